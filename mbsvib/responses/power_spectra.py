"""Power spectral densities of noise: tables, white noise, filtered white noise, and several of these at once.

All are one-sided and per Hz, as for floor vibration: the mean square is their integral from 0 to infinity.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.errors import ResponseError, nearest

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from mbsvib.common.arrays import Array, Complex


DIRECTIONS = check.DIRECTIONS
SEMIDEFINITE = 1e-9  # a correlation matrix typed with so many digits may be indefinite by its rounding


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """A density over ``frequencies`` [Hz]: straight between its break-points on log-log axes, zero beyond them."""

    frequencies: Array
    values: Array

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
        """
        f = np.asarray(frequencies, dtype=float)
        inside = (f >= self.frequencies[0]) & (f <= self.frequencies[-1])
        result = np.zeros_like(f)
        result[inside] = np.exp(np.interp(np.log(f[inside]), np.log(self.frequencies), np.log(self.values)))
        return result


@dataclass(frozen=True, slots=True, eq=False)
class Shaped:
    """White noise of the one-sided density ``level`` through the filter H = c (s - a)^-1 b + d: ``level`` |H|^2."""

    level: float
    a: Array
    b: Array
    c: Array
    d: float

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
        """
        f = np.asarray(frequencies, dtype=float)
        if not len(self.a):
            return np.full_like(f, self.level * self.d**2)
        s = 2j * np.pi * f[..., None, None]
        h = (self.c @ np.linalg.solve(s * np.eye(len(self.a)) - self.a, self.b))[..., 0, 0] + self.d
        return np.asarray(self.level * np.abs(h) ** 2)

    @property
    def poles(self) -> Complex:
        """Poles of the filter [1/s]."""
        return np.linalg.eigvals(self.a).astype(complex) if len(self.a) else np.zeros(0, dtype=complex)


@dataclass(frozen=True, slots=True, eq=False)
class BaseNoise:
    """Base excitation: a density for each of the ``directions``, S_ij = R_ij sqrt(S_i S_j) with the Hermitian
    ``correlation`` R.
    """

    directions: tuple[str, ...]
    spectra: tuple[Table | Shaped, ...]
    correlation: Complex

    def at(self, frequencies: Array) -> Complex:
        """Return the matrix of densities.

        Parameters
        ----------
        frequencies : array, shape (n,)
            Frequencies [Hz].

        Returns
        -------
        array, shape (n, directions, directions)
            One-sided densities, cross-densities off the diagonal.
        """
        root = np.sqrt([spectrum.at(frequencies) for spectrum in self.spectra])
        return np.asarray(np.einsum("in,jn,ij->nij", root, root, self.correlation))

    @property
    def breaks(self) -> Array:
        """Frequencies [Hz] at which tables have their break-points."""
        grids = [spectrum.frequencies for spectrum in self.spectra if isinstance(spectrum, Table)]
        return np.unique(np.concatenate(grids)) if grids else np.zeros(0)

    @property
    def unbounded(self) -> bool:
        """Whether some spectrum extends to infinite frequency."""
        return any(isinstance(spectrum, Shaped) for spectrum in self.spectra)

    @property
    def poles(self) -> Complex:
        """Poles of the filters [1/s]."""
        return np.concatenate([s.poles for s in self.spectra if isinstance(s, Shaped)] or [np.zeros(0, dtype=complex)])

    @property
    def filters(self) -> tuple[Shaped, ...] | None:
        """The filters, if all spectra are filtered white noise with real correlation, so that moments are exact."""
        shaped = tuple([s for s in self.spectra if isinstance(s, Shaped)])
        alike = len(shaped) == len(self.spectra) and not self.correlation.imag.any()
        if alike and not np.array_equal(self.correlation, np.eye(len(shaped))):
            # correlated axes share their noise: S_ij = R_ij sqrt(S_i S_j) holds for one and the same filter
            alike = all(np.array_equal(getattr(s, part), getattr(shaped[0], part)) for s in shaped for part in "abcd")
        return shaped if alike else None


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
    return Shaped(_level(level), np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), 1.0)


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
        If the filter is not proper or not stable.
    """
    top = np.trim_zeros(np.atleast_1d(np.asarray(numerator, dtype=float)), "f")
    below = np.trim_zeros(np.atleast_1d(np.asarray(denominator, dtype=float)), "f")
    if not len(below) or len(top) > len(below) or not (np.isfinite(top).all() and np.isfinite(below).all()):
        raise ResponseError(f"shaped: numerator has degree {len(top) - 1}, denominator {len(below) - 1}; expected "
                            f"finite coefficients, and no higher degree above: the filter must be proper.")  # fmt: skip
    n = len(below) - 1
    below, top = below / below[0], np.concatenate((np.zeros(len(below) - len(top)), top)) / below[0]
    # time in units of the filter's mean pole, so that the companion matrix has entries of one size
    unit = abs(below[-1]) ** (1.0 / n) if n and below[-1] else 1.0
    powers = unit ** -np.arange(n + 1.0)
    below, top = below * powers, top * powers
    a = np.zeros((n, n))
    a[1:, :-1] = np.eye(max(n - 1, 0))
    if n:
        a[0] = -below[1:]
    if n and np.linalg.eigvals(a).real.max() >= 0.0:
        raise ResponseError(f"shaped: the filter with denominator {check.shown(denominator)} is not stable; expected "
                            f"roots with negative real parts, or the noise would have no mean square.")  # fmt: skip
    b = np.zeros((n, 1))
    b[:1] = 1.0
    level = _level(level, "shaped noise")
    return Shaped(level, a * unit, b * unit, (top[1:] - top[0] * below[1:])[None, :], float(top[0]))


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
    try:
        rows = np.asarray(points, dtype=float)
    except (TypeError, ValueError) as error:
        raise ResponseError(f"{name}: {check.shown(points)}; expected {expected}.") from error
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


