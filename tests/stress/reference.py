"""Roots of det(lambda^2 M + lambda C + K) in 80 digits, each proved to be the only one in a small disc.

The matrices are those of ``tests.support.exact``, in as many digits. All roots are found at once by the Ehrlich-Aberth
iteration, from any starting points (those of the toolbox, spoilt), with Newton's step p / p' = 1 / trace(Q^-1 Q') by an
LU of Q. A disc of n |p / p'| about a point holds a root of a polynomial of degree n: where the n discs are disjoint,
each holds exactly one, and none is missing. Roots 0 are counted by ranks and divided out.
"""

from contextlib import contextmanager

import numpy as np

from tests.support import digits, fast_digits
from tests.support.digits import mp
from tests.support.exact import Exact

DIGITS = 80
# Entries below this part of the largest one in their row are what 80 digits leave of a zero.
ZERO = mp.mpf("1e-60")
PERTURBED = 1e-2
ENOUGH = mp.mpf("1e-25")
ROUNDS = 60


@contextmanager
def precision(redundant=None):
    """Compute in 80 digits; ``redundant`` is the pivot below which a constraint counts as implied by the others."""
    before = digits.REDUNDANT
    module = Exact.__init__.__globals__["null_space"].__globals__
    module["REDUNDANT"] = before if redundant is None else mp.mpf(redundant)
    try:
        with mp.workdps(DIGITS):
            yield
    finally:
        module["REDUNDANT"] = before


def exact(model, redundant=None):
    """The linear equations of a model in 80 digits."""
    with precision(redundant):
        return Exact(model)


def rank(rows):
    """Rank of a matrix, by elimination with full pivoting on rows of unit size."""
    sizes = [max(map(abs, row), default=0) for row in rows]
    rows = [[v / s for v in row] for row, s in zip(rows, sizes, strict=True) if s]
    count = 0
    while rows:
        size, r, c = max((abs(v), i, j) for i, row in enumerate(rows) for j, v in enumerate(row))
        if size < ZERO:
            break
        pivot = rows.pop(r)
        rows = [[v - row[c] / pivot[c] * p for v, p in zip(row, pivot, strict=True)] for row in rows]
        count += 1
    return count


def squares(reference):
    """Undamped omega^2 in 80 digits, ascending; exact zeros for rigid-body modes."""
    m = reference.dof
    with mp.workdps(DIGITS):
        lower = mp.cholesky(mp.matrix(reference.M))
        half = digits.transpose(digits.solve(lower.tolist(), reference.K))
        full = mp.matrix(digits.solve(lower.tolist(), half))
        values = sorted(fast_digits.symmetric_eigenvalues((full + full.T) / 2), key=abs)
        rigid = m - _elastic_rank(reference)
        assert all(abs(v) < mp.mpf("1e-50") * abs(values[-1]) for v in values[:rigid])
        return [mp.mpf(0)] * rigid + sorted(values[rigid:])


def _elastic_rank(reference):
    return rank(_felt(reference, damped=False))


def _felt(reference, damped):
    """Elastic rows (and damping rows) in the reference's coordinates, whatever their stiffness."""
    rows = []
    for spring in reference.model.springs.values():
        moved, k, c = reference._spring(spring)
        moved = digits.clean(digits.product(moved, reference.basis))
        rows += [_combined(row, moved) for row in (k + c if damped else k) if any(row)]
    return rows


def _combined(weights, rows):
    return [mp.fdot(weights, column) for column in zip(*rows, strict=True)]


def eigenvalues(reference, start):
    """All 2 m eigenvalues in 80 digits, from the starting values ``start`` (2 m,); zeros exact; certified."""
    with mp.workdps(DIGITS):
        m = reference.dof
        zeros = (m - _elastic_rank(reference)) + (m - rank(_felt(reference, damped=True)))
        nonzero = [complex(v) for v in start if v != 0]
        assert len(nonzero) == 2 * m - zeros, "exact zeros of rigid-body modes"
        return [mp.mpc(0)] * zeros + _aberth(_newton(reference, zeros), nonzero)


def _newton(reference, zeros):
    """p / p' of the determinant without its roots 0."""
    scale = [1 / mp.sqrt(reference.M[i][i]) for i in range(reference.dof)]
    mass, damping, stiffness = (
        mp.matrix([[a * x * b for x, b in zip(row, scale, strict=True)] for row, a in zip(rows, scale, strict=True)])
        for rows in (reference.M, reference.C, reference.K)
    )

    def step(s):
        full, slope = mass * s**2 + damping * s + stiffness, mass * (2 * s) + damping
        try:
            ratio = fast_digits.solve(full, slope)
        except ZeroDivisionError:
            return mp.mpc(0)
        return 1 / (sum(ratio[j, j] for j in range(full.rows)) - zeros / s)

    return step


def _aberth(newton, start):
    rng = np.random.default_rng(7)
    pairs = [v for v in start if v.imag >= 0]
    assert 2 * sum(v.imag > 0 for v in pairs) + sum(v.imag == 0 for v in pairs) == len(start), "conjugate pairs"
    z = [mp.mpc(v.real * (1 + PERTURBED * a), v.imag * (1 + PERTURBED * b))
         for v, (a, b) in zip(pairs, rng.uniform(-1, 1, (len(pairs), 2)), strict=True)]  # fmt: skip
    done = [False] * len(z)
    step = [mp.mpf(1)] * len(z)
    for _ in range(ROUNDS):
        if all(done):
            break
        for i, value in enumerate(z):
            if done[i]:
                continue
            step[i] = newton(value)
            others = [v for j, v in enumerate(z) if j != i] + [mp.conj(v) for v in z if v.imag]
            others = [v for v in others if v != value]
            move = step[i] / (1 - step[i] * mp.fsum(1 / (value - v) for v in others))
            if value.imag == 0:
                move = mp.mpc(move.real)
            done[i] = abs(move) <= ENOUGH * abs(value)
            if not done[i] or abs(move) > 0:
                z[i] = value - move
    assert all(done), "the reference did not converge"
    result = z + [mp.conj(v) for v in z if v.imag]
    radius = [len(result) * ENOUGH * abs(v) for v in result]  # far above |p / p'| after the last step
    for i, a in enumerate(result):
        assert all(abs(a - b) > radius[i] + r for b, r in zip(result[:i], radius[:i], strict=True)), "discs overlap"
    return result
