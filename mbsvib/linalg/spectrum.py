"""Eigenvalues with the error of each: which of them are 0, and which decay, as far as rounding lets one know.

A change E of A moves a simple eigenvalue by l^H E r / (l^H r), so that rounding moves it by eps ||A|| / |l^H r|. Parts
of A that act on each other one way or not at all have a size of their own. Of a defective eigenvalue this has no bound:
k that coincide move by the k-th root of rounding, as far as a change E of this size makes A - z singular.

Source: Trefethen & Embree, Spectra and Pseudospectra (2005), theorem 2.2 and section 52.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eig

from mbsvib.common.arrays import Array, Bools, Complex, Index
from mbsvib.linalg.balancing import Exponents, matrix_exponents
from mbsvib.linalg.groups import part_numbers
from mbsvib.linalg.rank import EPS, POLE_ROUNDINGS

# Condition of an eigenvalue above which it may be a defective one, whose error is found by the resolvent.
DEFECTIVE = 1e6
# Eigenvalues below this share of the largest are 0 for means of their sizes.
ZERO_SIZE = 1e-12
# Radii about an eigenvalue grow by this factor, until none of so many points on the circle is an eigenvalue of A + E.
GROWTH, DIRECTIONS = 2.0, np.exp(0.5j * np.pi * np.arange(4) + 0.3j)


@dataclass(frozen=True, slots=True)
class Spectrum:
    """Eigenvalues ``values`` (n,) of a matrix with bounds ``errors`` (n,) of their rounding; ``left`` and ``right``
    (n, n) are eigenvectors of the scaled matrix T^-1 A T, T = diag(2^``power``).
    """

    values: Complex
    errors: Array
    left: Complex
    right: Complex
    power: Exponents

    @property
    def at_zero(self) -> Bools:
        """Which eigenvalues (n,) are 0 but for rounding."""
        return np.asarray(np.abs(self.values) <= self.errors)

    @property
    def decaying(self) -> Bools:
        """Which eigenvalues (n,) have a negative real part, whatever rounding does."""
        return decaying(self.values, self.errors)

    def clusters(self, which: Bools) -> list[Index]:
        """Return groups of some eigenvalues: those that rounding cannot tell apart are together, and conjugates."""
        at = np.flatnonzero(which)
        values, errors = self.values[at], self.errors[at]
        folded = values.real + 1j * np.abs(values.imag)
        near = np.abs(folded[:, None] - folded) <= errors[:, None] + errors
        part = part_numbers(near)
        return [at[part == k] for k in range(int(part.max(initial=-1)) + 1)]


def decaying(values: Complex, errors: Array) -> Bools:
    """Return which eigenvalues (n,) of x' = A x decay, whatever rounding of the size ``errors`` (n,) does."""
    return np.asarray(values.real < -errors)


def mean_size(values: Complex) -> float:
    """Return the geometric mean magnitude of eigenvalues without those that are none of the largest; 1 if all are 0."""
    size = np.abs(values)
    size = size[size > ZERO_SIZE * size.max(initial=0.0)]
    return float(np.exp(np.log(size).mean())) if len(size) else 1.0


def outside(of_a: Spectrum) -> Bools:
    """Return which eigenvalues (n,) of x+ = A x may be on the unit circle or outside."""
    return np.asarray(np.abs(of_a.values) >= 1.0 - of_a.errors)


def spectrum(a: Array) -> Spectrum:
    """Return the eigenvalues of a matrix (n, n) with their errors, in LAPACK's order."""
    if not len(a):
        none = np.zeros((0, 0), dtype=complex)
        return Spectrum(np.zeros(0, dtype=complex), np.zeros(0), none, none, np.zeros(0, dtype=np.int64))
    power = matrix_exponents(a)
    scaled = np.ldexp(a, power[None, :] - power[:, None])
    values, left, right = eig(scaled, left=True)
    values, product = _by_vectors(scaled, values, left, right)
    size = _rounding_of_parts(scaled, left, right)
    with np.errstate(divide="ignore", over="ignore"):
        errors = np.divide(size, product, out=EPS * np.abs(values), where=size > 0.0)
    largest = DEFECTIVE * EPS * float(np.linalg.norm(scaled))
    for k in np.flatnonzero(errors > largest).tolist():
        errors[k] = min(errors[k], _radius(scaled, complex(values[k])))
    return Spectrum(values, POLE_ROUNDINGS * errors, left, right, power)


def _by_vectors(scaled: Array, values: Complex, left: Complex, right: Complex) -> tuple[Complex, Array]:
    """Return eigenvalues l^H A r / (l^H r), unless nearly defective, and |l^H r| (n,): those of the solver have errors
    of the size of the largest parts, also where these do not act on the others.
    """
    product = np.einsum("ij,ij->j", left.conj(), right)
    simple = np.abs(product) * DEFECTIVE > 1.0
    quotient: Complex = np.einsum("ij,ij->j", left.conj(), scaled @ right) / np.where(simple, product, 1.0) + 0j
    quotient.imag[values.imag == 0.0] = 0.0
    below = np.flatnonzero(values.imag < 0.0)
    quotient[below] = quotient[below - 1].conj()
    return np.where(simple, quotient, values), np.abs(product)


def _rounding_of_parts(scaled: Array, left: Complex, right: Complex) -> Array:
    """Return eps times the sum over parts p, q of |l_p| |A_pq| |r_q|, which bounds l^H E r, (n,)."""
    part = part_numbers(scaled != 0.0, strong=True)
    member = (part == np.arange(int(part.max()) + 1)[:, None]).astype(float)
    size = np.sqrt(member @ scaled**2 @ member.T)
    l_size, r_size = (np.sqrt(member @ np.abs(vectors) ** 2) for vectors in (left, right))
    return np.asarray(EPS * np.einsum("pk,pq,qk->k", l_size, size, r_size))


def _radius(a: Array, value: complex) -> float:
    """The distance from an eigenvalue at which no matrix as close to A as rounding is singular."""
    size = float(np.linalg.norm(a))
    radius = rounding = EPS * size
    while radius < size:
        points = value + radius * DIRECTIONS
        least = np.linalg.svd(points[:, None, None] * np.eye(len(a)) - a, compute_uv=False)[:, -1].min()
        if least > rounding:
            break
        radius *= GROWTH
    return radius
