"""Each estimator line by line: against scipy.signal, the formulas written out, and drawn spectra of known noise."""

import numpy as np
import pytest
from scipy import signal

import mbsvib as mv
from mbsvib.errors import ResponseError
from mbsvib.measurement import estimation, time_records


def normal(rng, *shape):
    return (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) / np.sqrt(2.0)


def drawn(seed, sizes, averages, lines, noise):
    """Spectral matrices of y = G u and references r, u = H r, with white noise of outputs and inputs."""
    rng = np.random.default_rng(seed)
    outputs, inputs, references = sizes
    g, mixed = normal(rng, outputs, inputs), normal(rng, inputs, references or inputs)
    r = normal(rng, lines, references or inputs, averages)
    u = mixed @ r
    y = g @ u + noise[0] * normal(rng, lines, outputs, averages)
    u = u + noise[1] * normal(rng, *u.shape)
    z = np.concatenate((y, u, r) if references else (y, u), axis=1)
    return g, z @ z.conj().swapaxes(1, 2) / averages


@pytest.mark.parametrize("length", [64, 65])
@pytest.mark.parametrize("experiments", [1, 3])
def test_averages_are_those_of_scipy(length, experiments):
    """All cross spectra with their order and conjugate; the number of independent averages from overlaps."""
    rng = np.random.default_rng(length)
    records = rng.standard_normal((experiments, 3, 500)) + 3.0
    found, averages, _ = estimation.welch(records, length)
    window = signal.get_window("hann", length)
    step = length - length // 2
    for c in range(3):
        for d in range(3):
            expected = signal.csd(records[:, d], records[:, c], nperseg=length, scaling="density")[1].mean(axis=0)
            scale = 2.0 / np.sum(window**2)
            np.testing.assert_allclose(found[1:-1, c, d] * scale, expected[1:-1], rtol=1e-9, atol=1e-12)
    count = (500 - length) // step + 1
    rho = window[:-step] @ window[step:] / (window @ window)
    assert averages == pytest.approx(experiments * count / (1.0 + 2.0 * (1.0 - 1.0 / count) * rho**2), rel=1e-12)
    assert estimation.welch(records[..., :length], length)[1] == experiments


@pytest.mark.parametrize(("method", "options", "first"), [
    ("H1", {"segments": 20}, 4.0 / 9.0), ("H2", {"segments": 20}, None), ("local", {}, None),
    ("Hv", {"segments": 20, "noise_ratio": 1e3}, 4.0 / 9.0),
])  # fmt: skip
@pytest.mark.parametrize("inputs", [1, 2])
def test_correlation_of_neighbouring_lines(method, options, first, inputs):
    """Against errors that are drawn: responses of 0, so that estimates are errors, or of 1 for H2.

    White inputs and Hann windows have the square of 2 / 3 between neighbours: windows have it, and so has the input.
    """
    found, stated, records = np.zeros(4), np.zeros(4), 1 if method == "local" else 4
    for seed in range(records):
        rng = np.random.default_rng(seed)
        u, noise = (0.1 ** (method == "H2") * rng.standard_normal((kind, 12000)) for kind in (inputs, 2))
        y = (rng.standard_normal((2, 12000)) if method == "H2" else noise)[:inputs]
        driven = {f"u{i}": one + (y[i] if method == "H2" else 0.0) for i, one in enumerate(u)}
        data = mv.Measurement.from_records(1e-3, driven, {f"y{i}": one for i, one in enumerate(y)}, method=method,
                                           **options)  # fmt: skip
        errors = data.responses - (np.eye(inputs)[..., None] if method == "H2" else 0.0)
        for j in range(1, 5):
            both = (errors[..., j:] * errors[..., :-j].conj()).real.sum()
            found[j - 1] += both / (np.abs(errors) ** 2).sum() / records
            stated[j - 1] += (data.line_correlation[j - 1] if j <= len(data.line_correlation) else 0.0) / records
    np.testing.assert_allclose(stated, found, atol=0.06)
    assert found[0] > 0.3
    if first is not None:
        assert stated[0] == pytest.approx(first, abs=0.03)


