"""Design points: systems, or plants around them, at points of a study; numbers with their derivatives there."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.api.model import Model
from mbsvib.api.system import System
from mbsvib.common.arrays import Array, Complex, Index
from mbsvib.common.expected import angular, kind_of
from mbsvib.errors import MbsvibError, ModelError
from mbsvib.feedback.loop import Loop
from mbsvib.linalg.matching import Station, upper
from mbsvib.modes import Modes
from mbsvib.sensitivities.variables import variables as resolved
from mbsvib.studies.derivatives import Derivatives, Differences, OfLoop, OfSystem
from mbsvib.studies.plants import GAIN_STEP, Plant, Systems

STEP = 1e-4  # of differences, in parts of a variable: close resonances allow no larger one, rounding no smaller one
SMOOTH = 1e-3  # share by which differences of second and of fourth order of smooth matrices differ at most


@dataclass(frozen=True, slots=True, eq=False)
class Dual:
    """Numbers ``value`` (k,) with their derivatives ``slope`` (k, n)."""

    value: Array
    slope: Array

    def __add__(self, right: Dual) -> Dual:
        return Dual(self.value + right.value, self.slope + right.slope)

    def __neg__(self) -> Dual:
        return Dual(-self.value, -self.slope)

    def __sub__(self, right: Dual) -> Dual:
        return self + -right

    def __mul__(self, right: Dual) -> Dual:
        slope = self.value[:, None] * right.slope + right.value[:, None] * self.slope
        return Dual(self.value * right.value, slope)

    def __truediv__(self, right: Dual) -> Dual:
        return self * right.through(lambda x: 1.0 / x, lambda x: -1.0 / x**2)

    def __pow__(self, power: float) -> Dual:
        return self.through(lambda x: x**power, lambda x: power * x ** (power - 1.0))

    def __getitem__(self, which: Any) -> Dual:
        return Dual(np.atleast_1d(self.value[which]), np.atleast_2d(self.slope[which]))

    def log(self) -> Dual:
        """Return the natural logarithm of each number."""
        return self.through(np.log, lambda x: 1.0 / x)

    def sum(self) -> Dual:
        """Return the sum of all numbers, as one."""
        return Dual(self.value.sum(keepdims=True), self.slope.sum(axis=0, keepdims=True))

    def through(self, function: Callable[[Array], Array], rate: Callable[[Array], Array]) -> Dual:
        """Return a function of each number, by its derivative."""
        with np.errstate(divide="ignore", invalid="ignore"):  # the caller refuses values that are not finite
            return Dual(function(self.value), rate(self.value)[:, None] * self.slope)


def stacked(*duals: Dual) -> Dual:
    """Return all numbers concatenated; constants may have derivatives (k, 1)."""
    width = next((dual.slope.shape[1] for dual in duals if dual.slope.shape[1] != 1), 1)
    slopes = [np.broadcast_to(dual.slope, (len(dual.value), width)) for dual in duals]
    return Dual(np.concatenate([dual.value for dual in duals]), np.concatenate(slopes))


@dataclass(frozen=True)
class DesignPoint:
    """A system, or the plant around it, and its variables (``rates`` of parameters with each). ``scale`` (variables,)
    converts derivatives with respect to variables to those with respect to the unknowns of a search, ``levels`` are
    bounds that replace the largest of many numbers, ``order`` is the mode number of each track. ``equations`` are None
    where no quantity of the study asks for the system; ``changed`` is the model at these values, None where it is that
    of the system. ``systems`` are those of a study with a plant around them, or with joints that are displaced, None of
    others; differences take a small part of the ``sizes`` (variables,) of the variables.
    """

    equations: Any
    rates: Mapping[str, Mapping[str, float]]
    values: Mapping[str, float]
    scale: Array
    levels: Mapping[Hashable, float]
    order: Index | None = None
    changed: Model | None = None
    systems: Systems | None = None
    sizes: Array | None = None

    @classmethod
    def of(
        cls, system: Any, variables: str | Iterable[str] | Mapping[str, Mapping[str, float]], equations: bool = True
    ) -> DesignPoint:
        """Return a single system with derivatives to some variables; a model if no equations are requested."""
        model = system if not equations and kind_of(system) == "model" else None
        equations_of = None if model is not None else linear(system)
        if isinstance(variables, Mapping):
            return cls(equations_of, variables, {}, np.ones(len(variables)), {}, changed=model)
        names = [variables] if isinstance(variables, str) else list(variables)
        known: Any = (system.plant.source if kind_of(system) == "closed loop" else system).parameters if names else {}
        values = {name: known[known.matching(name)[0]] for name in names}
        return cls(equations_of, {name: {name: 1.0} for name in names}, values, np.ones(len(names)), {}, changed=model)

    @classmethod
    def at(
        cls, systems: Systems, values: Mapping[str, float], scale: Array, sizes: Array, equations: bool = True
    ) -> DesignPoint:
        """Return the point of a study at values of its variables; ``sizes`` (variables,) are those of the variables."""
        rates = systems.design.rates(values)
        if not equations:
            return cls(None, rates, values, scale, {}, changed=systems.described(values))
        system = checked(systems.at(values))
        around = systems if systems.plant.function is not None or systems.design.pose else None
        return cls(system, rates, values, scale, {}, systems=around, sizes=sizes)

    @cached_property
    def system(self) -> Any:
        """The equations of motion, or the plant."""
        return linear(self.equations if self.systems is None else self.systems.plant(self.equations, self.values))

    @property
    def model(self) -> Model:
        """The mechanism."""
        source = getattr(getattr(self.equations, "plant", None), "source", self.equations)  # of loops: the mechanism
        origin = getattr(getattr(source, "provenance", None), "origin", None) if self.changed is None else self.changed
        if origin is None:
            raise ModelError("quantities of cycles are those of a model; a system that no model was linearized to has "
                             "none.", element="system")  # fmt: skip
        return origin

    def with_levels(self, levels: Mapping[Hashable, float]) -> DesignPoint:
        """Return the same point, with its cached results, and with bounds that replace the largest of many numbers."""
        if self.equations is not None:
            _ = self.derivatives
        return self._like(("system", "derivatives", "differences", "modes", "pairs"), levels=levels)

    def ordered(self, order: Index | None) -> DesignPoint:
        """Return the same point, with its cached results, and the mode number of each track."""
        return self._like(("system", "derivatives", "differences", "modes"), order=order)

    def _like(self, cached: tuple[str, ...], **changes: Any) -> DesignPoint:
        result = replace(self, **changes)
        result.__dict__.update((name, self.__dict__[name]) for name in cached if name in self.__dict__)
        return result

    @property
    def width(self) -> int:
        """Number of unknowns."""
        return len(self.scale) + len(self.levels)

    def level(self, largest: Hashable) -> Dual | None:
        """Return the bound that replaces the largest of many numbers; None if there is none."""
        if largest not in self.levels:
            return None
        slope = np.zeros((1, self.width))
        slope[0, len(self.scale) + list(self.levels).index(largest)] = 1.0
        return Dual(np.array([self.levels[largest]]), slope)

    def dual(self, value: Array, slope: Array) -> Dual:
        """Return numbers with derivatives converted from variables to the unknowns."""
        slopes = np.zeros((len(value), self.width))
        slopes[:, : len(self.scale)] = slope * self.scale
        return Dual(value, slopes)

    @cached_property
    def modes(self) -> Modes:
        """The modes, not followed."""
        modes: Modes = self.system.modes()
        return modes

    @cached_property
    def pairs(self) -> tuple[Complex, Complex]:
        """Eigenvalues by track (modes, 2), and their derivatives (variables, modes, 2)."""
        modes = self.modes
        which = np.arange(len(modes)) if self.order is None else self.order
        ends = np.stack((modes.starts[:-1], modes.starts[1:] - 1), axis=1)[which]
        if not self.rates:
            return modes.eigenvalues[ends], np.zeros((0, *ends.shape), dtype=complex)
        return modes.eigenvalues[ends], self.derivatives.eigenvalues(modes)[:, ends]

    @cached_property
    def differences(self) -> Differences:
        """Differences to all variables."""
        return Differences(self._off, self._steps(STEP))

    @cached_property
    def derivatives(self) -> Derivatives:
        """The derivatives to the variables: exact ones of a system and of a continuous loop around it whose controller
        does not depend on the parameters, else differences. Those of the controller's matrices to gains are
        differences, if they are smooth.
        """
        asked, systems = self.system, self.systems
        if systems is None:
            return (OfLoop if kind_of(asked) == "closed loop" else OfSystem)(asked, self.rates)
        if systems.design.pose:
            return self.differences
        if not systems.plant.gains and _selected(asked, self.equations):
            return OfSystem(asked, self.rates)
        law = _law(asked)
        if law is None or not _selected(asked.plant.source, self.equations) or not self._independent(systems, law):
            return self.differences
        change = self._law_changes(systems.plant, law)
        return self.differences if change is None else OfLoop(asked, self.rates, change)

    def _off(self, offsets: Mapping[str, float]) -> Any:
        assert self.systems is not None
        plant, values = self.systems.plant, {name: x + offsets.get(name, 0.0) for name, x in self.values.items()}
        return plant(self.equations if set(offsets) <= set(plant.gains) else self.systems.at(values), values)

    def _steps(self, share: float) -> dict[str, float]:
        assert self.sizes is not None
        return {name: share * float(size) for name, size in zip(self.values, self.sizes, strict=True)}

    def _independent(self, systems: Systems, law: Array) -> bool:
        """Whether the controller is the same around another system."""
        if set(self.values) <= set(systems.plant.gains):
            return True
        try:
            others = None if systems.other is None else _law(systems.plant(systems.other, self.values))
            return others is not None and np.array_equal(law, others)
        except MbsvibError:
            return False

    def _law_changes(self, plant: Plant, law: Array) -> Array | None:
        """Derivatives of the controller's matrices, (variables, ...), None where they are not smooth."""
        result = np.zeros((len(self.values), *law.shape))
        for k, (name, step) in enumerate(self._steps(GAIN_STEP).items()):
            if name not in plant.gains:
                continue
            known = [_law(self._off({name: offset * step})) for offset in (-2, -1, 1, 2)]
            near = [item for item in known if item is not None and item.shape == law.shape]
            if len(near) < len(known):
                return None
            wide, close = (near[3] - near[0]) / (4.0 * step), (near[2] - near[1]) / (2.0 * step)
            change = (4.0 * close - wide) / 3.0
            if np.abs(close - change).max(initial=0.0) > SMOOTH * np.abs(change).max(initial=0.0):
                return None
            result[k] = change
        return result

    @property
    def of_parameters(self) -> bool:
        """Whether derivatives to the variables are those to parameters of the system, which the plant has, too."""
        return self.systems is None or not (
            self.systems.plant.gains or isinstance(self.derivatives, Differences))

    def by_differences(self, function: Callable[[Any], Any]) -> Array:
        """Return the differences of numbers (k,) of the plant, (k, variables)."""
        if not self.rates:
            return np.zeros((1, 0))
        if self.systems is None:
            raise ModelError(f"gradient: '{self.system.name}' is not a continuous loop around a system; expected one, "
                             f"or plant= of a study, which takes differences.", field="system")  # fmt: skip
        return np.asarray(self.differences.of(function)).T

    def response(self, omega: ArrayLike, inputs: Sequence[str], outputs: Sequence[str]) -> tuple[Complex, Complex]:
        """Return the frequency response (outputs, inputs, n), and its derivatives (variables, outputs, inputs, n)."""
        w = angular(omega, "response")
        value = steady_response(self.system, w, outputs, inputs)
        if not self.rates:
            return value, np.zeros((0, *value.shape), dtype=complex)
        return value, self.derivatives.response(w, outputs, inputs)


