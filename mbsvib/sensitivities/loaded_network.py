"""Loaded scenes in balance: derivatives through the equilibrium, analytic and by the adjoint.

The Lagrangian of the loaded scene, expanded to second order in the motions x and y of the bodies, gives
x^T K y = V_xy + sum of H over all forces. A parameter p changes it directly, by the forces in joints, and by the pose:

- the forces lambda in joints change so that bodies stay in balance and joints carry no force along what they free. The
  motion z of second order in which every joint gives way by dH/d lambda tells their share without knowing them:
  sum of d lambda . dH/d lambda = lambda . dS s - dF . z, where F are applied forces and s what joints move in it;
- the pose gives way by dq/dp = K^-1 dR/dp to what the forces R along the coordinates leave over. As it does, points
  and axes go with the bodies, springs change their tension: the parameters of the model in the new pose follow at
  rates P, so that all derivatives are those at the pose as it is, plus (dq/dp)^T P^T times these.

One solution for z a pair of motions, and one factorization of K, give the derivatives to all parameters.

Source: implicit function theorem on the Lagrangian; Haftka & Gurdal, Elements of Structural Optimization (1992),
chapter 7, for direct and adjoint derivatives.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import prod

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from mbsvib.common.arrays import Array, Index
from mbsvib.equations.equations import Equations
from mbsvib.equilibrium.articulation import with_rigid_parts
from mbsvib.equilibrium.moved_parts import static_model
from mbsvib.kinematics.pose import size_of
from mbsvib.linalg.products import product
from mbsvib.linalg.rotations import skew
from mbsvib.linalg.vectors import Field, cross, dot, moved, transformed, wide
from mbsvib.mechanism.parameters import Parameter
from mbsvib.sensitivities.adjoint_fields import Fields, joint_release_motion, transmitted
from mbsvib.sensitivities.families import rules_of
from mbsvib.sensitivities.families.pose_changes import ForceChanges, ForceLayout, PoseRates, RowTerms
from mbsvib.sensitivities.families.rules import crossed
from mbsvib.sensitivities.forces import Forces, point_slopes, turn_slopes, work_slopes, wrench_slopes
from mbsvib.sensitivities.forms import ParameterGroup, form_table, groups_by_rule, internal_groups
from mbsvib.sensitivities.network import Network
from mbsvib.sensitivities.network_assembly import model_in_pose
from mbsvib.sensitivities.variables import FieldLayout, ListedLater


def internal_parameters(network: Network) -> list[tuple[str, str, tuple[int, ...]]]:
    """Return part, field and index of all numbers that change with the pose and are no parameters of the model: axes
    of torsion springs and rotors, the place and orientation of beams and superelements that keep their shape.
    """
    internal = [(part.name, *rules_of(part).loaded.internal) for part in network.parts]
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
        rules_of(part).loaded.add_force_terms(terms, network, forces, part, k)
    return ForceChanges(terms.row, at, terms.matrix(at.size))


def parameter_rates(network: Network, forces: Forces, changes: ForceChanges, motion: Array) -> Array:
    """Return the changes (parameters, c) of parameters as bodies move, as those of a model do that is described in the
    new pose.

    ``motion`` (bodies, 6, c): motions at the centres of mass.
    """
    rates = PoseRates(network, forces, changes, motion)
    rates.carry([part for part, _ in network.carriers_of_force])
    for part, k in network.carriers_of_force:
        rules_of(part).loaded.follow(rates, part, k)
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
    change = -network.matrices.stiffness @ strained
    # a moment turns with half of the turn between the bodies
    change[:, 3:] += 0.5 * skew(forces.wrench[joints : joints + springs, 3:]).swapaxes(1, 2) @ strained[:, 3:]
    # what a free length does is said by the parameters
    change[[getattr(spring, "free_length", None) is not None for spring in network.springs]] = 0.0
    result[at.wrench.start : at.wrench.start + 6 * springs] = change.reshape(6 * springs, motion.shape[2])
    result[at.twist] = relative[forces.bushings, 3:].reshape(3 * len(forces.bushings), relative.shape[2])
    for k in forces.follower.tolist():
        result[at.wrench_of(k) : at.wrench_of(k) + 6] = crossed(relative[k, 3:], forces.wrench[k])
    return result


@dataclass(frozen=True)
class LoadedNetwork:
    """A network in balance under its ``forces``, with all its parameters ``entries``, their ``groups`` and ``changes``;
    internal parameters come behind them.

    The pose may make the ``motions`` (bodies, 6, c), first those along the m coordinates; parameters are then
    carried along at ``parameter_rates`` (p, c), and forces change at ``force_rates`` (e, c) beside these. Forces of
    ``size_of_forces`` (m,) [N, N m] cancel along the coordinates, of which ``steps`` (m,) are large: 1 rad, or the
    size of the mechanism [m].
    """

    network: Network
    forces: Forces
    entries: Sequence[Parameter]
    groups: tuple[ParameterGroup, ...]
    changes: ForceChanges
    motions: Array
    parameter_rates: Array
    force_rates: Array
    size_of_forces: Array
    steps: Array

    @property
    def dof(self) -> int:
        """Number m of coordinates along which the pose moves: all minimal ones unless beams keep their shape."""
        reactions = self.network.reactions
        count = int(self.network.coordinates.displacements.shape[1])
        return count if reactions is None else count - len(reactions.dependent)

    @property
    def size(self) -> int:
        """Number of rows: all parameters, then the motions of the pose."""
        return self.changes.count + int(self.motions.shape[2])

    @cached_property
    def relaxing(self) -> NDArray[np.bool_]:
        """Coordinates (m,) along which nothing moves but nodes between springs and dampers of Maxwell elements."""
        nodes = {part.node for part in self.network.maxwell_elements.values()}
        others = [body.name not in nodes for body in self.network.bodies]
        return np.asarray(~self.motions[others, :, : self.dof].any(axis=(0, 1)))

    def add_forms(self, result: Field, left: Fields, right: Fields | None = None) -> None:
        """Add to x^T (dT/dp) y what the forces at the pose do to it, in place.

        ``result`` (size, ...): forms by the rules of parts, of all parameters; then of the pose; ``left``, ``right``:
        the motions x and y; right None: y = x, and half of each form is added.
        """
        twisted = self._twisted(left, right)
        rows = twisted.reshape(3 * len(self.forces.bushings), *twisted.shape[2:])
        result[self.changes.count :] += product(self.force_rates[self.changes.at.twist].T, rows)
        weight = 0.5 * (left.stiff if right is None else left.stiff + right.stiff)
        if weight.any():
            self._add_geometric(result, left, right, weight)

    def _add_geometric(self, result: Field, left: Fields, right: Fields | None, weight: Field) -> None:
        """What comes of the geometric stiffness."""
        at, joints = self.changes.at, self.forces.counts[0]
        x = self.forces.relative_motions(left.carrying)
        y = x if right is None else self.forces.relative_motions(right.carrying)
        gap = wrench_slopes(self.forces, x, None if right is None else y)
        if left.turned is not None:
            gap[:joints, 3:] += 0.5 * cross(left.turned, y[1][:joints, 3:])
        if self.network.reactions is not None:
            self._add_tensions(gap, x[1], y[1])
        second = self._released(gap)
        row = self._work_of_applied_forces(second, gap)
        point, start = point_slopes(self.forces, x, None if right is None else y)
        turn, twist = turn_slopes(self.forces, x, y), self._stiffened(left, right)
        for key, part in (("point", point), ("start", start[self.forces.lines]), ("turn", turn), ("twist", twist)):
            _put(row, getattr(at, key), part)
        self._fold(result, row * weight, weight * second[:joints])
        if left.turned is not None:
            self._open(result, weight * cross(left.turned, cross(y[1][:joints, 3:], wide(
                self.forces.wrench[:joints, 3:], y[1]))))  # fmt: skip

    def _released(self, gap: Field) -> Field:
        """Relative motions (n, 6, ...), less the gaps, in which joints and elements of beams give way by gaps."""
        joints, reactions = self.forces.counts[0], self.network.reactions
        second = self.forces.relative_motions(joint_release_motion(self.network, gap[:joints]))[1] - gap
        if reactions is None:
            return second
        opened = reactions.opened(-second[joints + reactions.springs])
        motion = np.tensordot(self.network.coordinates.displacements, opened, axes=1)
        return second + self.forces.relative_motions(motion.reshape(len(self.forces.centre), 6, *gap.shape[2:]))[1]

    def _add_tensions(self, gap: Field, x: Field, y: Field) -> None:
        """Add what the forces of elements do in beams, in place; x, y: relative motions.

        Tension acts by bent lines, each force f by f . (r x d) / 2, see ``equations.beam_prestress``.
        """
        joints, number = self.forces.counts[0], self.network.spring_number
        for part in self.network.parts:
            lines = rules_of(part).loaded.bent_lines(part)
            if lines is None:
                continue
            names, axes, forms = lines
            which = np.array([joints + number[name] for name in names])
            r, s = (relative_motions[which] for relative_motions in (x, y))
            gap[which, :3] += 0.5 * (cross(s[:, 3:], r[:, :3]) + cross(r[:, 3:], s[:, :3]))
            r, s = _in_axes(axes, r), _in_axes(axes, s)
            works = (r * transformed(forms, s)).sum(axis=1, keepdims=True)
            gap[which, :3] -= wide(axes[:, :, 0], gap) * works

    def _open(self, result: Field, slope: Field) -> None:
        """Add what turning the axes of joints does that are turned open, twice ``slope`` (joints, 3, ...)."""
        for group in self.groups:
            if group.kind == "joint" and group.field == "orientation":
                result[group.rows] += 0.5 * slope[group.number]

    def add_point_motion(self, result: Field, body: int, point: Array, slope: Field) -> None:
        """Add, in place, what the pose does by moving a point that a body carries.

        ``result`` (size, ...): derivatives to parameters and to the pose; ``body``: number of the body; ``point`` (3,):
        the point [m]; ``slope`` (3, ...): derivatives to the point.
        """
        moves = moved(self.motions[body][None], (point - self.network.position[body])[None])[0, :3]
        result[self.changes.count :] += product(moves.T, slope)

    def add_turn(self, result: Field, body: int, wrench: Array, relative: Field) -> None:
        """Add, in place, what the pose does by turning a ``wrench`` (6,) with a body, which acts along (6, ...)."""
        force, moment = (np.cross(wrench[k : k + 3], relative[k : k + 3], axisb=0, axisc=0) for k in (0, 3))
        result[self.changes.count :] += product(self.motions[body, 3:].T, force + moment)

    @cached_property
    def generalized_force_jacobian(self) -> Array:
        """Derivatives (size, m) of the forces along the coordinates to parameters and to motions of the pose; together
        with what these do to parameters, -K for those along the coordinates.
        """
        m = self.dof
        relative = -self.forces.relative_motions(self.motions[:, :, :m])[1]
        result = np.zeros((self.size, m))
        work = self._work_of_applied_forces(relative, np.zeros_like(relative))
        self._fold(result, work, relative[: self.forces.counts[0]])
        return result

    def with_openings(self, openings: Array, forces: csr_array) -> LoadedNetwork:
        """Return the same with further motions of the pose: those in which joints give way.

        ``openings`` (joints, 6, v): how far each joint gives way at its point, one motion after the other; ``forces``
        (v, e): what changes of the forces then.
        """
        motion = joint_release_motion(self.network, openings)
        added = tuple(of(self.network, self.forces, self.changes, motion) for of in (parameter_rates, force_rates))
        return replace(self, motions=np.concatenate((self.motions, motion), axis=2),
                       parameter_rates=np.concatenate((self.parameter_rates, added[0]), axis=1),
                       force_rates=np.concatenate((self.force_rates, added[1] + forces.T), axis=1))  # fmt: skip

    @cached_property
    def _through(self) -> tuple[ParameterGroup, ...]:
        """The groups of what forces go through: joints and couplers."""
        return tuple(group for group in self.groups if group.kind in ("joint", "coupler"))

    def _fold(self, result: Field, row: Field, moves: Field) -> None:
        """Add to parameters what belongs to them, and to the pose the rest; ``moves`` (joints, 6, ...) is what joints
        move to second order.
        """
        count, tail = self.changes.count, row.shape[1:]
        flat = row.reshape(len(row), prod(tail))
        result[:count] += (self.changes.matrix @ flat).reshape(count, *tail)
        result[count:] += product(self.force_rates.T, row)
        if self._through:
            result += form_table(self._through, self.size, *self._resting(moves))

    def _work_of_applied_forces(self, moves: Field, gap: Field) -> Field:
        """What is no parameter, as far as applied forces do work on the motion of second order, (extras, ...)."""
        displacements, at = moves.copy(), self.changes.at
        displacements[: self.forces.counts[0]] = 0.0
        wrench, point, start = work_slopes(self.forces, displacements, gap)
        row = np.zeros((at.size, *moves.shape[2:]), dtype=moves.dtype)
        for key, part in (("point", point), ("start", start[self.forces.lines]),
                          ("wrench", wrench[self.forces.counts[0] :])):  # fmt: skip
            _put(row, getattr(at, key), part)
        return row

    def _resting(self, moves: Field) -> tuple[Fields, Fields]:
        """The forces in joints at rest, and what joints move (joints, 6, ...), as fields."""
        springs, joints = self.forces.counts[1], len(moves)
        tail = moves.shape[2:]
        ones, zero = (1,) * len(tail), np.zeros((1,) * len(tail))
        wrench = np.zeros((joints + springs, 6, *ones))
        wrench[:joints] = wide(self.forces.wrench[:joints], wrench)
        relative = np.zeros((joints + springs, 6, *tail), dtype=moves.dtype)
        relative[:joints] = moves
        still = np.zeros(wrench.shape, dtype=moves.dtype)
        none = np.zeros((len(self.forces.centre), 6, *ones))
        tied = self._tied.reshape(-1, *ones)
        return (Fields(none[0, :1], none, none, still, still[joints:], wrench, none[:0], tied, zero, zero, zero),
                Fields(none[0, :1], np.broadcast_to(none, (*none.shape[:2], *tail)), none, relative, still[joints:],
                       still, none[:0], np.zeros_like(tied), zero, zero, zero))  # fmt: skip

    @cached_property
    def _tied(self) -> Array:
        """Forces at rest in the rows that close loops, (rows,)."""
        still = np.zeros((self.forces.counts[1], 6))
        return transmitted(self.network, -self.forces.applied, still)[2]

    def _stiffened(self, left: Fields, right: Fields | None) -> Field:
        """What turning the second body of each bushing does to its moment's part in K, (bushings, 3, ...).

        About an axis e it is e (e . s) (m . r) / 2 - ((m . r) s + (m . s) r) / 4, see ``elements.torsion_spring``.
        """
        bushings = self.forces.bushings
        strained = bushings - self.forces.counts[0]
        r, s = (side.strain[strained, 3:] for side in (left, left if right is None else right))
        m = wide(self.forces.wrench[bushings, 3:], r)
        result = (cross(s, cross(m, r)) + cross(r, cross(m, s))) / 12.0
        about, axis = self._torsion_springs
        if len(about):
            r, s, m, e = r[about], s[about], m[about], wide(axis, r)
            result[about] = 0.5 * e * dot(e, s) * dot(m, r) - 0.25 * (s * dot(m, r) + r * dot(m, s))
        return result

    @cached_property
    def _torsion_springs(self) -> tuple[Index, Array]:
        """Which of the bushings are torsion springs, whose angle is a twist, and their axes (n, 3)."""
        axes = {part.name: axis for part in self.network.parts
                if (axis := rules_of(part).loaded.twist_axis(part)) is not None}
        names = [self.network.springs[k - self.forces.counts[0]].name for k in self.forces.bushings.tolist()]
        about = [i for i, name in enumerate(names) if name in axes]
        return np.array(about, dtype=np.intp), np.array([axes[names[i]] for i in about]).reshape(-1, 3)

    def _twisted(self, left: Fields, right: Fields | None) -> Field:
        """The same for its stiffness and damping: K and C go with (1 - [rho]x / 2) on both sides."""
        bushings = self.forces.bushings
        strained = bushings - self.forces.counts[0]
        twisted = -0.5 * cross(left.strain[strained, 3:], (left if right is None else right).wrench[bushings, 3:])
        if right is not None:
            twisted = twisted - 0.5 * cross(right.strain[strained, 3:], left.wrench[bushings, 3:])
        return twisted


def _in_axes(axes: Array, vectors: Field) -> Field:
    """Six-vectors (n, 6, ...) in axes (n, 3, 3), their columns."""
    turn = axes.swapaxes(1, 2)
    return np.concatenate((transformed(turn, vectors[:, :3]), transformed(turn, vectors[:, 3:])), axis=1)


def _put(row: Field, at: slice, part: Field) -> None:
    """Add derivatives (k, 3, ...) or (k, 6, ...) at their place in a row."""
    row[at] += part.reshape(at.stop - at.start, *row.shape[1:])


def loaded_network(network: Network, system: Equations) -> LoadedNetwork:
    """Return a network in balance."""
    statics, model = system.provenance.statics, model_in_pose(system)
    assert network.forces is not None
    assert network.coordinates.twists is not None
    assert model is not None
    forces, layout = network.forces, FieldLayout.of(system.parameters.parts.values())
    entries = ListedLater(layout.starts[-1], lambda: system.parameters.entries)
    changes = force_changes(network, forces, layout)
    reactions, size = network.reactions, np.zeros(system.dof) if statics is None else statics.size
    motions = network.coordinates.displacements.reshape(len(network.bodies), 6, -1)
    turns = network.coordinates.twists.turns[system.provenance.reduction.independent]
    if reactions is not None:
        motions, size = motions @ reactions.motions, abs(reactions.motions).T @ size
        turns = turns[reactions.independent]
    steps = np.where(turns, 1.0, size_of(static_model(with_rigid_parts(model))))
    gravity = changes.row.get(("gravity", "", (0,)))
    groups = (*groups_by_rule(network, layout), *internal_groups(network, len(entries), gravity))
    return LoadedNetwork(
        network, forces, entries, groups, changes, motions,
        parameter_rates(network, forces, changes, motions),
        force_rates(network, forces, changes, motions), size, steps,
    )  # fmt: skip
