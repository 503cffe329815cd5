"""Measured frequency responses in a fit: residuals, derivatives, and the channels through which they were measured.

A pair of output o and input i has the response H = F_o g_i G of the model's G, see ``variables``.
Residuals r = sqrt(2) (H - Y) / sigma have real and imaginary parts of variance 1 where sigma^2 = E|noise|^2; from afar
log(H / Y) leads where peaks do not meet.

Source: Pintelon & Schoukens, System Identification: A Frequency Domain Approach (2012), section 9.

Frequency responses of matrices and their derivatives to some variables, for all lines at once.

With Z = K + s C + s^2 M, R = Z^-1 B and L = Z^-T H^T, H = Cq + s Cv + s^2 Ca, the response is G = H R + D, and
dG = dD + L^T dB + dH R - L^T dZ R. What a variable changes of Z has a small rank r, dZ = U A(s) V^T, found once for
all lines: then L^T dZ R costs r (outputs + inputs) products a line. One solution for the columns [B, H^T] is all that
a line needs, whatever the number of variables.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple
from warnings import catch_warnings, simplefilter, warn

import numpy as np

from mbsvib.common.arrays import Array, Bools, Complex, Index
from mbsvib.errors import AccuracyWarning, ResponseError
from mbsvib.fitting.variables import HELD, Channels, values_of
from mbsvib.linalg.rank import CANCELLING_SPRINGS, ZERO_SLOPE
from mbsvib.measurement.noise_levels import likeliest, shapes, shrunk

# Numbers that the derivatives of some lines may hold.
BLOCK = 400_000


class Factors(NamedTuple):
    """dK, dC, dM = U A V^T: ``left`` (m, r), ``right`` (m, r) and the three A (3, r, r)."""

    left: Array
    right: Array
    middle: Array


def blocks(
    matrices: Any, slopes: Mapping[str, Array] | None, omega: Array, rows: Index, columns: Index
) -> Iterator[tuple[slice, Complex, Complex | None]]:
    """Yield some lines at a time with G (n, outputs, inputs) and dG (v, n, outputs, inputs), None without slopes.

    ``matrices``: M, C, K, B, Cq, Cv, Ca, D; ``slopes``: their derivatives (v, ...) by name; ``rows``, ``columns``: the
    outputs and inputs.
    """
    m, count = len(matrices.K), 0 if slopes is None else len(slopes["K"])
    size = np.abs(matrices.K).diagonal() + np.median(omega) ** 2 * np.abs(matrices.M).diagonal()
    size = np.where(size > 0.0, size, size.max(initial=0.0) or 1.0)
    scale = np.exp2(np.round(-0.5 * np.log2(size)))  # gives all coordinates one size in the middle of the lines
    middle = float(np.exp(np.log(np.maximum(omega, omega.max() * 1e-6)).mean()))
    pencil = [matrix * scale[:, None] * scale for matrix in (matrices.K, matrices.C, matrices.M)]
    b = scale[:, None] * matrices.B[:, columns]
    h = [matrix[rows] * scale for matrix in (matrices.Cq, matrices.Cv, matrices.Ca)]
    d = matrices.D[np.ix_(rows, columns)]
    symmetric = all((matrix == matrix.T).all() for matrix in pencil)
    changes: list[tuple[Any, ...]] | None = None
    if slopes is not None:  # factors of dZ, dB, dH (3, outputs, m) and dD of each variable, None where they do not move
        pencils = np.array([slopes[key] for key in ("K", "C", "M")]).swapaxes(0, 1) * scale[:, None] * scale
        sensed = np.array([slopes[key][:, rows] for key in ("Cq", "Cv", "Ca")]).swapaxes(0, 1) * scale
        direct = slopes["D"][:, rows][:, :, columns]
        others = zip(slopes["B"][:, :, columns] * scale[:, None], sensed, direct, strict=True)
        changes = [(_factors(own, middle), *(x if x.any() else None for x in ends))
                   for own, ends in zip(pencils, others, strict=True)]  # fmt: skip
    step = max(1, BLOCK // max(1, (count + 2) * len(rows) * len(columns) + m * (m + len(rows) + len(columns))))
    for start in range(0, len(omega), step):
        which = slice(start, start + step)
        s: Complex = (1j * omega[which, None, None]).astype(complex)
        z, sensing = (x[0] + s * x[1] + s * s * x[2] for x in (pencil, h))
        try:
            size = np.sqrt(np.abs(pencil[0].diagonal()))
            size = np.where(size > 0.0, size, 1.0)
            if s[0] == 0.0 and CANCELLING_SPRINGS * np.linalg.cond(pencil[0] / size[:, None] / size) > 1.0:
                raise np.linalg.LinAlgError  # a motion without stiffness, but for rounding
            into, out = np.broadcast_to(b, (len(z), *b.shape)), sensing.swapaxes(1, 2)
            if changes is not None and symmetric:
                right, left = np.split(np.linalg.solve(z, np.concatenate((into, out), axis=2)), [b.shape[1]], axis=2)
            else:
                right = np.linalg.solve(z, into)
                left = out if changes is None else np.linalg.solve(z.swapaxes(1, 2), out)
        except np.linalg.LinAlgError:
            raise ResponseError("fit: a measured line is at an undamped pole of the model, where its response is "
                                "infinite (0 Hz if it moves freely); leave the line out, data.within(low, high), or "
                                "give the model damping.") from None  # fmt: skip
        response = sensing @ right + d
        yield which, response, None if changes is None else _slopes(changes, left.swapaxes(1, 2), right, s)


def responses(matrices: Any, omega: Array, rows: Index, columns: Index) -> Complex:
    """Return G (n, outputs, inputs) at all lines, see ``blocks``."""
    return np.concatenate([response for _, response, _ in blocks(matrices, None, omega, rows, columns)])


def _factors(pencil: Array, middle: float) -> Factors | None:
    """dK, dC and dM (3, m, m) as products of low rank."""
    if not pencil.any():
        return None
    weighted = pencil * np.array([1.0, middle, middle**2])[:, None, None]
    moves = np.flatnonzero(weighted.any(axis=(0, 1)) | weighted.any(axis=(0, 2)))
    part = weighted[:, moves[:, None], moves]
    symmetric = bool((part == part.swapaxes(1, 2)).all())
    left = _range(np.concatenate(part, axis=1))
    right = left if symmetric else _range(np.concatenate(part.swapaxes(1, 2), axis=1))
    core = left.T @ pencil[:, moves[:, None], moves] @ right
    full = np.zeros((2, pencil.shape[1], max(left.shape[1], right.shape[1])))
    full[0, moves, : left.shape[1]], full[1, moves, : right.shape[1]] = left, right
    return Factors(full[0, :, : left.shape[1]], full[1, :, : right.shape[1]], core)


def _range(matrix: Array) -> Array:
    """Orthonormal columns of what the columns of a matrix span, without rounding."""
    u, size, _ = np.linalg.svd(matrix, full_matrices=False)
    return np.asarray(u[:, size > ZERO_SLOPE * size[0]])


def _slopes(changes: list[Any], left: Complex, right: Complex, s: Complex) -> Complex:
    """dG (v, n, outputs, inputs)."""
    result = np.zeros((len(changes), len(left), left.shape[1], right.shape[2]), dtype=complex)
    for total, (factors, b, h, d) in zip(result, changes, strict=True):
        if factors is not None:
            middle = factors.middle[0] + s * factors.middle[1] + s * s * factors.middle[2]
            total -= ((left @ factors.left) @ middle) @ (factors.right.T @ right)
        if b is not None:
            total += left @ b
        if h is not None:
            total += (h[0] + s * h[1] + s * s * h[2]) @ right
        if d is not None:
            total += d
    return result


# Deviation of logarithms of responses from afar, beyond which they count by their size only.
LOG_DEVIATION = 0.2
# Mean sine of the phase of a model over some lines from which its sign is that of a measurement, too.
TURNED = 0.05
# Delays are looked for up to so many periods of the highest line, in steps of this share of one.
PERIODS, STEP = 5, 0.05

# Noise that is not known: the lines of a pair that count as much as those of all inputs together.
ALIKE = 4.0
# Residuals below this share of what was measured are rounding of exact data.
EXACT = 1e-10


class Block(NamedTuple):
    """Residuals (n, ...) of some lines, real and imaginary parts of variance 1, and derivatives (v, n, ...)."""

    residual: Complex
    slopes: Complex | None


@dataclass(frozen=True, eq=False)
class ResponseData:
    """Responses ``measured`` (n, outputs, inputs) at ``omega``, 0 where ``weight`` (n, outputs, inputs) is: sqrt(2)
    over the standard deviation of the noise, up to one factor for each pair where it is not ``known``.

    ``correlation`` of errors with those of the next line, the one after it, and so on: ``lines_alike`` count as one.

    ``whitening`` takes the correlation out of weighted outputs (n, outputs, outputs), or out of all weighted pairs (n,
    pairs, pairs). ``rows`` and ``columns`` are ports of the model; ``sign`` (outputs, inputs) has directions against
    its own. ``scene`` is the number of the condition in which it was measured. ``dependent`` is how many numbers others
    tell already.
    """

    name: str
    scene: int
    omega: Array
    measured: Complex
    weight: Array
    whitening: Complex | None
    rows: Index
    columns: Index
    sign: Complex
    channels: Channels
    known: bool
    dependent: int = 0
    correlation: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def solved_at(self) -> Array:
        """Where responses of the model are computed: at the last line in place of lines that do not count."""
        counts = (self.weight > 0.0).any(axis=(1, 2))
        return np.where(counts, self.omega, self.omega[counts].max() if counts.any() else self.omega)

    def blocks(self, equations: Any, slopes: Mapping[str, Array] | None, values: Array, far: bool) -> Iterator[Block]:
        """Yield residuals with derivatives of some lines at a time; ``far``: those of logarithms, of some lines."""
        if far and (step := max(1, min(8, len(self.omega) // 25))) > 1:
            yield from self.every(step).blocks(equations, slopes, values, far)
            return
        for which, response, change in blocks(equations, slopes, self.solved_at, self.rows, self.columns):
            factor = self.channels.factor(values, self.omega[which]) * self.sign[which]
            total = factor * response
            residual, weight = self._weighted(which, total, far)
            every = None
            if change is not None:
                change *= weight * factor
                every = change
                if len(change) < len(values):
                    more = self.channels.slopes(values, self.omega[which], self.sign[which] * response, len(change))
                    every = np.concatenate((change, weight * more))
                every = every if far else self._whitened(which, every)
            yield Block(residual, every)

    def _weighted(self, which: slice, total: Complex, far: bool) -> tuple[Complex, Complex | Array]:
        """Residuals of responses H, and what dH is multiplied with to be theirs before outputs are whitened."""
        measured, weight = self.measured[which], self.weight[which]
        counts = weight > 0.0
        if not far:
            return self._whitened(which, weight * (total - measured) * counts), weight
        with np.errstate(divide="ignore", invalid="ignore"):
            counts &= (total != 0.0) & (measured != 0.0)
            spread = np.where(counts, np.sqrt(2.0) / (weight * np.abs(measured)), 1.0) if self.known else 0.0
            size = np.where(counts, 1.0 / np.hypot(LOG_DEVIATION, spread), 0.0)
            return np.where(counts, size * np.log(total / measured), 0.0), np.where(counts, size / total, 0.0)

    def _whitened(self, which: slice, weighted: Complex) -> Complex:
        """Weighted responses (..., n, outputs, inputs) without the correlation of their noise."""
        if self.whitening is None:
            return weighted
        factor = self.whitening[which]
        columns = weighted.reshape(*weighted.shape[:-2], factor.shape[-1], -1)
        return np.asarray((factor @ columns).reshape(weighted.shape))

    def every(self, step: int) -> ResponseData:
        """Return the same with one line of ``step``."""
        whitening = None if self.whitening is None else self.whitening[::step]
        return replace(self, omega=self.omega[::step], measured=self.measured[::step], weight=self.weight[::step],
                       whitening=whitening, sign=self.sign[::step])  # fmt: skip

    @property
    def rounding(self) -> float:
        """The size of residuals that are rounding of what was measured."""
        return EXACT * float(np.linalg.norm(self.weight * self.measured))

    @property
    def numbers(self) -> float:
        """How many independent real numbers were measured."""
        return 2 * (int((self.weight > 0.0).sum()) - self.dependent) / lines_alike(self.correlation)

    def reweighted(self, residual: Complex, share: float) -> ResponseData:
        """Return the same with the noise of each pair that its residuals (n, outputs, inputs) tell: a constant s, or
        sigma^2 = s (c + |H|^2) where that is likelier for its output by more than chance.

        ``share``: numbers over numbers less fitted values.
        """
        counts, weight = self.weight > 0.0, self.weight.copy()
        off = residual / np.where(counts, weight, 1.0)
        size = np.where(counts, np.abs(self.measured + off) ** 2, np.nan)
        middle = _median(size)
        power, size = np.abs(off) ** 2 / middle, size / middle
        for o in range(weight.shape[1]):
            p, h, known = power[:, o], size[:, o], counts[:, o]
            if not p[known].any():
                continue
            tried = shapes(h)
            scales = [_scales(p / v, known) for v in tried]
            k = likeliest([-(np.log(s * v) + p / (s * v))[known].sum() for s, v in zip(scales, tried, strict=True)])
            variance = share * middle[o] * scales[k] * tried[k] * lines_alike(self.correlation)
            weight[:, o] = np.where(known, np.sqrt(2.0 / np.where(known, variance, 1.0)), 0.0)
        return replace(self, weight=weight)

    def fitted(self, equations: Any, values: Array) -> Complex:
        """Return what the model says (n, outputs, inputs), NaN where nothing was measured."""
        model = responses(equations, self.solved_at, self.rows, self.columns)
        return np.where(self.weight > 0.0, self.channels.factor(values, self.omega) * self.sign * model, np.nan)

    def started(self, equations: Any, values: Array) -> Array:
        """Return values with starts of delays and gains, from the phases and sizes of all responses."""
        values, channels = values.copy(), self.channels
        model = responses(equations, self.solved_at, self.rows, self.columns) * self.sign
        counts = (self.weight > 0.0) & (model != 0.0) & (self.measured != 0.0)
        ratio = np.where(counts, self.measured, 1.0) / np.where(counts, model, 1.0)
        turn = np.where(counts, ratio / np.abs(ratio), 0.0)
        for o in np.flatnonzero(channels.delay >= 0).tolist():
            delays = np.arange(-1.0, PERIODS, STEP) * (2.0 * np.pi / self.omega.max())
            fits = np.abs((np.exp(1j * np.outer(delays, self.omega)) @ turn[:, o]).real).sum(axis=1)
            values[channels.delay[o]] = delays[int(fits.argmax())]
        turn = turn * np.exp(1j * self.omega[:, None] * values_of(values, channels.delay, 0.0))[:, :, None]
        size = np.where(counts, np.log(np.abs(ratio)), 0.0)
        for o in np.flatnonzero(channels.gain >= 0).tolist():
            first = counts[:, o, 0].any()
            where = np.s_[:, o, 0] if first else np.s_[:, o]
            values[channels.gain[o]] = _gain(size[where], turn[where], counts[where])
        if (channels.gain >= 0).any():
            gain = values_of(values, channels.gain, 1.0)
            size = size - np.log(np.abs(gain))[:, None] * counts
            turn = turn * np.sign(gain)[:, None]
        for i in np.flatnonzero(channels.input_gain >= 0).tolist():
            values[channels.input_gain[i]] = _gain(size[:, :, i], turn[:, :, i], counts[:, :, i])
        return values

    def check_phases(self, equations: Any) -> None:
        """Warn if phases turn against those of the model, over steps of 1, 2, 4, ... lines."""
        model = responses(equations, self.solved_at, self.rows, self.columns) * self.sign * (self.weight > 0.0)
        steps = [2**k for k in range((len(model) - 1).bit_length())]
        expected, turn = np.array([(_turn(model, step), _turn(self.measured, step)) for step in steps] or [(0, 0)]).T
        delayed = (self.channels.delay != HELD).any()
        if not delayed and np.abs(expected).max() > TURNED and expected @ turn < -0.5 * (expected @ expected):
            warn(f"fit: the phases of {self.name} turn against those of the model over the frequency. If its responses "
                 f"are those of exp(-i w t), give their complex conjugates, np.conj(responses).", AccuracyWarning,
                 stacklevel=5)  # fmt: skip
        seen = self.measured[self.weight > 0.0]
        if not seen.imag.any() and seen.any() and np.abs(model.imag).max() > TURNED * np.abs(model).max():
            warn(f"fit: the responses of {self.name} have no imaginary part, unlike those of the model. Magnitudes and "
                 f"decibels have no phase: give complex responses.", AccuracyWarning, stacklevel=5)


def _turn(responses: Complex, step: int) -> float:
    """Mean over pairs of the sine of the phase over some lines, weighted with the size of responses."""
    product = responses[step:] * responses[:-step].conj()
    size = np.abs(product).sum(axis=0)
    return float((product.imag.sum(axis=0) / np.where(size > 0.0, size, 1.0)).mean())


def _gain(size: Array, turn: Complex, counts: Bools) -> float:
    """The gain of some ratios of measured to modelled responses: their mean size and prevailing sign."""
    mean = float(np.exp(size.sum() / max(1, counts.sum())))
    return mean if turn.real.sum() >= 0.0 else -mean


def weights(
    responses: Complex, variance: Array | None, averages: float | None, alike: float = 1.0
) -> tuple[Array, bool]:  # fmt: skip
    """Return the weights of responses (n, outputs, inputs), 0 where they are not measured, and whether they are known.

    A variance of some averages is noise itself: it counts beside those of neighbouring lines. Without a variance each
    pair has the noise of its median response, up to a factor that the residuals tell. As many lines as are ``alike``
    count as one.
    """
    counts = np.isfinite(responses)
    if variance is None:
        size = _median(np.where(counts, np.abs(responses), np.nan))
        return np.where(counts, np.sqrt(2.0 / alike) / size, 0.0), False
    least = np.where(counts & (variance > 0.0), variance, np.inf).min(axis=0)
    variance = np.where(variance > 0.0, variance, least)  # a coherence of 1 is not known to so many digits
    counts &= np.isfinite(variance)
    if averages is not None and averages > 1.0:
        drawn, measured = (np.moveaxis(np.where(counts, one, np.nan), 0, 2) for one in (variance, responses))
        variance = np.moveaxis(shrunk(drawn, measured, averages - 1.0, alike), 2, 0)
    return np.where(counts, np.sqrt(2.0 / alike / np.where(counts, variance, 1.0)), 0.0), True


def lines_alike(correlation: Array) -> float:
    """Return how many lines tell as much as one: the variance of a mean over many is so many times that of independent
    ones, 1 + 2 sum_j rho_j with the correlation rho_j of the errors of lines that are j apart.
    """
    return float(1.0 + 2.0 * correlation.sum())


def _median(size: Array) -> Array:
    """Medians (outputs, inputs) of sizes (n, outputs, inputs) that are known and not 0; of the output, or 1, else."""
    size = np.where(size > 0.0, size, np.nan)
    with np.errstate(all="ignore"), catch_warnings():
        simplefilter("ignore", RuntimeWarning)  # pairs without lines
        of_pair, of_output = np.nanmedian(size, axis=0), np.nanmedian(size, axis=(0, 2))[:, None]
    return np.where(np.isnan(of_pair), np.where(np.isnan(of_output), 1.0, of_output), of_pair)


def _scales(ratio: Array, known: Bools) -> Array:
    """Mean squares (inputs,) of residuals against a noise, with some lines of their geometric mean over all inputs."""
    total, count = np.where(known, ratio, 0.0).sum(axis=0), known.sum(axis=0)
    mean = np.where(total > 0.0, total, 1.0) / np.maximum(count, 1)
    return np.asarray((total + ALIKE * np.exp(np.log(mean[total > 0.0]).mean())) / (count + ALIKE))
