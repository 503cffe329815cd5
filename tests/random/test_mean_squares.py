"""Root mean squares under noise against closed forms, extended precision and integrals by mpmath."""

import re

import control
import mpmath
import numpy as np
import pytest

import mbsvib as mv
from mbsvib import isolation
from mbsvib.random.budget import random
from tests.random.scenes import oscillator, two_masses

M, C, K = 2.0, 3.0, 800.0
W = 2.0 * np.pi


def test_white_noise_on_an_oscillator():
    """E[x^2] = S / (4 c k), E[v^2] = S / (4 c m); white noise reaches an acceleration directly."""
    rms = oscillator().linearize().rms(None, {"F": 0.3})
    np.testing.assert_allclose([rms["x"], rms["v"]], np.sqrt(0.3 / (4.0 * C * np.array([K, M]))), rtol=1e-13)
    assert rms["a"] == rms["a_abs"] == np.inf


def exact(a, b, c):
    """Diagonal of C P C^T, A P + P A^T + B B^T = 0, in 50 digits; by source (outputs, inputs)."""
    with mpmath.workdps(50):
        n = len(a)
        big = mpmath.matrix(n * n)
        for i in range(n):
            for j in range(n):
                for k in range(n):
                    big[i * n + j, k * n + j] += mpmath.mpf(float(a[i, k]))
                    big[i * n + j, i * n + k] += mpmath.mpf(float(a[j, k]))
        result = np.zeros((len(c), b.shape[1]))
        for s in range(b.shape[1]):
            w = mpmath.matrix([-mpmath.mpf(float(x)) * mpmath.mpf(float(y)) for x in b[:, s] for y in b[:, s]])
            p = mpmath.lu_solve(big, w)
            for o in range(len(c)):
                result[o, s] = float(sum(mpmath.mpf(float(c[o, i])) * p[i * n + j] * mpmath.mpf(float(c[o, j]))
                                         for i in range(n) for j in range(n)))  # fmt: skip
    return result


@pytest.mark.parametrize("inputs", [1, 3])
def test_moments_against_extended_precision(inputs):
    """Both ways, by the source and by the output, of stiff equations in bad units."""
    rng = np.random.default_rng(inputs)
    a = rng.normal(size=(4, 4)) - 4.0 * np.eye(4)
    unit = np.array([1.0, 1e5, 1e-4, 10.0])
    a, b, c = a / unit[:, None] * unit, rng.normal(size=(4, inputs)) / unit[:, None], rng.normal(size=(2, 4)) * unit
    space = mv.StateSpace.from_arrays(a, b, c, 0)
    budget = space.budget({f"u{k + 1}": 2.0 for k in range(inputs)})
    parts = [[budget.contributions[y][u] for u in space.inputs] for y in space.outputs]
    np.testing.assert_allclose(np.square(parts), exact(a, b, c), rtol=1e-12)


def test_squares_of_contributions_add_up():
    budget = two_masses().linearize().budget({"F1": 1.0, "F2": isolation.shaped([40.0], [1.0, 40.0], 3.0)})
    for name, parts in budget.contributions.items():
        np.testing.assert_allclose(sum(value**2 for value in parts.values()), budget.rms[name] ** 2, rtol=1e-15)
        np.testing.assert_allclose(list(parts.values()), sorted(parts.values(), reverse=True), rtol=1e-9)


def test_shaped_noise_against_its_density():
    """Filters before the input and behind the output, by moments and by an integral of the same functions."""
    system, pole = two_masses().linearize(), 50.0
    noise, weight = isolation.shaped([pole], [1.0, pole], 2.0), isolation.shaped([1.0, 0.0], [1.0, 9.0])
    by_moments = system.rms(None, {"F1": noise}, weighting=weight)
    density = system.budget({"F1": lambda f: 2.0 / (1.0 + (W * f / pole) ** 2)},
                            weighting=lambda f: 1j * W * f / (1j * W * f + 9.0))  # fmt: skip
    assert 0.0 < density.error < 1e-9
    for name, value in by_moments.items():
        np.testing.assert_allclose(density.rms[name], value, rtol=1e-11)


