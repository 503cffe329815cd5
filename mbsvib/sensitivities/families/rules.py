"""Rules of families: what a record says of a family, and the terms of derivatives that its rules share.

With T(s) = K + s C + s^2 M every derivative is symmetric and of low rank:
x^T dT y = sum_t P_t(x) Q_t(y) + Q_t(x) P_t(y).
Stiffness, damping and inertia see motions only. Where a part moves, the wrench in it works on what the change does to
the motion: a connection at p turned by rho and moved by dp sees (u + theta x dp, theta) turned back by rho, a joint of
the tree hands on the same with the other sign.

A rule lists the terms (P, Q), each (parts, ...), of every entry of a field. Slopes of the rows of an element without a
rule of its own are differences of its formulas, extrapolated to rounding; nothing of the mechanism is differenced.

Source: Jiang, Chen & Luo (2011), equations 78-87; here by the wrenches that connections transmit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from math import prod
from typing import Any, TypeVar

import numpy as np

from mbsvib.common.arrays import Array, Index
from mbsvib.elements.part import Part
from mbsvib.errors import ModelError
from mbsvib.linalg.differences import slope
from mbsvib.linalg.products import real_product
from mbsvib.linalg.rank import AGREEING_SLOPES, ZERO_SLOPE
from mbsvib.linalg.rotations import skew
from mbsvib.linalg.vectors import Field, any_nonzero, transformed
from mbsvib.sensitivities.adjoint_fields import Fields
from mbsvib.sensitivities.families.pose_changes import PoseRates, ReferenceTerms, RowTerms
from mbsvib.sensitivities.forces import Forces
from mbsvib.sensitivities.network import Network, Spin

P = TypeVar("P", bound=Part)
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


# A rule with what is constant of each part
RuleAndData = tuple["Rule", "tuple[Array, ...]"]


def joins_spinning_body(spin: Spin, part: Any, field: str) -> bool:
    """Return whether a field of a connection may take a spinning body off its axis, or change dampers that turn along.
    """
    if not spin.bodies.intersection((part.first, part.second)):
        return False
    return field not in ("stiffness", "damping") or (field == "damping" and spin.coupling is not None)


def any_field(*_: Any) -> bool:
    """Return that all fields of a part have rules."""
    return True


@dataclass(frozen=True, slots=True)
class InternalRule:
    """The rule of ``count`` numbers that are no parameters, of connections or bodies ``number`` (1,)."""

    rule: Rule
    count: int
    number: Index
    data: tuple[Any, ...] = ()


@dataclass(frozen=True, slots=True)
class LoadRules:
    """What a family of parts says of its parameters under loads.

    ``is_exception`` tells of which parts derivatives through the equilibrium are not known. ``add_force_terms`` says
    what parameters change of the forces, ``follow`` how they go with the bodies beside what roles say, and
    ``add_reference_terms`` what parameters as described do where the equilibrium was found in another pose.
    ``internal`` is the field of numbers that change with the pose and are no parameters, and their count;
    ``internal_rules`` are their rules, ``gravity_rule`` what gravity does beside forces. ``reactions`` names the
    elements whose forces statics gives, with the bodies of internal coordinates. ``twist_axis`` is the axis of a moment
    about which an angle is measured, ``bent_lines`` the names, frames and forms of elements whose bending tension
    changes.
    """

    is_exception: Callable[[Any, bool, frozenset[str]], bool] = lambda *_: False
    add_force_terms: Callable[[RowTerms, Network, Forces, Any, int], None] = lambda *_: None
    follow: Callable[[PoseRates, Any, int], None] = lambda *_: None
    add_reference_terms: Callable[[ReferenceTerms, Any, int], None] = lambda *_: None
    internal: tuple[str, int] = ("", 0)
    internal_rules: Callable[[Network, Any], Sequence[InternalRule]] = lambda *_: ()
    gravity_rule: Callable[[Network, Sequence[Any]], Rule] | None = None
    reactions: Callable[[Any], tuple[tuple[str, ...], tuple[str, ...], int] | None] = lambda *_: None
    twist_axis: Callable[[Any], Any] = lambda *_: None
    bent_lines: Callable[[Any], tuple[tuple[str, ...], Array, Array] | None] = lambda *_: None


NONE = LoadRules()
UNKNOWN = LoadRules(is_exception=lambda *_: True)


@dataclass(frozen=True, slots=True)
class PartRules:
    """What a family of parts says of its parameters; ``kind`` names the groups of these.

    ``rule`` gives the rule of a field of many parts at once, with ``constants`` of these, ``single`` that of one entry;
    those that float are parts of a kind of their own where it ``floats``. ``has_rule`` tells whether a field has one at
    all. Where bodies spin, parameters that may take one off its axis, or change how dampers turn along,
    ``alters_spin``, are differenced: variants say whether the spin is steady still. ``loaded`` are the rules under
    loads.
    """

    kind: str
    rule: Callable[[Network, Any, str], Rule] | None = None
    constants: Callable[[Network, Sequence[Any], str], tuple[Array, ...]] = lambda *_: ()
    floats: bool = False
    single: Callable[[Network, Any, str, tuple[int, ...]], RuleAndData] | None = None
    has_rule: Callable[[Any, str], bool] = any_field
    alters_spin: Callable[[Spin, Any, str], bool] = lambda *_: False
    loaded: LoadRules = NONE


def crossed(turn: Field, wrench: Array) -> Field:
    """Return how a force and moment (6,) change as they are turned (3, ...), (6, ...)."""
    return np.asarray((skew(wrench.reshape(2, 3)).swapaxes(1, 2) @ turn).reshape(6, -1))


# The first step of differences, against the scale of the number; the next one is smaller.
STEP, SMALLER = 2.0**-7, 0.125
# A size that stands for zero in a division.
TINY = 1e-300


def part_slopes(
    part: P, field: str, index: tuple[int, ...], numbers: Callable[[P], dict[str, Array]], scale: float | None = None
) -> dict[str, Array]:
    """Return the derivatives of what a part is made of to one of its parameters.

    ``numbers``: returns what a part is made of, by name; ``scale``: what is a large change of the parameter, None: its
    value. Raises an error if these do not change smoothly.
    """
    value = next(item.value for item in part.parameter_fields() if item.name == field)
    present = numbers(part)
    size = scale or abs(_entry_of(value, index)) or 1.0

    def at(change: float) -> Array:
        varied = part.with_values({field: _changed(value, index, change)})
        return np.concatenate([array.reshape(-1) for array in numbers(varied).values()])

    best, refusal = np.inf, None
    sizes = np.concatenate([np.full(array.size, np.abs(array).max(initial=0.0)) for array in present.values()])
    for step, sides in product((STEP, STEP * SMALLER), (0, 1, -1)):
        try:
            flat, error = slope(at, step * size, sides)
        except ModelError as problem:  # a value that such a part refuses, as a negative one may be
            refusal = problem
            continue
        worst = float((size * error / (sizes + size * np.abs(flat) + TINY)).max(initial=0.0))
        if worst <= AGREEING_SLOPES:
            ends = np.cumsum([array.size for array in present.values()])[:-1]
            return {key: change.reshape(array.shape)
                    for (key, array), change in zip(present.items(), np.split(flat, ends), strict=True)}  # fmt: skip
        best = min(best, worst)
    if refusal is not None and not np.isfinite(best):
        raise refusal
    raise ModelError(
        f"sensitivities: {part.family} '{part.name}' does not change smoothly with its '{field}' (differences agree to "
        f"{best:.1e} only). Compare variants by model.with_values.", element=part.name, field=field,
    )  # fmt: skip


def _entry_of(value: Any, index: tuple[int, ...]) -> float:
    for i in index:
        value = value[i]
    return float(value)


def _changed(value: Any, index: tuple[int, ...], change: float) -> Any:
    """A number, vector or symmetric matrix of which one entry has changed."""
    if not index:
        return value + change
    array = np.array(value, dtype=float)
    array[index] += change
    array[index[::-1]] = array[index]
    return array.tolist() if array.ndim > 1 else tuple(array.tolist())
