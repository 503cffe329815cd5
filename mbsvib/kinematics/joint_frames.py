"""Joints in other poses: the axes with which their directions turn, and how far cut ones are open.

The directions of a joint turn with its first body, but for those of joints with axes of their own: of two successive
free rotations (see ``elements.joint_kinds``) the first axis is fixed in the first body, the other in the second; the
axes of other two free rotations bisect the angle of both bodies; those of a rod are along it. The openings of a joint
are those of its family (``elements.joint_motion``). Arrays may have leading axes of poses.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.elements.joint_motion import Columns
from mbsvib.linalg.displacements import Displacement
from mbsvib.linalg.rotations import components_first, exponential, frames_along, logarithm, skew

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Index
    from mbsvib.elements import Joint
    from mbsvib.kinematics.pose import Pose


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


Axes = Callable[[Joints, "Pose"], "Array"]


def _between_axes(joints: Joints, pose: Pose) -> Array:
    """Axes along the first axis, along the normal of both axes, and perpendicular to these."""
    first_axis = pose.vectors(joints.first, joints.first_axis)
    normal = _cross(first_axis, pose.vectors(joints.second, joints.last_axis))
    normal /= np.sqrt((normal * normal).sum(axis=-1, keepdims=True))
    return np.stack((first_axis, normal, _cross(normal, first_axis)), axis=-1)


def _halfway(joints: Joints, pose: Pose) -> Array:
    first, second = pose.rotations.take(joints.first, axis=-3), pose.rotations.take(joints.second, axis=-3)
    return np.asarray(first @ exponential(0.5 * logarithm(first.swapaxes(-1, -2) @ second)))


def _along_rod(joints: Joints, pose: Pose) -> Array:
    rod = pose.points(joints.second, joints.end) - pose.points(joints.first, joints.start)
    return frames_along(rod / np.sqrt((rod * rod).sum(axis=-1, keepdims=True)))


def _cross(a: Array, b: Array) -> Array:
    """Return the vector products of (..., 3)."""
    return np.asarray((skew(a) @ b[..., None])[..., 0])


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

    ``first``, ``second`` (k,) are their bodies, ``end`` (..., k, 3) their points on the second one [m], ``columns``
    their directions as components (..., k).
    """

    motion: Any
    rows: Index
    first: Index
    second: Index
    end: Array
    columns: Columns

    def at(self, pose: Pose) -> list[Any]:
        """Return what they are open in a pose [m, rad], one array (..., k) for each locked direction."""
        first, second = pose.rotations.take(self.first, axis=-3), pose.rotations.take(self.second, axis=-3)
        back = first.swapaxes(-1, -2)
        apart = pose.points(self.second, self.end) - pose.points(self.first, self.end)
        shift: Any = tuple(components_first((back @ apart[..., None])[..., 0]))
        rows = components_first((back @ second).swapaxes(-1, -2))
        rotation: Any = tuple([tuple(components_first(row)) for row in rows])
        opened: list[Any] = self.motion.openings(Displacement(rotation, shift, self.columns.point), self.columns)
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
        result.append(Openings(motion, which, arrays.first, arrays.second, arrays.end, columns))
    return tuple(result)


def _components(vectors: Array) -> Any:
    return tuple(components_first(np.asarray(vectors)))


def _directions(groups: Sequence[Any]) -> Any:
    """Directions (name, six components (k,)) of joints of one form."""
    return tuple([(groups[0][i][0], _components(np.array([group[i][1] for group in groups])))
                  for i in range(len(groups[0]))])  # fmt: skip
