"""Scales in which entries of matrices can be compared whatever their units are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mbsvib.common.arrays import Array, Index
from mbsvib.equations.equations import Equations
from mbsvib.equations.matrices import MATRICES


@dataclass(frozen=True, slots=True)
class EntryScales:
    """Factors of the entries of matrices, and which rows of each are compared with each other.

    ``factors``: of each of M, C, K, B, Cq, Cv, Ca and D, (rows, columns): a coordinate is scaled by the ``root`` (m,)
    of its mass, an input by the largest force that it has along these. ``rows``: all rows of M, C, K and B; of the
    other matrices those of outputs with the same unit.
    """

    root: Array
    factors: Mapping[str, Array]
    rows: Mapping[str, tuple[Index, ...]]

    @staticmethod
    def of(nominal: Equations, inertia: Array, B: Array) -> EntryScales:
        """Return the scales of systems with the names of ``nominal``, (...,) of them.

        ``inertia`` (..., m): of the coordinates, the diagonals of M; ``B`` (..., m, inputs).
        """
        root = np.sqrt(inertia.max(axis=tuple(range(inertia.ndim - 1))))
        force = np.abs(B / root[:, None]).max(axis=tuple(range(B.ndim - 1)), initial=0.0)
        force = np.where(force > 0.0, force, 1.0)
        units = np.array(nominal.output_units)
        alike = tuple([np.flatnonzero(units == unit) for unit in dict.fromkeys(nominal.output_units)])
        factors, rows = {}, {}
        for key in MATRICES:
            of_motion = key in ("M", "C", "K", "B")
            of_rows = root if of_motion else np.ones(len(units))
            factors[key] = 1.0 / np.multiply.outer(of_rows, force if key in ("B", "D") else root)
            rows[key] = (np.arange(len(root)),) if of_motion else alike
        return EntryScales(root, factors, rows)
