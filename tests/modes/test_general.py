"""Modes without symmetry: every eigenvalue against 60 digits, bounds that hold, exact zeros and exact axes."""

from dataclasses import replace

import mpmath as mp
import numpy as np
import pytest

import mbsvib as mv
from mbsvib.modes.energy_state import energy_state
from mbsvib.modes.general import _inverse, _separated
from mbsvib.modes.strong_damping import DamperForces, improved
from mbsvib.modes.undamped import undamped
from tests.hunt.checks import CHECKS, Subject
from tests.hunt.generate import example
from tests.support.sizes import few
from tests.support.unsymmetric import chain, eigenvalues, massless, unsymmetric, worst

FAMILIES = {
    "spin and dampers": lambda seed: unsymmetric(chain(5, seed), 1.0, 0.0, seed),
    "spin": lambda seed: unsymmetric(chain(5, seed, damp=0.0), 1.0, 0.0, seed),
    "fast spin": lambda seed: unsymmetric(chain(5, seed, damp=0.0), 1e3, 0.0, seed),
    "follower loads": lambda seed: unsymmetric(chain(5, seed), 0.0, 20.0, seed),
    "all": lambda seed: unsymmetric(chain(5, seed), 3.0, 20.0, seed),
    "flutter": lambda seed: unsymmetric(chain(5, seed, damp=0.0), 0.0, 1000.0, seed),
    "wide": lambda seed: unsymmetric(chain(5, seed, span=3.0), 1.0, 0.0, seed),
    "free": lambda seed: unsymmetric(chain(5, seed, ground=False), 1.0, 0.0, seed),
    "free, spin, strong dampers": lambda seed: unsymmetric(chain(5, seed, damp=1e4, ground=False), 30.0, 0.0, seed),
    "negative stiffness": lambda seed: unsymmetric(chain(5, seed, damp=0.0, sign=-1.0), 100.0, 0.0, seed),
    "negative stiffness and dampers": lambda seed: unsymmetric(chain(5, seed, sign=-1.0), 100.0, 0.0, seed),
    "massless": lambda seed: massless(chain(6, seed, damp=3.0), [2]),
    "massless ones": lambda seed: massless(chain(6, seed, damp=30.0), [1, 3, 4]),
    "massless and spin": lambda seed: massless(unsymmetric(chain(6, seed, damp=3.0), 1.0, 0.0, seed), [1, 3]),
    "massless and all": lambda seed: massless(unsymmetric(chain(6, seed, damp=3.0), 1.0, 9.0, seed), [2, 3, 5]),
    "massless and free": lambda seed: massless(chain(6, seed, damp=3.0, ground=False), [1, 4]),
}  # fmt: skip


@pytest.mark.few(5)
@pytest.mark.parametrize("seed", few(range(3), 1))
@pytest.mark.parametrize("family", FAMILIES)
def test_against_many_digits(family, seed):
    system = FAMILIES[family](seed)
    error, ratio = worst(system.modes(), eigenvalues(system))
    assert error <= 1e-12
    assert ratio <= 1.0
    assert system.modes().errors.max() <= 1e-10


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
def test_spin_keeps_energy(size):
    """Without dampers every eigenvalue is imaginary, to the last bit."""
    values = unsymmetric(chain(7, 1, damp=0.0), size).modes().eigenvalues
    assert not values.real.any()
    np.testing.assert_array_equal(values[0::2], values[1::2].conj())


