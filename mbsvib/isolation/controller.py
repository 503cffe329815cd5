"""Controllers: linear laws from named sensors to named actuators, and the classical ones of active isolation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.errors import ResponseError
from mbsvib.isolation.figures import ACCELERATIONS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from mbsvib.common.arrays import Array, Complex
    from mbsvib.isolation.actuated import Active
    from mbsvib.responses.state_space import StateSpace


COORDINATES = ("legs", "modal")


@dataclass(frozen=True, repr=False, eq=False)
class Controller:
    """z' = A z + B y,  u = C z + D y, from the sensors ``inputs`` to the actuators ``outputs``, signs included."""

    name: str
    A: Array
    B: Array
    C: Array
    D: Array
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    def at(self, s: Complex) -> Complex:
        """Return K(s).

        Parameters
        ----------
        s : array, shape (n,)
            Points [1/s].

        Returns
        -------
        array, shape (n, outputs, inputs)
            Gains.
        """
        k = np.broadcast_to(self.D, (len(s), *self.D.shape)).astype(complex)
        if len(self.A):
            k = k + self.C @ np.linalg.solve(s[:, None, None] * np.eye(len(self.A)) - self.A, self.B)
        return np.asarray(k)

    def state_space(self) -> StateSpace:
        """Return the law as a state space with names, ready for ``mbsvib_export.to_control``."""
        from mbsvib.responses.state_space import StateSpace

        n = len(self.A)
        return StateSpace(self.name, "controller", self.A.copy(), self.B.copy(), self.C.copy(), self.D.copy(),
                          np.zeros((0, n)), tuple([f"{self.name}{i + 1}" for i in range(n)]), ("",) * n, self.inputs,
                          ("",) * len(self.inputs), self.outputs, ("N",) * len(self.outputs))  # fmt: skip

    def __repr__(self) -> str:
        return (f"Controller({self.name!r}: {len(self.inputs)} sensors, {len(self.outputs)} actuators, {len(self.A)} "
                f"states)")  # fmt: skip


def controller(law: Any, inputs: Sequence[str], outputs: Sequence[str], name: str = "controller") -> Controller:
    """Return a controller of one's own.

    Parameters
    ----------
    law : array-like, shape (outputs, inputs), or a state space
        Constant gains, or an object with A, B, C, D, as python-control has them; u = K y, so that a law that opposes
        what it measures has a negative gain.
    inputs, outputs : sequence of str
        Names of sensors and actuators, in the order of the law.
    name : str
        Name for tables.

    Returns
    -------
    Controller
        The law.

    Raises
    ------
    ResponseError
        If shapes do not match the names.
    """
    if hasattr(law, "A") and hasattr(law, "D"):
        if getattr(law, "dt", None) not in (None, 0):
            raise ResponseError(f"controller '{name}': the law is discrete (dt = {law.dt}); give the continuous one, "
                                f"and sample the closed loop by sampled(rate).")  # fmt: skip
        a, b, c, d = (np.array(getattr(law, part), dtype=float, ndmin=2) for part in "ABCD")
    else:
        d = np.array(law, dtype=float, ndmin=2)
        a, b, c = np.zeros((0, 0)), np.zeros((0, d.shape[1])), np.zeros((d.shape[0], 0))
    if d.shape != (len(outputs), len(inputs)):
        raise ResponseError(f"controller '{name}': the law has shape {d.shape}; expected ({len(outputs)}, "
                            f"{len(inputs)}), a row for each actuator and a column for each sensor.")  # fmt: skip
    n = a.size and len(a)
    return Controller(name, a.reshape(n, n), b.reshape(n, len(inputs)), c.reshape(len(outputs), n), d, tuple(inputs),
                      tuple(outputs))  # fmt: skip


