"""The batch: systems of many variants of one model, with the methods of a single system."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, TypeVar, overload

import numpy as np

from mbsvib.api.system import RESPONSE_RTOL, Provenance, System
from mbsvib.common.tables import SHOWN
from mbsvib.elements import Joint
from mbsvib.equations.equations import MATRICES
from mbsvib.errors import AccuracyWarning, ResponseError, counted

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from numpy.typing import ArrayLike, NDArray

    from mbsvib.common.arrays import Array, Complex
    from mbsvib.equations.batch_values import Values
    from mbsvib.modes.batch import BatchModes
    from mbsvib.responses.state_space import StateSpace


T = TypeVar("T")

FACTORS = ("inertia_factor", "elastic_rows", "stiffness", "damping", "body_motion")


@dataclass(frozen=True, repr=False, eq=False)
class Batch:
    """Systems M_i q'' + C_i q' + K_i q = B_i u of n variants, all in the minimal coordinates of ``nominal``.

    Arrays are those of ``System`` with an axis of variants in front: ``M``, ``C``, ``K`` (n, m, m), ``B`` (n, m,
    inputs), ``Cq``, ``Cv``, ``Ca`` (n, outputs, m), ``D`` (n, outputs, inputs). They are read-only, and views of a
    single matrix where nothing varies. ``batch[i]`` is the system of variant i, ``nominal`` that of the model as given;
    ``values`` holds what varies, and ``closure`` (n, joint coordinates, m) is B'' where the geometry of loops does;
    ``own`` is what each variant came from where they were linearized one by one.
    """

    nominal: System
    values: Values = field(repr=False)
    closure: Array | None = field(repr=False)
    M: Array
    C: Array
    K: Array
    B: Array
    Cq: Array
    Cv: Array
    Ca: Array
    D: Array
    inertia_factor: Array
    elastic_rows: Array
    stiffness: Array
    damping: Array
    row_owner: NDArray[np.intp]
    body_motion: Array
    own: tuple[Provenance, ...] | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        for name in (*MATRICES, *FACTORS, "row_owner"):
            getattr(self, name).setflags(write=False)

    @property
    def name(self) -> str:
        """Name of the model."""
        return self.nominal.name

    @property
    def dof(self) -> int:
        """Number of degrees of freedom, m."""
        return self.nominal.dof

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the minimal coordinates, those of the pose as given."""
        return self.nominal.coordinates

    @property
    def coordinate_units(self) -> tuple[str, ...]:
        """Units of the minimal coordinates."""
        return self.nominal.coordinate_units

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return self.nominal.inputs

    @property
    def input_units(self) -> tuple[str, ...]:
        """Units of the inputs."""
        return self.nominal.input_units

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return self.nominal.outputs

    @property
    def output_units(self) -> tuple[str, ...]:
        """Units of the outputs."""
        return self.nominal.output_units

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of the bodies."""
        return self.nominal.bodies

    @property
    def parameters(self) -> Mapping[str, Array]:
        """Values (n,) of the parameters that vary, by name."""
        return self.values.by_name

    def displacements(self, q: ArrayLike) -> dict[str, Array]:
        """Return the displacements of the bodies in all variants, x_i = B'_i B''_i q.

        Parameters
        ----------
        q : array-like, shape (m,) or (n, m)
            Minimal coordinates [m, rad], the same for all variants or one set for each.

        Returns
        -------
        dict of str to array, shape (n, 6)
            Translation of each body's centre of mass [m] and its rotation [rad], world axes.

        Raises
        ------
        ResponseError
            If ``q`` does not have one entry for each coordinate.
        """
        vector = np.asarray(q)
        if vector.shape not in ((self.dof,), (len(self), self.dof)):
            raise ResponseError(f"displacements: q has shape {vector.shape}; expected ({self.dof},), or "
                                f"({len(self)}, {self.dof}) with one set for each variant.")  # fmt: skip
        motion = (self.body_motion @ vector.reshape(len(vector) if vector.ndim > 1 else 1, 1, self.dof, 1))[..., 0]
        return {name: motion[:, i] for i, name in enumerate(self.bodies)}

    @cached_property
    def _modes(self) -> BatchModes:
        from mbsvib.modes import RTOL
        from mbsvib.modes.batch import batch_modes

        return batch_modes(self, RTOL)

    def _modes_within(self, rtol: float) -> BatchModes:
        from mbsvib.modes.batch import batch_modes

        return self._modes if float(self._modes.errors.max(initial=0.0)) <= rtol else batch_modes(self, rtol)

    @cached_property
    def _modal(self) -> BatchModes:
        """The bases of the responses, as accurate as those of single systems."""
        from mbsvib.modes.batch import batch_modes

        known = self.__dict__.get("_modes")
        if known is not None and float(known.errors.max(initial=0.0)) <= RESPONSE_RTOL:
            return self._modes
        return batch_modes(self, RESPONSE_RTOL)

    def modes(self, rtol: float | None = None) -> BatchModes:
        """Return the modes of all variants.

        Parameters
        ----------
        rtol : float, optional
            Relative accuracy asked of every eigenvalue, 1e-10 if none is. Variants whose error estimate stays larger
            are warned of by index (AccuracyWarning).

        Returns
        -------
        BatchModes
            Eigenvalues, frequencies, damping ratios, shapes and error estimates with an axis of variants in front.
        """
        if rtol is None:
            return self._modes
        result = self._modes_within(rtol)
        late = np.flatnonzero(result.errors.max(axis=1, initial=0.0) > rtol)
        if len(late):
            warnings.warn(
                f"modes of '{self.name}': estimated relative error up to {result.errors.max():.1e} exceeds "
                f"rtol = {rtol:g} in {counted(len(late), 'variant')}, the first of which is {late[0]}.",
                AccuracyWarning, stacklevel=2,
            )  # fmt: skip
        return result

    def frequency_response(self, omega: ArrayLike) -> Complex:
        """Return the frequency response of all variants.

        G_i(i w) = (Cq + i w Cv - w^2 Ca) (K + i w C - w^2 M)^-1 B + D

        Parameters
        ----------
        omega : array-like, shape (k,)
            Angular frequencies [rad/s].

        Returns
        -------
        array, shape (n, outputs, inputs, k)
            Complex responses [output unit / input unit].

        Raises
        ------
        ResponseError
            If a frequency is not finite, or is an undamped pole of a variant, by index.
        """
        from mbsvib.responses.batch import FEW, few_frequencies
        from mbsvib.responses.frequency_response import _checked

        w = _checked(omega)
        if len(w) * self.dof <= FEW:
            result = few_frequencies(self, self._modal, np.abs(w))
            if np.isfinite(result).all():
                result[..., w < 0.0] = result[..., w < 0.0].conj()
                return result
        return np.array(self._each(lambda system: system.frequency_response(omega)))

    def time_response(
        self, t: ArrayLike, u: ArrayLike, hold: str = "first", initial: tuple[ArrayLike, ArrayLike] | None = None
    ) -> Array:
        """Return the time response of all variants to the same inputs; exact as that of a single system.

        Parameters
        ----------
        t : array-like, shape (k,)
            Ascending times [s].
        u : array-like, shape (inputs, k), or (k,) for a single input
            Inputs at these times.
        hold : str
            "first": linear between samples; "zero": constant from each sample to the next.
        initial : pair of array-like, shape (m,), optional
            q and q' at t[0]; default: rest.

        Returns
        -------
        array, shape (n, outputs, k)
            Outputs at these times.

        Raises
        ------
        ResponseError
            If times do not ascend, shapes do not match, or the hold is unknown.
        """
        return np.array(self._each(lambda system: system.time_response(t, u, hold, initial)))

    def state_space(self, realization: str = "physical") -> tuple[StateSpace, ...]:
        """Return first-order equations x' = A x + B u, y = C x + D u of each variant.

        Parameters
        ----------
        realization : str
            "physical": x = (q, q'); "modal": one 2x2 block for each mode; "balanced": physical times powers of two.

        Returns
        -------
        tuple of StateSpace
            One for each variant.

        Raises
        ------
        ResponseError
            If the realization is unknown.
        """
        return tuple(self._each(lambda system: system.state_space(realization)))

    def explain(self) -> str:
        """Return in words how the equations came about: those of the pose as given, and what varies from it."""
        names = list(self.values.by_name)
        shown = ", ".join(names[:SHOWN]) + (f", ... ({len(names)} in all)" if len(names) > SHOWN else "")
        fixed = [name for name in MATRICES if getattr(self, name).size and getattr(self, name).strides[0] == 0]
        lines = ["variants", f"  {counted(len(self), 'variant')} of {counted(len(names), 'parameter')}: {shown}"]
        if fixed:
            lines.append(f"  computed once, as nothing varies in them: {', '.join(fixed)}")
        return "\n".join([self.nominal.explain(), *lines])

    def _each(self, ask: Callable[[System], T]) -> list[T]:
        """Ask every variant, with the modes that were computed for all at once."""
        modal = self._modal
        result = []
        for i, system in enumerate(self):
            system.__dict__["_modal"] = modal[i].damped  # where the system itself keeps them
            try:
                result.append(ask(system))
            except ResponseError as error:
                raise ResponseError(f"variant {i}: {error}") from error
        return result

    def __len__(self) -> int:
        return self.values.count

    def __iter__(self) -> Iterator[System]:
        return (self[i] for i in range(len(self)))

    @overload
    def __getitem__(self, i: int) -> System: ...

    @overload
    def __getitem__(self, i: slice) -> list[System]: ...

    def __getitem__(self, i: int | slice) -> System | list[System]:
        if isinstance(i, slice):
            return [self[k] for k in range(*i.indices(len(self)))]
        k = range(len(self))[i]
        used = (self.stiffness[k] != 0.0) | (self.damping[k] != 0.0)
        used &= self.elastic_rows[k].any(axis=1)
        arrays = {name: getattr(self, name)[k] for name in (*MATRICES, "inertia_factor", "body_motion")}
        arrays |= {name: getattr(self, name)[k][used] for name in ("elastic_rows", "stiffness", "damping")}
        return replace(self.nominal, row_owner=self.row_owner[used], provenance=self._provenance(k), **arrays)

    def piece(self, start: int, stop: int) -> Batch:
        """Return some of the variants as a batch of their own, without copying anything.

        Parameters
        ----------
        start, stop : int
            The first variant, and the one behind the last.

        Returns
        -------
        Batch
            Variants start .. stop - 1.
        """
        if (start, stop) == (0, len(self)):
            return self
        arrays = {name: getattr(self, name)[start:stop] for name in (*MATRICES, *FACTORS)}
        closure = None if self.closure is None else self.closure[start:stop]
        own = None if self.own is None else self.own[start:stop]
        return replace(self, values=self.values.slice(start, stop), closure=closure, own=own, **arrays)

    def _provenance(self, k: int) -> Provenance:
        """That of the pose as given, on which the choice of coordinates rests, with the variant's own numbers."""
        if self.own is not None:
            return self.own[k]
        given, values = self.nominal.provenance, self.values
        parts = tuple(values.part(part.name, k) if part.name in values.fields else part for part in given.parts)
        topology, reduction = given.topology, given.reduction
        if values.varies((Joint,)):
            own = [part for part in parts if isinstance(part, Joint)]
            topology = replace(topology, joints=tuple(own))
        if self.closure is not None:
            reduction = replace(reduction, matrix=self.closure[k])
        return replace(given, topology=topology, reduction=reduction, parts=parts)

    def __repr__(self) -> str:
        return f"Batch({self.name!r}: {len(self)} variants, {self.dof} DOF)"
