"""Figures of isolation show what the results hold."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import isolation, plots
from tests.isolation.scenes import active_strut, one_axis


def test_transmissibility_and_compliance():
    one, other = (isolation.study(one_axis(ratio), "payload", directions="z") for ratio in (0.05, 0.5))
    figure = plots.isolation([one, other], ["light", "heavy"])
    top, below = figure.axes
    assert np.array_equal(top.lines[0].get_ydata(), one.index)
    assert np.array_equal(below.lines[1].get_ydata(), other.compliance_values[0])
    assert top.get_ylabel().endswith("[-]")
    assert len(plots.isolation(one).axes) == 2
    with pytest.raises(mv.ModelError, match="a label for each"):
        plots.isolation([one, other], ["light"])


def test_root_locus_and_front():
    plant = isolation.actuated(active_strut(), "payload", "leg", directions="z")
    locus = isolation.root_locus(plant, lambda g: isolation.force_feedback(plant, g), np.linspace(0.0, 300.0, 40))
    figure = plots.root_locus(locus)
    assert figure.axes[0].get_title(loc="left") == "IFF: damping 49.9 % at gain 138.5"  # 50 % at 141.4
    goal = isolation.passive(one_axis(0.1), "payload", directions="z")
    front = goal.front({"mount.stiffness": (1e3, 1e5)}, goal.index([100.0]), goal.sag(load=1.0), [1e-4, 2e-4])
    figure = plots.front(front)
    assert np.array_equal(figure.axes[0].lines[0].get_xdata(), front.price)
