"""Fits of responses whose errors at neighbouring lines are alike, against all of the correlation and drawn noise."""

from dataclasses import replace

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.api.fitting import _problem
from mbsvib.fitting import knowledge
from mbsvib.fitting.data import conditioned
from mbsvib.fitting.variables import variables
from tests.fitting.scenes import away, chain


def alike(size, seed, shape):
    """Noise of which neighbouring lines share a part: weighted means over lines, with its correlation."""
    weights = np.array([1.0, 3.0, 5.0, 3.0, 1.0])
    rng = np.random.default_rng(seed)
    white = rng.standard_normal((2, *shape[:-1], shape[-1] + 4))
    noise = np.apply_along_axis(np.convolve, -1, white[0] + 1j * white[1], weights, "valid")
    products = np.correlate(weights, weights, "full")[4:]
    return size * noise / np.sqrt(2.0 * products[0]), products[1:] / products[0]


def test_covariance_of_lines_that_are_alike(monkeypatch):
    """(J^T J)^-1 J^T R J (J^T J)^-1 with all of R, whatever lines are computed at once; a prior is independent."""
    model, omega = chain(), 2 * np.pi * np.linspace(2.0, 60.0, 37)
    exact = model.linearize().frequency_response(omega)
    noise, correlation = alike(1e-6, 0, exact.shape)
    data = mv.Measurement(omega, exact + noise, ["z0", "z1", "z2"], ["F", "F0"], variance=np.full(exact.shape, 1e-12),
                          line_correlation=correlation)  # fmt: skip
    chosen = variables(model.parameters, ["k*.stiffness"], (), {"k0.stiffness": (1.1e4, 1e3)}, None)
    problem = _problem(model, conditioned([data]), chosen, ())
    x = problem.variables.unknowns(problem.variables.start)
    blocks = {k: np.concatenate([block.slopes for j, block in problem.blocks(x) if j == k], axis=1) for k in (0, -1)}
    alone = replace(problem, data=_problem(model, conditioned([replace(data, line_correlation=())]), chosen, ()).data)
    slopes = next(iter(alone.blocks(x)))[1].slopes.reshape(3, len(omega), -1)
    factor = 1.0 + 2.0 * correlation.sum()
    np.testing.assert_allclose(blocks[0].reshape(slopes.shape), slopes / np.sqrt(factor))
    shared = np.eye(len(omega))
    for j, rho in enumerate(correlation, start=1):
        shared += rho * (np.eye(len(omega), k=j) + np.eye(len(omega), k=-j))
    prior = blocks[-1].reshape(3, -1)
    expected = np.einsum("anp,nm,bmp->ab", slopes, shared, slopes.conj()).real / factor**2 + (prior @ prior.T).real
    for size in (400_000, 100):
        monkeypatch.setattr("mbsvib.fitting.response_data.BLOCK", size)
        np.testing.assert_allclose(knowledge._of_noise(problem, x), expected, rtol=1e-9)
    assert problem.numbers == pytest.approx(2 * exact.size / factor + 1)


@pytest.mark.slow
@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize("lines", [150, 400])
def test_intervals_where_errors_of_lines_are_alike(known, lines):
    """Of 40 measurements some 95 % of the intervals hold, and right structures pass.

    Taken for independent, all were called wrong.
    """
    model, omega = chain(), 2 * np.pi * np.linspace(2.0, 60.0, lines)
    exact = model.linearize().frequency_response(omega)
    names = ["k0.stiffness", "k1.stiffness", "k2.stiffness", "k1.damping"]
    right, held, passed, blind = [model.parameters[name] for name in names], 0, 0, 0
    sd = 0.05 * np.median(np.abs(exact))
    for seed in range(40):
        noise, correlation = alike(sd, seed, exact.shape)
        data = mv.Measurement(omega, exact + noise, ["z0", "z1", "z2"], ["F", "F0"], line_correlation=correlation,
                              variance=np.full(exact.shape, sd**2) if known else None)  # fmt: skip
        fit = away(model, names, 0.1, seed).fit(data, names)
        held += sum(low <= value <= high for value, (low, high) in zip(right, fit.intervals.values(), strict=True))
        passed += fit.residual_test.passed
        blind += model.fit(replace(data, line_correlation=()), names).residual_test.passed
    assert 160 * 0.95 - 3.0 * np.sqrt(160 * 0.95 * 0.05) <= held
    assert passed >= 39
    assert blind == 0


@pytest.mark.slow
@pytest.mark.parametrize(("method", "options", "seconds"), [("local", {}, 8.0), ("H1", {"segments": 6}, 96.0)])
def test_intervals_of_estimated_responses(method, options, seconds):
    """Records of a shaker test: intervals hold, and the structure passes; of 48 none did."""
    model = chain(damping=(20.0, 40.0, 60.0))
    system, step = model.linearize(), 1e-3
    names = ["k0.stiffness", "k1.stiffness", "k2.stiffness", "k1.damping"]
    right, held, passed = [model.parameters[name] for name in names], 0, 0
    t = np.arange(0.0, seconds, step)
    for seed in range(20):
        rng = np.random.default_rng(seed)
        u = rng.standard_normal(len(t))
        y = system.time_response(t, u[None], inputs="F")
        y = y + 0.1 * y.std(axis=1, keepdims=True) * rng.standard_normal(y.shape)
        data = mv.Measurement.from_records(t, {"F": u}, dict(zip(["z0", "z1", "z2"], y, strict=True)), method=method,
                                           quantity="displacement", band=(2.0, 60.0), **options)  # fmt: skip
        ramps = np.sinc(data.frequencies * step) ** 2  # between samples the force is a ramp
        fit = away(model, names, 0.1, seed).fit(replace(data, responses=data.responses / ramps), names)
        held += sum(low <= value <= high for value, (low, high) in zip(right, fit.intervals.values(), strict=True))
        passed += fit.residual_test.passed
    assert held >= 80 * 0.95 - 3.0 * np.sqrt(80 * 0.95 * 0.05)
    assert passed >= 19
