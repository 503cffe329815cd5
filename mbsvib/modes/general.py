"""Modes of systems without symmetry: spin, follower loads, massless motions.

Where C has a gyroscopic part or K a circulatory one, each eigenvalue has a right and a left vector; where M is
singular, massless motions have one eigenvalue each in place of two. The eigenvalues of the state matrix in energy
coordinates (``energy_state``) start an iteration on the factors themselves (``general_refinement``). A system that
keeps a sum of squares (spin, but neither dampers nor circulatory forces nor negative stiffness) has a skew-symmetric
state matrix, a Hermitian one times i: its eigenvalues are imaginary exactly.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import eig

from mbsvib.common.arrays import Array, Bools, Complex, Index
from mbsvib.equations.equations import Equations
from mbsvib.linalg.rank import EPS
from mbsvib.modes.energy_state import EnergyState, energy_state
from mbsvib.modes.general_refinement import Spectrum, refined
from mbsvib.modes.pairs import natural_frequencies, of_all
from mbsvib.modes.zero_subspaces import answer

# Shapes that differ by less are parallel, such as all motions of a single mass on springs and dampers.
ALIKE = 1e-9
# In place of the number of an eigenvalue: the eigenvalue 0, the conjugate of the first one, no second eigenvalue.
STILL, CONJUGATE, UNPAIRED = -1, -2, -3


@dataclass(frozen=True, slots=True)
class General:
    """Modes of a system without symmetry, in ascending natural frequency.

    ``pairs`` (k, 2) of eigenvalues, one row a mode, with ``errors`` (k, 2) relative; a mode of first order
    (``single``) has its one eigenvalue twice. ``shapes`` (m, k) are the modes, complex. ``spectrum`` contains the
    nonzero eigenvalues with both vectors, ``state`` the equations in energy coordinates with the subspaces of the
    eigenvalue 0. ``numbers`` (k, 2) are those of the pairs in the complete spectrum, -1 for the eigenvalue 0.
    """

    pairs: Complex
    errors: Array
    single: Bools
    shapes: Complex
    rigid: int
    spectrum: Spectrum
    numbers: Index
    state: EnergyState = field(repr=False)

    @property
    def mode(self) -> Index:
        """The mode number of each eigenvalue of the spectrum."""
        result = np.zeros(self.numbers.max(initial=-1) + 2, dtype=np.intp)  # of the eigenvalue 0 behind them
        result[self.numbers] = np.arange(len(self.numbers))[:, None]
        return result[: len(self.spectrum.values)]

    @property
    def values(self) -> Complex:
        """All eigenvalues, (2m - massless,), pairs together."""
        return np.asarray(of_all(self.pairs, self.single))


def is_general(system: Equations) -> bool:
    """Tell whether a system needs the solver for unsymmetric matrices or massless motions.

    That is, whether C has a gyroscopic part, K a circulatory one, or M is singular.
    """
    return system.gyroscopic is not None or system.circulatory is not None or system.massless > 0


def general(system: Equations, rtol: float) -> General:
    """Return the modes, (lambda^2 M + lambda C + K) phi = 0, of a system whose matrices need not be symmetric."""

    return _in_modes(system, *spectrum(system, rtol))


def _in_modes(system: Equations, state: EnergyState, eigen: Spectrum) -> General:
    """Pair eigenvalues into modes: conjugates, real ones with 0 or with each other; the rest have first order."""
    rest, drift = (shapes.astype(complex) for shapes in rigid_shapes(state))
    momentum, resting = system.inertia_factor @ eigen.right, system.inertia_factor @ rest
    size = np.abs(eigen.values)
    separation = np.abs(eigen.values[:, None] - eigen.values) / np.maximum(size[:, None], size)
    zeros, reals = list(range(rest.shape[1])), np.nonzero(~eigen.turns)[0].tolist()
    pairs = max(0, (len(reals) + len(zeros) - system.massless) // 2)
    numbers: list[tuple[int, int]] = [(STILL, STILL)] * drift.shape[1]  # numbers of eigenvalues
    shapes: list[Complex] = list(drift.T)
    while zeros and reals and pairs:
        i, j = _most_alike(resting[:, zeros], momentum[:, reals], size[reals])
        numbers.append((STILL, reals.pop(j)))
        shapes.append(rest[:, zeros.pop(i)])
        pairs -= 1
    while len(zeros) > 1 and pairs:
        numbers.append((STILL, STILL))
        shapes.append(rest[:, zeros.pop(0)])
        zeros.pop(0)
        pairs -= 1
    while len(reals) > 1 and pairs:
        i, j = _most_alike(momentum[:, reals], momentum[:, reals], separation[np.ix_(reals, reals)])
        first, second = sorted((reals[i], reals[j]), key=lambda k: abs(eigen.values[k]))
        reals = [k for k in reals if k not in (first, second)]
        numbers.append((first, second))
        shapes.append(eigen.right[:, first])
        pairs -= 1
    numbers += [(STILL, UNPAIRED)] * len(zeros) + [(k, UNPAIRED) for k in reals]
    shapes += [rest[:, k] for k in zeros] + [eigen.right[:, k] for k in reals]
    for k in np.nonzero(eigen.turns)[0].tolist():
        numbers.append((k, CONJUGATE))
        shapes.append(eigen.right[:, k])
    return _sorted(system, state, eigen, (np.array(numbers, dtype=np.intp).reshape(-1, 2), shapes))


def _sorted(
    system: Equations, state: EnergyState, eigen: Spectrum, modes: tuple[Index, list[Complex]]
) -> General:
    numbers, shapes = modes
    values, errors = np.append(eigen.complete()[0], 0.0), np.append(eigen.errors, eigen.errors[eigen.turns])
    conjugates = len(eigen.values) + np.cumsum(eigen.turns) - 1
    first, second = numbers.T
    single = second == UNPAIRED
    numbers[second == CONJUGATE, 1] = conjugates[first[second == CONJUGATE]]
    numbers[single, 1] = first[single]
    order = np.argsort(natural_frequencies(values[numbers]), kind="stable")
    numbers, single, errors = numbers[order], single[order], np.append(errors, 0.0)  # STILL is the last one
    columns = np.array(shapes, dtype=complex).reshape(len(numbers), system.dof).T[:, order]
    rigid = int(np.count_nonzero((numbers == STILL).any(axis=1)))
    return General(values[numbers], errors[numbers], single, columns, rigid, eigen, numbers, state)


def rigid_shapes(state: EnergyState) -> tuple[Array, Array]:
    """Return the motions without stiffness as displacements (m, r): those that come to rest, and those in chains, which
    drift.
    """
    if state.long:  # motions cannot be assigned to chains: take as many as there are pairs of zeros
        u = np.linalg.svd(state.show @ state.right)[0]
        zeros = state.right.shape[1]
        return u[:, zeros // 2 : -(-zeros // 2)], u[:, : zeros // 2]
    null = state.show @ state.right[:, : state.null_count]
    free = state.right.shape[1] - state.null_count
    if not free:
        return null, null[:, :0]
    turn = np.linalg.svd(state.nilpotent[: state.null_count, state.null_count :])[0]
    return null @ turn[:, free:], null @ state.nilpotent[: state.null_count, state.null_count :]


def _most_alike(first: Complex, second: Complex, separation: Array) -> tuple[int, int]:
    """Numbers of the two most nearly parallel columns; among parallel ones those with the smallest ``separation``. If
    both matrices are the same, the columns are different.
    """
    first, second = (a / np.maximum(np.linalg.norm(a, axis=0), np.finfo(float).tiny) for a in (first, second))
    share = np.abs(first.T @ second)
    if share.shape[0] == share.shape[1] and first.shape == second.shape and np.array_equal(first, second):
        np.fill_diagonal(share, -1.0)
    alike = share >= share.max() - ALIKE
    i, j = np.unravel_index(int(np.where(alike, separation, np.inf).argmin()), share.shape)
    return int(i), int(j)


# Eigenvalues closer than this many roundings of the matrix are treated as repeated if their vectors are dependent.
TOGETHER = 1e3
DEPENDENT = 0.5
# An eigenvalue of a conservative system within this many roundings of the imaginary axis is imaginary.
ON_AXIS = 100.0
# Eigenvalues smaller than this share of the largest may have lost more than their last digits to rounding.
SMALL = 1e-8
# Rounding may turn repeated real eigenvalues into a conjugate pair with imaginary parts up to this share of them.
NEARLY_REAL = 1e-6


def spectrum(system: Equations, rtol: float) -> tuple[EnergyState, Spectrum]:
    """Return all eigenvalues and vectors, those of 0 by their invariant subspaces."""
    state = energy_state(system, rtol)
    even = system.circulatory is None and not system.row_damping.any()
    start = _imaginary(state) if state.conservative else _any(state, even)
    return state, refined(system, state, start)


def _imaginary(state: EnergyState) -> Spectrum:
    """Eigenvalues of a skew-symmetric A, without those of drifting motions."""
    p = len(state.scale)
    active = np.concatenate((np.arange(state.null_count, p), np.arange(p, 2 * p)))
    a = state.a[np.ix_(active, active)]
    chains = state.right[active, state.null_count :]
    complement = np.linalg.qr(chains, mode="complete")[0][:, chains.shape[1] :]
    inner = complement.T @ a @ complement
    omega, vectors = np.linalg.eigh(-0.5j * (inner - inner.T))
    positive = omega > 0.0
    if 2 * np.count_nonzero(positive) != len(omega):
        return _any(state, even=True)
    omega, states = omega[positive], complement @ vectors[:, positive]
    rate, null_count, d = states[p - state.null_count :], state.null_count, state.scale[state.null_count :, None]
    eta = rate / (1j * omega)
    numerator = states[: p - null_count] * d - 1j * omega * rate[null_count:]
    eta[null_count:] = numerator / (d * d + omega**2)
    x = (state.show[:, :p] * state.scale) @ eta
    return Spectrum(1j * omega, x, x.conj(), np.ones(len(omega), dtype=bool), "hermitian")


def _any(state: EnergyState, even: bool) -> Spectrum:
    """Nonzero eigenvalues of A with right and left vectors.

    The eigenvalues of an ``even`` system, without damping, are symmetric about the imaginary axis: one that is off the
    axis by no more than its rounding has no mirror image, and is put on the axis.
    """
    complement = np.linalg.qr(state.left, mode="complete")[0][:, state.left.shape[1] :]
    inner = complement.T @ state.a @ complement
    values, left, right = _eigen(inner)
    size = np.abs(values)
    if len(size) and float(size.min()) < SMALL * float(size.max()):
        values, left, right = _with_small_ones((values, left, right), state, complement)
    values, left, right = _separated(inner, values, left, right)
    r, w = complement @ right, complement @ left
    w -= state.left @ (state.right.T @ w)
    p = len(state.scale)
    x = state.show @ r
    # velocities of fast motions are more accurate than their displacements, and conversely for slow motions
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

_Eigensolution = tuple["Complex", "Complex", "Complex"]


def _eigen(a: Array) -> _Eigensolution:
    """Eigenvalues without those of negative imaginary part, with left and right vectors."""
    values, left, right = eig(a, left=True, right=True)
    half = np.nonzero(values.imag >= 0.0)[0]
    return values[half], left[:, half].conj().astype(complex), right[:, half].astype(complex)


def _with_small_ones(eigensolution: _Eigensolution, state: EnergyState, complement: Array) -> _Eigensolution:
    """Replace eigenvalues that are small compared with the largest by those of the inverse of A, which is explicit."""
    inverse = _inverse(state)
    if inverse is None:
        return eigensolution
    back, *vectors = _eigen(complement.T @ (inverse - state.right @ (state.left.T @ inverse)) @ complement)
    if not back.all():
        return eigensolution
    small = np.where(back.imag == 0.0, 1.0 / back, (1.0 / back).conj())  # the one with positive imaginary part
    vectors = [np.where(back.imag == 0.0, part, part.conj()) for part in vectors]
    middle = np.sqrt(np.abs(eigensolution[0]).max() * np.abs(small).min())
    from_matrix, from_inverse = np.abs(eigensolution[0]) >= middle, np.abs(small) < middle
    count = [np.count_nonzero(selected) + np.count_nonzero(values.imag[selected] > 0.0)
             for values, selected in ((eigensolution[0], from_matrix), (small, from_inverse))]  # fmt: skip
    if sum(count) != complement.shape[1]:
        return eigensolution
    return (np.concatenate((eigensolution[0][from_matrix], small[from_inverse])),
            np.concatenate((eigensolution[1][:, from_matrix], vectors[0][:, from_inverse]), axis=1),
            np.concatenate((eigensolution[2][:, from_matrix], vectors[1][:, from_inverse]), axis=1))  # fmt: skip


def _inverse(state: EnergyState) -> Array | None:
    """Generalized inverse of A, from K q = -C q' - M q''; None where K is singular and not symmetric."""
    p, m = len(state.scale), len(state.basis)
    stiffness = state.coupling.copy()
    stiffness[np.arange(p), np.arange(p)] += state.square
    forces = np.zeros((m, len(state.a)))
    forces[:, :p], forces[:, 2 * p :] = state.damping[:, :p] / state.scale, state.damping[:, p:]
    forces[:p, p : 2 * p] = np.eye(p)
    if not state.coupling.any():
        q = np.divide(-forces, state.square[:, None], out=np.zeros_like(forces), where=state.square[:, None] != 0.0)
    elif state.null_count and not np.array_equal(stiffness, stiffness.T):
        return None
    else:
        null = np.concatenate((state.right[:p] / state.scale[:, None], state.right[2 * p :]))[:, : state.null_count]
        q = answer(stiffness, forces, null, null)
    result = np.zeros_like(state.a)
    result[:p], result[2 * p :] = state.scale[:, None] * q[:p], q[p:]
    result[np.arange(p, 2 * p), np.arange(p)] = 1.0 / state.scale
    return result


