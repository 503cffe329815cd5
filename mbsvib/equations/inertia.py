"""Inertia as factors: M = W^T W, with three rows of W for the translation of each body and three for its rotation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from mbsvib.common.arguments import IDENTITY
from mbsvib.common.arrays import Array
from mbsvib.common.fast_init import fast_init
from mbsvib.elements import Body
from mbsvib.elements.body import tensors
from mbsvib.elements.rows import columns
from mbsvib.errors import ModelError
from mbsvib.linalg.rank import EPS, MASSLESS

# Variants with smaller pivots of the scaled mass matrix are checked as single systems, with a lower limit.
SUSPECT_MASS = 1e-12


@fast_init
@dataclass(frozen=True, slots=True)
class SpatialInertia:
    """Square roots of the bodies' inertia: ``linear`` (..., bodies) of the masses, ``angular`` (..., bodies, 3, 3) F of
    the tensors, F^T F = I about the centre of mass in world axes. ``regular`` says that every body has a mass, and
    a moment about every axis.
    """

    linear: Array
    angular: Array
    regular: bool = True

    def factor(self, motion: Array) -> Array:
        """Return the rows W of body motions (..., bodies, 6, m), shape (..., 6 bodies, m)."""
        variants = max(motion.shape[:-3], self.linear.shape[:-1], self.angular.shape[:-3])
        size = motion.shape[-3], 3 + self.angular.shape[-2], motion.shape[-1]
        result = np.empty((*variants, *size), np.result_type(motion, self.linear, self.angular))
        np.multiply(motion[..., :3, :], self.linear[..., None, None], out=result[..., :3, :])
        np.matmul(self.angular, motion[..., 3:, :], out=result[..., 3:, :])
        return result.reshape(*variants, size[0] * size[1], size[2])


def inertia_tensor(body: Body) -> Array:
    """Return the inertia tensor (3, 3) of a body about its centre of mass, world axes."""
    axes = np.array(body.orientation)
    return np.asarray(axes @ tensors(np.array(body.inertia)) @ axes.T)


def spatial_inertia(bodies: Sequence[Body]) -> SpatialInertia:
    """Return the square roots of the bodies' inertia in world axes."""
    entries = columns([(body.mass, *body.inertia) for body in bodies], 7)
    regular = np.count_nonzero(entries[:4] > 0.0) == 4 * len(bodies)
    if np.count_nonzero(entries[4:]):
        root = tensor_factors(entries[1:].T)
        regular = regular and np.count_nonzero(root.reshape(-1, 9)[:, ::4]) == 3 * len(bodies)
    else:
        root = np.zeros((len(bodies), 3, 3))
        root.reshape(-1, 9)[:, ::4] = np.sqrt(entries[1:4]).T
    if any(body.orientation is not IDENTITY for body in bodies):
        root = np.matmul(root, np.array([body.orientation for body in bodies]).transpose(0, 2, 1))
    return SpatialInertia(np.sqrt(entries[0]), root, regular)


def unit_inertia(count: int) -> SpatialInertia:
    """Return square roots of inertia that are one, of ``count`` bodies."""
    return SpatialInertia(np.ones(count), np.broadcast_to(np.eye(3), (count, 3, 3)))


def tensor_factors(inertia: Array) -> Array:
    """Return F with F^T F = the tensors given by their entries (..., 6), upper triangular, shape (..., 3, 3).

    Of tensors with small imaginary parts F has three more rows, those of their roots.
    """
    if np.iscomplexobj(inertia):
        size, rows = np.linalg.eigh(tensors(inertia.imag))
        imaginary = np.sqrt(1j * size)[..., None] * rows.swapaxes(-1, -2)
        return np.concatenate((tensor_factors(inertia.real), imaginary), axis=-2)
    try:
        return np.asarray(np.linalg.cholesky(tensors(inertia)).astype(float, copy=False).swapaxes(-1, -2))
    except np.linalg.LinAlgError:
        # a body without extent in some direction: what rounding leaves of its smallest moment may be negative
        values, vectors = np.linalg.eigh(tensors(inertia))
        values[values <= 4.0 * EPS * values[..., 2:]] = 0.0
        return np.asarray(np.sqrt(np.maximum(values, 0.0))[..., None] * np.swapaxes(vectors, -1, -2), dtype=float)


def check_mass(mass: Array, names: tuple[str, ...]) -> None:
    """Refuse coordinates whose motion moves no mass, by name."""
    if not names:
        return
    diagonal = mass.diagonal()
    factor, failed_pivot = lapack.dpotrf(mass.T, clean=0)
    if not failed_pivot:
        pivots = np.square(factor.diagonal()) / diagonal
        lowest = int(pivots.argmin())
        if pivots[lowest] > MASSLESS:
            return
    else:
        lowest = int(diagonal.argmin())
        if diagonal[lowest] > 0.0:
            scale = 1.0 / np.sqrt(diagonal)
            if np.linalg.eigvalsh(mass * scale[:, None] * scale)[0] > MASSLESS:
                return
            lowest = failed_pivot - 1
    raise ModelError(
        f"coordinate '{names[lowest]}': the mass matrix is singular, this motion (alone or with others) moves no mass "
        f"but for rounding. Give the bodies it moves an inertia about its axis, or make what is tiny exactly zero: "
        f"motions without mass follow from statics where springs and dampers hold them.",
        element=names[lowest],
    )  # fmt: skip


def check_masses(mass: Array, names: tuple[str, ...], first: int) -> None:
    """Refuse variants in which the motion of a coordinate moves no mass, by index."""
    if mass.ndim == 2 or not names:
        return
    diagonal = mass.diagonal(axis1=1, axis2=2)
    try:
        pivots = np.linalg.cholesky(mass).diagonal(axis1=1, axis2=2) ** 2  # times the diagonal
        suspects = np.flatnonzero((pivots < SUSPECT_MASS * diagonal).any(axis=1))
    except np.linalg.LinAlgError:
        suspects = np.arange(len(mass))
    for i in suspects.tolist():
        try:
            check_mass(mass[i], names)
        except ModelError as error:
            raise ModelError(f"variant {first + i}: {error} All variants of a batch have the same motions without "
                             f"mass, and the nominal model has none.", element=error.element) from error  # fmt: skip
