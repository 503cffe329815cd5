"""Elastic blocks in the frame of a body that moves finitely: their energies.

Stations have the velocities V = (R^T v, R^T w + rho') in the axes of the root, and T = 1/2 V^T M V with the mass matrix
of the part as described: M is that of small displacements, and exact for motions of the root.

Source: Zwoelfer & Gerstmayr (2021), The nodal-based floating frame of reference formulation, Acta Mechanica 232.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.equilibrium.articulation import TURNED
from mbsvib.errors import LargeDisplacementWarning
from mbsvib.finite_motion.elastic_block import Bending, ElasticBlock
from mbsvib.finite_motion.frames import REST, Expression, Frame, angular_velocity
from mbsvib.finite_motion.kinematics import Kinematics
from mbsvib.mechanism.mechanism import GROUND

# Entries of products below this share of the largest are rounding of what is zero by symmetry.
ROUNDING = 1e-13


@dataclass(frozen=True)
class ElasticEnergies:
    """What an elastic block stores and dissipates [J, W], its ``momentum`` (3,) [N s] and its ``angular_momentum`` (3,)
    [N m s] about the origin, world axes.

    ``angle`` [rad] is the largest rotation at its interface.
    """

    kinetic: Expression
    potential: Expression
    dissipation: Expression
    angle: Expression
    momentum: Expression
    angular_momentum: Expression


def elastic_energies(block: ElasticBlock, b: Expression, z: Expression, motion: Kinematics) -> ElasticEnergies:
    """Return the energies of an elastic block.

    ``b`` (6 interface nodes,): displacements of the interface since as described. ``z`` (modes,): modes of the part
    with its interface held.
    """
    both, span = ca.vertcat(z, b), block.span
    rates = motion.rate(both)
    stiffness = span.T @ block.stiffness @ span
    count = len(block.eigenvalues)
    stiffness[:count, :count] = np.diag(block.eigenvalues)
    stiffness[:count, count:] = stiffness[count:, :count] = 0.0
    linear_force = span.T @ (block.stiffness @ block.state - block.force)
    offset = 0.5 * block.state @ block.stiffness @ block.state
    potential = 0.5 * _form(stiffness, both) + ca.dot(ca.SX(_clean(linear_force)), both) + offset
    relative = 0.5 * _form(span.T @ block.relative_damping @ span, rates)
    if block.bending is not None:
        added = _of_slopes(block.bending, block, both, rates)
        potential, relative = potential + added[0], relative + added[1]
    columns = [6 * i + j for i in block.elastic for j in range(6)] + list(range(6 * len(block.points), len(block.mass)))
    change, speed = ca.SX(span) @ both, ca.SX(span) @ rates
    if motion.frames[block.root] is REST:
        forms = [0.5 * _form(span.T @ matrix[np.ix_(columns, columns)] @ span, rates)
                 for matrix in (block.mass, block.damping)]  # fmt: skip
        potential -= sum((ca.dot(ca.SX(_clean(force)), both) for force in [_weight(block) @ span]), ca.SX(0.0))
        momentum = _momentum(block, change, ca.SX(block.mass[:, columns] @ span) @ rates)
    else:
        frame, ground = motion.frames[block.root], motion.frames[GROUND]
        origin, spin = motion.velocity(block.root, frame.shift), motion.angular_velocity(block.root)
        velocities, fallen = _stations(block, change, speed, frame, (origin, spin))
        of_dampers = velocities  # which stand on the ground
        if ground is not REST:
            seen = frame.seen_from(ground)
            twist = motion.rate(seen.shift), angular_velocity(seen, motion.q, motion.qd)
            of_dampers, _ = _stations(block, change, speed, seen, twist)
        forms = [0.5 * _form(block.mass, velocities), 0.5 * _form(block.damping, of_dampers)]
        potential -= fallen
        linear, angular = map(frame.vector, _momentum(block, change, ca.SX(block.mass) @ velocities))
        momentum = linear, angular + ca.cross(frame.shift, linear)
    turns = [ca.norm_2(ca.SX(span[6 * s + 3 : 6 * s + 6]) @ both + ca.SX(block.state[6 * s + 3 : 6 * s + 6]))
             for s in block.interface]  # fmt: skip
    largest = ca.mmax(ca.vertcat(*turns)) if turns else ca.SX(0.0)
    return ElasticEnergies(forms[0], potential, relative + forms[1], largest, *momentum)


def warn_of_bending(
    who: str, bends: Mapping[str, ElasticEnergies], motion: Kinematics, q: Array, bases: Array, level: int
) -> None:
    """Warn of beams and superelements that bend too far for small displacements.

    ``q`` (samples, n) and ``bases`` (9 b,) or (samples, 9 b): the motion. ``level``: frames up to the call of the user.
    """
    if not bends:
        return
    function = ca.Function("bending", [motion.q, motion.bases], [ca.vertcat(*(part.angle for part in bends.values()))])
    angles = np.asarray(function(q.T, bases.T)).max(axis=1)
    for name, angle in zip(bends, angles.tolist(), strict=True):
        if angle > TURNED:
            warnings.warn(f"{who}: '{name}' bends by {angle:.2g} rad; its displacements are small ones in the frame "
                          f"of the body that carries it, good to about {0.5 * angle**2:.0%} there. Make several parts "
                          f"of it, with a body between them.", LargeDisplacementWarning, stacklevel=level)  # fmt: skip


def strain_of_slopes(bending: Bending, block: ElasticBlock, both: Expression) -> Expression:
    """Return what slopes add to the strain of a beam's elements, sum w_j (S_j x)^2 / 2 (n,)."""
    slopes = _along(bending.slopes, block, both)
    return _by_element(bending) @ (0.5 * slopes * slopes)


