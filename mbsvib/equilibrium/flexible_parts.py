"""Beams and superelements in another pose: bent, or moved as rigid bodies.

They are linear in the frame of the body that carries them; ``elements.elastic_part`` has their forces there.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.elements.beam import Beam
from mbsvib.linalg.rank import ZERO_SUM
from mbsvib.linalg.rotations import exponential, logarithm

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.elements.part import Part
    from mbsvib.elements.superelement import Superelement
    from mbsvib.equilibrium.pose import Pose
    from mbsvib.mechanism.mechanism import Mechanism

    Flexible = Beam | Superelement


def flexible(model: Mechanism) -> list[Flexible]:
    """Return the beams and superelements of a mechanism."""
    return cast("list[Flexible]", list(model.composed.values()))


def attachment_points(part: Flexible) -> dict[str, Any]:
    """Return the bodies that a beam or superelement connects, nodes and ground included, with a point of each.

    Parameters
    ----------
    part : Beam or Superelement
        The part.

    Returns
    -------
    dict of str to tuple
        Points [m] by body.
    """
    points = dict(part.node_bodies)
    return points if part.root in points else points | {part.root: part.points[0]}


def part_in_pose(part: Flexible, pose: Pose) -> dict[str, Any] | Part:
    """Return a beam or superelement in another pose, or its arguments if it moved there as a rigid body.

    Raises
    ------
    ModelError
        If one direction cannot describe the y axes of its elements in the pose.
    """
    bodies = [body for body, _ in part.node_bodies]
    carriers = [name for name in part.carriers if name in pose.number]
    if pose.as_described or all(map(pose.is_unmoved, [part.root, *bodies, *carriers])):
        return part
    return _beam(part, bodies, pose) if isinstance(part, Beam) else _superelement(part, bodies, pose)


def _bent(root: str, bodies: list[str], points: Array, before: Array, pose: Pose) -> tuple[Array, Array, bool]:
    """Points (n, 3) of nodes and their displacements (n, 6) against the root in a pose, and whether the displacements
    have changed by more than rounding.

    ``before`` (n, 6) are the displacements in the reference pose, ``points`` (n, 3) the points there.
    """
    which, frame = np.array([pose.number[body] for body in bodies]), np.full(len(bodies), pose.number[root])
    moved_points, turn = pose.points(which, points), pose.rotations[pose.number[root]]
    change = moved_points - pose.points(frame, points)
    rotation = logarithm(turn.T @ pose.rotations[which] @ exponential(before[:, 3:]))
    after = np.concatenate((before[:, :3] @ turn.T + change, rotation @ turn.T), axis=1)
    extent = float(np.abs(np.concatenate((points, moved_points))).max())
    turned = np.abs(rotation - before[:, 3:]).max()
    return moved_points, after, bool(np.abs(change).max() > ZERO_SUM * extent or turned > ZERO_SUM)


def _beam(part: Beam, bodies: list[str], pose: Pose) -> dict[str, Any] | Part:
    count, root = len(bodies), part.root
    before = np.zeros((count, 6)) if part.displacements is None else np.array(part.displacements)
    points, after, bends = _bent(root, bodies, np.array(part.points), before, pose)
    if not bends and part.displacements is None:
        return _rigid_words(part, root, pose)
    turn = exponential(0.5 * (after[1:, 3:] + after[:-1, 3:])) @ pose.rotations[pose.number[root]]
    return part.through(points, np.einsum("eij,ej->ei", turn, part.without_forces().y_axes()), after)


def _superelement(part: Superelement, bodies: list[str], pose: Pose) -> Part:
    axes, root, count = np.array(part.orientation), part.root, len(bodies)
    before = np.zeros(len(part.M)) if part.displacements is None else np.array(part.displacements)
    world = (before[: 6 * count].reshape(-1, 3) @ axes.T).reshape(-1, 6)
    points, after, bends = _bent(root, bodies, np.array([point for _, point in part.nodes]), world, pose)
    turned = pose.rotated(root, part.orientation)
    internal = before[6 * count :].copy()
    for i, name in enumerate(part.carriers):
        k = pose.number.get(name)
        if k is not None:  # otherwise the part moves as a rigid body
            displacement = internal[3 * i : 3 * i + 3]
            displacement += (pose.centre[k] - pose.origin[k])[: len(displacement)]
    state = np.concatenate(((after.reshape(-1, 3) @ turned).reshape(-1), internal))
    bends = bends or part.displacements is not None or bool((internal != before[6 * count :]).any())
    names = [name for name, _ in part.nodes]
    return replace(
        part, nodes=tuple(zip(names, [(x, y, z) for x, y, z in points.tolist()], strict=True)),
        orientation=check.orientation(turned, part.name), displacements=tuple(state.tolist()) if bends else None,
    )  # fmt: skip


def _rigid_words(part: Beam, root: str, pose: Pose) -> dict[str, Any]:
    """Arguments of a beam that moves as a rigid body."""
    kwargs = part.constructor_kwargs()
    for key in ("start", "end"):
        if kwargs.get(key) is not None:
            kwargs[key] = pose.point(root, kwargs[key])
    if kwargs.get("nodes") is not None:
        kwargs["nodes"] = [pose.point(root, point) for point in kwargs["nodes"]]
    if kwargs.get("axis") is not None:
        kwargs["axis"] = pose.rotated(root, kwargs["axis"])
    sideways = part.y_axes() @ pose.rotations[pose.number[root]].T
    kwargs["y_axis"] = sideways[0] if np.abs(part.y_axes() - part.y_axes()[0]).max() == 0.0 else sideways
    return kwargs
