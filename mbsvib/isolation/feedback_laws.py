"""The classical controllers of active isolation: force feedback, velocity feedback, skyhook damping."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import eigh

from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array
from mbsvib.common.expected import one_of, reals
from mbsvib.errors import ResponseError
from mbsvib.feedback.controller import Controller, controller, integrators
from mbsvib.isolation.actuated import Active, check_plant
from mbsvib.isolation.study_scene import ACCELERATIONS

COORDINATES = ("legs", "modal")


def force_feedback(plant: Active, gain: ArrayLike, leak: float = 0.0) -> Controller:
    """Return decentralised integral force feedback: each leg pushes by the integral of its own tension.

    u_i = g_i / (s + leak) T_i, so that a massless leg on a mass has s^2 + g s + Omega^2 = 0

    Parameters
    ----------
    plant : Active
        The mechanism.
    gain : float or array-like, shape (legs,)
        g [rad/s].
    leak : float
        Corner [rad/s] below which force is not integrated. With 0 the legs have no static stiffness left.

    Returns
    -------
    Controller
        The controller.

    Raises
    ------
    ResponseError
        If the gains are refused.

    Source: A. Preumont, Vibration control of active structures, chapter on integral force feedback.
    """
    gains = np.diag(_gains(plant, gain, "force_feedback", "rad/s"))
    law = integrators("IFF", gains, plant.names("force"), plant.names("actuator"), leak)
    return law.for_plant(plant.system)


def velocity_feedback(plant: Active, gain: ArrayLike) -> Controller:
    """Return direct velocity feedback: each leg opposes the rate of its own elongation, u_i = -g_i d(stroke_i)/dt.

    Parameters
    ----------
    plant : Active
        The mechanism.
    gain : float or array-like, shape (legs,)
        g [N s/m], as the coefficient of a damper in parallel with the spring.

    Returns
    -------
    Controller
        The controller.

    Raises
    ------
    ResponseError
        If the gains are refused.
    """
    gains = np.diag(_gains(plant, gain, "velocity_feedback", "N s/m"))
    return controller(-gains, plant.names("rate"), plant.names("actuator"), "DVF").for_plant(plant.system)


def skyhook(plant: Active, gain: ArrayLike, coordinates: str = "legs", leak: float = 0.0) -> Controller:
    """Return skyhook damping: forces against the body's absolute velocity, the integral of accelerometers.

    legs: u_i = -g_i / (s + leak) a_i with the body's acceleration a_i along the leg.
    modal: the wrench -M Phi diag(2 g omega) Phi^T M v on the body, so that its suspension modes have the damping
    ratios g, shared among the legs by their static effect.

    Parameters
    ----------
    plant : Active
        The mechanism.
    gain : float or array-like, shape (legs,) or (6,)
        Legs: g [N s/m]. Modal: damping ratios, in ascending frequency.
    coordinates : str
        "legs" or "modal".
    leak : float
        Corner of the integrators [rad/s].

    Returns
    -------
    Controller
        The controller.

    Raises
    ------
    ResponseError
        If the gains or coordinates are refused.
    ModelError
        If modal coordinates are requested for a body without static stiffness.
    """
    if one_of(coordinates, COORDINATES, "skyhook", "coordinates") == "legs":
        gains = np.diag(_gains(plant, gain, "skyhook", "N s/m"))
        law = integrators("skyhook", -gains, plant.names("acceleration"), plant.names("actuator"), leak)
        return law.for_plant(plant.system)
    ratios = _shared(gain, 6, "skyhook", "damping ratios of the six suspension modes")
    mass = plant.mass
    square, shapes = eigh(plant.stiffness, mass)
    damper = mass @ (shapes * (2.0 * ratios * np.sqrt(np.maximum(square, 0.0)))) @ shapes.T @ mass
    forces = -np.linalg.pinv(plant.wrenches) @ damper
    law = integrators("modal skyhook", forces, ACCELERATIONS, plant.names("actuator"), leak)
    return law.for_plant(plant.system)


def force_feedback_optimum(pole: float, zero: float) -> tuple[float, float]:
    """Return the gain of integral force feedback that damps a mode most, and the damping ratio that it gets.

    g = Omega sqrt(Omega / z),  zeta = (Omega - z) / (2 z), for s (s^2 + Omega^2) + g (s^2 + z^2) = 0

    Parameters
    ----------
    pole : float
        Natural frequency Omega [rad/s].
    zero : float
        Frequency z of the zero from actuator to force, that of the mode with the actuator's leg taken out [rad/s].

    Returns
    -------
    gain, damping_ratio : float
        [rad/s] and -. Where z < Omega / 3 the mode can be damped critically, and the ratio counts no more.

    Raises
    ------
    ResponseError
        If not 0 < z < Omega.

    Source: A. Preumont et al., J. Sound Vib. 300 (2007) 644, equations 15 and 16.
    """
    if not 0.0 < zero < pole < np.inf:
        raise ResponseError(f"force_feedback_optimum: pole = {pole:g}, zero = {zero:g} rad/s; expected 0 < zero < "
                            f"pole, as force feedback has them.")  # fmt: skip
    return pole * float(np.sqrt(pole / zero)), (pole - zero) / (2.0 * zero)


def _gains(plant: Active, gain: ArrayLike, who: str, unit: str) -> Array:
    check_plant(plant, who)
    if not plant.legs:
        raise ResponseError(f"{who}: the plant has no legs with actuators; name some, isolation.actuated(model, body, "
                            f"legs), or close a loop of your own signals by plant.feedback.")  # fmt: skip
    return _shared(gain, len(plant.legs), who, f"a gain [{unit}], or one for each of {len(plant.legs)} legs")


def _shared(gain: ArrayLike, size: int, who: str, expected: str) -> Array:
    values = reals(gain, who, "gain", expected)
    if values.shape not in ((), (size,)) or not np.isfinite(values).all():
        raise ResponseError(f"{who}: gain = {check.shown(gain)}; expected {expected}.")
    return np.broadcast_to(values, (size,)).copy()