def test_spin_stabilises_negative_stiffness():
    """m q'' + g J q' - k q = 0: imaginary for g > 2 sqrt(k m), a growing spiral below."""
    base = chain(2, 0, damp=0.0)
    w, rows = np.zeros_like(base.inertia_factor[:2]), np.eye(2)
    w[:, :] = np.eye(2)
    system = replace(base, inertia_factor=w, M=np.eye(2), elastic_rows=rows, row_stiffness=np.array([-4.0, -4.0]),
                     row_damping=np.zeros(2), K=-4.0 * np.eye(2), row_owner=np.zeros(2, dtype=int))  # fmt: skip
    for g in (4.1, 40.0, 3.9):
        spin = np.array([[0.0, g], [-g, 0.0]])
        values = replace(system, gyroscopic=spin, C=spin).modes().eigenvalues
        inside = g * g / 4.0 - 4.0
        if inside > 0.0:
            exact = np.array([g / 2.0 - np.sqrt(inside), g / 2.0 + np.sqrt(inside)])
            assert not values.real.any()
            np.testing.assert_allclose(values.imag[0::2], exact, rtol=1e-12)
        else:
            np.testing.assert_allclose(np.sort(values.real), np.sqrt(-inside) * np.array([-1, -1, 1, 1]), rtol=1e-12)


@pytest.mark.parametrize("beyond", [1e-2, 1e-6, 1e-8])
def test_spin_that_just_stabilises(beyond):
    """s^4 + (g^2 - 13) s^2 + 36 = 0 in turned coordinates, stable from g = 5 on, where two pairs meet."""
    g = 5.0 * (1.0 + beyond)
    base, stiffness = chain(2, 0, damp=0.0), np.array([-4.0, -9.0])
    half = 0.5 * (g * g - 13.0)
    exact = np.sqrt([36.0 / (half + np.sqrt(half * half - 36.0)), half + np.sqrt(half * half - 36.0)])
    for seed in range(4):
        t = np.eye(2) + 0.5 * np.random.default_rng(seed).normal(size=(2, 2))
        spin = t.T @ np.array([[0.0, g], [-g, 0.0]]) @ t
        spin = 0.5 * (spin - spin.T)
        system = replace(base, inertia_factor=t, M=t.T @ t, elastic_rows=t, row_stiffness=stiffness, gyroscopic=spin,
                         K=t.T @ np.diag(stiffness) @ t, C=spin, row_damping=np.zeros(2), row_owner=np.zeros(2, int),
                         )  # fmt: skip
        modes = system.modes()
        assert not modes.eigenvalues.real.any()
        off = np.abs(modes.eigenvalues.imag[0::2] / exact - 1.0)
        assert off.max() <= 1e-13 / np.sqrt(beyond)
        assert (off <= modes.errors[0::2] + 1e-15 / np.sqrt(beyond)).all()


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_equal_real_eigenvalues_that_rounding_makes_pairs(unit):
    """Four relaxations of one rate: as two conjugate pairs they are still four real eigenvalues, in any unit of time.
    """
    t = np.random.default_rng(0).normal(size=(6, 6))
    back, rates = np.linalg.inv(t), np.array([-1.0, -1.0, -1.0, -1.0, -3.0, -7.0])
    pairs = np.array([[1, 1j, 0, 0, 0, 0], [0, 0, 1, 1j, 0, 0], [0, 0, 0, 0, 1, 0], [0, 0, 0, 0, 0, 1]]).T
    right, left = (v / np.linalg.norm(v, axis=0) for v in (t @ pairs, back.T @ pairs.conj()))
    a, values = (t * rates) @ back, np.array([-1 + 1e-16j, -1 + 2e-13j, -3, -7])
    values, left, right = _separated(unit * a, unit * values, left, right)
    np.testing.assert_allclose(np.sort(values), unit * np.sort(rates), rtol=1e-12)
    np.testing.assert_allclose(a @ right, right * values / unit, atol=1e-12)
    both = left.T @ right
    np.testing.assert_allclose(both, np.diag(np.diag(both)), atol=1e-12)
    # a chain has one vector, and none that are independent
    chained = np.array([[-1.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -3.0]])
    right, left = (np.array(rows, dtype=complex).T for rows in (
        [[1, 0, 0], [1, 1e-14, 0], [0, 0, 1]], [[0, 1, 0], [1e-14, 1, 0], [0, 0, 1]]))  # fmt: skip
    values, left, right = _separated(chained, np.array([-1.0, -1.0, -3.0], dtype=complex), left, right)
    np.testing.assert_allclose(chained @ right, right * values, atol=1e-12)
    np.testing.assert_allclose(chained.T @ left, left * values, atol=1e-12)
    # nor has one that rounding makes a pair: its parts are no two vectors
    right, left = (np.array(rows, dtype=complex).T for rows in ([[1, 1e-8j, 0], [0, 0, 1]], [[1e-8j, 1, 0], [0, 0, 1]]))
    torn = np.array([-1.0 + 1e-14j, -3.0])
    np.testing.assert_array_equal(_separated(chained, torn, left, right)[0], torn)


