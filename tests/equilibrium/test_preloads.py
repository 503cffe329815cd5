"""Preloads that hold a given pose."""

import numpy as np
import pytest

import mbsvib as mv
from tests.equilibrium.test_moved import four_bar
from tests.equilibrium.test_search import G, check, pendulum, reloaded
from tests.support.lagrangian import Lagrangian
from tests.support.random_models import planar, rotation, spatial
from tests.support.restated import restated
from tests.support.sizes import few


def in_balance(model):
    weight = sum(body.mass for body in model.bodies.values()) * np.linalg.norm(model.gravity)
    return np.abs(Lagrangian(model).at().residual).max() < 1e-12 * weight


def test_a_spring_holds_a_lever():
    model = pendulum(np.pi / 2)
    model.add_spring("k", "ground", "rod", (0.4, 0, 0.3), (0.4, 0, 0), 500.0, free_length=0.25)
    held = model.equilibrium(preload="k")
    assert held.springs["k"].preload == pytest.approx(3 * 9.81, rel=1e-14)
    assert held.springs["k"].free_length is None
    assert held.bodies["rod"].position == model.bodies["rod"].position
    assert in_balance(held)
    assert held.linearize().dof == 1


def arm():
    """3 kg, 0.5 m from its hinge on an axis of its own, which has no torque yet."""
    model = mv.Model("arm", gravity=G)
    model.add_body("arm", 3.0, (0.01, 0.2, 0.2), position=(0.5, 0, 0))
    model.add_joint("hinge", "revolute", "ground", "arm", position=(0, 0, 0), axis=(0, 1, 0))
    return model


@pytest.mark.parametrize("select", ["gear", "g*", True])
def test_a_torsion_spring_holds_an_arm(select):
    model = arm()
    model.add_torsion_spring("gear", "ground", "arm", axis=(0, -1, 0), stiffness=200.0, preload=7.0)
    held = model.equilibrium(preload=select)
    assert held.springs["gear"].preload == pytest.approx(3 * 9.81 * 0.5, rel=1e-14)  # about -y it lifts the arm
    assert held.linearize().K[0, 0] == pytest.approx(200.0, rel=1e-12)  # weight as high as its hinge


def test_the_static_spring_of_a_maxwell_element_holds_an_arm():
    model = arm()
    model.add_maxwell("strut", "ground", "arm", (0.5, 0, 0.4), (0.5, 0, 0), 1e4, 30.0, static_stiffness=600.0)
    model.add_maxwell("free", "ground", "arm", (0.5, 0, 0.4), (0.5, 0, 0), 1e4, 30.0)
    held = model.equilibrium(preload="strut")
    assert held.springs["strut"].preload == pytest.approx(3 * 9.81, rel=1e-14)
    with pytest.raises(mv.ModelError, match="preload = 'free' has no stiffness at rest"):
        model.equilibrium(preload="free")


def test_the_smallest_of_many_preloads_is_taken():
    model = mv.Model("table", gravity=G)
    model.add_body("top", 8.0, (1, 1, 1), (0.1, 0.05, 1.0))
    for name, x, y in (("a", 0.0, 0.0), ("b", 1.0, 0.0), ("c", 0.0, 1.0), ("d", 1.0, 1.0)):
        model.add_bushing(f"leg.{name}", "ground", "top", (x, y, 0.8), (1e3, 1e3, 1e4, 0, 0, 0))
    held = model.equilibrium(preload=("leg.*",))
    assert in_balance(held)
    force = np.array([held.springs[f"leg.{name}"].preload[2] for name in "abcd"])
    balance = np.array([[1, 1, 1, 1], [0, 1, 0, 1], [0, 0, 1, 1]])
    expected = np.linalg.pinv(balance) @ (8 * 9.81 * np.array([1.0, 0.1, 0.05]))
    assert force == pytest.approx(expected, rel=1e-12)
    assert all(held.springs[f"leg.{name}"].preload[3:] == (0, 0, 0) for name in "abcd")


