"""Filters of outputs before their mean squares: frequency weighting of vibration, averages over time."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array, Complex
from mbsvib.common.display import Displayed
from mbsvib.common.expected import one_of, positive
from mbsvib.common.selection import selected
from mbsvib.elements.ports import MOTION_UNITS
from mbsvib.errors import ResponseError
from mbsvib.responses.densities import Shaped, shaped, table
from mbsvib.responses.from_control import is_control, is_transfer_function
from mbsvib.responses.state_space import StateSpace

# Corner frequencies [Hz] and quality factors of the weightings for health and comfort: band limits f1, f2; transition
# f3, f4, Q4; upward step f5, Q5, f6, Q6, None without
_ISO_2631 = {"Wk": (0.4, 100.0, 12.5, 12.5, 0.63, (2.37, 0.91, 3.35, 0.91)), "Wd": (0.4, 100.0, 2.0, 2.0, 0.63, None)}
NOT_ACCELERATIONS = (*MOTION_UNITS[0], *MOTION_UNITS[1], "N", "N m")
EXPECTED = ("'Wk' or 'Wd', isolation.shaped(numerator, denominator), a stable StateSpace or transfer function of "
            "python-control with one input and one output, at least two pairs (frequency [Hz], gain above 0) in "
            "ascending order, or a function of the frequency [Hz]")  # fmt: skip


@dataclass(frozen=True, repr=False, eq=False)
class Window(Displayed):
    """A time T [s] over which an output is averaged: its ``mean``, or what varies within the time.

    Frequency weights sinc^2(pi f T) and 1 - sinc^2(pi f T) of the density.
    """

    time: float
    """Time T of the average [s]."""
    mean: bool

    def __call__(self, f: Array) -> Array:
        """Return the gains at frequencies (n,) [Hz]."""
        turn = np.pi * f * self.time
        if self.mean:
            return np.asarray(np.sinc(f * self.time))
        small = np.abs(turn) < 0.05  # 1 - sinc^2 cancels there: its series
        square = turn * turn
        series = square / 3.0 * (1.0 - square * (2.0 / 15.0) * (1.0 - square / 14.0 * (1.0 - square * 2.0 / 45.0)))
        return np.sqrt(np.where(small, series, 1.0 - np.sinc(f * self.time) ** 2))


def moving_average(time: float) -> Window:
    """Return the mean over a time as a weighting: the error that settles during an exposure or a dwell.

    Parameters
    ----------
    time : float
        T [s].

    Returns
    -------
    Window
        A ``weighting`` of ``rms``, ``psd`` and ``budget``: sinc^2(pi f T).

    Raises
    ------
    ResponseError
        If the time is not positive.

    Source: Lucke, Sirlin & San Martin, J. Astronautical Sci. 40 (1992) 557: displacement, smear and jitter.
    """
    return Window(positive("moving_average", "time", time, "a time [s]"), True)


def moving_deviation(time: float) -> Window:
    """Return what varies within a time as a weighting: the jitter during an exposure or a dwell.

    Parameters
    ----------
    time : float
        T [s].

    Returns
    -------
    Window
        A ``weighting`` of ``rms``, ``psd`` and ``budget``: 1 - sinc^2(pi f T). Its square and that of the
        ``moving_average`` add up to the mean square.

    Raises
    ------
    ResponseError
        If the time is not positive.

    Source: Lucke, Sirlin & San Martin, J. Astronautical Sci. 40 (1992) 557: displacement, smear and jitter.
    """
    return Window(positive("moving_deviation", "time", time, "a time [s]"), False)


@dataclass(frozen=True, repr=False, eq=False)
class Integrated(Displayed):
    """An output integrated over time so many ``times``, frequency by frequency: gains 1/(2 pi i f)^times."""

    times: int

    def __call__(self, f: Array) -> Complex:
        """Return the gains at frequencies (n,) [Hz]."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray((2j * np.pi * f) ** -float(self.times))

    def unit(self, given: str) -> str:
        """Return the unit of the integral of an output.

        Parameters
        ----------
        given : str
            Unit of the output.

        Returns
        -------
        str
            The unit, times seconds.
        """
        for _ in range(self.times):
            given = {"m/s^2": "m/s", "m/s": "m", "rad/s^2": "rad/s", "rad/s": "rad"}.get(given, f"{given} s")
        return given


def integrated(times: int = 2) -> Integrated:
    """Return the integral of an output over time as a weighting: absolute displacements from absolute accelerations.

    Displacements beside base motion are relative to the base, which itself goes anywhere; an acceleration with
    ``absolute=True``, integrated twice, is the displacement in space as far as the noise has a first frequency.

    Parameters
    ----------
    times : int
        1: velocities of accelerations; 2: displacements.

    Returns
    -------
    Integrated
        A ``weighting`` of ``rms``, ``psd`` and ``budget``: |2 pi f|^(-2 times). The unit of the output changes with it.

    Raises
    ------
    ResponseError
        If it is neither once nor twice.
    """
    if times not in (1, 2) or isinstance(times, bool):
        raise ResponseError(f"integrated: times = {check.shown(times)}; expected 1 or 2.")
    return Integrated(int(times))


