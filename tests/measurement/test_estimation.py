"""Estimates from time records: against scipy.signal, closed forms, and seeded records of known system and noise."""

import numpy as np
import pytest
from scipy import signal

import mbsvib as mv

STEP = 1e-2
NUM, DEN = signal.zpk2tf([0.3], [0.9 * np.exp(0.9j), 0.9 * np.exp(-0.9j)], 0.05)


def truth(frequencies):
    """The response of the discrete filter."""
    return signal.freqz(NUM, DEN, worN=2 * np.pi * frequencies * STEP)[1]


def records(count, seed, input_noise=0.0, output_noise=0.0, experiments=1):
    rng = np.random.default_rng(seed)
    u = rng.standard_normal((experiments, count + 200))
    y = signal.lfilter(NUM, DEN, u)[:, 200:]
    u = u[:, 200:]
    return (u + input_noise * rng.standard_normal(u.shape), y + output_noise * rng.standard_normal(y.shape))


def test_h1_and_coherence_are_those_of_scipy():
    u, y = records(3000, 1, output_noise=0.05)
    data = mv.Measurement.from_records(STEP, {"u": u}, {"y": y}, segments=5)
    frequencies, cross = signal.csd(u[0], y[0], 1 / STEP, nperseg=600)
    _, power = signal.welch(u[0], 1 / STEP, nperseg=600)
    _, coherence = signal.coherence(u[0], y[0], 1 / STEP, nperseg=600)
    inner = slice(1, -1)
    np.testing.assert_allclose(data.frequencies, frequencies[inner], rtol=1e-12)
    np.testing.assert_allclose(data.responses[0, 0], (cross / power)[inner], rtol=1e-6)  # they remove one mean more
    np.testing.assert_allclose(data.coherence[0, 0], coherence[inner], rtol=1e-6)
    m = data.averages
    # windows that overlap by half: rho = 1/6 in the limit of long segments
    assert m == pytest.approx(9 / (1 + 2 * (8 / 9) / 36), rel=1e-4)
    c = data.coherence
    np.testing.assert_allclose(data.variance, abs(data.responses) ** 2 * (1 - c) / (c * (m - 1)), rtol=1e-9)
    assert data.notes == ("method H1", "resolution 0.166667 Hz", f"{m:.3g} independent averages")


@pytest.mark.few(2)
@pytest.mark.parametrize(
    ("method", "noise", "options"),
    [("H1", (0.0, 0.1), {"segments": 10}), ("H2", (0.3, 0.0), {"segments": 10}),
     ("Hv", (0.3, 0.1), {"segments": 10, "noise_ratio": 1 / 3}), ("local", (0.0, 0.1), {})],
)  # fmt: skip
def test_bias_and_variance_of_each_estimator(method, noise, options):
    """Of 40 seeded records: the mean is the truth within four standard errors, the scatter the stated variance."""
    runs, band, count = 40, (3.0, 40.0), 4000 if options else 1000
    found = [mv.Measurement.from_records(STEP, {"u": u}, {"y": y}, method=method, band=band, **options)
             for u, y in (records(count, seed, *noise) for seed in range(runs))]  # fmt: skip
    g = np.array([data.responses[0, 0] for data in found])
    stated = np.array([data.variance[0, 0] for data in found]).mean(axis=0)
    error = g - truth(found[0].frequencies)
    scatter = (np.abs(g - g.mean(axis=0)) ** 2).sum(axis=0) / (runs - 1)
    # mean of many lines: standard error of a ratio below 2 % with the correlation of neighbours
    assert (scatter / stated).mean() == pytest.approx(1.0, abs=0.08)
    bias = np.abs(error.mean(axis=0)) / np.sqrt(scatter / runs)
    assert np.sqrt(np.mean(bias**2)) < 1.3  # 1 without bias
    assert bias.max() < 5.0


