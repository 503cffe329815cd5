"""Time records, their times and their lengths, as far as frequency responses need them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.common.arguments import shown
from mbsvib.common.arrays import Array
from mbsvib.common.expected import reals
from mbsvib.errors import ResponseError
from mbsvib.linalg.bands import within
from mbsvib.measurement.matching import unit_of

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


def si(channel: Mapping[str, Any]) -> tuple[Array, str]:
    """Return values in SI units and their unit; units that are not known stay."""
    unit = unit_of(str(channel.get("unit_str", "")))
    factor, known = SI.get(unit, (1.0, unit))
    return factor * np.asarray(channel["data"], dtype=float), known
