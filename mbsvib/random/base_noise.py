"""Noise of a base that is shaken along some directions: their densities, several of which may share one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.display import Displayed
from mbsvib.errors import ResponseError, nearest
from mbsvib.random.sources import Sources, checked_correlation
from mbsvib.responses.densities import density

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from mbsvib.common.arrays import Complex
    from mbsvib.responses.densities import Density, Shaped, Table


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class BaseNoise(Displayed):
    """Base excitation: a density for each of the ``directions``, S_ij = R_ij sqrt(S_i S_j) with the Hermitian
    ``correlation`` R.
    """

    directions: tuple[str, ...]
    spectra: tuple[Table | Shaped | Density, ...]
    correlation: Complex

    @property
    def unbounded(self) -> bool:
        """Whether some spectrum extends to infinite frequency."""
        return any(spectrum.span[1] == np.inf for spectrum in self.spectra)


def base_sources(noise: BaseNoise) -> Sources:
    """Return noise of a base as sources at the inputs of base motion."""
    independent = np.array_equal(noise.correlation, np.eye(len(noise.directions)))
    return Sources(tuple([f"base.{direction}" for direction in noise.directions]), noise.spectra,
                   None if independent else noise.correlation)  # fmt: skip


def base_noise(
    spectra: BaseNoise | Mapping[str, Any], directions: tuple[str, ...] = check.DIRECTIONS,
    correlation: ArrayLike | None = None,
) -> BaseNoise:  # fmt: skip
    """Return the base excitation.

    ``spectra``: one-sided acceleration density by direction, as ``density`` takes it. Several directions may share one,
    ``{"x y z": 1e-6}``. ``directions``: those in which the base can be shaken. ``correlation`` (n, n): Hermitian with
    ones on its diagonal, in the order of the spectra.
    """
    if isinstance(spectra, BaseNoise):
        return spectra
    if not isinstance(spectra, Mapping) or not spectra:
        raise ResponseError(f"base: spectra = {check.shown(spectra)}; expected a density for each direction, such as "
                            f"{{'z': [(1, 1e-6), (100, 1e-4)]}} in (m/s^2)^2/Hz.")  # fmt: skip
    densities: dict[str, Table | Shaped | Density] = {}
    for names, value in spectra.items():
        for name in str(names).split():
            if name not in directions:
                raise ResponseError(f"base: there is no direction '{name}' to shake it in."
                                    f"{nearest(name, directions)} Directions: {' '.join(directions)}.")  # fmt: skip
            if name in densities:
                raise ResponseError(f"base: direction '{name}' has two spectra; give one of them.")
            densities[name] = density(value, f"base {name}")
    given = np.eye(len(densities)) if correlation is None else correlation
    return BaseNoise(tuple(densities), tuple(densities.values()),
                     checked_correlation(given, tuple(densities), None)[0])  # fmt: skip
