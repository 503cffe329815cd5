"""Fits of models to simulated measurements: values, intervals, channels, and what the data do not tell."""

import pickle
from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.errors import AccuracyWarning, ModelError, ResponseError
from mbsvib.fitting.knowledge import combinations
from tests.fitting.scenes import away, chain, measured

OMEGA = 2 * np.pi * np.linspace(2.0, 60.0, 80)
FREE = ["k*.stiffness", "k*.damping", "b1.mass"]


def relative(fit, model):
    return np.array([fit.values[name] / value - 1.0 for name, value in model.parameters.items() if name in fit.values])


def test_exact_responses_give_exact_values_from_afar():
    model = chain()
    fit = away(model, FREE, 0.6, 1).fit(measured(model, OMEGA, 0.0, 0), FREE)
    assert fit.converged
    assert fit.residual_test.passed
    np.testing.assert_allclose(relative(fit, model), 0.0, atol=1e-11)
    assert fit.model.parameters["k1.stiffness"] == fit.values["k1.stiffness"]
    again = pickle.loads(pickle.dumps(fit))
    assert again.values == fit.values
    assert str(again) == str(fit)


def test_covariance_is_the_inverse_of_the_information():
    """Of the derivatives of whole responses, computed by the model itself."""
    model = chain()
    data = measured(model, OMEGA, 0.02, 3)
    fit = model.fit(data, FREE)
    slopes = fit.model.linearize().frequency_response_sensitivities(OMEGA, list(fit.values))
    rows = (slopes * np.sqrt(2.0 / data.variance)).reshape(len(slopes), -1).view(float)
    np.testing.assert_allclose(fit.covariance, np.linalg.inv(rows @ rows.T), rtol=1e-6,
                               atol=1e-9 * np.abs(fit.covariance).max())  # fmt: skip
    sd = np.sqrt(fit.covariance.diagonal())
    np.testing.assert_allclose(fit.deviation(np.eye(len(sd))), sd, rtol=1e-12)
    name = "k1.stiffness"
    low, high = fit.intervals[name]
    k = list(fit.values).index(name)
    assert np.log(high / low) == pytest.approx(2 * 1.959964 * sd[k] / fit.values[name], rel=1e-6)
    shift = fit.deviation(fit.model.linearize().mode_sensitivities(fit.rates).frequencies)
    assert shift.shape == (3,)
    assert (shift < 0.01).all()
    modes = fit.model.linearize().modes(2, confidence=fit)
    np.testing.assert_allclose(np.diff(modes.frequency_intervals)[:, 0], 2 * 1.959964 * shift[:2], rtol=1e-6)
    np.testing.assert_allclose(modes.frequency_intervals.mean(axis=1), modes.frequencies, rtol=1e-12)


def test_noise_that_is_not_known_is_that_of_the_residuals():
    """Their sum of squares over the numbers that are measured less the values that are fitted."""
    model = chain()
    data = measured(model, OMEGA[::16], 0.02, 3, ["z2"], ["F"], known=False)
    fit = model.fit(data, "k*.stiffness")
    residuals = fit.responses() - data.responses
    slopes = fit.model.linearize().frequency_response_sensitivities(data.omega, list(fit.values), "z2", "F")
    rows = slopes.reshape(3, -1).view(float)
    power = np.square(np.abs(residuals)).sum() / (rows.shape[1] - 3)
    np.testing.assert_allclose(fit.covariance, power * np.linalg.inv(rows @ rows.T), rtol=1e-4)


def covered(runs, known):
    model, hits, failed = chain(), [], 0
    for seed in range(runs):
        data = measured(model, OMEGA, 0.03, seed, ["z0", "z1", "z2"], ["F"], known=known)
        fit = away(model, FREE, 0.3, 1000 + seed).fit(data, FREE)
        failed += not fit.residual_test.passed
        hits += [low <= model.parameters[name] <= high for name, (low, high) in fit.intervals.items()]
    return np.mean(hits), failed


