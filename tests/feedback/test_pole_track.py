"""Tracks of poles over a gain against closed forms: the same branches on every grid."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import isolation
from mbsvib.feedback.pole_track import GainSpectrum, Track, _conjugate

GRIDS = (np.array([0.0, 2.0]), np.linspace(0.0, 2.0, 5), np.linspace(0.0, 2.0, 24), np.linspace(0.0, 2.0, 101))


def mixed(*blocks, seed=1):
    """Return a state matrix of blocks in unknown states."""
    from scipy.linalg import block_diag

    matrix = block_diag(*blocks)
    change = np.random.default_rng(seed).normal(size=matrix.shape)
    return np.linalg.solve(change, matrix @ change)


def oscillator(real, imaginary):
    return np.array([[real, imaginary], [-imaginary, real]])


def columns_at_end(at, grid):
    """Return the poles at the last gain of the columns that start with a positive imaginary part, by their starts."""
    poles = Track(at, grid).poles
    up = np.flatnonzero(poles[0].imag > 0.0)
    return poles[-1, up[np.argsort(poles[0, up].imag)]]


@pytest.mark.few(2)
@pytest.mark.parametrize("grid", GRIDS)
def test_poles_that_cross_go_straight_on(grid):
    """In the middle of one step, and in a grid's gain, both poles are at -0.5 + 5j."""

    def at(g):
        return mixed(oscillator(-0.5, 4.0 + g), oscillator(-0.3 - 0.2 * g, 6.0 - g))

    assert columns_at_end(at, grid) == pytest.approx([-0.5 + 6.0j, -0.7 + 4.0j], rel=1e-9)


@pytest.mark.few(2)
@pytest.mark.parametrize("grid", GRIDS)
def test_poles_that_pass_each_other_keep_apart(grid):
    """Real symmetric coupling makes frequencies repel each other: the lower one stays the lower one."""
    coupling = 0.01

    def stiffness(g):
        return np.array([[16.0 + 6.0 * g, coupling], [coupling, 30.0 - 6.0 * g]])

    def at(g):
        return mixed(np.block([[np.zeros((2, 2)), np.eye(2)], [-stiffness(g), np.zeros((2, 2))]]))

    assert columns_at_end(at, grid).imag == pytest.approx(np.sqrt(np.linalg.eigvalsh(stiffness(2.0))), rel=1e-9)


@pytest.mark.few(1)
@pytest.mark.parametrize("grid", GRIDS)
@pytest.mark.parametrize("copies", [1, 2, 3])
def test_a_pair_that_meets_on_the_real_axis_goes_on_to_the_right(grid, copies):
    """s^2 + 2 g s + 1: the poles are -g +- sqrt(g^2 - 1), the same for each copy of the block."""

    def at(g):
        return mixed(*[np.array([[0.0, 1.0], [-1.0, -2.0 * g]])] * copies)

    assert columns_at_end(at, grid) == pytest.approx([-2.0 + np.sqrt(3.0)] * copies, rel=1e-7)


@pytest.mark.few(2)
@pytest.mark.parametrize("grid", GRIDS)
def test_nearly_equal_poles_move_together(grid):
    """A difference of 1e-5 does not ask for steps of 1e-5."""
    calls = []

    def at(g):
        calls.append(g)
        turn = 5.0 + np.sin(g)
        return mixed(oscillator(-g, turn), oscillator(-g, turn * (1.0 + 1e-5)), oscillator(-0.1, 9.0))

    end = 5.0 + np.sin(2.0)
    assert columns_at_end(at, grid) == pytest.approx([-2.0 + end * 1j, -2.0 + end * (1.0 + 1e-5) * 1j, -0.1 + 9j],
                                                     rel=1e-8)  # fmt: skip
    assert len(calls) < 300


def test_poles_ascend_and_conjugates_come_second():
    poles = GainSpectrum(0.0, mixed(oscillator(-1.0, 5.0), np.diag([-3.0]), oscillator(-1.0, 2.0))).poles
    np.testing.assert_allclose(poles, [-1 + 2j, -1 - 2j, -3, -1 + 5j, -1 - 5j], rtol=1e-12)


