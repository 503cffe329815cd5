"""Poles of the closed loop over a gain, each mode followed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mbsvib.common.arguments import shown
from mbsvib.common.arrays import Array, Complex
from mbsvib.common.columnar import Columnar, numbered
from mbsvib.common.display import Displayed
from mbsvib.common.expected import ascending, mode_index
from mbsvib.errors import ResponseError
from mbsvib.feedback.controller import Controller
from mbsvib.feedback.pole_track import Track, has_moved, least_damping, ratios
from mbsvib.isolation.actuated import Active, check_plant
from mbsvib.isolation.collocation import removable, without


@dataclass(frozen=True, repr=False, eq=False)
class RootLocus(Columnar, Displayed):
    """Poles (n, poles) [1/s] over the ``gains`` (n,), in columns that follow them; those of the open loop first.

    ``modes`` are the columns of poles that start with a positive imaginary part; ``zeros`` (of the pairs that the
    controller closes) are where poles go as the gain grows. ``curves`` (more, poles) are the same poles at more gains,
    and ``best_poles`` (poles,) those at the best one. ``stable`` (n,): whether the loop is stable at each gain.
    """

    name: str
    """Name of the controller."""
    gains: Array
    poles: Complex
    zeros: Complex
    modes: NDArray[np.intp]
    curves: Complex
    best_poles: Complex
    stable: NDArray[np.bool_]
    _optima: tuple[tuple[float, float], ...]

    def columns(self) -> dict[str, NDArray[Any]]:
        """Return a row for each gain: whether it is stable, and real and imaginary parts [1/s] of poles 1, 2, ..."""
        parts = {"pole_re": self.poles.real, "pole_im": self.poles.imag}
        return {"gain": self.gains, "stable": self.stable, **numbered(parts)}

    @cached_property
    def damping_ratios(self) -> Array:
        """Damping ratios of the modes, (n, modes)."""
        return ratios(self.poles[:, self.modes])

    @cached_property
    def moved(self) -> NDArray[np.bool_]:
        """Whether the gain moves each mode by more than a hundredth of its frequency, (modes,)."""
        return has_moved(self.poles)[self.modes]

    def best(self, mode: int | None = None) -> tuple[float, float]:
        """Return the gain at which a mode, or the least damped vibration, is damped most.

        Parameters
        ----------
        mode : int, optional
            Number of the mode, from 1 as ``print(locus)`` lists them; default: what vibrates with the least damping at
            each gain, modes or poles of the controller, of all that it moves.

        Returns
        -------
        gain, damping_ratio : float
            The gain, between the first and the last one of the locus, and the damping ratio there: 1 where nothing that
            the controller moves vibrates any more.

        Raises
        ------
        ResponseError
            If there is no such mode.
        """
        index = -1 if mode is None else mode_index(mode, "RootLocus.best", len(self.modes), "print(locus)")
        return self._optima[index]

    def summary(self, scale: float = 1.0) -> tuple[str, str]:
        """Return the effect of the best gain on all oscillating poles, in two lines.

        Parameters
        ----------
        scale : float
            What gains are multiplied by.

        Returns
        -------
        tuple of str
            The smallest damping with open loops and at the best gain; this gain, and the modes that hardly move.
        """
        gain, ratio = self.best()
        stays, unmoved = self.modes[~self.moved], ""
        if len(stays):
            change = _change(*(float(ratios(poles[stays]).min()) for poles in (self.poles[0], self.best_poles)))
            unmoved = f"{len(stays)} of {len(self.modes)} modes hardly move: {change}"
        if not has_moved(self.poles).any() or not np.isfinite(ratio):
            return "no pole moves" if np.isfinite(ratio) else "not stable at any gain", unmoved
        before = float(least_damping(self.poles[:1], has_moved(self.poles))[0])
        where = f"at gain {scale * gain:.4g}" + (", the largest gain given" if gain == self.gains[-1] else "")
        return f"least damping {_change(before, ratio)}", "; ".join(filter(None, (where, unmoved)))

    def table(self) -> dict[str, Any]:
        """Return what each mode reaches, and what closed forms promise a mode that keeps its shape, as arguments of
        ``mbsvib.common.tables.text`` and ``show``.
        """
        rows: list[tuple[Any, ...]] = []
        zeros = self._zeros()
        for mode, column in enumerate(self.modes.tolist(), 1):
            pole, zero = float(np.abs(self.poles[0, column])), zeros.get(mode - 1, 0.0)
            zero_text = f"{zero / (2.0 * np.pi):.6g}" if zero else ""
            gain, ratio = self.best(mode)
            best, damping = f"{gain:.4g}", f"{100.0 * ratio:.4g}"
            if not self.moved[mode - 1]:
                best = "hardly moves"
            elif np.isneginf(ratio):
                best, damping = "not stable", ""
            closed = self.moved[mode - 1] and 0.0 < pole / 3.0 < zero < pole
            promised = f"{50.0 * (pole - zero) / zero:.4g}" if closed else ""
            rows.append((mode, f"{pole / (2.0 * np.pi):.6g}", zero_text, best, damping, promised))
        headers = ("mode", "pole [Hz]", "zero [Hz]", "best gain", "damping ratio [%]", "(pole - zero) / (2 zero) [%]")
        columns = [(header, "right") for header in headers]
        words = " ".join(self.summary()).strip()
        return {"title": f"Root locus: {self.name}", "columns": columns, "rows": rows,
                "notes": [f"{words[0].upper()}{words[1:]}."]}  # fmt: skip

    def _zeros(self) -> dict[int, float]:
        """The zero [rad/s] of each mode, if there are as many: modes that do not move coincide with theirs, the others
        interlace with the remaining zeros.
        """
        remaining = np.sort(self.zeros.imag[self.zeros.imag > 0.0])
        if len(remaining) != len(self.modes):
            return {}
        result = {}
        for mode in np.flatnonzero(~self.moved).tolist():
            at = int(np.abs(remaining - np.abs(self.poles[0, self.modes[mode]])).argmin())
            result[mode] = float(remaining[at])
            remaining = np.delete(remaining, at)
        return result | dict(zip(np.flatnonzero(self.moved).tolist(), remaining.tolist(), strict=True))

    def __repr__(self) -> str:
        return f"RootLocus({self.name!r}: {len(self.gains)} gains, {self.poles.shape[1]} poles)"


def root_locus(plant: Active, law: Callable[[float], Controller], gains: ArrayLike) -> RootLocus:
    """Return the poles of closed loops over a gain.

    Parameters
    ----------
    plant : Active
        The mechanism.
    law : callable
        Returns the controller of a gain, ``lambda g: isolation.force_feedback(plant, g)``, with the same states at all
        gains.
    gains : array-like, shape (n,)
        Ascending gains, from 0 on.

    Returns
    -------
    RootLocus
        Poles that keep their column from gain to gain, whatever the gains are. Where a pair meets on the real axis,
        the one with the positive imaginary part goes on as the right one of the two real poles.

    Raises
    ------
    ResponseError
        If the gains do not ascend, or the controller has not the same states at all of them.
    """
    check_plant(plant, "root_locus")
    g = ascending(gains, "root_locus", "gains", "two or more, ascending, from 0 on", least=0.0, count=2)
    if not callable(law):
        raise ResponseError(f"root_locus: law = {shown(law)}; expected a function of the gain, such as "
                            f"lambda g: isolation.force_feedback(plant, g).")  # fmt: skip
    count = len(plant.with_gains(law(float(g[0]))).state_space().A)

    def matrix(gain: float) -> Array:
        result: Array = plant.with_gains(law(gain)).state_space().A
        if len(result) != count:
            raise ResponseError(f"root_locus: the loop has {count} states at the gain {g[0]:g} and {len(result)} at "
                                f"{gain:g}; expected a controller with the same states at all gains.")  # fmt: skip
        return result

    track = Track(matrix, g)
    track.refine()
    table = track.poles
    first = plant.with_gains(law(float(g[-1])))
    system = plant.system
    tensions = [name.removesuffix(".actuator") for name in first.actuators]
    force_feedback = set(first.sensors) == {f"{leg}.force" for leg in tensions} and removable(plant, tensions)
    zeros = without(system, tensions).poles() if force_feedback else system.transmission_zeros(
        first.sensors, first.actuators)  # fmt: skip
    start = table[0]
    modes = np.flatnonzero((start.imag > 0.0) & (np.abs(start) > track.errors(float(g[0]))))
    modes = modes[np.argsort(np.abs(start[modes]), kind="stable")]
    moving = has_moved(table)
    gain, ratio, poles = track.highest(lambda poles: least_damping(poles, moving))
    optima = [track.highest(lambda poles, column=column: ratios(poles[:, column]))[:2] if moving[column]  # type: ignore[misc]
              else (float(g[0]), float(ratios(start[[column]])[0])) for column in modes.tolist()]  # fmt: skip
    return RootLocus(first.law.name, g, table, zeros, modes, track.curves, poles,
                     np.array([track.stable(gain) for gain in g.tolist()]), (*optima, (gain, ratio)))  # fmt: skip


def _change(before: float, after: float) -> str:
    """Two damping ratios in words, one if they read the same."""
    words = [f"{100.0 * ratio:.3g} %" if ratio < 1.0 else "overdamped" for ratio in (before, after)]
    return " → ".join(dict.fromkeys(words))
