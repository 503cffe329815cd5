"""Warnings where beams and superelements bend beyond the range of small displacements."""

from __future__ import annotations

import math
import warnings
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.elements.beam import Beam
from mbsvib.elements.rows import Rows
from mbsvib.equilibrium.flexible_parts import flexible
from mbsvib.errors import LargeDisplacementWarning
from mbsvib.kinematics.relative_motion import relative_motion

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.equilibrium.motion import PosedModel
    from mbsvib.kinematics.loops import Reduction
    from mbsvib.mechanism.mechanism import Mechanism

# Rotation of a node [rad] against the body that carries the part; the relative error of displacements is about half its
# square.
TURNED = 0.15
# A sag w of a beam whose ends cannot approach each other makes it stiffer by the share w^2 / (16 i^2), i its radius of
# gyration, which is 0.75 (w / t)^2 for a thickness t: less than one percent up to this share of the thickness.
SAG = 0.1
# Smaller relative motion of the ends along the line between them is rounding.
APART = 1e-9


def warn_beyond(there: Mechanism, at: PosedModel, reduction: Reduction) -> None:
    """Warn of parts that bend beyond the range of linear theory; ``there`` is the model in the pose ``at``.

    Warns
    -----
    LargeDisplacementWarning
        If nodes have turned by ``TURNED``, or a beam whose ends are held apart sags by ``SAG`` of its thickness.
    """
    for part in flexible(there):
        if part.displacements is None:
            continue
        kind = type(part).__name__.lower()
        six = np.array(part.displacements).reshape(-1)[: 6 * len(part.points)].reshape(-1, 6)
        angle = float(np.sqrt(np.square(six[:, 3:]).sum(axis=1)).max())
        if angle > TURNED:
            _warn(f"{kind} '{part.name}' bends by {angle:.2g} rad; displacements in the frame of the body that "
                  f"carries it are assumed to be small, which is accurate to about {0.5 * angle**2:.0%} there. Divide "
                  f"it into several parts with a body between them, or lower the load.")  # fmt: skip
        elif isinstance(part, Beam) and (share := _sag(part, six)) > SAG and _held_apart(part, at, reduction):
            _warn(f"beam '{part.name}' sags by {share:.2g} of its thickness between ends that are held apart, which "
                  f"would stretch it and make it stiffer by about {0.75 * share**2:.0%}; the linear theory of "
                  f"small displacements neglects this tension.")  # fmt: skip


def _warn(message: str) -> None:
    warnings.warn(message, LargeDisplacementWarning, stacklevel=5)


def _sag(beam: Beam, six: Array) -> float:
    """The largest deflection from the line between the ends over the thickness in its direction."""
    axes = np.array([axes for _, axes in beam.without_forces().frames()])
    share = (np.arange(len(six)) / (len(six) - 1))[:, None]
    sag = six[:, :3] - (1.0 - share) * six[0, :3] - share * six[-1, :3]
    local = np.einsum("eij,ei->ej", axes[np.minimum(np.arange(len(six)), len(axes) - 1)], sag)
    section = beam.properties
    thick = [math.sqrt(12.0 * second / section.A) for second in (section.Iz, section.Iy)]
    return float((np.abs(local[:, 1:]) / thick).max())


def _held_apart(beam: Beam, at: PosedModel, reduction: Reduction) -> bool:
    """Whether no coordinate changes the distance between the ends of a beam."""
    first, last = beam.body_of(0), beam.body_of(len(beam.points) - 1)
    if first == last:
        return True
    line = np.subtract(beam.points[-1], beam.points[0])
    line /= np.linalg.norm(line)
    rows = Rows.stack([(at.pose.number[first], at.pose.number[last], *beam.points[-1], *line.tolist(), 0.0, 0.0, 0.0)])
    motion = reduction.apply(relative_motion(at.coordinates, rows).dense(0, 1))
    return not bool((np.abs(motion) > APART).any())
