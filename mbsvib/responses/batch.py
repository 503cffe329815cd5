"""Frequency response of all variants at few frequencies: one linear solution for each of them, all at once.

In the basis of the undamped modes (Omega^2 - w^2 + i w Gamma) eta = Phi^T B. If w is above the frequency of a mode, its
eta is mainly -b / w^2, which nearly cancels in the sum over modes. There only the remainder, r = (Omega^2 + i w Gamma)
eta / w^2, is summed, and c b over these modes, with D for accelerations, is computed beforehand (see ``modal_sum``).
"""

from __future__ import annotations

from contextlib import suppress
from functools import cached_property

import numpy as np

from mbsvib.common.arrays import Array, Complex, Index
from mbsvib.equations.batch_equations import BatchEquations
from mbsvib.linalg.products import square_difference
from mbsvib.modes.batch import BatchModes, batch_modes
from mbsvib.modes.batch_damped import DampedBatch
from mbsvib.modes.result import RTOL, Modes
from mbsvib.responses.basis import RESPONSE_RTOL
from mbsvib.responses.general_terms import cleaned
from mbsvib.responses.modal_sum import partial_sums

# Up to this many frequencies times degrees of freedom, one solution per frequency costs less than setting up the sums
# over the modes of every variant.
FEW = 300
# Matrices of one piece of the batch stay in this much memory.
PIECE_BYTES = 2**22


class BatchBasis:
    """Modes of all variants of a batch, with those of single variants of the class ``form``; they are computed once."""

    def __init__(self, batch: BatchEquations, form: type[Modes] = Modes) -> None:
        self.batch = batch
        self.form = form

    @cached_property
    def modes(self) -> BatchModes:
        """All modes at the default accuracy."""
        return batch_modes(self.batch, RTOL, self.form)

    def modes_within(self, rtol: float) -> BatchModes:
        """Return all modes at a relative accuracy ``rtol``; cached ones if they are accurate enough."""
        good = float(self.modes.errors.max(initial=0.0)) <= rtol
        return self.modes if good else batch_modes(self.batch, rtol, self.form)

    @cached_property
    def modal(self) -> BatchModes:
        """The bases of the responses, as accurate as those of single systems."""
        known = self.__dict__.get("modes")
        if known is not None and float(known.errors.max(initial=0.0)) <= RESPONSE_RTOL:
            return self.modes
        return batch_modes(self.batch, RESPONSE_RTOL, self.form)


def few_frequencies(batch: BatchEquations, damped: DampedBatch, w: Array) -> Complex:
    """Return the complex responses (n, outputs, inputs, k) of all variants at few frequencies; not finite at poles.

    ``w`` (k,): angular frequencies [rad/s], none negative.
    """
    rates = [batch.Cq, batch.Cv, batch.Ca]
    order, output = np.nonzero([c.any(axis=(0, 2)) for c in rates])
    result: Complex = np.empty((len(batch), len(batch.outputs), len(batch.inputs), len(w)), dtype=complex)
    size = max(1, PIECE_BYTES // (16 * max(1, len(w) * batch.dof**2)))
    for start in range(0, len(batch), size):
        part = slice(start, start + size)
        phi, square, gamma = _ascending(damped.shapes[part], damped.square[part], damped.gamma[part])
        c = np.stack([rates[k][part, o] for k, o in zip(order, output, strict=True)], axis=1) @ phi if len(order) \
            else np.zeros((len(phi), 0, batch.dof))  # fmt: skip
        b = phi.swapaxes(1, 2) @ batch.B[part]
        motion, below = _motions(square, gamma, b, w)
        accelerates = order == 2
        direct = np.where(accelerates[:, None], batch.D[part][:, output], 0.0)
        known = np.take_along_axis(_sums(c, b, direct), below[:, None, None], 3)
        value = (c[:, None] @ motion).transpose(0, 2, 3, 1)  # (variants, rows, inputs, frequencies)
        inverse = np.divide(1.0, w * w, out=np.zeros_like(w), where=w > 0.0)
        feedthrough = batch.D[part].copy()
        feedthrough[:, output[accelerates]] = 0.0
        result[part] = feedthrough[..., None]
        for row, (k, o) in enumerate(zip(order.tolist(), output.tolist(), strict=True)):
            if k == 2:
                result[part, o] += known[:, row] - w * w * value[:, row]
            else:
                result[part, o] += (1j * w) ** k * (value[:, row] - known[:, row] * inverse)
    return result


def _ascending(phi: Array, square: Array, gamma: Array) -> tuple[Array, Array, Array]:
    """The basis sorted by magnitude of the frequencies; this differs from the order of squares if modes diverge."""
    order = np.argsort(np.abs(square), axis=1, kind="stable")
    if (order == np.arange(square.shape[1])).all():
        return phi, square, gamma
    gamma = np.take_along_axis(np.take_along_axis(gamma, order[:, None], 2), order[:, :, None], 1)
    return np.take_along_axis(phi, order[:, None], 2), np.take_along_axis(square, order, 1), gamma


def _motions(square: Array, gamma: Array, b: Array, w: Array) -> tuple[Complex, Index]:
    """Terms of each mode to be summed (variants, k, m, inputs), and how many modes are below each frequency."""
    at = np.arange(square.shape[1])
    root = np.sqrt(np.abs(square))[:, None]
    wide = w[:, None]
    brake = np.asarray((1j * w)[:, None, None] * gamma[:, None], dtype=complex)
    stiff = square_difference(square[:, None], wide)
    eta: Complex = np.full((len(b), len(w), *b.shape[1:]), np.nan, dtype=complex)
    if not gamma[:, ~np.eye(len(at), dtype=bool)].any():  # modes are uncoupled
        down = stiff + brake[..., at, at]
        np.divide(b[:, None], down[..., None], out=eta, where=down[..., None] != 0.0)
    else:
        matrix = brake.copy()
        matrix[..., at, at] += stiff
        with suppress(np.linalg.LinAlgError):  # a pole: the result is not a number
            eta[:] = np.linalg.solve(matrix, np.broadcast_to(b[:, None], eta.shape))
    low = root < wide
    inverse = np.divide(1.0, w * w, out=np.zeros_like(w), where=w > 0.0)[:, None, None]
    rest = (square[:, None, :, None] * eta + brake @ eta) * inverse
    return np.where(low[..., None], rest, eta), np.count_nonzero(low, axis=2)


def _sums(c: Array, b: Array, direct: Array) -> Array:
    """Sums of ``direct`` + c_j b_j over the first 0, 1 .. m modes, (variants, rows, inputs, m + 1)."""
    terms = c[:, :, None] * b.swapaxes(1, 2)[:, None]
    return partial_sums(terms, np.abs(terms), direct, cleaned(c, b, direct=direct))
