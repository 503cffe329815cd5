"""Responses of closed loops by two forms, of which the one with less rounding counts; responses for norms.

The response of the plant with open loops is accurate in each entry, but its terms cancel in the response of the closed
loop where they are much larger than this: next to a pole of the plant or of a controller. The closed-loop equations
have no such terms, but their states are only accurate against the largest.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbsvib.common.arrays import Array, Complex, Index
from mbsvib.errors import ResponseError
from mbsvib.linalg.rank import EPS
from mbsvib.linalg.spectrum import Spectrum
from mbsvib.modes.damped import Damped
from mbsvib.responses.frequency_response import trusted

Closed = Callable[[Index, Index, Index], tuple[Complex, Array]]


# The closed-loop equations are solved where rounding of the other form may reach this share of a response, and the
# second number times it of the usual size of its row and column: entries far below that are zero but for rounding, as
# by symmetry.
LOST, SMALL = 1e-11, 1e-4
ROUNDS = 3  # of equilibration: sizes to within the eighth root of what units change


def evaluated(response: Callable[[Array], Complex], w: Array, shape: tuple[int, int]) -> Complex:
    """Return responses (n, *shape) at frequencies ``w`` (n,), NaN at poles, where ``response`` raises an error."""
    try:
        return response(w)
    except (ResponseError, np.linalg.LinAlgError):
        if len(w) <= 1:
            return np.full((len(w), *shape), complex(np.nan, np.nan))
    halves = np.array_split(w, 2)
    return np.concatenate([evaluated(response, half, shape) for half in halves])


def inverse(matrices: Complex) -> Complex:
    """Return the inverses of matrices (n, k, k), not a number of those that are singular."""
    try:
        return np.asarray(np.linalg.inv(matrices))
    except np.linalg.LinAlgError:
        if len(matrices) == 1:
            return np.full_like(matrices, complex(np.nan, np.nan))
    return np.concatenate([inverse(half) for half in np.array_split(matrices, 2)])


def at_poles(s: Complex, of_a: Spectrum) -> NDArray[np.bool_]:
    """Return which points (n,) rounding cannot tell from eigenvalues of a matrix."""
    return np.asarray((np.abs(s[:, None] - of_a.values) <= of_a.errors).any(axis=1))


def refuse_poles(pole: NDArray[np.bool_], w: Array, name: str) -> None:
    """Refuse a response at poles of a loop: some of the angular frequencies ``w`` (n,) [rad/s]."""
    if pole.any():
        raise ResponseError(f"frequency_response: {w[int(pole.argmax())]:g} rad/s equals a pole of "
                            f"'{name}' within rounding; leave this frequency out.")  # fmt: skip


def blended(value: Complex, error: Array, closed: Closed) -> Complex:
    """Return responses (n, rows, columns), those that lost digits from the closed-loop equations if these are better.

    ``error`` (n, rows, columns): bounds of rounding of ``value``; both may be NaN or infinite. ``closed``: the
    closed-loop equations.
    """
    size = np.abs(value)
    at = np.flatnonzero(~(error <= LOST * size).all(axis=(1, 2)))
    if not len(at):
        return value
    size = size[at]
    lost = ~(error[at] <= LOST * np.maximum(size, SMALL * usual(size)))
    points, rows, columns = (np.flatnonzero(lost.any(axis=axes)) for axes in ((1, 2), (0, 2), (0, 1)))
    if len(points):
        block = np.ix_(at[points], rows, columns)
        solved, terms = (part.transpose(2, 0, 1) for part in closed(rows, columns, at[points]))
        value[block] = np.where(error[block] <= EPS * terms, value[block], solved)
    return value


def usual(size: Array, rounds: int = ROUNDS) -> Array:
    """Return products of sizes of the row and of the column, (n, rows, columns), that equilibrate rows and columns.

    Each of the ``rounds`` takes the square root of what is left of the ratios of units.

    Source: D. Ruiz, A scaling algorithm to equilibrate both rows and columns norms in matrices, RAL-TR-2001-034.
    """
    size = np.where(np.isfinite(size), size, 0.0)
    row, column = np.ones((*size.shape[:2], 1)), np.ones((len(size), 1, size.shape[2]))
    for _ in range(rounds):
        high, wide = (np.sqrt(size.max(axis=axis, keepdims=True, initial=0.0)) for axis in (2, 1))
        high, wide = np.where(high > 0.0, high, 1.0), np.where(wide > 0.0, wide, 1.0)
        size = size / high / wide
        row, column = row * high, column * wide
    return np.asarray(row * column)


DENSE = 60  # degrees of freedom up to which the dense equations are solved at every frequency


def response(system: Any, w: Array, outputs: Sequence[str], inputs: Sequence[str]) -> Complex:
    """Return G(i w) (outputs, inputs, n) for norms: accurate in its norm, not in entries that are zero by symmetry."""
    o, i = [system.outputs.index(name) for name in outputs], [system.inputs.index(name) for name in inputs]
    entries = np.ix_(o, i)
    modal = system.basis.modal
    if (
        isinstance(modal, Damped)
        and system.basis.strong_dampers is None
        and (modal.vectors is None or trusted(modal, modal.shapes.T @ system.B, w))
    ):
        result = system.basis.modal_sum.at(np.asarray(1j * w, dtype=complex))[entries]
        if np.isfinite(result).all():
            return np.asarray(result)
    if system.dof > DENSE:
        return np.asarray(system.frequency_response(w)[entries])
    return solved(system, w, o, i)[0]


def solved(system: Any, w: Array, o: list[int], i: list[int]) -> tuple[Complex, Complex, Complex]:
    """Return G = H R + D (outputs, inputs, n), R = Z^-1 B (n, m, inputs) and L = H Z^-1 (n, outputs, m).

    Z = K + i w C - w^2 M,  H = Cq + i w Cv - w^2 Ca

    ``system``: equations of few degrees of freedom. ``w`` (n,): angular frequencies [rad/s].
    """
    s = np.asarray(1j * w[:, None, None], dtype=complex)
    z = system.K + s * system.C + s * s * system.M
    h = system.Cq[o] + s * system.Cv[o] + s * s * system.Ca[o]
    try:
        right = np.linalg.solve(z, np.broadcast_to(system.B[:, i], (len(w), system.dof, len(i))))
    except np.linalg.LinAlgError:  # at a pole: raises an error with the mode
        system.frequency_response(w)
        raise
    left = np.linalg.solve(z.transpose(0, 2, 1), h.transpose(0, 2, 1)).transpose(0, 2, 1)
    value = h @ right + system.D[np.ix_(o, i)]
    return np.asarray(value.transpose(1, 2, 0)), right, left
