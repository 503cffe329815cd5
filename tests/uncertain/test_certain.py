"""What is certain of uncertain plants: tables, and the steps of their searches."""

from dataclasses import replace

import numpy as np
import pytest

from mbsvib.uncertain.blocks import Block
from mbsvib.uncertain.certain import HALVINGS
from mbsvib.uncertain.results import RobustStability, WorstGain, WorstRms
from mbsvib.uncertain.search import halved


def test_tables_of_what_is_certain():
    """Three parameters at most stand in a row; bounds are rounded up; infinite gains are said."""
    blocks = (Block("k", "N/m", 1.5, 1.0, 2.0, 1, False), Block("c", "N s/m", 2.0, 1.0, 3.0, 1, False))
    gain = WorstGain("plant", 1.25, 1.5, {"k": 2.0, "c": 1e-12}, 14.0 * np.pi, blocks, ("x",), ("F",), "m/N")
    assert gain.table()["title"] == "Worst gain of plant, F → x"
    assert gain.table()["notes"] == ["Reached at the values of the table: 1.25 m/N at 7 Hz.",
                                     "Proven for all values within the limits: no more than 1.5 m/N."]  # fmt: skip
    assert gain.table()["rows"] == [("k", "1.5", "2", "N/m"), ("c", "2", "0", "N s/m")]
    assert gain.columns()["value"].tolist() == [2.0, 1e-12]
    several = WorstGain("plant", 1.25, 1.5, {}, 1.0, (), ("x", "y", "z"), ("F", "M"))
    assert several.table()["title"] == "Worst gain of plant, F, M → 3 outputs"
    unstable = WorstGain("plant", np.inf, np.inf, {"k": 2.0}, np.nan).table()
    assert unstable["notes"] == ["Infinite: the plant is not stable at these values."]
    places = {"k": 2.0, "c": 3.0, "m": 4.0}
    rms = WorstRms("plant", {"x": 1.23456, "y": 2.0}, {"x": places, "y": {"k": 1.5}}, {"x": 1.23451, "y": 3.0})
    (x, y) = rms.table()["rows"]
    assert x[:2] == ("x", "1.2346")
    assert float(x[2]) >= 1.23451
    assert (x[3], y[3]) == ("k = 2, c = 3, ...", "k = 1.5")
    assert not rms.table()["notes"]
    (note,) = replace(rms, upper={"x": np.inf, "y": 3.0}).table()["notes"]
    assert note.startswith("No bound is proven for x: ")
    stable = RobustStability("plant", 0.4, 0.9, {"k": 2.0}, 14.0 * np.pi).table()["notes"]
    assert stable == ["Not stable at all values within the limits.",
                      "Proven: stable with all limits 0.4 times as far from the nominal values.",
                      "At the values of the table, 0.9 times as far, a pole of 7 Hz does not decay."]  # fmt: skip


@pytest.mark.parametrize(("true", "near"), [(0.83, 0.001), (0.31, 0.001), (0.83, 0.4)])
def test_steps_towards_what_is_not_proven(true, near):
    """Halves of the way between what is proven and what is not, a few of them; the result is always proven."""
    asked = []

    def proves(t):
        asked.append(t)
        return t <= true

    found = halved(proves, 0.2, 1.0, HALVINGS, near)[0]
    assert found <= true
    assert len(asked) <= HALVINGS
    last = min([1.0, *[t for t in asked if t > true]])
    assert last - found == pytest.approx(0.8 * 0.5 ** len(asked))
    assert (len(asked) == HALVINGS) or last - found <= near
    downwards = halved(lambda t: t >= true, 1.0, 0.2, HALVINGS, near)[0]
    assert downwards >= true
