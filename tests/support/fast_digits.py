"""Dense linear algebra of mpmath's numbers in as many digits as mpmath has, computed by FLINT: a hundred times faster.

Matrices are ``mp.matrix``, or lists of rows beside their ``context`` of mpmath; what is returned is of the same kind.
The precision of the context is worked in, with ``GUARD`` more bits.
"""

from contextlib import contextmanager

import flint
from mpmath.libmp import from_man_exp

GUARD = 32


def solve(a, b, context=None):
    """A^-1 B."""
    with _working(context or a.ctx) as mp:
        first, second = _alike(a, b)
        return _back(first.solve(second, algorithm="approx"), mp, context)


def inverse(a):
    """A^-1."""
    return solve(a, a.ctx.eye(a.rows))


def product(a, b, context=None):
    """A B."""
    with _working(context or a.ctx) as mp:
        first, second = _alike(a, b)
        return _back(first * second, mp, context)


def determinant(a, context=None):
    """det A."""
    with _working(context or a.ctx) as mp:
        return _number(_alike(a)[0].det(), mp)


def exponential(a, context=None):
    """exp A."""
    with _working(context or a.ctx) as mp:
        return _back(_alike(a)[0].exp(), mp, context)


def eigenvalues(a, context=None):
    """The eigenvalues, complex, in no order."""
    with _working(context or a.ctx) as mp:
        values = flint.acb_mat(_alike(a)[0]).eig(algorithm="approx")
        return [mp.mpc(_number(v.real, mp), _number(v.imag, mp)) for v in values]


def symmetric_eigenvalues(a, context=None):
    """The eigenvalues of a real symmetric matrix, ascending."""
    return sorted(v.real for v in eigenvalues(a, context))


def transfer(matrices, s, context):
    """G(s) = (Cq + s Cv + s^2 Ca) (s^2 M + s C + K)^-1 B + D, rounded to doubles once.

    ``matrices`` are M, C, K, B, Cq, Cv, Ca, D as lists of rows, none of them empty.
    """
    with _working(context):
        m, c, k, b, cq, cv, ca, d = (flint.acb_mat(_real(matrix)) for matrix in matrices)
        s = flint.acb(s)
        states = (m * (s * s) + c * s + k).solve(b, algorithm="approx")
        return [[complex(v) for v in row] for row in ((cq + cv * s + ca * (s * s)) * states + d).tolist()]


def null_space(rows, width, smallest, context):
    """Gauss-Jordan elimination with full pivoting: the basis of the null space as lists of rows, and two pivots.

    A pivot below ``smallest`` counts as zero. The two are the smallest one kept, and the largest one dropped.
    """
    with _working(context) as mp:
        rows = [[flint.arb(v) for v in row] for row in rows]
        largest = [_largest(row) for row in rows]
        pivots, retained, dropped = [], mp.inf, mp.mpf(0)
        while len(pivots) < len(rows):
            k = len(pivots)
            r = max(range(k, len(rows)), key=lambda i: (largest[i][0], i))
            c = largest[r][1]
            size = _number(abs(rows[r][c]), mp)
            if size < smallest:
                dropped = size
                break
            retained = min(retained, size)
            for line in (rows, largest):
                line[k], line[r] = line[r], line[k]
            pivot = rows[k][c]
            rows[k] = row = [v if v.is_zero() else (v / pivot).mid() for v in rows[k]]
            acting = [(j, v) for j, v in enumerate(row) if not v.is_zero()]
            for i, other in enumerate(rows):
                factor = other[c]
                if i != k and not factor.is_zero():
                    for j, v in acting:
                        other[j] = (other[j] - factor * v).mid()
                    other[c] = flint.arb(0)
                    if i > k:
                        largest[i] = _largest(other)
            pivots.append(c)
        free = [j for j in range(width) if j not in pivots]
        basis = [[mp.mpf(i == j) for j in free] for i in range(width)]
        for row, c in zip(rows, pivots, strict=False):
            basis[c] = [_number(-row[j], mp) for j in free]
        return basis, retained, dropped


def _largest(row):
    """Size and number of the largest entry."""
    return max(((abs(float(v)), j) for j, v in enumerate(row)), default=(0.0, 0))


@contextmanager
def _working(context):
    before = flint.ctx.prec
    flint.ctx.prec = context.prec + GUARD
    try:
        yield context
    finally:
        flint.ctx.prec = before


def _rows(matrix):
    return matrix.tolist() if hasattr(matrix, "tolist") else matrix


def _real(rows):
    return flint.arb_mat([[flint.arb(v) for v in row] for row in rows])


def _alike(*matrices):
    """The matrices as FLINT's, all of them real or all complex."""
    lists = [_rows(matrix) for matrix in matrices]
    if any(v.imag for rows in lists for row in rows for v in row):
        return [flint.acb_mat([[flint.acb(v) for v in row] for row in rows]) for rows in lists]
    return [_real([[v.real for v in row] for row in rows]) for rows in lists]


def _back(matrix, mp, context):
    rows = [[_number(value, mp) for value in row] for row in matrix.tolist()]
    return rows if context else mp.matrix(rows)


def _number(value, mp):
    if isinstance(value, flint.acb):
        return mp.mpc(_number(value.real, mp), _number(value.imag, mp))
    mantissa, exponent = value.mid().man_exp()
    return mp.make_mpf(from_man_exp(int(mantissa), int(exponent), mp.prec, "n"))
