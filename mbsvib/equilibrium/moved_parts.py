"""Carrying: a model in another pose, with everything that is fixed to a body moved along with it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar

from mbsvib.elements import BaseMotion, Body, Bushing, ForceOutput, Input, Joint, Load, Maxwell, Output, Spring
from mbsvib.elements.coupler import Coupling
from mbsvib.elements.part import Composed, Part
from mbsvib.elements.rotor import Rotor
from mbsvib.equilibrium import flexible_parts as rigid
from mbsvib.equilibrium import joints, springs
from mbsvib.errors import ModelError
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.mechanism.rebuilding import rebuilt

if TYPE_CHECKING:
    from mbsvib.equilibrium.pose import Pose

M = TypeVar("M", bound=Mechanism)


def carried(model: M, pose: Pose, relaxed: bool = False) -> M:
    """Return a model in another pose.

    Points and axes go with the bodies that they belong to; forces fixed in the world and the directions of inputs and
    outputs stay as they are.

    Parameters
    ----------
    model : Mechanism
        The model as described.
    pose : Pose
        The pose of its bodies.
    relaxed : bool
        Whether springs and bushings keep the forces that they have as described; otherwise these follow from the
        motion.

    Returns
    -------
    Mechanism
        The same mechanism there.

    Raises
    ------
    ModelError
        If a part cannot be described in that pose.
    """
    return rebuilt(model, lambda part: _words(part, pose, relaxed))


def bare(model: M) -> M:
    """Return a model without what no equilibrium depends on: inputs, outputs, and Maxwell elements, which give way."""
    springs = {name: part for name, part in model.springs.items() if not isinstance(part, Maxwell)}
    return model.with_parts(springs=springs, inputs={}, outputs={})


def _words(part: Any, pose: Pose, relaxed: bool) -> dict[str, Any] | Part:
    if isinstance(part, Body):
        return _body(part, pose)
    if isinstance(part, (Joint, Spring, Bushing, Maxwell)):
        if pose.stays(part.first) and pose.stays(part.second):
            return part
        return joints.words_at(part, pose) if isinstance(part, Joint) else springs.words_at(part, pose, relaxed)
    if isinstance(part, Composed):
        return rigid.words_at(part, pose)  # type: ignore[arg-type]
    if isinstance(part, (Load, Input, Output)):
        return _applied(part, pose)
    if isinstance(part, Rotor):
        return part.words() | {"axis": pose.direction(part.body, part.axis)}
    if isinstance(part, (BaseMotion, ForceOutput, Coupling)):
        return part
    what = type(part).__name__.lower()
    raise ModelError(f"{what} '{part.name}': no {what} can be taken to another pose yet; give the model in that pose.",
                     element=part.name)  # fmt: skip


def _applied(part: Load | Input | Output, pose: Pose) -> Part:
    """A force or an output there; its direction is fixed in the world, but that of a follower load."""
    if pose.stays(part.body):
        return part
    changes: dict[str, Any] = {} if part.position is None else {"position": pose.point(part.body, part.position)}
    if isinstance(part, Load) and part.follower:
        changes |= {key: pose.direction(part.body, getattr(part, key)) for key in ("force", "torque")}
    return replace(part, **changes) if changes else part


def _body(body: Body, pose: Pose) -> Body:
    """The body there; nothing of it that could be refused has changed."""
    if pose.stays(body.name):
        return body
    centre = pose.centre[pose.number[body.name]]
    return replace(body, position=tuple(centre.tolist()), orientation=pose.axes(body.name, body.orientation))
