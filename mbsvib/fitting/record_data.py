"""Time records in a fit: residuals of the Fourier coefficients of whole records, with free states at their ends.

Inputs that are held, or linear, between samples make the plant an exact recursion x_k+1 = F x_k + G_0 u_k + G_1 u_k+1
of matrix exponentials. Over a whole record its Fourier coefficients at z = e^(i w h) are, without approximation,

Y = (C (z - F)^-1 (G_0 + z G_1) + D) U + C (z - F)^-1 z eta,   eta = x_0 - x_N + G_1 (u_N - u_0)

Residuals at lines are independent whatever the colour of the noise, those of samples of white noise only; with all
lines and white noise both have the same sum of squares. eta is free and enters linearly: residuals are projected on
what it does not reach, and so are derivatives. For band-limited signals the same holds with s = i w and A, B instead of
z, F and G, but for what is folded from above half the sampling rate, a smooth function of w: polynomials, free as well.

Source: Pintelon & Schoukens, System Identification: A Frequency Domain Approach (2012), section 6.3 and appendix 6.B;
Golub & Pereyra, SIAM J. Numer. Anal. 10 (1973) 413, for the projection, with derivatives by Kaufman, BIT 15 (1975) 49.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from mbsvib.common.arrays import Array, Complex, Index
from mbsvib.errors import ResponseError
from mbsvib.fitting.response_data import EXACT, Block, ResponseData
from mbsvib.fitting.variables import Channels, values_of
from mbsvib.sensitivities.responses import exponential
from mbsvib.sensitivities.states import changed, states

# Degree of the polynomials for what is folded back in band-limited signals.
FOLDED = 5
# Columns of free states below this share of the largest are not told from the others.
DEPENDENT = 1e-10
# Numbers that matrices of some lines may hold.
CHUNK = 2_000_000
SENSING = ("Cq", "Cv", "Ca")


class Recursion(NamedTuple):
    """The matrices F (n, n), G (n, 2 inputs), C and D at the lines, or their derivatives (v, ...)."""

    F: Array
    G: Array
    C: Array
    D: Array


class Spectra(NamedTuple):
    """Per line: the state (k, n, experiments), that of unit eta (k, n, n) and C (z - F)^-1 (k, outputs, n)."""

    state: Complex
    free: Complex
    left: Complex


@dataclass(frozen=True, eq=False)
class RecordData:
    """Fourier coefficients ``measured`` (k, outputs, experiments) at ``omega`` [rad/s] of records with the ``step``
    [s], with inputs ``driven`` (k, inputs, experiments); ``weight`` (k, outputs, experiments), ``whitening`` (outputs,
    outputs), ``rows``, ``columns``, ``scene`` and ``channels`` as in ``ResponseData``.

    Outputs are ``sign`` times the derivatives of order ``powers`` of those of the model. ``estimate``: responses that
    were estimated from the records, for the search from afar. ``free_states``: how many numbers of the records these
    take.
    """

    name: str
    scene: int
    omega: Array
    step: float
    hold: str
    driven: Complex
    measured: Complex
    weight: Array
    whitening: Array | None
    rows: Index
    columns: Index
    sign: Index
    powers: Index
    channels: Channels
    known: bool
    estimate: ResponseData | None
    free_states: int = 0

    def blocks(self, equations: Any, slopes: Mapping[str, Array] | None, values: Array, far: bool) -> Iterator[Block]:
        """Yield residuals (k, outputs, experiments) with derivatives, projected on what free states do not reach.

        ``far``: those of logarithms of the estimated responses, where there are some.
        """
        if far and self.estimate is not None:
            yield from self.estimate.blocks(equations, slopes, values, far)
            return
        matrices, rates = self._recursion(equations, slopes)
        inputs = self._inputs(values)
        spectra = self._spectra(matrices, inputs)
        rows = self.channels.rows(values, self.omega) * self.sign
        model = rows[:, :, None] * (matrices.C @ spectra.state + matrices.D @ inputs[:, : len(self.columns)])
        free = self._free(matrices, spectra, rows, values)
        off, total, state, residual = self.measured - model, model.copy(), spectra.state.copy(), np.empty_like(model)
        ranges = []
        for e in range(model.shape[2]):
            u, back = _range(_real(self._whitened(free, e)))
            inside = u.T @ _real(self._whitened(off[:, :, e, None], e))[:, 0]
            eta = back @ inside
            passing = len(eta) - len(self.rows)  # drifts pass no channel
            total[:, :, e] += free[:, :, :passing] @ eta[:passing]
            state[:, :, e] += spectra.free @ eta[: len(matrices.F)]
            residual[:, :, e] = _complex(u @ inside, model) - self._whitened(off[:, :, e, None], e)[..., 0]
            ranges.append(u)
        if rates is None:
            yield Block(residual, None)
            return
        of_model = np.empty((len(rates.F), *self.measured.shape), dtype=complex)  # for what changes in the plant
        for change, fr, gr, cr, dr in zip(of_model, *rates, strict=True):
            change[:] = spectra.left @ (fr @ state + gr @ inputs) + cr @ state + dr @ inputs[:, : len(self.columns)]
        of_channels = self._of_channels(values, matrices, spectra, (rows, total), len(rates.F))
        every = np.concatenate((rows[:, :, None] * of_model, of_channels))
        for e, u in enumerate(ranges):
            columns = _real(self._whitened(np.moveaxis(every[..., e], 0, 2), e))
            columns -= u @ (u.T @ columns)
            every[..., e] = [_complex(column, model) for column in columns.T]
        yield Block(residual, every)

    @cached_property
    def _points(self) -> Complex:
        """z, or s for band-limited signals."""
        s = 1j * self.omega
        return np.asarray(s if self.hold == "band-limited" else np.exp(s * self.step))

    def _recursion(self, equations: Any, slopes: Mapping[str, Array] | None) -> tuple[Recursion, Recursion | None]:
        ports = self.columns.tolist(), self.rows.tolist()
        sensing = dict(zip(SENSING, self._derived([getattr(equations, key) for key in SENSING]), strict=True))
        linear = replace(equations, **sensing)
        base = states(equations.basis.with_equations(linear), *ports)
        n, first = len(base.A), base.first
        if slopes is None:
            da, db, dc, dd = (np.zeros((0, *shape)) for shape in (
                (n - first, n), (n - first, base.B.shape[1]), base.C.shape, base.D.shape))  # fmt: skip
        else:
            sensed = dict(zip(SENSING, self._derived([slopes[key] for key in SENSING]), strict=True))
            da, db, dc, dd = changed(base, SimpleNamespace(**{**slopes, **sensed}), *ports)  # type: ignore[arg-type]
        if self.hold == "band-limited":
            pad = ((0, 0), (first, 0), (0, 0))
            values, rates = np.concatenate((base.A, base.B), axis=1), np.pad(np.concatenate((da, db), axis=2), pad)
        else:
            values, rates = exponential(base, self.step, da, db)
            rates = rates.reshape(len(da), *values.shape)
        return (Recursion(values[:, :n], values[:, n:], base.C, base.D),
                None if slopes is None else Recursion(rates[..., :n], rates[..., n:], dc, dd))  # fmt: skip

    def _derived(self, sensing: list[Array]) -> list[Array]:
        """Cq, Cv and Ca (..., outputs, m) of the derivatives that were measured."""
        result = np.zeros_like(np.array(sensing))
        for row, power in zip(self.rows, self.powers, strict=True):
            for k in range(max(0, -power), min(3, 3 - power)):
                result[k + power, ..., row, :] = sensing[k][..., row, :]
        return list(result)

    def check(self, equations: Any) -> None:
        """Refuse outputs whose measured derivatives the model does not have."""
        for row, power in zip(self.rows.tolist(), self.powers.tolist(), strict=True):
            lost = any(getattr(equations, key)[row].any() for k, key in enumerate(SENSING) if not 0 <= k + power < 3)
            if lost or (power and equations.D[row].any()):
                raise ResponseError(f"fit: the output '{equations.outputs[row]}' of the model has another quantity "
                                    f"than the records {self.name}, which cannot be had from it; add an output of the "
                                    f"measured quantity to the model.")  # fmt: skip

    def _inputs(self, values: Array) -> Complex:
        """What acts behind G: u, and behind it the rise over a step, as the hold has it (k, 2 inputs, experiments)."""
        return self._held(self.driven * values_of(values, self.channels.input_gain, 1.0)[:, None])

    def _held(self, u: Complex) -> Complex:
        if self.hold == "band-limited":
            return u
        rise = (self._points - 1.0)[:, None, None] * u if self.hold == "first" else np.zeros_like(u)
        return np.concatenate((u, rise), axis=1)

    def _spectra(self, matrices: Recursion, inputs: Complex) -> Spectra:
        n, outputs = len(matrices.F), len(matrices.C)
        turn = np.ones_like(self._points) if self.hold == "band-limited" else self._points
        drive, parts = matrices.G @ inputs, []
        step = max(1, CHUNK // (n * (2 * n + outputs + 1)))
        for first in range(0, len(self.omega), step):
            which = slice(first, first + step)
            inverse = np.linalg.inv(self._points[which, None, None] * np.eye(n) - matrices.F)
            parts.append((inverse @ drive[which], inverse * turn[which, None, None], matrices.C @ inverse))
        return Spectra(*(np.concatenate(part) for part in zip(*parts, strict=True)))

    def _free(self, matrices: Recursion, spectra: Spectra, rows: Complex, values: Array) -> Complex:
        """Outputs (k, outputs, columns) of free states: of the plant, of channels, and what is folded back.

        The last column of each output is a drift, linear in time: 1 / (1 / z - 1) up to a factor.
        """
        columns = [rows[:, :, None] * (matrices.C @ spectra.free)]
        x, tails = 1j * self.omega / self.omega.max(), self.channels.tails(values, self.omega)
        for o, order in enumerate(self.channels.orders):
            count = max(order, FOLDED + 1 if self.hold == "band-limited" else 0)
            own = np.zeros((*rows.shape, count), dtype=complex)
            own[:, o] = tails[:, o, None] * x[:, None] ** np.arange(count)
            columns.append(own)
        drift = 1.0 / np.expm1(-1j * self.omega * self.step)
        return np.concatenate((*columns, drift[:, None, None] * np.eye(len(self.rows))), axis=2)

    def _of_channels(
        self, values: Array, matrices: Recursion, spectra: Spectra, output: tuple[Complex, Complex], first: int
    ) -> Complex:
        """dY (channels, k, outputs, experiments); ``output``: F (k, outputs), and Y with all free states."""
        rows, total = output
        result = np.zeros((len(values) - first, *total.shape), dtype=complex)
        for number, o, rate in self.channels.rates(values, self.omega):
            result[number - first, :, o] = rate[:, None] * total[:, o]
        for o, number in enumerate(self.channels.gain.tolist()):
            if number >= 0:
                result[number - first, :, o] = total[:, o] / (values[number] or 1.0)
        for i, number in enumerate(self.channels.input_gain.tolist()):
            if number >= 0:
                act = self._held(np.where(np.arange(len(self.columns))[:, None] == i, self.driven, 0.0))
                part = spectra.left @ (matrices.G @ act) + matrices.D @ act[:, : len(self.columns)]
                result[number - first] = rows[:, :, None] * part
        return result

    def _whitened(self, columns: Complex, experiment: int) -> Complex:
        """Weighted outputs (k, outputs, columns), without the correlation of their noise."""
        weighted = self.weight[:, :, experiment, None] * columns
        return weighted if self.whitening is None else np.asarray(self.whitening @ weighted)

    @property
    def rounding(self) -> float:
        """The size of residuals that are rounding of what was measured."""
        return EXACT * float(np.linalg.norm(self.weight * self.measured))

    @property
    def numbers(self) -> int:
        """How many real numbers were measured, but for those that free states take."""
        return 2 * self.measured.size - self.free_states

    def fitted(self, residual: Complex) -> Complex:
        """Return what residuals (k, outputs, experiments) say of the measured coefficients, with free states."""
        off = residual if self.whitening is None else np.linalg.solve(self.whitening, residual)
        return np.asarray(self.measured + off / self.weight)

    def reweighted(self, residual: Complex, share: float) -> RecordData:
        """Return the same with the noise of each output as large as its residuals tell.

        ``share``: numbers over numbers less fitted values.
        """
        power = (np.abs(residual) ** 2).mean(axis=(0, 2)) * share / 2.0 * (2 * self.measured.size / self.numbers)
        scale = np.where(power > 0.0, 1.0 / np.sqrt(np.where(power > 0.0, power, 1.0)), 1.0)
        return replace(self, weight=self.weight * scale[:, None])

    def started(self, equations: Any, values: Array) -> Array:
        """Return values with starts of delays and gains, from the estimated responses."""
        return values if self.estimate is None else self.estimate.started(equations, values)

    def with_free_states(self, equations: Any, values: Array) -> RecordData:
        """Return the same with the count of free states."""
        self.check(equations)
        matrices = self._recursion(equations, None)[0]
        spectra = self._spectra(matrices, self._inputs(values))
        free = self._free(matrices, spectra, self.channels.rows(values, self.omega) * self.sign, values)
        count = sum(_range(_real(self._whitened(free, e)))[0].shape[1] for e in range(self.measured.shape[2]))
        if 2 * self.measured.size <= count:
            lines = len(self.omega)
            raise ResponseError(f"fit: the records {self.name} have {2 * self.measured.size} numbers at {lines} lines "
                                f"each {(self.omega[-1] - self.omega[0]) / max(1, lines - 1) / 2 / np.pi:.4g} Hz, and "
                                f"their unknown beginning takes {count}; record longer, or widen the band.")
        return replace(self, free_states=count)


def _real(columns: Complex) -> Array:
    """Columns (2 k outputs, columns) of real and imaginary parts, of (k, outputs, columns)."""
    flat = columns.reshape(-1, columns.shape[-1])
    return np.concatenate((flat.real, flat.imag))


def _complex(column: Array, like: Complex) -> Complex:
    """(k, outputs) of a column."""
    real, imaginary = np.split(column, 2)
    return np.asarray((real + 1j * imaginary).reshape(like.shape[:2]))


def _range(columns: Array) -> tuple[Array, Array]:
    """Orthonormal columns of what some columns span, and what takes these to factors of the columns."""
    size = np.linalg.norm(columns, axis=0)
    size[size == 0.0] = 1.0
    u, values, vh = np.linalg.svd(columns / size, full_matrices=False)
    kept = values > DEPENDENT * values.max(initial=0.0)
    return u[:, kept], vh[kept].T / values[kept] / size[:, None]
