"""What parameters change of the forces at the pose that is no parameter itself, and how both follow the bodies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_array

from mbsvib.elements import Bushing, Spring
from mbsvib.elements.beam import Beam
from mbsvib.elements.load import Gravity
from mbsvib.elements.superelement import Superelement
from mbsvib.elements.superelement_expansion import elastic_part
from mbsvib.linalg.vectors import cross, moved, wide
from mbsvib.sensitivities.beam_rules import middle_rates, motion_slopes, numbers, slopes
from mbsvib.sensitivities.internal_parameters import AXIS, MOTION, internal_parameters
from mbsvib.sensitivities.network import maxwell_lines
from mbsvib.sensitivities.part_rules import line_turn_rates

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.elements import Joint
    from mbsvib.mechanism.parameters import Parameter
    from mbsvib.sensitivities.forces import Forces
    from mbsvib.sensitivities.network import Network


@dataclass(frozen=True, slots=True)
class ForceLayout:
    """Where what is no parameter stands in one long row: points (n, 3) of forces, starts (lines, 3) of lines, wrenches
    (applied, 6) of applied forces, turns (k, 3) of joints with two successive rotations, and twists (bushings, 3) of
    the second bodies of bushings. ``joints`` come before the applied forces, ``lines`` gives the number of each line.
    """

    point: slice
    start: slice
    wrench: slice
    turn: slice
    twist: slice
    joints: int
    lines: dict[int, int]

    @staticmethod
    def of(forces: Forces) -> ForceLayout:
        """Return the places for some forces."""
        joints, count = forces.counts[0], len(forces.first)
        sizes = (3 * count, 3 * len(forces.lines), 6 * (count - joints), 3 * len(forces.twice),
                 3 * len(forces.bushings))  # fmt: skip
        ends = np.cumsum(sizes).tolist()
        point, start, wrench, turn, twist = (slice(end - size, end) for size, end in zip(sizes, ends, strict=True))
        lines = {k: i for i, k in enumerate(forces.lines.tolist())}
        return ForceLayout(point, start, wrench, turn, twist, joints, lines)

    @property
    def size(self) -> int:
        """Length of the row."""
        return int(self.twist.stop)

    def point_of(self, force: int) -> int:
        """Return where the point of a force begins."""
        return int(self.point.start) + 3 * force

    def start_of(self, force: int) -> int:
        """Return where the start of a line begins."""
        return int(self.start.start) + 3 * self.lines[force]

    def wrench_of(self, force: int) -> int:
        """Return where the wrench of an applied force begins."""
        return int(self.wrench.start) + 6 * (force - self.joints)


@dataclass(frozen=True)
class ForceChanges:
    """How parameters, by part, field and index in ``row``, act on what is no parameter: by ``matrix`` (p, e) on a long
    row, in which each has its place ``at``.
    """

    row: dict[tuple[str, str, tuple[int, ...]], int]
    at: ForceLayout
    matrix: csr_array

    @property
    def count(self) -> int:
        """Number of parameters, internal ones included."""
        return len(self.row)


class RowTerms:
    """RowTerms of a matrix with a row for each parameter, collected one by one.

    Parameters
    ----------
    row : dict
        Number of each parameter, by part, field and index.
    at : ForceLayout
        Places of what is no parameter.
    """

    def __init__(self, row: dict[tuple[str, str, tuple[int, ...]], int], at: ForceLayout) -> None:
        self.row, self.at = row, at
        self._terms: list[tuple[int, int, float]] = []

    def put(self, parameter: tuple[str, str, tuple[int, ...]], column: int, vector: Iterable[float]) -> None:
        """Let a parameter change the numbers from a column on; parts that the user did not give have none."""
        if parameter in self.row:
            row = self.row[parameter]
            self._terms += [(row, column + i, float(value)) for i, value in enumerate(vector) if value != 0.0]

    def along(self, part: str, field: str, column: int) -> None:
        """Let the three entries of a field change the three numbers from a column on."""
        for i in range(3):
            self.put((part, field, (i,)), column + i, (1.0,))

    def matrix(self, width: int) -> csr_array:
        """Return the matrix, (parameters, width)."""
        row, column, value = zip(*self._terms, strict=True) if self._terms else ((), (), ())
        return csr_array((value, (row, column)), shape=(len(self.row), width))


def force_changes(network: Network, forces: Forces, entries: Sequence[Parameter]) -> ForceChanges:
    """Return what parameters change of the forces at the pose."""
    at = ForceLayout.of(forces)
    keys = (*[(entry.part, entry.field, entry.index) for entry in entries], *internal_parameters(network))
    terms = RowTerms({key: k for k, key in enumerate(keys)}, at)
    joints, springs, bodies, _ = forces.counts
    weight = joints + springs
    for k, joint in enumerate(network.joints):
        if joint.end is not None:
            terms.along(joint.name, "position", at.start_of(k))
            terms.along(joint.name, "end", at.point_of(k))
        elif joint.position is not None:
            terms.along(joint.name, "position", at.point_of(k))
    for i, k in enumerate(forces.twice.tolist()):
        terms.along(network.joints[k].name, "orientation", int(at.turn.start) + 3 * i)
    for k, spring in enumerate(network.springs, joints):
        if isinstance(spring, Bushing):
            _bushing(terms, spring, k)
        else:
            _spring(terms, spring, k)
    for maxwell, k in maxwell_lines(network):
        terms.along(maxwell, "start", at.start_of(joints + k))
        terms.along(maxwell, "end", at.point_of(joints + k))
    for k, body in enumerate(network.bodies):
        terms.along(body.name, "position", at.point_of(weight + k))
        terms.put((body.name, "mass", ()), at.wrench_of(weight + k), forces.gravity)
        for i in range(3 if any(isinstance(part, Gravity) for part in network.parts) else 0):
            terms.put(("gravity", "", (i,)), at.wrench_of(weight + k) + i, (body.mass,))
    for k, load in enumerate(network.loads, weight + bodies):
        terms.along(load.name, "force", at.wrench_of(k))
        terms.along(load.name, "torque", at.wrench_of(k) + 3)
        owner = (load.body, "position") if load.position is None else (load.name, "position")
        terms.along(*owner, at.point_of(k))
    for beam in (part for part in network.parts if isinstance(part, Beam)):
        _beam(terms, network, forces, beam)
    for part in (part for part in network.parts if isinstance(part, Superelement)):
        _superelement(terms, network, forces, part)
    return ForceChanges(terms.row, at, terms.matrix(at.size))


def _beam(terms: RowTerms, network: Network, forces: Forces, beam: Beam) -> None:
    """Its elements carry forces at their midpoints, its nodes the weight and loads without points of their own."""
    number = {part.name: k for k, part in enumerate((*network.joints, *network.springs))}  # springs come later
    elements = [terms.at.point_of(number[name]) for name in beam.element_names]
    weight_of = {f"{beam.name}.weight{i}": i for i in range(len(beam.points))}
    node_of = {beam.body_of(i): i for i in range(len(beam.points)) if beam.body_of(i) in beam.node_names}
    loads = [(load, k) for load, k in zip(network.loads, forces.loads.tolist(), strict=True)]
    weights = [(weight_of[load.name], k) for load, k in loads if load.name in weight_of]
    at_nodes = [(node_of[load.body], k) for load, k in loads if load.position is None and load.body in node_of]
    for part, field, index in [key for key in terms.row if key[0] == beam.name]:
        change = motion_slopes(beam, index[0]) if field == MOTION else slopes(beam, field, index)
        for point, middle in zip(elements, middle_rates(change), strict=True):
            terms.put((part, field, index), point, middle)
        for i, k in at_nodes:
            terms.put((part, field, index), terms.at.point_of(k), change["points"][i])
        for i, k in weights:
            terms.put((part, field, index), terms.at.point_of(k), change["centres"][i])
            terms.put((part, field, index), terms.at.wrench_of(k), change["weight"][i] * forces.gravity)
    for i, k in weights:
        for j in range(3):
            terms.put(("gravity", "", (j,)), terms.at.wrench_of(k) + j, (numbers(beam)["weight"][i],))


def _superelement(terms: RowTerms, network: Network, forces: Forces, part: Superelement) -> None:
    """It acts at its nodes; the body that carries it takes its weight."""
    points = np.array([point for _, point in part.nodes])
    number = {spring.name: k for k, spring in enumerate(network.springs, len(network.joints))}
    elements = [(i, number[name]) for i, (node, _) in enumerate(part.nodes)
                if (name := f"{part.name}.{node}") in number]  # fmt: skip
    node_of = {part.body_of(i): i for i in range(len(points)) if part.body_of(i) in part.node_names}
    loads = list(zip(network.loads, forces.loads.tolist(), strict=True))
    weights = [(np.array(load.position), k) for load, k in loads if load.name == f"{part.name}.weight"]
    moving = [(points[i], k) for i, k in elements] + weights + [
        (points[node_of[load.body]], k) for load, k in loads if load.position is None and load.body in node_of]
    for i, way in enumerate(np.tile(np.eye(3), (2, 1))):
        for at, k in moving:
            terms.put((part.name, MOTION, (i,)), terms.at.point_of(k), way if i < 3 else np.cross(way, at - points[0]))
    for i, way in enumerate(np.eye(3) if weights else ()):
        for load in elastic_part(part, tuple(way.tolist())).loads:
            terms.put(("gravity", "", (i,)), terms.at.wrench_of(weights[0][1]), load.force)


def _spring(terms: RowTerms, spring: Spring, k: int) -> None:
    """Its force is -T e on the second body, with T as given, or k (L - L0)."""
    terms.along(spring.name, "start", terms.at.start_of(k))
    terms.along(spring.name, "end", terms.at.point_of(k))
    line, column = np.array(spring.line), terms.at.wrench_of(k)
    if spring.free_length is None:
        if spring.preload is not None:
            terms.put((spring.name, "preload", ()), column, -line)
        return
    terms.put((spring.name, "stiffness", ()), column, (spring.free_length - spring.length) * line)
    terms.put((spring.name, "free_length", ()), column, spring.stiffness * line)
    for i in range(3):
        for field, sign in (("start", 1.0), ("end", -1.0)):
            terms.put((spring.name, field, (i,)), column, sign * spring.stiffness * line[i] * line)


def _bushing(terms: RowTerms, bushing: Bushing, k: int) -> None:
    """Its wrench is its preload, in axes that turn with its orientation."""
    terms.along(bushing.name, "position", terms.at.point_of(k))
    if bushing.preload is None:
        return
    axes, column = np.array(bushing.orientation), terms.at.wrench_of(k)
    wrench = np.array(bushing.preload).reshape(2, 3) @ axes.T
    for i in range(6):
        terms.put((bushing.name, "preload", (i,)), column + 3 * (i // 3), axes[:, i % 3])
    terms.put((bushing.name, "preload", ()), column + 3, axes[:, 2])  # of torsion springs
    for i, unit in enumerate(np.eye(3)):
        terms.put((bushing.name, "orientation", (i,)), column, np.cross(unit, wrench).reshape(6))


def parameter_rates(network: Network, forces: Forces, changes: ForceChanges, motion: Array) -> Array:
    """Return how parameters change as bodies move, as those of a model do that is described in the new pose.

    ``motion`` (bodies, 6, c): motions at the centres of mass. Returns (parameters, c): changes of the parameters.
    """
    result = np.zeros((changes.count, motion.shape[2]))
    first, relative = forces.relative_motions(motion)
    second = first + relative
    start = first[:, :3] - cross(first[:, 3:], wide(forces.span, first))
    axes = first[:, 3:] + forces.turned_axes(relative)
    joints = forces.counts[0]

    def put(part: str, field: str, value: Array) -> None:
        for i in range(3 if (part, field, (0,)) in changes.row else 0):  # nodes of Maxwell elements have no parameters
            result[changes.row[part, field, (i,)]] = value[i]

    for k, part in enumerate(network.bodies):
        put(part.name, "position", motion[k, :3])
        put(part.name, "orientation", motion[k, 3:])
    for k, joint in enumerate(network.joints):
        if joint.end is not None:
            put(joint.name, "position", start[k])
            put(joint.name, "end", second[k, :3])
            continue
        put(joint.name, "position", second[k, :3])
        put(joint.name, "orientation", _by_axis(joint, axes[k]))
    for k, spring in enumerate(network.springs, joints):
        if isinstance(spring, Bushing):
            put(spring.name, "position", second[k, :3])
            put(spring.name, "orientation", axes[k])
        else:
            put(spring.name, "start", start[k])
            put(spring.name, "end", second[k, :3])
    for maxwell, k in maxwell_lines(network):
        put(maxwell, "start", start[joints + k])
        put(maxwell, "end", second[joints + k, :3])
    for k, load in zip(forces.loads, network.loads, strict=True):
        if load.position is not None:
            put(load.name, "position", second[k, :3])
    number = {body.name: k for k, body in enumerate(network.bodies)}
    for flexible in network.parts:
        if not isinstance(flexible, (Beam, Superelement)):
            continue
        body, point = flexible.node_bodies[0]
        if body != "ground":
            arm = np.array(point) - network.position[number[body]]
            shift = moved(motion[number[body]][None], arm[None])[0]
            for i in range(6):
                result[changes.row[flexible.name, MOTION, (i,)]] = shift[i]
    for name, (k, _) in ({} if network.spin is None else network.spin.rotor).items():
        put(name, AXIS, motion[k, 3:])
    return result


def _by_axis(joint: Joint, turn: Array) -> Array:
    """How the axes of a joint turn with its first body (3, c): where it is given by its axis, they are those that the
    axis gives in each pose.
    """
    if joint.axis is None or not joint.along_axis:
        return turn
    line = np.array(joint.axes)[:, 2]
    return np.asarray(line_turn_rates(line[None])[0].T @ np.cross(turn, line, axisa=0).T)


def force_rates(network: Network, forces: Forces, changes: ForceChanges, motion: Array) -> Array:
    """Return how forces change as bodies move, beyond what parameters say of it: springs by their stiffness, bushings
    by the turn between their bodies, followers with theirs.

    ``motion`` (bodies, 6, c): motions at the centres of mass. Returns (e, c): changes of the forces.
    """
    relative, joints, at = forces.relative_motions(motion)[1], forces.counts[0], changes.at
    result = np.zeros((at.size, motion.shape[2]))
    for k, spring in enumerate(network.springs, joints):
        displacement, entries = relative[k], slice(at.wrench_of(k), at.wrench_of(k) + 6)
        if isinstance(spring, Bushing):
            result[entries] = -network.stiffness[k - joints] @ displacement
            moment = forces.wrench[k, 3:]
            result[entries.start + 3 : entries.stop] += 0.5 * np.cross(displacement[3:], moment, axisa=0).T
        elif spring.free_length is None:
            line = np.array(spring.line)
            tension = -spring.stiffness * (line @ displacement[:3])
            result[entries.start : entries.start + 3] = np.multiply.outer(line, tension)
    result[at.twist] = relative[forces.bushings, 3:].reshape(3 * len(forces.bushings), relative.shape[2])
    for k in forces.follower.tolist():
        turned = np.cross(relative[k, 3:], forces.wrench[k].reshape(2, 1, 3), axisa=0)
        result[at.wrench_of(k) : at.wrench_of(k) + 6] = turned.transpose(0, 2, 1).reshape(6, -1)
    return result
