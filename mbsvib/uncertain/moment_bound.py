"""A root mean square that no values within limits exceed: covariances as polynomials of the parameters, with a proof.

E x' = A x + B u,  E, A, B, C affine in the parameters;  P(x) the covariance under white noise of unit intensity

The polynomial p is P at sampled values. What it leaves of the Lyapunov equation is a polynomial, so that its
coefficients bound it,

R = A p E^T + E p A^T + B B^T,  |R| <= rho,       A W E^T + E W A^T + I <= theta < 1 with another polynomial W

and P <= p + rho / (1 - theta) W everywhere: the equations stay regular and stable within the box, by continuity from
its middle. Where the degree does not suffice the box is halved.

Source: Lyapunov's theorem and monotony of its solution, Zhou, Doyle & Glover, Robust and Optimal Control (1996),
section 3.8; parameter-dependent solutions: Chesi, Garulli, Tesi & Vicino, IEEE Trans. Automatic Control 50 (2005) 365.

Polynomials of several variables from -1 to 1: sums of products of Chebyshev polynomials, with matrices as factors.

f(x) = sum over |alpha| <= degree of F_alpha T_alpha1(x_1) T_alpha2(x_2) ...

Every product of T is between -1 and 1, so that |f| is at most the sum of |F_alpha|.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import comb

import numpy as np

from mbsvib.common.arrays import Array, Index
from mbsvib.feedback.closing import Matrices
from mbsvib.linalg.rank import ZERO_RATE

Powers = tuple[int, ...]


@dataclass(frozen=True)
class Basis:
    """All products of Chebyshev polynomials of ``count`` variables up to a total ``degree``."""

    count: int
    degree: int

    @cached_property
    def powers(self) -> tuple[Powers, ...]:
        """The degrees of each product in each variable, lowest total degree first."""
        found: list[Powers] = [()]
        for _ in range(self.count):
            found = [(*p, k) for p in found for k in range(self.degree - sum(p) + 1)]
        return tuple(sorted(found, key=lambda p: (sum(p), p)))

    @cached_property
    def place(self) -> dict[Powers, int]:
        """The number of each product."""
        return {p: k for k, p in enumerate(self.powers)}

    @cached_property
    def nodes(self) -> Array:
        """Points (m, count) at which a polynomial is sampled, twice as many as products, spread at random."""
        rng = np.random.default_rng(0)
        return np.asarray(np.cos(np.pi * rng.random((2 * len(self.powers) + 8, self.count))))

    def at(self, x: Array) -> Array:
        """Return the products (m, products) at points (m, count)."""
        single = np.ones((self.degree + 1, *x.shape))
        single[1:2] = x
        for k in range(2, self.degree + 1):
            single[k] = 2.0 * x * single[k - 1] - single[k - 2]
        result = np.ones((len(x), len(self.powers)))
        for j, of_variable in enumerate(np.array(self.powers, dtype=np.intp).T.reshape(self.count, -1)):
            result *= single[of_variable, :, j].T
        return result

    @cached_property
    def inverse(self) -> Array:
        """Coefficients by values at the nodes, (products, m)."""
        return np.asarray(np.linalg.pinv(self.at(self.nodes)), dtype=float)

    def fitted(self, values: Array) -> Array:
        """Return coefficients (products, ...) of values (m, ...) at the nodes, by least squares."""
        return np.asarray((self.inverse @ values.reshape(len(values), -1)).reshape(-1, *values.shape[1:]))

    def raised(self, j: int) -> tuple[Index, Index]:
        """Products in the next basis of which half the sum is each product times x_j."""
        above = basis(self.count, self.degree + 1).place
        up, down = (np.array([above[(*p[:j], abs(p[j] + step), *p[j + 1 :])] for p in self.powers], dtype=np.intp)
                    for step in (1, -1))  # fmt: skip
        return up, down

    @cached_property
    def raises(self) -> tuple[tuple[Index, Index], ...]:
        """``raised`` for each variable."""
        return tuple([self.raised(j) for j in range(self.count)])

    @cached_property
    def halves(self) -> Array:
        """Matrices (count, 2, products, products) to coefficients on the half of the box in which x_j is below or above
        0, where it is from -1 to 1 again.
        """
        result = np.empty((self.count, 2, len(self.powers), len(self.powers)))
        for j, side in np.ndindex(self.count, 2):
            x = self.nodes.copy()
            x[:, j] = 0.5 * x[:, j] + side - 0.5
            result[j, side] = self.inverse @ self.at(x)
        return result


@lru_cache(maxsize=32)
def basis(count: int, degree: int) -> Basis:
    """Return the products of so many variables up to a total degree."""
    return Basis(count, degree)


def times(coefficients: Array, own: Basis, affine: Array) -> Array:
    """Return a polynomial of matrices (products, k, n) times the transpose of ``affine`` (count + 1, m, n), the matrix
    at 0 and the slopes, in the next basis.
    """
    above = basis(own.count, own.degree + 1)
    result = np.zeros((len(above.powers), coefficients.shape[1], affine.shape[1]))
    result[[above.place[p] for p in own.powers]] = coefficients @ affine[0].T
    for slope, (up, down) in zip(affine[1:], own.raises, strict=True):
        if slope.any():
            term = 0.5 * (coefficients @ slope.T)
            np.add.at(result, up, term)
            np.add.at(result, down, term)
    return result


def largest(coefficients: Array, own: Basis, reached: float, near: float, most: int) -> float:
    """Return a number that a polynomial (products,) does not exceed.

    It is at most by the share ``near`` above its largest value, or above ``reached``, a value of interest, unless
    ``most`` halvings of the box do not suffice.
    """
    boxes = [(_bound(coefficients), coefficients)]
    for _ in range(most):
        k = int(np.argmax([bound for bound, _ in boxes]))
        bound, here = boxes[k]
        slopes = here[[own.place[tuple(row)] for row in np.eye(own.count, dtype=int).tolist()]]
        corner = np.where(slopes < 0.0, -1.0, 1.0)[None]  # to which the linear terms point
        reached = max(reached, float((own.at(corner) @ here)[0]))
        if bound <= (1.0 + near) * reached:
            break
        weights = np.abs(here) @ np.array(own.powers, dtype=float).reshape(len(here), own.count)
        boxes[k : k + 1] = [(_bound(part), part) for part in own.halves[int(weights.argmax())] @ here]
    return max(bound for bound, _ in boxes)


def _bound(coefficients: Array) -> float:
    return float(coefficients[0] + np.abs(coefficients[1:]).sum())


NEAR = 1e-3  # share of the mean square up to which a bound is made nearer
PRODUCTS = 500  # of the largest basis
BOXES = 64  # into which the limits are halved at most
WORK = 8000  # boxes times products
DEGREES = (2, 4, 6, 8, 12)  # of polynomials, tried in turn
OPEN = 3  # boxes without a bound, beyond which halving leads nowhere
HALVINGS = 200  # in search of the largest value of a polynomial


@dataclass(frozen=True, eq=False)
class Affine:
    """E x' = A x + B u, y = C x: each (parameters + 1, ...), the matrix in the middle of a box, and its slopes."""

    e: Array
    a: Array
    b: Array
    c: Array

    def within(self, low: Array, high: Array) -> Affine:
        """Return the same on a part of the box."""
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        return Affine(*[np.concatenate(((part[0] + np.tensordot(middle, part[1:], axes=1))[None],
                                        half[:, None, None] * part[1:]))
                        for part in (self.e, self.a, self.b, self.c)])  # fmt: skip

    def at(self, x: Array) -> tuple[Array, Array, Array]:
        """Return E^-1 A, E^-1 B and E^-1 at points (m, parameters)."""
        e, a, b = (part[0] + np.tensordot(x, part[1:], axes=1) for part in (self.e, self.a, self.b))
        one = np.broadcast_to(np.eye(len(e[0])), e.shape)
        n, solved = len(e[0]), np.linalg.solve(e, np.concatenate((a, b, one), axis=2))
        return solved[..., :n], solved[..., n:-n], solved[..., -n:]


