"""Base motion: closed forms of isolators, and the same mechanism on a body that is shaken instead of the ground."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import mbsvib as mv
from mbsvib.api.model import ADDERS
from mbsvib.common.arguments import DIRECTIONS
from tests.support.compare import linearized
from tests.support.random_models import seeds, spatial
from tests.support.sizes import examples

OMEGA = np.array([0.7, 3.0, 11.0, 29.0, 150.0])


def isolator(masses=(2.0, 3.0), stiffness=(800.0, 500.0), damping=(4.0, 6.0)):
    """Masses on sledges along x, one behind the other from the ground."""
    model = mv.Model("isolator")
    before = "ground"
    for i, (m, k, c) in enumerate(zip(masses, stiffness, damping, strict=True)):
        name = f"m{i}"
        model.add_body(name, m, (1, 1, 1), (i + 1.0, 0, 0))
        model.add_joint(f"j{i}", "prismatic", before, name, axis=(1, 0, 0))
        model.add_spring(f"k{i}", before, name, (i, 0, 0), (i + 1.0, 0, 0), k, c)
        model.add_output(f"a{i}", name, "x", quantity="acceleration")
        model.add_output(f"x{i}", name, "x")
        model.add_force_output(f"f{i}", f"k{i}")
        before = name
    model.add_base_motion("ground.ax", "x")
    return model


def response(model, omega=OMEGA):
    system = model.linearize()
    return dict(zip(system.outputs, system.frequency_response(omega)[:, 0], strict=True))


def test_one_mass():
    """T = (c s + k) / (m s^2 + c s + k); relative displacement -m / (...); the spring carries m times T."""
    result, s = response(isolator((2.0,), (800.0,), (4.0,))), 1j * OMEGA
    below = 2.0 * s**2 + 4.0 * s + 800.0
    assert_allclose(result["a0"], (4.0 * s + 800.0) / below, rtol=1e-12)
    assert_allclose(result["x0"], -2.0 / below, rtol=1e-12)
    assert_allclose(result["f0"], -2.0 * (4.0 * s + 800.0) / below, rtol=1e-12)


def test_two_masses():
    result, s = response(isolator()), 1j * OMEGA
    z1, z2 = 4.0 * s + 800.0, 6.0 * s + 500.0
    below = (2.0 * s**2 + z1 + z2) * (3.0 * s**2 + z2) - z2**2
    assert_allclose(result["a0"], z1 * (3.0 * s**2 + z2) / below, rtol=1e-12)
    assert_allclose(result["a1"], z1 * z2 / below, rtol=1e-12)
    assert_allclose(result["f1"], 3.0 * result["a1"] * -1, rtol=1e-11)  # all that accelerates the second mass


def test_skyhook():
    """A force -g times the absolute velocity makes T = w0^2 / (s^2 + (g/m) s + w0^2)."""
    model, gain, s = isolator((2.0,), (800.0,), (0.0,)), 30.0, 1j * OMEGA
    model.add_input("F", "m0", "x")
    result = model.linearize().frequency_response(OMEGA)[0]  # a0 to ground.ax and F
    closed = result[0] / (1.0 + gain * result[1] / s)
    assert_allclose(closed, 400.0 / (s**2 + gain / 2.0 * s + 400.0), rtol=1e-12)


def test_a_locked_body_moves_with_the_ground():
    """Six directions, axes off the body's centre: the acceleration of a rigid body, wherever it is measured."""
    model = mv.Model("locked")
    model.add_body("b", 2.0, (1, 1, 1), (0.3, -0.2, 0.5))
    model.add_joint("j", "fixed", "ground", "b")
    centre, point = np.array((1.0, 2.0, -1.0)), np.array((0.1, 0.4, 0.9))
    for direction in DIRECTIONS:
        model.add_base_motion(f"base.{direction}", direction, centre)
        model.add_output(direction, "b", direction, point, quantity="acceleration")
    system = model.linearize()
    x, y, z = point - centre
    expected = np.eye(6)
    expected[:3, 3:] = [[0, z, -y], [-z, 0, x], [y, -x, 0]]
    assert_allclose(system.D, expected, atol=1e-15)


