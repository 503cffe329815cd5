"""Closed loops in 40 digits, from the factors of a system and the matrices of a controller."""

import mpmath

from tests.support import fast_digits
from tests.support.unsymmetric import matrices

DIGITS = 40


def closed(system, law, sensors, actuators):
    """A, B, C, D of u = w + K y around a system, in extended precision."""
    with mpmath.workdps(DIGITS):
        m, c, k = matrices(system)
        mp = mpmath
        n, z = system.dof, len(law.A)
        b, cq, cv, ca, d = (mp.matrix(a.tolist()) if a.size else mp.zeros(*a.shape)
                            for a in (system.B, system.Cq, system.Cv, system.Ca, system.D))  # fmt: skip
        inverse = m**-1
        a0 = mp.zeros(2 * n)
        for i in range(n):
            a0[i, n + i] = mp.mpf(1)
        low = _join([[-inverse * k, -inverse * c]])
        a0[n:, :] = low
        b0 = _join([[mp.zeros(n, b.cols)], [inverse * b]])
        c0 = _join([[cq, cv]]) + ca * low
        d0 = d + ca * inverse * b
        o = [system.outputs.index(name) for name in sensors]
        u = [system.inputs.index(name) for name in actuators]
        az, bz, cz, dz = (mp.matrix(a.tolist()) if a.size else mp.zeros(*a.shape) for a in (law.A, law.B, law.C, law.D))
        bu, cy, dyu = _pick(b0, range(2 * n), u), _pick(c0, o, range(2 * n)), _pick(d0, o, u)
        dy, du = _pick(d0, o, range(b.cols)), _pick(d0, range(c0.rows), u)
        loop = (mp.eye(len(o)) - dyu * dz) ** -1
        seen, through, direct = loop * cy, loop * dyu * cz, loop * dy
        force_x, force_z, force_w = dz * seen, dz * through + cz, dz * direct
        a = _join([[a0 + bu * force_x, bu * force_z], [bz * seen, az + bz * through]]) if z else a0 + bu * force_x
        b1 = b0 + bu * force_w
        c1, d1 = c0 + du * force_x, d0 + du * force_w
        if z:
            b1, c1 = _join([[b1], [bz * direct]]), _join([[c1, du * force_z]])
        return a, b1, c1, d1


def poles(system, law, sensors, actuators):
    """Poles of the closed loop."""
    return fast_digits.eigenvalues(closed(system, law, sensors, actuators)[0])


def response(system, law, sensors, actuators, w):
    """G(i w) of the closed loop as a list of rows."""
    a, b, c, d = closed(system, law, sensors, actuators)
    with mpmath.workdps(DIGITS):
        x = fast_digits.solve(mpmath.mpc(0, w) * mpmath.eye(a.rows) - a, b)
        return (c * x + d).tolist()


def _join(blocks):
    return mpmath.matrix([[block[i, j] for block in row for j in range(block.cols)] for row in blocks
                          for i in range(row[0].rows)])  # fmt: skip


def _pick(matrix, rows, columns):
    rows, columns = list(rows), list(columns)
    result = mpmath.zeros(len(rows), len(columns))
    for i, row in enumerate(rows):
        for j, column in enumerate(columns):
            result[i, j] = matrix[row, column]
    return result
