"""Poses of a loaded mechanism next to its own: what is left of the forces there, and the tangent that moves it back."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.elements.coupler import refuse_curved
from mbsvib.equilibrium.articulation import articulated, with_rigid_parts
from mbsvib.equilibrium.balance import balance
from mbsvib.equilibrium.motion import close, posed_model
from mbsvib.equilibrium.moved_parts import model_in_pose, static_model
from mbsvib.kinematics.pose import start
from mbsvib.linalg.differences import slope
from mbsvib.linalg.rank import ZERO_DIFFERENCE
from mbsvib.linalg.vectors import inverse_root
from mbsvib.sensitivities.pose_motion import balancing_motion

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.equilibrium.balance import Balance
    from mbsvib.equilibrium.motion import PosedModel
    from mbsvib.mechanism.mechanism import Mechanism

# The first step of differences along coordinates, against what is a large motion.
STEP = 2.0**-6


@dataclass(frozen=True)
class VariantPoses:
    """A mechanism in balance, the ``posed_model`` of its pose, and the ``forces`` there along its m coordinates.

    Beams and superelements bend on the way to another pose if they state displacements. Otherwise the pose given is
    the loaded one, whatever the loads are, and they keep their shape.
    """

    model: Mechanism
    posed_model: PosedModel
    forces: Balance

    @staticmethod
    def of(model: Mechanism, cut: Sequence[str], names: Sequence[str] | None = None) -> VariantPoses:
        """Return the poses next to that of a mechanism whose loops are cut at some joints, along some coordinates."""
        at = _posed_model(model, cut)
        return VariantPoses(model, at, balance(at, names))

    @property
    def names(self) -> tuple[str, ...]:
        """Names (m,) of the coordinates."""
        return self.forces.names

    @property
    def steps(self) -> Array:
        """What is a large motion (m,) along each coordinate: 1 rad, or the size of the mechanism [m]."""
        return self.posed_model.scale[self.forces.reduction.independent]

    def residual(self, variant: Mechanism) -> Array:
        """Return what is left of the forces (m,) on a variant of the mechanism in the same pose."""
        return balance(_posed_model(variant, self.posed_model.cut), self.names).residual

    def at(self, motion: Array) -> Mechanism:
        """Return the mechanism after a motion (m,) along its coordinates, with its loops closed."""
        moved = self.posed_model.moved(self.forces.all_joints(motion))
        depends = np.ones(len(moved.coordinates.names), dtype=bool)
        depends[self.forces.reduction.independent] = False
        return model_in_pose(self.model, close(moved, depends)[0].pose)

    @cached_property
    def tangent(self) -> Array:
        """Minus the derivative of what is left of the forces along motions (m, m).

        It is K, but for couplers of several rotations of one joint, which go by small rotations in each pose anew.
        """
        if not self.model.couplers:
            return self.forces.tangent

        def along(unit: Array, step: float) -> Array:
            return -slope(lambda q: self.residual(self.at(q * unit)), step)[0]

        units = np.eye(len(self.names))
        return np.transpose([along(*direction) for direction in zip(units, STEP * self.steps, strict=True)])

    def motion(self, force: Array, scale: float) -> Array | None:
        """Return the motion x (m,) that balances forces, T x = f with the tangent T; None if they act on one that
        nothing holds.

        ``force`` (m,): derivative f of what is left of the forces to a parameter; where it is rounding, x is zero.
        ``scale``: what is a large change of the parameter.
        """
        forces, rounding = self.forces, self.forces.size / scale
        unbalanced = np.where(np.abs(force) > ZERO_DIFFERENCE * rounding, force, 0.0)
        if not unbalanced.any():
            return unbalanced
        refuse_curved(self.model.couplers.values(), "so that derivatives to parameters that move the equilibrium are "
                      "not known. Name others, such as stiffness and damping.")
        unit = inverse_root(np.abs(forces.tangent.diagonal()) + forces.balanced_forces / self.steps)
        motions, unresisted = balancing_motion(self.tangent, unit, unbalanced[None], lambda: rounding[None])
        if unresisted[0]:
            return None
        motion = motions[0]
        share = np.abs(motion) / self.steps
        return np.where(share > ZERO_DIFFERENCE * share.max(), motion, 0.0)


def _posed_model(model: Mechanism, cut: Sequence[str]) -> PosedModel:
    bends = any(part.displacements is not None for part in model.composed.values())
    articulated_model = static_model(articulated(model) if bends else with_rigid_parts(model))
    remaining = tuple(name for name in cut if name in articulated_model.joints)
    return posed_model(articulated_model, start(articulated_model), remaining)