@pytest.mark.slow
@pytest.mark.parametrize("known", [True, False])
def test_intervals_hold_the_values_in_95_percent(known):
    share, failed = covered(150, known)
    assert 0.92 <= share <= 0.98
    assert failed <= 2


@pytest.mark.slow
def test_channels_are_found_with_signs():
    """An amplifier with the other sign, a delay and a low-pass in all outputs."""
    model = chain()
    gain = np.array([-3.0, 1.0, 0.5])[:, None, None]
    data = measured(model, OMEGA, 0.01, 1, change=lambda w: gain * np.exp(-2e-3j * w) / (1.0 + 1e-3j * w))
    fit = away(model, ["k*.stiffness"], 0.3, 1).fit(data, ["k*.stiffness"], channels=["gain", "delay", "lag"])
    assert fit.residual_test.passed
    expected = {"z0.gain": -3.0, "z1.gain": 1.0, "z2.gain": 0.5, "F0.gain": 1.0, "z0.delay": 2e-3, "z1.lag": 1e-3}
    for name, value in expected.items():
        k = list(fit.values).index(name)
        assert abs(fit.values[name] - value) < 4.0 * np.sqrt(fit.covariance[k, k]), name
    assert set(fit.values) - set(expected) == {"k0.stiffness", "k1.stiffness", "k2.stiffness", "z1.delay", "z2.delay",
                                               "z0.lag", "z2.lag"}  # fmt: skip
    assert fit.units["z0.delay"] == "s"
    np.testing.assert_allclose(fit.responses(), data.responses, rtol=0.06)
    drawn = fit.plot().axes[0].lines
    assert [line.get_label() for line in drawn[:2]] == ["measured", "fit of chain"]
    np.testing.assert_array_equal(drawn[1].get_ydata(), np.abs(fit.responses()[0, 0]))


def test_what_is_known_of_channels_counts_as_measured():
    """A prior of one value changes all as a Kalman update does: x + C e (p - x_k) / (C_kk + s^2); a bound holds it."""
    model = chain()
    data = measured(model, OMEGA, 0.01, 1, change=lambda w: np.exp(-2e-3j * w))
    start, words = away(model, ["k*.stiffness"], 0.3, 1), {"free": ["k*.stiffness"], "channels": ["delay"]}
    alone = start.fit(data, **words)
    names = list(alone.values)
    k, values, spread = names.index("z0.delay"), np.array(list(alone.values.values())), alone.covariance
    deviation = np.sqrt(spread[k, k])
    prior = values[k] + 0.5 * deviation, deviation
    told = start.fit(data, **words, prior={"z0.delay": prior})
    gain = spread[:, k] / (spread[k, k] + prior[1] ** 2)
    moved = (np.array([told.values[name] for name in names]) - values) / np.sqrt(spread.diagonal())
    np.testing.assert_allclose(moved, gain * (prior[0] - values[k]) / np.sqrt(spread.diagonal()), atol=5e-3)
    assert told.covariance[k, k] == pytest.approx(0.5 * spread[k, k], rel=1e-2)
    held = start.fit(data, **words, bounds={"z0.delay": (1e-4, 1.9e-3)})
    assert held.values["z0.delay"] == pytest.approx(1.9e-3, rel=1e-12)
    with pytest.raises(ModelError, match=r"prior has 'z9\.delay', which is not fitted"):
        start.fit(data, **words, prior={"z9.delay": prior})


def test_gains_come_from_the_inputs_that_were_measured():
    """An amplifier of another sign whose response to the first input is missing."""
    model = chain()
    exact = -3.0 * model.linearize().frequency_response(OMEGA)
    exact[0, 0] = exact[2, 1] = np.nan
    start = away(model, ["k*.stiffness"], 0.3, 1)
    fit = start.fit(mv.Measurement(OMEGA, exact, ["z0", "z1", "z2"], ["F", "F0"]), "k*.stiffness", channels="gain")
    np.testing.assert_allclose(relative(fit, model), 0.0, atol=1e-9)
    assert [fit.values[f"{name}.gain"] for name in ("z0", "z1", "z2", "F0")] == pytest.approx([-3.0] * 3 + [1.0])


