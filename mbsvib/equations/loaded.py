"""The loaded mechanism: statics, and the geometric stiffness in addition to the elastic one; arrays may have an axis of
variants in front.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.equations.batch_geometry import scene_of_variant
from mbsvib.equations.coupler_curvature import curvature_stiffness
from mbsvib.equations.load_stiffness import load_stiffness, loaded_pairs
from mbsvib.equations.reactions import Reactions, loop_multipliers
from mbsvib.equations.statics import Statics, check_balance, forces_along
from mbsvib.errors import EquilibriumError
from mbsvib.linalg.rank import BALANCE
from mbsvib.mechanism.drives import driven_coordinates

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.equations.draft import Draft
    from mbsvib.equations.load_stiffness import LoadedPairs


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
