"""Batches of models with spin, follower loads and massless motions: each variant as it is by itself."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import mbsvib as mv
from tests.massless.scenes import along_z

OMEGA = np.array([0.1, 0.3, 2.0, 40.0])
MATRICES = ("M", "C", "K", "B", "Cq", "Cv", "Ca", "D")


def isolator(stiffness=3.0, damping=5.0, static=2.0, mass=7.0):
    """A mass on a relaxation isolator."""
    model = mv.Model("isolator")
    model.add_body("m", mass, (1, 1, 1), position=(0, 0, 1))
    model.add_joint("rail", "prismatic", "ground", "m")
    model.add_maxwell("leg", "ground", "m", (0, 0, 0), (0, 0, 1), stiffness=stiffness, damping=damping,
                      static_stiffness=static)  # fmt: skip
    model.add_force_output("f", "leg")
    return with_ports(model, "m", "z")


def gyroscope(speed=30.0):
    """A disk in a gimbal with springs and a damper about x and y."""
    model = mv.Model("gyroscope")
    model.add_body("disk", 1.0, (0.1, 0.1, 0.2))
    model.add_joint("gimbal", "universal", "ground", "disk", (0, 0, 0), axis=(1, 0, 0), axis2=(0, 1, 0))
    model.add_bushing("k", "ground", "disk", (0, 0, 0), (0, 0, 0, 40.0, 90.0, 0), (0, 0, 0, 0.1, 0.0, 0))
    model.add_rotor("spin", "disk", speed, (0, 0, 1), inertia=0.05)
    return with_ports(model, "disk", "rx")


def follower():
    """Two rods in line on sprung hinges, pushed along by a force that turns with the second one."""
    model = mv.Model("follower")
    for name, first, at in (("one", "ground", 0.0), ("two", "one", 2.0)):
        model.add_body(name, 2.0, (1, 1, 1), position=(0, at + 1.0, 0))
        model.add_joint(f"{name}.hinge", "revolute", first, name, (0, at, 0), axis=(1, 0, 0))
        model.add_bushing(f"{name}.k", first, name, (0, at, 0), (0, 0, 0, 10.0, 0, 0))
    model.add_load("push", "two", force=(0, -1.0, 0), position=(0, 4.0, 0), follower=True)
    return with_ports(model, "two", "z")


def torque():
    """A shaft in two sprung gimbals under a torque along it, which stays as it is: no symmetry of K."""
    model = mv.Model("torque")
    model.add_body("shaft", 1.0, (0.3, 0.4, 0.5))
    model.add_joint("ball", "spherical", "ground", "shaft", (0, 0, 0))
    model.add_bushing("k", "ground", "shaft", (0, 0, 0), (0, 0, 0, 40.0, 90.0, 70.0),
                      preload=(0, 0, 0, 0, 0, -2.0))  # fmt: skip
    model.add_load("twist", "shaft", torque=(0, 0, 2.0))
    return with_ports(model, "shaft", "ry")


def nodes():
    """A body on a node without mass, held by springs alone, and on one that a damper holds."""
    springs = {"k1": ("ground", "n", 30.0, 0.0), "k2": ("n", "b", 50.0, 0.0), "k3": ("b", "m", 20.0, 0.0),
               "c": ("m", "ground", 5.0, 2.0)}  # fmt: skip
    model = along_z({"n": 0.0, "b": 2.0, "m": 0.0}, springs)
    model.add_force_output("f", "k2")
    return with_ports(model, "b", "z")


def joint_forces():
    """A gyroscope whose bearing forces are outputs."""
    model = gyroscope()
    model.add_force_output("bearing", "gimbal", "rz")
    return model


def with_ports(model, body, direction):
    model.add_input("F", body, direction)
    model.add_output("x", body, direction)
    model.add_output("v", body, direction, quantity="velocity")
    model.add_output("a", body, direction, quantity="acceleration")
    return model


CASES = {
    "maxwell": (isolator, {"leg.stiffness": [3.0, 1.0, 4.0], "m.mass": 2.0, "leg.damping": [5.0, 9.0, 1.0]}),
    "maxwell alone": (lambda: isolator(static=0.0), {"leg.damping": [5.0, 9.0, 0.1]}),
    "rotor": (gyroscope, {"spin.speed": [30.0, 0.0, -200.0], "k.stiffness.rx": [40.0, 10.0, 3.0]}),
    "follower": (follower, {"push.force.y": [-1.0, -4.0, -9.0], "two.mass": [2.0, 3.0, 4.0]}),
    "torque": (torque, {"shaft.inertia.xx": [0.3, 0.35, 0.4], "k.stiffness.rx": [40.0, 10.0, 3.0]}),
    "nodes": (nodes, {"k1.stiffness": [30.0, 3.0, 300.0], "c.damping": [2.0, 1.0, 20.0], "b.mass": 3.0}),
    "joint forces": (joint_forces, {"spin.speed": [30.0, 0.0, -200.0]}),
}  # fmt: skip


@pytest.mark.few(1)
@pytest.mark.parametrize("name", CASES)
def test_variants_are_those_of_single_models(name):
    make, values = CASES[name]
    model = make()
    batch = model.linearize(values=values)
    modes, responses, spaces = batch.modes(), batch.frequency_response(OMEGA), batch.state_space()
    t = np.linspace(0.0, 2.0, 9)
    times = batch.time_response(t, np.cos(t))
    assert len(batch) == len(modes) == 3
    for i in range(3):
        single = model.with_values({key: np.broadcast_to(value, 3)[i] for key, value in values.items()}).linearize(
            independent=batch.coordinates)  # fmt: skip
        system = batch[i]
        for key in (*MATRICES, "gyroscopic", "circulatory", "null_inertia"):
            result, expected = getattr(system, key), getattr(single, key)
            assert (result is None) == (expected is None), key
            if expected is not None:
                assert_allclose(result, expected, rtol=0, atol=1e-14 * np.abs(expected).max(initial=0.0), err_msg=key)
            if key in MATRICES:
                assert_array_equal(getattr(batch, key)[i], result)
        assert (system.coordinates, system.massless) == (single.coordinates, single.massless)
        own = single.modes()
        assert_allclose(modes.eigenvalues[i], own.eigenvalues, rtol=1e-12, atol=1e-12)
        assert_allclose(modes[i].eigenvalues, own.eigenvalues, rtol=1e-12, atol=1e-12)
        assert_allclose(np.abs(modes.shapes[i]), np.abs(own.shapes), rtol=1e-9, atol=1e-9)
        for key in ("natural", "damped_frequencies", "damping_ratios"):
            assert_allclose(getattr(modes, key)[i], getattr(own, key), rtol=1e-10, atol=1e-12, err_msg=key)
        assert modes.stable[i] == own.stable
        assert modes.classical[i] == own.classical
        assert modes.rigid[i] == own.rigid
        if own.first_order is not None:
            assert_array_equal(modes.first_order[i], own.first_order)
        for result, expected in ((responses[i], single.frequency_response(OMEGA)),
                                (times[i], single.time_response(t, np.cos(t)[None]))):  # fmt: skip
            assert_allclose(result, expected, rtol=0, atol=1e-11 * np.abs(expected).max())
        space = single.state_space()
        assert spaces[i].states == space.states
        assert_allclose(spaces[i].A, space.A, rtol=1e-12, atol=1e-12 * np.abs(space.A).max())
    part = batch.slice(1, 3).modes()
    assert_array_equal(part.eigenvalues, modes.eigenvalues[1:])


def test_relaxation_isolators_in_closed_form():
    """m c s^3 + m k1 s^2 + c (k0 + k1) s + k0 k1 = 0: one mode of first order, wherever it is among the others."""
    damping = np.array([5.0, 0.05, 80.0])
    modes = isolator().linearize(values={"leg.damping": damping}).modes()
    assert modes.eigenvalues.shape == modes.errors.shape == (3, 3)
    assert modes.pairs.shape == (3, 2, 2)
    for values, c in zip(modes.eigenvalues, damping, strict=True):
        roots = np.roots([7.0 * c, 21.0, 5.0 * c, 6.0])
        assert_allclose(np.sort_complex(values), np.sort_complex(roots), rtol=1e-12)
    assert_array_equal(modes.first_order.sum(axis=1), 1)
    assert_array_equal(modes.first_order.argmax(axis=1), [0, 1, 0])
    assert_array_equal(modes.damping_ratios[modes.first_order], 1.0)


def test_speeds_of_a_gyroscope_in_closed_form():
    """s^4 I^2 + s^2 (I (a + b) + h^2) + a b = 0 without dampers, h = 0.05 speed, and I = 0.1."""
    speed = np.array([0.0, 10.0, 300.0])
    batch = gyroscope().linearize(values={"spin.speed": speed, "k.damping.rx": 0.0})
    h = 0.05 * speed
    middle, last = 0.1 * 130.0 + h**2, 40.0 * 90.0
    high = (middle + np.sqrt(middle**2 - 4.0 * 0.01 * last)) / 0.02
    expected = np.sqrt(np.stack((last / 0.01 / high, high), axis=1))
    assert_allclose(batch.modes().natural, expected, rtol=1e-12)
    assert batch.modes().stable.all()
    assert batch[0].gyroscopic is None
    assert_allclose(np.abs(batch.gyroscopic[:, 0, 1]), h, rtol=1e-14)


def test_other_motions_without_mass_are_refused_by_index_and_name():
    model = nodes()
    with pytest.raises(mv.ModelError, match=r"variant 1: coordinate 'm\.rail\.z' moves no mass and follows from "
                                            r"statics, in the nominal model it moves no mass but d"):  # fmt: skip
        model.linearize(values={"c.damping": [2.0, 0.0]})
    with pytest.raises(mv.ModelError, match=r"variant 2: coordinate 'n\.rail\.z' moves mass, in the nominal model it "
                                            r"moves no mass and follows"):  # fmt: skip
        model.linearize(values={"n.mass": [0.0, 0.0, 1.0]})
    model = along_z({"n": 0.0, "b": 1.0}, {"k1": ("ground", "n", 1, 0), "k2": ("n", "b", 2, 0)})
    with pytest.raises(mv.ModelError, match=r"variant 1: coordinate 'b\.rail\.z' moves no mass and follows from "
                                            r"statics, in the nominal model it moves mass"):  # fmt: skip
        model.linearize(values={"b.mass": [2.0, 0.0]})
    solid = along_z({"b": 1.0, "c": 1.0}, {"k1": ("ground", "b", 1, 0), "k2": ("b", "c", 1, 0)})
    with pytest.raises(mv.ModelError, match=r"variant 1: coordinate 'b\.rail\.z'.*the same motions without mass"):
        solid.linearize(values={"b.mass": [1.0, 0.0]})


def test_a_massless_body_on_a_massive_one_is_no_motion_without_mass():
    model = along_z({"b": 1.0}, {"k1": ("ground", "b", 1, 0)})
    model.add_body("flag", 0.5, (0, 0, 0))
    model.add_joint("weld", "fixed", "b", "flag")
    batch = model.linearize(values={"flag.mass": [0.5, 0.0]})
    assert_allclose(batch.M[:, 0, 0], [1.5, 1.0], rtol=1e-15)
    assert_allclose(batch.modes().natural[:, 0], [1.0 / np.sqrt(1.5), 1.0], rtol=1e-15)
