"""Actuators in prismatic joints and bushings, and actuators and sensors of the user's own."""

import control
import numpy as np
import pytest

import mbsvib as mv
from mbsvib import isolation, library
from tests.isolation.scenes import MASS, active_strut, two_masses

W = np.geomspace(5.0, 1.9e3, 25)


def bushed(order=("ground", "payload"), turn=False):
    """A payload on a bushing whose local x is world z, guided along z."""
    model = mv.Model("bushed")
    model.add_body("payload", MASS, (0.2, 0.2, 0.2), (0, 0, 0.3))
    model.add_joint("guide", "prismatic", *reversed(order) if turn else order, axis=(0, 0, 1))
    axes = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    model.add_bushing("mount", *order, (0, 0, 0.1), (9e4, 5e4, 5e4, 0, 0, 0), (20, 0, 0, 0, 0, 0), orientation=axes)
    return model


@pytest.mark.parametrize(("model", "leg", "k", "c"), [
    (active_strut(), "leg", 9e4, 0.0),
    (active_strut(), "guide", 1.2e5, 0.0),
    (active_strut(turned=True), "guide", 1.2e5, 0.0),
    (bushed(), "mount.x", 9e4, 20.0),
    (bushed(order=("payload", "ground")), "mount.x", 9e4, 20.0),
    (bushed(), "guide", 9e4, 20.0),
    (bushed(turn=True), "guide", 9e4, 20.0),
])  # fmt: skip
def test_a_strut_in_closed_form(model, leg, k, c):
    """m z'' + (k + beside) z = +-u; tension = k stroke - u, whichever way the leg points."""
    plant = isolation.actuated(model, "payload", leg, directions="z")
    beside = 1.2e5 - k if leg == "leg" else 0.0
    s = 1j * W
    way = 1.0 / (MASS * s**2 + c * s + k + beside)
    g = {name: plant.system.frequency_response(W, f"{leg}.{name}", f"{leg}.actuator")[0, 0]
         for name in ("stroke", "rate", "force", "acceleration")}  # fmt: skip
    np.testing.assert_allclose(g["stroke"], way, rtol=1e-11)
    np.testing.assert_allclose(g["rate"], s * way, rtol=1e-11)
    np.testing.assert_allclose(g["acceleration"], s**2 * way, rtol=1e-11)
    np.testing.assert_allclose(g["force"], (k + c * s) * way - 1.0, rtol=1e-9)
    loop = plant.with_gains(isolation.force_feedback(plant, 30.0))
    exact = np.roots([MASS, c + 30.0 * MASS, k + beside, 30.0 * beside])
    for value in exact[np.abs(exact) > 0.0]:
        assert np.abs(loop.poles() - value).min() < 1e-9 * abs(value)


def test_torsion_springs_have_no_stroke():
    """A torsion spring acts as the rotational stiffness of a bushing; it is no leg, and adds no force to a slide."""
    plants = []
    for torsion in (True, False):
        model = mv.Model("twisted")
        model.add_body("payload", MASS, (0.2, 0.2, 0.2), (0, 0, 0.3))
        model.add_joint("guide", "cylindrical", "ground", "payload", (0, 0, 0.1), axis=(0, 0, 1))
        model.add_bushing("mount", "ground", "payload", (0, 0, 0.1), (0, 0, 9e4, 0, 0, 0 if torsion else 40.0))
        if torsion:
            model.add_torsion_spring("twist", "ground", "payload", (0, 0, 1), 40.0)
        study = isolation.study(model, "payload", frequencies=W / 6.0)
        assert [leg.name for leg in study.scene.legs] == ["mount.z"]
        plants.append((study.scene.system, isolation.actuated(model, "payload", "guide").system))
    for twisted, plain in zip(*plants, strict=True):
        a, b = (system.frequency_response(W) for system in (twisted, plain))
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-15 * np.abs(b).max())


@pytest.mark.slow
def test_legs_of_a_platform_by_their_joints():
    """The springs of the platform act along its slides: an actuator beside the one is one in the other."""
    model = library.stewart()
    springs, slides = (isolation.actuated(model, "platform", legs) for legs in ("leg*.k", "leg*.slide"))
    assert slides.legs == tuple(f"leg{i}.slide" for i in range(1, 7))
    w = np.geomspace(100.0, 3e4, 9)
    for port in ("force", "stroke", "rate", "acceleration"):
        one, other = (plant.system.frequency_response(w, plant.names(port), plant.names("actuator"))
                      for plant in (springs, slides))  # fmt: skip
        np.testing.assert_allclose(other, one, rtol=1e-9, atol=1e-9 * np.abs(one).max(axis=(0, 1)).min())
    laws = [isolation.force_feedback(plant, 400.0) for plant in (springs, slides)]
    one, other = (plant.with_gains(law) for plant, law in zip((springs, slides), laws, strict=True))
    np.testing.assert_allclose(np.sort_complex(one.vibrating), np.sort_complex(other.vibrating), rtol=1e-9)
    assert one.isolation().amplification == pytest.approx(other.isolation().amplification, rel=1e-6)


def test_springs_beside_a_joint_add_up():
    """One line spring against the joint's direction and a bushing that is turned: tensions are summed with signs."""
    model = bushed(turn=True)
    model.add_spring("against", "payload", "ground", (0.1, 0, 0.2), (0.1, 0, 0), 3e4)
    plant = isolation.actuated(model, "payload", "guide", directions="z")
    assert "guide.force" in plant.system.outputs
    assert not [name for name in plant.system.outputs if name.startswith("guide.force.")]
    s = 1j * W
    way = 1.0 / (MASS * s**2 + 20.0 * s + 1.2e5)
    found = plant.system.frequency_response(W, "guide.force", "guide.actuator")[0, 0]
    np.testing.assert_allclose(found, (1.2e5 + 20.0 * s) * way - 1.0, rtol=1e-9)


