"""First-order equations with massless motions: as many states as there are eigenvalues, and no input derivative.

With N the massless motions, each one at a coordinate of its own, q' = E w + N p: w are the rates that move mass, and p
follow at once from the dampers, (N^T C N) p = N^T (B u - K q - C E w). The states are q and w.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.equations.unresisted_motion import independent_coordinates
from mbsvib.linalg.qr import gram_solution
from mbsvib.responses.energy_schur import ModalStates
from mbsvib.responses.general_terms import cleaned

if TYPE_CHECKING:
    from mbsvib.equations.equations import Equations


# Maximum number of coordinates in the name of a rate that is a sum.
SPELLED = 3
RATE_UNITS = {"m": "m/s", "rad": "rad/s", "modal": "modal/s"}


@dataclass(frozen=True, slots=True)
class FirstOrder:
    """x' = A x + B u,  (q, q') = T x + U u: ``a`` (n, n), ``b`` (n, inputs), ``transform`` T (2m, n) and ``through`` U
    (2m, inputs), with names and units of the states. ``mass_rates`` (m - massless, n) are the rates w that move mass;
    None stands for all rates. ``modal`` are modal states in energy coordinates, None of physical states.
    """

    a: Array
    b: Array
    transform: Array
    through: Array
    names: tuple[str, ...]
    units: tuple[str, ...]
    mass_rates: Array | None = None
    modal: ModalStates | None = None

    def accelerations(self, system: Equations) -> tuple[Array, Array]:
        """Return factors of the accelerations that outputs see, Ca q'' = L R x': L (outputs, m) and R (m, n).

        Ca q'' = (Ca E) w' + (Ca N) p', in which Ca N is 0 where it is rounding: p' is large where a damper is weak.
        """
        rate = self.transform[system.dof :]
        if self.mass_rates is None or system.null_inertia is None:
            return system.Ca, rate
        independent, dependent = independent_coordinates(system.null_inertia)
        return (np.concatenate((system.Ca[:, dependent], cleaned(system.Ca, system.null_inertia)), axis=1),
                np.concatenate((self.mass_rates, rate[independent])))  # fmt: skip


def physical(system: Equations) -> FirstOrder:
    """Return first-order equations of a system with massless motions in physical states.

    The 2m - massless states are the coordinates, then the rates that move mass.
    """
    null = system.null_inertia
    assert null is not None
    m, inputs = system.dof, system.B.shape[1]
    _, dependent = independent_coordinates(null)
    n = m + len(dependent)
    # p = slow x + push u
    braked = null.T @ system.C
    right = np.concatenate((-null.T @ system.K, -braked[:, dependent], null.T @ system.B), axis=1)
    at_once = np.linalg.solve(braked @ null, right)
    transform = np.zeros((2 * m, n))
    transform[:m, :m] = np.eye(m)
    transform[m + dependent, np.arange(m, n)] = 1.0
    transform[m:] += null @ at_once[:, :n]
    through = np.zeros((2 * m, inputs))
    through[m:] = null @ at_once[:, n:]
    a, b = np.empty((n, n)), np.empty((n, inputs))
    a[:m], b[:m] = transform[m:], through[m:]
    if len(dependent):
        forces = np.concatenate(
            (-system.K[dependent] @ transform[:m] - system.C[dependent] @ transform[m:],
             system.B[dependent] - system.C[dependent] @ through[m:]), axis=1,
        )  # fmt: skip
        solution = gram_solution(system.inertia_factor[:, dependent], forces)
        a[m:], b[m:] = solution[:, :n], solution[:, n:]
    rates = [rate_name(system.coordinates, null, i) for i in dependent.tolist()]
    units = tuple(RATE_UNITS[system.coordinate_units[i]] for i in dependent.tolist())
    mass_rates = np.eye(len(dependent), n, m)
    return FirstOrder(a, b, transform, through, (*system.coordinates, *rates), (*system.coordinate_units, *units),
                      mass_rates)  # fmt: skip


def rate_name(coordinates: tuple[str, ...], null: Array, dependent: int) -> str:
    """Return the name of a rate that moves mass: that of one coordinate, minus those of massless motions."""
    independent, _ = independent_coordinates(null)
    text = coordinates[dependent]
    shares = [(-float(null[dependent, k]), coordinates[independent[k]])
              for k in np.flatnonzero(null[dependent]).tolist()]  # fmt: skip
    for factor, name in shares[: SPELLED - 1]:
        size = "" if abs(factor) == 1.0 else f"{abs(factor):.6g} "
        text += f" {'-' if factor < 0.0 else '+'} {size}{name}"
    return f"d({text}{' + ...' if len(shares) >= SPELLED else ''})/dt"
