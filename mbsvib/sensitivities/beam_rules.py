"""Beams: how their elements change with material, section and damping.

An element is six springs at its midpoint and a mass matrix of its two ends, closed formulas of its section. Slopes of
these formulas are differences, extrapolated to rounding (12 digits): nothing of the mechanism is differenced.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.elements import beam_element as element
from mbsvib.elements.beam_expansion import turned
from mbsvib.linalg.differences import slope
from mbsvib.linalg.vectors import transformed

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    from mbsvib.common.arrays import Array
    from mbsvib.elements.beam import Beam
    from mbsvib.linalg.vectors import Field
    from mbsvib.sensitivities.adjoint_fields import Fields
    from mbsvib.sensitivities.network import Network
    from mbsvib.sensitivities.rule_terms import Rule, Terms

# The first step of differences, against the value.
STEP = 2.0**-7
# Slopes of a mass matrix below this share of the largest are rounding.
ACTS = 1e-11


def beam_rule(network: Network, beam: Beam, field: str) -> Rule:
    """Return the rule by which a number of a beam enters the equations.

    Parameters
    ----------
    network : Network
        Bodies and connections.
    beam : Beam
        The beam.
    field : str
        A number of its material, its section, or its damping.

    Returns
    -------
    callable
        Terms of one entry.
    """
    number = {body.name: i for i, body in enumerate(network.bodies)}
    springs = {spring.name: i for i, spring in enumerate(network.springs)}
    frames = beam.frames()
    axes = np.array([turn for _, turn in frames]).transpose(0, 2, 1)
    k = np.array([element.stiffness(length, beam.properties, beam.material, beam.shear) for length, _ in frames])
    stiff, mass = slopes(beam, field, [length for length, _ in frames])
    rate = k if field == "beta" else beam.beta * stiff
    which = np.array([springs[name] for name in beam.element_names])
    factors = [_factors(each, turn) for each, (_, turn) in zip(mass, frames, strict=True)]
    ends = [(number.get(beam.node(i), -1), np.array(point)) for i, point in enumerate(beam.points)]
    # what dampers in proportion to the mass do: their factor for C, of M or of its slope
    by_mass = 1.0 if field == "alpha" else beam.alpha

    def rule(fields: Fields, _: Any, __: tuple[Array, ...]) -> list[Terms]:
        d = fields.strain[which]
        local = np.concatenate((transformed(axes, d[:, :3]), transformed(axes, d[:, 3:])), axis=1)
        terms: Terms = []
        for e in range(len(which)):
            for i in range(6):
                weight = 0.5 * (stiff[e, i] * fields.stiff + rate[e, i] * fields.rate)
                terms.append((weight * local[e : e + 1, i], local[e : e + 1, i]))
        weight = 0.5 * by_mass * fields.rate + (0.0 if field == "alpha" else 0.5 * fields.square)
        for e, (sizes, rows) in enumerate(factors):
            moved = np.tensordot(rows, _ends(network, fields.body, ends[e : e + 2]), axes=1)
            terms += [(size * weight * row[None], row[None]) for size, row in zip(sizes, moved, strict=True)]
        return [terms]

    return rule


def slopes(beam: Beam, field: str, lengths: list[float]) -> tuple[Array, Array]:
    """Return how springs (e, 6) and mass matrices (e, 12, 12), element axes, change; of ``alpha`` the mass itself."""

    def values(changed: Beam) -> Array:
        given = changed.properties, changed.material, changed.shear
        rows = [element.mass_rows(length, *given) for length in lengths]
        return np.array([(*element.stiffness(length, *given), *(factor.T @ factor).reshape(-1))
                         for length, factor in zip(lengths, rows, strict=True)])  # fmt: skip

    if field in ("alpha", "beta"):
        rows = values(beam) * np.repeat((0.0, 1.0 if field == "alpha" else 0.0), (6, 144))
    else:
        start = next(item.value for item in beam.parameter_fields() if item.name == field)
        rows, _ = slope(lambda change: values(beam.with_values({field: start + change})), STEP * (abs(start) or 1.0))
    return rows[:, :6], rows[:, 6:].reshape(-1, 12, 12)


def _factors(matrix: Array, axes: Any) -> tuple[Array, Array]:
    """A symmetric matrix as sizes (r,) and rows (r, 12), world axes."""
    sizes, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
    acts = np.abs(sizes) > ACTS * np.abs(sizes).max(initial=0.0)
    return sizes[acts], turned(np.ascontiguousarray(vectors.T[acts]), axes)


def _ends(network: Network, body: Field, ends: Sequence[tuple[int, Array]]) -> Field:
    """Displacements (12, ...) of the two ends of an element, which may be points of rigid bodies."""
    parts = []
    for number, point in ends:
        if number < 0:
            parts.append(np.zeros((6, *body.shape[2:]), dtype=body.dtype))
            continue
        moved, (x, y, z) = np.array(body[number]), point - network.position[number]
        rx, ry, rz = body[number, 3:]
        moved[0] += ry * z - rz * y
        moved[1] += rz * x - rx * z
        moved[2] += rx * y - ry * x
        parts.append(moved)
    return np.concatenate(parts)