@pytest.mark.parametrize("kind", ["spring", "bushing"])
def test_acceleration_counts_outward_from_the_other_body(kind):
    """A leg between two masses by its joint, described from either end; the spring beside it connects no bodies."""
    found = {}
    for order in (("lower", "payload"), ("payload", "lower")):
        model = mv.Model("stages")
        for name, mass, z in (("lower", 3.0, 0.2), ("payload", MASS, 0.6)):
            model.add_body(name, mass, (0.2, 0.2, 0.2), (0, 0, z))
        model.add_joint("rail", "prismatic", "ground", "lower", axis=(0, 0, 1))
        model.add_joint("guide", "prismatic", *order, axis=(0, 0, 1))
        model.add_spring("k1", "ground", "lower", (0, 0, 0), (0, 0, 0.2), 5e4)
        if kind == "spring":
            model.add_spring("k2", *order, *((0, 0, 0.2), (0, 0, 0.6))[:: 1 if order[0] == "lower" else -1], 9e4)
        else:
            model.add_bushing("k2", *order, (0, 0, 0.4), (0, 0, 9e4, 0, 0, 0))
        plant = isolation.actuated(model, "payload", "guide", directions="z")
        found[order[0]] = plant.system.frequency_response(W, "guide.acceleration", "guide.actuator")[0, 0]
    x = [np.linalg.solve([[5e4 + 9e4 - 3.0 * w**2, -9e4], [-9e4, 9e4 - MASS * w**2]], [-1.0, 1.0])[1] for w in W]
    np.testing.assert_allclose(found["lower"], -(W**2) * x, rtol=1e-9)
    np.testing.assert_allclose(found["payload"], -(W**2) * x, rtol=1e-9)


def own_ports():
    model = active_strut()
    model.add_input("coil", "payload", "z")
    model.add_output("geophone", "payload", "z", quantity="velocity")
    model.add_force_output("load cell", "leg")
    return model


@pytest.mark.parametrize("legs", [None, []])
def test_own_actuators_and_sensors_are_kept(legs):
    model = own_ports()
    plant = isolation.actuated(model, "payload", legs, directions="z")
    assert plant.system.inputs[0] == "coil"
    assert plant.system.outputs[:2] == ("geophone", "load cell")
    gain = 300.0
    loop = plant.feedback([[-gain]], "geophone", "coil", name="sky")
    exact = np.roots([MASS, gain, 1.2e5])
    assert max(np.abs(loop.poles() - value).min() for value in exact) < 1e-9 * np.abs(exact).max()
    assert loop.isolation(W / 6.0).index[0] > 0.0
    assert loop.sampled(5e3).stable
    assert (model.inputs.keys(), model.outputs.keys()) == ({"coil"}, {"geophone", "load cell"})


def test_state_spaces_go_into_with_gains():
    plant = isolation.actuated(own_ports(), "payload", "leg", directions="z")
    law = control.ss([[-1.0]], [[1.0]], [[-3e3]], [[0.0]], inputs=["leg:rate"], outputs=["leg:actuator"])
    ours = isolation.controller(law, ["leg.rate"], ["leg.actuator"])
    sky = mv.StateSpace.from_arrays(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), [[-50.0]],
                                    inputs=["geophone"], outputs=["coil"])  # fmt: skip
    np.testing.assert_allclose(plant.with_gains(law, sky).poles(), plant.with_gains(ours, sky).poles(), rtol=1e-13)


def test_own_ports_above_another_base():
    model = two_masses()
    model.add_input("coil", "payload", "z", relative_to="stage")
    model.add_output("gap", "payload", "z", relative_to="stage")
    plant = isolation.actuated(model, "payload", "upper", base="stage", directions="z")
    assert plant.system.frequency_response([0.0], "gap", "coil")[0, 0, 0] == pytest.approx(1e-4, rel=1e-12)
    model.add_force_output("below", "lower")
    with pytest.raises(mv.ModelError, match=r"base = 'stage'.*'below' .* cannot be kept"):
        isolation.actuated(model, "payload", "upper", base="stage", directions="z")


def taken():
    model = own_ports()
    model.add_input("load.z", "payload", "z")
    return model


REFUSALS = [
    (lambda: isolation.actuated(bushed(), "payload", "mount"), r"'mount' is a bushing.*mount\.x, mount\.y, mount\.z"),
    (lambda: isolation.actuated(bushed(), "payload", "mount.w"), r"leg 'mount\.w' is not .*It has guide, mount\.x"),
    (lambda: isolation.actuated(bushed(), "payload", []), "no line spring beside which"),
    (lambda: isolation.actuated(bushed(), "payload", "b*"), r"leg 'b\*' is not a line spring"),
    (lambda: isolation.actuated(taken(), "payload"), r"input 'load\.z'"),
]  # fmt: skip


@pytest.mark.parametrize(("ask", "message"), REFUSALS, ids=[message for _, message in REFUSALS])
def test_refusals(ask, message):
    with pytest.raises(mv.ModelError, match=message):
        ask()


def test_laws_in_legs_need_legs():
    """A controller without sensors and actuators would damp nothing and say nothing."""
    plant = isolation.actuated(library.stewart_isolator(), "platform", [])
    with pytest.raises(mv.ResponseError, match=r"force_feedback: the plant has no legs .* by plant\.feedback"):
        isolation.force_feedback(plant, 10.0)