def test_responses_that_the_model_does_not_have_leave_the_others_alone():
    """What is measured at a body apart is noise to the model, whose logarithm there is of no use."""
    model = chain()
    model.add_body("apart", 1.0, (1, 1, 1), position=(1, 0, 0))
    model.add_joint("rail", "prismatic", "ground", "apart", axis=(0, 0, 1))
    model.add_spring("k", "ground", "apart", (1, 0, -1), (1, 0, 0), stiffness=1e4, damping=3.0)
    model.add_output("other", "apart", "z")
    data = measured(model, OMEGA, 0.01, 1)
    responses, variance = data.responses.copy(), data.variance.copy()
    variance[3] = 1e-14
    responses[3] = 1e-7 * np.exp(1j * np.arange(2 * len(OMEGA))).reshape(2, -1)
    data = mv.Measurement(OMEGA, responses, data.outputs, data.inputs, variance=variance)
    fit = away(model, ["k?.stiffness"], 0.6, 1).fit(data, "k?.stiffness")
    np.testing.assert_allclose(relative(fit, model), 0.0, atol=5e-3)


@pytest.mark.slow
def test_springs_in_series_are_told_by_their_sum_only():
    """A node without mass between two springs: only 1/k + 1/k is known."""

    def series(lower=1e4, upper=2e4):
        model = mv.Model("series")
        model.add_body("node", 0.0, (0, 0, 0), position=(0, 0, 1.0))
        model.add_body("top", 2.0, (1, 1, 1), position=(0, 0, 2.0))
        for i, (body, below, k) in enumerate((("node", "ground", lower), ("top", "node", upper))):
            model.add_joint(f"rail_{body}", "prismatic", "ground", body, axis=(0, 0, 1))
            model.add_spring(("lower", "upper")[i], below, body, (0, 0, float(i)), (0, 0, i + 1.0), k, damping=0.0)
        model.add_spring("damper", "ground", "top", (0, 1, 0), (0, 1, 2.0), damping=5.0)
        model.add_input("F", "top", "z")
        model.add_output("z", "top", "z")
        model.add_output("middle", "node", "z")
        return model

    model = series()
    data = measured(model, OMEGA, 0.01, 1)
    start = series(1.2e4, 1.7e4)
    fit = start.fit(data["z", :], ["lower.stiffness", "upper.stiffness"])
    assert len(fit.unidentified) == 1
    assert "lower.stiffness" in fit.unidentified[0]
    assert "upper.stiffness" in fit.unidentified[0]
    assert fit.intervals["lower.stiffness"] == (0.0, np.inf)
    assert np.isinf(fit.covariance[0, 0])
    assert "not determined by the data" in str(fit)
    series_stiffness = 1.0 / (1.0 / fit.values["lower.stiffness"] + 1.0 / fit.values["upper.stiffness"])
    assert series_stiffness == pytest.approx(1.0 / (1e-4 + 0.5e-4), rel=2e-3)
    both = start.fit(data, ["lower.stiffness", "upper.stiffness"])
    assert both.unidentified == ()
    np.testing.assert_allclose(relative(both, model), 0.0, atol=5e-3)
    best = fit.next_sensor()
    assert [one.name for one in best] == ["middle"]
    assert best[0].narrower > 10.0


@pytest.mark.parametrize("seed", range(4))
def test_what_is_not_told_does_not_depend_on_the_basis(seed):
    directions = np.array([[0.0, 1.0, -1.0, 0.0, 0.0], [1.0, 0.0, 0.0, -0.5, 0.0]])
    turned = np.linalg.qr(np.random.default_rng(seed).standard_normal((2, 2)))[0] @ np.linalg.qr(directions.T)[0].T
    first, second = combinations(turned, ["a", "b", "c", "d", "e"])
    assert first == pytest.approx({"a": 1.0, "d": -0.5}, abs=1e-14)
    assert second == pytest.approx({"b": 1.0, "c": -1.0}, abs=1e-14)


