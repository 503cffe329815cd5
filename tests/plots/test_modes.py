"""The overview of modes."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import plots
from mbsvib.plots import modes


def dots(axes):
    return [line for line in axes.lines if line.get_marker() == "o"]


def test_values_and_labels():
    system = mv.library.build("stewart").linearize()
    top, below = modes(system).axes
    assert (top.get_ylabel(), below.get_ylabel(), below.get_xlabel()) == (
        "natural frequency [Hz]", "damping ratio [%]", "mode")  # fmt: skip
    np.testing.assert_allclose(dots(top)[0].get_ydata(), system.modes().frequencies)
    np.testing.assert_allclose(dots(below)[0].get_ydata(), 100 * system.modes().damping_ratios)
    assert top.get_title(loc="right") == "stewart: 6 DOF"


def test_a_wide_range_is_logarithmic():
    top, _ = modes(mv.library.chain(50, line=(0, 1, 0)).linearize()).axes
    assert top.get_yscale() == "log"


@pytest.mark.slow
def test_rigid_body_modes_are_open_circles(slider, tmp_path):
    figure = modes(slider(stiffness=0.0))
    figure.savefig(tmp_path / "rigid.png")
    top, _ = figure.axes
    assert dots(top)[-1].get_markerfacecolor() == "white"
    assert dots(top)[-1].get_ydata() == pytest.approx([0.0])


@pytest.mark.slow
def test_a_braked_rigid_body_is_drawn(slider, tmp_path):
    modes(slider(stiffness=0.0, damping=3.0)).savefig(tmp_path / "braked.png")
    assert (tmp_path / "braked.png").stat().st_size > 1000


def test_a_locked_mechanism_has_nothing_to_draw():
    model = mv.Model("locked")
    model.add_body("b", 1.0, (1, 1, 1))
    model.add_joint("weld", "fixed", "ground", "b")
    with pytest.raises(mv.ResponseError, match="fully locked"):
        modes(model.linearize())


def rounded_plate():
    """A plate of 10 ug on springs in turned directions; its damper moves no mode but those along x and about z."""
    model = mv.Model("plate")
    model.add_body("plate", 1e-8, (1e-16, 1e-16, 2e-16))
    turned = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
    for name, position in {"a": (2e-4, 1e-4, 0), "b": (-2e-4, 3e-4, 0), "c": (1e-4, -3e-4, 0)}.items():
        model.add_bushing(name, "ground", "plate", position, (50, 4e3, 7e3, 0, 0, 0), orientation=turned)
    model.add_bushing("film", "ground", "plate", (0, 0, 0), damping=(1e-6, 0, 0, 0, 0, 0))
    return model


def test_damping_ratios_that_are_rounding_are_drawn_and_said_as_zero():
    system = rounded_plate().linearize()
    result = system.modes()
    ratios, below = 100 * result.damping_ratios, modes(system).axes[1]
    rounded = np.flatnonzero(np.abs(ratios) < 1e-13 * ratios.max())
    assert ratios[rounded].any()
    assert dots(below)[0].get_ydata().min() > 1e-6 * ratios.max()
    assert below.get_ylim()[0] > 1e-6 * ratios.max() or below.get_yscale() == "linear"
    strips = plots.mode_strips(system).axes
    assert all(strips[i].get_title(loc="left").endswith("damping ratio 0 %") for i in rounded)
    assert result.animate(int(rounded[0]) + 1, frames=2).title.endswith("damping 0 %")