def affine(space: Matrices, owner: Index, limits: Array) -> Affine | None:
    """Return equations whose first inputs and outputs are those of changes delta within limits (parameters, 2), None
    where they are not affine.

    Channels that weigh accelerations are z = S x' + G u: their changes are those of E.
    """
    a, b, c, d = space
    r, n = len(owner), len(a)
    straight = ~d[:r, :r].any(axis=1)
    states, wanted = np.concatenate((a, b[:, :r]), axis=1), np.concatenate((c[:r], d[:r, :r]), axis=1)
    s = np.linalg.lstsq(states.T, wanted.T, rcond=None)[0].T
    s[straight] = 0.0
    misses = np.abs(s @ states - wanted)[~straight].max(initial=0.0) > ZERO_RATE * np.abs(wanted).max(initial=0.0)
    g, through = d[:r, r:] - s @ b[:, r:], d[r:, :r]
    if misses or through[:, ~straight].any() or d[r:, r:].any():
        return None
    parts = [[np.eye(n)], [a], [b[:, r:]], [c[r:]]]
    for k in range(len(limits)):
        own = owner == k
        mass, other = own & ~straight, own & straight
        if (through[:, own] @ g[own]).any():
            return None
        for part, slope in zip(parts, (-b[:, :r][:, mass] @ s[mass], b[:, :r][:, other] @ c[:r][other],
                                       b[:, :r][:, own] @ g[own], through[:, other] @ c[:r][other]), strict=True):
            part.append(slope)  # fmt: skip
    return Affine(*[np.array(part) for part in parts]).within(limits[:, 0], limits[:, 1])


