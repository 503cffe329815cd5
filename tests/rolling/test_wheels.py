"""Discs, casters, carts and cambered wheels, by closed forms; contacts by differences; what is refused, by name."""

import json
import pickle

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.elements.rolling import Rolling
from mbsvib.files import load, save, schema
from mbsvib.library import bicycle
from mbsvib.linalg.rotations import exponential
from mbsvib.rolling.contact import contact

G, ACROSS = 9.81, (0.0, 1.0, 0.0)


def ordered(values):
    """Eigenvalues that are not 0, in an order that rounding does not decide."""
    return np.array(sorted(values[values != 0.0], key=lambda z: (round(z.real, 6), z.imag)))


def disc(speed, across, about, mass=3.0, radius=0.4):
    """A wheel alone with moments of inertia across and about its axis."""
    model = mv.Model("disc", (0, 0, -G), travel=(speed, 0, 0))
    model.add_body("wheel", mass, (across, about, across), (0, 0, radius))
    model.add_rolling("roll", "wheel", radius, ACROSS)
    return model


@pytest.mark.parametrize(("across", "about", "critical"), [(0.25, 0.5, 1 / 3), (0.5, 1.0, 1 / 4)])
@pytest.mark.parametrize("share", [0.5, 2.0])
def test_a_disc_or_hoop_is_stable_above_its_critical_speed(across, about, critical, share):
    """(A + m r^2) s^2 = m g r - C (C + m r^2) W^2 / A; v^2 = g r / 3 of a disc, g r / 4 of a hoop."""
    m, r = 3.0, 0.4
    speed = np.sqrt(share * critical * G * r)
    system = disc(speed, across * m * r**2, about * m * r**2).linearize()
    a, c = across * m * r**2, about * m * r**2
    square = (m * G * r - c * (c + m * r**2) * (speed / r) ** 2 / a) / (a + m * r**2)
    values = system.poles()
    moving = values[values != 0.0]
    np.testing.assert_allclose(np.sort_complex(moving), np.sort_complex(np.array([1, -1]) * np.sqrt(square + 0j)),
                               rtol=1e-12, atol=1e-14)  # fmt: skip
    assert (square < 0.0) == (share > 1.0)
    # x, y, heading, wheel angle, speed, and the rate of yaw, which goes on with a lean that balances it
    assert len(values) - len(moving) == 6


def caster(speed, c=0.12, mass=0.0, inertia=0.02, stiffness=0.0, damping=0.0):
    """A wheel that trails a pivot, which the ground holds, or a spring and a damper across."""
    model = mv.Model("caster", travel=(speed, 0, 0))
    model.add_body("wheel", 1.5, (0.004, 0.008, 0.004), (-c, 0, 0.05))
    model.add_body("arm", 0.5, (0.5 * inertia, 0.5 * inertia, inertia - 0.004), (-c, 0, 0.05))
    model.add_joint("axle", "revolute", "arm", "wheel", (-c, 0, 0.05), axis=ACROSS)
    if mass:
        model.add_body("cart", mass, (1, 1, 1), (0, 0, 0.3))
        model.add_joint("slide", "prismatic", "ground", "cart", (0, 0, 0.3), axis=ACROSS)
        model.add_spring("k", "ground", "cart", (0, -1, 0.3), (0, 0, 0.3), stiffness, damping)
    model.add_joint("pivot", "revolute", "cart" if mass else "ground", "arm", (0, 0, 0.3), axis=(0, 0, 1))
    model.add_rolling("roll", "wheel", 0.05, ACROSS)
    model.add_output("angle", "arm", "rz")
    model.add_input("torque", "arm", "rz")
    return model


def test_a_towed_caster_follows_within_its_trail():
    """c p' + v p = 0: no speed is independent."""
    system = caster(2.0).linearize()
    values = system.poles()
    np.testing.assert_allclose(values[values != 0.0], -2.0 / 0.12, rtol=1e-13)
    assert not [name for name in system.states if name.startswith("d(")]
    t = np.linspace(0.0, 0.1, 5)
    start = np.zeros(len(system.states))
    start[system.states.index("pivot.rz")] = 0.3
    got, = system.time_response(t, np.zeros(5), initial=start)
    np.testing.assert_allclose(got, 0.3 * np.exp(-2.0 / 0.12 * t), rtol=1e-12)


def test_a_pushed_caster_turns_over():
    values = caster(-2.0).linearize().poles()
    np.testing.assert_allclose(values.real.max(), 2.0 / 0.12, rtol=1e-13)


