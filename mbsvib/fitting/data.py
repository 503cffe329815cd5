"""Measured objects as data of a fit, with the values of their channels."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arguments import shown
from mbsvib.errors import ResponseError
from mbsvib.fitting.mode_data import ModeData
from mbsvib.fitting.response_data import HELD, Channels, ResponseData, weights
from mbsvib.linalg.rank import EPS
from mbsvib.measurement.data import Measurement
from mbsvib.measurement.modes import MeasuredModes

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array, Complex

    Channel = tuple[str, str, float, float, float, float]

# What a channel may have, each with its unit, its value if it is held, and its natural size.
KINDS = ("gain", "delay", "lag")
# Relative standard deviations of frequencies and damping ratios, and that of shapes in parts of their largest entry.
FREQUENCY, DAMPING, SHAPE = 1e-3, 0.1, 0.05


def response_data(
    measurement: Measurement, name: str, number: int, scene: Any, kinds: Sequence[str], first: int, known: Sequence[str]
) -> tuple[ResponseData, list[Channel]]:
    """Return measured responses as data, and the values of their channels: name, unit, start, size and limits of each.

    ``number``: that of the ``scene`` in which they were measured; ``kinds``: what the channels have; ``first``: the
    number of the first of these values; ``known``: names of values
    that there are.
    """
    match, outputs, inputs = measurement.matched(scene.model), scene.plant.outputs, scene.plant.inputs
    rows = np.array([outputs.index(one) for one in match.output_names], dtype=np.intp)
    columns = np.array([inputs.index(one) for one in match.input_names], dtype=np.intp)
    responses = np.moveaxis(measurement.responses, 2, 0)
    variance = None if measurement.variance is None else np.moveaxis(measurement.variance, 2, 0)
    sign = np.moveaxis(match.factor(measurement.omega), 2, 0)
    whitening = None
    if measurement.covariance is not None:
        whitening, size = _whitening(measurement, np.isfinite(responses), name)
        weight, is_known = np.where(np.isfinite(responses), np.sqrt(2.0) / size[:, :, None], 0.0), True
    else:
        weight, is_known = weights(responses, variance, measurement.averages)
    weight = np.where(np.isfinite(sign), weight, 0.0)
    if not (weight > 0.0).any():
        raise ResponseError(f"fit: {name} has no line that was measured with a known noise; expected finite responses "
                            f"and variances.")  # fmt: skip
    channels, added = _channels(measurement, kinds, first, known, name)
    return ResponseData(
        name, number, measurement.omega, np.where(weight > 0.0, responses, 0.0), weight,
        whitening, rows, columns, np.where(np.isfinite(sign), sign, 0.0), channels, is_known,
    ), added  # fmt: skip


def _whitening(measurement: Measurement, counts: Any, name: str) -> tuple[Complex, Array]:
    """Inverse Cholesky factors (n, outputs, outputs) of the correlation of outputs, and their deviations (n, outputs).
    """
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
        return np.linalg.inv(factor), size
    except np.linalg.LinAlgError:
        raise ResponseError(f"fit: the covariance of the outputs of {name} is singular at some lines; expected a "
                            f"positive definite one, or a variance.") from None  # fmt: skip


def _channels(
    measurement: Measurement, kinds: Sequence[str], first: int, known: Sequence[str], name: str
) -> tuple[Channels, list[Channel]]:
    """Gains of the first input, and delays and lags of all inputs, are held: only products and sums are measured."""
    added: list[Channel] = []
    period = 2.0 * np.pi / float(measurement.omega[-1])
    taken = set(known)

    def number(signal: str, kind: str) -> int:
        label = f"{signal}.{kind}"
        if label in taken:
            label = f"{name}.{label}"
        taken.add(label)
        unit, start, size = ("", 1.0, 1.0) if kind == "gain" else ("s", 0.0, period)
        added.append((label, unit, start, size, 0.0 if kind == "lag" else -np.inf, np.inf))
        return first + len(added) - 1

    outer = {kind: np.array([number(signal, kind) if kind in kinds else HELD for signal in measurement.outputs],
                            dtype=np.intp) for kind in KINDS}  # fmt: skip
    inner = np.array([number(signal, "gain") if "gain" in kinds and i else HELD
                      for i, signal in enumerate(measurement.inputs)], dtype=np.intp)  # fmt: skip
    return Channels(outer["gain"], outer["delay"], outer["lag"], inner), added


def mode_data(measured: MeasuredModes, name: str, number: int, scene: Any) -> ModeData:
    """Return measured modes as data."""
    n = len(measured.frequencies)
    ratios = np.full(n, np.nan) if measured.damping_ratios is None else measured.damping_ratios
    shapes: Any = np.full((0, n), np.nan + 0j)
    rows = sign = powers = np.zeros(0, dtype=np.intp)
    if measured.shapes is not None:
        match, shapes = measured.matched(scene.model), np.asarray(measured.shapes, dtype=complex)
        rows = np.array([scene.plant.outputs.index(one) for one in match.output_names], dtype=np.intp)
        sign, powers = np.array([(partner.sign, partner.derivatives) for partner in match.outputs], dtype=np.intp).T
    return ModeData(name, number, measured.frequencies, ratios, shapes, *_deviations(measured, shapes), rows, sign,
                    powers)  # fmt: skip


def _deviations(measured: MeasuredModes, shapes: Complex) -> tuple[Array, Array, Array]:
    """Standard deviations of frequencies and damping ratios, relative, and of shapes."""
    n = len(measured.frequencies)
    frequency = np.full(n, FREQUENCY) if measured.sd is None else measured.sd / measured.frequencies
    with np.errstate(all="ignore"):
        largest = np.nanmax(np.abs(shapes), axis=0, initial=0.0) if len(shapes) else np.zeros(n)
    shape = np.broadcast_to(SHAPE * largest, shapes.shape)
    return frequency, np.full(n, DAMPING), np.where(shape > 0.0, shape, 1.0)


def conditioned(data: Any) -> list[tuple[dict[str, float], Any]]:
    """Return each of the data with the values of parameters and joint coordinates that it was measured with.

    ``data``: one measured object or several, each alone or as (values, measured object).
    """
    several = list(data) if isinstance(data, list) else [data]
    if not several:
        raise ResponseError("fit: data is empty; expected a Measurement, MeasuredModes or a list of these.")
    result = []
    for item in several:
        values, measured = item if isinstance(item, tuple) and len(item) == 2 else ({}, item)
        if not isinstance(measured, (Measurement, MeasuredModes)) or not hasattr(values, "items"):
            raise ResponseError(f"fit: data has {shown(item)}; expected a Measurement, MeasuredModes, or a pair of "
                                f"values and one of these, ({{'payload.mass': 12.0}}, measurement).")  # fmt: skip
        result.append(({str(key): check.number(value, "fit", str(key)) for key, value in values.items()}, measured))
    return result
