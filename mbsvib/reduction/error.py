"""The error of a reduced model: the largest singular value of the difference of two frequency responses."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.linalg.rank import DAMPED_FREE_MOTION, DECAYS, EPS
from mbsvib.modes.undamped import undamped
from mbsvib.reduction.projection import projected
from mbsvib.responses.basis import Basis
from mbsvib.responses.frequency_response import frequency_response
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
# The rounding of a reduced model is about, not exactly, largest at the poles' frequencies.
ROUNDING_MARGIN = 0.1
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
    if (poles.real >= -EPS * np.abs(poles)).any():
        return np.inf
    fastest = float(np.abs(poles).max(initial=0.0)) or 1.0

    def difference(omega: ArrayLike) -> Complex:
        of_full, of_small = (frequency_response(basis, omega) for basis in bases)
        return np.asarray(of_full - of_small)

    return (1.0 + MARGIN) * hinf(difference, poles, difference([FAR * fastest])[:, :, 0]).value


def rounding_error(space: StateSpace, small: tuple[Array, Array, Array]) -> float:
    """Return the largest error of a reduced state space at the poles' frequencies, where rounding of its entries shows.
    """
    poles = np.concatenate([np.linalg.eigvals(a) for a in (space.A, small[0])])
    decays = poles.real < -DECAYS * np.abs(poles)
    omega = np.unique(np.abs(poles[decays]))
    value = 0.0
    for s in 1j * omega:
        exact, rounded = (c @ np.linalg.solve(s * np.eye(len(a)) - a, b) for a, b, c in (
            (space.A, space.B, space.C), small))  # fmt: skip
        value = max(value, float(np.linalg.norm(exact - rounded, ord=2))) if exact.size else value
    return (1.0 + ROUNDING_MARGIN) * value


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
