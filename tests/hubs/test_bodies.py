"""Bodies on hubs against Euler's equations, closed forms and Lagrange's equations of finite motion."""

import mpmath
import numpy as np
import pytest

import mbsvib as mv
from mbsvib.campbell import campbell
from mbsvib.equilibrium.path import with_share

SPEED = 7.3


def rates(system):
    """Absolute eigenvalues with positive imaginary parts, ascending [rad/s]."""
    values = np.array(system.modes().eigenvalues)
    return np.sort(values.imag[values.imag > 1e-9])


def pendulum(plane, speed=SPEED, radius=0.4, length=0.9, mass=2.0, inertia=(0.3, 0.3, 0.3)):
    """A pendulum on a hub of some radius that stands out radially: axis of its hinge ``plane``."""
    model = mv.Model("pendulum")
    model.add_hub("hub", speed, (0, 0, 1))
    model.add_body("bob", mass, inertia, (radius + length, 0, 0))
    model.add_joint("hinge", "revolute", "hub", "bob", (radius, 0, 0), axis=plane)
    return model


@pytest.mark.parametrize("inertia", [(0.0, 0.0, 0.0), (0.02, 0.3, 0.31)])
def test_rotating_pendulum_flaps_and_lags(inertia):
    """(m l^2 + J) w^2 = W^2 m l (R + l) + (Jz - Jx) W^2 across, W^2 m l R in the plane."""
    r, length, mass = 0.4, 0.9, 2.0
    flap = mass * length * (r + length) + inertia[2] - inertia[0]
    expected = SPEED * np.sqrt(flap / (mass * length**2 + inertia[1]))
    assert rates(pendulum((0, 1, 0), inertia=inertia).linearize()) == pytest.approx([expected], rel=1e-13)
    expected = SPEED * np.sqrt(mass * length * r / (mass * length**2 + inertia[2]))
    assert rates(pendulum((0, 0, 1), inertia=inertia).linearize()) == pytest.approx([expected], rel=1e-13)


@pytest.mark.parametrize("method", ["dense", "sparse"])
def test_spinning_free_body_follows_euler(method):
    """Modes of a free body in its own frame: W sqrt((Jz - Jx)(Jz - Jy) / Jx Jy), and W twice of its centre."""
    a, b, c = 2.0, 3.0, 4.5
    model = mv.Model("body")
    model.add_hub("hub", SPEED, (0, 0, 2))
    model.add_body("body", 5.0, (a, b, c))
    model.add_joint("free", "free", "hub", "body", (0, 0, 0))
    system = model.linearize(method=method)
    if method == "sparse":
        other = model.linearize(method="dense")
        model.add_input("T", "body", "rx")
        model.add_output("r", "body", "ry")
        one, two = (model.linearize(method=m).frequency_response([3.0, 11.0]) for m in ("dense", "sparse"))
        np.testing.assert_allclose(one, two, rtol=1e-11)
        assert other.dof == 6
        return
    mpmath.mp.dps = 30
    wobble = SPEED * float(mpmath.sqrt(mpmath.mpf(c - a) * (c - b) / (a * b)))
    np.testing.assert_allclose(rates(system), np.sort([wobble, SPEED, SPEED, SPEED]), rtol=2e-7)


def finite(tensor, mass, centre, w):
    """Mass, gyroscopic and stiffness matrices of a free body by differences of its energy, in 40 digits.

    L = 1/2 m |v + W x r|^2 + 1/2 (w + R^T W) . J (w + R^T W), coordinates: centre and rotation vector.
    """
    mpmath.mp.dps = 40
    skew = lambda v: mpmath.matrix([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])  # noqa: E731
    spin, j = mpmath.matrix([mpmath.mpf(x) for x in w]), mpmath.matrix(tensor.tolist())

    def lagrangian(q, qd):
        r = mpmath.matrix([centre[i] + q[i] for i in range(3)])
        v = mpmath.matrix(qd[:3]) + skew(spin) * r
        theta = mpmath.matrix(q[3:])
        angle = mpmath.sqrt(sum(x * x for x in theta))
        x = skew(theta)
        if angle == 0:
            one, two, three = mpmath.mpf(1), mpmath.mpf(1) / 2, mpmath.mpf(1) / 6
        else:
            one, two = mpmath.sin(angle) / angle, (1 - mpmath.cos(angle)) / angle**2
            three = (angle - mpmath.sin(angle)) / angle**3
        rotation = mpmath.eye(3) + one * x + two * x * x
        rate = (mpmath.eye(3) + two * x + three * x * x) * mpmath.matrix(qd[3:])
        omega = rotation.T * (rate + spin)
        return mass * (v.T * v)[0] / 2 + (omega.T * j * omega)[0] / 2

    h = mpmath.mpf(10) ** -10
    unit = [[h * (i == k) for i in range(6)] for k in range(6)]
    zero = [mpmath.mpf(0)] * 6

    def mixed(one, two):
        add = lambda a, b, s: [x + s * y for x, y in zip(a, b, strict=True)]  # noqa: E731
        total = mpmath.mpf(0)
        for s in (1, -1):
            for t in (1, -1):
                state = [add(add(zero, one[k], s), two[k], t) for k in (0, 1)]
                total += s * t * lagrangian(*state)
        return total / (4 * h * h)

    gyro, stiff = np.zeros((6, 6)), np.zeros((6, 6))
    for i in range(6):
        for k in range(6):
            gyro[i, k] = mixed((zero, unit[i]), (unit[k], zero)) - mixed((unit[i], zero), (zero, unit[k]))
            stiff[i, k] = -mixed((unit[i], zero), (unit[k], zero))
    gradient = [(lagrangian(unit[i], zero) - lagrangian([-x for x in unit[i]], zero)) / (2 * h) for i in range(6)]
    return gyro, stiff, np.array([float(x) for x in gradient])


