"""The rules by which numbers of bodies, joints, bushings and line springs enter the equations."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.elements import Body, Joint, Spring
from mbsvib.elements.inerter import Inerter
from mbsvib.linalg.vectors import cross, transformed, wide
from mbsvib.sensitivities.rule_terms import along, cross_terms, line_turn_rates, moved_end, square_terms

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.elements import Bushing
    from mbsvib.linalg.vectors import Field
    from mbsvib.sensitivities.adjoint_fields import Fields
    from mbsvib.sensitivities.rule_terms import Rule, Terms

_TENSOR = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
_FULL = tuple((i, j) for i in range(6) for j in range(i, 6))
_WORLD = np.eye(3)
_DIAGONAL = tuple((i, i) for i in range(6))


def rule(part: Body | Joint | Bushing | Inerter | Spring, field: str) -> Rule:
    """Return the rule by which a field of a part of this kind enters the equations.

    ``field``: one of its fields. Returns terms of each entry, from fields, numbers of parts, and their constants.
    """
    if isinstance(part, Body):
        return {"mass": _mass, "inertia": _inertia, "position": _moved_body, "orientation": _turned_body}[field]
    if isinstance(part, Joint):
        if part.end is not None:
            return {"position": _rod_start, "end": _rod_end}[field]
        return {"position": _moved_joint, "orientation": _turned_joint, "pitch": _pitch}[field]
    if isinstance(part, (Inerter, Spring)):
        return {"stiffness": _line_stiffness, "damping": _line_damping, "inertance": _line_inertance,
                "start": _start, "end": _end}[field]  # fmt: skip
    if field in ("stiffness", "damping"):
        full = isinstance(getattr(part, field)[0], tuple)
        return {
            ("stiffness", False): _stiffness, ("stiffness", True): _full_stiffness,
            ("damping", False): _damping, ("damping", True): _full_damping,
        }[field, full]  # fmt: skip
    return {"position": _moved, "orientation": _turned}[field]


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
    carried = cross_terms(fields.support[data[0], :3], -fields.body[k, 3:])
    return [a + b for a, b in zip(_moved_body(fields, k, ()), carried, strict=True)]


def _turned_body(fields: Fields, k: Any, _: tuple[Array, ...]) -> list[Terms]:
    return cross_terms(fields.body_wrench[k, 3:], fields.body[k, 3:])


def _strain(fields: Fields, k: Any, axes: Array) -> Field:
    d: Field = fields.strain[_among_springs(fields, k)]
    if bool((axes == _WORLD).all()):
        return d
    return np.concatenate((transformed(axes, d[:, :3]), transformed(axes, d[:, 3:])), axis=1)


def _in_axes(axes: Array, vectors: Field) -> Field:
    return vectors if bool((axes == _WORLD).all()) else transformed(axes, vectors)


def _among_springs(fields: Fields, k: Any) -> Any:
    joints = len(fields.relative) - len(fields.strain)
    return slice(k.start - joints, k.stop - joints) if isinstance(k, slice) else k - joints


def _stiffness(fields: Fields, k: Any, data: tuple[Array, ...]) -> list[Terms]:
    return square_terms(_strain(fields, k, data[0]), _DIAGONAL, fields.stiff)


def _full_stiffness(fields: Fields, k: Any, data: tuple[Array, ...]) -> list[Terms]:
    return square_terms(_strain(fields, k, data[0]), _FULL, fields.stiff)


def _damping(fields: Fields, k: Any, data: tuple[Array, ...]) -> list[Terms]:
    return square_terms(_strain(fields, k, data[0]), _DIAGONAL, fields.rate)


def _full_damping(fields: Fields, k: Any, data: tuple[Array, ...]) -> list[Terms]:
    return square_terms(_strain(fields, k, data[0]), _FULL, fields.rate)


def _moved(fields: Fields, k: Any, _: tuple[Array, ...]) -> list[Terms]:
    return cross_terms(fields.wrench[k, :3], fields.relative[k, 3:])


def _turned(fields: Fields, k: Any, _: tuple[Array, ...]) -> list[Terms]:
    d, w = fields.relative[k], fields.wrench[k]
    return [a + b for a, b in zip(cross_terms(w[:, :3], d[:, :3]), cross_terms(w[:, 3:], d[:, 3:]), strict=True)]


def _moved_joint(fields: Fields, k: Any, _: tuple[Array, ...]) -> list[Terms]:
    return cross_terms(fields.wrench[k, :3], -fields.relative[k, 3:])


def _turned_joint(fields: Fields, k: Any, _: tuple[Array, ...]) -> list[Terms]:
    d, w = -fields.relative[k], fields.wrench[k]
    return [a + b for a, b in zip(cross_terms(w[:, :3], d[:, :3]), cross_terms(w[:, 3:], d[:, 3:]), strict=True)]


def _pitch(fields: Fields, k: Any, data: tuple[Array, ...]) -> list[Terms]:
    return [[(along(data[0], fields.wrench[k, :3]), along(data[0], fields.relative[k, 3:]))]]


def _rod_start(fields: Fields, k: Any, data: tuple[Array, ...]) -> list[Terms]:
    return [_turned_about(fields, k, -data[0][:, i]) for i in range(3)]


def _rod_end(fields: Fields, k: Any, data: tuple[Array, ...]) -> list[Terms]:
    moved = _moved_joint(fields, k, ())
    return [moved[i] + _turned_about(fields, k, data[0][:, i]) for i in range(3)]


def _turned_about(fields: Fields, k: Any, rho: Array) -> Terms:
    """Rods turn with their ends, each by its rho (parts, 3)."""
    d, w = -fields.relative[k], fields.wrench[k]
    turn = wide(rho, d)
    force, moment = cross(turn, w[:, :3]), cross(turn, w[:, 3:])
    return [(force[:, i], d[:, i]) for i in range(3)] + [(moment[:, i], d[:, 3 + i]) for i in range(3)]


def _line_stiffness(fields: Fields, k: Any, data: tuple[Array, ...]) -> list[Terms]:
    seen = along(data[0], fields.strain[_among_springs(fields, k), :3])
    return [[((0.5 * fields.stiff) * seen, seen)]]


def _line_damping(fields: Fields, k: Any, data: tuple[Array, ...]) -> list[Terms]:
    seen = along(data[0], fields.strain[_among_springs(fields, k), :3])
    return [[((0.5 * fields.rate) * seen, seen)]]


def _line_inertance(fields: Fields, k: Any, data: tuple[Array, ...]) -> list[Terms]:
    seen = along(data[0], fields.relative[k, :3])
    return [[((0.5 * fields.square) * seen, seen)]]


def _start(fields: Fields, k: Any, data: tuple[Array, ...]) -> list[Terms]:
    return _line_end(fields, k, data, end=False)


def _end(fields: Fields, k: Any, data: tuple[Array, ...]) -> list[Terms]:
    return _line_end(fields, k, data, end=True)


def _line_end(fields: Fields, k: Any, data: tuple[Array, ...], end: bool) -> list[Terms]:
    change = moved_end(data[0], data[1], fields.relative[k], end)
    tension = along(data[0], fields.wrench[k, :3])
    return [[(tension, change[:, i])] for i in range(3)]