def test_slopes_of_repeated_poles():
    """Three pairs and two real poles at one place each for gain 0, with slopes of their own."""

    def at(g):
        return mixed(oscillator(-0.5 + 2.0 * g, 4.0 - 3.0 * g), oscillator(-0.5 - g, 4.0 + 5.0 * g),
                     oscillator(-0.5 + 7.0 * g, 4.0), np.diag([-1.0 + 0.5 * g, -1.0 - 8.0 * g]))  # fmt: skip

    spectrum = GainSpectrum(0.0, at(0.0))
    slopes = spectrum.slopes(at(1.0) - at(0.0))
    for start, exact in ((-0.5 + 4j, [2 - 3j, -1 + 5j, 7]), (-0.5 - 4j, [2 + 3j, -1 - 5j, 7]), (-1, [0.5, -8])):
        those = np.sort_complex(slopes[np.abs(spectrum.values - start) < 1e-6])
        np.testing.assert_allclose(those, np.sort_complex(np.array(exact, dtype=complex)), rtol=1e-9)


@pytest.mark.parametrize("size", [2, 3])
@pytest.mark.parametrize("seed", [None, 1, 2, 3, 4, 5])
def test_defective_poles_have_no_slopes(size, seed):
    """A Jordan block, as it is and in turned states, beside copies of a pole, whose slopes are those of their own."""
    from scipy.linalg import block_diag

    matrix = block_diag(-np.eye(size) + np.diag(np.ones(size - 1), 1), -5.0 * np.eye(2))
    change = block_diag(np.arange(1.0, 1.0 + size**2).reshape(size, size), [[2.0, 1.0], [1.0, 2.0]])
    if seed is not None:
        turn = np.random.default_rng(seed).normal(size=matrix.shape)
        matrix, change = (np.linalg.solve(turn, part @ turn) for part in (matrix, change))
    spectrum = GainSpectrum(0.0, matrix)
    slopes, copies = spectrum.slopes(change), np.abs(spectrum.values + 5.0) < 1e-6
    np.testing.assert_array_equal(slopes[~copies], 0.0)
    np.testing.assert_allclose(np.sort_complex(slopes[copies]), [1.0, 3.0], rtol=1e-9)


@pytest.mark.few(2)
@pytest.mark.parametrize(("best", "gain", "height"), [
    (1.13, 1.13, 3.0), (0.7, 0.7, 3.0), (1.92, 1.92, 3.0), (0.05, 0.05, 3.0), (-0.3, 0.0, 2.91), (2.4, 2.0, 2.84),
])  # fmt: skip
def test_the_gain_at_which_a_measure_is_highest(best, gain, height):
    """A parabola of the decay rate, between gains of the grid and beyond both ends; another pole does not count."""

    def at(g):
        return mixed(oscillator((g - best) ** 2 - 3.0, 20.0), oscillator(-0.1, 5.0))

    track = Track(at, np.linspace(0.0, 2.0, 6))
    where, value, poles = track.highest(lambda poles: -np.sort(poles.real, axis=1)[:, 0])
    assert where == pytest.approx(gain, abs=1e-5)
    assert value == pytest.approx(height, rel=1e-9)
    assert min(poles.real) == pytest.approx(-height, rel=1e-9)


def test_the_highest_of_stable_loops_only_and_the_lowest_of_equal_gains():
    """A pole that crosses the imaginary axis at 1.3 while the measure still rises; a plateau from 0.45 to 1.55."""

    def at(g):
        return mixed(oscillator(-1.0 - g, 20.0), oscillator(-0.26 + 0.2 * g, 5.0))

    track = Track(at, np.linspace(0.0, 2.0, 6))
    where, value, _ = track.highest(lambda poles: -np.sort(poles.real, axis=1)[:, 0])
    assert 1.3 - 1e-5 < where <= 1.3 + 1e-9
    assert value == pytest.approx(2.3, abs=1e-5)
    where, value, _ = track.highest(lambda poles: np.minimum(-np.sort(poles.real, axis=1)[:, 0], 1.45))
    assert (where, value) == (pytest.approx(0.45, abs=1e-5), 1.45)
    assert where >= 0.45
    unstable = Track(lambda g: mixed(oscillator(0.1 + g, 5.0)), np.array([0.0, 1.0]))
    where, value, poles = unstable.highest(lambda poles: -poles.real[:, 0])
    assert (where, value) == (0.0, -np.inf)
    assert poles == pytest.approx([0.1 + 5j, 0.1 - 5j], rel=1e-9)


