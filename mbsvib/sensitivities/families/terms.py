"""Terms of the derivatives of the equations: products of motions and wrenches that the rules of families share.

With T(s) = K + s C + s^2 M every derivative is symmetric and of low rank:
x^T dT y = sum_t P_t(x) Q_t(y) + Q_t(x) P_t(y).
Stiffness, damping and inertia see motions only. Where a part moves, the wrench in it works on what the change does to
the motion: a connection at p turned by rho and moved by dp sees (u + theta x dp, theta) turned back by rho, a joint of
the tree hands on the same with the other sign.

A rule lists the terms (P, Q), each (parts, ...), of every entry of a field.

Source: Jiang, Chen & Luo (2011), equations 78-87; here by the wrenches that connections transmit.
"""

from __future__ import annotations

from collections.abc import Callable
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.linalg.products import real_product
from mbsvib.linalg.rank import ZERO_SLOPE
from mbsvib.linalg.rotations import skew
from mbsvib.linalg.vectors import any_nonzero, transformed

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.linalg.vectors import Field
    from mbsvib.sensitivities.adjoint_fields import Fields

    Terms = list[tuple[Field, Field]]


# fields, numbers of the bodies or connections, and what is constant of each
Rule = Callable[["Fields", Any, "tuple[Array, ...]"], "list[Terms]"]
# Fields of so many numbers are looked through for components that are zero, as planar mechanisms have many.
LARGE = 12_000
_WORLD = np.eye(3)


def square_terms(d: Field, pairs: tuple[tuple[int, int], ...], factor: Field) -> list[Terms]:
    """A symmetric matrix on d: d_i^2 for entries on the diagonal, 2 d_i d_j beside it; none of what does not move."""
    moves = [True] * d.shape[1]
    if d.size > LARGE:
        moves = [any_nonzero(d[:, i]) for i in range(d.shape[1])]
    half = [d[:, i] * (0.5 * factor) if moves[i] else None for i in range(d.shape[1])]
    return [[] if (p := half[i]) is None or not moves[j] else [(p if i == j else 2.0 * p, d[:, j])] for i, j in pairs]


def cross_terms(force: Field, theta: Field) -> list[Terms]:
    """Return the terms of force . (theta x e) for the three unit vectors e."""
    return [[(force[:, j], theta[:, k]), (force[:, k], -theta[:, j])] for j, k in ((1, 2), (2, 0), (0, 1))]


def along(axis: Array, vectors: Field) -> Field:
    """Return components (k, ...) of vectors (k, 3, ...) along axes (k, 3)."""
    return transformed(axis[:, None], vectors)[:, 0]


def line_end_rates(line: Array, span: Array, end: bool) -> Array:
    """Return how elongations change as an end of lines moves (parts, 3, 6), per unit motion of the end, on motions of
    second bodies against first ones at the starts.

    dp . (+-(1 - e e^T) u / L + e x theta) where the end of a line e of length L moves by dp, (u, theta) the relative
    motion there

    ``line``, ``span`` (parts, 3): directions, and the ways from start to end [m]; ``end``: whether the end moves, or
    the start.
    """
    per_length = (1.0 if end else -1.0) / np.linalg.norm(span, axis=1)[:, None, None]
    across = per_length * (np.eye(3) - line[:, :, None] * line[:, None])
    turned = skew(line) - across @ skew(span) if end else skew(line)
    return np.concatenate((across, turned), axis=2)


def line_turn_rates(span: Array) -> Array:
    """Return how axes that a line gives (parts, 3) turn as its end moves, (parts, direction of the motion, 3).

    They are the least turn that takes the z axis of the world along the line, or against it where the line points down.
    """
    length = np.linalg.norm(span, axis=1, keepdims=True)
    u = span / length
    across = skew(u).swapaxes(1, 2) / length[:, None]
    pole = np.where(u[:, 2] < -0.5, -1.0, 1.0)[:, None]
    spin = across[:, :, 2] / (pole + u[:, 2, None])
    return np.asarray(across - spin[:, :, None] * u[:, None])


def in_axes(axes: Array, vectors: Field) -> Field:
    """Return vectors (k, 3, ...) or six-vectors in axes (k, 3, 3)."""
    if bool((axes == _WORLD).all()):
        return vectors
    flat = vectors.reshape(len(vectors), vectors.shape[1] // 3, 3, prod(vectors.shape[2:]))
    return real_product(axes[:, None], flat).reshape(vectors.shape)


def among_springs(fields: Fields, k: Any) -> Any:
    """Return numbers of connections as numbers of springs."""
    joints = len(fields.relative) - len(fields.strain)
    return slice(k.start - joints, k.stop - joints) if isinstance(k, slice) else k - joints


def coefficient(direction: Array, row: int, power: str) -> Rule:
    """Return the rule of one coefficient of the spring ``row``, on its strain along a direction (6,).

    ``power``: "stiff", "rate" or "square", the matrix that it belongs to.
    """
    def rule(fields: Fields, _: Any, __: tuple[Array, ...]) -> list[Terms]:
        strain = np.tensordot(direction, fields.strain[row], axes=1)[None]
        return [[(0.5 * getattr(fields, power) * strain, strain)]]

    return rule


def moved_point(sign: int) -> Rule:
    """Return the rule of points of connections; joints, of ``sign`` -1, hand on what bushings take."""
    def rule(fields: Fields, k: Any, _: tuple[Array, ...]) -> list[Terms]:
        turn = fields.relative[k, 3:]
        return cross_terms(fields.wrench[k, :3], turn if sign > 0 else -turn)

    return rule


def turned_axes(sign: int) -> Rule:
    """Return the rule of axes of connections; joints, of ``sign`` -1, hand on what bushings take."""
    def rule(fields: Fields, k: Any, _: tuple[Array, ...]) -> list[Terms]:
        d, w = fields.relative[k] if sign > 0 else -fields.relative[k], fields.wrench[k]
        return [a + b for a, b in zip(cross_terms(w[:, :3], d[:, :3]), cross_terms(w[:, 3:], d[:, 3:]), strict=True)]

    return rule


def factors(matrices: Array) -> list[tuple[Array, Array]]:
    """Return symmetric matrices (k, n, n) as sizes (r,) and rows (r, n) each, without what is rounding in all."""
    result, largest = [], np.abs(matrices).max(initial=0.0)
    for matrix in matrices:
        sizes, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
        acts = np.abs(sizes) > ZERO_SLOPE * largest
        result.append((sizes[acts], np.ascontiguousarray(vectors.T[acts])))
    return result


def form_terms(form: tuple[Array, Array], motion: Field, weight: Field) -> Terms:
    """Return the terms of a symmetric matrix, given by ``factors``, on a motion (n, ...)."""
    sizes, rows = form
    of_rows = np.tensordot(rows, motion, axes=1)
    return [(size * weight * row[None], row[None]) for size, row in zip(sizes, of_rows, strict=True)]
