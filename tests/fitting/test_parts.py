"""Parts of a fit by hand: values and their bounds, weights, what residuals tell, candidates."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

import mbsvib as mv
from mbsvib.api.fitting import _problem
from mbsvib.errors import ModelError, ResponseError
from mbsvib.fitting import knowledge
from mbsvib.fitting.data import conditioned
from mbsvib.fitting.mode_data import ModeData
from mbsvib.fitting.response_data import ResponseData, weights
from mbsvib.fitting.variables import FARTHEST, Channels, variables
from tests.fitting.scenes import away, chain, measured
from tests.fitting.test_derivatives import spinning

OMEGA = 2 * np.pi * np.linspace(2.0, 60.0, 80)
FREE = ["k*.stiffness", "k*.damping", "b1.mass"]


@pytest.mark.parametrize(("bounds", "low", "high"), [
    (None, 1e4 / FARTHEST, 1e4 * FARTHEST), ((None, 2e4), 1e4 / FARTHEST, 2e4), ((5e3, None), 5e3, 1e4 * FARTHEST),
    ((None, None), 1e4 / FARTHEST, 1e4 * FARTHEST), ((5e3, 2e4), 5e3, 2e4),
    ((-1.0, 1e12), 1e4 / FARTHEST, 1e4 * FARTHEST),
])  # fmt: skip
def test_bounds_of_a_positive_value(bounds, low, high):
    known = variables(chain().parameters, "k0.stiffness", (), None, {"k0.stiffness": bounds} if bounds else None)
    np.testing.assert_allclose([known.low[0], known.high[0]], [low, high], rtol=1e-12)
    np.testing.assert_allclose(known.limits(), [[np.log(low)], [np.log(high)]])
    np.testing.assert_allclose([known.values(np.array([x]))[0] for x in (-100.0, 100.0)], [low, high], rtol=1e-12)


def test_bounds_and_sizes_of_values_of_any_sign():
    """A place has the size of the largest in the model, however near to the origin; a value of 0 that of its bounds."""
    model = spinning()
    names = ["shaft.position.x", "shaft.position.y", "near.orientation.ry"]
    given = {"shaft.position.y": (-0.2, 0.3), "shaft.position.x": (None, 0.4), "near.orientation.ry": (-1.0, None)}
    known = variables(model.parameters, names, (), None, given)
    assert known.low.tolist() == [-np.inf, -0.2, -1.0]
    assert known.high.tolist() == [0.4, 0.3, np.inf]
    metres = max(abs(entry.value) for entry in model.parameters.entries if entry.unit == "m")
    assert known.size.tolist() == [metres, 0.5, 1.0]
    assert variables(model.parameters, names[1], (), None, None).size.tolist() == [metres]
    assert variables(model.parameters, names[1], (), None, {names[1]: (-0.2, None)}).size.tolist() == [metres]
    products = mv.Model("m", gravity=(0, 0, -9.81))
    products.add_body("b", 1.0, [[2e-3, 1e-5, 0], [1e-5, 3e-3, 0], [0, 0, 3e-3]])
    products.add_body("house", 1e6, (1e6, 1e6, 1e6))
    inertia = variables(products.parameters, ["b.inertia.xx", "b.inertia.xy", "b.inertia.xz"], (), None, None)
    assert inertia.positive.tolist() == [True, False, False]
    assert inertia.size.tolist() == [2e-3, 3e-3, 3e-3]
    x = known.unknowns(np.array([-0.05, 0.1, 0.2]))
    np.testing.assert_allclose(known.values(x), [-0.05, 0.1, 0.2])
    step = 1e-6
    slopes = (known.values(x + step) - known.values(x - step)) / (2 * step)
    np.testing.assert_allclose(slopes, known.rates(known.values(x)))
    assert known.values(x + 10.0).tolist() == [0.4, 0.3, pytest.approx(10.2)]
    start = variables(model.parameters, "shaft.mass", (), None, None)
    np.testing.assert_allclose(start.rates(np.array([3.0])), [3.0])
    for wrong in ((0.2, 0.3), (0.0, 0.05), (0.1, 0.1), (0.3, -0.3)):
        with pytest.raises(ModelError, match="a start within ascending bounds"):
            variables(model.parameters, "shaft.position.x", (), None, {"shaft.position.x": wrong})


def test_one_value_for_several_parameters():
    """It starts at the geometric mean of positive numbers, else at the mean, with the size of the largest."""
    model = chain(stiffness=(1e4, 2e4, 4e4))
    known = variables(model.parameters, "b0.mass", "k*.stiffness", None, None)
    assert known.names == ("b0.mass", "k*.stiffness")
    np.testing.assert_allclose(known.start, [1.0, 2e4])
    assert known.size.tolist() == [1.0, 4e4]
    assert known.parameters == ("b0.mass", "k0.stiffness", "k1.stiffness", "k2.stiffness")
    assert known.map.tolist() == [[1, 0], [0, 1], [0, 1], [0, 1]]
    ends = variables(model.parameters, (), "b*.position.z", None, None)
    assert (ends.start.tolist(), ends.size.tolist(), ends.positive.tolist()) == ([2.0], [3.0], [False])
    with pytest.raises(ModelError, match=r"'k0\.\*' ties parameters in N s/m and N/m.*one unit"):
        variables(model.with_values({"k0.stiffness": 1.0}).parameters, (), ["k0.*"], None, None)
    undamped = variables(chain(damping=(0.0, 1.0, 2.0)).parameters, (), "k*.damping", None, None)
    assert (undamped.start.tolist(), undamped.positive.tolist()) == ([1.0], [False])
    with pytest.raises(ModelError, match="free and tied are empty"):
        variables(model.parameters, (), (), None, None)
    for field, wrong in (("prior", [1.0]), ("prior", {"b0.mass": 1.0}), ("bounds", {"b0.mass": (1.0, 2.0, 3.0)}),
                         ("bounds", {"b0.mass": ("a", 1.0)})):  # fmt: skip
        with pytest.raises(ModelError, match=field):
            variables(model.parameters, "b0.mass", (), **({"prior": None, "bounds": None} | {field: wrong}))


def test_fits_end_at_bounds_from_either_side():
    model, data = chain(), measured(chain(), OMEGA[::4], 0.01, 1)
    for bounds, value in (((None, 0.9e4), 0.9e4), ((1.1e4, None), 1.1e4), ((None, 1.2e4), None), ((0.9e4, None), None)):
        start = model.with_values({"k0.stiffness": 0.8e4 if bounds[0] is None else 1.3e4})
        fit = start.fit(data, ["k0.stiffness", "k1.stiffness"], bounds={"k0.stiffness": bounds})
        assert fit.converged
        expected = pytest.approx(1e4, rel=0.02) if value is None else value
        assert fit.values["k0.stiffness"] == expected, bounds


def test_weights_of_variances_that_are_known_or_not():
    """A variance of 0 counts as the least of its pair; a sample variance counts beside those of other lines."""
    rng = np.random.default_rng(0)
    variance = rng.gamma(2.0, 0.5, (40, 1, 2))
    variance[[0, 20], 0, 0] = 1e-8
    variance[30, 0, 1] = 0.0
    responses = np.ones((40, 1, 2), dtype=complex)
    responses[5] = np.nan
    plain, known = weights(responses, variance, None)
    assert known
    least = np.delete(variance[:, 0, 1], [5, 30]).min()
    expected = np.sqrt(2.0 / np.where(variance > 0.0, variance, least))
    expected[5] = 0.0
    np.testing.assert_allclose(plain, expected)
    np.testing.assert_array_equal(weights(responses, variance, 1)[0], plain)
    few, known = weights(responses, variance, 3)
    assert known
    assert few[5].tolist() == [[0.0, 0.0]]
    assert few[20, 0, 0] < 1e-2 * plain[20, 0, 0]
    sizes, known = weights(np.array([1.0, -4.0j, 2.0, 0.0, np.nan]).reshape(5, 1, 1), None, 3)
    assert not known
    np.testing.assert_allclose(sizes.ravel(), np.sqrt(2.0) / 2.0 * np.array([1, 1, 1, 1, 0]))


def one_output(residual, weight=1.0, omega=OMEGA):
    """Data of one pair with some residuals."""
    n = len(residual)
    full = np.broadcast_to(weight, n).reshape(n, 1, 1).astype(float)
    return ResponseData("data 1", 0, omega[:n], np.ones((n, 1, 1), dtype=complex), full, None, np.array([0]),
                        np.array([0]), np.ones((n, 1, 1)), Channels.held(1, 1), True)  # fmt: skip


@pytest.mark.parametrize("scale", [0.7, 1.0, 1.6])
@pytest.mark.parametrize("smooth", [0.0, 0.9])
@pytest.mark.parametrize("known", [True, False])
def test_residuals_are_noise_or_are_not(scale, smooth, known):
    """chi^2 and the correlation of neighbouring lines by hand, over two sets of data of which one counts for chi^2."""
    rng = np.random.default_rng(2)
    white = rng.standard_normal((60, 2)) @ [1.0, 1j]
    for k in range(1, 60):
        white[k] = smooth * white[k - 1] + np.sqrt(1 - smooth**2) * white[k]
    r, other = scale * white[:, None, None], rng.standard_normal(5) + 0j
    problem = SimpleNamespace(known=known, data=(one_output(white), object.__new__(ModeData)))
    test = knowledge._test(problem, [r, other], 117, 3)
    total = np.sum(np.abs(r) ** 2) + np.sum(np.abs(other) ** 2)
    if known:
        assert test.ratio == pytest.approx(total / 117)
    else:
        assert np.isnan(test.ratio)
    correlation = np.sum((r[1:] * r[:-1].conj()).real) / np.sum(np.abs(r) ** 2)
    assert test.correlation == pytest.approx(correlation)
    likely = stats.chi2.sf(total, 117) >= 1e-3 or not known
    assert test.passed == (likely and stats.norm.sf(correlation * np.sqrt(118)) >= 1e-3)
    assert test.passed == (not smooth and (scale < 1.5 or not known))
    assert bool(test.bands) <= (not test.passed)


def test_bands_are_where_the_mean_of_seven_lines_is_twice_that_of_all():
    f = np.arange(30.0)
    power = np.ones(30)
    power[10:13] = 20.0
    mean = np.array([np.take(power, np.clip(np.arange(k - 3, k + 4), 0, 29)).mean() for k in range(30)])
    above = np.flatnonzero(mean > 2.0 * power.mean())
    assert knowledge._bands(f, power) == [(above[0], above[-1])]
    assert above[0] < 10
    power[[0, 29]] = 40.0
    bands = knowledge._bands(f, power)
    assert [bands[0][0], bands[-1][1]] == [0.0, 29.0]
    assert knowledge._bands(f[:3], np.array([1.0, 1.0, 1.0])) == []


@pytest.mark.parametrize("size", [1.0, 1e-9, 1e9])
def test_what_data_tell_does_not_depend_on_the_size_of_other_values(size):
    """Values 0 and 1 by their sum alone, 3 not at all, whatever a change by 1 of the fourth, which is told, means."""
    rng = np.random.default_rng(6)
    rows = rng.standard_normal((12, 3))
    slopes = 1e3 * np.column_stack((rows[:, 0], rows[:, 0], rows[:, 1] * size, 1e-9 * rows[:, 2], rows[:, 2]))
    untold, covariance = knowledge._determined(slopes.T @ slopes)
    shares = np.array([[1, 1, 0, 0, 0], [0, 0, 0, 0, 1], [0, 0, 1, 0, 0]])[: 2 if size < 1e-3 else 3].T
    shares = shares / np.linalg.norm(shares, axis=0)  # less than 100 % of it is not told
    exact = shares @ np.linalg.inv((slopes @ shares).T @ (slopes @ shares)) @ shares.T
    scale = np.sqrt(np.where(exact.diagonal() > 0.0, exact.diagonal(), 1.0))
    np.testing.assert_allclose(covariance / np.outer(scale, scale), exact / np.outer(scale, scale), atol=1e-8)
    assert len(untold) == (3 if size < 1e-3 else 2)
    np.testing.assert_allclose(untold @ untold.T, np.eye(len(untold)), atol=1e-8)
    np.testing.assert_allclose(np.linalg.norm(untold @ np.array([[1, -1, 0, 0, 0], [0, 0, 0, 1, 0]]).T, axis=0),
                               [np.sqrt(2.0), 1.0], atol=1e-8)  # fmt: skip


def test_covariance_of_residuals_is_not_below_that_of_the_noise():
    """C P C with P = S^T S n / (n - v), of each value at least the ratio times C."""
    rng = np.random.default_rng(3)
    factor = rng.standard_normal((3, 3))
    covariance = factor @ factor.T
    scores = 3.0 * rng.standard_normal((12, 3))
    power = scores.T @ scores * 12 / 9
    sandwich = covariance @ power @ covariance
    np.testing.assert_allclose(knowledge._sandwich(covariance, power, 1e-6 * covariance), sandwich)
    large = knowledge._sandwich(covariance, power, 1e6 * covariance)
    np.testing.assert_allclose(large.diagonal(), 1e6 * covariance.diagonal())
    deviation = np.sqrt(sandwich.diagonal())
    np.testing.assert_allclose(large / np.sqrt(np.outer(large.diagonal(), large.diagonal())),
                               sandwich / np.outer(deviation, deviation))  # fmt: skip
    np.testing.assert_allclose(knowledge._sandwich(covariance, 0.0 * power, 2.0 * covariance), 2.0 * covariance)


def test_scores_of_blocks_add_up_to_the_gradient():
    """Three blocks of lines for each value, over all data; priors and modes number by number."""
    model = chain()
    free = ["k*.stiffness"]
    data = [measured(model, OMEGA, 0.02, 1), measured(model, OMEGA[:40], 0.02, 2, ["z1"], ["F"])]
    chosen = variables(model.parameters, free, (), {"k0.stiffness": (1.1e4, 1e3)}, None)
    problem = _problem(model, conditioned(data), chosen, ())
    x = problem.variables.unknowns(problem.variables.start) + 0.01
    scores = knowledge._scores(problem, x)
    assert scores.shape == (6 + 3 + 2, 3)  # 9 blocks in 2 to 1, and a prior with real and imaginary part
    sums = problem.sums(x, far=False)
    np.testing.assert_allclose(scores.sum(axis=0), sums.gradient, rtol=1e-9)
    assert sums.cost == pytest.approx(problem.cost(x, far=False), rel=1e-12)
    squares = sum(float((np.abs(r) ** 2).sum()) for r in problem.residuals(x))
    shift = (problem.variables.values(x)[0] - 1.1e4) / 1e3
    assert sums.cost == pytest.approx(0.5 * (squares + shift**2), rel=1e-12)
    assert problem.numbers == 2 * (80 * 6 + 40) + 1


def test_noise_that_is_not_known_is_scaled_for_each_pair():
    """Mean square of residuals and, as of four more lines, its geometric mean over inputs against responses, over the
    numbers that were measured, more by what the fitted values take away.
    """
    rng = np.random.default_rng(5)
    data = replace(one_output(np.zeros(20)), measured=np.ones((20, 3, 2), dtype=complex), weight=np.ones((20, 3, 2)))
    data.measured[..., 1] = 50.0
    data.weight[:10, 1, 0] = 0.0
    residual = rng.standard_normal((20, 3, 2)) + 1j * rng.standard_normal((20, 3, 2))
    residual[:10, 1, 0] = residual[:, 2] = residual[:, 0, 0] = 0.0
    squares, counts = np.sum(np.abs(residual) ** 2, axis=0), np.array([[20, 20], [10, 20]])
    middle = np.median(np.where(data.weight > 0, np.abs(data.measured + residual), np.nan) ** 2, axis=0)
    middle[1, 0] = np.median(np.abs(1.0 + residual[10:, 1, 0]) ** 2)
    mean = np.exp(np.log(squares[1] / counts[1] / middle[1]).mean())
    power = np.array([[4 * squares[0, 1] / 20 / middle[0, 1] * middle[0, 0] / 24, squares[0, 1] / 20],
                      (squares[1] + 4 * mean * middle[1]) / (counts[1] + 4)])  # fmt: skip
    scaled = data.reweighted(residual, 1.25).weight
    np.testing.assert_allclose(scaled, data.weight / np.sqrt([*(1.25 * power / 2.0).tolist(), [1.0, 1.0]]))


def test_intervals_of_noise_from_residuals_are_those_of_student():
    model = chain()
    data = measured(model, OMEGA[::16], 0.02, 3, ["z2"], ["F"], known=False)
    fit = model.fit(data, "k*.stiffness")
    assert fit.quantile == pytest.approx(stats.t.ppf(0.975, 2 * 5 - 3), rel=1e-9)
    slopes = np.eye(3)
    np.testing.assert_allclose(fit.half_width(slopes), fit.quantile * fit.deviation(slopes), rtol=1e-12)
    columns = fit.columns()
    for k, name in enumerate(fit.names):
        assert (columns["low"][k], columns["high"][k]) == fit.intervals[name]
        assert np.log(columns["high"][k] / columns["low"][k]) == pytest.approx(
            2.0 * fit.quantile * np.sqrt(fit.covariance[k, k]) / fit.values[name], rel=1e-9)
    assert columns["unit"].tolist() == ["N/m"] * 3
    told = model.fit(measured(model, OMEGA[::16], 0.02, 3), "k*.stiffness")
    assert told.quantile == pytest.approx(1.959964, rel=1e-6)


def test_results_that_depend_on_what_is_not_told_have_no_deviation():
    """Complex slopes count by their size; only slopes to what is not told make a result unknown."""
    model = chain()
    fit = model.fit(measured(model, OMEGA, 0.02, 3), ["k*.stiffness"])
    infinite = fit.covariance.copy()
    infinite[1, 1] = np.inf
    part = replace(fit, covariance=infinite)
    slopes = np.array([[1.0, 2j, 1.0 - 1j], [0.0, 0.0, 1e-3], [2.0, 1j, 0.0]])
    c = fit.covariance[np.ix_([0, 2], [0, 2])]
    s = slopes[[0, 2], :2]
    np.testing.assert_allclose(part.deviation(slopes)[:2], np.sqrt(np.einsum("ki,kl,li->i", s.conj(), c, s).real))
    assert np.isinf(part.deviation(slopes)[2])


@pytest.mark.slow
def test_channels_of_two_measurements_have_names_of_their_own():
    """The second has the name of its data in front; inputs have gains but for the first, no delay."""
    model, gains = chain(), np.array([2.0, -0.5, 1.0])[:, None, None]
    first = measured(model, OMEGA, 0.0, 1, change=lambda w: gains * np.exp(-1e-3j * w))
    second = measured(model, OMEGA, 0.0, 1, ["z0"], ["F0", "F"], change=lambda w: 4.0 / (1.0 + 2e-3j * w))
    fit = away(model, ["k*.stiffness"], 0.1, 1).fit([first, second], "k*.stiffness", channels=["gain", "delay", "lag"])
    expected = {"z0.gain": 2.0, "z1.gain": -0.5, "z2.gain": 1.0, "F0.gain": 1.0, "data 2.z0.gain": 4.0, "F.gain": 1.0,
                "z0.delay": 1e-3, "z1.delay": 1e-3, "z2.delay": 1e-3, "data 2.z0.delay": 0.0, "z0.lag": 0.0,
                "z1.lag": 0.0, "z2.lag": 0.0, "data 2.z0.lag": 2e-3}  # fmt: skip
    assert set(fit.values) - set(expected) == {"k0.stiffness", "k1.stiffness", "k2.stiffness"}
    for name, value in expected.items():
        assert fit.values[name] == pytest.approx(value, rel=1e-3, abs=1e-6), name
    np.testing.assert_allclose(fit.responses(2), second.responses, rtol=1e-3)


def test_covariances_that_do_not_tell_the_noise_are_refused():
    model, exact = chain(), measured(chain(), OMEGA, 0.0, 1, ["z0", "z1"], ["F"])
    full = np.repeat(np.array([[1.0, 0.5], [0.5, 1.0]])[:, :, None] * 1e-12, len(OMEGA), axis=2)
    holes, lines, singular = exact.responses.copy(), exact.responses.copy(), full.copy()
    holes[0, 0, 3] = lines[:, 0, 3] = np.nan
    singular[..., 5] = 0.0
    for responses, covariance, words in ((holes, full, "pairs that were not measured at some"),
                                         (exact.responses, singular, "singular at some lines")):  # fmt: skip
        data = mv.Measurement(OMEGA, responses, exact.outputs, exact.inputs, covariance=covariance)
        with pytest.raises(ResponseError, match=words):
            model.fit(data, "k*.stiffness")
    fit = model.fit(mv.Measurement(OMEGA, lines, exact.outputs, exact.inputs, covariance=full), "k*.stiffness")
    assert np.isnan(fit.responses()[:, 0, 3]).all()
    assert fit.values["k1.stiffness"] == pytest.approx(2e4, rel=1e-9)


@pytest.mark.few(1)
@pytest.mark.parametrize("noise", [0.0, 1.0])
@pytest.mark.parametrize("seed", [3, 4])
def test_uncorrelated_covariances_are_variances(noise, seed):
    """From afar, of data with noise and without, for fits, their tests and further sensors; outputs in other units."""
    model = chain()
    exact = measured(model, OMEGA, 0.0, 0).responses
    sd = np.array([1.0, 2.0, 0.5])[:, None, None] * 1e-2 * np.abs(exact).mean() * np.linspace(1.0, 3.0, len(OMEGA))
    rng = np.random.default_rng(1)
    normal = rng.standard_normal(exact.shape) + 1j * rng.standard_normal(exact.shape)
    responses, names = exact + noise * sd * normal / np.sqrt(2.0), (["z0", "z1", "z2"], ["F", "F0"])
    power = np.eye(3)[:, :, None] * sd[:, 0] ** 2
    fits = [away(model, FREE, 0.6, seed).fit(mv.Measurement(OMEGA, responses, *names, **given), FREE)
            for given in ({"variance": np.broadcast_to(sd**2, exact.shape)}, {"covariance": power})]  # fmt: skip
    assert all(fit.converged and fit.residual_test.passed for fit in fits)
    np.testing.assert_allclose(list(fits[1].values.values()), list(fits[0].values.values()), rtol=1e-6)
    np.testing.assert_allclose(fits[1].covariance, fits[0].covariance, rtol=1e-4)
    if noise:
        given = {"variance": np.broadcast_to(sd**2, exact.shape)}, {"covariance": power}
        ranked = [model.fit(mv.Measurement(OMEGA, responses, *names, **one)["z2", "F"], "k*.stiffness").next_sensor()
                  for one in given]  # fmt: skip
        assert [one.name for one in ranked[0]] == [one.name for one in ranked[1]]
        np.testing.assert_allclose([one.gain for one in ranked[1]], [one.gain for one in ranked[0]], rtol=1e-6)


def test_frequencies_and_ratios_have_the_covariance_of_their_deviations():
    """J of log f over its deviation, and of ratios over a tenth of themselves, from sensitivities of the modes."""
    model = chain()
    modes = model.linearize().modes()
    sd = np.array([0.01, 0.02, 0.05])
    free = ["k*.stiffness", "k*.damping"]
    data = mv.MeasuredModes(modes.frequencies, modes.damping_ratios, sd=sd)
    fit = model.fit(data, free)
    slopes = model.linearize().mode_sensitivities(list(fit.values))
    ratios = np.concatenate((slopes.frequencies / sd, slopes.damping_ratios / (0.1 * modes.damping_ratios)), axis=1)
    np.testing.assert_allclose(fit.covariance, np.linalg.inv(ratios @ ratios.T), rtol=1e-6)
    plain = model.fit(mv.MeasuredModes(modes.frequencies), "k*.stiffness")
    rows = model.linearize().mode_sensitivities(list(plain.values)).frequencies / (1e-3 * modes.frequencies)
    np.testing.assert_allclose(plain.covariance, np.linalg.inv(rows @ rows.T), rtol=1e-6)


def test_modes_are_paired_by_shape_before_frequency():
    """Shapes that were measured in part and against the sign of an output; frequencies alone pair the nearest."""
    model = chain()
    system = model.linearize()
    modes = system.modes()
    shapes = (system.Cq @ modes.shapes)[:, [2, 0, 1]] * np.array([1.0, -2.0, 0.5j])
    shapes[0, 0] = np.nan
    problem = _problem(model, conditioned(mv.MeasuredModes([10.0, 11.0, 12.0], shapes=shapes, outputs=system.outputs)),
                       variables(model.parameters, "k*.stiffness", (), None, None), ())  # fmt: skip
    (data,) = problem.data
    model_shapes = [shape[:, None] for shape in (system.Cq @ modes.shapes).T]
    assert data.paired(modes.frequencies, model_shapes).tolist() == [2, 0, 1]
    assert data.numbers == 3 + 8 - 3  # real up to factors
    turned = replace(data, shapes=data.shapes * np.array([[1.0], [1.0], [1j]]))
    assert turned.numbers == 3 + 2 * 8 - 2 * 3
    np.testing.assert_allclose(data.shape_deviation[1], 0.05 * np.nanmax(np.abs(shapes), axis=0))
    alone = replace(data, shapes=np.full_like(shapes, np.nan), frequencies=modes.frequencies[[1, 2, 0]] * 1.2)
    assert alone.paired(modes.frequencies, model_shapes).tolist() == [1, 2, 0]
    near = replace(alone, frequencies=modes.frequencies[[1, 2, 0]] * 0.85)
    assert near.paired(modes.frequencies, model_shapes).tolist() == [1, 2, 0]


@pytest.mark.parametrize("order", [0, 2])
@pytest.mark.parametrize("kind", ["output", "input"])
def test_a_candidate_takes_the_noise_and_the_sign_of_its_kind(kind, order):
    """The median of lines of measured channels of its unit; against a hand-made information of both."""
    model = chain()
    exact = model.linearize().frequency_response(OMEGA)
    first, second = (("z1", "z2"), ("F",)) if kind == "output" else (("z2",), ("F0",))
    rng = np.random.default_rng(1)
    rows, columns = ([list(model.linearize().outputs).index(one) for one in first],
                     [list(model.linearize().inputs).index(one) for one in second])  # fmt: skip
    variance = (0.01 * np.abs(exact[np.ix_(rows, columns)])) ** 2 * rng.uniform(0.5, 2.0, (len(rows), 1, len(OMEGA)))
    factor = (1j * OMEGA) ** order
    data = mv.Measurement(OMEGA, factor * exact[np.ix_(rows, columns)], first, second,
                          variance=np.abs(factor) ** 2 * variance,
                          quantity=("displacement", "velocity", "acceleration")[order])  # fmt: skip
    fit = model.fit(data, ["k*.stiffness"])
    name = "z0" if kind == "output" else "F"
    (one,) = fit.next_sensor([name])
    size = np.array(list(fit.values.values()))[:, None]
    weight = np.sqrt(2.0 / variance)
    typical = np.median(weight, axis=0 if kind == "output" else 1)[0]

    def information(outputs, inputs, w):
        slopes = fit.model.linearize().frequency_response_sensitivities(OMEGA, list(fit.values), outputs, inputs)
        part = (slopes * w).reshape(3, -1).view(float) * size
        return part @ part.T

    before = np.eye(3) + information(list(first), list(second), weight)
    after = before + information([name] if kind == "output" else list(first),
                                 list(second) if kind == "output" else [name], typical)  # fmt: skip
    assert one.gain == pytest.approx(np.linalg.slogdet(after)[1] - np.linalg.slogdet(before)[1], rel=1e-5)
    spread = [np.linalg.inv(matrix).diagonal() for matrix in (before, after)]
    widest = int(spread[0].argmax())
    assert one.widest == fit.names[widest]
    assert one.narrower == pytest.approx(np.sqrt(spread[0][widest] / spread[1][widest]), rel=1e-5)
    with pytest.raises(ResponseError, match=r"output or input 'nothing'.* It has z0, z1, z2, F, F0\."):
        fit.next_sensor(["nothing"])
