"""What acts, as far as parts and tree say: kept with the model, so that only what depends on loops is done again."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.equations.geometric_stiffness import geometric_terms
from mbsvib.equations.joint_carriers import carriers
from mbsvib.equations.statement import JointRows, joint_rows
from mbsvib.equations.wrench_pairs import Pairs

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Index
    from mbsvib.equations.geometric_stiffness import GeometricTerms
    from mbsvib.equations.joint_carriers import Carriers
    from mbsvib.equations.scene import Scene
    from mbsvib.equations.second_order_rows import Felt
    from mbsvib.equations.wrenches import Applied


@dataclass(frozen=True, slots=True)
class Acting:
    """Applied forces on the bodies, and the geometry of all pairs, the applied ones and those of joints.

    ``ways`` lead from bodies to joints. ``wrench`` (6, bodies + 1) acts on the bodies, ``sizes`` (2, bodies + 1) are
    those of all forces and moments in it; ``pairs`` (6, applied) are the wrenches on the second bodies, then ``first``
    and ``second`` (pairs,), ``start`` and ``end`` (3, pairs) of all pairs. ``owners`` are the names of all pairs and of
    the bodies, ``terms`` the rows of geometric stiffness. The joints of the open tree carry ``tree`` (6, joints, 1),
    and ``loops`` (6 joints, locked rows) is what multipliers add to that in all joints. ``rows`` are those of ``terms``
    in joint coordinates.
    """

    ways: Carriers
    wrench: Array
    sizes: Array
    pairs: Array
    first: Index
    second: Index
    start: Array
    end: Array
    owners: tuple[str, ...]
    terms: GeometricTerms
    tree: Array
    loops: Array
    rows: JointRows


def acting(applied: Applied, felt: Felt, scene: Scene, memory: dict[str, Any]) -> Acting:
    """Return what acts on a mechanism; as long as its tree is the same, what was found before.

    Parameters
    ----------
    applied : Applied
        What loads the mechanism.
    felt : Felt
        What forces feel.
    scene : Scene
        The mechanism in numbers.
    memory : dict
        Where the result is kept.

    Returns
    -------
    Acting
        Forces on bodies, and geometry.
    """
    kept: Acting | None = memory.get("acting")
    if kept is not None and kept.ways.topology is scene.topology:
        return kept
    topology = scene.topology
    position = np.concatenate((scene.position, np.zeros((1, 3)))).T
    ways = carriers(topology, position)
    wrench, sizes = applied.pairs.on_bodies(position)
    wrench[:3] += applied.weight
    sizes[0] += np.sqrt(np.square(applied.weight).sum(axis=0))
    first = np.concatenate((applied.pairs.first, ways.first))
    second = np.concatenate((applied.pairs.second, ways.second))
    start = np.concatenate((applied.pairs.start, ways.start), axis=1)
    end = np.concatenate((applied.pairs.end, ways.point), axis=1)
    terms = geometric_terms(Pairs(first, second, start, end, end, end), applied, felt, position)
    memory["acting"] = result = Acting(
        ways, wrench, sizes, np.concatenate((applied.pairs.force, applied.pairs.torque)), first, second, start, end,
        (*applied.names, *(joint.name for joint in topology.joints), *topology.bodies),
        terms, ways.of_tree(wrench[:, :, None]), ways.of_locked(scene.cuts), joint_rows(terms.rows, scene.coordinates),
    )  # fmt: skip
    return result
