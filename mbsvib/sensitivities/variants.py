"""Derivatives of whole matrices, along parameters that do more than one part's rule tells.

What moves the equilibrium, changes forces in joints, couples coordinates, spins or has no mass acts everywhere at once.
There the equations of variants of the model say how they change, in the pose as it is and along the motions q by which
the equilibrium gives way, with the forces R that are left over along them:

dF/dp = F_p + F_q dq/dp,  R_q dq/dp = -R_p

These derivatives are complex steps of a batch, as exact as the equations. For parts that a batch does not take, or
whose poses are not stated, they are extrapolated differences (11 digits), whose variants need not balance. Where a
model had to find its equilibrium far from where it is described, each variant finds its own.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.common.selection import port_numbers
from mbsvib.elements.load import Gravity
from mbsvib.equations.assembly import assembled, linearized
from mbsvib.equations.batch_assembly import BatchPlan, batch_plan
from mbsvib.equations.batch_equations import BatchEquations
from mbsvib.equations.batch_values import Values
from mbsvib.equations.equations import Equations
from mbsvib.equations.expansion import expanded
from mbsvib.equations.matrices import MATRICES
from mbsvib.equations.plan_tangents import along_parameters, along_poses, among, forces_along_parameters
from mbsvib.equations.scene import scene, with_maxwell_nodes
from mbsvib.equilibrium.articulation import with_rigid_parts
from mbsvib.equilibrium.moved_parts import static_model
from mbsvib.equilibrium.search import at_equilibrium
from mbsvib.errors import MbsvibError, ModelError
from mbsvib.kinematics.pose import size_of
from mbsvib.linalg.differences import slope
from mbsvib.mechanism.changes import Slots, scale_of
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.sensitivities.matrix_entries import MatrixEntries
from mbsvib.sensitivities.network_assembly import may_move
from mbsvib.sensitivities.pose_motion import VariantPoses
from mbsvib.sensitivities.variables import Direction
from mbsvib.sparse.equations import SparseEquations

Rates = tuple[tuple[str, float], ...]

# The first step, against the value of a parameter or the size that it is measured by; how much smaller the next is.
STEP, SMALLER, TRIALS = 2.0**-6, 0.125, 4
# Differences agree as soon as they are this close, against what the matrices are over the scale of the parameter.
AGREED = 1e-11
# Slopes that agree no better than this are refused.
WORST = 1e-7
# Fields that say where parts are, and by which forces; forces are measured by this share of the loads at least.
PLACES, FORCES, LEAST = ("position", "start", "end"), ("force", "torque", "preload"), 1e-3


class Variants:
    """The equations of a system's model with other values of its parameters, and in other poses.

    ``moves``: whether the pose follows its equilibrium.
    """

    def __init__(self, system: Equations, moves: bool = True) -> None:
        self.system, self._moves = system, moves
        self._entries = MatrixEntries(system)
        self._slopes: dict[Rates, Array] = {}
        self._tangents: dict[Rates, Array] = {}
        self._force_tangents: dict[Rates, Array] = {}
        self._slopes_along: dict[int, Array] = {}
        self._refused: dict[Rates, ModelError] = {}
        self._stuck: dict[int, MbsvibError] = {}

    def slopes(self, directions: Sequence[Direction], every: bool = False) -> dict[str, Array]:
        """Return the derivatives of the matrices of a whole system along some directions, each computed once.

        They are those of M, C, K, B, Cq, Cv, Ca and D along k directions, (k, ...) each; not a number where a direction
        takes degrees of freedom away. If the matrices do not change smoothly, or a parameter loads a motion that
        nothing holds, an error is raised, unless these are all parameters there are (``every``): then the derivatives
        are not a number.
        """
        self._add_tangents([direction for direction in directions if direction.rates not in self._slopes])
        for direction in directions:
            key = direction.rates
            if key not in self._slopes:
                try:
                    self._slopes[key] = self._slope(direction)
                except ModelError as refusal:
                    self._slopes[key], self._refused[key] = np.full(self._entries.count, np.nan), refusal
            if key in self._refused and not every:
                raise self._refused[key]
        flat = np.array([self._slopes[direction.rates] for direction in directions])
        shapes = [getattr(self.system, key).shape for key in MATRICES]
        parts = np.split(flat, np.cumsum([int(np.prod(shape)) for shape in shapes])[:-1], axis=1)
        return {key: part.reshape(len(flat), *shape) for key, part, shape in zip(MATRICES, parts, shapes, strict=True)}

    def _add_tangents(self, directions: Sequence[Direction]) -> None:
        """Compute the derivatives in the pose as it is along directions for which the parts are those of a batch."""
        system, poses = self.system, self._poses
        if not directions or system.provenance.origin is None or system.provenance.moved_to_equilibrium:
            return
        along = () if poses is None else poses.names
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            plan, values, kept = _plan_along(self._model, system.coordinates, self._cut, directions)
            if not kept or plan.nominal.coordinates != system.coordinates:
                return
            known = along_parameters(plan, plan.equations(values, BatchEquations), _rates(kept))
            slopes = {key: array[0] for key, array in known.items() if array is not None}
            if {*along} <= {*plan.names} and along and not self._slopes_along:
                moving = along_poses(plan, along) or {}
                self._slopes_along |= {k: self._in_one_row({key: moving[key][k] for key in MATRICES}, plan.nominal)
                                       for k in range(len(along) if moving else 0)}  # fmt: skip
            rows = {one.rates: self._in_one_row({key: slopes[key][k] for key in MATRICES}, plan.nominal)
                    for k, one in enumerate(kept)}  # fmt: skip
            # steps that start motions of nodes, or strains of elements, have no derivative, differences may
            lasting = plan.prestress is None and plan.nominal.provenance.separation is None
            self._tangents |= {key: row for key, row in rows.items() if lasting or not np.isnan(row).any()}
            forces = slopes.get("residual")
            if along and plan.prestress is not None:  # the pose moves as if beams were rigid
                plan, forces, kept = self._forces_on_rigid_parts(kept)
        if poses is not None and {*along} <= {*plan.names}:
            forces = np.zeros((len(kept), len(plan.names))) if forces is None else forces
            forces = forces[:, [*map(plan.names.index, along)]]
            self._force_tangents |= {one.rates: force for one, force in zip(kept, forces, strict=True)}

    def _forces_on_rigid_parts(
        self, directions: Sequence[Direction]
    ) -> tuple[BatchPlan, Array | None, Sequence[Direction]]:
        """Steps of what is left of the forces where beams are rigid, with their plan, and the directions of other parts
        along which they are.
        """
        assert self._poses is not None
        still = static_model(with_rigid_parts(self._model))
        known, there = ({part.name: part for part in model.declared_parts} for model in (self._model, still))
        entry = self._model.parameters.entry
        directions = [one for one in directions if all(
            known[part] == there.get(part) and not isinstance(known[part], Gravity)  # weights of beams are constant
            for part in [entry(name).part for name, _ in one.rates])]  # fmt: skip
        plan, values, kept = _plan_along(still, self._poses.names, self._poses.posed_model.cut, directions, True)
        return plan, forces_along_parameters(plan, values, _rates(kept)) if kept else None, kept

    @cached_property
    def unreduced(self) -> Equations | None:
        """The system that ``reachable`` took this one out of; None where this one is whole."""
        system, provenance = self.system, self.system.provenance
        if provenance.removed is None:
            return None
        independent = (*system.coordinates, *provenance.removed.names)
        if not provenance.moved_to_equilibrium:
            return linearized(self._model, independent, self._cut)
        unreduced: Equations | SparseEquations = at_equilibrium(self._model, independent, self._cut, "dense")[1]
        assert isinstance(unreduced, Equations)
        return unreduced

    def sizes(self, directions: Sequence[Direction]) -> Array:
        """Return the largest of the forces that cancel in the pose, over what is a large change along directions."""
        return np.array([self._entries.loads * max((abs(rate) / self._scale(name) for name, rate in direction.rates),
                                           default=0.0)
                         for direction in directions])  # fmt: skip

    def _slope(self, direction: Direction) -> Array:
        scale = min(self._scale(name) / abs(rate) for name, rate in direction.rates)

        def at(change: float) -> Array:
            return self._equations(self._varied(direction, change))

        try:
            return self._through_equilibrium(self._in_pose(direction, scale, at), scale, direction.name)
        except _OtherMobility:
            return np.full(self._entries.count, np.nan)

    def _in_pose(self, direction: Direction, scale: float, at: Callable[[float], Array]) -> Array:
        """Derivatives of the matrices in the pose as it is, then of the forces left over; ``at`` returns all of them.
        """
        name, slopes = f"'{direction.name}'", self._tangents.get(direction.rates)
        if slopes is None:
            return self._extrapolated(at, scale, name)
        if (poses := self._poses) is None:
            return slopes
        force, count = self._force_tangents.get(direction.rates), self._entries.count
        if force is None:
            force = self._extrapolated(lambda change: np.concatenate((
                np.zeros(count), poses.residual(self._varied(direction, change)))), scale, name)[count:]  # fmt: skip
        return np.concatenate((slopes, force))

    def _varied(self, direction: Direction, change: float) -> Mechanism:
        known = self._model.parameters
        return self._model.with_values({name: known[name] + change * rate for name, rate in direction.rates})

    def _through_equilibrium(self, slopes: Array, scale: float, name: str) -> Array:
        """Let the equilibrium give way to the forces that a parameter leaves over."""
        change, force = slopes[: self._entries.count], slopes[self._entries.count :]
        if not len(force):
            return change
        assert self._poses is not None
        try:
            motion = self._poses.motion(force, scale)
        except MbsvibError as refusal:
            raise self._not_smooth(f"'{name}'", str(refusal)) from refusal
        if motion is None:
            raise not_held(name, self.system.name)
        for k in np.flatnonzero(motion):
            change = change + motion[k] * self._along(int(k))
        return change

    @cached_property
    def _model(self) -> Mechanism:
        provenance = self.system.provenance
        if provenance.origin is None:
            raise ModelError(
                f"sensitivities of '{self.system.name}': it is not a system as model.linearize() returns it, so that "
                f"the effect of its parameters is not known; take that system.", element=self.system.name,
            )  # fmt: skip
        return provenance.origin

    @cached_property
    def _cut(self) -> tuple[str, ...]:
        topology = self.system.provenance.topology
        joints = self._model.joints
        return tuple(name for k in topology.cut if (name := topology.joints[k].name) in joints)

    @cached_property
    def _poses(self) -> VariantPoses | None:
        """The poses next to that of the system; None where it stays, or each variant finds its own."""
        provenance = self.system.provenance
        if provenance.moved_to_equilibrium or not self._moves or not may_move(self.system):
            return None
        return VariantPoses.of(self._model, self._cut)

    def _along(self, k: int) -> Array:
        """Derivatives of all entries along a motion of the pose."""
        poses = self._poses
        assert poses is not None
        if k in self._stuck:
            raise self._stuck[k]
        if k not in self._slopes_along:
            unit = np.eye(len(poses.names))[k]
            try:
                self._slopes_along[k] = self._extrapolated(
                    lambda q: self._matrices(poses.at(q * unit)), float(poses.steps[k]),
                    f"coordinate '{poses.names[k]}'")  # fmt: skip
            except MbsvibError as refusal:
                self._stuck[k] = refusal
                raise
        return self._slopes_along[k]

    @cached_property
    def _size(self) -> float:
        """The size of the mechanism [m], nodes of beams included."""
        return size_of(with_rigid_parts(self._model))

    def _scale(self, name: str) -> float:
        """What a parameter is measured by: the size of the mechanism for places, the loads for forces, or else what
        ``scale_of`` says.
        """
        known = self._model.parameters
        if name not in known:  # a joint coordinate
            return 1.0 if name.rpartition(".")[2][0] == "r" else self._size
        field, scale = known.entry(name).field, scale_of(known, name)
        if field in PLACES:
            return self._size
        return max(scale, LEAST * self._entries.loads) if field in FORCES else scale

    def _extrapolated(self, at: Callable[[float], Array], scale: float, parameter: str) -> Array:
        """A slope, with steps made smaller until the differences agree."""
        entries = self._entries
        best, least, refusal, moves = None, np.inf, None, 0
        for step in (STEP * scale * SMALLER**k for k in range(TRIALS)):
            for sides in (0, 1, -1):
                try:
                    slopes, error = slope(at, step, sides)
                except _OtherMobility:
                    moves += 1
                    continue
                except MbsvibError as problem:
                    refusal = problem
                    continue
                matrices, forces = slopes[: entries.count], slopes[entries.count :]
                size = scale * np.abs(slopes)
                size[: entries.count] += entries.compared(scale * matrices)
                if self._poses is not None and len(forces):
                    size[entries.count :] += self._poses.forces.size + scale * np.abs(forces).max()
                ratio = scale * error / np.where(size > 0.0, size, np.inf)
                off = float(ratio.max(initial=0.0))
                if off < least:
                    best, least = slopes, off
                break
            if least <= AGREED:
                break
        if best is None and moves:
            raise _OtherMobility
        if best is None or least > WORST:
            why = str(refusal) if best is None else f"differences agree to {least:.1e} only"
            raise self._not_smooth(parameter, why) from refusal
        return best

    def _not_smooth(self, parameter: str, why: str) -> ModelError:
        return ModelError(
            f"sensitivities: the equations of '{self.system.name}' do not change smoothly with {parameter} ({why}). "
            f"Compare variants by model.with_values, or name other parameters.", element=self.system.name,
        )  # fmt: skip

    def _equations(self, model: Mechanism) -> Array:
        """All matrices of a variant in the pose of the system, then the forces that are left over."""
        poses = self._poses
        entries = self._matrices(model)
        return entries if poses is None else np.concatenate((entries, poses.residual(model)))

    def _matrices(self, model: Mechanism) -> Array:
        """All matrices of a variant in its own pose."""
        system, provenance = self.system, self.system.provenance
        variant: Equations | SparseEquations
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            if provenance.moved_to_equilibrium:
                _, variant = at_equilibrium(model, independent=system.coordinates, cut=self._cut, method="dense")
            else:
                plain = expanded(model)
                view = scene(with_maxwell_nodes(plain), self._cut)
                try:
                    variant = assembled(plain, view, system.coordinates, checked=False)
                except ModelError:
                    if assembled(plain, view, checked=False).dof != system.dof:
                        raise _OtherMobility from None
                    raise
        assert isinstance(variant, Equations)
        if variant.coordinates != system.coordinates or not np.array_equal(
            variant.provenance.reduction.independent, provenance.reduction.independent
        ):
            raise _OtherMobility
        return self._in_one_row({key: getattr(variant, key) for key in MATRICES}, variant)

    def _in_one_row(self, matrices: Mapping[str, Array], whole: Equations) -> Array:
        """The entries of matrices of ``whole`` equations, with the ports of the system only."""
        system = self.system
        o, i = port_numbers(list(system.outputs), list(system.inputs), (whole.outputs, whole.inputs), system.name)
        picked = {"B": (slice(None), i), "D": np.ix_(o, i)} | dict.fromkeys(("Cq", "Cv", "Ca"), (o, slice(None)))
        return np.concatenate([matrices[key][picked.get(key, ...)].reshape(-1) for key in MATRICES])


def _plan_along(
    model: Mechanism, independent: Sequence[str], cut: Sequence[str], directions: Sequence[Direction],
    forces_alone: bool = False,
) -> tuple[BatchPlan, Values, Sequence[Direction]]:  # fmt: skip
    """The plan of a model, its values, and those directions whose parts are those of a batch."""
    names = list(dict.fromkeys(name for one in directions for name, _ in one.rates))
    slots = Slots.of(model.parameters, names)
    plan, values = among(batch_plan(model, slots, independent, cut, forces_alone=forces_alone), names)
    return plan, values, [one for one in directions if {name for name, _ in one.rates} <= {*values.slots.names}]


def _rates(directions: Sequence[Direction]) -> dict[str, Array]:
    """The rates (k,) of parameters along directions, by name."""
    rates = [dict(one.rates) for one in directions]
    names = dict.fromkeys(name for one in rates for name in one)
    return {name: np.array([rate.get(name, 0.0) for rate in rates]) for name in names}


def not_held(name: str, system: str) -> ModelError:
    """The refusal of a variable that loads a motion which no stiffness holds."""
    return ModelError(
        f"sensitivities: '{name}' moves the equilibrium of '{system}' along a motion that no stiffness holds, or that "
        f"of a bent beam, so that there is no derivative. Name other parameters, or compare variants by "
        f"model.with_values.", element=name,
    )  # fmt: skip


class _OtherMobility(MbsvibError):
    """A variant has other coordinates."""
