"""What a fit knows: covariance of its values, what the data do not tell, and whether the structure explains them.

J^T J = sum over all rows of J, whitened, has the inverse of the covariance. Directions of which the standard deviation
exceeds the size of their values are not told by the data: they have no interval. Where residuals are larger than the
noise, or smooth along the lines, the structure is not that of the measured machine: the covariance is then
(J^T J)^-1 J^T R J (J^T J)^-1 with R of blocks of neighbouring lines, never that of the noise. Where errors of
neighbouring lines are alike, R of noise alone has their correlation, and residuals are compared with those beyond.

Source: Ljung, System Identification (1999), sections 9 and 16; White, Econometrica 48 (1980) 817, for the covariance;
Brockwell & Davis, Time Series (1991), section 7.2, for the variance 1 + 2 sum rho^2 of correlations beyond.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from mbsvib.common.arrays import Array, Bools, Complex
from mbsvib.common.display import Displayed
from mbsvib.fitting.mode_data import ModeData
from mbsvib.fitting.problem import CONVERGED, Problem, real_rows
from mbsvib.fitting.response_data import ResponseData, lines_alike
from mbsvib.linalg.rank import TIE_BREAK

# Directions with singular values below this share of the largest are lost in rounding, and have this deviation; the
# deviation from which these are not told, in parts of the size of values; shares of a value in one that are not named;
# of its square, that make it untold.
SMALLEST_SHARE, LOST, LARGEST_DEVIATION, NAMED, TOLD = 1e-6, 1e8, 1.0, 0.1, 0.01
# Intervals leave as much to both sides as makes 95 %.
QUANTILE = 0.975
# Probability of residuals of noise alone that counts as none.
REFUSED = 1e-3
# Bands are where the power of residuals, averaged over so many lines to both sides, is this many times its mean.
BESIDE, STANDS_OUT = 3, 2.0
# Lines in a block of the covariance from residuals, at least so many blocks a value.
BLOCKS = 3
# Least share of the deviation from independent lines: correlations of errors are known to some digits only.
LEAST_SHARE = 0.1


@dataclass(frozen=True, slots=True, repr=False)
class ResidualTest(Displayed):
    """Whether the residuals are noise: ``passed``; ``ratio``: chi^2 over its degrees of freedom, not a number without
    known noise; ``correlation`` of residuals with those of the next line of other noise, 0 for noise, or that of their
    phases where the noise is not known, if that is larger; ``bands`` [Hz] that the structure does not reach.
    """

    passed: bool
    ratio: float
    correlation: float
    bands: tuple[tuple[float, float], ...]


@dataclass(frozen=True, eq=False)
class Knowledge:
    """Covariance of x (v, v), infinite on the diagonal where ``told`` (v,) is false; combinations that are not told,
    each {name: share}; the test of the residuals; degrees of freedom of the noise, infinite where it is known.
    """

    covariance: Array
    told: Bools
    combinations: tuple[dict[str, float], ...]
    test: ResidualTest
    freedom: float

    @property
    def quantile(self) -> float:
        """Standard deviations to both sides that 95 % lie within."""
        from scipy.special import ndtri, stdtrit

        return float(ndtri(QUANTILE) if np.isinf(self.freedom) else stdtrit(self.freedom, QUANTILE))


def knowledge(problem: Problem, x: Array) -> Knowledge:
    """Return what is known at the solution x of a problem."""
    residuals = problem.residuals(x)
    untold, covariance = _determined(problem.sums(x, far=False).normal)
    is_told, told = (untold**2).sum(axis=0) <= TOLD, len(x) - len(untold)
    freedom = max(1, problem.numbers - told)
    test = _test(problem, residuals, freedom, told)
    least = covariance
    if any(len(_correlation(data)) for data in problem.data):
        least = _sandwich(covariance, _of_noise(problem, x), LEAST_SHARE**2 * covariance)
    if not test.passed:
        scores = _scores(problem, x)
        power = scores.T @ scores * (len(scores) / max(1, len(scores) - len(x)))
        least = _sandwich(covariance, power, (max(1.0, test.ratio) if test.ratio > 0.0 else 1.0) * least)
    covariance = least.copy()
    covariance[~is_told] = covariance[:, ~is_told] = 0.0
    covariance[~is_told, ~is_told] = np.inf
    return Knowledge(covariance, is_told, combinations(untold, problem.variables.names), test,
                     np.inf if problem.known else float(freedom))


def _determined(normal: Array) -> tuple[Array, Array]:
    """Orthonormal directions (k, v) that the data do not tell, and the covariance (v, v) with these held.

    First values that are not told even if all others are known. Of the rest, what rounding leaves of J^T J shows with a
    unit diagonal, whatever the size of the values is.
    """
    alone = normal.diagonal() * LARGEST_DEVIATION**2 <= 1.0
    rest, every = np.flatnonzero(~alone), np.eye(len(normal))
    scale = np.sqrt(normal.diagonal()[rest])
    scaled = normal[np.ix_(rest, rest)] / scale[:, None] / scale
    shares, axes = np.linalg.eigh(scaled)
    lost, axes = shares <= SMALLEST_SHARE**2 * shares.max(initial=0.0), axes / scale[:, None]
    deviations = np.where(lost, LOST / np.linalg.norm(axes, axis=0), 1.0 / np.sqrt(np.where(lost, 1.0, shares)))
    directions, sizes, _ = np.linalg.svd(axes * deviations)
    untold = directions[:, sizes >= LARGEST_DEVIATION].T
    basis = np.linalg.svd(untold / scale)[2][len(untold) :] if len(untold) else np.eye(len(rest))
    covariance = np.zeros_like(normal)
    covariance[np.ix_(rest, rest)] = basis.T @ np.linalg.inv(basis @ scaled @ basis.T) @ basis / scale[:, None] / scale
    return np.concatenate((every[alone], untold @ every[rest])), covariance


def _correlation(data: object) -> Array:
    """Correlation of the errors of neighbouring lines of some data."""
    return data.correlation if isinstance(data, ResponseData) else np.zeros(0)


def _of_noise(problem: Problem, x: Array) -> Array:
    """E[J^T r r^T J] (v, v) of noise of which neighbouring lines have a part in common."""
    total, before = np.zeros((len(x), len(x))), dict[int, Array]()
    for k, block in problem.blocks(x):
        slopes = real_rows(block)[0].reshape(len(x), len(block.residual), -1)
        correlation = _correlation(problem.data[k]) if k >= 0 else np.zeros(0)
        known = before.get(k, slopes[:, :0])
        lines = np.concatenate((known, slopes), axis=1)
        before[k] = lines[:, max(0, lines.shape[1] - len(correlation)) :]
        power = np.tensordot(slopes, slopes, ([1, 2], [1, 2]))
        for j, shared in enumerate(correlation.tolist(), start=1):
            first = max(known.shape[1], j)
            both = np.tensordot(lines[:, first - j : -j], lines[:, first:], ([1, 2], [1, 2]))
            power += shared * (both + both.T)
        total += power / lines_alike(correlation)  # residuals are weighted as if so many of them were one
    return total


def _scores(problem: Problem, x: Array) -> Array:
    """J^T r of blocks of neighbouring lines, and of each of the other numbers (blocks, v)."""
    scores, lines = [], sum(len(data.omega) for data in problem.data if not isinstance(data, ModeData))
    for k, block in problem.blocks(x):
        slopes, residual = real_rows(block)
        pieces = len(residual)
        if k >= 0 and not isinstance(problem.data[k], ModeData):
            most = len(block.residual) // (1 + len(_correlation(problem.data[k])))
            pieces = max(1, min(most, round(BLOCKS * len(x) * len(block.residual) / lines)))
        width = len(residual) // len(block.residual)
        ends = np.linspace(0, len(residual) // width, pieces + 1).round().astype(int) * width
        scores += [slopes[:, a:b] @ residual[a:b] for a, b in pairwise(ends)]
    return np.array(scores)


def _sandwich(inverse: Array, power: Array, least: Array) -> Array:
    """The covariance (J^T J)^-1 E[J^T r r^T J] (J^T J)^-1 with deviations not below those of the ``least`` one."""
    sandwich = inverse @ power @ inverse
    deviation, low = (np.sqrt(np.maximum(c.diagonal(), 0.0)) for c in (sandwich, least))
    scale = np.maximum(deviation, low) / np.where(deviation > 0.0, deviation, 1.0)
    return np.where(deviation > 0.0, sandwich * scale[:, None] * scale, least)


def _test(problem: Problem, residuals: Sequence[Complex], freedom: float, told: int) -> ResidualTest:
    from scipy.special import gammaincc, ndtr

    ratio, passed = np.nan, True
    if problem.known:
        total = sum(float((np.abs(r) ** 2).sum()) for r in residuals)
        ratio = total / freedom
        passed = bool(gammaincc(0.5 * freedom, 0.5 * total) >= REFUSED)
    left = CONVERGED if problem.known else 0.0  # of residuals without noise, by a search that ended
    along, power, spread, count, bands = np.zeros(2), np.zeros(2), np.zeros(2), 0, []  # of residuals and of phases
    for data, r in zip(problem.data, residuals, strict=True):
        shared = _correlation(data)
        j = 1 + len(shared)  # lines from which on noise is independent
        if not isinstance(data, ModeData) and len(r) > 1 + j and np.linalg.norm(r) > max(data.rounding, left):
            size = np.abs(r)
            phases = r / np.where(size > 0.0, size, 1.0)  # lines with much noise or a misfit do not outweigh others
            for k, values in enumerate((r,) if data.known else (r, phases)):
                square = np.abs(values) ** 2
                along[k] += (values[j:] * values[:-j].conj()).real.sum()
                power[k] += square.sum()
                spread[k] += 0.5 * (square[j:] * square[:-j]).sum() * (1.0 + 2.0 * (shared @ shared))
            count += 2 * int((data.weight[j:] > 0.0).sum())
            bands += _bands(data.omega / (2.0 * np.pi), (size**2).mean(axis=(1, 2)))
    correlation = along / np.where(power > 0.0, power, 1.0)
    if count > told:
        passed &= bool((ndtr(-along / np.sqrt(np.where(spread > 0.0, spread, 1.0))) >= REFUSED).all())
    kinds = 2 if power[1] > 0.0 else 1
    return ResidualTest(passed, ratio, float(correlation[:kinds].max()), () if passed else tuple(bands))


def _bands(frequencies: Array, power: Array) -> list[tuple[float, float]]:
    """Bands [Hz] whose residuals stand out."""
    width = min(2 * BESIDE + 1, len(power))
    mean = np.convolve(np.pad(power, width // 2, mode="edge"), np.full(width, 1.0 / width), "valid")[: len(power)]
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mean > STANDS_OUT * power.mean(), [False]))))
    return [(float(frequencies[a]), float(frequencies[b - 1])) for a, b in edges.reshape(-1, 2)]


def combinations(directions: Array, names: Sequence[str]) -> tuple[dict[str, float], ...]:
    """The span of orthonormal directions (k, v) as combinations of few names, small shares left out.

    Each combination has a name that no other has, the first of those with the largest share that is left: any basis of
    the span gives the same combinations, in the order of the names.
    """
    left, pivots = directions.copy(), []
    for _ in directions:
        shares = (left**2).sum(axis=0)
        pivot = int((shares >= (1.0 - TIE_BREAK) * shares.max()).argmax())
        along = left[:, pivot] / np.sqrt(shares[pivot])
        left -= np.outer(along, along @ left)
        pivots.append(pivot)
    rows = np.linalg.solve(directions[:, sorted(pivots)], directions)
    result = []
    for row in rows / np.abs(rows).max(axis=1, initial=0.0, keepdims=True):
        named = np.flatnonzero(np.abs(row) >= NAMED)
        sign = np.sign(row[named[0]])
        result.append({names[i]: float(sign * row[i]) for i in named.tolist()})
    return tuple(result)
