"""Legs between base and platform: chains of bodies, the parts that move with each end, and parallel springs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from mbsvib.api.model import Model
from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array
from mbsvib.common.expected import names
from mbsvib.common.patterns import matching
from mbsvib.elements import Bushing, Joint, Spring
from mbsvib.elements.connection import Connection
from mbsvib.errors import ModelError

ALONG = ("prismatic", "cylindrical", "screw", "point_on_line")  # slide along their axis
STRAIGHT = 1e-6  # sine of the angle between a slide and its leg
SAME = 1e-9  # distance, in parts of a leg's length, of points that are one


@dataclass(frozen=True, slots=True)
class Leg:
    """A leg with its ``bodies``, from ``start`` on the base to ``end`` on the platform, (3,) each [m].

    ``points`` are its positions by the prefixes of their parameters, and their ``shares``: 0 moves with the start, 1
    with the end, others keep their share of the length. ``orientations`` are the prefixes of its orientations.
    """

    name: str
    bodies: tuple[str, ...]
    start: Array
    end: Array
    points: Mapping[str, Array]
    shares: Mapping[str, float]
    orientations: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Chain:
    """Bodies that are connected without ``base`` and ``platform``, and their connections, also to these."""

    bodies: tuple[str, ...]
    connections: tuple[Connection | Joint, ...]
    base: str
    platform: str

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of all its parts."""
        return (*self.bodies, *(part.name for part in self.connections))

    @property
    def name(self) -> str:
        """The common prefix of its parts' names."""
        common = {name.split(".")[0] for name in self.parts}
        return common.pop() if self.bodies and len(common) == 1 else self.parts[0]

    @property
    def complete(self) -> bool:
        """Whether it connects base and platform, and has no other connection to ground."""
        return not self.missing() and "ground" not in self.bodies

    def missing(self) -> list[str]:
        """Which of base and platform it is not connected to."""
        reached = {end for part in self.connections for end in (part.first, part.second)}
        return [end for end in (self.base, self.platform) if end not in reached]

    def leg(self, model: Model) -> Leg:
        """Return the leg, with the parts that move with each end."""
        who = f"platform: leg '{self.name}'"
        self._refuse_odd(model, who)
        start, end = self._end(self.base, who), self._end(self.platform, who)
        line, size = end - start, max(np.abs(start).max(), np.abs(end).max())
        length = float(np.linalg.norm(line))
        if length <= SAME * size:
            raise ModelError(f"{who}: it has no length, as both of its ends are at {_text(start)} m.",
                             element=self.name, field="legs")  # fmt: skip
        self._refuse_bent(line / length, who)
        share = {self.base: 0.0, self.platform: 1.0} | self._shares(model, start, line / length**2, who)
        points, shares = {}, {}
        for name in self.bodies:
            points[f"{name}.position"], shares[f"{name}.position"] = np.array(model.bodies[name].position), share[name]
        for part in self.connections:
            for field, body in _fields(part):
                points[f"{part.name}.{field}"] = np.array(getattr(part, field))
                shares[f"{part.name}.{field}"] = share[body]
        oriented = [name for name in self.bodies if any(model.bodies[name].inertia)]
        oriented += [part.name for part in self.connections if isinstance(part, Bushing)
                     or (isinstance(part, Joint) and part.kind not in ("spherical", "distance"))]  # fmt: skip
        names = tuple([f"{name}.orientation" for name in oriented])
        return Leg(self.name, self.bodies, start, end, points, shares, names)

    def _end(self, at: str, who: str) -> Array:
        """The point at which a body, base or platform, is connected to it."""
        located = [(part, _point(part, at)) for part in self.connections]
        points = {part.name: np.array(point) for part, point in located if point is not None and not _slides(part)} or {
            part.name: np.array(point) for part, point in located if point is not None}  # fmt: skip
        if not points:
            names = [part.name for part in self.connections if at in (part.first, part.second)]
            raise ModelError(f"{who}: joint '{names[0]}' has no position, so that the leg has no end at '{at}'; give "
                             f"its position, where leg and '{at}' meet.", element=names[0], field="legs")  # fmt: skip
        (name, point), *others = points.items()
        for other_name, other_point in others:
            if not _same(other_point, point):
                raise ModelError(f"{who}: '{at}' holds it at two points, {_text(point)} m by '{name}' and "
                                 f"{_text(other_point)} m by '{other_name}'; expected a chain with one end there.",
                                 element=other_name, field="legs")  # fmt: skip
        return point

    def _refuse_odd(self, model: Model, who: str) -> None:
        """Refuse legs with parts that cannot follow."""
        strange = [name for name in self.bodies if name not in model.bodies]
        if strange:
            raise ModelError(f"{who}: '{strange[0]}' belongs to a beam or superelement, which does not follow the ends "
                             f"of a leg; expected rigid bodies.", element=strange[0], field="legs")  # fmt: skip
        for part in (*model.loads.values(), *model.rotors.values()):
            on = part.constructor_kwargs()["body"]
            if on in self.bodies:
                raise ModelError(f"{who}: '{part.name}' on its body '{on}' keeps its direction when the leg turns; "
                                 f"leave it out.", element=part.name, field="legs")  # fmt: skip
        for part in self.connections:
            if isinstance(part, Spring) and part.free_length is not None:
                raise ModelError(f"{who}: spring '{part.name}' has a free length, so that it would be loaded where the "
                                 f"leg gets longer; give its preload instead.", element=part.name,
                                 field="free_length")  # fmt: skip

    def _refuse_bent(self, along: Array, who: str) -> None:
        for part in self.connections:
            if isinstance(part, Joint) and part.kind in ALONG:
                axis = np.array(part.axes)[:, 2]
                if np.linalg.norm(np.cross(axis, along)) > STRAIGHT:
                    raise ModelError(f"{who}: '{part.name}' slides along {_text(axis)}, which is not the line from end "
                                     f"to end, {_text(along)}.", element=part.name, field="legs")  # fmt: skip

    def _shares(self, model: Model, start: Array, per_length: Array, who: str) -> dict[str, float]:
        """The share of the leg's length that each body has."""
        slides = {frozenset((part.first, part.second)) for part in self.connections if _slides(part)}
        rigid_pairs = [(part.first, part.second) for part in self.connections
                if (isinstance(part, Joint) and not _slides(part))
                or (isinstance(part, Bushing) and frozenset((part.first, part.second)) not in slides)]  # fmt: skip
        below, above = (_reached([end], rigid_pairs, self.bodies) for end in (self.base, self.platform))
        result: dict[str, float] = {}
        for name in self.bodies:
            if name in below and name in above:
                raise ModelError(f"{who}: its body '{name}' goes with both ends, as nothing between them slides; "
                                 f"expected a joint along the leg that does.", element=name, field="legs")  # fmt: skip
            if name not in result:
                group = _reached([name], rigid_pairs, self.bodies) - {self.base, self.platform}
                centre = np.mean([model.bodies[member].position for member in group], axis=0)
                share = 0.0 if name in below else 1.0 if name in above else float((centre - start) @ per_length)
                result.update(dict.fromkeys(group, share))
        return result


