"""Groups of parameters: one field of many parts of a kind, which one rule holds for, whatever motions are asked for."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations_with_replacement
from operator import itemgetter
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.sensitivities.families import rules_of
from mbsvib.sensitivities.families.rules import any_field

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Index
    from mbsvib.elements.part import Part
    from mbsvib.sensitivities.families.rules import PartRules, RuleAndData
    from mbsvib.sensitivities.families.terms import Rule
    from mbsvib.sensitivities.network import Network
    from mbsvib.sensitivities.variables import FieldLayout, PartFields

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
    """Tell which parameters (parameters,) act by what their own parts do alone, so that a rule holds for them."""
    parts = network.named
    alike = not network.limits and network.spin is None  # parts of a class then differ in nothing
    known: dict[tuple[type, PartFields], list[bool]] = {}
    result = []
    for name, fields in zip(layout.names, layout.fields, strict=True):
        if name not in parts:
            result.append([False] * fields.width)
            continue
        part = parts[name][1]
        key, rules = (type(part), fields), rules_of(part)
        if not alike or key not in known or rules.has_rule is not any_field:
            known[key] = []
            for field, *_, count in fields.fields:
                known[key] += [_has_rule(network, field, rules, part)] * count
        result.append(known[key])
    return layout.of_parameters(result)


def groups_by_rule(network: Network, layout: FieldLayout) -> list[ParameterGroup]:
    """Return the groups of the parameters that have rules, as if each acted by what its own part does alone.

    ``layout``: the parameters by the fields of their parts, which are bodies, connections and what is made of these.
    """
    parts = network.named
    members: dict[tuple[Any, ...], list[tuple[int, int, Any]]] = {}
    groups: list[ParameterGroup] = []
    for name, fields, start in zip(layout.names, layout.fields, layout.starts, strict=False):
        if name not in parts:
            continue
        k, part = parts[name]
        rules = rules_of(part)
        if rules.single is not None:
            groups += _of_entries(network, rules.single, part, fields, start, layout.number)
        elif rules.rule is not None:
            floats = rules.floats and k in network.floating_number
            members.setdefault((type(part), fields, floats), []).append((k, start, part))
    for (_, fields, _), alike in members.items():
        groups += _of_fields(network, fields, sorted(alike, key=itemgetter(0)), layout.number)
    return groups


def _has_rule(network: Network, field: str, rules: PartRules, part: Any) -> bool:
    """Whether a parameter acts by what its own part does alone."""
    if field in FORCES or (rules.rule is None and rules.single is None) or not rules.has_rule(part, field):
        return False
    if network.spin is not None and rules.alters_spin(network.spin, part, field):
        return False
    # the tension of a spring with a free length comes from its stiffness
    pulls = field == "stiffness" and getattr(part, "free_length", None) is not None
    return all((rules.kind, field) in limit and not pulls for limit in network.limits)


def _of_entries(
    network: Network, single: Callable[..., RuleAndData], part: Any, fields: PartFields, start: int,
    number: Index | None,
) -> Iterator[ParameterGroup]:  # fmt: skip
    """The groups of a part each of whose entries has a rule of its own; its entries begin at ``start``."""
    for field, depth, shift, count in fields.fields:
        if field in FORCES:
            continue
        entries = np.arange(count) + start + shift
        for i, row in enumerate((entries if number is None else number[entries]).tolist()):
            if row >= 0:
                rule, data = single(network, part, field, _index(i, depth))
                yield ParameterGroup(rules_of(part).kind, field, _ONE, rule, data, np.array([[row]]), 0)


def _of_fields(
    network: Network, fields: PartFields, members: list[tuple[int, int, Any]], number: Index | None
) -> Iterator[ParameterGroup]:
    """The groups of the fields of parts of one class, each with its number, its first entry and the part."""
    numbers, starts, parts = zip(*members, strict=True)
    index, first, rules = np.array(numbers), np.array(starts), rules_of(parts[0])
    assert rules.rule is not None
    stride = _stride(list(starts), fields.width)
    for field, _, shift, count in fields.fields:
        if field in FORCES:
            continue
        rows = first[:, None] + np.arange(shift, shift + count)
        if number is not None:
            rows = number[rows]
            if not (rows >= 0).any():
                continue
            follow = bool((rows == rows[:, :1] + np.arange(count)).all())
            stride = _stride(rows[:, 0].tolist(), count) if follow else 0
        yield ParameterGroup(rules.kind, field, index, rules.rule(network, parts[0], field),
                             rules.constants(network, parts, field), rows, stride)  # fmt: skip


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
