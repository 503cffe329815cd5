"""Systems with motions as inputs, of one model and of many variants."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.api.connecting import Connecting
from mbsvib.api.sensitivities import SensitiveVerbs
from mbsvib.api.state_space import StateSpace
from mbsvib.common.arrays import Array, Complex
from mbsvib.common.display import Displayed
from mbsvib.common.expected import angular
from mbsvib.common.selection import Names, port_numbers
from mbsvib.errors import ResponseError, counted
from mbsvib.random.verbs import RandomVerbs
from mbsvib.responses.driven import Drive, driven_response, driven_space, feedthrough_of
from mbsvib.responses.linear import LinearVerbs
from mbsvib.uncertain.plant import UncertainPlant

# What a system tells of the mechanism without its inputs; asked of a system with motions, its equations answer.
WITHOUT_INPUTS = frozenset((
    "M", "C", "K", "mass", "damping", "stiffness", "Cq", "Cv", "Ca", "dof", "coordinates", "coordinate_units", "bodies",
    "body_motion", "inertia_factor", "elastic_rows", "row_stiffness", "row_damping", "row_owner", "gyroscopic",
    "circulatory", "massless", "null_inertia", "tree", "cut_joints", "redundant", "parameters", "displacements",
    "provenance", "sensitivity_basis", "stiffness_shares", "linear_range", "explain", "reactions",
))  # fmt: skip


@dataclass(frozen=True, repr=False, eq=False)
class Driven(Displayed):
    """Equations and how motions act on them."""

    ends: Any
    """The equations with the motions of all ends as inputs: a System, a SparseSystem or a Batch."""
    drives: tuple[Drive, ...]
    """The inputs and how they act."""

    @property
    def name(self) -> str:
        """Name of the model."""
        return str(self.ends.name)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return tuple([drive.name for drive in self.drives])

    @property
    def input_units(self) -> tuple[str, ...]:
        """Units of the inputs."""
        return tuple([drive.unit for drive in self.drives])

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return tuple(self.ends.outputs)

    @property
    def output_units(self) -> tuple[str, ...]:
        """Units of the outputs."""
        return tuple(self.ends.output_units)

    def __getattr__(self, key: str) -> Any:
        if key in ("ends", "drives"):  # before these are there, as while an object is read from a pickle
            raise AttributeError(key)
        if key in WITHOUT_INPUTS:
            return getattr(self.ends, key)
        known = not key.startswith("_") and hasattr(type(self.ends), key)
        motion = next((drive.name for drive in self.drives if drive.columns != (drive.name,)), "")
        hint = f"; beside the motion input '{motion}' ask .state_space(), or .ends, whose inputs are the " \
               f"displacements and velocities of the moved ends" if known else ""  # fmt: skip
        raise AttributeError(f"'{type(self).__name__}' object has no attribute '{key}'{hint}.", name=key, obj=self)

    def __repr__(self) -> str:
        ports = f"{counted(len(self.inputs), 'input')}, {counted(len(self.outputs), 'output')}"
        return f"{type(self).__name__}({self.name!r}: {self.ends.dof} DOF, {ports})"


@dataclass(frozen=True, repr=False, eq=False)
class DrivenSystem(RandomVerbs, SensitiveVerbs, Connecting, LinearVerbs, Driven):
    """M q'' + C q' + K q = B0 u + B1 u' + B2 u'',  y = Cq q + Cv q' + Ca q'' + D u: a system with motions as inputs.

    Its matrices, modes and coordinates are those of ``ends``, the equations whose inputs are the displacements
    ``NAME.displacement`` and velocities ``NAME.velocity`` of the moved ends, and ``NAME.acceleration`` of driven
    joints. ``drives`` tell how the inputs act on these. Time responses, norms and loops are those of ``state_space()``.
    """

    kind: ClassVar[str] = "state space"
    """Tells what has a state space from systems of second order."""

    @property
    def B0(self) -> Array:
        """Generalized forces by a unit of the displacement of each end, or of each other input (m, inputs)."""
        return self._columns(0)

    @property
    def B1(self) -> Array:
        """Generalized forces by a unit of the velocity of each end (m, inputs)."""
        return self._columns(1)

    @property
    def B2(self) -> Array:
        """Generalized forces by a unit of the acceleration of each driven joint (m, inputs)."""
        return self._columns(2)

    @property
    def D(self) -> Array:
        """Direct response of outputs to inputs (outputs, inputs) of the state space."""
        return self.state_space().D

    def modes(self, *args: Any, **kwargs: Any) -> Any:
        """Return the modes of the mechanism, as if its ends stood still, with the arguments of ``System.modes``."""
        return self.ends.modes(*args, **kwargs)

    def poles(self) -> Complex:
        """Return the eigenvalues (2m,) [1/s] of the mechanism; those of its inputs' integrators are not among them."""
        return np.asarray(self.ends.poles())

    def _with_ports(self, outputs: Names, inputs: Names) -> Self:
        o, i = port_numbers(outputs, inputs, (self.outputs, self.inputs), self.name)
        drives = tuple([self.drives[k] for k in i])
        columns = [column for drive in drives for column in drive.columns]
        part = self.ends.with_ports([self.outputs[k] for k in o], columns)
        return replace(self, ends=part, drives=drives)

    def frequency_response(self, omega: ArrayLike, outputs: Names = None, inputs: Names = None) -> Complex:
        """Return the frequency response as ``System.frequency_response``; it exists where no proper state space does.

        G(i w) = (Cq + i w Cv - w^2 Ca) (K + i w C - w^2 M)^-1 (B0 + i w B1) / (i w)^n + D

        with n = 1 for a velocity and 2 for an acceleration as the input, which have no response at 0 rad/s.
        """
        w, part = angular(omega), self.with_ports(outputs, inputs)
        response: Complex = driven_response(part.ends.frequency_response(w), part.ends.inputs, part.drives, w)
        return response

    def reduced(self, order: int | None = None, error: float | None = None, method: str = "balanced",
                keep: Names = None, **kwargs: Any) -> Any:  # fmt: skip
        """Return a model with fewer states (a StateSpace, "balanced") or coordinates, as ``System.reduced``.

        Of other methods than "balanced" errors and bounds are those of ``ends``, by the displacement and velocity of
        each end. ``kwargs``: more of those of ``SparseSystem.reduced``.
        """
        part = self if keep is None else self.with_ports(keep)
        if getattr(self.ends, "kind", "") != "system":
            return replace(part, ends=part.ends.reduced(order, **kwargs))
        if method == "balanced":
            return part.state_space("modal").reduced(order, error)
        return replace(part, ends=part.ends.reduced(order, error, method))

    def transmission_zeros(self, outputs: Names = None, inputs: Names = None) -> Complex:
        """Return the invariant zeros [1/s] as ``System.transmission_zeros``, also where no proper state space exists.

        Where an output needs the derivative of a displacement they are those by its velocity or acceleration, G / s^n,
        whose finite zeros are the same.
        """
        from mbsvib.responses.finite_zeros import first_order_zeros

        part = self.with_ports(outputs, inputs)
        while True:
            try:
                space = part.state_space()
                break
            except ResponseError:
                raised = tuple([replace(drive, order=drive.order + (drive.order + 1 < len(drive.columns)))
                                for drive in part.drives])  # fmt: skip
                if raised == part.drives:
                    raise
                part = replace(part, drives=raised)
        return first_order_zeros(space.A, space.B, space.C, space.D, part)

    def uncertain(self, limits: Mapping[str, Any], order: int = 1) -> UncertainPlant:
        """Return the system with parameters that lie within limits and the same inputs; see ``System.uncertain``."""
        plant: UncertainPlant = self.ends.uncertain(limits, order)
        count = sum(plant.blocks.values())
        added = zip(plant.linear.inputs[:count], plant.linear.input_units[:count], strict=True)
        channels = tuple([Drive(name, unit, (name,)) for name, unit in added])
        linear = DrivenSystem(plant.linear, (*channels, *self.drives))
        return replace(plant, nominal=self, linear=linear, _origin=self)

    def _slopes(self, question: str, *arguments: Any) -> Any:
        from mbsvib.api import driven_slopes

        return getattr(driven_slopes, question)(self, *arguments)

    def state_space(self, realization: str | None = None, **kwargs: Any) -> StateSpace:
        """Return proper first-order equations; an output that needs the derivative of an input is refused.

        x = (q, q' - M^-1 B1 u) where inputs are displacements; a velocity has the state ``NAME.displacement``, an
        acceleration also ``NAME.velocity``. ``realization`` is that of the mechanism ("physical", "modal" or
        "balanced"), ``kwargs`` are those of a sparse system, ``modes=k``.
        """
        space: StateSpace = self.ends.state_space(*(() if realization is None else (realization,)), **kwargs)
        return driven_space(space, self.drives, feedthrough_of(self.ends, space), self.name)

    def _columns(self, order: int) -> Array:
        inputs, matrix = list(self.ends.inputs), self.ends.B
        result = np.zeros((len(matrix), len(self.drives)))
        for k, drive in enumerate(self.drives):
            if len(drive.columns) > order:
                result[:, k] = matrix[:, inputs.index(drive.columns[order])]
        return result