@pytest.mark.slow
def test_tables_are_powers_of_the_frequency():
    """A light mode within a table of two slopes, against mpmath."""
    points = [(2.0, 1e-3), (3.0, 4e-2), (9.0, 1e-5)]
    c = 0.02
    got = oscillator(c=c).linearize().rms("x", {"F": points})["x"]

    def density(f):
        (f0, s0), (f1, s1) = points[:2] if f < 3.0 else points[1:]
        slope = mpmath.log(mpmath.mpf(s1) / s0) / mpmath.log(mpmath.mpf(f1) / f0)
        return s0 * (f / f0) ** slope / abs(K + 2j * mpmath.pi * f * c - (2 * mpmath.pi * f) ** 2 * M) ** 2

    peak = np.sqrt(K / M) / W
    width = c / (2.0 * M) / W
    stops = sorted({2.0, 3.0, 9.0, peak, *(peak + s * width * 4.0**k for k in range(6) for s in (-1, 1))})
    reference = mpmath.sqrt(mpmath.quad(density, stops))
    np.testing.assert_allclose(got, float(reference), rtol=1e-11)


def test_a_band_cuts_white_noise():
    """Of a filter of first order: S a^2 times the arc tangents."""
    space = mv.StateSpace.from_arrays([[-5.0]], [[1.0]], [[1.0]], 0)
    low, high = 0.2, 3.0
    expected = (np.arctan(W * high / 5.0) - np.arctan(W * low / 5.0)) / (W * 5.0)
    np.testing.assert_allclose(space.rms("y1", {"u1": 1.0}, band=(low, high))["y1"] ** 2, expected, rtol=1e-13)
    np.testing.assert_allclose(space.rms("y1", {"u1": 1.0}, band=(0.0, 1e6))["y1"] ** 2, 0.25 / 5.0, rtol=1e-6)


def test_what_does_not_decay_is_infinite_only_where_it_is_driven_and_seen():
    undamped = two_masses(c1=0.0, c2=0.0).linearize()
    assert set(undamped.rms(None, {"F1": 1.0}).values()) == {np.inf}
    frequencies = undamped.modes().frequencies
    between = [(frequencies[0] * 1.1, 1.0), (frequencies[1] * 0.9, 1.0)]
    assert 0.0 < undamped.rms("x1", {"F1": between})["x1"] < np.inf
    assert undamped.rms("x1", {"F1": [(1.0, 1.0), (20.0, 1.0)]})["x1"] == np.inf
    assert undamped.rms("x1", {"F1": 1.0}, band=(frequencies[0] * 1.1, frequencies[1] * 0.9))["x1"] < np.inf
    # two modes that do not know each other: one decays, the other does not
    a = np.zeros((4, 4))
    a[:2, :2], a[2:, 2:] = [[0.0, 1.0], [-9.0, 0.0]], [[0.0, 1.0], [-16.0, -0.5]]
    b = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 0.0], [0.0, 1.0]])
    c = np.array([[1.0, 0.0, 1.0, 0.0], [0.0, 0.0, 1.0, 0.0]])
    budget = mv.StateSpace.from_arrays(a, b, c, 0).budget({"u1": 2.0, "u2": 2.0})
    assert budget.contributions["y1"]["u1"] == np.inf
    assert budget.contributions["y2"]["u1"] == 0.0
    np.testing.assert_allclose(budget.rms["y2"] ** 2, 1.0 / (2.0 * 0.5 * 16.0), rtol=1e-13)