def integrators(
    name: str, gains: ArrayLike, inputs: Sequence[str], outputs: Sequence[str], leak: float = 0.0
) -> Controller:
    """Return u = gains / (s + leak) y.

    Parameters
    ----------
    name : str
        Name for tables.
    gains : array-like, shape (outputs, inputs)
        Matrix of gains.
    inputs, outputs : sequence of str
        Names of sensors and actuators.
    leak : float
        Corner of the integrators [rad/s]: below it they forget.

    Returns
    -------
    Controller
        The law, one integrator a sensor.

    Raises
    ------
    ResponseError
        If the leak is negative.
    """
    matrix = np.array(gains, dtype=float, ndmin=2)
    if not 0.0 <= leak < np.inf:
        raise ResponseError(f"{name}: leak = {leak!r}; expected a corner frequency, no less than 0 [rad/s].")
    n = len(inputs)
    return Controller(name, -leak * np.eye(n), np.eye(n), matrix, np.zeros((len(outputs), n)), tuple(inputs),
                      tuple(outputs))  # fmt: skip


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
        The law.

    Raises
    ------
    ResponseError
        If the gains are refused.

    Source: A. Preumont, Vibration control of active structures, chapter on integral force feedback.
    """
    return integrators("IFF", np.diag(_gains(plant, gain, "force_feedback", "rad/s")), plant.names("tension"),
                       plant.names("actuator"), leak)  # fmt: skip


def velocity_feedback(plant: Active, gain: ArrayLike) -> Controller:
    """Return direct velocity feedback: each leg opposes the rate of its own elongation, u_i = -g_i d(stroke_i)/dt.

    Parameters
    ----------
    plant : Active
        The mechanism.
    gain : float or array-like, shape (legs,)
        g [N s/m], what a damper beside the spring would have.

    Returns
    -------
    Controller
        The law.

    Raises
    ------
    ResponseError
        If the gains are refused.
    """
    return controller(-np.diag(_gains(plant, gain, "velocity_feedback", "N s/m")), plant.names("rate"),
                      plant.names("actuator"), "DVF")  # fmt: skip


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
        The law.

    Raises
    ------
    ResponseError
        If the gains or coordinates are refused.
    ModelError
        If modal coordinates are asked for where no spring holds the body.
    """
    if coordinates not in COORDINATES:
        raise ResponseError(f"skyhook: coordinates = {coordinates!r}; expected 'legs' or 'modal'.")
    if coordinates == "legs":
        gains = np.diag(_gains(plant, gain, "skyhook", "N s/m"))
        return integrators("skyhook", -gains, plant.names("acceleration"), plant.names("actuator"), leak)
    ratios = _shared(gain, 6, "skyhook", "damping ratios of the six suspension modes")
    from scipy.linalg import eigh

    mass = plant.mass
    square, shapes = eigh(plant.stiffness, mass)
    damper = mass @ (shapes * (2.0 * ratios * np.sqrt(np.maximum(square, 0.0)))) @ shapes.T @ mass
    law = -np.linalg.pinv(plant.wrenches) @ damper
    return integrators("modal skyhook", law, ACCELERATIONS, plant.names("actuator"), leak)


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
    if not hasattr(plant, "legs"):
        raise ResponseError(f"{who}: plant = {type(plant).__name__}; expected a plant with actuators, "
                            f"isolation.actuated(model, body).")  # fmt: skip
    return _shared(gain, len(plant.legs), who, f"a gain [{unit}], or one for each of {len(plant.legs)} legs")


def _shared(given: ArrayLike, size: int, who: str, expected: str) -> Array:
    try:
        values = np.asarray(given, dtype=float)
    except (TypeError, ValueError) as error:
        raise ResponseError(f"{who}: gain = {check.shown(given)}; expected {expected}.") from error
    if values.shape not in ((), (size,)) or not np.isfinite(values).all():
        raise ResponseError(f"{who}: gain = {check.shown(given)}; expected {expected}.")
    return np.broadcast_to(values, (size,)).copy()