@dataclass(frozen=True, eq=False)
class Weight:
    """A filter of an output: rational (``filter``), or a ``function`` of frequencies (n,) [Hz] that returns gains; that
    of a table is not smooth at its ``breaks`` [Hz].
    """

    name: str
    filter: Shaped | None = None
    function: Callable[[Array], ArrayLike] | None = None
    breaks: Array = field(default_factory=lambda: np.zeros(0))

    def unit(self, given: str) -> str:
        """Return the unit of the weighted output, for a ``given`` unit of the output."""
        return self.function.unit(given) if isinstance(self.function, Integrated) else given

    def check_unit(self, output: str, unit: str) -> None:
        """Refuse a weighting of ISO 2631-1, by its name, of an ``output`` in a unit that no acceleration has."""
        if self.name in _ISO_2631 and unit in NOT_ACCELERATIONS:
            raise ResponseError(f"weighting '{self.name}': the output '{output}' is in {unit}, and ISO 2631-1 weights "
                                f"accelerations. Weight outputs of acceleration alone; in Python, "
                                f"isolation.iso_2631('{self.name}') is the filter for any output.")  # fmt: skip

    @property
    def words(self) -> str:
        """What it is, as tables and figures call it."""
        if isinstance(self.function, Window):
            return f"{'mean over' if self.function.mean else 'deviation within'} {self.function.time:g} s"
        if isinstance(self.function, Integrated):
            return "integral over time" if self.function.times == 1 else "double integral over time"
        if len(self.breaks):
            return "table"
        return self.name if self.name in _ISO_2631 else "filter" if self.filter is not None else "function of f"

    @property
    def known(self) -> bool:
        """Whether its poles, times and breaks tell how it varies with the frequency."""
        return self.filter is not None or isinstance(self.function, (Window, Integrated)) or len(self.breaks) > 0

    @property
    def window(self) -> Window | None:
        """The time over which the output is averaged, None for other weights."""
        return self.function if isinstance(self.function, Window) else None

    @property
    def poles(self) -> Complex:
        """Poles of the filter [1/s]."""
        if self.filter is None:
            return np.zeros(int(isinstance(self.function, Integrated)), dtype=complex)
        return self.filter.poles

    def at(self, f: Array) -> Complex:
        """Return the gains (n,) at frequencies [Hz]."""
        if self.filter is not None:
            return self.filter.response(np.asarray(2j * np.pi * f, dtype=complex))
        assert self.function is not None
        gain = np.asarray(self.function(f), dtype=complex)
        if gain.shape != f.shape or not (self.known or np.isfinite(gain).all()):
            raise ResponseError(f"weighting {self.name}: the function returns the shape {gain.shape} for {len(f)} "
                                f"frequencies, or what is not finite; expected one gain for each.")  # fmt: skip
        return gain


def iso_2631(name: str) -> Shaped:
    """Return a frequency weighting of accelerations for health and comfort.

    H(s) = band limit x transition x upward step, of second order each

    Parameters
    ----------
    name : str
        "Wk", for vertical vibration of seats, or "Wd", for horizontal vibration.

    Returns
    -------
    Shaped
        The filter, as ``weighting`` of ``rms``, ``psd`` and ``budget``.

    Raises
    ------
    ResponseError
        If there is no such weighting.

    Source: ISO 2631-1:1997, table 3 and annex A.
    """
    f1, f2, f3, f4, q4, step = _ISO_2631[one_of(name, _ISO_2631, "iso_2631", "name")]
    w1, w2, w3, w4 = (2.0 * np.pi * f for f in (f1, f2, f3, f4))
    numerator = np.polymul([1.0, 0.0, 0.0], [w4**2 / w3, w4**2])
    denominator = np.polymul(np.polymul([1.0, np.sqrt(2.0) * w1, w1**2], [1.0, np.sqrt(2.0) * w2, w2**2]),
                             [1.0, w4 / q4, w4**2])  # fmt: skip
    gain = w2**2
    if step is not None:
        w5, q5, w6, q6 = 2.0 * np.pi * step[0], step[1], 2.0 * np.pi * step[2], step[3]
        numerator = np.polymul(numerator, [1.0, w5 / q5, w5**2])
        denominator = np.polymul(denominator, [1.0, w6 / q6, w6**2])
    return shaped(gain * numerator, denominator)


def weights(weighting: Any, outputs: tuple[str, ...], name: str) -> tuple[Weight | None, ...]:
    """Return the filter of each of some outputs of the equations ``name``, None for none.

    ``weighting``: one for all outputs, or a mapping of names or patterns; each ``EXPECTED``, or what
    ``moving_average``, ``moving_deviation`` and ``integrated`` make.
    """
    if weighting is None:
        return (None,) * len(outputs)
    if not isinstance(weighting, Mapping):
        return (_weight(weighting, "of all outputs"),) * len(outputs)
    result: list[Weight | None] = [None] * len(outputs)
    for pattern, value in weighting.items():
        one = _weight(value, f"of '{pattern}'")
        for k in selected(pattern, outputs, "output", name):
            if result[k] is not None:
                raise ResponseError(f"weighting: the output '{outputs[k]}' has two, the second by '{pattern}'; give "
                                    f"one of them.")  # fmt: skip
            result[k] = one
    return tuple(result)


def _weight(value: Any, name: str) -> Weight:
    if isinstance(value, str):
        return Weight(value, iso_2631(value))
    if is_control(value) or is_transfer_function(value):
        value = StateSpace.from_control(value)
    if isinstance(value, StateSpace):
        growing = (np.linalg.eigvals(value.A).real >= 0.0).any()
        if value.D.shape != (1, 1) or growing:
            fault = "has a pole that does not decay" if growing else f"has the shape {value.D.shape}"
            raise ResponseError(f"weighting {name}: '{value.name}' {fault}; expected {EXPECTED}.")
        value = Shaped(1.0, value.A, value.B, value.C, float(value.D[0, 0]))
    if isinstance(value, Shaped):
        return Weight(name, value)
    if callable(value):
        return Weight(name, function=value)
    try:
        gains = table(value, f"weighting {name}")
    except ResponseError:
        raise ResponseError(f"weighting {name}: {check.shown(value)}; expected {EXPECTED}.") from None
    return Weight(name, function=gains.at, breaks=gains.breaks)
