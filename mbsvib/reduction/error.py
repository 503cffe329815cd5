"""The error of a reduced model: the largest singular value of the difference of two frequency responses."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import schur

from mbsvib.linalg.balancing import exponents, scaled_by
from mbsvib.linalg.rank import DAMPED_FREE_MOTION, EPS
from mbsvib.linalg.spectrum import spectrum
from mbsvib.modes.undamped import undamped
from mbsvib.reduction.projection import projected
from mbsvib.responses.basis import Basis
from mbsvib.responses.energy_schur import triangular_solutions
from mbsvib.responses.frequency_response import frequency_response
from mbsvib.responses.lasting_modes import last
from mbsvib.responses.norms import hinf

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from mbsvib.common.arrays import Array, Complex
    from mbsvib.equations.equations import Equations
    from mbsvib.responses.state_space import StateSpace

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
