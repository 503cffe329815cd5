"""Loaded scenes whose frequencies are known in closed form, or from the exact Lagrangian."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.api.model import ADDERS
from tests.support.lagrangian import projected

G = 9.81
ROD = 14.678304239401497  # (rad/s)^2, 0.1 x 1 x 0.1 m, hinge at the top end
LAGUERRE = {1: [1.0], 3: [0.4157745567834791, 2.294280360279042, 6.2899450829374794]}
AXES = [(1, 0, 0), (0, -1, 0), (0.6, 0.8, 0)]


def box(mass, x, y, z):
    return mass / 12 * np.array([y * y + z * z, x * x + z * z, x * x + y * y])


def squares(model):
    return np.sort(np.square(2 * np.pi * model.linearize().modes().frequencies))


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("at", [(0, 0, 0), (300.0, -20.0, 7.0)])
def test_hinged_rod(axis, swap, at):
    model = mv.Model("rod", gravity=(0, 0, -G))
    model.add_body("rod", 10.0, box(10.0, 0.1, 0.1, 1.0), position=np.add(at, (0, 0, -0.5)))
    pair = ("rod", "ground") if swap else ("ground", "rod")
    model.add_joint("hinge", "revolute", *pair, position=at, axis=axis)
    assert squares(model) == pytest.approx([ROD], rel=1e-13)


@pytest.mark.parametrize("joint", [False, True])
def test_a_loaded_block_on_a_bushing(joint):
    """Without any joint, or on one that frees all: it sways at k + (k_r - m g h) / h^2 for a tall light block."""
    model = mv.Model("block", gravity=(0, 0, -G))
    model.add_body("block", 2.0, (1e-9, 1e-9, 1e-9), position=(0, 0, 0.3))
    if joint:
        model.add_joint("any", "free", "ground", "block", position=(0, 0, 0.3))
    model.add_bushing("foot", "ground", "block", position=(0, 0, 0), stiffness=(1e9, 1e9, 2e3, 40.0, 40.0, 60.0),
                      preload=(0, 0, 2.0 * G, 0, 0, 0))  # fmt: skip
    batch = model.linearize(values={"foot.stiffness.rx": np.array([40.0, 50.0])})
    for k, system in zip((40.0, 50.0), batch, strict=True):
        sway = (k - 2.0 * G * 0.3) / (2.0 * 0.3**2)
        squares_of = np.square(2 * np.pi * system.modes().frequencies)
        assert np.abs(squares_of / sway - 1.0).min() < 1e-6
    np.testing.assert_array_equal(batch[0].K, model.linearize().K)


def test_a_load_in_place_of_gravity():
    """A dead force at the centre of mass is gravity; one at the free end counts with its own arm."""
    model = mv.Model("rod")
    model.add_body("rod", 10.0, box(10.0, 0.1, 0.1, 1.0), position=(0, 0, -0.5))
    model.add_joint("hinge", "revolute", "ground", "rod", position=(0, 0, 0), axis=(1, 0, 0))
    inertia = box(10.0, 0.1, 0.1, 1.0)[0] + 10.0 * 0.25
    middle = model.replace("rod", mass=10.0)
    middle.add_load("weight", "rod", force=(0, 0, -10 * G))
    assert squares(middle) == pytest.approx([ROD], rel=1e-13)
    model.add_load("pull", "rod", force=(0, 0, -70.0), position=(0, 0, -1))
    assert squares(model) == pytest.approx([70.0 / inertia], rel=1e-13)
    follower = model.replace("pull", follower=True).linearize()
    assert follower.K.tolist() == [[0.0]]


@pytest.mark.parametrize("above", [0.2, 0.9, 1.0, 1.1, 3.0])
def test_inverted_pendulum_diverges_where_the_spring_is_too_soft(above):
    mass, d = 3.0, 0.7
    kt = above * mass * G * d
    inertia = box(mass, 0.1, 0.1, 1.0)
    model = mv.Model("inverted", gravity=(0, 0, -G))
    model.add_body("rod", mass, inertia, position=(0, 0, d))
    model.add_joint("hinge", "revolute", "ground", "rod", position=(0, 0, 0), axis=(0, 1, 0))
    model.add_bushing("spring", "ground", "rod", (0, 0, 0), (0, 0, 0, 0, kt, 0))
    square = (kt - mass * G * d) / (inertia[1] + mass * d * d)
    modes = model.linearize().modes()
    if above == 1.0:
        assert abs(modes.eigenvalues).max() < 1e-7 * np.sqrt(kt / mass)
    else:
        assert np.square(modes.eigenvalues) == pytest.approx([-square, -square], rel=1e-12)
    assert modes.stable is (above >= 1.0)


@pytest.mark.parametrize("n", LAGUERRE)
@pytest.mark.parametrize("kind", ["revolute", "spherical", "universal", "distance"])
def test_chain_of_point_masses_has_the_roots_of_laguerre_polynomials(kind, n):
    length, tiny = 0.3, 1e-13
    model = mv.Model("chain", gravity=(0, 0, -G))
    for k in range(n):
        at, first = (0, 0, -length * k), f"m{k - 1}" if k else "ground"
        inertia = (1, 1, 1) if kind == "distance" else (tiny, tiny, tiny)
        model.add_body(f"m{k}", 0.5, inertia, position=(0, 0, at[2] - length))
        words = {"revolute": {"axis": (1, 0, 0)}, "universal": {"axis": (1, 0, 0), "axis2": (0, 1, 0)},
                 "distance": {"end": (0, 0, at[2] - length)}}.get(kind, {})  # fmt: skip
        model.add_joint(f"j{k}", kind, first, f"m{k}", position=at, **words)
    system = model.linearize()
    square = np.sort(np.square(2 * np.pi * system.modes().frequencies))
    expected = G / length * np.array(LAGUERRE[n])
    item = {"revolute": 1, "spherical": 2, "universal": 2, "distance": 2}[kind]
    bending = np.repeat(expected, item)
    result = square[square > 1e-6 * expected[0]][: len(bending)]
    assert result == pytest.approx(bending, rel=1e-9)


def test_trifilar_pendulum():
    """m g R^2 / (I l) about the vertical, g / l sideways; three rods close two loops."""
    radius, length, mass, inertia = 0.4, 1.5, 6.0, 0.7
    model = mv.Model("trifilar", gravity=(0, 0, -G))
    model.add_body("plate", mass, (0.3, 0.45, inertia), position=(0, 0, 0))
    for k in range(3):
        angle = 2 * np.pi * k / 3
        at = radius * np.array([np.cos(angle), np.sin(angle), 0])
        model.add_joint(f"wire{k}", "distance", "ground", "plate", position=np.add(at, (0, 0, length)), end=at)
    expected = sorted([G / length, G / length, mass * G * radius**2 / (inertia * length)])
    assert squares(model) == pytest.approx(expected, rel=1e-12)


def test_trifilar_pendulum_on_springs():
    """The same with wires that are stiff springs: the soft modes do not feel how stiff, where they are uncoupled."""
    radius, length, mass, inertia = 0.4, 1.5, 6.0, 0.7
    model = mv.Model("trifilar", gravity=(0, 0, -G))
    model.add_body("plate", mass, (0.36, 0.36, inertia), position=(0, 0, 0))
    for k in range(3):
        angle = 2 * np.pi * k / 3
        at = radius * np.array([np.cos(angle), np.sin(angle), 0])
        model.add_spring(f"wire{k}", "ground", "plate", np.add(at, (0, 0, length)), at, 1e6, preload=mass * G / 3)
    system = model.linearize()
    yaw = system.coordinates.index("plate.rz")
    assert system.K[yaw, yaw] == pytest.approx(mass * G * radius**2 / length, rel=1e-12)
    expected = sorted([G / length] * 2 + [mass * G * radius**2 / (inertia * length)])
    assert squares(model)[:3] == pytest.approx(expected, rel=1e-3)


def test_double_pendulum():
    """Two rods: M = [[I1 + m1 d1^2 + m2 l1^2, m2 l1 d2], [., I2 + m2 d2^2]], K = diag((m1 d1 + m2 l1) g, m2 g d2)."""
    m1, m2, l1, d1, d2, i1, i2 = 2.0, 3.0, 0.8, 0.3, 0.5, 0.11, 0.07
    model = mv.Model("double", gravity=(0, 0, -G))
    model.add_body("upper", m1, (i1, i1, 0.01), position=(0, 0, -d1))
    model.add_body("lower", m2, (i2, i2, 0.01), position=(0, 0, -l1 - d2))
    model.add_joint("shoulder", "revolute", "ground", "upper", position=(0, 0, 0), axis=(1, 0, 0))
    model.add_joint("elbow", "revolute", "upper", "lower", position=(0, 0, -l1), axis=(1, 0, 0))
    mass = np.array([[i1 + m1 * d1**2 + m2 * l1**2, m2 * l1 * d2], [m2 * l1 * d2, i2 + m2 * d2**2]])
    stiffness = np.diag([(m1 * d1 + m2 * l1) * G, m2 * G * d2])
    expected = np.sort(np.linalg.eigvals(np.linalg.solve(mass, stiffness)).real)
    assert squares(model) == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize("tension", [3.0, 250.0])
def test_string_of_masses_under_tension(tension):
    """n masses at distance a: across the string omega^2 = 4 F / (m a) sin^2(j pi / (2 (n + 1))), along it with k."""
    n, a, mass, k = 5, 0.2, 0.1, 4e3
    model = mv.Model("string")
    for i in range(n):
        model.add_body(f"m{i}", mass, (1e-3, 1e-3, 1e-3), position=((i + 1) * a, 0, 0))
        model.add_joint(f"j{i}", None, "ground", f"m{i}", position=((i + 1) * a, 0, 0), free=("x", "y", "z"))
    names = ["ground", *model.bodies, "ground"]
    for i in range(n + 1):
        free = a - tension / k  # so that the tension is k (a - free)
        words = {"preload": tension} if i % 2 else {"free_length": free}
        model.add_spring(f"s{i}", names[i], names[i + 1], (i * a, 0, 0), ((i + 1) * a, 0, 0), k, **words)
    wave = 4 / mass * np.sin(np.arange(1, n + 1) * np.pi / (2 * (n + 1))) ** 2
    across, along = tension / a * wave, k * wave
    assert squares(model) == pytest.approx(np.sort([*across, *across, *along]), rel=1e-9)


def four_bar():
    """A planar four-bar with spring, in balance: three redundant constraints in space."""
    model = mv.Model("four-bar", gravity=(0, -G, 0))
    pins = [(0, 0, 0), (0.1, 0.3, 0), (0.55, 0.42, 0), (0.5, 0, 0)]
    names = ["ground", "crank", "coupler", "rocker", "ground"]
    for name, a, b, mass in zip(names[1:4], pins[:3], pins[1:], (1.0, 2.0, 1.5), strict=True):
        model.add_body(name, mass, (0.02, 0.03, 0.04), position=np.add(a, b) / 2 + [0.01, -0.02, 0.03])
    for k, pin in enumerate(pins):
        model.add_joint(f"pin{k}", "revolute", names[k], names[k + 1], position=pin, axis=(0, 0, 1))
    model.add_spring("spring", "ground", "coupler", (-0.3, 0.5, 0), (0.3, 0.3, 0), 500.0)
    return model


def balanced(model, name):
    """The model with the tension in one of its springs that holds it."""
    free = mv.Model(model.name)
    for group in model.groups().values():
        for part in group.values():
            getattr(free, ADDERS[type(part)])(**part.constructor_kwargs())
    motion = free.linearize().body_motion
    weight = sum(b.mass * np.array(model.gravity) @ motion[i, :3] for i, b in enumerate(model.bodies.values()))
    system = free.linearize()
    row = system.elastic_rows[system.row_owner == list(free.springs).index(name)]
    return model.replace(name, preload=float((weight / row[0])[0]))


def test_four_bar_under_gravity():
    model = balanced(four_bar(), "spring")
    system = model.linearize()
    stiffness, mass, residual = projected(model, system)
    assert system.dof == 1
    assert len(system.redundant) == 3
    assert abs(residual[0]) < 1e-12
    assert np.abs(system.K - stiffness).max() < 1e-12 * np.abs(stiffness).max()
    assert np.abs(system.M - mass).max() < 1e-12 * mass.max()
    assert "redundant" in system.explain()


@pytest.mark.parametrize("cut", ["pin0", "pin1", "pin2", "pin3"])
def test_the_cut_does_not_change_the_stiffness(cut):
    model = balanced(four_bar(), "spring")
    expected = squares(model)
    system = model.linearize(cut=[cut])
    assert np.square(2 * np.pi * system.modes().frequencies) == pytest.approx(expected, rel=1e-12)


def test_what_is_missing_is_named():
    model = mv.Model("lift", gravity=(0, 0, -10.0))
    model.add_body("cabin", 41.2, (1, 1, 1))
    model.add_joint("rail", "prismatic", "ground", "cabin")
    with pytest.raises(mv.EquilibriumError, match=r"body 'cabin', 412 N missing along z of joint 'rail'") as caught:
        model.linearize()
    error = caught.value
    assert (error.body, error.coordinate, error.unit) == ("cabin", "rail.z", "N")
    assert error.missing == pytest.approx(412.0)
    assert "model.equilibrium()" in str(error)
    model.add_load("rope", "cabin", force=(0, 0, 412.0))
    assert model.linearize().K.tolist() == [[0.0]]
    with pytest.raises(mv.EquilibriumError, match=r", -1e-06 N missing"):
        model.replace("rope", force=(0, 0, 412.000001)).linearize()


def test_floating_bodies_fall():
    model = mv.Model("stone", gravity=(0, 0, -10.0))
    model.add_body("stone", 1.0, (1, 1, 1))
    with pytest.raises(mv.EquilibriumError, match=r"unbalanced force on body 'stone', 10 N missing along z \("):
        model.linearize()
