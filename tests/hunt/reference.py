"""Answers of the absolute equations: eigenvalues, responses, reactions, and how far rounding of the data moves them."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import eigvals
from scipy.optimize import linear_sum_assignment

from mbsvib.linalg.rank import EPS
from tests.hunt.equations import Equations

# The equations are taken again with every entry changed by this share; what comes of it, times ALLOWED, is allowed for.
CHANGE = 1e-14
ALLOWED = 100.0
# Of sums this share of the terms is allowed for.
CANCELLATION = 1e-12
# Motions are known to a few roundings of the largest coordinate, and forces in joints to those of all that act.
ROUNDING = 64 * float(np.finfo(float).eps)
# Responses are zero below this, in SI units.
NOTHING = 1e-25
# Singular values of M, and of C on motions without mass, below this share of the largest are rounding.
MASSLESS = 1e-12
# Forces in the pose that are left over by more than this share are no balance.
BALANCE = 1e-8


@dataclass(frozen=True)
class Matrices:
    """Projected equations M, C, K, B (m), and outputs in these coordinates, per order of derivative."""

    M: np.ndarray
    C: np.ndarray
    K: np.ndarray
    B: np.ndarray
    out: tuple[Any, ...]
    sizes: tuple[Any, ...]
    of_multipliers: object
    D: np.ndarray
    outside: np.ndarray
    reach: tuple[Any, ...]
    of_forces: object
    acting: np.ndarray

    def response(self, omega):
        """Responses (outputs, inputs, frequencies), the size of the terms that they are sums of, and what they would be
        if all coordinates moved by as much as the motion is large, or all forces acted on the joint.
        """
        result = np.empty((*self.D.shape, len(omega)), complex)
        size, unit = np.empty(result.shape), np.empty(result.shape)
        for k, w in enumerate(omega):
            s = 1j * w
            z = np.linalg.solve(s * s * self.M + s * self.C + self.K, self.B) if len(self.M) else self.B.astype(complex)
            of_forces, size_of_forces = self.of_multipliers(s, z)
            result[:, :, k] = sum(s**i * rows @ z for i, rows in enumerate(self.out)) + self.D + of_forces
            size[:, :, k] = sum(abs(w) ** i * rows @ np.abs(z) for i, rows in enumerate(self.sizes)) + np.abs(self.D)
            size[:, :, k] += size_of_forces + self.outside
            reach = sum(abs(w) ** i * rows for i, rows in enumerate(self.reach))
            unit[:, :, k] = reach[:, None] * np.linalg.norm(z, axis=0)
            unit[:, :, k] += self.of_forces(abs(w), np.abs(z))
            unit[:, :, k] += reach[:, None] * self._rounded(s)
        return result, size, unit

    def _rounded(self, s):
        """Motions by rounding of N^T F, one per input: all that moves where constraints hold what an input acts on."""
        if not len(self.M):
            return np.zeros(len(self.acting))
        compliance = np.linalg.norm(np.linalg.inv(s * s * self.M + s * self.C + self.K), 2)
        return ALLOWED * CHANGE * compliance * np.sqrt(len(self.M)) * self.acting

    def eigenvalues(self, shift, order):
        """The finite eigenvalues: of the inverse about a shift, as many as there are, the largest."""
        m = len(self.M)
        if not m:
            return np.empty(0, complex)
        scale = abs(shift)
        unit, zero = np.eye(m), np.zeros((m, m))
        left = np.block([[zero, unit], [-self.K, -scale * self.C]])
        right = np.block([[unit, zero], [zero, scale**2 * self.M]])
        inverse = np.linalg.solve(left - shift / scale * right, right)
        values = eigvals(inverse)
        large = np.argsort(-np.abs(values), kind="stable")[:order]
        return shift + scale / values[large]

    @property
    def order(self):
        """The number of finite eigenvalues: two for each motion with mass, one where only dampers resist."""
        if not len(self.M):
            return 0
        _, sizes, turn = np.linalg.svd(self.M)
        without = turn[sizes <= MASSLESS * sizes[0]].T
        damped = np.linalg.svd(without.T @ self.C @ without, compute_uv=False)
        mass, damping, stiffness = (np.linalg.norm(one, 2) for one in (self.M, self.C, self.K))
        rounded = max(MASSLESS * damping, EPS * np.sqrt(mass * stiffness))  # damping may be rounding alone
        return 2 * len(self.M) - 2 * without.shape[1] + int(np.sum(damped > rounded))


class Reference:
    """The answers to a scene; ``tolerances`` are what they move when the data are rounded."""

    def __init__(self, scene):
        self.equations = Equations(scene)
        e = self.equations
        self.dof, self.redundant = e.dof, e.redundant
        self.matrices = projected(e)
        self.changed = [projected(e, np.random.default_rng(seed)) for seed in range(2)]

    @property
    def balanced(self):
        e = self.equations
        return not e.scene.loaded or bool(np.all(np.abs(e.lacking) <= BALANCE * e.size_of_forces.max(initial=0.0)))

    @cached_property
    def shift(self):
        """A point off the axes, of the size of a middling eigenvalue."""
        if not self.dof:
            return 1.0 + 0.0j
        mass, damping, stiffness = (
            np.abs(np.diag(a)).sum() for a in (self.matrices.M, self.matrices.C, self.matrices.K)
        )
        size = np.sqrt(stiffness / mass) if mass else stiffness / damping if damping else 1.0
        return (0.31 + 0.77j) * max(size, 1e-3)

    @cached_property
    def eigenvalues(self):
        values = self.matrices.eigenvalues(self.shift, self.matrices.order)
        return values[np.argsort(np.abs(values), kind="stable")]

    @cached_property
    def eigenvalue_tolerance(self):
        """Tolerance of each eigenvalue."""
        move = np.zeros(len(self.eigenvalues))
        for matrices in self.changed:
            others = matrices.eigenvalues(self.shift, self.matrices.order)
            _, distance = matched(self.eigenvalues, others)
            move = np.maximum(move, distance)
        return ALLOWED * move

    def response(self, omega):
        """Responses, and the tolerance of each entry."""
        answer, size, unit = self.matrices.response(omega)
        move = np.max([np.abs(matrices.response(omega)[0] - answer) for matrices in self.changed], axis=0)
        rounded = ROUNDING * unit.max(axis=2, keepdims=True)
        return answer, ALLOWED * move + CANCELLATION * size + rounded + NOTHING

    @cached_property
    def determined(self):
        """Which outputs do not depend on how redundant constraints share forces."""
        e = self.equations
        free = np.abs(e.ports.Rl @ e.undetermined)
        size = np.abs(e.ports.Rl) @ np.abs(e.row_unit)
        return np.all(free <= 1e-8 * size[:, None], axis=1)

    @cached_property
    def determined_joints(self):
        """Which joints' forces do not depend on that, by name."""
        e = self.equations
        limit = 1e-8 * e.row_unit.max(initial=0.0)
        return {name: bool(np.abs(part @ e.undetermined).max(initial=0.0) <= limit) for name, part in e.parts_l.items()}

    @property
    def reactions(self):
        return self.equations.wrenches


