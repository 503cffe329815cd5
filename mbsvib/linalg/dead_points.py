"""Dead points of loops: where the derivative of closures to the coordinates that depend on others loses rank."""

from __future__ import annotations

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.linalg.rank import REDUNDANT_LOOPS

# A change of norm below 1 takes no eigenvalue of 1 to 0; the margin is for rounding.
NEARBY = 0.9
# Loops open by r leave a smallest singular value s off by about r / s: below this times sqrt(r) it is not known to a
# percent, rates and forces not to a few.
UNKNOWN = 10.0


def no_dead_point(before: Array, after: Array) -> bool:
    """Tell whether there is no dead point between two poses: both are on the same branch of the closed loops.

    Beyond a dead point A(before)^+ A(after) has a negative eigenvalue. Eigenvalues are used rather than the
    determinant, whose sign does not show two dead points at once.

    ``before``, ``after`` (rows, k): A, the derivative of closures to the coordinates that depend on others.
    """
    left, values, right = np.linalg.svd(before, full_matrices=False)
    rank = int(np.count_nonzero(values > REDUNDANT_LOOPS * max(1.0, float(values.max(initial=0.0)))))
    change = left[:, :rank].T @ (after - before) @ right[:rank].T / values[:rank, None]
    if np.abs(change).sum(axis=0).max(initial=0.0) < NEARBY:
        return True
    return bool((np.linalg.eigvals(np.eye(rank) + change).real > 0.0).all())


def is_unknown(smallest: float, opening: float) -> bool:
    """Tell whether loops that may be open by ``opening`` hide the smallest singular value of A: a singular pose."""
    return smallest < UNKNOWN * float(np.sqrt(opening))