def test_local_polynomials_do_not_leak():
    """A damping ratio of 0.5 % at 14.3 Hz in a record of 16 / (ratio f); Hann windows of an eighth of it do leak.

    At 4 / (ratio f), the least that is taken, the variance has the error.
    """
    num, den = signal.zpk2tf([0.3], [0.9955 * np.exp(0.9j), 0.9955 * np.exp(-0.9j)], 0.05)
    u = np.random.default_rng(11).standard_normal(25_300)
    y = signal.lfilter(num, den, u)[3000:]
    errors = []
    for length, options in ((22_300, {"method": "local"}), (5575, {"method": "local"}), (22_300, {"segments": 8})):
        lowest = (14.324, 0.00501)
        data = mv.Measurement.from_records(STEP, {"u": u[3000:][:length]}, {"y": y[:length]}, band=(13.5, 15.1),
                                           lowest=lowest, **options)  # fmt: skip
        g = signal.freqz(num, den, worN=data.omega * STEP)[1]
        errors.append(data.responses[0, 0] / g - 1.0)
    assert np.abs(errors[0]).max() < 0.015
    assert np.abs(errors[1]).max() < 0.25
    assert np.abs(errors[2]).max() > 0.07
    with pytest.raises(mv.ResponseError, match=r"10 s for a mode .* expected 4 / \(ratio f\) = 55.74 s or more"):
        mv.Measurement.from_records(STEP, {"u": u[:1000]}, {"y": y[:1000]}, method="local", lowest=lowest)


@pytest.mark.slow
def test_estimators_are_biased_as_they_should():
    """H1 low by 1 / (1 + noise to signal) at the input's noise, H2 high by that at the output's."""
    u, y = records(200_000, 3, input_noise=0.5)
    data = mv.Measurement.from_records(STEP, {"u": u}, {"y": y}, segments=1000)
    np.testing.assert_allclose(np.mean(data.responses[0, 0] / truth(data.frequencies)), 1 / 1.25, rtol=0.01)
    u, y = records(200_000, 4, output_noise=0.02)
    data = mv.Measurement.from_records(STEP, {"u": u}, {"y": y}, segments=1000, method="H2")
    g = truth(data.frequencies)
    np.testing.assert_allclose(np.mean(data.responses[0, 0] / g / (1 + 0.02**2 / abs(g) ** 2)), 1.0, rtol=0.02)
    both = [mv.Measurement.from_records(STEP, {"u": u}, {"y": y}, segments=10, method=m).responses
            for m in ("H1", "H2", "Hv")]  # fmt: skip
    np.testing.assert_allclose(both[2], both[0] * np.sqrt(abs(both[1] / both[0])), rtol=1e-9)


def closed_loop(r, v):
    """u = r - 8 y for y = G u + v, with a sample of delay in G."""
    delayed = np.concatenate(([0.0], NUM))
    closed = np.polyadd(DEN, 8.0 * delayed)
    y = signal.lfilter(delayed, closed, r) + signal.lfilter(DEN, closed, v)
    return r - 8.0 * y, y


@pytest.mark.slow
def test_closed_loop_needs_the_reference():
    """u = r - 8 y with noise in y: H1 is biased, the reference removes it, whether averaged or local."""
    rng = np.random.default_rng(5)
    r, v = rng.standard_normal((2, 20_000))
    u, y = closed_loop(r, 0.05 * v)
    delay = lambda f: np.exp(-2j * np.pi * f * STEP)  # noqa: E731
    errors = []
    for options in ({"segments": 50}, {"segments": 50, "reference": {"r": r}},
                    {"method": "local", "reference": {"r": r}}):  # fmt: skip
        data = mv.Measurement.from_records(STEP, {"u": u}, {"y": y}, band=(5.0, 45.0), **options)
        g = truth(data.frequencies) * delay(data.frequencies)
        errors.append((data.responses[0, 0] - g, data.variance[0, 0]))
    bias = [abs(np.mean(error)) / np.mean(np.sqrt(variance)) for error, variance in errors]
    assert bias[0] > 1.0
    assert max(bias[1:]) < 0.15
    # the variance of a local polynomial has 7 complex degrees of freedom: F distribution of mean 7 / 6
    for (error, variance), mean in zip(errors[1:], (1.0, 7 / 6), strict=True):
        assert np.mean(abs(error) ** 2 / variance) == pytest.approx(mean, abs=0.2)
    u, y = closed_loop(r, v)
    with pytest.raises(mv.ResponseError, match=r"known to \d+ % only; expected 30 % or less. Average more"):
        mv.Measurement.from_records(STEP, {"u": u}, {"y": y}, method="local", reference={"r": r})


