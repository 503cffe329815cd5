"""Bode plots: labels, units, and data against closed forms."""

import threading

import matplotlib as mpl
import numpy as np
import pytest

import mbsvib as mv
from mbsvib.plots import bode
from tests.plots.conftest import MASS, STIFFNESS


def panels(figure):
    """Return the (magnitude, phase) axes in the order in which they are read."""
    return list(zip(figure.axes[0::2], figure.axes[1::2], strict=True))


def curve(axes, number=0):
    lines = [line for line in axes.lines if len(line.get_xdata()) > 2]
    return np.asarray(lines[number].get_xdata()), np.asarray(lines[number].get_ydata(), dtype=float)


@pytest.mark.slow
def test_labels_and_units(slider):
    figure = bode(slider(damping=10.0))
    titles = [top.get_title(loc="left") for top, _ in panels(figure)]
    assert titles == ["F → x", "ax → x", "F → v", "ax → v", "F → a", "ax → a"]
    magnitudes = [top.get_ylabel() for top, _ in panels(figure)]
    assert magnitudes == ["|x / F| [m/N]", "|x / ax| [s²]", "|v / F| [(m/s)/N]", "|v / ax| [(m/s)/(m/s²)]",
                          "|a / F| [(m/s²)/N]", "|a / ax| [1]"]  # fmt: skip
    assert {below.get_ylabel() for _, below in panels(figure)} == {"phase [deg]"}
    assert [below.get_xlabel() for _, below in panels(figure)][-2:] == ["frequency [Hz]"] * 2
    top, below = panels(figure)[0]
    assert (top.get_xscale(), top.get_yscale(), below.get_xscale()) == ("log", "log", "log")


def test_decibels_and_radians_per_second(slider):
    system = slider(damping=10.0)
    f = np.geomspace(1.0, 100.0, 50)
    ((top, below),) = panels(bode(system, "x", "F", f, decibels=True, radians=True))
    omega, level = curve(top)
    assert np.allclose(omega, 2.0 * np.pi * f)
    assert np.allclose(level, 20.0 * np.log10(np.abs(system.frequency_response(omega)[0, 0])))
    assert top.get_yscale() == "linear"
    assert top.get_ylabel() == "magnitude [dB re 1 m/N]"
    assert below.get_xlabel() == "frequency [rad/s]"
    ratio = panels(bode(system, "a", "ax", f, decibels=True))[0][0]
    assert ratio.get_ylabel() == "magnitude [dB]"
    long = panels(bode(system, "a", "F", f, decibels=True))[0][0]
    assert long.get_ylabel() == "|G| [dB re 1 (m/s²)/N]"  # the word would reach into the panel of the phase


@pytest.mark.slow
def test_panels_of_one_unit_share_their_limits(slider):
    system = mv.library.quarter_car().linearize()
    ports = ["travel", "body.z"], ["actuator", "road"]
    shared = panels(bode(system, *ports))
    own = panels(bode(system, *ports, shared=False))
    for column in (0, 1):
        limits = [shared[k][0].get_ylim() for k in (column, column + 2)]
        single = [own[k][0].get_ylim() for k in (column, column + 2)]
        assert limits[0] == limits[1] == (min(low for low, _ in single), max(high for _, high in single))
    assert shared[0][0].get_ylim() != shared[1][0].get_ylim()
    assert own[0][0].get_ylim() != own[2][0].get_ylim()


def test_the_peak_is_that_of_the_closed_form(slider):
    ratio = 1e-4
    system = slider(damping=2 * ratio * np.sqrt(STIFFNESS * MASS))
    ((top, below),) = panels(bode(system, "x", "F"))
    f, magnitude = curve(top)
    assert magnitude.max() == pytest.approx(1 / (2 * ratio * STIFFNESS * np.sqrt(1 - ratio**2)), rel=1e-9)
    assert f[magnitude.argmax()] == pytest.approx(np.sqrt(STIFFNESS / MASS * (1 - 2 * ratio**2)) / (2 * np.pi))
    _, phase = curve(below)
    assert phase[0] == pytest.approx(0.0, abs=0.01)
    assert phase[-1] == pytest.approx(-180.0, abs=0.01)
    assert phase[magnitude.argmax()] == pytest.approx(-90.0, abs=0.1)