def test_next_sensor_tells_most_by_its_own_derivatives():
    model = chain()
    data = measured(model, OMEGA, 0.01, 1, ["z2"], ["F"])
    fit = model.fit(data, FREE)
    ranked = fit.next_sensor()
    size = np.array(list(fit.values.values()))[:, None]
    weight = np.sqrt(2.0 / data.variance[0, 0])
    slopes = fit.model.linearize().frequency_response_sensitivities(OMEGA, list(fit.values), ["z2", "z0", "z1"], ["F"])
    rows = [((size * part[:, 0]) * weight).view(float) for part in slopes.swapaxes(0, 1)]
    information = [part @ part.T for part in rows]
    before = np.eye(len(size)) + information[0]
    gains = {name: np.linalg.slogdet(before + one)[1] - np.linalg.slogdet(before)[1]
             for name, one in zip(("z0", "z1"), information[1:], strict=True)}  # fmt: skip
    for one in ranked:
        if one.name in gains:
            assert one.gain == pytest.approx(gains[one.name], rel=1e-6)
    order = np.array([one.gain for one in ranked])
    assert (np.diff(order) <= 1e-12 * order[:-1]).all()  # those that are equal but for rounding keep the model's order
    assert {one.name for one in ranked} == {"z0", "z1", "F0"}
    with pytest.raises(ResponseError, match="no candidate"):
        fit.next_sensor("z2")


def test_noise_of_a_candidate_of_another_quantity_is_as_large_against_its_responses():
    """An accelerometer tells as much as a displacement sensor of the same relative noise at each line."""
    model = chain()
    model.add_output("a0", "b0", "z", quantity="acceleration")
    exact = model.linearize().frequency_response(OMEGA, ["z2", "z0"], ["F"])
    data = mv.Measurement(OMEGA, exact, ["z2", "z0"], ["F"], variance=(0.01 * np.abs(exact)) ** 2)
    fit = model.fit(data["z2", :], FREE)
    (one,) = fit.next_sensor("a0")
    both = model.fit(data, FREE)
    size = np.array(list(fit.values.values()))
    before, after = (np.eye(len(size)) + np.linalg.inv(f.covariance / np.outer(size, size)) for f in (fit, both))
    expected = np.linalg.slogdet(after)[1] - np.linalg.slogdet(before)[1]
    assert one.gain == pytest.approx(expected, rel=1e-4)


@pytest.mark.slow
def test_wrong_structure_is_said():
    """A mass that is 30 % off, and not fitted."""
    model = chain()
    data = measured(model, OMEGA, 0.01, 1)
    fit = model.with_values({"b0.mass": 1.3}).fit(data, ["k*.stiffness", "k*.damping"])
    assert not fit.residual_test.passed
    assert fit.residual_test.ratio > 100.0
    assert fit.residual_test.bands
    assert "does not explain" in str(fit)
    plain = model.fit(data, ["k*.stiffness", "k*.damping"])
    widths = [np.sqrt(one.covariance.diagonal() / np.array(list(one.values.values())) ** 2) for one in (fit, plain)]
    assert (widths[0] > 0.5 * np.sqrt(fit.residual_test.ratio) * widths[1]).all()


def test_outputs_with_common_noise_are_whitened():
    """Intervals of a common noise are those of generalised least squares."""
    model = chain()
    system = model.linearize()
    exact = system.frequency_response(OMEGA, ["z0", "z1", "z2"], ["F"])
    size = 0.02 * np.abs(exact).mean()
    power = size**2 * (0.1 * np.eye(3) + np.ones((3, 3)))
    rng = np.random.default_rng(0)
    noise = np.linalg.cholesky(power / 2.0) @ (rng.standard_normal((3, 80)) + 1j * rng.standard_normal((3, 80)))
    data = mv.Measurement(OMEGA, exact + noise[:, None], ["z0", "z1", "z2"], ["F"],
                          covariance=np.repeat(power[:, :, None], 80, axis=2))  # fmt: skip
    fit = model.fit(data, FREE)
    assert fit.residual_test.passed
    slopes = fit.model.linearize().frequency_response_sensitivities(OMEGA, list(fit.values), ["z0", "z1", "z2"], ["F"])
    white = np.sqrt(2.0) * np.einsum("ij,pjn->pin", np.linalg.inv(np.linalg.cholesky(power)), slopes[:, :, 0])
    rows = white.reshape(len(slopes), -1).view(float)
    np.testing.assert_allclose(np.sqrt(fit.covariance.diagonal()), np.sqrt(np.linalg.inv(rows @ rows.T).diagonal()),
                               rtol=1e-6)  # fmt: skip


