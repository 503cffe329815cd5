"""Sources of noise at the inputs of linear equations, or of a base: their densities, and how they are correlated.

S_ij = R_ij sqrt(S_i S_j), entry (i, j) of the one-sided densities being that of E[x_i conj(x_j)]
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array, Complex
from mbsvib.common.display import Displayed
from mbsvib.common.selection import selected
from mbsvib.errors import ResponseError
from mbsvib.linalg.covariances import are_covariances
from mbsvib.linalg.rank import UNIT_CORRELATION
from mbsvib.responses.densities import Density, Shaped, Table, density

Correlation = ArrayLike | Callable[[Array], ArrayLike] | None

# The entry of budgets that is due to correlation.
CORRELATION = "correlation"


@dataclass(frozen=True, eq=False)
class Sources:
    """Noise at the inputs ``names`` (s,) with their ``densities``; ``correlation`` R (s, s), or a function of
    frequencies (n,) [Hz] that returns (n, s, s), None where they are independent.
    """

    names: tuple[str, ...]
    densities: tuple[Table | Shaped | Density, ...]
    correlation: Complex | Callable[[Array], Any] | None = None

    @property
    def breaks(self) -> Array:
        """Frequencies [Hz] at which densities are not smooth."""
        return np.unique(np.concatenate([part.breaks for part in self.densities]))

    @property
    def poles(self) -> Complex:
        """Poles of the filters of noise [1/s]."""
        return np.concatenate([part.poles for part in self.densities])

    @property
    def constant(self) -> Array | None:
        """The correlation where it is the same at all frequencies and real, None elsewhere."""
        known = None if self.correlation is None or callable(self.correlation) else self.correlation
        return None if known is None or known.imag.any() else known.real

    def of(self, f: Array) -> Array:
        """Return the densities (s, n) of the sources at frequencies (n,) [Hz]."""
        return np.array([part.at(f) for part in self.densities])

    def matrix(self, f: Array) -> Complex:
        """Return the densities and cross-densities (n, s, s) at frequencies (n,) [Hz]."""
        root, cross = np.sqrt(self.of(f)), self.across(f)
        r = np.eye(len(self.names)) if cross is None else cross + np.eye(len(self.names))
        return np.asarray(np.einsum("in,jn,nij->nij", root, root, np.broadcast_to(r, (len(f), *r.shape[-2:]))))

    def across(self, f: Array) -> Complex | None:
        """Return R without its diagonal at frequencies [Hz], (n or 1, s, s); None where sources are independent."""
        if self.correlation is None:
            return None
        given = at_frequencies(self.correlation, f) if callable(self.correlation) else self.correlation
        matrix = checked_correlation(given, self.names, len(f) if callable(self.correlation) else None)
        return np.asarray(matrix * (1.0 - np.eye(len(self.names))))


def sources(
    spectra: Mapping[str, Any] | Sources, inputs: tuple[str, ...], units: tuple[str, ...], name: str,
    correlation: Correlation = None,
) -> Sources:  # fmt: skip
    """Return the sources of noise at some of the ``inputs`` of the equations ``name``, in the order of ``spectra``.

    ``spectra``: one-sided density of each [unit^2/Hz] by name or pattern: a number is white noise, pairs (frequency
    [Hz], density) a table, straight on log-log axes, a function takes frequencies [Hz]. ``units``: those of the inputs.
    """
    if isinstance(spectra, Sources):
        return spectra
    if not isinstance(spectra, Mapping) or not spectra:
        raise ResponseError(f"noise: {check.shown(spectra)}; expected the density of each input that is driven, such "
                            f"as {{'{inputs[0] if inputs else 'floor.z'}': 1e-6}}.")  # fmt: skip
    found: dict[str, Any] = {}
    for pattern, value in spectra.items():
        of_input = density(value, f"noise at '{pattern}'")
        for k in selected(pattern, inputs, "input", name):
            if inputs[k] != pattern and inputs[k] in spectra:
                continue  # a name goes before patterns
            if inputs[k] in found:
                raise ResponseError(f"noise: the input '{inputs[k]}' has two densities, the second by '{pattern}'; "
                                    f"give one of them.")  # fmt: skip
            if of_input.unit and units[k] and of_input.unit != units[k]:
                raise ResponseError(f"noise: the density given for '{inputs[k]}' is one of {of_input.unit}, yet the "
                                    f"input has the unit {units[k]}; choose the quantity of the spectrum, such as "
                                    f"quantity='acceleration'.")  # fmt: skip
            found[inputs[k]] = of_input
    given = correlation
    if given is not None and not callable(given):
        given = checked_correlation(given, tuple(found), None)[0]
        given = None if np.array_equal(given, np.eye(len(found))) else given
    return Sources(tuple(found), tuple(found.values()), given)


def at_frequencies(function: Callable[[Any], Any], f: Array) -> Any:
    """Return the values of a function of frequencies (n,) [Hz], or of one that takes a single frequency."""
    try:
        return np.asarray(function(f), dtype=complex)
    except (TypeError, ValueError):
        try:
            return np.asarray([function(float(value)) for value in f], dtype=complex)
        except (TypeError, ValueError) as error:
            raise ResponseError(f"correlation: the function fails at {f[0]:g} Hz ({error}); expected one of a frequency"
                                " [Hz] that returns (s, s), or of (n,) that returns (n, s, s).") from error  # fmt: skip


def checked_correlation(value: Any, names: tuple[str, ...], count: int | None) -> Complex:
    """Return correlation matrices (n or 1, s, s) of some sources, refused if they are those of no noise.

    ``count``: number of frequencies at which a function was asked, None for a constant matrix.
    """
    s = len(names)
    try:
        matrix = np.asarray(value, dtype=complex)
    except (TypeError, ValueError) as error:
        raise ResponseError(f"correlation = {check.shown(value)}; expected a matrix of numbers.") from error
    stack = matrix[None] if matrix.ndim == 2 else matrix
    if stack.shape[1:] != (s, s) or len(stack) not in (1, count or 1) or not np.isfinite(stack).all():
        raise ResponseError(f"correlation has the shape {matrix.shape}; expected ({s}, {s}), finite, for the sources "
                            f"{', '.join(names)}; a function returns ({s}, {s}) or (n, {s}, {s}).")  # fmt: skip
    normalized = np.abs(np.diagonal(stack, axis1=1, axis2=2) - 1.0).max(initial=0.0) <= UNIT_CORRELATION
    if not normalized or not are_covariances(stack):
        raise ResponseError("correlation is not that of any noise; expected a Hermitian matrix, ones on its diagonal, "
                            "no negative eigenvalue (all entries 1: one source drives all).")  # fmt: skip
    return stack


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class BaseNoise(Displayed):
    """Base excitation: a density for each of the ``directions``, S_ij = R_ij sqrt(S_i S_j) with the Hermitian
    ``correlation`` R.
    """

    directions: tuple[str, ...]
    spectra: tuple[Table | Shaped | Density, ...]
    """One-sided density of each direction [(m/s^2)^2/Hz, (rad/s^2)^2/Hz]."""
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
            check.known(name, directions, f"base: there is no direction '{name}' to shake it in", None, "Directions:",
                        ResponseError)  # fmt: skip
            if name in densities:
                raise ResponseError(f"base: direction '{name}' has two spectra; give one of them.")
            densities[name] = density(value, f"base {name}")
    given = np.eye(len(densities)) if correlation is None else correlation
    return BaseNoise(tuple(densities), tuple(densities.values()), checked_correlation(given, tuple(densities), None)[0])
