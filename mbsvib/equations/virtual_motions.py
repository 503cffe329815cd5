"""Wrenches in joints by virtual motions: rows of the equations along motions that release a joint.

A joint gets six virtual coordinates v in its axes, which turn with its first body. With the coordinates of loops that
follow them, x = -A^-1 Phi_v so that the kept constraints stay closed, its wrench w on the second body is

    w . v = (M_v z'' + C_v z' + K_v z) - B_v u

with the rows of the same matrices along v and x. In a loaded pose K_v has the second derivatives of the work of all
forces to v and the coordinates: axes, lever arms and forces change with the pose. Moments are about the point of the
second body, which slides with it. The virtual motion of a cut joint opens it: no body moves, its locked rows change.

Source: principle of virtual work; Haug, Computer Aided Kinematics and Dynamics of Mechanical Systems (1989), chapter 6.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mbsvib.common.arrays import Array, Index
from mbsvib.core.geometric_stiffness import MotionOrder, Pairs, TwistsAt, bracket_form, geometric_stiffness
from mbsvib.elements import Joint
from mbsvib.elements.rows import Rows
from mbsvib.equations.load_stiffness import LoadedPairs, rounding
from mbsvib.equations.matrices import matrices, minimal_rows
from mbsvib.equations.scene import Scene
from mbsvib.equations.spin_terms import CrossCoupling, with_antisymmetric_terms
from mbsvib.equations.wrenches import leading, trailing
from mbsvib.kinematics.loops import Reduction
from mbsvib.kinematics.relative_motion import Twists
from mbsvib.linalg.products import concatenated, product_with_zeros, widened
from mbsvib.linalg.rank import ZERO_SUM
from mbsvib.linalg.rotations import cross, skew
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.mechanism.topology import FLOATS, Topology

Kept = Sequence[tuple[Index, Index]]


@dataclass(frozen=True, slots=True)
class VirtualMotions:
    """Six virtual motions (v = 6 j) of each of the ``joints`` (j,), in their axes: as ``twists`` in the tree, and as
    changes ``opening`` (..., locked rows, v) of cut joints. ``six`` (..., 6, v) (rotation, translation), world axes,
    act at ``point`` (..., 3, v).
    """

    joints: tuple[int, ...]
    twists: Twists
    opening: Array
    six: Array
    point: Array


def virtual_motions(scene: Scene, joints: Sequence[int], axes: Mapping[str, Array], points: Mapping[int, Array]
                    ) -> VirtualMotions:  # fmt: skip
    """Return the virtual motions of some joints.

    ``axes`` (..., 3, 3) by name and ``points`` (..., 3) by number: where variants differ in them.
    """
    topology, number = scene.topology, scene.topology.body_numbers
    on_path = beyond(scene)
    path = np.zeros((len(scene.coordinates.path), 6 * len(joints)), dtype=np.int8)
    six, at = [np.zeros((6, 0))], [np.zeros((3, 0))]
    opening = np.zeros((scene.locked + len(scene.couplers), 6 * len(joints)))
    for k, joint in enumerate(joints):
        part, mine = topology.joints[joint], slice(6 * k, 6 * k + 6)
        frame = np.asarray(axes.get(part.name, part.axes))
        both = np.zeros((*frame.shape[:-2], 6, 6), frame.dtype)
        both[..., :3, 3:] = both[..., 3:, :3] = frame  # translations first
        six.append(both)
        body = number[part.second] if part.second != "ground" else number[part.first]
        centre = scene.position[..., body, :] if part.point is None else np.array(part.point)
        at.append(np.repeat(points.get(joint, centre)[..., None], 6, axis=-1))
        path[:, mine] = on_path[:, [joint]]
        if joint in topology.cut:
            assert scene.cuts is not None
            rows = np.flatnonzero(scene.cuts.joint[: scene.locked] == topology.cut.index(joint))
            relative = _along(scene.cuts.rows.take(rows), both, at[-1])
            measured = _measured_in(scene, part.name, both, at[-1])
            opening = widened(opening, relative, measured)
            opening[..., rows, mine] = -relative
            opening[..., scene.locked :, mine] = -measured
    directions, point = concatenated(six, -1), concatenated(at, -1)
    names = tuple([f"{joint}.{i}" for joint in joints for i in range(6)])
    twists = Twists(names, trailing(directions[..., 3:, :]), trailing(directions[..., :3, :]), trailing(point), path,
                    np.zeros(len(names), dtype=bool))  # fmt: skip
    return VirtualMotions(tuple(joints), twists, opening, directions, point)


def _measured_in(scene: Scene, joint: str, six: Array, point: Array) -> Array:
    """Changes (..., couplers, v) of couplers by motions ``six`` of a cut joint whose coordinates they measure."""
    result = np.zeros((len(scene.couplers), six.shape[-1]))
    for k, (name, term) in enumerate(_measured_terms(scene)):
        if name == joint:
            assert scene.cuts is not None
            assert scene.cuts.couplings is not None
            couplings = scene.cuts.couplings
            row = _along(couplings.measured.take(slice(k, k + 1)), six, point)
            change = couplings.value[..., term, None, None] * row
            result = widened(result, change)
            result[..., couplings.row[term], :] += change[..., 0, :]
    return result


def _measured_terms(scene: Scene) -> list[tuple[str, int]]:
    """Name of the joint, and number among all terms of couplers, of each coordinate measured in a cut joint."""
    if scene.cuts is None or scene.cuts.couplings is None:
        return []
    names = [joint.name for joint, _ in scene.measured]
    return list(zip(names, np.flatnonzero(scene.cuts.couplings.column < 0).tolist(), strict=True))


def _along(rows: Rows, six: Array, point: Array) -> Array:
    """Relative displacements (..., rows, v) along rows of motions ``six`` (..., 6, v) at points (..., 3, v)."""
    force, moment, at = leading(rows.force), leading(rows.moment), leading(rows.point)
    arm = at[..., :, :, None] - point[..., :, None, :]
    turn = six[..., :3, None, :]
    moved = six[..., 3:, None, :] + cross(turn, arm)
    return np.asarray((force[..., None] * moved).sum(axis=-3) + (moment[..., None] * turn).sum(axis=-3))


def beyond(scene: Scene) -> NDArray[np.int8]:
    """Signs (bodies + 1, joints) of the joints of the tree on the way from ground to each body."""
    result = np.zeros((len(scene.coordinates.path), len(scene.topology.joints)), dtype=np.int8)
    for branch in scene.topology.branches:
        result[branch.body] = result[branch.parent]
        if branch.joint != FLOATS:
            result[branch.body, branch.joint] = branch.sign
    return result


def joint_points(scene: Scene, joints: Sequence[int], fixed: Mapping[int, Array]) -> dict[int, Array]:
    """Return the points (..., 3) of joints, where they move with the joint or with a body in variants; ``fixed`` has
    those of joints without coordinates that differ from the described ones.
    """
    result, start = {}, 0
    twists, topology = leading(scene.coordinates.point), scene.topology
    number = topology.body_numbers
    for k in sorted(topology.branch_of):
        count = len(topology.joints[k].freedom)
        if k in joints and count:
            result[k] = twists[..., start]
        start += count
    for k in joints:
        joint = topology.joints[k]
        if k in topology.cut and scene.cuts is not None:
            rows = np.flatnonzero(scene.cuts.joint[: scene.locked] == topology.cut.index(k))
            if len(rows):
                result[k] = leading(scene.cuts.rows.point)[..., rows[0]]
        if k not in result or joint.point is None:
            body = joint.first if joint.second == "ground" else joint.second
            described = scene.position[..., number[body], :] if joint.point is None else np.array(joint.point)
            result[k] = fixed.get(k, described)
    return result


def opened(scene: Scene, motions: VirtualMotions) -> Array:
    """Return the change (..., locked rows, v) of the locked rows by virtual motions."""
    if scene.cuts is None:
        return motions.opening
    extended = _with_motions(scene, motions.twists)
    return np.asarray(motions.opening + extended.closure(extended.relative_of())[..., len(scene.coordinates.names) :])


@dataclass(frozen=True, slots=True)
class JointWrenches:
    """Rows of wrenches (..., v, m) by the coordinates, ``q``, their rates ``v`` and accelerations ``a``, and by the
    inputs ``u`` (..., v, inputs), along virtual motions.
    """

    q: Array
    v: Array
    a: Array
    u: Array


def _with_motions(scene: Scene, virtual: Twists) -> Scene:
    """The scene with virtual motions behind its joint coordinates."""
    own, cuts = scene.coordinates, scene.cuts
    linear, angular, point = (trailing(concatenated([leading(getattr(part, key)) for part in (own, virtual)], -1))
                              for key in ("linear", "angular", "point"))  # fmt: skip
    coordinates = Twists(own.names + virtual.names, linear, angular, point, np.concatenate((own.path, virtual.path), 1),
                         np.concatenate((own.turns, virtual.turns)), own.pitch)  # fmt: skip
    if cuts is not None and cuts.couplings is not None:
        touched = np.zeros((len(cuts.couplings.touched), len(coordinates.names)), dtype=bool)
        cuts = replace(cuts, couplings=replace(cuts.couplings, touched=touched))
    return replace(scene, coordinates=coordinates, cuts=cuts)


class VirtualWork:
    """The work of all forces along virtual motions, in the terms of a scene with the minimal coordinates.

    ``phi`` (..., locked rows, n); ``kept``: rows and dependent coordinates of each group of loops.
    """

    def __init__(self, scene: Scene, reduction: Reduction, phi: Array, kept: Kept, motions: VirtualMotions) -> None:
        self._scene, self._reduction, self._motions = scene, reduction, motions
        self._extended = _with_motions(scene, motions.twists)
        self._relative = self._extended.relative()
        n, opening = len(scene.coordinates.names), motions.opening
        if scene.cuts is not None:
            opening = opening + self._extended.closure(self._relative)[..., n:]
        lead = np.broadcast_shapes(phi.shape[:-2], opening.shape[:-2])
        self.following = np.zeros((*lead, n, opening.shape[-1]), np.result_type(phi, opening))
        for rows, dependent in kept:
            if len(dependent):
                matrix = phi[..., rows[:, None], dependent]
                self.following[..., dependent, :] = -np.linalg.solve(matrix, opening[..., rows, :])

    @property
    def joints(self) -> tuple[int, ...]:
        """Numbers of the joints with virtual motions."""
        return self._motions.joints

    def _minimal(self) -> Reduction:
        """The minimal coordinates, and the virtual motions behind them."""
        matrix, (n, v) = self._reduction.matrix, self.following.shape[-2:]
        independent = np.append(self._reduction.independent, np.arange(n, n + v))
        if matrix is None:
            return Reduction(independent, None, ())
        unit = np.eye(v, matrix.shape[-1] + v, matrix.shape[-1])
        return Reduction(independent, concatenated((concatenated((matrix, self.following), -1), unit), -2), ())

    def at_rest(self, momenta: Sequence[tuple[int, Array]], couplings: Sequence[CrossCoupling]) -> JointWrenches:
        """Return the wrenches without the forces at the pose, of which ``momenta`` and ``couplings`` are spin."""
        scene, reduction = self._extended, self._minimal()
        terms = matrices(scene, minimal_rows(scene, self._relative, reduction), closed=reduction.matrix is not None)
        if momenta or couplings:
            terms = with_antisymmetric_terms(scene, reduction, terms, momenta, couplings)
        m = len(self._reduction.independent)
        elastic, factor = terms.elastic_rows, terms.inertia_factor
        virtual = elastic[..., m:].swapaxes(-1, -2)
        q, v = (product_with_zeros(virtual * value[..., None, :], elastic[..., :m])
                for value in (terms.row_stiffness, terms.row_damping))  # fmt: skip
        if terms.circulatory is not None:
            q = q + terms.circulatory[..., m:, :m]
        if terms.gyroscopic is not None:
            v = v + terms.gyroscopic[..., m:, :m]
        a = product_with_zeros(factor[..., m:].swapaxes(-1, -2), factor[..., :m])
        return JointWrenches(q, v, a, -terms.B[..., m:, :])

    def of_forces(self, loaded: LoadedPairs, pairs: Pairs, motion: Array) -> Array:
        """Return the rows (..., v, m) of the forces at the pose in ``pairs`` with their ``motion`` (..., 6, p, n)."""
        scene, motions, n = self._scene, self._motions, motion.shape[-1]
        twists, v = loaded.twists, motions.six.shape[-1]
        virtual = TwistsAt(motions.six[..., :3, :], motions.six[..., 3:, :], motions.point, motions.twists.path)
        extended = TwistsAt(*(concatenated((getattr(twists, key), getattr(virtual, key)), -1)
                              for key in ("angular", "linear", "point", "path")))  # fmt: skip
        of_virtual = virtual.motion(pairs.first, pairs.second, pairs.point)
        second = geometric_stiffness(extended, self._order(loaded.order, twists.path, v), pairs,
                                     concatenated((motion, of_virtual), -1), loaded.rod_curvature)  # fmt: skip
        hessian = second.symmetric if second.antisymmetric is None else second.symmetric + second.antisymmetric
        hessian = np.array(hessian)
        hessian.real[np.abs(hessian) <= rounding(extended, pairs)] = 0.0
        rows = np.array(hessian[..., n:, :n])
        for k, joint in enumerate(motions.joints):
            part, mine = scene.topology.joints[joint], slice(6 * k, 6 * k + 6)
            six, point = motions.six[..., mine], motions.point[..., 6 * k : 6 * k + 1]
            a, b = (np.array([scene.topology.body_numbers[body]]) for body in (part.first, part.second))
            xi = twists.motion(a, b, point)[..., 0, :]
            if joint in scene.topology.cut:
                force, rows[..., mine, :] = self._of_cut(loaded, pairs, joint, six, point)
            else:
                force = second.transmitted[..., 3:, n + 6 * k]
            if not part.is_rod and carrier_of(part, scene.topology.body_numbers) != a[0]:
                # moments are about a point that moves with the second body
                slide = skew(xi[..., 3:, :].swapaxes(-1, -2)) @ force[..., None, :, None]
                rows[..., mine, :] -= six[..., :3, :].swapaxes(-1, -2) @ slide[..., 0].swapaxes(-1, -2)
        back = self.following.swapaxes(-1, -2)
        result = self._reduction.apply(rows + back @ hessian[..., :n, :n])
        size = np.abs(rows) + np.abs(back) @ np.abs(hessian[..., :n, :n])
        if self._reduction.matrix is not None:
            size = size @ np.abs(self._reduction.matrix)
        result.real[np.abs(result) <= ZERO_SUM * size] = 0.0
        return result

    def _of_cut(self, loaded: LoadedPairs, pairs: Pairs, joint: int, six: Array, point: Array) -> tuple[Array, Array]:
        """Force (..., 3) in a cut joint, and its rows (..., 6, n): -v . H xi - 1/2 F . [v, xi], of the joint and of the
        couplers that measure it.
        """
        scene, n = self._scene, loaded.motion.shape[-1]
        part = scene.topology.joints[joint]
        force, rows = np.zeros((1, 3))[0], np.zeros((6, n))
        for i in () if part.is_rod else self._pairs_of(loaded, joint):
            at = pairs.point[..., i : i + 1]
            xi = loaded.twists.motion(pairs.first[[i]], pairs.second[[i]], at)[..., 0, :]
            moved = skew((point - at).swapaxes(-1, -2)) @ six[..., :3, :].swapaxes(-1, -2)[..., None]
            there = concatenated((six[..., :3, :], six[..., 3:, :] + moved[..., 0].swapaxes(-1, -2)), -2)
            matrix = pairs.hessian[..., i, :, :] + 0.5 * bracket_form(pairs.wrench[..., i])
            force, rows = force - pairs.wrench[..., 3:, i], rows - there.swapaxes(-1, -2) @ matrix @ xi
        return force, rows

    def _pairs_of(self, loaded: LoadedPairs, joint: int) -> list[int]:
        """Numbers of the pairs that act in a cut joint: its own, and those of couplers that measure its coordinates."""
        scene, count, result = self._scene, len(loaded.pairs.first), []
        if loaded.cut is not None:
            own = (loaded.cut.number[loaded.cut.start] == scene.topology.cut.index(joint)).nonzero()[0]
            result += (count + own).tolist()
            count += len(loaded.cut.first)
        return result + [count + k for k, (name, _) in enumerate(_measured_terms(scene))
                         if name == scene.topology.joints[joint].name]  # fmt: skip

    def _order(self, order: MotionOrder, path: NDArray[np.int8], v: int) -> MotionOrder:
        """The order of the coordinates and, behind them, of the virtual motions, each before those of its own joint."""
        topology, motions, n = self._scene.topology, self._motions, len(order.joint)
        branch_of = topology.branch_of
        before = np.zeros((n + v, n + v))
        before[:n, :n] = order.before
        for k, joint in enumerate(motions.joints):
            if joint not in branch_of:
                continue
            mine, branch = np.arange(n + 6 * k, n + 6 * k + 6), branch_of[joint]
            before[:n, mine] = path[branch.parent, :, None]
            on_path = motions.twists.path[:, 6 * k]
            for column, other in enumerate(order.joint.tolist()):
                if other == joint:
                    if not topology.joints[joint].is_rod:
                        at = (mine, column) if branch.sign > 0 else (column, mine)
                        before[at] = branch.sign
                elif other != FLOATS:
                    before[mine, column] = on_path[branch_of[other].parent]
        sign = np.concatenate((order.sign, np.ones(v)))
        return MotionOrder(before, np.concatenate((order.joint, np.repeat(motions.joints, 6))), sign, order.rods)


def joint_ends(topology: Topology, position: Array) -> tuple[Index, Index, Array, Array, Index]:
    """Return the bodies and points of joints.

    ``position`` (3, bodies + 1): centres of mass [m], the origin for ground. Returns ``first, second`` (joints,):
    numbers of their bodies; ``start, point`` (3, joints): points of the first and of the second body [m], which differ
    for rods; ``carrier`` (joints,): numbers of the bodies with which these points move.
    """
    number, joints = topology.body_numbers, topology.joints
    first, second, carrier = (np.array(bodies, dtype=np.intp) for bodies in (
        [number[joint.first] for joint in joints], [number[joint.second] for joint in joints],
        [carrier_of(joint, number) for joint in joints]))  # fmt: skip
    point = np.array([point_of(joint, number, position) for joint in joints]).reshape(-1, 3).T
    start = point.copy()
    for k, joint in enumerate(joints):
        if joint.is_rod:
            start[:, k] = joint.position
    return first, second, start, point, carrier


def carrier_of(joint: Joint, number: Mapping[str, int]) -> int:
    """Return the body with which a joint's point moves: its second body, or its first where the second is ground and
    the point is a centre of mass.
    """
    return number[joint.first if joint.point is None and joint.second == "ground" else joint.second]


def point_of(joint: Joint, number: Mapping[str, int], position: Array) -> Array | tuple[float, float, float]:
    """Return a joint's point; by default the centre of mass of its second body (of its first, where that is ground)."""
    if joint.point is not None:
        return joint.point
    bodies = (number[joint.second], number[joint.first])
    return position[:, bodies[1] if bodies[0] == position.shape[1] - 1 else bodies[0]]


def carries_nothing(joint: Joint, direction: Array, model: Mechanism, loaded: bool) -> bool:
    """Return whether a component of the wrench in a joint is zero in every motion, along its free directions.

    ``direction`` (6,): of the component, world axes. Under load, the free rotations must be about axes that the first
    body carries, or about all; couplers act along free directions.
    """
    if (loaded and len(joint.rotation_axes) == 2) or any(
            name.rpartition(".")[0] == joint.name for part in model.couplers.values() for name, _ in part.terms):
        return False
    return not product_with_zeros(np.array([row for _, row in joint.locked]).reshape(-1, 6), direction).any()
