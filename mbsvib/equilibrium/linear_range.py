"""Warnings where beams and superelements bend beyond the range of small displacements."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.elements.beam import Beam
from mbsvib.elements.beam_expansion import elastic_part
from mbsvib.elements.beam_sag import SAG, sag_message, sag_rows
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
# Work of the tension on the slopes of a bent beam, as a share of the energy of its bending: about how much the tension
# would change the bending, which the equilibrium takes for linear in the frame of the body that carries the beam.
TENSIONED = 0.1
BENDING = [1, 2, 4, 5]  # of the six deformations of an element, along and about its axes
# Smaller relative motion of the ends along the line between them [m or rad], or slope of an element, is rounding.
MOVES = 1e-9


def warn_beyond(deformed: Mechanism, at: PosedModel, reduction: Reduction) -> None:
    """Warn of parts that bend beyond the range of linear theory; ``deformed`` is the model in the pose ``at``.

    Warns
    -----
    LargeDisplacementWarning
        If nodes have turned by ``TURNED``, a beam whose ends are held apart sags by ``SAG`` of its thickness, or
        tension would change the bending of a beam by ``TENSIONED``.
    """
    for part in flexible(deformed):
        if part.displacements is None:
            continue
        six = np.array(part.displacements).reshape(-1)[: 6 * len(part.points)].reshape(-1, 6)
        angle = float(np.sqrt(np.square(six[:, 3:]).sum(axis=1)).max())
        if angle > TURNED:
            _warn(f"{part.family} '{part.name}' bends by {angle:.2g} rad; displacements in the frame of the body that "
                  f"carries it are assumed to be small, which is accurate to about {0.5 * angle**2:.0%} there. Divide "
                  f"it into several parts with a body between them, or lower the load.")  # fmt: skip
        elif isinstance(part, Beam):
            share = float(np.abs(sag_rows(part) @ six.reshape(-1)).max())
            if share > SAG and _held_apart(part, at, reduction):
                _warn(sag_message(part.name, share))
                continue
            tensioned, force = _tension_share(part, six[:, :3])
            if abs(tensioned) > TENSIONED:
                _warn(f"{part.family} '{part.name}': its {'tension' if force > 0.0 else 'compression'} of up to "
                      f"{abs(force):.3g} N would change how it bends by about {abs(tensioned):.0%}, which the "
                      f"equilibrium neglects. Divide the beam into several ones with a body between them, between "
                      f"which tension counts.")  # fmt: skip


def _warn(message: str) -> None:
    warnings.warn(message, LargeDisplacementWarning, stacklevel=5)


def _tension_share(beam: Beam, displacement: Array) -> tuple[float, float]:
    """Work of the tension on the slopes of a bent beam over twice the energy of bending; the largest tension [N]."""
    part, lengths = elastic_part(beam), np.array(beam.lengths())
    deformation = (part.rows @ part.state).reshape(len(lengths), 6)
    force = part.values.reshape(len(lengths), 6) * deformation
    along = np.array([axes for _, axes in beam.frames()])[:, :, 0]
    between = np.diff(displacement, axis=0)
    across = between - (between * along).sum(axis=1, keepdims=True) * along
    work = float(force[:, 0] @ (np.square(across).sum(axis=1) / lengths))
    energy = float((force * deformation)[:, BENDING].sum())
    bends = energy > 0.0 and bool((np.abs(across) > MOVES * lengths[:, None]).any())
    return work / energy if bends else 0.0, float(force[np.abs(force[:, 0]).argmax(), 0])


def _held_apart(beam: Beam, at: PosedModel, reduction: Reduction) -> bool:
    """Whether no coordinate changes the distance between the ends of a beam."""
    first, last = beam.body_of(0), beam.body_of(len(beam.points) - 1)
    if first == last:
        return True
    line = np.subtract(beam.points[-1], beam.points[0])
    line /= np.linalg.norm(line)
    rows = Rows.stack([(at.pose.number[first], at.pose.number[last], *beam.points[-1], *line.tolist(), 0.0, 0.0, 0.0)])
    motion = reduction.apply(relative_motion(at.coordinates, rows).dense(0, 1))
    return not bool((np.abs(motion) > MOVES).any())