def steady_response(system: Any, omega: Array, outputs: Sequence[str], inputs: Sequence[str]) -> Complex:
    """Return the frequency response of a system, or of a loop that is stable; others have no steady vibration."""
    if isinstance(system, Loop):
        system.check_stable()
    return np.asarray(system.frequency_response(omega, list(outputs), list(inputs)))


def station(asked: Any, at: float = 0.0, modes: Modes | None = None) -> Station:
    """Return modes with their shapes, to be followed: of systems weighted by the inertia, of loops with states of
    controllers the displacements, velocities and states.
    """
    modes = asked.modes() if modes is None else modes
    if kind_of(asked) == "closed loop" and asked.period is None:
        if asked.second_order is None:
            space = asked.state_space()
            inside = modes.shapes[len(asked.plant.space.A) :]
            return Station(at, upper(modes.pairs), np.concatenate((space.transform @ modes.shapes, inside)))
        asked = asked.second_order
    if kind_of(asked) != "system":
        raise ModelError(f"modes of '{asked.name}' cannot be followed by their shapes, as its states are others at "
                         f"each point; expected a system or a continuous loop. Ask quantities of responses.",
                         field="plant")  # fmt: skip
    return Station(at, upper(modes.pairs), checked(asked).inertia_factor @ modes.shapes)