def test_an_integrator_that_no_output_shows_does_not_count():
    """PI control of a velocity hides a pole at 0: v is exact; the noise of its sensor goes into the integrator."""
    system = oscillator().linearize()
    pi = mv.StateSpace.from_arrays([[0.0]], [[1.0]], [[-20.0]], [[-5.0]], ["v"], ["F"])
    loop = system.feedback(pi, noise=True)
    np.testing.assert_allclose(loop.rms("v", {"F": 1.0})["v"], np.sqrt(1.0 / (4.0 * (C + 5.0) * M)), rtol=1e-12)
    assert loop.rms("x", {"v.noise": 1.0})["x"] == np.inf
    # two free masses, driven and seen from within, and pushed from outside
    free = mv.Model("free")
    for name, x in (("p", 0.0), ("q", 1.0)):
        free.add_body(name, 1.0, (1, 1, 1), position=(0, 0, x))
        free.add_joint(f"{name}.j", "prismatic", "ground", name, axis=(0, 0, 1))
    free.add_spring("k", "p", "q", (0, 0, 0), (0, 0, 1), stiffness=50.0, damping=0.8)
    free.add_input("inner", "q", "z", relative_to="p")
    free.add_input("outer", "q", "z")
    free.add_output("gap", "q", "z", relative_to="p")
    free.add_output("far", "q", "z")
    budget = free.linearize().budget({"inner": 1.0, "outer": 1.0})
    reduced = 0.5  # mass of the relative motion
    np.testing.assert_allclose(budget.contributions["gap"]["inner"] ** 2, 1.0 / (4.0 * 0.8 * 50.0), rtol=1e-12)
    np.testing.assert_allclose(budget.contributions["gap"]["outer"] ** 2, reduced**2 / (4.0 * 0.8 * 50.0), rtol=1e-12)
    assert budget.contributions["far"]["outer"] == np.inf


def test_correlated_sources():
    """A second force that repeats the first one tau later acts as one force does through 1 + exp(-i w tau)."""
    system, tau, table = two_masses().linearize(), 0.05, [(1.0, 1.0), (30.0, 0.2)]

    def delayed(f):
        matrix = np.ones((len(f), 2, 2), dtype=complex)
        matrix[:, 0, 1] = np.exp(1j * W * f * tau)
        matrix[:, 1, 0] = matrix[:, 0, 1].conj()
        return matrix

    budget = system.budget({"F1": table, "F2": table}, correlation=delayed)
    f = np.linspace(1.0, 30.0, 200_001)
    g = system.frequency_response(W * f)
    density = np.exp(np.interp(np.log(f), np.log([1.0, 30.0]), np.log([1.0, 0.2])))
    for row, name in enumerate(system.outputs):
        both = np.abs(g[row, 0] + g[row, 1] * np.exp(-1j * W * f * tau)) ** 2 * density
        np.testing.assert_allclose(budget.rms[name], np.sqrt(np.trapezoid(both, f)), rtol=1e-7)
        signed = sum(np.copysign(value**2, value) for value in budget.contributions[name].values())
        np.testing.assert_allclose(signed, budget.rms[name] ** 2, rtol=1e-13)
        at = system.psd(name, {"F1": table, "F2": table}, f[::20_000], correlation=delayed)
        np.testing.assert_allclose(at[0], both[::20_000], rtol=1e-12)


def test_correlated_white_noise_has_exact_moments():
    """All entries 1: one source of both, the sum of their columns; and a matrix between."""
    system = two_masses().linearize()
    a, b, c = (getattr(system.state_space(), key) for key in "ABC")
    for r in (1.0, -0.4):
        budget = system.budget({"F1": 2.0, "F2": 8.0}, correlation=[[1.0, r], [r, 1.0]])
        turned = b[:, :2] @ np.linalg.cholesky([[1.0, 2.0 * r], [2.0 * r, 4.0 + 1e-300]]) if abs(r) < 1.0 else \
            (b[:, :1] + 2.0 * b[:, 1:2])  # fmt: skip
        expected = exact(a, turned, c).sum(axis=1)
        np.testing.assert_allclose([value**2 for value in budget.rms.values()], expected, rtol=1e-11)
        assert budget.error == 0.0


def test_bands_of_a_free_mass():
    """White noise S in a band: x = F / m w^2 has S (f1^-3 - f2^-3) / (3 m^2 (2 pi)^4), a fourfold pole at 0."""
    model = mv.Model("free")
    model.add_body("b", M, (1, 1, 1))
    model.add_joint("j", "prismatic", "ground", "b", axis=(0, 0, 1))
    model.add_input("F", "b", "z")
    model.add_output("x", "b", "z")
    free = model.linearize()
    for last in (1.5, 3.0, 3.9, 7.5, 400.0):
        exact = (1.0 - last**-3.0) / (3.0 * M**2 * W**4)
        np.testing.assert_allclose(free.rms("x", {"F": 1.0}, (1.0, last))["x"] ** 2, exact, rtol=1e-13)


