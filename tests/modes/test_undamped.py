"""The first solver of undamped modes: a bound known beforehand, and factors looked at only where it is not enough."""

from dataclasses import replace

import mpmath as mp
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import expm

import mbsvib as mv
from mbsvib.equations.batch_equations import of_variant
from mbsvib.linalg.products import single_entries
from mbsvib.linalg.rank import EPS
from mbsvib.modes import modes
from mbsvib.modes import undamped as ladder
from mbsvib.modes.batch_damped import undamped_batch
from mbsvib.modes.undamped import cleaned, undamped
from tests.support.unsymmetric import eigenvalues


def network(n, seed=0):
    """Sliding masses with springs to ground and to each other: many elastic rows, most with two entries."""
    rng = np.random.default_rng(seed)
    model = mv.Model("network")
    for i in range(n):
        model.add_body(f"b{i}", rng.uniform(0.5, 2.0), (1, 1, 1), position=(0, 0, i))
        model.add_joint(f"j{i}", "prismatic", "ground", f"b{i}", axis=(0, 0, 1))
        model.add_spring(f"g{i}", "ground", f"b{i}", (0, 0, -1), (0, 0, i), stiffness=rng.uniform(10, 100))
        for j in rng.choice(i, min(i, 4), replace=False):
            model.add_spring(f"s{i}.{j}", f"b{i}", f"b{j}", (0, 0, i), (0, 0, j), stiffness=rng.uniform(100, 1000))
    return model


SCENES = {
    "chain of 30": lambda: mv.library.chain(30, line=(0, 1, 0)),
    "chain of 120": lambda: mv.library.chain(120, line=(0, 1, 0)),
    "tree": lambda: mv.library.tree(6), "ladder": lambda: mv.library.ladder(30),
    "spherical chain": lambda: mv.library.chain(20, "spherical", line=(0, 1, 0)), "network": lambda: network(80),
}  # fmt: skip


def off(result, best):
    """Relative errors of the frequencies."""
    return np.abs(np.sqrt(result.square / best.square) - 1.0)


@pytest.mark.few(8)
@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("rtol", [1e-4, 1e-8, 1e-10, 1e-12])
def test_the_bound_holds_and_is_not_wasteful(scene, rtol):
    """Within what was asked; above the error, and not thousands of times above the largest error as it once was."""
    system = SCENES[scene]().linearize()
    best = undamped(system, 1e-15)
    result = undamped(system, rtol, clean=False)
    error = off(result, best)
    assert result.errors.max() <= rtol
    assert (error <= result.errors + best.errors).all()
    assert result.errors.max() <= 1000 * max(error.max(), 1e-14)


@pytest.mark.parametrize("scene", sorted(SCENES.keys() - {"spherical chain"}))  # its frequencies are equal in pairs
def test_frequencies_in_doubt_alone_are_taken_from_the_factors(scene, monkeypatch):
    """No refinement is run for frequencies, and the cleaned shapes give the same ones."""
    system = SCENES[scene]().linearize()
    full = undamped(system, 1e-12)
    with monkeypatch.context() as patch:
        patch.setattr(ladder, "refined", None)
        result = undamped(system, 1e-12, clean=False)
    assert (off(result, full) <= result.errors + full.errors).all()
    assert_allclose(np.abs(np.einsum("ij,ij->j", result.shapes, system.M @ full.shapes)), 1.0, atol=1e-9)


def test_responses_get_clean_shapes():
    """The modes of a long chain are good to ten digits at first, and to what responses need once one is asked for."""
    system = mv.library.chain(150, line=(0, 1, 0)).linearize()
    first = system.modes()
    assert first.mixed > 1e-11
    assert system.basis.response_modes.mixed <= 1e-13
    shapes = system.basis.response_modes.shapes
    w = system.inertia_factor @ shapes
    assert_allclose(w.T @ w, np.eye(system.dof), atol=1e-12)
    e = system.elastic_rows @ shapes * np.sqrt(system.row_stiffness)[:, None]
    scale = np.sqrt((e * e).sum(axis=0))
    assert_allclose((e / scale).T @ (e / scale), np.eye(system.dof), atol=1e-9)


def test_short_chains_are_clean_from_the_start():
    system = mv.library.chain(4, line=(0, 1, 0)).linearize()
    assert system.basis.response_modes is system.basis.modes


def test_damping_that_couples_modes_asks_for_clean_shapes():
    model = mv.library.chain(100, line=(0, 1, 0))
    model = model.with_values({"spring7.damping.rz": 3.0})
    assert modes(model.linearize(), 1e-10, clean=False).mixed == 0.0


