"""Frequency responses as data sets of xarray."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.api.sparse_system import SparseSystem
from mbsvib.api.system import System
from mbsvib.common.labelled import of_responses
from mbsvib.common.selection import Names
from mbsvib.feedback.controller import Controller
from mbsvib.responses.state_space import StateSpace
from mbsvib_export.neutral import linear_of, refusal

if TYPE_CHECKING:
    from mbsvib.feedback.closed_loop import ClosedLoop


def to_xarray(
    system: System | SparseSystem | ClosedLoop | StateSpace | Controller, omega: ArrayLike, *, outputs: Names = None,
    inputs: Names = None,
) -> Any:
    """Return the frequency response of a system as a data set of xarray.

    G(i w) as ``system.frequency_response`` computes it. Measurements and sweeps have a ``to_xarray`` of their own.

    Parameters
    ----------
    system : System, SparseSystem, ClosedLoop, StateSpace, Controller or control.StateSpace
        The linear equations.
    omega : array-like, shape (n,)
        Angular frequencies [rad/s].
    outputs, inputs : str or sequence of str, optional
        Names or patterns of those that are exported; default: all.

    Returns
    -------
    xarray.Dataset
        "response" (output, input, frequency), complex; coordinates "frequency" [Hz], "output", "input", and
        "output_unit", "input_unit" of each.

    Raises
    ------
    ExportError
        If xarray is not installed, or no System is given.
    ResponseError
        If a frequency is not finite or is an undamped pole of the system.
    """
    linear = linear_of(system)
    if linear is None:
        raise refusal(system, "to_xarray", "a System (model.linearize()), a closed loop or a state space, which have a "
                      "frequency response")  # fmt: skip
    linear = linear.with_ports(outputs, inputs)
    response = linear.frequency_response(omega)
    return of_responses("to_xarray", np.asarray(omega, dtype=float).reshape(-1) / (2.0 * np.pi),
                        (linear.outputs, linear.inputs), (linear.output_units, linear.input_units),
                        {"response": (("output", "input", "frequency"), response, None)}, linear.name)  # fmt: skip