def by_chance(seed):
    """Return a state matrix over the gain: a mechanism with feedback, copies of it, integrators, or anything."""
    chance = np.random.default_rng(seed)
    n, zero = int(chance.integers(2, 7)), np.zeros
    factor, port = chance.normal(size=(n, n)), chance.normal(size=(n, 1))
    stiffness = factor @ factor.T + np.eye(n)
    start = np.block([[zero((n, n)), np.eye(n)], [-stiffness, -0.02 * stiffness]])
    change = np.block([[zero((n, 2 * n))], [zero((n, n)), -port @ port.T]])
    if seed % 4 == 1:
        start, change = (np.kron(np.eye(3), matrix) for matrix in (start, change))
        mix = chance.normal(size=start.shape)
        start, change = (np.linalg.solve(mix, matrix @ mix) for matrix in (start, change))
    elif seed % 4 == 2:
        start = np.block([[start, np.vstack((zero((n, 1)), port))], [zero((1, 2 * n + 1))]])
        change = np.vstack((zero((2 * n, 2 * n + 1)), np.hstack((-port.T, zero((1, n + 1))))))
    elif seed % 4 == 3:
        start, change = chance.normal(size=(2, 2 * n, 2 * n))
    return lambda g: start + g * change


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(16))
def test_branches_of_any_family_are_the_same_on_all_grids(seed):
    at, common = by_chance(seed), np.linspace(0.0, 5.0, 6)
    chance = np.random.default_rng(seed)
    tables = []
    for grid in (common, np.linspace(0.0, 5.0, 51), np.union1d(common, chance.uniform(0.0, 5.0, 20))):
        poles = Track(at, grid).poles
        tables.append(poles[np.abs(grid[:, None] - common).argmin(axis=0)])
    for table in tables[1:]:
        np.testing.assert_allclose(table, tables[0], rtol=1e-6, atol=1e-6 * np.abs(tables[0]).max())


LAWS = [isolation.force_feedback, isolation.velocity_feedback]


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
def test_branches_of_a_symmetric_hexapod_are_the_same_on_all_grids(law):
    """Modes of x and y are equal; with tilting they meet integrators on the real axis, four poles at a time."""
    plant = isolation.actuated(mv.library.stewart_isolator(), "platform")
    common = np.linspace(0.0, 300.0, 11)
    grids = [common, *(np.linspace(0.0, 300.0, n) for n in (31, 101))]
    loci = [isolation.root_locus(plant, lambda g: law(plant, g), grid) for grid in grids]
    tables = [locus.poles[np.abs(locus.gains[:, None] - common).argmin(axis=0)] for locus in loci]
    for table in tables[1:]:
        np.testing.assert_allclose(table, tables[0], rtol=1e-7, atol=1e-6)


@pytest.mark.slow
def test_modes_under_force_feedback_end_near_zeros():
    """The classical root locus: a branch leads from each pole to a zero, or to infinity along an asymptote."""
    plant = isolation.actuated(mv.library.stewart_isolator(), "platform")
    locus = isolation.root_locus(plant, lambda g: isolation.force_feedback(plant, g), [0.0, 300.0, 3e4])
    ends = locus.poles[-1, locus.modes][:6]
    targets = np.sort_complex(locus.zeros[(locus.zeros.imag > 0.0) & (np.abs(locus.zeros) < 200.0)])
    assert ends.imag.min() > 0.0
    assert np.sort_complex(ends.imag) == pytest.approx(np.sort_complex(targets.imag), rel=1e-3)


def test_conjugates_are_told_from_poles_of_one_sign():
    for values, pair in (([-1 - 2j, -1 + 2j], True), ([-1 - 2j, -1 - 2j], False), ([-2, -1], False),
                         ([-1 - 2j, -1 - 3j, -1 + 2j, -1 + 3j], True)):  # fmt: skip
        assert _conjugate(np.array(values)) == pair
