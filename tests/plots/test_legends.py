"""Legends outside of panels stay within their figures, however long their words are."""

import control
import numpy as np
import pytest

from mbsvib import library, plots


def loops():
    system = library.chain(3).linearize()
    names = [f"{system.name} with a notch, a lead and integral force feedback {i}" for i in range(4)]
    return [system.feedback([[-1.0]], system.outputs[0], system.inputs[0], name=name) for name in names]


@pytest.mark.slow
@pytest.mark.parametrize("draw", [
    lambda: plots.mechanism(library.stewart_isolator()),
    lambda: plots.bode(loops(), frequencies=np.array([1.0, 2.0])),
    lambda: plots.step(loops(), duration=0.1),
    lambda: plots.pole_zero_map([control.tf([1.0], [1.0, 1.0], name=f"a controller with a long name of its own {i}")
                                 for i in range(3)]),
])  # fmt: skip
def test_within_the_figure(draw):
    figure = draw()
    figure.draw_without_rendering()
    legend = figure.legends[0].get_window_extent()
    assert legend.x0 >= figure.bbox.x0
    assert legend.x1 <= figure.bbox.x1