def base_noise(
    spectra: BaseNoise | Mapping[str, Any], directions: tuple[str, ...] = DIRECTIONS,
    correlation: ArrayLike | None = None,
) -> BaseNoise:  # fmt: skip
    """Return the base excitation.

    Parameters
    ----------
    spectra : mapping of str to float, array-like or Shaped
        One-sided acceleration density by direction: a number is white noise, pairs (frequency [Hz], density) are a
        table; ``white`` and ``shaped`` make others. Several directions may share one, ``{"x y z": 1e-6}``.
    directions : tuple of str
        Those in which the base can be shaken.
    correlation : array-like, shape (n, n), optional
        Hermitian matrix with ones on its diagonal, in the order of the spectra; default: independent.

    Returns
    -------
    BaseNoise
        Spectra and their correlation.

    Raises
    ------
    ResponseError
        If a direction is unknown or named twice, a spectrum is refused, or no noise has such a correlation.
    """
    if isinstance(spectra, BaseNoise):
        return spectra
    if not isinstance(spectra, Mapping) or not spectra:
        raise ResponseError(f"base: spectra = {check.shown(spectra)}; expected a density for each direction, such as "
                            f"{{'z': [(1, 1e-6), (100, 1e-4)]}} in (m/s^2)^2/Hz.")  # fmt: skip
    densities: dict[str, Table | Shaped] = {}
    for names, density in spectra.items():
        for name in str(names).split():
            if name not in directions:
                raise ResponseError(f"base: there is no direction '{name}' to shake it in."
                                    f"{nearest(name, directions)} Directions: {' '.join(directions)}.")  # fmt: skip
            if name in densities:
                raise ResponseError(f"base: direction '{name}' has two spectra; give one of them.")
            densities[name] = _spectrum(density, f"base {name}")
    n = len(densities)
    matrix = np.eye(n, dtype=complex) if correlation is None else np.asarray(correlation, dtype=complex)
    if matrix.shape != (n, n) or not np.isfinite(matrix).all():
        raise ResponseError(f"base: correlation has shape {matrix.shape}; expected ({n}, {n}), finite, for the "
                            f"directions {' '.join(densities)}.")  # fmt: skip
    hermitian = np.abs(matrix - matrix.conj().T).max() <= SEMIDEFINITE
    normalized = np.abs(matrix.diagonal() - 1.0).max() <= 1e-12
    if not (hermitian and normalized) or np.linalg.eigvalsh(matrix)[0] < -SEMIDEFINITE:
        raise ResponseError("base: correlation is not that of any noise; expected a Hermitian matrix, ones on its "
                            "diagonal, no negative eigenvalue (all motions of one source: all entries 1).")  # fmt: skip
    return BaseNoise(tuple(densities), tuple(densities.values()), matrix)


def _spectrum(density: Any, name: str) -> Table | Shaped:
    if isinstance(density, (Table, Shaped)):
        return density
    if isinstance(density, (int, float, np.floating, np.integer)):
        return Shaped(_level(density, name), np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), 1.0)
    return table(density, name)


def _level(value: Any, name: str = "white noise") -> float:
    try:
        level = float(value)
    except (TypeError, ValueError) as error:
        raise ResponseError(f"{name}: level = {value!r}; expected a density, no less than 0.") from error
    if not 0.0 <= level < np.inf:
        raise ResponseError(f"{name}: level = {level:g}; expected a density, no less than 0.")
    return level
