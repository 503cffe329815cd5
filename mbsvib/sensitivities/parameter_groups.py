"""Variables that were asked for, with the groups of the parameters that they move."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, eye_array

from mbsvib.common.arrays import Array
from mbsvib.linalg.products import product
from mbsvib.linalg.rank import ZERO_STRESS_WORK
from mbsvib.linalg.vectors import Field, incidence_sum
from mbsvib.sensitivities.adjoint_fields import Fields, fields, in_joints, motions
from mbsvib.sensitivities.forms import MatrixDerivativeGroup, ParameterGroup, form_table, groups_by_rule
from mbsvib.sensitivities.loaded_network import LoadedNetwork
from mbsvib.sensitivities.network import Network
from mbsvib.sensitivities.pose_motion import ReferencePose, pose_motion
from mbsvib.sensitivities.variables import Direction, Variables

MatrixSlopes = Callable[[Sequence[Direction], bool], Mapping[str, Array]]


@dataclass(frozen=True)
class ParameterGroups:
    """The variables asked for and the groups of the parameters that they move ``by_rule``, or with whole matrices.

    Where these go through an equilibrium, the parameters are all there are of the network ``loaded``: variables move
    them at ``rates`` (variables, parameters), None one by one, and the pose by ``motion`` (variables, c), those
    ``unresisted`` along one that nothing holds. ``slopes`` gives derivatives of whole matrices. ``every`` says that
    these are all parameters, of which some may have no derivative. ``again`` makes the same groups.
    """

    network: Network
    variables: Variables
    by_rule: tuple[ParameterGroup, ...]
    slopes: MatrixSlopes
    matrix_group: MatrixDerivativeGroup | None = None
    loaded: LoadedNetwork | None = None
    rates: csr_array | None = None
    motion: Array | None = None
    unresisted: NDArray[np.bool_] | None = None
    every: bool = False
    again: Callable[[], ParameterGroups] | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        """Return how these groups are made again: rules of parameters are functions, which pickle cannot hold."""
        return self.again, ()

    @cached_property
    def loses_freedom(self) -> NDArray[np.bool_]:
        """Which parameters (size,), changed alone, take degrees of freedom away."""
        return lost_freedoms(self.network, self.by_rule, self.size)

    @property
    def unsymmetric(self) -> bool:
        """Whether derivatives of K may have an antisymmetric part where K has none, as those to torques have."""
        if self.loaded is not None:
            return bool(self.loaded.forces.counts[3]) or self.network.matrices.spin is not None
        if self.network.matrices.spin is not None:
            return True
        return self.matrix_group is not None and not self.matrix_group.symmetric

    @property
    def size(self) -> int:
        """Number of rows that forms have: parameters and directions, and behind them what moves the pose."""
        if self.loaded is not None:
            return self.loaded.size
        return len(self.variables.parameters) + len(self.variables.directions)

    @cached_property
    def variable_slopes(self) -> Mapping[str, Array]:
        """Derivatives of whole matrices to the variables, for outputs that are no motions and no forces in springs."""
        return self.slopes(self.variables.as_directions(), self.every)

    def of_bodies(self, *fields: str) -> tuple[ParameterGroup, ...]:
        """Return the groups of bodies, or of some of their fields."""
        return tuple(group for group in self.by_rule if group.kind == "body" and (not fields or group.field in fields))

    def forms(self, left: Fields, right: Fields | None = None) -> Field:
        """Return x^T (dT/dp) y (size, ...) of all parameters, with what the forces at the pose do.

        ``left``, ``right``: the motions x and y; right None: y = x, and half of each form is returned.
        """
        result = form_table(self.by_rule, self.size, left, right)
        if self.matrix_group is not None:
            result[self.matrix_group.rows] = self.matrix_group.forms(left, right)
        if self.loaded is not None:
            self.loaded.add_forms(result, left, right)
        return result

    def chain(self, values: Any) -> Any:
        """Turn derivatives to the parameters (size, ...) into those to the variables (variables, ...), not a number
        where a parameter, changed alone, takes degrees of freedom away; ``values`` may be used up.
        """
        broken = self.loses_freedom
        if self.loaded is None or self.motion is None or self.unresisted is None:
            values[broken] = np.nan
            return self.variables.chain(values)
        count = self.loaded.changes.count
        direct = values[:count]
        moved = product(self.loaded.parameter_rates.T, direct)
        moved += values[count:]
        result = product(self.motion, moved)
        result += direct if self.rates is None else incidence_sum(self.rates, direct)
        requested, broken = self.variables.rates, broken[: len(self.loaded.entries)]
        result[self.unresisted | (broken if requested is None else abs(requested) @ broken > 0.0)] = np.nan
        return result


def grouped_by_rule(
    network: Network, requested: Variables, ruled: NDArray[np.bool_], slopes: MatrixSlopes, every: bool = False
) -> ParameterGroups:
    """Return groups of the parameters that have rules, and one of whole matrices for all others.

    ``ruled`` (parameters,): which parameters have rules; ``slopes``: derivatives of whole matrices along directions;
    ``every``: whether all parameters are asked for, of which some may have no derivative. Raises an error if the
    equations do not change smoothly with a parameter, or it loads a motion that nothing holds.
    """
    layout, rows, directions = requested.layout, np.flatnonzero(~ruled), requested.directions
    if len(rows) and not requested.identity:
        requested = requested.joined(~ruled)
        layout, directions = requested.layout, requested.directions
        rows = len(requested.parameters) + np.arange(len(directions))
    elif len(rows):
        layout = layout.only(ruled)
        names = [requested.parameters[k].name for k in rows.tolist()]
        directions = tuple(Direction(name, ((name, 1.0),)) for name in names)
    matrices = MatrixDerivativeGroup(rows, slopes(directions, every)) if directions else None
    return ParameterGroups(network, requested, tuple(groups_by_rule(network, layout)), slopes, matrices, every=every)


def grouped_under_loads(
    loaded: LoadedNetwork, reference: ReferencePose | None, requested: Variables, slopes: MatrixSlopes,
    every: bool = False, moves: bool = True,
) -> ParameterGroups:
    """Return the groups of all parameters of a loaded network, with the motion of its pose.

    ``reference``: what parameters as described do, where the equilibrium was found in another pose; ``slopes``:
    derivatives of whole matrices along directions; ``every``: whether all parameters are asked for, of which some may
    have no derivative; ``moves``: whether the pose follows its equilibrium. Variables that load a motion which nothing
    holds are ``unresisted``.
    """
    requested = requested.among(loaded.entries)
    rates, count = requested.rates, loaded.changes.count
    if rates is not None:
        rates = csr_array((rates.data, rates.indices, rates.indptr), shape=(rates.shape[0], count))
    elif count > len(loaded.entries):
        rates = csr_array(eye_array(len(loaded.entries), count))
    if reference is not None:
        moved = (reference.rates, reference.forces, reference.openings)
        rates, forces, joint_openings = moved if rates is None else tuple(rates @ matrix for matrix in moved)
        openings = joint_openings.toarray().reshape(len(requested.names), len(loaded.network.joints), 6)
        loaded = loaded.with_openings(openings.transpose(1, 2, 0), forces)
    still = np.zeros((len(requested.names), loaded.motions.shape[2]))
    motion, unresisted = pose_motion(loaded, rates) if moves else (still, np.zeros(len(still), dtype=bool))
    return ParameterGroups(loaded.network, requested, loaded.groups, slopes, None, loaded, rates, motion, unresisted,
                           every)  # fmt: skip


def lost_freedoms(network: Network, groups: Iterable[ParameterGroup], size: int) -> NDArray[np.bool_]:
    """Return which of ``size`` parameters (size,), changed alone, take degrees of freedom away, as redundant
    constraints then contradict each other.

    A change does so where a state of self-stress, forces in the locked rows that load no coordinate, works on it.
    """
    result = np.zeros(size, dtype=bool)
    ties, dof = network.tree.constraints, network.coordinates.displacements.shape[1]
    if ties is None or not ties.stress.shape[1] or not dof:
        return result
    joints = len(network.joints)
    ones = np.ones(dof)
    motion = fields(network, motions(network, np.eye(dof)), ones, ones, ones)
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
        rows = group.rows
        if (known := group.block(slice(0, len(rows)), stress, None, dof * none.shape[2])) is None:
            continue
        acts, block = known
        rows = rows[:, acts]
        work = np.abs(block).reshape(*rows.shape, -1).max(axis=2)
        broken = work > ZERO_STRESS_WORK * moves * (length if group.field == "orientation" else 1.0) * loads
        requested = rows >= 0
        result[rows[requested]] = broken[requested]
    return result