@pytest.mark.parametrize("c", [1e-6, 1e-9, 1e-10, 1e-12])
def test_a_band_around_a_mode_of_next_to_no_damping(c):
    """S / 4 c k but for the tails. Below a damping ratio of 1e-11 a mode counts as undamped: part of it was missing."""
    got = oscillator(c=c).linearize().rms("x", {"F": 1.0}, (1.0, 10.0))["x"]
    assert got == (np.inf if c < 1e-9 else pytest.approx(0.5 / np.sqrt(c * K), rel=1e-4))


def test_densities_in_a_band_where_a_mode_is_very_light():
    """The integral of a Lorentz peak that a grid of frequencies would miss."""
    c = 1e-6
    got = oscillator(c=c).linearize().rms("x", {"F": [(1.0, 1.0), (10.0, 1.0)]})["x"] ** 2
    np.testing.assert_allclose(got, 1.0 / (4.0 * c * K), rtol=1e-4)  # but for the tails
    mode = np.sqrt(K / M) / W
    whole, *halves = [oscillator(c=c).linearize().rms("x", {"F": 1.0}, band=band)["x"] ** 2
                      for band in ((1.0, 10.0), (1.0, mode), (mode, 10.0))]  # fmt: skip
    np.testing.assert_allclose(whole, got, rtol=1e-12)
    np.testing.assert_allclose(sum(halves), got, rtol=1e-9)


@pytest.mark.parametrize(("noise", "settings", "words"), [
    ({}, {}, "expected the density of each input"),
    ({"G": 1.0}, {}, "has no such input"),
    ({"F": -1.0}, {}, "no less than 0"),
    ({"F*": 1.0, "?2": 2.0}, {}, "'F2' has two densities"),
    ({"F": lambda f: np.ones(3)}, {}, "the function returns the shape"),
    ({"F": lambda f: 1.0 + 1j * f}, {}, "values of the function = .*; expected one real density for each frequency"),
    ({"F": lambda f: -f}, {}, "no less than 0"),
    ({"base": isolation.road_spectrum("A", 20.0)}, {}, "has the unit m/s\\^2"),
    ({"F": [(1.0, 1.0), (2.0, 1.0)]}, {"band": (3.0, 4.0)}, "has no noise"),
    ({"F": 1.0}, {"band": (3.0, 2.0)}, "expected two finite frequencies"),
    ({"F": 1.0, "F2": 1.0}, {"correlation": [[1.0, 2.0], [2.0, 1.0]]}, "not that of any noise"),
    ({"F": 1.0}, {"correlation": [[1.0, 0.0], [0.0, 1.0]]}, "shape \\(2, 2\\)"),
    ({"F": 1.0}, {"weighting": "Wz"}, "iso_2631: name = 'Wz'; expected 'Wk' or 'Wd'"),
    ({"F": 1.0}, {"weighting": {"x": "Wk", "*": "Wd"}}, "has two"),
    ({"F": 1.0}, {"weighting": 3.0}, "expected 'Wk' or 'Wd'"),
    ({"F": 1.0}, {"weighting": [(1.0, 0.0), (2.0, 1.0)]}, "gain above 0"),
    ({"F": 1.0}, {"weighting": mv.StateSpace.from_arrays([[1.0]], [[1.0]], [[1.0]], [[0.0]])}, "does not decay"),
])  # fmt: skip
def test_refusals(noise, settings, words):
    with pytest.raises(mv.ResponseError, match=words):
        oscillator().linearize().rms("x", noise, **settings)


def test_an_unstable_system_is_refused():
    with pytest.raises(mv.ResponseError, match="grows"):
        oscillator(c=-1.0).linearize().rms("x", {"F": 1.0})
    with pytest.raises(mv.ResponseError, match="grows"):
        oscillator(c=-1.0).linearize().rms("x", {"F": [(1.0, 1.0), (2.0, 1.0)]})


