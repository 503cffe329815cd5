"""Where bodies and nodes are in the samples of a run."""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.simulation.trace import Trace


def frames(run: Trace) -> dict[str, tuple[Array, Array]]:
    """Return rotations (samples, 3, 3) and shifts (samples, 3) [m] of all bodies and nodes since the pose as described.

    The keys are the names of bodies, ground and nodes of beams and superelements among them.
    """
    statement = run.session.statement
    motion = statement.motion
    frames = statement.frames
    function = ca.Function("frames", [motion.q, motion.bases], [
        ca.vertcat(*(ca.vec(frame.rotation) for frame in frames.values())),
        ca.vertcat(*(frame.shift for frame in frames.values()))])  # fmt: skip
    q = np.array([sample.state.q for sample in run.samples]).T
    bases = np.array([sample.chart.bases for sample in run.samples]).T
    rotations, shifts = (np.asarray(array) for array in function(q, bases))
    samples = len(run.samples)
    return {
        name: (rotations[9 * i : 9 * i + 9].reshape(3, 3, samples, order="F").transpose(2, 0, 1),
               shifts[3 * i : 3 * i + 3].T)
        for i, name in enumerate(frames)
    }  # fmt: skip
