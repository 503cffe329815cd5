"""Free-floating mechanisms that relax: rigid-body modes are exactly 0, all else against 50 digits."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
from tests.massless.scenes import along_z
from tests.support.random_models import rotation
from tests.support.relaxing import Relaxing

DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")


def ports(model, first, last, rng):
    model.add_input("F", first, rng.uniform(-1, 1, 6))
    model.add_input("G", last, rng.uniform(-1, 1, 6), relative_to=first)
    model.add_output("x", last, rng.uniform(-1, 1, 6))
    model.add_output("v", first, rng.uniform(-1, 1, 6), quantity="velocity")
    model.add_output("r", last, rng.uniform(-1, 1, 6), relative_to=first)
    return model


def platform(seed):
    """A platform on six relaxation legs and a cable on a floating base."""
    rng = np.random.default_rng(seed)
    model = mv.Model("platform")
    model.add_body("base", 40.0, (3.0, 3.1, 5.0), position=(0, 0, 0))
    model.add_body("top", 12.0, (0.3, 0.32, 0.5), position=(0, 0, 0.3))
    for i in range(6):
        foot, hip = np.deg2rad(60 * i + 10 * (-1) ** i), np.deg2rad(60 * i + 20 * (-1) ** i)
        model.add_maxwell(f"leg{i}", "base", "top", (0.4 * np.cos(foot), 0.4 * np.sin(foot), 0.05),
                          (0.3 * np.cos(hip), 0.3 * np.sin(hip), 0.27), stiffness=2e5 * rng.uniform(1, 2),
                          damping=10 ** rng.uniform(-1, 4))  # fmt: skip
    model.add_bushing("cable", "base", "top", position=(0.02, 0.01, 0.15), stiffness=10 ** rng.uniform(-2, 4, 6))
    return ports(model, "base", "top", rng)


def two_bushings(seed):
    rng = np.random.default_rng(seed)
    model = mv.Model("two bushings")
    model.add_body("a", 1.5, (0.3, 0.4, 0.5), position=(0, 0, 0))
    model.add_body("b", 2.5, (0.6, 0.5, 0.7), position=(0.2, 0.1, 2.0))
    for name in ("u", "v"):
        model.add_bushing(name, "a", "b", position=rng.uniform(0, 1, 3), orientation=rng.uniform(-1, 1, 3),
                          stiffness=rng.uniform(5, 10, 6))  # fmt: skip
    model.add_maxwell("leg", "a", "b", (0.1, -0.2, 0.4), (0.5, 0.3, 1.4), stiffness=3.0, damping=5.0)
    return ports(model, "a", "b", rng)


def damped_node(seed):
    """A massless body on a spring-damper, stiffness and damping in the same directions."""
    rng = np.random.default_rng(seed)
    model = mv.Model("node")
    model.add_body("a", 1.5, (0.3, 0.4, 0.5), position=(0, 0, 0))
    model.add_body("n", 0.0, (0, 0, 0), position=(0.2, 0.1, 1.0))
    stiffness = rng.uniform(5, 10, 6) * (seed % 2)
    model.add_bushing("u", "a", "n", position=(0.1, 0.1, 0.5), orientation=rng.uniform(-1, 1, 3), stiffness=stiffness,
                      damping=rng.uniform(0.5, 1, 6))  # fmt: skip
    return ports(model, "a", "n", rng)


def anything(seed):
    """Two to four bodies, some without mass, with springs, dampers, bushings and Maxwell elements between them."""
    rng = np.random.default_rng(seed)
    model = mv.Model("anything")
    bodies = [f"b{i}" for i in range(rng.integers(2, 5))]
    positions = {name: rng.uniform(-1, 1, 3) for name in bodies}
    for i, name in enumerate(bodies):
        mass = 0.0 if i and rng.random() < 0.25 else 10 ** rng.uniform(-1, 1)
        model.add_body(name, mass, mass * rng.uniform(0.1, 0.15, 3), position=positions[name])
        if i and rng.random() < 0.3:
            kind = rng.choice(["revolute", "prismatic", "spherical", "cylindrical"])
            model.add_joint(f"j{i}", str(kind), f"b{rng.integers(0, i)}", name, position=positions[name],
                            orientation=rng.uniform(-1, 1, 3))  # fmt: skip
    for e in range(rng.integers(len(bodies), 3 * len(bodies) + 2)):
        first, second = rng.choice(bodies, 2, replace=False)
        ends = [positions[name] + 0.3 * rng.uniform(-1, 1, 3) for name in (first, second)]
        k, c = 10 ** rng.uniform(1, 3, 6), 10 ** rng.uniform(-1, 1, 6)
        k, c = (values * (rng.random(6) < rng.choice([0.5, 1.0])) for values in (k, c))
        k[0], c[0] = max(k[0], 1.0), max(c[0], 0.1)
        kind = rng.choice(["maxwell", "maxwell", "spring", "damper", "bushing", "stiff bushing", "damping bushing"])
        if kind == "maxwell":
            model.add_maxwell(f"e{e}", first, second, *ends, stiffness=k[0], damping=c[0], static_stiffness=k[1])
        elif kind in ("spring", "damper"):
            model.add_spring(f"e{e}", first, second, *ends, stiffness=k[0] * (kind == "spring"), damping=c[0])
        else:
            k, c = k * (kind != "damping bushing"), c * (kind != "stiff bushing")
            model.add_bushing(f"e{e}", first, second, position=np.mean(ends, axis=0), orientation=rng.uniform(-1, 1, 3),
                              stiffness=k, damping=c)  # fmt: skip
    return ports(model, bodies[0], bodies[-1], rng)


def of_states(space, omega):
    unit = np.eye(len(space.A))
    return np.stack([space.C @ np.linalg.solve(1j * w * unit - space.A, space.B) + space.D for w in omega], axis=-1)


def check(model):
    """Poles, responses and modal states against 50 digits."""
    system = model.linearize()
    exact, poles = Relaxing(model), system.poles()
    moving = poles[poles != 0.0]
    assert len(poles) - len(moving) == exact.still
    assert max((exact.distance(value) for value in moving[moving.imag >= 0.0]), default=0.0) <= 1e-9
    modes = system.modes()
    assert modes.errors.max() <= 1e-9
    assert modes.rigid == np.count_nonzero(modes.frequencies == 0.0)
    speeds = np.abs(moving) if len(moving) else np.ones(1)
    omega = np.geomspace(0.03 * speeds.min(), 3.0 * speeds.max(), 5)
    expected = exact.frequency_response(omega)
    size = np.abs(expected).max(axis=(0, 1))
    assert_allclose(system.frequency_response(omega) / size, expected / size, rtol=0, atol=1e-10)
    assert_allclose(of_states(system.state_space("modal"), omega) / size, expected / size, rtol=0, atol=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 33])  # in the second, a pair of eigenvalues is 5e4 apart: damping ratio 200
def test_a_platform_on_relaxation_legs_and_a_cable(seed):
    check(platform(seed))


@pytest.mark.few(2)
@pytest.mark.parametrize("scene", [two_bushings, damped_node])
@pytest.mark.parametrize("seed", range(2))
def test_two_floating_bodies(scene, seed):
    check(scene(seed))


@pytest.mark.slow
def test_a_floating_scene():
    check(anything(9))


def loaded(model, kind):
    """The same with loads or preloads on bodies with mass which cancel, so that nothing changes."""
    heavy = [body for body in model.bodies.values() if body.mass]
    first, last = heavy[0], (heavy[1:] or [b for b in model.bodies.values() if not b.mass])[-1]
    for i, sign in enumerate((1.0, -1.0)):
        if kind == "force":
            model.add_load(f"l{i}", first.name, force=sign * np.array([9.0, -3.0, 20.0]), position=first.position,
                           follower=True)  # fmt: skip
        elif kind == "torque":
            model.add_load(f"l{i}", first.name, torque=sign * np.array([1.0, 4.0, -2.0]))
        else:
            ends = np.add(first.position, (0.1, 0, 0)), np.add(last.position, (0.2, 0.3, 0))
            model.add_spring(f"l{i}", first.name, last.name, *ends, stiffness=100.0, preload=sign * 30.0)
    return model


@pytest.mark.few(1)
@pytest.mark.parametrize(("scene", "seed", "kind"), [
    (two_bushings, 0, "force"), (two_bushings, 1, "preload"), (damped_node, 0, "force"), (anything, 11, "preload"),
    (anything, 1, "torque"),
])  # fmt: skip
def test_loads_that_cancel(scene, seed, kind):
    check(loaded(scene(seed), kind))


@pytest.mark.slow
def test_many_floating_scenes():
    refused = []
    for seed in range(40):
        kind = (None, "force", "torque", "preload")[seed % 4]
        try:
            check(loaded(anything(seed), kind) if kind else anything(seed))
        except mv.ModelError as error:
            refused.append(str(error))
    assert all("no spring or damper holds it" in text for text in refused)
    assert len(refused) < 10
    for seed in range(10):
        check(platform(seed))


@pytest.mark.parametrize("stiff", [1e3, 1e6, 1e9, 1e12])
@pytest.mark.parametrize("damping", [0.0, 0.3])
def test_a_floating_node_between_a_stiff_and_a_soft_spring(stiff, damping):
    """What a stiff spring yields is rounding beside what it moves by: no spring holds the pair none the less."""
    springs = {"s": ("a", "n", stiff, 0), "w": ("n", "b", 2.0, 0), "d": ("a", "b", 0, damping)}
    springs.pop("d") if not damping else None
    system = along_z({"a": 1.5, "n": 0.0, "b": 3.0}, springs).linearize()
    poles = system.poles()
    assert np.count_nonzero(poles == 0.0) == 2
    expected = np.roots([1.0, damping, 1.0 / (1.0 / stiff + 1.0 / 2.0)])  # the reduced mass of the pair is 1
    assert_allclose(np.sort_complex(poles[poles != 0.0]), np.sort_complex(expected), rtol=1e-12)


@pytest.mark.parametrize("stiff", [1e5, 1e8])
def test_a_floating_node_in_space_between_stiff_and_soft(stiff):
    rng = np.random.default_rng(1)
    model = mv.Model()
    positions = {name: rng.uniform(-1, 1, 3) for name in "anb"}
    for name, mass in zip("anb", (1.0, 0.0, 2.0), strict=True):
        model.add_body(name, mass, (mass, mass, mass), position=positions[name])
    for name, first, second, k in (("s", "a", "n", stiff), ("w", "n", "b", 1.0)):
        model.add_bushing(name, first, second, position=rng.uniform(-1, 1, 3), orientation=rng.uniform(-1, 1, 3),
                          stiffness=k * rng.uniform(1, 2, 6))  # fmt: skip
    modes = model.linearize().modes()
    assert modes.rigid == 6
    assert modes.frequencies[6] > 0.01


@pytest.mark.parametrize("strong", [1e3, 1e6, 1e9, 1e12])
def test_a_weak_brake_beside_strong_ones(strong):
    """A pair and a body that nothing but dampers hold: the pair comes to rest at the rate c / m of its weak one."""
    springs = {"k": ("a", "b", 3.0, strong), "w": ("ground", "b", 0, 1e-3), "s": ("ground", "c", 0, strong)}
    poles = along_z({"a": 1.0, "b": 2.0, "c": 1.0}, springs).linearize().poles()
    assert np.count_nonzero(poles == 0.0) == 2
    assert_allclose(np.abs(poles + 1e-3 / 3.0).min(), 0.0, atol=1e-3 / 3.0 * 1e-6)


@pytest.mark.parametrize("seed", [1, 4, 5, 7, 9])
def test_springs_in_series_through_a_node_between_floating_bodies(seed):
    """A node without mass between two bushings at one point: as one bushing of their series stiffness."""
    rng = np.random.default_rng(seed)
    points, axes = rng.uniform(-1, 1, (4, 3)), [rotation(rng) for _ in range(2)]
    near, far = 10 ** rng.uniform(1, 5, (2, 6))
    models = []
    for node in (False, True):
        model = mv.Model("floating")
        model.add_body("a", 2.0, (0.1, 0.2, 0.15), points[0])
        model.add_body("b", 1.0, (0.05, 0.06, 0.07), points[1])
        model.add_joint("j", "revolute", "a", "b", points[2], orientation=axes[0])
        if node:
            model.add_body("node", 0.0, (0.0, 0.0, 0.0), points[0])
            model.add_bushing("k", "a", "node", points[3], near, orientation=axes[1])
            model.add_bushing("l", "node", "b", points[3], far, orientation=axes[1])
        else:
            model.add_bushing("both", "a", "b", points[3], near * far / (near + far), orientation=axes[1])
        models.append(model)
    expected, result = (model.linearize().modes().natural for model in models)
    assert np.count_nonzero(result == 0.0) == 6
    np.testing.assert_allclose(result, expected, rtol=1e-9)
