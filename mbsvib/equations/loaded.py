"""Steps of the assembly: loads, spin, and coordinates that inputs prescribe; also for many variants at once.

Of prescribed coordinates the equations become columns of inputs, and rows of the drives' forces.

With the driven coordinates d among the minimal ones and f the others,

M_ff q'' + C_ff q' + K_ff q = B_f u - K_fd d - C_fd d' - M_fd d'',   y = Cq_f q + ... + Cq_d d + Cv_d d' + Ca_d d'',

and the drives push with M_df q'' + C_df q' + K_df q + M_dd d'' + C_dd d' + K_dd d - B_d u. Whatever else acts
along d in the given pose they hold as well; forces along a coordinate itself have no stiffness.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.elements.motion_input import DrivenCoordinate
from mbsvib.equations.batch_values import Values
from mbsvib.equations.draft import Draft
from mbsvib.equations.load_stiffness import LoadedPairs, curvature_stiffness, load_stiffness, loaded_pairs
from mbsvib.equations.matrices import Terms
from mbsvib.equations.placing import scene_of_variant
from mbsvib.equations.spin_terms import Spin, check_spin, cross_couplings, momenta, with_antisymmetric_terms
from mbsvib.equations.statics import Reactions, Statics, check_balance, forces_along, loop_multipliers
from mbsvib.equations.steady_spin import NONE, spin_velocities
from mbsvib.equations.wrenches import has_antisymmetric_forces
from mbsvib.errors import EquilibriumError
from mbsvib.kinematics.loops import Reduction
from mbsvib.linalg.products import widened
from mbsvib.linalg.rank import BALANCE
from mbsvib.mechanism.drives import driven_coordinates
from mbsvib.mechanism.mechanism import Mechanism


def with_loads(draft: Draft) -> Draft:
    """Return equations of motion with the stiffness of loads, and the forces at the pose."""
    scene, reduction, terms = draft.scene, draft.reduction, draft.terms
    assert scene.loads is not None
    applied = scene.loads[0]
    residual, size = forces_along(scene, terms.body_motion)
    driven = draft.model.derived(driven_coordinates)
    if driven:  # the drives hold what acts along their coordinates
        residual[..., np.isin(draft.names, driven)] = 0.0
    if draft.checked:
        _check_balance(draft, residual, size)
    loaded = _pairs(draft)
    multipliers = loop_multipliers(reduction, draft.kept, draft.phi, loaded.gradient)
    reactions = Reactions(scene, reduction, draft.phi, draft.kept, draft.varied.points)
    of_loads = load_stiffness(scene, reduction, loaded, multipliers, every=draft.variants is not None)
    joints = len(scene.owners) + len(applied.names)
    everything = np.full(of_loads.stiffness.shape[-1], joints + len(scene.topology.joints))
    terms = terms.with_rows(of_loads.rows, of_loads.stiffness, everything, of_loads.matrix)
    terms = terms.with_antisymmetric(None, of_loads.circulatory)
    if any(coupler.curvatures for coupler in scene.couplers):
        rows, stiffness, owner = curvature_stiffness(scene, reduction, -multipliers)
        terms = terms.with_rows(rows, stiffness, joints + owner)
    statics = Statics(applied, reactions, loaded, multipliers, residual, size)
    return replace(draft, terms=terms, statics=statics, reactions=reactions, loaded=loaded, multipliers=multipliers)


def _pairs(draft: Draft) -> LoadedPairs:
    """The pairs of the scene; those of a single model are kept with its loads as long as its tree is the same."""
    scene = draft.scene
    assert scene.loads is not None
    known: LoadedPairs | None
    topology, known = scene.loads[1].get("pairs", (None, None))
    if topology is scene.topology and known is not None:
        return known
    pairs = loaded_pairs(scene, draft.varied.axes, draft.varied.lengths)
    scene.loads[1]["pairs"] = scene.topology, pairs
    return pairs


def _check_balance(draft: Draft, residual: Array, size: Array) -> None:
    """Refuse a pose, or a variant by its index, that is not in balance."""
    scene, reduction, name, stiffness = draft.scene, draft.reduction, draft.model.name, draft.terms.K
    if draft.variants is None:
        return check_balance(residual, size, stiffness, scene, reduction, name)
    for i in np.flatnonzero((np.abs(residual) > BALANCE * size).any(axis=-1)).tolist():
        at = [array if array.ndim == k else array[i] for array, k in ((residual, 1), (size, 1), (stiffness, 2))]
        try:
            check_balance(at[0], at[1], at[2], scene_of_variant(scene, i), reduction, name)
        except EquilibriumError as error:
            error.args = (f"variant {draft.variants.first + i}: {error}", *error.args[1:])
            raise
    return None


def with_driven_coordinates(draft: Draft) -> Draft:
    """Return equations of motion in the coordinates that are not driven, with the motions of the others as inputs."""
    terms, names = draft.terms, draft.names
    number = {name: k for k, name in enumerate(draft.model.derived(driven_coordinates))}
    d = np.array([names.index(name) for name in number])
    f = np.setdiff1d(np.arange(len(names)), d)
    forces, outputs = (terms.K, terms.C, terms.M), (terms.Cq, terms.Cv, terms.Ca)
    every = (terms.B, terms.D, *forces, *outputs)
    b, through, *measured = (widened(matrix, *every) for matrix in (
        terms.B[..., f, :], terms.D, *[matrix[..., f] for matrix in outputs]))  # fmt: skip
    sources: list[Any] = list(draft.model.inputs.values())
    columns = [(i, part.order, d[number[part.element]]) for i, part in enumerate(sources)
               if isinstance(part, DrivenCoordinate)]  # fmt: skip
    for i, order, k in columns:
        b[..., i], through[..., i] = -forces[order][..., f, k], outputs[order][..., k]
    for row, weights in _of_drives(draft, tuple(number)):
        for matrix, whole in zip(measured, forces, strict=True):
            matrix[..., row, :] += weights @ whole[..., d[:, None], f]
        through[..., row, :] -= weights @ terms.B[..., d, :]
        for i, order, k in columns:
            through[..., row, i] += forces[order][..., d, k] @ weights
    reduction = draft.reduction
    matrix = np.eye(len(names)) if reduction.matrix is None else reduction.matrix
    statics = draft.statics
    if statics is not None:
        statics = replace(statics, residual=statics.residual[..., f], size=statics.size[..., f])
    kept = _restricted(terms, f) | dict(zip(("Cq", "Cv", "Ca"), measured, strict=True))
    return replace(draft, minimal=tuple([draft.minimal[k] for k in f]), statics=statics,
                   terms=replace(terms, **kept, B=b, D=through),
                   reduction=Reduction(reduction.independent[f], matrix[..., f], reduction.groups))  # fmt: skip


def _restricted(terms: Terms, f: Array) -> dict[str, Any]:
    """Square matrices and factors in some of the coordinates."""
    square = {key: getattr(terms, key) for key in ("M", "C", "K", "gyroscopic", "circulatory")}
    result: dict[str, Any] = {key: None if value is None else value[..., f[:, None], f]
                              for key, value in square.items()}  # fmt: skip
    return result | {key: getattr(terms, key)[..., f] for key in ("inertia_factor", "elastic_rows", "body_motion")}


def _of_drives(draft: Draft, driven: Sequence[str]) -> list[tuple[int, Array]]:
    """The outputs of forces in driven joints, and the weights of the forces along the driven coordinates in them."""
    joints, result = draft.scene.topology.joints, []
    for row, kind, k, wrench in draft.scene.port.wrench_outputs:
        if kind == "joint":
            axes, freedom = np.array(joints[k].axes), dict(joints[k].freedom)
            world = np.concatenate((axes @ wrench[:3], axes @ wrench[3:]))
            weights = [-float(world @ freedom[word]) if owner == joints[k].name else 0.0
                       for owner, _, word in (name.rpartition(".") for name in driven)]  # fmt: skip
            if any(weights):
                result.append((row, np.array(weights)))
    return result


def with_spin(draft: Draft) -> Draft:
    """Return equations of motion with the antisymmetric terms of rotors and elements."""
    model, scene, fields = draft.model, draft.scene, draft.varied.fields
    rotors = {name: replace(part, speed=_largest(fields.get(name, NONE).get("speed", part.speed)))
              for name, part in model.rotors.items()}  # fmt: skip
    check_spin(model.with_parts(rotors=rotors) if fields else model, scene.bodies, scene.elements)
    return replace(draft, terms=with_antisymmetric_terms(scene, draft.reduction, draft.terms, *spin_of(draft),
                                                         model.expansion))  # fmt: skip


def _largest(speed: Any) -> float:
    values = np.ravel(np.real(speed))
    return float(values[np.abs(values).argmax()])


def spin_of(draft: Draft) -> Spin:
    """Return the angular momenta of rotors, and the cross-coupled elements."""
    if not draft.model.derived(has_antisymmetric_forces):
        return [], []
    bodies, fields = draft.scene.bodies, draft.varied.fields
    return momenta(draft.model, bodies, fields), cross_couplings(draft.model, bodies, draft.scene.elements, fields)


def spins_otherwise(model: Mechanism, values: Values) -> bool:
    """Return whether variants differ in more than speeds and momenta, so that each is to be checked by itself.

    Bodies that themselves spin must stay symmetric about their axis, and so must all that acts on them; they spin at
    one speed. Their mass may vary, and coefficients that are not zero of what holds them to bodies that do not spin.
    Elements with cross-coupling stay as they are.
    """
    spinning = {rotor.body for rotor in model.rotors.values() if rotor.inertia is None}
    for name, fields in values.index.items():
        if name in spinning and not fields.keys() <= {"mass"}:
            return True
        scaled = fields.keys() <= {"stiffness", "damping"} and values.slots.rescales(name)
        for one in (name, *values.parameters.parts[name].replaced_coefficients({})):
            part = model.joints.get(one) or model.springs.get(one)
            ends = 0 if part is None else len(spinning & {part.first, part.second})
            if getattr(part, "cross_coupling", None) is not None or (ends and not (scaled and ends == 1)):
                return True
    speeds = list(spin_velocities(model, values.fields).values())
    sizes = [np.linalg.norm(speed, axis=-1) for speed in speeds]
    return any(rotor in values.index for rotor in model.rotors) and any((size != sizes[0]).any() for size in sizes)
