"""Records of families, and how parts change that have no formulas of their own.

Slopes of the rows of such an element are differences of its formulas, extrapolated to rounding; nothing of the
mechanism is differenced.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, TypeVar

import numpy as np

from mbsvib.common.arrays import Array, Index
from mbsvib.elements.part import Part
from mbsvib.errors import ModelError
from mbsvib.linalg.differences import slope
from mbsvib.linalg.rank import AGREEING_SLOPES
from mbsvib.linalg.rotations import skew
from mbsvib.linalg.vectors import Field
from mbsvib.sensitivities.families.pose_changes import PoseRates, ReferenceTerms, RowTerms
from mbsvib.sensitivities.forces import Forces
from mbsvib.sensitivities.local_forms import LocalForm, Shift
from mbsvib.sensitivities.network import Network, Spin

P = TypeVar("P", bound=Part)
Forms = Sequence[LocalForm | Shift]


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
class LoadRules:
    """What a family of parts says of its parameters under loads.

    ``is_exception`` tells of which parts derivatives through the equilibrium are not known. ``add_force_terms`` says
    what parameters change of the forces, ``follow`` how they go with the bodies beside what roles say, and
    ``add_reference_terms`` what parameters as described do where the equilibrium was found in another pose.
    ``internal`` is the field of numbers that change with the pose and are no parameters, and their count;
    ``internal_forms`` are their forms, ``gravity_forms`` those of what gravity does beside forces. ``reactions`` names
    the elements whose forces statics gives, with the bodies of internal coordinates. ``twist_axis`` is the axis of a
    moment about which an angle is measured, ``bent_lines`` the names, frames and forms of elements whose bending
    tension changes.
    """

    is_exception: Callable[[Any, bool, frozenset[str]], bool] = lambda *_: False
    add_force_terms: Callable[[RowTerms, Network, Forces, Any, int], None] = lambda *_: None
    follow: Callable[[PoseRates, Any, int], None] = lambda *_: None
    add_reference_terms: Callable[[ReferenceTerms, Any, int], None] = lambda *_: None
    internal: tuple[str, int] = ("", 0)
    internal_forms: Callable[[Network, Any], Sequence[Forms]] = lambda *_: ()
    gravity_forms: Callable[[Network, Any], Sequence[Forms]] = lambda *_: ()
    reactions: Callable[[Any], tuple[tuple[str, ...], tuple[str, ...], int] | None] = lambda *_: None
    twist_axis: Callable[[Any], Any] = lambda *_: None
    bent_lines: Callable[[Any], tuple[tuple[str, ...], Array, Array] | None] = lambda *_: None


NONE = LoadRules()
UNKNOWN = LoadRules(is_exception=lambda *_: True)


@dataclass(frozen=True, slots=True)
class PartRules:
    """What a family of parts says of its parameters; ``kind`` names the groups of these.

    ``rule`` gives the forms of a field of many parts at once, of bodies or connections by their numbers, ``single``
    those of one entry of one part; those that float are parts of a kind of their own where it ``floats``. ``has_rule``
    tells whether a field has any. Where bodies spin, parameters that may take one off its axis, or change how dampers
    turn along, ``alters_spin``, are differenced: variants say whether the spin is steady still. ``loaded`` are the
    rules under loads.
    """

    kind: str
    rule: Callable[[Network, Sequence[Any], Index, str], Forms] | None = None
    floats: bool = False
    single: Callable[[Network, Any, str, tuple[int, ...]], Forms] | None = None
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