def test_impacts_at_one_time_have_the_correlation_of_the_window():
    """2 / 3 and 1 / 6 of Hann windows, where all inputs turn alike from line to line."""
    rng = np.random.default_rng(0)
    u = np.zeros((5, 1000))
    u[:, 500] = rng.uniform(0.5, 1.5, 5)
    data = mv.Measurement.from_records(1e-3, {"u": u}, {"y": u + 0.01 * rng.standard_normal(u.shape)}, segments=1)
    np.testing.assert_allclose(data.line_correlation, [2.0 / 3.0, 1.0 / 6.0], atol=0.01)


@pytest.mark.parametrize(("experiments", "periods", "averages"), [(1, 1, None), (1, 3, 3), (3, 2, 3), (4, 1, 4)])
def test_averages_of_periods_and_experiments(experiments, periods, averages):
    """One more than the variance has degrees of freedom: of experiments, else of periods."""
    rng = np.random.default_rng(1)
    u = np.tile(rng.standard_normal((experiments, 50)), periods)
    data = mv.Measurement.from_records(1e-3, {"u": u}, {"y": u + 0.1 * rng.standard_normal(u.shape)},
                                       method="periodic", period=0.05)  # fmt: skip
    assert data.averages == averages
    assert data.line_correlation.size == 0


@pytest.mark.parametrize(("sizes", "instruments"), [
    ((2, 1, 0), [2]), ((2, 2, 0), [2, 3]), ((2, 2, 0), [0, 1]), ((3, 2, 3), [5, 6, 7]), ((1, 1, 2), [2, 3]),
])  # fmt: skip
def test_instruments_line_by_line(sizes, instruments):
    averages, (_, spectra) = 30.0, drawn(1, sizes, 30, 5, (0.3, 0.2))
    found = estimation.by_instruments(spectra, sizes[:2], np.array(instruments), averages)
    y, u = np.arange(sizes[0]), sizes[0] + np.arange(sizes[1])
    for k, s in enumerate(spectra):
        back = np.linalg.inv(s[np.ix_(instruments, instruments)])
        power = np.linalg.inv(s[np.ix_(u, instruments)] @ back @ s[np.ix_(instruments, u)])
        g = s[np.ix_(y, instruments)] @ back @ s[np.ix_(instruments, u)] @ power
        np.testing.assert_allclose(found.responses[..., k], g, rtol=1e-10)
        error = s[np.ix_(y, y)] - g @ s[np.ix_(u, y)] - s[np.ix_(y, u)] @ g.conj().T + g @ s[np.ix_(u, u)] @ g.conj().T
        expected = np.outer(error.diagonal().real, power.diagonal().real) / (averages - sizes[1])
        np.testing.assert_allclose(found.variance[..., k], expected, rtol=1e-9)
        if sizes[1] == 1:
            coherence = np.abs(s[y, u]) ** 2 / (s[y, y] * s[u, u]).real
            np.testing.assert_allclose(found.coherence[:, 0, k], coherence, rtol=1e-12)
        scaled = s[np.ix_(u, u)] / np.sqrt(np.outer(s[u, u], s[u, u]).real)
        assert found.condition[k] == pytest.approx(np.sqrt(np.linalg.cond(scaled)), rel=1e-9)
    assert (found.coherence is None) == (sizes[1] > 1)
    with pytest.raises(ResponseError, match="independent averages for"):
        estimation.by_instruments(spectra, sizes[:2], np.array(instruments), float(sizes[1]))


def test_total_least_squares_of_one_input_in_closed_form():
    _, spectra = drawn(2, (3, 1, 0), 20, 6, (0.4, 0.3))
    syy, suu, syu = spectra[:, range(3), range(3)].real, spectra[:, 3, 3].real[:, None], spectra[:, :3, 3]
    mean = estimation.total_least_squares(spectra, (3, 1), None, 20.0)
    np.testing.assert_allclose(mean.responses[:, 0].T, np.sqrt(syy / suu) * syu / np.abs(syu), rtol=1e-9)
    ratio = 0.6
    found = estimation.total_least_squares(spectra, (3, 1), ratio, 20.0)
    apart = syy / ratio**2 - suu
    root = apart + np.sqrt(apart**2 + 4.0 * np.abs(syu) ** 2 / ratio**2)
    np.testing.assert_allclose(found.responses[:, 0].T, root / (2.0 * syu.conj() / ratio**2), rtol=1e-9)


