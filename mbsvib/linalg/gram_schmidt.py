"""Orthonormal columns, one after the other."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


def extended(
    basis: NDArray[Any], block: NDArray[Any], least: float, most: int | None = None, metric: Any = None
) -> NDArray[Any]:
    """Return orthonormal columns (n, k), and behind them what is new in a block (n, b), up to ``most`` in all.

    A column of which no more than the share ``least`` is left depends on those before it. ``metric`` (n, n): symmetric,
    positive semidefinite, may be sparse; default: the identity.
    """
    def of(column: NDArray[Any]) -> NDArray[Any]:
        return column if metric is None else np.asarray(metric @ column)

    def size_of(column: NDArray[Any]) -> float:
        return float(np.linalg.norm(column) if metric is None else np.sqrt(max(0.0, column @ of(column))))

    for column in block.T:
        if basis.shape[1] == most or not (size := size_of(column)):
            continue
        rest = column / size
        for _ in range(2):
            rest = rest - basis @ (basis.conj().T @ of(rest))
        if (left := size_of(rest)) > least:
            basis = np.column_stack((basis, rest / left))
    return basis