def mounted(seed):
    """A box on three mounts in any directions."""
    rng = np.random.default_rng(seed)
    model = mv.Model("box", gravity=(1.0, -3.0, -9.81))
    model.add_body("box", 8.0, (1, 1, 1), (0.1, 0.05, 1.0))
    for k in range(3):
        model.add_bushing(f"mount{k}", "ground", "box", rng.normal(size=3) * (2.0, 1.0, 0.3), 1e4 * rng.random(6),
                          orientation=rotation(rng))  # fmt: skip
    return model


def in_world(model):
    """Forces and moments of all bushings (n, 2, 3)."""
    return np.array([np.reshape(spring.preload, (2, 3)) @ np.array(spring.orientation).T
                     for spring in model.springs.values()])  # fmt: skip


@pytest.mark.parametrize("seed", range(3))
def test_moments_count_over_the_distance_of_all_points_from_their_mean(seed):
    """Least sum of |force|^2 + |moment / L|^2, L the root mean square distance."""
    model = mounted(seed)
    body = model.bodies["box"]
    points = np.array([spring.position for spring in model.springs.values()])
    every = np.concatenate((points, [body.position]))
    length = np.sqrt(np.square(every - every.mean(axis=0)).sum() / 4)
    balance = np.concatenate([np.block([[np.eye(3), np.zeros((3, 3))], [np.cross(arm, -np.eye(3)), length * np.eye(3)]])
                              for arm in points - body.position], axis=1)  # fmt: skip
    expected = np.linalg.pinv(balance) @ [*(-8.0 * np.array(model.gravity)), 0, 0, 0]
    expected = expected.reshape(3, 2, 3) * np.array([[1.0], [length]])
    result = in_world(model.equilibrium(preload=True))
    np.testing.assert_allclose(result, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("seed", range(3))
def test_preloads_turn_with_the_scene(seed):
    """As frequencies depend on them, these stay the same."""
    model, by = mounted(seed), rotation(np.random.default_rng(seed))
    result, other = (item.equilibrium(preload=True) for item in (model, restated(model, by, (3.0, -5.0, 2.0))))
    expected = in_world(result)
    np.testing.assert_allclose(in_world(other) @ by, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    frequencies = [item.linearize().modes().frequencies for item in (result, other)]
    np.testing.assert_allclose(*frequencies, rtol=1e-12)


@pytest.mark.parametrize("full", [False, True])
def test_bushings_carry_what_they_are_stiff_in(full):
    model = mv.Model("mount", gravity=(1.0, 2.0, -9.81))
    model.add_body("box", 2.0, (1, 1, 1), (0.3, 0.1, 0.2))
    rng = np.random.default_rng(0)
    stiffness = 10 ** rng.uniform(2, 3, size=6)
    if full:
        root = rng.normal(size=(6, 6))
        stiffness = 100 * root @ root.T
    model.add_bushing("k", "ground", "box", (0.0, 0.0, 0.0), stiffness, orientation=(0.3, 0.2, -0.5))
    held = model.equilibrium(preload=True)
    axes = np.array(held.springs["k"].orientation)
    force = -2.0 * np.array(model.gravity)
    assert axes @ held.springs["k"].preload[:3] == pytest.approx(force, rel=1e-12)
    assert axes @ held.springs["k"].preload[3:] == pytest.approx(np.cross([0.3, 0.1, 0.2], force), rel=1e-12)
    assert in_balance(held)


@pytest.mark.slow
def test_legs_of_a_stewart_platform_hold_its_payload():
    model = reloaded(mv.library.stewart())
    held = model.equilibrium(preload=("leg*",))
    assert in_balance(held)
    assert all(held.bodies[name] == body for name, body in model.bodies.items())
    preloads = np.array([spring.preload for spring in held.springs.values()])
    assert preloads[0::2] == pytest.approx(np.full(3, preloads[0]), rel=1e-9)
    check(held, held.equilibrium(report=True))


def test_a_loop_is_held_by_one_spring():
    model = reloaded(four_bar()[0], (0.0, -9.81, 0.0))
    model.add_spring("k", "ground", "coupler", (0.2, 1.0, 0.0), model.joints["C"].position, 60.0)
    assert in_balance(model.equilibrium(preload="k"))


def test_what_springs_cannot_hold_is_named():
    model = mv.Model("cart", gravity=(1.0, 0, -9.81))
    model.add_body("cart", 2.0, (1, 1, 1))
    model.add_joint("table", "planar", "ground", "cart", (0, 0, 0))
    model.add_spring("k", "ground", "cart", (0, -1, 0), (0, 0, 0), 100.0)
    model.add_spring("d", "ground", "cart", (0, -1, 0), (0, 0, 0), damping=1.0)
    message = r"no preload of 'k' holds the given pose; unbalanced force on body 'cart', -2 N missing along x of joint"
    with pytest.raises(mv.EquilibriumError, match=message) as caught:
        model.equilibrium(preload=True)
    assert (caught.value.body, caught.value.coordinate, caught.value.unit) == ("cart", "table.x", "N")
    with pytest.raises(mv.ModelError, match=r"preload = 'kk' is not a spring or bushing .* Did you mean 'k'"):
        model.equilibrium(preload="kk")
    with pytest.raises(mv.ModelError, match="preload = 'd' has no stiffness at rest"):
        model.equilibrium(preload=["d"])


@pytest.mark.slow
@pytest.mark.parametrize("seed", few(range(6), 2))
def test_springs_of_random_mechanisms_hold_them(seed):
    kinds = ("cylindrical", "universal", "spherical", "planar", "screw", "revolute", "distance", "point_on_line")
    for model in (spatial(seed, bodies=3, ports=False), planar(seed, bodies=4, loops=2, ports=False),
                  spatial(seed, bodies=4, loops=1, kinds=kinds, ports=False)):  # fmt: skip
        held = reloaded(model, (5.0, -9.0, -25.0)).equilibrium(preload=True)
        assert in_balance(held)
        assert held.linearize().dof == model.linearize().dof


def test_forces_that_are_rounding_need_no_preload():
    """1e-14 N against 1e3 N/m is what rounding of the pose does, and balance as ``linearize`` has it."""
    model = mv.Model("two")
    for name, force in (("a", 20.0), ("b", 1e-14)):
        model.add_body(name, 1.0, (0.1, 0.2, 0.25), (1.0, 2.0, 3.0))
        model.add_joint(f"rail {name}", "prismatic", "ground", name, axis=(0, 0, 1))
        model.add_bushing(f"k {name}", "ground", name, (1.0, 2.0, 3.0), (0, 0, 1e3, 0, 0, 0))
        model.add_load(f"f {name}", name, (0, 0, force))
    held = model.equilibrium(preload="k a")
    np.testing.assert_allclose(held.springs["k a"].preload, (0, 0, -20.0, 0, 0, 0), rtol=1e-14)
    assert held.linearize().dof == 2


def test_patterns_name_directions_of_bushings():
    """A beam on two bushings that are stiff in all directions: z alone carries the weight, and x alone cannot."""
    model = mv.Model("car", gravity=(0, 0, -10.0))
    model.add_body("car", 3.0, (1, 1, 1), (0.5, 0, 1.0))
    for name, x in (("front.tyre", 0.0), ("rear.tyre", 2.0)):
        model.add_bushing(name, "ground", "car", (x, 0, 0), (1e4, 1e4, 1e5, 10.0, 10.0, 10.0))
    held = model.equilibrium(preload="*.tyre.z")
    along = {name: np.array(part.preload) for name, part in held.springs.items()}
    for preload, share in zip(along.values(), (0.75, 0.25), strict=True):
        np.testing.assert_allclose(np.abs(preload), [0.0, 0.0, 30.0 * share, 0.0, 0.0, 0.0], atol=1e-12)
    both = model.equilibrium(preload=["front.tyre.z", "rear.tyre.?"])
    np.testing.assert_allclose(np.abs(both.springs["rear.tyre"].preload[2]), 7.5, rtol=1e-9)
    with pytest.raises(mv.EquilibriumError):
        model.equilibrium(preload="*.x")
    with pytest.raises(mv.ModelError, match=r"'\*\.tyre\.w' is not a spring"):
        model.equilibrium(preload="*.tyre.w")
