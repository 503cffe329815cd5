"""Plants of a study, such as closed loops, around its systems, and their derivatives to its variables."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from inspect import Parameter, signature
from typing import Any, cast
from warnings import catch_warnings, simplefilter

import numpy as np

from mbsvib.api.batch import Batch
from mbsvib.api.driven import DrivenSystem
from mbsvib.api.in_equilibrium import batch_in_equilibrium, in_equilibrium
from mbsvib.api.model import Model
from mbsvib.api.plant import Plant as CompiledPlant
from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array
from mbsvib.common.expected import kind_of
from mbsvib.equations.assembly import is_small
from mbsvib.errors import MbsvibError, ModelError
from mbsvib.responses.driven import Drive, differ, drives
from mbsvib.studies.derivatives import Derivatives, Differences, OfLoop, OfSystem, Rates
from mbsvib.studies.design import StudyVariables

PlantFunction = Callable[..., Any]

STEP = 1e-4  # of differences, in parts of a variable: close resonances allow no larger one, rounding no smaller one
GAIN_STEP = 1e-3  # of differences of a controller's matrices, which are smooth or jump with their realization
SMOOTH = 1e-3  # share by which differences of second and of fourth order of smooth matrices differ at most


def name_of(item: Any, attribute: str = "__qualname__") -> str:
    """Return the label of a quantity, or the name of a function: tables and records tell them apart by it."""
    return str(getattr(item, "label", getattr(item, attribute, type(item).__name__)))


@dataclass(frozen=True)
class Plant:
    """What a ``function`` makes of a system; its further arguments are ``gains`` by name, with their defaults, not a
    number where there is none.
    """

    function: PlantFunction | None
    gains: Mapping[str, float]

    @property
    def name(self) -> str | None:
        """Name of the function; None without one."""
        function = self.function.function if isinstance(self.function, WithMotions) else self.function
        return None if function is None else name_of(function)

    def __call__(self, system: Any, values: Mapping[str, Any]) -> Any:
        if self.function is None:
            return system
        return self.function(system, **{name: float(values[name]) for name in self.gains if name in values})


NO_PLANT = Plant(None, {})


@dataclass(frozen=True)
class WithMotions:
    """What a ``function`` makes of a system with the motion inputs of its model; the system itself without one."""

    function: PlantFunction | None
    motions: tuple[Drive, ...]

    def __call__(self, system: Any, **gains: float) -> Any:
        driven = DrivenSystem(system, self.motions)
        return driven if self.function is None else self.function(driven, **gains)


def plant_of(function: PlantFunction | None, variables: Any, model: Model) -> Plant:
    """Return the plant of a study, checked; its gains without default are among the variables."""
    motions = drives(model) if kind_of(model) == "model" else ()  # the study refuses what is no model
    if differ(motions):
        return Plant(WithMotions(function, motions), _checked(function, variables).gains)
    return _checked(function, variables)


def _checked(function: PlantFunction | None, variables: Any) -> Plant:
    if function is None:
        return NO_PLANT
    if not callable(function):
        raise check.refuse("study", "plant", function, "a function of a system, such as lambda system: "
                           "system.feedback(K)")  # fmt: skip
    try:
        others = list(signature(function).parameters.values())[1:]
    except ValueError:  # some built-in functions have none
        others = []
    named = [item for item in others if item.kind in (Parameter.POSITIONAL_OR_KEYWORD, Parameter.KEYWORD_ONLY)]
    for item in named:
        if item.default is Parameter.empty and item.name not in variables:
            raise ModelError(f"plant: its argument '{item.name}' has no default and is not one of the variables: "
                             f"{', '.join(map(str, variables))}.", element=item.name, field="plant")  # fmt: skip
    return Plant(function, {item.name: np.nan if item.default is Parameter.empty else check.number(
        item.default, "plant", item.name) for item in named if item.name in variables})  # fmt: skip


class Systems:
    """Systems of a model at values of variables, and what a ``plant`` makes of them: those of a compiled model where
    forces at the pose need not balance, else of models in equilibrium. ``independent``: requested minimal coordinates,
    in which a search keeps its systems.
    """

    def __init__(
        self, model: Model, design: StudyVariables, plant: Plant = NO_PLANT, independent: Sequence[str] | None = None
    ) -> None:
        self.model, self.design, self.plant, self.independent = model, design, plant, independent
        self._last: tuple[Mapping[str, float], Any] = {}, None

    @cached_property
    def compiled(self) -> CompiledPlant | None:
        """The compiled model; None where models find their equilibrium, or are large. Given poses have to balance."""
        if not is_small(self.model):
            return None
        start, pose = self.design.start, self.design.pose
        with catch_warnings(), suppress(MbsvibError):
            simplefilter("ignore")
            compiled = self.model.compile(list(self.design.values(start)), independent=self.independent, pose=list(
                self.design.displacements(start)) if pose else None, relaxed=self.design.relaxed)  # fmt: skip
            same = self.independent is None or compiled.coordinates == tuple(self.independent)
            if same and (pose or not compiled.loaded):
                return compiled
        return None

    def at(self, values: Mapping[str, float]) -> Any:
        """Return the system at values of the variables."""
        changed = self.design.values(values) | self.design.displacements(values)
        if self._last[1] is None or self._last[0] != changed:  # gains alone change no system
            self._last = changed, self._system(changed, values)
        return self._last[1]

    def _system(self, changed: Mapping[str, float], values: Mapping[str, float]) -> Any:
        if self.compiled is not None:
            with suppress(MbsvibError):  # other coordinates may do, and refusals are those of models
                return self.compiled.system([changed[name] for name in self.compiled.names])
        system = self.balanced(values)[1]
        return system.ends if isinstance(system, DrivenSystem) else system

    def batch(self, columns: Mapping[str, Any]) -> Batch:
        """Return the systems at values (n,) of the variables; parameters or a pose are among them."""
        changed = self.design.values(columns)
        if not self.design.pose:
            return batch_in_equilibrium(self.model, changed)
        if self.compiled is None:
            raise ModelError(f"model '{self.model.name}' is not in balance in each pose", field="variables")
        changed |= self.design.displacements(columns)
        return cast("Batch", self.compiled(np.column_stack([changed[name] for name in self.compiled.names])))

    def described(self, values: Mapping[str, float]) -> Model:
        """Return the model at values of the variables, in the pose that these give."""
        model, pose = self.model.with_values(self.design.values(values)), self.design.displacements(values)
        return model.moved(pose, relaxed=self.design.relaxed) if pose else model

    def balanced(self, values: Mapping[str, float]) -> tuple[Model, Any]:
        """Return the model at values of the variables with its system: in equilibrium, or in the pose that these give,
        where it has to balance.
        """
        model = self.described(values)
        if self.design.pose:
            return model, model.linearize(self.independent)
        return in_equilibrium(model, independent=self.independent)

    def asked(self, values: Mapping[str, float]) -> Any:
        """Return what the plant makes of the system at values of the variables."""
        return self.plant(self.at(values), values)

    @cached_property
    def other(self) -> Any:
        """What the plant makes, with its gains as at the start, of a system whose parameters all differ a little from
        those at the start; None if there is none.
        """
        for side in (GAIN_STEP, -GAIN_STEP):
            with suppress(MbsvibError):
                start = self.design.start
                return self.at({name: value + side * (abs(value) or 1.0) for name, value in start.items()})
        return None


@dataclass(frozen=True)
class PlantPoint:
    """What the plant of a study makes of the ``system`` at some ``values`` of its variables, with ``rates`` of
    parameters.

    ``sizes`` (variables,): sizes of the variables, of which differences take a small part.
    """

    systems: Systems
    system: Any
    values: Mapping[str, float]
    rates: Rates
    sizes: Array

    @property
    def plant(self) -> Plant:
        """The plant of the study."""
        return self.systems.plant

    @cached_property
    def asked(self) -> Any:
        """What the function returns here."""
        return self.plant(self.system, self.values)

    @cached_property
    def differences(self) -> Differences:
        """Differences to all variables."""
        return Differences(self._off, self._steps(STEP))

    @cached_property
    def derivatives(self) -> Derivatives:
        """Exact derivatives of the system or of a continuous loop around it whose controller does not depend on the
        parameters; else differences. Those of the controller's matrices to gains are differences, if they are smooth.
        """
        if self.systems.design.pose:
            return self.differences
        if not self.plant.gains and _selected(self.asked, self.system):
            return OfSystem(self.asked, self.rates)
        law = _law(self.asked)
        if law is None or not _selected(self.asked.plant.source, self.system) or not self._independent(law):
            return self.differences
        change = self._law_changes(law)
        return self.differences if change is None else OfLoop(self.asked, self.rates, change)

    def _off(self, offsets: Mapping[str, float]) -> Any:
        values = {name: value + offsets.get(name, 0.0) for name, value in self.values.items()}
        return self.plant(self.system if set(offsets) <= set(self.plant.gains) else self.systems.at(values), values)

    def _steps(self, share: float) -> dict[str, float]:
        return {name: share * float(size) for name, size in zip(self.values, self.sizes, strict=True)}

    def _independent(self, law: Array) -> bool:
        """Whether the controller is the same around another system."""
        if set(self.values) <= set(self.plant.gains):
            return True
        try:
            other = self.systems.other
            others = None if other is None else _law(self.plant(other, self.values))
            return others is not None and np.array_equal(law, others)
        except MbsvibError:
            return False

    def _law_changes(self, law: Array) -> Array | None:
        """Derivatives of the controller's matrices, (variables, ...), None where they are not smooth."""
        steps = {name: step for name, step in self._steps(GAIN_STEP).items() if name in self.plant.gains}
        result = np.zeros((len(self.values), *law.shape))
        for name, step in steps.items():
            known = [_law(self._off({name: offset * step})) for offset in (-2, -1, 1, 2)]
            near = [item for item in known if item is not None and item.shape == law.shape]
            if len(near) < len(known):
                return None
            wide, close = (near[3] - near[0]) / (4.0 * step), (near[2] - near[1]) / (2.0 * step)
            change = (4.0 * close - wide) / 3.0
            if np.abs(close - change).max(initial=0.0) > SMOOTH * np.abs(change).max(initial=0.0):
                return None
            result[list(self.values).index(name)] = change
        return result


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
