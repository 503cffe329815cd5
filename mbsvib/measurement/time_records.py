"""Time records: their checks, and the estimate that each method makes of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common.arguments import shown
from mbsvib.common.expected import reals
from mbsvib.errors import ResponseError
from mbsvib.measurement import estimation
from mbsvib.measurement.matching import unit_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike

    from mbsvib.common.arrays import Array, Index
    from mbsvib.measurement.estimation import Estimate

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
    if times.ndim == 0 and times > 0.0:
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
        samples = period / step
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
        if ends.shape != (2,) or not (0.0 < ends[0] < ends[1] and ends[0] * seconds >= 1.0):
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
        return estimation.local_polynomials(records, sizes, numbers - 1)
    if method == "periodic":
        return estimation.periodic(records, (outputs, inputs), samples, numbers)
    spectra, averages = estimation.welch(records, samples)
    spectra = spectra[numbers]
    if method == "Hv":
        return estimation.total_least_squares(spectra, (outputs, inputs), ratio, averages)
    if method == "H1":
        first = outputs + inputs if references else outputs
        return estimation.by_instruments(spectra, (outputs, inputs), np.arange(first, spectra.shape[1]), averages)
    if inputs == 1:  # each output alone: outputs without noise depend on each other
        each = [estimation.by_instruments(spectra[:, pair][:, :, pair], (1, 1), np.array([0]), averages)
                for pair in ([o, outputs] for o in range(outputs))]  # fmt: skip
        responses, variance, coherence = (np.concatenate([getattr(one, field) for one in each])
                                          for field in ("responses", "variance", "coherence"))  # fmt: skip
        return estimation.Estimate(responses, variance, coherence, each[0].condition, averages)
    if outputs != inputs:
        raise ResponseError(f"from_records: H2 of {outputs} outputs and {inputs} inputs; expected as many of both, or "
                            f"one input. Take 'H1' or 'Hv'.")  # fmt: skip
    return estimation.by_instruments(spectra, (outputs, inputs), np.arange(outputs), averages)


def si(channel: Mapping[str, Any]) -> tuple[Array, str]:
    """Return values in SI units and their unit; units that are not known stay."""
    unit = unit_of(str(channel.get("unit_str", "")))
    factor, known = SI.get(unit, (1.0, unit))
    return factor * np.asarray(channel["data"], dtype=float), known
