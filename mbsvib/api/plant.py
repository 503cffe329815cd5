"""The compiled plant: the equations of one structure as a function of some of its numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.api.batch import Batch
from mbsvib.api.modes import Modes
from mbsvib.api.system import System
from mbsvib.common.arguments import names_in, shown
from mbsvib.common.arrays import Array, Complex
from mbsvib.common.display import Displayed
from mbsvib.common.expected import reals
from mbsvib.common.selection import Names, port_numbers
from mbsvib.equations.batch_assembly import BatchPlan, batch_plan
from mbsvib.equations.batch_equations import of_variant
from mbsvib.equations.batch_values import Values, with_checked_parts
from mbsvib.equations.matrices import Matrices
from mbsvib.equilibrium.posed_variants import PosedVariants, pose_coordinates
from mbsvib.errors import ModelError, counted, nearest
from mbsvib.mechanism.changes import Slots
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.modes.batch import BatchModes
from mbsvib.modes.result import modes as modes_of


@dataclass(frozen=True, repr=False, eq=False)
class Tangent(Displayed):
    """Derivatives of the matrices along a direction, in their own shapes and units per unit of the direction.

    ``M``, ``C``, ``K`` (m, m), ``B`` (m, inputs), ``Cq``, ``Cv``, ``Ca`` (outputs, m), ``D`` (outputs, inputs), with a
    leading axis of n variants where the values have one.
    """

    M: Array
    C: Array
    K: Array
    B: Array
    Cq: Array
    Cv: Array
    Ca: Array
    D: Array

    def __repr__(self) -> str:
        return f"Tangent({' x '.join(map(str, self.M.shape[:-2]))}{', ' if self.M.ndim > 2 else ''}{len(self.M.T)} DOF)"


@dataclass(frozen=True, repr=False, eq=False)
class Plant(Displayed):
    """The equations M q'' + C q' + K q = B u of one structure as a function of p of its numbers.

    ``names`` (p,) are the parameters, ``nominal`` (p,) their values in the model and ``units`` theirs. Pose coordinates
    follow them, with displacements from the described pose; nominal is 0.
    ``plant(values)`` returns the matrices of values (p,), or with a leading axis those of n variants (n, p): all in
    the same ``coordinates``, which are those of the model. What does not depend on the numbers was computed once.
    Plants are immutable and can be pickled.
    """

    names: tuple[str, ...]
    nominal: Array
    units: tuple[str, ...]
    _plan: BatchPlan

    @property
    def name(self) -> str:
        """Name of the model."""
        return self._plan.nominal.name

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the minimal coordinates (m,), the same for all values."""
        return self._plan.nominal.coordinates

    @property
    def plans(self) -> int:
        """How often ranks of loops were decided: once at the start, and for each variant in which that was in doubt."""
        return 1 + sum(self._plan.decided)

    @property
    def loaded(self) -> bool:
        """Whether forces act at the pose for some values, which then have to balance there."""
        return self._plan.loaded

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return self._plan.nominal.inputs

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return self._plan.nominal.outputs

    def __call__(self, values: ArrayLike) -> Matrices:
        """Return the matrices for values of the parameters.

        Parameters
        ----------
        values : array-like, shape (p,) or (n, p)
            Values in the order of ``names`` [``units``].

        Returns
        -------
        Matrices
            ``M``, ``C``, ``K`` (m, m), ``B`` (m, inputs), ``Cq``, ``Cv``, ``Ca`` (outputs, m), ``D`` (outputs, inputs);
            for values (n, p) a ``Batch``, whose arrays have an axis of variants in front.

        Raises
        ------
        ModelError
            If values have another shape, are not finite, or are refused by a part.
        SingularPoseError
            If the number of degrees of freedom is another one for some values.
        EquilibriumError
            If the loads do not balance for some values.
        """
        array, single = self._checked(values)
        return self._plan.single(self._values(array)) if single else self._batch(array)

    def system(self, values: ArrayLike) -> System:
        """Return the system for values of the parameters.

        Parameters
        ----------
        values : array-like, shape (p,)
            Values in the order of ``names``.

        Returns
        -------
        System
            With all names and methods.

        Raises
        ------
        ModelError
            If values are not (p,), not finite, or refused by a part.
        SingularPoseError, EquilibriumError
            As of ``plant(values)``.
        """
        array, single = self._checked(values)
        if not single:
            raise ModelError(f"system: values have the shape {np.shape(values)}; expected ({len(self.names)},). "
                             f"plant(values) returns a batch of many variants.", field="values")  # fmt: skip
        return cast("System", self._plan.system(self._values(array), Batch))

    def modes(self, values: ArrayLike) -> Modes | BatchModes:
        """Return the modes for values of the parameters.

        Parameters
        ----------
        values : array-like, shape (p,) or (n, p)
            Values in the order of ``names``.

        Returns
        -------
        Modes or BatchModes
            Modes of the system, or of all variants with an axis of variants in front.

        Raises
        ------
        ModelError, SingularPoseError, EquilibriumError
            As of ``plant(values)``.
        """
        array, single = self._checked(values)
        batch = self._batch(array)
        return cast("System", of_variant(batch, 0)).modes() if single else batch.modes()

    def eigenvalues(self, values: ArrayLike, gradient: bool = False) -> Complex | tuple[Complex, Complex]:
        """Return the eigenvalues for values of the parameters, with their derivatives if asked for.

        Parameters
        ----------
        values : array-like, shape (p,) or (n, p)
            Values in the order of ``names``.
        gradient : bool
            True: return the derivatives to all parameters and pose coordinates, too.

        Returns
        -------
        array, shape (..., 2m)
            Eigenvalues [1/s], as of ``modes().eigenvalues``.
        array, shape (..., 2m, p)
            Their derivatives. Eigenvalues that coincide have those of their branches, in ascending order; an eigenvalue
            0 has 0 where the motion stays free, infinity where it does not. Not a number for a parameter that, changed
            alone, takes degrees of freedom away or is refused.

        Raises
        ------
        ModelError, SingularPoseError, EquilibriumError
            As of ``plant(values)``.
        """
        array, single = self._checked(values)
        if len(array) == 1 and not gradient:  # by itself, which costs less than a batch of one
            equations = replace(self._plan.nominal, **vars(self._plan.single(self._values(array))))
            alone: Complex = modes_of(equations, clean=False).eigenvalues
            return alone if single else alone[None]
        batch = self._differentiable(array, "eigenvalues") if gradient else self._batch(array)
        modes = batch.basis.modal if gradient else batch.modes()
        if not gradient:
            return modes.eigenvalues
        eigenvalues = modes.eigenvalues[0] if single else modes.eigenvalues
        from mbsvib.sensitivities.eigenvalues import eigenvalue_slopes

        slopes = eigenvalue_slopes(self._plan, batch, modes)
        return eigenvalues, slopes[0] if single else slopes

    def tangent(self, values: ArrayLike, direction: ArrayLike) -> Tangent:
        """Return the derivatives of the matrices along a direction.

        dM = sum over the parameters of (dM/dp) v_p, likewise of C, K, B, Cq, Cv, Ca and D

        Parameters
        ----------
        values : array-like, shape (p,) or (n, p)
            Values in the order of ``names``.
        direction : array-like, shape (p,) or (k, p)
            Rates v of the parameters, or k of these.

        Returns
        -------
        Tangent
            ``M``, ``C``, ``K``, ``B``, ``Cq``, ``Cv``, ``Ca``, ``D``, with leading axes for values (n, p) and for k
            directions, as exact as the matrices; loads need not balance along the direction. Not a number where the
            direction takes degrees of freedom away, or values along it are refused.

        Raises
        ------
        ModelError, SingularPoseError, EquilibriumError
            As of ``plant(values)``, and if poses vary and are computed one by one, as where parameters move joints.

        Source: Martins, Sturdza & Alonso, ACM Trans. Math. Softw. 29 (2003) 245, for complex steps.
        """
        array, single = self._checked(values)
        rates = self._array(direction, "direction", "tangent")
        if rates.ndim not in (1, 2) or rates.shape[-1] != len(self.names):
            raise ModelError(f"tangent: direction has the shape {rates.shape}; expected ({len(self.names)},), a rate "
                             f"of each parameter, or several of these.", field="direction")  # fmt: skip
        from mbsvib.sensitivities.eigenvalues import tangents

        slopes = tangents(self._plan, self._differentiable(array, "tangent"), np.atleast_2d(rates).T)
        one = 0 if rates.ndim == 1 else slice(None)
        return Tangent(**{key: slope[0, one] if single else slope[:, one] for key, slope in slopes.items()})

    def frequency_response(
        self, values: ArrayLike, omega: ArrayLike, outputs: Names = None, inputs: Names = None
    ) -> Complex:
        """Return the frequency response for values of the parameters.

        Parameters
        ----------
        values : array-like, shape (p,) or (n, p)
            Values in the order of ``names``.
        omega : array-like, shape (k,)
            Angular frequencies [rad/s].
        outputs, inputs : str or sequence of str, optional
            Names or patterns; default: all.

        Returns
        -------
        array, shape (..., outputs, inputs, k)
            Complex responses [output unit / input unit].

        Raises
        ------
        ResponseError
            If a name is unknown, or a frequency is not finite, or an undamped pole.
        ModelError, SingularPoseError, EquilibriumError
            As of ``plant(values)``.
        """
        array, single = self._checked(values)
        batch = self._batch(array)
        rows, columns = port_numbers(outputs, inputs, (self.outputs, self.inputs), self.name)
        result = batch.frequency_response(omega)[:, rows][:, :, columns]
        return result[0] if single else result

    def _batch(self, array: Array) -> Batch:
        return self._plan.equations(self._values(array), Batch)

    def _values(self, array: Array) -> Values:
        slots, columns = self._plan.slots, np.ascontiguousarray(array.T)
        count = len(slots.names)
        values = with_checked_parts(Values.of(slots, columns[:count]))
        return replace(values, displacements=dict(zip(self.names[count:], columns[count:], strict=True)))

    def _differentiable(self, array: Array, caller: str) -> Batch:
        """The batch, refused where poses vary and variants are computed one by one: these have no derivatives."""
        plan, batch = self._plan, self._batch(array)
        if plan.posed is not None and (batch.provenances is not None or not plan.at_once(batch.values)):
            moving = self.names[len(plan.slots.names)]
            raise ModelError(f"{caller}: no derivatives to the pose coordinate '{moving}': poses are computed one by "
                             f"one, as a parameter moves joints or points, or an element has no closed form in other "
                             f"poses. Compile the model of one pose, model.moved(...), without pose= for "
                             f"derivatives to its parameters.", element=moving, field="pose")  # fmt: skip
        return batch

    def _checked(self, values: ArrayLike) -> tuple[Array, bool]:
        """Values (n, p), and whether they are those of a single variant."""
        array, count = self._array(values, "values", "plant"), len(self.names)
        if array.ndim not in (1, 2) or array.shape[-1] != count or not len(array):
            raise ModelError(f"plant: values have the shape {array.shape}; expected ({count},) or (n, {count}), in the "
                             f"order of plant.names, '{self.names[0]}' first.", field="values")  # fmt: skip
        return np.atleast_2d(array), array.ndim == 1

    def _array(self, values: Any, field: str, caller: str) -> Array:
        array = reals(values, caller, field, "real numbers, one for each parameter", ModelError)
        if not np.isfinite(array).all():
            at = tuple(np.argwhere(~np.isfinite(array))[0].tolist())
            name = self.names[at[-1]] if at and at[-1] < len(self.names) else ""
            raise ModelError(f"{caller}: {field}{list(at)} = {array[at]}, of '{name}'; expected a finite number.",
                             element=name, field=field)  # fmt: skip
        return array

    def __repr__(self) -> str:
        return f"Plant({self.name!r}: {counted(len(self.names), 'parameter')}, {len(self.coordinates)} DOF)"


