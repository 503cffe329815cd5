"""The same mechanism in another pose, by the values of joint coordinates."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.expected import names
from mbsvib.equilibrium.articulation import with_rigid_parts
from mbsvib.equilibrium.bending import elastic_mechanism, pose_of_least_energy
from mbsvib.equilibrium.linear_range import warn_beyond
from mbsvib.equilibrium.motion import close, posed_model, same_branch, step_to_close
from mbsvib.equilibrium.moved_parts import model_in_pose
from mbsvib.equilibrium.vector_coordinates import held_vectors
from mbsvib.errors import ModelError, nearest
from mbsvib.kinematics.loops import reduce
from mbsvib.kinematics.relative_motion import arm
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.mechanism.topology import cut_elsewhere

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.equilibrium.motion import PosedModel
    from mbsvib.equilibrium.pose import Pose

M = TypeVar("M", bound=Mechanism)

# The longest step [rad, mechanism sizes] in which loops are kept closed, and the shortest that is still tried.
LONGEST, SHORTEST = 0.2, 1e-5
# Loops count as closed in the end when they are open by less than this share of the mechanism's size, or by rounding.
TOLERANCE = 1e-12


def moved(
    model: M, values: Mapping[str, float], relaxed: bool = False, cut: Sequence[str] | None = None
) -> M:
    """Return the model in another pose; see ``Model.moved``.

    Parameters
    ----------
    model : Mechanism
        The model in its reference pose.
    values : mapping of str to float
        Displacements of joint coordinates [m, rad].
    relaxed : bool
        Whether springs keep the forces of the reference pose.
    cut : sequence of str, optional
        Joints at which loops are to be cut.

    Returns
    -------
    Mechanism
        The model in the new pose.

    Raises
    ------
    ModelError
        If a coordinate is unknown or depends on the others, or loops cannot be closed there.
    """
    if not isinstance(values, Mapping):
        raise check.refuse("moved", "values", values, "a mapping of joint coordinates to values, {'hinge.rz': 0.1}")
    displacements = {str(name): check.number(value, "moved", str(name)) for name, value in values.items()}
    stiff = with_rigid_parts(model)
    cut_joints = None if cut is None else tuple(names(cut, "moved", "cut", ModelError))
    try:
        return model_in_pose(model, _rigid_pose(stiff, displacements, cut_joints), relaxed)
    except ModelError:
        if relaxed or not model.composed or not set(displacements) <= _all_coordinates(stiff):
            raise
        bent = _bent_model(model, displacements, cut_joints)
        if bent is None:
            raise
        return bent


def _rigid_pose(stiff: Mechanism, displacements: Mapping[str, float], cut: tuple[str, ...] | None) -> Pose:
    """The pose of a mechanism whose parts are rigid."""
    at = posed_model(stiff, cut=cut_elsewhere_of(stiff, displacements) if cut is None else cut)
    target = np.zeros(len(at.coordinates.names))
    for name, value in displacements.items():
        if name not in at.coordinates.names:
            known = at.coordinates.names
            raise ModelError(f"moved: '{name}' is not a joint coordinate of model '{stiff.name}'."
                             f"{nearest(name, known)} It has {', '.join(known[:8])}"
                             f"{', ...' if len(known) > 8 else ''}.", element=name, field="values")  # fmt: skip
        target[at.coordinates.names.index(name)] = value
    return at.moved(target).pose if at.cuts is None else _follow(at, target, list(displacements)).pose


def _all_coordinates(model: Mechanism) -> set[str]:
    return {f"{joint.name}.{name}" for joint in model.joints.values() for name, _ in joint.freedom}


def _bent_model(model: M, displacements: Mapping[str, float], cut: tuple[str, ...] | None) -> M | None:
    """The model in the pose with its beams and superelements bent, or None if that pose cannot be reached either."""
    mechanism = elastic_mechanism(model)
    cut = cut_elsewhere_of(mechanism, displacements) if cut is None else cut
    reached = pose_of_least_energy(mechanism, displacements, cut)
    if reached is None:
        return None
    result = model_in_pose(model, reached[0].pose)
    warn_beyond(result)
    return result


def _follow(at: PosedModel, target: Array, names: list[str]) -> PosedModel:
    """Take the independent coordinates to their values in steps along which the loops stay closed."""
    assert at.cuts is not None
    arms = partial(arm, at.kinematics.topology, at.pose.centre[:-1])
    reduction = reduce(at.coordinates, at.cuts, at.closure, names, arms)
    depends = np.ones(len(target), dtype=bool)
    depends[reduction.independent] = False
    longest = float(np.abs(target / at.scale).max(initial=0.0))
    done, step = 0.0, min(1.0, LONGEST / max(longest, LONGEST))
    held = held_vectors(at.reference, at.coordinates, depends)
    at, gap = close(at, depends, held)
    while done < 1.0:
        share = min(step, 1.0 - done)
        independent, reached = np.where(depends, 0.0, share * target / at.scale), held.at((done + share) * target)
        q = step_to_close(at, np.zeros(len(at.openings)), depends, held, independent)
        # dependent motions many times larger than the step indicate a jump or a dead point
        small = np.abs(q / at.scale).max(initial=0.0) <= 10.0 * LONGEST
        attempt, gap = close(at.moved(q), depends, reached) if small else (at, np.inf)
        closed = gap <= max(TOLERANCE, attempt.rounding) and _near(at, attempt)
        if closed and same_branch(at, attempt, depends, (held, reached)):
            at, held, done, step = attempt, reached, done + share, min(2.0 * step, LONGEST / max(longest, LONGEST))
            continue
        step = 0.5 * share
        if step * longest < SHORTEST:
            raise _unreachable(at, target, names, done, gap)
    return at


def _near(first: PosedModel, second: PosedModel) -> bool:
    """Tell whether no body moved so far in one step that loops may have jumped to another branch."""
    turned = np.einsum("kij,kij->k", first.pose.rotations, second.pose.rotations)
    went = np.abs(second.pose.centre - first.pose.centre).max()
    return bool(turned.min() > 1.0 + 2.0 * np.cos(5.0 * LONGEST) and went < 5.0 * LONGEST * first.size)


def _unreachable(at: PosedModel, target: Array, names: list[str], done: float, gap: float) -> ModelError:
    reached = ", ".join(f"{name} = {done * target[at.coordinates.names.index(name)]:.6g}" for name in names)
    loops = ", ".join(at.cuts.joints if at.cuts else ())
    open_by = f" beyond it they stay open by {gap:.1e} of the mechanism's size" if np.isfinite(gap) else \
        " there the other joints would have to jump"  # fmt: skip
    return ModelError(
        f"moved: the loops closed by {loops} can be closed up to {reached} and no further;{open_by}. Ask for a pose "
        f"short of it, or name another coordinate.", element=names[0] if names else None, field="values",
    )  # fmt: skip


def cut_elsewhere_of(model: Mechanism, coordinates: Iterable[str]) -> tuple[str, ...]:
    """Return joints to cut so that the joints of the coordinates asked for are part of the tree."""
    cut, closing = cut_elsewhere(model, {name.rsplit(".", 1)[0] for name in coordinates} & set(model.joints))
    if closing is not None:
        raise ModelError(f"moved: all joints of the loop that '{closing}' closes have a value; leave one of them to "
                         f"follow from the others.", element=closing, field="values")  # fmt: skip
    return cut