def test_slow_eigenvalues_of_a_free_system_come_from_an_inverse_where_k_is_symmetric():
    """A with its inverse is the identity off the zeros; forces that turn with a motion leave K without symmetry."""
    system = massless(chain(5, 0, ground=False, damp=3.0), [2])
    state = energy_state(system, 1e-12)
    inverse = _inverse(state)
    off = np.linalg.qr(state.left, mode="complete")[0][:, state.left.shape[1] :]
    projected = inverse - state.right @ (state.left.T @ inverse)
    np.testing.assert_allclose(off.T @ state.a @ off @ (off.T @ projected @ off), np.eye(off.shape[1]), atol=1e-9)
    swirl = np.zeros((5, 5))
    swirl[:3, :3] = [[0.0, 1.0, -1.0], [-1.0, 0.0, 1.0], [1.0, -1.0, 0.0]]
    assert _inverse(energy_state(replace(system, circulatory=swirl, K=system.K + swirl), 1e-12)) is None


def test_zeros_are_exact():
    """A free chain of sliders drifts where spin does not feel it, and comes to rest where dampers do."""
    modes = unsymmetric(chain(5, 2, ground=False, damp=0.0), 1.0).modes()
    assert np.count_nonzero(modes.eigenvalues == 0.0) == 2
    assert modes.rigid == 1
    held = massless(chain(6, 0, damp=3.0), [2, 3]).modes()
    assert len(held.eigenvalues) == 10
    assert len(held) == 6
    assert held.first_order.sum() == 2
    np.testing.assert_array_equal(held.damped_frequencies[held.first_order], 0.0)
    np.testing.assert_allclose(held.damping_ratios[held.first_order], 1.0, rtol=1e-15)
    assert "first order" in str(held)
    assert len(held.nearest(3).eigenvalues) == 6 - held.nearest(3).first_order.sum()


def on_dampers(k, ground):
    """Masses of 1, 2 and 3 kg in a row with springs k, a massless motion beside them, a damper to ground; a free mass.
    """
    model = mv.Model("free")
    masses = {"a": 1.0, "b": 2.0, "c": 3.0, "n": 0.0, "free": 1.0}
    for i, (name, mass) in enumerate(masses.items()):
        model.add_body(name, mass, np.eye(3) * mass, (0, 0, i))
        model.add_joint(f"rail {name}", "prismatic", "ground", name, axis=(1, 0, 0))
    for first, second, stiffness, damping in (("ground", "a", 0.0, ground), ("a", "b", k, 0.0), ("b", "c", k, 0.0),
                                              ("a", "n", 2.0 * k, 0.0), ("n", "b", 0.0, k**0.5)):  # fmt: skip
        if stiffness or damping:
            model.add_bushing(f"{first}{second}", first, second, (0, 0, 0), (stiffness, 0, 0, 0, 0, 0),
                              (damping, 0, 0, 0, 0, 0))  # fmt: skip
    return model.linearize(), np.array(list(masses.values()))


@pytest.mark.parametrize(("k", "ground", "zeros"), [
    (1e-12, 0.0, 4), (1.0, 0.0, 4), (1e12, 0.0, 4), (1e10, 1.0, 3), (1.0, 1e10, 3)])  # fmt: skip
