"""Some modes of unsymmetric equations: search for the nearest eigenvalues and the subspace of their vectors.

The lowest modes have an eigenvalue in a disc around 0 whose radius is the highest natural frequency among them. Those
nearest to a frequency have eigenvalues in a ring, or, if they are overdamped, one on the real axis within it. Discs are
placed along the ring, starting at the imaginary axis, where lightly damped modes are, until they cover the ring.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mbsvib.common.arrays import Array, Complex, Index
from mbsvib.equations.equations import Equations
from mbsvib.equations.unresisted_motion import free_motions
from mbsvib.errors import ResponseError
from mbsvib.modes import Modes
from mbsvib.modes import modes as dense_modes
from mbsvib.sparse.disc import Disc, disc
from mbsvib.sparse.equations import SparseEquations
from mbsvib.sparse.galerkin import (
    Galerkin,
    Solution,
    eigenvectors,
    error_bound,
    extended,
    independent,
    independent_with_mass,
    parts,
    split_massless,
    with_static_motions,
)
from mbsvib.sparse.layout import motions
from mbsvib.sparse.operator import COUPLED_RIGID, operator
from mbsvib.sparse.quadratic import Quadratic
from mbsvib.sparse.reduction import RTOL, reduced

# Number of additional modes.
GUARDS = 2
# All modes are computed up to this number of degrees of freedom, or up to this multiple of the wanted modes.
DENSE_DOF, DENSE_RATIO = 40, 6
# If the search fails, all modes are computed up to this size.
LARGEST = 1500
# The shift for the lowest modes, as a share of the lowest frequency that is not 0.
SHIFT = 0.1
# The wanted eigenvalues are at most this factor above that shift, approximately.
FAST = 100.0
# Steps that approximate the nearest eigenvalues, and the factor by which the shift grows until nonzero ones appear.
STEPS, ABOVE = 24, 10.0
# A frequency above all eigenvalues by more than this factor is reduced to the last of them.
BEYOND = 1.2
# Shifts near the imaginary axis have this relative distance from it, on the unstable side, where few eigenvalues are.
ASIDE = 1e-5
# Radius of the first disc over the width of the ring; of the others, over the distance from the imaginary axis, or over
# the width of the ring if that is larger.
FIRST, CLEAR, WIDER = 1.5, 0.7, 1.2
# A ring wider than this share of its radius is searched as a disc around 0.
WIDE = 0.5
# Share of the radius of the disc on the real axis that is searched: lightly damped modes are at its rim.
WITHIN = 0.9
# Computed pairs of eigenvalues 0 are smaller than this share of a typical one of springs and bodies.
NOISE = 1e-6
# Eigenvalues smaller than this share of the radius of a disc may be 0.
ZERO = 1e-5
# Eigenvalues with a smaller share of imaginary part may be real.
REAL = 1e-6
# Eigenvalues of a disc and of its subspace are the same up to this share of their distance from the shift.
SAME = 1e-5
# Residual of approximate eigenvalues, and number of rounds of searching for them.
ROUGH, ROUNDS = 1e-2, 40
# Eigenvalues whose distances agree to this relative difference are taken together.
TIES = 1e-9


def general_modes(
    system: SparseEquations, k: int, near: float, form: type[Equations]
) -> tuple[Equations, Modes, Array, Index]:
    """Return the modes whose natural frequencies are nearest to a frequency, of unsymmetric equations.

    ``near`` [Hz], 0 for the lowest. Returns the small system of the class ``form``, its modes, a bound of the relative
    error of each eigenvalue by truncation of the subspace, and the numbers of the wanted modes.
    """
    quadratic, centre = Quadratic(system), 2.0 * np.pi * near

    def choose(result: Modes) -> Index:
        speed = np.abs(result.pairs).max(axis=1)  # orders rigid-body modes
        return np.sort(np.lexsort((speed, np.abs(result.natural - centre)))[:k])

    if system.dof > max(DENSE_DOF, DENSE_RATIO * (k + GUARDS)):
        search = Search(quadratic, k, centre, choose, form)
        result = search.ring() if near else search.lowest()
        if result is not None:
            return result.small, result.modes, result.bound, result.selected
        if system.dof > LARGEST:
            raise ResponseError(
                f"modes: {k} modes of '{system.name}' near {near:g} Hz cannot be separated from others nearby; ask for "
                f"fewer, or near another frequency, or use linearize(method='dense')."
            )
    mass, massless = split_massless(system, with_static_motions(system, coordinates(system)))
    if massless.shape[1]:
        mass = independent_with_mass(system, mass)
    small = reduced(system, np.concatenate((mass, massless), axis=1), 0, form, massless.shape[1])
    all_modes: Modes = dense_modes(small, RTOL)
    vectors = eigenvectors(all_modes, np.arange(len(all_modes)))
    bound = error_bound(system, small, all_modes, vectors, np.zeros(len(vectors.values)))
    return small, all_modes, bound, choose(all_modes)


@dataclass(frozen=True)
class Search:
    """The search for ``count`` modes around an angular frequency ``centre``; ``choose`` returns the numbers of the
    wanted modes of a small system, of class ``form``.
    """

    quadratic: Quadratic
    count: int
    centre: float
    choose: Callable[[Modes], Index]
    form: type[Equations]

    def lowest(self) -> Solution | None:
        """Return modes from a disc around 0; None if it would have to contain all of them."""
        sigma = SHIFT * lowest_speed(self.quadratic)
        first = disc(self.quadratic, sigma, FAST * sigma)
        rigid = rigid_motions(self.quadratic, self.count)
        requested = 2 * (self.count + GUARDS)
        while requested < self.quadratic.system.dof:
            first = first.grown(requested)
            if len(first.values) < self.count:
                return None
            first_order = bool(self.quadratic.system.massless)
            if first.reach >= (1.0 + TIES) * (self.centre + self._nearest(first, rigid.shape[1], first_order) + sigma):
                solution = self._solved(rigid, [first, *self._neighbours(first, requested)])
                if solution is None:
                    return None
                if first.reach >= (1.0 + TIES) * (self.centre + self._distance(solution) + sigma):
                    return solution
            requested += max(4, requested // 3)
        return None

    def ring(self) -> Solution | None:
        """Return modes from a ring; None if it would have to contain all of them."""
        centre = min(self.centre, highest_speed(self.quadratic, self.centre))
        sigma, requested = centre * (1j + ASIDE), self.count + GUARDS
        first = disc(self.quadratic, sigma)
        while True:
            first = first.grown(requested)
            if requested > self.quadratic.system.dof or len(first.values) < self.count:
                return None
            width = self._nearest(first, 0) - (self.centre - centre)
            least = width if self.quadratic.conservative else FIRST * width
            if first.reach >= (1.0 + TIES) * least + ASIDE * centre:
                break
            requested += max(4, requested // 3)
        if width > WIDE * centre:
            return self.lowest()
        discs = [first, *self._neighbours(first, requested)]
        if not self.quadratic.conservative:
            for side in (1.0,) if self.quadratic.stable else (1.0, -1.0):
                discs += self._arc(centre, width, side, first)
        return self._solved(rigid_motions(self.quadratic, self.count), discs)

    def _arc(self, centre: float, width: float, side: float, first: Disc) -> list[Disc]:
        """Discs that cover a quarter of a ring from the first one at the imaginary axis to the real axis, to the left
        for 1 and to the right for -1, and one for real eigenvalues within.
        """
        half = 0.5 * (centre + width)
        result = [disc(self.quadratic, -side * half).filled(WITHIN * half)]
        angle = _covered(centre, width, first.reach - ASIDE * centre)
        while angle < 0.5 * np.pi:
            sigma = centre * (1j * np.cos(angle) - side * np.sin(angle))
            next_disc = disc(self.quadratic, sigma).filled(max(CLEAR * centre * np.sin(angle), WIDER * width))
            result.append(next_disc)
            covered = _covered(centre, width, next_disc.reach)
            if not covered:
                break
            angle += covered
        return result

    def _neighbours(self, first: Disc, requested: int) -> list[Disc]:
        """The disc of left eigenvectors, unless these are the right ones or their conjugates."""
        if self.quadratic.symmetric or self.quadratic.conservative:
            return []
        return [first.left().grown(requested)]

    def _solved(self, rigid: Array, discs: list[Disc]) -> Solution | None:
        """Modes from the subspace of some discs; None if eigenvalues of the first disc are missing."""
        system, mass, massless = self.quadratic.system, rigid, rigid[:, :0]
        for member in discs:
            more_mass, more_massless = split_massless(system, parts(member.motions()))
            mass = extended(self.quadratic, mass, more_mass, abs(member.shifted.sigma))
            massless = independent(system, np.concatenate((massless, more_massless), axis=1))

        def distance(values: Complex) -> Array:
            return np.asarray(np.max([member.distance(values) for member in discs], axis=0))

        galerkin = Galerkin(self.quadratic, self.choose, distance, self.form)
        result = galerkin.converged(mass, massless, rigid.shape[1])
        known = discs[0].values[np.abs(discs[0].values) > SAME * discs[0].reach]
        difference = np.abs(known[:, None] - result.modes.eigenvalues).min(axis=1, initial=np.inf)
        if (difference > SAME * np.abs(known - discs[0].shifted.sigma)).any():
            return None
        return galerkin.narrowed(result)

    def _nearest(self, first: Disc, rigid: int, first_order: bool = False) -> float:
        """Upper bound of the distance of the last wanted mode: every conjugate pair and every rigid motion is a mode.

        With ``first_order`` states every real eigenvalue is a mode too, although some may form pairs.
        """
        values = first.values[first.values.imag > (-REAL if first_order else REAL) * np.abs(first.values)]
        speeds = np.abs(values[np.abs(values) > ZERO * first.reach])
        distance = np.sort(np.abs(np.append(speeds, np.zeros(rigid)) - self.centre))
        return float(distance[self.count - 1]) if len(distance) >= self.count else np.inf

    def _distance(self, solution: Solution) -> float:
        """Distance of the last selected mode."""
        return float(np.abs(solution.modes.natural[solution.selected] - self.centre).max())


def _covered(centre: float, width: float, reach: float) -> float:
    """Half the angle of a ring that a disc covers: |w e^(i a) - w0|^2 = (w - w0)^2 + 4 w w0 sin^2 (a / 2)."""
    square = max(0.0, reach**2 - width**2) / (4.0 * centre * (centre + width))
    return 2.0 * float(np.arcsin(np.sqrt(min(square, 1.0))))


def rigid_motions(quadratic: Quadratic, count: int) -> Array:
    """Return the motions that deform no spring (size, r), if only springs determine them."""
    if (quadratic.system.row_stiffness < 0.0).any():
        return np.zeros((quadratic.system.layout.size, 0))
    return operator(quadratic.system, None, max(count, COUPLED_RIGID)).rigid


def lowest_speed(quadratic: Quadratic) -> float:
    """Return the approximate magnitude of the smallest nonzero eigenvalue."""
    speed = quadratic.speed
    sigma = NOISE * speed
    while sigma < speed:  # increase the shift until a nonzero eigenvalue is among the nearest ones
        size = _nearest_to(quadratic, sigma)
        size = size[size > sigma]
        if len(size):
            return float(size.min())
        sigma *= ABOVE
    return speed


def highest_speed(quadratic: Quadratic, centre: float) -> float:
    """Return a frequency at which modes can be separated and whose nearest modes are those of the centre."""
    for _ in range(ROUNDS):
        size = _nearest_to(quadratic, 1j * centre)
        if size.max(initial=0.0) * BEYOND**2 > centre or not size.any():
            break
        centre = BEYOND * float(size.max())
    return centre


def _nearest_to(quadratic: Quadratic, sigma: complex) -> Array:
    """Approximate magnitudes of the eigenvalues nearest to a shift."""
    if isinstance(sigma, complex):
        sigma *= 1.0 - 1j * ASIDE
    rough = disc(quadratic, sigma).shifted.rough(STEPS)
    values = rough.values[rough.residuals < ROUGH]
    return np.asarray(np.abs(sigma + 1.0 / values[values != 0.0]))


def coordinates(system: SparseEquations) -> Array:
    """Return a basis of all motions (size, dof): unit joint coordinates, combined in loops; exact up to rounding."""
    layout, tree, m = system.layout, system.structure, len(system.joint_coordinates)
    free = np.eye(m)
    if len(layout.multiplier):
        row, column, value = system.constraints.independent_entries(tree)
        loops = np.zeros((len(layout.multiplier), m))
        np.add.at(loops, (row, column), value)
        free = free_motions(loops)
    return motions(tree, layout)(free)