def test_undamped_modes_that_coincide():
    """Three axes of one frequency, whose poles differ by rounding alone: no panel of an integral lies between these."""
    model = mv.library.cubic_hexapod(damping=0.0)
    model.add_base_motion("floor", "z")
    noise = {"floor": [(1.0, 1e-6), (500.0, 1e-6)], "Fx": [(1.0, 1.0), (20.0, 1.0)]}
    budget = model.linearize().budget(noise, ["x", "z"])
    assert budget.rms["z"] == np.inf
    assert 0.0 < budget.rms["x"] < np.inf
    peak = model.linearize().modes().frequencies[0]
    below, beyond = budget.cumulative([0.9 * peak, 1.1 * peak])[1]
    stiffness, mass = (2.0 * np.pi * peak) ** 2, 1.0
    f = np.linspace(1.0, 0.9 * peak, 100_001)
    np.testing.assert_allclose(
        below, np.sqrt(np.trapezoid(1e-6 * (mass / (stiffness - (W * f) ** 2)) ** 2, f)), rtol=1e-6)
    assert beyond == np.inf


def under(system, noise, outputs="x", band=None, correlation=None, weighting=None):
    return random(system, noise, outputs, band, correlation, weighting)


@pytest.mark.slow
@pytest.mark.parametrize("first", [0.0, 2.0])
@pytest.mark.parametrize("correlation", [None, [[1.0, 0.6], [0.6, 1.0]]])
def test_integrals_up_to_frequencies(first, correlation):
    """Of each source and of the correlation, times a factor; nothing below the first frequency and beyond the last."""
    system, table = oscillator().linearize(), [(1.0, 1.0), (9.0, 0.2)]
    known = under(system, {"F": table, "base": [(0.5, 0.1), (4.0, 0.3)]}, ["x", "v"], correlation=correlation)
    f = np.array([0.3, 1.5, 3.0, 5.0, 20.0])
    got = known.below(f, lambda f: 1.0 / (1.0 + f), first)
    grid = np.linspace(0.3, 20.0, 400_001)
    density = known.densities(grid) / (1.0 + grid) * (grid >= first)
    middle = 0.5 * (density[..., 1:] + density[..., :-1])
    step = np.concatenate((np.zeros((2, 3, 1)), np.cumsum(middle, axis=-1)), axis=-1)
    expected = step[..., np.searchsorted(grid, f - 1e-9)] * (grid[1] - grid[0])
    np.testing.assert_allclose(got, expected, rtol=1e-4, atol=1e-4 * np.abs(expected).max())
    assert bool(got[:, 2].any()) is (correlation is not None)


@pytest.mark.parametrize(("c", "noise", "band", "words"), [
    (0.0, {"F": 1.0}, None, "the mode of 'oscillator' at 3.1831 Hz is not damped"),
    (0.0, {"F": [(1.0, 1.0), (3.0, 1.0)]}, None, None),
    (0.0, {"F": 1.0}, (3.5, 9.0), None),
    (0.0, {"F": 1.0}, (1.0, 9.0), "at 3.1831 Hz is not damped"),
    (3.0, {"F": 1.0}, None, "noise comes from 'F' to 'a' at all frequencies"),
    (3.0, {"F": [(1.0, 1.0), (3.0, 1.0)], "F2": 1.0}, None, "noise comes from 'F2' to 'a'"),
    (3.0, {"F": 1.0}, (1.0, 9.0), None),
    (3.0, {"F": isolation.shaped([5.0], [1.0, 5.0])}, None, None),
])  # fmt: skip
def test_what_makes_a_mean_square_infinite_is_named(c, noise, band, words):
    known = under(oscillator(c=c).linearize(), noise, ["x", "a"], band)
    finite = np.isfinite(known.mean_squares().total).all()
    assert finite == (words is None)
    if words is None:
        known.check_finite()
    else:
        with pytest.raises(mv.ResponseError, match=re.escape(words)):
            known.check_finite()