@pytest.mark.slow
@pytest.mark.parametrize("axis", [(0, 0, 1), (1, 2, -0.5)])
def test_any_body_follows_lagrange(axis):
    """A body with products of inertia off the axis, held at rest by a bushing: G and K of its Lagrangian."""
    tensor = np.array([[2.0, 0.3, -0.2], [0.3, 3.0, 0.4], [-0.2, 0.4, 2.5]])
    centre, mass = np.array([0.5, -0.2, 0.7]), 4.0
    w = SPEED * np.array(axis) / np.linalg.norm(axis)
    gyro, stiff, force = finite(tensor, mass, centre, w)
    model = mv.Model("body")
    model.add_hub("hub", SPEED, axis)
    model.add_body("body", mass, tensor, centre)
    model.add_joint("free", "free", "hub", "body", centre)
    model.add_load("hold", "body", -force[:3], -force[3:], follower=True)
    system = model.linearize()
    size = np.abs(stiff).max()  # what holds the body, a follower load, adds to the other blocks and antisymmetric parts
    np.testing.assert_allclose(system.C, gyro, rtol=0, atol=1e-12 * np.abs(gyro).max())
    difference = np.array(system.K) - stiff
    np.testing.assert_allclose(difference[:3, :3], 0.0, rtol=0, atol=1e-12 * size)
    np.testing.assert_allclose(0.5 * (difference + difference.T)[3:, 3:], 0.0, rtol=0, atol=1e-12 * size)


def test_dumbbell_swings_out_to_its_balance():
    """Two masses on a governor's arms: W^2 (r + l sin a) cos a = g sin a; found from a pose nearby."""
    g, r, length = 9.81, 0.1, 0.5
    model = mv.Model("governor", gravity=(0, 0, -g))
    model.add_hub("hub", 8.0, (0, 0, 1))
    angle = float(mpmath.findroot(lambda a: 64 * (r + length * mpmath.sin(a)) * mpmath.cos(a) - g * mpmath.sin(a), 1.0))
    first = angle - 0.1
    for side, sign in (("left", -1.0), ("right", 1.0)):
        model.add_body(side, 1.5, (0, 0, 0), (sign * (r + length * np.sin(first)), 0, -length * np.cos(first)))
        model.add_joint(f"{side}_hinge", "revolute", "hub", side, (sign * r, 0, 0), axis=(0, 1, 0))
    with pytest.raises(mv.EquilibriumError):
        model.linearize()
    there = model.equilibrium(snap=True)
    assert there.bodies["right"].position[0] == pytest.approx(r + length * np.sin(angle), rel=1e-9)
    second = g * np.cos(angle) + 64 * (r * np.sin(angle) - length * np.cos(2 * angle))
    np.testing.assert_allclose(rates(there.linearize()), np.sqrt(second / length), rtol=1e-8)


@pytest.mark.parametrize("share", [1.0, 0.25, 0.0])
def test_a_share_of_the_load_is_one_of_the_centrifugal_force(share):
    """k (x - r) = share m W^2 x of a mass on a radial slide."""
    model = mv.Model("slide")
    model.add_hub("hub", SPEED, (0, 0, 1))
    model.add_body("mass", 2.0, (0.1, 0.1, 0.1), (0.5, 0, 0))
    model.add_joint("rail", "prismatic", "hub", "mass", (0.5, 0, 0), axis=(1, 0, 0))
    model.add_spring("spring", "hub", "mass", (0.1, 0, 0), (0.5, 0, 0), 1000.0)
    there = with_share(model, share).equilibrium()
    assert there.bodies["mass"].position[0] == pytest.approx(500.0 / (1000.0 - share * 2.0 * SPEED**2), rel=1e-12)


