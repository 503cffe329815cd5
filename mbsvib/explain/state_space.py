"""What a state space is, in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsvib.common.display import upper
from mbsvib.common.tables import listed
from mbsvib.errors import counted

if TYPE_CHECKING:
    from mbsvib.responses.state_space import StateSpace


def explain(space: StateSpace) -> str:
    """Return a description of a state space: its realization, and how far a reduced model is off."""
    lines = [f"{space.name}: {counted(len(space.states), 'state')}, realization {space.realization!r}"]
    if space.error_bound is not None:
        lines.append(f"  the frequency response differs by {upper(space.error_bound)} at most from that of the full "
                     f"model, as its largest singular value, output by input in SI units")  # fmt: skip
    lines.append(f"  states: {listed(space.states) or 'none'}")
    return "\n".join(lines)
