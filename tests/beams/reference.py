"""Beam elements after the text books, independent of the library: 12 x 12 stiffness and consistent mass matrices.

Source: Przemieniecki, Theory of Matrix Structural Analysis (1968), (5.116) and (11.38), in their closed form.
"""

import mpmath as mp
import numpy as np

PLANES = (((1, 5, 7, 11), 1), ((2, 4, 8, 10), -1))


def matrices(length, area, iy, iz, j, e, g, rho, phi_y=0, phi_z=0, rotary=False, zero=0.0):
    """Stiffness and mass (12 x 12) on u, theta of both ends as lists of rows, in the arithmetic of what is given."""
    k = [[zero] * 12 for _ in range(12)]
    m = [[zero] * 12 for _ in range(12)]
    for i, stiff, mass in ((0, e * area, rho * area), (3, g * j, rho * (iy + iz))):
        for a, b, sign, share in ((i, i, 1, 2), (i + 6, i + 6, 1, 2), (i, i + 6, -1, 1), (i + 6, i, -1, 1)):
            k[a][b] += sign * stiff / length
            m[a][b] += share * mass * length / 6
    for (indices, sign), second, phi in zip(PLANES, (iz, iy), (phi_y, phi_z), strict=True):
        turn = (1, sign, 1, sign)
        bend, line, turns = _bending(length, phi)
        stiff = e * second / (length**3 * (1 + phi))
        mass, spin = rho * area * length / (1 + phi) ** 2, rho * second / (length * (1 + phi) ** 2)
        for a in range(4):
            for b in range(4):
                both = turn[a] * turn[b]
                k[indices[a]][indices[b]] += both * stiff * bend[a][b]
                m[indices[a]][indices[b]] += both * (mass * line[a][b] + (spin * turns[a][b] if rotary else 0))
    return k, m


def _bending(h, p):
    single = h / h
    bend = [[12, 6 * h, -12, 6 * h], [6 * h, (4 + p) * h * h, -6 * h, (2 - p) * h * h],
            [-12, -6 * h, 12, -6 * h], [6 * h, (2 - p) * h * h, -6 * h, (4 + p) * h * h]]  # fmt: skip
    a = 13 * single / 35 + 7 * p / 10 + p * p / 3
    b = (11 * single / 210 + 11 * p / 120 + p * p / 24) * h
    c = 9 * single / 70 + 3 * p / 10 + p * p / 6
    d = -(13 * single / 420 + 3 * p / 40 + p * p / 24) * h
    e = (single / 105 + p / 60 + p * p / 120) * h * h
    f = -(single / 140 + p / 60 + p * p / 120) * h * h
    line = [[a, b, c, d], [b, e, -d, f], [c, -d, a, -b], [d, f, -b, e]]
    r = 6 * single / 5
    s = (single / 10 - p / 2) * h
    t = (2 * single / 15 + p / 6 + p * p / 3) * h * h
    u = (-single / 30 - p / 6 + p * p / 6) * h * h
    turns = [[r, s, -r, s], [s, t, -s, u], [-r, -s, r, -s], [s, u, -s, t]]
    return bend, line, turns


def cantilever_plane(n, length, area, second, e, rho, unit):
    """Banded stiffness and mass of an Euler-Bernoulli cantilever in one plane: rows of {column: value}."""
    h = length * unit / n
    k, m = matrices(h, area * unit, second * unit, second * unit, unit, e * unit, unit, rho * unit, zero=0 * unit)
    indices = PLANES[0][0]
    rows = [[{} for _ in range(2 * n + 2)] for _ in range(2)]
    for i in range(n):
        for rows_of, element in zip(rows, (k, m), strict=True):
            for a in range(4):
                for b in range(4):
                    row = rows_of[2 * i + a]
                    row[2 * i + b] = row.get(2 * i + b, 0 * unit) + element[indices[a]][indices[b]]
    return tuple([{j - 2: v for j, v in row.items() if j >= 2} for row in part[2:]] for part in rows)


def eigenvalue_near(stiffness, mass, shift):
    """The eigenvalue next to ``shift`` by inverse iteration with a banded factorisation, in mpmath's precision."""
    n = len(stiffness)
    low = [{j: v - shift * mass[i][j] for j, v in stiffness[i].items()} for i in range(n)]
    diagonal = []
    for i in range(n):
        for j in sorted(k for k in low[i] if k < i):
            pivot = low[i][j] / diagonal[j]
            for k, v in low[j].items():
                if k > j:
                    low[i][k] = low[i].get(k, mp.mpf(0)) - pivot * v
            low[i][j] = pivot
        diagonal.append(low[i][i])
    x = [mp.mpf(1) / (i + 1) + mp.sin(i) for i in range(n)]
    value = mp.mpf(0)
    for _ in range(60):
        y = [sum(v * x[j] for j, v in mass[i].items()) for i in range(n)]
        for i in range(n):
            y[i] -= sum(v * y[j] for j, v in low[i].items() if j < i)
        for i in reversed(range(n)):
            y[i] = (y[i] - sum(v * y[j] for j, v in low[i].items() if j > i)) / diagonal[i]
        size = max(y, key=abs)
        x = [v / size for v in y]
        old, value = value, _rayleigh(stiffness, mass, x)
        if abs(value - old) < mp.mpf(10) ** -30 * abs(value):
            return value
    raise AssertionError("inverse iteration did not converge")


def _rayleigh(stiffness, mass, x):
    n = len(x)
    up = sum(x[i] * v * x[j] for i in range(n) for j, v in stiffness[i].items())
    down = sum(x[i] * v * x[j] for i in range(n) for j, v in mass[i].items())
    return up / down


def assembled(points, frames, element):
    """Stiffness and mass of a free line of nodes in world axes; ``element(i)`` gives those of each in its axes."""
    size = 6 * len(points)
    k, m = np.zeros((size, size)), np.zeros((size, size))
    for i, axes in enumerate(frames):
        turn = np.kron(np.eye(4), np.array(axes).T)
        at = slice(6 * i, 6 * i + 12)
        for full, part in zip((k, m), element(i), strict=True):
            full[at, at] += turn.T @ np.array(part) @ turn
    return k, m
