"""Active legs: actuators in parallel with the legs of a mechanism, and their sensors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.api import loops
from mbsvib.api.model import Model
from mbsvib.api.system import System
from mbsvib.common.arrays import Array
from mbsvib.common.display import Displayed
from mbsvib.common.expected import a_model
from mbsvib.common.selection import Names
from mbsvib.errors import ModelError, ResponseError, counted
from mbsvib.feedback.closed_loop import close, connected
from mbsvib.feedback.controller import Controller, as_controller
from mbsvib.feedback.feedback_loop import FeedbackLoop
from mbsvib.feedback.loop import LoopPlant
from mbsvib.isolation.isolation_study import Isolation, figures
from mbsvib.isolation.struts import ActiveLeg, active_legs
from mbsvib.isolation.study_scene import DISPLACEMENTS, StudyScene, scene
from mbsvib.mechanism.mechanism import GROUND

HELD = 1e-12  # stiffness in parts of the largest, below which a motion is not held


class StudyFigures(FeedbackLoop):
    """What closed loops of a study answer, in continuous or discrete time."""

    plant: Active
    """The system with force actuators and sensors in its legs."""

    def isolation(self, frequencies: ArrayLike | None = None) -> Isolation:
        """Return the figures of the closed loop.

        Parameters
        ----------
        frequencies : array-like, shape (n,), optional
            Ascending frequencies [Hz]; default: the band of the mechanism with open loops, resolving every resonance of
            open and closed ones.

        Returns
        -------
        Isolation
            Transmissibility, compliance and figures.

        Raises
        ------
        ResponseError
            If the loop is not stable.
        """
        self.check_stable()
        return figures(self.plant.scene, self, frequencies)


class SampledLoop(StudyFigures, loops.SampledLoop):
    """A closed loop of a study whose controllers run in discrete time."""


class ClosedLoop(StudyFigures, loops.ClosedLoop):
    """A mechanism with controllers; has the inputs and outputs of ``plant.system``, actuators take further forces."""

    sampled_form = SampledLoop


@dataclass(frozen=True, repr=False, eq=False)
class Active(LoopPlant, Displayed):
    """A mechanism whose ``legs`` have actuators, ready for control: its figures, and its loops closed.

    ``system`` has, in addition to the ports of an isolation study, the inputs ``LEG.actuator`` [N], which push the ends
    of the leg apart, and the outputs ``LEG.force`` [N], the force in the leg as measured by a sensor in series with
    spring and actuator, ``LEG.stroke`` [m] and ``LEG.rate`` [m/s], its elongation, and ``LEG.acceleration`` [m/s^2],
    that of the isolated body where the leg ends, absolute, in the direction in which the actuator pushes this end.
    Inputs and outputs of the model itself come first and keep their names.
    """

    _engine = "scene space"

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

    def feedback(
        self, controller: Any, sensors: Names = None, actuators: Names = None, name: str | None = None
    ) -> ClosedLoop | Any:
        """Return the closed loop with a controller from any sensors to any actuators, u = w + K y.

        Parameters
        ----------
        controller : Controller, StateSpace, control.StateSpace, control.TransferFunction or array-like
            An array, shape (actuators, sensors), is a static gain. One of python-control in discrete time runs at its
            sample time, behind a zero-order hold.
        sensors, actuators : str or sequence of str, optional
            Names or patterns of outputs and of inputs; default: the names that the controller has.
        name : str, optional
            Name of the controller in tables.

        Returns
        -------
        ClosedLoop, or SampledLoop with a discrete controller
            The mechanism with the loop closed.

        Raises
        ------
        ResponseError
            If a name is unknown, shapes do not match, or a discrete controller has no sample time or a pole at z = -1.
        """
        return connected(self, controller, sensors, actuators, name, ClosedLoop)

    def with_gains(self, *controllers: Any) -> ClosedLoop:
        """Return the closed loop; several controllers act together (HAC-LAC: an inner and an outer one).

        Parameters
        ----------
        *controllers : Controller, StateSpace, control.StateSpace or control.TransferFunction
            Their signals have the names of sensors and actuators. Outputs on the same actuator add up.

        Returns
        -------
        ClosedLoop
            The mechanism with all loops closed.
        """
        laws = [law if isinstance(law, Controller) else as_controller(law, self.system) for law in controllers]
        return cast("ClosedLoop", close(self, *laws, form=ClosedLoop))

    def isolation(self, frequencies: ArrayLike | None = None) -> Isolation:
        """Return the figures with open loops.

        Parameters
        ----------
        frequencies : array-like, shape (n,), optional
            Ascending frequencies [Hz].

        Returns
        -------
        Isolation
            Transmissibility, compliance and figures.
        """
        return figures(self.scene, self.system, frequencies)

    def __repr__(self) -> str:
        return f"Active({self.scene.model.name!r}: {counted(len(self.legs), 'actuator')})"


def check_plant(plant: Any, who: str) -> Active:
    """Return a plant of a study, refuse what is none."""
    if not isinstance(plant, Active):
        raise ResponseError(f"{who}: plant = {type(plant).__name__}; expected a plant with actuators, "
                            f"isolation.actuated(model, body).")  # fmt: skip
    return plant


def actuated(
    model: Model, body: str, legs: Sequence[str] | None = None, base: str = GROUND, *, point: ArrayLike | None = None,
    length: float | None = None, directions: Sequence[str] | None = None,
) -> Active:  # fmt: skip
    """Return a mechanism with an actuator in parallel with the springs of each leg, and sensors.

    Parameters
    ----------
    model : Model
        The mechanism; it stays as it is. Its inputs and outputs are kept.
    body : str
        The isolated body.
    legs : sequence of str, optional
        Names or patterns of legs that get actuators: line springs, Maxwell elements, prismatic and cylindrical joints,
        and directions of bushings (``"mount1.z"``). Default: all line springs and Maxwell elements, without any of
        these all prismatic joints. ``[]``: none, where the model has actuators and sensors of its own.
    base : str
        What is shaken: the ground, or a body whose motion is prescribed.
    point : array-like, shape (3,), optional
        Reference point on base and body [m]; default: the body's centre of mass.
    length : float, optional
        Length [m] that makes rotations comparable.
    directions : sequence of str, optional
        In which the base is shaken.

    Returns
    -------
    Active
        The plant.

    Raises
    ------
    ModelError
        If a name is unknown, a leg has no line, or an input or output of the model has the name of a port.
    """
    a_model(model, "actuated")
    selected = active_legs(model, legs)
    active: list[ActiveLeg] = []

    def add_ports(changed: Model) -> None:
        for leg in selected:
            if leg.elements[0] not in changed.springs and leg.elements[0] not in changed.joints:
                raise ModelError(f"actuated: leg '{leg.name}' is below the base '{base}'; choose legs above it.",
                                 element=leg.name, field="legs")  # fmt: skip
        active.extend(active_legs(changed, [leg.name for leg in selected]) if selected else ())
        attached = _attached_bodies(changed, body, {name for leg in active for name in leg.elements})
        for leg in active:
            _add_ports(changed, body, leg, attached)

    study_scene = scene(model, body, base, point, length, directions, keep_ports=True, more=add_ports)
    return Active(_with_tensions(study_scene.system, active), study_scene, tuple([leg.name for leg in active]))


def _add_ports(model: Model, body: str, leg: ActiveLeg, attached: set[str]) -> None:
    """Add the actuator and the sensors of a leg; tensions of elements in parallel are outputs of their own."""
    ends = leg.start, leg.first
    model.add_input(f"{leg.name}.actuator", leg.second, leg.axis, *ends)
    if f"{leg.name}.stroke" not in model.outputs:
        model.add_output(f"{leg.name}.stroke", leg.second, leg.axis, *ends)
    model.add_output(f"{leg.name}.rate", leg.second, leg.axis, *ends, quantity="velocity")
    for name, direction, _ in leg.forces:
        if _part(leg, name) not in model.outputs:  # else the study of the passive leg has it
            model.add_force_output(_part(leg, name), name, direction)
    away = leg.first in attached and leg.second not in attached
    end, outward = (leg.start, -leg.axis) if away else (leg.end, leg.axis)
    model.add_output(f"{leg.name}.acceleration", body, outward, end, quantity="acceleration")


def _part(leg: ActiveLeg, element: str) -> str:
    return f"{leg.name}.force" if len(leg.forces) == 1 else f"{leg.name}.force.{element}"


def _with_tensions(system: System, legs: Sequence[ActiveLeg]) -> System:
    """The system whose outputs ``LEG.force`` are the force of the whole leg, as a sensor in series measures it: the
    sum over its elements less the force of its actuator.
    """
    outputs = tuple(dict.fromkeys([*system.outputs, *(f"{leg.name}.force" for leg in legs)]))
    units = dict.fromkeys(outputs, "N") | dict(zip(system.outputs, system.output_units, strict=True))
    sums, direct = np.eye(len(outputs), len(system.outputs)), np.zeros((len(outputs), len(system.inputs)))
    for leg in legs:
        row = outputs.index(f"{leg.name}.force")
        sums[row] = 0.0
        for name, _, factor in leg.forces:
            sums[row, system.outputs.index(_part(leg, name))] = factor
        direct[row, system.inputs.index(f"{leg.name}.actuator")] = 1.0
    rows = {key: sums @ getattr(system, key) for key in ("Cq", "Cv", "Ca")}
    result = replace(system, outputs=outputs, output_units=tuple(units.values()), D=sums @ system.D - direct, **rows)
    inner = {_part(leg, name) for leg in legs if len(leg.forces) > 1 for name, _, _ in leg.forces}
    return result.with_ports([name for name in outputs if name not in inner]) if inner else result


def _attached_bodies(model: Model, body: str, legs: set[str]) -> set[str]:
    """The bodies that are connected to the isolated one by elements other than legs, not through the ground."""
    pairs = [(part.first, part.second) for group in (model.joints, model.springs) for part in group.values()
            if part.name not in legs]  # fmt: skip
    attached, last = {body}, 0
    while len(attached) > last:
        last = len(attached)
        for pair in pairs:
            if GROUND not in pair and not attached.isdisjoint(pair):
                attached.update(pair)
    return attached