@pytest.mark.parametrize(("noise", "words"), [({"F": 1.0}, "a band that starts above 0 Hz"),
                                              ({"F": [(1.0, 1.0), (9.0, 1.0)]}, None)])  # fmt: skip
def test_rigid_bodies_move_away_without_bound(noise, words):
    free = mv.System.from_matrices([[2.0]], [[0.0]], [[0.0]], B=[[1.0]], Cq=[[1.0]], inputs=["F"], outputs=["x"])
    known = under(free, noise)
    assert np.isinf(known.mean_squares().total[0]) == (words is not None)
    if words is None:
        known.check_finite()
        w = W * np.array([1.0, 9.0])
        expected = (w[0] ** -3 - w[1] ** -3) / (3.0 * W * 4.0)
        np.testing.assert_allclose(known.mean_squares().total, expected, rtol=1e-9)  # a pole of fourth order
    else:
        with pytest.raises(mv.ResponseError, match=words):
            known.check_finite()


TABLE = [(1.0, 1.0), (9.0, 0.2)]


@pytest.mark.parametrize(("noise", "weighting", "exact"), [
    (TABLE, None, True), (TABLE, "Wk", True), (1.0, "Wk", True), (TABLE, isolation.moving_average(0.1), True),
    (TABLE, isolation.integrated(1), True), (TABLE, lambda f: 1.0 / (1.0 + f), False),
    (lambda f: 1.0 / (1.0 + f**4), None, False),
])  # fmt: skip
def test_only_integrals_over_functions_have_an_error(noise, weighting, exact):
    budget = oscillator().linearize().budget({"base": noise}, "a_abs", weighting=weighting)
    assert (budget.error == 0.0) is exact
    assert budget.error < 1e-9


@pytest.mark.parametrize("weighting", [
    mv.StateSpace.from_arrays([[-9.0]], [[1.0]], [[9.0]], [[0.0]]), control.tf([9.0], [1.0, 9.0]),
    [(f, 9.0 / np.hypot(9.0, 2.0 * np.pi * f)) for f in np.geomspace(0.09, 10.0, 2000)],
])  # fmt: skip
def test_filters_in_several_forms_are_one_weighting(weighting):
    system, band = oscillator().linearize(), (0.1, 9.0)
    exact = system.rms("x", {"base": 1.0}, band, weighting=isolation.shaped([9.0], [1.0, 9.0]))["x"]
    assert system.rms("x", {"base": 1.0}, band, weighting=weighting)["x"] == pytest.approx(exact, rel=1e-5)


@pytest.mark.few(3)
@pytest.mark.parametrize("second", [isolation.shaped([9.0], [1.0, 9.0], 3.0), 2.0, [(0.1, 2.0), (60.0, 0.01)],
                                    isolation.shaped([40.0], [1.0, 40.0], 0.5)])  # fmt: skip
@pytest.mark.parametrize("r", [0.6, -0.9, 0.5j])
def test_correlated_sources_of_any_densities(second, r):
    """Their cross-density is R sqrt(S1 S2), which has exact moments for filters that are alike but for their level."""
    system, first = two_masses().linearize(), isolation.shaped([40.0], [1.0, 40.0], 2.0)
    correlation = np.array([[1.0, r], [np.conj(r), 1.0]])
    budget = system.budget({"F1": first, "F2": second}, correlation=correlation)
    f = np.linspace(0.0, 60.0, 60_001)
    g = system.frequency_response(W * f)
    densities = np.array([part.at(f) for part in budget._random.sources.densities])
    seen = g * np.sqrt(densities)
    square = np.einsum("ojn,jk,okn->on", seen, correlation, seen.conj()).real
    for row, name in enumerate(system.outputs):
        assert budget.rms[name] ** 2 == pytest.approx(np.trapezoid(square[row], f), rel=2e-3)
        signed = sum(np.copysign(value**2, value) for value in budget.contributions[name].values())
        np.testing.assert_allclose(signed, budget.rms[name] ** 2, rtol=1e-12)
    alike = isinstance(second, type(first)) and second.alike(first) and not isinstance(r, complex)
    assert (budget._random.cross is not None) is alike


