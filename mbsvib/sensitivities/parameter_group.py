"""Groups of parameters: one field of many parts of a kind, which one rule holds for, whatever motions are asked for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.sensitivities import beam_rules
from mbsvib.sensitivities.coupler_rules import coupler_rule
from mbsvib.sensitivities.maxwell_rules import maxwell_rule
from mbsvib.sensitivities.part_rules import constants, moved_floating, rule
from mbsvib.sensitivities.rotor_rules import rotor_rule
from mbsvib.sensitivities.torsion_rules import torsion_rule

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Index
    from mbsvib.mechanism.parameters import Parameter
    from mbsvib.sensitivities.network import Network
    from mbsvib.sensitivities.rule_terms import Rule
    from mbsvib.sensitivities.shared_wrenches import Spin

# Parts whose entries have rules of their own, one by one.
_SINGLE: dict[str, Callable[..., Any]] = {
    "beam": beam_rules.beam_rule, "coupler": coupler_rule, "maxwell": maxwell_rule, "rotor": rotor_rule,
    "torsion": torsion_rule,
}  # fmt: skip
# Fields of springs that say what force they have at the pose, and are no part of K by themselves.
FORCES = ("preload", "free_length")
_PAIR = {pair: n for n, pair in enumerate((i, j) for i in range(6) for j in range(i, 6))}


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
            return slice(first, last + 1), tuple(each[start:stop] for each in self.data), self.rows[start:stop]
        return number, tuple(each[start:stop] for each in self.data), self.rows[start:stop]


def have_rules(network: Network, parameters: Sequence[Parameter]) -> NDArray[np.bool_]:
    """Tell which parameters act by what their own parts do alone.

    Parameters
    ----------
    network : Network
        Bodies and connections.
    parameters : sequence of Parameter
        The parameters.

    Returns
    -------
    array of bool, shape (parameters,)
        Whether a rule holds for each.
    """
    parts, known = network.named, {}
    if not network.limits and network.spin is None and not network.bare:
        return np.array([(part in parts and field not in FORCES and parts[part][0] != "beam")
                         or _has_rule(network, field, parts.get(part))
                         for part, field in ((each.part, each.field) for each in parameters)],
                        dtype=np.bool_)  # fmt: skip
    for each in parameters:
        if (each.part, each.field) not in known:
            known[each.part, each.field] = _has_rule(network, each.field, parts.get(each.part))
    return np.array([known[each.part, each.field] for each in parameters], dtype=np.bool_)


def groups_by_rule(network: Network, entries: Sequence[Parameter]) -> tuple[ParameterGroup, ...]:
    """Return the groups of parameters as if all of them acted by what their own parts do alone.

    Parameters
    ----------
    network : Network
        Bodies and connections.
    entries : sequence of Parameter
        The parameters.

    Returns
    -------
    tuple of ParameterGroup
        Groups of those that have a rule.
    """
    parts = network.named
    return tuple(numbered_groups(network, [(place, each) for place, each in enumerate(entries) if each.part in parts
                                           and each.field not in FORCES]))  # fmt: skip


def numbered_groups(network: Network, members: Sequence[tuple[int, Parameter]]) -> list[ParameterGroup]:
    """Return the groups of parameters that have a rule, each with the number of its row."""
    parts = network.named
    members_of: dict[tuple[Any, ...], list[tuple[int, int, int]]] = {}
    before = own_field = depth = None
    for place, entry in members:
        name, field, index = entry.part, entry.field, entry.index
        if (name, field, len(index)) != before:
            before, depth = (name, field, len(index)), len(index)
            kind, number, part = parts[name]
            apart = (kind == "joint" and part.end is not None) or (
                kind == "body" and field == "position" and number in network.floating)  # fmt: skip
            if kind not in _SINGLE:
                own_field = members_of.setdefault((kind, field, type(part), depth, apart), [])
        if kind in _SINGLE:
            own_field = members_of.setdefault((kind, field, (number, index), depth, apart), [])
        assert own_field is not None
        own_field.append((place, number, 0 if not depth else index[0] if depth == 1 else _PAIR[index[0], index[1]]))
    return [_group(network, key, members) for key, members in members_of.items()]


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
        return part.inertia is None and spin.turning is not None
    if kind == "body":
        return part.name in spin.bodies and field != "mass"
    if kind not in ("joint", "spring", "torsion") or not spin.bodies.intersection((part.first, part.second)):
        return False
    return field not in ("stiffness", "damping") or (field == "damping" and spin.turning is not None)


def _group(network: Network, key: tuple[Any, ...], members: list[tuple[int, int, int]]) -> ParameterGroup:
    kind, field, _, depth, apart = key
    if kind in _SINGLE:
        place, index, _ = members[0]
        found = _SINGLE[kind](network, network.parts[index], field, key[2][1])
        own_rule, data = found if isinstance(found, tuple) else (found, ())
        return ParameterGroup(kind, field, np.zeros(1, dtype=np.intp), own_rule, data, np.array([[place]]), 0)
    table = np.array(members, dtype=np.intp)
    number, inverse = np.unique(table[:, 1], return_inverse=True)
    known: Any = network.bodies if kind == "body" else network.joints + network.springs
    same = [known[i] for i in number.tolist()]
    width = 1 if depth == 0 else 21 if depth == 2 else 6 if field in ("inertia", "stiffness", "damping") else 3
    rows = np.full((len(number), width), -1, dtype=np.intp)
    rows[inverse, table[:, 2]] = table[:, 0]
    if kind == "body" and apart:
        among = (number[:, None] == network.floating).argmax(axis=1)
        return ParameterGroup(kind, field, number, moved_floating, (among,), rows, _stride(rows))
    return ParameterGroup(kind, field, number, rule(same[0], field), constants(same, field), rows, _stride(rows))


def _stride(rows: Index) -> int:
    count, width = rows.shape
    stride = int(rows[1, 0] - rows[0, 0]) if count > 1 else width
    regular = rows[0, 0] + stride * np.arange(count)[:, None] + np.arange(width)
    return stride if stride >= width and rows[0, 0] >= 0 and bool((rows == regular).all()) else 0