@pytest.mark.few(2)
@pytest.mark.parametrize(("method", "sizes", "noise", "ratio"), [
    ("H1", (2, 2, 0), (0.3, 0.0), None), ("H2", (2, 2, 0), (0.0, 0.1), None),
    ("reference", (2, 2, 2), (0.3, 0.2), None),
    ("Hv", (2, 2, 0), (0.3, 0.2), 1.5), ("Hv", (2, 1, 0), (0.1, 0.3), 1 / 3),
    ("reference", (1, 1, 1), (0.3, 0.3), None),
    ("Hv", (1, 3, 0), (0.2, 0.1), 2.0),
])  # fmt: skip
def test_variance_of_each_pair_is_the_scatter(method, sizes, noise, ratio):
    """Of 2 000 drawn lines: the mean is the truth within five standard errors, the scatter the stated variance."""
    averages, lines = 150, 2000
    g, spectra = drawn(8, sizes, averages, lines, noise)
    first = {"H1": sizes[0], "H2": 0, "reference": sizes[0] + sizes[1], "Hv": 0}[method]
    if method == "Hv":
        found = estimation.total_least_squares(spectra, sizes[:2], ratio, float(averages))
    else:
        found = estimation.by_instruments(spectra, sizes[:2], first + np.arange(sizes[1]), float(averages))
    error = found.responses - g[:, :, None]
    scatter = np.mean(np.abs(error) ** 2, axis=2)
    np.testing.assert_allclose(np.mean(found.variance, axis=2) / scatter, 1.0, atol=0.12)
    assert (np.abs(error.mean(axis=2)) < 5.0 * np.sqrt(scatter / lines) + 0.02 * np.sqrt(scatter)).all()


def curved(seed, sizes, experiments, lines):
    """Records whose spectra are curved responses times references, beside curved transients; G of all lines."""
    rng = np.random.default_rng(seed)
    outputs, inputs, references = sizes
    k = np.arange(1, lines + 1) / lines
    powers = k[:, None] ** np.arange(3)
    r = normal(rng, experiments, references or inputs, lines)
    to_u = np.einsum("irp,kp->kir", normal(rng, inputs, references, 3), powers) if references else None
    to_y = np.einsum("orp,kp->kor", normal(rng, outputs, references or inputs, 3), powers)
    transient = np.einsum("ezp,kp->ezk", normal(rng, experiments, outputs + (inputs if references else 0), 3), powers)
    y = np.einsum("kor,erk->eok", to_y, r) + transient[:, :outputs]
    u = r if to_u is None else np.einsum("kir,erk->eik", to_u, r) + transient[:, outputs:]
    spectra = np.concatenate((y, u, r) if references else (y, u), axis=1)
    whole = np.pad(spectra, ((0, 0), (0, 0), (1, 1)))
    whole[..., -1] = 0.0
    g = to_y if to_u is None else to_y @ np.linalg.pinv(to_u)
    return np.fft.irfft(whole), g


@pytest.mark.parametrize(("sizes", "experiments"), [((2, 1, 0), 1), ((2, 2, 0), 2), ((1, 1, 1), 1), ((2, 2, 2), 3)])
def test_local_polynomials_are_exact_for_curved_responses(sizes, experiments, monkeypatch):
    """At the ends, within, for a choice of lines and for blocks of them; the last line, at half the rate, is none."""
    records, g = curved(3, sizes, experiments, 90)
    wanted = np.array([0, 1, 40, 41, 60, 70])
    found = estimation.local_polynomials(records, sizes, wanted)
    np.testing.assert_allclose(found.responses, g[wanted].transpose(1, 2, 0), rtol=1e-7, atol=1e-9)
    assert (found.variance <= 1e-18 * np.abs(g).max() ** 2).all()
    assert (found.variance >= 0.0).all()
    monkeypatch.setattr(estimation, "CHUNK", 4)
    np.testing.assert_allclose(estimation.local_polynomials(records, sizes, wanted).responses, found.responses,
                               rtol=1e-9, atol=1e-12)  # fmt: skip
    if sizes[1] == 1:
        np.testing.assert_allclose(found.condition, 1.0)
    with pytest.raises(ResponseError, match=r"method='local' needs \d+ or more"):
        estimation.local_polynomials(records[..., :24], sizes, wanted[:2])


