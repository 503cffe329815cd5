"""Rise, overshoot and settling of step responses: when they have settled, and marks in their panels."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mbsvib.common import units
from mbsvib.errors import ResponseError
from mbsvib.plots import _style as style
from mbsvib.plots._curves import negligible

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array
    from mbsvib.plots._system import Linear
    from mbsvib.responses.step_info import StepInfo

LONGER = 1.2  # time shown, in settling times
NEAR_POLE = 0.97  # times natural frequencies: at undamped ones there is no response
PERIODS = 400.0  # of the slowest vibration; more of them make a solid band
RISE = (0.1, 0.9)  # shares of the final value
NO_OVERSHOOT = 1e-6  # per cent: rounding

SAMPLED = 0.05  # share of a peak by which samples may miss it


class Response(NamedTuple):
    """A response as it is drawn: times [s] and values (n,), and the factors of both in the units of the axes."""

    t: Array
    y: Array
    time_factor: float
    factor: float


def infos(systems: Sequence[Linear], outputs: list[str], inputs: list[str]) -> list[StepInfo | None]:
    """Return the figures of step responses of each system, None for those that do not settle or have no such sum."""
    result: list[StepInfo | None] = []
    for system in systems:
        try:
            result.append(system.step_info(outputs, inputs))
        except ResponseError:  # unstable, at rest nowhere, or poles that coincide
            result.append(None)
    return result


def rounding(system: Linear) -> NDArray[np.bool_]:
    """Return which responses (outputs, inputs) are rounding next to all natural frequencies."""
    poles = np.abs(system.poles())
    omega = np.unique(NEAR_POLE * poles[poles > 0.0])
    return negligible(system, np.abs(system.frequency_response(omega if omega.size else np.ones(1))).max(axis=2))


def until_settled(
    systems: Sequence[Linear], known: Sequence[StepInfo | None], zero: Sequence[NDArray[np.bool_]]
) -> float | None:
    """Return the time [s] to show until all responses but those of ``zero`` settle; None if one does not in time."""
    last = 0.0
    for system, info, none in zip(systems, known, zero, strict=True):
        if info is None:
            return None
        counted_pairs = ~none[np.ix_([system.outputs.index(name) for name in info.outputs],
                            [system.inputs.index(name) for name in info.inputs])]  # fmt: skip
        peaks = np.where(info.overshoot > NO_OVERSHOOT, info.peak_time, 0.0)
        last = max(last, *(float(times[counted_pairs].max(initial=0.0)) for times in (info.settling_time, peaks)))
    turns = [abs(value.imag) for system in systems for value in system.poles() if value.imag]
    if not last or (turns and LONGER * last * min(turns) / (2.0 * np.pi) > PERIODS):
        return None
    return LONGER * last


def mark(axes: Axes, info: StepInfo, pair: tuple[str, str], response: Response) -> None:
    """Mark rise, peak and settling of a ``pair`` (output, input), and write them into a corner of its panel."""
    i, j = info.outputs.index(pair[0]), info.inputs.index(pair[1])
    final, settling = float(info.final[i, j]), float(info.settling_time[i, j])
    t, y = response.t * response.time_factor, response.y * response.factor
    towards = np.sign(final) * response.y
    colour, words = style.COLOURS[1], []
    if np.isfinite(info.rise_time[i, j]):
        words.append(f"rise time {_time(info.rise_time[i, j])}")
        for share in RISE:
            if towards.max() >= share * abs(final):
                at = max(int(np.argmax(towards >= share * abs(final))), 1)
                when = np.interp(share * abs(final), towards[at - 1 : at + 1], t[at - 1 : at + 1])
                axes.plot(when, share * final * response.factor, ".", color=colour, markersize=4.5, zorder=2.5)
        over = float(info.overshoot[i, j])
        words.append(f"overshoot {over:.3g} %" if over > NO_OVERSHOOT else "no overshoot")
        if over > NO_OVERSHOOT:
            at, peak = int(np.argmax(towards)), float(info.peak[i, j])
            peak_point = t[at], y[at]
            if abs(towards[at] - peak) < SAMPLED * peak:  # the other extremum may be the larger one
                peak_point = info.peak_time[i, j] * response.time_factor, np.sign(final) * peak * response.factor
            axes.plot(*peak_point, "o", color=colour, markersize=4.5, zorder=2.5)
        low, high = (response.factor * final * (1.0 + side * info.band) for side in (-1.0, 1.0))
        axes.axhspan(low, high, color=colour, alpha=0.15, linewidth=0.0)
    within = settling <= response.t[-1]
    if within:
        axes.axvline(settling * response.time_factor, color=colour, linewidth=0.9, linestyle=(0, (1.5, 1.5)))
    words.append(f"settling time {_time(settling)}" + ("" if within else " (not shown)"))
    height, side = (0.95, "top") if final < 0.0 else (0.05, "bottom")
    axes.text(0.985, height, "\n".join(words), transform=axes.transAxes, ha="right", va=side, fontsize=8.0, zorder=3.0,
              bbox={"facecolor": "white", "alpha": 0.8, "edgecolor": "none", "pad": 1.5})  # fmt: skip


def _time(value: float) -> str:
    """Return a time in words with three digits."""
    factor, unit = units.prefix("s", value)
    return f"{factor * value:.3g} {unit}"
