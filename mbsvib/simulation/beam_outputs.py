"""Strains of beams and forces in their elements, from the coordinates of elastic blocks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from mbsvib.elements.beam import Beam
from mbsvib.elements.beam_expansion import elements
from mbsvib.elements.strain_output import StrainOutput, expand
from mbsvib.finite_motion.elastic import strain_of_slopes
from mbsvib.finite_motion.elastic_nodes import node_row

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.elements.ports import ForceOutput
    from mbsvib.finite_motion.elastic_block import ElasticBlock
    from mbsvib.finite_motion.lagrange import FiniteMotion
    from mbsvib.finite_motion.rotations import Expression
    from mbsvib.mechanism.mechanism import Mechanism


def beam_of(model: Mechanism, element: str | None) -> Any:
    """Return the beam that has an element of this name, or None."""
    return next((part for part in model.composed.values() if element in part.element_names), None)


def strain(part: StrainOutput, beam: Beam, statement: FiniteMotion) -> Expression:
    """Return a strain of a beam, a relative displacement of two nodes in the axes of the body that carries it."""
    measured = expand(part, {beam.name: beam}).outputs[part.name]
    block = _block(beam, statement)
    row = _relative(block, (measured.relative_to, measured.body), measured.position or (0.0, 0.0, 0.0), measured.wrench)
    i = beam.element_names.index(part.element)
    return _along(row[None], block, statement) + _by_slopes(i, block, statement) / beam.lengths()[i]


def element_force(part: ForceOutput, beam: Beam, statement: FiniteMotion) -> Expression:
    """Return the force in a beam element at its midpoint, along its axes; positive where it pulls its ends together."""
    i = beam.element_names.index(part.element)
    block, (_, spring) = _block(beam, statement), elements(beam)[i]
    axes, ends = np.array(spring.orientation), (spring.first, spring.second)
    directions = [(*axes[:, k], 0.0, 0.0, 0.0) for k in range(3)] + [(0.0, 0.0, 0.0, *axes[:, k]) for k in range(3)]
    rows = np.array([_relative(block, ends, spring.position, direction) for direction in directions])
    deformation = _along(rows, block, statement)
    deformation[0] += _by_slopes(i, block, statement)
    stiffness, damping = (ca.SX(np.array(part.wrench) * np.array(values)) for values in (spring.stiffness,
                                                                                         spring.damping))  # fmt: skip
    return ca.dot(stiffness, deformation) + ca.dot(damping, statement.motion.rate(deformation))


def _block(beam: Beam, statement: FiniteMotion) -> ElasticBlock:
    return next(block for block in statement.blocks if block.name == beam.name)


def _relative(
    block: ElasticBlock, ends: tuple[str, str], point: tuple[float, ...], direction: tuple[float, ...]
) -> Array:
    """The row on x of the displacement of the second end against the first."""
    first, second = (node_row(block, body, point, direction) for body in ends)
    return second - first


def _by_slopes(i: int, block: ElasticBlock, statement: FiniteMotion) -> Expression:
    """What slopes add to the change of length of element i since as described [m]."""
    if block.bending is None:
        return ca.SX(0.0)
    b, z = statement.motion.elastic[block.name]
    now, described = (strain_of_slopes(block.bending, block, both) for both in (
        ca.vertcat(z, b), ca.SX.zeros(block.span.shape[1])))  # fmt: skip
    return now[i] - described[i]


def _along(rows: Array, block: ElasticBlock, statement: FiniteMotion) -> Expression:
    b, z = statement.motion.elastic[block.name]
    return ca.sparsify(ca.SX(rows @ block.span)) @ ca.vertcat(z, b)
