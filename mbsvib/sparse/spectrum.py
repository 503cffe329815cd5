"""Some modes of equations without symmetry: which eigenvalues are nearest, and the subspace that has their vectors.

The lowest modes have an eigenvalue each in a disc around 0, as far out as the highest natural frequency among them.
Those nearest to a frequency have theirs in a ring, or, where they creep, one on the real axis within it: discs are laid
side by side along the ring from the imaginary axis, where lightly damped modes are, until the ring is covered.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.equations.unresisted_motion import free_motions
from mbsvib.errors import ResponseError
from mbsvib.modes import modes as dense_modes
from mbsvib.sparse.converged import Galerkin, eigenvectors, error_bound, joined, parts
from mbsvib.sparse.disc import disc
from mbsvib.sparse.first_order import following, heaviest, independent, told_apart
from mbsvib.sparse.layout import kinematics
from mbsvib.sparse.operator import BRAKED, operator
from mbsvib.sparse.quadratic import Quadratic
from mbsvib.sparse.reduction import RTOL, reduced

if TYPE_CHECKING:
    from collections.abc import Callable

    from mbsvib.common.arrays import Array, Complex, Index
    from mbsvib.equations.equations import Equations
    from mbsvib.modes import Modes
    from mbsvib.sparse.converged import Solution
    from mbsvib.sparse.disc import Disc
    from mbsvib.sparse.equations import SparseEquations

# Modes beyond those asked for.
GUARDS = 2
# Systems of so few degrees of freedom, or of not many times the modes asked for, are taken whole.
WHOLE, EACH = 40, 6
# Where the search fails, they are so up to this size.
LARGEST = 1500
# The shift for the lowest modes, as a share of the lowest frequency that is not 0.
SHIFT = 0.1
# Eigenvalues wanted are no more than this above that shift, roughly.
FAST = 100.0
# Steps that tell the nearest eigenvalues roughly, and by how much more the shift is tried beyond those that are 0.
STEPS, ABOVE = 24, 10.0
# A frequency further than this above all eigenvalues comes down to the last of them.
BEYOND = 1.2
# Shifts near the imaginary axis are off it by this share, to the side of growing motions, where few eigenvalues are.
ASIDE = 1e-5
# The first disc is this much larger than a ring is wide; those beside it are this share of the distance from the
# imaginary axis, or this much larger than the ring is wide.
FIRST, CLEAR, WIDER = 1.5, 0.7, 1.2
# A ring wider than this share of its radius is searched as a disc around 0.
WIDE = 0.5
# Share of a disc on the real axis within a ring that is searched: lightly damped modes are at its rim.
WITHIN = 0.9
# Pairs of eigenvalues 0 come out no larger than this beside a typical one of springs and bodies.
NOISE = 1e-6
# Eigenvalues this small beside the reach of a disc may be 0.
ZERO = 1e-5
# Eigenvalues with a smaller share of imaginary part may be real.
REAL = 1e-6
# Eigenvalues of a disc and of its subspace are the same up to this share of their distance from the shift.
SAME = 1e-5
# Residual of eigenvalues that are known roughly, and rounds of finding where they are.
ROUGH, ROUNDS = 1e-2, 40
# Eigenvalues equally near are taken with each other up to this share of their distance.
TIES = 1e-9


def general_modes(
    system: SparseEquations, k: int, near: float, form: type[Equations]
) -> tuple[Equations, Modes, Array, Index]:
    """Return the modes whose natural frequencies are nearest to a frequency, of equations without symmetry.

    Parameters
    ----------
    system : SparseEquations
        The equations of motion.
    k : int
        Number of modes.
    near : float
        Frequency [Hz], 0 for the lowest.
    form : type
        The class of the small dense equations.

    Returns
    -------
    tuple
        The small system, its modes, a bound of the relative error of each eigenvalue by what the subspace lacks, and
        which modes to take.
    """
    quadratic, centre = Quadratic(system), 2.0 * np.pi * near

    def choose(result: Modes) -> Index:
        speed = np.abs(result.pairs).max(axis=1)  # tells rigid-body modes apart
        return np.sort(np.lexsort((speed, np.abs(result.natural - centre)))[:k])

    if system.dof > max(WHOLE, EACH * (k + GUARDS)):
        search = Search(quadratic, k, centre, choose, form)
        result = search.ring() if near else search.lowest()
        if result is not None:
            return result.small, result.modes, result.bound, result.chosen
        if system.dof > LARGEST:
            raise ResponseError(
                f"modes: {k} modes of '{system.name}' near {near:g} Hz are not told apart from others nearby; ask for "
                f"fewer, or near another frequency, or linearize(method='dense')."
            )
    mass, light = told_apart(system, following(system, coordinates(system)))
    if light.shape[1]:
        mass = heaviest(system, mass)
    small = reduced(system, np.concatenate((mass, light), axis=1), 0, form, light.shape[1])
    every: Modes = dense_modes(small, RTOL)
    vectors = eigenvectors(every, np.arange(len(every)))
    return small, every, error_bound(system, small, every, vectors, np.zeros(len(vectors.values))), choose(every)


@dataclass(frozen=True)
class Search:
    """The search for ``count`` modes around an angular frequency ``centre``; ``choose`` numbers those of a small system
    of a class ``form``.
    """

    quadratic: Quadratic
    count: int
    centre: float
    choose: Callable[[Modes], Index]
    form: type[Equations]

    def lowest(self) -> Solution | None:
        """Return modes out of a disc around 0; None where it would have to hold all of them."""
        sigma = SHIFT * lowest_speed(self.quadratic)
        first = disc(self.quadratic, sigma, FAST * sigma)
        rigid = rigid_motions(self.quadratic, self.count)
        wanted = 2 * (self.count + GUARDS)
        while wanted < self.quadratic.system.dof:
            first = first.grown(wanted)
            if len(first.values) < self.count:
                return None
            slow = bool(self.quadratic.system.massless)
            if first.reach >= (1.0 + TIES) * (self.centre + self._nearest(first, rigid.shape[1], slow) + sigma):
                answer = self._solved(rigid, [first, *self._left(first, wanted)])
                if answer is None:
                    return None
                if first.reach >= (1.0 + TIES) * (self.centre + self._distance(answer) + sigma):
                    return answer
            wanted += max(4, wanted // 3)
        return None

    def ring(self) -> Solution | None:
        """Return modes out of a ring; None where it would have to hold all of them."""
        centre = min(self.centre, highest_speed(self.quadratic, self.centre))
        sigma, wanted = centre * (1j + ASIDE), self.count + GUARDS
        first = disc(self.quadratic, sigma)
        while True:
            first = first.grown(wanted)
            if wanted > self.quadratic.system.dof or len(first.values) < self.count:
                return None
            width = self._nearest(first, 0) - (self.centre - centre)
            least = width if self.quadratic.conservative else FIRST * width
            if first.reach >= (1.0 + TIES) * least + ASIDE * centre:
                break
            wanted += max(4, wanted // 3)
        if width > WIDE * centre:
            return self.lowest()
        discs = [first, *self._left(first, wanted)]
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
            each = disc(self.quadratic, sigma).filled(max(CLEAR * centre * np.sin(angle), WIDER * width))
            result.append(each)
            covered = _covered(centre, width, each.reach)
            if not covered:
                break
            angle += covered
        return result

    def _left(self, first: Disc, wanted: int) -> list[Disc]:
        """The disc of left eigenvectors, where these are not the right ones or their conjugates."""
        if self.quadratic.symmetric or self.quadratic.conservative:
            return []
        return [first.left().grown(wanted)]

    def _solved(self, rigid: Array, discs: list[Disc]) -> Solution | None:
        """Modes out of the subspace of some discs; None if it lacks eigenvalues that are in the first one."""
        system, basis, light = self.quadratic.system, rigid, rigid[:, :0]
        for each in discs:
            mass, massless = told_apart(system, parts(each.motions()))
            basis = joined(self.quadratic, basis, mass, abs(each.shifted.sigma))
            light = independent(system, np.concatenate((light, massless), axis=1))

        def apart(values: Complex) -> Array:
            return np.asarray(np.max([each.apart(values) for each in discs], axis=0))

        galerkin = Galerkin(self.quadratic, self.choose, apart, self.form)
        result = galerkin.converged(basis, light, rigid.shape[1])
        known = discs[0].values[np.abs(discs[0].values) > SAME * discs[0].reach]
        off = np.abs(known[:, None] - result.modes.eigenvalues).min(axis=1, initial=np.inf)
        if (off > SAME * np.abs(known - discs[0].shifted.sigma)).any():
            return None
        return galerkin.narrowed(result)

    def _nearest(self, first: Disc, rigid: int, slow: bool = False) -> float:
        """Distance of the last mode wanted, or more: every conjugate pair is a mode of its own, and a rigid motion; and
        if ``slow`` every real eigenvalue, of which some may be pairs.
        """
        values = first.values[first.values.imag > (-REAL if slow else REAL) * np.abs(first.values)]
        turns = np.abs(values[np.abs(values) > ZERO * first.reach])
        distance = np.sort(np.abs(np.append(turns, np.zeros(rigid)) - self.centre))
        return float(distance[self.count - 1]) if len(distance) >= self.count else np.inf

    def _distance(self, answer: Solution) -> float:
        """Distance of the last mode chosen."""
        return float(np.abs(answer.modes.natural[answer.chosen] - self.centre).max())


def _covered(centre: float, width: float, reach: float) -> float:
    """Half the angle in which a disc covers a ring: |w e^(i a) - w0|^2 = (w - w0)^2 + 4 w w0 sin^2 (a / 2)."""
    share = max(0.0, reach**2 - width**2) / (4.0 * centre * (centre + width))
    return 2.0 * float(np.arcsin(np.sqrt(min(share, 1.0))))


def rigid_motions(quadratic: Quadratic, count: int) -> Array:
    """Return the motions that meet no spring (size, r), where springs alone decide which these are."""
    if (quadratic.system.stiffness < 0.0).any():
        return np.zeros((quadratic.system.layout.size, 0))
    return operator(quadratic.system, None, max(count, BRAKED)).rigid


def lowest_speed(quadratic: Quadratic) -> float:
    """Return the size of the smallest eigenvalue that is not 0, up to a factor."""
    system = quadratic.system
    square = float(np.abs(system.stiffness) @ np.asarray(system.elastic_rows.power(2).sum(axis=1))[:, 0])
    speed = np.sqrt(square / (float(system.inertia_factor.power(2).sum()) or 1.0)) or 1.0
    sigma = NOISE * float(speed)
    while sigma < speed:  # from below the nearest eigenvalue stands apart, once those that are 0 are not all there is
        size = _nearest_to(quadratic, sigma)
        size = size[size > sigma]
        if len(size):
            return float(size.min())
        sigma *= ABOVE
    return float(speed)


def highest_speed(quadratic: Quadratic, centre: float) -> float:
    """Return a frequency at which modes are told apart, from which those are nearest that are nearest to the centre."""
    for _ in range(ROUNDS):
        size = _nearest_to(quadratic, 1j * centre)
        if size.max(initial=0.0) * BEYOND**2 > centre or not size.any():
            break
        centre = BEYOND * float(size.max())
    return centre


def _nearest_to(quadratic: Quadratic, sigma: complex) -> Array:
    """Sizes of the eigenvalues nearest to a shift, roughly."""
    if isinstance(sigma, complex):
        sigma *= 1.0 - 1j * ASIDE
    rough = disc(quadratic, sigma).shifted.rough(STEPS)
    values = rough.values[rough.residuals < ROUGH]
    return np.asarray(np.abs(sigma + 1.0 / values[values != 0.0]))


def coordinates(system: SparseEquations) -> Array:
    """Return motions that span all of a system's: one of its joint coordinates each, where loops leave them.

    Parameters
    ----------
    system : SparseEquations
        The equations of motion.

    Returns
    -------
    array, shape (size, dof)
        Displacements and joint coordinates; exact up to the rounding of the geometry.
    """
    from scipy.sparse.linalg import splu

    place, tree, m = system.layout, system.structure, len(system.joint_coordinates)
    free = np.eye(m)
    if len(place.multiplier):
        row, column, value = system.constraints.kept_entries(tree)
        loops = np.zeros((len(place.multiplier), m))
        np.add.at(loops, (row, column), value)
        free = free_motions(loops)
    result = np.zeros((place.size, free.shape[1]))
    result[place.coordinate] = free
    at = place.displacement[tree.moves]
    demands = kinematics(tree, place)[at].tocsc()
    result[at] = splu(demands[:, at], permc_spec="NATURAL").solve(-(demands[:, place.coordinate] @ free))
    return result
