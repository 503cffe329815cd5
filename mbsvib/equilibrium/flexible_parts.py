"""Beams and superelements on their way to another pose: they go along as they are, as rigid bodies would."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np

from mbsvib.elements import body as _body
from mbsvib.elements import joint as _joint
from mbsvib.elements.beam import Beam
from mbsvib.equations.beam_prestress import weights
from mbsvib.errors import ModelError
from mbsvib.mechanism.mechanism import GROUND, Mechanism
from mbsvib.mechanism.rebuilding import changed

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mbsvib.elements.superelement import Superelement
    from mbsvib.equilibrium.pose import Pose
    from mbsvib.equilibrium.report import Equilibrium

M = TypeVar("M", bound=Mechanism)

# Axes of elements count as carried along when they are off by no more than so much rounding.
SAME = 1e-12


def stiffened(model: M) -> M:
    """Return the same mechanism with fixed joints in place of beams and superelements, their nodes among its bodies.

    The weight of beams is that of loads on the nodes, as linearize has it; inputs and outputs, which may refer to
    elements of beams, are left out.

    Parameters
    ----------
    model : Mechanism
        The mechanism.

    Returns
    -------
    Mechanism
        The same model if nothing in it bends.
    """
    if not model.composed:
        return model
    bodies, joints, loads = dict(model.bodies), dict(model.joints), dict(model.loads)
    flexible = cast("list[Beam | Superelement]", list(model.composed.values()))
    for part in flexible:
        for node, point in part.node_names.items():
            bodies[node] = _body.make(node, 0.0, (0.0, 0.0, 0.0), point, None)
    for part in flexible:
        if isinstance(part, Beam) and model.gravity is not None and any(model.gravity):
            loads |= {load.name: load for load in weights(part, model.gravity)}
        places = held(part)
        root = root_of(part)
        for k, (body, point) in enumerate(places.items()):
            if body != root:
                name = f"{part.name} holds {k}"
                joints[name] = _joint.make(name, "fixed", root, body, point, None, None, None, None, None)
    return model.with_parts(bodies=bodies, composed={}, joints=joints, loads=loads, inputs={}, outputs={})


def held_as(model: M, found: Equilibrium[M]) -> Equilibrium[M]:
    """Return what holds a mechanism, found for the stiffened one.

    Parameters
    ----------
    model : Mechanism
        The mechanism.
    found : Equilibrium
        What preloads hold the stiffened one.

    Returns
    -------
    Equilibrium
        The same for the mechanism itself.
    """
    if not model.composed:
        return found

    changes = {name: {word: value for word, value in part.words().items() if word in ("preload", "free_length")}
               for name, part in found.model.springs.items()}  # fmt: skip
    return replace(found, model=changed(model, changes))


def held(part: Beam | Superelement) -> dict[str, Any]:
    """Return the bodies that a beam or superelement holds together, nodes and ground included, and a point of each.

    Parameters
    ----------
    part : Beam or Superelement
        The part.

    Returns
    -------
    dict of str to tuple
        Points [m] by body.
    """
    if isinstance(part, Beam):
        return {part.node(i): point for i, point in enumerate(part.points)}
    points = {part.body_of(i): point for i, (_, point) in enumerate(part.nodes)}
    return points | ({GROUND: part.nodes[0][1]} if part.grounded else {})


def root_of(part: Beam | Superelement) -> str:
    """Return the body along with which a beam or superelement goes.

    Parameters
    ----------
    part : Beam or Superelement
        The part.

    Returns
    -------
    str
        Ground if it holds that, else the first body that it holds.
    """
    bodies = held(part)
    return GROUND if GROUND in bodies else next(iter(bodies))


def words_at(part: Beam | Superelement, pose: Pose) -> dict[str, Any]:
    """Return the words of a beam or superelement in another pose, to which it goes as a rigid body.

    Parameters
    ----------
    part : Beam or Superelement
        The part.
    pose : Pose
        The pose of all bodies and nodes.

    Returns
    -------
    dict
        Words of its adder.

    Raises
    ------
    ModelError
        If no single direction says where the y axes of its elements have gone.
    """
    words, root = part.words(), root_of(part)
    if pose.stays(root):
        return words
    if not isinstance(part, Beam):
        words["nodes"] = {name: pose.point(root, point) for name, point in part.nodes}
        words["orientation"] = pose.turned(root, part.orientation)
        return words
    for key in ("start", "end"):
        if words.get(key) is not None:
            words[key] = pose.point(root, words[key])
    if words.get("nodes") is not None:
        words["nodes"] = [pose.point(root, point) for point in words["nodes"]]
    if words.get("axis") is not None:
        words["axis"] = pose.turned(root, words["axis"])
    before = part.frames()
    sideways = np.array(before[0][1])[:, 1] if part.y_axis is None else np.array(part.y_axis)
    words["y_axis"] = pose.turned(root, sideways)
    _check_axes(part, words, [pose.turned(root, axes) for _, axes in before])
    return words


def _check_axes(part: Beam, words: Mapping[str, Any], expected: list[Any]) -> None:
    from mbsvib.elements.beam import make

    found = [np.array(axes) for _, axes in make(**words).frames()]
    if max(float(np.abs(a - b).max()) for a, b in zip(found, expected, strict=True)) > SAME:
        raise ModelError(f"beam '{part.name}': its elements have horizontal y axes, which no single y_axis can say in "
                         f"another pose; give it a y_axis, or make it of straight beams.", element=part.name,
                         field="y_axis")  # fmt: skip
