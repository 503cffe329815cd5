"""First-order equations in the undamped modes, and their derivatives.

The modes stay what they are at the pose: they are a basis like any other, also of systems with spin or follower loads,
whose equations they do not separate. States are (s eta, eta') with s = omega, so that both have the unit of a velocity
and A is as well scaled as the mechanism allows.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import eigh

from mbsvib.errors import ModelError
from mbsvib.modes.damped import Damped
from mbsvib.parts import Body
from mbsvib.sensitivities.limits import limits

if TYPE_CHECKING:
    from mbsvib.kinematics import Array
    from mbsvib.sensitivities.matrices import MatrixDerivatives
    from mbsvib.system import System

# A rigid-body mode has the scale of the slowest mode beside it, but not below this share of the fastest.
SLOWEST = 1e-3
# A sum below this share of its terms is their rounding.
CANCELLED = 1e-12


@dataclass(frozen=True, slots=True)
class States:
    """x' = A x + B u, y = C x + D u with the basis ``shapes`` (m, m), ``scale`` (m,), ``square`` (m, m) and
    ``gamma`` (m, m) for K and C, ``rates`` of the outputs and ``force`` of the inputs in the basis.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    shapes: Array
    scale: Array
    square: Array
    gamma: Array
    rates: tuple[Array, Array, Array]
    force: Array


def states(system: System, inputs: list[int], outputs: list[int]) -> States:
    """Return the first-order equations of some inputs and outputs.

    Parameters
    ----------
    system : System
        The equations of motion.
    inputs, outputs : list of int
        Numbers of the ports.

    Returns
    -------
    States
        Equations in the undamped modes.

    Raises
    ------
    ModelError
        If the system has motions without mass.
    """
    shapes, square, gamma = _basis(system)
    omega = np.sqrt(np.abs(np.diagonal(square)))
    fastest = omega.max(initial=0.0) or 1.0
    scale = np.maximum(omega, SLOWEST * fastest) if (omega < SLOWEST * fastest).any() else omega
    m = len(square)
    a = np.zeros((2 * m, 2 * m))
    a[np.arange(m), m + np.arange(m)] = scale
    a[m:, :m], a[m:, m:] = -square / scale, -gamma
    force = shapes.T @ system.B[:, inputs]
    rates = (system.Cq[outputs] @ shapes, system.Cv[outputs] @ shapes, system.Ca[outputs] @ shapes)
    b = np.concatenate((np.zeros_like(force), force))
    c = np.concatenate((rates[0] / scale, rates[1]), axis=1) + rates[2] @ a[m:]
    d = _sum(system.D[np.ix_(outputs, inputs)], (rates[2], force))
    return States(a, b, c, d, shapes, scale, square, gamma, rates, force)


def _basis(system: System) -> tuple[Array, Array, Array]:
    """Shapes with unit mass, and K and C in them; as diagonal as can be."""
    modal = system._modal
    if isinstance(modal, Damped):
        return modal.shapes, np.diag(modal.square), np.diag(modal.gamma) if modal.gamma.ndim == 1 else modal.gamma
    if system.massless:
        raise refuse_general(system)
    _, shapes = eigh(0.5 * (system.K + system.K.T), system.M)
    return shapes, shapes.T @ system.K @ shapes, shapes.T @ system.C @ shapes


def refuse_general(system: System) -> ModelError:
    """Return the refusal of a system with motions without mass, or with spin, which names what does it.

    Parameters
    ----------
    system : System
        The equations of motion.

    Returns
    -------
    ModelError
        To be raised.
    """
    light = [part.name for part in system.provenance.parts if isinstance(part, Body) and part.mass == 0.0]
    who = light[0] if light else limits(system)[0].who if limits(system) else system.name
    return ModelError(
        f"sensitivities: '{who}' makes motions without mass or matrices without symmetry, for which there are none of "
        f"shapes, and without mass none of responses in time and H2 norms. Compare variants by model.with_values.",
        element=who,
    )  # fmt: skip


def changed(base: States, change: MatrixDerivatives, inputs: list[int], outputs: list[int]) -> tuple[Array, ...]:
    """Return the derivatives of the first-order equations.

    Parameters
    ----------
    base : States
        The equations.
    change : MatrixDerivatives
        Derivatives of the matrices to v variables.
    inputs, outputs : list of int
        Numbers of the ports.

    Returns
    -------
    tuple of array
        Rows of A that change (v, m, 2m), those of B (v, m, inputs), C (v, outputs, 2m) and D (v, outputs, inputs).
    """
    shapes, m = base.shapes, len(base.scale)
    mass, damping, stiffness = (shapes.T @ each @ shapes for each in (change.M, change.C, change.K))
    a = np.concatenate(((mass @ base.square - stiffness) / base.scale, mass @ base.gamma - damping), axis=2)
    b = shapes.T @ change.B[:, :, inputs] - mass @ base.force
    cq, cv, ca = (each[:, outputs] @ shapes for each in (change.Cq, change.Cv, change.Ca))
    c = np.concatenate((cq / base.scale, cv), axis=2) + ca @ base.A[m:] + base.rates[2] @ a
    d = _sum(change.D[:, outputs][:, :, inputs], (ca, base.force), (base.rates[2], b))
    return a, b, c, d


def _sum(start: Array, *products: tuple[Array, Array]) -> Array:
    """Sum of a matrix and of products, 0 where they cancel but for rounding: accelerations see the base at once, and
    what the mechanism takes back.
    """
    total, size = start, np.abs(start)
    for a, b in products:
        total, size = total + a @ b, size + np.abs(a) @ np.abs(b)
    return np.where(np.abs(total) <= CANCELLED * size, 0.0, total)
