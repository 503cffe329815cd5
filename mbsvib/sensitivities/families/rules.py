"""What a family of parts says of its parameters: one record a family."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.linalg.rotations import skew

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Index
    from mbsvib.linalg.vectors import Field
    from mbsvib.sensitivities.families.pose_changes import PoseRates, ReferenceTerms
    from mbsvib.sensitivities.families.terms import Rule
    from mbsvib.sensitivities.force_layout import RowTerms
    from mbsvib.sensitivities.forces import Forces
    from mbsvib.sensitivities.network import Network
    from mbsvib.sensitivities.shared_wrenches import Spin

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
class PartRules:
    """What a family of parts says of its parameters; ``kind`` names the groups of these.

    How they enter the equations: ``rule`` gives the rule of a field of many parts at once, with ``constants`` of these,
    ``single`` that of one entry; those that float are parts of a kind of their own where it ``floats``. ``has_rule``
    tells whether a field has one at all. Where bodies spin, parameters that may take one off its axis, or change how
    dampers turn along, ``alters_spin``, are differenced: variants say whether the spin is steady still.

    Under loads: ``is_exception`` tells of which parts derivatives through the equilibrium are not known.
    ``add_force_terms`` says what parameters change of the forces, ``follow`` how they go with the bodies beside what
    roles say, and ``add_reference_terms`` what parameters as described do where the equilibrium was found in another
    pose. ``internal`` is the field of numbers that change with the pose and are no parameters, and their count;
    ``internal_rules`` are their rules, ``gravity_rule`` what gravity does beside forces. ``reactions`` names the
    elements whose forces statics gives, with the bodies of internal coordinates. ``twist_axis`` is the axis of a moment
    about which an angle is measured, ``bent_lines`` the names, frames and forms of elements whose bending tension
    changes.
    """

    kind: str
    rule: Callable[[Network, Any, str], Rule] | None = None
    constants: Callable[[Network, Sequence[Any], str], tuple[Array, ...]] = lambda *_: ()
    floats: bool = False
    single: Callable[[Network, Any, str, tuple[int, ...]], RuleAndData] | None = None
    has_rule: Callable[[Any, str], bool] = any_field
    alters_spin: Callable[[Spin, Any, str], bool] = lambda *_: False
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


def crossed(turn: Field, wrench: Array) -> Field:
    """Return how a force and moment (6,) change as they are turned (3, ...), (6, ...)."""
    return np.asarray((skew(wrench.reshape(2, 3)).swapaxes(1, 2) @ turn).reshape(6, -1))
