"""Applied forces and the geometry of all wrench pairs: they depend on parts and tree only, and are cached with them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.equations.force_paths import force_paths
from mbsvib.equations.geometric_stiffness import geometric_terms
from mbsvib.equations.statement import JointRows, joint_rows
from mbsvib.equations.wrench_pairs import WrenchPairs

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Index
    from mbsvib.equations.force_paths import ForcePaths
    from mbsvib.equations.geometric_stiffness import GeometricTerms
    from mbsvib.equations.scene import Scene
    from mbsvib.equations.second_order_rows import SecondOrderRows
    from mbsvib.equations.wrenches import AppliedWrenches


@dataclass(frozen=True, slots=True)
class AppliedForces:
    """Applied forces on the bodies, and the geometry of all wrench pairs, the applied ones and those of joints.

    ``wrench`` (6, bodies + 1) acts on the bodies; ``sizes`` (2, bodies + 1) are the sums of the lengths of its forces
    and moments; ``pairs`` (6, applied) are the wrenches on the second bodies; ``first`` and ``second`` (pairs,),
    ``start`` and ``end`` (3, pairs) those of all pairs. ``owners`` are the names of all pairs and of the bodies.
    ``geometric`` is the geometric stiffness, and ``geometric_rows`` its rows in joint coordinates. ``tree_wrenches``
    (6, joints, 1) are the wrenches in joints of the open tree, ``multiplier_wrenches`` (6 joints, locked rows) those
    in all joints per unit of each multiplier.
    """

    paths: ForcePaths
    wrench: Array
    sizes: Array
    pairs: Array
    first: Index
    second: Index
    start: Array
    end: Array
    owners: tuple[str, ...]
    geometric: GeometricTerms
    tree_wrenches: Array
    multiplier_wrenches: Array
    geometric_rows: JointRows

    @property
    def reach(self) -> float:
        """Largest coordinate of a point [m], to which the rounding of points is relative."""
        return max(float(np.abs(self.start).max(initial=0.0)), float(np.abs(self.paths.position).max(initial=0.0)))


def applied_forces(
    applied: AppliedWrenches, second_order: SecondOrderRows, scene: Scene, cache: dict[str, Any]
) -> AppliedForces:
    """Return the applied forces of a mechanism, the cached ones if its tree is the same."""
    cached: AppliedForces | None = cache.get("applied_forces")
    if cached is not None and cached.paths.topology is scene.topology:
        return cached
    topology = scene.topology
    position = np.concatenate((scene.position, np.zeros((1, 3)))).T
    paths = force_paths(topology, position)
    wrench, sizes = applied.on_bodies(position)
    first = np.concatenate((applied.pairs.first, paths.first))
    second = np.concatenate((applied.pairs.second, paths.second))
    start = np.concatenate((applied.pairs.start, paths.start), axis=1)
    end = np.concatenate((applied.pairs.end, paths.point), axis=1)
    geometric = geometric_terms(WrenchPairs(first, second, start, end, end, end), applied, second_order, position)
    cache["applied_forces"] = result = AppliedForces(
        paths, wrench, sizes, np.concatenate((applied.pairs.force, applied.pairs.torque)), first, second, start, end,
        (*applied.names, *(joint.name for joint in topology.joints), *topology.bodies),
        geometric, paths.of_tree(wrench[:, :, None]), paths.of_locked(scene.cuts),
        joint_rows(geometric.rows, scene.coordinates),
    )  # fmt: skip
    return result
