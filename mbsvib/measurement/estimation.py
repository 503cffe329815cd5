"""Time records and their checks; frequency responses and their variance from spectra of these: Welch's averages, local
polynomials, periodic data.

All spectra are (..., channels, n) over n lines. One formula serves H1, H2 and closed loops: with instruments r,

G = Syr Srr^-1 Sru (Sur Srr^-1 Sru)^-1,  e = y - G u,  cov G_oi = See (Sur Srr^-1 Sru)^-1_ii / (m - inputs)

r = u is H1, r = y is H2, and an outer reference is the unbiased choice in a closed loop.
Sources: Bendat, Piersol, Random Data (2010), 7.3, 9.2; Welch, IEEE Trans. Audio 15 (1967) 70; Pintelon, Schoukens,
System Identification: A Frequency Domain Approach (2012), 2.7 (several inputs, periods), 7.2 (local polynomials).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.common.arguments import shown
from mbsvib.common.arrays import Array, Complex, Index
from mbsvib.common.expected import reals
from mbsvib.errors import ResponseError
from mbsvib.linalg.bands import within
from mbsvib.linalg.rank import INPUTS_APART, NO_PIVOT
from mbsvib.measurement.matching import unit_of

ORDER, LINES = 2, 6  # of local polynomials: degree, and lines at either side
LEAST_FREEDOM = 7  # of the residuals of a local polynomial; with several inputs it takes more lines for it
# Relative error of the response from reference to input from which the error of a quotient is far from normal.
WEAK = 0.3
CHUNK = 4096  # lines that are solved at once


class Estimate(NamedTuple):
    """Responses (outputs, inputs, n), their variance, coherence with a single input, and condition of the inputs (n,).

    ``averages``: effective number of independent ones. ``noise`` is the part of the variance that changes from period
    to period, where this is known apart.
    """

    responses: Complex
    variance: Array | None
    coherence: Array | None
    condition: Array
    averages: float | None
    noise: Array | None = None


def welch(records: Array, length: int) -> tuple[Complex, float]:
    """Return spectral matrices (n, channels, channels) by Hann windows that overlap by half, and their number m.

    ``records`` (experiments, channels, N). m is the number of independent windows with the same variance,
    m = E K / (1 + 2 sum_j (1 - j / K) rho_j^2), with K windows a record whose correlation at distance j is rho_j.
    """
    step = length - length // 2
    window: Any = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(length) / length)
    starts = range(0, records.shape[-1] - length + 1, step)
    total: Any = 0.0
    for start in starts:
        piece = records[..., start : start + length]
        spectra = np.fft.rfft((piece - piece.mean(axis=-1, keepdims=True)) * window)
        total = total + np.einsum("ecn,edn->ncd", spectra, spectra.conj())
    count, shared = len(starts), 1.0
    for j in range(1, min(count, -(-length // step))):
        overlap = window[: length - j * step] @ window[j * step :] / (window @ window)
        shared += 2.0 * (1.0 - j / count) * overlap**2
    averages = len(records) * count / shared
    return np.asarray(total / (len(records) * count)), averages


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
                    averages)  # fmt: skip


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
    pieces = []
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
    return Estimate(_last(response), _last(variance), None, _condition(power), None)


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
    return Estimate(_last(best), noise if total is None else total, None, condition, None, noise)


def _unexcited(line: int) -> ResponseError:
    return ResponseError(f"from_records: around line {line + 1} (times the resolution) too few lines are excited for "
                         f"method='local'. Leave them out by band=, or take method='periodic' for periodic excitation.")


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


# Times that differ from even ones by less than this share of a step are even: rounded time stamps.
EVEN = 1e-2
# Length over 1 / (damping ratio frequency) from which a peak is off by less than 20 %; segments and periods: 1.
RESOLVED = {"local": 4}
# Units of test laboratories in SI units.
SI = {"g": (9.80665, "m/s^2"), "mm": (1e-3, "m"), "um": (1e-6, "m"), "µm": (1e-6, "m"), "kN": (1e3, "N"),
      "mm/s": (1e-3, "m/s"), "mm/s^2": (1e-3, "m/s^2")}  # fmt: skip


def stacked(
    groups: Mapping[str, Mapping[str, ArrayLike]], who: str = "from_records",
    needed: Sequence[str] = ("output", "input"),
) -> tuple[Array, tuple[int, int, int]]:  # fmt: skip
    """Return records (experiments, channels, N) and the number of channels of each group; ``needed`` are not empty."""
    stacked: list[Array] = []
    counts: list[int] = []
    for kind, group in groups.items():
        records = dict(group.items()) if hasattr(group, "items") else {}
        counts.append(len(records))
        if not hasattr(group, "items") or (not records and kind in needed):
            raise ResponseError(f"{who}: {kind}s = {shown(group)}; expected records by name, {{'F': array}}.")
        for name, values in records.items():
            record = np.atleast_2d(reals(values, who, f"'{name}'", "a record of numbers"))
            if record.ndim != 2 or record.shape[1] < 2 or (stacked and record.shape != stacked[0].shape):
                raise ResponseError(f"{who}: '{name}' has shape {record.shape}; expected experiments and "
                                    f"samples{f', {stacked[0].shape} as the others' if stacked else ''}.")  # fmt: skip
            if not np.isfinite(record).all():
                at = np.argwhere(~np.isfinite(record))[0][-1]
                raise ResponseError(f"{who}: '{name}' is not finite at sample {at}; cut or repair the record.")
            if (np.ptp(record) if len(record) else 0.0) == 0.0:
                raise ResponseError(f"{who}: '{name}' is constant; leave this {kind} out.")
            stacked.append(record - record.mean(axis=1, keepdims=True))
    outputs, inputs, references = counts
    if references and references < inputs:
        raise ResponseError(f"{who}: {references} references for {inputs} inputs; expected as many or more.")
    return np.stack(stacked, axis=1), (outputs, inputs, references)


def step_of(t: ArrayLike, count: int, who: str = "from_records") -> float:
    """Return the time between samples [s]."""
    times = reals(t, who, "t", "even times [s], or the time between samples [s]")
    if times.ndim == 0:
        if not 0.0 < times < np.inf:
            raise ResponseError(f"{who}: t = {times:g}; expected a positive time between samples [s].")
        return float(times)
    if times.shape != (count,) or count < 2 or not np.isfinite(times).all():
        raise ResponseError(f"{who}: t has shape {times.shape}, records have {count} samples; expected one time "
                            f"[s] each, or the time between samples.")  # fmt: skip
    step = float(times[-1] - times[0]) / (count - 1)
    off = np.abs(times - times[0] - step * np.arange(count)).max()
    if not step > 0.0 or off > EVEN * step:
        raise ResponseError(f"{who}: times are uneven: off by {off:.3g} s from steps of {step:.6g} s; resample "
                            f"the records.")  # fmt: skip
    return step


def samples_of(count: int, step: float, segments: int | None, period: float | None) -> int:
    """Return the samples of a segment, of a period, or of the record."""
    if period is not None:
        samples = float(reals(period, "from_records", "period", "a time [s]")) / step
        if not samples >= 2.0 or abs(samples - round(samples)) > EVEN:
            raise ResponseError(f"from_records: period = {period!r} s is {samples:.6g} samples; expected a "
                                f"whole number.")  # fmt: skip
        return round(samples)
    if segments is None:
        return count
    if isinstance(segments, bool) or not isinstance(segments, (int, np.integer)) or not 1 <= segments <= count // 4:
        raise ResponseError(f"from_records: segments = {shown(segments)}; expected a whole number from 1 to "
                            f"{count // 4}.")  # fmt: skip
    return count // int(segments)


def check_length(
    seconds: float, band: tuple[float, float] | None, lowest: tuple[float, float] | None, method: str,
    who: str = "from_records",
) -> None:  # fmt: skip
    """Refuse lines that stretches of that length do not resolve."""
    windowed = method in ("H1", "H2", "Hv")
    what = f"segments of {seconds:.4g} s" if windowed else f"{seconds:.4g} s"
    hint = "Record longer" + (", take fewer segments, or method='local'." if windowed else ".")
    if band is not None:
        ends = reals(band, who, "band", "the first and the last frequency [Hz]")
        if ends.shape != (2,) or not (0.0 < ends[0] < ends[1] and within(ends[:1] * seconds, 1.0, np.inf).all()):
            raise ResponseError(f"{who}: band = {shown(band)} Hz with {what}, whose lowest line is {1 / seconds:.4g} "
                                f"Hz; expected a band above it, (first, last). {hint}")
    if lowest is not None:
        mode = reals(lowest, who, "lowest", "a frequency [Hz] and a damping ratio")
        frequency, ratio = mode if mode.shape == (2,) else (0.0, 0.0)
        if not (frequency > 0.0 and ratio > 0.0):
            raise ResponseError(f"{who}: lowest = {shown(lowest)}; expected a frequency [Hz] and a damping "
                                f"ratio.")  # fmt: skip
        times = RESOLVED.get(method, 1)
        if seconds * frequency * ratio < times:
            least = times / (ratio * frequency)
            raise ResponseError(f"{who}: {what} for a mode at {frequency:g} Hz with damping ratio {ratio:g}; "
                                f"expected {times} / (ratio f) = {least:.4g} s or more. {hint}")  # fmt: skip


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
    spectra, averages = welch(records, samples)
    spectra = spectra[numbers]
    if method == "Hv":
        return total_least_squares(spectra, (outputs, inputs), ratio, averages)
    if method == "H1":
        first = outputs + inputs if references else outputs
        return by_instruments(spectra, (outputs, inputs), np.arange(first, spectra.shape[1]), averages)
    if inputs == 1:  # each output alone: outputs without noise depend on each other
        each = [by_instruments(spectra[:, pair][:, :, pair], (1, 1), np.array([0]), averages)
                for pair in ([o, outputs] for o in range(outputs))]  # fmt: skip
        responses, variance, coherence = (np.concatenate([getattr(one, field) for one in each])
                                          for field in ("responses", "variance", "coherence"))  # fmt: skip
        return Estimate(responses, variance, coherence, each[0].condition, averages)
    if outputs != inputs:
        raise ResponseError(f"from_records: H2 of {outputs} outputs and {inputs} inputs; expected as many of both, or "
                            f"one input. Take 'H1' or 'Hv'.")  # fmt: skip
    return by_instruments(spectra, (outputs, inputs), np.arange(outputs), averages)


def si(channel: Mapping[str, Any]) -> tuple[Array, str]:
    """Return values in SI units and their unit; units that are not known stay."""
    unit = unit_of(str(channel.get("unit_str", "")))
    factor, known = SI.get(unit, (1.0, unit))
    return factor * np.asarray(channel["data"], dtype=float), known
