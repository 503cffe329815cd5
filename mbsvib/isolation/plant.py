"""A mechanism with actuators and sensors in its legs, as controllers see it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.errors import ModelError
from mbsvib.feedback.loop import LoopPlant
from mbsvib.isolation.study_scene import DISPLACEMENTS, StudyScene

if TYPE_CHECKING:
    from mbsvib.api.system import System
    from mbsvib.common.arrays import Array

HELD = 1e-12  # stiffness in parts of the largest, below which a motion is not held


@dataclass(frozen=True, repr=False, eq=False)
class Plant(LoopPlant):
    """A mechanism whose ``legs`` have actuators and sensors.

    ``system`` has the ports of an isolation study, and the inputs ``LEG.actuator`` [N], which push the ends of the leg
    apart, and the outputs ``LEG.force`` [N], the force in the leg as measured by a sensor in series with spring and
    actuator, ``LEG.stroke`` [m] and ``LEG.rate`` [m/s], its elongation, and ``LEG.acceleration`` [m/s^2], that
    of the isolated body where the leg ends, absolute, in the direction in which the actuator pushes this end.
    """

    system: System
    scene: StudyScene
    legs: tuple[str, ...]

    def names(self, port: str) -> tuple[str, ...]:
        """Return the names of one kind of port, leg after leg.

        Parameters
        ----------
        port : str
            actuator, force, stroke, rate or acceleration.

        Returns
        -------
        tuple of str
            Names of inputs or outputs.
        """
        return tuple([f"{leg}.{port}" for leg in self.legs])

    @cached_property
    def _static(self) -> tuple[Array, Array]:
        """Static shapes (m, 6) for unit displacements of the body, and its stiffness (6, 6)."""
        system = self.system
        rows = system.Cq[[system.outputs.index(name) for name in DISPLACEMENTS]]
        size = np.linalg.svd(system.K, compute_uv=False)
        if size[-1] <= HELD * size[0]:
            raise ModelError(f"active: '{self.scene.model.name}' has motions that no spring holds; control in modal "
                             f"coordinates needs a static stiffness.")  # fmt: skip
        compliant = np.linalg.solve(system.K, rows.T)
        stiffness = np.linalg.inv(rows @ compliant)
        return compliant @ stiffness, 0.5 * (stiffness + stiffness.T)

    @property
    def stiffness(self) -> Array:
        """Static stiffness of the body at the reference point, (6, 6), the other motions free."""
        return self._static[1]

    @property
    def mass(self) -> Array:
        """Mass that the body's static motions move, with the legs', at the reference point, (6, 6)."""
        shapes = self._static[0]
        return np.asarray(shapes.T @ self.system.M @ shapes)

    @property
    def wrenches(self) -> Array:
        """Wrench on the body at the reference point, (6, legs), that has the static effect of unit actuator forces."""
        system = self.system
        forces = system.B[:, [system.inputs.index(name) for name in self.names("actuator")]]
        return np.asarray(self._static[0].T @ forces)
