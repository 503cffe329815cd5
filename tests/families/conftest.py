"""The rows of the families that only these tests have."""

import pytest

import mbsvib as mv
import mbsvib_export
from mbsvib.api.model import ADDERS
from mbsvib.elements.families import EXPANSIONS
from mbsvib.elements.part import MAKERS
from mbsvib.files import words
from mbsvib_export.targets import BY_SUFFIX
from tests.families import distance, magnet, matrix_market, point_on_circle


@pytest.fixture(autouse=True)
def rows(monkeypatch):
    """What the tables derive from the rows of a family, a call of several parts and an export target."""
    for row, adder in ((magnet.ROW, magnet.add_magnet), (distance.ROW, distance.add_distance)):
        monkeypatch.setitem(EXPANSIONS, row.part, row.expansion)
        monkeypatch.setitem(MAKERS, row.part, row.make)
        monkeypatch.setitem(ADDERS, row.part, f"add_{row.word}")
        monkeypatch.setattr(mv.Model, f"add_{row.word}", adder, raising=False)
        for table in (words.SECTIONS, words.ALL_SECTIONS):
            monkeypatch.setitem(table, row.section, (*table[row.section], row.word))
    monkeypatch.setattr(mv.Model, f"add_{point_on_circle.WORD}", point_on_circle.add_point_on_circle, raising=False)
    calls = words.ALL_SECTIONS[point_on_circle.SECTION]
    monkeypatch.setitem(words.ALL_SECTIONS, point_on_circle.SECTION, (*calls, point_on_circle.WORD))
    target = matrix_market.ROW
    monkeypatch.setattr(mbsvib_export, target.writes, matrix_market.to_mtx, raising=False)
    monkeypatch.setitem(BY_SUFFIX, target.suffixes[0], target)
