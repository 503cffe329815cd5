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

from mbsvib.modes.pairs import natural_frequencies, of_all

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Complex, Index
    from mbsvib.equations.equations import Equations
    from mbsvib.modes.energy_state import EnergyState
    from mbsvib.modes.general_refinement import Spectrum


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
    single: NDArray[np.bool_]
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
    from mbsvib.modes.general_spectrum import spectrum  # most systems have symmetric matrices

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
    system: Equations, state: EnergyState, eigen: Spectrum, modes: tuple[NDArray[np.intp], list[Complex]]
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
