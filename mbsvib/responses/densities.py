"""Power spectral densities: tables, white noise through filters, and functions of the frequency.

All are one-sided and per Hz: the mean square is their integral from 0 to infinity. ``unit`` is that of the signal,
where it is known.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array, Complex
from mbsvib.common.display import Displayed
from mbsvib.common.expected import real, reals
from mbsvib.errors import ResponseError
from mbsvib.linalg.bands import within
from mbsvib.linalg.rank import DECAYS
from mbsvib.responses.from_control import realized


class Spectrum(Displayed):
    """A one-sided density, at all frequencies unless it says otherwise."""

    __slots__ = ()

    @property
    def filter(self) -> Shaped | None:
        """The filter of white noise, None of other noise."""
        return None

    @property
    def poles(self) -> Complex:
        """Poles of the filter [1/s]."""
        return np.zeros(0, dtype=complex)

    @property
    def span(self) -> tuple[float, float]:
        """First and last frequency [Hz] at which there may be noise."""
        return 0.0, np.inf

    @property
    def breaks(self) -> Array:
        """Frequencies [Hz] at which it is known not to be smooth."""
        return np.zeros(0)

    def at(self, frequencies: Array) -> Array:
        """Return the density.

        Parameters
        ----------
        frequencies : array, shape (n,)
            Frequencies [Hz].

        Returns
        -------
        array, shape (n,)
            One-sided densities.

        Raises
        ------
        ResponseError
            If a function returns another shape, or what no density is.
        """
        return self._values(reals(frequencies, "density", "frequencies", "numbers [Hz]"))

    @abstractmethod
    def _values(self, f: Array) -> Array:
        """Densities at frequencies [Hz]."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Table(Spectrum):
    """A density over ``frequencies`` [Hz]: straight between its break-points on log-log axes, zero beyond them."""

    frequencies: Array
    values: Array
    """One-sided densities (n,) at the break-points [unit^2/Hz]."""
    unit: str = ""
    """Unit of the signal, empty where it may have any."""

    @property
    def span(self) -> tuple[float, float]:
        """First and last frequency [Hz] at which there is noise."""
        return float(self.frequencies[0]), float(self.frequencies[-1])

    @property
    def breaks(self) -> Array:
        """Frequencies [Hz] at which it is not smooth."""
        return self.frequencies

    def _values(self, f: Array) -> Array:
        inside = within(f, *self.span)
        result = np.zeros_like(f)
        result[inside] = np.exp(np.interp(np.log(f[inside]), np.log(self.frequencies), np.log(self.values)))
        return result


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Shaped(Spectrum):
    """White noise of the one-sided density ``level`` through the filter H = c (s - a)^-1 b + d: ``level`` |H|^2."""

    level: float
    a: Array
    b: Array
    c: Array
    d: float
    unit: str = ""
    """Unit of the signal, empty where it may have any."""

    @property
    def filter(self) -> Shaped:
        """Itself: its mean squares are exact by a Lyapunov equation."""
        return self

    def alike(self, other: Shaped) -> bool:
        """Return whether another filter is the same, the level aside.

        Parameters
        ----------
        other : Shaped
            The other one.

        Returns
        -------
        bool
            Whether A, B, C and D are equal.
        """
        return all(np.array_equal(getattr(self, part), getattr(other, part)) for part in "abcd")

    def _values(self, f: Array) -> Array:
        return np.asarray(self.level * np.abs(self.response((2j * np.pi * f).astype(complex))) ** 2)

    def response(self, s: Complex) -> Complex:
        """Return the transfer function of the filter.

        Parameters
        ----------
        s : array, shape (n,)
            Points [1/s].

        Returns
        -------
        array, shape (n,)
            H(s).
        """
        if not len(self.a):
            return np.full(np.shape(s), self.d, dtype=complex)
        x = np.linalg.solve(s[..., None, None] * np.eye(len(self.a)) - self.a, self.b)
        return np.asarray((self.c @ x)[..., 0, 0] + self.d)

    @property
    def poles(self) -> Complex:
        """Poles of the filter [1/s]."""
        return np.linalg.eigvals(self.a).astype(complex) if len(self.a) else np.zeros(0, dtype=complex)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Density(Spectrum):
    """A density by a ``function`` of the frequencies (n,) [Hz], at all of them."""

    function: Callable[[Array], ArrayLike]
    name: str = "density"
    unit: str = ""

    def _values(self, f: Array) -> Array:
        result = reals(self.function(f), self.name, "values of the function", "one real density for each frequency")
        if result.shape != f.shape:
            raise ResponseError(f"{self.name}: the function returns the shape {result.shape} for {len(f)} frequencies; "
                                f"expected one density for each, ({len(f)},).")  # fmt: skip
        wrong = np.flatnonzero(~(np.isfinite(result) & (result >= 0.0)))
        if len(wrong):
            raise ResponseError(f"{self.name}: the function returns {result[wrong[0]]:g} at {f[wrong[0]]:g} Hz; "
                                f"expected a finite density, no less than 0.")  # fmt: skip
        return result


