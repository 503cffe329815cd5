"""Responses and margins of feedback loops, in continuous or discrete time."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar
from warnings import warn

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.common.arrays import Array, Complex
from mbsvib.common.columnar import Columnar
from mbsvib.common.expected import angular, positive, real, reals
from mbsvib.errors import AccuracyWarning, UnstableWarning
from mbsvib.feedback.loop import Loop
from mbsvib.feedback.loop_rounding import Closed, blended, evaluated, response
from mbsvib.feedback.margins import Margins, margins
from mbsvib.linalg.discrete import implausible_step
from mbsvib.linalg.rank import EPS
from mbsvib.responses.linear import LinearVerbs
from mbsvib.responses.state_space import StateSpace


@dataclass(frozen=True, repr=False, eq=False)
class FeedbackLoop(Columnar, LinearVerbs, Loop):
    """A plant with controllers, u = w + K y; has the inputs w and outputs of ``plant.system``, or some of them.

    Subclasses define whether controllers run in continuous or discrete time.
    """

    _engine = "continuous_form sampled_form"

    sampled_form: ClassVar[type[Any] | None] = None  # the class with discrete-time controllers, None: this one

    def columns(self) -> dict[str, Any]:
        """Return the poles as columns by name: those of the table of ``modes()``."""
        return dict(self.modes().columns())

    def state_space(self, realization: str = "modal") -> StateSpace:
        """Return first-order equations of the closed loop, ready for ``mbsvib_export.to_control``.

        Parameters
        ----------
        realization : str
            States of the plant, before those of the controllers: "modal" (of a plant with motions as inputs, physical),
            or "physical". "balanced": physical states and those of the controllers, scaled by powers of two.

        Returns
        -------
        StateSpace
            Matrices, names and units.

        Raises
        ------
        ResponseError
            If the realization is another one, or the plant is a state space whose states are given; of a sampled loop
            always, as samples have no continuous equations.
        """
        return self._first_order(realization)

    @abstractmethod
    def _first_order(self, realization: str) -> StateSpace:
        """What ``state_space`` returns."""

    @property
    def continuous_form(self) -> type[Any]:
        """The class of the loop with continuous-time controllers."""
        return type(self)

    @abstractmethod
    def _forces(self, w: Array, plant: tuple[Complex, Complex]) -> tuple[Complex, Array]:
        """Forces of the controllers under unit inputs, (n, actuators, inputs), and bounds of their rounding, from the
        responses (n, sensors, ...) of the ``plant`` to actuators and to inputs.
        """

    @abstractmethod
    def _by_states(self, w: Array) -> Closed:
        """Responses by the closed-loop equations, as a function of outputs, inputs and points of ``w`` (n,)."""

    @abstractmethod
    def _loop_gain(self, w: Array) -> Complex:
        """-K G at the actuators, (n, actuators, actuators), of a sampled loop from sample to sample."""

    def _between(self, w: Array) -> Complex:
        """The response of the plant from actuators to sensors, (n, sensors, actuators)."""
        system = self.plant.system
        if getattr(system, "basis", None) is not None:
            values = response(system, w, self.sensors, self.actuators)
        else:
            values = system.frequency_response(w, self.sensors, self.actuators)
        return np.asarray(values.transpose(2, 0, 1))

    def loop_gain(self, omega: ArrayLike) -> Complex:
        """Return the loop gain at the actuators with the sign of negative feedback, L = -K G_yu, with open loops.

        Parameters
        ----------
        omega : array-like, shape (n,)
            Angular frequencies [rad/s].

        Returns
        -------
        array, shape (actuators, actuators, n)
            Gains; a loop with a single actuator is unstable where L encircles -1.

        Raises
        ------
        ResponseError
            If a frequency is a pole of the plant or of a controller, where L is infinite.
        """
        w = np.atleast_1d(reals(omega, "loop_gain", "omega", "numbers [rad/s]"))
        return np.asarray(self._loop_gain(w).transpose(1, 2, 0))

    def _response(self, part: FeedbackLoop, w: Array) -> Complex:
        if self.growing:
            warn(f"{self.unstable} No steady vibration has its frequency response.", UnstableWarning, stacklevel=3)
        return part.response(w)

    def response(self, w: ArrayLike) -> Complex:
        """Return the response of the closed loop, whether or not it is stable: from those of the plant or, where these
        cancel, as next to its poles or a controller's, from the closed-loop equations.

        Parameters
        ----------
        w : array-like, shape (n,)
            Angular frequencies [rad/s].

        Returns
        -------
        array, shape (outputs, inputs, n)
            Complex responses.

        Raises
        ------
        ResponseError
            If ``w`` is no vector of frequencies, or rounding of one is more than a turn in a period of sampling.
        """
        return self._steady(angular(w))

    def _steady(self, at: Array) -> Complex:
        system = self.plant.system
        (y, u), (o, i) = self.ports, self.selected_ports
        rows, columns = sorted({*o, *y}), sorted({*i, *u})
        part = system.with_ports([system.outputs[k] for k in rows], [system.inputs[k] for k in columns])
        g = evaluated(lambda w: part.frequency_response(w).transpose(2, 0, 1), at, (len(rows), len(columns)))
        y, o = ([rows.index(k) for k in numbers] for numbers in (y, o))
        u, i = ([columns.index(k) for k in numbers] for numbers in (u, i))
        acts, direct = g[:, o][:, :, u], g[:, o][:, :, i]
        forces, error = self._forces(at, (g[:, y][:, :, u], g[:, y][:, :, i]))
        error = EPS * np.abs(direct) + np.abs(acts) @ error
        return blended(direct + acts @ forces, error, self._by_states(at)).transpose(1, 2, 0)

    def margins(self, frequencies: ArrayLike | None = None) -> Margins:
        """Return stability margins: of all loops together, and of each with the others closed.

        Parameters
        ----------
        frequencies : array-like, shape (n,), optional
            Where to look [Hz]; default: around all poles.

        Returns
        -------
        Margins
            Printed as a table.
        """
        return margins(self, frequencies)

    def sampled(self, rate: float, delay: float = 0.0) -> Any:
        """Return the loop with discrete-time controllers, at another rate if they are.

        Parameters
        ----------
        rate : float
            Sampling rate [Hz].
        delay : float
            Between measuring and acting [s].

        Returns
        -------
        SampledLoop
            The same loop with discrete controllers and a zero-order hold.

        Raises
        ------
        ResponseError
            If the rate is no positive number or the delay none from 0 on.

        Warns
        -----
        AccuracyWarning
            If a period of the rate is many periods of all poles of the plant and the controllers.
        """
        rate = positive("sampled", "rate", rate, "a number [Hz]")
        poles = np.concatenate((np.ravel(self.plant.system.poles()), np.linalg.eigvals(self.law.A)))
        if doubt := implausible_step(1.0 / rate, poles):
            warn(f"sampled: rate = {rate:g} Hz: {doubt} of '{self.name}'; is it a rate in Hz, not a step in s?",
                 AccuracyWarning, stacklevel=2)  # fmt: skip
        delay = real(delay, "sampled", "delay", "a number [s] that is not negative", 0.0)
        form: type[Any] = self.sampled_form or type(self)
        return form(self.plant, self.controllers, self.sensors, self.actuators, rate, delay,
                    selection=self.selection, continuous_form=self.continuous_form)  # fmt: skip
