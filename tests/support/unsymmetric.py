"""Systems without symmetry from random chains, and their eigenvalues in 60 digits.

The data of the factors are doubles, so that the reference is exact: M = W^T W, C = D^T diag(c) D + G and
K = D^T diag(k) D + N are formed, and the first-order equations solved, in 60 digits.
"""

from dataclasses import replace

import mpmath as mp
import numpy as np

import mbsvib as mv

DIGITS = 60


def chain(n, seed, span=1.0, ground=True, damp=0.02, sign=1.0):
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
    return model.linearize()


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
    c, k = (d.T * mp.diag([mp.mpf(float(v)) for v in values]) * d for values in (system.damping, system.stiffness))
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
    kept = [i for i in range(m) if i not in loose]
    order = kept + loose
    pick = mp.matrix(m, m)
    for i, j in enumerate(order):
        pick[j, i] = 1
    mass, c, k = (pick.T * a * pick for a in (mass, c, k))
    p, n1 = len(kept), len(loose)
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
    inverse = mp.inverse(left)
    return inverse * right, inverse * force * pick.T, pick * show


def eigenvalues(system):
    """All eigenvalues, 2m - massless."""
    with mp.workdps(DIGITS):
        return list(mp.eig(first_order(system)[0], left=False, right=False))


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
