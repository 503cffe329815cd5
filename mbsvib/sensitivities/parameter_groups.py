"""Plans: parameters grouped into families that one rule holds for, whichever motions they are asked for."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.elements import Joint, Maxwell
from mbsvib.elements.beam import Beam
from mbsvib.elements.coupler import Coupling
from mbsvib.linalg.vectors import product
from mbsvib.sensitivities.adjoint_fields import onto
from mbsvib.sensitivities.beams import beam_rule
from mbsvib.sensitivities.couplers import coupler_rule
from mbsvib.sensitivities.factors import constants, moved_floating, rule
from mbsvib.sensitivities.matrix_derivatives import Whole
from mbsvib.sensitivities.maxwell import maxwell_rule
from mbsvib.sensitivities.variables import Direction
from mbsvib.sensitivities.variants import not_held

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray
    from scipy.sparse import csr_array

    from mbsvib.common.arrays import Array, Index
    from mbsvib.mechanism.parameters import Parameter
    from mbsvib.sensitivities.balance.balanced import Balanced
    from mbsvib.sensitivities.factors import Rule
    from mbsvib.sensitivities.network import Network
    from mbsvib.sensitivities.variables import Variables

# Parts whose entries have rules of their own, one by one.
_SINGLE: dict[str, Callable[..., Rule]] = {"coupler": coupler_rule, "maxwell": maxwell_rule}
# Fields of springs that say what force they have at the pose, and are no part of K by themselves.
FORCES = ("preload", "free_length")
_PAIR = {pair: n for n, pair in enumerate((i, j) for i in range(6) for j in range(i, 6))}


@dataclass(frozen=True, slots=True)
class Family:
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


@dataclass(frozen=True)
class Plan:
    """The variables asked for and the families of the parameters that they move.

    Where these go through an equilibrium, the parameters are all there are of ``balanced``: variables move them at
    ``rates`` (variables, parameters), None one by one, and the pose by ``motion`` (variables, c), those ``lost`` along
    one that nothing holds. ``every`` says that these are all parameters, of which some may have no derivative.
    """

    network: Network
    variables: Variables
    families: tuple[Family | Whole, ...]
    balanced: Balanced | None = None
    rates: csr_array | None = None
    motion: Array | None = None
    lost: NDArray[np.bool_] | None = None
    every: bool = False

    @cached_property
    def breaking(self) -> NDArray[np.bool_]:
        """Which parameters, changed alone, take degrees of freedom away."""
        from mbsvib.sensitivities.products import breaking

        return breaking(self)

    @property
    def unsymmetric(self) -> bool:
        """Whether derivatives of K may have an antisymmetric part where K has none, as those to torques have."""
        if self.balanced is not None:
            return bool(self.balanced.forces.counts[3])
        return self.whole is not None and not self.whole.symmetric

    @property
    def size(self) -> int:
        """Number of rows that forms have: parameters and directions, and behind them what moves the pose."""
        if self.balanced is not None:
            return self.balanced.size
        return len(self.variables.parameters) + len(self.variables.directions)

    def chain(self, values: Any) -> Any:
        """Turn derivatives to the parameters (size, ...) into those to the variables (variables, ...), not a number
        where a parameter, changed alone, takes degrees of freedom away; ``values`` may be used up.
        """
        broken = self.breaking
        if self.balanced is None or self.motion is None or self.lost is None:
            values[broken] = np.nan
            return self.variables.chain(values)
        count = len(self.variables.parameters)
        own = values[:count]
        moved = product(self.balanced.carried.T, own)
        moved += values[count:]
        result = product(self.motion, moved)
        result += own if self.rates is None else onto(self.rates, own)
        asked = self.variables.rates
        result[self.lost | (broken[:count] if asked is None else abs(asked) @ broken[:count] > 0.0)] = np.nan
        return result

    def only(self, kind: str, *fields: str) -> tuple[Family, ...]:
        """Return the families of parts of one kind, or of some of their fields."""
        return tuple(each for each in self.families if isinstance(each, Family) and each.kind == kind
                     and (not fields or each.field in fields))  # fmt: skip

    @cached_property
    def beside(self) -> Mapping[str, Array]:
        """Derivatives of whole matrices to the variables, for outputs that are no motions and no forces in springs."""
        return self.network.variants.slopes(self.variables.each(), self.every)

    @cached_property
    def whole(self) -> Whole | None:
        """The parameters whose derivatives are whole matrices, if there are any."""
        return next((each for each in self.families if isinstance(each, Whole)), None)


def plan(network: Network, asked: Variables, every: bool = False) -> Plan:
    """Return a plan for the derivatives to some variables.

    Parameters
    ----------
    network : Network
        Bodies and connections.
    asked : Variables
        What changes.
    every : bool
        Whether all parameters are asked for, of which some may have no derivative.

    Returns
    -------
    Plan
        Families of parameters.

    Raises
    ------
    ModelError
        If the equations do not change smoothly with a parameter, or it loads a motion that nothing holds.
    """
    parts = _parts(network)
    rule: dict[tuple[str, str], bool] = {}
    for parameter in asked.parameters:
        own = (parameter.part, parameter.field)
        if own not in rule:
            rule[own] = _has_rule(network, parameter, parts.get(parameter.part))
    without = np.array([not rule[each.part, each.field] for each in asked.parameters], dtype=np.bool_)
    if without.any() and network.balanced is not None and (
            network.described is None or all(map(network.described.tells, asked.parameters))):  # fmt: skip
        return _through_equilibrium(network, network.balanced, asked, every)
    if without.any() and not asked.identity:
        asked = asked.joined(without)
        whole, directions = len(asked.parameters) + np.arange(len(asked.directions)), asked.directions
    else:
        whole = np.flatnonzero(without)
        directions = tuple(Direction(name, ((name, 1.0),)) for name in (asked.parameters[k].name for k in whole))
    own_rules = [(place, each) for place, each in enumerate(asked.parameters) if rule[each.part, each.field]]
    families: list[Family | Whole] = [*_families(network, parts, own_rules)]
    if directions:
        families.append(Whole(whole[:, None], network.variants.slopes(directions, every)))
    return Plan(network, asked, tuple(families), every=every)


def _through_equilibrium(network: Network, balanced: Balanced, asked: Variables, every: bool) -> Plan:
    """A plan for variables that move the pose."""
    asked, found = asked.among(balanced.entries), network.described
    rates = asked.rates
    if found is not None:
        moved = (found.rates, found.forces, found.gaps)
        rates, forces, gaps = moved if rates is None else tuple(rates @ each for each in moved)
        apart = gaps.toarray().reshape(len(asked.names), len(network.joints), 6)
        balanced = balanced.following(apart.transpose(1, 2, 0), forces)
    motion, lost = balanced.follow(rates)
    if lost.any() and not every:
        raise not_held(asked.names[int(np.argmax(lost))], network.variants.system.name)
    return Plan(network, asked, balanced.families, balanced, rates, motion, lost, every)


def families_of(network: Network, entries: Sequence[Parameter]) -> tuple[Family, ...]:
    """Return the families of parameters as if all of them acted by what their own parts do alone.

    Parameters
    ----------
    network : Network
        Bodies and connections.
    entries : sequence of Parameter
        The parameters.

    Returns
    -------
    tuple of Family
        Families of those that have a rule.
    """
    parts = _parts(network)
    return tuple(_families(network, parts, [(place, each) for place, each in enumerate(entries) if each.part in parts
                                            and each.field not in FORCES]))  # fmt: skip


def _parts(network: Network) -> dict[str, tuple[str, int, Any]]:
    """Kind, number and part of each name."""
    joints = len(network.joints)
    parts: dict[str, tuple[str, int, Any]] = {}
    for kind, shift, members in (("body", 0, network.bodies), ("joint", 0, network.joints),
                                 ("spring", joints, network.springs)):  # fmt: skip
        parts.update((part.name, (kind, shift + i, part)) for i, part in enumerate(members))
    if not network.bare:
        parts.update((part.name, ("beam", i, part)) for i, part in enumerate(network.parts) if isinstance(part, Beam))
        for kind, what in (("coupler", Coupling), ("maxwell", Maxwell)):
            parts.update((part.name, (kind, i, part)) for i, part in enumerate(network.parts) if isinstance(part, what))
    return parts


def _families(
    network: Network, parts: dict[str, tuple[str, int, Any]], members: Sequence[tuple[int, Parameter]]
) -> list[Family]:
    groups: dict[tuple[Any, ...], list[tuple[int, int, int]]] = {}
    for place, parameter in members:
        kind, number, part = parts[parameter.part]
        index = parameter.index
        slot = 0 if not index else index[0] if len(index) == 1 else _PAIR[index[0], index[1]]
        apart = (isinstance(part, Joint) and part.end is not None) or (
            kind == "body" and parameter.field == "position" and number in network.floating)  # fmt: skip
        own: Any = number if kind == "beam" else (number, index) if kind in _SINGLE else type(part)
        key = (kind, parameter.field, own, len(index), apart)
        groups.setdefault(key, []).append((place, number, slot))
    return [_family(network, key, found) for key, found in groups.items()]


def _has_rule(network: Network, parameter: Parameter, known: tuple[str, int, Any] | None) -> bool:
    """Whether a parameter acts by what its own part does alone."""
    if known is None or parameter.field in FORCES:
        return False
    # the tension of a spring with a free length comes from its stiffness
    pulls = parameter.field == "stiffness" and getattr(known[2], "free_length", None) is not None
    return all((known[0], parameter.field) in limit and not pulls for limit in network.limits)


def _family(network: Network, key: tuple[Any, ...], members: list[tuple[int, int, int]]) -> Family:
    kind, field, _, depth, apart = key
    if kind in _SINGLE or kind == "beam":
        place, index, _ = members[0]
        part: Any = network.parts[index]
        own = beam_rule(network, part, field) if kind == "beam" else _SINGLE[kind](network, part, field, key[2][1])
        return Family(kind, field, np.zeros(1, dtype=np.intp), own, (), np.array([[place]]), 0)
    table = np.array(members, dtype=np.intp)
    number, inverse = np.unique(table[:, 1], return_inverse=True)
    known: Any = network.bodies if kind == "body" else network.joints + network.springs
    chosen = [known[i] for i in number.tolist()]
    width = 1 if depth == 0 else 21 if depth == 2 else 6 if field in ("inertia", "stiffness", "damping") else 3
    rows = np.full((len(number), width), -1, dtype=np.intp)
    rows[inverse, table[:, 2]] = table[:, 0]
    if kind == "body" and apart:
        among = (number[:, None] == network.floating).argmax(axis=1)
        return Family(kind, field, number, moved_floating, (among,), rows, _stride(rows))
    return Family(kind, field, number, rule(chosen[0], field), constants(chosen, field), rows, _stride(rows))


def _stride(rows: Index) -> int:
    count, width = rows.shape
    stride = int(rows[1, 0] - rows[0, 0]) if count > 1 else width
    regular = rows[0, 0] + stride * np.arange(count)[:, None] + np.arange(width)
    return stride if stride >= width and rows[0, 0] >= 0 and bool((rows == regular).all()) else 0
