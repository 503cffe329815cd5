"""Bounds of rounding errors of frequency responses; parts that do not depend on frequency are computed once.

A sum over modes is accurate to rounding of its largest terms. The change of a response by an error of eps in every
number of the equations may be smaller: with forward and adjoint motions x and z it is at most

    eps (sum over rows of |k + i w c| (|D z| |D||x| + |D||z| |D x|), of w^2 likewise with W, + |C||x| + |B||z|).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mbsvib.common.arrays import Array, Complex, Index
from mbsvib.equations.equations import Equations
from mbsvib.linalg.products import product, square_difference
from mbsvib.linalg.rank import EPS
from mbsvib.modes.damped import Damped
from mbsvib.responses.modal_sum import half_spectrum

# Rounding of a sum over modes in parts of its terms' size.
ROUNDING = 16.0


@dataclass(frozen=True, slots=True)
class Noise:
    """Bound of the rounding errors of responses, up to a factor of order one.

    ``parts`` are the outputs by order of differentiation: the order, the output numbers, the magnitudes of the modes'
    input times output coefficients (rows inputs, k), and those of the known sums (rows, inputs, k + 1). ``b`` are the
    inputs and ``outputs`` the outputs in the basis.
    """

    b: Array
    outputs: tuple[tuple[int, Array], ...]
    terms: TermSizes
    parts: tuple[tuple[int, Index, Array, Array], ...]
    direct: Array

    @staticmethod
    def of(system: Equations, modal: Damped) -> Noise:
        """Return the bound for a system and its modes."""
        b = modal.shapes.T @ system.B
        beta, direct = np.linalg.norm(b, axis=0), np.abs(system.D)
        terms = TermSizes.of(modal)
        right = np.abs(b if terms.vectors is None else terms.vectors.T @ b)
        parts = []
        for order, rows in differentiated(system):
            used = np.flatnonzero(rows.any(axis=1))
            c = rows[used] @ modal.shapes
            gamma, gain = np.linalg.norm(c, axis=1), np.abs(c if terms.vectors is None else c @ terms.vectors)
            magnitudes = gamma[:, None, None] * right.T + gain[:, None, :] * beta[:, None]
            sums = terms.sums(magnitudes, direct[used] if order == 2 else None)
            parts.append((order, used, magnitudes.reshape(-1, magnitudes.shape[2]), sums))
        output_rows = tuple((order, rows @ modal.shapes) for order, rows in differentiated(system))
        return Noise(b, output_rows, terms, tuple(parts), direct)

    def at(self, w: Array, by_modes: bool) -> Array:
        """Return the bound (outputs, inputs, n) at frequencies ``w`` (n,) [rad/s], none negative.

        Responses that are sums over modes, ``by_modes``, avoid the cancellation above a mode; others are solutions.
        """
        gain, fade = self.terms.gain(w)
        result = np.zeros((*self.direct.shape, len(w)))
        if by_modes:
            gain *= fade
            below = np.searchsorted(self.terms.ascending, w)
            inverse = np.divide(1.0, w, out=np.zeros_like(w), where=w > 0.0) ** self.terms.power
        else:
            result += self.direct[:, :, None]
        for order, used, magnitudes, sums in self.parts:
            part = (magnitudes @ gain).reshape(len(used), -1, len(w))
            if by_modes:
                part += sums[:, :, below] * inverse
            result[used] += part * w**order if order else part
        result *= EPS * ROUNDING
        return result


@dataclass(frozen=True, slots=True)
class TermSizes:
    """Sizes of the terms of a sum over modes: the sums of all R and lambda R, which are known, are of the size
    ``strength`` (k,) over w^power; ``vectors`` (m, k) if they are not the basis, ``corner`` (k,) as in ``ModalSum``.
    ``free`` of them, the last ones, are rigid-body modes, if damping couples modes.
    """

    modal: Damped
    value: Complex
    free: int
    strength: Array
    power: int
    corner: Array
    ascending: Array
    vectors: Complex | None

    @staticmethod
    def of(modal: Damped) -> TermSizes:
        """Return the terms of a system's modes."""
        if modal.vectors is None or modal.slopes is None:
            corner = np.abs(modal.pairs).max(axis=1)
            return TermSizes(modal, np.zeros(0, complex), 0, np.ones(len(corner)), 2, corner, np.sort(corner), None)
        value, y, slope, _, free = half_spectrum(modal)
        vectors: Complex = np.concatenate((y, free), axis=1)
        rigid = np.zeros(free.shape[1])
        strength, corner = (np.concatenate((a, rigid)) for a in (2.0 / np.abs(slope), np.abs(value)))
        return TermSizes(modal, value, len(rigid), strength, 1, corner, np.sort(corner), vectors)

    def gain(self, w: Array) -> tuple[Array, Array]:
        """Return magnitudes (k, n) of 1 / (s - lambda), and of the remainder above the mode, without the known sums."""
        corner = self.corner[:, None]
        if self.vectors is None:
            square, turn = self.modal.square[:, None], w * w
            size, brake = np.abs(square), np.abs(self.modal.gamma)[:, None] * w
            fade = np.where(corner < w, (size + brake) / turn, 1.0)
            return 1.0 / np.maximum(np.abs(square_difference(square, w)), brake), fade
        value = self.value[:, None]
        count = len(value)
        gain = np.empty((count + self.free, len(w)))
        gain[:count] = self.strength[:count, None] / np.maximum(np.abs(value.real), np.abs(w - value.imag))
        gain[count:] = 1.0 / (w * w)
        return gain, np.minimum(1.0, (corner / w) ** 2)

    def sums(self, magnitudes: Array, direct: Array | None) -> Array:
        """Magnitudes of the known sums (rows, inputs, k + 1), from below w or from above, whichever cancels less."""
        terms = (magnitudes * self.strength)[:, :, np.argsort(self.corner, kind="stable")]
        below, above = np.zeros((2, *terms.shape[:2], terms.shape[2] + 1))
        np.cumsum(terms, axis=2, out=below[:, :, 1:])
        above[:, :, :-1] = np.cumsum(terms[:, :, ::-1], axis=2)[:, :, ::-1]
        return np.asarray(np.minimum(below if direct is None else below + direct[:, :, None], above))