def projected(e, rng=None):
    """The equations on the null space of the constraints; with ``rng`` from data that are changed at random."""

    def near(matrix):
        return matrix if rng is None else matrix * (1 + CHANGE * rng.uniform(-1, 1, size=matrix.shape))

    i = e.moving
    n = e.N if rng is None else e.N + CHANGE * e.unit[i][:, None] * rng.uniform(-1, 1, size=e.N.shape)
    mass, damping, stiffness, forces = (near(a) for a in (e.M, e.C, e.K, e.forces))
    m, c, k = (a[np.ix_(i, i)] for a in (mass, damping, stiffness))
    ports = [near(rows) for rows in (e.ports.Rq, e.ports.Rv, e.ports.Ra)]
    multiplied = near(e.ports.Rl)

    def of_multipliers(s, z):
        if not e.ports.size.any():
            return 0.0, 0.0
        forces_in_joints = e.reactions(forces[i] - (s * s * m + s * c + k) @ (n @ z))
        return multiplied @ forces_in_joints, e.ports.size @ np.abs(forces_in_joints)

    def of_forces(w, z):
        """Size of all forces that act, unit by unit, for outputs that are sums of such forces."""
        moved = np.abs(e.N) @ z
        terms = np.abs(forces[i]) + w * w * np.abs(m) @ moved + w * np.abs(c) @ moved + np.abs(k) @ moved
        return e.ports.force[:, None] * (e.unit[i][:, None] * terms).max(axis=0, initial=0.0)

    out = tuple(rows[:, i] @ n for rows in ports)
    reach = tuple(np.abs(rows[:, i]) @ e.unit[i] for rows in ports)
    sizes = tuple(np.abs(rows[:, i]) @ np.abs(n) for rows in ports)
    mass, force = n.T @ m @ n, n.T @ forces[i]
    # accelerations at once, from which those of slow motions differ by little
    at_once = sizes[2] @ np.abs(np.linalg.lstsq(mass, force, rcond=1e-9)[0]) if e.dof else 0.0
    return Matrices(mass, n.T @ c @ n, n.T @ k @ n, force, out, sizes, of_multipliers, near(e.ports.D),
                    e.ports.outside + at_once, reach, of_forces, e.unit[i] @ np.abs(forces[i]))  # fmt: skip


def matched(values, others):
    """The others in the order of the values, each to its nearest as a whole, and the distances."""
    cost = np.abs(values[:, None] - others[None, :])
    rows, columns = linear_sum_assignment(
        cost / (1e-300 + np.abs(values)[:, None] + 1e-9 * np.abs(values).max(initial=0.0))
    )
    order = np.empty(len(values), dtype=int)
    order[rows] = columns
    return others[order], cost[np.arange(len(values)), order]
