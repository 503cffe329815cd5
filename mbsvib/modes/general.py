"""Modes of systems without symmetry: spin, follower loads, massless motions.

Where C has a gyroscopic part or K a circulatory one, each eigenvalue has a right and a left vector; where M is
singular, massless motions have one eigenvalue each in place of two. The eigenvalues of the state matrix in energy
coordinates (``energy_state``) start an iteration on the factors themselves (``general_refinement``). A system that
keeps a sum of squares (spin, but neither dampers nor circulatory forces nor negative stiffness) has a skew-symmetric
state matrix, a Hermitian one times i: its eigenvalues are imaginary exactly.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.linalg.rank import EPS
from mbsvib.modes.energy_state import EnergyState, answer, energy_state
from mbsvib.modes.general_refinement import Spectrum, refined

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Complex
    from mbsvib.equations.equations import Equations


# Eigenvalues this many roundings of the matrix apart are one, if their vectors look nearly dependent.
TOGETHER = 1e3
DEPENDENT = 0.5
# A conservative system's eigenvalue off the imaginary axis by less than this many roundings is on it.
ON_AXIS = 100.0
# Eigenvalues are small beside the largest where rounding of that may have taken more than their last digits.
SMALL = 1e-8
# Motions whose shapes differ by no more than this are parallel: all those of one mass on springs and dampers.
ALIKE = 1e-9
# Real eigenvalues that coincide may come out as a pair with such a share of them as imaginary part.
NEARLY_REAL = 1e-6
# In place of the number of an eigenvalue: 0, the conjugate of the other one, and none.
STILL, CONJUGATE, ALONE = -1, -2, -3


@dataclass(frozen=True, slots=True)
class General:
    """Modes of a system without symmetry, in ascending natural frequency.

    ``pairs`` (k, 2) of eigenvalues, one row a mode, with ``errors`` (k, 2) relative; a mode of first order
    (``single``) has its one eigenvalue twice. ``shapes`` (m, k) are the modes, complex. ``spectrum`` has the
    eigenvalues but 0 with both vectors, ``state`` what belongs to 0, and the equations in energy coordinates; ``mode``
    numbers the mode of each eigenvalue of the spectrum.
    """

    pairs: Complex
    errors: Array
    single: NDArray[np.bool_]
    shapes: Complex
    rigid: int
    spectrum: Spectrum
    mode: NDArray[np.intp]
    state: EnergyState = field(repr=False)

    @property
    def values(self) -> Complex:
        """All eigenvalues, (2m - massless,), pairs together."""
        keep = np.ones(self.pairs.shape, dtype=bool)
        keep[:, 1] = ~self.single
        return self.pairs[keep]

    @property
    def value_errors(self) -> Array:
        """Relative errors of ``values``."""
        keep = np.ones(self.pairs.shape, dtype=bool)
        keep[:, 1] = ~self.single
        return self.errors[keep]


def is_general(system: Equations) -> bool:
    """Tell whether a system's matrices lack what symmetric solvers rely on.

    Parameters
    ----------
    system : Equations
        The equations of motion.

    Returns
    -------
    bool
        Whether C has a gyroscopic part, K a circulatory one, or M is singular.
    """
    return system.gyroscopic is not None or system.circulatory is not None or system.massless > 0


def general(system: Equations, rtol: float) -> General:
    """Return the modes, (lambda^2 M + lambda C + K) phi = 0, of a system whose matrices need not be symmetric.

    Parameters
    ----------
    system : Equations
        The equations of motion.
    rtol : float
        Relative accuracy asked of every eigenvalue.

    Returns
    -------
    General
        Eigenvalues, right and left vectors.
    """
    return _in_modes(system, *spectrum(system, rtol))


def spectrum(system: Equations, rtol: float) -> tuple[EnergyState, Spectrum]:
    """Return all eigenvalues and vectors, those of 0 by their invariant subspaces.

    Parameters
    ----------
    system : Equations
        The equations of motion.
    rtol : float
        Relative accuracy asked of every eigenvalue.

    Returns
    -------
    EnergyState and Spectrum
        What belongs to 0, and the other eigenvalues with their vectors.
    """
    state = energy_state(system, rtol)
    even = system.circulatory is None and not system.damping.any()
    start = _imaginary(state) if state.conservative else _any(state, even)
    return state, refined(system, state, start)


def _imaginary(state: EnergyState) -> Spectrum:
    """Eigenvalues of a skew-symmetric A, less those of motions that only drift."""
    p = len(state.scale)
    felt = np.concatenate((np.arange(state.still, p), np.arange(p, 2 * p)))
    a = state.a[np.ix_(felt, felt)]
    chains = state.right[felt, state.still :]
    keep = np.linalg.qr(chains, mode="complete")[0][:, chains.shape[1] :]
    inner = keep.T @ a @ keep
    omega, vectors = np.linalg.eigh(-0.5j * (inner - inner.T))
    chosen = omega > 0.0
    if 2 * np.count_nonzero(chosen) != len(omega):
        return _any(state, even=True)
    omega, found = omega[chosen], keep @ vectors[:, chosen]
    rate, still, d = found[p - state.still :], state.still, state.scale[state.still :, None]
    eta = rate / (1j * omega)
    turned = found[: p - still] * d - 1j * omega * rate[still:]
    eta[still:] = turned / (d * d + omega**2)
    x = (state.show[:, :p] * state.scale) @ eta
    return Spectrum(1j * omega, x, x.conj(), np.ones(len(omega), dtype=bool), "hermitian")


def _any(state: EnergyState, even: bool) -> Spectrum:
    """Eigenvalues of A with right and left vectors, less those that are 0.

    Those of an ``even`` system, without damping, have mirror images: one that is off the imaginary axis by no more than
    its rounding has none, and is on it.
    """
    keep = np.linalg.qr(state.left, mode="complete")[0][:, state.left.shape[1] :]
    inner = keep.T @ state.a @ keep
    values, left, right = _eigen(inner)
    size = np.abs(values)
    if len(size) and float(size.min()) < SMALL * float(size.max()):
        values, left, right = _with_small_ones((values, left, right), state, keep)
    values, left, right = _separated(inner, values, left, right)
    r, w = keep @ right, keep @ left
    w -= state.left @ (state.right.T @ w)
    p = len(state.scale)
    x = state.show @ r
    # velocities are the better part of a fast motion, displacements that of a slow one
    d = state.scale[:, None]
    share = (values.conj() * r[p : 2 * p] - np.abs(values) ** 2 * r[:p] / d) / (d * d + np.abs(values) ** 2)
    x = x + (state.show[:, :p] * state.scale) @ share
    y: Complex = state.force.T @ w
    values, turns = values.astype(complex), values.imag > 0.0
    if not even:
        return Spectrum(values, x, y, turns)
    condition = np.linalg.norm(r, axis=0) * np.linalg.norm(w, axis=0) / np.abs(np.einsum("ij,ij->j", w, r))
    on = turns & (np.abs(values.real) <= ON_AXIS * EPS * float(np.linalg.norm(state.a, 2)) * condition)
    values.real[on] = 0.0
    y[:, on] = x[:, on].conj()
    return Spectrum(values, x, y, turns, "", on)


_Found = tuple["Complex", "Complex", "Complex"]


def _eigen(a: Array) -> _Found:
    """Eigenvalues without those of negative imaginary part, with left and right vectors."""
    from scipy.linalg import eig

    values, left, right = eig(a, left=True, right=True)
    half = np.nonzero(values.imag >= 0.0)[0]
    return values[half], left[:, half].conj().astype(complex), right[:, half].astype(complex)


def _with_small_ones(found: _Found, state: EnergyState, keep: Array) -> _Found:
    """Eigenvalues that are small beside the largest from the inverse of A, which is known without inverting A."""
    inverse = _inverse(state)
    if inverse is None:
        return found
    back, *vectors = _eigen(keep.T @ (inverse - state.right @ (state.left.T @ inverse)) @ keep)
    if not back.all():
        return found
    small = np.where(back.imag == 0.0, 1.0 / back, (1.0 / back).conj())  # the one with positive imaginary part
    vectors = [np.where(back.imag == 0.0, part, part.conj()) for part in vectors]
    middle = np.sqrt(np.abs(found[0]).max() * np.abs(small).min())
    own, other = np.abs(found[0]) >= middle, np.abs(small) < middle
    count = [np.count_nonzero(chosen) + np.count_nonzero(values.imag[chosen] > 0.0)
             for values, chosen in ((found[0], own), (small, other))]  # fmt: skip
    if sum(count) != keep.shape[1]:
        return found
    return (np.concatenate((found[0][own], small[other])),
            np.concatenate((found[1][:, own], vectors[0][:, other]), axis=1),
            np.concatenate((found[2][:, own], vectors[1][:, other]), axis=1))  # fmt: skip


def _inverse(state: EnergyState) -> Array | None:
    """x with A x = b for all b that have one, from K q = -C q' - M q''; None where K is singular and not diagonal."""
    p, m = len(state.scale), len(state.basis)
    stiffness = state.coupling.copy()
    stiffness[np.arange(p), np.arange(p)] += state.square
    push = np.zeros((m, len(state.a)))
    push[:, :p], push[:, 2 * p :] = state.damping[:, :p] / state.scale, state.damping[:, p:]
    push[:p, p : 2 * p] = np.eye(p)
    if not state.coupling.any():
        q = np.divide(-push, state.square[:, None], out=np.zeros_like(push), where=state.square[:, None] != 0.0)
    elif state.still and not np.array_equal(stiffness, stiffness.T):
        return None
    else:
        null = np.concatenate((state.right[:p] / state.scale[:, None], state.right[2 * p :]))[:, : state.still]
        q = answer(stiffness, push, null, null)
    result = np.zeros_like(state.a)
    result[:p], result[2 * p :] = state.scale[:, None] * q[:p], q[p:]
    result[np.arange(p, 2 * p), np.arange(p)] = 1.0 / state.scale
    return result


