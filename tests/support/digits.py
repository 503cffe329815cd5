"""Linear algebra in 50 digits, on lists of rows."""

import mpmath
import numpy as np

from tests.support import fast_digits

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
    if not a or not b or not b[0]:
        return [[] for _ in a]
    return fast_digits.product(a, b, mp)


def clean(a):
    """Zeros where 50 digits leave the rounding of a zero, for entries of the order of one."""
    return [[v if abs(v) > mp.mpf("1e-40") else mp.mpf(0) for v in row] for row in a]


def double(a, width=0):
    """A matrix of 50 digits, rounded once."""
    return np.array([[float(v) for v in row] for row in a]).reshape(len(a), -1 if a and a[0] else width)


def solve(a, b):
    """A^-1 B for a list-of-lists B."""
    if not a or not b[0]:
        return [[] for _ in a]
    return fast_digits.solve(a, b, mp)


def null_space(rows, width):
    """Basis (columns) of the null space, with the smallest pivot kept and the largest one dropped."""
    return fast_digits.null_space(rows, width, REDUNDANT, mp)


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
