"""Groups of parameters: one field of many parts of a kind, which one rule holds for, whatever motions are asked for."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations_with_replacement
from operator import itemgetter
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.sensitivities.families import rules_of
from mbsvib.sensitivities.families.body import moved_floating
from mbsvib.sensitivities.families.rules import any_field

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Index
    from mbsvib.elements.part import Part
    from mbsvib.sensitivities.families.rules import PartRules
    from mbsvib.sensitivities.families.terms import Rule
    from mbsvib.sensitivities.network import Network
    from mbsvib.sensitivities.shared_wrenches import Spin
    from mbsvib.sensitivities.variables import FieldLayout

# Fields of springs that say what force they have at the pose, and are no part of K by themselves.
FORCES = ("preload", "free_length")
_ONE = np.zeros(1, dtype=np.intp)
_PAIRS = tuple(combinations_with_replacement(range(6), 2))


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
    alike = not network.limits and network.spin is None  # parts of a class then differ in nothing
    known: dict[tuple[type, str], bool] = {}
    result = []
    for name, field, _ in layout.fields:
        part = parts[name][1] if name in parts else None
        rules = None if part is None else rules_of(part)
        key = type(part), field
        if not alike or key not in known or (rules is not None and rules.has_rule is not any_field):
            known[key] = rules is not None and _has_rule(network, field, rules, part)
        result.append(known[key])
    return layout.of_parameters(result)


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
        k, part = parts[name]
        rules = rules_of(part)
        if rules.single is not None:
            entries = range(start, start + width) if number is None else number[start : start + width].tolist()
            for i, row in enumerate(entries):
                if row >= 0:
                    own_rule, data = rules.single(network, part, field, _index(i, depth))
                    groups.append(ParameterGroup(rules.kind, field, _ONE, own_rule, data, np.array([[row]]), 0))
            continue
        kind = rules.kind
        if rules.rule is None:
            continue
        separate = part.end is not None if kind == "joint" else kind == "body" and field == "position" and k in floating
        numbers, first, same = members.setdefault((kind, field, type(part), width, separate), ([], [], []))
        numbers.append(k)
        first.append(start)
        same.append(part)
    groups += [_group(network, key, sorted(zip(*lists, strict=True), key=itemgetter(0)), number)
               for key, lists in members.items()]  # fmt: skip
    return groups


def _has_rule(network: Network, field: str, rules: PartRules, part: Any) -> bool:
    """Whether a parameter acts by what its own part does alone."""
    if field in FORCES or (rules.rule is None and rules.single is None) or not rules.has_rule(part, field):
        return False
    if network.spin is not None and _turns_along(network.spin, field, rules.kind, part):
        return False
    # the tension of a spring with a free length comes from its stiffness
    pulls = field == "stiffness" and getattr(part, "free_length", None) is not None
    return all((rules.kind, field) in limit and not pulls for limit in network.limits)


def _turns_along(spin: Spin, field: str, kind: str, part: Any) -> bool:
    """Whether a parameter may take a spinning body, or what joins it, off its axis, or change how dampers turn along.

    Such parameters are differenced: variants say whether the spin is steady still.
    """
    if kind == "rotor":
        return part.inertia is None and spin.circulatory is not None
    if kind == "body":
        return part.name in spin.bodies and field != "mass"
    if kind not in ("joint", "spring", "torsion", "element") or not spin.bodies.intersection((part.first, part.second)):
        return False
    return field not in ("stiffness", "damping") or (field == "damping" and spin.circulatory is not None)


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
    rules = rules_of(same[0])
    assert rules.rule is not None
    return ParameterGroup(kind, field, index, rules.rule(same[0], field), rules.constants(same, field), rows, stride)


def internal_groups(network: Network, first: int, gravity: int | None) -> list[ParameterGroup]:
    """Return the groups of numbers that change with the pose and are no parameters, and of gravity where it does more
    than forces.

    ``first``: the row of the first of these numbers; ``gravity``: that of gravity along x, None without gravity.
    """
    result, row = [], first
    with_gravity: dict[Any, list[Part]] = {}
    for part in network.parts:
        rules = rules_of(part)
        for own in rules.internal_rules(network, part):
            result.append(ParameterGroup(rules.kind, rules.internal[0], own.number, own.rule, own.data,
                                         row + np.arange(own.count)[None], own.count))  # fmt: skip
            row += own.count
        if rules.gravity_rule is not None and gravity is not None:
            with_gravity.setdefault(rules.gravity_rule, []).append(part)
    for rule_of, parts in with_gravity.items():
        rows = (gravity or 0) + np.arange(3)[None]
        result.append(ParameterGroup("gravity", "", _ONE, rule_of(network, parts), (), rows, 3))
    return result


def _index(i: int, depth: int) -> tuple[int, ...]:
    """The index of entry i of a number, vector or symmetric matrix."""
    return ((), (i,), _PAIRS[i] if depth > 1 else ())[depth]


def _stride(lead: list[int], width: int) -> int:
    """How many parameters are from part to part, by the first of each; 0 where that differs or none is asked for."""
    stride = lead[1] - lead[0] if len(lead) > 1 else width
    regular = stride >= width and lead[0] >= 0 and lead == list(range(lead[0], lead[0] + stride * len(lead), stride))
    return stride if regular else 0
