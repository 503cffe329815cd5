"""Frequency responses of time records and their variance: Welch's averages, local polynomials, periodic data.

All spectra are (..., channels, n) over n lines. One formula serves H1, H2 and closed loops: with instruments r,

G = Syr Srr^-1 Sru (Sur Srr^-1 Sru)^-1,  e = y - G u,  cov G_oi = See (Sur Srr^-1 Sru)^-1_ii / (m - inputs)

r = u is H1, r = y is H2, and an outer reference is the unbiased choice in a closed loop.

Errors of neighbouring lines k and k + j are alike: of averages of windows w by what windows and drive r share,
rho_j = Re sum_t w_t^2 exp(-2 pi i j t / N) E[r_k conj(r_k+j)], of local polynomials by the lines that both have.

Sources: Bendat, Piersol, Random Data (2010), 7.3, 9.2; Welch, IEEE Trans. Audio 15 (1967) 70; Pintelon, Schoukens,
System Identification: A Frequency Domain Approach (2012), 2.7 (several inputs, periods), 7.2 (local polynomials).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from mbsvib.common.arrays import Array, Complex, Index
from mbsvib.errors import ResponseError
from mbsvib.linalg.rank import INPUTS_APART, NO_PIVOT

ORDER, LINES = 2, 6  # of local polynomials: degree, and lines at either side
LEAST_FREEDOM = 7  # of the residuals of a local polynomial; with several inputs it takes more lines for it
# Relative error of the response from reference to input from which the error of a quotient is far from normal.
WEAK = 0.3
CHUNK = 4096  # lines that are solved at once
SHARED = 2  # neighbours on each side with which a line of a Hann window shares noise
ALIKE = 0.01  # correlations of lines that are as good as none


class Estimate(NamedTuple):
    """Responses (outputs, inputs, n), their variance, coherence with a single input, and condition of the inputs (n,).

    ``averages``: effective number of independent ones, one more than the variance has degrees of freedom. ``noise`` is
    the part of the variance that changes from period to period, where this is known apart. ``correlation`` (lines,) of
    errors with those of the next line, the one after it, and so on.
    """

    responses: Complex
    variance: Array | None
    coherence: Array | None
    condition: Array
    averages: float | None
    noise: Array | None = None
    correlation: Array = np.zeros(0)


def welch(records: Array, length: int) -> tuple[Complex, float, Complex]:
    """Return spectral matrices (n, channels, channels) by Hann windows that overlap by half, their number m, and
    E[z_k conj(z_k+j)] times the correlation of white noise at lines that are j = 1, 2 apart (j, n, channels).

    ``records`` (experiments, channels, N). m is the number of independent windows with the same variance,
    m = E K / (1 + 2 sum_j (1 - j / K) rho_j^2), with K windows a record whose correlation at distance j is rho_j.
    """
    step = length - length // 2
    window: Any = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(length) / length)
    starts = range(0, records.shape[-1] - length + 1, step)
    total: Any = 0.0
    beside: Complex = np.zeros((SHARED, length // 2 + 1, records.shape[1]), dtype=complex)
    share = np.fft.fft(window**2)[1 : SHARED + 1] / (window @ window)
    for start in starts:
        piece = records[..., start : start + length]
        spectra = np.fft.rfft((piece - piece.mean(axis=-1, keepdims=True)) * window)
        total = total + np.einsum("ecn,edn->ncd", spectra, spectra.conj())
        for j, part in enumerate(share, start=1):
            beside[j - 1, :-j] += part * np.einsum("ecn,ecn->nc", spectra[..., :-j], spectra[..., j:].conj())
    count, shared = len(starts), 1.0
    for j in range(1, min(count, -(-length // step))):
        overlap = window[: length - j * step] @ window[j * step :] / (window @ window)
        shared += 2.0 * (1.0 - j / count) * overlap**2
    averages = len(records) * count / shared
    count *= len(records)
    return np.asarray(total / count), averages, np.asarray(beside / count)


def by_instruments(spectra: Complex, sizes: tuple[int, int], instruments: Index, averages: float) -> Estimate:
    """Return the estimate with the instruments r, some of the channels outputs, inputs, references of ``spectra``."""
    outputs, inputs = sizes
    y, u, r = np.arange(outputs), outputs + np.arange(inputs), instruments
    if averages <= inputs:
        raise ResponseError(f"from_records: {averages:.3g} independent averages for {inputs} inputs; expected more. "
                            f"Give more segments, more experiments, or method='local'.")  # fmt: skip
    own = spectra[:, u][:, :, u]
    condition = _condition(own)
    weighted = np.linalg.solve(spectra[:, r][:, :, r], spectra[:, r])  # Srr^-1 Srz
    cross = spectra[:, :, r] @ weighted[:, :, u]  # Szr Srr^-1 Sru
    power = np.linalg.inv(cross[:, u])
    g = cross[:, y] @ power
    shares = np.repeat(np.einsum("nii->ni", power).real[:, None], outputs, axis=1)
    return _with_variance(spectra, g, shares, (y, u), condition, averages)


def total_least_squares(spectra: Complex, sizes: tuple[int, int], ratio: float | None, averages: float) -> Estimate:
    """Return Hv: conj(v_y) y + sum conj(v_u) u = 0 with the eigenvector v of the least eigenvalue of [y u], scaled.

    ``ratio``: standard deviation of the noise of outputs over that of inputs; None: the same share of the power in each
    channel, with one input the geometric mean of H1 and H2.
    """
    outputs, inputs = sizes
    u = outputs + np.arange(inputs)
    g = np.empty((len(spectra), outputs, inputs), dtype=complex)
    shares = np.empty((len(spectra), outputs, inputs))
    own = spectra[:, u][:, :, u]
    for o in range(outputs):
        joint = spectra[:, [o, *u]][:, :, [o, *u]]
        scale = np.sqrt(np.einsum("nii->ni", joint).real) if ratio is None else \
            np.broadcast_to([ratio] + [1.0] * inputs, (len(spectra), 1 + inputs))  # fmt: skip
        values, vectors = np.linalg.eigh(joint / (scale[:, :, None] * scale[:, None, :]))
        v = vectors[:, :, 0].conj() / scale
        g[:, o] = -v[:, 1:] / v[:, :1]
        noise = values[:, :1] * scale**2
        inverse = np.linalg.inv(own - noise[:, None, 1:] * np.eye(inputs))
        left = noise[:, 1:] / (1.0 + np.einsum("ni,ni->n", np.abs(g[:, o]) ** 2, noise[:, 1:] / noise[:, :1]))[:, None]
        shares[:, o] = np.einsum("nii->ni", inverse + inverse @ (left[:, :, None] * inverse)).real
    return _with_variance(spectra, g, shares, (np.arange(outputs), u), _condition(own), averages)


def _with_variance(
    spectra: Complex, g: Any, shares: Array, channels: tuple[Index, Index], condition: Array, averages: float
) -> Estimate:
    y, u = channels
    residual = np.concatenate((np.broadcast_to(np.eye(len(y)), (len(g), len(y), len(y))), -g), axis=2)
    both = np.concatenate((y, u))
    errors = np.einsum("noc,ncd,nod->no", residual, spectra[:, both][:, :, both], residual.conj()).real
    variance = np.maximum(errors, 0.0)[:, :, None] * shares / (averages - len(u))
    coherence = None
    if len(u) == 1:
        powers = np.einsum("nii->ni", spectra).real
        coherence = np.abs(spectra[:, y, u[0]]) ** 2 / (powers[:, y] * powers[:, u])
    return Estimate(_last(g), _last(variance), None if coherence is None else _last(coherence[:, :, None]), condition,
                    averages - len(u) + 1)  # fmt: skip


def local_polynomials(records: Array, sizes: tuple[int, int, int], wanted: Index) -> Estimate:
    """Return G at lines of whole records, from polynomials of degree 2 over neighbouring lines.

    Z(k + x) = sum_p x^p (g_p R(k + x) + t_p) + noise, for z = (y, u) and r, which is u if there is no reference; t are
    transients, for each experiment. G = Gyr Gur^-1, with first-order variance of (y - G u).
    ``records`` (experiments, channels, N), ``sizes``: numbers of outputs, inputs and references.
    ``wanted``: which lines, 0 is the first above zero.
    """
    outputs, inputs, references = sizes
    r = slice(outputs + inputs, None) if references else slice(outputs, outputs + inputs)
    spectra = np.fft.rfft(records)[:, :, 1:]
    count, (experiments, _, lines) = references or inputs, spectra.shape
    columns = (ORDER + 1) * (count + experiments)
    half = max(LINES, -(-((LEAST_FREEDOM + columns) / experiments - 1) // 2))
    width = 2 * int(half) + 1
    if lines < width:
        raise ResponseError(f"from_records: {lines} lines; method='local' needs {width} or more, from longer records.")
    freedom = experiments * width - columns
    pieces, alike = [], np.zeros((2, width - 1))
    for first in range(0, len(wanted), CHUNK):
        k = wanted[first : first + CHUNK]
        window = np.clip(k - int(half), 0, lines - width)[:, None] + np.arange(width)
        x = ((window - k[:, None]) / half)[:, None, :, None] ** np.arange(ORDER + 1)  # (n, 1, width, powers)
        local = np.moveaxis(spectra[:, :, window], (0, 1), (1, 3))  # (n, experiments, width, channels)
        drive = local[..., r]
        size = np.sqrt(np.mean(np.abs(drive) ** 2, axis=(1, 2)))  # (n, references)
        quiet = np.flatnonzero(size.min(axis=1) <= INPUTS_APART * np.median(size))
        if len(quiet):
            raise _unexcited(k[quiet[0]])
        driven = (drive / size[:, None, None])[..., None, :] * x[..., :, None]
        free = np.einsum("nawp,ef->newpf", x, np.eye(experiments)) + 0j
        matrix = np.concatenate((driven, free), axis=-1).reshape(len(k), experiments * width, columns)
        q, upper = np.linalg.qr(matrix)
        pivots = np.abs(np.einsum("nii->ni", upper))
        empty = np.flatnonzero(pivots.min(axis=1) <= NO_PIVOT * pivots.max(axis=1))
        if len(empty):
            raise _unexcited(k[empty[0]])
        target = local[..., : outputs + inputs].reshape(len(k), experiments * width, outputs + inputs)
        projected = q.conj().swapaxes(1, 2) @ target
        inverse = np.linalg.inv(upper)
        g = ((inverse @ projected)[:, :count] / size[:, :, None]).swapaxes(1, 2)  # (n, channels, references)
        alike += _alike(inverse[:, :count] @ q.conj().swapaxes(1, 2), window)
        rest = target - q @ projected
        noise = rest.swapaxes(1, 2) @ rest.conj() / freedom
        own = local[..., outputs : outputs + inputs]
        power = np.einsum("newc,newd->ncd", own, own.conj())
        spread = inverse[:, :count] @ inverse[:, :count].conj().swapaxes(1, 2) / (size[:, :, None] * size[:, None])
        pieces.append((g, noise, spread, power))
    g, noise, spread, power = (np.concatenate(part) for part in zip(*pieces, strict=True))
    back = np.linalg.pinv(g[:, outputs:])
    error = np.sqrt(np.einsum("nii->n", noise[:, outputs:, outputs:]).real * np.einsum("nii->n", spread).real)
    doubt = float(np.median(error * np.linalg.norm(back, 2, axis=(1, 2))))
    if doubt > WEAK:
        raise ResponseError(f"from_records: the response of the inputs to the reference is known to {100 * doubt:.3g} "
                            f"% only; expected {100 * WEAK:g} % or less. Average more: method='H1' with segments.")
    response = g[:, :outputs] @ back
    errors = np.concatenate((np.broadcast_to(np.eye(outputs), (len(g), outputs, outputs)), -response), axis=2)
    scatter = np.einsum("noc,ncd,nod->no", errors, noise, errors.conj()).real
    share = np.einsum("nri,nrs,nsi->ni", back, spread.conj(), back.conj()).real
    variance = np.maximum(scatter, 0.0)[:, :, None] * share[:, None, :]
    return Estimate(_last(response), _last(variance), None, _condition(power), float(freedom + 1),
                    correlation=_trimmed(alike[0] / np.maximum(alike[1], 1.0)))  # fmt: skip


def _alike(weights: Complex, window: Index) -> Array:
    """Sums of the correlations of lines that are 1, 2, ... apart, and numbers of these, (2, lines), by the ``weights``
    (n, references, experiments * lines) of the lines in each ``window`` (n, lines).
    """
    n, width = window.shape
    unit = (weights / np.linalg.norm(weights, axis=(1, 2), keepdims=True)).reshape(n, -1, width)
    result = np.zeros((2, width - 1))
    for j in range(1, width):
        moved = window[j:, 0] - window[:-j, 0] == j  # not at the ends of the spectrum
        result[:, j - 1] = np.vdot(unit[:-j, :, j:][moved], unit[j:, :, :-j][moved]).real, moved.sum()
    return result


def periodic(records: Array, sizes: tuple[int, int], period: int, wanted: Index) -> Estimate:
    """Return G = Y U^-1 line by line from whole periods; groups of experiments are as many as there are inputs.

    The scatter of groups is noise and nonlinear distortion, that of periods noise alone. ``wanted``: numbers of lines.
    """
    outputs, inputs = sizes
    experiments, channels, length = records.shape
    count, groups = length // period, experiments // inputs
    if not count or experiments % inputs:
        raise ResponseError(f"from_records: {experiments} experiments of {length / period:.3g} periods for {inputs} "
                            f"inputs; expected whole periods, and as many experiments as inputs, or a multiple of "
                            f"that.")  # fmt: skip
    shaped = records[..., length - count * period :].reshape(groups, inputs, channels, count, period)
    spectra = np.fft.rfft(shaped)[..., wanted].transpose(4, 0, 3, 2, 1)  # (n, groups, periods, channels, experiments)
    mean = spectra.mean(axis=2)  # (n, groups, channels, experiments)
    drive = mean[:, :, outputs:]
    strength = np.linalg.svd(drive, compute_uv=False).min(axis=(1, 2))
    excited = strength > INPUTS_APART * strength.max()
    back = np.linalg.inv(np.where(excited[:, None, None, None], drive, np.eye(inputs)))
    g = mean[:, :, :outputs] @ back
    g[~excited] = np.nan
    best = g.mean(axis=1)
    noise = total = None
    if count > 1:
        errors = (spectra[:, :, :, :outputs] - g[:, :, None] @ spectra[:, :, :, outputs:]) @ back[:, :, None]
        noise = _last((np.abs(errors) ** 2).sum(axis=(1, 2)) / (count * (count - 1) * groups**2))
    if groups > 1:
        total = _last((np.abs(g - best[:, None]) ** 2).sum(axis=1) / (groups * (groups - 1)))
    condition = np.where(excited, np.linalg.cond(drive).max(axis=1), 1.0)
    independent = groups if groups > 1 else count
    return Estimate(_last(best), noise if total is None else total, None, condition,
                    float(independent) if independent > 1 else None, noise)  # fmt: skip


def _unexcited(line: int) -> ResponseError:
    return ResponseError(f"from_records: around line {line + 1} (times the resolution) too few lines are excited for "
                         f"method='local'. Leave them out by band=, or take method='periodic' for periodic excitation.")


def _trimmed(correlation: Array) -> Array:
    """Correlations up to the last one that is not as good as none."""
    known = np.flatnonzero(np.abs(correlation) > ALIKE)
    return correlation[: known[-1] + 1 if len(known) else 0]


def _last(values: Array | Complex) -> Any:
    """Lines last."""
    return np.ascontiguousarray(np.moveaxis(values, 0, -1))


def _condition(power: Complex) -> Array:
    """Condition (n,) of inputs, scaled to the same power; refused where they are not independent."""
    size = np.sqrt(np.einsum("nii->ni", power).real)
    values = np.linalg.eigvalsh(power / (size[:, :, None] * size[:, None]))
    with np.errstate(divide="ignore"):
        condition = np.sqrt(values[:, -1] / np.maximum(values[:, 0], 0.0))
    if np.median(condition) > 1.0 / INPUTS_APART:
        raise ResponseError(f"from_records: the {power.shape[1]} inputs are not independent: their condition is "
                            f"{np.median(condition):.3g}. Give as many experiments as inputs, or independent signals.")
    return np.asarray(condition)


def estimate(
    records: Array, sizes: tuple[int, int, int], method: str, lines: tuple[int, Index], ratio: float | None
) -> Estimate:
    """Return the estimate of a method.

    ``lines``: samples of a segment or period, and the numbers of the lines that are wanted.
    """
    samples, numbers = lines
    outputs, inputs, references = sizes
    if method == "local":
        return local_polynomials(records, sizes, numbers - 1)
    if method == "periodic":
        return periodic(records, (outputs, inputs), samples, numbers)
    spectra, averages, beside = welch(records, samples)
    own = np.sqrt(np.einsum("nii->ni", spectra).real)
    spectra = spectra[numbers]
    drive = np.arange(outputs) if method == "H2" else np.arange(outputs + bool(references) * inputs, spectra.shape[1])
    correlation = []
    for j, shared in enumerate(beside, start=1):
        size = own * np.concatenate((own[j:], np.zeros((j, own.shape[1]))))
        share = np.divide(shared.real, size, out=np.zeros_like(size), where=size > 0.0)
        correlation.append(share[numbers][:, drive].mean())
    found = _averaged(spectra, (outputs, inputs), drive, method, ratio, averages)
    return found._replace(correlation=_trimmed(np.array(correlation)))


def _averaged(
    spectra: Complex, sizes: tuple[int, int], drive: Index, method: str, ratio: float | None, averages: float
) -> Estimate:
    outputs, inputs = sizes
    if method == "Hv":
        return total_least_squares(spectra, sizes, ratio, averages)
    if method == "H1":
        return by_instruments(spectra, sizes, drive, averages)
    if inputs == 1:  # each output alone: outputs without noise depend on each other
        each = [by_instruments(spectra[:, pair][:, :, pair], (1, 1), np.array([0]), averages)
                for pair in ([o, outputs] for o in range(outputs))]  # fmt: skip
        responses, variance, coherence = (np.concatenate([getattr(one, field) for one in each])
                                          for field in ("responses", "variance", "coherence"))  # fmt: skip
        return each[0]._replace(responses=responses, variance=variance, coherence=coherence)
    if outputs != inputs:
        raise ResponseError(f"from_records: H2 of {outputs} outputs and {inputs} inputs; expected as many of both, or "
                            f"one input. Take 'H1' or 'Hv'.")  # fmt: skip
    return by_instruments(spectra, sizes, drive, averages)
