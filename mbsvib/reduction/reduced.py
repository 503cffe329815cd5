"""Reduced models of a system by four methods, to an order or to an error: the largest singular value of the difference
of two frequency responses.

Balanced truncation leaves out hardly controllable or hardly observable states, by the Gramians of stable state spaces.

A P + P A^T + B B^T = 0 and A^T Q + Q A + C^T C = 0 are solved for factors, P = L_p L_p^T and Q = L_q L_q^T, by Newton's
iteration for the sign of A: a product is never formed, so that small Hankel singular values keep their digits.

Source: Benner & Quintana-Orti, Solving stable generalized Lyapunov equations with the matrix sign function, Numerical
Algorithms 20 (1999), section 4.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag, schur

from mbsvib.common.arrays import Array, Complex
from mbsvib.equations.equations import Equations, Truncation
from mbsvib.errors import ResponseError, nearest
from mbsvib.linalg.balancing import exponents, scaled_by
from mbsvib.linalg.lasting import separated
from mbsvib.linalg.rank import DAMPED_FREE_MOTION, EPS
from mbsvib.linalg.spectrum import spectrum
from mbsvib.modes.undamped import undamped
from mbsvib.reduction.modal import CraigBampton, ModalTruncation, projected
from mbsvib.responses.basis import Basis
from mbsvib.responses.energy_schur import last, triangular_solutions
from mbsvib.responses.frequency_response import frequency_response
from mbsvib.responses.norms import hinf
from mbsvib.responses.state_space import StateSpace

# Newton's iteration doubles its digits once it is this near to the limit; before that it is scaled.
NEAR = 0.1
# An eigenvalue as near to the imaginary axis as 1e-12 of its size takes some fifty steps.
STEPS = 100


def gramian_factors(a: Array, b: Array, c: Array) -> tuple[Array, Array]:
    """Return factors L_p (n, p) and L_q (n, q) of the Gramians of a stable state space, with as many columns as ranks.
    """
    n = len(a)
    sign, left, right = a, b, c.T
    for _ in range(STEPS):
        inverse = np.linalg.inv(sign)
        distance = float(np.linalg.norm(sign + np.eye(n)))
        scale = 1.0 if distance < NEAR else float(np.sqrt(np.linalg.norm(sign) / np.linalg.norm(inverse)))
        left = _compressed(np.hstack((left, scale * (inverse @ left))) / np.sqrt(2.0 * scale))
        right = _compressed(np.hstack((right, scale * (inverse.T @ right))) / np.sqrt(2.0 * scale))
        sign = 0.5 * (sign / scale + scale * inverse)
        if distance < np.sqrt(EPS):
            return left / np.sqrt(2.0), right / np.sqrt(2.0)
    raise ResponseError("reduced: the Gramians did not converge; a mode decays by less than 1e-12 of its frequency in "
                        "a radian. Give it damping, or take method='modal'.")  # fmt: skip


def _compressed(factor: Array) -> Array:
    """A factor with the same product, and no more columns than rows."""
    if factor.shape[1] <= len(factor):
        return factor
    return np.asarray(np.linalg.qr(factor.T, mode="r")).T


@dataclass(frozen=True, slots=True)
class Balanced:
    """x = ``right`` z and z = ``left`` x: the first states z do not decay and have the matrix ``undamped``, the others
    are balanced with the Hankel singular values ``hankel``, in descending order. States that do not decay and that no
    response contains are left out.
    """

    left: Array
    right: Array
    undamped: Array
    hankel: Array

    @property
    def lasting(self) -> int:
        """Number of states that do not decay."""
        return len(self.undamped)

    def matrix(self, a: Array, order: int) -> Array:
        """Return the state matrix (order, order) of the first states, for that of all (n, n)."""
        result: Array = self.left[:order] @ a @ self.right[:, :order]
        result[: self.lasting] = result[:, : self.lasting] = 0.0
        result[: self.lasting, : self.lasting] = self.undamped
        return result

    def bound(self, order: int) -> float:
        """Return twice the sum of the Hankel singular values that ``order`` states leave out.

        max over omega of sigma(G(i w) - G_r(i w)) <= 2 (s_(r+1) + ... + s_n)

        Source: Antoulas, Approximation of Large-Scale Dynamical Systems (2005), theorem 7.9.
        """
        return 2.0 * float(self.hankel[order - self.lasting :].sum())

    def order(self, error: float) -> int:
        """Return the smallest order whose bound is no larger than ``error``."""
        tail = 2.0 * np.append(np.cumsum(self.hankel[::-1])[::-1], 0.0)
        return self.lasting + int(np.argmax(tail <= error))


def balanced(a: Array, b: Array, c: Array) -> Balanced:
    """Return the balancing transformation of a state space; poles that do not decay stay as they are.

    Source: Tombs & Postlethwaite, Truncated balanced realization of a stable non-minimal state-space system,
    International Journal of Control 46 (1987), the square-root method.
    """
    parts = separated(a, b, c)
    lasting = [group.part for group in parts.shown]
    left, right = (np.concatenate([np.zeros((len(a), 0)), *matrices], axis=1) for matrices in
                   ([part.left.T for part in lasting], [part.right for part in lasting]))  # fmt: skip
    hankel = np.zeros(0)
    if len(parts.decaying.a):
        power = exponents(parts.decaying.a, parts.decaying.b, parts.decaying.c)
        l_p, l_q = gramian_factors(*scaled_by(power, parts.decaying.a, parts.decaying.b, parts.decaying.c))
        u, hankel, vt = np.linalg.svd(l_q.T @ l_p)
        rank = int(np.count_nonzero(hankel > 0.0))
        hankel = hankel[:rank]
        root = np.sqrt(hankel)
        into, out = l_p @ vt[:rank].T / root, l_q @ u[:, :rank] / root
        left = np.hstack((left, parts.decaying.left.T @ np.ldexp(out, -power[:, None])))
        right = np.hstack((right, parts.decaying.right @ np.ldexp(into, power[:, None])))
    undamped = block_diag(np.zeros((0, 0)), *[part.a for part in lasting])
    return Balanced(left.T, right, undamped, hankel)


# The difference is at its limit this far above the fastest pole.
FAR = 1e6
# Extrema between the samples of a band are missed below 1e-4 of the response (responses/extrema.py).
MARGIN = 2e-4
# The rounding of a reduced model is largest about the poles' frequencies, at so many half-widths.
ABOUT = np.array([-2.0, -1.0, -0.5, -0.25, 0.0, 0.05, 0.25, 0.5, 1.0, 2.0])
# Accuracy of the modes that tell free motions from others.
RTOL = 1e-10


def error_bound(full: Equations, small: Equations) -> float:
    """Return a bound on max over omega of sigma(G(i w) - G_small(i w)), output by input in SI units.

    Free motions without damping are in both models and are left out of both. Infinite where a mode does not decay.
    """
    if not full.inputs or not full.outputs:
        return 0.0
    bases = [Basis(_deforming(part)) for part in (full, small)]
    poles = np.concatenate([basis.poles for basis in bases])
    if last(poles).any():
        return np.inf
    fastest = float(np.abs(poles).max(initial=0.0)) or 1.0

    def difference(omega: ArrayLike) -> Complex:
        of_full, of_small = (frequency_response(basis, omega) for basis in bases)
        return np.asarray(of_full - of_small)

    return (1.0 + MARGIN) * hinf(difference, poles, difference([FAR * fastest])[:, :, 0]).value


def rounding_error(space: StateSpace, small: tuple[Array, Array, Array], lasting: int) -> tuple[float, float]:
    """Return the largest error of a reduced state space about its poles, where rounding shows, and the rounding of it.

    The first ``lasting`` of its states do not decay.
    """
    full = (space.A, space.B, space.C)
    if not space.D.size or not len(space.A):
        return 0.0, 0.0
    of_a = spectrum(space.A)
    poles = np.concatenate((of_a.values[of_a.decaying], np.linalg.eigvals(small[0][lasting:, lasting:])))
    about = np.abs(poles.imag) - poles.real * ABOUT[:, None]
    omega = np.unique(np.concatenate((np.abs(poles), about[about > 0.0])))
    (exact, rounding), (reduced, more) = (_response(a, b, c, 1j * omega) for a, b, c in (full, small))
    errors = np.linalg.norm((exact - reduced).transpose(2, 0, 1), ord=2, axis=(1, 2))
    return float(errors.max(initial=0.0)), float((rounding + more).max(initial=0.0))


def _response(a: Array, b: Array, c: Array, s: Complex) -> tuple[Complex, Array]:
    """G = C R B (outputs, inputs, n), R = (s - A)^-1, and a bound of its rounding (n,).

    |dG| <= eps ((|s| + |A|) |C R| |R B| + |C R| |B| + |C| |R B|)
    """
    power = exponents(a, b, c)
    a, b, c = scaled_by(power, a, b, c)
    t, q = schur(a, output="complex")
    b, c = q.conj().T @ b, c @ q
    right, left = (triangular_solutions(matrix, np.repeat(side[:, :, None], len(s), axis=2).astype(complex), s)
                   for matrix, side in ((t, b), (t.T[::-1, ::-1], c.T[::-1])))  # fmt: skip
    inward, outward = (np.linalg.norm(x, axis=(0, 1)) for x in (right, left))
    size = np.abs(s) + np.linalg.norm(t)
    rounding = (size * inward + np.linalg.norm(b)) * outward + np.linalg.norm(c) * inward
    return np.tensordot(c, right, axes=1), EPS * rounding


def _deforming(system: Equations) -> Equations:
    """Equations without free motions that nothing damps; these are decoupled from all others."""
    modes = undamped(system, RTOL)
    free = modes.shapes[:, : modes.rigid]
    scale = np.sqrt(np.diag(system.M))  # shapes are known to rounding of coordinates with a mass of one
    damping = system.C / np.multiply.outer(scale, scale)
    force, largest = np.abs(damping @ (scale[:, None] * free)), np.abs(damping).sum(axis=1).max(initial=0.0)
    if not modes.rigid or (force > DAMPED_FREE_MOTION * largest).any():
        return system
    n = system.dof - modes.rigid
    return projected(system, modes.shapes[:, modes.rigid :], [f"mode{k + 1}" for k in range(n)], ["modal"] * n)


METHODS = ("balanced", "modal", "static-corrected", "craig-bampton")


def reduced_space(space: StateSpace, order: int | None = None, error: float | None = None) -> StateSpace:
    """Return a state space of an ``order``, or of an ``error`` at most, by balanced truncation: states hankel1,
    hankel2, ...

    States that do not decay are kept. The error is the largest singular value of that of the frequency response, output
    by input in SI units.
    """
    _check(space.name, order, error, len(space.states), "states")
    realization = balanced(space.A, space.B, space.C)
    lasting = realization.lasting
    if error is None:
        n = min(int(order or 0), lasting + len(realization.hankel))
        small, bound = _truncated(space, realization, n)
    else:
        n = realization.order(float(error))
        small, bound = _truncated(space, realization, n)
        if bound > error:  # rounding takes a part of it
            n = realization.order(max(0.0, 2.0 * error - bound))
            small, bound = _truncated(space, realization, n)
        if bound > error:
            raise ResponseError(f"reduced: error = {error:g}; rounding of the {len(space.states)} states of "
                                f"'{space.name}' alone leaves up to {bound:.3g}. Give a larger error, or reduce other "
                                f"states, such as state_space('modal') of a system.")  # fmt: skip
    a, b, c = small
    names = tuple([f"lasting{k + 1}" if k < lasting else f"hankel{k - lasting + 1}" for k in range(n)])
    return replace(
        space, realization="reduced", A=a, B=b, C=c, D=space.D.copy(),
        transform=space.transform @ realization.right[:, :n], states=names, state_units=("",) * n,
        error_bound=bound + (space.error_bound or 0.0),
    )  # fmt: skip


def check_first_order(name: str, method: str) -> None:
    """Refuse methods that project equations of motion for the state space ``name``."""
    if method == "balanced":
        return
    advice = ("it projects equations of motion, which a state space has not: reduce the system, or take 'balanced'."
              if method in METHODS else f"expected 'balanced'.{nearest(str(method), METHODS)}")  # fmt: skip
    raise ResponseError(f"reduced: method = {method!r} for the state space '{name}'; {advice}")


def _truncated(space: StateSpace, realization: Balanced, n: int) -> tuple[tuple[Array, Array, Array], float]:
    """A, B, C of the first n states, and a bound of their error: truncation, or what is seen about poles, and rounding.
    """
    if n < realization.lasting:
        raise ResponseError(f"reduced: order = {n}; {realization.lasting} of the {len(space.states)} states of "
                            f"'{space.name}' do not decay and are kept. Ask for at least as many, or give the "
                            f"mechanism damping.")  # fmt: skip
    small = realization.matrix(space.A, n), realization.left[:n] @ space.B, space.C @ realization.right[:, :n]
    about_poles, rounding = rounding_error(space, small, realization.lasting)
    return small, max(realization.bound(n), about_poles) + rounding


def hankel_singular_values(space: StateSpace) -> Array:
    """Return the Hankel singular values sqrt(lambda_i(P Q)) of the states that decay, P and Q the Gramians, descending.
    """
    return balanced(space.A, space.B, space.C).hankel


def reduced_equations(
    system: Equations, method: str, order: int | None = None, error: float | None = None
) -> Equations:
    """Return equations of motion in ``order`` coordinates, or in as few as an ``error`` of the response allows.

    modal: the modes that contribute most; static-corrected: these, and the static response of the others in D;
    craig-bampton: displacements of outputs and of the points where inputs act, and modes with these held
    """
    if method not in METHODS[1:]:
        about = " It is for systems of sparse matrices (System.from_matrices)." if method == "krylov" else ""
        raise ResponseError(f"reduced: method = {method!r}; expected one of {', '.join(map(repr, METHODS))}.{about}"
                            f"{nearest(str(method), METHODS)}")  # fmt: skip
    _check(system.name, order, error, system.dof, "coordinates")
    if system.massless or system.circulatory is not None:
        kind = "motions without mass" if system.massless else "forces that follow the motion"
        raise ResponseError(f"reduced: '{system.name}' has {kind}, which method = {method!r} does not project; take "
                            f"method='balanced'.")  # fmt: skip
    family = CraigBampton(system) if method == "craig-bampton" else ModalTruncation(system,
                                                                                   method == "static-corrected")
    if order is not None and order < family.least:
        kind = "coordinates of the interface" if method == "craig-bampton" else "free motions"
        raise ResponseError(f"reduced: order = {order}; '{system.name}' has {family.least} {kind}, which every reduced "
                            f"model keeps. Ask for at least as many.")  # fmt: skip
    if order is not None:
        small = family.model(order)
        bound = error_bound(system, small)
    else:
        small, bound = _smallest(system, family, float(error or 0.0))
    before = system.provenance.truncation
    truncation = Truncation(method, system.dof, bound + (0.0 if before is None else before.error_bound))
    return replace(small, provenance=replace(small.provenance, truncation=truncation))


def _smallest(system: Equations, family: CraigBampton | ModalTruncation, error: float) -> tuple[Equations, float]:
    """A model within an error, found by bisection: the smallest where errors fall with the order."""
    low, high = family.least, family.most
    models = {}
    while low < high:
        middle = (low + high) // 2
        small = family.model(middle)
        models[middle] = small, error_bound(system, small)
        low, high = (low, middle) if models[middle][1] <= error else (middle + 1, high)
    if low not in models:
        small = family.model(low)
        models[low] = small, error_bound(system, small)
    if models[low][1] > error:
        raise ResponseError(f"reduced: error = {error:g}; all {low} coordinates of '{system.name}' leave "
                            f"{models[low][1]:.3g}. Give a larger error, or take method='balanced'.")  # fmt: skip
    return models[low]


def _check(name: str, order: int | None, error: float | None, most: int, kind: str) -> None:
    if (order is None) == (error is None):
        raise ResponseError(f"reduced: order = {order}, error = {error}; expected one of both: the number of {kind}, "
                            f"or the largest error of the frequency response.")  # fmt: skip
    if order is not None and (isinstance(order, bool) or not isinstance(order, (int, np.integer))
                              or not 0 <= order <= most):
        raise ResponseError(f"reduced: order = {order!r}; expected a whole number up to {most}, the {kind} of "
                            f"'{name}'.")  # fmt: skip
    if error is not None and not (isinstance(error, (int, float, np.floating)) and 0.0 < error < np.inf):
        raise ResponseError(f"reduced: error = {error!r}; expected a positive number, output by input in SI units.")
