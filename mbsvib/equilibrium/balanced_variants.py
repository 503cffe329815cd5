"""Variants of a model in equilibrium, all at once: Newton's method from the pose as described.

The equations and the guards are those of a single model (``path``): every pose on the way is stable, and steps
contract. Variants that do not meet them are refused, to be searched one by one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.common.arrays import Array, Bools
from mbsvib.elements.coupler import Coupling
from mbsvib.elements.pose import Pose
from mbsvib.equations.batch_assembly import B, BatchPlan, batch_plan, described_variants
from mbsvib.equations.batch_equations import BatchEquations
from mbsvib.equations.batch_loops import reduce_batch
from mbsvib.equations.batch_values import Values, checked
from mbsvib.equations.draft import Variants
from mbsvib.equations.equations import Equations
from mbsvib.equations.scene import Scene
from mbsvib.equilibrium.balance import RESOLVED, of_loads
from mbsvib.equilibrium.path import BALANCED, CLOSED, CONTRACTION, LONGEST, NEWTON_STEPS
from mbsvib.equilibrium.posed_variants import PLACES
from mbsvib.equilibrium.search import at_equilibrium
from mbsvib.errors import EquilibriumError
from mbsvib.kinematics.couplers import locked
from mbsvib.kinematics.couplings import coupler_travel
from mbsvib.linalg.products import weighted_gram
from mbsvib.linalg.rank import CLOSED_EXACTLY, EPS, ZERO_STIFFNESS
from mbsvib.mechanism.changes import Slots
from mbsvib.mechanism.mechanism import Mechanism

# Steps that close loops after one of Newton's method, at most.
CORRECTIONS = 8


def balanced_batch(
    model: Mechanism, values: Mapping[str, ArrayLike], form: type[Equations] = Equations,
    batch: type[B] = BatchEquations,  # type: ignore[assignment]
) -> B:  # fmt: skip
    """Return the equations of variants of a model in the equilibrium of each; ``values`` (n,): by name or pattern.

    Raises an ``EquilibriumError`` where Newton's method does not contract in some variant, or poses are not stated for
    many variants at once.
    """
    variants = checked(model.parameters, values)
    plan = balanced_plan(model, variants.slots, form)
    places = any(field in PLACES for fields in variants.index.values() for field in fields)
    if plan.posed_scene is None or places or not plan.names:
        raise EquilibriumError(f"model '{model.name}': its variants are balanced one by one.")
    return plan.equations(variants, batch)


def balanced_plan(model: Mechanism, slots: Slots, form: type[Equations] = Equations) -> BatchPlan:
    """Return the plan of variants in equilibrium."""
    plan = replace(batch_plan(model, slots, form=form), relaxed=False, poses=_described)
    return replace(plan, poses=BalancedVariants(plan).poses_of, posed=partial(_variants, model))


def _described(values: Values, first: int) -> NoReturn:
    raise AssertionError


def _variants(model: Mechanism, values: Values) -> Callable[[int], Mechanism]:
    return partial(_variant, model, values)


def _variant(model: Mechanism, values: Values, i: int) -> Mechanism:
    return at_equilibrium(model.with_values({name: float(array[i]) for name, array in values.by_name.items()}))[0]


@dataclass(frozen=True)
class BalancedVariants:
    """The equilibria of the variants of a ``plan``."""

    plan: BatchPlan

    def poses_of(self, values: Values, first: int) -> Pose:
        """Return the poses of equilibrium of some variants, ``first`` the number of the first of them.

        N^T (K + K_g) N dz = N^T F,  q -> q + N dz,  with loops closed after each step
        """
        posed = self.plan.posed_scene
        assert posed is not None
        (described, forces), kinematics = described_variants(self.plan, values), posed.kinematics
        pose, count = kinematics.described, values.count
        pose = Pose(pose.number, pose.origin, *(np.repeat(array[None], count, axis=0)
                                                for array in (pose.centre, pose.rotations)))  # fmt: skip
        before, last, travel, gap = np.full(count, np.inf), False, None, np.zeros(count)
        for _ in range(NEWTON_STEPS):
            scene = posed.at(described, pose, forces=forces)
            step, share, stable = self._step(scene, values, first, pose)
            length = np.abs(step / kinematics.scale).max(axis=1, initial=0.0)
            done = share <= BALANCED
            lost = ~stable | (gap > np.maximum(CLOSED, kinematics.rounding(scene.coordinates))) | (
                ~done & ((length > CONTRACTION * before) | (length > LONGEST)))  # fmt: skip
            if lost.any():
                raise _lost(first + int(np.argmax(lost)))
            if last:
                return pose
            before, last = length, bool(done.all())
            pose = kinematics.tree.at(pose, scene.coordinates).moved(step)
            if scene.cuts is not None:
                pose, gap, travel = self._closed(pose, travel, scene.couplers)
        raise _lost(first + int(np.argmin(done)))

    def _closed(
        self, pose: Pose, travel: Array | None, couplers: tuple[Coupling, ...]
    ) -> tuple[Pose, Array, Array | None]:
        """The poses with loops closed by their dependent coordinates, what they are still open (v,) in units of 1 rad
        and the size of the mechanism, and the displacements of coupled coordinates.
        """
        assert self.plan.posed_scene is not None
        kinematics = self.plan.posed_scene.kinematics
        for _ in range(CORRECTIONS):
            coordinates, cuts = kinematics.at(pose)
            assert cuts is not None
            error = kinematics.openings(pose)
            if cuts.couplings is not None:
                travel = coupler_travel(couplers, kinematics.topology.joints, pose, travel)
                error = np.concatenate((error, cuts.couplings.sums(travel)), axis=1)
            gap = np.abs(error * kinematics.row_scale).max(axis=1)
            if (gap <= CLOSED_EXACTLY).all():
                break
            phi, step = locked(coordinates, cuts), np.zeros((len(error), len(coordinates.names)))
            for kept, dependent in self.plan.pivots.kept:
                solution = np.linalg.solve(phi[:, kept[:, None], dependent], error[:, kept, None])
                step[:, dependent] = -solution[..., 0]
            pose = kinematics.tree.at(pose, coordinates).moved(step)
        return pose, gap, travel

    def _step(
        self, scene: Scene, values: Values, first: int, pose: Pose
    ) -> tuple[Array, Array, Bools]:
        """Newton's step of all joints (v, n), the share of the forces that is left (v,), and which are stable (v,)."""
        posed, pivots, locked = self.plan.posed_scene, self.plan.pivots, scene.locked
        assert posed is not None
        relative, axes = scene.relative(), posed.joint_axes(pose)
        phi, reduction = scene.closure(relative), pivots.reduction
        if phi.ndim == 3:
            reduction, decided = reduce_batch(scene, values, phi, pivots, Variants(first, axes))
            if decided:
                raise _lost(first)
        rows = reduction.apply_exactly(relative.dense(locked, locked + len(scene.springs.owner)))
        residual, size, tangent = of_loads(scene, axes, reduction, partial(pivots.multipliers, phi))
        tangent = tangent + weighted_gram(rows, scene.springs.stiffness)
        unit = posed.kinematics.scale[reduction.independent]
        size = np.maximum(size, EPS / RESOLVED * (np.abs(tangent) @ unit))
        scaled = tangent * np.multiply.outer(unit, unit)
        eigenvalues = np.linalg.eigvalsh(0.5 * (scaled + scaled.swapaxes(-1, -2)))
        stable = eigenvalues[:, 0] > ZERO_STIFFNESS * np.abs(eigenvalues).max(axis=1)
        safe = np.where(stable[:, None, None], scaled, np.eye(len(unit)))
        change: Any = unit * np.linalg.solve(safe, (unit * residual)[..., None])[..., 0]
        step = change if reduction.matrix is None else (reduction.matrix @ change[..., None])[..., 0]
        share = np.abs(residual / np.where(size > 0.0, size, 1.0)).max(axis=1)
        return step, share, np.asarray(stable)


def _lost(i: int) -> EquilibriumError:
    return EquilibriumError(f"variant {i}: Newton's method does not contract from the described pose.")
