"""Derivatives of the equations as products of motions and wrenches.

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
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.elements import Body, Joint, Spring
from mbsvib.linalg.vectors import any_nonzero, cross, transformed, wide

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.elements import Bushing
    from mbsvib.linalg.vectors import Field
    from mbsvib.sensitivities.adjoint_fields import Fields

    Terms = list[tuple[Field, Field]]

# found, numbers of the bodies or connections, and what is constant of each
Rule = Callable[["Fields", Any, "tuple[Array, ...]"], "list[Terms]"]
_TENSOR = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
_WHOLE = tuple((i, j) for i in range(6) for j in range(i, 6))
_WORLD = np.eye(3)
# Fields of so many numbers are looked through for components that are zero, as planar mechanisms have many.
LARGE = 12_000
_DIAGONAL = tuple((i, i) for i in range(6))


def rule(part: Body | Joint | Bushing | Spring, field: str) -> Rule:
    """Return the rule by which a field of a part of this kind enters the equations.

    Parameters
    ----------
    part : Body, Joint, Bushing or Spring
        A part.
    field : str
        One of its fields.

    Returns
    -------
    callable
        Terms of each entry, from fields, numbers of parts, and their constants.
    """
    if isinstance(part, Body):
        return {"mass": _mass, "inertia": _inertia, "position": _moved_body, "orientation": _turned_body}[field]
    if isinstance(part, Joint):
        if part.end is not None:
            return {"position": _rod_start, "end": _rod_end}[field]
        return {"position": _moved_joint, "orientation": _turned_joint, "pitch": _pitch}[field]
    if isinstance(part, Spring):
        return {"stiffness": _line_stiffness, "damping": _line_damping, "start": _start, "end": _end}[field]
    if field in ("stiffness", "damping"):
        whole = isinstance(getattr(part, field)[0], tuple)
        return {
            ("stiffness", False): _stiffness, ("stiffness", True): _whole_stiffness,
            ("damping", False): _damping, ("damping", True): _whole_damping,
        }[field, whole]  # fmt: skip
    return {"position": _moved, "orientation": _turned}[field]


def constants(parts: Sequence[Any], field: str) -> tuple[Array, ...]:
    """Return what a rule has to know of parts of one kind, each (parts, ...).

    Parameters
    ----------
    parts : sequence of Body, Joint, Bushing or Spring
        The parts.
    field : str
        One of their fields.

    Returns
    -------
    tuple of array
        Axes of bodies and bushings; directions of line springs and screws; how rods turn.
    """
    first = parts[0]
    if isinstance(first, Body):
        return (np.array([part.orientation for part in parts]).transpose(0, 2, 1),) if field == "inertia" else ()
    if isinstance(first, Spring):
        span = np.array([np.subtract(part.end, part.start) for part in parts])
        return np.array([part.line for part in parts]), span
    if isinstance(first, Joint):
        if first.end is not None:
            return (turning(np.array([np.subtract(part.end, part.position) for part in parts])),)
        return (np.array([part.axes for part in parts])[:, :, 2],) if field == "pitch" else ()
    if field in ("stiffness", "damping"):
        return (np.array([part.orientation for part in parts]).transpose(0, 2, 1),)
    return ()


def turning(span: Array) -> Array:
    """Return how axes that a line gives (parts, 3) turn as its end moves, (parts, direction of the motion, 3).

    They are the least turn that takes the z axis of the world along the line, or against it where the line points down.
    """
    length = np.linalg.norm(span, axis=1, keepdims=True)
    u = span / length
    across = np.cross(u[:, None], np.eye(3) / length[:, None])
    pole = np.where(u[:, 2] < -0.5, -1.0, 1.0)[:, None]
    spin = across[:, :, 2] / (pole + u[:, 2, None])
    return np.asarray(across - spin[:, :, None] * u[:, None])


def _mass(found: Fields, k: Any, _: tuple[Array, ...]) -> list[Terms]:
    x = found.body[k]
    return [[((0.5 * found.square) * x[:, i], x[:, i]) for i in range(3)]]


def _inertia(found: Fields, k: Any, data: tuple[Array, ...]) -> list[Terms]:
    return _entries(_in_axes(data[0], found.body[k, 3:]), _TENSOR, found.square)


def _moved_body(found: Fields, k: Any, _: tuple[Array, ...]) -> list[Terms]:
    return _crossed(found.body_wrench[k, :3], found.body[k, 3:])


def moved_floating(found: Fields, k: Any, data: tuple[Array, ...]) -> list[Terms]:
    """A body that floats: its coordinates are those of its centre of mass, so that all that hangs on it follows."""
    carried = _crossed(found.support[data[0], :3], -found.body[k, 3:])
    return [a + b for a, b in zip(_moved_body(found, k, ()), carried, strict=True)]


def _turned_body(found: Fields, k: Any, _: tuple[Array, ...]) -> list[Terms]:
    return _crossed(found.body_wrench[k, 3:], found.body[k, 3:])


def _strain(found: Fields, k: Any, axes: Array) -> Field:
    d: Field = found.strain[_among_springs(found, k)]
    if bool((axes == _WORLD).all()):
        return d
    return np.concatenate((transformed(axes, d[:, :3]), transformed(axes, d[:, 3:])), axis=1)


def _in_axes(axes: Array, vectors: Field) -> Field:
    return vectors if bool((axes == _WORLD).all()) else transformed(axes, vectors)


def _among_springs(found: Fields, k: Any) -> Any:
    joints = len(found.relative) - len(found.strain)
    return slice(k.start - joints, k.stop - joints) if isinstance(k, slice) else k - joints


def _stiffness(found: Fields, k: Any, data: tuple[Array, ...]) -> list[Terms]:
    return _entries(_strain(found, k, data[0]), _DIAGONAL, found.stiff)


def _whole_stiffness(found: Fields, k: Any, data: tuple[Array, ...]) -> list[Terms]:
    return _entries(_strain(found, k, data[0]), _WHOLE, found.stiff)


def _damping(found: Fields, k: Any, data: tuple[Array, ...]) -> list[Terms]:
    return _entries(_strain(found, k, data[0]), _DIAGONAL, found.rate)


def _whole_damping(found: Fields, k: Any, data: tuple[Array, ...]) -> list[Terms]:
    return _entries(_strain(found, k, data[0]), _WHOLE, found.rate)


def _moved(found: Fields, k: Any, _: tuple[Array, ...]) -> list[Terms]:
    return _crossed(found.wrench[k, :3], found.relative[k, 3:])


def _turned(found: Fields, k: Any, _: tuple[Array, ...]) -> list[Terms]:
    d, w = found.relative[k], found.wrench[k]
    return [a + b for a, b in zip(_crossed(w[:, :3], d[:, :3]), _crossed(w[:, 3:], d[:, 3:]), strict=True)]


def _moved_joint(found: Fields, k: Any, _: tuple[Array, ...]) -> list[Terms]:
    return _crossed(found.wrench[k, :3], -found.relative[k, 3:])


def _turned_joint(found: Fields, k: Any, _: tuple[Array, ...]) -> list[Terms]:
    d, w = -found.relative[k], found.wrench[k]
    return [a + b for a, b in zip(_crossed(w[:, :3], d[:, :3]), _crossed(w[:, 3:], d[:, 3:]), strict=True)]


def _pitch(found: Fields, k: Any, data: tuple[Array, ...]) -> list[Terms]:
    return [[(along(data[0], found.wrench[k, :3]), along(data[0], found.relative[k, 3:]))]]


def _rod_start(found: Fields, k: Any, data: tuple[Array, ...]) -> list[Terms]:
    return [_turned_about(found, k, -data[0][:, i]) for i in range(3)]


def _rod_end(found: Fields, k: Any, data: tuple[Array, ...]) -> list[Terms]:
    moved = _moved_joint(found, k, ())
    return [moved[i] + _turned_about(found, k, data[0][:, i]) for i in range(3)]


def _turned_about(found: Fields, k: Any, rho: Array) -> Terms:
    """Rods turn with their ends, each by its rho (parts, 3)."""
    d, w = -found.relative[k], found.wrench[k]
    turn = wide(rho, d)
    force, moment = cross(turn, w[:, :3]), cross(turn, w[:, 3:])
    return [(force[:, i], d[:, i]) for i in range(3)] + [(moment[:, i], d[:, 3 + i]) for i in range(3)]


def _line_stiffness(found: Fields, k: Any, data: tuple[Array, ...]) -> list[Terms]:
    seen = along(data[0], found.strain[_among_springs(found, k), :3])
    return [[((0.5 * found.stiff) * seen, seen)]]


def _line_damping(found: Fields, k: Any, data: tuple[Array, ...]) -> list[Terms]:
    seen = along(data[0], found.strain[_among_springs(found, k), :3])
    return [[((0.5 * found.rate) * seen, seen)]]


def _start(found: Fields, k: Any, data: tuple[Array, ...]) -> list[Terms]:
    return _line_end(found, k, data, end=False)


def _end(found: Fields, k: Any, data: tuple[Array, ...]) -> list[Terms]:
    return _line_end(found, k, data, end=True)


def _line_end(found: Fields, k: Any, data: tuple[Array, ...], end: bool) -> list[Terms]:
    change = moved_end(data[0], data[1], found.relative[k], end)
    tension = along(data[0], found.wrench[k, :3])
    return [[(tension, change[:, i])] for i in range(3)]


def moved_end(line: Array, span: Array, relative: Field, end: bool) -> Field:
    """Return how elongations change as an end of lines moves, (parts, 3, ...).

    With e the line and L its length, moving an end by dp changes the elongation by
    dp . (+-(1 - e e^T) u / L + e x theta), u the relative motion there.

    Parameters
    ----------
    line, span : array, shape (parts, 3)
        Directions, and the ways from start to end [m].
    relative : array, shape (parts, 6, ...)
        Motions of second bodies against first ones at the starts.
    end : bool
        Whether the end moves, or the start.

    Returns
    -------
    array, shape (parts, 3, ...)
        Per unit motion of the end.
    """
    u, theta = relative[:, :3], relative[:, 3:]
    if end:
        u = u + cross(theta, wide(span, relative))
    e, sign = wide(line, u), 1.0 if end else -1.0
    across = u - e * along(line, u)[:, None]
    return np.asarray(across * wide(sign / np.linalg.norm(span, axis=1), u) + cross(e, theta))


def _entries(d: Field, pairs: tuple[tuple[int, int], ...], factor: Field) -> list[Terms]:
    """A symmetric matrix on d: d_i^2 for entries on the diagonal, 2 d_i d_j beside it; none of what does not move."""
    moves = [True] * d.shape[1]
    if d.size > LARGE:
        moves = [any_nonzero(d[:, i]) for i in range(d.shape[1])]
    half = [d[:, i] * (0.5 * factor) if moves[i] else None for i in range(d.shape[1])]
    return [[] if (p := half[i]) is None or not moves[j] else [(p if i == j else 2.0 * p, d[:, j])] for i, j in pairs]


def _crossed(force: Field, theta: Field) -> list[Terms]:
    """force . (theta x e) for the three unit vectors e."""
    return [[(force[:, j], theta[:, k]), (force[:, k], -theta[:, j])] for j, k in ((1, 2), (2, 0), (0, 1))]


def along(axis: Array, vectors: Field) -> Field:
    """Return components (k, ...) of vectors (k, 3, ...) along axes (k, 3)."""
    return transformed(axis[:, None], vectors)[:, 0]
