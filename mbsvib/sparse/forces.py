"""Forces in joints, and all forces on a body or the ground, as outputs of many bodies.

A force in a joint is the work that all else does, inertia included, in a motion in which the joint gives way along it:
all that hangs behind moves as one body, and where loops cross the joint their coordinates follow so that no other
constraint is broken. Where constraints are redundant none gives way alone; the motion then breaks them as little as can
be, which makes the forces those of least norm, as on the dense path. All forces on a body are its change of momentum.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.loads.reactions import place as place_of
from mbsvib.sparse.release import Release
from mbsvib.sparse.rows import relative_rows
from mbsvib.sparse.turning import Turning
from mbsvib.topology import FLOATS

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from scipy.sparse import csr_matrix

    from mbsvib.composite import Composite, Shared
    from mbsvib.elements import Elements
    from mbsvib.inertia import SpatialInertia
    from mbsvib.kinematics import Array, Index, Rows
    from mbsvib.ports import Ports
    from mbsvib.sparse.constraints import Constraints
    from mbsvib.sparse.layout import Layout
    from mbsvib.sparse.loads import Geometric
    from mbsvib.sparse.tree import Tree
    from mbsvib.topology import Topology


@dataclass(frozen=True, slots=True)
class Virtual:
    """A motion of the bodies: those that are ``moved`` (bodies + 1,), 1 or -1 times, follow a twist (``linear``,
    ``angular``) of one rigid body about ``point``, and the tree adds ``follows`` (size,), if anything does follow.
    """

    moved: Array
    linear: Array
    angular: Array
    point: Array
    follows: Array | None = None

    def full(self, rows: Rows) -> Array:
        """Return how far the twist goes along the directions of rows, (rows,)."""
        turning = rows.moment + np.cross(rows.point - self.point[:, None], rows.force, axis=0)
        return np.asarray(self.linear @ rows.force + self.angular @ turning)

    def along(self, rows: Rows) -> Array:
        """Return the relative displacements along rows that the rigid part makes, (rows,)."""
        return np.asarray((self.moved[rows.second] - self.moved[rows.first]) * self.full(rows))

    def of_bodies(self, position: Array) -> Array:
        """Return the rigid part of displacements (bodies, 6) at centres of mass (bodies, 3)."""
        turned = np.cross(self.angular, position - self.point) + self.linear
        whole = np.concatenate((turned, np.broadcast_to(self.angular, turned.shape)), axis=1)
        return np.asarray(whole * self.moved[: len(position), None])


@dataclass(frozen=True)
class Acting:
    """All that acts on the bodies, in numbers: ``springs`` with their ``elastic`` rows over the unknowns, ``inertia``
    with its ``factor``, ``port`` with the rows that its inputs have (``pushed``), what more bodies have ``shared``, and
    the forces ``found`` at the pose, if there are any.
    """

    topology: Topology
    tree: Tree
    place: Layout
    closure: Constraints
    number: Mapping[str, int]
    springs: Elements
    elastic: csr_matrix
    inertia: SpatialInertia
    factor: csr_matrix
    port: Ports
    pushed: csr_matrix
    shared: Shared | None
    found: Geometric | None

    @cached_property
    def release(self) -> Release:
        """Motions in which cut joints give way."""
        return Release(self.tree, self.place, self.closure)

    def outputs(self) -> tuple[tuple[csr_matrix, csr_matrix, csr_matrix], Array]:
        """Return rows of all outputs that are forces in joints or sums of forces, and zeros for the others.

        Returns
        -------
        tuple
            Rows (outputs, size) for displacement, velocity and acceleration, and D (outputs, inputs).
        """
        from scipy.sparse import csr_matrix

        shape = (len(self.port.output_units), self.place.size)
        through = np.zeros((shape[0], len(self.port.input_units)))
        entries: tuple[list[Any], list[Any], list[Any]] = ([], [], [])
        for row, kind, number, wrench in self.port.wrench_outputs:
            lines, through[row] = (self._sum if kind == "body" else self._in_joint)(number, wrench)
            for derivative, line in lines.items():
                at = np.flatnonzero(line)
                entries[derivative].append((line[at], np.full(len(at), row), at))
        found = []
        for parts in entries:
            value, row_of, column = (np.concatenate([part[i] for part in parts] or [()]) for i in range(3))
            found.append(csr_matrix((value, (row_of.astype(int), column.astype(int))), shape=shape))
        return (found[0], found[1], found[2]), through

    def _sum(self, body: int, wrench: Array) -> tuple[dict[int, Array], Array]:
        """All forces on a body, its change of momentum; on the ground, what the bodies lack of theirs."""
        n = len(self.tree.parent)
        moved, about = np.zeros(n + 1), np.zeros(3)
        if body < n:
            moved[body], about = -1.0, self.tree.position[body]
        else:
            moved[:n] = 1.0
        inertia, base = self._of_inertia(Virtual(moved, wrench[:3], wrench[3:], about))
        lines = {2: inertia}
        if body == n and self._turning is not None:
            lines[0] = self._turning.on_ground(wrench)
        return lines, base

    def _in_joint(self, number: int, wrench: Array) -> tuple[dict[int, Array], Array]:
        """The force with which a joint pulls its first body to its second."""
        motion = self._giving_way(number, wrench)
        lines = {0: np.zeros(self.place.size), 1: np.zeros(self.place.size)}
        for rows, along, stiffness, damping in self._elastic(motion):
            for derivative, value in ((0, stiffness), (1, damping)):
                lines[derivative] -= rows.T @ (value * along)
        if self._turning is not None:
            lines[0] += self._turning.of_joint(motion, number)
        lines[2], through = self._of_inertia(motion)
        forces = self.port.force_inputs
        push = motion.along(self.port.rows)[: len(forces)]
        through[forces] += push if motion.follows is None else push + self.pushed @ motion.follows
        return lines, through

    def _giving_way(self, number: int, wrench: Array) -> Virtual:
        """The motion of a joint's second body against its first, and of all that has to follow."""
        joint, rows = self.topology.joints[number], self.closure.rows
        centre = np.concatenate((self.tree.position, np.zeros((1, 3)))).T
        axes, point = np.array(joint.axes), np.array(place_of(joint, dict(self.number), centre), dtype=float)
        motion = Virtual(np.zeros(centre.shape[1]), axes @ wrench[:3], axes @ wrench[3:], point)
        couplers, target = self.closure.couplers, np.zeros(len(self.closure.names))
        locked = target[: len(rows.first)]
        if number in self._hung:
            body, sign = self._hung[number]
            enter, leave = self._subtrees
            motion.moved[:-1][(enter >= enter[body]) & (enter < leave[body])] = sign
            locked -= motion.along(rows)
        else:
            own = np.flatnonzero(self.closure.loop[: len(locked)] == self.topology.cut.index(number))
            locked[own] = motion.full(rows)[own]
        if couplers is not None:
            row, share = couplers.measured
            seen = couplers.terms.measured
            gap = -motion.along(seen) if number in self._hung else motion.full(seen) * (couplers.joint == number)
            np.add.at(target, len(locked) + row, share * gap)
        return replace(motion, follows=self.release.unknowns(target)) if target.any() else motion

    def _elastic(self, motion: Virtual) -> Iterator[tuple[csr_matrix, Array, Array, Array]]:
        """Elastic rows, how far a motion goes along them, stiffness and damping."""
        follows = motion.follows
        along = motion.along(self.springs.rows)
        yield (self.elastic, along if follows is None else along + self.elastic @ follows, self.springs.stiffness,
               self.springs.damping)  # fmt: skip
        if self._blended is not None and self.shared is not None and self.shared.elastic is not None:
            blend = self.shared.elastic
            along = _rigidly(blend.composite, motion)
            yield (self._blended, along if follows is None else along + self._blended @ follows, blend.stiffness,
                   blend.damping)  # fmt: skip

    def _of_inertia(self, motion: Virtual) -> tuple[Array, Array]:
        """What inertia does in a motion, per unit of the unknowns' acceleration (size,) and of the inputs."""
        moved = self.inertia.factor(motion.of_bodies(self.tree.position)[:, :, None])[:, 0]
        if self.shared is not None and self.shared.mass is not None:
            moved = np.concatenate((moved, _rigidly(self.shared.mass, motion)))
        if motion.follows is not None:
            moved = moved + self.factor @ motion.follows
        through = np.zeros(len(self.port.input_units))
        for column, carried in self._base:
            through[column] = -(moved @ carried)
        return -(self.factor.T @ moved), through

    @cached_property
    def _turning(self) -> Turning | None:
        return None if self.found is None else Turning(self.tree, self.place, self.found)

    @cached_property
    def _base(self) -> list[tuple[int, Array]]:
        """Square roots of inertia times the acceleration of all that the moving ground carries along."""
        result = []
        for column, source in self.port.base_motions:
            linear, angular = np.array(source.wrench[:3]), np.array(source.wrench[3:])
            n = len(self.tree.parent)
            motion = Virtual(np.ones(n), linear, angular, np.array(source.position))
            moved = self.inertia.factor(motion.of_bodies(self.tree.position)[:, :, None])
            if self.shared is not None:
                moved = self.shared.carried(moved, linear, angular, np.array(source.position))
            result.append((column, moved[:, 0]))
        return result

    @cached_property
    def _blended(self) -> csr_matrix | None:
        """Elastic rows that more than two bodies share."""
        if self.shared is None or self.shared.elastic is None:
            return None
        composite = self.shared.elastic.composite
        return composite.of_sparse(relative_rows(self.tree, self.place, composite.rows))

    @cached_property
    def _hung(self) -> dict[int, tuple[int, int]]:
        """The body that hangs on each joint of the tree, and its sign there."""
        return {b.joint: (b.body, b.sign) for b in self.topology.branches if b.joint != FLOATS}

    @cached_property
    def _subtrees(self) -> tuple[Index, Index]:
        """Numbers of bodies such that those behind each of them are a range: its begin and its end, (bodies,)."""
        n, held, outward = len(self.tree.parent), self.tree.parent.tolist(), self.tree.outward.tolist()
        size, begin, free = [1] * (n + 1), [0] * (n + 1), [0] * (n + 1)
        for body in reversed(outward):
            size[held[body]] += size[body]
        for body in outward:
            begin[body] = free[held[body]]
            free[held[body]] += size[body]
            free[body] = begin[body] + 1
        enter = np.array(begin[:n], dtype=np.intp)
        return enter, enter + np.array(size[:n], dtype=np.intp)


def _rigidly(composite: Composite, motion: Virtual) -> Array:
    """How far the rigid part of a motion goes along composite rows."""
    return composite.of((motion.along(composite.rows) * composite.rides)[:, None])[:, 0]