def test_stewart_peaks_equal_the_frequency_response():
    system = mv.library.build("stewart").linearize()
    ((top, _),) = panels(bode(system, "x", "Fx"))
    _, magnitude = curve(top)
    at = 2 * np.pi * system.modes().damped_frequencies[0]
    assert magnitude.max() == pytest.approx(abs(system.frequency_response([at])[0, 0, 0]), rel=1e-4)
    assert magnitude[0] == pytest.approx(2.8371955207e-8, rel=5e-3)


def test_an_antiresonance_is_resolved():
    system = mv.library.build("quarter_car").linearize()
    ((top, _),) = panels(bode(system, "wheel.z", "road"))
    _, magnitude = curve(top)
    # undamped, so that the zero is exact: a grid that is even falls short of it by orders of magnitude
    assert magnitude.min() < 1e-3 * magnitude[0]


def test_natural_frequencies_are_marked_once(slider):
    system = mv.library.build("stewart").linearize()
    ((top, _),) = panels(bode(system, "x", "Fx"))
    marks = [line.get_xdata()[0] for line in top.lines if len(line.get_xdata()) == 2]
    assert len(marks) == 4  # two pairs are equal
    assert marks == pytest.approx(sorted({round(f, 6) for f in system.modes().frequencies}), abs=1e-6)
    ((top, _),) = panels(bode(system, "x", "Fx", marks=False))
    assert len(top.lines) == 1


def test_many_natural_frequencies_are_not_marked():
    ((top, _),) = panels(bode(mv.library.chain(50, line=(0, 1, 0)).linearize(), "x", "Fx"))
    assert len(top.lines) == 1


def test_given_frequencies_are_used_as_they_are(slider):
    system = slider(damping=1.0)
    ((top, _),) = panels(bode(system, "x", "F", [4.0, 1.0, 2.0]))
    f, magnitude = curve(top)
    assert f.tolist() == [1.0, 2.0, 4.0]
    expected = 1 / np.abs(STIFFNESS - MASS * (2 * np.pi * f) ** 2 + 2j * np.pi * f)
    np.testing.assert_allclose(magnitude, expected, rtol=1e-12)
    for wrong in ([], [0.0, 1.0], [1.0, np.nan]):
        with pytest.raises(mv.ResponseError, match="above 0 Hz"):
            bode(system, "x", "F", wrong)


def test_continuous_and_wrapped_phase():
    system = mv.library.build("stewart").linearize()
    ((_, below),) = panels(bode(system, "x", "My"))
    _, phase = curve(below)
    assert phase.min() < -350
    assert np.abs(np.diff(phase)).max() < 90
    ((_, below),) = panels(bode(system, "x", "My", wrap=True))
    _, phase = curve(below)
    assert np.isnan(phase).any()
    assert np.nanmin(phase) >= -180
    assert np.nanmax(phase) <= 180


def test_an_undamped_system_has_phases_of_0_and_minus_180(slider):
    ((_, below),) = panels(bode(slider(), "x", "F"))
    _, phase = curve(below)
    assert set(np.unique(phase)) == {0.0, -180.0}


def test_phase_of_a_free_body_starts_behind(slider):
    ((_, below),) = panels(bode(slider(stiffness=0.0), "x", "F"))
    assert curve(below)[1] == pytest.approx(-180.0)


def test_what_is_zero_by_symmetry_is_named():
    system = mv.library.build("stewart").linearize()
    ((top, _),) = panels(bode(system, "y", "Fx"))
    assert [text.get_text() for text in top.texts] == ["zero"]
    assert np.isnan(curve(top)[1]).all()


