"""Joint coordinates that inputs prescribe: their equations become columns of inputs, and rows of the drives' forces.

With the driven coordinates d among the minimal ones and f the others,

M_ff q'' + C_ff q' + K_ff q = B_f u - K_fd d - C_fd d' - M_fd d'',   y = Cq_f q + ... + Cq_d d + Cv_d d' + Ca_d d'',

and the drives push with M_df q'' + C_df q' + K_df q + M_dd d'' + C_dd d' + K_dd d - B_d u. Whatever else acts
along d in the given pose they hold as well; forces along a coordinate itself have no stiffness.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.elements.motion_input import DrivenCoordinate
from mbsvib.kinematics.loops import Reduction
from mbsvib.mechanism.drives import driven_coordinates

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.equations.draft import Draft
    from mbsvib.equations.terms import Terms


def with_driven_coordinates(draft: Draft) -> Draft:
    """Return equations of motion in the coordinates that are not driven, with the motions of the others as inputs."""
    terms, names = draft.terms, draft.names
    number = {name: k for k, name in enumerate(draft.model.derived(driven_coordinates))}
    d = np.array([names.index(name) for name in number])
    f = np.setdiff1d(np.arange(len(names)), d)
    forces, outputs = (terms.K, terms.C, terms.M), (terms.Cq, terms.Cv, terms.Ca)
    lead = np.broadcast_shapes(*[matrix.shape[:-2] for matrix in (*forces, *outputs, terms.B, terms.D)])
    kind = np.result_type(terms.B, terms.D, *forces, *outputs)
    b, through, *measured = (np.broadcast_to(matrix, (*lead, *matrix.shape[-2:])).astype(kind) for matrix in (
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
