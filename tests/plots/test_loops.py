"""Figures of closed loops: loop gains with margins, sensitivities, maps of poles and zeros."""

import control
import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
from mbsvib import library, plots


def slider():
    model = mv.Model("slider")
    model.add_body("mass", 1.0, (1, 1, 1))
    model.add_joint("rail", "prismatic", "ground", "mass", axis=(1, 0, 0))
    model.add_spring("spring", "ground", "mass", (-1, 0, 0), (0, 0, 0), 100.0, 2.0)
    model.add_input("F", "mass", "x")
    model.add_output("x", "mass", "x")
    return model.linearize()


def single():
    return slider().feedback(control.ss([[-50.0]], [[1.0]], [[-3000.0]], [[-20.0]]), "x", "F", name="lag")


def several():
    plant = library.stewart(ports="legs").linearize()
    law = control.ss(-300.0 * np.eye(6), np.eye(6), 2e8 * np.eye(6), -1e7 * np.eye(6))
    return plant.feedback(law, "*.elongation", "*.f", name="lead")


def line_of(s):
    """L with the other loops closed."""
    return 1.0 / s - 1.0


@pytest.mark.few(1)
@pytest.mark.parametrize("make", [single, several])
def test_margins_are_where_they_are_said_to_be(make):
    loop = make()
    margins = loop.margins()
    for i in range(len(loop.actuators)):
        def gain(hertz, i=i):
            return line_of(loop.sensitivity([2 * np.pi * hertz])[i, i, 0])

        for factor, at in ((margins.gain[i], margins.gain_at[i]), (margins.lower[i], margins.lower_at[i])):
            if np.isfinite(at):
                assert_allclose(factor * gain(at), -1.0, atol=1e-6)
        if np.isfinite(margins.phase[i]):
            assert_allclose(abs(gain(margins.phase_at[i])), 1.0, rtol=1e-8)
            assert_allclose(180.0 - abs(np.degrees(np.angle(gain(margins.phase_at[i])))), margins.phase[i], rtol=1e-6)
            angle = 2 * np.pi * margins.delay_at[i] * margins.delay[i]
            assert_allclose(gain(margins.delay_at[i]) * np.exp(-1j * angle), -1.0, atol=1e-8)
        assert_allclose(abs(1.0 + gain(margins.modulus_at[i])), margins.modulus_each[i], rtol=1e-8)


def test_margins_of_python_control():
    loop = single()
    margins = loop.margins()
    plant = control.tf([1.0], [1.0, 2.0, 100.0])
    law = control.tf([20.0, 20.0 * 50.0 + 3000.0], [1.0, 50.0])
    gain, phase, _, at_gain, at_phase, _ = control.stability_margins(plant * law)
    assert_allclose([margins.gain[0], margins.phase[0]], [gain, phase], rtol=1e-6)
    assert_allclose(2 * np.pi * np.array([margins.gain_at[0], margins.phase_at[0]]), [at_gain, at_phase], rtol=1e-6)


def test_loop_gain_and_its_margins_are_drawn():
    loop = single()
    margins = loop.margins()
    figure = plots.loop_gain(loop, decibels=True)
    top, below = figure.axes
    f, size = top.lines[0].get_data()
    s = loop.sensitivity(2 * np.pi * f)[0, 0]
    assert_allclose(size, 20 * np.log10(np.abs(line_of(s))), atol=1e-9)
    mark = top.lines[-1]
    assert_allclose(mark.get_xdata(), margins.gain_at[0])
    assert_allclose(mark.get_ydata(), [-20 * np.log10(margins.gain[0]), 0.0], atol=1e-12)
    at, ends = below.lines[-1].get_data()
    assert_allclose(at, margins.phase_at[0])
    assert abs(abs(ends[1] - ends[0]) - margins.phase[0]) < 0.5
    words = f"gain margin {margins.lower[0]:.3g} … {margins.gain[0]:.3g},\nphase margin {margins.phase[0]:.3g} deg"
    assert top.get_legend().get_texts()[0].get_text() == words