def frame(asked: Any, first: Station) -> Array | Complex | None:
    """Return the matrix by which shapes of loops become comparable: in parts of those of the ``first`` station, as
    displacements and states have no common unit; None where shapes are weighted.
    """
    if kind_of(asked) != "closed loop" or asked.second_order is not None:
        return None
    oscillating = first.vectors[:, first.values.imag > 0.0]
    return np.linalg.pinv(np.concatenate((first.vectors, oscillating.conj()), axis=1))


def framed(shapes: Station, by: Array | Complex | None) -> Station:
    """Return modes with their shapes multiplied by the matrix of ``frame``."""
    return shapes if by is None else replace(shapes, vectors=by @ shapes.vectors)


def linear(asked: Any) -> Any:
    """Return a system, a loop or a state space, or refuse another object."""
    return asked if kind_of(asked) in ("closed loop", "state space") else checked(asked)


def checked(system: Any) -> System:
    """Return a system, or refuse another object; sparse ones have no sensitivities."""
    if not isinstance(system, System):
        raise ModelError(f"quantities are those of a System, not of a {type(system).__name__}; models of more than 600 "
                         f"coordinates are sparse, which have no sensitivities yet; try it on a smaller one.",
                         element="system")  # fmt: skip
    return system


def check_variables(system: System, rates: Mapping[str, Mapping[str, float]]) -> None:
    """Refuse variables whose derivatives are not supported, before anything is computed."""
    resolved(system.parameters, rates)
    system.sensitivity_basis.groups(rates)


def _law(asked: Any) -> Array | None:
    """[A B; C D] of the controller of a continuous loop, None of all else."""
    if kind_of(asked) != "closed loop" or asked.period is not None:
        return None
    return np.block([[asked.law.A, asked.law.B], [asked.law.C, asked.law.D]])


def _selected(asked: Any, system: Any) -> bool:
    """Whether something is the system itself, or that with some of its outputs and inputs."""
    if asked is system:
        return True
    if kind_of(asked) != "system" or any(getattr(asked, key) is not getattr(system, key) for key in ("M", "C", "K")) \
            or not (set(asked.outputs) <= set(system.outputs) and set(asked.inputs) <= set(system.inputs)):
        return False
    same = system.with_ports(list(asked.outputs), list(asked.inputs))
    return all(np.array_equal(getattr(asked, key), getattr(same, key)) for key in ("B", "Cq", "Cv", "Ca", "D"))