def test_shimmy_of_a_caster_on_a_spring():
    """(I + c^2 m0) s^3 + (c m0 v + c^2 d) s^2 + (c^2 k + c d v) s + c k v = 0, with I about the wheel's centre."""
    c, m0, k, d, v, inertia = 0.12, 4.0, 900.0, 7.0, 1.3, 0.02
    system = caster(v, c, m0, inertia, k, d).linearize()
    exact = np.roots([inertia + c**2 * m0, c * m0 * v + c**2 * d, c**2 * k + c * d * v, c * k * v])
    values = system.poles()
    np.testing.assert_allclose(ordered(values), ordered(exact), rtol=1e-11)


def test_a_cart_whose_two_wheels_share_an_axle_swings_about_it():
    """Two wheels, one axle, a body below: a pendulum whose axle rolls, with (M + 2 (m + J/r^2)) moved along."""
    r, low, m, j, mass, inertia, half = 0.25, 0.1, 1.0, 0.03, 8.0, 0.2, 0.3
    model = mv.Model("cart", (0, 0, -G), travel=(1.5, 0, 0))
    model.add_body("body", mass, (0.3, inertia, 0.3), (0, 0, r - low))
    for side in (1, -1):
        name = "left" if side > 0 else "right"
        model.add_body(name, m, (0.02, j, 0.02), (0, side * half, r))
        model.add_joint(f"{name}_axle", "revolute", "body", name, (0, side * half, r), axis=ACROSS)
        model.add_rolling(f"{name}_roll", name, r, ACROSS)
    model.add_force_output("axle.y", "left_axle", "z")
    with pytest.raises(mv.ModelError, match=r"output 'axle.y': the wheels share their contact forces"):
        model.linearize()
    system = model.with_parts(outputs={}).linearize()
    # T = M/2 (x' - low p')^2 + I/2 p'^2 + (m + J/r^2) x'^2 (two wheels), V = M g low p^2 / 2
    cart = 2.0 * (m + j / r**2)
    total = mass + cart
    effective = inertia + mass * low**2 - (mass * low) ** 2 / total
    frequency = np.sqrt(mass * G * low / effective)
    values = system.poles()
    np.testing.assert_allclose(values[np.abs(values) > 0.0], [1j * frequency, -1j * frequency], rtol=0,
                               atol=1e-11 * frequency)  # fmt: skip
    assert sum(force[2] for force in system.contact_forces.values()) == pytest.approx((mass + 2.0 * m) * G)


@pytest.mark.parametrize("camber", [0.0, 0.25, -0.6])
def test_contacts_of_cambered_wheels_by_differences(camber):
    """The velocity of the contact point of a wheel that is turned and spins, against its first-order form."""
    wheel = Rolling("roll", "wheel", 0.3, (0.0, np.cos(camber), np.sin(camber)), (0.0, 0.0, 1.0))
    state = contact(wheel, (2.0, 0.0, 0.0))
    n, a = np.array(wheel.normal), np.array(wheel.axis)

    def arm(turn):
        axis = exponential(np.array(turn)) @ a
        p = n - (n @ axis) * axis
        return -wheel.radius * p / np.linalg.norm(p)

    def velocity(turn):
        return np.array([2.0, 0, 0]) + np.cross(state.spin * exponential(np.array(turn)) @ a, arm(turn))

    np.testing.assert_allclose(arm(np.zeros(3)), state.arm, rtol=1e-14, atol=1e-15)
    np.testing.assert_allclose(velocity(np.zeros(3)), 0.0, atol=1e-14)
    h = 1e-5
    for k, way in enumerate(np.eye(3)):
        for function, slope in ((arm, state.turned_arm), (velocity, state.slip)):
            found = (function(h * way) - function(-h * way)) / (2.0 * h)
            np.testing.assert_allclose(found, slope[:, k], rtol=0, atol=1e-8)
    np.testing.assert_allclose(state.directions[0] @ state.slip, 0.0, atol=1e-14)  # the plane is a plane


def test_models_out_of_balance_are_refused_by_name():
    model = bicycle().replace("frame", position=(0.3, 0.05, 0.9))
    with pytest.raises(mv.EquilibriumError, match="unbalanced"):
        model.linearize()


