"""The result of inverse dynamics over a cycle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array
from mbsvib.common.display import Displayed
from mbsvib.common.expected import one_of
from mbsvib.errors import ModelError

if TYPE_CHECKING:
    from mbsvib.cycles.machine import Machine

QUANTITIES = ("force", "moment", "torque")


@dataclass(frozen=True, repr=False, eq=False)
class CycleData(Displayed):
    """A running machine: its motion at n samples, drive torques, shaking force and moment; arrays are read-only.

    ``drives`` are the driven joint coordinates. ``coordinates``, ``rates`` and ``accelerations`` have arrays (n,) of
    all coordinates of the spanning tree by name, displacements from the pose as described [m, rad]. By body, in world
    axes: ``positions`` (n, 3) of the centre of mass [m], ``orientations`` (n, 3, 3), ``velocities`` (n, 6) [m/s, rad/s]
    and ``body_accelerations`` (n, 6) [m/s^2, rad/s^2]. ``torques`` (n,) by drive [N m, N] move the mechanism against
    inertia, gravity, springs, dampers and loads. ``shaking_force`` (n, 3) [N] and ``shaking_moment`` (n, 3) [N m] about
    ``about`` (3,) are what the inertia of all bodies does to the ground, world axes.
    """

    machine: Machine = field(repr=False)
    drives: tuple[str, ...]
    coordinates: Mapping[str, Array]
    rates: Mapping[str, Array]
    accelerations: Mapping[str, Array]
    positions: Mapping[str, Array]
    orientations: Mapping[str, Array]
    velocities: Mapping[str, Array]
    body_accelerations: Mapping[str, Array]
    torques: Mapping[str, Array]
    shaking_force: Array
    shaking_moment: Array
    about: Array

    @property
    def torque(self) -> Any:
        """The torque of the drive (n,) [N m, N]; of several drives, a mapping of these by drive."""
        return self.torques[self.drives[0]] if len(self.drives) == 1 else self.torques

    @property
    def angles(self) -> Array:
        """Values (n,) of the first drive [rad, m]."""
        return self.coordinates[self.drives[0]]

    def values(self, quantity: str, drive: str | None = None) -> Array:
        """Return a quantity at every sample.

        Parameters
        ----------
        quantity : str
            "force", "moment" or "torque".
        drive : str, optional
            Which drive's torque; default: the only one.

        Returns
        -------
        array, shape (n, 3) or (n, 1)
            Its components.

        Raises
        ------
        ModelError
            If there is no such quantity or drive.
        """
        if one_of(quantity, QUANTITIES, "cycle", "quantity", ModelError) != "torque":
            return self.shaking_force if quantity == "force" else self.shaking_moment
        name = self.drives[0] if drive is None and len(self.drives) == 1 else drive
        if name is None or name not in self.torques:
            raise check.refuse("cycle", "drive", drive, f"one of the drives: {', '.join(self.drives)}")
        return self.torques[name][:, None]

    def rms(self, quantity: str, drive: str | None = None) -> float:
        """Return the root mean square of a quantity over the samples.

        sqrt(1/n sum of |x_i|^2); over a full turn, leave out the sample at its end that repeats the first.

        Parameters
        ----------
        quantity : str
            "force" [N], "moment" [N m] or "torque".
        drive : str, optional
            Which drive's torque; default: the only one.

        Returns
        -------
        float
            Its value.

        Raises
        ------
        ModelError
            If there is no such quantity or drive.
        """
        return float(np.sqrt((self.values(quantity, drive) ** 2).sum(axis=1).mean()))

    def peak(self, quantity: str, drive: str | None = None) -> float:
        """Return the largest absolute value of a quantity over the samples.

        Parameters
        ----------
        quantity : str
            "force" [N], "moment" [N m] or "torque".
        drive : str, optional
            Which drive's torque; default: the only one.

        Returns
        -------
        float
            Its value.

        Raises
        ------
        ModelError
            If there is no such quantity or drive.
        """
        return float(np.sqrt((self.values(quantity, drive) ** 2).sum(axis=1).max()))

    def table(self) -> dict[str, Any]:
        """Return the table of rms values and peaks as arguments of ``mbsvib.common.tables.text`` and ``show``."""
        rows = [(f"shaking {quantity} [{unit}]", f"{self.rms(quantity):.7g}", f"{self.peak(quantity):.7g}")
                for quantity, unit in (("force", "N"), ("moment", "N m"))]  # fmt: skip
        for drive in self.drives:
            unit = "N m" if drive.rpartition(".")[2].startswith("r") else "N"
            rows.append((f"torque at {drive} [{unit}]" if unit == "N m" else f"force at {drive} [{unit}]",
                         f"{self.rms('torque', drive):.7g}", f"{self.peak('torque', drive):.7g}"))  # fmt: skip
        at = " ".join(f"{entry:.6g}" for entry in self.about)
        notes = [f"{len(self.shaking_force)} samples; moments about ({at}) m.",
                 *(f"Doubtful: {text}" for text in self.machine.model.doubts)]  # fmt: skip
        return {"title": f"Cycle of {self.machine.model.name}", "columns": [("", "left"), ("rms", "right"),
                ("peak", "right")], "rows": rows, "notes": notes}  # fmt: skip

    def __repr__(self) -> str:
        return (f"Cycle({self.machine.model.name!r}: {len(self.shaking_force)} samples, driven by "
                f"{', '.join(self.drives)})")  # fmt: skip
