"""Figures of isolation show what the results hold."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import isolation, plots
from tests.isolation.scenes import active_strut, one_axis


def test_transmissibility_and_compliance():
    first, second = (isolation.study(one_axis(ratio), "payload", directions="z") for ratio in (0.05, 0.5))
    figure = plots.isolation([first, second], ["light", "heavy"])
    top, below = figure.axes
    assert np.array_equal(top.lines[0].get_ydata(), first.index)
    assert np.array_equal(below.lines[1].get_ydata(), second.compliance_values[0])
    assert top.get_ylabel().endswith("[-]")
    assert len(plots.isolation(first).axes) == 2
    with pytest.raises(mv.ModelError, match="a label for each"):
        plots.isolation([first, second], ["light"])


def test_root_locus_and_front():
    plant = isolation.actuated(active_strut(), "payload", "leg", directions="z")
    locus = isolation.root_locus(plant, lambda g: isolation.force_feedback(plant, g), np.linspace(0.0, 300.0, 40))
    figure = plots.root_locus(locus)
    assert figure.get_suptitle() == "IFF: least damping 0 % → 50 %\nat gain 141.4"
    dots = [line.get_xydata()[0] for line in figure.axes[0].lines
            if line.get_marker() == "o" and line.get_mfc() != "none"]  # fmt: skip
    at_best = plant.with_gains(isolation.force_feedback(plant, 1e2 * np.sqrt(2))).vibrating[0] / (2 * np.pi)
    assert np.allclose(dots, [[at_best.real, at_best.imag]], rtol=1e-3)
    assert plots.root_locus(locus, scale=2.0).get_suptitle().endswith("at gain 282.8")
    goal = isolation.passive(one_axis(0.1), "payload", directions="z")
    front = goal.front({"mount.stiffness": (1e3, 1e5)}, goal.index([100.0]), goal.sag(load=1.0), [1e-4, 2e-4])
    figure = plots.front(front)
    assert np.array_equal(figure.axes[0].lines[0].get_xdata(), front.price)
