"""Warnings where beams and superelements bend beyond the range of small displacements."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.errors import LargeDisplacementWarning

if TYPE_CHECKING:
    from mbsvib.mechanism.mechanism import Mechanism

# Rotation of a node [rad] against the body that carries the part; the relative error of displacements is about half its
# square.
TURNED = 0.15


def warn_beyond(deformed: Mechanism) -> None:
    """Warn of parts of a deformed model that bend beyond the range of small displacements, by ``TURNED``."""
    for part in deformed.composed.values():
        if part.displacements is None:
            continue
        six = np.array(part.displacements).reshape(-1)[: 6 * len(part.points)].reshape(-1, 6)
        angle = float(np.sqrt(np.square(six[:, 3:]).sum(axis=1)).max())
        if angle > TURNED:
            warnings.warn(f"{part.family} '{part.name}' bends by {angle:.2g} rad; displacements in the frame of the "
                          f"body that carries it are assumed to be small, which is accurate to about "
                          f"{0.5 * angle**2:.0%} there. Divide it into several parts with a body between them, or "
                          f"lower the load.", LargeDisplacementWarning, stacklevel=4)  # fmt: skip
