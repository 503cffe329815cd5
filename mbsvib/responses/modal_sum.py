"""Sums over modes: transfer functions with the residues of all eigenvalues, at many points in one matrix product.

With y^T (2 lambda + Gamma) y = theta the inverse of s^2 + s Gamma + Omega^2 is the sum of R / (s - lambda) over all
eigenvalues, R = y y^T / theta, and two sums are known a priori: that of R is 0 and that of lambda R is 1. Far above
an eigenvalue R / (s - lambda) is mainly R / s + lambda R / s^2, which nearly cancels in the sum over modes: at high
frequencies digits would be lost in proportion to the frequency, and to its square in an absolute acceleration, where
the sum of lambda R cancels with D. So each eigenvalue below |s| contributes only the remainder,
lambda^2 R / (s^2 (s - lambda)). The other part is summed in advance, over the eigenvalues below or, with the known
sums, over those above, whichever has the smaller terms.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mbsvib.common.arrays import Array, Bools, Complex, Index
from mbsvib.equations.equations import Equations
from mbsvib.linalg.products import product
from mbsvib.linalg.rank import ZERO_SUM
from mbsvib.modes.damped import Damped
from mbsvib.modes.general import General
from mbsvib.responses.general_terms import asymptotic_terms, cleaned, terms

# Weights of one block of points stay in the cache.
BLOCK_BYTES = 2**20

_Terms = tuple["Complex", "Array", "Array", "Array | None", "Array", "Index"]


@dataclass(frozen=True, slots=True)
class ModalSum:
    """Transfer functions from inputs to ``rows``, each a displacement, velocity or acceleration output (``order``).

    p pairs of eigenvalues, roots of s^2 + ``total`` s + ``product`` with ``natural`` = sqrt(|product|), have the real
    coefficients gamma = sum of lambda R and alpha = sum of R; ``real_poles`` (q,) are not paired. ``coefficients``
    (rows inputs, p or 2 p, + q) contains gamma, alpha (except for classical damping, where they are 0) and R.
    ``corner`` (p + q,), ascending, is the magnitude of s above which an eigenvalue counts as below s (``pair_corner``:
    in the order of the pairs); ``alphas`` and ``gammas`` (rows inputs, p + q + 1) are the sums over those below.
    """

    natural: Array
    total: Array
    product: Array
    real_poles: Array
    pair_corner: Array
    coefficients: Array
    corner: Array
    alphas: Array
    gammas: Array
    order: Index
    output: Index
    feedthrough: Array
    number: Index

    def at(self, s: Complex) -> Complex:
        """Return the transfer matrix at the points ``s`` (n,), shape (outputs, inputs, n); infinite at its poles."""
        outputs, inputs = self.feedthrough.shape
        result: Complex = np.empty((outputs, inputs, len(s)), dtype=complex)
        result[:] = self.feedthrough[:, :, None]
        static, below = s == 0.0, np.searchsorted(self.corner, np.abs(s), side="left")
        below[static] = np.count_nonzero(self.corner == 0.0)
        inverse = np.divide(1.0, s, out=np.zeros_like(s), where=s != 0.0)
        block = max(64, BLOCK_BYTES // (16 * max(1, self.coefficients.shape[1])))
        powers = [np.ones_like(s), s, s * s]
        for start in range(0, len(s), block):
            part = slice(start, start + block)
            weights = self._weights(s[part], inverse[part])
            shape = (len(self.order), inputs, weights.shape[1])
            value: Complex = product(self.coefficients, weights).reshape(shape)
            alphas, sums = (a[:, below[part]].reshape(shape) for a in (self.alphas, self.gammas))
            less = alphas * inverse[part]
            for row, (order, output) in enumerate(zip(self.order.tolist(), self.output.tolist(), strict=True)):
                power = powers[order][part]
                if order == 2:  # D is part of the sums, and the remainder is not scaled up
                    result[output, :, part] += power * (value[row] + less[row]) + sums[row]
                else:
                    result[output, :, part] += power * (value[row] + less[row] + sums[row] * inverse[part] ** 2)
                    if static[part].any():
                        at_rest = _at_rest(order, alphas[row], sums[row])
                        result[output, :, part] += np.where(static[part], at_rest, 0.0)
        return result

    def _weights(self, s: Complex, inverse: Complex) -> Complex:
        """Weights of gamma, alpha and R at the points s, shape (coefficients, n)."""
        p, coupled = len(self.natural), self.coefficients.shape[1] > len(self.corner)
        weights = np.empty((self.coefficients.shape[1], len(s)), dtype=complex)
        total, product = self.total[:, None], self.product[:, None]
        size = np.abs(s)
        down = self._quadratics(s)
        with np.errstate(divide="ignore", invalid="ignore"):
            np.divide(1.0, down, out=down)
            low = self.pair_corner[:, None] < size
            weights[:p] = np.where(low, -(total * s + product) * inverse**2, 1.0)
            weights[:p] *= down
            if coupled:
                weights[p : 2 * p] = np.where(low, -product * inverse, s + total)
                weights[p : 2 * p] *= down
            if len(self.real_poles):
                root = self.real_poles[:, None]
                last = weights[2 * p if coupled else p :]
                last[:] = np.where(np.abs(root) < size, (root * inverse) ** 2, 1.0)
                last /= s - root
            if not s.all():  # poles at 0 are in the sums in advance
                resting = self.pair_corner == 0.0
                none = np.concatenate((*[resting] * (2 if coupled and p else 1), self.real_poles == 0.0))
                weights[np.ix_(none, s == 0.0)] = 0.0
        return weights

    def _quadratics(self, s: Complex) -> Complex:
        """Return (s - lambda1)(s - lambda2) of all pairs, (p, n), by differences: exactly real at s = 0."""
        x, y = s.real, s.imag
        natural, total, product = (a[:, None] for a in (self.natural, self.total, self.product))
        result: Complex = np.empty((len(natural), len(s)), dtype=complex)
        result.real = np.where(product >= 0.0, (natural - y) * (natural + y), product - y * y)
        if x.any():
            result.real += x * (x + total)
        result.imag = y * (2.0 * x + total)
        return result

    def pole_at(self, s: Complex) -> tuple[int, int] | None:
        """Return (mode, point) of the first of the points ``s`` that is an eigenvalue, or None."""
        down = np.concatenate((self._quadratics(s), s - self.real_poles[:, None]))
        modes, points = np.nonzero(down == 0.0)
        return (int(self.number[modes[0]]), int(points[0])) if len(modes) else None


def _at_rest(order: int, alpha: Array, gamma: Array) -> Array:
    """What alpha / s + gamma / s^2 times s^order, an order of 0 or 1, adds at s = 0."""
    infinite = (gamma != 0.0) | (alpha != 0.0) if order == 0 else gamma != 0.0
    return np.asarray(np.where(infinite, np.inf, alpha if order else 0.0))


def modal_sum(
    system: Equations, modal: Damped | General, inputs: Sequence[int] | None = None,
    outputs: Sequence[int] | None = None,
) -> ModalSum:
    """Return the sum over modes of the transfer functions of a system, of some ``inputs`` and ``outputs`` or all."""
    pick = slice(None) if inputs is None else list(inputs)
    show = slice(None) if outputs is None else list(outputs)
    rates = [c[show] for c in (system.Cq, system.Cv, system.Ca)]
    order, output = np.nonzero([c.any(axis=1) for c in rates])
    rows = np.array(rates)[order, output]
    if not isinstance(modal, Damped):
        basis, b, d = modal.state.basis, system.B[:, pick], system.D[show][:, pick]
        return general_sum(modal, (rows, rows @ basis), order, output, (b, basis.T @ b), d)
    c = rows @ modal.shapes
    return _sum_of(modal, c, order, output, modal.shapes.T @ system.B[:, pick], system.D[show][:, pick])


def sum_of_motions(modal: Damped, b: Array) -> ModalSum:
    """Return the sum over modes of (s^2 + s Gamma + Omega^2)^-1 b for b (m, inputs) in the basis: all m motions."""
    m = len(b)
    return _sum_of(modal, np.eye(m), np.zeros(m, dtype=np.intp), np.arange(m), b, np.zeros(b.shape))


def _sum_of(modal: Damped, c: Array, order: Index, output: Index, b: Array, d: Array) -> ModalSum:
    rows, residues = (order, output, d), ((c[:, :0], b[:0]), (c, b))
    if modal.vectors is not None:
        return _gathered(_coupled(modal, c, b), rows, residues)
    pairs = ~_braked(modal)
    shape = np.sqrt(np.abs(modal.square[pairs])), modal.gamma[pairs], modal.square[pairs]
    return _gathered(_classical(modal, c, b), rows, residues, shape)


def general_sum(
    modal: General, c: tuple[Array, Array], order: Index, output: Index, b: tuple[Array, Array], d: Array
) -> ModalSum:
    """Return the sum over modes of a system without symmetry.

    ``c`` (rows, m) and ``b`` (m, inputs): outputs and inputs, in coordinates and in the basis. ``order``, ``output``
    (rows,): how often each row is differentiated, and the number of its output. ``d`` (outputs, inputs): feedthrough.
    """
    e1, e2 = asymptotic_terms(modal.state)
    residues = (c[1], e1, b[1]), (c[1], e2, b[1])
    return _gathered(terms(modal, c[0], b[0]), (order, output, d), residues)


def _gathered(
    terms: _Terms, rows: tuple[Index, Index, Array], residues: tuple[tuple[Array, ...], tuple[Array, ...]],
    shape: tuple[Array, Array, Array] | None = None,
) -> ModalSum:  # fmt: skip
    """Assemble the sum from the terms, the rows with D, and the factors of the sums of all R and of all lambda R.

    ``shape``: natural, total and product of each pair if they are known by other means than its eigenvalues.
    """
    (pairs, real_poles, gamma, alpha, single, number), (order, output, d) = terms, rows
    first = pairs[:, 0]
    natural, total, product = shape or (np.abs(first), -2.0 * first.real, np.abs(first) ** 2)
    direct, feedthrough = np.where((order == 2)[:, None], d[output], 0.0), d.copy()
    feedthrough[output[order == 2]] = 0.0
    total_alpha, total_gamma = cleaned(*residues[0]).reshape(-1), cleaned(*residues[1], direct=direct).reshape(-1)
    # a real pair counts as below only beyond its fast root: up to there its own quotient is accurate
    pair_corner = np.abs(pairs).max(axis=1, initial=0.0)
    corner = np.concatenate((pair_corner, np.abs(real_poles)))
    ascending = np.argsort(corner, kind="stable")
    of_gamma = np.concatenate((gamma, single * real_poles), axis=1)[:, ascending]
    of_alpha = np.concatenate((np.zeros_like(gamma) if alpha is None else alpha, single), axis=1)[:, ascending]
    # gamma and alpha are real parts of lambda R and R, with the rounding errors of these
    speed, moves = corner[ascending], corner[ascending] > 0.0
    size_gamma = np.maximum(np.abs(of_gamma), np.abs(of_alpha) * speed)
    size_alpha = np.divide(size_gamma, speed, out=np.abs(of_alpha), where=moves)
    parts = (gamma, single) if alpha is None else (gamma, alpha, single)
    return ModalSum(
        natural, total, product, real_poles, pair_corner, np.concatenate(parts, axis=1), corner[ascending],
        partial_sums(of_alpha, size_alpha, np.zeros_like(total_alpha), total_alpha),
        partial_sums(of_gamma, size_gamma, direct.reshape(-1), total_gamma),
        order, output, feedthrough, number,
    )  # fmt: skip


def partial_sums(terms: Array, size: Array, start: Array, total: Array) -> Array:
    """Return sums ``start`` + terms[..., :j] = ``total`` - terms[..., j:] for all j, by the side with less rounding."""
    up, down, left, right = np.zeros((4, *terms.shape[:-1], terms.shape[-1] + 1))
    for values, below, above in ((terms, up, down), (size, left, right)):
        np.cumsum(values, axis=-1, out=below[..., 1:])
        above[..., :-1] = np.cumsum(values[..., ::-1], axis=-1)[..., ::-1]
    near = left + np.abs(start)[..., None] <= right + np.abs(total)[..., None]
    return np.asarray(np.where(near, start[..., None] + up, total[..., None] - down))


def _classical(modal: Damped, c: Array, b: Array) -> _Terms:
    """Each mode is one pair, with R1 = -R2; those of braked rigid-body modes stand alone, as that at 0 may."""
    braked = _braked(modal)
    pairs, alone = np.flatnonzero(~braked), np.flatnonzero(braked)
    gamma = _outer(c[:, pairs], b[pairs])
    free = (modal.pairs[pairs] == 0.0).all(axis=1)
    gamma[:, free] = _of_one_pole(c[:, pairs[free]], b[pairs[free]], (c, b))
    moved = b[alone] / modal.gamma[alone, None]
    single = np.concatenate((_of_one_pole(c[:, alone], moved, (c, b)), -_outer(c[:, alone], moved)), axis=1)
    real_poles = np.concatenate((np.zeros(len(alone)), -modal.gamma[alone]))
    return modal.pairs[pairs], real_poles, gamma, None, single, np.concatenate((pairs, alone, alone))


def _braked(modal: Damped) -> Bools:
    """Which modes of classical damping have one of their two eigenvalues at 0, (m,)."""
    return np.asarray((modal.pairs == 0.0).sum(axis=1) == 1)


def _of_one_pole(c: Array, b: Array, ports: tuple[Array, Array]) -> Array:
    """Terms (rows inputs, k) of poles at 0 with factors c (rows, k) and b (k, inputs): their sum in the first one.

    The sum is 0 if it is rounding. The basis is mass-normalised: entries of ``ports``, c and b in it, are known to
    rounding of their lengths, whatever the units.
    """
    result: Array = _outer(c, b)
    if not result.shape[1]:
        return result
    c_size, c_part = np.linalg.norm(ports[0], axis=1), np.linalg.norm(c, axis=1)
    b_size, b_part = np.linalg.norm(ports[1], axis=0), np.linalg.norm(b, axis=0)
    rounding = ZERO_SUM * (np.outer(c_size, b_part) + np.outer(c_part, b_size)).reshape(-1)
    total = result.sum(axis=1)
    result[:] = 0.0
    result[:, 0] = np.where(np.abs(total) <= rounding, 0.0, total)
    return result


def _outer(left: Any, right: Any) -> Any:
    """Products left (rows, k) right (k, inputs), one row for each row and input: (rows inputs, k)."""
    (rows, k), inputs = left.shape, right.shape[1]
    return np.einsum("rk,ki->rik", left, right).reshape(rows * inputs, k)


def half_spectrum(modal: Damped) -> tuple[Complex, Complex, Complex, Index, Array]:
    """Return nonzero eigenvalues (k,), of conjugate pairs the first, of coupled damping, and motions that stay free.

    Their vectors y (m, k) with slopes y^T (2 lambda + Gamma) y, and the numbers of their modes; the second eigenvalues
    of real pairs come last. Motions (m, r) without stiffness and damping have two eigenvalues 0 each.
    """
    assert modal.vectors is not None
    assert modal.slopes is not None
    free = (modal.pairs == 0.0).all(axis=1)
    first, second = np.flatnonzero(~free), np.flatnonzero(~free & (modal.pairs[:, 0].imag == 0.0))
    value, slope = (np.concatenate((a[first, 0], a[second, 1])) for a in (modal.pairs, modal.slopes))
    vectors = np.concatenate((modal.vectors[:, first, 0], modal.vectors[:, second, 1]), axis=1)
    return value, vectors, slope, np.concatenate((first, second)), modal.vectors[:, free, 0].real


def _coupled(modal: Damped, c: Array, b: Array) -> _Terms:
    """Conjugate pairs together; real eigenvalues one by one, as pairs of them need not cancel; free rigid modes."""
    value, y, slope, number, rigid_vectors = half_spectrum(modal)
    turns = value.imag != 0.0
    with np.errstate(divide="ignore", invalid="ignore"):  # a defective pair: the sum is not used
        residue = _outer(c @ y, (y.T @ b) / slope[:, None])
    rigid = _of_one_pole(c @ rigid_vectors, rigid_vectors.T @ b, (c, b))
    at_zero = np.flatnonzero(value == 0.0)
    if len(at_zero):
        residue[:, at_zero] = _of_one_pole((c @ y[:, at_zero]).real, ((y.T @ b)[at_zero] / slope[at_zero, None]).real,
                                           (c, b))  # fmt: skip
    gamma = np.concatenate((rigid, 2.0 * (residue * value)[:, turns].real), axis=1)
    alpha = np.concatenate((np.zeros_like(rigid), 2.0 * residue[:, turns].real), axis=1)
    free = np.flatnonzero((modal.pairs == 0.0).all(axis=1))
    pairs = np.concatenate((modal.pairs[free], modal.pairs[number[turns]]))
    return pairs, value[~turns].real, gamma, alpha, residue[:, ~turns].real, np.concatenate(
        (free, number[turns], number[~turns]))  # fmt: skip


def residues(modal: Damped, s: Complex) -> tuple[Complex, Complex]:
    """Return Y (m, k) and weights g (k, n) of (s^2 + s Gamma + Omega^2)^-1 = Y g Y^T, by all eigenvalues one by one.

    ``s`` (n,): points, none of them an eigenvalue.
    """
    assert modal.vectors is not None
    assert modal.slopes is not None
    free = (modal.pairs == 0.0).all(axis=1)
    rigid_vectors = modal.vectors[:, free, 0]
    value, slope = (a[~free].reshape(-1) for a in (modal.pairs, modal.slopes))
    y = np.concatenate((modal.vectors[:, ~free].reshape(len(rigid_vectors), -1), rigid_vectors), axis=1)
    rigid = np.broadcast_to(1.0 / (s * s), (rigid_vectors.shape[1], len(s)))
    return y, np.concatenate((1.0 / ((s - value[:, None]) * slope[:, None]), rigid))


def general_motions(modal: General, b: Array) -> ModalSum:
    """Return the sum over modes of (s^2 M + s C + K)^-1 b in the basis, for forces b (m, inputs) in it."""
    state = modal.state
    m = len(state.basis)
    back = np.asarray(np.linalg.inv(state.basis), dtype=float)
    order = np.zeros(m, dtype=np.intp)
    return general_sum(modal, (back, np.eye(m)), order, np.arange(m), (back.T @ b, b), np.zeros(b.shape))