def moment_bound(equations: Affine, reached: float) -> float:
    """Return a mean square that no values in the box exceed, infinite if none is proven; ``reached``: one that is."""
    count = len(equations.a) - 1
    ends = -np.ones(count), np.ones(count)
    boxes = [(*_proven(equations, reached), *ends)]
    most = min(BOXES, WORK // max(comb(count + k, k) for k in _degrees(count)))
    while len(boxes) < most:
        k = int(np.argmax([box[0] for box in boxes]))
        bound, j, low, high = boxes[k]
        if bound <= (1.0 + NEAR) * reached or np.isinf([box[0] for box in boxes]).sum() > OPEN:
            break
        middle = 0.5 * (low[j] + high[j])
        boxes.pop(k)
        for side, value in ((high, middle), (low, middle)):
            ends = low.copy(), high.copy()
            ends[0 if side is low else 1][j] = value
            boxes.append((*_proven(equations.within(*ends), reached), *ends))
    return float(max(box[0] for box in boxes))


def _proven(equations: Affine, reached: float) -> tuple[float, int]:
    """A bound on a box, and the parameter that asks for the highest degree."""
    count, result = len(equations.a) - 1, (np.inf, 0)
    for degree in _degrees(count):
        result = min(result, _of_degree(equations, basis(count, degree), reached))
        if result[0] <= (1.0 + NEAR) * reached:
            break
    return result


def _degrees(count: int) -> list[int]:
    """Degrees of polynomials that are tried for so many parameters."""
    return [degree for degree in DEGREES if comb(count + degree, degree) <= PRODUCTS] or [DEGREES[0]]


def _of_degree(equations: Affine, own: Basis, reached: float) -> tuple[float, int]:
    a, b, one = equations.at(own.nodes)
    solved = Covariances(a)
    if solved.growth >= 0.0:
        return np.inf, 0
    w = own.fitted(solved.under(one))
    powers = np.array(own.powers, dtype=float).reshape(-1, own.count)
    j = int((np.square(powers).T @ np.linalg.norm(w, axis=(1, 2))).argmax())
    theta = _size(_residual(equations, w, own, np.eye(len(w[0]))[None], 0))
    if theta >= 1.0:
        return np.inf, j
    p, start = own.fitted(solved.under(b)), basis(own.count, 0)
    noise = times(times(np.eye(b.shape[2])[None], start, equations.b).swapaxes(1, 2), basis(own.count, 1), equations.b)
    rho = _size(_residual(equations, p, own, noise, 2))
    bound, c = p + rho / (1.0 - theta) * w, equations.c  # of P; then c P c^T
    if not c[1:].any():
        square = np.asarray(np.einsum("i,kij,j->k", c[0, 0], bound, c[0, 0]))
        return largest(square, own, reached, NEAR, HALVINGS), j
    square = times(times(bound, own, c).swapaxes(1, 2), basis(own.count, own.degree + 1), c)[:, 0, 0]
    return largest(square, basis(own.count, own.degree + 2), reached, NEAR, HALVINGS), j


def _residual(equations: Affine, p: Array, own: Basis, drive: Array, degree: int) -> Array:
    """Coefficients of A p E^T + E p A^T + drive."""
    left = times(p, own, equations.a)
    half = times(left.swapaxes(1, 2), basis(own.count, own.degree + 1), equations.e)
    result = half + half.swapaxes(1, 2)
    above, of_drive = basis(own.count, own.degree + 2), basis(own.count, degree)
    result[[above.place[k] for k in of_drive.powers]] += drive
    return result


def _size(coefficients: Array) -> float:
    """A bound of the norm of a polynomial."""
    return float(np.linalg.norm(coefficients, 2, axis=(1, 2)).sum())


class Covariances:
    """About the solutions of A P + P A^T + b b^T = 0, by eigenvectors of all A (m, n, n) at once."""

    def __init__(self, a: Array) -> None:
        values, self.right = np.linalg.eig(a)
        self.left = np.linalg.inv(self.right)
        self.sums = values[:, :, None] + values.conj()[:, None, :]
        self.growth = float(values.real.max(initial=-np.inf))

    def under(self, b: Array) -> Array:
        """Return P (m, n, n) for b (m, n, s)."""
        inner = self.left @ b
        p = self.right @ (-inner @ inner.conj().swapaxes(1, 2) / self.sums) @ self.right.conj().swapaxes(1, 2)
        return np.asarray(0.5 * (p + p.conj().swapaxes(1, 2)).real)