@pytest.mark.parametrize("rate", [1e-8, 3.0, 1e8])
@pytest.mark.parametrize("noise", [2.0, lambda f: np.full(f.shape, 2.0)], ids=["number", "function"])
def test_slow_processes_are_finite(rate, noise):
    """Noise of a one-sided density of 2 on x' = -a x + w has the mean square 1 / 2 a, however slow its decay is."""
    space = mv.StateSpace.from_arrays([[-rate]], [[1.0]], [[1.0]], 0)
    assert space.rms("y1", {"u1": noise})["y1"] == pytest.approx(np.sqrt(0.5 / rate), rel=1e-12)


def test_rates_that_rounding_cannot_tell_apart_are_refused():
    """A slide with a light part on strong dampers: its mean square was 0 in place of S / (4 c k); a band has it."""
    model, light = mv.Model("slide"), 1e-6
    model.add_body("slide", 50.0, (1, 1, 1))
    model.add_joint("rail", "prismatic", "ground", "slide", axis=(1, 0, 0))
    model.add_spring("drag", "ground", "slide", (-1, 0, 0), (0, 0, 0), stiffness=0.02, damping=1.0)
    model.add_body("light", light, (light, light, light))
    model.add_joint("gimbal", None, "slide", "light", (0, 0, 0), free=("x", "rx", "ry"))
    model.add_bushing("strong", "slide", "light", (0, 0, 0), (1e3, 0, 0, 2, 2, 0), (1e4, 0, 0, 1e4, 1e4, 0))
    model.add_input("f", "slide", "x")
    model.add_output("x", "slide", "x")
    system = model.linearize()
    with pytest.raises(mv.MbsvibError, match=r"0.0002 to 1e\+10 1/s.*Give a band"):
        system.rms("x", {"f": 1.0})
    with pytest.raises(mv.ResponseError, match=r"H2 norm of 'slide'.*0.0002 to 1e\+10 1/s.*rms in a band"):
        system.state_space().h2_norm()
    assert system.rms("x", {"f": 1.0}, band=(0, 1e6))["x"] == pytest.approx(np.sqrt(1 / (4 * 0.02)), rel=1e-9)


@pytest.mark.parametrize("ratio", [1e-3, 1e-5, 1e-7, 1e-9])
def test_lightly_damped_modes_lose_no_digits(ratio):
    """Eight modes: -sum of R_i conj(R_j) / (lambda_i + conj(lambda_j)) over residues of pairs of poles."""
    rng = np.random.default_rng(4)
    w, (b, c) = 10.0 ** rng.uniform(0.0, 3.0, 8), rng.standard_normal((2, 8))
    system = mv.System.from_matrices(np.eye(8), np.diag(2.0 * ratio * w), np.diag(w * w), b[:, None], c[None])
    turn = 1j * w * np.sqrt(1.0 - ratio**2)
    poles, residues = np.append(turn, -turn) - ratio * np.append(w, w), np.append(b * c / turn, -b * c / turn) / 2.0
    square = -(np.outer(residues, residues.conj()) / np.add.outer(poles, poles.conj())).sum().real
    assert system.rms(None, {"u1": 2.0})["y1"] == pytest.approx(np.sqrt(square), rel=1e-11)
    a = np.block([[np.zeros((8, 8)), np.diag(w)], [-np.diag(w), -2.0 * ratio * np.diag(w)]])
    energies = mv.StateSpace.from_arrays(a, np.eye(16)[:, 8:] @ b[:, None], (c / w)[None] @ np.eye(8, 16), 0)
    assert energies.h2_norm().value == pytest.approx(np.sqrt(square), rel=1e-11)
    by_sources = mv.System.from_matrices(np.eye(8), np.diag(2.0 * ratio * w), np.diag(w * w), np.diag(b), c[None])
    alone = np.sqrt(0.25 * (b * c) ** 2 / (2.0 * ratio * w**3))
    shares = by_sources.budget({"u*": 1.0}).contributions["y1"]
    assert list(shares.values()) == pytest.approx(-np.sort(-alone), rel=1e-11)
