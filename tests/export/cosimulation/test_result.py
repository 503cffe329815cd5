"""Orders, what passes, and the figure of a check, of numbers that are given."""

import numpy as np
import pytest

from mbsvib_export.cosimulation import CosimulationCheck, MasterCheck

STEPS = (0.4, 0.2, 0.1)


def master(method="jacobi", errors=(0.9, 0.08, 0.02), *, difference=1e-12, stable=True, largest=0.5):
    return MasterCheck(method, STEPS, errors, "z", difference, 0.9, stable, largest)


def check(*masters):
    return CosimulationCheck("car", "law", STEPS[0], 4.0, ("F",), {"d": 1.0}, -1.0, masters)


@pytest.mark.parametrize(("errors", "order"), [
    ((0.9, 0.08, 0.02), 2.0), ((1.0, 0.2, 0.1), 1.0), ((np.inf, 0.4, 0.05), 3.0), ((1.0, np.inf, 0.1), np.nan),
    ((1e-9, 4e-12, 1e-12), np.nan), ((0.0, 0.0, 0.0), np.nan),
])  # fmt: skip
def test_the_order_is_that_of_the_two_smallest_steps(errors, order):
    assert master(errors=errors).order == pytest.approx(order, rel=1e-12, nan_ok=True)


def test_a_master_passes_where_it_is_stable_and_does_what_the_reference_does():
    good, off, growing = master(), master("slopes", difference=2e-9), master("iteration", stable=False)
    assert [item.passed for item in (good, off, growing)] == [True, False, False]
    assert check(good).passed
    assert not check(good, off).passed
    assert not check(growing, good).passed
    assert check(good, off)["slopes"] is off


def test_the_figure_has_a_line_for_each_master_and_its_largest_step():
    """No line at steps that were not found: 0, infinity."""
    masters = (master(), master("slopes", (0.3, 0.2, 1e-12), largest=0.7), master("iteration", largest=np.inf),
               master("gauss-seidel", largest=0.0))  # fmt: skip
    figure = check(*masters).plot()
    (axes,), (legend,) = figure.axes, figure.legends
    errors = [line for line in axes.lines if len(line.get_xdata()) == 3]
    limits = [line for line in axes.lines if len(line.get_xdata()) == 2]
    assert [line.get_xdata().tolist() for line in errors] == [list(STEPS)] * 4
    assert [tuple(line.get_ydata()) for line in errors] == [item.errors for item in masters]
    assert [line.get_label() for line in errors] == ["jacobi, order 2.00", "slopes", "iteration, order 2.00",
                                                     "gauss-seidel, order 2.00"]  # fmt: skip
    assert [line.get_xdata()[0] for line in limits] == [0.5, 0.7]
    assert [line.get_color() for line in limits] == [line.get_color() for line in errors[:2]]
    assert len({line.get_color() for line in errors}) == 4
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("step [s]", "relative error [1]")
    assert axes.get_title(loc="right") == "car, law"
    assert [text.get_text() for text in legend.get_texts()] == [line.get_label() for line in errors]
    assert legend.get_title().get_text() == "dotted: largest stable step"
    width, height = figure.get_size_inches()
    assert width > height
