"""The Rayleigh step of modes that damping couples: eigenvalues to rounding, better vectors, and bounds of the errors.

Each eigenvalue is improved by Newton steps on its own two-sided quadratic lambda^2 (y^T M y) + lambda (y^T C y) +
y^T K y = 0, whose error is of second order in that of the vector y. Each vector is improved by the projections of its
residual on the others, through the resolvent, the sum of y y^T / (slope (s - lambda)) over all eigenvalues. These
projections bound the error that is left, and the sizes of all terms its rounding.

Arrays may have axes of variants in front. Of conjugate eigenvalues the one with Im > 0 is known, and also represents
the other; these come first.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mbsvib.common.arrays import Array, Bools, Complex
from mbsvib.common.fast_init import fast_init
from mbsvib.linalg.products import product_with_zeros, real_product
from mbsvib.linalg.rank import EPS
from mbsvib.modes.pairs import TINY, nearness, with_neighbours, within_reach
from mbsvib.modes.undamped import CLEAN

# A Newton step larger than this share of the eigenvalue does not correct rounding errors: the pair is nearly defective.
CORRECTION = 1e-4
# The square of a step this small is less than rounding.
SQUARED = 1e-9
# Vectors in the resolvent are as inexact as those whose errors it bounds: these errors are up to twice as large.
INEXACT = 2.0
# An eigenvalue next to one whose vector differs by less was found twice, in place of a near one: 1 / (1 - cosine).
TWICE = 1e6
# Rounding of the rigid-body modes as motion of springs, in parts of eps; calibrated on chains with strong dampers.
RIGID = 16.0


@fast_init
@dataclass(frozen=True, slots=True)
class Forms:
    """Mass, damping and stiffness in the basis of undamped modes, ``matrices`` (3, ..., m, m) from the factors: 1,
    Gamma and Omega^2 up to rounding and mixing of the shapes, which matter if an eigenvalue is required to the last
    digit. ``magnitudes`` (3, ..., m, m) are the sizes of the terms that they are sums of. The first ``rigid`` motions
    have no stiffness.
    """

    matrices: Array
    magnitudes: Array
    rigid: int = 0

    def of(self, y: Complex) -> Complex:
        """Return the three matrices times complex vectors (..., m, n), shape (3, ..., m, n)."""
        return real_product(self.matrices, y)

    def rounding(self, size: Array) -> Array:
        """Return the rounding of the three forms in vectors with entries of some ``size`` (..., m, n), (3, ..., n)."""
        terms = self.magnitudes @ size
        terms *= size
        return np.asarray(EPS * np.add.reduce(terms, axis=-2))

    def with_errors(self, square: Array, errors: Array) -> Forms:
        """Return the forms with the relative ``errors`` (..., m) of the frequencies, of which ``square`` (..., m) are
        the squares, among the magnitudes.
        """
        magnitudes, error = self.magnitudes.copy(), 2.0 * (errors / EPS + 1.0)
        diagonals = np.einsum("...ii->...i", magnitudes)
        diagonals[0] += error
        diagonals[2] += error * np.abs(square)
        if self.rigid:  # rounding of the rigid-body motions is motion of springs, which the forms leave out
            magnitudes[2, : self.rigid] += RIGID * np.abs(square)
        return Forms(self.matrices, magnitudes, self.rigid)


def forms_in(factors: Sequence[Array], shapes: Array, gamma: Array, rigid: int = 0) -> Forms:
    """Return the forms of a system, or of all variants, in a basis ``shapes`` (..., m, m) with ``rigid`` motions first.

    ``factors``: W (..., r, m) and D (..., s, m), k and c (..., s); ``gamma`` (..., m, m): the damping in this basis.
    """
    w, d, stiffness, damping = factors
    k, c = stiffness[..., None], damping[..., None]
    h, e, size = w @ shapes, d @ shapes, np.abs(shapes)
    matrices, magnitudes = np.empty((2, 3, *gamma.shape))
    cancel, stretch = np.abs(d) @ size, e * k
    if rigid:  # relative motions that gamma leaves out as rounding may be larger than the rounding of one sum
        cancel = np.maximum(cancel, np.abs(e - product_with_zeros(d, shapes)) / EPS)
    back = cancel.swapaxes(-1, -2)
    matrices[0], matrices[1], matrices[2] = h.swapaxes(-1, -2) @ h, gamma, e.swapaxes(-1, -2) @ stretch
    magnitudes[0] = np.abs(h).swapaxes(-1, -2) @ (np.abs(w) @ size)
    magnitudes[1], magnitudes[2] = back @ np.abs(e * c), back @ np.abs(stretch)
    if rigid:
        for of_stiffness in (matrices[2], magnitudes[2]):
            of_stiffness[:rigid] = of_stiffness[:, :rigid] = 0.0
    return Forms(matrices, magnitudes, rigid)


def both(half: Any, count: int) -> Any:
    """Append the conjugates of the first ``count`` values along the last axis."""
    return np.concatenate((half, half[..., :count].conj()), axis=-1)


def rayleigh(
    values: Complex, y: Complex, forms: Forms, count: int
) -> tuple[Complex, Complex, Complex, Array, Array]:
    """Return better eigenvalues (..., n) and vectors (..., m, n), their slopes y^T (2 lambda + Gamma) y, bounds of the
    eigenvalues' relative errors, and the part of these that can be reduced, (..., n) each.

    The first ``count`` of the ``values`` (..., n) represent their conjugates; ``y`` (..., m, n) are the vectors.
    """
    n, r = values.shape[-1], forms.rigid
    inertia, damping, elastic = products = forms.of(y)
    a, b, _ = forms_of_y = np.add.reduce(y * products, axis=-2)
    improved, amount, small = _newton(values, forms_of_y, count)
    # the remaining error is of second order: residual r times the resolvent
    wide = improved[..., None, :]
    residual = wide * (wide * inertia + damping) + elastic
    every = both(np.concatenate((y, wide, (2.0 * improved * a + b)[..., None, :]), axis=-2), count)
    slope, difference = every[..., -1, :], wide - every[..., -2, :, None]
    share, distance = every[..., :-2, :].swapaxes(-1, -2) @ residual, slope[..., None] * difference
    speed, size, steepness, gap = np.abs(improved), np.abs(y), np.maximum(np.abs(slope), TINY), np.abs(difference)
    for separate in (gap, distance):
        np.einsum("...ii->...i", separate[..., :n, :])[...] = np.inf
    projection, separation, root = np.abs(share), np.abs(distance), np.sqrt(steepness)
    together = projection * (root[..., None] / root[..., None, :n])  # of what eigenvalues that meet share
    moved = projection * (projection / np.maximum(np.maximum(separation, together), TINY))
    growth = nearness(gap[..., :n, :], improved, y, (inertia, damping), slope)
    uncertainty = np.add.reduce(moved if growth is None else moved * both(growth, count)[..., None], axis=-2)
    if r:
        at_rest = _at_rest(residual[:r], improved, forms.matrices[1].diagonal()[:r, None])
        uncertainty += np.add.reduce(np.abs(residual[:r] * at_rest))
    of_mass, of_damping, of_stiffness = forms.rounding(size)
    weight = np.maximum(steepness[..., :n] * speed, TINY)
    uncertainty = (INEXACT * uncertainty + 4.0 * speed * of_damping) / weight
    reducible, bound = np.minimum((uncertainty, uncertainty + (speed * speed * of_mass + of_stiffness) / weight), 1.0)
    if growth is not None:
        reducible[growth > TWICE] = 1.0
    if np.count_nonzero(small) < small.size:
        reducible[~small] = 1.0
        bound = np.where(small, bound, np.maximum(bound, np.minimum(amount / np.maximum(speed, TINY), 1.0)))
    bound = np.maximum(bound, reducible, out=bound, where=small)
    if np.count_nonzero(bound > CLEAN):
        bound = with_neighbours(speed, bound, gap)
    if np.count_nonzero(reducible > CORRECTION):  # vectors of eigenvalues within reach of such a one mix with its own
        # a step that was not taken says how far the eigenvalue is, which its error, at most the whole of it, does not
        reach = within_reach(improved, reducible, np.where(small, 0.0, INEXACT * amount))
        reducible, bound = np.maximum(reducible, reach), np.maximum(bound, reach)
    distance[projection >= CORRECTION * separation] = np.inf
    y = y - every[..., :-2, :] @ (share / distance)
    if r:
        y[:r] -= at_rest
    y /= np.sqrt(np.add.reduce((y * y.conj()).real, axis=-2))[..., None, :]
    y.imag[..., count:] = 0.0
    slopes = np.add.reduce(y * (2.0 * wide * y + real_product(forms.matrices[1], y)), axis=-2)
    return improved, y, slopes, bound, reducible


def _newton(values: Complex, forms: Complex, count: int) -> tuple[Complex, Array, Bools]:
    """Eigenvalues after Newton steps on their own quadratics, with the last steps' sizes, and which were taken."""
    a, b, c = forms
    improved = values
    for _ in range(2):  # the second step squares the error of the first
        slope = 2.0 * improved * a + b
        slope[slope == 0.0] = np.inf
        step = (improved * (improved * a + b) + c) / slope
        amount, speed = np.abs(step), np.abs(improved)
        small = amount <= CORRECTION * speed
        improved = np.where(small, improved - step, improved)
        if np.count_nonzero(amount > SQUARED * speed) == 0:
            break
    if count and improved.imag[..., :count].min() <= 0.0:  # conjugates that are about to meet
        small[..., :count] &= improved.imag[..., :count] > 0.0
        improved = np.where(small, improved, values)
    return improved, amount, small


def _at_rest(residual: Complex, values: Complex, brakes: Array) -> Complex:
    """Shares of damped rigid-body modes, at the eigenvalue 0 with the slope Gamma, in the vectors."""
    return np.divide(residual, brakes * values, out=np.zeros_like(residual), where=brakes * np.abs(values) > 0.0)
