"""Root loci: poles of the closed loop over a gain, each mode followed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib._checks import shown
from mbsvib._given import mode_index, reals
from mbsvib.errors import ResponseError

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    from mbsvib.isolation.actuated import Active
    from mbsvib.isolation.controller import Controller
    from mbsvib.kinematics import Array

    Complex = NDArray[np.complex128]

HALVINGS = 6
# A step is short if every pole is found within this share of its distance to the nearest other one.
SHORT = 0.3
REAL = 0.05
MOVED = 0.01
ALIKE = 1e-7  # poles in parts of their size that count as one


@dataclass(frozen=True, repr=False, eq=False)
class RootLocus:
    """Poles (n, poles) [1/s] over the ``gains`` (n,), in columns that follow them; those of the open loop first.

    ``modes`` are the columns of poles that start with a positive imaginary part; ``zeros`` (of the pairs that the law
    closes) are where poles go as the gain grows.
    """

    name: str
    gains: Array
    poles: Complex
    zeros: Complex
    modes: NDArray[np.intp]

    @cached_property
    def damping_ratios(self) -> Array:
        """Damping ratios of the modes, (n, modes)."""
        values = self.poles[:, self.modes]
        size = np.abs(values)
        return np.divide(0.0 - values.real, size, out=np.zeros_like(size), where=size > 0.0)

    @cached_property
    def moved(self) -> NDArray[np.bool_]:
        """Whether the gain moves each mode by more than a hundredth of its frequency, (modes,)."""
        values = self.poles[:, self.modes]
        return np.asarray(np.abs(values - values[0]).max(axis=0) > MOVED * np.abs(values[0]))

    @property
    def stable(self) -> NDArray[np.bool_]:
        """Whether nothing grows, at each gain, (n,)."""
        largest = np.abs(self.poles).max(axis=1, keepdims=True)
        return np.asarray((self.poles.real <= 1e-10 * largest).all(axis=1))

    def best(self, mode: int | None = None) -> tuple[float, float]:
        """Return the gain at which a mode, or the least damped one, is damped most, among those that are looked at.

        Parameters
        ----------
        mode : int, optional
            Number of the mode, from 1 as ``print(locus)`` lists them; default: the least damped one at each gain, of
            those that the law moves.

        Returns
        -------
        gain, damping_ratio : float
            The gain and the damping ratio there.

        Raises
        ------
        ResponseError
            If there is no such mode.
        """
        if mode is None:
            return self._best(self.damping_ratios[:, self.moved])
        index = mode_index(mode, "RootLocus.best", len(self.modes), "print(locus)")
        return self._best(self.damping_ratios[:, [index]])

    def _best(self, ratios: Array) -> tuple[float, float]:
        least = np.where(self.stable, ratios.min(axis=1, initial=np.inf), -np.inf)
        at = int(least.argmax())
        return float(self.gains[at]), float(least[at])

    def table(self) -> dict[str, Any]:
        """Return what each mode reaches, and what closed forms promise a mode that keeps its shape.

        Returns
        -------
        dict
            Title, columns, rows and notes, as arguments of ``mbsvib.tables.text`` and ``show``.
        """
        rows = []
        zeros = np.sort(self.zeros.imag[self.zeros.imag > 0.0])
        for mode, column in enumerate(self.modes.tolist(), 1):
            pole = float(np.abs(self.poles[0, column]))
            gain, ratio = self.best(mode)
            # as many zeros as modes interlace with them one by one
            zero = float(zeros[mode - 1]) if len(zeros) == len(self.modes) else 0.0
            promised = f"{50.0 * (pole - zero) / zero:.4g}" if 0.0 < pole / 3.0 < zero < pole else ""
            seen = f"{zero / (2.0 * np.pi):.6g}" if zero else ""
            rows.append(
                (mode, f"{pole / (2.0 * np.pi):.6g}", seen, f"{gain:.4g}", f"{100.0 * ratio:.4g}", promised)
            )
        headers = ("mode", "pole [Hz]", "zero [Hz]", "best gain", "damping ratio [%]", "(pole - zero) / (2 zero) [%]")
        columns = [(header, "right") for header in headers]
        return {"title": f"Root locus: {self.name}", "columns": columns, "rows": rows, "notes": []}

    def __str__(self) -> str:
        from mbsvib import tables

        return tables.text(**self.table())

    def __repr__(self) -> str:
        return f"RootLocus({self.name!r}: {len(self.gains)} gains, {self.poles.shape[1]} poles)"


def root_locus(plant: Active, law: Callable[[float], Controller], gains: ArrayLike) -> RootLocus:
    """Return the poles of closed loops over a gain.

    Parameters
    ----------
    plant : Active
        The mechanism.
    law : callable
        Returns the controller of a gain, ``lambda g: isolation.force_feedback(plant, g)``.
    gains : array-like, shape (n,)
        Ascending gains, from 0 on.

    Returns
    -------
    RootLocus
        Poles that keep their column from gain to gain.

    Raises
    ------
    ResponseError
        If the gains do not ascend.
    """
    from mbsvib.isolation.closed_loop import close
    from mbsvib.isolation.collocation import removable, without

    g = np.atleast_1d(reals(gains, "root_locus", "gains", "two or more, ascending, from 0 on"))
    if not callable(law):
        raise ResponseError(f"root_locus: law = {shown(law)}; expected a function of the gain, such as "
                            f"lambda g: isolation.force_feedback(plant, g).")  # fmt: skip
    if g.ndim != 1 or len(g) < 2 or not np.isfinite(g).all() or g[0] < 0.0 or (np.diff(g) <= 0.0).any():
        raise ResponseError(f"root_locus: gains have shape {g.shape}; expected two or more, ascending, from 0 on.")

    def at(gain: float) -> Complex:
        return close(plant, law(gain)).poles()

    rows = [at(g[0])]
    for low, high in pairwise(g.tolist()):
        rows.append(_followed(at, (low, rows[-1]), (high, at(high)), HALVINGS))
    table = np.array(rows)
    first = close(plant, law(float(g[-1])))
    system = plant.system
    tensions = [name.removesuffix(".actuator") for name in first.actuators]
    forces = set(first.sensors) == {f"{leg}.tension" for leg in tensions} and removable(plant, tensions)
    zeros = without(system, tensions).poles() if forces else system.transmission_zeros(
        first.actuators, first.sensors)  # fmt: skip
    start = table[0]
    largest = np.abs(start).max(initial=0.0)
    modes = np.flatnonzero((start.imag > 0.0) & (np.abs(start) > 1e-9 * largest))
    return RootLocus(first.law.name, g, table, zeros, modes[np.argsort(np.abs(start[modes]), kind="stable")])


def _followed(
    at: Callable[[float], Complex], one: tuple[float, Complex], other: tuple[float, Complex], halvings: int
) -> Complex:
    """Poles at the other gain, in the order of those at the one."""
    from scipy.optimize import linear_sum_assignment

    (low, before), (high, after) = one, other
    distance = np.abs(before[:, None] - after)
    row, column = linear_sum_assignment(distance)
    step = distance[row, column]
    apart = np.abs(after[column][:, None] - after[column])
    size = np.maximum(np.abs(after[column]), 1e-9 * np.abs(after).max(initial=0.0))
    apart[apart <= ALIKE * size[:, None]] = np.inf  # poles that coincide need not be told apart
    # what is overdamped comes together and parts again on the real axis: there are no modes to follow
    waves = (np.abs(before[row].imag) > REAL * size) & (np.abs(after[column].imag) > REAL * size)
    if halvings and (waves & (step > SHORT * apart.min(axis=1, initial=np.inf))).any():
        middle = 0.5 * (low + high)
        between = _followed(at, one, (middle, at(middle)), halvings - 1)
        return _followed(at, (middle, between), other, halvings - 1)
    return np.asarray(after[column])