def test_chains_of_zeros_are_told_in_any_unit_of_time(k, ground, zeros):
    """What drifts is a chain of two zeros, what a damper stops one zero: A moves the rates of a chain to its motion."""
    state = energy_state(on_dampers(k, ground)[0], 1e-12)
    assert (state.right.shape[1], state.null_count) == (zeros, 2)
    assert np.count_nonzero(state.nilpotent[:2, 2:].any(axis=0)) == zeros - 2
    assert not state.nilpotent[2:].any()
    assert not state.nilpotent[:, :2].any()


@pytest.mark.parametrize(("k", "ground"), [(1.0, 1e8), (1e10, 1e10), (1e10, 1e-6)])
def test_the_damper_to_ground_carries_the_momentum_of_every_mode(k, ground):
    """lambda sum m phi + c phi_a = 0, where the motion that comes to rest is in no other mode."""
    system, masses = on_dampers(k, ground)
    modes = system.modes()
    moving = modes.pairs[:, 0] != 0.0
    value, shapes = modes.pairs[moving, 0], modes.shapes[:, moving]
    size = np.abs(value) * (masses @ np.abs(shapes)) + ground * np.abs(shapes[0])
    np.testing.assert_array_less(np.abs(value * (masses @ shapes) + ground * shapes[0]), 1e-13 * size)


def test_zeros_of_massless_motions_are_no_pairs():
    """A disk that spins about a fixed point comes to rest at any tilt, and so do two bodies without mass on dampers."""
    model = mv.Model("gyroscope")
    model.add_body("disk", 2.0, (0.5, 0.5, 0.8), (0, 0, 0))
    model.add_joint("centre", "spherical", "ground", "disk", (0, 0, 0))
    model.add_rotor("spin", "disk", 30.0, (0, 0, 1))
    for i in range(2):
        model.add_body(f"b{i}", 0.0, (0, 0, 0), (0, 0, 1.0 + i))
        model.add_joint(f"rail{i}", "prismatic", "ground", f"b{i}", axis=(1, 0, 0))
        model.add_bushing(f"c{i}", "ground", f"b{i}", position=(0, 0, 1.0 + i), damping=(3.0, 0, 0, 0, 0, 0))
    modes = model.linearize().modes()
    assert len(modes) == 5
    assert modes.first_order.sum() == 2
    assert modes.rigid == 4
    assert np.count_nonzero(modes.eigenvalues == 0.0) == 6
    np.testing.assert_allclose(modes.natural[-1], 30.0 * 0.8 / 0.5, rtol=1e-13)


def behind_a_damper(**values):
    """A mass of 1 kg on 1 N/m, with 10 N/m behind 10/6 N s/m beside it: (s + 1) (s + 2) (s + 3) = 0."""
    model = mv.Model("maxwell")
    for i, name in enumerate(("mass", "node")):
        model.add_body(name, 1.0 - i, np.eye(3) * (1 - i), (0, 0, i))
        model.add_joint(f"{name}.rail", "prismatic", "ground", name, axis=(1, 0, 0))
    model.add_bushing("spring", "ground", "mass", (0, 0, 0), (1.0, 0, 0, 0, 0, 0))
    model.add_bushing("behind", "mass", "node", (0, 0, 0), (10.0, 0, 0, 0, 0, 0))
    model.add_bushing("damper", "ground", "node", (0, 0, 0), damping=(10.0 / 6.0, 0, 0, 0, 0, 0))
    return model.linearize(values=values or None)


def test_real_eigenvalues_of_one_shape_are_paired_by_their_ratio():
    """Of -1, -2 and -3, with the same motion of the mass, the last two are the nearest as a share."""
    modes = behind_a_damper().modes()
    np.testing.assert_allclose(modes.pairs, [[-1.0, -1.0], [-2.0, -3.0]], rtol=1e-12)
    assert modes.first_order.tolist() == [True, False]


