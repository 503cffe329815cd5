"""The loaded mechanism: statics, and the geometric stiffness in addition to the elastic one.

Applied forces and the geometry of all wrench pairs depend on parts and tree only, and are cached with them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.equations.coupler_curvature import curvature_stiffness
from mbsvib.equations.force_paths import ForcePaths, force_paths
from mbsvib.equations.load_stiffness import LoadedPairs, load_stiffness, loaded_pairs
from mbsvib.equations.reactions import reactions
from mbsvib.equations.statics import Statics, balance, check_balance
from mbsvib.equations.wrench_pairs import WrenchPairs
from mbsvib.mechanism.drives import driven_coordinates

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.equations.draft import Draft
    from mbsvib.equations.scene import Scene
    from mbsvib.equations.wrenches import AppliedWrenches


@dataclass(frozen=True, slots=True)
class AppliedForces:
    """Applied forces on the bodies, and the geometry of all wrench pairs, the applied ones and those of joints.

    ``wrench`` (6, bodies + 1) acts on the bodies; ``sizes`` (2, bodies + 1) are the sums of the lengths of its forces
    and moments; ``pairs`` are all pairs, with the names ``owners``, those in joints without their sizes. ``loaded`` are
    the applied pairs for their stiffness. ``tree_wrenches`` (6, joints, 1) are the wrenches in joints of the open tree,
    ``multiplier_wrenches`` (6 joints, locked rows) those in all joints per unit of each multiplier.
    """

    paths: ForcePaths
    wrench: Array
    sizes: Array
    pairs: WrenchPairs
    owners: tuple[str, ...]
    loaded: LoadedPairs
    tree_wrenches: Array
    multiplier_wrenches: Array

    @property
    def reach(self) -> float:
        """Largest coordinate of a point [m], to which the rounding of points is relative."""
        points = (self.pairs.start, self.paths.position)
        return max(float(np.abs(array).max(initial=0.0)) for array in points)


def applied_forces(applied: AppliedWrenches, scene: Scene, cache: dict[str, Any]) -> AppliedForces:
    """Return the applied forces of a mechanism, the cached ones if its tree is the same."""
    cached: AppliedForces | None = cache.get("applied_forces")
    if cached is not None and cached.paths.topology is scene.topology:
        return cached
    topology = scene.topology
    position = np.concatenate((scene.position, np.zeros((1, 3)))).T
    paths = force_paths(topology, position)
    wrench, sizes = applied.on_bodies(position)
    none = np.zeros((3, len(paths.first)))
    of_joints = WrenchPairs(paths.first, paths.second, paths.start, paths.point, none, none)
    cache["applied_forces"] = result = AppliedForces(
        paths, wrench, sizes, WrenchPairs.join(applied.pairs, of_joints),
        (*applied.names, *(joint.name for joint in topology.joints)),
        loaded_pairs(scene), paths.of_tree(wrench[:, :, None]), paths.of_locked(scene.cuts),
    )  # fmt: skip
    return result


def with_loads(draft: Draft) -> Draft:
    """Return equations of motion with the stiffness of loads, and the forces at the pose."""
    scene, reduction, terms = draft.scene, draft.reduction, draft.terms
    assert scene.loads is not None
    applied, cache = scene.loads
    forces = applied_forces(applied, scene, cache)
    motion = terms.body_motion
    residual, size = balance(forces.wrench[:, :-1], forces.sizes[:, :-1], motion, forces.reach)
    driven = draft.model.derived(driven_coordinates)
    if driven:  # the drives hold what acts along their coordinates
        residual[np.isin(draft.names, driven)] = 0.0
    if draft.checked:
        check_balance(residual, size, terms.K, scene, reduction, draft.model.name)
    to_joints = reactions(forces.paths, scene.coordinates, scene.cuts, reduction, draft.phi, forces.multiplier_wrenches)
    multipliers = np.zeros((0, 1)) if scene.cuts is None else to_joints.multipliers(forces.tree_wrenches)
    statics = Statics(applied, to_joints, forces.pairs, forces.tree_wrenches, multipliers, forces.paths.position,
                      residual, size, forces.owners)  # fmt: skip
    of_loads = load_stiffness(scene, reduction, forces.loaded, -multipliers[:, 0])
    everything = np.full(len(of_loads.stiffness), len(scene.owners) + len(forces.owners))
    terms = terms.with_rows(of_loads.rows, of_loads.stiffness, everything, of_loads.matrix)
    terms = terms.with_antisymmetric(None, of_loads.circulatory)
    if any(coupler.curvatures for coupler in scene.couplers):
        rows, stiffness, owner = curvature_stiffness(scene, draft.reduction, multipliers[:, 0])
        terms = terms.with_rows(rows, stiffness, len(scene.owners) + len(applied.names) + owner)
    return replace(draft, terms=terms, statics=statics, reactions=to_joints, loaded=forces.loaded)