def _separated(a: Array, values: Complex, left: Complex, right: Complex) -> _Found:
    """Give eigenvalues that rounding cannot tell apart independent vectors, if they have them.

    Real ones that rounding has made a conjugate pair of are real again, with the parts of its vectors.
    """
    size = TOGETHER * EPS * (float(np.abs(a).sum(axis=1).max(initial=0.0)) or 1.0)
    torn = (values.imag > 0.0) & (values.imag <= np.minimum(size, NEARLY_REAL * np.abs(values)))
    if torn.any():
        parts = (np.concatenate((v[:, ~torn], v[:, torn].real, v[:, torn].imag), axis=1) for v in (left, right))
        again = [v / np.maximum(np.linalg.norm(v, axis=0), np.finfo(float).tiny) for v in parts]
        all_values = np.concatenate((values[~torn], values[torn].real, values[torn].real))
        parted = np.arange(len(all_values)) >= np.count_nonzero(~torn)
        *found, done = _independent(a, size, (all_values, *again), parted)
        if done[parted].all():
            return found[0], found[1], found[2]
    return _independent(a, size, (values, left, right), np.zeros(len(values), dtype=bool))[:3]


def _independent(
    a: Array, size: float, found: _Found, parted: NDArray[np.bool_]
) -> tuple[Complex, Complex, Complex, NDArray[np.bool_]]:
    """Values, left and right vectors, independent in groups that are no more than ``size`` apart, and which are in one:
    those of nearly dependent vectors and ``parted`` ones.
    """
    values, left, right = found
    weak = parted | (np.abs(np.einsum("ij,ij->j", left, right)) < DEPENDENT)
    done, seen = np.zeros(len(values), dtype=bool), np.zeros(len(values), dtype=bool)
    for i in np.nonzero(weak)[0]:
        group = np.nonzero((np.abs(values - values[i]) <= size) & ((values.imag > 0.0) == (values[i].imag > 0.0)))[0]
        if seen[i] or len(group) < 2:
            continue
        seen[group] = True
        r, w = np.linalg.qr(right[:, group])[0], np.linalg.qr(left[:, group])[0]
        both = w.T @ r
        if np.linalg.cond(both) > 1.0 / DEPENDENT**4:
            continue
        w = np.linalg.solve(both, w.T).T
        within = w.T @ a @ r
        if np.abs(within - np.diag(within.diagonal())).max() <= size:
            values, left, right = values.copy(), left.copy(), right.copy()
            values[group], left[:, group], right[:, group] = within.diagonal(), w, r
            done[group] = True
    return values, left, right, done