def _separated(a: Array, values: Complex, left: Complex, right: Complex) -> _Eigensolution:
    """Replace nearly dependent vectors of eigenvalues that agree to rounding by independent ones, if they exist.

    Conjugate pairs that are repeated real eigenvalues up to rounding become real, with the parts of their vectors.
    """
    size = TOGETHER * EPS * float(np.abs(a).sum(axis=1).max(initial=0.0))
    torn = (values.imag > 0.0) & (values.imag <= np.minimum(size, NEARLY_REAL * np.abs(values)))
    if torn.any():
        parts = (np.concatenate((v[:, ~torn], v[:, torn].real, v[:, torn].imag), axis=1) for v in (left, right))
        again = [v / np.maximum(np.linalg.norm(v, axis=0), np.finfo(float).tiny) for v in parts]
        all_values = np.concatenate((values[~torn], values[torn].real, values[torn].real))
        parted = np.arange(len(all_values)) >= np.count_nonzero(~torn)
        *eigensolution, done = _independent(a, size, (all_values, *again), parted)
        if done[parted].all():
            return eigensolution[0], eigensolution[1], eigensolution[2]
    return _independent(a, size, (values, left, right), np.zeros(len(values), dtype=bool))[:3]


def _independent(
    a: Array, size: float, eigensolution: _Eigensolution, parted: Bools
) -> tuple[Complex, Complex, Complex, Bools]:
    """Values, left and right vectors, made independent in groups of values that are at most ``size`` apart, and a mask
    of the values in such groups: those of nearly dependent vectors and ``parted`` ones.
    """
    values, left, right = eigensolution
    weak = parted | (np.abs(np.einsum("ij,ij->j", left, right)) < DEPENDENT)
    done, visited = np.zeros(len(values), dtype=bool), np.zeros(len(values), dtype=bool)
    for i in np.nonzero(weak)[0]:
        group = np.nonzero((np.abs(values - values[i]) <= size) & ((values.imag > 0.0) == (values[i].imag > 0.0)))[0]
        if visited[i] or len(group) < 2:
            continue
        visited[group] = True
        r, w = np.linalg.qr(right[:, group])[0], np.linalg.qr(left[:, group])[0]
        products = w.T @ r
        if np.linalg.cond(products) > 1.0 / DEPENDENT**4:
            continue
        w = np.linalg.solve(products, w.T).T
        within = w.T @ a @ r
        if np.abs(within - np.diag(within.diagonal())).max() <= size:
            values, left, right = values.copy(), left.copy(), right.copy()
            values[group], left[:, group], right[:, group] = within.diagonal(), w, r
            done[group] = True
    return values, left, right, done
