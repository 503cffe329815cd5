"""scipy.signal: StateSpace. It has no names; rows and columns have the order of the system's."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsvib.common.selection import Names
from mbsvib_export.neutral import Source, state_space_of

if TYPE_CHECKING:
    from scipy import signal


def to_scipy(
    system: Source, realization: str = "physical", *, outputs: Names = None, inputs: Names = None
) -> signal.StateSpace:
    """Return a system as a state space of scipy.signal.

    x' = A x + B u,  y = C x + D u, the matrices bit for bit those of ``system.state_space(realization)``, whose
    ``states``, ``inputs`` and ``outputs`` name their rows and columns. Take ``lsim`` and ``to_discrete`` for responses
    in time, and ``system.frequency_response`` for those in frequency: scipy's pass through polynomials.

    Parameters
    ----------
    system : System, ClosedLoop, Controller, StateSpace, control.StateSpace or SystemData
        The equations of motion, or a state space that is ready.
    realization : str
        The states of a System: "physical" (q and q'), "modal" or "balanced".
    outputs, inputs : str or sequence of str, optional
        Names or patterns of those to export; default: all.

    Returns
    -------
    scipy.signal.StateSpace
        Continuous in time; SI units and radians.

    Raises
    ------
    ExportError
        If no system is given, or a state space that is ready in another realization.
    ResponseError
        If the realization, or the name of an output or input, is unknown.
    """
    space = state_space_of(system, realization, "to_scipy", outputs, inputs)
    from scipy import signal

    return signal.StateSpace(space.A.copy(), space.B.copy(), space.C.copy(), space.D.copy())
