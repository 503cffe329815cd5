"""Controllers: linear equations from named sensors to named actuators."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag

from mbsvib.common.arrays import Array, Complex
from mbsvib.common.display import Displayed
from mbsvib.common.expected import reals
from mbsvib.common.selection import Names, port_numbers, selected
from mbsvib.common.tables import listed
from mbsvib.errors import ResponseError, counted
from mbsvib.feedback.closing import regular, transfer
from mbsvib.linalg.discrete import inverse_tustin
from mbsvib.responses.from_control import arguments, is_control, is_transfer_function, of_control, sample_time
from mbsvib.responses.linear import LinearVerbs
from mbsvib.responses.state_space import StateSpace

SAME = 1e-9  # share of a sample time by which two of them may differ and be one


@dataclass(frozen=True, repr=False, eq=False)
class Controller(LinearVerbs, Displayed):
    """z' = A z + B y,  u = C z + D y, from the sensors ``inputs`` to the actuators ``outputs``, signs included.

    It has the responses, norms and plots of a system. ``units`` are those of sensors and of actuators, where the plant
    is known.
    """

    name: str
    """Name for tables and figures."""
    A: Array
    """State matrix (n, n) [1/s]."""
    B: Array
    """Input matrix (n, inputs)."""
    C: Array
    """Output matrix (outputs, n)."""
    D: Array
    """Direct response of outputs to inputs (outputs, inputs)."""
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    kind: ClassVar[str] = "controller"

    units: tuple[tuple[str, ...], tuple[str, ...]] | None = None

    def __post_init__(self) -> None:
        for label in "ABCD":
            if not np.isfinite(getattr(self, label)).all():
                raise ResponseError(f"controller '{self.name}': {label} has entries that are not finite; expected real "
                                    f"numbers.")  # fmt: skip

    @property
    def input_units(self) -> tuple[str, ...]:
        """Units of the sensors, "" where they are unknown."""
        return self.units[0] if self.units else ("",) * len(self.inputs)

    @property
    def output_units(self) -> tuple[str, ...]:
        """Units of the actuators, "" where they are unknown."""
        return self.units[1] if self.units else ("",) * len(self.outputs)

    def for_plant(self, plant: Any) -> Self:
        """Return the controller with the units of a plant.

        Parameters
        ----------
        plant : System, StateSpace or ClosedLoop
            Whose outputs are the sensors and whose inputs the actuators.

        Returns
        -------
        Controller
            The same equations.
        """
        sensors, actuators = (dict(zip(*signals, strict=True)) for signals in
                              ((plant.outputs, plant.output_units), (plant.inputs, plant.input_units)))  # fmt: skip
        units = tuple([sensors.get(n, "") for n in self.inputs]), tuple([actuators.get(n, "") for n in self.outputs])
        return replace(self, units=units)

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
        return transfer((self.A, self.B, self.C, self.D), s)

    def _with_ports(self, outputs: Names, inputs: Names) -> Self:
        o, i = port_numbers(outputs, inputs, (self.outputs, self.inputs), self.name)
        units = self.input_units, self.output_units
        return replace(self, B=self.B[:, i], C=self.C[o], D=self.D[np.ix_(o, i)],
                       inputs=tuple([self.inputs[k] for k in i]), outputs=tuple([self.outputs[k] for k in o]),
                       units=(tuple([units[0][k] for k in i]), tuple([units[1][k] for k in o])))  # fmt: skip

    def state_space(self) -> StateSpace:
        """Return the controller as a state space with names, ready for ``mbsvib_export.to_control``."""
        n = len(self.A)
        return StateSpace(self.name, "controller", self.A.copy(), self.B.copy(), self.C.copy(), self.D.copy(),
                          np.zeros((0, n)), tuple([f"{self.name}{i + 1}" for i in range(n)]), ("",) * n, self.inputs,
                          self.input_units, self.outputs, self.output_units)  # fmt: skip

    def poles(self) -> Complex:
        """Return the eigenvalues of A [1/s], shape (states,), in ascending magnitude."""
        return self.state_space().poles()

    def _response(self, part: Controller, w: Array) -> Complex:
        return part.state_space().frequency_response(w)

    def __repr__(self) -> str:
        counts = (self.inputs, "sensor"), (self.outputs, "actuator"), (self.A, "state")
        return f"Controller({self.name!r}: {', '.join(counted(len(part), noun) for part, noun in counts)})"


def controller(
    law: Any, inputs: str | Sequence[str], outputs: str | Sequence[str], name: str = "controller"
) -> Controller:  # fmt: skip
    """Return a user-defined controller.

    Parameters
    ----------
    law : array-like, shape (outputs, inputs), or a state space
        Constant gains, or an object with A, B, C, D, as python-control has them; u = K y, so that one that opposes
        what it measures has a negative gain.
    inputs, outputs : str or sequence of str
        Names of sensors and actuators, in the order of the gains.
    name : str
        Name for tables.

    Returns
    -------
    Controller
        The controller.

    Raises
    ------
    ResponseError
        If shapes do not match the names.
    """
    inputs, outputs = ([names] if isinstance(names, str) else list(names) for names in (inputs, outputs))
    if hasattr(law, "A") and hasattr(law, "D"):
        if getattr(law, "dt", None) not in (None, 0):
            raise ResponseError(f"controller '{name}': it is discrete (dt = {law.dt}); give the continuous one, "
                                f"and sample the closed loop by sampled(rate).")  # fmt: skip
        a, b, c, d = (np.array(getattr(law, part), dtype=float, ndmin=2) for part in "ABCD")
    else:
        d = _gains(law, name)
        a, b, c = np.zeros((0, 0)), np.zeros((0, d.shape[1])), np.zeros((d.shape[0], 0))
    if d.shape != (len(outputs), len(inputs)):
        raise ResponseError(f"controller '{name}': its gain matrix has shape {d.shape}; expected ({len(outputs)}, "
                            f"{len(inputs)}), a row for each actuator and a column for each sensor.")  # fmt: skip
    n = a.size and len(a)
    return Controller(name, a.reshape(n, n), b.reshape(n, len(inputs)), c.reshape(len(outputs), n), d, tuple(inputs),
                      tuple(outputs))  # fmt: skip


def _gains(law: Any, name: str) -> Array:
    if not of_control(law):
        with suppress(ResponseError):
            return np.array(reals(law, name, "gains", "a matrix"), ndmin=2)
    raise ResponseError(f"controller '{name}': it is a {type(law).__name__}; expected a Controller, a state space or "
                        f"transfer function of python-control, or a matrix of real gains.")  # fmt: skip


def as_controller(
    value: Any, plant: Any, sensors: Any = None, actuators: Any = None, name: str | None = None,
    period: float | None = None,
) -> Controller:  # fmt: skip
    """Return a controller from named sensors to named actuators of a plant.

    ``value``: the controller; an array (actuators, sensors) is a static gain. ``sensors``, ``actuators``: names or
    patterns of outputs and inputs of the plant; default: the names that the controller has. ``name``: for tables;
    default: its own. ``period``: sample time [s] that a discrete controller must have; it is converted to the
    continuous controller of which Tustin's rule makes it.
    """
    known = isinstance(value, Controller) or getattr(value, "kind", None) == "state space"
    foreign = is_control(value) or is_transfer_function(value)
    own_inputs, own_outputs = (value.inputs, value.outputs) if known else (None, None)
    if not known and foreign:  # python-control has no dots in names
        own_inputs, own_outputs = _labels(value.input_labels, plant.outputs), _labels(value.output_labels, plant.inputs)
    sensors, actuators = own_inputs if sensors is None else sensors, own_outputs if actuators is None else actuators
    if sensors is None or actuators is None:
        raise ResponseError(_unnamed(value, plant, foreign))
    o = selected(sensors, plant.outputs, "output", plant.name, plant.inputs)
    i = selected(actuators, plant.inputs, "input", plant.name, plant.outputs)
    into, out = tuple([plant.outputs[k] for k in o]), tuple([plant.inputs[k] for k in i])
    for kind, own, given in (("sensors", own_inputs, into), ("actuators", own_outputs, out)):
        if own is not None and tuple(own) != given and sorted(own) == sorted(given):
            raise ResponseError(f"feedback: {kind} are {', '.join(given)}, and the controller has {', '.join(own)}; "
                                f"expected the same order: leave out {kind}=, or rename its signals.")  # fmt: skip
    source_name = value.name if known or (foreign and "[" not in value.name) else None  # not "sys[3]"
    called = name or source_name or "controller"
    if isinstance(value, Controller):
        if value.D.shape != (len(out), len(into)):
            raise ResponseError(f"feedback: {value!r}; expected {len(into)} sensors and {len(out)} actuators: "
                                f"{', '.join(into)}; {', '.join(out)}.")  # fmt: skip
        return replace(value, name=called, inputs=into, outputs=out).for_plant(plant)
    return controller(_continuous(value, period) if foreign else value, into, out, called).for_plant(plant)


def _unnamed(value: Any, plant: Any, foreign: bool) -> str:
    """The refusal of a controller whose signals have no names of the plant."""
    labels = (value.input_labels, value.output_labels) if foreign else ()
    between = f" from {' to '.join(listed(part) for part in labels)}" if foreign else ""
    exchanged = all(map(_labels, labels, (plant.inputs, plant.outputs))) if foreign else False
    hint = " Its inputs and outputs are exchanged: a controller takes outputs of the plant." if exchanged else ""
    return (f"feedback: the controller is a {type(value).__name__}{between}, whose signals do not have the names of "
            f"those of '{plant.name}'; expected sensors=[...] and actuators=[...] beside it, or inputs among "
            f"{listed(plant.outputs)} and outputs among {listed(plant.inputs)}.{hint}")  # fmt: skip


def _continuous(value: Any, period: float | None) -> Any:
    """Equations of python-control in continuous time."""
    step = sample_time(value)
    if step is None:
        return value if is_control(value) else StateSpace.from_control(value)
    if period is None or abs(step - period) > SAME * period:
        expected = "one in continuous time" if period is None else f"{period:g} s as the loop has, or continuous time"
        raise ResponseError(f"feedback: the controller '{value.name}' is discrete, dt = {step:g} s; expected "
                            f"{expected}. system.feedback(controller) takes a discrete one, and makes a sampled loop."
                            )  # fmt: skip
    equations = arguments(value)
    a, b, c, d = (np.array(equations[label], dtype=float, ndmin=2) for label in "ABCD")
    if not regular(-a):
        raise ResponseError(f"feedback: the controller '{value.name}' has a pole at z = -1; expected poles below half "
                            f"the sampling rate.")  # fmt: skip
    return StateSpace.from_arrays(**equations | dict(zip("ABCD", inverse_tustin(a, b, c, d, step), strict=True)))


def _labels(labels: Sequence[str], known: Sequence[str]) -> list[str] | None:
    """Names of signals of python-control as they are here, None if one is unknown."""
    renamed = [label if label in known else label.replace(":", ".") for label in labels]
    return renamed if all(name in known for name in renamed) else None


def integrators(
    name: str, gains: ArrayLike, inputs: Sequence[str], outputs: Sequence[str], leak: float = 0.0
) -> Controller:
    """Return u = gains / (s + leak) y.

    ``gains`` (outputs, inputs). ``leak``: corner frequency [rad/s], below which they do not integrate.
    """
    matrix = np.array(gains, dtype=float, ndmin=2)
    if not 0.0 <= leak < np.inf:
        raise ResponseError(f"{name}: leak = {leak!r}; expected a corner frequency, no less than 0 [rad/s].")
    n = len(inputs)
    return Controller(name, -leak * np.eye(n), np.eye(n), matrix, np.zeros((len(outputs), n)), tuple(inputs),
                      tuple(outputs))  # fmt: skip


def combined(controllers: Sequence[Controller], sensors: tuple[str, ...], actuators: tuple[str, ...]) -> Controller:
    """Return one controller, from all ``sensors`` to all ``actuators``, that does what several do."""
    a = block_diag(*[part.A for part in controllers])
    b, c = np.zeros((len(a), len(sensors))), np.zeros((len(actuators), len(a)))
    d, start = np.zeros((len(actuators), len(sensors))), 0
    for part in controllers:
        states = slice(start, start + len(part.A))
        into, out = [sensors.index(name) for name in part.inputs], [actuators.index(name) for name in part.outputs]
        b[states, into], c[out, states] = part.B, part.C
        d[np.ix_(out, into)] += part.D
        start += len(part.A)
    return Controller(" + ".join(part.name for part in controllers), a, b, c, d, sensors, actuators)