def _of_slopes(
    bending: Bending, block: ElasticBlock, both: Expression, rates: Expression
) -> tuple[Expression, Expression]:
    """What slopes add to the potential and to the dissipation."""
    strain, added = _along(bending.strain, block, both), strain_of_slopes(bending, block, both)
    potential = ca.dot(ca.DM(bending.stiffness), added * (strain + 0.5 * added))
    if not bending.damping.any():
        return potential, ca.SX(0.0)
    strain_rate, slope_rates = (_spanned(rows, block) @ rates for rows in (bending.strain, bending.slopes))
    added = _by_element(bending) @ (_along(bending.slopes, block, both) * slope_rates)
    return potential, ca.dot(ca.DM(bending.damping), added * (strain_rate + 0.5 * added))


def _along(rows: Array, block: ElasticBlock, both: Expression) -> Expression:
    """Rows on x."""
    return _spanned(rows, block) @ both + ca.DM(rows @ block.state)


def _spanned(rows: Array, block: ElasticBlock) -> Expression:
    """Rows on (z, b), without what is rounding of zeros."""
    matrix = rows @ block.span
    size = np.abs(rows) @ np.abs(block.span)
    return ca.sparsify(ca.DM(np.where(np.abs(matrix) > ROUNDING * size, matrix, 0.0)))


def _by_element(bending: Bending) -> Expression:
    """The matrix (n, m) that adds up what belongs to an element, with weights."""
    matrix = np.zeros((len(bending.strain), len(bending.elements)))
    matrix[bending.elements, range(len(bending.elements))] = bending.weights
    return ca.sparsify(ca.DM(matrix))


def _stations(
    block: ElasticBlock, change: Expression, speed: Expression, frame: Frame, twist: tuple[Expression, Expression]
) -> tuple[Expression, Expression]:
    """Velocities of all stations and rates of internal coordinates in the axes of the root, and the work of weights,
    with the root in this frame; ``twist`` is the velocity of what was at the origin, and the angular velocity in the
    axes of the root.
    """
    number_of = {station: k for k, station in enumerate(block.elastic)}
    parts, fallen = [], ca.SX(0.0)
    origin, spin = frame.rotation.T @ twist[0], twist[1]
    for i, point in enumerate(block.points):
        at, v, w, arm = ca.SX(point), ca.SX.zeros(3), ca.SX.zeros(3), ca.SX(block.arms[i])
        start, turned = at, arm
        if i in number_of:
            k = 6 * number_of[i]
            start = at + ca.SX(block.state[k : k + 3])
            at, v, w = start + change[k : k + 3], speed[k : k + 3], speed[k + 3 : k + 6]
            turned = arm + ca.cross(change[k + 3 : k + 6], arm)
        parts.append(ca.vertcat(origin + ca.cross(spin, at) + v, spin + w))
        if block.weight[i].any():
            fallen += ca.dot(ca.SX(block.weight[i]), frame.point(at + turned) - start - arm)
    return ca.vertcat(*parts, speed[6 * len(block.elastic) :]), fallen


def _momentum(block: ElasticBlock, change: Expression, momenta: Expression) -> tuple[Expression, Expression]:
    """Linear momentum (3,), and the angular one about the origin, in the axes of the root, of the momenta M V.

    p = sum p_i,  L = sum (r_i x p_i + h_i)
    """
    linear, angular = ca.SX.zeros(3), ca.SX.zeros(3)
    number_of = {station: k for k, station in enumerate(block.elastic)}
    for i, point in enumerate(block.points):
        at, own = ca.SX(point), momenta[6 * i : 6 * i + 6]
        if i in number_of:
            k = 6 * number_of[i]
            at += ca.SX(block.state[k : k + 3]) + change[k : k + 3]
        linear += own[:3]
        angular += ca.cross(at, own[:3]) + own[3:]
    return linear, angular


def _weight(block: ElasticBlock) -> Array:
    """Forces of the weight along x."""
    result = np.zeros(len(block.state))
    for k, station in enumerate(block.elastic):
        result[6 * k : 6 * k + 3] = block.weight[station]
        result[6 * k + 3 : 6 * k + 6] = np.cross(block.arms[station], block.weight[station])
    return result


def _form(matrix: Array, vector: Expression) -> Expression:
    """v^T A v of a symmetric matrix, without what is rounding of zeros."""
    scale = np.sqrt(np.abs(matrix.diagonal()))
    retained = np.where(np.abs(matrix) > ROUNDING * np.outer(scale, scale), matrix, 0.0)
    return ca.dot(vector, ca.sparsify(ca.DM(0.5 * (retained + retained.T))) @ vector)


def _clean(vector: Array) -> Array:
    return np.where(np.abs(vector) > ROUNDING * np.abs(vector).max(initial=0.0), vector, 0.0)