@pytest.mark.slow
def test_payloads_and_priors_and_ties():
    """The same springs with two payloads; a value tied to all of them, another known before."""
    model = chain(stiffness=(2e4, 2e4, 2e4))
    heavy = model.with_values({"b2.mass": 6.0})
    data = [measured(model, OMEGA, 0.01, 1), ({"b2.mass": 6.0}, measured(heavy, OMEGA, 0.01, 2))]
    start = model.with_values({"k*.stiffness": 1.5e4, "b0.mass": 1.2})
    prior = {"b0.mass": (1.0, 1e-4)}
    fit = start.fit(data, ["b0.mass"], ["k*.stiffness"], prior, {"k*.stiffness": (1e4, 3e4)})
    assert fit.values["k*.stiffness"] == pytest.approx(2e4, rel=2e-3)
    assert fit.values["b0.mass"] == pytest.approx(1.0, abs=5e-4)
    assert fit.covariance[0, 0] < 1e-8
    assert fit.model.parameters["k2.stiffness"] == fit.values["k*.stiffness"]
    single = start.fit(data[:1], ["b0.mass"], ["k*.stiffness"], prior)
    assert fit.covariance[1, 1] < 0.8 * single.covariance[1, 1]
    softer = model.with_values({"k*.stiffness": 1.5e4})
    held = softer.fit(data, [], ["k*.stiffness"], bounds={"k*.stiffness": (1e4, 1.8e4)})
    assert held.values["k*.stiffness"] == 1.8e4
    assert "k*.stiffness is at its bound." in str(held)
    assert "bound" not in str(fit)


@pytest.mark.slow
def test_loads_take_the_model_to_its_equilibrium():
    """A mass on a soft inclined spring under gravity: where it hangs, and how it vibrates, depend on the stiffness."""

    def hanging(k):
        model = mv.Model("hanging", gravity=(0, 0, -9.81))
        model.add_body("m", 1.0, (0.1, 0.1, 0.1), position=(0, 0, 0))
        model.add_joint("rail", "prismatic", "ground", "m", (0, 0, 0), axis=(0, 0, 1))
        model.add_spring("k", "ground", "m", (0.5, 0, 0.8), (0, 0, 0), stiffness=k, damping=2.0, free_length=0.8)
        model.add_input("F", "m", "z")
        model.add_output("z", "m", "z")
        return model

    data = measured(hanging(200.0).equilibrium(), 2 * np.pi * np.linspace(0.5, 6.0, 40), 0.01, 4)
    fit = hanging(260.0).equilibrium().fit(data, "k.stiffness")
    assert fit.residual_test.passed
    low, high = fit.intervals["k.stiffness"]
    assert low < 200.0 < high
    assert high / low < 1.02


def test_lines_without_noise_and_pairs_that_were_not_measured():
    """A variance of 0 counts as the least one, an infinite one and NaN as not measured."""
    model = chain()
    data = measured(model, OMEGA, 0.01, 1)
    variance, responses = data.variance.copy(), data.responses.copy()
    variance[0, 0, 3] = 0.0
    responses[1, 1] = responses[2, 0, 7] = np.nan
    responses[0, 1, 5], variance[0, 1, 5] = 1e3, np.inf
    fit = model.fit(mv.Measurement(OMEGA, responses, data.outputs, data.inputs, variance=variance), FREE)
    assert [fit.values[f"k{i}.stiffness"] for i in range(3)] == pytest.approx([1e4, 2e4, 3e4], rel=0.02)
    assert np.isnan(fit.responses()[1, 1]).all()
    np.testing.assert_array_equal(np.flatnonzero(~np.isfinite(fit.responses()[0, 1])), [5])
    assert np.isfinite(fit.responses()[0, 0]).all()
    with pytest.raises(ResponseError, match="no line that was measured with a known noise"):
        model.fit(mv.Measurement(OMEGA, responses, data.outputs, data.inputs, variance=np.zeros_like(variance)), FREE)