def _in_modes(system: Equations, state: EnergyState, found: Spectrum) -> General:
    """Put eigenvalues into modes: conjugates, real ones with 0 or with each other, the rest alone."""
    rest, drift = (shapes.astype(complex) for shapes in rigid_shapes(state))
    momentum, resting = system.inertia_factor @ found.right, system.inertia_factor @ rest
    size = np.abs(found.values)
    apart = np.abs(found.values[:, None] - found.values) / np.maximum(size[:, None], size)
    zeros, reals = list(range(rest.shape[1])), np.nonzero(~found.turns)[0].tolist()
    pairs = max(0, (len(reals) + len(zeros) - system.massless) // 2)
    table: list[tuple[int, int]] = [(STILL, STILL)] * drift.shape[1]  # numbers of eigenvalues
    shapes: list[Complex] = list(drift.T)
    while zeros and reals and pairs:
        i, j = _most_alike(resting[:, zeros], momentum[:, reals], size[reals])
        table.append((STILL, reals.pop(j)))
        shapes.append(rest[:, zeros.pop(i)])
        pairs -= 1
    while len(zeros) > 1 and pairs:
        table.append((STILL, STILL))
        shapes.append(rest[:, zeros.pop(0)])
        zeros.pop(0)
        pairs -= 1
    while len(reals) > 1 and pairs:
        i, j = _most_alike(momentum[:, reals], momentum[:, reals], apart[np.ix_(reals, reals)])
        first, second = sorted((reals[i], reals[j]), key=lambda k: abs(found.values[k]))
        reals = [k for k in reals if k not in (first, second)]
        table.append((first, second))
        shapes.append(found.right[:, first])
        pairs -= 1
    table += [(STILL, ALONE)] * len(zeros) + [(k, ALONE) for k in reals]
    shapes += [rest[:, k] for k in zeros] + [found.right[:, k] for k in reals]
    for k in np.nonzero(found.turns)[0].tolist():
        table.append((k, CONJUGATE))
        shapes.append(found.right[:, k])
    return _sorted(system, state, found, (np.array(table, dtype=np.intp).reshape(-1, 2), shapes))


def _sorted(
    system: Equations, state: EnergyState, found: Spectrum, modes: tuple[NDArray[np.intp], list[Complex]]
) -> General:
    table, shapes = modes
    first, second = table.T
    values, errors = np.append(found.values, 0.0), np.append(found.errors, 0.0)  # STILL is the last one
    conjugate, single = second == CONJUGATE, second == ALONE
    second = np.where(conjugate | single, first, second)
    pairs = np.stack((values[first], np.where(conjugate, values[first].conj(), values[second])), axis=1)
    order = np.argsort(np.sqrt(np.abs(pairs[:, 0] * pairs[:, 1])), kind="stable")
    columns = np.array(shapes, dtype=complex).reshape(len(table), system.dof).T
    mode = np.zeros(len(values), dtype=np.intp)
    place = np.argsort(order)
    mode[first], mode[second] = place, place
    rigid = int(np.count_nonzero((pairs == 0.0).any(axis=1)))
    return General(pairs[order], np.stack((errors[first], errors[second]), axis=1)[order], single[order],
                   columns[:, order], rigid, found, mode[:-1], state)  # fmt: skip


def rigid_shapes(state: EnergyState) -> tuple[Array, Array]:
    """Return the motions that stiffness does not feel: those which come to rest, and those in chains, which drift.

    Parameters
    ----------
    state : EnergyState
        The equations in energy coordinates.

    Returns
    -------
    tuple of array, shape (m, r)
        Both, as displacements.
    """
    if state.long:  # no motion has a chain of its own: as many as there are pairs of zeros
        u = np.linalg.svd(state.show @ state.right)[0]
        zeros = state.right.shape[1]
        return u[:, zeros // 2 : -(-zeros // 2)], u[:, : zeros // 2]
    null = state.show @ state.right[:, : state.still]
    free = state.right.shape[1] - state.still
    if not free:
        return null, null[:, :0]
    turn = np.linalg.svd(state.nilpotent[: state.still, state.still :])[0]
    return null @ turn[:, free:], null @ state.nilpotent[: state.still, state.still :]


def _most_alike(one: Complex, other: Complex, apart: Array) -> tuple[int, int]:
    """Numbers of the two columns that are most nearly parallel, of those that are so alike the least ``apart``; of
    columns of the same matrix two different ones.
    """
    one, other = (a / np.maximum(np.linalg.norm(a, axis=0), np.finfo(float).tiny) for a in (one, other))
    share = np.abs(one.T @ other)
    if share.shape[0] == share.shape[1] and one.shape == other.shape and np.array_equal(one, other):
        np.fill_diagonal(share, -1.0)
    alike = share >= share.max() - ALIKE
    i, j = np.unravel_index(int(np.where(alike, apart, np.inf).argmin()), share.shape)
    return int(i), int(j)