def shaken(model, centre):
    """The same mechanism on a heavy body that floats, pushed by six forces; its own accelerations come first."""
    result = mv.Model("shaken")
    result.add_body("shaker", 50.0, (7.0, 8.0, 9.0), centre)
    for group in (model.bodies, model.joints, model.springs):
        for part in group.values():
            words = part.constructor_kwargs()
            for side in ("first", "second"):
                if words.get(side) == "ground":
                    words[side] = "shaker"
            getattr(result, ADDERS[type(part)])(**words)
    for d in DIRECTIONS:
        result.add_input(f"F{d}", "shaker", d)
    for d in DIRECTIONS:
        result.add_output(f"base.{d}", "shaker", d, quantity="acceleration")
    return result


@pytest.mark.slow
@examples(16, slow=50)
@given(seeds(), st.integers(2, 4), st.integers(0, 2))
def test_on_a_shaker(seed, bodies, loops):
    """Whatever the ground does can be done by a body: absolute and relative outputs, forces, loops and all."""
    kinds = ("revolute", "prismatic", "cylindrical", "universal", "spherical", "planar", "distance", "point_on_plane")
    model = spatial(seed, bodies=bodies, loops=loops, kinds=kinds, ports=False)
    rng = np.random.default_rng(seed)
    centre = rng.normal(size=3)
    for d in DIRECTIONS:
        model.add_base_motion(f"base.{d}", d, centre)
    other = shaken(model, centre)
    for name in model.bodies:
        point, direction = rng.normal(size=3), rng.normal(size=6)
        for target, ground in ((model, "ground"), (other, "shaker")):
            target.add_output(f"{name}.abs", name, direction, point, quantity="acceleration")
            target.add_output(f"{name}.rel", name, direction, point, relative_to=ground,
                              quantity="acceleration", absolute=False if ground == "ground" else None)  # fmt: skip
            target.add_output(f"{name}.disp", name, direction, point, relative_to=ground)
            target.add_output(f"{name}.speed", name, direction, point, relative_to=ground, quantity="velocity")
            if name != "b0":
                target.add_output(f"{name}.pair", name, direction, point, relative_to="b0", quantity="acceleration")
    for name, spring in model.springs.items():
        for target in (model, other):
            target.add_force_output(f"{name}.f", name, "z" if hasattr(spring, "line") else np.arange(1.0, 7.0))
    system, full = linearized(model), linearized(other)
    assume(system.dof)
    assert full.dof == system.dof + 6
    omega = np.array([0.9, 7.0, 60.0, 500.0])
    result, forced = system.frequency_response(omega), full.frequency_response(omega)
    for k in range(len(omega)):
        expected = forced[6:, :, k] @ np.linalg.inv(forced[:6, :, k])
        size = np.abs(expected).max(axis=1, keepdims=True)
        size = np.maximum(size, 1e-5 * size.max())  # what loops hold still is rounding, of the size of the others
        assert np.max(np.abs(result[:, :, k] - expected) / size) < 1e-7


def test_two_bases_that_the_ground_ties_together():
    """Feet apart on one ground, shaken about an axis between them: each spring feels its own part."""
    model = mv.Model("table")
    model.add_body("plate", 4.0, (0.5, 0.5, 0.9), (0, 0, 0.4))
    model.add_joint("guide", "planar", "ground", "plate", (0, 0, 0.4), axis=(0, 1, 0))
    for name, x in (("left", -0.6), ("right", 0.6)):
        model.add_spring(name, "ground", "plate", (x, 0, 0), (x, 0, 0.4), 300.0, 2.0)
        model.add_force_output(f"{name}.f", name)
    model.add_bushing("side", "ground", "plate", (0, 0, 0.4), (50.0, 0, 0, 0, 0, 0))
    model.add_base_motion("roll", "ry")
    model.add_base_motion("heave", "z")
    model.add_output("plate.ry", "plate", "ry", quantity="acceleration")
    system, s = model.linearize(), 1j * OMEGA
    response = dict(zip(system.outputs, system.frequency_response(OMEGA), strict=True))
    z, arm = 300.0 + 2.0 * s, 0.6
    below = 0.5 * s**2 + 2 * arm**2 * z
    assert_allclose(response["plate.ry"][0], 2 * arm**2 * z / below, rtol=1e-12)
    assert_allclose(response["left.f"][0], -z * arm * 0.5 / below, rtol=1e-11)  # ry lifts what is at -x
    assert_allclose(response["right.f"][0], z * arm * 0.5 / below, rtol=1e-11)
    assert_allclose(response["left.f"][1], -z * 4.0 / (4.0 * s**2 + 2 * z), rtol=1e-11)