@pytest.mark.slow
def test_each_actuator_has_a_panel():
    loop = several()
    assert len(plots.loop_gain(loop).axes) == 12
    figure = plots.loop_nyquist(loop, ["leg1.f", "leg2.f"])
    assert len(figure.axes) == 2
    circle = figure.axes[0].lines[-1]
    assert_allclose(np.abs(circle.get_xdata() + 1j * circle.get_ydata() + 1.0), loop.margins().modulus_each[0])
    f = np.geomspace(1.0, 3e3, 50)
    curve = plots.loop_nyquist(loop, "leg3.f", f).axes[0].lines[0]
    assert_allclose(curve.get_xdata() + 1j * curve.get_ydata(), line_of(loop.sensitivity(2 * np.pi * f)[2, 2]))


@pytest.mark.slow
def test_peaks_of_sensitivities():
    loop = several()
    figure = plots.sensitivity([loop, loop.sampled(5e4)], labels=["continuous", "sampled"])
    left, right = figure.axes
    f, largest = left.lines[0].get_data()
    assert_allclose(largest.max(), 1.0 / loop.margins().modulus, rtol=1e-3)
    s = loop.sensitivity(2 * np.pi * f).transpose(2, 0, 1)
    assert_allclose(right.lines[0].get_ydata(), np.linalg.norm(np.eye(6) - s, 2, axis=(1, 2)), rtol=1e-10)
    assert not loop.sampled(5e4).stable
    assert left.lines[1].get_label().startswith("sampled (unstable): ")
    assert left.lines[1].get_xdata()[-1] < 2.5e4


def test_poles_and_zeros():
    system, loop = slider(), single()
    axes = plots.pole_zero_map([system, loop], "x", "F").axes[0]
    for i, each in enumerate((system, loop)):
        poles, zeros = axes.lines[2 * i], axes.lines[2 * i + 1]
        upper = each.poles()[each.poles().imag >= 0] / (2 * np.pi)
        assert_allclose(np.sort_complex(poles.get_xdata() + 1j * poles.get_ydata()), np.sort_complex(upper))
        assert len(zeros.get_xdata()) == len(each.transmission_zeros("x", "F"))
    near = plots.pole_zero_map(system, imaginary=(0.0, 3.0)).axes[0]
    assert near.get_ylim() == (0.0, 3.0)


def legends(figure):
    name, _, peaks = figure.legends[0].get_texts()[0].get_text().partition(": ")
    return [f"{name}: {words[3:]}" for words in peaks.split("\n")]


@pytest.mark.slow
def test_an_end_of_the_range_is_no_peak():
    """S = (s + 1) / (s + 11) rises to 1, and T = 10 / (s + 11) falls from 10 / 11."""
    plant = mv.StateSpace.from_arrays([[-1.0]], [[1.0]], [[1.0]], [[0.0]], inputs=["u"], outputs=["y"])
    loop = plant.feedback([[-10.0]], "y", "u", name="gain")
    s, t = legends(plots.sensitivity(loop, np.geomspace(1e-3, 1e3, 300)))
    assert s == "gain: no peak, 1 towards high frequencies"
    assert t == "gain: no peak, 0.909 towards low frequencies"
    (s, t) = legends(plots.sensitivity(single()))
    f, largest = plots.sensitivity(single()).axes[0].lines[0].get_data()
    assert s == f"lag: peak {largest.max():.3g} at {f[largest.argmax()]:.4g} Hz"
    assert legends(plots.sensitivity(loop, [1e5, 2e5]))[0] == "gain: no peak, 1 at both ends"