def test_preloads_of_a_suspension_hold_a_load_on_wheels():
    """A frame on a rear arm: the spring bears the moment of the contact's force about the pivot, less the weights'."""
    model = mv.Model("moped", (0, 0, -G), travel=(4.0, 0, 0))
    bodies = {"frame": (80.0, (0.6, 0, 0.5)), "arm": (5.0, (0.2, 0, 0.3)), "back": (7.0, (0, 0, 0.3)),
              "front": (6.0, (1.2, 0, 0.3))}  # fmt: skip
    for name, (mass, position) in bodies.items():
        model.add_body(name, mass, (0.25, 0.45, 0.25), position)
    model.add_joint("pivot", "revolute", "frame", "arm", (0.4, 0, 0.35), axis=ACROSS)
    model.add_torsion_spring("coil", "frame", "arm", ACROSS, stiffness=5000.0, damping=100.0)
    for name, holder, x in (("back", "arm", 0.0), ("front", "frame", 1.2)):
        model.add_joint(f"{name}.axle", "revolute", holder, name, (x, 0, 0.3), axis=ACROSS)
        model.add_rolling(f"{name}.tread", name, 0.3, ACROSS)
    with pytest.raises(mv.ModelError, match=r"rolling wheels .* model\.equilibrium\(preload=\.\.\.\)"):
        model.equilibrium()
    held = model.equilibrium(preload="coil")
    rear = G * sum(mass * (1.2 - x) for mass, (x, _, _) in bodies.values()) / 1.2
    assert held.springs["coil"].preload == pytest.approx(-0.4 * (rear - 7.0 * G) + 0.2 * 5.0 * G, rel=1e-12)
    np.testing.assert_allclose(held.linearize().contact_forces["back.tread"], (0, 0, rear), rtol=0, atol=1e-9)
    with pytest.raises(mv.EquilibriumError, match="no preload of 'coil' holds"):
        model.replace("frame", position=(0.6, 0.1, 0.5)).equilibrium(preload="coil")


@pytest.mark.parametrize(("call", "words"), [
    (lambda model: model.linearize(method="sparse"), "its equations are dense"),
    (lambda model: model.linearize(cut=["steer"]), "loops are cut as they are"),
    (lambda model: model.linearize(values={"frame.mass": [80, 90]}), "one by one"),
    (lambda model: model.compile(), "which only model.linearize"),
    (lambda model: model.equilibrium(), "which only model.linearize"),
    (lambda model: model.moved({"steer.rz": 0.1}), "which only model.linearize"),
    (lambda model: model.path("steer.rz", [0.0, 0.1]), "which only model.linearize"),
    (lambda model: model.cycle("steer.rz", [0.0, 0.1], speed=1.0), "which only model.linearize"),
    (lambda model: model.simulate([0.0, 1.0]), "which only model.linearize"),
    (lambda model: model.with_parts(travel=1), "no group 'travel'"),
])  # fmt: skip
def test_what_else_a_model_does_is_refused_by_name(call, words):
    with pytest.raises(mv.ModelError, match=words):
        call(bicycle())


@pytest.mark.parametrize(("changes", "words"), [
    ({"radius": 0.0}, "a positive radius"), ({"radius": "r"}, "the radius of the wheel"),
    ({"axis": (0, 0, 1)}, "would lie flat"), ({"axis": (0, 0, 0)}, "axis"), ({"body": "ground"}, "a body that rolls"),
    ({"body": "whel"}, "not a body"), ({"name": "wheel"}, "taken"),
])  # fmt: skip
def test_wheels_that_cannot_be_are_refused(changes, words):
    model = mv.Model("m")
    model.add_body("wheel", 1.0, (1, 1, 1))
    with pytest.raises(mv.ModelError, match=words):
        model.add_rolling(**{"name": "roll", "body": "wheel", "radius": 0.3, "axis": ACROSS} | changes)


def test_wheels_that_would_slip_or_spin_otherwise_are_refused():
    model = disc(2.0, 0.1, 0.2)
    model.travel = (2.0, 0.1, 0.0)
    with pytest.raises(mv.ModelError, match=r"rolling wheel 'roll': travel = .* rolls along"):
        model.linearize()
    model = disc(2.0, 0.1, 0.2)
    model.add_rotor("spin", "wheel", 3.0, ACROSS)
    with pytest.raises(mv.ModelError, match="leave the rotor out"):
        model.linearize()
    model = disc(2.0, 0.1, 0.2).replace("wheel", inertia=(0.1, 0.2, 0.15))
    with pytest.raises(mv.ModelError, match="rotor 'roll': body 'wheel' spins, and its inertia is not symmetric"):
        model.linearize()
    model = bicycle()
    model.add_force_output("sum", "frame", "z")
    with pytest.raises(mv.ModelError, match="output 'sum' is the sum of the forces on 'frame'"):
        model.linearize()