@pytest.mark.parametrize("quantity", ["displacement", "velocity"])
def test_absolute_motion_that_would_integrate_the_input_is_refused(quantity):
    model = isolator()
    model.add_output("far", "m1", "x", quantity=quantity, absolute=True)
    with pytest.raises(mv.ModelError, match=f"output 'far': an absolute {quantity} would integrate .* 'ground.ax'"):
        model.linearize()


def swing(**words):
    model = mv.Model("swing", **words)
    model.add_body("rod", 1.0, (1, 1, 1), (0, 0, -1))
    model.add_joint("hinge", "revolute", "ground", "rod", (0, 0, 0), axis=(0, 1, 0))
    model.add_output("a", "rod", "x", quantity="acceleration")
    return model


def test_what_does_not_turn_with_the_ground_is_named():
    """A rod that hangs from a frictionless hinge stays where it is when the hinge turns, as gravity holds it."""
    model = swing(gravity=(0, 0, -9.81))
    model.add_base_motion("tilt", (0, 0, 0, 0, 2.0, 0))
    with pytest.raises(mv.ModelError, match=r"base motion 'tilt': .* but gravity acts along \(0\.0, 0\.0, -9\.81\)"):
        model.linearize()
    model = swing()
    model.add_load("weight", "rod", force=(0, 0, -5.0))
    model.add_base_motion("tilt", "rx")
    with pytest.raises(mv.ModelError, match=r"load 'weight' has the force .* Give the load as follower=True"):
        model.linearize()
    model = swing()
    model.add_rotor("wheel", "rod", 100.0, (0, 1, 0), inertia=0.1)
    model.add_base_motion("yaw", "rz")
    with pytest.raises(mv.ModelError, match=r"rotor 'wheel' spins about \(0\.0, 1\.0, 0\.0\)"):
        model.linearize()


def test_a_ground_that_shifts_or_turns_about_gravity_is_none_of_that():
    model = swing(gravity=(0, 0, -9.81))
    model.add_base_motion("yaw", "rz")
    model.add_base_motion("ax", "x")
    result = model.linearize().frequency_response(OMEGA)
    s = 1j * OMEGA
    assert_allclose(result[0, 1], 1.0 - s**2 / (2.0 * s**2 + 9.81), rtol=1e-11)  # J = 2, m l = 1
    assert_allclose(result[0, 0], 0.0, atol=1e-14)


@pytest.mark.parametrize("torque", [0.0, 3.0])
def test_a_load_that_follows_turns_with_the_ground(torque):
    """Ziegler's column on a ground that turns: -M (1, 1)^T as input, K with the force of the tip in its first row."""
    k, p, length = 50.0, 20.0, 1.0
    model = mv.Model("column")
    for name, below, x in (("a", "ground", 0.5), ("b", "a", 1.5)):
        model.add_body(name, 2.0, (1, 1, 0.3), (x, 0, 0))
        model.add_joint(f"j{name}", "revolute", below, name, (x - 0.5, 0, 0))
        model.add_bushing(f"k{name}", below, name, (x - 0.5, 0, 0), (0, 0, 0, 0, 0, k))
        model.add_output(f"r{name}", name, "rz")
    model.add_load("push", "b", (-p, 0, 0), (torque, 0, 0), (2, 0, 0), follower=True)
    model.add_base_motion("turn", "rz")
    system = model.linearize()
    # absolute small angles a, b: T = sum m v^2 / 2 + J w^2 / 2; the force follows b
    mass = np.array([[0.3 + 2.0 * 0.25 + 2.0, 1.0], [1.0, 0.3 + 0.5]]) * length**2
    stiffness = np.array([[2 * k - p, p - k], [-k, k]])
    for w, result in zip(OMEGA, system.frequency_response(OMEGA)[:, 0].T, strict=True):
        expected = np.linalg.solve(stiffness - w**2 * mass, -mass.sum(axis=1))
        assert_allclose(result, expected, rtol=1e-11)
