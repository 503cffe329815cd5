"""Measured objects as data of a fit, with the values of their channels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arguments import shown
from mbsvib.common.arrays import Array, Bools, Complex, Index
from mbsvib.errors import ResponseError
from mbsvib.fitting.mode_data import ModeData, shape_deviations
from mbsvib.fitting.record_data import RecordData
from mbsvib.fitting.response_data import ResponseData, lines_alike, weights
from mbsvib.fitting.variables import FARTHEST, HELD, Channels
from mbsvib.linalg.rank import EPS
from mbsvib.measurement.common_errors import CommonErrors
from mbsvib.measurement.data import Measurement
from mbsvib.measurement.estimation import local_polynomials
from mbsvib.measurement.matching import Matching
from mbsvib.measurement.modes import MeasuredModes
from mbsvib.measurement.records import Records

Channel = tuple[str, str, float, float, float, float, bool]

# What a channel may have, each with its unit, its value if it is held, and its natural size.
KINDS = ("gain", "delay", "lag", "lowpass", "highpass")
# A filter of second order starts with this damping ratio, and so many times beyond the lines.
BUTTERWORTH, BEYOND = 0.5**0.5, 2.0
# Estimated responses count from afar where they are so many times their noise.
CLEAR = 3.0
# and where the power of inputs around is at least this share of its median over all lines.
QUIET, SMOOTHED = 1e-3, 15
# Share of its variance below which the noise of a combination of pairs is rounding, as that of the sides of a joint;
# numbers that correlations of all pairs may have.
SAME, LARGEST = 1e-9, 100_000_000
# Relative standard deviations of frequencies and damping ratios.
FREQUENCY, DAMPING = 1e-3, 0.1


def response_data(
    measurement: Measurement, name: str, number: int, scene: Any, kinds: Sequence[str], first: int, known: Sequence[str]
) -> tuple[ResponseData, list[Channel]]:
    """Return measured responses as data, and the values of their channels: name, unit, start, size and limits of each.

    ``number``: that of the ``scene`` in which they were measured; ``kinds``: what the channels have; ``first``: the
    number of the first of these values; ``known``: names of values
    that there are.
    """
    match, rows, columns = _matched(measurement, scene, kinds, name)
    responses = np.moveaxis(measurement.responses, 2, 0)
    variance = None if measurement.variance is None else np.moveaxis(measurement.variance, 2, 0)
    sign = np.moveaxis(match.factor(measurement.omega), 2, 0)
    alike = lines_alike(measurement.line_correlation)
    errors, whitening, dependent = measurement.common_errors, None, 0
    if errors is None and measurement.covariance is not None:
        whitening, weight = _whitening(measurement, np.isfinite(responses), name)
        weight /= np.sqrt(alike)
        is_known = True
    else:
        variance = variance if errors is None else np.moveaxis(errors.power(), 2, 0)
        weight, is_known = weights(responses, variance, measurement.averages, alike)
        if errors is not None:
            whitening, dependent = _whitening_of_pairs(errors, weight > 0.0, name)
    weight = np.where(np.isfinite(sign), weight, 0.0)
    if not (weight > 0.0).any():
        raise ResponseError(f"fit: {name} has no line that was measured with a known noise; expected finite responses "
                            f"and variances.")  # fmt: skip
    channels, added = _channels(measurement, measurement.omega, kinds, first, known, name)
    return ResponseData(
        name, number, measurement.omega, np.where(weight > 0.0, responses, 0.0), weight,
        whitening, rows, columns, np.where(np.isfinite(sign), sign, 0.0), channels, is_known,
        dependent, measurement.line_correlation,
    ), added  # fmt: skip


def _matched(
    measured: Measurement | Records, scene: Any, kinds: Sequence[str], name: str
) -> tuple[Matching, Index, Index]:
    """Partners of the channels, and their numbers among the ports of the plant; channels in volts or unknown units are
    refused unless their gains are fitted.
    """
    match = measured.matched(scene.model)
    for partner in () if "gain" in kinds else (*match.outputs, *match.inputs):
        if not partner.scale_known:
            raise ResponseError(f"fit: the channel '{partner.measured}' of {name} is in {partner.measured_unit}, that "
                                f"of the model in {partner.unit}, and the factor between them is not known; fit it, "
                                f"channels=['gain'], or convert the data to SI units: m, rad, N, N m, m/s, m/s^2.")
    rows, columns = (np.array([ports.index(one) for one in names], dtype=np.intp) for ports, names in (
        (scene.plant.outputs, match.output_names), (scene.plant.inputs, match.input_names)))  # fmt: skip
    return match, rows, columns


def _whitening(measurement: Measurement, counts: Any, name: str) -> tuple[Complex, Array]:
    """Inverse Cholesky factors (n, outputs, outputs) of the correlation of outputs, and the weights of responses."""
    if not (counts.all(axis=(1, 2)) | ~counts.any(axis=(1, 2))).all():
        raise ResponseError(f"fit: {name} has a covariance of its outputs, and pairs that were not measured at some "
                            f"lines; leave these outputs or lines out.")  # fmt: skip
    power: Any = np.moveaxis(np.asarray(measurement.covariance), 2, 0)
    size: Any = np.sqrt(np.einsum("nii->ni", power).real)
    size = np.where(size > 0.0, size, size.max(axis=1, initial=0.0, keepdims=True))
    least = len(measurement.outputs) * EPS * (size > 0.0)[:, :, None] * np.eye(power.shape[1])
    size = np.where(size > 0.0, size, 1.0)
    try:
        factor: Any = np.linalg.cholesky(power / size[:, :, None] / size[:, None] + least)
    except np.linalg.LinAlgError:
        raise ResponseError(f"fit: the covariance of the outputs of {name} is singular at some lines; expected a "
                            f"positive definite one, or a variance.") from None  # fmt: skip
    return np.linalg.inv(factor), np.where(counts, np.sqrt(2.0) / size[:, :, None], 0.0)


def _whitening_of_pairs(errors: CommonErrors, counts: Bools, name: str) -> tuple[Complex, int]:
    """What takes the correlation out of all pairs whose errors have common causes (n, pairs, pairs), without their
    combinations that have no noise, and the number of these.
    """
    n, pairs = len(counts), counts[0].size
    if n * pairs**2 > LARGEST:
        size, most = 16e-9 * n * pairs**2, 16e-9 * LARGEST
        raise ResponseError(f"fit: errors of {name} have common causes, and the correlation of its {pairs} pairs at "
                            f"{n} lines takes {size:.3g} GB; expected at most {most:.3g} GB. Leave channels or lines "
                            f"out, data[outputs, inputs], data.within(low, high).")  # fmt: skip
    power = errors.matrices()
    size = np.sqrt(np.einsum("nkk->nk", power).real)
    known = counts.reshape(n, pairs) & (size > 0.0)
    unit = np.where(known, 1.0 / np.where(known, size, 1.0), 0.0)
    shares, axes = np.linalg.eigh(power * unit[:, :, None] * unit[:, None])
    noisy = shares > SAME
    scale = np.where(noisy, 1.0 / np.sqrt(np.where(noisy, shares, 1.0)), 0.0)
    return (axes * scale[:, None]) @ axes.conj().swapaxes(1, 2), int(known.sum() - noisy.sum())


def _channels(
    measured: Measurement | Records, omega: Array, kinds: Sequence[str], first: int, known: Sequence[str], name: str
) -> tuple[Channels, list[Channel]]:
    """Gains of the first input, and delays and filters of all inputs, are held: only products and sums are measured."""
    added: list[Channel] = []
    taken, lowest, highest = set(known), float(omega[omega > 0.0].min(initial=np.inf)), float(omega[-1])
    corner = {"lowpass": BEYOND * highest / (2.0 * np.pi), "highpass": min(lowest, highest) / BEYOND / (2.0 * np.pi)}

    def number(signal: str, kind: str) -> int:
        if kind not in kinds:
            return HELD
        label = f"{signal}.{kind}"
        if label in taken:
            label = f"{name}.{label}"
        taken.add(label)
        if kind in corner:
            entries: list[Channel] = [
                (f"{label}.{field}", unit, start, start, start / FARTHEST, start * FARTHEST, True)
                for field, unit, start in (("frequency", "Hz", corner[kind]), ("damping_ratio", "", BUTTERWORTH))]
        elif kind == "gain":
            entries = [(label, "", 1.0, 1.0, -np.inf, np.inf, False)]
        else:
            least = 0.0 if kind == "lag" else -np.inf
            entries = [(label, "s", 0.0, 2.0 * np.pi / highest, least, np.inf, False)]
        added.extend(entries)
        return first + len(added) - len(entries)

    outer = {kind: np.array([number(signal, kind) for signal in measured.outputs], dtype=np.intp) for kind in KINDS}
    inner = np.array([number(signal, "gain") if i else HELD for i, signal in enumerate(measured.inputs)], dtype=np.intp)
    lowpass, highpass = (np.where(outer[kind][:, None] >= 0, outer[kind][:, None] + np.arange(2), HELD)
                         for kind in ("lowpass", "highpass"))  # fmt: skip
    return Channels(outer["gain"], outer["delay"], outer["lag"], lowpass, highpass, inner), added


def record_data(
    records: Records, name: str, number: int, scene: Any, kinds: Sequence[str], first: int, known: Sequence[str]
) -> tuple[RecordData, list[Channel]]:
    """Return time records as data, and the values of their channels, as ``response_data`` does."""
    match, rows, columns = _matched(records, scene, kinds, name)
    for partner in match.inputs:
        if partner.derivatives:
            raise ResponseError(f"fit: the input '{partner.measured}' of {name} is in {partner.measured_unit}, that of "
                                f"the model in {partner.unit}; give records of what the model has as its input.")
    numbers = records.lines()
    omega = 2.0 * np.pi * numbers / (records.samples * records.t)
    channels, added = _channels(records, omega, kinds, first, known, name)
    measured, driven = records.spectra("output"), records.spectra("input")
    driven = driven * np.array([partner.sign for partner in match.inputs]).reshape(-1, 1)
    power, whitening = records.power(), None
    if power is None:
        size = np.median(np.abs(measured), axis=(0, 2))[None]
    else:
        size = np.sqrt(np.einsum("nii->ni", power))
        if records.covariance is not None:
            whitening = np.linalg.inv(np.linalg.cholesky(power[0] / size[0][:, None] / size[0]))
    weight = np.broadcast_to(np.sqrt(2.0) / size[:, :, None], measured.shape)
    result = RecordData(
        name, number, omega, records.t, records.hold, driven, measured, weight, whitening, rows, columns,
        np.array([partner.sign for partner in match.outputs]),
        np.array([partner.derivatives for partner in match.outputs], dtype=np.intp),
        channels, power is not None, None)
    return replace(result, estimate=_estimated(records, numbers, result, match)), added


def _estimated(records: Records, numbers: Index, data: RecordData, match: Matching) -> ResponseData | None:
    """Responses of the records by local polynomials, None where these do not tell them."""
    if not len(records.inputs):
        return None
    from scipy.ndimage import uniform_filter1d

    every = np.array([*records.outputs.values(), *records.inputs.values()]).swapaxes(0, 1)
    try:
        found = local_polynomials(every, (len(records.outputs), len(records.inputs), 0), numbers - 1)
    except ResponseError:
        return None
    ports = tuple(records.outputs), tuple(records.inputs)
    smooth = Measurement(data.omega, found.responses, *ports, found.variance).smoothed()
    responses, variance = np.moveaxis(found.responses, 2, 0), np.moveaxis(np.asarray(smooth.variance), 2, 0)
    weight, known = weights(responses, variance, None, lines_alike(found.correlation))
    drive = uniform_filter1d((np.abs(data.driven) ** 2).mean(axis=2), SMOOTHED, axis=0)
    driven = (drive > QUIET * np.median(drive, axis=0)).all(axis=1)
    clear = np.abs(responses) > CLEAR * np.sqrt(variance)  # logarithms of noise tell nothing
    weight = np.where(clear & driven[:, None, None], weight, 0.0)
    if not (weight > 0.0).any():
        return None
    sign = np.moveaxis(match.factor(data.omega), 2, 0)
    return ResponseData(data.name, data.scene, data.omega, responses, weight, None, data.rows, data.columns, sign,
                        data.channels, known)


def mode_data(measured: MeasuredModes, name: str, number: int, scene: Any) -> ModeData:
    """Return measured modes as data."""
    n = len(measured.frequencies)
    ratios = np.full(n, np.nan) if measured.damping_ratios is None else np.where(
        measured.damping_ratios > 0.0, measured.damping_ratios, np.nan)  # fmt: skip
    shapes: Any = np.full((0, n), np.nan + 0j)
    rows = sign = powers = np.zeros(0, dtype=np.intp)
    if measured.shapes is not None:
        match, shapes = measured.matched(scene.model), np.asarray(measured.shapes, dtype=complex)
        rows = np.array([scene.plant.outputs.index(one) for one in match.output_names], dtype=np.intp)
        sign, powers = np.array([(partner.sign, partner.derivatives) for partner in match.outputs], dtype=np.intp).T
    deviation = np.full(n, FREQUENCY) if measured.sd is None else measured.sd / measured.frequencies
    return ModeData(name, number, measured.frequencies, ratios, shapes, deviation, np.full(n, DAMPING),
                    shape_deviations(shapes), rows, sign.astype(float), powers)  # fmt: skip


def conditioned(data: Any) -> list[tuple[dict[str, float], Any]]:
    """Return each of the data with the values of parameters and joint coordinates that it was measured with.

    ``data``: one measured object or several, each alone or as (values, measured object).
    """
    several = list(data) if isinstance(data, list) else [data]
    if not several:
        raise ResponseError("fit: data is empty; expected a Measurement, Records, MeasuredModes or a list "
                            "of these.")  # fmt: skip
    result = []
    for item in several:
        values, measured = item if isinstance(item, tuple) and len(item) == 2 else ({}, item)
        if not isinstance(measured, (Measurement, Records, MeasuredModes)) or not hasattr(values, "items"):
            raise ResponseError(f"fit: data = {shown(item)}; expected a Measurement, Records, MeasuredModes, or a "
                                f"pair of values and one of these, ({{'payload.mass': 12.0}}, measurement).")
        result.append(({str(key): check.number(value, "fit", str(key)) for key, value in values.items()}, measured))
    return result
