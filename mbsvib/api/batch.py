"""The batch: systems of many variants of one model, with the methods of a single system."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, TypeVar, cast, overload

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.api.elsewhere import tell_where
from mbsvib.api.system import System
from mbsvib.common.arrays import Array, Complex
from mbsvib.common.display import Displayed
from mbsvib.common.expected import angular
from mbsvib.common.tables import SHOWN
from mbsvib.equations.batch_equations import BatchEquations, of_variant
from mbsvib.equations.matrices import MATRICES
from mbsvib.errors import AccuracyWarning, ResponseError, counted
from mbsvib.responses.state_space import StateSpace

if TYPE_CHECKING:
    from mbsvib.modes.batch import BatchModes
    from mbsvib.responses.batch import BatchBasis


T = TypeVar("T")


@dataclass(frozen=True, repr=False, eq=False, kw_only=True)
class Batch(BatchEquations, Displayed):
    """Systems M_i q'' + C_i q' + K_i q = B_i u of n variants, all in the minimal coordinates of ``nominal``.

    Arrays are those of ``System`` with an axis of variants in front: ``M``, ``C``, ``K`` (n, m, m), ``B`` (n, m,
    inputs), ``Cq``, ``Cv``, ``Ca`` (n, outputs, m), ``D`` (n, outputs, inputs). They are read-only, and views of a
    single matrix where nothing varies. ``batch[i]`` is the system of variant i, ``nominal`` that of the model itself;
    ``values`` holds what varies, and ``closure`` (n, joint coordinates, m) is B'' where the geometry of loops does;
    ``provenances`` are those of variants that were linearized one by one; if ``own_decisions``, ``batch[i]`` computes
    its own static forces and its own motions without mass. ``gyroscopic`` and ``circulatory``
    (n, m, m) and ``null_inertia`` (n, m, massless) are None where no variant has them.
    """

    nominal: System

    @cached_property
    def basis(self) -> BatchBasis:
        """Cached modes of all variants."""
        from mbsvib.api.modes import Modes
        from mbsvib.responses.batch import BatchBasis

        return BatchBasis(self, Modes)

    def modes(self, rtol: float | None = None) -> BatchModes:
        """Return the modes of all variants.

        Parameters
        ----------
        rtol : float, optional
            Required relative accuracy of every eigenvalue, default 1e-10. A warning (AccuracyWarning) states the
            indices of variants whose error estimate stays larger.

        Returns
        -------
        BatchModes
            Eigenvalues, frequencies, damping ratios, shapes and error estimates with an axis of variants in front.
        """
        if rtol is None:
            return self.basis.modes
        result = self.basis.modes_within(rtol)
        inaccurate = np.flatnonzero(result.errors.max(axis=1, initial=0.0) > rtol)
        if len(inaccurate):
            warnings.warn(
                f"modes of '{self.name}': estimated relative error up to {result.errors.max():.1e} exceeds "
                f"rtol = {rtol:g} in {counted(len(inaccurate), 'variant')}, the first of which is {inaccurate[0]}.",
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

        w = angular(omega)
        modal = self.basis.modal
        if modal.damped is not None and len(w) * self.dof <= FEW:
            result = few_frequencies(self, modal.damped, np.abs(w))
            if np.isfinite(result).all():
                result[..., w < 0.0] = result[..., w < 0.0].conj()
                return result
        return np.array(self._map(lambda system: system.frequency_response(omega), described=False))

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
        return np.array(self._map(lambda system: system.time_response(t, u, hold, initial), described=False))

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
        return tuple(self._map(lambda system: system.state_space(realization)))

    def explain(self) -> str:
        """Return a description of the equations: those of the given pose, and the varied parameters."""
        names = list(self.parameters)
        shown = ", ".join(names[:SHOWN]) + (f", ... ({len(names)} in all)" if len(names) > SHOWN else "")
        fixed = [name for name in MATRICES if getattr(self, name).size and getattr(self, name).strides[0] == 0]
        lines = ["variants", f"  {counted(len(self), 'variant')} of {counted(len(names), 'parameter')}: {shown}"]
        if fixed:
            lines.append(f"  computed once, as nothing varies in them: {', '.join(fixed)}")
        return "\n".join([self.nominal.explain(), *lines])

    def _map(self, ask: Callable[[System], T], described: bool = True) -> list[T]:
        """Call a function for every variant, with the modes that were computed for all together; ``described``: with
        decisions of its own.
        """
        modal = self.basis.modal
        result = []
        for i in range(len(self)):
            system = self[i] if described else cast("System", of_variant(self, i))
            system.basis.assume(modal[i].damped)
            try:
                result.append(ask(system))
            except ResponseError as error:
                raise ResponseError(f"variant {i}: {error}") from error
        return result

    def __iter__(self) -> Iterator[System]:
        return (self[i] for i in range(len(self)))

    @overload
    def __getitem__(self, i: int) -> System: ...

    @overload
    def __getitem__(self, i: slice) -> list[System]: ...

    def __getitem__(self, i: int | slice) -> System | list[System]:
        if isinstance(i, slice):
            return [self[k] for k in range(*i.indices(len(self)))]
        return cast("System", super().__getitem__(i))

    def __repr__(self) -> str:
        return f"Batch({self.name!r}: {len(self)} variants, {self.dof} DOF)"


tell_where(Batch, System, "its systems have it: batch[0].{name}.")
