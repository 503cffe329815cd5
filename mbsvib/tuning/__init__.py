"""Controllers of a given structure, tuned together with the mechanism: structures, goals, the search."""

from __future__ import annotations

from mbsvib.tuning import goals, tunable
from mbsvib.tuning.tuning import Design, tune

__all__ = ["Design", "goals", "tunable", "tune"]
