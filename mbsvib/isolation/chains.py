"""Chains of bodies between base and platform: what of a leg goes with which end, and what makes it none."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.elements import Bushing, Joint, Maxwell, Spring
from mbsvib.errors import ModelError

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from mbsvib.api.model import Model
    from mbsvib.common.arrays import Array

    Connection = Bushing | Joint | Maxwell | Spring

ALONG = ("prismatic", "cylindrical", "screw", "point_on_line")  # slide along their axis
STRAIGHT = 1e-6  # sine of the angle between a slide and its leg
SAME = 1e-9  # distance, in parts of a leg's length, of points that are one


@dataclass(frozen=True, slots=True)
class Leg:
    """A leg with its ``bodies``, from ``start`` on the base to ``end`` on the platform, (3,) each [m].

    ``points`` are its positions by the names that their parameters begin with, and their ``shares``: 0 goes with the
    start, 1 with the end, what is between them keeps its share of the length. ``turned`` are orientations, likewise.
    """

    name: str
    bodies: tuple[str, ...]
    start: Array
    end: Array
    points: Mapping[str, Array]
    shares: Mapping[str, float]
    turned: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Chain:
    """Bodies that hang together without ``base`` and ``platform``, and all that connects them, also to these."""

    bodies: tuple[str, ...]
    connections: tuple[Connection, ...]
    base: str
    platform: str

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of all that it is made of."""
        return (*self.bodies, *(part.name for part in self.connections))

    @property
    def name(self) -> str:
        """What its parts' names begin with."""
        common = {name.split(".")[0] for name in self.parts}
        return common.pop() if self.bodies and len(common) == 1 else self.parts[0]

    @property
    def whole(self) -> bool:
        """Whether it leads from base to platform, and is held by the ground nowhere else."""
        return not self.missing() and "ground" not in self.bodies

    def missing(self) -> list[str]:
        """Which of base and platform it does not reach."""
        reached = {end for part in self.connections for end in (part.first, part.second)}
        return [end for end in (self.base, self.platform) if end not in reached]

    def leg(self, model: Model) -> Leg:
        """Return what of it goes with which end.

        Parameters
        ----------
        model : Model
            The mechanism.

        Returns
        -------
        Leg
            Its ends, points and orientations.

        Raises
        ------
        ModelError
            If it has not two ends, is not straight, does not slide, or has parts that would not follow.
        """
        who = f"platform: leg '{self.name}'"
        self._refuse_odd(model, who)
        start, end = self._end(self.base, who), self._end(self.platform, who)
        line, size = end - start, max(np.abs(start).max(), np.abs(end).max())
        length = float(np.linalg.norm(line))
        if length <= SAME * size:
            raise ModelError(f"{who}: it has no length, as both of its ends are at {_said(start)} m.",
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
        turned = [name for name in self.bodies if any(model.bodies[name].inertia)]
        turned += [part.name for part in self.connections if isinstance(part, Bushing)
                   or (isinstance(part, Joint) and part.kind not in ("spherical", "distance"))]  # fmt: skip
        names = tuple([f"{name}.orientation" for name in turned])
        return Leg(self.name, self.bodies, start, end, points, shares, names)

    def _end(self, at: str, who: str) -> Array:
        """Where it is held at its one end."""
        every = [(part, _point(part, at)) for part in self.connections]
        found = {part.name: np.array(point) for part, point in every if point is not None and not _slides(part)} or {
            part.name: np.array(point) for part, point in every if point is not None}  # fmt: skip
        if not found:
            names = [part.name for part in self.connections if at in (part.first, part.second)]
            raise ModelError(f"{who}: joint '{names[0]}' has no position, so that the leg has no end at '{at}'; give "
                             f"its position, where leg and '{at}' meet.", element=names[0], field="legs")  # fmt: skip
        (name, point), *others = found.items()
        for other, place in others:
            if not same(place, point):
                raise ModelError(f"{who}: '{at}' holds it at two points, {_said(point)} m by '{name}' and "
                                 f"{_said(place)} m by '{other}'; expected a chain with one end there.",
                                 element=other, field="legs")  # fmt: skip
        return point

    def _refuse_odd(self, model: Model, who: str) -> None:
        """Refuse legs with parts that would not follow."""
        strange = [name for name in self.bodies if name not in model.bodies]
        if strange:
            raise ModelError(f"{who}: '{strange[0]}' belongs to a beam or superelement, which does not follow the ends "
                             f"of a leg; expected rigid bodies.", element=strange[0], field="legs")  # fmt: skip
        for part in (*model.loads.values(), *model.rotors.values()):
            on = part.words()["body"]
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
                    raise ModelError(f"{who}: '{part.name}' slides along {_said(axis)}, which is not the line from end "
                                     f"to end, {_said(along)}.", element=part.name, field="legs")  # fmt: skip

    def _shares(self, model: Model, start: Array, per_length: Array, who: str) -> dict[str, float]:
        """The share of the leg's length that each body has."""
        slides = {frozenset((part.first, part.second)) for part in self.connections if _slides(part)}
        held = [(part.first, part.second) for part in self.connections
                if (isinstance(part, Joint) and not _slides(part))
                or (isinstance(part, Bushing) and frozenset((part.first, part.second)) not in slides)]  # fmt: skip
        below, above = (_reached([end], held, self.bodies) for end in (self.base, self.platform))
        result: dict[str, float] = {}
        for name in self.bodies:
            if name in below and name in above:
                raise ModelError(f"{who}: its body '{name}' goes with both ends, as nothing between them slides; "
                                 f"expected a joint along the leg that does.", element=name, field="legs")  # fmt: skip
            if name not in result:
                group = _reached([name], held, self.bodies) - {self.base, self.platform}
                centre = np.mean([model.bodies[each].position for each in group], axis=0)
                share = 0.0 if name in below else 1.0 if name in above else float((centre - start) @ per_length)
                result.update(dict.fromkeys(group, share))
        return result


def chains_between(model: Model, body: str, base: str) -> list[Chain]:
    """What lies between two bodies: all that hangs together without them, and line springs and rods from one to the
    other.
    """
    every: list[Connection] = [*model.joints.values(), *model.springs.values()]
    ends = (base, body)
    between = [part for part in every if part.first not in ends or part.second not in ends]
    pairs = [(part.first, part.second) for part in between]
    inner = dict.fromkeys(name for pair in pairs for name in pair if name not in ends)
    result, seen = [], set[str]()
    for name in inner:
        if name not in seen:
            group = _reached([name], pairs, inner)
            seen |= group
            members = tuple([each for each in inner if each in group])
            those = tuple([part for part in between if part.first in members or part.second in members])
            result.append(Chain(members, those, base, body))
    lines = [part for part in every if {part.first, part.second} == {base, body} and len(_fields(part)) == 2]
    return [*result, *(Chain((), (part,), base, body) for part in lines)]


def _reached(starts: list[str], pairs: Iterable[tuple[str, str]], through: Iterable[str]) -> set[str]:
    """What pairs lead to, stepping on nothing but some bodies."""
    known, allowed, edges = set(starts), set(through), list(pairs)
    todo = list(starts)
    while todo:
        here = todo.pop()
        for first, second in edges:
            for one, other in ((first, second), (second, first)):
                if one == here and other not in known:
                    known.add(other)
                    todo += [other] if other in allowed else []
    return known


def _slides(part: Connection) -> bool:
    """Whether it is a joint that lets a leg change its length."""
    if not isinstance(part, Joint) or part.kind == "distance":
        return False
    return part.kind == "screw" or any(name in "xyz" for name, _ in part.freedom)


def _fields(part: Connection) -> list[tuple[str, str]]:
    """Points of a connection, and the body that each goes with."""
    if isinstance(part, (Spring, Maxwell)):
        return [("start", part.first), ("end", part.second)]
    if isinstance(part, Joint) and part.end is not None:
        return [("position", part.first), ("end", part.second)]
    return [] if part.position is None else [("position", part.first)]


def _point(part: Connection, at: str) -> tuple[float, ...] | None:
    """Where a connection holds a body, if it does."""
    fields = _fields(part)
    if at not in (part.first, part.second) or not fields:
        return None
    return tuple(getattr(part, {body: field for field, body in fields}.get(at, fields[0][0])))


def same(one: Array, other: Array) -> bool:
    """Return whether two points are one."""
    return bool(np.linalg.norm(one - other) <= SAME * max(np.abs(one).max(), np.abs(other).max()))


def _said(vector: Array) -> str:
    return "(" + ", ".join(f"{x:.6g}" for x in vector) + ")"
