"""What sets of sensors and actuators are judged by: information, and the mean squares that the best controller reaches.

Source: Gawronski, Advanced Structural Dynamics and Active Control of Structures (2004), chapter 7 (placement by
Gramians); Atkinson, Donev & Tobias, Optimum Experimental Designs, with SAS (2007), section 10 (information).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple, TypeAlias

import numpy as np

from mbsvib.common.arrays import Array, Complex
from mbsvib.errors import ResponseError
from mbsvib.isolation.riccati import riccati
from mbsvib.linalg.lyapunov import Lyapunov
from mbsvib.linalg.rank import NO_INFORMATION

Slopes = tuple[float, tuple[Array, Array]]


@dataclass(frozen=True, eq=False)
class Information:
    """Information ``matrices`` (n, p, p), one a candidate, which add up; ``parts`` {name: numbers} of its directions.

    loss = (``reference`` - log det(sum of x_k W_k)) / p, the reference that of all candidates
    """

    matrices: Array | Complex
    parts: Mapping[str, list[int]]
    reference: float = 0.0

    def scaled(self, who: str) -> Information:
        """Return the same with ones on the diagonal of the sum; refused if there is a direction without information."""
        total = self.matrices.sum(axis=0)
        size = np.sqrt(np.diagonal(total).real)
        for name, numbers in self.parts.items():
            if not size[numbers].all():
                raise ResponseError(f"placement: {name} is not {who} by any candidate; expected candidates at places "
                                    f"that move in it, or leave it out.")  # fmt: skip
        matrices = self.matrices / size[:, None] / size
        values, vectors = np.linalg.eigh(matrices.sum(axis=0))
        if values[0] < NO_INFORMATION:
            share = {name: float(np.linalg.norm(vectors[numbers, 0])) for name, numbers in self.parts.items()}
            most = [name for name in share if share[name] > 0.1 * max(share.values())]
            raise ResponseError(f"placement: all candidates together do not tell {' and '.join(most)} apart; expected "
                                f"more candidates, or fewer of these.")  # fmt: skip
        return Information(matrices, self.parts, float(np.log(values).sum()))

    def of(self, weights: Array) -> Array:
        """Return the losses (k,) of weights (k, n)."""
        values = np.linalg.eigvalsh(np.tensordot(weights, self.matrices, 1))
        told = values[:, 0] > NO_INFORMATION * values[:, -1]
        logarithm = np.log(values, out=np.zeros_like(values), where=told[:, None]).sum(axis=1)
        return np.where(told, (self.reference - logarithm) / values.shape[1], np.inf)

    def slope(self, weights: Array) -> Array:
        """Return the gradient (n,) of the loss."""
        inverse = np.linalg.inv(np.tensordot(weights, self.matrices, 1))
        return np.asarray(-np.einsum("nij,ji->n", self.matrices, inverse).real / len(inverse))

    def shares(self, weights: Array) -> dict[str, float]:
        """Return how much of the information about each part remains: inverse variances against all candidates."""
        if not np.isfinite(self.of(weights[None])[0]):
            return dict.fromkeys(self.parts, np.nan)
        before, after = (np.linalg.inv(np.tensordot(w, self.matrices, 1)) for w in (np.ones(len(weights)), weights))
        result = {}
        for name, numbers in self.parts.items():
            sizes = [np.linalg.slogdet(m[np.ix_(numbers, numbers)])[1] for m in (before, after)]
            result[name] = float(np.exp((sizes[0] - sizes[1]) / len(numbers)))
        return result


@dataclass(frozen=True, eq=False)
class Gramians:
    """Sensors by what they show of some modes, actuators by what they do to them; None where none are chosen."""

    sensors: Information | None
    actuators: Information | None
    joint, logarithmic = True, True

    def losses(self, sensors: Array, actuators: Array) -> Array:
        """Return the losses (k, l) of weights (k, sensors) with weights (l, actuators): the sums of both sides."""
        sides = [np.zeros(len(w)) if side is None else side.of(w)
                 for side, w in ((self.sensors, sensors), (self.actuators, actuators))]  # fmt: skip
        return np.asarray(sides[0][:, None] + sides[1])

    def slopes(self, sensors: Array, actuators: Array) -> Slopes:
        """Return the loss and its gradients."""
        sides = (self.sensors, sensors), (self.actuators, actuators)
        first, second = (np.zeros(len(w)) if side is None else side.slope(w) for side, w in sides)
        return float(self.losses(sensors[None], actuators[None])[0, 0]), (first, second)

    def values(self, sensors: Array, actuators: Array) -> dict[str, float]:
        """Return the share of each mode that remains, the product of both sides."""
        sides = [side.shares(w) for side, w in ((self.sensors, sensors), (self.actuators, actuators)) if side]
        return {name: float(np.prod([side[name] for side in sides])) for name in sides[0]}


@dataclass(frozen=True, eq=False)
class Experiments:
    """Information about parameters: of each sensor while each actuator alone excites, (sensors, actuators, p, p)."""

    matrices: Array
    parts: Mapping[str, list[int]]
    reference: float
    joint, logarithmic = False, True

    def _sensors(self, actuators: Array) -> Information:
        return Information(np.tensordot(actuators, self.matrices, (0, 1)), self.parts, self.reference)

    def losses(self, sensors: Array, actuators: Array) -> Array:
        """Return the losses (k, l)."""
        return np.stack([self._sensors(weights).of(sensors) for weights in actuators], axis=1)

    def slopes(self, sensors: Array, actuators: Array) -> Slopes:
        """Return the loss and its gradients."""
        exciting = Information(np.tensordot(sensors, self.matrices, 1), self.parts, self.reference)
        gradients = self._sensors(actuators).slope(sensors), exciting.slope(actuators)
        return float(self.losses(sensors[None], actuators[None])[0, 0]), gradients

    def values(self, sensors: Array, actuators: Array) -> dict[str, float]:
        """Return how much of the information about each parameter remains."""
        pairs = Information(self.matrices.reshape(-1, *self.matrices.shape[2:]), self.parts, self.reference)
        return pairs.shares(np.outer(sensors, actuators).ravel())


class Weighted(NamedTuple):
    """x' = a x + b1 w + b2 u,  z = c1 x + d12 u,  y = c2 x + d21 w + n: w of intensity 1, n of ``noise`` (sensors,),
    u of the cost u^2 ``effort`` (actuators,); outputs z over what is allowed.
    """

    a: Array
    b1: Array
    b2: Array
    c1: Array
    d12: Array
    c2: Array
    d21: Array
    noise: Array
    effort: Array


class _Side(NamedTuple):
    """Riccati's solution, its gain (rows of the ports), and what it passes on to the other side: Y and L R L^T of
    sensors, X and K^T R K of actuators.
    """

    solution: Array
    gain: Array
    passed: Array


@dataclass(frozen=True, eq=False)
class BestControl:
    """The least of E[z^T z + u^T R u] that any controller of a set reaches (LQG): loss = tr(Y K^T R K) + tr(X B B^T).

    Of sensors alone, the mean square of the error with which z is estimated; of actuators alone, z with known states.
    The loss is convex in 1/noise of the sensors, and in 1/effort of the actuators.
    Source: Zhou, Doyle & Glover, Robust and Optimal Control (1996), section 14.
    """

    plant: Weighted
    sensing: bool
    acting: bool
    joint, logarithmic = False, False
    _known: dict[tuple[str, bytes], _Side | None] = field(default_factory=dict)

    def _side(self, name: str, weights: Array) -> _Side | None:
        """One side at weights, None where no stabilising solution exists."""
        key = name, weights.tobytes()
        if key not in self._known:
            self._known[key] = self._solved(name, weights)
        return self._known[key]

    def _solved(self, name: str, weights: Array) -> _Side | None:
        p, on = self.plant, weights > 0.0
        costs = (p.noise if name == "sensors" else p.effort)[on] / weights[on]
        if name == "sensors":
            a, b, f, g = p.a.T, p.c2[on].T, p.b1.T, p.d21[on].T
        else:
            a, b, f, g = p.a, p.b2[:, on], p.c1, p.d12[:, on]
        try:
            solution, active = riccati(a, b, (f, g), costs)
        except ResponseError:
            return None
        gain, passed = np.zeros((len(weights), len(a))), g @ active
        gain[on] = active
        return _Side(solution, gain, passed.T @ passed + active.T @ (costs[:, None] * active))

    def losses(self, sensors: Array, actuators: Array) -> Array:
        """Return the losses (k, l)."""
        p, none = self.plant, None
        sensing = [self._side("sensors", w) if self.sensing else none for w in sensors]
        acting = [self._side("actuators", w) if self.acting else none for w in actuators]
        result = np.full((len(sensors), len(actuators)), np.inf)
        for i, one in enumerate(sensing):
            for j, other in enumerate(acting):
                if (self.sensing and one is None) or (self.acting and other is None):
                    continue
                result[i, j] = 0.0
                if one is not None:
                    result[i, j] += np.vdot(one.solution, p.c1.T @ p.c1 if other is None else other.passed)
                if other is not None:
                    result[i, j] += np.vdot(other.solution, p.b1 @ p.b1.T)
        return result

    def slopes(self, sensors: Array, actuators: Array) -> Slopes:
        """Return the loss and its gradients; noise and effort are inverse to the weights."""
        p, (first, second) = self.plant, (np.zeros(len(w)) for w in (sensors, actuators))
        one = self._side("sensors", sensors) if self.sensing else None
        other = self._side("actuators", actuators) if self.acting else None
        if one is not None:
            weight = p.c1.T @ p.c1 if other is None else other.passed
            back = Lyapunov(p.a - one.gain.T @ p.c2).observed(weight)
            first = -p.noise * _squares(sensors) * np.einsum("si,ij,sj->s", one.gain, back, one.gain)
        if other is not None:
            drive = p.b1 @ p.b1.T if one is None else one.passed
            spread = Lyapunov(p.a - p.b2 @ other.gain).controlled(drive)
            second = -p.effort * _squares(actuators) * np.einsum("ai,ij,aj->a", other.gain, spread, other.gain)
        return float(self.losses(sensors[None], actuators[None])[0, 0]), (first, second)

    def mean_squares(self, sensors: Array, actuators: Array) -> tuple[Array, Array]:
        """Return the mean squares of z, of sensors alone those of its errors, and of the actuators."""
        p = self.plant
        one = self._side("sensors", sensors) if self.sensing else None
        other = self._side("actuators", actuators) if self.acting else None
        error = np.zeros_like(p.a) if one is None else one.solution
        z, u = np.einsum("zi,ij,zj->z", p.c1, error, p.c1), np.zeros(len(actuators))
        if other is not None:
            drive = p.b1 @ p.b1.T if one is None else one.passed
            spread = Lyapunov(p.a - p.b2 @ other.gain).controlled(drive)
            seen = p.c1 - p.d12 @ other.gain
            z = z + np.einsum("zi,ij,zj->z", seen, spread, seen)
            u = np.einsum("ai,ij,aj->a", other.gain, spread, other.gain)
        return z, u


# How sets of sensors (first side) and of actuators (second side) are rated, by weights of both sides: ``joint`` if the
# loss is convex in both at once, ``logarithmic`` if it is the logarithm of a figure.
Criterion: TypeAlias = Gramians | Experiments | BestControl


def _squares(weights: Array) -> Array:
    """1 / weights^2, 0 of candidates that are left out."""
    return np.divide(1.0, weights**2, out=np.zeros_like(weights), where=weights > 0.0)
