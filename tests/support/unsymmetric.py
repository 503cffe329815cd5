"""Systems without symmetry from random chains, and their eigenvalues in 60 digits.

The data of the factors are doubles, so that the reference is exact: M = W^T W, C = D^T diag(c) D + G and
K = D^T diag(k) D + N are formed, and the first-order equations solved, in 60 digits.
"""

from dataclasses import replace

import mpmath as mp
import numpy as np

import mbsvib as mv
from tests.support import fast_digits

DIGITS = 60


def chain(n, seed, **changes):
    """The equations of ``chain_model``."""
    return chain_model(n, seed, **changes).linearize()


def chain_model(n, seed, span=1.0, ground=True, damp=0.02, sign=1.0):
    """Sliders along x with springs to the next two; ``span`` decades of masses and stiffnesses."""
    rng = np.random.default_rng(seed)
    model = mv.Model("chain")
    for i in range(n):
        model.add_body(f"b{i}", 10 ** rng.uniform(-span, span), (0.1, 0.1, 0.1), position=(0, 0, i + 1.0))
        model.add_joint(f"j{i}", "prismatic", "ground", f"b{i}", axis=(1, 0, 0))
    for i in range(n):
        if i or ground:
            k, c = 10 ** rng.uniform(2, 2 + span), damp * 10 ** rng.uniform(0, span)
            model.add_bushing(f"k{i}", f"b{i - 1}" if i else "ground", f"b{i}", position=(0, 0, i + 0.5),
                              stiffness=(sign * k, 0, 0, 0, 0, 0), damping=(c, 0, 0, 0, 0, 0))  # fmt: skip
        if i > 1:
            model.add_bushing(f"x{i}", f"b{i - 2}", f"b{i}", position=(0, 0, i + 0.5),
                              stiffness=(sign * 10 ** rng.uniform(1, 2), 0, 0, 0, 0, 0),
                              damping=(damp * rng.uniform(0, 30), 0, 0, 0, 0, 0))  # fmt: skip
    for i in (0, n // 2):
        model.add_input(f"F{i}", f"b{i}", "x")
    model.add_output("x", f"b{n - 1}", "x")
    model.add_output("v", "b0", "x", quantity="velocity")
    model.add_output("a", "b0", "x", quantity="acceleration")
    return model


def unsymmetric(system, gyroscopic=0.0, circulatory=0.0, seed=0):
    """The same system with antisymmetric random parts of C and K."""
    rng = np.random.default_rng(seed + 1000)
    changes = {}
    for letter, name, size in (("C", "gyroscopic", gyroscopic), ("K", "circulatory", circulatory)):
        part = rng.normal(size=(system.dof, system.dof))
        part = size * (part - part.T)
        if size:
            changes |= {name: part, letter: getattr(system, letter) + part}
    return replace(system, **changes)


def massless(system, bodies):
    """The same system without the mass of some sliders: coordinates are the sliders' own."""
    w = system.inertia_factor.copy()
    w[:, bodies] = 0.0
    null = np.eye(system.dof)[:, bodies]
    return replace(system, inertia_factor=w, M=w.T @ w, massless=len(bodies), null_inertia=null)


def matrices(system):
    """M, C, K in the working precision of mpmath."""
    w, d = mp.matrix(system.inertia_factor.tolist()), mp.matrix(system.elastic_rows.tolist())
    c, k = (d.T * mp.diag([mp.mpf(float(v)) for v in values]) * d
            for values in (system.row_damping, system.row_stiffness))
    if system.gyroscopic is not None:
        c += mp.matrix(system.gyroscopic.tolist())
    if system.circulatory is not None:
        k += mp.matrix(system.circulatory.tolist())
    return w.T * w, c, k


def first_order(system):
    """A and F of x' = A x + F f, and S with q = S x, in the working precision; massless motions are coordinates."""
    mass, c, k = matrices(system)
    m = system.dof
    loose = [] if not system.massless else np.nonzero(system.null_inertia)[0].tolist()
    retained = [i for i in range(m) if i not in loose]
    order = retained + loose
    pick = mp.matrix(m, m)
    for i, j in enumerate(order):
        pick[j, i] = 1
    mass, c, k = (pick.T * a * pick for a in (mass, c, k))
    p, n1 = len(retained), len(loose)
    # (q, v of those with mass): damping of the massless rates and M of the others are the matrix of the rates
    left = mp.matrix(2 * p + n1, 2 * p + n1)
    right, force = mp.matrix(2 * p + n1, 2 * p + n1), mp.matrix(2 * p + n1, m)
    for i in range(p):
        left[i, i] = right[i, p + n1 + i] = 1
        for j in range(p):
            left[m + i, m + j], right[m + i, m + j] = mass[i, j], -c[i, j]
    for i in range(m):
        row = m + i if i < p else i
        force[row, i] = 1
        for j in range(m):
            right[row, j] = -k[i, j]
        for j in range(p, m):
            left[row, j] = c[i, j]
        if i >= p:
            for j in range(p):
                right[row, m + j] = -c[i, j]
    show = mp.matrix(m, 2 * p + n1)
    for i in range(m):
        show[i, i] = 1
    return fast_digits.solve(left, right), fast_digits.solve(left, force * pick.T), pick * show


def eigenvalues(system):
    """All eigenvalues, 2m - massless."""
    with mp.workdps(DIGITS):
        return fast_digits.eigenvalues(first_order(system)[0])


def worst(modes, exact):
    """Largest relative error of the eigenvalues (of zeros: absolute), and largest ratio to their estimates."""
    left, error, ratio = list(exact), 0.0, 0.0
    assert len(modes.eigenvalues) == len(left)
    for value, bound in zip(modes.eigenvalues.tolist(), modes.errors.tolist(), strict=True):
        true = left.pop(min(range(len(left)), key=lambda j: abs(left[j] - mp.mpc(value))))
        off = float(abs(true - mp.mpc(value)) / (abs(true) if value else 1))
        error = max(error, off)
        ratio = max(ratio, off / bound if value else 0.0)
    return error, ratio


def realization(system):
    """A, B, C, D in the working precision; states are coordinates (massless ones last), then rates of the others."""
    a, force, show = first_order(system)
    b, d = mp.matrix(system.B.tolist()), mp.matrix(system.D.tolist())
    cq, cv, ca = (mp.matrix(c.tolist()) for c in (system.Cq, system.Cv, system.Ca))
    b, rate = force * b, show * a
    return a, b, cq * show + cv * rate + ca * rate * a, d + cv * show * b + ca * rate * b


def start(system, q, rate):
    """The state of coordinates and rates."""
    loose = [] if not system.massless else np.nonzero(system.null_inertia)[0].tolist()
    retained = [i for i in range(system.dof) if i not in loose]
    return mp.matrix([*[q[i] for i in retained + loose], *[rate[i] for i in retained]])


def frequency_response(system, omega):
    """The response at some frequencies, rounded to doubles."""
    with mp.workdps(DIGITS):
        a, b, c, d = realization(system)
        result = np.empty((d.rows, d.cols, len(omega)), dtype=complex)
        for i, w in enumerate(omega.tolist()):
            g = c * fast_digits.solve(mp.mpc(0, w) * mp.eye(a.rows) - a, b) + d
            result[:, :, i] = [[complex(g[j, k]) for k in range(d.cols)] for j in range(d.rows)]
    return result


def time_response(system, t, u, hold, initial):
    """Outputs at even times, rounded to doubles."""
    with mp.workdps(DIGITS):
        a, b, c, d = realization(system)
        n, k = b.rows, b.cols
        h = mp.mpf(float(t[1] - t[0]))
        full = mp.zeros(n + 2 * k, n + 2 * k)
        full[:n, :n], full[:n, n : n + k] = a * h, b * h
        for i in range(k):
            full[n + i, n + k + i] = 1
        power = fast_digits.exponential(full)
        x = start(system, *initial)
        result = np.empty((d.rows, len(t)))
        for i in range(len(t)):
            now = mp.matrix(u[:, i].tolist())
            result[:, i] = [float(value) for value in c * x + d * now]
            if i + 1 < len(t):
                x = power[:n, :n] * x + power[:n, n : n + k] * now
                if hold == "first":
                    x += power[:n, n + k :] * (mp.matrix(u[:, i + 1].tolist()) - now)
    return result


def zeros(system, output, source):
    """Zeros of one response: roots of its numerator, which is interpolated on a circle."""
    with mp.workdps(4 * DIGITS):
        a, b, c, d = realization(system)
        b, c, d = b[:, source], c[output, :], d[output, source]
        n = a.rows
        size = mp.mpf("1.3") * max(abs(v) for v in fast_digits.eigenvalues(a))
        points = [size * mp.expjpi(2 * mp.mpf(k) / (n + 1)) for k in range(n + 1)]
        values = []
        for s in points:
            matrix = s * mp.eye(n) - a
            values.append(((c * fast_digits.solve(matrix, b))[0] + d) * fast_digits.determinant(matrix) / size**n)
        powers = [sum(v * mp.expjpi(-2 * mp.mpf(k) * j / (n + 1)) for k, v in enumerate(values)) for j in range(n + 1)]
        largest = max(map(abs, powers))
        while abs(powers[-1]) < mp.mpf(10) ** (-2 * DIGITS) * largest:
            powers.pop()
        still = 0
        while abs(powers[still]) < mp.mpf(10) ** (-2 * DIGITS) * largest:
            still += 1
        result = mp.polyroots([p.real for p in powers[still:]], asc=True, maxsteps=500, extraprec=1000)
        return [mp.mpc(0)] * still + [root * size for root in result]