def test_repeated_frequencies_are_refined():
    """What the quotient of a mode leaves out is divided by the distance to the next: equal ones need the other way."""
    model = mv.Model("equal")
    below = {"x": "ground", "y": "ground"}
    for i in range(40):
        for axis, direction in (("x", (1, 0, 0)), ("y", (0, 1, 0))):
            name = f"{axis}{i}"
            model.add_body(name, 1.0, (1, 1, 1), position=(i, i, 0))
            model.add_joint(f"j{name}", "prismatic", below[axis], name, axis=direction)
            model.add_bushing(f"k{name}", below[axis], name, (i, i, 0), (1e4, 1e4, 0, 0, 0, 0))
            below[axis] = name
    result = undamped(model.linearize(), 1e-14, clean=False)
    exact = 2 * 100.0 * np.sin((2 * np.arange(1, 41) - 1) * np.pi / (2 * 81))
    assert_allclose(result.omega, np.repeat(exact, 2), rtol=3e-15)
    assert (np.abs(result.omega / np.repeat(exact, 2) - 1) <= result.errors + 4e-16).all()


def test_rows_with_one_entry():
    rows = np.zeros((3, 4))
    rows[[0, 1, 2], [2, 0, 2]] = 1.0, -2.0, 3.0
    assert single_entries(rows).tolist() == [2, 0, 2]
    rows[0, 1] = 1e-300
    assert single_entries(rows) is None
    rows[1] = 0.0
    assert single_entries(rows) is None


def test_coupled_modes_in_a_basis_that_mixes():
    """The eigensolver's shapes are no modes to the last digit, the eigenvalues that are made of them are."""
    system = mv.library.stewart_isolator(payload_mass=10.0).linearize()
    quick, clean = modes(system, 1e-12, clean=False), modes(system, 1e-12)
    assert quick.mixed > 1e-13
    assert clean.mixed == 0.0
    off = np.abs(quick.eigenvalues - clean.eigenvalues)
    assert (off <= (quick.errors + clean.errors) * np.abs(clean.eigenvalues)).all()
    assert_allclose(quick.eigenvalues, clean.eigenvalues, rtol=2e-15, atol=0)
    assert quick.errors.max() <= 1e-12


@pytest.mark.parametrize(("ratio", "share"), [(1e4, 1.0), (1e6, 0.99), (1e6, 1.05)])
def test_nearly_critical_damping_beside_a_stiff_spring_keeps_the_accuracy(ratio, share):
    """Near critical damping an eigenvalue moves up to a hundred times as far as the frequency: both meet 1e-12."""
    model = mv.Model("two")
    stiffness, mass = (100.0, 100.0 * ratio), (1.0, 2.0)
    damping = 2.0 * share * (stiffness[0] * 3.0) ** 0.5
    for i, (below, name) in enumerate((("ground", "a"), ("a", "b"))):
        model.add_body(name, mass[i], (1, 1, 1), position=(0, 0, i + 1))
        model.add_joint(f"j{name}", "prismatic", "ground", name, axis=(0, 0, 1))
        model.add_spring(f"k{name}", below, name, (0, 0, i), (0, 0, i + 1), stiffness[i], damping * (i == 0))
    result = model.linearize().modes()
    assert result.errors.max() <= 1e-12
    k1, k2, m1, m2, c = map(mp.mpf, (*stiffness, *mass, damping))
    with mp.workdps(60):
        exact = mp.polyroots([k1 * k2, c * k2, m1 * k2 + m2 * (k1 + k2), c * m2, m1 * m2], 200, extraprec=200, asc=True)
        for value, error in zip(result.eigenvalues, result.errors.ravel(), strict=True):
            nearest = min(exact, key=lambda root, value=value: abs(root - value))
            assert abs(nearest - mp.mpc(value)) <= error * abs(nearest)


def test_damping_that_commutes_is_told_in_a_basis_that_mixes():
    system = mv.library.stewart_isolator().linearize()
    w, k = system.inertia_factor, system.row_stiffness
    none = np.zeros(len(w))
    rayleigh = replace(
        system, elastic_rows=np.concatenate((system.elastic_rows, w)), row_stiffness=np.concatenate((k, none)),
        row_damping=np.concatenate((1e-5 * k, none + 0.3)), row_owner=np.zeros(len(k) + len(w), dtype=int),
        C=0.3 * system.M + 1e-5 * system.K,
    )  # fmt: skip
    result = modes(rayleigh, 1e-10, clean=False)
    assert result.classical == "damping commutes with mass and stiffness"
    assert_allclose(-result.pairs[:, 0].real, 0.15 + 0.5e-5 * result.natural**2, rtol=1e-9)


