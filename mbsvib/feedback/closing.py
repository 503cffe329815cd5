"""Closed loops of first-order equations, and gradients to the entries of their plant and of their controller.

The equations of a loop are a linear fractional map of those of the plant, M = [A B; C D], and of the controller,
X = [A_k B_k; C_k D_k]: dM_closed = E_L dM E_R. A change of M adds dM (x, u) to (x', y), of which the loop makes further
terms; (x, u) itself is a linear map of what drives the loop. The same holds for X. So a gradient of a number to the
entries of M_closed, G, is one to those of M by E_L^T G E_R^T.

Source: Zhou, Doyle & Glover, Robust and Optimal Control (1996), section 10.1.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from mbsvib.common.arrays import Array, Complex
from mbsvib.linalg.balancing import matrix_exponents

Matrices = tuple[Array, Array, Array, Array]

# A singular value of 1 - D K below this share of its terms is rounding: the loop has no solution.
ALGEBRAIC = 1e-12


class ClosedSpace(NamedTuple):
    """x' = a x + b w, y = c x + d w of a closed loop; its controllers demand gain x + push w of their actuators."""

    a: Array
    b: Array
    c: Array
    d: Array
    gain: Array
    push: Array


def transfer(space: Matrices, s: Complex) -> Complex:
    """Return C (s - A)^-1 B + D (n, outputs, inputs) at points ``s`` (n,), D at infinite ones."""
    a, b, c, d = space
    result, near = np.broadcast_to(d, (len(s), *d.shape)).astype(complex), np.isfinite(s)
    if len(a) and near.any():
        result[near] += c @ np.linalg.solve(s[near, None, None] * np.eye(len(a)) - a, b)
    return result


def on_axis(w: Array) -> Complex:
    """Return i w for angular frequencies (n,), infinite ones among them."""
    s = np.zeros(len(w), dtype=complex)
    s.imag = w
    return s


def regular(product: Array) -> bool:
    """Return whether 1 - D K can be inverted, for the product D K (n, n) of the feedthroughs, in any units of ports."""
    n = len(product)
    if not n:
        return True
    power = matrix_exponents(product)
    product = np.ldexp(product, power[None, :] - power[:, None])
    smallest = np.linalg.svd(np.eye(n) - product, compute_uv=False)[-1]
    return bool(smallest > ALGEBRAIC * (1.0 + np.linalg.norm(product, 2)))


def closed_space(plant: Matrices, law: Matrices, sensors: list[int], actuators: list[int]) -> ClosedSpace:
    """Return A, B, C, D of a plant under u = w + K y, in continuous or discrete time; states of the plant come first.

    ``plant``, ``law``: A, B, C, D. ``sensors``, ``actuators``: numbers of the outputs and inputs of the plant that the
    controller has, in its order.
    """
    (a, b, c, d), (ka, kb, kc, kd) = plant, law
    n, through = len(a), d[np.ix_(sensors, actuators)]
    loop = np.eye(len(sensors)) - through @ kd
    # y = observed (x, z) + direct w
    observed = np.linalg.solve(loop, np.concatenate((c[sensors], through @ kc), axis=1))
    direct = np.linalg.solve(loop, d[sensors])
    gain, push = kd @ observed, kd @ direct
    gain[:, n:] += kc
    acts = b[:, actuators]
    closed_a = np.concatenate((acts @ gain, kb @ observed))
    closed_a[:n, :n] += a
    closed_a[n:, n:] += ka
    closed_c = d[:, actuators] @ gain
    closed_c[:, :n] += c
    closed_d = d + d[:, actuators] @ push
    closed_c[sensors], closed_d[sensors] = observed, direct  # sums cancel where K times the feedthrough is large
    return ClosedSpace(closed_a, np.concatenate((b + acts @ push, kb @ direct)), closed_c, closed_d, gain, push)


@dataclass(frozen=True, eq=False)
class Gathered:
    """Ports by number among those of a plant, some of them more than once: ``rows`` of outputs, ``columns`` of inputs,
    -1 for none. ``direct``: numbers of outputs and of inputs gathered, of which each output has one input added to it.
    """

    rows: list[int]
    columns: list[int]
    direct: tuple[list[int], list[int]] = ([], [])

    def of(self, plant: Matrices) -> Matrices:
        """Return A, B, C, D with these ports."""
        a, b, c, d = plant
        through = np.pad(d, (0, 1))[np.ix_(self.rows, self.columns)]
        through[self.direct] += 1.0
        return a, np.pad(b, ((0, 0), (0, 1)))[:, self.columns], np.pad(c, ((0, 1), (0, 0)))[self.rows], through

    def back(self, gradient: Array, plant: Matrices) -> Array:
        """Return the gradient to [A B; C D] of the plant, of one to those with these ports."""
        n, (p, q) = len(plant[0]), plant[3].shape
        result = np.zeros((n + p + 1, n + q + 1))
        rows, columns = ([*range(n), *[n + k % (count + 1) for k in numbers]] for numbers, count in
                         ((self.rows, p), (self.columns, q)))  # fmt: skip
        np.add.at(result, np.ix_(rows, columns), gradient)
        return result[:-1, :-1]


