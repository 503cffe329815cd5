"""Hubs: what steady rotation adds to the equations of all that is on a hub, in the frame that turns with it.

With W the angular velocity of the frame and A = |W|^2 1 - W W^T, a mass m at r from a point of the axis has the force
m A r at rest, the stiffness -m A and the Coriolis term 2 m [W]x. A tensor J, with the momentum h = J W, and
that of rotors on the body, has the torque -W x h, and adds

K = [W]x J [W]x - [W]x [h]x,     C = tr(J) [W]x - 2 [J W]x,

the derivatives of that torque to rotation vectors and their rates. So a body has a load and a cross-coupled bushing
from the hub, an element of a beam loads at its nodes and rows that its nodes share. Tension, and its stiffness,
follow as those of any load.

Source: Meirovitch, Methods of Analytical Dynamics (1970), section 4.3, for motion in rotating frames.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.elements import Body
from mbsvib.elements import beam_element as element
from mbsvib.elements.beam import Beam
from mbsvib.elements.beam_expansion import rotated
from mbsvib.elements.bushing import Bushing
from mbsvib.elements.joint import Joint
from mbsvib.elements.joint import make as make_joint
from mbsvib.elements.load import Load
from mbsvib.elements.shared_rows import Node, SharedRows
from mbsvib.equations.inertia import inertia_tensor
from mbsvib.errors import ModelError
from mbsvib.linalg.rotations import skew
from mbsvib.mechanism.mechanism import GROUND, Mechanism

M = TypeVar("M", bound=Mechanism)
# Directions are printed with six or seven digits.
SLACK = 1e-6
_VARIES = "the equations would vary with time, which is not supported"


def on_hubs(model: Mechanism) -> dict[str, str]:
    """Return the hub of each body that turns, the hubs themselves included, by name.

    What joints, elements and shared rows connect turns together; the ground connects nothing.
    """
    neighbours: dict[str, set[str]] = {name: set() for name in model.bodies}
    links = [{part.first, part.second} for group in (model.joints, model.springs) for part in group.values()]
    links += [{body for body, _ in part.node_bodies} for part in model.composed.values()]
    if model.expansion is not None:
        links += [{name for node in rows.nodes for name in (node.body, node.relative_to)}
                  for rows in (*model.expansion.mass, *model.expansion.elastic)]  # fmt: skip
    for link in links:
        for name in link - {GROUND}:
            neighbours.setdefault(name, set()).update(link - {GROUND, name})
    result: dict[str, str] = {}
    for hub in model.hubs:
        front = [hub]
        while front:
            body = front.pop()
            if result.get(body, hub) != hub or (body != hub and body in model.hubs):
                raise ModelError(f"hub '{hub}': body '{body}' is on hub '{result.get(body, body)}' too; {_VARIES}.",
                                 element=hub, field="name")  # fmt: skip
            if body not in result:
                result[body] = hub
                front += neighbours[body]
    return result


def velocity(hub: Any) -> Array:
    """Return the angular velocity (3,) of a hub [rad/s], world axes."""
    return np.asarray(hub.speed * np.array(hub.axis))


def centrifugal(hub: Any) -> Array:
    """Return A = |W|^2 1 - W W^T (3, 3), the centrifugal acceleration by the distance from a point of the axis."""
    w = velocity(hub)
    return np.asarray(w @ w * np.eye(3) - np.outer(w, w))


def turning(model: M, beams: Mapping[str, Beam]) -> M:
    """Return an expanded mechanism whose hubs are held, with the forces and terms of the frames that turn with them."""
    of, hubs = on_hubs(model), model.hubs
    check_steady(model, of)
    for output in model.outputs.values():
        if output.element == GROUND:
            raise ModelError(f"output '{output.name}': the sum of forces on the ground beside hub '{next(iter(hubs))}' "
                             f"is not available in linear equations; ask for the forces in joints on the hub, or "
                             f"model.simulate.", element=output.name, field="element")  # fmt: skip
    joints, loads, springs = holding(model), dict(model.loads), dict(model.springs)
    for name, body in model.bodies.items():
        if name not in of or name in hubs:
            continue
        momentum = sum((rotor.inertia * rotor.speed * np.array(rotor.axis) for rotor in model.rotors.values()
                        if rotor.body == name and rotor.inertia is not None), np.zeros(3))  # fmt: skip
        if not (body.mass or any(body.inertia) or momentum.any()):
            continue
        load, bushing = _of_body(body, hubs[of[name]], np.asarray(momentum))
        loads[load.name], springs[bushing.name] = load, bushing
    elastic, gyroscopic = [], []
    for beam in beams.values():
        hub = hub_of(beam, of, hubs)
        if hub is None:
            continue
        loads |= {load.name: load for load in _beam_loads(beam, hub)}
        terms = [_beam_terms(beam, hub, i) for i in range(len(beam.points) - 1)]
        elastic += [stiff for stiff, _ in terms]
        gyroscopic += [coriolis for _, coriolis in terms]
        springs |= {spring.name: spring for spring in _section_torques(beam, hub, loads)}
    assert model.expansion is not None
    expansion = replace(model.expansion, elastic=(*model.expansion.elastic, *elastic), gyroscopic=tuple(gyroscopic))
    return model.with_parts(joints=joints, loads=loads, springs=springs, expansion=expansion)


def on_held(model: M) -> M:
    """Return a mechanism with joints that hold its hubs, if there are any."""
    return model.with_parts(joints=holding(model)) if model.hubs else model


def holding(model: Mechanism) -> dict[str, Joint]:
    """Return the joints of a mechanism and those that hold its hubs in their frame."""
    names = [held(name) for name in model.hubs]
    return dict(model.joints) | {joint: make_joint(joint, "fixed", GROUND, hub, None, None, None, None, None, None)
                                 for joint, hub in zip(names, model.hubs, strict=True)}  # fmt: skip


def held(hub: str) -> str:
    """Return the name of the joint that holds a hub."""
    return f"{hub}.held"


def hub_of(beam: Beam, of: dict[str, str], hubs: Any) -> Any:
    """Return the hub on which a beam turns, or None."""
    return next((hubs[of[body]] for body in map(beam.body_of, range(len(beam.points))) if body in of), None)


def _of_body(body: Body, hub: Any, momentum: Array) -> tuple[Load, Bushing]:
    """Return the force and torque at rest of a body with rotors of this angular momentum (3,), and its terms."""
    w, tensor = velocity(hub), inertia_tensor(body)
    stiffness, damping = np.zeros((6, 6)), np.zeros((6, 6))
    field, spin, total = centrifugal(hub), skew(w), tensor @ w + momentum
    stiffness[:3, :3], damping[:3, :3] = -body.mass * field, 2.0 * body.mass * spin
    stiffness[3:, 3:] = spin @ tensor @ spin - spin @ skew(total)
    damping[3:, 3:] = np.trace(tensor) * spin - 2.0 * skew(tensor @ w)
    force = body.mass * field @ (np.array(body.position) - np.array(hub.position))
    load = Load(f"{body.name}.centrifugal", body.name, _vector(force), _vector(-np.cross(w, total)))
    return load, Bushing(f"{body.name}.turning", hub.name, body.name, body.position, _matrix(stiffness),
                         _matrix(damping))  # fmt: skip


def _vector(array: Array) -> tuple[float, float, float]:
    x, y, z = array.tolist()
    return (x, y, z)


def _matrix(array: Array) -> tuple[tuple[float, ...], ...]:
    return tuple(map(tuple, array.tolist()))


def falls(model: Mechanism, beams: Sequence[Beam]) -> list[Array]:
    """Return the acceleration of gravity and hubs at the middle of the elements of beams (elements, 3) [m/s^2]."""
    of = on_hubs(model) if model.hubs else {}
    result = []
    for beam in beams:
        hub = hub_of(beam, of, model.hubs)
        own = np.zeros((len(beam.points) - 1, 3)) if hub is None else fall(beam, hub)
        result.append(own + (0.0 if model.gravity is None else np.array(model.gravity)))
    return result


def fall(beam: Beam, hub: Any) -> Array:
    """Return the centrifugal acceleration at the middle of each element of a beam (elements, 3) [m/s^2]."""
    points = np.array([beam.middle(i) for i in range(len(beam.points) - 1)])
    return np.asarray((points - np.array(hub.position)) @ centrifugal(hub))


def _beam_loads(beam: Beam, hub: Any) -> list[Load]:
    """Return the centrifugal forces on the nodes of a beam: consistent nodal loads, as ``Beam.node_weights``.

    The acceleration is a in the middle of an element and changes by d from there to its end. On its start act m a / 2
    at its ``arm``, L / 6 if of constant section, and -``odd_load`` d, then -m d / 5 at L / 12; on its end the same
    with + d: forces and moments of the static deflection, and the points turn with the nodes.
    """
    field, accelerations, lengths = centrifugal(hub), fall(beam, hub), beam.lengths()
    result = []
    for i, (a, length) in enumerate(zip(accelerations, lengths, strict=True)):
        start, end = (np.array(beam.points[k]) for k in (i, i + 1))
        part, change = beam.element(length), field @ (end - start) / 2.0
        odd, near = part.odd_load
        for k, at, toward, sign in ((i, start, end, -1.0), (i + 1, end, start, 1.0)):
            body = beam.body_of(k)
            for suffix, force, arm in (("a", 0.5 * part.mass * a, part.arm), ("b", sign * odd * change, near)):
                if body != GROUND and force.any():
                    result.append(Load(f"{beam.name}.centrifugal{i}{'se'[k - i]}{suffix}", body, _vector(force),
                                       position=_vector(at + (toward - at) * (arm / length))))  # fmt: skip
    return result


def _beam_terms(beam: Beam, hub: Any, i: int) -> tuple[SharedRows, SharedRows]:
    """Return the rows of element i with centrifugal stiffness, and those with Coriolis terms.

    They are those of its mass at points along it. Sections turn about the beam's axis, and where it has shear
    deformation about all axes, with their inertia tensor.
    """
    frame, points = np.array(beam.frames()[i][1]), _mass_points(beam, i)
    w, spin = velocity(hub), skew(velocity(hub))
    tensors = frame @ (points.sections[:, :, None] * np.eye(3)) @ frame.T
    momenta = skew(tensors @ w)
    of_rotation = spin @ tensors @ spin - spin @ momenta
    of_rates = np.trace(tensors, axis1=1, axis2=2)[:, None, None] * spin - 2.0 * momenta
    moves, turns = (frame @ rotated(rows, beam.frames()[i][1]) for rows in (points.moves, points.turns))
    rows, values = [], []
    for stiffness, motion in ((-points.masses[:, None, None] * centrifugal(hub), moves),
                              (0.5 * (of_rotation + of_rotation.swapaxes(1, 2)), turns)):  # fmt: skip
        sizes, vectors = np.linalg.eigh(stiffness)
        rows.append((vectors.swapaxes(1, 2) @ motion).reshape(-1, 12))
        values.append(sizes.reshape(-1))
    matrix = (moves.swapaxes(1, 2) @ (2.0 * points.masses[:, None, None] * spin) @ moves
              + turns.swapaxes(1, 2) @ of_rates @ turns).sum(axis=0)  # fmt: skip
    nodes = tuple([Node(beam.body_of(k), beam.points[k]) for k in (i, i + 1)])
    every, weights = _fewest(np.concatenate(rows), np.concatenate(values))
    return (SharedRows(beam.name, nodes, every, stiffness=weights),
            SharedRows(beam.name, nodes, np.eye(12), gyroscopic=0.5 * (matrix - matrix.T)))  # fmt: skip


def _mass_points(beam: Beam, i: int) -> element.MassPoints:
    """The mass of element i at points along it, that of its length without forces."""
    length, unloaded = beam.frames()[i][0], beam.lengths()[i]
    masses, sections, moves, turns = beam.element(length).mass_points()
    return element.MassPoints(unloaded / length * masses, unloaded / length * sections, moves, turns)


def _fewest(rows: Array, values: Array) -> tuple[Array, Array]:
    """At most as many rows of either sign as columns, with the same sum of weighted squares."""
    parts, signs = [], []
    for sign in (-1.0, 1.0):
        used = sign * values > 0.0
        part = rows[used] * np.sqrt(np.abs(values[used]))[:, None]
        parts.append(np.linalg.qr(part, mode="r") if len(part) > rows.shape[1] else part)
        signs.append(np.full(len(parts[-1]), sign))
    return np.concatenate(parts), np.concatenate(signs)


def _section_torques(beam: Beam, hub: Any, loads: dict[str, Load]) -> list[Bushing]:
    """Add the torques on a beam's sections as loads on its nodes, and return what makes their stiffness symmetric.

    The torque -W x J W of a section follows from a potential; on a fixed one, in K, acts -1/2 [t]x, which is taken out.
    """
    w, result = velocity(hub), []
    for i, (_, frame) in enumerate(beam.frames()):
        axes = np.array(frame)
        tensor = axes @ np.diag(_mass_points(beam, i).sections.sum(axis=0)) @ axes.T
        torque = -0.5 * np.cross(w, tensor @ w)
        if not beam.element(beam.lengths()[i]).sections_turn:
            torque = axes[:, 0] * (axes[:, 0] @ torque)
        if np.linalg.norm(torque) <= SLACK**2 * np.trace(tensor) * (w @ w):
            continue
        for k in (i, i + 1):
            if beam.body_of(k) in (GROUND, hub.name):
                continue
            name, matrix = f"{beam.name}.torque{i}{'se'[k - i]}", np.zeros((6, 6))
            loads[name] = Load(name, beam.body_of(k), torque=_vector(torque))
            matrix[3:, 3:] = 0.5 * skew(torque)
            result.append(Bushing(name, hub.name, beam.body_of(k), beam.points[k], _matrix(matrix)))
    return result


def refuse_superelements(model: Mechanism) -> None:
    """Refuse superelements on hubs.

    With displacements sum of phi_i x_i, the Coriolis and centrifugal terms are the integrals of rho phi_i phi_j^T, of
    which M has the traces only; and K does not contain the stiffness of the tension that the rotation makes.
    """
    of = on_hubs(model) if model.superelements else {}
    for part in model.superelements.values():
        for hub in {of[body] for body, _ in part.node_bodies if body in of}:
            raise ModelError(f"superelement '{part.name}' on hub '{hub}': M, C and K determine neither the centrifugal "
                             f"and Coriolis forces on its mass nor the stiffness of the tension that these make; "
                             f"describe it by beams, bodies and bushings.", element=part.name)  # fmt: skip


def check_steady(model: Mechanism, of: dict[str, str]) -> None:
    """Refuse what does not turn along steadily, by the names of the hub and of the part."""
    for group, what in ((model.joints, "joins"), (model.springs, "acts between")):
        for part in group.values():
            if GROUND in (part.first, part.second):
                body = part.second if part.first == GROUND else part.first
                if body in of and part.name != held(of[body]):
                    _refuse(model, of[body], part.name, f"{what} the ground and body '{body}', which turns with it")
    for load in model.loads.values():
        if load.body in of and not load.follower:
            for value in (load.force, load.torque):
                if _off_axis(model.hubs[of[load.body]], value):
                    _refuse(model, of[load.body], load.name, "keeps its direction in the world, off the axis; "
                            "a follower load turns along")  # fmt: skip
    for rotor in model.rotors.values():
        if rotor.body in of and rotor.inertia is None:
            _refuse(model, of[rotor.body], rotor.name, "spins as a whole body; give the inertia of what spins on it")
    for hub in model.hubs.values():
        if model.gravity is not None and _off_axis(hub, model.gravity) and len(of) > len(model.hubs):
            _refuse(model, hub.name, "gravity", "does not act along the axis")
    for source in model.inputs.values():
        if source.moves_ground:
            _refuse(model, next(iter(model.hubs)), source.name, "moves the ground below it")


def _off_axis(hub: Any, value: Any) -> bool:
    across = np.cross(np.array(hub.axis), np.array(value))
    return bool(np.linalg.norm(across) > SLACK * np.linalg.norm(value))


def _refuse(model: Mechanism, hub: str, part: str, why: str) -> None:
    raise ModelError(f"hub '{hub}' of model '{model.name}': '{part}' {why}; {_VARIES}.", element=part, field="hub")
