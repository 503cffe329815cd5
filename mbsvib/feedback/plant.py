"""Plants of closed loops: linear equations with named sensors and actuators, and their first-order form."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from mbsvib.responses.state_space import StateSpace


class LoopPlant(Protocol):
    """A system, or a state space, whose outputs are sensors and whose inputs are actuators."""

    @property
    def system(self) -> Any:
        """The equations with open loops."""

    @property
    def space(self) -> StateSpace:
        """First-order equations: in modal states for a mechanism."""


@dataclass(frozen=True, repr=False, eq=False)
class SystemPlant:
    """Any system or state space as a plant."""

    system: Any

    @cached_property
    def space(self) -> StateSpace:
        """First-order equations: in modal states for a system, as given for a state space."""
        space: StateSpace = self.system.state_space("modal" if self.system.kind == "system" else None)
        return space

    def __repr__(self) -> str:
        return f"SystemPlant({self.system!r})"
