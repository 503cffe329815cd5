"""Controllers by synthesis: linear quadratic Gaussian, and H-infinity where ctrlsys (SLICOT) is installed."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mbsvib.errors import ResponseError
from mbsvib.feedback.controller import Controller
from mbsvib.isolation.slicot import hinf_synthesis, need_ctrlsys
from mbsvib.isolation.study_scene import ACCELERATIONS
from mbsvib.linalg.balancing import scaled

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.isolation.plant import Plant

UNDAMPED = 1e-12  # share of the largest pole below which a real part is rounding


def lqg(
    plant: Plant, sensors: Sequence[str], effort: float, base: float = 1.0, noise: float = 1e-6,
    performance: Sequence[str] = ACCELERATIONS,
) -> Controller:  # fmt: skip
    """Return the controller that keeps the mean square of the body's acceleration plus that of forces least.

    minimise E[z^T z + effort u^T u] under white acceleration of the base in all directions and white noise of sensors

    Parameters
    ----------
    plant : Plant
        The mechanism.
    sensors : sequence of str
        What is measured: outputs of the plant.
    effort : float
        Weight of actuator forces [performance^2/N^2], positive: the smaller, the harder the actuators work.
    base : float
        Density of the base's acceleration [(m/s^2)^2/Hz], of rotations at the characteristic length.
    noise : float
        Density of the sensors' noise in their units, positive.
    performance : sequence of str
        Outputs z to keep small; default: the body's accelerations, rotations times the characteristic length.

    Returns
    -------
    Controller
        The controller, of as many states as the mechanism.

    Raises
    ------
    ResponseError
        If a weight is not positive, a name unknown, or no stabilising controller exists.
    """
    _check_positive("lqg", effort=effort, base=base, noise=noise)
    a, b, bw, c, d, dw, z, zd, _, rate = _weighted(plant, sensors, performance)
    m, n = b.shape[1], len(c)
    back = riccati(a, b, z.T @ z, zd.T @ zd + effort * np.eye(m), z.T @ zd)[1]
    inject = riccati(a.T, c.T, base * bw @ bw.T, base * dw @ dw.T + noise * np.eye(n), base * bw @ dw.T)[1].T
    law = a - b @ back - inject @ c + inject @ d @ back
    return Controller("LQG", law * rate, inject * rate, -back, np.zeros((m, n)), tuple(sensors),
                      plant.names("actuator")).for_plant(plant.system)  # fmt: skip


def hinf(
    plant: Plant, sensors: Sequence[str], effort: float, noise: float = 1e-3,
    performance: Sequence[str] = ACCELERATIONS, relaxation: float = 1.0,
) -> tuple[Controller, float]:  # fmt: skip
    """Return the controller that keeps the largest response to base and sensor noise least.

    minimise the H-infinity norm from (base acceleration, noise n) to (z, effort u)

    Parameters
    ----------
    plant : Plant
        The mechanism.
    sensors : sequence of str
        What is measured: outputs of the plant.
    effort : float
        Weight of actuator forces [performance/N], positive.
    noise : float
        Amplitude of the sensors' noise in their units, positive.
    performance : sequence of str
        Outputs z to keep small.
    relaxation : float
        Norm that is allowed, in parts of the smallest, from 1 on: a controller of 1.2 times the smallest norm has
        slower poles and often much wider stability margins.

    Returns
    -------
    controller, norm : Controller, float
        The controller and the norm that it reaches, within 1 % of the smallest but for ``relaxation``.

    Raises
    ------
    ExportError
        If ctrlsys is not installed.
    ResponseError
        If a weight is not positive, or no controller is found.

    Source: Glover & Doyle, State-space formulae for all stabilizing controllers that satisfy an H-infinity norm bound,
    Systems & Control Letters 11 (1988); SLICOT's SB10FD.
    """
    need_ctrlsys("hinf", ", or use lqg, which does without")
    _check_positive("hinf", effort=effort, noise=noise)
    if not 1.0 <= relaxation < np.inf:
        raise ResponseError(f"hinf: relaxation = {relaxation!r}; expected a number from 1 on.")
    a, b, bw, c, d, dw, z, zd, zw, rate = _weighted(plant, sensors, performance)
    m, n, k = b.shape[1], len(c), bw.shape[1]
    generalized_plant = (
        a, np.hstack((bw, np.zeros((len(a), n)), b)), np.vstack((z, np.zeros((m, len(a))), c)),
        np.block([[zw, np.zeros((len(z), n)), zd], [np.zeros((m, k + n)), effort * np.eye(m)],
                  [dw, noise * np.eye(n), d]]),
    )  # fmt: skip
    synthesis = hinf_synthesis(generalized_plant, n, m, "hinf", relaxation)
    law = Controller("Hinf", synthesis.A * rate, synthesis.B * rate, synthesis.C, synthesis.D, tuple(sensors),
                     plant.names("actuator")).for_plant(plant.system)  # fmt: skip
    return law, float(synthesis.norm or 0.0)


def _check_positive(who: str, **weights: float) -> None:
    for name, value in weights.items():
        if not 0.0 < value < np.inf:
            raise ResponseError(f"{who}: {name} = {value!r}; expected a positive number.")


def riccati(a: Array, b: Array, state: Array, effort: Array, cross: Array) -> tuple[Array, Array]:
    """Return Riccati's stabilising solution X for the weights Q, R and S, and the gain R^-1 (B^T X + S^T).

    X = U2 U1^-1 from the decaying invariant subspace (U1, U2) of the Hamiltonian matrix. Its complex Schur form is
    ordered whatever eigenvalues coincide, as those of a symmetric platform do; the real one of
    ``scipy.linalg.solve_continuous_are`` is not.

    Source: A. J. Laub, A Schur method for solving algebraic Riccati equations, IEEE Trans. Automatic Control 24 (1979).
    """
    from scipy.linalg import schur

    none = ResponseError("lqg: no stabilising controller was found; a mode may be out of reach of the actuators or "
                         "sensors, or effort and noise are too small against the rest.")  # fmt: skip
    n = len(a)
    drive, direct = np.linalg.solve(effort, b.T), np.linalg.solve(effort, cross.T)
    free, push, weight = a - b @ direct, b @ drive, state - cross @ direct
    sizes = float(np.linalg.norm(weight)), float(np.linalg.norm(push))
    size = np.sqrt(sizes[0] / sizes[1]) if all(sizes) else 1.0
    try:
        _, basis, count = schur(np.block([[free, -size * push], [-weight / size, -free.T]]), "complex", sort="lhp")
        cost = size * np.linalg.solve(basis[:n, :n].T, basis[n:, :n].T).real
    except np.linalg.LinAlgError as error:
        raise none from error
    cost = 0.5 * (cost + cost.T)
    gain = drive @ cost + direct
    poles = np.linalg.eigvals(a - b @ gain)
    # rounding moves uncontrollable poles to either side of the imaginary axis
    if count != n or not (poles.real < -UNDAMPED * np.abs(poles).max()).all():
        raise none
    return cost, np.asarray(gain)


class _Weighted(NamedTuple):
    """x' = a x + b u + bw w,  y = c x + d u + dw w,  z = e x + f u + g w, time in parts of a second: ``rate`` [1/s]."""

    a: Array
    b: Array
    bw: Array
    c: Array
    d: Array
    dw: Array
    e: Array
    f: Array
    g: Array
    rate: float


def _weighted(plant: Plant, sensors: Sequence[str], performance: Sequence[str]) -> _Weighted:
    """The plant in time units of its highest frequency, balanced, rotations times the length."""
    from mbsvib.responses.transmission_zeros import numbers

    space, scene = plant.space, plant.scene
    u, w = ([space.inputs.index(name) for name in names] for names in (plant.names("actuator"), scene.inputs))
    y, z = numbers(plant.system, "output", sensors), numbers(plant.system, "output", performance)
    units = [plant.system.output_units[k] for k in z]
    size = np.array([scene.length if unit.startswith("rad") else 1.0 for unit in units])[:, None]
    weights = 1.0 / scene.scale(scene.base_directions)
    rate = float(np.abs(plant.system.poles()).max())
    a, b, c = scaled(space.A / rate, space.B / rate, space.C)
    through = space.D
    # noise and cost are densities over time too: a change of its unit scales all of them equally
    return _Weighted(
        a, b[:, u], b[:, w] * weights, c[y], through[np.ix_(y, u)], through[np.ix_(y, w)] * weights,
        size * c[z], size * through[np.ix_(z, u)], size * through[np.ix_(z, w)] * weights, rate,
    )  # fmt: skip