def test_local_polynomials_need_excited_lines():
    """A multisine over whole periods: its lines are 8 apart in the record, and there are none outside of its band."""
    spectrum = np.zeros(257, dtype=complex)
    spectrum[5:200] = np.exp(2j * np.pi * np.random.default_rng(9).random(195))
    for periods, band in ((8, (10.0, 30.0)), (1, None)):
        u = np.tile(np.fft.irfft(spectrum), periods)
        y = signal.lfilter(NUM, DEN, u)
        with pytest.raises(mv.ResponseError, match=r"too few lines are excited for method='local'. Leave them out"):
            mv.Measurement.from_records(STEP, {"u": u}, {"y": y}, method="local", band=band)


def two_by_two(u):
    gains = np.array([[1.0, -0.4], [0.3, 2.0]])
    return np.einsum("oi,ein->eon", gains, signal.lfilter(NUM, DEN, u)), gains


@pytest.mark.few(2)
@pytest.mark.parametrize("method", ["H1", "H2", "Hv", "local"])
def test_several_inputs_by_several_experiments_or_at_once(method):
    rng = np.random.default_rng(6)
    u = rng.standard_normal((3, 2, 6000))
    y, gains = two_by_two(u)
    y += 0.01 * rng.standard_normal(y.shape)
    options = {} if method == "local" else {"segments": 12}
    data = mv.Measurement.from_records(STEP, {"a": u[:, 0], "b": u[:, 1]}, {"p": y[:, 0], "q": y[:, 1]}, method=method,
                                       **options, output_units=("m", "m"), input_units=("N", "N"))  # fmt: skip
    error = data.responses - gains[:, :, None] * truth(data.frequencies)
    if method == "local":
        assert np.mean(abs(error) ** 2 / data.variance) == pytest.approx(1.0, abs=0.05)
    assert np.sqrt(np.mean(abs(error) ** 2)) < 0.02
    assert "condition of the inputs up to " in data.notes[-1]
    assert data.input_units == ("N", "N")


def test_condition_of_inputs_does_not_depend_on_their_units():
    """Two independent inputs, one in N and one in kN, are as independent as before."""
    u = np.random.default_rng(6).standard_normal((2, 3000))
    notes = [mv.Measurement.from_records(STEP, {"a": u[0], "b": unit * u[1]}, {"p": u[0] + u[1]}, segments=20).notes[-1]
             for unit in (1.0, 1e-3)]  # fmt: skip
    assert notes[0] == notes[1]