def test_a_cart_on_three_parallel_wheels_rolls_straight_on():
    """All directions are locked but one; conditions and contact forces are redundant."""
    model = mv.Model("sledge", (0, 0, -G), travel=(1.0, 0, 0))
    model.add_body("body", 5.0, (1, 1, 1), (0, 0, 0.3))
    for name, x, y in (("a", 0.5, 0.2), ("b", -0.5, -0.2), ("c", -0.5, 0.3)):
        model.add_body(name, 0.5, (0.01, 0.02, 0.01), (x, y, 0.2))
        model.add_joint(f"{name}_axle", "revolute", "body", name, (x, y, 0.2), axis=ACROSS)
        model.add_rolling(f"{name}_roll", name, 0.2, ACROSS)
    values = model.linearize().poles()
    assert (values == 0.0).all()


def test_files_keep_wheels_and_travel(tmp_path):
    import jsonschema

    model = bicycle(speed=3.3)
    for suffix in ("yaml", "json"):
        path = save(model, tmp_path / f"model.{suffix}")
        back = load(path)
        assert back.travel == model.travel
        assert dict(back.rolling) == dict(model.rolling)
        np.testing.assert_array_equal(back.linearize().A, model.linearize().A)
    jsonschema.Draft202012Validator(schema()).validate(json.loads(path.read_text("utf-8")))


def test_parameters_are_speed_and_radius():
    model = bicycle()
    assert model.parameters["travel.x"] == 5.0
    assert model.parameters.units["travel.x"] == "m/s"
    varied = model.with_values({"travel.x": 4.0, "front.radius": 0.36})
    assert varied.travel == (4.0, 0.0, 0.0)
    assert varied.rolling["front"].radius == 0.36
    assert model.travel == (5.0, 0.0, 0.0)
    with pytest.raises(mv.ModelError, match="a positive radius"):
        model.with_values({"front.radius": -1.0})


@pytest.mark.slow
def test_what_systems_cannot_do_they_refuse():
    system = bicycle().linearize()
    with pytest.raises(AttributeError, match="first-order equations"):
        _ = system.K
    with pytest.raises(mv.ModelError, match="derivatives of its shapes"):
        _ = system.mode_sensitivities("travel.x").shapes
    with pytest.raises(mv.ModelError, match="derivatives are those of"):
        system.reduced(order=8).mode_sensitivities("travel.x")
    assert "Hz per m/s" in str(system.mode_sensitivities("travel.x"))
    assert pickle.loads(pickle.dumps(system)).poles().tolist() == system.poles().tolist()


def test_sweeps_take_speeds_one_by_one():
    result = mv.sweep(bicycle(), {"travel.x": [1.0, 5.0]}, lambda system: system.poles().real.max())
    np.testing.assert_allclose(result["value"], (3.526961709900694, 0.0), rtol=1e-11)


def test_wheels_whose_any_deviation_makes_one_slip_are_refused():
    """One of two wheels on an axle turns about a king pin above its contact: the fixed one lets it not."""
    model = mv.Model("pin", travel=(1.0, 0, 0))
    model.add_body("body", 5.0, (1, 1, 1), (0, 0, 0.3))
    model.add_body("fork", 0.5, (0.01, 0.01, 0.01), (0, -0.3, 0.3))
    model.add_joint("pin", "revolute", "body", "fork", (0, -0.3, 0.3), axis=(0, 0, 1))
    for name, carrier, y in (("fixed", "body", 0.3), ("steered", "fork", -0.3)):
        model.add_body(name, 0.5, (0.01, 0.02, 0.01), (0, y, 0.2))
        model.add_joint(f"{name}_axle", "revolute", carrier, name, (0, y, 0.2), axis=ACROSS)
        model.add_rolling(f"{name}_roll", name, 0.2, ACROSS)
    with pytest.raises(mv.SingularPoseError, match="any deviation would make one slip"):
        model.linearize()


def test_copies_of_models_roll_too():
    model = mv.Model("two", (0, 0, -G), travel=(5.0, 0, 0))
    model.add_model("a", bicycle(), position=(0, 1, 0))
    model.add_model("b", bicycle(), position=(0, -1, 0), mirror="y")
    values = model.linearize().poles()
    alone = bicycle().linearize().poles()
    np.testing.assert_allclose(ordered(values), ordered(np.repeat(alone, 2)), rtol=1e-9)
    with pytest.warns(mv.errors.LeftOutWarning, match="travel"):
        model.add_model("c", bicycle(speed=3.0))
    with pytest.raises(mv.ModelError, match=r"rolling wheel 'd.rear': its plane would be part of body 'a.frame'"):
        model.add_model("d", bicycle(), ground="a.frame")


def test_motions_as_inputs_are_refused():
    model = caster(1.0, mass=4.0, stiffness=900.0)
    model.add_motion_input("road", "k")
    with pytest.raises(mv.ModelError, match="input 'road': motions as inputs beside rolling wheels"):
        model.linearize()