def test_modes_of_first_order_in_a_batch():
    """One eigenvalue each, in variants as in a single system: roots of s^3 + 6 s^2 + (k + 10) s + 6 k."""
    k = np.array([1.0, 1.4, 5.0, 30.0])
    modes = behind_a_damper(**{"spring.stiffness.x": k}).modes()
    assert modes.eigenvalues.shape == (4, 3)
    for values, stiffness in zip(modes.eigenvalues, k, strict=True):
        np.testing.assert_allclose(np.sort_complex(values), np.sort_complex(
            np.roots([1.0, 6.0, stiffness + 10.0, 6.0 * stiffness])), rtol=1e-12)  # fmt: skip
    assert [variant.first_order.sum() for variant in modes] == [1] * 4


@pytest.mark.few(1)
@pytest.mark.parametrize("held", [True, False])
def test_a_shaft_that_is_light_against_its_disk(held):
    """Masses over twelve decades: the vectors of the first step are not accurate, whether or not motions are free."""
    model = mv.Model("fan")
    model.add_body("disk", 12.0, (0.1, 0.1, 0.19), position=(0, 0, 0.4))
    if not held:
        model.add_body("hub", 30.0, (0.3, 0.3, 0.3), position=(0, 0, 0))
    model.add_beam("shaft", "ground" if held else "hub", "disk", {"type": "circle", "radius": 0.015},
                   {"E": 2.1e11, "nu": 0.3, "rho": 1e-6}, start=(0, 0, 0), end=(0, 0, 0.4), elements=2)  # fmt: skip
    model.add_rotor("wheel", "disk", 300.0, (0, 0, 1), inertia=0.19)
    system = model.linearize()
    error, ratio = worst(system.modes(), eigenvalues(system))
    assert error <= 1e-14
    assert ratio <= 1.0


def test_shapes_solve_the_equations():
    system = unsymmetric(chain(6, 4), 2.0, 10.0)
    modes = system.modes()
    for value, shape in zip(modes.pairs[:, 0], modes.shapes.T, strict=True):
        terms = [value**2 * system.M @ shape, value * system.C @ shape, system.K @ shape]
        assert np.abs(sum(terms)).max() <= 1e-13 * max(np.abs(term).max() for term in terms)


def braked(n, seed, strength, every):
    """A chain of like masses with dampers ``strength`` times critical at some places and weak ones elsewhere."""
    rng = np.random.default_rng(seed)
    model = mv.Model("braked")
    for i in range(n):
        model.add_body(f"b{i}", rng.uniform(0.5, 2.0), (0.1, 0.1, 0.1), position=(0, 0, i + 1.0))
        model.add_joint(f"j{i}", "prismatic", "ground", f"b{i}", axis=(1, 0, 0))
        c = strength * 200.0 * rng.uniform(0.1, 1.0) if i % every == 0 else rng.uniform(0.0, 1.0)
        k = 1e4 * rng.uniform(0.5, 2.0)
        model.add_bushing(f"k{i}", f"b{i - 1}" if i else "ground", f"b{i}", position=(0, 0, i + 0.5),
                          stiffness=(k, 0, 0, 0, 0, 0), damping=(c, 0, 0, 0, 0, 0))  # fmt: skip
    return model.linearize()


@pytest.mark.few(2)
@pytest.mark.parametrize("every", [1, 2, 3])
@pytest.mark.parametrize("strength", [1e2, 1e4, 1e6, 1e8, 1e10])
def test_strong_dampers(strength, every):
    """Symmetric systems that strong dampers leave in doubt come out as well, whatever creeps or swings beside them."""
    for seed in range(2):
        system = braked(7, seed, strength, every)
        modes = system.modes(rtol=1e-12)
        error, ratio = worst(modes, eigenvalues(system))
        assert error <= 1e-12
        assert ratio <= 1.0
        assert modes.errors.max() <= 1e-12


