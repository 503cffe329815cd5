"""What acts, as far as parts and tree say: kept with the model, so that only what depends on loops is done again."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.equations.joint_carriers import carriers
from mbsvib.equations.reactions import skew

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Index
    from mbsvib.equations.joint_carriers import Carriers
    from mbsvib.equations.scene import Scene
    from mbsvib.equations.second_order_rows import Felt
    from mbsvib.equations.wrenches import Applied

_SIGNS = np.array((-1.0, 1.0))
# what forces and what torques are multiplied with: v x f + 1/2 w x tau
_PARTS = np.array((1.0, 0.5)).reshape(2, 1, 1)


@dataclass(frozen=True, slots=True)
class Acting:
    """Applied forces on the bodies, and the geometry of all pairs, the applied ones and those of joints.

    ``ways`` lead from bodies to joints. ``wrench`` (6, bodies + 1) acts on the bodies, ``sizes`` (2, bodies + 1) are
    those of all forces and moments in it; ``pairs`` (6, applied) are the wrenches on the second bodies, then ``first``
    and ``second`` (pairs,), ``start`` and ``end`` (3, pairs) of all pairs. ``arms`` (3, 2 pairs) go from the centres
    of mass of the first and then of the second bodies, ``place`` (2 pairs, bodies) tells which body, with the sign of
    the force on it, and leaves follower loads out; ``touched`` is the same without signs. ``levers`` (k, 3, 6) times a
    wrench is v x f + 1/2 w x tau for the ``turned`` (k,) bodies, as which felt rows turn: these are the first
    of ``one`` (p,), the felt rows that are one factor of a product, each with the pair in ``turner`` (p,) that owns it.
    ``owners`` are the names of all pairs and of the bodies, ``owner`` the numbers of those that own the rows of
    ``geometric``: of bodies, of products, of lines. The joints of the open tree carry ``tree`` (6, joints, 1),
    and ``loops`` (6 joints, locked rows) is what multipliers add to that in all joints.
    """

    ways: Carriers
    wrench: Array
    sizes: Array
    pairs: Array
    first: Index
    second: Index
    start: Array
    end: Array
    arms: Array
    place: Array
    touched: Array
    levers: Array
    turned: Index
    one: Index
    turner: Index
    owners: tuple[str, ...]
    owner: Index
    tree: Array
    loops: Array


def acting(
    applied: Applied, felt: Felt, scene: Scene, memory: dict[str, Any]
) -> Acting:
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
    topology, bodies = scene.topology, len(scene.bodies)
    position = np.concatenate((scene.position, np.zeros((1, 3)))).T
    ways = carriers(topology, position)
    wrench, sizes = applied.pairs.on_bodies(position)
    wrench[:3] += applied.weight
    sizes[0] += np.sqrt(np.square(applied.weight).sum(axis=0))
    first = np.concatenate((applied.pairs.first, ways.first))
    second = np.concatenate((applied.pairs.second, ways.second))
    start = np.concatenate((applied.pairs.start, ways.start), axis=1)
    end = np.concatenate((applied.pairs.end, ways.point), axis=1)
    ends, count = np.concatenate((first, second)), len(first)
    arms = np.concatenate((start, end), axis=1)
    arms -= position[:, ends]
    sign = np.repeat(_SIGNS, count)
    sign.reshape(2, count)[:, : applied.loads][:, applied.follower] = 0.0
    place = np.zeros((2 * count, bodies + 1))
    place[np.arange(2 * count), ends] = sign
    place = place[:, :-1]
    turning = np.flatnonzero(felt.carrier < bodies)
    twist = felt.twist[:, turning].reshape(2, 3, -1) * _PARTS
    levers = skew(twist.swapaxes(0, 1)).transpose(3, 0, 2, 1).reshape(-1, 3, 6)
    turner = np.concatenate((felt.owner[turning], felt.two[0]))
    owner = np.concatenate((np.arange(count, count + bodies).repeat(6), turner, turner, felt.line_owner))
    memory["acting"] = result = Acting(
        ways, wrench, sizes, np.concatenate((applied.pairs.force, applied.pairs.torque)), first, second, start, end,
        arms, place, np.abs(place), levers, felt.carrier[turning],
        np.concatenate((turning, felt.two[1])), turner,
        (*applied.names, *(joint.name for joint in topology.joints), *topology.bodies), owner,
        ways.of_tree(wrench[:, :, None]), ways.of_locked(scene.cuts),
    )  # fmt: skip
    return result
