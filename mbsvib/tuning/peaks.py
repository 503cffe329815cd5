"""Highest peaks of responses of small state spaces, as a search asks for them thousands of times.

In states that are eigenvectors, G(i w) = C V (i w - Lambda)^-1 V^-1 B + D costs little at hundreds of frequencies. They
lie about all poles; tops are refined, and the value at the highest is solved for anew. Frequencies at which the norm on
panels found higher peaks are remembered: a search drives towards peaks between the points.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Complex

# Distances from a pole at which responses are sampled, in parts of its real part.
BESIDE = np.array([-8.0, -3.0, -1.5, -0.8, -0.4, 0.0, 0.4, 0.8, 1.5, 3.0, 8.0])
COARSE, BEYOND = 40, 10.0  # further frequencies, up to the fastest pole times this and down to the slowest over this
CLOSE = 0.15  # least distance of frequencies, in parts of that to the nearest pole
TOP = 0.9  # singular values are computed where they may be this share of the highest
ROUNDS, POINTS = 5, 9  # of refinement: each shrinks the bracket by 4
TINY = 1e-300  # divisor of nothing
DEPENDENT = 1e9  # condition of the eigenvectors above which equations are solved in the given states


class Response:
    """A response C (i w - A)^-1 B + D of a stable A with known ``values`` and ``vectors`` of its eigenvalues."""

    def __init__(self, a: Array, ports: tuple[Array, Array, Array], eigen: tuple[Complex, Complex, Complex | None]):
        self.a, (self.b, self.c, self.d) = a, ports
        self.values, vectors, inverse = eigen
        self.modal = None if inverse is None else (self.c @ vectors, inverse @ self.b)

    def at(self, w: Array) -> Complex:
        """Return G (n, outputs, inputs)."""
        if self.modal is None:
            s = 1j * w[:, None, None] * np.eye(len(self.a)) - self.a
            return np.asarray(self.c @ np.linalg.solve(s, self.b.astype(complex)) + self.d)
        left, right = self.modal
        return np.asarray((left / (1j * w[:, None] - self.values)[:, None, :]) @ right + self.d)

    def sizes(self, w: Array) -> Array:
        """Return the largest singular values (n,), those that cannot be among the largest by a lower bound."""
        g = self.at(w)
        frobenius = np.linalg.norm(g, axis=(1, 2))
        if min(g.shape[1:]) == 1:
            return np.asarray(frobenius)
        result = frobenius / np.sqrt(min(g.shape[1:]))
        near = frobenius >= TOP * result.max()
        result[near] = _largest(g[near])
        return np.asarray(result)


def _largest(g: Complex) -> Array:
    rows, columns = g.shape[1:]
    h = g.conj().swapaxes(1, 2)
    return np.asarray(np.sqrt(np.maximum(np.linalg.eigvalsh(g @ h if rows < columns else h @ g)[:, -1], 0.0)))


def eigen(a: Array) -> tuple[Complex, Complex, Complex | None]:
    """Return eigenvalues, eigenvectors and their inverse, None where they are nearly dependent."""
    values, vectors = np.linalg.eig(a)
    sizes = np.linalg.norm(vectors, axis=1) + TINY
    try:
        inverse = np.linalg.inv(vectors / sizes[:, None])
    except np.linalg.LinAlgError:
        return values, vectors, None
    condition = np.sqrt(len(a)) * np.linalg.norm(inverse)
    return values, vectors, inverse / sizes if condition < DEPENDENT else None


def peak(response: Response, remembered: list[float]) -> tuple[float, float]:
    """Return the highest peak of a response and its frequency, inf where it is at infinity."""
    poles = response.values[response.values.imag >= 0.0]
    w = _sampled(poles, remembered)
    value = response.sizes(w)
    best = int(value.argmax())
    before, after = np.concatenate(([-np.inf], value[:-1])), np.concatenate((value[1:], [-np.inf]))
    # above the larger neighbour by no more than as far as that is above the other one: parabolas
    rise = 0.5 * np.maximum(2.0 * value - before - after, 0.0)
    tops = np.flatnonzero((value >= before) & (value >= after) & (value + rise >= value[best]))
    tops = np.union1d(tops, [best])
    where, highest = float(w[best]), float(value[best])
    low, high = w[np.maximum(tops - 1, 0)], w[np.minimum(tops + 1, len(w) - 1)]
    for _ in range(ROUNDS):
        grid = low[:, None] + (high - low)[:, None] * np.linspace(0.0, 1.0, POINTS)
        values = response.sizes(grid.ravel()).reshape(grid.shape)
        row, at = np.unravel_index(int(values.argmax()), values.shape)
        if values[row, at] > highest:
            where, highest = float(grid[row, at]), float(values[row, at])
        k, rows = values.argmax(axis=1), np.arange(len(values))
        low, high = grid[rows, np.maximum(k - 1, 0)], grid[rows, np.minimum(k + 1, POINTS - 1)]
        fall = values.max(axis=1) - np.minimum(values[rows, np.maximum(k - 1, 0)],
                                               values[rows, np.minimum(k + 1, POINTS - 1)])  # fmt: skip
        near = values.max(axis=1) + fall >= highest
        near[row] = True
        low, high = low[near], high[near]
    where, highest = _polished(response, where, highest, grid[row], values[row])
    far = float(np.linalg.norm(response.d, 2)) if response.d.any() else 0.0
    return (far, np.inf) if far >= highest else (highest, where)


def _sampled(poles: Complex, remembered: list[float]) -> Array:
    """Frequencies about all poles and beyond, no closer than the response can change: by the nearest pole."""
    size = np.abs(poles)
    slow, fast = float(size.min(initial=1.0)), float(size.max(initial=1.0))
    w = np.concatenate(([0.0], np.ravel(np.abs(poles.imag)[:, None] + np.abs(poles.real)[:, None] * BESIDE), size,
                        np.geomspace(slow / BEYOND, fast * BEYOND, COARSE), remembered))  # fmt: skip
    w = np.unique(w[(w >= 0.0) & (w < np.inf)])
    if not len(poles):
        return w
    closest = CLOSE * np.abs(1j * w[:, None] - poles).min(axis=1)
    kept = [0]
    for k in range(1, len(w)):
        if w[k] - w[kept[-1]] >= closest[k]:
            kept.append(k)
    return np.union1d(w[kept], [one for one in remembered if 0.0 <= one < np.inf])


def _polished(response: Response, where: float, highest: float, grid: Array, values: Array) -> tuple[float, float]:
    """The top of the parabola through the three highest of a grid, as gradients ask for the peak itself."""
    k = int(values.argmax())
    if not 0 < k < len(grid) - 1 or values[k] < highest:
        return where, highest
    fall, curvature = values[k + 1] - values[k - 1], values[k + 1] - 2.0 * values[k] + values[k - 1]
    if not curvature < 0.0:
        return where, highest
    w = float(grid[k] - 0.5 * (grid[k + 1] - grid[k]) * fall / curvature)
    value = float(response.sizes(np.array([w]))[0])
    return w, max(value, highest)


def peak_gradient(response: Response, w: float) -> tuple[float, Array]:
    """Return the largest singular value at a frequency and its gradient to [A B; C D]: Re([l; u] [r; v]^H)."""
    n, d = len(response.a), response.d
    if np.isinf(w):
        u, s, vh = np.linalg.svd(d)
        result = np.zeros((n + len(d), n + d.shape[1]))
        result[n:, n:] = np.outer(u[:, 0], vh[0])
        return float(s[0]), result
    matrix = 1j * w * np.eye(n) - response.a
    x = np.linalg.solve(matrix, response.b.astype(complex))
    u, s, vh = np.linalg.svd(response.c @ x + d)
    left = np.concatenate((np.linalg.solve(matrix.T, response.c.T @ u[:, 0].conj()), u[:, 0].conj()))
    right = np.concatenate((x @ vh[0].conj(), vh[0].conj()))
    return float(s[0]), np.outer(left, right).real
