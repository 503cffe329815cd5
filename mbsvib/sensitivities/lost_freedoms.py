"""Parameters that take degrees of freedom away when they change alone: redundant constraints then contradict."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.sensitivities.adjoint_fields import fields, motions
from mbsvib.sensitivities.transmitted_wrenches import in_joints

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from mbsvib.sensitivities.network import Network
    from mbsvib.sensitivities.parameter_group import ParameterGroup
    from mbsvib.sensitivities.rule_terms import Terms

# Work of a state of self-stress is rounding below this share of the largest force times the largest motion anywhere.
WORKS = 1e-9


def lost_freedoms(network: Network, groups: Iterable[ParameterGroup], size: int) -> NDArray[np.bool_]:
    """Return which parameters, changed alone, take degrees of freedom away: redundant constraints then contradict.

    A change does so where a state of self-stress, forces in the locked rows that load no coordinate, works on it.

    Parameters
    ----------
    network : Network
        Bodies and connections.
    groups : iterable of ParameterGroup
        Parameters, those of joints and couplers among them.
    size : int
        Number of rows.

    Returns
    -------
    array, shape (size,)
        True where the mechanism has fewer degrees of freedom nearby.
    """
    result = np.zeros(size, dtype=bool)
    ties, dof = network.constraints, network.displacements.shape[1]
    if ties is None or not ties.stress.shape[1] or not dof:
        return result
    joints = len(network.joints)
    one = np.ones(dof)
    motion = fields(network, motions(network, np.eye(dof)), one, one, one)
    none = np.zeros((len(network.bodies), 6, ties.stress.shape[1]))
    wrench = np.concatenate((in_joints(network, none, ties.stress), np.zeros((len(network.springs), *none.shape[1:]))))
    length = float(np.ptp(network.point, axis=0).max()) or 1.0
    per_length = np.repeat([1.0, length], 3)[:, None]
    moves = float(np.abs(motion.relative * per_length).max(initial=0.0)) / length
    loads = float(np.abs(wrench[:joints] / per_length).max(initial=0.0))
    stress = replace(motion, wrench=wrench[..., None], tied=ties.stress[..., None],
                     relative=motion.relative[..., None, :])  # fmt: skip
    for group in groups:
        if group.kind not in ("joint", "coupler"):
            continue
        number, data, rows = group.part(0, len(group.number))
        work = _work(group.rule(stress, number, data))
        broken = work > WORKS * moves * (length if group.field == "orientation" else 1.0) * loads
        asked = rows >= 0
        result[rows[asked]] = broken[asked]
    return result


def _work(terms: list[Terms]) -> Any:
    """Largest product of a force and a change, (parts, entries)."""
    return np.stack([np.abs(sum(p * q for p, q in entry)).reshape(len(entry[0][0]), -1).max(axis=1)
                     for entry in terms], axis=1)  # fmt: skip
