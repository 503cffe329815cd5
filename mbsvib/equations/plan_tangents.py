"""Derivatives of the equations of variants, and of what is left of the forces there, by complex steps through a plan.

Steps are along directions in the space of parameters, in the pose as it is, or along motions of the pose. Both together
give derivatives through the equilibrium: where forces R are left over,

dF/dp = F_p + F_q dq/dp,  R_q dq/dp = -R_p

Where motions without mass were separated, the condensed motions N move neither mass nor damper: M N = 0 and C N = 0
give dN, but for a part along N itself, which does not matter. With N + i h dN the formulas of the condensation hold,

T_d = -X_d^-1 X_r,  X = (N^T K N)^-1 N^T K,  S = N (N^T K N)^-1 N^T B

A direction in which motions without mass get one, or condensed ones a damper, has no derivative.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mbsvib.common.arrays import Array, Bools, Index
from mbsvib.elements.pose import Pose
from mbsvib.equations.batch_assembly import AssembledVariants, BatchPlan, assembled_variants
from mbsvib.equations.batch_equations import BatchEquations, joined
from mbsvib.equations.batch_values import STEP, Values, checked
from mbsvib.equations.draft import Draft
from mbsvib.equations.matrices import MATRICES, Terms
from mbsvib.equations.posed_scene import posed_scene
from mbsvib.linalg.qr import pivoted_qr
from mbsvib.linalg.rank import ZERO_ALONG
from mbsvib.linalg.rotations import skew
from mbsvib.mechanism.changes import Slots

RESULTS = (*MATRICES, "gyroscopic", "circulatory", "residual")


def among(plan: BatchPlan, names: Sequence[str]) -> tuple[BatchPlan, Values]:
    """Return the plan of those parameters that variants, each with another, can have at once, with their values."""
    parameters = plan.slots.parameters

    def of(which: list[str], alone: float = 0.0) -> tuple[BatchPlan, Values]:
        slots, values = Slots.of(parameters, which), np.array([parameters[name] for name in which]).reshape(-1, 1)
        values = np.concatenate((values, values + alone * np.eye(len(which))), axis=1) if alone else values
        return replace(plan, slots=slots), Values.of(slots, values)

    def taken(which: list[str]) -> bool:
        narrowed, values = of(which, 1.0)
        return narrowed.at_once(values)

    if taken(list(names)):
        return of(list(names))
    parts: dict[str, list[str]] = {}
    for name in names:
        parts.setdefault(parameters.entry(name).part, []).append(name)
    kept = [own if taken(own) else [name for name in own if taken([name])] for own in parts.values()]
    together = [name for own in kept for name in own]
    return of(together if taken(together) else [])


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


def forces_along_parameters(plan: BatchPlan, values: Values, directions: Mapping[str, Array]) -> Array | None:
    """Return the derivatives (k, coordinates of the plan) of what is left of the forces on the model along directions,
    as of ``along_parameters``; None without forces.
    """
    steps = values.stepping(directions)
    width = plan.chunk_size(steps.count)
    chunks = [assembled_variants(plan, steps.slice(start, start + width), start)
              for start in range(0, steps.count, width)]  # fmt: skip
    result = joined([chunk.residual for chunk in chunks], "residual", steps.count, width)
    if result is None:
        return None
    result = result.imag / STEP
    result[np.concatenate([chunk.lost for chunk in chunks])] = np.nan
    return np.asarray(result)


def along_poses(plan: BatchPlan, names: Sequence[str]) -> dict[str, Array] | None:
    """Return the derivatives of the matrices of the model, and of what is left of the forces, as its pose moves along
    coordinates, (coordinates, ...) each; None where poses are not stated.

    Forces change as those of springs and loads do. ``names``: of the coordinates, among those of the plan.
    """
    if plan.stressed:
        return None
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


def condensed_along(terms: Terms, before: tuple[str, ...], base: Draft) -> tuple[dict[str, Array], Bools]:
    """Return the matrices (k, ...) of steps from one variant, and a mask (k,) of those without derivative.

    ``terms``: those of the steps with all coordinates, whose names are ``before``. ``base``: the variant with its
    separation.
    """
    separation = base.separation
    assert separation is not None
    arrays = {key: array for key in (*MATRICES, "gyroscopic", "circulatory")
              if (array := getattr(terms, key)) is not None}  # fmt: skip
    count = max(len(array) if array.ndim == 3 else 1 for array in arrays.values())
    lost = np.zeros(count, dtype=bool)
    if separation.motions is not None:
        dependent = np.array([before.index(name) for name in separation.condensed], dtype=np.intp)
        null, lost = _null_along(arrays["M"], arrays["C"], separation.motions, count)
        arrays = _condensed(arrays, null, dependent)
    massless = base.terms.null_inertia
    if massless is not None:
        lost = lost | _gains(arrays["M"], massless)
    return arrays, lost


def _condensed(arrays: dict[str, Array], null: Array, dependent: Index) -> dict[str, Array]:
    """The matrices for q = T z + S u."""
    m = null.shape[-2]
    remaining = np.setdiff1d(np.arange(m), dependent)
    stiffness, left = arrays["K"], null.swapaxes(-1, -2)
    held = left @ stiffness @ null
    amplitudes = np.linalg.solve(held, left @ stiffness)
    t = np.zeros((*amplitudes.shape[:-2], m, len(remaining)), amplitudes.dtype)
    t[..., remaining, np.arange(len(remaining))] = 1.0
    t[..., dependent, :] = -np.linalg.solve(amplitudes[..., dependent], amplitudes[..., remaining])
    s, back = null @ np.linalg.solve(held, left @ arrays["B"]), t.swapaxes(-1, -2)
    square = {"M", "C", "K", "gyroscopic", "circulatory"}
    result = {key: back @ array @ t for key, array in arrays.items() if key in square}
    result |= {key: arrays[key] @ t for key in ("Cq", "Cv", "Ca")}
    result["B"] = back @ arrays["B"]
    if "circulatory" in arrays:
        result["B"] = result["B"] - back @ stiffness @ s
    return result | {"D": arrays["D"] + arrays["Cq"] @ s}


def _null_along(mass: Array, damping: Array, motions: Array, count: int) -> tuple[Array, Bools]:
    """N + i h dN (k, m, n), each motion one in a coordinate in which the others are zero, and a mask of lost steps."""
    diagonal = np.einsum("...ii->...i", np.abs(mass) + np.abs(damping)).reshape(-1, len(motions))[0]
    unit = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    n = motions.shape[1]
    own = np.sort(pivoted_qr((motions / unit[:, None]).T)[1][:n])
    others = np.setdiff1d(np.arange(len(motions)), own)
    null = motions @ np.linalg.inv(motions[own])
    both = [unit[:, None] * matrix for matrix in (mass, damping) if matrix.any()]
    both = [np.broadcast_to(matrix, (count, *matrix.shape[-2:])) / (np.abs(matrix * unit).max() or 1.0)
            for matrix in both]  # fmt: skip
    result = np.broadcast_to(null, (count, *null.shape)).astype(complex)
    rows = np.concatenate(both, axis=-2) if both else np.zeros((count, 0, len(motions)))
    if not np.iscomplexobj(rows):
        return result, np.zeros(count, dtype=bool)
    right, size = rows.imag @ null, np.abs(rows.imag) @ np.abs(null)
    matrix = rows.real[..., others] * unit[others]
    solution = np.linalg.pinv(matrix) @ right
    result.imag[:, others] = -unit[others][:, None] * solution
    left = np.abs(right - matrix @ solution)
    limit = ZERO_ALONG * size.max(axis=-2, keepdims=True, initial=0.0)
    return result, np.asarray((left > limit).any(axis=(1, 2)))


def _gains(mass: Array, massless: Array) -> Bools:
    """Whether motions without mass get one."""
    change = np.abs(massless.T @ mass.imag @ massless)
    size = np.abs(massless.T) @ np.abs(mass.imag) @ np.abs(massless)
    return np.asarray((change > ZERO_ALONG * size).any(axis=(-1, -2)))