def legs_between(model: Model, body: str, base: str, patterns: Sequence[str] | None) -> tuple[Leg, ...]:
    """Return the legs between two bodies.

    ``body``, ``base``: the supported body, and the body that carries the legs. ``patterns``: names or patterns of
    parts, one or more of each leg. Default: every chain between both.
    """
    chains = _chains_between(model, body, base)
    if patterns is None:
        selected = [chain for chain in chains if chain.complete]
    else:
        selected = _picked(chains, names(patterns, "platform", "legs", ModelError))
    if not selected:
        raise ModelError(f"platform: no leg leads from '{base}' to '{body}': expected line springs or chains of rigid "
                         f"bodies and joints between both.", element=body, field="body")  # fmt: skip
    result: list[Leg] = []
    for leg in (chain.leg(model) for chain in selected):
        if not _joined(result, leg):
            result.append(leg)
    for chain in chains:
        if chain.complete and chain not in selected:
            with suppress(ModelError):  # chains that are not legs are ignored
                _joined(result, chain.leg(model))
    return tuple(result)


def _picked(chains: list[Chain], patterns: Iterable[str]) -> list[Chain]:
    picked: list[Chain] = []
    known = [name for chain in chains for name in chain.parts]
    for pattern in patterns:
        found = set(matching(pattern, known))
        these = [chain for chain in chains if any(name in found for name in chain.parts)]
        if not these:
            raise check.unknown(pattern, known, f"platform: legs: no part of a leg is named '{pattern}'", "legs", "")
        for chain in these:
            for end in chain.missing():
                raise ModelError(f"platform: leg '{chain.name}': it does not reach '{end}'; expected a chain of bodies "
                                 f"and joints from '{chain.base}' to '{chain.platform}'.",
                                 element=chain.name, field="legs")  # fmt: skip
            if not chain.complete:
                raise ModelError(f"platform: leg '{chain.name}': it is held by the ground too; expected a chain from "
                                 f"'{chain.base}' to '{chain.platform}' alone.", element=chain.name,
                                 field="legs")  # fmt: skip
        picked += [chain for chain in these if chain not in picked]
    return [chain for chain in chains if chain in picked]