@pytest.mark.few(2)
@pytest.mark.parametrize(("sizes", "experiments"), [((2, 1, 0), 2), ((1, 2, 0), 2), ((2, 1, 1), 1), ((1, 2, 2), 3)])
def test_variance_of_local_polynomials_is_the_scatter_of_each_pair(sizes, experiments):
    """Noise of the outputs on curved responses: at lines far apart, whose windows do not overlap."""
    rng = np.random.default_rng(5)
    records, g = curved(4, sizes, experiments, 20_000)
    records[:, : sizes[0]] += 0.05 * records.std() * rng.standard_normal((experiments, sizes[0], records.shape[2]))
    wanted = np.arange(40, 19_900, 30)
    found = estimation.local_polynomials(records, sizes, wanted)
    error = np.abs(found.responses - g[wanted].transpose(1, 2, 0)) ** 2
    np.testing.assert_allclose(np.median(error / found.variance, axis=2), 0.72, atol=0.12)  # F(2, 14) and more


def test_periods_and_groups_apart():
    """Noise of one group from its periods; the first samples, which are no whole period, do not count."""
    rng = np.random.default_rng(6)
    period, periods = 32, 400
    u = np.tile(rng.standard_normal((1, 1, period)), periods)
    response = np.array([1.0, -2.0])[:, None] * np.fft.rfft(u[0, 0, :period])
    y = np.tile(np.fft.irfft(response), periods) + 0.1 * rng.standard_normal((2, period * periods))
    records = np.concatenate((np.full((1, 3, 7), 50.0), np.concatenate((y, u[0]))[None]), axis=2)
    lines = np.array([1, 4, 9])
    found = estimation.periodic(records, (2, 1), period, lines)
    power = np.abs(np.fft.rfft(u[0, 0, :period])[lines]) ** 2
    np.testing.assert_allclose(found.noise[:, 0], np.tile(0.01 * period / power / periods, (2, 1)), rtol=0.2)
    assert found.variance is found.noise
    error = found.responses[:, 0] - np.array([1.0, -2.0])[:, None]
    assert (np.abs(error) ** 2 / found.noise[:, 0]).mean() < 4.0
    alone = estimation.periodic(records[..., -period:], (2, 1), period, lines)
    assert (alone.noise, alone.variance, alone.averages) == (None, None, None)
    two = np.stack((records[0], records[0] * [[2.0], [2.0], [2.0]]))
    np.testing.assert_allclose(estimation.periodic(two, (2, 1), period, lines).noise, found.noise / 2.0, rtol=1e-9)
    with pytest.raises(ResponseError, match=r"1 experiments of 0\.5 periods for 1 inputs"):
        estimation.periodic(records[..., : period // 2], (2, 1), period, lines)


def test_condition_of_two_correlated_inputs():
    """sqrt((1 + c) / (1 - c)) for a correlation c, whatever their sizes."""
    c, scale = 0.6, np.diag([1.0, 1e-3])
    power = scale @ np.array([[1.0, c * 1j], [-c * 1j, 1.0]]) @ scale
    np.testing.assert_allclose(estimation._condition(np.array([power])), [2.0], rtol=1e-9)


def test_records_come_as_outputs_inputs_and_references():
    rng = np.random.default_rng(0)
    given = {name: rng.standard_normal((2, 20)) + 5.0 for name in ("a", "b", "u", "r", "q")}
    groups = {"output": {"a": given["a"], "b": given["b"]}, "input": {"u": given["u"]},
              "reference": {"r": given["r"], "q": given["q"]}}  # fmt: skip
    records, sizes = time_records.stacked(groups)
    assert sizes == (2, 1, 2)
    for k, one in enumerate(given.values()):
        np.testing.assert_allclose(records[:, k], one - one.mean(axis=1, keepdims=True))
    groups = {"output": {"a": given["a"][0]}, "input": {"u": given["u"][0]}, "reference": {}}
    assert time_records.stacked(groups)[0].shape == (1, 2, 20)


@pytest.mark.parametrize(("t", "count", "step"), [(0.25, 7, 0.25), (np.arange(5) * 0.5 + 3.0, 5, 0.5),
                                                  (np.round(np.arange(300) / 300.0, 5), 300, 1 / 300)])  # fmt: skip
def test_steps_of_times(t, count, step):
    assert time_records.step_of(t, count) == pytest.approx(step, rel=1e-4)


@pytest.mark.parametrize("t", [0.0, -1.0, [0.0], [1.0, 0.5, 0.0], [0.0, 1.0, np.nan], [0.0, 1.0, 2.1], [0.0, 0.9, 2.0],
                               [1.0, 1.0, 1.0]])  # fmt: skip
def test_times_that_are_none(t):
    with pytest.raises(ResponseError, match=r"t has shape|times are uneven|a positive time between samples"):
        time_records.step_of(t, 3)


@pytest.mark.parametrize(("given", "samples"), [
    ((100, 0.1, None, None), 100), ((100, 0.1, 7, None), 14), ((100, 0.1, 25, None), 4), ((100, 0.1, 1, None), 100),
    ((100, 0.1, None, 2.0), 20), ((100, 0.1, None, 2.0005), 20), ((100, 0.1, None, 0.2), 2),
])  # fmt: skip
def test_samples_of_a_stretch(given, samples):
    assert time_records.samples_of(*given) == samples


@pytest.mark.parametrize("given", [(100, 0.1, 26, None), (100, 0.1, 0, None), (100, 0.1, True, None),
                                   (9, 1.0, 2.0, None),
                                   (100, 0.1, None, 0.1), (100, 0.1, None, 2.004), (100, 0.1, None, -2.0)])  # fmt: skip
def test_stretches_that_are_none(given):
    with pytest.raises(ResponseError, match="whole number"):
        time_records.samples_of(*given)


@pytest.mark.parametrize(("band", "lowest", "method", "words"), [
    ((0.5, 3.0), (4.0, 0.25), "H1", ""), ((0.4, 3.0), None, "H1", "segments of 2 s, whose lowest line is 0.5 Hz"),
    ((3.0, 0.5), None, "local", "expected a band"), ((0.0, 3.0), None, "local", "expected a band"),
    (None, (4.0, 0.1), "H1", r"expected 1 / \(ratio f\) = 2.5 s or more. Record longer, take fewer segments, or"),
    (None, (4.0, 0.4), "local", r"expected 4 / \(ratio f\) = 2.5 s or more. Record longer\."),
    (None, (4.0, 0.5), "local", ""),
    (None, (4.0, 0.1), "periodic", r"2 s for a mode at 4 Hz with damping ratio 0.1; expected 1 /"),
    (None, (-4.0, 0.2), "H1", "expected a frequency"), (None, (4.0, 0.0), "Hv", "expected a frequency"),
])  # fmt: skip
def test_lengths_that_resolve_the_lines(band, lowest, method, words):
    if not words:
        time_records.check_length(2.0, band, lowest, method)
        return
    with pytest.raises(ResponseError, match=words):
        time_records.check_length(2.0, band, lowest, method)


def test_h2_of_one_input_takes_each_output_alone():
    """S_yy / S_uy of each; of more inputs as many outputs are needed."""
    rng = np.random.default_rng(1)
    u = rng.standard_normal((2, 800))
    y = np.stack([u[0] + 0.2 * u[1], 2.0 * u[0] - u[1], u[1]])
    data = mv.Measurement.from_records(0.1, {"u": u[0]}, {"a": y[0], "b": y[1]}, method="H2", segments=10)
    for k, one in enumerate("ab"):
        alone = mv.Measurement.from_records(0.1, {"u": u[0]}, {one: y[k]}, method="H2", segments=10)
        for field in ("responses", "variance", "coherence"):
            np.testing.assert_allclose(getattr(data, field)[k], getattr(alone, field)[0], rtol=1e-9)
        syy, suy = (signal.csd(first, y[k], 10.0, nperseg=80)[1] for first in (y[k], u[0]))
        np.testing.assert_allclose(alone.responses[0, 0], (syy / suy.conj())[1:-1], rtol=0.02)
    with pytest.raises(ResponseError, match="H2 of 3 outputs and 2 inputs; expected as many of both"):
        mv.Measurement.from_records(0.1, {"u": u[0], "v": u[1]}, dict(zip("abc", y, strict=True)), method="H2",
                                    segments=10)  # fmt: skip


def test_lines_of_a_band_with_both_ends():
    u = np.random.default_rng(2).standard_normal(400)
    data = mv.Measurement.from_records(0.01, {"u": u}, {"y": 2.0 * u + 0.1}, segments=4, band=(3.0, 7.0))
    np.testing.assert_allclose(data.frequencies, [3.0, 4.0, 5.0, 6.0, 7.0])
    np.testing.assert_allclose(data.responses, 2.0)
    every = mv.Measurement.from_records(0.01, {"u": u}, {"y": 2.0 * u + 0.1}, segments=4)
    np.testing.assert_allclose(every.frequencies, np.arange(1.0, 50.0))
