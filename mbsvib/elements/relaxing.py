"""Connections whose stiffness depends on frequency: what bushings, springs and torsion springs of this kind share.

f(s) = static + viscous s + sum of g s tau / (1 + s tau)

A connection of stiffness k is one with ``static`` k and the damping c + ``viscous`` k, and beside it for each
relaxation a spring g k in series with a damper g tau k. At rest dampers carry nothing.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping
from typing import Any, ClassVar, TypeVar

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arguments import Vector
from mbsvib.common.arrays import Array
from mbsvib.elements.connection import Connection, PreloadForm
from mbsvib.elements.dynamic import Dynamic
from mbsvib.elements.roles import ParameterField
from mbsvib.elements.shared_rows import ExpandedPart
from mbsvib.errors import ModelError

_LABELS = ("g", "tau")
R = TypeVar("R", bound="RelaxingAxis")


class Relaxing(Connection):
    """A connection whose stiffness ``dynamic`` lets depend on frequency."""

    __slots__ = ()
    _engine = "replacement"
    dynamic: Dynamic

    @abstractmethod
    def replacement(self, *_: Any) -> ExpandedPart:
        """Return the nodes, their joints and the connections that replace it."""

    @property
    def generated_names(self) -> tuple[str, ...]:
        made = self.replacement()
        return (*made.bodies, *made.joints, *made.springs)

    @property
    def body_positions(self) -> Mapping[str, Vector]:
        return {name: node.position for name, node in self.replacement().bodies.items()}

    @property
    def rest_wrench(self) -> tuple[float, ...]:
        return super().rest_wrench if self.at_rest is None else self.at_rest.rest_wrench

    def preload_form(self, size: float) -> PreloadForm | None:
        return None if self.at_rest is None else self.at_rest.preload_form(size)

    def _arguments_with(self, values: Mapping[str, Any]) -> dict[str, Any]:
        own = {f"{label}{k}": (i, k - 1) for k in range(1, len(self.dynamic.terms) + 1)
               for i, label in enumerate(_LABELS)}  # fmt: skip
        changed = super()._arguments_with({field: values[field] for field in values if field not in own})
        if own.keys() & values.keys():
            numbers = [[pair[i] for pair in self.dynamic.terms] for i in (0, 1)]
            for field in own.keys() & values.keys():
                i, k = own[field]
                numbers[i][k] = values[field]
            changed["dynamic"] = self.dynamic.words() | dict(zip(("weights", "times"), numbers, strict=True))
        return changed

    def suspects(self, values: Mapping[str, Array]) -> bool:
        return True

    @property
    def _term_names(self) -> tuple[str, ...]:
        return tuple([f"{label}{k}" for k in range(1, len(self.dynamic.terms) + 1) for label in _LABELS])

    def replaced_coefficients(self, fields: Mapping[str, Array]) -> dict[str, dict[str, Array]]:
        k, c = (fields.get(field, np.array(getattr(self, field))[..., None]) for field in ("stiffness", "damping"))
        result = {f"{self.name}.rest": {"stiffness": self.dynamic.static * k, "damping": c + self.dynamic.viscous * k}}
        for i, pair in enumerate(self.dynamic.terms, 1):
            g, tau = (fields.get(f"{label}{i}", np.full(1, value)) for label, value in zip(_LABELS, pair, strict=True))
            stem = f"{self.name}.{i}"
            result |= {f"{stem}.spring": {"stiffness": g * k}, f"{stem}.damper": {"damping": g * tau * k}}
        count = max([np.shape(array)[-1] for array in fields.values()], default=1)
        return {name: {field: np.broadcast_to(array, (*array.shape[:-1], count)) for field, array in arrays.items()}
                for name, arrays in result.items()}  # fmt: skip

    def parameter_fields(self) -> Iterator[ParameterField]:
        yield from super().parameter_fields()
        for k, (g, tau) in enumerate(self.dynamic.terms, 1):
            yield ParameterField(f"g{k}", g, "-")
            yield ParameterField(f"tau{k}", tau, "s")


class RelaxingAxis(Relaxing):
    """A relaxing connection along or about one axis, with one stiffness and one damping."""

    __slots__ = ()
    made_at_rest: ClassVar[Callable[..., Connection]]  # what makes such a connection without relaxations
    stiffness: float
    damping: float
    preload: float | None

    @property
    def batched_fields(self) -> frozenset[str]:
        return frozenset(("stiffness", "damping", *self._term_names))

    @property
    def signed_fields(self) -> frozenset[str]:
        return self.batched_fields

    @property
    def rest_stiffness(self) -> float:
        """Stiffness without relaxations, as it acts at rest."""
        return self.dynamic.static * self.stiffness

    @property
    def rest_damping(self) -> float:
        """Damping without relaxations."""
        return self.damping + self.dynamic.viscous * self.stiffness

    @property
    def at_rest(self) -> Any:
        """The connection without relaxations; None where nothing is left."""
        if not (self.rest_stiffness or self.rest_damping or self.preload):
            return None
        values = self.arguments() | {"stiffness": self.rest_stiffness, "damping": self.rest_damping}
        del values["dynamic"]
        return type(self).made_at_rest(**values)

    @property
    def relaxations(self) -> tuple[tuple[tuple[float], float], ...]:
        """Stiffness and time constant [s] of each relaxation."""
        return tuple([((g * self.stiffness,), tau) for g, tau in self.dynamic.terms])


def factor_of(dynamic: Any, who: str) -> Dynamic:
    """Return how a stiffness depends on frequency, of an ``mv.Dynamic`` or its words; others, and those without states,
    are refused.
    """
    factor = Dynamic.of_words(dynamic) if isinstance(dynamic, Mapping) else dynamic
    if not isinstance(factor, Dynamic):
        raise check.refuse(who, "dynamic", dynamic, "an mv.Dynamic, how the stiffness depends on frequency")
    if not factor.is_rational:
        raise ModelError(f"{who}: dynamic = {factor!r} has no states, which a mechanism needs; give the sum of "
                         f"relaxations that is nearest over a band of frequencies [Hz], dynamic.rational((low, high)), "
                         f"which states its error.", element=who, field="dynamic")  # fmt: skip
    return factor


def relaxing(kind: Callable[..., R], plain: Any, dynamic: Any, unit: str) -> R:
    """Return a connection along one axis whose stiffness depends on frequency, from the same without.

    One whose stiffness is not positive is refused, as its relaxations would give energy.
    """
    who = f"{plain.family} '{plain.name}'"
    factor = factor_of(dynamic, who)
    if plain.stiffness <= 0.0:
        raise ModelError(f"{who}: stiffness = {plain.stiffness:g} {unit} with dynamic = {factor!r}; expected one above "
                         f"0, so that its relaxations take energy.", element=who, field="stiffness")  # fmt: skip
    result = kind(**plain.arguments(), dynamic=factor)
    result.at_rest  # noqa: B018  a free length needs a stiffness at rest
    return result
