"""Closed loops: the mechanism with its controllers, as accurate over frequency as the mechanism itself."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.errors import ResponseError, nearest
from mbsvib.isolation.controller import Controller
from mbsvib.isolation.feedback_loop import FeedbackLoop
from mbsvib.isolation.linear import Resolution
from mbsvib.isolation.participation import eigen
from mbsvib.isolation.sampled import sampled
from mbsvib.responses.state_space import StateSpace

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array, Complex
    from mbsvib.isolation.plant import Plant
    from mbsvib.isolation.sampled import SampledLoop


@dataclass(frozen=True, repr=False, eq=False)
class ClosedLoop(FeedbackLoop):
    """A mechanism with controllers; has the inputs and outputs of ``plant.system``, actuators take further forces."""

    def _loop(self, omega: Array, own: Complex) -> tuple[Complex, Complex, Complex]:
        s = np.asarray(1j * omega, dtype=complex)
        try:
            k = self.law.at(s)
        except np.linalg.LinAlgError as error:
            raise ResponseError("closed loop: a controller has a pole at one of the frequencies (a pure integrator at "
                                "0 Hz?); give it a leak, or leave this frequency out.") from error  # fmt: skip
        return k, k @ own, np.ones(len(omega), dtype=complex)

    @cached_property
    def _space(self) -> tuple[Array, Array, Array, Array, StateSpace]:
        space = self.plant.space
        law, (y, u) = self.law, self.ports
        n = len(space.A)
        loop = np.eye(len(y)) - space.D[np.ix_(y, u)] @ law.D
        if np.linalg.cond(loop) > 1e12:
            raise ResponseError(f"closed loop: {law.name} makes an algebraic loop: its feedthrough times that of the "
                                f"sensors is 1. Change the gain.")  # fmt: skip
        # y = seen (x, z) + direct w
        sensors = np.linalg.solve(loop, np.concatenate((space.C[y], space.D[np.ix_(y, u)] @ law.C), axis=1))
        direct = np.linalg.solve(loop, space.D[y])
        forces, forces_w = law.D @ sensors, law.D @ direct
        forces[:, n:] += law.C
        a = np.concatenate((space.B[:, u] @ forces, law.B @ sensors))
        a[:n, :n] += space.A
        a[n:, n:] += law.A
        b = np.concatenate((space.B + space.B[:, u] @ forces_w, law.B @ direct))
        c = space.D[:, u] @ forces
        c[:, :n] += space.C
        d = space.D + space.D[:, u] @ forces_w
        return a, b, c, d, space

    def state_space(self, realization: str = "modal") -> StateSpace:
        """Return first-order equations of the closed loop, ready for ``mbsvib_export.to_control``.

        Parameters
        ----------
        realization : str
            "modal": the mechanism's states are modal, the controllers' their own.

        Returns
        -------
        StateSpace
            Matrices, names and units.

        Raises
        ------
        ResponseError
            If the realization is another one.
        """
        if realization != "modal":
            raise ResponseError(f"state_space: realization = {realization!r}; a closed loop has only 'modal' states.")
        a, b, c, d, space = self._space
        k = len(a) - len(space.A)
        states = tuple([f"controller{i + 1}" for i in range(k)])
        return StateSpace(f"{space.name} with {self.law.name}", "modal", a.copy(), b.copy(), c.copy(), d.copy(),
                          np.concatenate((space.transform, np.zeros((len(space.transform), k))), axis=1),
                          (*space.states, *states), (*space.state_units, *("",) * k), space.inputs, space.input_units,
                          space.outputs, space.output_units, space.through)  # fmt: skip

    @cached_property
    def _eigen(self) -> tuple[Complex, Array]:
        return eigen(self._space[0])

    @property
    def resolution(self) -> Resolution:
        """Poles and panels of the responses."""
        return Resolution(self.poles())

    @property
    def far(self) -> ClosedLoop:
        """The loop or system with the same response at high frequency."""
        return self

    @property
    def title(self) -> str:
        """The controllers' names."""
        return self.law.name

    def sampled(self, rate: float, delay: float = 0.0) -> SampledLoop:
        """Return the loop with discrete-time controllers.

        Parameters
        ----------
        rate : float
            Samples a second [Hz].
        delay : float
            Between measuring and acting [s].

        Returns
        -------
        SampledLoop
            The same loop with discrete controllers and a zero-order hold.
        """
        return sampled(self, rate, delay)


def close(plant: Plant, *controllers: Controller) -> ClosedLoop:
    """Return a mechanism with its loops closed.

    Parameters
    ----------
    plant : Plant
        The mechanism with actuators and sensors.
    *controllers : Controller
        Controllers that act together.

    Returns
    -------
    ClosedLoop
        Poles, responses, margins.

    Raises
    ------
    ResponseError
        If there is no controller, or one names an unknown sensor or actuator.
    """
    if not controllers:
        raise ResponseError("closed loop: no controller is given; make one by force_feedback, skyhook, controller, ...")
    system = plant.system
    for law in controllers:
        if not isinstance(law, Controller):
            raise ResponseError(f"closed loop: {type(law).__name__} is not a controller; expected what force_feedback, "
                                f"skyhook, controller, ... return.")  # fmt: skip
        for what, names, known in (("sensor", law.inputs, system.outputs), ("actuator", law.outputs, system.inputs)):
            for name in names:
                if name not in known:
                    raise ResponseError(f"closed loop: {law.name} names the {what} '{name}'; the plant has none."
                                        f"{nearest(name, known)} It has {', '.join(known)}.")  # fmt: skip
    return ClosedLoop(plant, controllers, _united([c.inputs for c in controllers]),
                      _united([c.outputs for c in controllers]))  # fmt: skip


def _united(groups: Sequence[tuple[str, ...]]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(name for group in groups for name in group))
