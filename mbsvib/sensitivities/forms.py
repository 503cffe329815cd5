"""Groups of parameters, and bilinear forms x^T (dT/dp) y of their derivatives for many pairs of motions at once.

A group is one field of many parts of a kind, which one rule holds for, whatever motions are asked for. Parameters that
no rule of one part tells have whole matrices as derivatives.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from math import prod
from operator import itemgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbsvib.common.arrays import Array, Index
from mbsvib.elements.part import Part
from mbsvib.linalg.rank import ZERO_MATRIX_SLOPE
from mbsvib.linalg.vectors import Field, any_nonzero
from mbsvib.sensitivities.adjoint_fields import Fields
from mbsvib.sensitivities.families import rules_of
from mbsvib.sensitivities.families.rules import PartRules, Rule, RuleAndData, Terms, any_field
from mbsvib.sensitivities.network import Network
from mbsvib.sensitivities.variables import FieldLayout, PartFields, indices

# Fields of springs that say what force they have at the pose, and are no part of K by themselves.
FORCES = ("preload", "free_length")
_ONE = np.zeros(1, dtype=np.intp)


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
    alike = not network.limits and network.matrices.spin is None  # parts of a class then differ in nothing
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
    if network.matrices.spin is not None and rules.alters_spin(network.matrices.spin, part, field):
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
        rows = entries if number is None else number[entries]
        for row, index in zip(rows.tolist(), indices(depth, count), strict=True):
            if row >= 0:
                rule, data = single(network, part, field, index)
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
        kind, rules = rules_of(part).kind, rules_of(part).loaded
        for own in rules.internal_rules(network, part):
            result.append(ParameterGroup(kind, rules.internal[0], own.number, own.rule, own.data,
                                         row + np.arange(own.count)[None], own.count))  # fmt: skip
            row += own.count
        if rules.gravity_rule is not None and gravity is not None:
            with_gravity.setdefault(rules.gravity_rule, []).append(part)
    for rule_of, parts in with_gravity.items():
        rows = (gravity or 0) + np.arange(3)[None]
        result.append(ParameterGroup("gravity", "", _ONE, rule_of(network, parts), (), rows, 3))
    return result


def _stride(lead: list[int], width: int) -> int:
    """How many parameters are from part to part, by the first of each; 0 where that differs or none is asked for."""
    stride = lead[1] - lead[0] if len(lead) > 1 else width
    regular = stride >= width and lead[0] >= 0 and lead == list(range(lead[0], lead[0] + stride * len(lead), stride))
    return stride if regular else 0


_POWERS = {"K": "stiff", "C": "rate", "M": "square"}


@dataclass(frozen=True, slots=True)
class MatrixDerivativeGroup:
    """The derivatives ``slopes`` of all matrices to the parameters ``rows`` (k,)."""

    rows: Index
    slopes: Mapping[str, Array]

    def forms(self, left: Fields, right: Fields | None = None) -> Field:
        """Return x^T (dK + s dC + s^2 dM) y, (k, ...); right None: y = x, and half of each form is returned.
        """
        other = left if right is None else right
        result: Any = 0.0
        for key, power in _POWERS.items():
            change = self.slopes[key]
            if not change.any():
                continue
            weight = getattr(left, power) if right is None else getattr(left, power) + getattr(right, power)
            shape = other.vectors.shape
            pushed = change @ other.vectors.reshape(len(other.vectors), prod(shape[1:]))
            works = (left.vectors * pushed.reshape(len(change), *shape)).sum(axis=1)
            result = result + 0.5 * weight * works
        if isinstance(result, float):
            tail = np.broadcast_shapes(left.vectors.shape[1:], other.vectors.shape[1:], np.shape(left.stiff))
            result = np.zeros((len(self.rows), *tail), dtype=left.vectors.dtype)
        return np.asarray(result)

    @property
    def symmetric(self) -> bool:
        """Whether all derivatives of K are symmetric."""
        change = np.nan_to_num(self.slopes["K"])
        asymmetry = np.abs(change - change.swapaxes(1, 2)).max(initial=0.0)
        return bool(asymmetry <= ZERO_MATRIX_SLOPE * np.abs(change).max(initial=0.0))

    def with_ports(
        self, result: Field, ports: tuple[list[int], list[int]], powers: tuple[Field, Field, Field],
        vectors: tuple[Field, Field], excluded: tuple[int, ...] = (),
    ) -> None:  # fmt: skip
        """Add dD + L^T dB + (dCq + s dCv + s^2 dCa) R to the derivatives of responses, in place.

        ``result`` (parameters, outputs, inputs, n): derivatives to all parameters; ``powers`` (n,): 1, s and s^2;
        ``vectors`` (m, 1, inputs, n) and (m, outputs, 1, n): R and L; ``excluded``: outputs whose D and H are counted
        elsewhere.
        """
        (i, o), (right, left) = ports, vectors
        counts = np.array([k not in excluded for k in range(len(o))])[:, None, None]
        for k, row in enumerate(self.rows.tolist()):
            result[row] += counts * self.slopes["D"][k][np.ix_(o, i)][:, :, None]
            result[row] += np.einsum("mi,mon->oin", self.slopes["B"][k][:, i], left[:, :, 0])
            for key, power in zip(("Cq", "Cv", "Ca"), powers, strict=True):
                result[row] += counts * power * np.einsum("om,min->oin", self.slopes[key][k][o], right[:, 0])


# Numbers that one block of forms may hold, so that it stays in the cache.
BLOCK = 80_000
# Blocks of fewer numbers are not worth a look whether they are zero.
SMALL = 2_000


def form_table(
    groups: Iterable[ParameterGroup], size: int, left: Fields, right: Fields | None = None
) -> Field:  # fmt: skip
    """Return x^T (dT/dp) y (size, ...) of the parameters of some groups, zero for all others.

    ``left``, ``right``: the motions x and y; right None: y = x, and half of each form is returned. Forms are computed
    block by block; what is zero for all parts of a large block is left out.
    """
    kind = np.result_type(left.body_wrench, left.wrench, *(() if right is None else (right.body_wrench, right.wrench)))
    tail = _tail(left, right)
    result, numbers = np.zeros((size, *tail), dtype=kind), prod(tail)
    for group in groups:
        count, width = group.rows.shape
        step = max(1, BLOCK // max(1, numbers * width))
        for start in range(0, count, step):
            number, data, rows = group.part(start, start + step)
            first = group.rule(left, number, data)
            second = None if right is None else group.rule(right, number, data)
            look = numbers * len(rows) > SMALL or not all(first) or not all(second or [True])
            coupled = _acting(first, second) if look else None
            if coupled is None:
                _put_block(result, rows, group.stride, _block(first, second, len(rows)))
                continue
            for i in coupled:
                of_one = None if second is None else second[i : i + 1]
                _put_block(result, rows[:, i : i + 1], group.stride, _block(first[i : i + 1], of_one, len(rows)))
    return result


def _put_block(result: Field, rows: Index, stride: int, block: Field) -> None:
    """Set the forms (parts, entries, ...) of the parameters ``rows``, -1 for none; ``stride`` leads from part to part
    where entries follow each other, and is 0 elsewhere.
    """
    if not stride:
        requested = rows >= 0
        result[rows[requested]] = block[requested]
        return
    first, (count, width) = int(rows[0, 0]), rows.shape
    if first + count * stride <= len(result):
        result[first : first + count * stride].reshape(count, stride, *block.shape[2:])[:, :width] = block
        return
    step, *inner = result.strides
    shape = (count, width, *block.shape[2:])
    np.lib.stride_tricks.as_strided(result[first:], shape, (stride * step, step, *inner))[:] = block


def _tail(left: Fields, right: Fields | None) -> tuple[int, ...]:
    pair = (left,) if right is None else (left, right)
    return np.broadcast_shapes(*(array.shape[2:] for side in pair for array in (side.body, side.body_wrench)))


def _acting(first: list[Terms], second: list[Terms] | None) -> list[int] | None:
    """Entries that are not zero for all parts, as planar mechanisms have many; None where all act."""
    def acts(terms: Terms, other: Terms) -> bool:
        return any((any_nonzero(p) and any_nonzero(a)) or (second is not None and any_nonzero(q) and any_nonzero(b))
                   for (p, q), (b, a) in zip(terms, other, strict=True))  # fmt: skip

    pairs = zip(first, first if second is None else second, strict=True)
    coupled = [i for i, (terms, other) in enumerate(pairs) if terms and other and acts(terms, other)]
    return None if len(coupled) == len(first) else coupled


def _block(first: list[Terms], second: list[Terms] | None, parts: int) -> Field:
    p, q = first[0][0]
    factors = (p, q) if second is None else (p, second[0][0][1], q, second[0][0][0])
    shape = np.broadcast_shapes(*(factor.shape[1:] for factor in factors))
    result: Field = np.empty((parts, len(first), *shape), dtype=np.result_type(*factors))
    for i, terms in enumerate(first):
        out = result[:, i]
        if second is None:
            np.multiply(*terms[0], out=out)
            for p, q in terms[1:]:
                out += p * q
            continue
        for t, ((p, q), (b, a)) in enumerate(zip(terms, second[i], strict=True)):
            if t:
                out += p * a
            else:
                np.multiply(p, a, out=out)
            out += q * b
    return result