def density(value: Any, name: str) -> Table | Shaped | Density:
    """Return a density of a number (white noise), of pairs (frequency [Hz], density), of a function, or as it is."""
    if isinstance(value, (Table, Shaped, Density)):
        return value
    if isinstance(value, (int, float, np.floating, np.integer)):
        return white(density_level(value, name))
    if value is None or isinstance(value, str):
        raise ResponseError(f"{name}: {check.shown(value)}; expected a number (white noise), pairs (frequency [Hz], "
                            f"density), a function of the frequency, or a density such as "
                            f"isolation.vc_spectrum('VC-C').")  # fmt: skip
    return Density(value, name) if callable(value) else table(value, name)


def white(level: float) -> Shaped:
    """Return white noise.

    Parameters
    ----------
    level : float
        One-sided density, of translations [(m/s^2)^2/Hz], of rotations [(rad/s^2)^2/Hz].

    Returns
    -------
    Shaped
        The same density at all frequencies.

    Raises
    ------
    ResponseError
        If the level is negative or no number.
    """
    return Shaped(density_level(level), np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), 1.0)


def shaped(numerator: ArrayLike, denominator: ArrayLike, level: float = 1.0) -> Shaped:
    """Return filtered white noise, level |H(i w)|^2 with H = numerator / denominator.

    Parameters
    ----------
    numerator, denominator : array-like, shape (n,)
        Coefficients of the polynomials in s, the highest power first.
    level : float
        One-sided density of the white noise before the filter.

    Returns
    -------
    Shaped
        The density.

    Raises
    ------
    ResponseError
        If coefficients are no finite numbers, or the filter is not proper or not stable.
    """
    top, below = (_coefficients(value, name) for name, value in (("numerator", numerator),
                                                                 ("denominator", denominator)))  # fmt: skip
    if not len(below) or len(top) > len(below) or not (np.isfinite(top).all() and np.isfinite(below).all()):
        raise ResponseError(f"shaped: numerator has degree {len(top) - 1}, denominator {len(below) - 1}; expected "
                            f"finite coefficients, and no higher degree above: the filter must be proper.")  # fmt: skip
    n = len(below) - 1
    # time in units of the filter's mean pole, so that the companion matrix has entries of one size
    unit = abs(below[-1] / below[0]) ** (1.0 / n) if n and below[-1] else 1.0
    powers = unit ** -np.arange(n + 1.0)
    top, below = top * powers[len(below) - len(top) :], below * powers
    poles = np.roots(below)
    if (poles.real >= -DECAYS * np.abs(poles)).any():
        raise ResponseError(f"shaped: the filter with denominator {check.shown(denominator)} is not stable; expected "
                            f"roots with negative real parts, or the noise would have no mean square.")  # fmt: skip
    a, b, c, d = realized([[top]], [[below]], "shaped")
    return Shaped(density_level(level, "shaped noise"), a * unit, b * unit, c, float(d[0, 0]))


def _coefficients(value: ArrayLike, name: str) -> Array:
    result = np.atleast_1d(reals(value, "shaped", name, "coefficients of s, the highest power first"))
    if result.ndim > 1:
        raise ResponseError(f"shaped: {name} has shape {result.shape}; expected a row of coefficients of s.")
    return np.asarray(np.trim_zeros(result, "f"))


def table(points: ArrayLike, name: str = "spectrum") -> Table:
    """Return a density from its break-points.

    Parameters
    ----------
    points : array-like, shape (n, 2)
        Frequency [Hz] and one-sided density of each break-point, frequencies ascending.
    name : str
        Name of the quantity, for messages.

    Returns
    -------
    Table
        Straight lines on log-log axes between the points, zero beyond.

    Raises
    ------
    ResponseError
        If there are fewer than two points, frequencies do not ascend from above 0, or a density is not positive.
    """
    expected = "at least two pairs (frequency [Hz], density)"
    rows = reals(points, name, "points", expected)
    if rows.ndim != 2 or rows.shape[1] != 2 or len(rows) < 2 or not np.isfinite(rows).all():
        raise ResponseError(f"{name}: {check.shown(points)}; expected {expected}, all finite.")
    f, values = rows.T.copy()
    out_of_order = np.flatnonzero(np.diff(f) <= 0.0)
    if f[0] <= 0.0 or len(out_of_order):
        at = 0 if f[0] <= 0.0 else int(out_of_order[0]) + 1
        raise ResponseError(f"{name}: point {at + 1} is at {f[at]:g} Hz; expected frequencies above 0 Hz, each higher "
                            f"than the one before: sort them, and leave out 0 Hz.")  # fmt: skip
    low = np.flatnonzero(values <= 0.0)
    if len(low):
        raise ResponseError(f"{name}: the density at {f[low[0]]:g} Hz is {values[low[0]]:g}; expected a positive one, "
                            f"since it is a mean square and is interpolated on log-log axes. Give the least one that "
                            f"matters, or end the table there.")  # fmt: skip
    return Table(f, values)


def density_level(value: Any, name: str = "white noise") -> float:
    """Return a level of white noise as a float, refused if it is negative or not finite."""
    return real(value, name, "level", "a density, no less than 0", 0.0)
