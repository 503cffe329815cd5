"""Warnings of runs in which beams and superelements bend beyond the range of small displacements."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from mbsvib.equilibrium.linear_range import TURNED
from mbsvib.errors import LargeDisplacementWarning

if TYPE_CHECKING:
    from mbsvib.simulation.trace import Trace


def warn_of_bending(run: Trace, stacklevel: int) -> None:
    """Warn of beams and superelements that bend too far for small displacements.

    ``stacklevel``: as of ``warnings.warn``, from the caller.
    """
    statement = run.session.statement
    if not statement.bends:
        return
    motion = statement.motion
    function = ca.Function("bending", [motion.q, motion.bases],
                           [ca.vertcat(*(part.angle for part in statement.bends.values()))])  # fmt: skip
    q = np.array([sample.state.q for sample in run.samples]).T
    bases = np.array([sample.chart.bases for sample in run.samples]).T
    for name, angle in zip(statement.bends, np.asarray(function(q, bases)).max(axis=1).tolist(), strict=True):
        if angle > TURNED:
            warnings.warn(f"simulate: '{name}' bends by {angle:.2g} rad; its displacements are small ones in the frame "
                          f"of the body that carries it, good to about {0.5 * angle**2:.0%} there. Make several parts "
                          f"of it, with a body between them.", LargeDisplacementWarning,
                          stacklevel=stacklevel + 1)  # fmt: skip

