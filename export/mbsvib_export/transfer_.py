"""Transfer functions of one input and one output, from poles and zeros, with the errors of their polynomials."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.api.driven import DrivenSystem
from mbsvib.api.system import System
from mbsvib.common.arrays import Array, Complex
from mbsvib.common.expected import kind_of
from mbsvib.errors import ExportError
from mbsvib.feedback.closed_loop import ClosedLoop
from mbsvib.feedback.closing import transfer
from mbsvib.feedback.sampled import SampledLoop
from mbsvib.responses.finite_zeros import first_order_zeros
from mbsvib.responses.frequency_grid import zeros_of
from mbsvib.responses.state_space import StateSpace
from mbsvib_export.names_ import SignalNames
from mbsvib_export.neutral import linear_of, only_port, refusal
from mbsvib_export.packages import need

if TYPE_CHECKING:
    import control

# points s or z, the response there, poles, zeros, and the sample time
_Parts = tuple[Complex, Complex, Complex, Complex, float]


WORST = 1e-6  # relative error of a response by polynomials, above which they are refused
# Poles and zeros closer than this, relative to their size, are one motion that the input does not reach or the output
# does not see; the error that is stated counts what that leaves.
SAME = 1e-9


def to_transfer_function(
    system: System | ClosedLoop | SampledLoop | StateSpace, output: str | None = None, input: str | None = None
) -> tuple[control.TransferFunction, float]:
    """Return the transfer function of one input and output as polynomials, and its error.

    G(s) = gain prod(s - zero) / prod(s - pole),  of a sampled loop G(z) from a held input to samples

    Polynomials of many or far-apart poles lose digits: the frequency response of the result is compared with that of
    the system on its frequency grid, and an inaccurate one is refused. Prefer ``to_control`` wherever it is taken.

    Parameters
    ----------
    system : System, ClosedLoop, SampledLoop, StateSpace or control.StateSpace
        The equations of motion.
    output : str, optional
        Name of the output; may be left out where there is one.
    input : str, optional
        Name of the input; may be left out where there is one.

    Returns
    -------
    (control.TransferFunction, float)
        The transfer function, names as in ``to_control``, and the largest error of its frequency response over the
        resonances, antiresonances and all between, relative to the response [1]; at an undamped zero relative to the
        response of the neighbouring frequencies.

    Raises
    ------
    ExportError
        If the error is larger than 1e-6, python-control is not installed, or no System is given.
    ResponseError
        If a name is unknown.
    """
    control = need("control", "to_transfer_function")
    linear: Any = system if isinstance(system, DrivenSystem) else linear_of(system)
    if linear is None or kind_of(system) == "sparse system":
        raise refusal(system, "to_transfer_function", "a System (model.linearize()), whose poles and zeros are "
                      "computed from its factors")  # fmt: skip
    source, target = (only_port(linear, name, kind, "to_transfer_function")
                      for name, kind in ((input, "input"), (output, "output")))  # fmt: skip
    if isinstance(linear, DrivenSystem):
        linear = linear.with_ports(target, source).state_space()
    at, exact, poles, zeros, period = (_sampled if isinstance(linear, SampledLoop) else _continuous)(
        linear, source, target)  # fmt: skip
    poles, zeros = _without_common(poles, zeros)
    numerator, denominator = _polynomials(poles, zeros, at, exact)
    with np.errstate(all="ignore"):  # what overflows is refused below
        response = np.polyval(numerator, at) / np.polyval(denominator, at)
    error = _error(response, exact)
    if not error <= WORST:
        raise ExportError(
            f"to_transfer_function: '{source}' to '{target}' of '{linear.name}' has {len(poles)} poles, and as "
            f"polynomials its frequency response is off by {error:.1e}; expected at most {WORST:.0e}. Use "
            f"to_control, whose state space keeps the digits, or a model of fewer modes."
        )
    result = control.TransferFunction(
        numerator, denominator, period, inputs=[SignalNames.to_control(source)],
        outputs=[SignalNames.to_control(target)], name=SignalNames.system_to_control(linear.name, (source, target)),
    )  # fmt: skip
    return result, error


def _continuous(system: Any, source: str, target: str) -> _Parts:
    omega = _grid(system, source, target)
    exact = system.frequency_response(omega)[system.outputs.index(target), system.inputs.index(source)]
    return np.asarray(1j * omega), exact, system.poles(), zeros_of(system, target, source), 0.0


def _sampled(loop: Any, source: str, target: str) -> _Parts:
    """From held input to samples; poles and zeros at z = 0, of delays, among them."""
    part = loop.with_ports(target, source)
    space = part.sample_to_sample
    z = np.exp(1j * loop.period * _grid(loop, source, target))
    matrices = space.A, space.B, space.C, space.D
    exact, poles = transfer(matrices, z)[:, 0, 0], np.linalg.eigvals(space.A)
    return z, exact, poles, first_order_zeros(*matrices, part) if exact.any() else poles[:0], loop.period


def _grid(system: Any, source: str, target: str) -> Array:
    if not len(system.poles()):
        return np.array([1.0])
    return np.asarray(system.frequency_grid(outputs=target, inputs=source), dtype=float)


def _without_common(poles: Complex, zeros: Complex) -> tuple[Complex, Complex]:
    remaining, remaining_zeros = list(poles), []
    for zero in zeros:
        nearest_pole = int(np.argmin(np.abs(np.array(remaining) - zero))) if remaining else -1
        if nearest_pole >= 0 and abs(remaining[nearest_pole] - zero) <= SAME * abs(zero):
            remaining.pop(nearest_pole)
        else:
            remaining_zeros.append(zero)
    return np.array(remaining, dtype=complex), np.array(remaining_zeros, dtype=complex)


def _polynomials(poles: Complex, zeros: Complex, at: Complex, exact: Complex) -> tuple[Array, Array]:
    """Numerator and denominator; the gain is a median over the grid, which single antiresonances do not affect."""
    s = at[:, None]
    log = np.log(s - zeros).sum(axis=1) - np.log(s - poles).sum(axis=1)
    numerator, denominator = (np.atleast_1d(np.real(np.poly(roots))) for roots in (zeros, poles))
    if not exact.any():
        return np.zeros(1), denominator
    with np.errstate(over="ignore", invalid="ignore"):
        return float(np.median((exact * np.exp(-log)).real)) * numerator, denominator


def _error(response: Complex, exact: Complex) -> float:
    size = np.abs(exact)
    if not np.isfinite(response).all():
        return float("inf")
    if not size.any():
        return float(np.abs(response).max())
    around = np.maximum(size, 0.5 * (np.roll(size, 1) + np.roll(size, -1))) if len(size) > 2 else size
    return float(np.max(np.abs(response - exact) / np.where(around > 0.0, around, size.max())))
