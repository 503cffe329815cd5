"""Some modes of many bodies: shift-invert Lanczos, and frequencies from the factors.

The subspace comes from Lanczos on T = W (K - sigma M)^-1 W^T and one more solve; the frequencies come from the small
dense system that it makes, M = |W x|^2 and K = |sqrt(k) D q|^2, through the same ladder as those of small mechanisms.
Since springs act on relative coordinates q that the solve yields with all their digits, nothing is lost where the
frequencies are many orders below those of a single body on its spring.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from mbsvib.equations.equations import Equations
from mbsvib.errors import ResponseError
from mbsvib.modes import Modes
from mbsvib.modes import modes as dense_modes
from mbsvib.modes.undamped import undamped
from mbsvib.sparse.damping import coupled, decoupled
from mbsvib.sparse.reduction import RTOL, reduced, rounding
from mbsvib.sparse.spectrum import general_modes
from mbsvib.sparse.subspace import subspace

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Index
    from mbsvib.sparse.equations import SparseEquations
    from mbsvib.sparse.subspace import Subspace

# Modes whose eigenvalues are off by more are not found from the undamped ones: others are near, or they are too many.
CONVERGED = 1e-6
# Modes are counted up to this many times the last natural frequency.
BEYOND = 1.0 + 1e-6


@dataclass(frozen=True, repr=False, eq=False)
class SomeModes(Modes):
    """Some modes of a large system, in ascending natural frequency: ``Modes`` with the system that they make.

    ``shapes`` are in the coordinates of ``reduced`` (mode1, mode2, ...), ``body_shapes`` those of the bodies.
    ``missed`` is the number of modes that the count of eigenvalues says are below the highest one and not among these
    (0; None where they cannot be counted: rows were exchanged, or the equations have no symmetry).
    """

    reduced: Equations = field(repr=False, kw_only=True)
    dof: int = field(kw_only=True)
    missed: int | None = field(kw_only=True)

    def _shown(self) -> str:
        return f"{len(self)} of {self.dof} DOF"

M = TypeVar("M", bound=SomeModes)


def modes(
    system: SparseEquations, k: int, near: float = 0.0, dense: type[Equations] = Equations,
    form: type[M] = SomeModes,  # type: ignore[assignment]
) -> M:  # fmt: skip
    """Return the k lowest modes, or the k nearest to a frequency.

    Parameters
    ----------
    system : SparseEquations
        The equations of motion.
    k : int
        Number of modes.
    near : float
        Frequency [Hz], 0 for the lowest.
    dense : type
        The class of the small dense equations.
    form : type
        The class of the modes.

    Returns
    -------
    SomeModes
        Modes in ascending natural frequency.

    Raises
    ------
    ResponseError
        If k or the frequency are not such numbers.
    """
    _check(system, k, near)
    missed = None
    if system.circulatory is not None or system.gyroscopic is not None or system.massless:
        small, result, left, chosen = general_modes(system, k, near, dense)
        errors = result.errors + left
    else:
        small, result, errors, chosen, missed = _symmetric(system, k, near, dense)
    errors = np.minimum(errors, 1.0)
    pairs = np.concatenate([np.arange(*result.starts[i : i + 2]) for i in chosen])
    return form(
        result.name, result.coordinates, result.bodies, result.eigenvalues[pairs], errors[pairs],
        result.shapes[:, chosen], result.classical, int(np.count_nonzero(chosen < result.rigid)),
        result.body_motion, result.inertia_factor, result.damped,
        None if result.first_order is None else result.first_order[chosen], reduced=small, dof=system.dof,
        missed=missed,
    )  # fmt: skip


def _symmetric(
    system: SparseEquations, k: int, near: float, dense: type[Equations]
) -> tuple[Equations, Modes, Array, Index, int | None]:
    """The small system, its modes with errors, which of them to take, and how many were missed."""
    found = subspace(system, k, near)
    basis, bound, rigid = _nearest(system, found, k)
    wanted = k
    while basis is None:
        wanted += max(4, k // 2)
        found = subspace(system, min(wanted, system.dof), near)
        basis, bound, rigid = _nearest(system, found, k)
    small = reduced(system, basis, rigid, dense)
    result: Modes = dense_modes(small, RTOL)
    if decoupled(found, result, basis):
        errors = result.errors + np.repeat(bound, 2) * (result.eigenvalues != 0.0)
        return small, result, errors, np.arange(k), found.missed
    small, result, left, chosen = coupled(found, k, near, dense)
    missed = found.missed
    certain = result.rigid == found.rigid and float(left.max(initial=0.0)) < CONVERGED
    unknown = _unknown_overdamped(system, result, chosen) if certain else 1
    if unknown:  # strong dampers make slow modes of what is fast without them
        small, result, left, chosen = general_modes(system, k, near, dense)
    if unknown is None or unknown:
        missed = None
    errors = result.errors + left + rounding(system) * (result.eigenvalues != 0.0)
    return small, result, errors, chosen, missed


def _unknown_overdamped(system: SparseEquations, result: Modes, chosen: Index) -> int | None:
    """How many pairs of real eigenvalues there are on both sides of -s, beyond those of a small system.

    s is beyond all chosen modes. Of the pair (a, b) of a mode, one on either side makes one eigenvalue of P(-s), which
    is symmetric, negative; their number is that of the negative pivots. None where it cannot be counted.
    """
    size = np.abs(result.pairs[chosen])
    s = BEYOND * float(np.sqrt(size.prod(axis=1)).max(initial=0.0) or size.max(initial=0.0))
    if not s:
        return 0
    try:
        negative = system.tableau.factor(s=-s, pivot=0.0).negative(system.layout)
    except np.linalg.LinAlgError:
        return None
    real = result.pairs[(result.pairs.imag == 0.0).all(axis=1)].real
    known = int(np.count_nonzero((real + s).prod(axis=1) < 0.0))
    return None if negative is None else abs(negative - known)


def _check(system: SparseEquations, k: int, near: float) -> None:
    if not system.dof:
        raise ResponseError(f"modes: '{system.name}' is fully locked: it has no modes. Its responses are constant: ask "
                            f"linearize(method='dense') for them, or frequency_response.")  # fmt: skip
    if isinstance(k, bool) or not hasattr(k, "__index__") or not 1 <= k <= system.dof:
        raise ResponseError(
            f"modes: count = {k!r}; expected a whole number from 1 to {system.dof}, the degrees of freedom of "
            f"'{system.name}'."
        )
    if not (isinstance(near, (int, float)) and 0.0 <= near < np.inf):
        raise ResponseError(f"modes: near = {near!r}; expected a frequency [Hz], or 0 for the lowest modes.")


def _nearest(system: SparseEquations, found: Subspace, k: int) -> tuple[Array | None, Array, int]:
    """The k modes nearest to the shift out of the subspace, M-orthonormal, what is unsure of their frequencies, and how
    many of them are rigid-body modes.

    None if the subspace is too small to tell which are nearest.
    """
    sigma = found.operator.sigma
    small = reduced(system, found.z, found.rigid)
    try:
        ritz = undamped(small, RTOL)
    except np.linalg.LinAlgError:
        raise ResponseError(
            f"modes: the search for the lowest modes of '{system.name}' found motions that depend on each other, "
            f"beside motions that hardly any stiffness holds; take linearize(method='dense')."
        ) from None  # fmt: skip
    if sigma > 0.0:
        centre = found.centre
        distance = np.abs(np.sqrt(np.abs(ritz.square)) - centre)
        last = float(np.sort(distance)[k - 1])
        needed = max((centre + last) ** 2 - sigma, sigma - max(0.0, centre - last) ** 2)
        if needed <= found.reach and found.operator.diverging() > int(np.count_nonzero(ritz.square < 0.0)):
            needed = sigma + (centre + last) ** 2
        if needed > found.reach:
            return None, np.zeros(0), 0  # one that was not found may be nearer: all are known by their squares only
    else:
        distance = np.abs(ritz.square)
        distance[: found.rigid] = -1.0
    chosen = np.sort(np.argsort(distance, kind="stable")[:k])
    y = ritz.shapes[:, chosen]
    basis = found.z @ y
    residual = np.sqrt(np.abs(y.T) ** 2 @ found.residual**2)
    noise = np.abs(y.T) ** 2 @ found.noise
    square = np.abs(ritz.square[chosen])
    apart = np.abs(ritz.square[chosen] - sigma)
    gap = np.maximum(found.reach - apart, 0.0)
    flexible = square > 0.0
    first = residual * apart / np.where(flexible, square, 1.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        second = np.where(gap > 0.0, residual**2 * apart**2 / (gap * np.where(flexible, square, 1.0)), np.inf)
    bound = np.where(flexible, 0.5 * (np.minimum(first, second) + noise) + rounding(system), 0.0)
    return basis, bound, int(np.count_nonzero(chosen < found.rigid))