# masses, and stiffnesses and dampings of the elements below each, of which the first holds the chain at the ground
LOOSE_CHAINS = {
    "like masses": ((1, 1, 1), (0, 1e3, 0), (1e-3, 1, 8.072e7)),
    "free": ((1.312, 0.943, 1.213, 1.41), (0, 164.138, 104.802, 0), (0, 0, 3.937e12, 1e-3)),
    "many decades": ((0.01988, 0.06286, 0.03477, 0.0128, 13.95, 0.4196, 47.97),
                     (28130, 10270, 0, 739, 3445, 3205, 5.012e6), (0, 1, 1e-3, 6.954e8, 1, 0, 1)),
    "equal relaxations": ((1,) * 5, (0, 1e3, 1e3, 1e3, 1e3), (1e-3, 3.56e10, 1, 0, 3.56e10)),
    "negative damper": ((1, 2, 3, 1), (1e3, 1e3, 2e3, 1e3), (0.3, 1e9, -0.1, 2)),
}  # fmt: skip


def loose_chain(masses, stiffness, damping):
    """Sliders along x with forces and displacements as ports, the first held by the first element if it has values."""
    model = mv.Model("loose")
    for i, (mass, k, c) in enumerate(zip(masses, stiffness, damping, strict=True)):
        model.add_body(f"b{i}", mass, (0.1, 0.1, 0.1), position=(0, 0, i))
        model.add_joint(f"j{i}", "prismatic", "ground", f"b{i}", axis=(1, 0, 0))
        if k or c:
            model.add_bushing(f"k{i}", f"b{i - 1}" if i else "ground", f"b{i}", (0, 0, i), (k, 0, 0, 0, 0, 0),
                              (c, 0, 0, 0, 0, 0))  # fmt: skip
        model.add_input(f"F{i}", f"b{i}", "x")
        model.add_output(f"x{i}", f"b{i}", "x")
    return model.linearize()


@pytest.mark.few(2)
@pytest.mark.parametrize("name", LOOSE_CHAINS)
def test_strong_dampers_in_loose_chains(name):
    """A strong damper locks some parts, others rest or swing: eigenvalues and responses, to many digits."""
    masses, stiffness, damping = LOOSE_CHAINS[name]
    system = loose_chain(masses, stiffness, damping)
    modes = system.modes(rtol=1e-12)
    error, ratio = worst(modes, eigenvalues(system))
    assert error <= 1e-12
    assert ratio <= 1.0
    assert modes.errors.max() <= 1e-11
    omega = np.array([3.0, 40.0])
    n, rows = len(masses), np.eye(len(masses)) - np.eye(len(masses), k=-1)
    with mp.workdps(40):
        for k, w in enumerate(omega):
            dynamic = mp.matrix(rows.T) * mp.diag([mp.mpc(a, w * b) for a, b in zip(stiffness, damping, strict=True)])
            dynamic = dynamic * mp.matrix(rows) - mp.diag([mp.mpf(w) ** 2 * m for m in masses])
            exact = np.array((dynamic**-1).tolist(), dtype=complex).reshape(n, n)
            result = system.frequency_response(omega)[:, :, k]
            np.testing.assert_allclose(result, exact, rtol=0, atol=1e-8 * np.abs(exact).max())


# stiffnesses and dampings of the elements below unit masses
RELAXATIONS = {
    "beside rigid-body modes": ((0, 1e3, 0, 1e3, 10, 0, 1e3), (1e-3, 1, 3.78375e6, 1e-3, 3.78375e6, 0, 3.78375e6)),
    "that meet": ((0, 1e3, 0, 1e3), (1e-3, 8.7428e7, 8.7428e7, 8.7428e7)),
    "that are hardly apart": (
        (1e3, 0, 0, 1e3, 0), (3654852.5886995066, 1, 1e-3, 3654852.5886995066, 3654852.5886995066)),
    "far below the others": ((0, 1e3, 0, 1e3, 10, 1e3), (1e-3, 1e-3, 100649080.43271133, 1e-3, 100649080.43271133, 1)),
    "of which rounding hides zeros": (
        (1e3, 0, 0, 1e3, 10, 0, 10), (1.015118272989e9, 1.015118272989e9, 1, 1e-3, 1, 1.015118272989e9, 1)),
}  # fmt: skip