def test_periodic_data_give_noise_and_distortion_apart():
    """Two inputs by two orthogonal experiments, four realisations, five periods; every second line is excited."""
    rng = np.random.default_rng(7)
    period, groups, periods = 64, 4, 5
    lines = np.arange(1, 31, 2)
    spectra = np.zeros((groups, 2, 2, period // 2 + 1), dtype=complex)
    phases = np.exp(2j * np.pi * rng.random((groups, len(lines))))
    spectra[..., lines] = np.array([[1, 1], [1, -1]])[None, :, :, None] * phases[:, None, None] * period
    one = np.fft.irfft(spectra).reshape(2 * groups, 2, period)
    u = np.tile(one, periods + 3)
    y, gains = two_by_two(u)
    y = y + 0.05 * np.tile(rng.standard_normal((2 * groups, 2, period)), periods + 3)  # the same in each period
    y += 0.01 * rng.standard_normal(y.shape)
    cut = slice(3 * period, None)
    named = {"a": u[:, 0, cut], "b": u[:, 1, cut]}, {"p": y[:, 0, cut], "q": y[:, 1, cut]}
    data = mv.Measurement.from_records(STEP, *named, method="periodic", period=period * STEP)
    known = ~np.isnan(data.responses[0, 0])
    np.testing.assert_allclose(data.frequencies[known], lines / (period * STEP))
    assert data.notes[-1].startswith("condition of the inputs up to 1,")
    error = (data.responses - gains[:, :, None] * truth(data.frequencies))[:, :, known]
    # |U| = period: E|dG|^2 = 2 E|N|^2 / (2 period)^2, E|N|^2 = period s^2, over realisations and periods
    noise, distortion = (period * 2 / (2 * period) ** 2 * s**2 / groups for s in (0.01, 0.05))
    assert data.noise_variance[:, :, known].mean() == pytest.approx(noise / periods, rel=0.15)
    assert data.variance[:, :, known].mean() == pytest.approx(distortion + noise / periods, rel=0.3)
    assert np.mean(abs(error) ** 2) == pytest.approx(distortion + noise / periods, rel=0.3)
    with pytest.raises(mv.ResponseError, match="3 experiments of 5 periods for 2 inputs"):
        mv.Measurement.from_records(STEP, *({k: v[:3] for k, v in group.items()} for group in named),
                                    method="periodic", period=period * STEP)  # fmt: skip


U, Y = records(400, 8)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"method": "H3"}, "method = 'H3'; expected 'H1', 'H2',"),
        ({"segments": None}, "segments = None with method='H1'; expected one"),
        ({"segments": 200}, "segments = 200; expected a whole number from 1 to 100"),
        ({"segments": 1}, "1 independent averages for 1 inputs; expected more"),
        ({"method": "local"}, "segments = 4 with method='local'; expected none"),
        ({"method": "periodic", "segments": None, "period": 0.123}, r"period = 0.123 s is 12.3 samples"),
        ({"method": "H2", "reference": {"r": U}}, "reference with method='H2'"),
        ({"noise_ratio": 2.0}, "noise_ratio = 2.0 with method='H1'"),
        ({"band": (0.5, 10.0)}, "segments of 1 s, whose lowest line is 1 Hz"),
        ({"band": (60.0, 90.0)}, "no line from 60 to 90 Hz; there are lines each 1 Hz up to 50 Hz"),
        ({"lowest": (12.0, 0.01)}, r"damping ratio 0.01; expected 1 / \(ratio f\) = 8.333 s or more. Record"),
        ({"band": 30.0}, "band = 30.0 Hz with .*; expected a band above it, "),
        ({"lowest": 12.0}, "lowest = 12.0; expected a frequency"),
        ({"outputs": {"y": Y.T}}, r"'y' has shape \(400, 1\); expected experiments and samples"),
        ({"t": np.arange(400.0) ** 1.01}, "times are uneven: off by"),
        ({"t": np.arange(10.0)}, r"t has shape \(10,\), records have 400 samples"),
        ({"inputs": {"u": U[:, :300]}}, r"'u' has shape \(1, 300\); expected experiments and samples, \(1, 400\)"),
        ({"inputs": {"u": 0 * U}}, "'u' is constant; leave this input out"),
        ({"inputs": {"u": np.where(np.arange(400) == 7, np.nan, U)}}, "'u' is not finite at sample 7"),
        ({"inputs": {"u": U, "v": 2 * U}}, "the 2 inputs are not independent: their condition is"),
        ({"inputs": U}, "inputs = .*; expected records by name"),
        ({"inputs": {"u": U, "v": U**2}, "reference": {"r": U}}, "1 references for 2 inputs"),
    ],
)  # fmt: skip
def test_what_records_do_not_tell_is_refused(change, message):
    given = {"t": STEP, "inputs": {"u": U}, "outputs": {"y": Y}, "segments": 4} | change
    with pytest.raises(mv.ResponseError, match=message):
        mv.Measurement.from_records(given.pop("t"), given.pop("inputs"), given.pop("outputs"), **given)