def test_what_cannot_be_fitted_is_named():
    model, data = chain(), measured(chain(), OMEGA, 0.01, 1)
    with pytest.raises(ModelError, match=r"k9\.stiffness"):
        model.fit(data, "k9.stiffness")
    with pytest.raises(ModelError, match=r"both set \'k0\.stiffness\'"):
        model.fit(data, "k0.stiffness", "k*.stiffness")
    with pytest.raises(ModelError, match=r"prior has 'k1\.stiffness', which is not fitted"):
        model.fit(data, "k0.stiffness", prior={"k1.stiffness": (1.0, 1.0)})
    with pytest.raises(ModelError, match="a start within ascending bounds"):
        model.fit(data, "k0.stiffness", bounds={"k0.stiffness": (1e5, 1e6)})
    with pytest.raises(ModelError, match="standard deviation"):
        model.fit(data, "k0.stiffness", prior={"k0.stiffness": (1e4, 0.0)})
    with pytest.raises(ModelError, match="'phase'"):
        model.fit(data, "k0.stiffness", channels="phase")
    with pytest.raises(ModelError, match="fitted, and given"):
        model.fit([({"k0.stiffness": 1e4}, data)], "k0.stiffness")
    with pytest.raises(ModelError, match="2 numbers were measured"):
        model.fit(data.within(2.0, 2.5)["z0", "F"], ["k*.stiffness"])
    with pytest.raises(ResponseError, match="expected a Measurement"):
        model.fit({"z0": 1.0}, "k0.stiffness")
    with pytest.raises(ResponseError, match="data is empty"):
        model.fit([], "k0.stiffness")
    with pytest.raises(ResponseError, match=r"shape \(2,\); expected \(1, \.\.\.\)"):
        model.fit(data, "k0.stiffness").deviation([1.0, 2.0])


def test_several_starts_and_progress():
    model, told = chain(), []
    data = measured(model, OMEGA, 0.01, 1)
    fit = away(model, FREE, 0.5, 4).fit(data, FREE, starts=3, seed=1, progress=lambda *count: told.append(count))
    assert fit.residual_test.passed
    assert told[-1][0] > 5
    assert all(done <= most for done, most in told)


def free_pair(stiffness):
    """Two masses that move freely along x; what LU makes of the stiffness is rounding, not zero."""
    model = mv.Model("pair")
    for k, name in enumerate(("a", "b", "c")):
        model.add_body(name, 1.0, (0, 0, 0), position=(k, 0, 0))
        model.add_joint(f"rail.{name}", "prismatic", "ground", name, axis=(1, 0, 0))
        model.add_output(f"x.{name}", name, "x")
    for name, first, second, at in (("k", "a", "b", 0), ("l", "b", "c", 1)):
        model.add_spring(name, first, second, (at, 0, 0), (at + 1, 0, 0), stiffness=stiffness, damping=1.0)
    model.add_input("F", "a", "x")
    return model


def test_a_line_at_0_hz_of_a_free_model_is_refused_unless_it_was_not_measured():
    omega = np.array([0.0, 20.0, 40.0, 60.0])
    g = np.full((3, 1, 4), np.nan + 0j)
    g[..., 1:] = free_pair(1234.5).linearize().frequency_response(omega[1:])
    start, names = free_pair(1100.1), (["x.a", "x.b", "x.c"], ["F"])
    fit = start.fit(mv.Measurement(omega, g, *names), tied=["?.stiffness"], free=[])
    assert fit.values["?.stiffness"] == pytest.approx(1234.5, rel=1e-9)
    with pytest.raises(mv.ResponseError, match=r"0 Hz if it moves freely\); leave the line out"):
        start.fit(mv.Measurement(omega, np.nan_to_num(g), *names), tied=["?.stiffness"], free=[])