@pytest.mark.filterwarnings("ignore::mbsvib.errors.AccuracyWarning")
@pytest.mark.parametrize("name", RELAXATIONS)
def test_bounds_hold_for_relaxations(name):
    """Strong dampers with springs beside them relax slowly, several of them alike: errors stay below their bounds."""
    stiffness, damping = RELAXATIONS[name]
    system = loose_chain((1,) * len(stiffness), stiffness, damping)
    assert worst(system.modes(rtol=1e-12), eigenvalues(system))[1] <= 1.0


@pytest.mark.slow
def test_many_strong_dampers_agree_with_their_forces_as_unknowns():
    """Two roads: right and left vectors on the factors, and Aberth's iteration with the dampers' forces."""
    system = braked(60, 0, 1e6, 3)
    modes = system.modes()
    assert modes.errors.max() <= 1e-12
    used = system.row_damping != 0.0
    basis = undamped(system, 1e-12)
    rows = (system.elastic_rows[used] @ basis.shapes) * np.sqrt(system.row_damping[used])[:, None]
    values = modes.eigenvalues * (1.0 + 1e-6 * np.cos(np.arange(len(modes.eigenvalues))))
    values[1::2] = np.where(values[1::2].imag != 0.0, values[0::2].conj(), values[1::2])
    other, _, _, errors, _ = improved(DamperForces(basis.square, rows, 0), values, np.full(len(values), 1e-5), 1e-13)
    away = np.abs(other - modes.eigenvalues) / np.abs(modes.eigenvalues)
    assert (away <= modes.errors + errors).all()
    assert away.max() <= 1e-10


def ziegler(thrust, damping=0.0):
    """Two rods without mass on torsion springs with masses 2 and 1 at their ends and a thrust that turns along."""
    model = mv.Model("column")
    for name, mass, z in (("a", 2.0, 1.0), ("b", 1.0, 2.0)):
        model.add_body(name, mass, (0, 0, 0), position=(0, 0, z))
        first = "ground" if name == "a" else "a"
        model.add_joint(f"j{name}", "revolute", first, name, position=(0, 0, z - 1.0), axis=(0, 1, 0))
        model.add_bushing(f"k{name}", first, name, position=(0, 0, z - 1.0), stiffness=(0, 0, 0, 0, 1.0, 0),
                          damping=(0, 0, 0, 0, damping, 0))  # fmt: skip
    model.add_load("thrust", "b", force=(0, 0, -thrust), follower=True)
    return model.linearize()


@pytest.mark.parametrize("thrust", [0.5, 2.0, 2.0857, 2.0859, 4.9, 5.0])
def test_flutter_of_a_column(thrust):
    """2 s^4 + (7 - 2 P) s^2 + 1 = 0: flutter from P = 7/2 - sqrt 2 to 7/2 + sqrt 2, divergence beyond."""
    modes = ziegler(thrust).modes()
    square = np.roots([2.0, 7.0 - 2.0 * thrust, 1.0]).astype(complex)
    exact = np.concatenate((np.sqrt(square), -np.sqrt(square)))
    for value, bound in zip(modes.eigenvalues, modes.errors, strict=True):
        assert np.abs(exact - value).min() <= max(1e-12, bound) * abs(value)
    assert modes.stable == (thrust < 3.5 - np.sqrt(2.0))
    assert modes.errors.max() <= 1e-10
    if thrust < 3.5 - np.sqrt(2.0):
        assert not modes.eigenvalues.real.any()


def test_little_damping_destabilises():
    """Equal dampers take the limit from 2.086 to 41/28 (Ziegler): the sign of a small real part is right."""
    for thrust, stable in ((41.0 / 28.0 - 1e-4, True), (41.0 / 28.0 + 1e-4, False)):
        assert ziegler(thrust, 1e-6).modes().stable == stable