@pytest.mark.slow
def test_transfer_functions_of_python_control_are_drawn():
    transfer = control.tf([1.0, 2.0], [1.0, 2.0, 100.0], name="resonance")
    axes = plots.pole_zero_map(transfer).axes[0]
    poles, zeros = (line.get_xydata() @ [1.0, 1.0j] for line in axes.lines[:2])
    assert_allclose(2 * np.pi * poles, [-1.0 + 1j * np.sqrt(99.0)])
    assert_allclose(2 * np.pi * zeros, [-2.0])
    f, size = plots.bode(transfer, decibels=False).axes[0].lines[0].get_data()
    assert_allclose(size, np.abs(transfer(2j * np.pi * f)), rtol=1e-9)
    integrator = mv.StateSpace.from_control(control.tf([3.0], [1.0, 0.0]))
    assert_allclose(integrator.frequency_response([2.0])[0, 0], 3.0 / 2j)
    static = mv.StateSpace.from_control(control.tf([3.0], [2.0]))
    assert static.A.shape == (0, 0)
    assert_allclose(static.D, 1.5)


@pytest.mark.parametrize(("source", "words"), [
    (control.tf([[[1], [1, 0, 0]]], [[[1, 2], [1, 3]]]), "numerator has degree 2"),
    (control.tf([1, 0, 0], [1, 1]), "numerator has degree 2"),
    (control.tf([1], [1, 1], 0.1), "dt = 0.1"),
    (control.frd([1.0, 2.0], [1.0, 2.0]), "FrequencyResponseData"),
])  # fmt: skip
def test_other_systems_of_python_control_are_refused(source, words):
    with pytest.raises(mv.ResponseError, match=words):
        plots.pole_zero_map(source)


def test_poles_far_apart_are_told_apart():
    """Poles from 10 to 300 Hz take half of each axis; given limits are linear."""
    system = library.stewart_isolator().linearize()
    axes = plots.pole_zero_map(system, "z", "Fz").axes[0]
    assert (axes.get_aspect(), axes.get_xscale()) == ("auto", "asinh")
    ends = np.array([[0.0, 9.5], [0.0, 17.0]])
    low, high = (axes.transData - axes.transAxes).transform(ends)[:, 1]
    assert high - low > 0.1
    shares = (axes.transData - axes.transAxes).transform(axes.lines[0].get_xydata())
    assert shares.min() > 0.0
    assert shares.max() < 1.0
    near = plots.pole_zero_map(system, "z", "Fz", imaginary=(0.0, 20.0)).axes[0]
    assert near.get_xscale() == "linear"
    assert plots.pole_zero_map(system, "z", "Fz", equal=True).axes[0].get_aspect() == 1.0
    assert plots.pole_zero_map(slider()).axes[0].get_aspect() == 1.0


@pytest.mark.parametrize("draw", [plots.loop_gain, plots.loop_nyquist, plots.sensitivity])
def test_open_loops_are_refused(draw):
    with pytest.raises(mv.ResponseError, match="expected a closed loop, as system"):
        draw(slider())


def test_bad_arguments_are_refused():
    with pytest.raises(mv.ResponseError, match="actuator 'G'"):
        plots.loop_gain(single(), "G")
    with pytest.raises(mv.ResponseError, match="2 labels for 1 loops"):
        plots.sensitivity(single(), labels=["a", "b"])
    with pytest.raises(mv.ResponseError, match=r"plots\.pole_zero_map: real is \(1, 0\)"):
        plots.pole_zero_map(slider(), real=(1, 0))
    with pytest.raises(mv.ResponseError, match="above 0"):
        plots.loop_nyquist(single(), frequencies=[0.0])


@pytest.mark.slow
def test_an_unstable_loop_has_no_marks():
    loop = slider().feedback([[1e3]], "x", "F")
    assert not loop.stable
    assert plots.loop_gain(loop).axes[0].get_legend().get_texts()[0].get_text() == "unstable"
    assert [text.get_text() for text in plots.loop_nyquist(loop).axes[0].texts] == ["unstable"]
    assert all(words.startswith("controller (unstable):") for words in legends(plots.sensitivity(loop)))


def test_a_loop_without_a_critical_frequency_says_so():
    assert "Critical frequency, where the sensitivity of all loops together is largest: " in str(single().margins())
    model = library.chain(1)
    model.add_output("rate", "body1", "rz", quantity="velocity")
    damped = model.linearize().feedback([[-1e-3]], "rate", "Mz")
    assert_allclose(damped.margins().modulus, 1.0, rtol=1e-6)
    assert "No critical frequency" in str(damped.margins())