@dataclass(frozen=True, repr=False, eq=False)
class DrivenBatch(Driven):
    """Systems with motions as inputs of n variants, as ``Batch``; ``batch[i]`` is the ``DrivenSystem`` of variant i."""

    def __len__(self) -> int:
        return len(self.ends)

    def __getitem__(self, index: int) -> DrivenSystem:
        return DrivenSystem(self.ends[index], self.drives)

    @property
    def nominal(self) -> DrivenSystem:
        """The system of the model itself."""
        return DrivenSystem(self.ends.nominal, self.drives)

    @property
    def values(self) -> Any:
        """The values that vary."""
        return self.ends.values

    def modes(self, rtol: float | None = None) -> Any:
        """Return the modes of all variants, as ``Batch.modes``."""
        return self.ends.modes(rtol)

    def frequency_response(self, omega: ArrayLike) -> Complex:
        """Return the frequency responses (n, outputs, inputs, k) of all variants at ``omega`` (k,) [rad/s]."""
        batch = self.ends
        result: Complex = driven_response(batch.frequency_response(omega), batch.nominal.inputs, self.drives, omega)
        return result

    def state_space(self, realization: str = "physical") -> tuple[StateSpace, ...]:
        """Return proper first-order equations of each variant, as ``DrivenSystem.state_space``."""
        return tuple([self[i].state_space(realization) for i in range(len(self))])

    def time_response(self, t: ArrayLike, u: ArrayLike, hold: str = "first") -> Array:
        """Return the time responses (n, outputs, k) of all variants to the same inputs, from rest."""
        return np.array([space.time_response(t, u, hold) for space in self.state_space()])
