"""Poles of a loop at one gain, and their derivatives with respect to it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.linalg.groups import linked_items
from mbsvib.linalg.spectrum import spectrum

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Complex, Index

ALIKE = 1e-7  # relative distance below which poles coincide
OSCILLATES = 1e-6  # relative imaginary parts that rounding gives to repeated real poles
SEPARATE = 1e-12  # reciprocal condition of the products of left and right vectors below which poles are defective
DEFECTIVE = 1e2  # distances and errors of coinciding poles by which A in their subspace may differ from a multiple of 1


@dataclass(frozen=True)
class GainSpectrum:
    """Eigenvalues ``poles`` (n,) of the state ``matrix`` (n, n) at a ``gain``, in ascending order of magnitude."""

    gain: float
    matrix: Array

    @property
    def poles(self) -> Complex:
        """Eigenvalues [1/s], (n,), 0 where they differ from it by rounding; those with positive imaginary part come
        before their conjugates.
        """
        return self._decomposition[0]

    @cached_property
    def values(self) -> Complex:
        """Eigenvalues, exactly real where they differ from that by rounding."""
        poles = self.poles.copy()
        poles.imag[np.abs(poles.imag) <= OSCILLATES * np.abs(poles)] = 0.0
        return poles

    @property
    def errors(self) -> Array:
        """Bounds of the rounding of the eigenvalues [1/s], (n,)."""
        return self._decomposition[1]

    @cached_property
    def tolerance(self) -> Array:
        """Distance from each eigenvalue below which another one coincides with it [1/s], (n,)."""
        return np.maximum(ALIKE * np.abs(self.values), self.errors)

    def slopes(self, change: Array) -> Complex:
        """Return the derivatives (n,) of ``values``; zero where an eigenvalue is defective and has none.

        For a simple eigenvalue lambda' = y^H A' x / (y^H x); for one of multiplicity m, the m eigenvalues of
        (Y^H X)^-1 Y^H A' X with its left and right vectors Y and X, in ascending order of real plus imaginary part.

        ``change`` (n, n): derivative A' of the state matrix.

        Source: Lancaster, P. (1964), On eigenvalues of matrices dependent on a parameter, Numer. Math. 6, theorem 7.
        """
        _, _, left, right, scale = self._decomposition
        rows = left.conj().T
        moved = (change / scale[:, None] * scale) @ right
        overlap = np.einsum("ij,ji->i", rows, right)
        regular = np.abs(overlap) > SEPARATE
        result = np.einsum("ij,ji->i", rows, moved) / np.where(regular, overlap, np.inf)
        of_a, of_change = (matrix / scale[:, None] * scale for matrix in (self.matrix, change))
        for clusters in self._clusters:
            y, x = (np.linalg.qr(vectors.T[clusters].swapaxes(1, 2))[0] for vectors in (left, right))
            y = y.conj().swapaxes(1, 2)
            overlaps, rates = y @ x, y @ of_change @ x
            sizes = np.linalg.svd(overlaps, compute_uv=False)
            regular = sizes[:, -1] > SEPARATE * sizes[:, 0]
            overlaps[~regular] = np.eye(clusters.shape[1])
            within = np.linalg.solve(overlaps, y @ of_a @ x)  # a multiple of 1 where each eigenvalue has a vector
            values = self.values[clusters]
            within -= values.mean(axis=1)[:, None, None] * np.eye(clusters.shape[1])
            spread = np.abs(values - values[:, :1]).max(axis=1) + self.errors[clusters].max(axis=1)
            regular &= np.abs(within).max(axis=(1, 2)) <= DEFECTIVE * spread
            rates[~regular] = 0.0
            slopes = np.linalg.eigvals(np.linalg.solve(overlaps, rates))
            in_order = np.argsort(slopes.real + slopes.imag, axis=-1, kind="stable")
            result[clusters] = np.take_along_axis(slopes, in_order, axis=-1)
        return np.asarray(result)

    @cached_property
    def _clusters(self) -> list[Index]:
        """Columns (clusters, multiplicity) of repeated eigenvalues, one array for each multiplicity."""
        values = self.values
        groups = linked_items(np.abs(values[:, None] - values) <= np.minimum(self.tolerance[:, None], self.tolerance))
        sizes = sorted({len(group) for group in groups})
        return [np.array([group for group in groups if len(group) == size]) for size in sizes]

    @cached_property
    def _decomposition(self) -> tuple[Complex, Array, Complex, Complex, Array]:
        """Eigenvalues, errors, left and right vectors (n, n) as columns, in states of the units ``scale`` (n,)."""
        of_a = spectrum(self.matrix)
        order = np.lexsort((-of_a.values.imag, np.abs(of_a.values)))
        values = np.where(of_a.at_zero, 0.0, of_a.values)[order]
        return (values, of_a.errors[order], of_a.left[:, order].astype(complex),
                of_a.right[:, order].astype(complex), np.ldexp(1.0, of_a.power))  # fmt: skip
