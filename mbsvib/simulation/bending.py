"""Warnings of runs in which beams and superelements bend beyond the range of small displacements."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from mbsvib.elements.beam_sag import SAG, sag_message
from mbsvib.equilibrium.linear_range import MOVES, TURNED
from mbsvib.errors import LargeDisplacementWarning

if TYPE_CHECKING:
    from mbsvib.simulation.trace import Trace


def warn_of_bending(run: Trace, stacklevel: int) -> None:
    """Warn of beams and superelements that bend too far for small displacements.

    Parameters
    ----------
    run : Trace
        What has been reached.
    stacklevel : int
        As of ``warnings.warn``, from the caller.

    Warns
    -----
    LargeDisplacementWarning
        If an interface turns by ``TURNED``, or a beam whose ends are held apart sags by ``SAG`` of its thickness.
    """
    statement = run.session.statement
    if not statement.bends:
        return
    motion, parts = statement.motion, list(statement.bends.values())
    function = ca.Function("bending", [motion.q, motion.bases], [
        ca.vertcat(*(part.angle for part in parts)), ca.vertcat(*(part.sag for part in parts))])  # fmt: skip
    q = np.array([sample.state.q for sample in run.samples]).T
    bases = np.array([sample.chart.bases for sample in run.samples]).T
    angles, sags = (np.asarray(array).max(axis=1).tolist() for array in function(q, bases))
    for name, angle, sag in zip(statement.bends, angles, sags, strict=True):
        message = None
        if angle > TURNED:
            message = (f"'{name}' bends by {angle:.2g} rad; its displacements are small ones in the frame of the body "
                       f"that carries it, good to about {0.5 * angle**2:.0%} there. Make several parts of it, with a "
                       f"body between them.")  # fmt: skip
        elif sag > SAG and _held_apart(run, name):
            message = sag_message(name, sag)
        if message is not None:
            warnings.warn(f"simulate: {message}", LargeDisplacementWarning, stacklevel=stacklevel + 1)


def _held_apart(run: Trace, name: str) -> bool:
    """Whether no motion changes the distance between the ends of a beam where the run starts."""
    session, start = run.session, run.samples[0]
    motion, loops = session.statement.motion, session.loops
    slope = ca.Function("stretch", [motion.q, motion.bases],
                        [ca.jacobian(session.statement.bends[name].stretch, motion.q)])  # fmt: skip
    q, bases = start.state.q, start.chart.bases
    matrix = np.concatenate((start.chart.select, start.chart.rows @ np.asarray(loops.equations.closures(q, bases)[1])))
    motions = np.linalg.solve(matrix, np.eye(len(q))[:, : len(start.chart.select)])
    change = np.asarray(slope(q, bases)) @ motions
    return not bool((np.abs(change) > MOVES * loops.coordinate_scale[start.chart.independent]).any())