@pytest.mark.parametrize("damping", [0.0, 0.3])
@pytest.mark.parametrize("radius", [1e-3, 1e-13])
def test_a_spring_at_a_small_lever_arm_beside_a_free_motion(radius, damping):
    """Units of length change no frequency: sqrt(k r^2 / J), sqrt(k / J) and a wheel that is free."""
    model = mv.Model("wheels")
    for name, below in (("a", "ground"), ("b", "a"), ("c", "ground")):
        model.add_body(name, 1.0, (1, 1, 0.5))
        model.add_joint(f"j{name}", "revolute", below, name, (0, 0, 0))
    model.add_bushing("k", "ground", "b", (0, 0, 0), (0, 0, 0, 0, 0, 8.0), (0, 0, 0, 0, 0, damping))
    model.add_spring("s", "ground", "a", (radius, -radius, 0), (radius, 0, 0), 5.0 / radius**2)
    modes = model.linearize().modes()
    assert modes.rigid == 1
    assert_allclose(modes.natural, [0.0, 10.0**0.5, 4.0], rtol=1e-12)


def rider(light, heavy):
    """Modes of a heavy mass in the coordinate between it and a light one; each is held by a spring of its own."""
    model = mv.Model("rider")
    for first, name, z in (("ground", "light", 1.0), ("light", "heavy", 2.0)):
        model.add_body(name, 1.0, (1, 1, 1), position=(0, 0, z))
        model.add_joint(f"rail.{name}", "prismatic", first, name, axis=(1, 0, 0))
        model.add_bushing(f"k.{name}", "ground", name, position=(0, 0, z), stiffness=(100.0, 0, 0, 0, 0, 0))
    values = {"light.mass": light, "heavy.mass": heavy, "k.heavy.stiffness.x": 200.0 * heavy}
    return model.linearize(values=values).modes()


@pytest.mark.parametrize("ratios", [(1e2,) * 3, (1e4,) * 3, (1e6,) * 3, (1.0, 1e2, 1e6), (1e6, 1.0, 1e4)])
def test_a_heavy_mass_that_rides_on_a_light_one_in_a_batch(ratios):
    """In the coordinate between them M is ill-conditioned; each is held by a spring of its own: k / m, exactly."""
    light, heavy = np.array([1.0, 1.3, 1.7]), np.array(ratios)
    modes = rider(light, heavy)
    exact = np.sqrt(np.stack((100.0 / light, np.full(3, 200.0)), axis=1))
    off = np.abs(modes.natural / exact - 1.0)
    assert (off <= modes.errors[:, 0::2]).all()
    assert off.max() <= 1e-15


@pytest.mark.parametrize("order", [[1, 2, 0], [2, 1, 0]])
def test_bounds_of_a_variant_depend_on_no_other(order):
    light, heavy = np.array([1.0, 1.3, 1.7]), np.array([1.0, 1e2, 1e6])
    modes, other = rider(light, heavy), rider(light[order], heavy[order])
    assert_allclose(other.errors, modes.errors[order], rtol=1e-9)
    assert_allclose(other.natural, modes.natural[order], rtol=1e-15)


@pytest.mark.few(2)
@pytest.mark.parametrize("rtol", [1e-6, 1e-8])
@pytest.mark.parametrize(("soft", "stiff", "between"), [(1e4, 1e10, 1e-2), (1e4, 1e10, 1e-1), (1.0, 1e8, 1e-7),
                                                        (1.0, 1e8, 1e-9)])  # fmt: skip
def test_errors_of_nearly_equal_frequencies(soft, stiff, between, rtol):
    """A weak spring decides the modes of two equal chains: bounds hold, to 60 digits, also where the rounding of stiff
    joints mixes the shapes by any angle, and are close.
    """
    model = mv.Model("two chains")
    for axis, direction in (("x", (1, 0, 0)), ("y", (0, 1, 0))):
        for i, (mass, share) in enumerate(((1.3, 0.0), (0.7, 1.7), (1.1, 0.6), (0.9, 1.2))):
            below, k = f"{axis}{i - 1}" if i else "ground", stiff * share if i else soft
            model.add_body(f"{axis}{i}", mass, (1, 1, 1), position=(i, i, 0))
            model.add_joint(f"j{axis}{i}", "prismatic", below, f"{axis}{i}", axis=direction)
            model.add_bushing(f"k{axis}{i}", below, f"{axis}{i}", (i, i, 0), (*(k * np.array(direction)), 0, 0, 0))
    model.add_spring("c", "x3", "y3", (-1, 0, 0), (0, 1, 0), between)
    system = model.linearize()
    exact = np.sort([float(value.imag) for value in eigenvalues(system) if value.imag > 0])
    batch = model.linearize(values={"c.stiffness": [between] * 2}).modes(rtol)
    quick = undamped(system, rtol, clean=False)
    for omega, errors in ((quick.omega, quick.errors), (batch.natural[1], batch.errors[1, ::2])):
        error = np.abs(omega / exact - 1.0)
        assert (error <= errors + 1e-15).all()
        assert errors.max() <= rtol
        assert errors.max() <= 1e4 * max(error.max(), 1e-14)