@pytest.mark.parametrize("damping", [0.0, 2.0])
@pytest.mark.parametrize("coupling", [
    [[0.0, 30.0], [-30.0, 50.0]], [[0.0, 30.0], [0.0, 50.0]], [[50.0, 30.0], [0.0, 0.0]], [[0.0, 7.0], [-7.0, 0.0]],
    [[0.0, 30.0], [0.0, 0.0]],
])  # fmt: skip
def test_motions_that_only_circulatory_forces_hold(coupling, damping):
    """A seal pushes a slide across its motion; nothing acts along z: eigenvalues by the polynomial of the plane."""
    model = mv.Model("seal")
    for i, (first, name) in enumerate((("ground", "x"), ("x", "y"), ("y", "z"))):
        model.add_body(name, i + 1.0, (1, 1, 1))
        model.add_joint(f"rail {name}", "prismatic", first, name, axis=np.eye(3)[i])
    k, c = np.zeros((6, 6)), np.zeros((6, 6))
    k[:2, :2], c[:2, :2] = coupling, damping * np.eye(2)
    model.add_bushing("seal", "ground", "z", (0, 0, 0), k, c)
    result = model.linearize().modes()
    (kxx, kxy), (kyx, kyy) = coupling
    plane = np.polysub(np.polymul([6.0, damping, kxx], [5.0, damping, kyy]), [kxy * kyx])
    zeros = 2 + len(plane) - len(np.trim_zeros(plane, "b"))
    assert np.count_nonzero(result.eigenvalues == 0.0) == zeros
    exact = np.roots(np.trim_zeros(plane, "b"))
    distance = np.abs(exact[:, None] - result.eigenvalues[result.eigenvalues != 0.0])
    assert distance.shape[0] == distance.shape[1]
    for k in (0, 1):
        assert (distance.min(axis=k, initial=np.inf) <= 3e-12 * np.abs(exact).max(initial=0.0)).all()


@pytest.mark.slow
def test_batches_refuse_variants_with_other_numbers_of_modes():
    """Real eigenvalues of one variant are decays of their own, in the other one they oscillate."""
    with pytest.raises(mv.ResponseError, match="variant 1 belong to 24 modes, those of variant 0 to 25"):
        CHECKS["batch"](Subject(example(48115)))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::mbsvib.UndeterminedForceWarning")
def test_responses_beside_a_free_motion_under_loads():
    """Its stiffness is rounding, so that what others do in it is no error of theirs; against the matrices alone."""
    system, w = example(47191).scene.model().linearize(), 4.44755
    dynamic = system.K + 1j * w * system.C - w * w * system.M
    exact = (system.Cq + 1j * w * system.Cv - w * w * system.Ca) @ np.linalg.solve(dynamic, system.B) + system.D
    assert np.abs(system.frequency_response([w])[:, :, 0] - exact).max() <= 1e-11 * np.abs(exact).max()


@pytest.mark.slow
def test_dampers_that_a_free_motion_moves_by_its_own_rounding():
    """Springs 1e8 times stiffer than the loads leave the free motion off by 1e-11: its damper does not brake it."""
    system = example(52057).scene.model().linearize()
    lower = -np.linalg.solve(system.M, np.hstack((system.K, system.C)))
    values = np.linalg.eigvals(np.vstack((np.eye(system.dof, 2 * system.dof, system.dof), lower)))
    slow, expected = (np.sort(np.abs(part))[:6] for part in (system.modes().eigenvalues, values))
    assert (slow[:2] == 0.0).all()
    assert slow[2:] == pytest.approx(expected[2:], rel=1e-5)


@pytest.mark.slow
def test_vectors_of_eigenvalues_that_are_all_but_exact_do_not_overflow():
    """The sparse equations of a floating mechanism have a decay of 2e-34 1/s beside those that are meant."""
    CHECKS["sparse"](Subject(example(54211)))