def test_rotor_on_a_turning_body():
    """A wheel on a plate that turns about another axis: torque W x h, held, and its stiffness W h about the hinge."""
    h, mass = 3.0, 2.0
    model = pendulum((0, 1, 0), inertia=(0.1, 0.1, 0.1), mass=mass)
    model.add_rotor("wheel", "bob", h / 0.05, (0, 0, 1), 0.05)
    expected = SPEED**2 * mass * 0.9 * 1.3 + SPEED * h
    assert rates(model.linearize()) == pytest.approx([np.sqrt(expected / (mass * 0.81 + 0.1))], rel=1e-12)


@pytest.mark.parametrize("method", ["dense", "sparse"])
@pytest.mark.parametrize(("speed", "stable"), [(200.0, True), (300.0, False), (500.0, True)])
def test_an_unsymmetric_shaft_is_unstable_between_its_critical_speeds(speed, stable, method):
    """(k1 - m W^2 + m s^2) (k2 - m W^2 + m s^2) + 4 m^2 W^2 s^2 = 0, with critical speeds 258 and 408 rad/s."""
    m, k1, k2 = 3.0, 2e5, 5e5
    model = mv.Model("shaft")
    model.add_hub("hub", speed, (0, 0, 1))
    model.add_body("disk", m, (0.02, 0.02, 0.03))
    model.add_bushing("shaft", "hub", "disk", (0, 0, 0), (k1, k2, 1e6, 1e5, 2e5, 3e5))
    a, b = k1 - m * speed**2, k2 - m * speed**2
    expected = np.roots([m * m, 0.0, m * (a + b) + 4.0 * m * m * speed**2, 0.0, a * b])
    modes = model.linearize(method=method).modes(*(6,) * (method == "sparse"))
    found = np.asarray(modes.eigenvalues)
    assert np.abs(found[:, None] - expected).min(axis=0).max() < 1e-12 * np.abs(expected).max()
    assert (found.real.max() < 1.0) == stable


def test_speed_zero_adds_nothing():
    model = pendulum((0, 1, 0), speed=0.0)
    assert not np.array(model.linearize().K).any()


@pytest.mark.slow
def test_batches_and_derivatives_to_all_parameters():
    model = pendulum((0, 1, 0), inertia=(0.02, 0.3, 0.31))
    model.add_bushing("k", "hub", "bob", (0.4, 0, 0), (0, 0, 0, 0, 50.0, 0))
    batch = model.linearize(values={"hub.speed": [0.0, 2.0, 9.0], "bob.mass": [1.0, 2.0, 3.0]})
    for i, (w, m) in enumerate(((0.0, 1.0), (2.0, 2.0), (9.0, 3.0))):
        single = model.with_values({"hub.speed": w, "bob.mass": m}).linearize()
        np.testing.assert_allclose(batch.K[i], single.K, rtol=1e-13)
    table = model.linearize().mode_sensitivities(["hub.speed", "bob.mass", "bob.position.x", "bob.inertia.zz"])
    for name, step in (("hub.speed", 1e-3), ("bob.mass", 1e-3), ("bob.inertia.zz", 1e-4)):
        up, down = (rates(model.with_values({name: model.parameters[name] + s}).linearize())[0] for s in (step, -step))
        slope = (up - down) / (2 * step) / (2 * np.pi)
        assert table.frequencies[table.variables.index(name)][0] == pytest.approx(slope, rel=1e-6)


def test_what_varies_with_time_is_refused_by_name():
    model = pendulum((0, 1, 0))
    for change, words in (
        (lambda m: m.add_spring("post", "ground", "bob", (2, 0, 0), (1.3, 0, 0), 10.0), "'post' acts between"),
        (lambda m: m.add_spring("post", "bob", "ground", (1.3, 0, 0), (2, 0, 0), 10.0), "'post' acts between"),
        (lambda m: m.add_joint("pin", "free", "ground", "bob", (0, 0, 0)), "'pin' joins"),
        (lambda m: m.add_joint("pin", "free", "bob", "ground", (0, 0, 0)), "'pin' joins"),
        (lambda m: m.add_load("push", "bob", (1, 0, 0)), "'push' keeps its direction"),
        (lambda m: m.add_load("twist", "hub", torque=(1, 0, 1)), "'twist' keeps its direction"),
        (lambda m: setattr(m, "gravity", (0, -9.81, 0)), "'gravity' does not act along the axis"),
        (lambda m: m.add_base_motion("floor", "x"), "'floor' moves the ground"),
        (lambda m: m.add_rotor("spin", "bob", 3.0, (0, 0, 1)), "'spin' spins as a whole body"),
        (lambda m: (m.add_hub("other", 1.0, (0, 0, 1)),
                    m.add_spring("tie", "other", "bob", (2, 0, 0), (1.3, 0, 0), 10.0)), "'other' is on hub 'other'"),
    ):  # fmt: skip
        changed = mv.Model("changed", gravity=model.gravity).with_parts(**model.groups())
        change(changed)
        with pytest.raises(mv.ModelError, match=words):
            changed.linearize()
    along = mv.Model("along", gravity=(0, 0, 3.0)).with_parts(**model.groups())
    along.add_load("lift", "bob", (0, 0, -6.0), torque=(0, 0, 2.0))
    along.add_load("turn", "bob", torque=(0, 0, -2.0), follower=True)
    along.add_spring("on the hub", "hub", "bob", (2, 0, 0), (1.3, 0, 0), 10.0)
    assert along.linearize().dof == 1


