"""Noise of measured responses in fits: what channels share, and what residuals tell, in any unit."""

from dataclasses import replace

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.errors import ResponseError
from mbsvib.fitting import data as fitting_data
from mbsvib.measurement.common_errors import CommonErrors
from tests.fitting.scenes import chain

AT, POINT = [(0.05, 0, 0), (0, 0.05, 0), (0, 0, 0.05)], (0.4, 0.2, 0.3)
OMEGA = 2 * np.pi * np.linspace(5.0, 60.0, 25)


def sensed():
    """A body on a bushing with six sensors and six impacts that tell all of its motion, and a port far from these."""
    model = mv.Model("body")
    model.add_body("b", 5.0, (0.05, 0.06, 0.08))
    model.add_bushing("k", "ground", "b", (0, 0, 0), (1e5, 1.2e5, 2e5, 3e3, 4e3, 2e3), (20, 24, 40, 0.6, 0.8, 0.4))
    model.add_port("p", "b", POINT)
    for k, (at, axes) in enumerate(zip(AT, ("yz", "xz", "xy"), strict=True), start=1):
        for axis in axes:
            model.add_output(f"{k}{axis.upper()}+", "b", axis, position=at)
            model.add_input(f"{k}{axis.upper()}+", "b", axis, position=at)
    return model


def test_a_virtual_point_tells_as_much_as_its_sensors():
    """Six channels of a point hold all that six sensors and six impacts do: values and covariance are the same."""
    model, free = sensed(), ["k.stiffness.*", "b.mass"]
    system = model.linearize()
    names = [name for name in system.outputs if name[0] != "p"]
    exact = system.frequency_response(OMEGA, names, names)
    rng = np.random.default_rng(1)
    variance = (0.01 * np.abs(exact).mean() * rng.uniform(0.5, 2.0, exact.shape)) ** 2
    noise = np.sqrt(variance / 2.0) * (rng.standard_normal(exact.shape) + 1j * rng.standard_normal(exact.shape))
    noise[2, 3, 7] = np.nan
    data = mv.Measurement(OMEGA, exact + noise, names, names, variance=variance, nodes=dict(enumerate(AT, start=1)),
                          output_units=["m"] * 6, input_units=["N"] * 6)  # fmt: skip
    lines = data[:, :].within(*data.frequencies[[8, -1]])
    point = lines.virtual_point("p", POINT, names, names)
    by_sensors, by_point = model.fit(lines, free), model.fit(point, free)
    assert by_point.residual_test.passed
    assert by_point.residual_test.ratio == pytest.approx(by_sensors.residual_test.ratio, rel=1e-6)
    for name in by_sensors.values:
        np.testing.assert_allclose(by_point.intervals[name], by_sensors.intervals[name], rtol=1e-7)
    size = np.sqrt(by_sensors.covariance.diagonal())
    np.testing.assert_allclose(by_point.covariance / np.outer(size, size), by_sensors.covariance / np.outer(size, size),
                               atol=1e-5)  # fmt: skip
    with_hole = model.fit(data.virtual_point("p", POINT, names, names), free)  # a line without one sensor has no point
    assert np.isnan(with_hole.responses()[..., 7]).all()
    assert with_hole.residual_test.passed


def test_channels_that_repeat_others_tell_nothing_more(monkeypatch):
    """Two outputs with one and the same error count once; pairs without noise do not count."""
    model = chain()
    exact = model.linearize().frequency_response(OMEGA, ["z0", "z1"], ["F"])
    size = 0.02 * np.abs(exact).mean()
    rng = np.random.default_rng(2)
    noise = size * (rng.standard_normal(exact.shape) + 1j * rng.standard_normal(exact.shape)) / np.sqrt(2.0)
    one = mv.Measurement(OMEGA, exact + noise, ["z0", "z1"], ["F"], variance=np.full(exact.shape, size**2))
    twin = chain()
    twin.add_output("again", "b1", "z")
    rows = np.repeat(np.array([[1.0, 0], [0, 1], [0, 1]])[:, :, None], len(OMEGA), axis=2)
    errors = CommonErrors(rows, one.variance, np.ones((1, 1, len(OMEGA))))
    double = mv.Measurement(OMEGA, one.responses[[0, 1, 1]], ["z0", "z1", "again"], ["F"], variance=errors.power(),
                            common_errors=errors)  # fmt: skip
    once, twice = model.fit(one, "k*.stiffness"), twin.fit(double, "k*.stiffness")
    assert twice.residual_test.ratio == pytest.approx(once.residual_test.ratio, rel=1e-6)
    np.testing.assert_allclose(twice.covariance, once.covariance, rtol=1e-5)
    silent = replace(double, variance=None, common_errors=replace(errors, rows=0.0 * rows))
    with pytest.raises(ResponseError, match="no line that was measured with a known noise"):
        twin.fit(silent, "k*.stiffness")
    monkeypatch.setattr(fitting_data, "LARGEST", 100)
    with pytest.raises(ResponseError, match="common causes, and the correlation of its 3 pairs at 25 lines takes"):
        twin.fit(double, "k*.stiffness")


def test_noise_that_is_not_stated_does_not_depend_on_units():
    """Forces and moments in N and N m, and the same machine in mm: values and intervals are the same."""

    def in_units(unit, change=1.0):
        model = mv.Model("body")
        model.add_body("b", 5.0, (0.05 * unit**2, 0.06 * unit**2, 0.08 * unit**2))
        stiffness = np.array([1e5, 1.2e5, 2e5, 3e3 * unit**2, 4e3 * unit**2 * change, 2e3 * unit**2])
        model.add_bushing("k", "ground", "b", (0, 0, 0.1 * unit), stiffness, 2e-4 * stiffness)
        for axis in ("x", "ry"):
            model.add_input(axis, "b", axis)
            model.add_output(axis, "b", axis)
        return model

    def fit(unit):
        exact = in_units(1.0).linearize().frequency_response(OMEGA)
        rng = np.random.default_rng(4)
        size = np.median(np.abs(exact), axis=2, keepdims=True)
        noisy = exact + 0.03 * size * (rng.standard_normal(exact.shape) + 1j * rng.standard_normal(exact.shape))
        scale = np.multiply.outer([1.0, 1.0 / unit], [1.0, 1.0 / unit])[:, :, None]
        return in_units(unit, 1.1).fit(mv.Measurement(OMEGA, scale * noisy, ["x", "ry"], ["x", "ry"]),
                                       ["k.stiffness.x", "k.stiffness.ry"])  # fmt: skip

    metres, other = fit(1.0), fit(1e3)
    for name, scale in (("k.stiffness.x", 1.0), ("k.stiffness.ry", 1e6)):
        np.testing.assert_allclose(other.intervals[name], scale * np.array(metres.intervals[name]), rtol=1e-9)
