"""Checks of what files hold: shapes, finite numbers, names that differ, a unit for each."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.errors import ExportError

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array


def check_arrays(name: str, arrays: list[tuple[str, Array, tuple[int, ...]]]) -> None:
    """Refuse arrays (label, array, shape expected) of another shape or with numbers that are not finite."""
    for label, array, shape in arrays:
        if array.shape != shape:
            raise ExportError(f"{name}: {label} has shape {array.shape}; expected {shape}, one row and column "
                              f"for each name that goes with it.")  # fmt: skip
        if not np.isfinite(array).all():
            raise ExportError(f"{name}: {label} holds NaN or infinity; expected finite numbers.")
        array.setflags(write=False)


def check_names(name: str, groups: list[tuple[str, tuple[str, ...], tuple[str, ...]]]) -> None:
    """Refuse groups (label, names, units) in which names are empty or repeated, or units are missing."""
    for label, names, units in groups:
        if len(set(names)) < len(names) or "" in names:
            wrong = next(name for name in names if not name or names.count(name) > 1)
            raise ExportError(f"{name}: the name {wrong!r} among the {label} is empty or there more than "
                              f"once; expected names that differ.")  # fmt: skip
        if len(units) != len(names):
            raise ExportError(f"{name}: {len(units)} units for {len(names)} {label}; expected one for each.")
