"""Vectors of many parts at once, (parts, 3, ...): the axes behind the first two are those of motions."""

from __future__ import annotations

from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Field = NDArray[Any]  # real or complex


def cross(a: Field, b: Field) -> Field:
    """Vector products of (k, 3, ...)."""
    result: Field = np.empty(np.broadcast(a, b).shape, dtype=np.result_type(a, b))
    for axis, i, j in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        np.multiply(a[:, i], b[:, j], out=result[:, axis])
        result[:, axis] -= a[:, j] * b[:, i]
    return result


def dot(a: Field, b: Field) -> Field:
    """Scalar products (k, 1, ...) of (k, 3, ...)."""
    return np.asarray((a * b).sum(axis=1, keepdims=True))


def wide(vectors: Field, like: Field) -> Field:
    """Vectors (k, 3) or numbers (k,) that broadcast against (k, 3, ...)."""
    return vectors.reshape(*vectors.shape, *[1] * (like.ndim - vectors.ndim))


def moved(motion: Field, arm: NDArray[np.float64]) -> Field:
    """Motions (k, 6, ...) of points that are at ``arm`` (k, 3) from the present ones."""
    result = motion.copy()
    result[:, :3] += cross(motion[:, 3:], wide(arm, motion))
    return result


def product(matrix: NDArray[np.float64], values: Field) -> Field:
    """Products of a real matrix (v, k) and numbers (k, ...), complex ones by their two parts."""
    flat = np.ascontiguousarray(values).reshape(len(values), prod(values.shape[1:]))
    kind = flat.dtype
    result: Field = matrix @ (flat.view(float) if kind.kind == "c" else flat)
    return result.view(kind).reshape(len(matrix), *values.shape[1:])
