"""Groups of parameters, and bilinear forms x^T (dT/dp) y of their derivatives for many pairs of motions at once.

A group is one field of many parts of a kind, which one rule holds for, whatever motions are asked for. Parameters that
no rule of one part tells have whole matrices as derivatives.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import chain
from math import prod
from operator import itemgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbsvib.common.arrays import Array, Index
from mbsvib.linalg.rank import ZERO_MATRIX_SLOPE
from mbsvib.linalg.vectors import Field
from mbsvib.sensitivities.adjoint_fields import Fields
from mbsvib.sensitivities.families import rules_of
from mbsvib.sensitivities.families.rules import Forms, PartRules, any_field
from mbsvib.sensitivities.local_forms import LocalForm, Shift, summed_products
from mbsvib.sensitivities.network import Network
from mbsvib.sensitivities.variables import FieldLayout, PartFields, indices

# Fields of springs that say what force they have at the pose, and are no part of K by themselves.
FORCES = ("preload", "free_length")
_ONE = np.zeros(1, dtype=np.intp)


@dataclass(frozen=True, slots=True)
class ParameterGroup:
    """One ``field`` of bodies or connections of one ``kind`` (body, joint, spring): their ``number`` (parts,), their
    ``forms``, how bodies go along by ``shifts``, and the parameter in each place of ``rows`` (parts, entries), -1 where
    none was asked for.
    """

    kind: str
    field: str
    number: Index
    forms: tuple[LocalForm, ...]
    shifts: tuple[Shift, ...]
    rows: Index

    @staticmethod
    def of(kind: str, field: str, number: Index, forms: Forms, rows: Index) -> ParameterGroup:
        """Return the group of some parts."""
        return ParameterGroup(kind, field, number, tuple(form for form in forms if isinstance(form, LocalForm)),
                              tuple(form for form in forms if isinstance(form, Shift)), rows)  # fmt: skip

    def block(self, which: slice, left: Fields, right: Fields | None, numbers: int) -> tuple[Any, Field] | None:
        """Return which entries are not zero in all, and their forms (parts, entries, ...) for some of the parts; None
        if all are. The arguments are those of ``LocalForm.products``.
        """
        which_forms = slice(None) if len(self.rows) == 1 else which
        every = [form.products(which_forms, left, right, numbers) for form in self.forms]
        known = [found for found in every if found]
        acts: Any = slice(None)
        if not known:
            return None
        if any(found is None or found[0].shape[2] < len(form.rows)
               for found, form in zip(every, self.forms, strict=True)):  # fmt: skip
            acts = np.flatnonzero(np.any([factor.any(axis=(0, 2)) for factor, _ in known], axis=0))
            known = [(factor[:, acts], products) for factor, products in known]
        parts = [summed_products(factor, products, len(self.rows[which])) for factor, products in known]
        return acts, sum(parts[1:], parts[0])


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
    network: Network, single: Callable[..., Forms], part: Any, fields: PartFields, start: int,
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
                forms = single(network, part, field, index)
                yield ParameterGroup.of(rules_of(part).kind, field, _ONE, forms, np.array([[row]]))


def _of_fields(
    network: Network, fields: PartFields, members: list[tuple[int, int, Any]], number: Index | None
) -> Iterator[ParameterGroup]:
    """The groups of the fields of parts of one class, each with its number, its first entry and the part."""
    numbers, starts, parts = zip(*members, strict=True)
    index, first, rules = np.array(numbers), np.array(starts), rules_of(parts[0])
    assert rules.rule is not None
    for field, _, shift, count in fields.fields:
        rows = first[:, None] + np.arange(shift, shift + count)
        rows = rows if number is None else number[rows]
        if field not in FORCES and (number is None or (rows >= 0).any()):
            yield ParameterGroup.of(rules.kind, field, index, rules.rule(network, parts, index, field), rows)


def internal_groups(network: Network, first: int, gravity: int | None) -> list[ParameterGroup]:
    """Return the groups of numbers that change with the pose and are no parameters, and of gravity where it does more
    than forces.

    ``first``: the row of the first of these numbers; ``gravity``: that of gravity along x, None without gravity.
    """
    groups: list[tuple[str, str, int, Forms]] = []
    for part in network.parts:
        kind, rules = rules_of(part).kind, rules_of(part).loaded
        field, count = rules.internal
        every = rules.internal_forms(network, part)
        groups += [(kind, field, first + k * (count // len(every)), forms) for k, forms in enumerate(every)]
        first += count
    if gravity is not None:
        of_parts = [every for part in network.parts if (every := rules_of(part).loaded.gravity_forms(network, part))]
        of_ways = enumerate(zip(*of_parts, strict=True))
        groups += [("gravity", "", gravity + k, tuple(chain(*forms))) for k, forms in of_ways]
    result = []
    for kind, field, row, forms in groups:
        count = next((form.factor.shape[1] for form in forms if isinstance(form, LocalForm)), 1)
        result.append(ParameterGroup.of(kind, field, _ONE, forms, row + np.arange(count)[None]))
    return result


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
        step = max(1, BLOCK // max(1, numbers * max([width, *(len(form.rows) for form in group.forms)])))
        for start in range(0, count, step):
            known = group.block(slice(start, start + step), left, right, numbers)
            if known is not None:
                acts, block = known
                rows = group.rows[start : start + step, acts]
                requested = rows >= 0
                result[rows if requested.all() else rows[requested]] = block if requested.all() else block[requested]
    return result


def _tail(left: Fields, right: Fields | None) -> tuple[int, ...]:
    pair = (left,) if right is None else (left, right)
    return np.broadcast_shapes(*(array.shape[2:] for side in pair for array in (side.body, side.body_wrench)))
