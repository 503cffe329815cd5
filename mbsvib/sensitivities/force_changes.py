"""What parameters change of the forces at the pose that is no parameter itself, and how both follow the bodies."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.linalg.rotations import skew
from mbsvib.sensitivities.families import rules_of
from mbsvib.sensitivities.families.pose_changes import PoseRates
from mbsvib.sensitivities.families.rules import crossed
from mbsvib.sensitivities.force_layout import ForceChanges, ForceLayout, RowTerms

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.sensitivities.forces import Forces
    from mbsvib.sensitivities.network import Network
    from mbsvib.sensitivities.variables import FieldLayout


def internal_parameters(network: Network) -> list[tuple[str, str, tuple[int, ...]]]:
    """Return part, field and index of all numbers that change with the pose and are no parameters of the model: axes
    of torsion springs and rotors, the place and orientation of beams and superelements that keep their shape.
    """
    internal = [(part.name, *rules_of(part).internal) for part in network.parts]
    return [(name, field, (i,)) for name, field, count in internal for i in range(count)]


def force_changes(network: Network, forces: Forces, layout: FieldLayout) -> ForceChanges:
    """Return what parameters change of the forces at the pose."""
    at = ForceLayout.of(forces)
    keys = (*layout.keys(), *internal_parameters(network))
    terms = RowTerms({key: k for k, key in enumerate(keys)}, at)
    for k, part in enumerate((*network.joints, *network.springs, *network.bodies, *network.loads)):
        for field in part.point_fields:  # a line begins at the first one
            starts = k in at.lines and field == part.point_fields[0]
            terms.along(part.name, field, at.start_of(k) if starts else at.point_of(k))
    for part, k in network.carriers_of_force:
        rules_of(part).add_force_terms(terms, network, forces, part, k)
    return ForceChanges(terms.row, at, terms.matrix(at.size))


def parameter_rates(network: Network, forces: Forces, changes: ForceChanges, motion: Array) -> Array:
    """Return the changes (parameters, c) of parameters as bodies move, as those of a model do that is described in the
    new pose.

    ``motion`` (bodies, 6, c): motions at the centres of mass.
    """
    rates = PoseRates(network, forces, changes, motion)
    rates.carry([part for part, _ in network.carriers_of_force])
    for part, k in network.carriers_of_force:
        rules_of(part).follow(rates, part, k)
    return rates.table


def force_rates(network: Network, forces: Forces, changes: ForceChanges, motion: Array) -> Array:
    """Return the changes (e, c) of forces as bodies move, beyond what parameters say of it: of springs by their
    stiffness, of bushings by the turn between their bodies, of followers with theirs.

    ``motion`` (bodies, 6, c): motions at the centres of mass.
    """
    relative, at = forces.relative_motions(motion)[1], changes.at
    result = np.zeros((at.size, motion.shape[2]))
    joints, springs = forces.counts[:2]
    strained = relative[joints : joints + springs]
    change = -network.stiffness @ strained
    # a moment turns with half of the turn between the bodies
    change[:, 3:] += 0.5 * skew(forces.wrench[joints : joints + springs, 3:]).swapaxes(1, 2) @ strained[:, 3:]
    # what a free length does is said by the parameters
    change[[getattr(spring, "free_length", None) is not None for spring in network.springs]] = 0.0
    result[at.wrench.start : at.wrench.start + 6 * springs] = change.reshape(6 * springs, motion.shape[2])
    result[at.twist] = relative[forces.bushings, 3:].reshape(3 * len(forces.bushings), relative.shape[2])
    for k in forces.follower.tolist():
        result[at.wrench_of(k) : at.wrench_of(k) + 6] = crossed(relative[k, 3:], forces.wrench[k])
    return result
