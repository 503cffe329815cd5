"""Loops beside the tree of a URDF file: what joins two of its links, as one of three dialects says.

- ``<constraint>``, the proposal to urdfdom: two origins and the axis in the parent's constraint frame; of a universal
  one a second axis in the child's.
- URDF+: ``<loop>`` with the kinds of joints of URDF, and ``<coupling>`` with a ratio.
- Extended URDF: a YAML file beside; see ``urdf.extended``.

Source: M. Chignoli, J.-J. Slotine, P. Wensing, S. Kim, URDF+, arXiv 2411.19753.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from os import PathLike
from xml.etree.ElementTree import Element

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array
from mbsvib.errors import ModelError

Frame = tuple[Array, Array]
Numbers = Callable[[Element | None, str, str | None, int, str, str], Array]
Frames = Callable[[Element | None, str, str], Frame]

AXIS = "1 0 0"
# Kinds of joints of the model, by the words of each element; those with an axis.
CONSTRAINTS = {"revolute": "revolute", "prismatic": "prismatic", "universal": "universal", "spherical": "spherical",
               "link": "fixed"}  # fmt: skip
LOOPS = {"revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic", "fixed": "fixed",
         "planar": "planar", "spherical": "spherical"}  # fmt: skip
WITH_AXIS = ("revolute", "prismatic", "universal", "planar")
# Names of the roles, as they should be, with the spellings that writers in the field use.
SPELLINGS = {"predecessor": ("predecesor", "predeccessor"), "successor": ("sucessor", "succesor", "sucesor")}
TAGS = ("constraint", "loop", "coupling")


@dataclass(frozen=True, slots=True, eq=False)
class Loop:
    """Two frames, (point, axes) on the first and on the second of ``links``, and the ``kind`` of joint between them.

    ``axis`` is in the first frame, and in the second one as well but for universal joints, which have ``axis2`` there.
    """

    name: str
    kind: str
    links: tuple[str, str]
    frames: tuple[Frame, Frame]
    axis: Array
    axis2: Array


@dataclass(frozen=True, slots=True)
class Coupling:
    """ratio * sum of the joints that lead to the first link = sum of those to the second, from where both part."""

    name: str
    links: tuple[str, str]
    ratio: float


@dataclass(slots=True, eq=False)
class Reader:
    """Reads elements; ``taken`` lists spellings that were taken as meant."""

    path: str | PathLike[str]
    links: Collection[str]
    numbers: Numbers
    frame: Frames
    taken: list[str]

    def all_of(self, top: Element) -> tuple[tuple[Loop, ...], tuple[Coupling, ...]]:
        """Return all loops and couplings of a file."""
        found = [self._constraint(element) for element in top.findall("constraint")]
        found += [self._loop(element) for element in top.findall("loop")]
        couplings = [self._coupling(element) for element in top.findall("coupling")]
        names = [loop.name for loop in found] + [part.name for part in couplings]
        for name in names:
            if names.count(name) > 1:
                raise ModelError(f"{self.path}: two loops have the name '{name}'.", element=name, field="name")
        return tuple(found), tuple(couplings)

    def _name(self, element: Element) -> tuple[str, str]:
        name = element.get("name", "")
        if not name:
            raise ModelError(f"{self.path}: a <{element.tag}> has no name.", field="name")
        return name, f"{self.path}: {element.tag} '{name}'"

    def _kind(self, element: Element, kinds: dict[str, str]) -> str:
        name, who = self._name(element)
        kind = element.get("type")
        known = kinds.get((kind or "").removesuffix("_joint") if kinds is CONSTRAINTS else kind or "")
        if known is None:
            raise ModelError(f"{who}: type = {kind!r}; expected {', '.join(kinds)}.", element=name, field="type")
        return known

    def _axis(self, element: Element, tag: str) -> Array:
        name, who = self._name(element)
        axis = self.numbers(element.find(tag), "xyz", AXIS, 3, who, name)
        if not axis.any():
            raise ModelError(f"{who}: {tag} = (0, 0, 0) is not a direction.", element=name, field=tag)
        return np.asarray(axis / np.linalg.norm(axis))

    def _end(self, element: Element, role: str) -> tuple[Element, str]:
        name, who = self._name(element)
        for tag in (role, *SPELLINGS.get(role, ())):
            end = element.find(tag)
            if end is not None:
                break
        else:
            raise ModelError(f"{who}: has no <{role} link=...>.", element=name, field=role)
        if tag != role:
            self.taken.append(f"<{tag}> of '{name}' as <{role}>")
        link = end.get("link")
        if link is None and end.get("name") is not None:
            link = end.get("name")
            self.taken.append(f"name= of <{tag}> of '{name}' as link=")
        check.known(link, self.links, f"{who}: {role} = {link!r} is not a link", role, "", element=name)
        return end, str(link)

    def _constraint(self, element: Element) -> Loop:
        name, who = self._name(element)
        kind = self._kind(element, CONSTRAINTS)
        self._only(element, ("parent", "child", "parent_origin", "child_origin", "parent_axis", "child_axis"))
        links = self._end(element, "parent")[1], self._end(element, "child")[1]
        frames = [self.frame(element.find(f"{role}_origin"), who, name) for role in ("parent", "child")]
        axis = self._axis(element, "parent_axis") if kind in WITH_AXIS else np.array((1.0, 0.0, 0.0))
        axis2 = self._axis(element, "child_axis") if kind == "universal" else axis
        return Loop(name, kind, links, (frames[0], frames[1]), axis, axis2)

    def _loop(self, element: Element) -> Loop:
        name, who = self._name(element)
        kind = self._kind(element, LOOPS)
        self._only(element, ("axis", *self._roles()))
        ends = [self._end(element, role) for role in SPELLINGS]
        frames = [self.frame(end.find("origin"), who, name) for end, _ in ends]
        axis = self._axis(element, "axis") if kind in WITH_AXIS else np.array((1.0, 0.0, 0.0))
        return Loop(name, kind, (ends[0][1], ends[1][1]), (frames[0], frames[1]), axis, axis)

    def _coupling(self, element: Element) -> Coupling:
        name, who = self._name(element)
        self._only(element, ("ratio", *self._roles()))
        ratio = float(self.numbers(element.find("ratio"), "value", None, 1, who, name)[0])
        if ratio == 0.0:
            raise ModelError(f"{who}: ratio = 0; expected another number.", element=name, field="ratio")
        return Coupling(name, (self._end(element, "predecessor")[1], self._end(element, "successor")[1]), ratio)

    @staticmethod
    def _roles() -> list[str]:
        return [tag for role, others in SPELLINGS.items() for tag in (role, *others)]

    def _only(self, element: Element, known: Collection[str]) -> None:
        """Refuse elements within that are not understood: they may change what is joined, or how."""
        name, who = self._name(element)
        for part in element:
            if part.tag not in known:
                raise ModelError(f"{who}: <{part.tag}> is not understood; expected {', '.join(known)}.", element=name,
                                 field=part.tag)  # fmt: skip