def _joined(legs: list[Leg], added: Leg) -> bool:
    """Merge a leg with one of several that has the same ends, such as parts of relaxation elements; tell if done."""
    for i, leg in enumerate(legs):
        if _same(leg.start, added.start) and _same(leg.end, added.end):
            legs[i] = replace(leg, bodies=leg.bodies + added.bodies, points={**leg.points, **added.points},
                              shares={**leg.shares, **added.shares},
                              orientations=leg.orientations + added.orientations)  # fmt: skip
            return True
    return False


def _chains_between(model: Model, body: str, base: str) -> list[Chain]:
    """Chains between two bodies: bodies that are connected without them, and line springs and rods between the two."""
    connections: list[Connection | Joint] = [*model.joints.values(), *model.springs.values()]
    ends = (base, body)
    between = [part for part in connections if part.first not in ends or part.second not in ends]
    pairs = [(part.first, part.second) for part in between]
    bodies_between = dict.fromkeys(name for pair in pairs for name in pair if name not in ends)
    result, visited = [], set[str]()
    for name in bodies_between:
        if name not in visited:
            group = _reached([name], pairs, bodies_between)
            visited |= group
            members = tuple([member for member in bodies_between if member in group])
            those = tuple([part for part in between if part.first in members or part.second in members])
            result.append(Chain(members, those, base, body))
    lines = [part for part in connections if {part.first, part.second} == {base, body} and len(_fields(part)) == 2]
    return [*result, *(Chain((), (part,), base, body) for part in lines)]


def _reached(starts: list[str], pairs: Iterable[tuple[str, str]], through: Iterable[str]) -> set[str]:
    """Bodies that can be reached by pairs, through some bodies only."""
    reached, allowed, edges = set(starts), set(through), list(pairs)
    todo = list(starts)
    while todo:
        current = todo.pop()
        for first, second in edges:
            for start, end in ((first, second), (second, first)):
                if start == current and end not in reached:
                    reached.add(end)
                    todo += [end] if end in allowed else []
    return reached


def _slides(part: Connection | Joint) -> bool:
    """Whether it is a joint that allows a change of the leg's length."""
    if not isinstance(part, Joint) or part.kind == "distance":
        return False
    return part.kind == "screw" or any(name in "xyz" for name, _ in part.freedom)


def _fields(part: Connection | Joint) -> list[tuple[str, str]]:
    """Points of a connection, and the body of each."""
    return list(zip(part.point_fields, (part.first, part.second), strict=False))


def _point(part: Connection | Joint, at: str) -> tuple[float, ...] | None:
    """The point of a connection on a body, or None."""
    fields = _fields(part)
    if at not in (part.first, part.second) or not fields:
        return None
    return tuple(getattr(part, {body: field for field, body in fields}.get(at, fields[0][0])))


def _same(first: Array, second: Array) -> bool:
    """Return whether two points coincide."""
    return bool(np.linalg.norm(first - second) <= SAME * max(np.abs(first).max(), np.abs(second).max()))


def _text(vector: Array) -> str:
    return "(" + ", ".join(f"{x:.6g}" for x in vector) + ")"
