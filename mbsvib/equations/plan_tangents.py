"""Derivatives of the equations of variants, and of what is left of the forces there, by complex steps through a plan.

Steps are along directions in the space of parameters, in the pose as it is, or along motions of the pose. Both together
give derivatives through the equilibrium: where forces R are left over,

dF/dp = F_p + F_q dq/dp,  R_q dq/dp = -R_p
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.equations.batch_assembly import assembled_variants, joined
from mbsvib.equations.batch_values import STEP, checked
from mbsvib.equations.massless_tangents import condensed_along
from mbsvib.equations.posed_scene import posed_scene
from mbsvib.equations.terms import MATRICES
from mbsvib.kinematics.pose import Pose
from mbsvib.linalg.rotations import skew

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from mbsvib.common.arrays import Array, Index
    from mbsvib.equations.batch_assembly import AssembledVariants, BatchPlan
    from mbsvib.equations.batch_equations import BatchEquations
    from mbsvib.equations.batch_values import Values
    from mbsvib.equations.draft import Draft

RESULTS = (*MATRICES, "gyroscopic", "circulatory", "residual")


def along_parameters(
    plan: BatchPlan, variants: BatchEquations, directions: Mapping[str, Array]
) -> dict[str, Array | None]:
    """Return the derivatives of the matrices of ``variants`` along directions, (variants, directions, ...) each.

    ``directions`` (k,): rates of the parameters that vary, by name. Not a number along a direction that takes degrees
    of freedom away; None is an array that no variant has. Where forces act at the pose, ``residual`` has the
    derivatives of what is left of them along all coordinates of the plan.
    """
    values, size = variants.values, variants.values.count
    steps = values.stepping(directions)
    count, width, closure = steps.count // size, plan.chunk_size(steps.count), variants.closure
    bases = _separations(plan, values.in_equations)
    chunks = []
    for start in range(0, steps.count, width):
        which = np.arange(start, min(start + width, steps.count)) // count
        chunk = assembled_variants(plan, steps.slice(start, start + width), start,
                                   None if closure is None else closure[which])  # fmt: skip
        chunks.append(_derived(chunk, which, bases))
    lost = np.concatenate([chunk["lost"] for chunk in chunks]).reshape(size, count)
    result: dict[str, Array | None] = {}
    for key in RESULTS:
        array = joined([chunk.get(key) for chunk in chunks], key, steps.count, width)
        if array is not None:
            array = (array.imag / STEP).reshape(size, count, *array.shape[1:])
            array[lost] = np.nan
        result[key] = array
    return result


def along_poses(plan: BatchPlan, names: Sequence[str]) -> dict[str, Array] | None:
    """Return the derivatives of the matrices of the model, and of what is left of the forces, as its pose moves along
    coordinates, (coordinates, ...) each; None where poses are not stated.

    Forces change as those of springs and loads do. ``names``: of the coordinates, among those of the plan.
    """
    posed = posed_scene(plan.user_model, plan.model, plan.scene, False, ())
    parameters = plan.slots.parameters
    mass = next((name for name in parameters if parameters.entry(name).field == "mass"), None)  # anything but a place
    if posed is None or mass is None or not set(names) <= set(plan.names):
        return None
    variant = checked(parameters, {mass: parameters[mass]})
    plan = replace(plan, slots=variant.slots)
    count, described, bodies = len(names), posed.kinematics.described, plan.scene.topology.bodies
    motion: Any = np.asarray(assembled_variants(plan, variant.in_equations, 0).terms.body_motion)
    motion = motion.reshape(motion.shape[-3:])[:, :, [plan.names.index(name) for name in names]]
    rows = [bodies.index(name) for name in list(described.number)[:-1]]
    step: Any = 1j * STEP * np.concatenate((motion[rows], np.zeros((1, 6, count)))).transpose(2, 0, 1)
    pose = Pose(described.number, described.origin, described.centre + step[..., :3],
                described.rotations + skew(step[..., 3:]))  # fmt: skip
    steps = variant.stepping({mass: np.zeros(count)})
    moving = replace(plan, relaxed=False, posed=_none, poses=lambda *_: pose)
    chunk = assembled_variants(moving, steps, 0)
    arrays = _derived(chunk, np.zeros(count, dtype=np.intp), _separations(plan, variant.in_equations))
    return {key: (np.broadcast_to(array, (count, *array.shape[-1 if key == "residual" else -2 :])).imag / STEP)
            for key in RESULTS if (array := arrays.get(key)) is not None}  # fmt: skip


def _none(_: Values) -> Any:
    raise AssertionError


def _separations(plan: BatchPlan, values: Values) -> list[Draft]:
    """Each variant with the separation of its motions without mass; none where these are the same in all."""
    if plan.nominal.provenance.separation is None:
        return []
    return [assembled_variants(plan, values.slice(i, i + 1), i).separating.separation_of(0)
            for i in range(values.count)]  # fmt: skip


def _derived(chunk: AssembledVariants, which: Index, bases: Sequence[Draft]) -> dict[str, Any]:
    """The matrices of steps from the variants ``which``, whose separations of motions without mass are ``bases``."""
    forces = {"residual": chunk.residual}
    if not bases:
        return chunk.terms.named() | {"lost": chunk.lost} | forces
    parts = []
    for row in np.unique(which).tolist():
        at = which == row
        arrays, lost = condensed_along(chunk.terms.of_variants(at), chunk.plan.names, bases[row])
        parts.append((int(np.count_nonzero(at)), arrays, lost))
    result = {key: np.concatenate([np.broadcast_to(arrays[key], (count, *arrays[key].shape[-2:]))
                                   for count, arrays, _ in parts]) for key in parts[0][1]}  # fmt: skip
    lost = np.concatenate([np.broadcast_to(one, count) for count, _, one in parts])
    return result | {"lost": chunk.lost | lost} | forces
