"""Minimisation where several smooth functions are equally large, and peaks of responses."""

import itertools

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.isolation import shaped
from mbsvib.tuning.peaks import Response, Weight, eigen, over_frequency, peak
from mbsvib.tuning.searching import _line, _shortest, bfgs


def valley(x):
    """Rosenbrock's function with a sharp floor: 10 |x2 - x1^2| + (1 - x1)^2, least at (1, 1)."""
    side = 10.0 if x[1] >= x[0] ** 2 else -10.0
    value = side * (x[1] - x[0] ** 2) + (1.0 - x[0]) ** 2
    return value, np.array([-2.0 * side * x[0] - 2.0 * (1.0 - x[0]), side])


@pytest.mark.parametrize("start", [(-1.2, 1.44), (-1.2, 1.0), (0.5, 0.25)])
def test_a_search_goes_on_along_a_sharp_valley(start):
    """At two of the starts both sides are equally high, and neither gradient alone leads down."""
    end = bfgs(valley, np.array(start), 2000)
    assert end.f < 1e-3
    assert end.history[0] == valley(np.array(start))[0]


def test_shortest_combination_of_gradients():
    np.testing.assert_allclose(_shortest(np.array([[1.0, 1.0], [1.0, -3.0]])), [1.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(_shortest(np.array([[2.0, 1.0], [1.0, 1.0]])), [1.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(_shortest(np.array([[1.0, 1.0], [-2.0, -2.0], [0.0, 3.0]])), 0.0, atol=1e-12)


@pytest.mark.parametrize(("outputs", "inputs", "through"), [(1, 1, 0.0), (2, 3, 0.0), (3, 2, 0.1), (2, 2, 9.0)])
def test_peaks_are_norms_with_gradients(outputs, inputs, through):
    """The largest singular value over all frequencies is the H-infinity norm; its gradient, against differences."""
    rng = np.random.default_rng(outputs + 10 * inputs)
    full = rng.normal(size=(6 + outputs, 6 + inputs))
    full[:6, :6] = full[:6, :6] - full[:6, :6].T - 0.2 * np.eye(6)
    full[6:, 6:] *= through

    def response(matrix):
        a, b, c, d = matrix[:6, :6], matrix[:6, 6:], matrix[6:, :6], matrix[6:, 6:]
        return Response((a, b, c, d), eigen(a))

    highest, w = peak(response(full), [])
    ports = [f"u{k}" for k in range(inputs)], [f"y{k}" for k in range(outputs)]
    space = mv.StateSpace.from_arrays(full[:6, :6], full[:6, 6:], full[6:, :6], full[6:, 6:], *ports)
    assert highest == pytest.approx(space.hinf_norm().value, rel=1e-6)
    change, step = rng.normal(size=full.shape), 1e-6
    difference = (peak(response(full + step * change), [])[0] - peak(response(full - step * change), [])[0]) / 2 / step
    assert (response(full).slope(w) * change).sum() == pytest.approx(difference, rel=1e-3)

def quadratic(x):
    """0.5 + 0.5 x^T H x of a condition above 100, least at 0."""
    h = np.array([[100.0, 30.0], [30.0, 10.0]])
    return float(0.5 + 0.5 * x @ h @ x), h @ x


def test_smooth_functions_are_minimised_in_few_steps():
    end = bfgs(quadratic, np.array([1.0, -2.0]), 200)
    assert end.f == pytest.approx(0.5, rel=1e-9)
    assert len(end.history) < 40
    assert all(later <= before for before, later in itertools.pairwise(end.history))
    assert end.f == end.history[-1] == quadratic(end.x)[0]
    assert len(bfgs(quadratic, np.array([1.0, -2.0]), 3).history) == 4
    enough = bfgs(quadratic, np.array([1.0, -2.0]), 200, 1.0)
    assert enough.history[-1] < 1.0 <= enough.history[-2]
    still = bfgs(quadratic, np.zeros(2), 200)
    assert (still.f, still.history) == (0.5, (0.5,))


@pytest.mark.parametrize("scale", [1e-3, 1.0, 30.0])
@pytest.mark.parametrize("function", [quadratic, valley])
def test_a_line_search_ends_where_the_slope_has_risen_or_lowest(function, scale):
    """Weak Wolfe conditions, or else the lowest of all points that were tried below the start."""
    for seed in range(6):
        x = np.random.default_rng(seed).normal(size=2)
        f, g = function(x)
        tried = []

        def told(point, tried=tried):
            tried.append(function(point)[0])
            return function(point)

        point, value, gradient = _line(told, x, f, g, -scale * g)
        assert value == function(point)[0]
        assert value < f
        along = (point - x) @ -g
        assert along > 0.0
        assert value <= f - 1e-4 * along
        np.testing.assert_array_equal(gradient, function(point)[1])
        assert gradient @ -g >= -0.5 * g @ g or value == min(tried)
    assert _line(function, x, f, g, scale * g) is None  # upwards there is nothing


def test_a_search_does_not_take_points_without_a_value():
    def half(x):
        return (np.inf, np.zeros(1)) if x[0] < 0.5 else (x[0] ** 2, 2.0 * x)

    assert bfgs(half, np.array([3.0]), 100).x[0] == pytest.approx(0.5, rel=1e-3)
    assert bfgs(half, np.array([0.2]), 100).f == np.inf


def space(seed, n, outputs, inputs, through):
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(n, n))
    a = a - a.T - 0.2 * np.eye(n)
    return a, rng.normal(size=(n, inputs)), rng.normal(size=(outputs, n)), through * rng.normal(size=(outputs, inputs))


@pytest.mark.parametrize("rate", [1.0, 40.0])
@pytest.mark.parametrize("weight", [None, "filter", "table", "matrix"])
@pytest.mark.parametrize(("outputs", "inputs"), [(1, 1), (2, 3), (3, 2), (2, 1)])
def test_weighted_responses_and_their_sizes(outputs, inputs, weight, rate):
    a, b, c, d = space(outputs, 5, outputs, inputs, 0.3)
    w = np.array([0.0, 0.3, 1.7, 20.0])
    rng = np.random.default_rng(2)
    known = {"filter": over_frequency(shaped([3.0 * rate], [1.0, 2.0 * rate]), "w"),
             "table": over_frequency([(0.2 * rate / 6.0, 2.0), (3.0 * rate / 6.0, 9.0)], "w"),
             "matrix": Weight((np.array([[-rate]]), rng.normal(size=(1, outputs)), rate * rng.normal(size=(2, 1)),
                               rng.normal(size=(2, outputs))))}.get(weight)  # fmt: skip
    g = np.array([c @ np.linalg.solve(1j * at * np.eye(5) - a, b) + d for at in w])
    if weight == "filter":
        g = g * (3.0 / (1j * w + 2.0))[:, None, None]
    elif weight == "table":
        f = w / 2.0 / np.pi
        gain = np.exp(np.interp(np.log(np.maximum(f, 1e-9)), np.log([0.2 / 6.0, 0.5]), np.log([2.0, 9.0])))
        g = g * np.where((f >= 0.2 / 6.0) & (f <= 0.5), gain, 0.0)[:, None, None]
    elif weight == "matrix":
        wa, wb, wc, wd = known.space
        g = np.array([(wc @ np.linalg.solve(1j * at * rate * np.eye(1) - wa, wb) + wd) @ part
                      for at, part in zip(w, g, strict=True)])  # fmt: skip
    for parts in (eigen(a), (*eigen(a)[:2], None)):
        response = Response((a, b, c, d), parts, known, rate)
        np.testing.assert_allclose(response.at(w), g, rtol=1e-10, atol=1e-12)
        top = np.linalg.norm(g, 2, axis=(1, 2))
        sizes = response.sizes(w)
        assert sizes.max() == pytest.approx(top.max(), rel=1e-10)
        assert (sizes <= top * (1.0 + 1e-10)).all()
        last = known.space[3] @ d if weight == "matrix" else d if weight is None else 0.0 * d
        assert response.far == pytest.approx(np.linalg.norm(last, 2), rel=1e-6, abs=1e-9)
        low, high = response.span
        assert (low, high) == ((pytest.approx(2.0 * np.pi * 0.2 / 6.0), pytest.approx(np.pi)) if weight == "table" else
                               (0.0, np.inf))  # fmt: skip


def test_eigenvectors_that_depend_on_each_other_are_not_used():
    """Whose sum of modes would be 0: two filters in series are 1 / (s + 1)^2."""
    a = np.array([[-1.0, 1.0], [0.0, -1.0]])
    assert eigen(a)[2] is None
    response = Response((a, np.array([[0.0], [1.0]]), np.array([[1.0, 0.0]]), np.zeros((1, 1))), eigen(a))
    assert peak(response, [])[0] == pytest.approx(1.0)
    values, vectors, inverse = eigen(np.array([[-1.0, 1e3], [-1e-3, -2.0]]))
    np.testing.assert_allclose(inverse @ vectors, np.eye(2), atol=1e-12)
    np.testing.assert_allclose(vectors @ np.diag(values) @ inverse, [[-1.0, 1e3], [-1e-3, -2.0]], rtol=1e-9)


@pytest.mark.parametrize("damping", [1e-6, 1e-3, 0.3])
@pytest.mark.parametrize("unit", [1e-5, 1.0, 1e4])
def test_frequencies_of_a_search_resolve_every_mode(damping, unit):
    """Of light and of heavy modes, no more than some tens each; peaks are found to rounding of their parabola."""
    w0 = np.array([0.4, 1.0, 30.0]) * unit
    a = np.zeros((6, 6))
    for k, w in enumerate(w0):
        a[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [[0.0, w], [-w, -2.0 * damping * w]]
    b = np.array([[0.0], [w0[0]], [0.0], [w0[1]], [0.0], [w0[2]]])
    for chosen in range(3):
        c = np.zeros((1, 6))
        c[0, 2 * chosen] = 1.0
        response = Response((a, b, c, np.zeros((1, 1))), eigen(a))
        marks = response.sampled([0.123 * unit])
        assert {0.0, 0.123 * unit} <= set(marks.tolist())
        assert (np.diff(marks) > 0.0).all()
        assert len(marks) < 120
        assert marks[1] < 0.1 * unit
        assert marks[-1] > 200.0 * unit
        value, w = peak(response, [])
        assert value == pytest.approx(1.0 / (2.0 * damping * np.sqrt(1.0 - damping**2)), rel=1e-7)
        assert w == pytest.approx(w0[chosen] * np.sqrt(1.0 - 2.0 * damping**2), rel=1e-3 * min(1.0, 10.0 * damping))


def test_known_frequencies_show_peaks_between_the_points():
    """A table has its top where no pole tells of it."""
    weight = over_frequency([(1.0, 1.0), (1.5, 1e3), (1.52, 1.0), (9.0, 1.0)], "w")
    a = np.array([[-1e-3]])
    value, w = peak(Response((a, np.ones((1, 1)), np.ones((1, 1)), np.ones((1, 1))), eigen(a), weight), [])
    assert value == pytest.approx(1e3 * abs(1.0 + 1.0 / (3j * np.pi + 1e-3)), rel=1e-9)
    assert w == pytest.approx(3.0 * np.pi, rel=1e-9)


def test_peaks_of_static_and_of_high_pass_responses():
    none = np.zeros((0, 0))
    static = Response((none, np.zeros((0, 1)), np.zeros((1, 0)), np.array([[3.0]])), eigen(none))
    assert peak(static, [])[0] == pytest.approx(3.0)
    one = np.ones((1, 1))
    assert peak(Response((-one, one, -one, one), eigen(-one)), []) == (1.0, np.inf)  # s / (s + 1)
    assert peak(Response((-one, one, one, one), eigen(-one)), []) == (pytest.approx(2.0), pytest.approx(0.0, abs=1e-9))
