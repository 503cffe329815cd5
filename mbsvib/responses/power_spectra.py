"""Power spectral densities of noise: tables, white noise, filtered white noise, and several of these at once.

All are one-sided and per Hz, as for floor vibration: the mean square is their integral from 0 to infinity.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.display import Displayed
from mbsvib.errors import ResponseError, nearest
from mbsvib.responses.densities import Shaped, Table, density_level, table

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from mbsvib.common.arrays import Array, Complex


DIRECTIONS = check.DIRECTIONS
SEMIDEFINITE = 1e-9  # a correlation matrix typed with so many digits may be indefinite by its rounding


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class BaseNoise(Displayed):
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


def base_noise(
    spectra: BaseNoise | Mapping[str, Any], directions: tuple[str, ...] = DIRECTIONS,
    correlation: ArrayLike | None = None,
) -> BaseNoise:  # fmt: skip
    """Return the base excitation.

    ``spectra``: one-sided acceleration density by direction: a number is white noise, pairs (frequency [Hz], density)
    are a table; ``white`` and ``shaped`` make others. Several directions may share one, ``{"x y z": 1e-6}``.
    ``directions``: those in which the base can be shaken. ``correlation`` (n, n): Hermitian with ones on its diagonal,
    in the order of the spectra.
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
    try:
        matrix = np.eye(n, dtype=complex) if correlation is None else np.asarray(correlation, dtype=complex)
    except (TypeError, ValueError) as error:
        raise ResponseError(f"base: correlation = {check.shown(correlation)}; expected a matrix of numbers.") from error
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
        return Shaped(density_level(density, name), np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), 1.0)
    return table(density, name)
