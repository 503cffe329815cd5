"""How far a beam sags between its ends, against its thickness."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.elements.beam import Beam

# A sag w of a beam whose ends cannot approach each other makes it stiffer by the share w^2 / (16 i^2), i its radius of
# gyration, which is 0.75 (w / t)^2 for a thickness t: less than one percent up to this share of the thickness.
SAG = 0.1


def sag_rows(beam: Beam) -> Array:
    """Return the rows (2 nodes, 6 nodes) that make of displacements the sag in units of the thickness.

    The sag is the deflection from the line between the ends, across the beam in two directions; the thickness is that
    of a rectangle with the same radius of gyration in that direction.
    """
    axes = [axes for _, axes in beam.without_forces().frames()]
    section = beam.properties
    thick = np.array([math.sqrt(12.0 * second / section.A) for second in (section.Iz, section.Iy)])
    count = len(beam.points)
    rows = np.zeros((count, 2, count, 6))
    for i in range(count):
        across = np.array(axes[min(i, len(axes) - 1)])[:, 1:].T / thick[:, None]
        share = i / (count - 1)
        for k, part in ((i, 1.0), (0, share - 1.0), (count - 1, -share)):
            rows[i, :, k, :3] += part * across
    return rows.reshape(2 * count, 6 * count)


def stretch_row(beam: Beam) -> Array:
    """Return the row (6 nodes,) that makes of displacements the change of the distance between the ends [m]."""
    line = np.subtract(beam.points[-1], beam.points[0])
    length = float(np.linalg.norm(line))
    row = np.zeros((len(beam.points), 6))
    if length > 0.0:
        row[0, :3], row[-1, :3] = -line / length, line / length
    return row.reshape(-1)


def sag_message(name: str, share: float) -> str:
    """Return the words on a sag, a share of the thickness, between ends that are held apart."""
    return (f"beam '{name}' sags by {share:.2g} of its thickness between ends that are held apart, which would stretch "
            f"it and make it stiffer by about {0.75 * share**2:.0%}; the linear theory of small displacements neglects "
            f"this tension.")  # fmt: skip
