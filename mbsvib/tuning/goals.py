"""Goals of ``mv.tune``: norms that are minimised, and limits of damping and margins."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.display import Displayed
from mbsvib.common.selection import needed_ports
from mbsvib.errors import ResponseError
from mbsvib.random.budget import random
from mbsvib.random.moments import Equations
from mbsvib.random.slopes import gradient as square_gradient
from mbsvib.random.slopes import stable_squares
from mbsvib.responses.state_space import StateSpace
from mbsvib.tuning.peaks import peak, peak_gradient

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from mbsvib.common.arrays import Array
    from mbsvib.common.selection import Names
    from mbsvib.random.sources import Correlation
    from mbsvib.responses.norms import Norm
    from mbsvib.tuning.scene import Loop, Scene

    Measured = tuple[float, Callable[[], Array]]

__all__ = ["damping", "hinf", "margin", "rms"]

VIBRATES = 1e-9  # share of the magnitude of a pole, above which an imaginary part is a vibration


class Goal(Displayed, ABC):
    """What a controller is to reach; ``label`` names it in tables."""

    limit: ClassVar[bool] = False
    weight: float = 1.0

    @property
    @abstractmethod
    def label(self) -> str:
        """The goal in words."""

    @abstractmethod
    def at(self, scene: Scene) -> Bound:
        """Return the goal at a plant."""

    @abstractmethod
    def of(self, loop: Any) -> float:
        """Return the value of a closed loop that the library computes anew."""

    def reached(self, value: float) -> bool | None:
        """Return whether a value is within the limit, None where it is minimised."""
        return None


class Bound(ABC):
    """A goal at a plant: weighted values that are minimised, or violations of limits, at most 0 where they hold."""

    noise: bool = False
    rate: float = 1.0

    @abstractmethod
    def measure(self, loop: Loop) -> Measured:
        """Return the number, and a function that returns its gradient to [A B; C D] of the loop."""

    def remember(self, loop: Any) -> None:  # noqa: B027
        """Remember where the library finds the peak of the closed loop."""


@dataclass(frozen=True, repr=False)
class Hinf(Goal):
    """The H-infinity norm from some inputs to some outputs."""

    outputs: Any
    inputs: Any
    weight: float = 1.0

    @property
    def label(self) -> str:
        """The norm and its ports."""
        return f"hinf {_text(self.outputs)} / {_text(self.inputs)}"

    def at(self, scene: Scene) -> Bound:
        """Return the norm at a plant."""
        inputs = scene.system.inputs if self.inputs is None else self.inputs
        ports = needed_ports(self.outputs, inputs, (scene.system.outputs, scene.inputs), scene.system.name)
        return _HinfAt(self, *ports, len(scene.system.inputs))

    def of(self, loop: Any) -> float:
        """Return the norm on panels."""
        return float(self.norm(loop).value)

    def norm(self, loop: Any) -> Norm:
        """Return the norm of a closed loop of the library."""
        norm: Norm = loop.hinf_norm(self.outputs, loop.plant.source.inputs if self.inputs is None else self.inputs)
        return norm


class _HinfAt(Bound):
    def __init__(self, goal: Hinf, outputs: list[int], inputs: list[int], own: int) -> None:
        self.goal, self.outputs, self.inputs = goal, outputs, inputs
        self.noise = any(k >= own for k in inputs)
        self.remembered: list[float] = []

    def measure(self, loop: Loop) -> Measured:
        return _peak(loop, self.outputs, self.inputs, self.remembered, self.goal.weight)

    def remember(self, loop: Any) -> None:
        self.remembered.append(float(self.goal.norm(loop).omega or 0.0) / self.rate)


def _peak(loop: Loop, outputs: list[int], inputs: list[int], remembered: list[float], weight: float) -> Measured:
    response = loop.response(outputs, inputs)
    value, w = peak(response, remembered)
    return weight * value, lambda: loop.within(weight * peak_gradient(response, w)[1], outputs, inputs)


@dataclass(frozen=True, repr=False)
class Rms(Goal):
    """The root mean square of outputs under noise, of several the root of the sum of their squares."""

    outputs: Any
    floor: Any
    weight: float = 1.0
    band: Any = None
    correlation: Any = None
    weighting: Any = None

    @property
    def label(self) -> str:
        """The outputs."""
        return f"rms {_text(self.outputs)}"

    def at(self, scene: Scene) -> Bound:
        """Return the root mean square at a plant."""
        return _RmsAt(self, scene)

    def of(self, loop: Any) -> float:
        """Return the root mean square by the budget."""
        values = loop.rms(self.outputs, self.floor, self.band, self.correlation, self.weighting).values()
        return float(np.sqrt(np.sum(np.square(list(values)))))


class _RmsAt(Bound):
    def __init__(self, goal: Rms, scene: Scene) -> None:
        o, i, system = len(scene.system.outputs), len(scene.inputs), scene.system
        template = replace(StateSpace.from_arrays(-np.eye(1), np.zeros((1, i)), np.zeros((o, 1)), np.zeros((o, i)),
                                                  inputs=scene.inputs, outputs=system.outputs, name=system.name),
                           input_units=scene.input_units, output_units=system.output_units)  # fmt: skip
        self.goal = goal
        self.under = random(template, goal.floor, goal.outputs, goal.band, goal.correlation, goal.weighting)
        names = self.under.sources.names
        self.inputs = [scene.inputs.index(name) for name in names]
        self.outputs = [system.outputs.index(name) for name in self.under.outputs]
        self.noise = any(k >= len(system.inputs) for k in self.inputs)

    def measure(self, loop: Loop) -> Measured:
        (a, b, c, d), rate = loop.closed, loop.scene.rate
        b, c, d = b[:, self.inputs] * rate, c[self.outputs], d[np.ix_(self.outputs, self.inputs)]
        linear = replace(self.under.linear, A=a * rate, B=b, C=c, D=d, states=tuple([f"x{k}" for k in range(len(a))]),
                         state_units=("",) * len(a), transform=np.zeros((0, len(a))))  # fmt: skip
        under, own = replace(self.under, linear=linear), Equations(a * rate, b, c, d)
        if under.exact and not any(weight is not None and weight.window is not None for weight in under.weights):
            square, to_square = stable_squares(under, own)
        else:
            square = float(under.mean_squares().total.sum())

            def to_square() -> Array:
                return np.asarray(sum(square_gradient(under, own, row) for row in range(len(c))))

        value = float(np.sqrt(square))

        def slope() -> Array:
            result = to_square() * (0.5 * self.goal.weight / value)
            result[: len(a)] *= rate
            return loop.within(result, self.outputs, self.inputs)

        return self.goal.weight * value, slope


@dataclass(frozen=True, repr=False)
class Damping(Goal):
    """A least damping ratio of all poles that vibrate."""

    least: float
    limit: ClassVar[bool] = True

    @property
    def label(self) -> str:
        """The limit."""
        return f"damping >= {self.least:g}"

    def at(self, scene: Scene) -> Bound:
        """Return the limit at a plant."""
        return _DampingAt(self.least)

    def of(self, loop: Any) -> float:
        """Return the least damping ratio of the poles that vibrate, 1 if none does."""
        return float(loop.damping_ratios.min(initial=1.0))

    def reached(self, value: float) -> bool:
        """Return whether the damping ratio is large enough."""
        return value >= self.least


class _DampingAt(Bound):
    def __init__(self, least: float) -> None:
        self.least = least

    def measure(self, loop: Loop) -> Measured:
        poles = loop.eigen[0]
        size = np.abs(poles)
        ratio = np.where(np.abs(poles.imag) > VIBRATES * size, -poles.real / np.where(size > 0.0, size, 1.0), 1.0)
        k = int(ratio.argmin())

        def slope() -> Array:
            a, b, cube = poles[k].real, poles[k].imag, size[k] ** 3
            change = ((-(b**2) - 1j * a * b) / cube) * loop.pole_slope(k)  # Re: -b^2 da + a b db
            return loop.within(-change.real / self.least, [], []) if ratio[k] < 1.0 else loop.within(
                np.zeros_like(loop.closed[0]), [], [])  # fmt: skip

        return 1.0 - float(ratio[k]) / self.least, slope


@dataclass(frozen=True, repr=False)
class Margin(Goal):
    """A least modulus margin of all loops simultaneously."""

    least: float
    limit: ClassVar[bool] = True

    @property
    def label(self) -> str:
        """The limit."""
        return f"margin >= {self.least:g}"

    def at(self, scene: Scene) -> Bound:
        """Return the limit at a plant."""
        return _MarginAt(self.least, scene.commands, scene.driven)

    def of(self, loop: Any) -> float:
        """Return the modulus margin."""
        return float(loop.margins().modulus)

    def reached(self, value: float) -> bool:
        """Return whether the margin is large enough."""
        return value >= self.least


class _MarginAt(Bound):
    def __init__(self, least: float, commands: list[int], driven: list[int]) -> None:
        self.least, self.commands, self.driven = least, commands, driven
        self.remembered: list[float] = []

    def measure(self, loop: Loop) -> Measured:
        value, slope = _peak(loop, self.commands, self.driven, self.remembered, 1.0)
        return 1.0 - 1.0 / (self.least * value), lambda: slope() / (self.least * value**2)

    def remember(self, loop: Any) -> None:
        self.remembered.append(2.0 * np.pi * loop.margins().frequency / self.rate)


def _text(names: Any) -> str:
    return "all" if names is None else names if isinstance(names, str) else ", ".join(map(str, names))


def hinf(outputs: Names = None, inputs: Names = None, weight: float = 1.0) -> Goal:
    """Return the goal of a small H-infinity norm: the highest peak of the largest singular value.

    weight max over w of sigma(G(i w))

    Parameters
    ----------
    outputs, inputs : str or sequence of str, optional
        Names or patterns of ports of the loop; inputs may be noise, "SENSOR.noise" and "ACTUATOR.noise". Default: all
        outputs, and all inputs that are not noise.
    weight : float
        Factor, by which goals are compared.

    Returns
    -------
    Goal
        For ``mv.tune``, which minimises the largest of all weighted norms.

    Raises
    ------
    ModelError
        If the weight is not positive.
    """
    return Hinf(outputs, inputs, _positive(weight, "hinf", "weight"))


def rms(
    outputs: Names, floor: Mapping[str, Any], weight: float = 1.0, band: Iterable[float] | None = None,
    correlation: Correlation = None, weighting: Any = None,
) -> Goal:  # fmt: skip
    """Return the goal of a small root mean square under noise.

    weight sqrt(sum over outputs of E[y^2])

    Parameters
    ----------
    outputs : str or sequence of str
        Names or patterns.
    floor : mapping of str to density
        One-sided densities at inputs [unit^2/Hz] by name or pattern, as of ``system.rms``; also of "SENSOR.noise" and
        "ACTUATOR.noise".
    weight : float
        Factor, by which goals are compared.
    band : (float, float), optional
        First and last frequency [Hz].
    correlation, weighting : optional
        As of ``system.rms``.

    Returns
    -------
    Goal
        For ``mv.tune``, which minimises the largest of all weighted norms.

    Raises
    ------
    ModelError
        If the weight is not positive.
    """
    return Rms(outputs, floor, _positive(weight, "rms", "weight"), band, correlation, weighting)


def damping(least: float) -> Goal:
    """Return the limit that all poles of the loop that vibrate have a damping ratio.

    -Re(s) / |s| >= least

    Parameters
    ----------
    least : float
        Damping ratio, from 0 to 1.

    Returns
    -------
    Goal
        A limit for ``mv.tune``.

    Raises
    ------
    ModelError
        If it is no damping ratio.
    """
    return Damping(_share(least, "damping"))


def margin(least: float) -> Goal:
    """Return the limit that the loops have a modulus margin, all of them simultaneously.

    1 / (max over w of sigma((1 - K G)^-1)) >= least, at the actuators

    Parameters
    ----------
    least : float
        Distance from the critical point, from 0 to 1.

    Returns
    -------
    Goal
        A limit for ``mv.tune``.

    Raises
    ------
    ModelError
        If it is no margin that a loop can have.
    """
    return Margin(_share(least, "margin"))


def _positive(value: Any, who: str, field: str) -> float:
    if not (number := check.number(value, f"goals.{who}", field)) > 0.0:
        raise check.refuse(f"goals.{who}", field, value, "a positive number")
    return number


def _share(value: Any, who: str) -> float:
    number = check.number(value, f"goals.{who}", "least")
    if not 0.0 < number < 1.0:
        raise check.refuse(f"goals.{who}", "least", value, "a number between 0 and 1")
    return number


def as_goals(goals: Any) -> tuple[Goal, ...]:
    """Return goals as a tuple."""
    several = (goals,) if isinstance(goals, Goal) else tuple(goals) if isinstance(goals, (list, tuple)) else ()
    if not several or not all(isinstance(goal, Goal) for goal in several):
        raise ResponseError(f"tune: goals = {check.shown(goals)}; expected a list of what mv.goals makes, such as "
                            f"[mv.goals.hinf('x', 'F')].")  # fmt: skip
    return several
