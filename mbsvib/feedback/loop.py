"""Plants with controllers: their ports, poles and stability, in continuous or discrete time.

Sensors and actuators may be noisy, u = K (y + n) + d: the controller sees the noise n [unit of the sensor] beside what
the sensor measures, and d [unit of the actuator] acts beside what it commands.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mbsvib.common.arrays import Array, Complex
from mbsvib.common.display import Displayed
from mbsvib.common.expected import reals
from mbsvib.common.selection import Names, port_numbers, united
from mbsvib.equations.selection import port_fields
from mbsvib.errors import ResponseError, counted
from mbsvib.feedback.closing import Gathered
from mbsvib.feedback.controller import Controller, as_controller, combined
from mbsvib.feedback.participation import described, origins, shown_damping, unstable
from mbsvib.feedback.pole_track import vibrates
from mbsvib.responses.state_space import StateSpace


@dataclass(frozen=True, repr=False, eq=False)
class LoopPlant:
    """A system, or a state space, whose outputs are sensors and whose inputs are actuators.

    With noise of sensors and actuators as inputs, ``without_noise`` is the plant without these and ``gathered`` says
    which of its outputs and inputs those of ``system`` are.
    """

    _engine = "gathered source wrenches"

    system: Any
    without_noise: Any = field(default=None, repr=False, kw_only=True)
    gathered: Gathered | None = field(default=None, repr=False, kw_only=True)

    @property
    def source(self) -> Any:
        """The plant without inputs of noise."""
        return self.system if self.without_noise is None else self.without_noise

    @cached_property
    def space(self) -> StateSpace:
        """First-order equations: in modal states for a system, as given for a state space."""
        space: StateSpace = self.system.state_space("modal" if self.system.kind == "system" else None)
        return space

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.system!r})"


class Resolution(NamedTuple):
    """Structure of responses: ``poles`` [1/s], repeated after the ``period`` [Hz]; ``longest`` [Hz] is the maximum
    length of a panel on which other factors are polynomials of the frequency.
    """

    poles: Complex
    longest: float = np.inf
    period: float = np.inf


def resolution(linear: Any) -> Resolution:
    """Return poles and panels of the responses of a system or a closed loop."""
    return linear.resolution if isinstance(linear, Loop) else Resolution(linear.poles())


@dataclass(frozen=True, repr=False, eq=False)
class Loop(Displayed, ABC):
    """A plant with controllers, u = w + K y; has the inputs w and outputs of ``plant.system``, or some of them."""

    _engine = ("check_stable delay_limit equations kind law ports resolution response rounded_poles selected_ports "
               "selection sources title unstable vibrating")

    kind: ClassVar[str] = "closed loop"

    plant: LoopPlant
    """What the controllers act on."""
    controllers: tuple[Controller, ...]
    """Controllers, which act in parallel."""
    sensors: tuple[str, ...] = field(repr=False)
    """Names of the outputs that controllers take."""
    actuators: tuple[str, ...] = field(repr=False)
    """Names of the inputs that they drive."""
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
        return tuple(self.plant.system.outputs if self.selection is None else self.selection[0])

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return tuple(self.plant.system.inputs if self.selection is None else self.selection[1])

    @property
    def output_units(self) -> tuple[str, ...]:
        """Units of the outputs."""
        return tuple([self.plant.system.output_units[k] for k in self.selected_ports[0]])

    @property
    def input_units(self) -> tuple[str, ...]:
        """Units of the inputs."""
        return tuple([self.plant.system.input_units[k] for k in self.selected_ports[1]])

    def _with_ports(self, outputs: Names, inputs: Names) -> Self:
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

    @property
    @abstractmethod
    def title(self) -> str:
        """The controllers, and how they run."""

    @property
    @abstractmethod
    def _eigen(self) -> tuple[Complex, Array, Array]:
        """Poles [1/s] in ascending magnitude, bounds of their rounding, and participation of states (states, poles)."""

    @property
    @abstractmethod
    def resolution(self) -> Resolution:
        """Poles and panels of the responses."""

    @abstractmethod
    def _sensitivity(self, w: Array) -> Complex:
        """(1 - K G)^-1 at the actuators, (n, actuators, actuators), of a sampled loop from sample to sample."""

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
        w = np.atleast_1d(reals(omega, "sensitivity", "omega", "numbers [rad/s]"))
        return np.asarray(self._sensitivity(w).transpose(1, 2, 0))

    def delay_limit(
        self, actuator: int, by_phase: tuple[float, float], band: tuple[float, float]
    ) -> tuple[float, float]:  # fmt: skip
        """Return the delay margin of an actuator, with the other loops closed.

        Parameters
        ----------
        actuator : int
            Its number.
        by_phase : (float, float)
            Phase margin over frequency [s], and that frequency [Hz].
        band : (float, float)
            First and last angular frequency [rad/s] at which the loop gain is known.

        Returns
        -------
        tuple of float
            Delay margin [s], and the frequency where it occurs [Hz].
        """
        del actuator, band
        return by_phase

    def poles(self) -> Complex:
        """Return the poles of the closed loop [1/s], in ascending magnitude."""
        return self._eigen[0].copy()

    @property
    def rounded_poles(self) -> tuple[Complex, Array]:
        """Poles of the first-order equations [1/s], and bounds of their rounding."""
        return self._eigen[:2]

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
        """Whether no pole grows; poles at 0 are allowed, of integrators and of rigid-body modes that no loop holds."""
        return not self.growing

    def check_stable(self) -> None:
        """Refuse a loop that is not stable.

        Raises
        ------
        ResponseError
            If a pole is unstable.
        """
        if self.growing:
            raise ResponseError(f"{self.unstable} Lower the gain, or look at collocation() for the pairs that do not "
                                f"damp.")  # fmt: skip

    @property
    def unstable(self) -> str:
        """Sentence on the poles that grow."""
        return f"closed loop: not stable with {self.law.name}: {'; '.join(self.growing)}."

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

    def table(self) -> dict[str, Any]:
        """Return the modes of the closed loop, and real poles that grow, as arguments of ``mbsvib.common.tables.text``
        and ``show``; a note counts the other real poles.
        """
        poles, errors, _ = self._eigen
        shown = np.union1d(self._vibrating, unstable(poles, errors))
        values = zip(np.abs(poles[shown]), shown_damping(poles[shown], errors[shown]), shown.tolist(), strict=True)
        rows = [(i + 1, f"{natural / (2 * np.pi):.6g}", f"{100.0 * ratio:.4g}", self.sources[at])
                for i, (natural, ratio, at) in enumerate(values)]  # fmt: skip
        notes = [f"Unstable: {words}." for words in self.growing]
        real = np.setdiff1d(np.flatnonzero(~vibrates(poles, errors)), shown)  # in ascending magnitude, as poles are
        if len(real):
            slowest = f"{'the slowest' if len(real) > 1 else 'it'} is at {poles[real[0]].real:.4g} 1/s"
            notes.append(f"Not listed: {counted(len(real), 'real pole')}; {slowest} ({self.sources[real[0]]}).")
        return {"title": f"Closed loop of {self.plant.system.name}: {self.title}",
                "columns": [("mode", "right"), ("natural [Hz]", "right"), ("damping ratio [%]", "right"),
                            ("origin", "left")], "rows": rows, "notes": notes}  # fmt: skip

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.plant.system.name!r} with {self.title})"


# Ends of the names of the inputs, and of what controllers see; loops do not show the latter.
NOISE, MEASURED = ".noise", ".measured"


def with_noise(plant: LoopPlant, law: Controller) -> tuple[LoopPlant, Controller]:
    """Return a plant with the noise of a controller's sensors and actuators as inputs, and the
    controller that sees it.

    Inputs: those of the system, "SENSOR.noise" in the order of the sensors, "ACTUATOR.noise" in that of the actuators;
    outputs: those of the system, then what the controller sees, "SENSOR.measured".
    """
    system = plant.system if plant.system.kind == "system" else plant.system.state_space()
    y = [system.outputs.index(name) for name in law.inputs]
    u = [system.inputs.index(name) for name in law.outputs]
    added = [f"{name}{NOISE}" for name in (*law.inputs, *law.outputs)]
    for name in added:
        if name in system.inputs or added.count(name) > 1:
            raise ResponseError(f"feedback: noise=True adds the input '{name}', which there is already; give the "
                                f"sensor or actuator another name.")  # fmt: skip
    rows, columns = [*range(len(system.outputs)), *y], [*range(len(system.inputs)), *u]
    ports = port_fields(system, rows, columns)
    at, count = len(system.inputs), len(y)
    measured = tuple([f"{name}{MEASURED}" for name in law.inputs])
    noise = np.zeros((len(rows), count))
    noise[len(system.outputs) :] = np.eye(count)
    ports |= {
        "outputs": (*system.outputs, *measured), "inputs": (*system.inputs, *added),
        "input_units": (*system.input_units, *[system.output_units[k] for k in y], *[system.input_units[k] for k in u]),
        "D": np.insert(ports["D"], [at] * count, noise, axis=1),
    }  # fmt: skip
    result = replace(system, **ports, **_inputs(system, columns, at, count), **_outputs(system, rows))
    noisy = replace(plant, system=result, without_noise=plant.system, gathered=Gathered(
        rows, [*columns[:at], *[-1] * count, *u], ([*range(len(rows) - count, len(rows))], [*range(at, at + count)])))
    return noisy, replace(law, inputs=measured).for_plant(result)


def _inputs(system: Any, columns: list[int], at: int, count: int) -> dict[str, Array]:
    """The matrices of inputs with columns of zeros for the noise of sensors, which acts through D alone."""
    return {key: np.insert(matrix[:, columns], [at] * count, np.zeros((len(matrix), 1)), axis=1)
            for key in ("B", "through") if (matrix := getattr(system, key, None)) is not None}  # fmt: skip


def _outputs(system: Any, rows: list[int]) -> dict[str, Array]:
    """The matrices of outputs; C of a system of second order is its damping."""
    keys = ("Cq", "Cv", "Ca") if system.kind == "system" else ("C",)
    return {key: getattr(system, key)[rows] for key in keys}
