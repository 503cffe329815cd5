"""Derivatives of the equations as products of motions and wrenches: how numbers of bodies, joints, bushings and line
springs enter.

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

from mbsvib.elements import Body, Joint, Spring
from mbsvib.elements.inerter import Inerter
from mbsvib.linalg.vectors import any_nonzero, cross, transformed, wide

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.elements import Bushing
    from mbsvib.linalg.vectors import Field
    from mbsvib.sensitivities.adjoint_fields import Fields

    Terms = list[tuple[Field, Field]]


# fields, numbers of the bodies or connections, and what is constant of each
Rule = Callable[["Fields", Any, "tuple[Array, ...]"], "list[Terms]"]
# Fields of so many numbers are looked through for components that are zero, as planar mechanisms have many.
LARGE = 12_000


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


def moved_end(line: Array, span: Array, relative: Field, end: bool) -> Field:
    """Return how elongations change as an end of lines moves, (parts, 3, ...).

    With e the line and L its length, moving an end by dp changes the elongation by
    dp . (+-(1 - e e^T) u / L + e x theta), u the relative motion there.

    ``line``, ``span`` (parts, 3): directions, and the ways from start to end [m]; ``relative`` (parts, 6, ...): motions
    of second bodies against first ones at the starts; ``end``: whether the end moves, or the start. Returns (parts, 3,
    ...): per unit motion of the end.
    """
    u, theta = relative[:, :3], relative[:, 3:]
    if end:
        u = u + cross(theta, wide(span, relative))
    e, sign = wide(line, u), 1.0 if end else -1.0
    across = u - e * along(line, u)[:, None]
    return np.asarray(across * wide(sign / np.linalg.norm(span, axis=1), u) + cross(e, theta))


def line_turn_rates(span: Array) -> Array:
    """Return how axes that a line gives (parts, 3) turn as its end moves, (parts, direction of the motion, 3).

    They are the least turn that takes the z axis of the world along the line, or against it where the line points down.
    """
    length = np.linalg.norm(span, axis=1, keepdims=True)
    u = span / length
    across = np.cross(u[:, None], np.eye(3) / length[:, None])
    pole = np.where(u[:, 2] < -0.5, -1.0, 1.0)[:, None]
    spin = across[:, :, 2] / (pole + u[:, 2, None])
    return np.asarray(across - spin[:, :, None] * u[:, None])


_TENSOR = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
_FULL = tuple((i, j) for i in range(6) for j in range(i, 6))
_WORLD = np.eye(3)
_DIAGONAL = tuple((i, i) for i in range(6))


def rule(part: Body | Joint | Bushing | Inerter | Spring, field: str) -> Rule:
    """Return the rule by which a field of a part of this kind enters the equations.

    ``field``: one of its fields. Returns terms of each entry, from fields, numbers of parts, and their constants.
    """
    if isinstance(part, Body):
        return _OF_BODIES[field]
    if isinstance(part, Joint):
        return (_OF_JOINTS if part.end is None else _OF_RODS)[field]
    if isinstance(part, (Inerter, Spring)):
        return _OF_LINES[field]
    full = field in ("stiffness", "damping") and isinstance(getattr(part, field)[0], tuple)
    return _OF_BUSHINGS[f"full {field}" if full else field]


def constants(parts: Sequence[Any], field: str) -> tuple[Array, ...]:
    """Return what a rule has to know of parts of one kind, each (parts, ...).

    ``field``: one of their fields. Returns axes of bodies and bushings; directions of line springs and screws; how rods
    turn.
    """
    first = parts[0]
    if isinstance(first, Body):
        return (np.array([part.orientation for part in parts]).transpose(0, 2, 1),) if field == "inertia" else ()
    if isinstance(first, (Inerter, Spring)):
        line = np.array([part.line for part in parts])
        if field not in ("start", "end"):
            return (line,)
        return line, np.array([part.end for part in parts]) - np.array([part.start for part in parts])
    if isinstance(first, Joint):
        if first.end is not None:
            return (line_turn_rates(np.array([np.subtract(part.end, part.position) for part in parts])),)
        return (np.array([part.axes for part in parts])[:, :, 2],) if field == "pitch" else ()
    if field in ("stiffness", "damping"):
        return (np.array([part.orientation for part in parts]).transpose(0, 2, 1),)
    return ()


def _mass(fields: Fields, k: Any, _: tuple[Array, ...]) -> list[Terms]:
    x = fields.body[k]
    return [[((0.5 * fields.square) * x[:, i], x[:, i]) for i in range(3)]]


def _inertia(fields: Fields, k: Any, data: tuple[Array, ...]) -> list[Terms]:
    return square_terms(_in_axes(data[0], fields.body[k, 3:]), _TENSOR, fields.square)


def _moved_body(fields: Fields, k: Any, _: tuple[Array, ...]) -> list[Terms]:
    return cross_terms(fields.body_wrench[k, :3], fields.body[k, 3:])


def moved_floating(fields: Fields, k: Any, data: tuple[Array, ...]) -> list[Terms]:
    """A body that floats: its coordinates are those of its centre of mass, so that all that hangs on it follows."""
    support = cross_terms(fields.support[data[0], :3], -fields.body[k, 3:])
    return [a + b for a, b in zip(_moved_body(fields, k, ()), support, strict=True)]


def _turned_body(fields: Fields, k: Any, _: tuple[Array, ...]) -> list[Terms]:
    return cross_terms(fields.body_wrench[k, 3:], fields.body[k, 3:])


def _in_axes(axes: Array, vectors: Field) -> Field:
    """Vectors (k, 3, ...) or six-vectors in axes (k, 3, 3)."""
    if bool((axes == _WORLD).all()):
        return vectors
    flat = vectors.reshape(len(vectors), vectors.shape[1] // 3, 3, prod(vectors.shape[2:]))
    return np.asarray((axes[:, None] @ flat).reshape(vectors.shape))


def _among_springs(fields: Fields, k: Any) -> Any:
    joints = len(fields.relative) - len(fields.strain)
    return slice(k.start - joints, k.stop - joints) if isinstance(k, slice) else k - joints


def _matrix(power: str, pairs: tuple[tuple[int, int], ...]) -> Rule:
    """Entries of the matrix of a bushing in its axes."""
    def rule(fields: Fields, k: Any, data: tuple[Array, ...]) -> list[Terms]:
        strain = fields.strain[_among_springs(fields, k)]
        return square_terms(_in_axes(data[0], strain), pairs, getattr(fields, power))

    return rule


def _moved(sign: int) -> Rule:
    """Points of connections; joints hand on what bushings take."""
    def rule(fields: Fields, k: Any, _: tuple[Array, ...]) -> list[Terms]:
        turn = fields.relative[k, 3:]
        return cross_terms(fields.wrench[k, :3], turn if sign > 0 else -turn)

    return rule


def _turned(sign: int) -> Rule:
    """Axes of connections; joints hand on what bushings take."""
    def rule(fields: Fields, k: Any, _: tuple[Array, ...]) -> list[Terms]:
        d, w = fields.relative[k] if sign > 0 else -fields.relative[k], fields.wrench[k]
        return [a + b for a, b in zip(cross_terms(w[:, :3], d[:, :3]), cross_terms(w[:, 3:], d[:, 3:]), strict=True)]

    return rule


def _pitch(fields: Fields, k: Any, data: tuple[Array, ...]) -> list[Terms]:
    return [[(along(data[0], fields.wrench[k, :3]), along(data[0], fields.relative[k, 3:]))]]


def _rod_start(fields: Fields, k: Any, data: tuple[Array, ...]) -> list[Terms]:
    return [_turned_about(fields, k, -data[0][:, i]) for i in range(3)]


def _rod_end(fields: Fields, k: Any, data: tuple[Array, ...]) -> list[Terms]:
    moved = _moved(-1)(fields, k, ())
    return [moved[i] + _turned_about(fields, k, data[0][:, i]) for i in range(3)]


def _turned_about(fields: Fields, k: Any, rho: Array) -> Terms:
    """Rods turn with their ends, each by its rho (parts, 3)."""
    d, w = -fields.relative[k], fields.wrench[k]
    turn = wide(rho, d)
    force, moment = cross(turn, w[:, :3]), cross(turn, w[:, 3:])
    return [(force[:, i], d[:, i]) for i in range(3)] + [(moment[:, i], d[:, 3 + i]) for i in range(3)]


def _line(power: str) -> Rule:
    """Coefficients of line springs and inerters."""
    def rule(fields: Fields, k: Any, data: tuple[Array, ...]) -> list[Terms]:
        motion = fields.relative[k, :3] if power == "square" else fields.strain[_among_springs(fields, k), :3]
        change = along(data[0], motion)
        return [[((0.5 * getattr(fields, power)) * change, change)]]

    return rule


def _line_end(end: bool) -> Rule:
    def rule(fields: Fields, k: Any, data: tuple[Array, ...]) -> list[Terms]:
        change = moved_end(data[0], data[1], fields.relative[k], end)
        tension = along(data[0], fields.wrench[k, :3])
        return [[(tension, change[:, i])] for i in range(3)]

    return rule


_OF_BODIES: dict[str, Rule] = {
    "mass": _mass, "inertia": _inertia, "position": _moved_body, "orientation": _turned_body}  # fmt: skip
_OF_RODS: dict[str, Rule] = {"position": _rod_start, "end": _rod_end}
_OF_JOINTS: dict[str, Rule] = {"position": _moved(-1), "orientation": _turned(-1), "pitch": _pitch}
_OF_LINES = {
    "stiffness": _line("stiff"), "damping": _line("rate"), "inertance": _line("square"),
    "start": _line_end(end=False), "end": _line_end(end=True),
}  # fmt: skip
_OF_BUSHINGS = {
    "stiffness": _matrix("stiff", _DIAGONAL), "full stiffness": _matrix("stiff", _FULL),
    "damping": _matrix("rate", _DIAGONAL), "full damping": _matrix("rate", _FULL),
    "position": _moved(1), "orientation": _turned(1),
}  # fmt: skip
