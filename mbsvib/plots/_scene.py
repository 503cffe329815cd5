"""Geometry of a mechanism for pictures: points fixed to bodies, lines and faces between them, shapes of parts.

A point between two bodies (on a spring) moves by a share of either: u = (1 - s) u_first(p) + s u_second(q). So the
picture of any displacement of the bodies is one product, and no drawing needs to know of joints.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mbsvib.common.arrays import Array, Index
from mbsvib.elements import Body, Input, Joint
from mbsvib.elements.connection import Connection
from mbsvib.elements.part import Composed, Part
from mbsvib.equations.equations import Provenance
from mbsvib.equations.expansion import expanded
from mbsvib.mechanism.mechanism import GROUND, Mechanism
from mbsvib.mechanism.topology import span

FLAT = 1e-4  # share of the size below which points lie in a line or a plane
LEAD = 0.14  # share of a spring's length that is straight at either end


@dataclass(frozen=True, slots=True, eq=False)
class Outline:
    """Points, polylines (kind and point numbers) and triangles that represent a body."""

    points: Array
    polylines: tuple[tuple[str, tuple[int, ...]], ...]
    faces: tuple[tuple[int, int, int], ...] = ()


def outline(centre: Array, attachments: Array, size: float) -> Outline:
    """Return the outline of a body: a bar, a plate or a hull between its connection points.

    ``centre`` (3,): its centre of mass. ``attachments`` (n, 3): where joints and springs hold it, each point once.
    ``size``: extent of the mechanism [m]. Returns its lines and faces; none where it is held at its centre only.
    """
    points = np.concatenate((attachments, centre[None]))
    if not len(attachments):
        return Outline(points, ())
    spread, axes = _principal(attachments)
    rank = int(np.count_nonzero(spread > FLAT * size))
    if rank >= 2:
        ring, faces = _plate(attachments @ axes[:2].T) if rank == 2 else _hull(attachments)
        off = _distance(centre, attachments, axes, rank) > 0.02 * size
        corners = sorted({i for polyline in ring for i in polyline}) if off else []
        polylines: list[tuple[str, tuple[int, ...]]] = [("body", polyline) for polyline in ring]
        return Outline(points, (*polylines, *(("spoke", (len(attachments), i)) for i in corners)), faces)
    inline, axes = _principal(points)
    if np.count_nonzero(inline > FLAT * size) <= 1:
        return Outline(points, (("body", tuple(np.argsort(points @ axes[0], kind="stable").tolist())),))
    return Outline(points, tuple([("body", (len(attachments), i)) for i in range(len(attachments))]))


def coil(start: Array, end: Array, radius: float, turns: int, per_turn: int) -> tuple[Array, Array]:
    """Return the points (n, 3) of a coil spring from start to end, and their positions along it, (n,) from 0 to 1."""
    span = end - start
    length = float(np.linalg.norm(span))
    along = span / length
    across = np.cross(along, np.eye(3)[np.abs(along).argmin()])
    across /= np.linalg.norm(across)
    third = np.cross(along, across)
    angle = np.linspace(0.0, 2.0 * np.pi * turns, turns * per_turn + 1)
    share = np.linspace(LEAD, 1.0 - LEAD, len(angle))
    r = min(radius, 0.12 * length) * np.minimum(1.0, np.minimum(angle, angle[-1] - angle) / np.pi)
    points = start + share[:, None] * span + r[:, None] * (
        np.cos(angle)[:, None] * across + np.sin(angle)[:, None] * third)  # fmt: skip
    return np.concatenate((start[None], points, end[None])), np.concatenate(([0.0], share, [1.0]))


def _principal(points: Array) -> tuple[Array, Array]:
    """Extents of points along their principal axes, and these axes as rows."""
    moved = points - points.mean(axis=0)
    _, _, axes = np.linalg.svd(moved, full_matrices=True)
    return np.ptp(moved @ axes.T, axis=0), axes


def _distance(centre: Array, attachments: Array, axes: Array, rank: int) -> float:
    """Distance of the centre from the plane of the points, 0 inside of a hull."""
    return abs(float((centre - attachments.mean(axis=0)) @ axes[2])) if rank == 2 else 0.0


def _plate(flat: Array) -> tuple[list[tuple[int, ...]], tuple[tuple[int, int, int], ...]]:
    from scipy.spatial import ConvexHull

    ring = ConvexHull(flat).vertices.tolist()
    faces = tuple((ring[0], ring[i], ring[i + 1]) for i in range(1, len(ring) - 1))
    return [(*ring, ring[0])], faces


def _hull(attachments: Array) -> tuple[list[tuple[int, ...]], tuple[tuple[int, int, int], ...]]:
    from scipy.spatial import ConvexHull

    hull = ConvexHull(attachments)
    edges = set()
    for face, neighbours in enumerate(hull.neighbors):
        for neighbour in neighbours:
            # edges between triangles of one flat side are not drawn
            if not np.allclose(hull.equations[face], hull.equations[neighbour], atol=1e-6):
                edges.add(tuple(sorted(set(hull.simplices[face].tolist()) & set(hull.simplices[neighbour].tolist()))))
    return sorted(edges), tuple((int(i), int(j), int(k)) for i, j, k in hull.simplices)


AXIS, ARROW, FOOT = 0.045, 0.13, 0.032  # sizes of joint axes, of input arrows and of feet, as shares of the size
SECOND_HEAD = 0.25  # distance of the two heads of a torque, as a share of its arrow
COIL, TURNS = 0.016, 6  # radius of a spring, as a share of the size, and its turns
FEW_SPRINGS = 60  # more than these are drawn with fewer points
# A pyramid below points on the ground, and a polyline along all of its edges.
_FOOT = np.array([(0.0, 0.0, 0.0), (0.6, 0.6, -1.0), (-0.6, 0.6, -1.0), (-0.6, -0.6, -1.0), (0.6, -0.6, -1.0)])
_FOOT_WAY = (0, 1, 2, 0, 3, 4, 0, 4, 1, 2, 3)


@dataclass(frozen=True, slots=True)
class Line:
    """A line through points ``first`` to ``last`` (exclusive); ``kind`` is body, beam, spoke, spring, damper, gap, rod,
    axis, ground or input, ``name`` that of the element.
    """

    kind: str
    name: str
    first: int
    last: int


@dataclass(frozen=True, slots=True)
class Mark:
    """A marker at a point; ``kind`` is body, node, joint, cut or bushing, ``words`` what to tell of it."""

    kind: str
    name: str
    point: int
    words: str


@dataclass(frozen=True, slots=True, eq=False)
class DrawnScene:
    """A mechanism as points, lines, marks and triangles.

    Points (n,) ride on body ``first`` at ``start`` and on body ``second`` at ``end`` (n, 3), with ``share`` of the
    latter; ``position`` (bodies + 1, 3) are the bodies' origins, ground last. ``points`` (n, 3) are where they are at
    rest, ``size`` [m] is the extent of all. ``faces`` (f, 3) are triangles of points, ``face_body`` (f,) whose.
    """

    name: str
    bodies: tuple[str, ...]
    position: Array
    points: Array
    first: Index
    second: Index
    share: Array
    start: Array
    end: Array
    lines: tuple[Line, ...]
    marks: tuple[Mark, ...]
    faces: Index
    face_body: Index
    size: float

    def displacements(self, motion: ArrayLike) -> NDArray[Any]:
        """Return the displacements of all points, (n, 3, ...), of those of the bodies, (bodies, 6, ...)."""
        motions = np.asarray(motion)
        moves = np.concatenate((motions, np.zeros((1, *motions.shape[1:]), motions.dtype)))
        share = self.share.reshape(-1, *[1] * (motions.ndim - 1))
        ends = [_rigid_displacement(moves[body], at - self.position[body])
                for body, at in ((self.first, self.start), (self.second, self.end))]  # fmt: skip
        return np.asarray((1.0 - share) * ends[0] + share * ends[1])


def of_model(model: Mechanism) -> DrawnScene:
    """Return the scene of a model, also for open loops and singular poses."""
    plain = expanded(model.with_parts(rolling={}))
    cut = set(span(plain).cut_joints) if plain.bodies else set()
    groups = (model.bodies, model.joints, model.springs, model.composed, model.inputs)
    return _scene(model.name, [part for group in groups for part in group.values()], cut)


def of_system(name: str, provenance: Provenance) -> DrawnScene:
    """Return the scene of the linearized model of a system."""
    cut = set(provenance.topology.cut_joints)
    return _scene(name, [*provenance.parts, *provenance.ports], cut, provenance.topology.bodies)


def _scene(name: str, parts: Sequence[Any], cut: set[str], bodies: Sequence[str] | None = None) -> DrawnScene:
    positions = {body: position for part in parts for body, position in part.body_positions.items()}
    names = tuple(positions) if bodies is None else tuple(bodies)
    builder = _Builder({body: i for i, body in enumerate((*names, GROUND))}, positions, _extent(parts, positions))
    springs = sum(part.symbol == "spring" for part in parts)
    hinges = {frozenset((part.first, part.second)): part.position for part in parts
              if part.symbol == "joint" and part.position is not None}  # fmt: skip
    draw: dict[str, Callable[[Any], None]] = {
        "joint": lambda part: builder.joint(part, part.name in cut),
        "spring": lambda part: builder.spring(part, fine=springs <= FEW_SPRINGS),
        "bushing": lambda part: builder.bushing(part, hinges.get(frozenset((part.first, part.second)))),
        "composed": builder.composed, "arrow": builder.arrow, "body": builder.body,
    }  # fmt: skip
    for part in sorted(parts, key=lambda part: part.symbol == "body"):  # bodies last, with all points that hold them
        if part.symbol in draw:
            draw[part.symbol](part)
    return builder.scene(name, names)


def _extent(parts: Iterable[Part], positions: Mapping[str, tuple[float, ...]]) -> float:
    points: list[Any] = list(positions.values())
    for part in parts:
        points += [getattr(part, key) for key in part.point_fields]
    return float(np.linalg.norm(np.ptp(np.array(points), axis=0))) or 1.0 if points else 1.0


@dataclass(slots=True)
class _Builder:
    """Collects points, lines and marks."""

    number: Mapping[str, int]
    positions: Mapping[str, tuple[float, ...]]
    size: float
    rest: list[Any] = field(default_factory=list)
    rides: list[tuple[int, int, float, Any, Any]] = field(default_factory=list)
    lines: list[Line] = field(default_factory=list)
    marks: list[Mark] = field(default_factory=list)
    faces: list[tuple[int, int, int]] = field(default_factory=list)
    face_body: list[int] = field(default_factory=list)
    attachments: dict[str, list[Any]] = field(default_factory=dict)

    def point(self, body: str, at: Any) -> int:
        i = self.number[body]
        self.rest.append(at)
        self.rides.append((i, i, 0.0, at, at))
        return len(self.rest) - 1

    def line(self, kind: str, name: str, ends: Sequence[tuple[str, Any]]) -> None:
        start = len(self.rest)
        for body, at in ends:
            self.point(body, at)
        self.lines.append(Line(kind, name, start, len(self.rest)))

    def mark(self, kind: str, name: str, body: str, at: Any, words: str) -> None:
        self.marks.append(Mark(kind, name, self.point(body, at), words))

    def attach(self, body: str, at: Any) -> None:
        """Add a connection point of a body, which extends the body's outline."""
        attachments = self.attachments.setdefault(body, [])
        if not any(np.allclose(at, point, rtol=0.0, atol=1e-6 * self.size) for point in attachments):
            attachments.append(at)
            if body == GROUND:
                foot = np.asarray(at) + FOOT * self.size * _FOOT
                self.line("ground", GROUND, [(GROUND, foot[i]) for i in _FOOT_WAY])

    def joint(self, part: Joint, cut: bool) -> None:
        moving = part.second if part.second != GROUND else part.first
        at = np.array(self.positions[moving] if part.position is None else part.position)
        self.attach(part.first, at)
        self.attach(part.second, at if part.end is None else part.end)
        if part.end is not None:
            self.line("rod", part.name, [(part.first, at), (part.second, part.end)])
        axes = np.array(part.axes)
        for i in part.drawn:
            reach = AXIS * self.size * axes[:, i]
            self.line("axis", part.name, [(part.first, at - reach), (part.first, at + reach)])
        if not part.locked:
            return
        words = f"{part.kind} joint between {part.first} and {part.second}"
        self.mark("cut" if cut else "joint", part.name, part.first, at, words + (", cut" if cut else ""))

    def spring(self, part: Connection, fine: bool) -> None:
        start, end = part.points
        self.attach(part.first, start)
        self.attach(part.second, end)
        if not getattr(part, "stiffness", 0.0):
            self.line("damper", part.name, [(part.first, start), (part.second, end)])
            return
        radius = COIL * self.size
        points, share = coil(np.array(start), np.array(end), radius, TURNS, 12 if fine else 4)
        first = len(self.rest)
        a, b = self.number[part.first], self.number[part.second]
        for at, s in zip(points, share, strict=True):
            self.rest.append(at)
            self.rides.append((a, b, float(s), start, end))
        self.lines.append(Line("spring", part.name, first, len(self.rest)))

    def bushing(self, part: Connection, hinge: Any) -> None:
        """Add a ring; a torsion spring, which has no point, stands at the joint of its bodies if there is one."""
        centre = self.positions[part.first if part.second == GROUND else part.second]
        at = part.points[0] if part.points else centre if hinge is None else hinge
        if part.points:
            self.attach(part.first, at)
            self.attach(part.second, at)
        self.line("gap", part.name, [(part.first, at), (part.second, at)])
        self.mark("bushing", part.name, part.second, at, f"{part.family} between {part.first} and {part.second}")

    def composed(self, part: Composed) -> None:
        nodes, polylines = part.node_bodies, part.outlines or ((0,),)
        for i in sorted({end for polyline in polylines for end in (polyline[0], polyline[-1])}):
            self.attach(*nodes[i])
        for polyline in part.outlines:
            self.line("beam", part.name, [nodes[i] for i in polyline])
        self.mark("node", part.name, *nodes[polylines[0][(len(polylines[0]) - 1) // 2]], part.summary)

    def arrow(self, part: Input) -> None:
        at = np.array(self.positions[part.body] if part.position is None else part.position)
        direction = np.array(part.wrench[:3] if any(part.wrench[:3]) else part.wrench[3:])
        arrow = ARROW * self.size * direction / np.linalg.norm(direction)
        heads = [1.0] if any(part.wrench[:3]) else [1.0 - SECOND_HEAD, 1.0]  # a torque has two
        self.line("input", part.name, [(part.body, at - (1.0 - share) * arrow) for share in (0.0, *heads)])

    def body(self, part: Body) -> None:
        centre = np.array(part.position)
        shape = outline(centre, np.array(self.attachments.get(part.name, ())).reshape(-1, 3), self.size)
        start = len(self.rest)
        for at in shape.points:
            self.point(part.name, at)
        for kind, polyline in shape.polylines:
            self.line(kind, part.name, [(part.name, shape.points[i]) for i in polyline])
        self.faces += [(start + i, start + j, start + k) for i, j, k in shape.faces]
        self.face_body += [self.number[part.name]] * len(shape.faces)
        self.mark("body", part.name, part.name, centre, f"body of {part.mass:.6g} kg")

    def scene(self, name: str, bodies: tuple[str, ...]) -> DrawnScene:
        position = np.array([self.positions[body] for body in bodies] + [(0.0, 0.0, 0.0)])
        columns = list(zip(*self.rides, strict=True)) if self.rides else [()] * 5
        return DrawnScene(
            name, bodies, position, _vectors(self.rest), np.array(columns[0], dtype=np.intp),
            np.array(columns[1], dtype=np.intp), np.array(columns[2], dtype=float), _vectors(columns[3]),
            _vectors(columns[4]), tuple(self.lines), tuple(self.marks),
            np.array(self.faces, dtype=np.intp).reshape(-1, 3), np.array(self.face_body, dtype=np.intp), self.size,
        )  # fmt: skip


def _vectors(values: Sequence[Any]) -> Array:
    return np.array([np.asarray(value, dtype=float) for value in values]).reshape(-1, 3)


def _rigid_displacement(moves: NDArray[Any], arm: Array) -> NDArray[Any]:
    """Displacements (n, 3, ...) of points at arms (n, 3) from the origins of bodies that move by (n, 6, ...)."""
    cross = np.cross(moves[:, 3:], arm.reshape(*arm.shape, *[1] * (moves.ndim - 2)), axis=1)
    return np.asarray(moves[:, :3] + cross)
