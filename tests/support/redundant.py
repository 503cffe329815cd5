"""Two joints between the same parts on a common axis, point or direction: redundant as a whole or in part.

What two joints leave free follows from integers, in axes along which the joints are aligned; the mechanism itself is
then turned about a random axis, so that nothing in it rounds as the integers do.
"""

from itertools import product

import numpy as np
from scipy.linalg import eigh, null_space

import mbsvib as mv
from tests.support.random_models import rotation

INERTIA = (0.03, 0.02, 0.04)
DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
STIFFNESS = np.array([50.0, 60.0, 70.0, 5.0, 6.0, 7.0])
PITCH = 0.5
# Relative motions that form a group: what two of them share, with their axes in line, is free in every pose.
GROUPS = {
    "revolute": ("rz",),
    "prismatic": ("z",),
    "cylindrical": ("z", "rz"),
    "screw": ("rz",),
    "spherical": ("rx", "ry", "rz"),
    "planar": ("x", "y", "rz"),
    "fixed": (),
    "in the plane": ("x", "y"),
    "upright": ("x", "y", "z", "rz"),
    "parallel": ("x", "y", "z"),
}
# Others with which it is so, and how far apart along z.
OTHERS = {
    ("universal", "universal"): 0, ("universal", "spherical"): 0, ("spherical", "universal"): 0,
    ("homokinetic", "homokinetic"): 0, ("homokinetic", "spherical"): 0, ("two turns", "two turns"): 0,
    ("two turns and a slide", "two turns and a slide"): 0, ("point_on_line", "point_on_line"): 0,
    ("point_on_line", "revolute"): 1, ("cylindrical", "point_on_line"): 1, ("prismatic", "point_on_line"): 1,
    ("point_on_plane", "point_on_plane"): 0, ("point_on_plane", "planar"): 0, ("point_on_plane", "revolute"): 1,
    ("distance", "distance"): 0, ("revolute", "distance"): 1, ("spherical", "distance"): 0,
}  # fmt: skip
FREE = GROUPS | {
    "two turns": ("rx", "ry"), "two turns and a slide": ("x", "rx", "ry"), "universal": ("rx", "ry"),
    "homokinetic": ("rx", "ry"), "point_on_line": ("z", "rx", "ry", "rz"),
    "point_on_plane": ("x", "y", "rx", "ry", "rz"), "distance": ("x", "y", "rx", "ry", "rz"),
}  # fmt: skip
CUSTOM = ("in the plane", "upright", "parallel", "two turns", "two turns and a slide")
PAIRS = [pair for pair in product(GROUPS, GROUPS) if pair != ("fixed", "fixed")] + list(OTHERS)
# Those that mechanisms are full of.
COMMON = [
    ("revolute", "revolute"), ("prismatic", "prismatic"), ("revolute", "spherical"), ("revolute", "cylindrical"),
    ("cylindrical", "cylindrical"), ("spherical", "spherical"), ("planar", "planar"), ("prismatic", "planar"),
    ("universal", "universal"), ("screw", "cylindrical"),
]  # fmt: skip
ARRANGEMENTS = ("one body", "two bodies on a third", "two bodies in one")
# Sizes and distances from the origin [m].
PLACES = ((1.0, 0.0), (1.0, 1e3), (1e-3, 1.0), (1e3, 1e6), (1e-2, 1e4))


def locked(kind, shift):
    """Rows (force, moment about the origin) that a joint at ``shift`` along its axis locks."""
    rows = []
    for direction, row in zip(DIRECTIONS, np.eye(6), strict=True):
        if direction not in FREE[kind]:
            if kind == "screw" and direction == "z":
                row[5] = -PITCH
            row[3:] += np.cross((0, 0, shift), row[:3])
            rows.append(row)
    return np.array(rows).reshape(-1, 6)


