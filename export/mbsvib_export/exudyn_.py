"""exudyn: the same mechanism for large motion, contact and friction, and for a second opinion."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from mbsvib.api.model import Model
from mbsvib.common.arguments import shown
from mbsvib.common.arrays import Array
from mbsvib.elements import Body, Bushing, Spring
from mbsvib.elements.joint import Joint
from mbsvib.elements.load import Load
from mbsvib.elements.motion_input import DrivenCoordinate
from mbsvib.elements.ports import Input, Output
from mbsvib.equations.expansion import expanded
from mbsvib.errors import ExportError, LeftOutWarning
from mbsvib.linalg.rotations import logarithm
from mbsvib_export.packages import need

Signal = float | Callable[[float], float]

_AXES = ("x", "y", "z", "rx", "ry", "rz")
# Kinds whose constraints in exudyn are the same in every pose.
_GENERIC = frozenset({"revolute", "prismatic", "cylindrical", "universal", "spherical", "planar", "fixed",
                      "point_on_line", "point_on_plane"})  # fmt: skip


def to_exudyn(model: Model, inputs: Mapping[str, Signal] | None = None) -> Any:
    """Return a mechanism as a system of exudyn, with the same names, in redundant coordinates.

    Bodies, joints, springs, bushings and outputs become items of exudyn with their names; loads and inputs have
    ``.force`` or ``.torque`` behind their names, and ``.reaction`` those on the other body. An output is a user sensor
    that gives the displacement from the described pose, its rate or acceleration. Of inputs between two bodies force
    and reaction turn each with its body; outputs keep their directions in the world. The system is assembled:
    ``mbs.SolveDynamic()`` simulates it; ``mbs.ComputeLinearizedSystem`` gives its matrices, after ``mbs.SolveStatic()``
    where gravity or loads act.

    Parameters
    ----------
    model : Model
        The mechanism.
    inputs : mapping of str to float or callable, optional
        Values of inputs over time [N, N m]: constants, or functions of the time [s]; default: 0.

    Returns
    -------
    exudyn.MainSystem
        The system; its container is ``mbs.variables["container"]``.

    Raises
    ------
    ExportError
        If exudyn is not installed, or has nothing for a part: named, with what to do.

    Warns
    -----
    LeftOutWarning
        Of base motions and outputs of forces, which the system does without.
    """
    exu = need("exudyn", "to_exudyn")
    if not isinstance(model, Model):
        raise ExportError(f"to_exudyn: model = {type(model).__name__}; expected a Model, as exudyn linearizes and "
                          f"simulates by itself.")  # fmt: skip
    if inputs is not None and not isinstance(inputs, Mapping):
        raise ExportError(f"to_exudyn: inputs = {shown(inputs)}; expected the values of inputs by name, such as "
                          f"{{'F': 10.0}}. The result is a system of exudyn in memory, no file.")  # fmt: skip
    plain = expanded(model)
    signals = dict(inputs or {})
    _check(model, plain, signals)
    scene = _Scene(exu, plain)
    for joint in plain.joints.values():
        scene.add_joint(joint)
    for part in plain.springs.values():
        scene.add_spring(part)
    for load in plain.loads.values():
        scene.add_load(load)
    for source in plain.inputs.values():
        if isinstance(source, Input):
            scene.add_input(source, signals.get(source.name, 0.0))
    for port in plain.outputs.values():
        if isinstance(port, Output) and isinstance(model.outputs[port.name], Output):
            scene.add_output(port)
    scene.mbs.Assemble()
    return scene.mbs


class _Scene:
    """The system, and the numbers of its bodies."""

    def __init__(self, exu: Any, model: Any) -> None:
        from exudyn import itemInterface, utilities

        items: Any = itemInterface
        inertia: Any = utilities.RigidBodyInertia
        self.exu, self.items, self.model = exu, items, model
        self.loads = {"force": items.LoadForceVector, "torque": items.LoadTorqueVector}
        container = exu.SystemContainer()
        self.mbs = container.AddSystem()
        self.mbs.variables["container"] = container
        self.numbers = {"ground": self.mbs.CreateGround()}
        self.frames: dict[str, tuple[Array, Array]] = {"ground": (np.zeros(3), np.eye(3))}
        gravity = [0.0, 0.0, 0.0] if model.gravity is None else list(model.gravity)
        for name, body in model.bodies.items():
            origin, axes = np.array(body.position), np.array(body.orientation)
            self.frames[name] = origin, axes
            self.numbers[name] = self.mbs.CreateRigidBody(
                name=name, referencePosition=origin, referenceRotationMatrix=axes, gravity=gravity,
                inertia=inertia(mass=body.mass, inertiaTensor=_tensor(body)),
            )  # fmt: skip

    def marker(self, body: str, point: Any, axes: Array | None = None) -> int:
        """A marker on a body at a point, with axes, both in the world."""
        origin, body_axes = self.frames[body]
        local = np.eye(4)
        local[:3, :3] = body_axes.T @ (body_axes if axes is None else axes)
        local[:3, 3] = body_axes.T @ (np.array(point) - origin)
        return int(self.mbs.AddMarker(self.items.MarkerBodyRigid(bodyNumber=self.numbers[body], localHT=local)))

    def add_joint(self, joint: Joint) -> None:
        """Add the constraints of a joint."""
        if joint.kind == "distance":
            pair = [self.marker(joint.first, joint.position), self.marker(joint.second, joint.end)]
            length = float(np.linalg.norm(np.subtract(joint.end, joint.position)))  # type: ignore[arg-type]
            self.mbs.AddObject(self.items.ObjectConnectorDistance(name=joint.name, markerNumbers=pair, distance=length))
            return
        point = joint.point or self.frames[joint.second][0]
        axes, free = np.array(joint.axes), {direction for direction, _ in joint.freedom}
        if len(free) == 6:
            return
        self.mbs.AddObject(self.items.ObjectJointGeneric(
            name=joint.name, constrainedAxes=[int(direction not in free) for direction in _AXES],
            markerNumbers=[self.marker(joint.first, point, axes), self.marker(joint.second, point, axes)]))  # fmt: skip

    def add_spring(self, part: Any) -> None:
        """Add a line spring or a bushing."""
        if isinstance(part, Spring):
            pair = [self.marker(part.first, part.start), self.marker(part.second, part.end)]
            self.mbs.AddObject(self.items.ObjectConnectorSpringDamper(
                name=part.name, markerNumbers=pair, referenceLength=part.length, stiffness=part.stiffness,
                damping=part.damping, force=part.tension))  # fmt: skip
            return
        axes = np.array(part.orientation)
        self.mbs.AddObject(self.items.ObjectConnectorRigidBodySpringDamper(
            name=part.name, stiffness=_matrix(part.stiffness), damping=_matrix(part.damping),
            markerNumbers=[self.marker(part.first, part.position, axes),
                           self.marker(part.second, part.position, axes)]))  # fmt: skip

    def add_load(self, load: Load) -> None:
        """Add a constant force and torque."""
        axes = self.frames[load.body][1]
        point = self.frames[load.body][0] if load.position is None else load.position
        for kind, vector in (("force", load.force), ("torque", load.torque)):
            if any(vector):
                load_vector = axes.T @ np.array(vector) if load.follower else np.array(vector)
                item = self.loads[kind]
                self.mbs.AddLoad(item(
                    name=f"{load.name}.{kind}", markerNumber=self.marker(load.body, point), loadVector=load_vector,
                    bodyFixed=load.follower))  # fmt: skip

    def add_input(self, port: Input, signal: Signal) -> None:
        """Add a force or torque over time, and its reaction."""
        point = self.frames[port.body][0] if port.position is None else port.position
        turns = port.relative_to != "ground"
        for body, kind, direction in _ends(port):
            name = f"{port.name}.{kind}{'' if body == port.body else '.reaction'}"
            along = self.frames[body][1].T @ direction if turns else direction
            kwargs: dict[str, Any] = {"loadVector": along * signal} if not callable(signal) else {
                "loadVector": along, "loadVectorUserFunction": _varying(signal)}  # fmt: skip
            self.mbs.AddLoad(self.loads[kind](
                name=name, markerNumber=self.marker(body, point), bodyFixed=turns, **kwargs))  # fmt: skip

    def add_output(self, port: Output) -> None:
        """Add a sensor of a component of the motion of a body against another."""
        variable = self.exu.OutputVariableType
        linear, angular = {
            "displacement": (variable.Displacement, variable.RotationMatrix),
            "velocity": (variable.Velocity, variable.AngularVelocity),
            "acceleration": (variable.Acceleration, variable.AngularAcceleration),
        }[port.quantity]
        point = self.frames[port.body][0] if port.position is None else port.position
        sensors, parts = [], []
        for body, kind, along in _ends(port):
            origin, axes = self.frames[body]
            measured = linear if kind == "force" else angular
            sensors.append(self.mbs.AddSensor(self.items.SensorBody(
                bodyNumber=self.numbers[body], localPosition=axes.T @ (np.array(point) - origin),
                outputVariableType=measured, storeInternal=True)))  # fmt: skip
            parts.append((along, axes if measured == variable.RotationMatrix else None))
        self.mbs.AddSensor(self.items.SensorUserFunction(
            name=port.name, sensorNumbers=sensors, storeInternal=True,
            sensorUserFunction=_component(parts)))  # fmt: skip


def _ends(port: Input | Output) -> Iterator[tuple[str, str, Array]]:
    """Bodies between which a port acts or measures, and the forces and torques on each that are not zero."""
    for body, sign in ((port.body, 1.0), (port.relative_to, -1.0)):
        for kind, part in (("force", port.wrench[:3]), ("torque", port.wrench[3:])):
            if body != "ground" and any(part):
                yield body, kind, sign * np.array(part)


def _varying(signal: Callable[[float], float]) -> Callable[..., list[float]]:
    def load(mbs: Any, t: float, vector: Any) -> list[float]:
        value = float(signal(t))
        return [value * entry for entry in vector]

    return load


def _component(parts: list[tuple[Array, Array | None]]) -> Callable[..., list[float]]:
    """The function of a sensor: components of vectors, and of the rotation vector since the described pose."""

    def value(mbs: Any, t: float, sensors: Any, factors: Any, configuration: Any) -> list[float]:
        total = 0.0
        for sensor, (along, axes) in zip(sensors, parts, strict=True):
            measured = np.array(mbs.GetSensorValues(sensor, configuration))
            if axes is not None:
                measured = logarithm(measured.reshape(1, 3, 3) @ axes.T)[0]
            total += float(along @ measured)
        return [total]

    return value


def _tensor(body: Body) -> Array:
    xx, yy, zz, xy, xz, yz = body.inertia
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _matrix(value: Any) -> Array:
    array = np.array(value, dtype=float)
    return np.diag(array) if array.ndim == 1 else array


def _check(model: Model, plain: Any, signals: Mapping[str, Signal]) -> None:
    """Refuse what exudyn has nothing for, by name; warn of what is left out."""

    def refuse(who: str, why: str) -> None:
        raise ExportError(f"to_exudyn: {who}: {why}")

    for part in model.composed.values():
        refuse(part.name, "flexible parts are not exported; take exudyn's own beams or FFRF objects there.")
    for name, part in model.springs.items():
        if part.body_positions:
            refuse(name, f"exudyn has no {part.family}; leave it out, or simulate by model.simulate.")
        if part.law is None or part.law.energy is not None:
            refuse(name, f"the force of a {part.family} is not linear; simulate by model.simulate.")
        if isinstance(part, Spring) and min(part.stiffness, part.damping) < 0.0:
            refuse(name, "exudyn takes no line spring with a stiffness or damping below 0; simulate by model.simulate.")
    for kind, group in (("hub", plain.hubs), ("coupler", plain.couplers), ("rotor", plain.rotors),
                        ("rolling wheel", plain.rolling)):  # fmt: skip
        for name in group:
            refuse(name, f"exudyn has no {kind} like this one; leave it out, or simulate by model.simulate.")
    for name, body in plain.bodies.items():
        if not body.mass or not min(body.inertia[:3]):
            refuse(name, "a body without mass or moment of inertia is none in exudyn; give it some.")
    for name, joint in plain.joints.items():
        turns = {direction for direction, _ in joint.freedom} & {"rx", "ry", "rz"}
        if joint.kind not in _GENERIC | {"distance", "free"} and (joint.kind in {"screw", "homokinetic"}
                                                                 or len(turns) == 2):  # fmt: skip
            refuse(name, f"exudyn has no joint of the kind '{joint.kind}' that is the same in every pose.")
    for name, part in plain.springs.items():
        if not isinstance(part, (Spring, Bushing)):
            refuse(name, f"exudyn has no {part.family}; leave it out, or simulate by model.simulate.")
        if isinstance(part, Bushing) and part.loaded:
            refuse(name, "a bushing with a preload follows another law in exudyn; give the force as a load.")
    for source in plain.inputs.values():
        if isinstance(source, DrivenCoordinate):
            refuse(source.source, f"coordinate '{source.element}' is driven, which exudyn would leave free.")
    for name in signals:
        if name not in plain.inputs:
            raise ExportError(f"to_exudyn: inputs: '{name}' is not an input of '{model.name}'; it has "
                              f"{', '.join(plain.inputs) or 'none'}.")  # fmt: skip
    left_out = [name for name, port in plain.inputs.items() if not isinstance(port, Input)]
    left_out += [name for name, port in model.outputs.items() if not isinstance(port, Output)]
    if left_out:
        warnings.warn(f"to_exudyn: left out, as exudyn has no base motion and its sensors of forces differ: "
                      f"{', '.join(left_out)}.", LeftOutWarning, stacklevel=3)  # fmt: skip
