"""Groups of parameters: one field of many parts of a kind, which one rule holds for, whatever motions are asked for."""

from __future__ import annotations

from dataclasses import dataclass
from operator import itemgetter
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.sensitivities import beam_rules
from mbsvib.sensitivities.made_part_rules import coupler_rule, maxwell_rule, rotor_rule, torsion_rule
from mbsvib.sensitivities.part_rules import constants, moved_floating, rule

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Index
    from mbsvib.sensitivities.network import Network
    from mbsvib.sensitivities.part_rules import Rule
    from mbsvib.sensitivities.shared_wrenches import Spin
    from mbsvib.sensitivities.variables import FieldLayout

# Parts whose entries have rules of their own, one by one.
_SINGLE: dict[str, Callable[..., Any]] = {
    "beam": beam_rules.beam_rule, "coupler": coupler_rule, "maxwell": maxwell_rule, "rotor": rotor_rule,
    "torsion": torsion_rule,
}  # fmt: skip
# Fields of springs that say what force they have at the pose, and are no part of K by themselves.
FORCES = ("preload", "free_length")


@dataclass(frozen=True, slots=True)
class ParameterGroup:
    """One ``field`` of bodies or connections of one ``kind`` (body, joint, spring): their ``number`` (parts,), a
    ``rule``, its ``data``, and the parameter in each place of ``rows`` (parts, entries), -1 where none was asked for;
    ``stride`` leads from part to part where the entries of each follow each other, 0 elsewhere.
    """

    kind: str
    field: str
    number: Index
    rule: Rule
    data: tuple[Array, ...]
    rows: Index
    stride: int

    def part(self, start: int, stop: int) -> tuple[Any, tuple[Array, ...], Index]:
        """Return numbers, data and rows of some of the parts; numbers as a slice where they follow each other."""
        number = self.number[start:stop]
        first, last = int(number[0]), int(number[-1])
        if last - first == len(number) - 1:
            return slice(first, last + 1), tuple(array[start:stop] for array in self.data), self.rows[start:stop]
        return number, tuple(array[start:stop] for array in self.data), self.rows[start:stop]


def have_rules(network: Network, layout: FieldLayout) -> NDArray[np.bool_]:
    """Tell which parameters act by what their own parts do alone.

    Returns (parameters,): whether a rule holds for each.
    """
    parts = network.named
    plain = not network.limits and network.spin is None and not network.bare
    return layout.of_parameters([
        (plain and part in parts and field not in FORCES and parts[part][0] != "beam")
        or _has_rule(network, field, parts.get(part)) for part, field, _ in layout.fields])  # fmt: skip


def groups_by_rule(network: Network, layout: FieldLayout) -> list[ParameterGroup]:
    """Return the groups of parameters as if all of them acted by what their own parts do alone.

    ``layout``: the parameters by the fields of their parts; those that have a rule get a group. Returns groups of the
    parameters of bodies, connections and parts that are made of these.
    """
    parts, starts, number = network.named, layout.starts, layout.number
    used = [True] * len(layout.fields)
    if number is not None:
        counts = np.concatenate(([0], np.cumsum(number >= 0)))[starts]
        used = (counts[1:] > counts[:-1]).tolist()
    groups: list[ParameterGroup] = []
    members: dict[tuple[Any, ...], tuple[list[int], list[int], list[Any]]] = {}
    floating = set(network.floating.tolist())
    for (name, field, depth), width, start, requested in zip(layout.fields, layout.width, starts, used, strict=False):
        if not requested or name not in parts or field in FORCES:
            continue
        kind, k, part = parts[name]
        if kind in _SINGLE:
            groups += [_single(network, kind, (part, field, (i,) if depth else ()), row)
                       for i, row in enumerate(range(start, start + width) if number is None else
                                               number[start : start + width].tolist()) if row >= 0]  # fmt: skip
            continue
        separate = part.end is not None if kind == "joint" else kind == "body" and field == "position" and k in floating
        numbers, first, same = members.setdefault((kind, field, type(part), width, separate), ([], [], []))
        numbers.append(k)
        first.append(start)
        same.append(part)
    groups += [_group(network, key, sorted(zip(*lists, strict=True), key=itemgetter(0)), number)
               for key, lists in members.items()]  # fmt: skip
    return groups


def _has_rule(network: Network, field: str, known: tuple[str, int, Any] | None) -> bool:
    """Whether a parameter acts by what its own part does alone."""
    if known is None or field in FORCES:
        return False
    if network.spin is not None and _turns_along(network.spin, field, *known):
        return False
    if known[0] == "beam" and not beam_rules.has_rule(known[2], field):
        return False
    # the tension of a spring with a free length comes from its stiffness
    pulls = field == "stiffness" and getattr(known[2], "free_length", None) is not None
    return all((known[0], field) in limit and not pulls for limit in network.limits)


def _turns_along(spin: Spin, field: str, kind: str, _: int, part: Any) -> bool:
    """Whether a parameter may take a spinning body, or what joins it, off its axis, or change how dampers turn along.

    Such parameters are differenced: variants say whether the spin is steady still.
    """
    if kind == "rotor":
        return part.inertia is None and spin.circulatory is not None
    if kind == "body":
        return part.name in spin.bodies and field != "mass"
    if kind not in ("joint", "spring", "torsion") or not spin.bodies.intersection((part.first, part.second)):
        return False
    return field not in ("stiffness", "damping") or (field == "damping" and spin.circulatory is not None)


def _single(network: Network, kind: str, entry: tuple[Any, str, tuple[int, ...]], row: int) -> ParameterGroup:
    """The group of one number of a part that is made of bodies and connections."""
    rule_and_data = _SINGLE[kind](network, *entry)
    own_rule, data = rule_and_data if isinstance(rule_and_data, tuple) else (rule_and_data, ())
    return ParameterGroup(kind, entry[1], np.zeros(1, dtype=np.intp), own_rule, data, np.array([[row]]), 0)


def _group(
    network: Network, key: tuple[Any, ...], members: list[tuple[int, int, Any]], number: Index | None
) -> ParameterGroup:  # fmt: skip
    """The group of one field of many parts, each with its number and the first entry of the field."""
    kind, field, _, width, separate = key
    numbers, first, same = zip(*members, strict=True)
    index = np.array(numbers)
    rows, lead, follow = np.array(first)[:, None] + np.arange(width), list(first), True
    if number is not None:
        rows = number[rows]
        lead, follow = rows[:, 0].tolist(), bool((rows == rows[:, :1] + np.arange(width)).all())
    stride = _stride(lead, width) if follow else 0
    if kind == "body" and separate:
        among = (index[:, None] == network.floating).argmax(axis=1)
        return ParameterGroup(kind, field, index, moved_floating, (among,), rows, stride)
    return ParameterGroup(kind, field, index, rule(same[0], field), constants(same, field), rows, stride)


def _stride(lead: list[int], width: int) -> int:
    """How many parameters are from part to part, by the first of each; 0 where that differs or none is asked for."""
    stride = lead[1] - lead[0] if len(lead) > 1 else width
    regular = stride >= width and lead[0] >= 0 and lead == list(range(lead[0], lead[0] + stride * len(lead), stride))
    return stride if regular else 0