@pytest.mark.parametrize("change", [{"masses": (1.0, 2.3, 3.0)}, {"damping": (2.0, 8.0, 6.0)}, None])
def test_a_wrong_structure_shows_without_stated_noise(change):
    """A few lines at peaks outweigh all others at light damping, and there residuals change their sign.

    The last case is magnitudes without phase.
    """
    omega = 2 * np.pi * np.linspace(0.5, 60.0, 80)
    exact = measured(chain(**(change or {})), omega, 0.0, 0)
    data = exact if change else mv.Measurement(omega, np.abs(exact.responses), exact.outputs, exact.inputs)
    with nullcontext() if change else pytest.warns(AccuracyWarning, match="have no imaginary part"):
        test = chain().fit(data, ["k0.stiffness"]).residual_test
    assert not test.passed
    assert test.correlation > 0.4


def test_noise_in_proportion_to_responses_is_told_by_residuals():
    """Intervals are those of noise that is stated, and residuals are noise."""
    model = chain()
    known = measured(model, OMEGA, 0.02, 5, ["z2"], ["F"])
    fit, stated = (model.fit(data, "k*.stiffness") for data in (replace(known, variance=None), known))
    assert fit.residual_test.passed
    widths = [[np.log(high / low) for low, high in one.intervals.values()] for one in (fit, stated)]
    np.testing.assert_allclose(widths[0], widths[1], rtol=0.2)


def test_channels_of_unknown_scale_take_a_gain():
    model = chain()
    data = measured(model, OMEGA[::4], 0.0, 0, ["z1", "z2"], ["F"])
    volts = replace(data, responses=50.0 * data.responses, output_units=["V", "V"], input_units=["N"])
    with pytest.raises(ResponseError, match=r"'z1' of data 1 is in V, that of the model in m.*channels=\['gain'\]"):
        model.fit(volts, "k1.stiffness")
    fit = model.fit(volts, "k1.stiffness", channels="gain")
    assert fit.values["z1.gain"] == pytest.approx(50.0)
    t = np.arange(40.0)
    with pytest.raises(ResponseError, match="'z1' of data 1 is in EU"):
        model.fit(mv.Records(t, {"F": t**2 % 5.0}, {"z1": t**2 % 7.0}, output_units=["EU"]), "k1.stiffness")


@pytest.mark.parametrize(("seed", "turn"), [(1, np.asarray), (2, np.asarray), (1, np.conj), (2, np.conj)])
def test_conjugated_responses_are_told(seed, turn):
    model = chain()
    data = measured(model, OMEGA, 0.05, seed, ["z0", "z2"], ["F"])
    data = replace(data, responses=turn(data.responses))
    with pytest.warns(AccuracyWarning, match="phases of data 1 turn") if turn is np.conj else nullcontext():
        away(model, FREE, 0.2, 1).fit(data, "k1.stiffness")


def test_magnitudes_are_told():
    """Their fit ended at other values, and only the residual test said that something is wrong."""
    model = chain()
    data = measured(model, OMEGA, 0.0, 1, ["z0", "z2"], ["F"])
    with pytest.warns(AccuracyWarning, match="responses of data 1 have no imaginary part, unlike those of the model"):
        model.fit(replace(data, responses=np.abs(data.responses)), tied="k1.stiffness")


@pytest.mark.parametrize("wrong", [
    {"prior": {"k1.stiffness": (np.nan, 1.0)}}, {"prior": {"k1.stiffness": (None, 1.0)}}, {"channels": None},
    {"channels": 3}, {"seed": "a"}, {"prior": {"k1.stiffness": (1.0, np.nan)}},
])  # fmt: skip
def test_arguments_that_are_no_numbers_or_names_are_refused(wrong):
    model = chain()
    with pytest.raises(ModelError, match=f"fit: {next(iter(wrong))}.*expected"):
        model.fit(measured(model, OMEGA[::16], 0.0, 0, ["z2"], ["F"]), "k1.stiffness", **wrong)