class Pair:
    """A mechanism of two joints in line: one at ``origin``, the other ``shift`` sizes off along the axis, which is the
    third one of ``turn``.
    """

    def __init__(self, kinds, rng, arrangement="one body", place=(1.0, 0.0)):
        self.kinds, self.rng, self.arrangement = kinds, rng, arrangement
        self.size, offset = place
        self.shift = OTHERS[kinds] if kinds in OTHERS else int(rng.integers(2))
        self.turn = rotation(rng)
        self.origin = (self.size + offset) * rng.uniform(-1, 1, size=3)
        self.rows = np.concatenate((locked(kinds[0], 0), locked(kinds[1], self.shift)))
        rank = np.linalg.matrix_rank(self.rows)
        self.redundant, self.dof = len(self.rows) - rank, 6 - rank + (arrangement == "two bodies on a third")
        self.model = model = mv.Model(f"{kinds[0]} and {kinds[1]}, {arrangement}")
        self.center = self.at(0.4, 0.1, 0.2)
        inertia = self.size**2 * np.array(INERTIA)
        model.add_body("door", 2.0, inertia, self.center, orientation=self.turn)
        ends = [("ground", "door"), ("ground", "door")]
        if arrangement == "two bodies on a third":
            model.add_body("frame", 1.0, inertia, self.at(-0.5, 0.1, 0.3))
            at = self.at(*rng.uniform(-1, 1, 3))
            model.add_joint("base", "revolute", "ground", "frame", at, axis=rng.normal(size=3))
            ends = [("frame", "door"), ("frame", "door")]
        elif arrangement == "two bodies in one":
            model.add_body("half", 1.0, inertia, self.at(0.3, -0.2, 0.3))
            model.add_joint("weld", "fixed", "half", "door", self.at(*rng.uniform(-1, 1, 3)))
            ends[1] = ("ground", "half")
        if kinds not in OTHERS and rng.random() < 0.5:
            ends[1] = ends[1][::-1]
        for name, kind, pair, z in zip("ab", kinds, ends, (0, self.shift), strict=True):
            self._add(name, kind, pair, z)
        stiffness = STIFFNESS * self.size ** np.repeat([0.0, 2.0], 3)
        model.add_bushing("k", "ground", "door", self.center, stiffness, orientation=self.turn)

    def at(self, *place):
        """A point of the aligned axes in the world."""
        return self.origin + self.size * self.turn @ np.array(place, dtype=float)

    def _add(self, name, kind, pair, z):
        words = {"pitch": PITCH * self.size} if kind == "screw" else {}
        if kind == "distance":
            # from a point on the axis along z, so that its rows are those of the joint's own axes
            ends = self.at(0, 0, z - 0.75), self.at(0, 0, z)
            self.model.add_joint(name, kind, *pair, *ends[:1], end=ends[1])
            return
        axis = self.turn[:, 2] * self.rng.uniform(0.1, 9.0)
        by_axis = kind in mv.elements.joint.KINDS and kind != "universal" and self.rng.random() < 0.5
        words |= {"axis": axis} if by_axis else {"orientation": self.turn}
        if kind in CUSTOM:
            words["free"] = FREE[kind]
        self.model.add_joint(name, None if kind in CUSTOM else kind, *pair, self.at(0, 0, z), **words)

    def frequencies(self):
        """Angular frequencies of the one body, by the motions that both joints allow."""
        twist = null_space(self.rows, rcond=1e-9)
        arm = self.turn.T @ (self.center - self.origin) / self.size
        moved = np.concatenate((twist[:3] + np.cross(twist[3:].T, arm).T, twist[3:]))
        mass = moved.T @ (np.array([2.0] * 3 + list(INERTIA))[:, None] * moved)
        return np.sqrt(eigh(moved.T @ (STIFFNESS[:, None] * moved), mass, eigvals_only=True))

    def check(self, system):
        """Check the number of degrees of freedom, and that without the redundant rows the loop closes all the same."""
        assert (system.dof, len(system.redundant)) == (self.dof, self.redundant), system.name
        (cut,) = system.cut_joints
        assert all(name.startswith(f"{cut}.") for name in system.redundant)

    def check_names(self, system):
        """Check that the cut joint holds the others' motions as well without the rows that are named as redundant."""
        (cut,) = system.cut_joints
        others = [joint for joint in self.model.joints.values() if joint.name not in (cut, "base")]
        free = [self._at_origin(joint, six, False) for joint in others for _, six in joint.freedom]
        joint = self.model.joints[cut]
        rows = {f"{cut}.{name}": self._at_origin(joint, six, True) for name, six in joint.locked}
        held = [row for name, row in rows.items() if name not in system.redundant]
        free = np.array(free).reshape(-1, 6).T
        moved = [np.array(some).reshape(-1, 6) @ free for some in (held, list(rows.values()))]
        ranks = [np.linalg.matrix_rank(some, tol=1e-5) if some.size else 0 for some in moved]
        assert ranks == [len(held)] * 2, (system.name, system.redundant)

    def _at_origin(self, joint, six, row):
        """A twist of a joint, or a row that it locks, at the origin of the axes and in sizes."""
        first, last = np.array(six[:3]), np.array(six[3:])
        arm = np.zeros(3) if joint.point is None else (np.array(joint.point) - self.origin) / self.size
        if row:
            return np.concatenate((first, last / (1.0 if not first.any() else self.size) + np.cross(arm, first)))
        return np.concatenate((first / (self.size if last.any() else 1.0) - np.cross(last, arm), last))
