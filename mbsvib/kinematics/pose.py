"""Joints in other poses: the axes with which their directions turn, and how far cut ones are open.

The directions of a joint turn with its first body, but for those of joints with axes of their own: of two successive
free rotations (see ``elements.joint_kinds``) the first axis is fixed in the first body, the other in the second; the
axes of other two free rotations bisect the angle of both bodies; those of a rod are along it. The openings of a joint
are those of its family (``elements.joint_kinds``). Arrays may have leading axes of poses.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any

import numpy as np

from mbsvib.common.arrays import Array, Index
from mbsvib.elements import Joint
from mbsvib.elements.joint_kinds import Columns
from mbsvib.elements.pose import IDENTITY, Pose
from mbsvib.linalg.displacements import Displacement
from mbsvib.linalg.products import concatenated
from mbsvib.linalg.rank import SAME_POINT
from mbsvib.linalg.rotations import components_first, cross, exponential, frames_along, logarithm
from mbsvib.mechanism.mechanism import Mechanism


def start(model: Mechanism) -> Pose:
    """Return the reference pose of a model."""
    number = {name: k for k, name in enumerate(model.bodies)}
    number["ground"] = len(number)
    origin = np.array([*(body.position for body in model.bodies.values()), (0.0, 0.0, 0.0)])
    return Pose(number, origin, origin, np.tile(IDENTITY, (len(origin), 1, 1)))


@dataclass(frozen=True, slots=True)
class Joints:
    """Joints (k) in the pose in which they are described.

    ``first``, ``second`` (k,) are their bodies, ``start`` and ``end`` (..., k, 3) their points as the first and the
    second body carry them [m], ``first_axis`` and ``last_axis`` (..., k, 3) the axes of their first and last free
    rotation.
    """

    first: Index
    second: Index
    start: Array
    end: Array
    first_axis: Array
    last_axis: Array

    def with_axes(
        self, joints: Sequence[Joint], axes: Mapping[str, Array], lengths: Mapping[str, Array], end: Array
    ) -> Joints:
        """Return the same with other ``axes`` (..., 3, 3) and, of rods, ``lengths`` (...) by name, and points ``end``
        (..., k, 3) [m]; the third axis of a rod is along it.
        """
        frames = np.array([joint.axes for joint in joints])
        own = concatenated([np.asarray(axes.get(joint.name, joint.axes))[..., None, :, :] for joint in joints], -3)
        length = np.sqrt(np.square(self.end - self.start).sum(axis=-1))
        length = concatenated([np.asarray(lengths.get(joint.name, length[k]))[..., None]
                               for k, joint in enumerate(joints)], -1)  # fmt: skip
        turns = own @ frames.swapaxes(-1, -2)
        first_axis, last_axis = ((turns @ axis[..., None])[..., 0] for axis in (self.first_axis, self.last_axis))
        return replace(self, start=end - length[..., None] * own[..., 2], end=end, first_axis=first_axis,
                       last_axis=last_axis)  # fmt: skip


Axes = Callable[[Joints, Pose], Array]


def _between_axes(joints: Joints, pose: Pose) -> Array:
    """Axes along the first axis, along the normal of both axes, and perpendicular to these."""
    first_axis = pose.vectors(joints.first, joints.first_axis)
    normal = cross(first_axis, pose.vectors(joints.second, joints.last_axis), -1)
    normal /= np.sqrt(np.add.reduce(normal * normal, axis=-1, keepdims=True))
    return np.concatenate([part[..., None] for part in (first_axis, normal, cross(normal, first_axis, -1))], axis=-1)


def _halfway(joints: Joints, pose: Pose) -> Array:
    first, second = pose.rotations.take(joints.first, axis=-3), pose.rotations.take(joints.second, axis=-3)
    return np.asarray(first @ exponential(0.5 * logarithm(first.swapaxes(-1, -2) @ second)))


def _along_rod(joints: Joints, pose: Pose) -> Array:
    rod = pose.points(joints.second, joints.end) - pose.points(joints.first, joints.start)
    return frames_along(rod / np.sqrt((rod * rod).sum(axis=-1, keepdims=True)))


def axes_of(joint: Joint) -> Axes | None:
    """Return the function of the axes with which the directions of a joint turn; None: they turn with the first body.
    """
    if joint.is_rod:
        return _along_rod
    if joint.successive:
        return _between_axes
    return _halfway if joint.bisects else None


def with_own_axes(joints: Sequence[Joint]) -> dict[Axes, list[int]]:
    """Return the numbers of the joints with axes of their own, by the function of these."""
    result: dict[Axes, list[int]] = {}
    for k, joint in enumerate(joints):
        axes = axes_of(joint)
        if axes is not None:
            result.setdefault(axes, []).append(k)
    return result


def stacked(joints: Sequence[Joint], number: Mapping[str, int], origin: Array) -> Joints:
    """Return joints as arrays.

    ``origin`` (bodies + 1, 3): centres of mass as described [m], used as the points of joints that have none.
    """
    first, second = (np.array([number[body] for body in bodies], dtype=np.intp) for bodies in (
        [joint.first for joint in joints], [joint.second for joint in joints]))  # fmt: skip
    inner = np.minimum(first, second)
    end = np.array([origin[k] if joint.point is None else joint.point for k, joint in zip(inner, joints, strict=True)])
    start = np.array([point if joint.end is None else joint.position or (0.0, 0.0, 0.0)
                      for point, joint in zip(end, joints, strict=True)])  # fmt: skip
    turns = [joint.rotation_axes or ((0.0,) * 3,) for joint in joints]
    return Joints(first, second, start, end, np.array([axes[0] for axes in turns]),
                  np.array([axes[-1] for axes in turns]))  # fmt: skip


@dataclass(frozen=True, slots=True)
class Openings:
    """Cut joints (k) of one form as described: their ``motion``, and the ``rows`` (locked, k) of their openings.

    ``ends`` (2 k,) are their second bodies, then the first ones, ``arms`` (2 k, 3, 1) from the centres of mass of these
    to their points on the second one [m], ``columns`` their directions as components (k,).
    """

    motion: Any
    rows: Index
    ends: Index
    arms: Array
    columns: Columns

    def at(self, pose: Pose) -> list[Any]:
        """Return what they are open in a pose [m, rad], one array (..., k) for each locked direction."""
        shift, change = pose.change
        gone = change.take(self.ends, axis=-3) @ self.arms
        gone += shift.take(self.ends, axis=-2)[..., None]
        turned, count = pose.rotations.take(self.ends, axis=-3), len(self.ends) // 2
        back = turned[..., count:, :, :].swapaxes(-1, -2)
        gap = back @ (gone[..., :count, :, :] - gone[..., count:, :, :])
        relative = back @ turned[..., :count, :, :]
        apart: Any = (gap[..., 0, 0], gap[..., 1, 0], gap[..., 2, 0])
        rotation: Any = tuple([(relative[..., i, 0], relative[..., i, 1], relative[..., i, 2]) for i in range(3)])
        opened: list[Any] = self.motion.openings(Displacement(rotation, apart, self.columns.point), self.columns)
        return opened


def openings_of(joints: Sequence[Joint], rows: Sequence[Sequence[int]], number: Mapping[str, int], origin: Array) -> \
        tuple[Openings, ...]:  # fmt: skip
    """Return cut joints in groups of one form; ``rows``: the numbers of the locked rows of each joint."""
    forms: dict[Any, list[int]] = {}
    for k, joint in enumerate(joints):
        if joint.locked:
            names = tuple([tuple([name for name, _ in group]) for group in (joint.freedom, joint.locked)])
            forms.setdefault((joint.motion, joint.successive, names), []).append(k)
    result = []
    for (motion, successive, _), members in forms.items():
        group = [joints[k] for k in members]
        arrays = stacked(group, number, origin)
        columns = Columns(_directions([joint.freedom for joint in group]),
                          _directions([joint.locked for joint in group]), _components(arrays.end),
                          _components(arrays.start), successive)  # fmt: skip
        which = np.array([rows[k] for k in members], dtype=np.intp).T
        ends = np.concatenate((arrays.second, arrays.first))
        arms = np.concatenate((arrays.end, arrays.end)) - origin[ends]
        result.append(Openings(motion, which, ends, arms[..., None], columns))
    return tuple(result)


def _components(vectors: Array) -> Any:
    return tuple(components_first(np.asarray(vectors)))


def _directions(groups: Sequence[Any]) -> Any:
    """Directions (name, six components (k,)) of joints of one form."""
    return tuple([(groups[0][i][0], _components(np.array([group[i][1] for group in groups])))
                  for i in range(len(groups[0]))])  # fmt: skip


def length_of(points: Array, *centres: Array) -> Any:
    """Return the root mean square distance (...) of points (..., n, 3) [m] from their mean [m].

    L^2 = 1/n sum of |p_i - 1/n sum of p_j|^2

    It is the same in all frames and for all orders of the points; 1 where there is no point, or all coincide within
    rounding. ``centres`` (..., n, 3): centres of mass of the bodies that have these points [m].
    """
    if not points.shape[-2]:
        return 1.0
    offsets = points - points.mean(axis=-2, keepdims=True)
    length = np.sqrt((offsets * offsets).sum(axis=(-2, -1)) / points.shape[-2])
    far = reduce(np.maximum, [np.abs(points - centre).max(axis=(-2, -1)) for centre in (np.zeros(3), *centres)])
    return np.where(np.abs(length) > SAME_POINT * far, length, 1.0)[()]


def size_of(model: Mechanism) -> float:
    """Return the size [m] of a mechanism in its reference pose, 1 m if all of its points coincide.

    It is the root mean square distance from their mean of the centres of mass, the points of joints and bushings, and
    the ends of springs.
    """
    points = [body.position for body in model.bodies.values()]
    points += [joint.point for joint in model.joints.values() if joint.point is not None]
    for spring in model.springs.values():
        points += spring.points
    return float(length_of(np.array(points).reshape(-1, 3)))
