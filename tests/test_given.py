"""A model where a system is asked for, or the other way round, is refused in words that say what to hand over."""

import pytest

import mbsvib as mv
from mbsvib import plots, report
from mbsvib.campbell import campbell

MODEL = mv.library.quarter_car()
SYSTEM = MODEL.linearize()
BATCH = MODEL.linearize(values={"suspension.stiffness": [1e4, 2e4]})
DRAWN = [plots.bode, plots.nyquist, plots.step, plots.singular_values, plots.topology, plots.energy, plots.modes]


@pytest.mark.parametrize("draw", DRAWN)
@pytest.mark.parametrize("given", [MODEL, "quarter_car", None, [MODEL]])
def test_figures_ask_for_systems(draw, given):
    with pytest.raises(mv.MbsvibError, match=r"expected a System\. .*model\.linearize\(\)"):
        draw(given)


@pytest.mark.parametrize("draw", [plots.topology, plots.energy, plots.modes, plots.mechanism])
def test_figures_of_one_system_take_no_batch(draw):
    with pytest.raises(mv.MbsvibError, match=r"Batch 'quarter_car'; expected a System\. Give one of the"):
        draw(BATCH)


@pytest.mark.parametrize("call", [lambda given: mv.save(given, "x.yaml"), lambda given: campbell(given, [0, 1]),
                                  mv.linearize])  # fmt: skip
def test_what_needs_a_model_says_so(call):
    with pytest.raises(mv.ModelError, match=r"System 'quarter_car'; expected a Model\. Give the model that"):
        call(SYSTEM)
    with pytest.raises(mv.ModelError, match=r"'car\.yaml'; expected a Model\. Read files by mv\.load"):
        call("car.yaml")
    with pytest.raises(mv.ModelError, match="expected a Model"):
        call(None)


def test_reports_take_either():
    pytest.importorskip("plotly")
    assert report.html(MODEL) == report.html(SYSTEM)
    with pytest.raises(mv.ModelError, match=r"report: source = 'car.yaml'; expected a Model\. Read files"):
        report.html("car.yaml")
