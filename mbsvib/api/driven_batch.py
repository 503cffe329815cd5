"""Systems of many variants with motions as inputs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.api.driven import Driven, DrivenSystem
from mbsvib.responses.driven import Drive, driven_response

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from mbsvib.api.state_space import StateSpace
    from mbsvib.common.arrays import Array, Complex


@dataclass(frozen=True, repr=False, eq=False)
class DrivenBatch(Driven):
    """Systems with motions as inputs of n variants, as ``Batch``; ``batch[i]`` is the ``DrivenSystem`` of variant i."""

    ends: Any
    """The batch with the motions of all ends as inputs."""
    drives: tuple[Drive, ...]
    """The inputs and how they act."""

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
        """Return the modes of all variants.

        Parameters
        ----------
        rtol : float, optional
            As of ``Batch.modes``.

        Returns
        -------
        BatchModes
            With an axis of variants in front.
        """
        return self.ends.modes(rtol)

    def frequency_response(self, omega: ArrayLike) -> Complex:
        """Return the frequency response of all variants.

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
            As of ``DrivenSystem.frequency_response``.
        """
        batch = self.ends
        result: Complex = driven_response(batch.frequency_response(omega), batch.nominal.inputs, self.drives, omega)
        return result

    def state_space(self, realization: str = "physical") -> tuple[StateSpace, ...]:
        """Return proper first-order equations of each variant.

        Parameters
        ----------
        realization : str
            As of ``Batch.state_space``.

        Returns
        -------
        tuple of StateSpace
            One for each variant.

        Raises
        ------
        ResponseError
            As of ``DrivenSystem.state_space``.
        """
        return tuple([self[i].state_space(realization) for i in range(len(self))])

    def time_response(self, t: ArrayLike, u: ArrayLike, hold: str = "first") -> Array:
        """Return the time response of all variants to the same inputs, from rest.

        Parameters
        ----------
        t : array-like, shape (k,)
            Ascending times [s].
        u : array-like, shape (inputs, k), or (k,) for a single input
            Inputs at these times.
        hold : str
            "first": linear between samples; "zero": constant from each sample to the next.

        Returns
        -------
        array, shape (n, outputs, k)
            Outputs at these times.

        Raises
        ------
        ResponseError
            As of ``DrivenSystem.state_space``, or if the data are refused.
        """
        return np.array([space.time_response(t, u, hold) for space in self.state_space()])
