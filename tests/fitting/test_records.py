"""Time records as data: exact values, the covariance of least squares in time, coloured noise, channels, refusals."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.api.fitting import _problem
from mbsvib.errors import ResponseError
from mbsvib.fitting.data import conditioned
from mbsvib.fitting.problem import real_rows
from mbsvib.fitting.variables import variables
from tests.fitting.scenes import away, chain, measured
from tests.fitting.test_derivatives import spinning, springs
from tests.fitting.test_modes import modes_of

FREE = ["k*.stiffness", "k*.damping"]
STEP, COUNT, BEFORE = 2e-3, 701, 300


def run(model, hold="first", seed=0, experiments=1, count=COUNT, level=1.0):
    """Inputs (experiments, inputs, N) and outputs (experiments, outputs, N) of a model that was in motion before."""
    system, rng = model.linearize(), np.random.default_rng(seed)
    fine = 24 if hold == "band-limited" else 1
    t = STEP / fine * np.arange((count + BEFORE) * fine)
    pairs = []
    for _ in range(experiments):
        force = level * rng.standard_normal((len(system.inputs), len(t)))
        if fine > 1:  # nothing above 0.35 of the sampling rate
            spectra = np.fft.rfft(force)
            spectra[:, np.fft.rfftfreq(len(t), STEP / fine) > 0.35 / STEP] = 0.0
            force = np.fft.irfft(spectra, len(t))
        motion = system.time_response(t, force, hold="zero" if hold == "zero" else "first")
        pairs.append((force[:, BEFORE * fine :: fine], motion[:, BEFORE * fine :: fine]))
    return [np.array(part) for part in zip(*pairs, strict=True)]


def records(model, hold="first", seed=0, experiments=1, noise=None, level=1.0, **words):
    """Records of a model; ``noise``: deviation in parts of the rms of each output."""
    force, motion = run(model, hold, seed, experiments, level=level)
    rms = motion.std(axis=(0, 2))
    if noise is not None:
        rng = np.random.default_rng(1000 + seed)
        motion = motion + noise * rms[:, None] * rng.standard_normal(motion.shape)
        words.setdefault("variance", dict(zip(model.outputs, (noise * rms) ** 2, strict=True)))
    named = [{name: part[:, k] for k, name in enumerate(names)}
             for names, part in ((model.inputs, force), (model.outputs, motion))]  # fmt: skip
    return mv.Records(STEP, *named, hold=hold, **words)


def off(fit, model):
    return np.array([value / model.parameters[name] - 1.0 for name, value in fit.values.items()])


@pytest.mark.slow
@pytest.mark.parametrize(("hold", "most"), [("first", 1e-9), ("zero", 1e-9), ("band-limited", 3e-4)])
def test_exact_records_give_exact_values_whatever_went_before(hold, most):
    """Displacement, velocity and acceleration, of two experiments; what is folded back is small where it is not held.
    """
    model = chain(quantities=("displacement", "velocity", "acceleration"))
    fit = away(model, FREE, 0.3, 1).fit(records(model, hold, experiments=2, band=(1.0, 170.0)), FREE)
    assert fit.converged
    np.testing.assert_allclose(off(fit, model), 0.0, atol=most)


@pytest.mark.slow
def test_motions_without_mass_and_quantities_that_the_model_does_not_name():
    """A node between two springs; accelerations upside down against displacements of the model."""
    model = springs()
    fit = away(model, ["k*.stiffness"], 0.2, 2).fit(records(model), ["k*.stiffness"])
    np.testing.assert_allclose(off(fit, model), 0.0, atol=1e-8)
    force, motion = run(chain(quantities=("acceleration",) * 3))
    nodes = {k + 1: (0.0, 0.0, k + 1.0) for k in range(3)}
    data = mv.Records(STEP, {"F": force[0, 0], "F0": force[0, 1]}, {f"{k + 1}Z-": -motion[0, k] for k in range(3)},
                      nodes=nodes, output_units=["m/s^2"] * 3)  # fmt: skip
    fit = away(chain(), FREE, 0.3, 1).fit(data, FREE)
    np.testing.assert_allclose(off(fit, chain()), 0.0, atol=1e-8)
    base = chain(quantities=("acceleration",) * 3)
    base.add_base_motion("floor", "z")
    one, other = force[0, 0], motion[0, 0]
    with pytest.raises(ResponseError, match="'z0' of the model has another quantity than the records data 1"):
        base.fit(mv.Records(STEP, {"floor": one}, {"z0": other}, output_units=["m"]), FREE)
    with pytest.raises(ResponseError, match="the input 'floor' of data 1 is in m, that of the model in m/s"):
        base.fit(mv.Records(STEP, {"floor": one}, {"z0": other}, input_units=["m"]), FREE)


def test_a_decay_needs_no_input():
    model, system = chain(), chain().linearize()
    t = STEP * np.arange(900)
    motion = system.time_response(t, np.zeros((2, len(t))), initial=([1e-3, 0.0, -2e-3], [0.0, 0.3, 0.0]))
    free = ["k*.stiffness", "k*.damping"]
    fit = away(model, free, 0.02, 1).fit(mv.Records(t, {}, dict(zip(model.outputs, motion, strict=True))), free, (),
                                         {"k0.stiffness": (1e4, 1e-3)})  # fmt: skip
    np.testing.assert_allclose(off(fit, model), 0.0, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("shared", [False, True])
def test_covariance_is_that_of_least_squares_in_time(shared):
    """The information of samples with white noise, less what means, drifts and an unknown beginning take, by other
    routes.
    """
    model = chain()
    force, motion = run(model)
    power = np.diag([1e-12, 4e-12, 2e-12])
    if shared:
        power = power + 1.5e-12
    words = {"covariance": power} if shared else {"variance": dict(zip(model.outputs, power.diagonal(), strict=True))}
    noise = np.linalg.cholesky(power) @ np.random.default_rng(3).standard_normal(motion[0].shape)
    fit = model.fit(mv.Records(STEP, dict(zip(model.inputs, force[0], strict=True)),
                               dict(zip(model.outputs, motion[0] + noise, strict=True)), **words), FREE)  # fmt: skip
    assert fit.residual_test.passed
    system, t = fit.model.linearize(), STEP * np.arange(COUNT)
    # where the motion began, by the residuals themselves: the states that fit best
    begin = np.array([system.time_response(t, 0.0 * force[0], initial=np.split(row, 2)) for row in np.eye(6)]
                     + [np.outer(row, t) for row in np.eye(3)])  # fmt: skip
    driven = system.time_response(t, force[0])
    weight = np.linalg.inv(np.linalg.cholesky(power))

    def rows(signals):
        centred = signals - signals.mean(axis=-1, keepdims=True)
        return (weight @ centred).reshape(len(signals), -1)

    free = rows(begin)
    found = np.linalg.lstsq(free.T, rows((motion[0] + noise - driven)[None])[0], rcond=None)[0]
    state = np.split(found[:6], 2)
    slopes = rows(system.time_response_sensitivities(t, force[0], list(fit.values), initial=state))
    slopes -= (slopes @ np.linalg.pinv(free)) @ free
    expected = np.linalg.inv(slopes @ slopes.T)
    deviation = np.sqrt(expected.diagonal())
    np.testing.assert_allclose(fit.covariance / deviation / deviation[:, None],
                               expected / deviation / deviation[:, None], atol=1e-5)  # fmt: skip
    # and no value nearby has a smaller sum of squares in time
    left = rows((motion[0] + noise - driven)[None])[0]
    left -= np.linalg.lstsq(free.T, left, rcond=None)[0] @ free
    assert np.abs(slopes @ left * deviation).max() < 2e-2


CHANNELS = ("gain", "delay", "lag", "lowpass", "highpass")


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["first", "zero", "band-limited", "shared", "channels", "rotor"])
def test_gradient_is_that_of_the_cost(kind):
    """With noise: projections on free states move with the values as well, at no change of the gradient."""
    model = spinning() if kind == "rotor" else chain()
    free = ["near.stiffness.*", "shaft.mass", "wheel.inertia"] if kind == "rotor" else [*FREE, "b*.mass"]
    hold = kind if kind in ("zero", "band-limited") else "first"
    words = {"variance": None, "covariance": 1e-12 * (np.eye(3) + 0.5)} if kind == "shared" else {}
    data = records(model, hold, experiments=2, noise=0.1, band=(20.0, 120.0), **words)
    chosen = variables(model.parameters, free, (), None, None)
    problem = _problem(model, conditioned(data), chosen, CHANNELS if kind == "channels" else ())
    rng = np.random.default_rng(0)
    x = problem.variables.unknowns(problem.variables.start) + 0.03 * rng.standard_normal(len(problem.variables.start))
    x[len(chosen.names) :] += 0.1
    sums, step = problem.sums(x, False), 1e-4
    for k, slope in enumerate(sums.gradient):
        unit = step * np.eye(len(x))[k]
        near, wide = ((problem.cost(x + s * unit, False) - problem.cost(x - s * unit, False)) / (2.0 * s * step)
                      for s in (1.0, 2.0))  # fmt: skip
        assert (4.0 * near - wide) / 3.0 == pytest.approx(slope, rel=1e-4, abs=1e-5 * np.abs(sums.gradient).max()), k


def test_rows_are_derivatives_where_residuals_vanish():
    model = chain()
    data = records(model, band=(5.0, 120.0), variance=1e-12)
    chosen = variables(model.parameters, [*FREE, "b*.mass"], (), None, None)
    problem = _problem(model, conditioned(data), chosen, ("gain",))
    x = problem.variables.unknowns(problem.variables.start)
    slopes = np.concatenate([real_rows(block)[0] for _, block in problem.blocks(x)], axis=1)

    def residuals(at):
        return np.concatenate([np.ascontiguousarray(block.residual).reshape(-1).view(float)
                               for _, block in problem.blocks(at, slopes=False)])  # fmt: skip

    for k, row in enumerate(slopes):
        unit = 1e-4 * np.eye(len(x))[k]
        found = (residuals(x + unit) - residuals(x - unit)) / 2e-4
        np.testing.assert_allclose(row, found, atol=1e-4 * np.abs(row).max(), err_msg=problem.variables.names[k])


@pytest.mark.slow
@pytest.mark.parametrize(("kinds", "expected"), [
    (("gain", "lowpass"), {"z0.gain": 1.0, "z1.gain": -2.0, "z0.lowpass.frequency": 60.0,
                           "z0.lowpass.damping_ratio": 0.3, "z2.lowpass.frequency": 90.0}),
    (("highpass", "delay"), {"z0.highpass.frequency": 3.0, "z0.highpass.damping_ratio": 0.6,
                             "z1.highpass.frequency": 1.5, "z2.delay": 3e-4}),
])  # fmt: skip
def test_filters_of_responses_and_of_records_are_found(kinds, expected):
    """Of second order, all outputs with their own; responses exactly, records from what a filter in time makes of them.
    """
    from scipy.signal import lsim

    model, free = chain(), ["k*.stiffness"]
    filters = []
    for k in range(3):
        corner, ratio = (60.0 + 15.0 * k, 0.3) if "lowpass" in kinds else (3.0 / (k + 1.0), 0.6)
        w = 2 * np.pi * corner
        top = [w * w] if "lowpass" in kinds else [1.0, 0.0, 0.0]
        gain = (1.0, -2.0, 0.5)[k] if "gain" in kinds else 1.0
        filters.append((gain * np.array(top), np.array([1.0, 2 * ratio * w, w * w])))
    delay = np.array([0.0, 0.0, 3e-4 if "delay" in kinds else 0.0])
    omega = 2 * np.pi * np.linspace(1.0, 90.0, 200)
    s = 1j * omega
    factor = np.array([np.polyval(top, s) / np.polyval(below, s) for top, below in filters])
    factor *= np.exp(-np.outer(delay, s))
    exact = model.linearize().frequency_response(omega) * factor[:, None]
    start = away(model, free, 0.1, 1)
    data = mv.Measurement(omega, exact, model.outputs, model.inputs, variance=(1e-4 * np.abs(exact)) ** 2)
    fit = start.fit(data, free, channels=kinds)
    for name, value in expected.items():
        assert fit.values[name] == pytest.approx(value, rel=1e-4), name
    assert all(fit.units[name] == "Hz" for name in expected if name.endswith("frequency"))
    fine, lines = 24, 1500
    rng, t = np.random.default_rng(2), STEP / 24 * np.arange((lines + BEFORE) * fine)
    spectra = np.fft.rfft(rng.standard_normal((2, len(t))))
    spectra[:, np.fft.rfftfreq(len(t), STEP / fine) > 170.0] = 0.0
    force = np.fft.irfft(spectra, len(t))
    motion = model.linearize().time_response(t, force)
    seen = np.array([lsim(one, y, t)[1] for one, y in zip(filters, motion, strict=True)])
    seen = np.array([np.interp(t - late, t, y) for late, y in zip(delay, seen, strict=True)])
    part = np.s_[:, BEFORE * fine :: fine]
    recorded = mv.Records(STEP, dict(zip(model.inputs, force[part], strict=True)),
                          dict(zip(model.outputs, seen[part], strict=True)), hold="band-limited",
                          band=(1.0, 90.0))  # fmt: skip
    fit = start.fit(recorded, free, channels=kinds)
    for name, value in expected.items():
        assert fit.values[name] == pytest.approx(value, rel=5e-3), name


@pytest.mark.slow
def test_records_responses_and_modes_of_several_payloads_in_one_fit():
    model = chain()
    heavy = model.with_values({"b2.mass": 5.0})
    omega = 2 * np.pi * np.linspace(2.0, 60.0, 60)
    start = away(model, FREE, 0.3, 3)
    alone = start.fit(records(model, noise=0.05), FREE)
    data = [records(model, noise=0.05), ({"b2.mass": 5.0}, records(heavy, "zero", seed=5, noise=0.05)),
            measured(model, omega, 0.02, 1), modes_of(model)]  # fmt: skip
    fit = start.fit(data, FREE)
    deviation, before = (np.sqrt(one.covariance.diagonal()) for one in (fit, alone))
    assert (deviation < before).all()
    exact = np.array([model.parameters[name] for name in fit.values])
    assert (np.abs(np.array(list(fit.values.values())) - exact) < 4.0 * deviation).all()
    assert fit.residual_test.passed


@pytest.mark.slow
def test_noise_of_a_colour_weighs_lines():
    """Noise of low frequencies under a stated density: its intervals are narrower in the median, and hold."""
    model = chain()
    force, motion = run(model, count=2000)
    rng, f = np.random.default_rng(4), np.fft.rfftfreq(2000, STEP)
    size = motion.std(axis=(0, 2)).min()

    def density(frequency):
        return size**2 * 2.0 * STEP * (1e-4 + 1.0 / (1.0 + (np.asarray(frequency) / 4.0) ** 4))

    white = np.fft.rfft(rng.standard_normal((3, 2000)))
    noise = np.fft.irfft(white * np.sqrt(density(f) * 0.5 / STEP), 2000)
    named = (dict(zip(names, part, strict=True)) for names, part in (
        (model.inputs, force[0]), (model.outputs, motion[0] + noise)))  # fmt: skip
    inputs, outputs = named
    start = away(model, FREE, 0.2, 1)
    told = start.fit(mv.Records(STEP, inputs, outputs, noise=dict.fromkeys(outputs, density)), FREE)
    assert told.residual_test.passed
    assert told.residual_test.ratio == pytest.approx(1.0, abs=0.06)
    white_fit = start.fit(mv.Records(STEP, inputs, outputs), FREE)
    exact = np.array([model.parameters[name] for name in told.values])
    error, deviation = np.array(list(told.values.values())) - exact, np.sqrt(told.covariance.diagonal())
    assert (np.abs(error) < 4.0 * deviation).all()
    assert np.median(deviation / np.sqrt(white_fit.covariance.diagonal())) < 0.5


def covered(runs, known):
    model, hits, failed, errors = chain(), [], 0, []
    for seed in range(runs):
        words = {} if known else {"variance": None}
        data = records(model, seed=seed, noise=0.1, band=(1.0, 120.0), **words)
        fit = away(model, FREE, 0.02, 500 + seed).fit(data, FREE)
        failed += not fit.residual_test.passed
        hits += [low <= model.parameters[name] <= high for name, (low, high) in fit.intervals.items()]
        errors.append(off(fit, model))
    return np.mean(hits), failed, np.array(errors)


@pytest.mark.slow
@pytest.mark.parametrize("known", [True, False])
def test_intervals_hold_the_values_in_95_percent(known):
    share, failed, errors = covered(150, known)
    assert 0.92 <= share <= 0.98
    assert failed <= 2
    assert (np.abs(np.median(errors, axis=0)) < 4.0 * 1.25 * errors.std(axis=0) / np.sqrt(150)).all()


@pytest.mark.slow
def test_a_wrong_structure_is_said():
    """A spring across that the model does not have."""
    model = chain()
    model.add_spring("across", "b0", "b2", (0, 1, 1.0), (0, 1, 3.0), stiffness=4e3)
    fit = chain().fit(records(model, noise=0.01), ["k*.stiffness"])
    assert not fit.residual_test.passed
    assert fit.residual_test.ratio > 2.0


SIGNAL = np.random.default_rng(0).standard_normal(64)


@pytest.mark.parametrize(("words", "said"), [
    ({"band": (0.5, 100.0)}, r"band = \(0\.5, 100\.0\) Hz with 0\.128 s, whose lowest line is 7\.8"),
    ({"band": (10.0, 300.0)}, r"sampling rate of 500 Hz and hold='first'; expected no more than 242"),
    ({"band": (10.0, 240.0), "hold": "band-limited"}, "expected no more than 200 Hz"),
    ({"band": (10.0, 11.0)}, "no line from 10 to 11 Hz; there are lines each 7.8125 Hz"),
    ({"hold": "second"}, "hold = 'second'"),
    ({"variance": 1.0, "covariance": [[1.0]]}, "state the same"),
    ({"variance": 0.0}, "variance of 'z0' is not positive"),
    ({"variance": {"z1": 1.0}}, "variance of z1; expected one of each of z0"),
    ({"covariance": [[-1.0]]}, "symmetric positive definite"),
    ({"noise": {"z0": lambda f: 0.0 * f}}, "noise of 'z0' is not positive"),
    ({"output_units": ["m", "m"]}, "2 output_units for the outputs z0"),
    ({"t": [0.0, 1.0]}, "t has shape"),
])  # fmt: skip
def test_records_that_cannot_be_data_are_named(words, said):
    words = {"t": STEP, "inputs": {"F": SIGNAL}, "outputs": {"z0": SIGNAL[::-1]}} | words
    with pytest.raises(ResponseError, match=f"Records: .*{said}"):
        mv.Records(**words)


def test_records_without_outputs_or_too_short_for_their_beginning_are_refused():
    with pytest.raises(ResponseError, match=r"Records: outputs = \{\}"):
        mv.Records(STEP, {"F": SIGNAL}, {})
    data = mv.Records(STEP, {"F": SIGNAL}, {"z0": SIGNAL[::-1]}, band=(60.0, 80.0))
    with pytest.raises(ResponseError, match=r"data 1 have 6 numbers at 3 lines .* beginning takes 6; record"):
        chain().fit(data, ["k0.stiffness"])
    assert repr(data) == "Records(1 input, 1 output, 1 experiment of 0.128 s)"
    assert "rms" in str(data)
    assert not data.outputs["z0"].flags.writeable


@pytest.mark.slow
@pytest.mark.parametrize("correlated", [False, True])
def test_records_are_drawn_beside_those_of_the_fit(correlated):
    """The fit explains all but the noise; within the band nothing of what was measured is lost."""
    model = chain()
    clean = np.array([part[0] for part in records(model).outputs.values()])
    data = records(model, noise=0.05)
    if correlated:
        variance = [data.variance[name] for name in data.outputs]
        data = mv.Records(STEP, data.inputs, data.outputs, covariance=np.diag(variance) + 0.2 * min(variance))
    fit = away(model, FREE, 0.05, 1).fit(data, FREE)
    axes = fit.plot().axes
    assert len(axes) == len(data.outputs)
    for name, panel, exact in zip(data.outputs, axes, clean, strict=True):
        shown, told, left = (line.get_ydata() for line in panel.lines)
        assert panel.lines[1].get_label() == "fit of chain"
        np.testing.assert_allclose(shown, data.outputs[name][0] - data.outputs[name].mean(), atol=1e-12)
        np.testing.assert_allclose(left, shown - told, atol=1e-15)
        assert np.std(told - exact) < 0.3 * np.std(shown - exact)
    with pytest.raises(ResponseError, match="expected 1 to 1, the number of one of the measurements with responses or"):
        fit.plot(2)
    with pytest.raises(ResponseError, match="expected 1 to 0"):
        fit.responses()


@pytest.mark.parametrize("hold", ["zero", *(pytest.param(one, marks=pytest.mark.slow) for one in (
    "first", "band-limited"))])  # fmt: skip
def test_drifts_do_not_count(hold):
    """A drift, linear in time, is a saw tooth to Fourier coefficients, with parts at all lines."""
    model, count = chain(), 101
    force, motion = (part[0] for part in run(model, hold, count=count))
    fits = []
    for drift in (0.0, 300.0):
        drifting = motion + drift * motion.std(axis=1, keepdims=True) * np.arange(count) / count
        data = mv.Records(STEP, dict(zip(model.inputs, force, strict=True)),
                          dict(zip(model.outputs, drifting, strict=True)), 1e-10, hold=hold)  # fmt: skip
        fits.append(model.fit(data, "k0.stiffness").values["k0.stiffness"])
    assert fits[1] == pytest.approx(fits[0], rel=1e-6)