def compiled(
    model: Mechanism, parameters: str | Sequence[str] | None = None, cut: Sequence[str] | None = None,
    independent: Sequence[str] | None = None, pose: str | Sequence[str] | None = None, relaxed: bool = False,
) -> Plant:  # fmt: skip
    """Return the equations of a model as a function of some of its parameters and of its pose; see ``Model.compile``.
    """
    known = model.parameters
    patterns = ["*"] if parameters is None else names_in([parameters] if isinstance(parameters, str) else parameters)
    if patterns is None:
        raise ModelError(f"compile: parameters = {shown(parameters)}; expected names or patterns.", field="parameters")
    names = list(dict.fromkeys(name for pattern in patterns for name in known.matching(pattern)))
    moving = () if pose is None else pose_coordinates(model, pose)
    if not names and not moving:
        raise ModelError(f"compile: parameters = {shown(parameters)}; expected at least one.{nearest('', known)}",
                         field="parameters")  # fmt: skip
    slots = Slots.of(known, names)
    plan = batch_plan(model, slots, independent, cut, System)
    if moving:
        posed = PosedVariants.of(model, moving, names, relaxed, cut)
        plan = replace(plan, posed=posed, poses=None if posed.poses is None else posed.poses_of, relaxed=relaxed)
    entries = [known.entry(name) for name in names]
    nominal = np.array([entry.value for entry in entries] + [0.0] * len(moving))
    nominal.setflags(write=False)
    units = [entry.unit for entry in entries] + ["rad" if name.rpartition(".")[2][0] == "r" else "m" for name in moving]
    return Plant((*names, *moving), nominal, tuple(units), plan)