def test_large_rotations_of_shapes_in_a_batch():
    """Shapes that mix by some percent are rotated by exp(angle) to third order, and stay orthonormal to rounding."""
    a = np.random.default_rng(0).normal(size=(2, 4, 4))
    angle = np.array([[[1e-2]], [[1e-7]]]) * (a - a.swapaxes(1, 2))
    rotated = cleaned(*np.tile(np.eye(4), (2, 2, 1, 1)), angle)
    assert_allclose(rotated @ rotated.swapaxes(1, 2), np.tile(np.eye(4), (2, 1, 1)), atol=1e-15)
    assert_allclose(rotated[0], expm(angle[0]), atol=2e-5)
    assert_allclose(rotated[1], expm(angle[1]), atol=1e-15)


@pytest.mark.parametrize("clean", [False, True])
def test_errors_of_quotients_include_the_rounding_of_their_roots_and_sums(clean):
    """Masses on springs, sqrt(k / m), of which roots, products and quotient happen to be rounded in one direction: both
    roots, their products with the shape and its quotient take half a rounding each, squares a quarter.
    """
    numbers = np.array([[1.0973565284571143, 1.0820926829229462], [1.0459891903123704, 1.0229285088092035]])
    model = mv.Model("soft and stiff")
    for name, stiffness in (("soft", 1.0), ("stiff", 1e7)):
        model.add_body(name, 1.0, (1, 1, 1))
        model.add_joint(f"{name}.j", "prismatic", "ground", name, axis=(0, 0, 1))
        model.add_spring(f"{name}.k", "ground", name, (0, 0, -1), (0, 0, 0), stiffness=stiffness)
    values = {"soft.k.stiffness": numbers[:, 0], "soft.mass": numbers[:, 1]}
    batch = model.linearize(values=values)
    several = undamped_batch(batch, 1e-15)
    for i, (k, m) in enumerate(numbers.tolist()):
        single = undamped(of_variant(batch, i), 1e-10, clean=clean)
        with mp.workdps(40):
            exact = mp.sqrt(mp.mpf(k) / mp.mpf(m))
            results = (single.omega[0], single.errors[0]), (np.sqrt(several.square[i, 0]), several.errors[i, 0])
            for omega, error in results:
                assert abs(mp.mpf(float(omega)) / exact - 1) <= error
                assert 2.75 * EPS <= error <= 5 * EPS


@pytest.mark.parametrize("count", [33, 200])
def test_errors_of_sums_over_many_equal_springs(count):
    """sqrt(n k / m): roundings of the partial sums may all go one way, up to n / 16 units of the last digit."""
    model = mv.Model("many equal springs")
    for name, stiffness, springs in (("soft", 1.0, count), ("stiff", 1e9, 1)):  # the soft one is refined
        model.add_body(name, 1.0, (1, 1, 1))
        model.add_joint(f"{name}.j", "prismatic", "ground", name, axis=(0, 0, 1))
        for i in range(springs):
            model.add_spring(f"{name}.k{i}", "ground", name, (0, 0, -1), (0, 0, 0), stiffness=stiffness)
    rng = np.random.default_rng(1)
    k, m = rng.uniform(1.0, 4.0, 500), rng.uniform(1.0, 4.0, 500)
    batch = model.linearize(values={"soft.k*.stiffness": k, "soft.mass": m})
    exact = np.sqrt(count * k.astype(np.longdouble) / m)
    found = undamped_batch(batch, 1e-15)
    off = np.abs(np.sqrt(found.square[:, 0]) / exact - 1.0).astype(float)
    assert (off <= found.errors[:, 0]).all()
    for i in np.argsort(off)[-3:].tolist():
        for clean in (False, True):
            alone = undamped(of_variant(batch, i), 1e-10, clean=clean)
            assert abs(float(alone.omega[0] / exact[i] - 1.0)) <= alone.errors[0] < 20.0 * EPS