@dataclass(frozen=True, eq=False)
class Closure:
    """A plant A, B, C, D under u = w + K y with the ``law`` A, B, C, D from the outputs ``sensors`` to the inputs
    ``actuators``, seen from the inputs ``sources`` to the outputs ``shown``, all by number.
    """

    plant: Matrices
    law: Matrices
    sensors: list[int]
    actuators: list[int]
    shown: list[int]
    sources: list[int]

    @cached_property
    def _space(self) -> ClosedSpace:
        return closed_space(self.plant, self.law, self.sensors, self.actuators)

    @property
    def closed(self) -> Matrices:
        """A, B, C, D of the loop from the sources to the outputs shown; states of the plant come first."""
        a, b, c, d, *_ = self._space
        return a, b[:, self.sources], c[self.shown], d[self.shown][:, self.sources]

    @cached_property
    def _acts(self) -> Array:
        """T, by which a command d of the controller becomes u = T d in the loop, (1 - D_k D_yu)^-1."""
        through = self.plant[3][np.ix_(self.sensors, self.actuators)]
        return np.asarray(np.linalg.inv(np.eye(len(self.actuators)) - self.law[3] @ through))

    @cached_property
    def _pushed(self) -> Array:
        """(x', z', y) of the loop by a command of the controller, (closed rows, actuators)."""
        _, b, _, d = self.plant
        at_sensors = self.law[1] @ d[np.ix_(self.sensors, self.actuators)]
        rows = b[:, self.actuators], at_sensors, d[np.ix_(self.shown, self.actuators)]
        return np.concatenate(rows) @ self._acts

    @cached_property
    def _around_plant(self) -> tuple[Array, Array]:
        """E_L and E_R of the plant."""
        (a, b, c, _), (ka, kb, *_), gain, push = self.plant, self.law, self._space.gain, self._space.push
        n, k, p, q = len(a), len(ka), len(c), b.shape[1]
        left = np.zeros((n + k + len(self.shown), n + p))
        left[:n, :n] = np.eye(n)
        left[n + k + np.arange(len(self.shown)), n + np.array(self.shown, dtype=np.intp)] = 1.0
        sensors = n + np.array(self.sensors, dtype=np.intp)
        left[n : n + k, sensors] += kb
        left[:, sensors] += self._pushed @ self.law[3]
        right = np.zeros((n + q, n + k + len(self.sources)))
        right[:n, :n] = np.eye(n)
        right[n + np.array(self.sources, dtype=np.intp), n + k + np.arange(len(self.sources))] = 1.0
        right[n + np.array(self.actuators, dtype=np.intp)] += np.concatenate((gain, push[:, self.sources]), axis=1)
        return left, right

    @cached_property
    def _around_law(self) -> tuple[Array, Array]:
        """E_L and E_R of the controller."""
        (a, _, c, d), (ka, _, kc, kd) = self.plant, self.law
        n, k = len(a), len(ka)
        left = np.zeros((n + k + len(self.shown), k + len(self.actuators)))
        left[n : n + k, :k] = np.eye(k)
        left[:, k:] = self._pushed
        through = d[np.ix_(self.sensors, self.actuators)]
        measured = np.concatenate((c[self.sensors], through @ kc, d[np.ix_(self.sensors, self.sources)]), axis=1)
        seen = np.linalg.solve(np.eye(len(self.sensors)) - through @ kd, measured)
        right = np.zeros((k + len(self.sensors), n + k + len(self.sources)))
        right[:k, n : n + k] = np.eye(k)
        right[k:] = seen
        return left, right

    def to_plant(self, gradient: Array) -> Array:
        """Return the gradient to the entries of [A B; C D] of the plant, (states + outputs, states + inputs).

        ``gradient`` (closed states + shown, closed states + sources): that to the entries of the ``closed`` equations.
        """
        left, right = self._around_plant
        return np.asarray(left.T @ gradient @ right.T)

    def to_law(self, gradient: Array) -> Array:
        """Return the gradient to the entries of [A B; C D] of the controller, (states + actuators, states + sensors).

        ``gradient``: as of ``to_plant``.
        """
        left, right = self._around_law
        return np.asarray(left.T @ gradient @ right.T)

    def along(self, plant: Array | None, law: Array | None) -> Array:
        """Return the changes of [A B; C D] of the ``closed`` equations that those of the plant and of the controller
        make, (..., closed states + shown, closed states + sources); None: no change.
        """
        changes = [(pair, change) for pair, change in ((self._around_plant, plant), (self._around_law, law))
                   if change is not None]  # fmt: skip
        return np.asarray(sum(left @ change @ right for (left, right), change in changes))