def test_moved_takes_joints_on_hubs_along():
    model = pendulum((0, 1, 0))
    there = model.moved({"hinge.rz": 0.3})
    expected = (0.4 + 0.9 * np.cos(0.3), 0.0, -0.9 * np.sin(0.3))
    np.testing.assert_allclose(there.bodies["bob"].position, expected, atol=1e-15)
    assert there.bodies["hub"] == model.bodies["hub"]
    with pytest.raises(mv.EquilibriumError, match="bob"):
        there.linearize()


def test_preloads_on_a_hub_are_all_that_equilibrium_adds():
    model = pendulum((0, 1, 0))
    model.add_spring("stay", "hub", "bob", (0, 0, 0.5), (1.3, 0, 0), 800.0, free_length=1.0)
    model.add_spring("other", "hub", "bob", (0, 0, -0.5), (1.3, 0, 0), 800.0)
    held = model.equilibrium(preload="other")
    assert list(held.joints) == ["hinge"]
    assert held.springs["other"].preload == pytest.approx(800.0 * (np.hypot(1.3, 0.5) - 1.0), rel=1e-12)


def test_a_path_of_a_slider_on_a_hub():
    """The force that holds it: (k - m W^2) z from where the spring balances the centrifugal force."""
    k, mass, radius = 200.0, 2.0, 0.5
    model = mv.Model("slider")
    model.add_hub("hub", SPEED, (0, 0, 1))
    model.add_body("slider", mass, (0.1, 0.1, 0.1), (radius, 0, 0))
    model.add_joint("rail", "prismatic", "hub", "slider", axis=(1, 0, 0))
    model.add_spring("spring", "hub", "slider", (0.1, 0, 0), (radius, 0, 0), k, preload=mass * SPEED**2 * radius)
    path = model.path("rail.z", [0.05, 0.1, -0.2])
    np.testing.assert_allclose(path.forces, (k - mass * SPEED**2) * path.values, rtol=1e-12)
    assert [*path.models[0].joints] == ["rail"]


def test_campbell_data_of_hubs_name_the_sweep():
    """The sweep that is named is the diagram: w^2 = W^2 (Jz - Jx + m l r) / (Jy + m l^2), r from the axis, l from the
    hinge to the centre of mass.
    """
    model = mv.Model("blade")
    model.add_hub("hub", speed=30.0, axis=(0, 0, 1))
    model.add_body("blade", 1.0, (0.01, 0.02, 0.03), (0.5, 0, 0))
    model.add_joint("flap", "revolute", "hub", "blade", (0.1, 0, 0), axis=(0, 1, 0))
    with pytest.raises(mv.ModelError, match=r"no rotor; its hub turns.*'hub.speed'.*'modes.frequencies'"):
        campbell(model, [10.0, 20.0])
    speeds = np.array([10.0, 20.0, 40.0])
    sweep = mv.sweep(model, {"hub.speed": speeds}, "modes.frequencies")["modes.frequencies"]
    share = np.sqrt((0.03 - 0.01 + 0.4 * 0.5) / (0.02 + 0.4**2))
    np.testing.assert_allclose(np.ravel(sweep) * 2.0 * np.pi, speeds * share, rtol=1e-9)


def test_cycles_are_refused_by_name():
    pytest.importorskip("casadi")
    with pytest.raises(mv.ModelError, match="hub 'hub'"):
        pendulum((0, 1, 0)).cycle("hinge.rz", np.linspace(0.0, 6.0, 8), speed=3.0)


def test_hubs_along_z_and_at_rest_are_read_as_they_were_saved(tmp_path):
    """Axis and speed are words that a file must have, whatever their values."""
    model = mv.Model("rotor")
    model.add_hub("hub", 0.0, (0, 0, 1))
    model.add_body("blade", 1.0, (0.1, 0.2, 0.25), position=(0.6, 0, 0))
    model.add_joint("flap", "revolute", "hub", "blade", position=(0.1, 0, 0), axis=(0, 1, 0))
    assert mv.load(mv.save(model, tmp_path / "rotor.yaml")).hubs == model.hubs
