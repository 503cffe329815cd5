"""Errors of channels that come from the same sensors, through joined parts: sums over the slopes of all sensors."""

import numpy as np
import pytest

import mbsvib as mv
from tests.assembly.test_responses import around, rail

W = np.array([21.0, 48.0])


def with_noise(data, seed=5):
    """The data with noise of three sensors, to three inputs, of which one sensor has ten times more than others."""
    sd = np.zeros(data.responses.shape)
    some = np.s_[3:6, 2:5]
    sd[some] = 1e-3 * np.random.default_rng(seed).uniform(0.5, 2.0, sd[some].shape) * np.abs(data.responses[some])
    sd[4] *= 10.0
    return mv.Measurement(data.omega, data.responses, data.outputs, data.inputs, variance=sd**2,
                          output_units=data.output_units, input_units=data.input_units, nodes=data.nodes,
                          output_points=data.output_points, input_points=data.input_points)  # fmt: skip


def shifted(data, at, step):
    responses = data.responses.copy()
    responses[at] += step
    return mv.Measurement(data.omega, responses, data.outputs, data.inputs, variance=data.variance, nodes=data.nodes,
                          output_units=data.output_units, input_units=data.input_units,
                          output_points=data.output_points, input_points=data.input_points)  # fmt: skip


@pytest.mark.slow
def test_noise_of_sensors_around_a_point_goes_through_the_joint():
    data = with_noise(around().within(3.0, 20.0))
    payload = mv.Model("payload")
    payload.add_body("pay", 0.7, (0.02, 0.03, 0.01), position=(0.6, 0.02, 0.3))
    payload.add_port("root", "pay", (0.5, 0.0, 0.2))
    payload.add_output("z", "pay", "z")
    payload = payload.linearize()
    connect = [("base.tip", "payload.root", ([2e3, 4e3, 3e3, 50.0, 60.0, 40.0], [1.0, 2.0, 1.0, 0.1, 0.1, 0.1]))]

    def found(part):
        virtual = part.virtual_point("tip", (0.5, 0.0, 0.2), "s*", "h*")
        return mv.assemble({"base": virtual, "payload": payload}, connect)[["payload.z", "base.tip.rx"], "base.F"]

    stated = found(data)
    expected, start = np.zeros(stated.variance.shape), found(data).responses
    for at in map(tuple, np.argwhere(data.variance.any(axis=2))):
        step = 1e-4 * np.sqrt(data.variance[at])
        expected += np.abs((found(shifted(data, at, step)).responses - start) / step) ** 2 * data.variance[at]
    np.testing.assert_allclose(stated.variance, expected, rtol=1e-3)
    lone = found(data).within(3.0, 10.0)
    np.testing.assert_allclose(lone.common_errors.power(), lone.variance, rtol=1e-12)


def test_a_part_taken_away_and_then_another_joined_as_both_at_once():
    a, b, c = rail("a", 3.0, 5.0, 2e3), rail("b", 2.0, 3.0, 4e2), rail("c", 1.0, 1.0, 1e3)
    whole = mv.assemble({"a": a, "b": b}, [("a.p", "b.p", "rigid")])
    responses = whole.frequency_response(W)
    data = mv.Measurement(W, responses, whole.outputs, whole.inputs, quantity="displacement",
                          variance=1e-8 * np.abs(responses) ** 2 * np.arange(1, 17).reshape(4, 4, 1))  # fmt: skip
    without = mv.assemble({"w": data, "b": b}, [("w.a.p", "b.p", "rigid")], remove="b")
    after = mv.assemble({"d": without, "c": c}, [("d.w.a.p", "c.p", "rigid")])["d.w.a.x", ["d.w.a.F", "c.F"]]
    once = mv.assemble({"w": data, "b": b, "c": c}, [("w.a.p", "b.p", "rigid"), ("w.a.p", "c.p", "rigid")],
                       remove="b")["w.a.x", ["w.a.F", "c.F"]]  # fmt: skip
    exact = mv.assemble({"a": a, "c": c}, [("a.p", "c.p", "rigid")])["a.x", ["a.F", "c.F"]].frequency_response(W)
    np.testing.assert_allclose(after.responses, exact, rtol=1e-10)
    np.testing.assert_allclose(after.variance, once.variance, rtol=1e-9)
    alone = mv.Measurement(W, without.responses, without.outputs, without.inputs, variance=without.variance,
                           quantity="displacement")  # fmt: skip
    apart = mv.assemble({"d": alone, "c": c}, [("d.w.a.p", "c.p", "rigid")])["d.w.a.x", ["d.w.a.F", "c.F"]]
    assert (np.abs(apart.variance / once.variance - 1.0) > 0.1).any()  # without knowing what errors share


def test_fewest_averages_and_most_alike_lines_of_parts_count():
    """What a fit of the whole may know of its variances is not more than what one part tells."""
    shown = []
    for name, averages, correlation in (("a", 3, ()), ("b", 5, [0.6, 0.1]), ("c", None, [0.4, 0.1])):
        part = rail(name, 3.0, 5.0, 2e3)
        g = part.frequency_response(W)
        shown.append(mv.Measurement(W, g, part.outputs, part.inputs, variance=1e-8 * np.abs(g) ** 2, averages=averages,
                                    quantity="displacement", line_correlation=correlation))  # fmt: skip
    parts = dict(zip("abc", shown, strict=True))
    whole = mv.assemble(parts, [("a.p", "b.p", "rigid"), ("b.p", "c.p", "rigid")])
    assert whole.averages == 3
    assert whole.line_correlation.tolist() == [0.6, 0.1]
    two = mv.assemble({"c": parts["c"], "d": rail("d", 3.0, 5.0, 2e3)}, [("c.p", "d.p", "rigid")])
    assert (two.averages, two.line_correlation.tolist()) == (None, [0.4, 0.1])


def test_errors_that_outputs_share_by_their_covariance():
    """Both outputs have the same error: the variance of a joined one is that of the sum of both slopes."""
    a, b = rail("a", 3.0, 5.0, 2e3), rail("b", 2.0, 3.0, 4e2)
    responses, size = a.frequency_response(W), 1e-7

    def found(shift=0.0, **noise):
        data = mv.Measurement(W, responses + shift, a.outputs, a.inputs, quantity="displacement", **noise)
        return mv.assemble({"a": data, "b": b}, [("a.p", "b.p", "rigid")])["b.x", "a.F"]

    stated = found(covariance=np.full((2, 2, len(W)), size**2)).smoothed(1)
    expected = np.zeros(len(W))
    for column in range(2):
        step = np.zeros((2, 2, len(W)))
        step[:, column] = 1e-3 * size
        expected += np.abs((found(step).responses - found().responses)[0, 0]) ** 2 * 1e6
    np.testing.assert_allclose(stated.variance[0, 0], expected, rtol=1e-3)
    np.testing.assert_allclose(stated.common_errors.power(), stated.variance, rtol=1e-12)
