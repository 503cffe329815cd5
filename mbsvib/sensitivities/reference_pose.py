"""Scenes that found their equilibrium elsewhere: what parameters of the model as described do to it in the pose there.

There a part is described by what its body carried along, so that changes dp of points and axes arrive as R dp, R the
turn of the body. What joins two bodies is carried by both: where these turn differently, by R_a and R_b, joints come
apart by (R_a - R_b) dp, and their bodies have to follow. Springs keep their law, so that what changes their length as
described changes their tension there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from mbsvib.sensitivities.displaced_bodies import turned
from mbsvib.sensitivities.families import rules_of
from mbsvib.sensitivities.families.pose_changes import ReferenceTerms

if TYPE_CHECKING:
    from scipy.sparse import csr_array

    from mbsvib.mechanism.mechanism import Mechanism
    from mbsvib.mechanism.parameters import Parameter
    from mbsvib.sensitivities.force_layout import ForceChanges
    from mbsvib.sensitivities.forces import Forces
    from mbsvib.sensitivities.network import Network


@dataclass(frozen=True)
class ReferencePose:
    """What p parameters as described change in the pose there: parameters by ``rates`` (p, p), forces by ``forces``
    (p, e) beside these, and joints come apart by ``openings`` (p, 6 joints) at their points. Bushings ``turned`` are
    those whose bodies turned against each other.
    """

    rates: csr_array
    forces: csr_array
    openings: csr_array
    turned: frozenset[str]

    def covers(self, entry: Parameter) -> bool:
        """Tell whether it is known what a parameter does: all but what ``turned`` bushings do about axes."""
        return entry.part not in self.turned or max(entry.index, default=0) < 3


def reference_pose(network: Network, forces: Forces, changes: ForceChanges, origin: Mechanism) -> ReferencePose:
    """Return what parameters as described do in the pose there."""
    terms = ReferenceTerms(network, forces, changes, origin)
    for part, k in network.carriers_of_force:
        terms.carry(part)
        rules_of(part).add_reference_terms(terms, part, k)
    terms.close()
    return ReferencePose(terms.parameters.matrix(changes.count), terms.forces.matrix(changes.at.size),
                         terms.openings.matrix(6 * len(network.joints)), turned(origin, network.parts))  # fmt: skip
