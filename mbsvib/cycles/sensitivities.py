"""Exact derivatives of a cycle to masses, centres, inertias, lengths and all other numbers of finite motion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array
from mbsvib.common.columnar import Columnar
from mbsvib.common.display import Displayed
from mbsvib.cycles.elastic import parameter_derivatives, with_parameters
from mbsvib.cycles.result import CycleData


@dataclass(frozen=True, eq=False, repr=False)
class CycleSensitivities(Columnar, Displayed):
    """Derivatives to ``parameters`` (k) of the samples of a cycle: ``torques`` (k, n) by drive, ``shaking_force`` and
    ``shaking_moment`` (k, n, 3).
    """

    cycle: CycleData = field(repr=False)
    parameters: tuple[str, ...]
    torques: Mapping[str, Array] = field(repr=False)
    shaking_force: Array = field(repr=False)
    shaking_moment: Array = field(repr=False)

    @cached_property
    def reactions(self) -> Mapping[str, Array]:
        """Derivatives (k, n, 6) of the reactions by joint; not a number where these are undetermined."""
        from mbsvib.cycles.reactions import reaction_sensitivities

        return reaction_sensitivities(self.cycle, self.parameters)

    @property
    def torque(self) -> Any:
        """That of the only drive (k, n), else those of all drives by name."""
        return next(iter(self.torques.values())) if len(self.torques) == 1 else self.torques

    def columns(self) -> dict[str, Any]:
        """Return the derivatives, one parameter after the other, as columns by name.

        Returns
        -------
        dict of str to array, shape (k * n,)
            ``parameter``, ``sample``, from 1, and the torques, forces and moments as ``Cycle.columns`` names them.
        """
        count, samples = self.shaking_force.shape[:2]
        result = {"parameter": np.repeat(self.parameters, samples), "sample": np.tile(np.arange(1, samples + 1), count)}
        result |= {f"{name}.torque": values.ravel() for name, values in self.torques.items()}
        for name, vectors in (("shaking_force", self.shaking_force), ("shaking_moment", self.shaking_moment)):
            result |= {f"{name}.{axis}": vectors[:, :, i].ravel() for i, axis in enumerate("xyz")}
        return result

    def values(self, quantity: str, drive: str | None = None) -> Array:
        """Return the derivatives (k, n, 3) or (k, n, 1) of what ``CycleData.values`` returns."""
        self.cycle.values(quantity, drive)  # refuses what it does not know
        if quantity == "torque":
            return self.torques[self.cycle.drives[0] if drive is None else drive][:, :, None]
        return self.shaking_force if quantity == "force" else self.shaking_moment

    def square(self, quantity: str, drive: str | None = None) -> Array:
        """Return the derivatives (k,) of the mean square of a quantity, smooth where that is zero."""
        values = self.cycle.values(quantity, drive)
        result: Array = 2.0 * np.einsum("nc,knc->k", values, self.values(quantity, drive)) / len(values)
        return result

    def rms(self, quantity: str, drive: str | None = None) -> Array:
        """Return the derivatives (k,) of the root mean square of a quantity.

        Parameters
        ----------
        quantity : str
            "force", "moment" or "torque".
        drive : str, optional
            Which drive's torque; default: the only one.

        Returns
        -------
        array, shape (k,)
            Derivatives; not a number where the value is zero, which has none.

        Raises
        ------
        ModelError
            If there is no such quantity or drive.
        """
        value = self.cycle.rms(quantity, drive)
        return self.square(quantity, drive) / (2.0 * value) if value else np.full(len(self.parameters), np.nan)

    def peak(self, quantity: str, drive: str | None = None) -> Array:
        """Return the derivatives (k,) of the largest absolute value of a quantity, at the sample where it is.

        Parameters
        ----------
        quantity : str
            "force", "moment" or "torque".
        drive : str, optional
            Which drive's torque; default: the only one.

        Returns
        -------
        array, shape (k,)
            Derivatives; not a number where the value is zero, which has none.

        Raises
        ------
        ModelError
            If there is no such quantity or drive.
        """
        values = self.cycle.values(quantity, drive)
        sizes = np.linalg.norm(values, axis=1)
        i = int(sizes.argmax())
        if not sizes[i]:
            return np.full(len(self.parameters), np.nan)
        return np.asarray(self.values(quantity, drive)[:, i] @ values[i] / sizes[i])


def sensitivities(cycle: CycleData, parameters: Any = None) -> CycleSensitivities:
    """Return exact derivatives of a cycle; see ``Cycle.sensitivities``. ``parameters``: names or patterns."""
    names = _names(cycle, parameters)
    plant = with_parameters(cycle.machine, names)
    slopes = parameter_derivatives(plant).results[:, :, [plant.statement.names.index(name) for name in names]]
    drives = len(cycle.drives)
    torque = slopes[:, :drives].transpose(2, 1, 0)
    force, moment = (slopes[:, drives + k : drives + k + 3].transpose(2, 0, 1) for k in (0, 3))
    for array in (torque, force, moment):
        array.flags.writeable = False
    return CycleSensitivities(cycle, names, {name: torque[:, i] for i, name in enumerate(cycle.drives)}, force, moment)


def _names(cycle: CycleData, parameters: Any) -> tuple[str, ...]:
    known = cycle.machine.model.parameters
    if parameters is None:
        fields = ("mass", "position", "inertia")
        return tuple([name for name in known if known.entry(name).part in cycle.machine.model.bodies
                      and known.entry(name).field in fields])  # fmt: skip
    patterns = [parameters] if isinstance(parameters, str) else parameters
    if not hasattr(patterns, "__iter__"):
        raise check.refuse("cycle", "parameters", parameters, "names or patterns of parameters")
    return tuple(dict.fromkeys(name for pattern in patterns for name in known.matching(pattern)))
