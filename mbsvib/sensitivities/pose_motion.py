"""How the pose of a loaded scene changes with parameters, along its coordinates: dq/dp = K^-1 dR/dp.

Rates dR/dp are those of the network under its forces, or what is left of the forces on variants in poses nearby.

A scene that found its equilibrium elsewhere has parameters of the model as described: a part there is what its body
carried along, so that changes dp of points and axes arrive as R dp, R the turn of the body. What joins two bodies is
carried by both: where these turn differently, by R_a and R_b, joints come apart by (R_a - R_b) dp, and their bodies
have to follow. Springs keep their law, so that what changes their length as described changes their tension there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from mbsvib.common.arrays import Array
from mbsvib.elements.coupler import refuse_curved
from mbsvib.equilibrium.articulation import articulated, with_rigid_parts
from mbsvib.equilibrium.balance import Balance, balance
from mbsvib.equilibrium.motion import PosedModel, close, posed_model
from mbsvib.equilibrium.moved_parts import model_in_pose, static_model
from mbsvib.kinematics.pose import start
from mbsvib.linalg.differences import slope
from mbsvib.linalg.rank import CANCELLED, ZERO_DIFFERENCE, ZERO_STIFFNESS, ZERO_UNHELD_FORCE
from mbsvib.linalg.vectors import inverse_root
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.mechanism.parameters import Parameter
from mbsvib.sensitivities.families import rules_of
from mbsvib.sensitivities.families.pose_changes import ForceChanges, ReferenceTerms, turned
from mbsvib.sensitivities.forces import Forces
from mbsvib.sensitivities.loaded_network import LoadedNetwork
from mbsvib.sensitivities.network import Network

# Of forces f, torques t and T / L (n, 1), and of the relative shifts v and turns w (n, m) that they see.
Sizes = tuple[Array, Array, Array, Array, Array]


def pose_motion(loaded: LoadedNetwork, rates: csr_array | None) -> tuple[Array, NDArray[np.bool_]]:
    """Return the motion by which the pose follows variables, and which of them load a motion that no
    stiffness holds.

    The motion (variables, c) is along the coordinates, then along the other motions, of which each variable has its own
    or none; the mask is (variables,). ``rates`` (variables, parameters): how variables move parameters; None: variables
    are the parameters.
    """
    count, m = loaded.changes.count, loaded.dof
    direct = loaded.generalized_force_jacobian[:count]
    forces = direct if rates is None else rates @ direct
    of_openings = np.eye(len(forces), loaded.motions.shape[2] - m)
    if of_openings.size:
        forces = forces + loaded.parameter_rates[:, m:].T @ direct + loaded.generalized_force_jacobian[count + m :]
    # K but for couplers of several rotations of one joint, which go by small rotations in each pose anew
    stiffness = -(loaded.parameter_rates[:, :m].T @ direct + loaded.generalized_force_jacobian[count : count + m]).T
    unit = inverse_root(np.abs(np.diagonal(stiffness)) + loaded.size_of_forces / loaded.steps)

    def terms() -> Array:
        # forces that all but vanish at rest are rounding of those that cancel
        size = _term_sizes(loaded, _sizes(loaded)) + CANCELLED / ZERO_UNHELD_FORCE * loaded.size_of_forces
        return size if rates is None else np.asarray(abs(rates) @ size)

    motion, unresisted = balancing_motion(stiffness, unit, forces, terms, loaded.relaxing)
    return np.concatenate((motion, of_openings), axis=1), unresisted


def balancing_motion(
    stiffness: Array, unit: Array, forces: Array, terms: Callable[[], Array], relaxing: NDArray[np.bool_] | None = None
) -> tuple[Array, NDArray[np.bool_]]:
    """Return the smallest motions x (v, m) that balance forces, K x = f, and which forces (v,) act on a motion that no
    stiffness holds.

    Where several motions do, as some motion is held by nothing, the others are x + N c with K N = 0. ``stiffness``
    (m, m): K. ``unit`` (m,): one over the root of what the stiffness along each coordinate is measured by. ``forces``
    (v, m): f, one row after the other. ``terms``: returns the sizes (v, m) of the products that the forces are sums of,
    asked for where some motion is held by nothing. ``relaxing`` (m,): coordinates that do not count in the size of a
    motion, as they only follow others.
    """
    left, sizes, right = np.linalg.svd(unit[:, None] * stiffness * unit)
    holds = sizes > ZERO_STIFFNESS
    along = (forces * unit) @ left
    motion = (along[:, holds] / sizes[holds]) @ right[holds]
    if holds.all():
        return unit * motion, np.zeros(len(forces), dtype=bool)
    if relaxing is not None and relaxing.any():
        free, counts = right[~holds], ~relaxing
        motion = motion - np.linalg.lstsq(free[:, counts].T, motion[:, counts].T)[0].T @ free
    over = np.abs(along[:, ~holds] @ left[:, ~holds].T)
    size = terms() @ unit + np.abs(forces * unit).max(axis=1)
    return unit * motion, (over > ZERO_UNHELD_FORCE * size[:, None]).any(axis=1)


def _sizes(loaded: LoadedNetwork) -> Sizes:
    """Sizes of forces and of what they see of motions along the coordinates."""
    forces = loaded.forces
    relative = forces.relative_motions(loaded.motions[:, :, : loaded.dof])[1]
    v, w = np.linalg.norm(relative[:, :3], axis=1), np.linalg.norm(relative[:, 3:], axis=1)
    f, t = (np.linalg.norm(part, axis=1)[:, None] for part in (forces.wrench[:, :3], forces.wrench[:, 3:]))
    return f, t, np.abs(forces.tension_over_length)[:, None], v, w


def _term_sizes(loaded: LoadedNetwork, sizes: Sizes) -> Array:
    """Sizes (parameters, m) of the products whose sums are the derivatives of the forces along the coordinates."""
    forces, at = loaded.forces, loaded.changes.at
    (f, t, tension_over_length, v, w), joints = sizes, forces.counts[0]
    rows = np.zeros((at.size, v.shape[1]))
    rows[at.point] = (f * w + tension_over_length * v).repeat(3, axis=0)
    rows[at.start] = (tension_over_length * v)[forces.lines].repeat(3, axis=0)
    both = np.stack((v, w), axis=1)[joints:].repeat(3, axis=1)
    rows[at.wrench] = both.reshape(6 * len(both), v.shape[1])
    result: Array = abs(loaded.changes.matrix) @ rows
    turned = f * v + t * w
    of = {"orientation": turned, "pitch": f * w}
    for group in loaded.groups:
        if group.kind == "joint":
            size = of.get(group.field, f * w + turned / forces.length[:, None])[group.number]
            result[group.rows] += size[:, None]
    return result


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
        rules_of(part).loaded.add_reference_terms(terms, part, k)
    terms.close()
    return ReferencePose(terms.parameters.matrix(changes.count), terms.forces.matrix(changes.at.size),
                         terms.openings.matrix(6 * len(network.joints)), turned(origin, network.parts))  # fmt: skip