@dataclass(frozen=True, slots=True)
class Changes:
    """Changes of responses by relative changes of one of all numbers of the equations.

    ``rows`` are those of springs and dampers, and of inertia below; ``sizes`` contains, one below the other, their
    magnitudes, and the reference magnitudes for rounding of the rows, of the outputs (``orders``) and of the inputs.
    """

    rows: Array
    stiffness: Array
    damping: Array
    sizes: Array
    orders: tuple[int, ...]
    direct: Array

    @staticmethod
    def of(system: Equations, modal: Damped) -> tuple[Changes, Changes]:
        """Return those of the most important numbers, a cheap lower bound, and those of all numbers."""
        inertia = system.inertia_factor[system.inertia_factor.any(axis=1)]
        all_numbers = Changes._of(system, inertia)
        if len(inertia) <= 2 * system.dof:
            return all_numbers, all_numbers
        largest = np.argsort(-np.linalg.norm(inertia @ modal.shapes, axis=1), kind="stable")
        return Changes._of(system, inertia[largest[: system.dof]]), all_numbers

    @staticmethod
    def _of(system: Equations, inertia: Array) -> Changes:
        used = (system.row_stiffness != 0.0) | (system.row_damping != 0.0)
        rows = np.concatenate((system.elastic_rows[used], inertia))
        outputs = differentiated(system)
        near = [_sizes(c) for c in (rows, *(c for _, c in outputs), system.B.T)]
        sizes, orders = np.concatenate((np.abs(rows), *near)), tuple(order for order, _ in outputs)
        stiffness = np.abs(system.row_stiffness[used])
        return Changes(rows, stiffness[:, None], system.row_damping[used][:, None], sizes, orders, np.abs(system.D))

    def at(self, w: Array, motion: Complex, relative_motion: Complex | None = None) -> Array:
        """Return the sum over all numbers (outputs, inputs, n) at frequencies ``w`` (n,) [rad/s], none negative.

        ``motion`` (m, inputs + outputs, n): forward and adjoint motions. ``relative_motion`` (rows, ...): the same
        along the rows; default: from ``motion``, as accurate as its rounding allows.
        """
        outputs, inputs = self.direct.shape
        count, springs = len(self.rows), len(self.stiffness)
        near = product(self.sizes, _magnitude(motion))
        if relative_motion is None:
            forces = _magnitude(product(self.rows, motion))
            forces -= ROUNDING * EPS * near[:count]
            np.maximum(forces, 0.0, out=forces)
        else:
            forces = np.abs(relative_motion)
        forces[:springs] *= np.hypot(self.stiffness, self.damping * w)[:, None]
        forces[springs:] *= w * w
        far = near[count : 2 * count]
        adjoint = np.concatenate((forces[:, inputs:], far[:, inputs:])).transpose(2, 1, 0)
        forward = np.concatenate((far[:, :inputs], forces[:, :inputs])).transpose(2, 0, 1)
        result: Array = (adjoint @ forward).transpose(1, 2, 0) + self.direct[:, :, None]
        for i, order in enumerate(self.orders):
            start = 2 * count + i * outputs
            part = near[start : start + outputs, :inputs]
            result += part * w**order if order else part
        result += near[-inputs:, inputs:].transpose(1, 0, 2)
        return result


def differentiated(system: Equations) -> list[tuple[int, Array]]:
    """Return the nonzero rows (outputs, m) of displacements, velocities and accelerations, with the order 0, 1 or 2."""
    return [(order, c) for order, c in enumerate((system.Cq, system.Cv, system.Ca)) if c.any()]


def _magnitude(values: Complex) -> Array:
    """Return magnitudes, faster than ``abs``; only for magnitudes between 1e-154 and 1e154."""
    return np.asarray(np.sqrt(np.square(values.real) + np.square(values.imag)))


def _sizes(rows: Array) -> Array:
    """Reference magnitudes for rounding of entries: the largest of the row, as 6e-17 may be a zero; zeros are exact."""
    return np.asarray((rows != 0.0) * np.abs(rows).max(axis=1, keepdims=True))