@pytest.mark.slow
def test_a_response_that_is_exactly_zero_is_drawn(tmp_path):
    model = mv.Model("two")
    for name in ("one", "other"):
        model.add_body(name, 1.0, (1, 1, 1))
        model.add_joint(f"{name}.rail", "prismatic", "ground", name, axis=(1, 0, 0))
        model.add_spring(f"{name}.k", "ground", name, (-1, 0, 0), (0, 0, 0), 100.0, 1.0)
    model.add_input("F", "one", "x")
    model.add_output("x", "other", "x")
    figure = bode(model.linearize())
    figure.savefig(tmp_path / "zero.png")
    assert np.isnan(curve(figure.axes[0])[1]).all()
    assert [text.get_text() for text in figure.axes[0].texts] == ["zero"]


def test_a_mechanism_none_of_whose_outputs_moves_is_drawn():
    """No output row was left, and the figure ended in an IndexError."""
    model = mv.Model("rail")
    model.add_body("b", 1.0, (1, 1, 1))
    model.add_joint("rail", "prismatic", "ground", "b", position=(0, 0, 0), axis=(1, 0, 0))
    model.add_spring("k", "ground", "b", start=(-1, 0, 0), end=(0, 0, 0), stiffness=100.0)
    model.add_input("F", "b", "y")
    model.add_output("y", "b", "y")
    figure = bode(model.linearize(), "y", "F")
    assert [text.get_text() for text in figure.axes[0].texts] == ["zero"]


@pytest.mark.slow
def test_a_locked_mechanism_passes_base_motion_on(tmp_path):
    model = mv.Model("locked")
    model.add_body("b", 1.0, (1, 1, 1))
    model.add_joint("weld", "fixed", "ground", "b")
    model.add_base_motion("ax", "x")
    model.add_output("a", "b", "x", quantity="acceleration")
    figure = bode(model.linearize())
    figure.savefig(tmp_path / "locked.png")
    f, magnitude = curve(figure.axes[0])
    assert f[0] < 1 <= f[-1]
    np.testing.assert_allclose(magnitude, 1.0)


@pytest.mark.slow
def test_a_single_frequency_is_drawn(slider, tmp_path):
    figure = bode(slider(damping=1.0), "x", "F", [3.0])
    figure.savefig(tmp_path / "one.png")
    assert len(figure.axes[0].lines[0].get_xdata()) == 1


def test_several_systems_get_a_legend(slider):
    figure = bode([slider(damping=1.0), slider(damping=50.0)], "x", "F", labels=["1 N s/m", "50 N s/m"])
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["1 N s/m", "50 N s/m"]
    for i, damping in enumerate((1.0, 50.0)):
        ratio = damping / (2 * np.sqrt(STIFFNESS * MASS))
        assert curve(figure.axes[0], i)[1].max() == pytest.approx(1 / (2 * ratio * STIFFNESS * np.sqrt(1 - ratio**2)))
    assert figure.axes[0].lines[0].get_linestyle() != figure.axes[0].lines[1].get_linestyle()


@pytest.mark.slow
def test_flat_responses_keep_labels_on_their_axis(slider, tmp_path):
    figure = bode(slider(), "x", "F", span=(0.01, 0.1))
    figure.savefig(tmp_path / "flat.png")
    labels = [tick.label1.get_text() for tick in figure.axes[0].yaxis.get_major_ticks()]
    assert len([label for label in labels if label]) >= 2


def test_nothing_global_is_left_behind(slider):
    before = dict(mpl.rcParams)
    bode(slider(damping=1.0), "x", "F")
    assert dict(mpl.rcParams) == before


@pytest.mark.slow
def test_figures_can_be_built_in_threads(slider, tmp_path):
    system = slider(damping=1.0)
    before, sizes = dict(mpl.rcParams), []

    def draw(number):
        path = tmp_path / f"{number}.png"
        bode(system, "x", "F").savefig(path)
        sizes.append(path.stat().st_size)

    threads = [threading.Thread(target=draw, args=(i,)) for i in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(sizes) == 2
    assert dict(mpl.rcParams) == before
