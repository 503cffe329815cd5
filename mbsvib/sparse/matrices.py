"""Sparse matrices of another program, with factors of their sums."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.errors import ResponseError
from mbsvib.linalg.multifrontal import LARGEST, factored, fronts

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Index
    from mbsvib.linalg.multifrontal import Fronts, SymmetricFactor


@dataclass(frozen=True)
class SparseMatrices:
    """Symmetric ``M``, ``C`` and ``K`` (n, n) of the system ``name``, sparse by columns."""

    name: str
    M: Any
    C: Any
    K: Any

    @cached_property
    def fronts(self) -> Fronts:
        """The fronts of factors of all sums of the matrices."""
        result = fronts((abs(self.M) + abs(self.C) + abs(self.K)).tocsr())
        size = 8 * result.entries
        if size > LARGEST:
            raise ResponseError(
                f"'{self.name}': the factor of its matrices, of {len(result.permutation)} coordinates, takes "
                f"{size / 1e9:.3g} GB; expected at most {LARGEST / 1e9:g} GB. Reduce the model in the program that "
                f"wrote the matrices, and give the reduced ones."
            )
        return result

    def factor(self, square: float = 0.0, s: complex = 0.0, pivot: float | None = None) -> SymmetricFactor:
        """Factor K + s C + (s^2 - square) M; a singular matrix is a LinAlgError. Pivots are chosen in their front."""
        del pivot
        matrix = self.K + s * self.C if s else self.K
        shift = s * s - square
        return factored((matrix + shift * self.M).tocsc() if shift else matrix, self.fronts)

    def motions(self) -> Array | None:
        """Return a basis (n, m) of all motions; None: all coordinates."""
        return None

    @cached_property
    def massless(self) -> Index:
        """The coordinates without mass, which follow from statics."""
        return np.flatnonzero(self.M.diagonal() == 0.0)
