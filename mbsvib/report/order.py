"""The order in which signals are shown: motions of the ground first, and motions of what is furthest from it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mbsvib.mechanism.mechanism import GROUND

if TYPE_CHECKING:
    from collections.abc import Sequence


def inputs_in_order(system: Any, names: Sequence[str]) -> list[str]:
    """Return inputs, motions of the ground before forces."""
    return sorted(names, key=lambda name: system.input_units[system.inputs.index(name)] not in _motions(system))


def outputs_in_order(system: Any, names: Sequence[str]) -> list[str]:
    """Return outputs, those of the unit of a ground's motion first, and among these the payload's first.

    The payload is the body with most connections between it and the ground, on the shortest way.
    """
    away, ports = _distances(system), {port.name: port for port in getattr(_provenance(system), "ports", ())}

    def key(name: str) -> tuple[bool, int]:
        body = getattr(ports.get(name), "body", None)
        return system.output_units[system.outputs.index(name)] not in _motions(system), -away.get(body, 0)

    return sorted(names, key=key)


def _motions(system: Any) -> set[str]:
    """The units of inputs that are motions."""
    return {unit for unit in system.input_units if unit.startswith(("m", "rad"))}


def _provenance(system: Any) -> Any:
    return getattr(system, "provenance", None)


def _distances(system: Any) -> dict[str | None, int]:
    """Connections between each body and the ground, on the shortest way."""
    links = [(part.first, part.second) for part in getattr(_provenance(system), "parts", ()) if hasattr(part, "second")]
    away: dict[str | None, int] = {GROUND: 0}
    front = [GROUND]
    while front:
        reached = dict.fromkeys(there for pair in links for here, there in (pair, pair[::-1])
                                if here in front and there not in away)  # fmt: skip
        away |= dict.fromkeys(reached, away[front[0]] + 1)
        front = list(reached)
    return away
