"""Units of time, length and force change nothing: norms, reduced models, zeros, steps, loops, margins, synthesis."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import isolation

# units of time [s], length [m] and force [N]
UNITS = {"ms": (1e-3, 1.0, 1.0), "mm": (1.0, 1e-3, 1.0), "kN": (1.0, 1.0, 1e3), "h and km": (3600.0, 1e3, 1.0),
         "um and 1/6000 s": (1 / 6000, 1e-6, 1.0)}  # fmt: skip
POWERS = {"x": 0, "v": 1, "a": 2}  # of 1/time in the outputs
W = np.geomspace(0.1, 300.0, 40)


def plant():
    """Three masses in a row with dampers that couple modes, a force on the first, a force between the others."""
    k = np.array([[700.0, -300.0, 0.0], [-300.0, 500.0, -200.0], [0.0, -200.0, 200.0]])
    c = np.array([[4.0, -1.0, 0.0], [-1.0, 1.5, -0.5], [0.0, -0.5, 2.5]])
    forces, seen = np.array([[1.0, 0.0], [0.0, -1.0], [0.0, 1.0]]), np.eye(3)[:1]
    none = 0.0 * seen
    system = mv.System.from_matrices(np.diag([1.0, 2.0, 0.5]), c, k, forces, np.concatenate((seen, none, none)),
                                     np.concatenate((none, seen, none)), np.concatenate((none, none, seen)),
                                     inputs=["F", "G"], outputs=["x", "v", "a"])  # fmt: skip
    return system.state_space("physical")


def restated(space, units):
    """The same equations in other units, and the units of the outputs and of the inputs."""
    time, length, force = units
    states = np.where(np.arange(len(space.A)) < len(space.A) // 2, length, length / time)
    shown = np.array([length / time ** POWERS[name] for name in space.outputs])[:, None]
    a, b = time * space.A * states / states[:, None], time * space.B * force / states[:, None]
    return mv.StateSpace.from_arrays(a, b, space.C * states / shown, space.D * force / shown, space.inputs,
                                     space.outputs), shown / force  # fmt: skip


def same(answer, other, tolerance=1e-9):
    np.testing.assert_allclose(other, answer, rtol=tolerance, atol=tolerance * np.abs(answer).max(initial=0.0))


@pytest.mark.slow
@pytest.mark.parametrize("units", UNITS.values(), ids=UNITS)
def test_norms_reduction_zeros_and_steps(units):
    one, time = plant(), units[0]
    two, scale = restated(one, units)
    same(np.abs(one.poles()), np.abs(two.poles()) / time)
    for output, source in (("x", "F"), ("v", "G"), ("a", "F")):
        first, second, factor = one[output, source], two[output, source], scale[one.outputs.index(output), 0]
        if output != "a":  # force acts directly on the acceleration
            same(first.h2_norm().value, second.h2_norm().value * factor / np.sqrt(time))
        peaks = first.hinf_norm(), second.hinf_norm()
        same(peaks[0].value, peaks[1].value * factor)
        same(peaks[0].omega, peaks[1].omega / time, 1e-7)  # a maximum is flat
        same(first.hankel_singular_values(), second.hankel_singular_values() * factor)
        zeros = first.transmission_zeros(), second.transmission_zeros() / time
        same(*zeros)
        assert all(np.count_nonzero(z == 0.0) == 2 * (output != "x") for z in zeros)
        small, other = first.reduced(4), second.reduced(4)
        same(small.frequency_response(W), other.frequency_response(W * time) * factor)
        same(small.error_bound, other.error_bound * factor)
        count = [len(space.reduced(error=0.5 * peak.value).A)
                 for space, peak in zip((first, second), peaks, strict=True)]  # fmt: skip
        assert count[0] == count[1] < 6
    first, second = one["x", "F"], two["x", "F"]
    steps = first.step_info(), second.step_info()
    same(steps[0].peak, steps[1].peak * scale[0, 0])
    for name in ("rise_time", "settling_time"):
        same(getattr(steps[0], name), getattr(steps[1], name) * time)
    same(steps[0].peak_time, steps[1].peak_time * time, 1e-7)
    for name in ("overshoot", "undershoot"):
        same(100.0 + getattr(steps[0], name), 100.0 + getattr(steps[1], name))


@pytest.mark.few(1)
@pytest.mark.parametrize("rate", [None, 400.0])
@pytest.mark.parametrize("units", UNITS.values(), ids=UNITS)
def test_loops_and_margins(units, rate):
    one, time = plant(), units[0]
    two, scale = restated(one, units)
    gain = np.array([[-900.0, -25.0]])
    loops = one.feedback(gain, ["x", "v"], "F"), two.feedback(gain * scale[:2, 0], ["x", "v"], "F")
    if rate is not None:
        loops = loops[0].sampled(rate, 1e-3), loops[1].sampled(rate * time, 1e-3 / time)
    first, second = loops
    same(first.response(W), second.response(W * time) * scale[:, :, None])
    for k, output in enumerate("xv"):
        same(first.h2_norm(output).value, second.h2_norm(output).value * scale[k, 0] / np.sqrt(time))
    same(first.sensitivity(W), second.sensitivity(W * time))
    margins = first.margins(), second.margins()
    for name, unit in (("modulus", 1.0), ("frequency", 1.0 / time), ("lower", 1.0), ("gain", 1.0), ("phase", 1.0),
                       ("delay", time), ("gain_at", 1.0 / time), ("phase_at", 1.0 / time)):  # fmt: skip
        same(getattr(margins[0], name), getattr(margins[1], name) * unit, 1e-7 if name == "frequency" else 1e-9)


@pytest.mark.parametrize("forces", [(1e3, 1.0), (1e-3, 1e6)])
@pytest.mark.parametrize("rate", [None, 400.0])
def test_disk_margins_with_a_unit_for_each_actuator(forces, rate):
    one, time = plant(), 1e-3
    two, scale = restated(one, (time, 1e-3, np.array(forces)))
    gain = np.array([[-900.0, -25.0], [400.0, -30.0]])
    loops = [one.feedback(gain, ["x", "v"], ["F", "G"]), two.feedback(gain * scale[:2].T, ["x", "v"], ["F", "G"])]
    if rate is not None:
        loops = [loops[0].sampled(rate, 1e-3), loops[1].sampled(rate * time, 1e-3 / time)]
    first, second = (loop.margins() for loop in loops)
    assert first.modulus < 0.9 * first.modulus_each.min()
    for name, unit in (("modulus", 1.0), ("frequency", 1.0 / time), ("all_gains", 1.0), ("all_phases", 1.0)):
        same(np.array(getattr(first, name)), np.array(getattr(second, name)) * unit,
             1e-7 if name == "frequency" else 1e-9)  # fmt: skip


def strut(units):
    """A payload on a leg with an actuator and a damper, with a soft spring beside it."""
    time, length, force = units
    mass, stiff = 40.0 * length / force / time**2, length / force
    model = mv.Model("strut")
    model.add_body("payload", mass, mass * np.full(3, 0.01 / length**2), (0, 0, 0.3 / length))
    model.add_joint("guide", "prismatic", "ground", "payload", axis=(0, 0, 1))
    model.add_spring("leg", "ground", "payload", (0, 0, 0), (0, 0, 0.2 / length), 9e4 * stiff, 60.0 * stiff / time)
    model.add_spring("beside", "ground", "payload", (0.1 / length, 0, 0), (0.1 / length, 0, 0.2 / length), 3e4 * stiff)
    return isolation.actuated(model, "payload", "leg", directions="z")


@pytest.mark.parametrize("units", UNITS.values(), ids=UNITS)
def test_lqg(units):
    time, length, force = units
    acceleration, sensors = length / time**2, ["leg.acceleration"]
    one, two = strut((1.0, 1.0, 1.0)), strut(units)
    first = isolation.lqg(one, sensors, 1e-3, 0.7, 1e-5)
    second = isolation.lqg(two, sensors, 1e-3 * (force / acceleration) ** 2, 0.7 / acceleration**2 / time,
                           1e-5 / acceleration**2 / time)  # fmt: skip
    s = 1j * np.geomspace(1.0, 1e4, 20)
    same(first.at(s), second.at(s * time) * force / acceleration)
