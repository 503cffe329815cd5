"""What goes into an FMU, whatever it came from: matrices, names, units, nominal values."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array


@dataclass(frozen=True, slots=True)
class Tunable:
    """A parameter on which the matrices depend affinely: derivatives ``slope`` of the entries at ``indices``, which
    counts from the start of A through B, C, D, E and F, row by row.
    """

    name: str
    unit: str
    value: float
    indices: NDArray[np.int64]
    slope: Array


@dataclass(frozen=True, slots=True)
class Plant:
    """E x' = A x + B u,  y = C x + F x' + D u; E and F are there only where parameters are ``tunable``.

    ``realization`` tells what the states are; names are those of mbsvib, a unit is empty where none is known.
    ``nominal`` are sizes of states, ``times`` stop time and step [s] of the default experiment.
    """

    name: str
    realization: str
    A: Array
    B: Array
    C: Array
    D: Array
    states: tuple[str, ...]
    state_units: tuple[str, ...]
    inputs: tuple[str, ...]
    input_units: tuple[str, ...]
    outputs: tuple[str, ...]
    output_units: tuple[str, ...]
    nominal: Array
    times: tuple[float, float]
    E: Array | None = None
    F: Array | None = None
    tunable: tuple[Tunable, ...] = ()

    @property
    def blocks(self) -> NDArray[np.int64]:
        """First rows of the diagonal blocks of A, and the number of states."""
        n = len(self.states)
        if n == 0 or self.tunable:
            return np.unique(np.array([0, n], dtype=np.int64))
        coupled = self.A != 0
        index = np.arange(n)
        last_index = np.maximum(index, np.where(coupled | coupled.T, index, -1).max(axis=1))
        ends = np.flatnonzero(np.maximum.accumulate(last_index) == index) + 1
        return np.concatenate(([0], ends)).astype(np.int64)
