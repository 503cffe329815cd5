"""Linear algebra in 50 digits, on lists of rows."""

import mpmath
import numpy as np

mp = mpmath.MPContext()
mp.dps = 50

# Poses are doubles: what is redundant in the drawing is so to 1e-16 only (1e-12 at 1e4 m from the origin).
REDUNDANT = mp.mpf("1e-9")


def dot(a, b):
    return mp.fdot(a, b)


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def exact(values):
    """Doubles as they are, in 50 digits."""
    return [mp.mpf(float(v)) for v in values]


def unit_vector(vector):
    values = [mp.mpf(v) for v in vector]
    length = mp.sqrt(dot(values, values))
    return [v / length for v in values]


def columns(matrix):
    return [exact(column) for column in zip(*matrix, strict=True)]


def transpose(a):
    return [list(row) for row in zip(*a, strict=True)]


def product(a, b):
    other = transpose(b) if b else []
    return [[dot(row, column) for column in other] for row in a]


def clean(a):
    """Zeros where 50 digits leave the rounding of a zero, for entries of the order of one."""
    return [[v if abs(v) > mp.mpf("1e-40") else mp.mpf(0) for v in row] for row in a]


def double(a, width=0):
    """A matrix of 50 digits, rounded once."""
    return np.array([[float(v) for v in row] for row in a]).reshape(len(a), -1 if a and a[0] else width)


def solve(a, b):
    """A^-1 B for a list-of-lists B, by LU with partial pivoting."""
    if not a:
        return []
    lower_upper, order = mp.LU_decomp(mp.matrix(a))
    result = []
    for column in transpose(b):
        result.append(list(mp.U_solve(lower_upper, mp.L_solve(lower_upper, mp.matrix(column), order))))
    return transpose(result) if result else [[] for _ in a]


def null_space(rows, width):
    """Basis (columns) of the null space, with the smallest pivot kept and the largest one dropped."""
    rows = [list(row) for row in rows]
    pivots, kept, dropped = [], mp.inf, mp.mpf(0)
    while len(pivots) < len(rows):
        left = range(len(pivots), len(rows))
        entries = ((abs(v), i, j) for i in left for j, v in enumerate(rows[i]) if v)
        size, r, c = max(entries, default=(mp.mpf(0), 0, 0))
        if size < REDUNDANT:
            dropped = size
            break
        kept = min(kept, size)
        k = len(pivots)
        rows[k], rows[r] = rows[r], rows[k]
        rows[k] = [v / rows[k][c] if v else v for v in rows[k]]
        for i, row in enumerate(rows):
            if i != k and row[c]:
                factor = row[c]
                rows[i] = [v - factor * p if p else v for v, p in zip(row, rows[k], strict=True)]
                rows[i][c] = mp.mpf(0)
        pivots.append(c)
    free = [j for j in range(width) if j not in pivots]
    basis = [[mp.mpf(0)] * len(free) for _ in range(width)]
    for column, j in enumerate(free):
        basis[j][column] = mp.mpf(1)
        for row, c in zip(rows, pivots, strict=False):
            basis[c][column] = -row[j]
    return basis, kept, dropped


def combination(*terms):
    first = terms[0][0]
    return [[sum(matrix[i][j] * factor for matrix, factor in terms) for j in range(len(row))]
            for i, row in enumerate(first)]  # fmt: skip


def rounded(values, zero):
    """Doubles; what 50 digits leave of an exact zero, a part ``zero`` of the largest value or less, is a zero."""
    limit = max((abs(v) for v in values), default=mp.mpf(0)) * mp.mpf(zero)
    parts = [[v.real, v.imag] if abs(v) > limit else [0, 0] for v in map(mp.mpc, values)]
    parts = [[part if abs(part) > mp.mpf("1e-20") * max(map(abs, pair)) else 0 for part in pair] for pair in parts]
    return np.array([complex(float(re), float(im)) for re, im in parts])
