"""Structures of controllers for ``mv.tune``: gains, PID, lead-lag, notch, state space, and their combinations.

Sensors are outputs and actuators inputs of the plant, by name; u = K y is added, so that what opposes a motion has a
negative gain.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from mbsvib.common import arguments as check
from mbsvib.common.expected import one_of
from mbsvib.common.selection import Names, united
from mbsvib.errors import ModelError, ResponseError
from mbsvib.tuning.parts import Gain, LeadLag, Notch, Pid, Space
from mbsvib.tuning.structures import Part, Sum, Tunable, as_tunable, port_names

Given = Mapping[str, Any] | None

__all__ = ["diagonal", "gain", "lead_lag", "notch", "pid", "state_space"]
__dir__ = __all__.copy


def _part(form: type[Part], outputs: Names, inputs: Names, name: str | None, start: Given, bounds: Given,
          **more: Any) -> Part:  # fmt: skip
    who = f"tunable.{form.kind}"
    for argument, value in (("start", start), ("bounds", bounds)):
        if value is not None and not isinstance(value, Mapping):
            raise check.refuse(who, argument, value, "a mapping from symbols of values")
    ports = port_names(outputs, who, "outputs"), port_names(inputs, who, "inputs")
    known = None if name is None else check.name(name, who)
    return form(*ports, known, dict(start or {}), dict(bounds or {}), **more)


def gain(
    outputs: Names, inputs: Names, *, name: str | None = None, start: Given = None, bounds: Given = None
) -> Tunable:
    """Return a matrix of constant gains.

    u = D y

    Parameters
    ----------
    outputs, inputs : str or sequence of str
        Names or patterns of actuators and of sensors.
    name : str, optional
        First part of the names of the values; parts of the same name share them. Default: "ACTUATOR/SENSOR".
    start, bounds : mapping, optional
        Initial values and bounds (lowest, highest) by symbol: "gain", of a matrix also "gain[row,column]".

    Returns
    -------
    Tunable
        Values "NAME.gain" [unit of the actuator per unit of the sensor].

    Raises
    ------
    ModelError
        If names or bounds are invalid.
    """
    return _part(Gain, outputs, inputs, name, start, bounds)


def pid(
    outputs: Names, inputs: Names, *, terms: str = "pid", name: str | None = None, start: Given = None,
    bounds: Given = None,
) -> Tunable:  # fmt: skip
    """Return a proper PID controller from one sensor to one actuator.

    K = kp + ki / s + kd s / (tau s + 1)

    Parameters
    ----------
    outputs, inputs : str
        Names of the actuator and of the sensor.
    terms : str
        Which of "p", "i" and "d" there are.
    name : str, optional
        As of ``gain``.
    start, bounds : mapping, optional
        As of ``gain``, by "kp", "ki", "kd" and "tau"; tau [s] is positive.

    Returns
    -------
    Tunable
        A controller of a given structure.

    Raises
    ------
    ModelError
        If names, terms or bounds are invalid.
    ResponseError
        If there are several actuators or sensors.
    """
    if not isinstance(terms, str) or not terms or set(terms) - set("pid") or len(set(terms)) < len(terms):
        raise check.refuse("tunable.pid", "terms", terms, 'some of the letters of "pid"')
    return _part(Pid, outputs, inputs, name, start, bounds, terms=terms)


def lead_lag(
    outputs: Names, inputs: Names, *, name: str | None = None, start: Given = None, bounds: Given = None
) -> Tunable:
    """Return a lead or lag from one sensor to one actuator.

    K = gain (s / zero + 1) / (s / pole + 1)

    Parameters
    ----------
    outputs, inputs : str
        Names of the actuator and of the sensor.
    name : str, optional
        As of ``gain``.
    start, bounds : mapping, optional
        As of ``gain``, by "gain", "zero" and "pole"; the latter are positive [rad/s].

    Returns
    -------
    Tunable
        A controller of a given structure.

    Raises
    ------
    ModelError
        If names or bounds are invalid.
    ResponseError
        If there are several actuators or sensors.
    """
    return _part(LeadLag, outputs, inputs, name, start, bounds)


def notch(
    outputs: Names, inputs: Names, *, name: str | None = None, start: Given = None, bounds: Given = None
) -> Tunable:
    """Return a notch from one sensor to one actuator; most often a factor of another controller.

    K = (s^2 + 2 depth w s + w^2) / (s^2 + 2 width w s + w^2),  w = frequency

    Parameters
    ----------
    outputs, inputs : str
        Names of the actuator and of the sensor.
    name : str, optional
        As of ``gain``.
    start, bounds : mapping, optional
        As of ``gain``, by "frequency" [rad/s], "depth" and "width", all positive.

    Returns
    -------
    Tunable
        A controller of a given structure.

    Raises
    ------
    ModelError
        If names or bounds are invalid.
    ResponseError
        If there are several actuators or sensors.
    """
    return _part(Notch, outputs, inputs, name, start, bounds)


def state_space(
    order: int, outputs: Names, inputs: Names, structure: str = "full", *, feedthrough: bool = True,
    name: str | None = None, start: Given = None, bounds: Given = None,
) -> Tunable:  # fmt: skip
    """Return a controller of a given number of states.

    x' = A x + B y,  u = C x + D y

    Parameters
    ----------
    order : int
        Number of states k.
    outputs, inputs : str or sequence of str
        Names or patterns of actuators and of sensors.
    structure : str
        "full": all entries of A are values. "modal": A has oscillators [0 w; -w -2 damping w] and, of an odd order, one
        real pole. "diagonal": A has real poles. Both are stable controllers; of one sensor B follows from A.
    feedthrough : bool
        Whether there is D.
    name : str, optional
        As of ``gain``.
    start, bounds : mapping, optional
        As of ``gain``, by "A[row,column]", "frequency[k]", "damping[k]", "pole[k]", "B", "C", "D"; frequencies and
        poles are positive [rad/s].

    Returns
    -------
    Tunable
        A controller of a given structure.

    Raises
    ------
    ModelError
        If the order is not a number of states, or the structure, names or bounds are invalid.
    """
    one_of(structure, ("full", "modal", "diagonal"), "tunable.state_space", "structure", ModelError)
    return _part(Space, outputs, inputs, name, start, bounds,
                    order=check.count(order, "tunable.state_space", "order", 1), structure=structure,
                    feedthrough=bool(feedthrough))  # fmt: skip


def diagonal(controllers: Sequence[Any]) -> Tunable:
    """Return decentral controllers side by side.

    K = diag(K1, K2, ...)

    Parameters
    ----------
    controllers : sequence of Tunable, Controller or StateSpace
        Each with actuators and sensors of its own. Those of one ``name=`` share their values.

    Returns
    -------
    Tunable
        From all sensors to all actuators.

    Raises
    ------
    ModelError
        If there is none.
    ResponseError
        If two have the same actuator or sensor.
    """
    if isinstance(controllers, (str, Mapping)) or not isinstance(controllers, Sequence) or not controllers:
        raise check.refuse("tunable.diagonal", "controllers", controllers, "a list of controllers")
    parts = tuple([as_tunable(part) for part in controllers])
    for kind, names in (("actuator", [part.outputs for part in parts]), ("sensor", [part.inputs for part in parts])):
        if len(united(*names)) < sum(map(len, names)):
            repeated = [name for group in names for name in group]
            first = next(name for name in repeated if repeated.count(name) > 1)
            raise ResponseError(f"tunable.diagonal: two controllers have the {kind} '{first}'; expected different "
                                f"ones. K1 + K2 adds controllers that share signals.")  # fmt: skip
    return Sum(parts)
