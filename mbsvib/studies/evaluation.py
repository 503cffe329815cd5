"""Design points: systems at points of a study; results that quantities need are computed once."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any
from warnings import catch_warnings, simplefilter

import numpy as np

from mbsvib.api.in_equilibrium import in_equilibrium
from mbsvib.api.system import System
from mbsvib.common.expected import kind_of
from mbsvib.equations.assembly import is_small
from mbsvib.errors import MbsvibError, ModelError
from mbsvib.linalg.matching import Station, upper
from mbsvib.sensitivities.variables import variables as resolved
from mbsvib.studies.dual import Dual

if TYPE_CHECKING:
    from collections.abc import Hashable, Iterable, Sequence

    from numpy.typing import ArrayLike

    from mbsvib.api.model import Model
    from mbsvib.api.plant import Plant
    from mbsvib.api.sparse_system import SparseSystem
    from mbsvib.common.arrays import Array, Complex, Index
    from mbsvib.modes import Modes
    from mbsvib.studies.design import StudyVariables


@dataclass(frozen=True)
class DesignPoint:
    """A system and its variables (``rates`` of parameters with each). ``scale`` (variables,) converts derivatives with
    respect to variables to those with respect to the unknowns of a search, ``levels`` are bounds that replace the
    largest of many numbers, ``order`` is the mode number of each track. ``equations`` are None where no quantity of the
    study asks for the system; ``changed`` is the model at these values, None where it is that of the system.
    """

    equations: System | None
    rates: Mapping[str, Mapping[str, float]]
    values: Mapping[str, float]
    scale: Array
    levels: Mapping[Hashable, float]
    order: Index | None = None
    changed: Model | None = None

    @classmethod
    def of(
        cls, system: Any, variables: str | Iterable[str] | Mapping[str, Mapping[str, float]], equations: bool = True
    ) -> DesignPoint:
        """Return a single system with derivatives to some variables; a model if no equations are requested."""
        model = system if not equations and kind_of(system) == "model" else None
        equations_of = None if model is not None else checked(system)
        if isinstance(variables, Mapping):
            return cls(equations_of, variables, {}, np.ones(len(variables)), {}, changed=model)
        names, known = [variables] if isinstance(variables, str) else list(variables), system.parameters
        values = {name: known[known.matching(name)[0]] for name in names}
        return cls(equations_of, {name: {name: 1.0} for name in names}, values, np.ones(len(names)), {}, changed=model)

    @property
    def system(self) -> System:
        """The equations of motion."""
        return checked(self.equations)

    @property
    def model(self) -> Model:
        """The mechanism."""
        origin: Any = self.changed if self.equations is None else self.equations.provenance.origin
        if origin is None:
            raise ModelError("quantities of cycles are those of a model; a system that no model was linearized to has "
                             "none.", element="system")  # fmt: skip
        return origin  # type: ignore[no-any-return]

    def with_levels(self, levels: Mapping[Hashable, float]) -> DesignPoint:
        """Return the same point, with its cached results, and with bounds that replace the largest of many numbers."""
        result = replace(self, levels=levels)
        result.__dict__.update((name, self.__dict__[name]) for name in ("modes", "pairs") if name in self.__dict__)
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
        return self.system.modes()

    @cached_property
    def pairs(self) -> tuple[Complex, Complex]:
        """Eigenvalues by track (modes, 2), and their derivatives (variables, modes, 2)."""
        modes = self.modes
        which = np.arange(len(modes)) if self.order is None else self.order
        ends = np.stack((modes.starts[:-1], modes.starts[1:] - 1), axis=1)[which]
        if not self.rates:
            return modes.eigenvalues[ends], np.zeros((0, *ends.shape), dtype=complex)
        slope = self.system.eigenvalue_sensitivities(self.rates)
        return modes.eigenvalues[ends], slope[:, ends]

    def response(self, omega: ArrayLike, inputs: Sequence[str], outputs: Sequence[str]) -> tuple[Complex, Complex]:
        """Return the frequency response (outputs, inputs, n), and its derivatives (variables, outputs, inputs, n)."""
        w = np.asarray(omega, dtype=float)
        o = [self.system.outputs.index(name) for name in outputs]
        i = [self.system.inputs.index(name) for name in inputs]
        value = self.system.frequency_response(w)[np.ix_(o, i)]
        if not self.rates:
            return value, np.zeros((0, *value.shape), dtype=complex)
        return value, self.system.frequency_response_sensitivities(w, self.rates, list(outputs), list(inputs))

    @cached_property
    def station(self) -> Station:
        """The modes with their shapes weighted by the inertia, to be followed."""
        return station(self.modes, self.system)


class Systems:
    """Systems of a model at values of variables: those of a compiled plant where forces at the pose need not balance,
    else of models in equilibrium. ``independent``: requested minimal coordinates, in which a search keeps its systems.
    """

    def __init__(self, model: Model, design: StudyVariables, independent: Sequence[str] | None = None) -> None:
        self.model, self.design, self.independent = model, design, independent

    @cached_property
    def plant(self) -> Plant | None:
        """The compiled plant; None where models find their equilibrium, or are large."""
        if not is_small(self.model):
            return None
        with catch_warnings(), suppress(MbsvibError):
            simplefilter("ignore")
            plant = self.model.compile(list(self.design.values(self.design.start)), independent=self.independent)
            if not plant.loaded and (self.independent is None or plant.coordinates == tuple(self.independent)):
                return plant
        return None

    def at(self, values: Mapping[str, float]) -> System | SparseSystem:
        """Return the system at values of the variables."""
        changed = self.design.values(values)
        if self.plant is not None:
            with suppress(MbsvibError):  # other coordinates may do, and refusals are those of models
                return self.plant.system([changed[name] for name in self.plant.names])
        return in_equilibrium(self.model.with_values(changed), independent=self.independent)[1]


def station(modes: Modes, system: System, at: float = 0.0) -> Station:
    """Return modes with their shapes weighted by the inertia, to be followed."""
    return Station(at, upper(modes.pairs), system.inertia_factor @ modes.shapes)


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
