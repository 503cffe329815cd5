"""Feedback loops: common base of continuous-time and discrete-time controllers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from mbsvib.common.display import Displayed
from mbsvib.common.expected import angular
from mbsvib.common.selection import port_numbers, united
from mbsvib.errors import ResponseError
from mbsvib.feedback.combined_controller import combined
from mbsvib.feedback.controller import Controller, as_controller
from mbsvib.feedback.integrand import response
from mbsvib.feedback.loop_rounding import blended, evaluated
from mbsvib.feedback.margins import margins
from mbsvib.feedback.pole_track import vibrates
from mbsvib.feedback.pole_words import described, origins, shown_damping, unstable
from mbsvib.linalg.rank import EPS
from mbsvib.responses.linear import LinearVerbs

if TYPE_CHECKING:

    from numpy.typing import ArrayLike, NDArray

    from mbsvib.common.arrays import Array, Complex
    from mbsvib.common.selection import Names
    from mbsvib.feedback.loop_rounding import Closed
    from mbsvib.feedback.margins import Margins
    from mbsvib.feedback.plant import LoopPlant
    from mbsvib.feedback.resolution import Resolution
    from mbsvib.responses.state_space import StateSpace



@dataclass(frozen=True, repr=False, eq=False)
class FeedbackLoop(LinearVerbs, Displayed, ABC):
    """A plant with controllers, u = w + K y; has the inputs w and outputs of ``plant.system``, or some of them.

    Subclasses define whether controllers run in continuous or discrete time.
    """

    kind: ClassVar[str] = "closed loop"

    plant: LoopPlant
    controllers: tuple[Controller, ...]
    sensors: tuple[str, ...] = field(repr=False)
    actuators: tuple[str, ...] = field(repr=False)
    selection: tuple[tuple[str, ...], tuple[str, ...]] | None = field(default=None, repr=False, kw_only=True)

    @property
    def open_loop(self) -> Any:
        """The plant with open loops."""
        return self.plant.system

    @property
    def name(self) -> str:
        """Name of the plant, and those of the controllers."""
        return f"{self.plant.system.name} with {self.title}"

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""
        known: tuple[str, ...] = self.plant.system.outputs if self.selection is None else self.selection[0]
        return known

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        known: tuple[str, ...] = self.plant.system.inputs if self.selection is None else self.selection[1]
        return known

    @property
    def output_units(self) -> tuple[str, ...]:
        """Units of the outputs."""
        system = self.plant.system
        return tuple([system.output_units[system.outputs.index(name)] for name in self.outputs])

    @property
    def input_units(self) -> tuple[str, ...]:
        """Units of the inputs."""
        system = self.plant.system
        return tuple([system.input_units[system.inputs.index(name)] for name in self.inputs])

    def with_ports(self, outputs: Names = None, inputs: Names = None) -> Self:
        """Return the loop with some of its outputs and inputs, as ``loop[outputs, inputs]`` does.

        Parameters
        ----------
        outputs, inputs : str or sequence of str, optional
            Names or patterns, in the order in which they are wanted; default: all. Sensors and actuators stay
            connected.

        Returns
        -------
        FeedbackLoop
            The same loop.

        Raises
        ------
        ResponseError
            If a name is unknown, or a pattern picks nothing.
        """
        if outputs is None and inputs is None:
            return self
        o, i = port_numbers(outputs, inputs, (self.outputs, self.inputs), self.name)
        return replace(self, selection=(tuple([self.outputs[k] for k in o]), tuple([self.inputs[k] for k in i])))

    def feedback(
        self, controller: Any, sensors: Names = None, actuators: Names = None, name: str | None = None
    ) -> Self:  # fmt: skip
        """Return the loop with a further controller, which acts together with the others: u = w + K y is added.

        Parameters
        ----------
        controller : Controller, StateSpace, control.StateSpace, control.TransferFunction or array-like
            From sensors to actuators, in continuous time or, of a sampled loop, at its rate; an array, shape
            (actuators, sensors), is a static gain.
        sensors, actuators : str or sequence of str, optional
            Names or patterns of outputs and of inputs of the plant; default: the names that the controller has.
        name : str, optional
            Name of the controller in tables.

        Returns
        -------
        FeedbackLoop
            The same plant with one more controller.

        Raises
        ------
        ResponseError
            If a name is unknown, shapes do not match, or the controller is discrete at another rate.
        """
        law = as_controller(controller, self.plant.system, sensors, actuators, name, self.period)
        return replace(self, controllers=(*self.controllers, law), sensors=united(self.sensors, law.inputs),
                       actuators=united(self.actuators, law.outputs))  # fmt: skip

    @cached_property
    def law(self) -> Controller:
        """All controllers as one."""
        return combined(self.controllers, self.sensors, self.actuators).for_plant(self.plant.system)

    @property
    def period(self) -> float | None:
        """Sample time of the controllers [s], None in continuous time."""
        return None

    @property
    def ports(self) -> tuple[list[int], list[int]]:
        """Numbers of the sensors among the outputs and of the actuators among the inputs."""
        system = self.plant.system
        return [system.outputs.index(n) for n in self.sensors], [system.inputs.index(n) for n in self.actuators]

    @property
    def selected_ports(self) -> tuple[list[int], list[int]]:
        """Numbers of the outputs and inputs among those of the plant."""
        system = self.plant.system
        return [system.outputs.index(n) for n in self.outputs], [system.inputs.index(n) for n in self.inputs]

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

    @abstractmethod
    def _sensitivity(self, w: Array) -> Complex:
        """(1 - K G)^-1 at the actuators, (n, actuators, actuators), of a sampled loop from sample to sample."""

    @property
    @abstractmethod
    def _eigen(self) -> tuple[Complex, Array, Array]:
        """Poles [1/s] in ascending magnitude, bounds of their rounding, and participation of states (states, poles)."""

    @property
    @abstractmethod
    def resolution(self) -> Resolution:
        """Poles and panels of the responses."""

    @abstractmethod
    def state_space(self, realization: str = "modal") -> StateSpace:
        """Return first-order equations of the closed loop.

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
            If the realization is another one, or there are no such equations.
        """

    @property
    @abstractmethod
    def title(self) -> str:
        """The controllers, and how they run."""

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
        return np.asarray(self._loop_gain(np.atleast_1d(np.asarray(omega, dtype=float))).transpose(1, 2, 0))

    def sensitivity(self, omega: ArrayLike) -> Complex:
        """Return the sensitivity at the actuators, S = (1 + L)^-1; T = 1 - S is the complementary sensitivity.

        Parameters
        ----------
        omega : array-like, shape (n,)
            Angular frequencies [rad/s].

        Returns
        -------
        array, shape (actuators, actuators, n)
            Sensitivities, also at poles of the plant.

        Raises
        ------
        ResponseError
            If a frequency is a pole of the closed loop.
        """
        return np.asarray(self._sensitivity(np.atleast_1d(np.asarray(omega, dtype=float))).transpose(1, 2, 0))

    def frequency_response(self, omega: ArrayLike, outputs: Names = None, inputs: Names = None) -> Complex:
        """Return the response of the closed loop, G + G_u (1 - K G_yu)^-1 K G_y.

        Parameters
        ----------
        omega : array-like, shape (n,)
            Angular frequencies [rad/s].
        outputs, inputs : str or sequence of str, optional
            Names or patterns; default: all.

        Returns
        -------
        array, shape (outputs, inputs, n)
            Complex responses, from those of the plant; where these cancel, as next to its poles or a controller's,
            from the closed-loop equations.

        Raises
        ------
        ResponseError
            If the loop is not stable, a frequency is a pole of the loop, or a name is unknown.
        """
        self.check_stable()
        return self.with_ports(outputs, inputs).response(omega)

    def response(self, w: ArrayLike) -> Complex:
        """Return the response of the closed loop, whether or not it is stable.

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
        at, system = angular(w), self.plant.system
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

    def poles(self) -> Complex:
        """Return the poles of the closed loop [1/s], in ascending magnitude."""
        return self._eigen[0].copy()

    @cached_property
    def growing(self) -> tuple[str, ...]:
        """The unstable modes in words, each with the mode of the mechanism it comes from."""
        numbers = unstable(*self._eigen[:2])
        return described(self._eigen[0], self.sources, numbers) if len(numbers) else ()

    @cached_property
    def sources(self) -> tuple[str, ...]:
        """Where each pole comes from, in words: a mode of the plant, or the controller."""
        return origins(self.plant.system, self.plant.space.states, *self._eigen)

    @property
    def stable(self) -> bool:
        """Whether the loop is stable; integrators without leak may leave poles at 0."""
        return not self.growing

    def check_stable(self) -> None:
        """Refuse a loop that is not stable.

        Raises
        ------
        ResponseError
            If a pole is unstable.
        """
        if self.growing:
            raise ResponseError(f"closed loop: not stable with {self.law.name}: {'; '.join(self.growing)}. Lower the "
                                f"gain, or look at collocation() for the pairs that do not damp.")  # fmt: skip

    @property
    def vibrating(self) -> Complex:
        """Poles that vibrate, one of each pair, in ascending magnitude."""
        return np.asarray(self._eigen[0][self._vibrating])

    @cached_property
    def _vibrating(self) -> NDArray[np.intp]:
        values, errors, _ = self._eigen
        return np.flatnonzero(vibrates(values, errors) & (values.imag > 0.0))

    @property
    def damping_ratios(self) -> Array:
        """Damping ratios of the poles that vibrate."""
        return np.asarray(-self.vibrating.real / np.abs(self.vibrating))

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

    def table(self) -> dict[str, Any]:
        """Return the table of the modes of the closed loop as arguments of ``mbsvib.common.tables.text`` and ``show``.

        Returns
        -------
        dict
            Title, columns, rows and notes.
        """
        damping = shown_damping(self.vibrating, self._eigen[1][self._vibrating])
        values = zip(np.abs(self.vibrating), damping, self._vibrating.tolist(), strict=True)
        rows = [(i + 1, f"{natural / (2 * np.pi):.6g}", f"{100.0 * ratio:.4g}", self.sources[at])
                for i, (natural, ratio, at) in enumerate(values)]  # fmt: skip
        notes = [f"Unstable: {words}." for words in self.growing]
        return {"title": f"Closed loop of {self.plant.system.name}: {self.title}",
                "columns": [("mode", "right"), ("natural [Hz]", "right"), ("damping ratio [%]", "right"),
                            ("origin", "left")], "rows": rows, "notes": notes}  # fmt: skip

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.plant.system.name!r} with {self.title})"
