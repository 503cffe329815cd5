"""Plants of a study, such as closed loops, around its systems."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
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
from mbsvib.common.expected import kind_of
from mbsvib.equations.assembly import is_small
from mbsvib.errors import MbsvibError, ModelError
from mbsvib.responses.driven import Drive, differ, drives
from mbsvib.studies.design import StudyVariables, Ties, design

PlantFunction = Callable[..., Any]

GAIN_STEP = 1e-3  # of differences of a controller's matrices, which are smooth or jump with their realization


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


def systems_of(
    model: Model, names: Iterable[str], ties: Ties | None, function: PlantFunction | None, relaxed: bool
) -> Systems:
    """Return the systems of a study whose variables have some ``names``; ``ties`` and ``relaxed`` as of ``design``."""
    around = plant_of(function, names, model)
    return Systems(model, design(model, names, ties, around.gains, relaxed), around)
