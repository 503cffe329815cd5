"""The scenes of the comparison, and what other libraries need to be told of them: plain numbers, body by body.

Every peer gets the bodies, joints and spring-dampers of the same ``mbsvib.Model``, so that nobody solves another
mechanism. Each spring-damper of these scenes acts in a joint: it becomes that joint's stiffness and damping.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mbsvib import library


class Scenes(dict[str, Any]):
    """Scenes by name: (makes the model, what the figure calls it); C and a number is a chain of so many bodies."""

    def __missing__(self, name):
        n = int(name.removeprefix("C"))
        return (lambda: library.chain(n, line=(0, 1, 0)), f"chain, {n} bodies")


SCENES = Scenes({
    "C4": (lambda: library.chain(4, line=(0, 1, 0)), "chain, 4 bodies"),
    "C10": (lambda: library.chain(10, line=(0, 1, 0)), "chain, 10 bodies"),
    "C50": (lambda: library.chain(50, line=(0, 1, 0)), "chain, 50 bodies"),
    "C200": (lambda: library.chain(200, line=(0, 1, 0)), "chain, 200 bodies"),
    "T5": (lambda: library.tree(5), "tree, 31 bodies"),
    "T7": (lambda: library.tree(7), "tree, 127 bodies"),
    "L5": (lambda: library.ladder(5), "ladder, 15 bodies, 5 DOF"),
    "L20": (lambda: library.ladder(20), "ladder, 60 bodies, 20 DOF"),
    "stewart": (library.stewart_isolator, "Stewart, 14 bodies, 12 DOF"),
})  # fmt: skip


@dataclass(frozen=True)
class Rigid:
    """A body: centre of mass [m] and inertia about it [kg m^2], world axes."""

    name: str
    mass: float
    centre: np.ndarray
    inertia: np.ndarray


@dataclass(frozen=True)
class Link:
    """A joint with the spring-damper in it: ``axes`` (columns, world; a revolute's or prismatic's axis is the third),
    ``stiffness`` and ``damping`` (6,) in ``spring_axes``; ``parent`` and ``child`` number the bodies, -1 is ground.
    """

    kind: str
    parent: int
    child: int
    point: np.ndarray
    axes: np.ndarray
    spring_axes: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray

    @property
    def along(self):
        """Axis of the joint, stiffness and damping of its one coordinate (spherical: of each of the three)."""
        at = 2 if self.kind == "prismatic" else 5
        return self.axes[:, 2], float(self.stiffness[at]), float(self.damping[at])


@dataclass(frozen=True)
class Scene:
    """All bodies and links; ``welds`` pairs the bodies that are one in truth (see ``open_tree``)."""

    name: str
    bodies: tuple[Rigid, ...]
    links: tuple[Link, ...]
    welds: tuple[tuple[int, int], ...] = ()


def scene(name):
    """Return a scene by its name, out of the model that mbsvib itself solves."""
    model = SCENES[name][0]()
    number = {"ground": -1} | {body: i for i, body in enumerate(model.bodies)}
    bodies = []
    for body in model.bodies.values():
        xx, yy, zz, xy, xz, yz = body.inertia
        axes = np.array(body.orientation)
        inertia = axes @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ axes.T
        bodies.append(Rigid(body.name, body.mass, np.array(body.position), inertia))
    springs = {(spring.first, spring.second): spring for spring in model.springs.values()}
    links = []
    for joint in model.joints.values():
        spring, axes = springs.pop((joint.first, joint.second)), np.array(joint.axes)
        if hasattr(spring, "line"):
            if joint.kind != "prismatic" or abs(axes[:, 2] @ spring.line) < 1.0 - 1e-12:
                raise ValueError(f"{joint.name}: a line spring has to act along a prismatic joint")
            turn, unit = axes, np.eye(6)[2]
            k, c = unit * spring.stiffness, unit * spring.damping
        else:
            turn, k, c = np.array(spring.orientation), np.array(spring.stiffness), np.array(spring.damping)
        links.append(Link(joint.kind, number[joint.first], number[joint.second], np.array(joint.position), axes, turn,
                          k, c))  # fmt: skip
    if springs:
        raise ValueError(f"spring-dampers without a joint: {', '.join(s.name for s in springs.values())}")
    return Scene(name, tuple(bodies), tuple(links))


def open_tree(closed):
    """Return the scene as a tree, depth first, one link a body, plus welds: for libraries that know only trees.

    A body at which k joints end becomes k bodies of a k-th of its mass and inertia, welded: the same mechanics, and
    every spring-damper stays in a joint of the tree.
    """
    ends = np.bincount([link.child for link in closed.links], minlength=len(closed.bodies))
    outgoing = {}
    for link in closed.links:
        outgoing.setdefault(link.parent, []).append(link)
    place, bodies, links, welds = {-1: -1}, [], [], []
    todo = outgoing[-1][::-1]
    while todo:
        link = todo.pop()
        whole, share = closed.bodies[link.child], ends[link.child]
        here = len(bodies)
        bodies.append(replace(whole, name=f"{whole.name}.{here}", mass=whole.mass / share,
                              inertia=whole.inertia / share))  # fmt: skip
        links.append(replace(link, parent=place[link.parent], child=here))
        if link.child in place:
            welds.append((place[link.child], here))
        else:
            place[link.child] = here
            todo += outgoing.get(link.child, [])[::-1]
    return Scene(closed.name, tuple(bodies), tuple(links), tuple(welds))
