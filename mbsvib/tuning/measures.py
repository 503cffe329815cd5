"""What goals of ``mv.tune`` measure: norms that are minimised or limited, damping, margins and roll-off."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, ClassVar
from warnings import catch_warnings, simplefilter

import numpy as np

from mbsvib.common.arrays import Array, Complex
from mbsvib.common.display import Displayed
from mbsvib.common.selection import needed_ports
from mbsvib.errors import OutsideTableWarning
from mbsvib.feedback.margins import modulus_margin
from mbsvib.random.budget import random
from mbsvib.random.moments import Equations
from mbsvib.random.slopes import gradient as square_gradient
from mbsvib.random.slopes import stable_squares
from mbsvib.responses.densities import Table
from mbsvib.responses.norms import Norm, RoundingError
from mbsvib.responses.norms import hinf as highest
from mbsvib.tuning.peaks import Weight, apply, peak, structured_peak, structured_slope
from mbsvib.tuning.scene import Loop, Scene

# of a loop and of known frequencies of peaks: the value, and a function that returns its gradient to [A B; C D]
Measure = Callable[[Loop, Sequence[float]], tuple[float, Callable[[], Array]]]

VIBRATES = 1e-9  # share of the magnitude of a pole, above which an imaginary part is a vibration
BEYOND = 1e3  # last frequency [Hz] of a mean square by quadrature, over the highest pole [rad/s]
SPAN = 1e3  # a roll-off is asked for from its frequency up to so many times it


class Goal(Displayed, ABC):
    """What a controller is to reach, named by its ``label``: a value that is minimised times a ``weight``, or one with
    a ``limit``, from above or, where it is the ``least``, from below.
    """

    _engine = "at least of rated reached"

    weight: float = 1.0
    limit: float | None = None
    least: ClassVar[bool] = False

    @property
    def label(self) -> str:
        """The goal in words."""
        words = self._words()
        return words if self.limit is None else f"{words} {'>=' if self.least else '<='} {self.limit:g}"

    @abstractmethod
    def _words(self) -> str:
        """What is measured."""

    @abstractmethod
    def at(self, scene: Scene) -> Measure:
        """Return the measure of the value at a plant."""

    @abstractmethod
    def of(self, loop: Any) -> Norm:
        """Return the value of a closed loop that the library computes anew, and the frequency of its peak if any."""

    def rated(self, value: float) -> tuple[float, float]:
        """Return the weighted value or, at most 0 where the limit holds, its violation, with the rate of change."""
        if self.limit is None:
            return self.weight * value, self.weight
        rate = (-1.0 if self.least else 1.0) / self.limit
        return rate * (value - self.limit), rate

    def reached(self, value: float) -> bool | None:
        """Return whether a value is within the limit, None where it is minimised."""
        if self.limit is None:
            return None
        return bool(value >= self.limit if self.least else value <= self.limit)


@dataclass(frozen=True, repr=False)
class Hinf(Goal):
    """The H-infinity norm from some inputs to some outputs, behind a weight over frequency if there is one."""

    outputs: Any
    inputs: Any
    weight: float = 1.0
    limit: float | None = None
    shape: Weight | None = None

    def _words(self) -> str:
        return f"hinf {_text(self.outputs)} / {_text(self.inputs)}{', weighted' if self.shape else ''}"

    def _shape(self, linear: Any) -> Weight | None:
        if self.shape is None:
            return None
        part = linear.with_ports(self.outputs, None)
        return self.shape.for_outputs(part.outputs, part.output_units)

    def at(self, scene: Scene) -> Measure:
        inputs = scene.system.inputs if self.inputs is None else self.inputs
        ports = needed_ports(self.outputs, inputs, (scene.system.outputs, scene.ports.inputs), scene.system.name)
        return _peak(*ports, self._shape(scene.system))

    def of(self, loop: Any) -> Norm:
        """Return the norm on panels."""
        inputs = loop.plant.source.inputs if self.inputs is None else self.inputs
        shape = self._shape(loop)
        if shape is None:
            norm: Norm = loop.hinf_norm(self.outputs, inputs)
            return norm
        part = loop.with_ports(self.outputs, inputs)
        return _weighted(part.frequency_response, shape, loop.poles(), part.state_space().D)


def _peak(outputs: list[int], inputs: list[int], shape: Weight | None = None, less: bool = False) -> Measure:
    def measure(loop: Loop, known: Sequence[float]) -> tuple[float, Callable[[], Array]]:
        response = loop.response(outputs, inputs, shape, less)
        value, w = peak(response, known)
        return value, lambda: loop.within(response.slope(w), outputs, inputs)

    return measure


def _weighted(response: Callable[[Array], Complex], shape: Weight, poles: Complex, direct: Array) -> Norm:
    """The highest peak of W times a response (outputs, inputs, n)."""
    far = apply(shape.at(np.array([np.inf])), direct[None])[0]
    return highest(lambda w: apply(shape.at(w), response(w).transpose(2, 0, 1)).transpose(1, 2, 0),
                   np.concatenate((poles, shape.poles)), far, shape.marks, shape.span)  # fmt: skip


@dataclass(frozen=True, repr=False)
class Rms(Goal):
    """The root mean square of outputs under noise, of several the root of the sum of their squares."""

    outputs: Any
    floor: Any
    weight: float = 1.0
    band: Any = None
    correlation: Any = None
    weighting: Any = None
    limit: float | None = None

    def _words(self) -> str:
        return f"rms {_text(self.outputs)}"

    def at(self, scene: Scene) -> Measure:
        known = random(scene.ports, self.floor, self.outputs, self.band, self.correlation, self.weighting)
        inputs = [scene.ports.inputs.index(name) for name in known.sources.names]
        outputs = [scene.ports.outputs.index(name) for name in known.outputs]
        exact = known.exact and not any(weight is not None and weight.window is not None for weight in known.weights)

        def measure(loop: Loop, _: Sequence[float]) -> tuple[float, Callable[[], Array]]:
            (a, b, c, d), rate = loop.part(outputs, inputs), loop.scene.rate
            own, n = Equations(a * rate, b * rate, c, d), len(a)
            if exact:
                square, to_square = stable_squares(known, own)
            else:
                under = replace(known, linear=replace(
                    known.linear, A=own.a, B=own.b, C=c, D=d, states=tuple([f"x{k}" for k in range(n)]),
                    state_units=("",) * n, transform=np.zeros((0, n))))  # fmt: skip
                square = float(under.mean_squares().total.sum())

                def to_square() -> Array:
                    return np.asarray(sum(square_gradient(under, own, row) for row in range(len(c))))

            value = float(np.sqrt(square))

            def slope() -> Array:
                result = to_square() * (0.5 / value)
                result[:n] *= rate
                return loop.within(result, outputs, inputs)

            return value, slope

        return measure

    def of(self, loop: Any) -> Norm:
        """Return the root mean square by the budget; by quadrature where moments lose their digits to fast poles."""
        ask = partial(loop.rms, self.outputs, self.floor, correlation=self.correlation, weighting=self.weighting)
        try:
            values = ask(band=self.band)
        except RoundingError:
            with catch_warnings():
                simplefilter("ignore", OutsideTableWarning)  # tables end where they end
                values = ask(band=(0.0, BEYOND * float(np.abs(loop.poles()).max(initial=1.0))))
        return Norm(float(np.sqrt(np.sum(np.square(list(values.values()))))))


@dataclass(frozen=True, repr=False)
class Damping(Goal):
    """A least damping ratio of all poles that vibrate."""

    limit: float
    least: ClassVar[bool] = True

    def _words(self) -> str:
        return "damping"

    def at(self, scene: Scene) -> Measure:
        return _damping

    def of(self, loop: Any) -> Norm:
        """Return the least damping ratio of the poles that vibrate, 1 if none does."""
        return Norm(float(loop.damping_ratios.min(initial=1.0)))


def _damping(loop: Loop, _: Sequence[float]) -> tuple[float, Callable[[], Array]]:
    def ratios(poles: Complex) -> Array:
        size = np.abs(poles)
        return np.where(np.abs(poles.imag) > VIBRATES * size, -poles.real / np.where(size > 0.0, size, 1.0), 1.0)

    def slope() -> Array:
        pole, change = loop.pole_slope(lambda poles: int(ratios(poles).argmin()))
        a, b = pole.real, pole.imag
        change = change * (-(b**2) - 1j * a * b) / abs(pole) ** 3  # Re: -b^2 da + a b db
        return loop.within(change.real * float(value < 1.0), [], [])

    value = float(ratios(loop.eigen[0]).min(initial=1.0))
    return value, slope


@dataclass(frozen=True, repr=False)
class Margin(Goal):
    """A least modulus margin of all loops simultaneously."""

    limit: float
    least: ClassVar[bool] = True

    def _words(self) -> str:
        return "margin"

    def at(self, scene: Scene) -> Measure:
        ports = scene.commands, scene.driven

        def measure(loop: Loop, known: Sequence[float]) -> tuple[float, Callable[[], Array]]:
            response = loop.response(*ports, None, less=False)
            value, w = structured_peak(response, known)
            return 1.0 / value, lambda: loop.within(-structured_slope(response, w) / value**2, *ports)

        return measure

    def of(self, loop: Any) -> Norm:
        """Return the modulus margin."""
        modulus, frequency = modulus_margin(loop)
        return Norm(modulus, omega=2.0 * np.pi * frequency)


@dataclass(frozen=True, repr=False)
class Rolloff(Goal):
    """A roll-off of the loops by so many dB a decade, from a frequency [Hz] on."""

    frequency: float
    decibels: float
    limit: float = 1.0

    def _words(self) -> str:
        return f"roll-off {self.decibels:g} dB/decade from {self.frequency:g} Hz"

    @property
    def shape(self) -> Weight:
        """The weight of the complementary sensitivity, straight on log-log axes."""
        f = self.frequency * np.array([1.0, SPAN])
        return Weight(None, Table(f, (f / self.frequency) ** (self.decibels / 20.0)))

    def at(self, scene: Scene) -> Measure:
        return _peak(scene.commands, scene.driven, self.shape, less=True)

    def of(self, loop: Any) -> Norm:
        """Return the highest peak of the weighted complementary sensitivity, S L, on panels."""
        def response(w: Array) -> Complex:
            return np.asarray(np.einsum("ijn,jkn->ikn", loop.sensitivity(w), loop.loop_gain(w)))

        return _weighted(response, self.shape, loop.poles(), np.zeros((len(loop.actuators),) * 2))


def _text(names: Any) -> str:
    return "all" if names is None else names if isinstance(names, str) else ", ".join(map(str, names))
