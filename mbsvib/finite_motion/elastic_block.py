"""Beams and superelements as elastic blocks: interface displacements and the modes of the part with its interface held.

In the frame of the body that carries it the part has small displacements x = x0 + P b + N z: b are those of interface
nodes since the pose as described, z modes of the part with its interface held,

    K_ii N_i = M_ii N_i Lambda,  N_i^T M_ii N_i = 1,  P_i = -K_ii^-1 K_ib,  P_b = 1,  N_b = 0,

i being all coordinates but those of the interface. So the linear part of the forces has no term of b and z together,
the mass has. The slopes of beams add to their strain (``elements.elastic_part``).
Motions of i without mass follow statically and are not among the modes.

Source: Craig & Bampton (1968), Coupling of substructures for dynamic analyses, AIAA Journal 6.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np
from scipy.linalg import cho_factor, cho_solve, eigh

from mbsvib.common.arguments import DIRECTIONS
from mbsvib.common.arrays import Array, Index
from mbsvib.elements.families import EXPANSIONS, elastic_parts
from mbsvib.elements.shared_rows import Node, SharedRows
from mbsvib.errors import ModelError
from mbsvib.finite_motion.frames import Expression, Frame, exponential, logarithm
from mbsvib.linalg.groups import part_numbers
from mbsvib.linalg.rank import MASSLESS
from mbsvib.linalg.rotations import exponential as rotation_matrix
from mbsvib.linalg.rotations import skew
from mbsvib.mechanism.mechanism import GROUND, Mechanism

ALL_SIX = (0, 1, 2, 3, 4, 5)


@dataclass(frozen=True)
class Bending:
    """What slopes add to the strain of a beam: e = D x + sum w_j (S_j x)^2 / 2 in each element along its axis.

    ``strain`` D (n, 6 e) is the linear part, with ``stiffness`` and ``damping`` (n,); ``slopes`` S (m, 6 e) have the
    weights ``weights`` w (m,) and belong to the ``elements`` (m,).
    """

    strain: Array
    stiffness: Array
    damping: Array
    slopes: Array
    weights: Array
    elements: Index


@dataclass(frozen=True)
class ElasticBlock:
    """A beam or superelement as an elastic block carried by body ``root``.

    Its stations (s,) are all nodes at ``points`` (s, 3) without forces [m]; ``elastic`` (e,) numbers those that
    move against the root, ``nodes`` names their bodies. Coordinates x (6 e + internal,) are their displacements and
    rotations, then internal ones, ``state`` x0 what they are as described. ``mass`` and ``damping`` (6 s +
    internal, 6 s + internal) act on the velocities of all stations and the rates of internal coordinates,
    ``relative_damping`` (6 e + internal, 6 e + internal) and ``stiffness`` on those of x; ``weight`` (s, 3) are
    forces at the stations [N], at the ``arms`` (s, 3) from them [m], and ``force`` (6 e + internal,) forces along
    x. ``interface`` numbers the elastic stations at which something is attached, ``joints`` names their links to
    the root, ``bodies`` the bodies there and ``held`` the directions (0 to 5) of each that belong to b. ``modes`` N
    and ``static`` P (6 e + internal, ...) span x. ``bending`` has the slopes of a beam.
    """

    name: str
    root: str
    points: Array
    elastic: tuple[int, ...]
    internal: int
    state: Array
    mass: Array
    damping: Array
    relative_damping: Array
    stiffness: Array
    weight: Array
    arms: Array
    force: Array
    interface: tuple[int, ...]
    joints: tuple[str, ...]
    bodies: tuple[str, ...]
    held: tuple[tuple[int, ...], ...]
    modes: Array
    static: Array
    eigenvalues: Array
    nodes: tuple[str, ...]
    bending: Bending | None = None

    @property
    def span(self) -> Array:
        """(N, P), which makes x - x0 of (z, b)."""
        return np.concatenate((self.modes, self.static), axis=1)

    @property
    def interface_names(self) -> tuple[str, ...]:
        """Names of the coordinates b."""
        return tuple([f"{joint}.{DIRECTIONS[d]}" for joint, held in zip(self.joints, self.held, strict=True)
                      for d in held])  # fmt: skip

    @property
    def mode_names(self) -> tuple[str, ...]:
        """Names of the coordinates z; "NAME.mode1" is an internal coordinate of a superelement in linear equations."""
        return tuple([f"{self.name}.fixed_mode{k + 1}" for k in range(len(self.eigenvalues))])


def elastic_blocks(model: Mechanism) -> tuple[ElasticBlock, ...]:
    """Return all beams and superelements of a mechanism as elastic blocks."""
    used = _used(model)
    blocks = tuple([_block(part, model, used) for part in model.composed.values()])
    for block in blocks:
        _check_carrier(model, block)
    return blocks


def with_interface(block: ElasticBlock, touched: Mapping[str, tuple[int, ...]]) -> ElasticBlock:
    """Return a block in which only some directions of its interface nodes belong to b, and modes move the others.

    ``touched``: these directions by the names of links; all of those that are not named.
    """
    held = tuple([touched.get(joint, ALL_SIX) for joint in block.joints])
    columns = _columns(block.elastic, len(block.points), block.internal)
    retained = [6 * k + d for k, directions in zip(block.interface, held, strict=True) for d in directions]
    modes, static, values = _craig_bampton(block.mass[np.ix_(columns, columns)], block.stiffness, retained)
    return replace(block, held=held, modes=modes, static=static, eigenvalues=values)


def _used(model: Mechanism) -> set[str]:
    """Bodies and nodes at which something acts or is measured."""
    result = set(model.bodies)
    for group in (model.joints, model.springs):
        result |= {body for part in group.values() for body in (part.first, part.second)}
    for group in (model.loads, model.inputs, model.outputs, model.rotors):
        for part in group.values():
            result |= {body for key in ("body", "relative_to") if (body := getattr(part, key, None)) is not None}
    for flexible in model.composed.values():
        result |= {body for body, _ in flexible.node_bodies} - flexible.node_names.keys()
    return result


def _block(part: Any, model: Mechanism, used: set[str]) -> ElasticBlock:
    flexible, = elastic_parts([part], model.gravity)
    if flexible.force is not None and flexible.root != GROUND:
        raise ModelError(
            f"{part.family} '{part.name}': gravity on a {part.family} that a moving body carries has no statement in "
            f"finite motion yet; leave gravity out, or give its weight as loads on its nodes.", element=part.name,
        )  # fmt: skip
    rest = part.without_forces()
    expansion, points = EXPANSIONS[type(part)](rest), np.array(rest.points)
    count, internal = len(points), flexible.internal
    station_of = {part.body_of(i): i for i in reversed(range(count))}
    station_of |= {name: count + i for i, name in enumerate(part.carriers)}
    dampers = [rows for rows in expansion.elastic if rows.damping is not None]
    mass, damping = (_matrix(rows, station_of, points, internal) for rows in (expansion.mass, dampers))
    elastic = tuple([i for i in range(count) if part.body_of(i) != part.root])
    weights, centres = part.node_weights()
    # nodes that the root holds as well do not move against it
    moving = [k for k, (body, _) in enumerate(flexible.nodes) if body != part.root]
    columns = _columns(moving, len(flexible.nodes), internal)
    rows, state, values = flexible.rows[:, columns], flexible.state[columns], flexible.values
    row_damping = np.zeros(len(values)) if flexible.damping is None else flexible.damping
    stiffness, relative_damping = (rows.T @ (value[:, None] * rows) for value in (values, row_damping))
    nodes = [(flexible.names[k], flexible.nodes[k][0]) for k in moving]
    interface = tuple([k for k, (_, body) in enumerate(nodes) if body in used])
    own = _columns(elastic, count, internal)
    held = [6 * k + j for k in interface for j in range(6)]
    modes, static, eigenvalues = _craig_bampton(mass[np.ix_(own, own)], stiffness, held)
    bending = None
    if flexible.slopes is not None:
        axial, number = np.unique(flexible.slopes.rows, return_inverse=True)
        bending = Bending(rows[axial], values[axial], row_damping[axial], flexible.slopes.matrix[:, columns],
                          flexible.slopes.weights, number)  # fmt: skip
    return ElasticBlock(
        part.name, part.root, points, elastic, internal, state, mass, damping, relative_damping, stiffness,
        np.outer(weights, model.gravity or (0.0, 0.0, 0.0)), centres - np.array(part.points),
        np.zeros(len(state)) if flexible.force is None else flexible.force[columns], interface,
        tuple([nodes[k][0] for k in interface]), tuple([nodes[k][1] for k in interface]),
        (ALL_SIX,) * len(interface), modes, static, eigenvalues, tuple([body for _, body in nodes]), bending,
    )  # fmt: skip


def _columns(nodes: Sequence[int], count: int, internal: int) -> list[int]:
    """Numbers of the coordinates of some of ``count`` nodes, and of all internal ones."""
    return [6 * i + j for i in nodes for j in range(6)] + list(range(6 * count, 6 * count + internal))


def _craig_bampton(mass: Array, stiffness: Array, interface: list[int]) -> tuple[Array, Array, Array]:
    """Modes N with some coordinates held, static shapes P of these, and eigenvalues."""
    inner = [k for k in range(len(mass)) if k not in set(interface)]
    static, modes, values = np.zeros((len(mass), len(interface))), np.zeros((len(mass), 0)), np.zeros(0)
    static[interface, range(len(interface))] = 1.0
    if inner:
        inner_stiffness = stiffness[np.ix_(inner, inner)]
        static[inner] = -cho_solve(cho_factor(inner_stiffness), stiffness[np.ix_(inner, interface)])
        mu, vectors = _inverse_squares(mass[np.ix_(inner, inner)], inner_stiffness)
        retained = np.flatnonzero(mu > MASSLESS * mu[-1])[::-1]
        values = 1.0 / mu[retained]
        modes = np.zeros((len(mass), len(retained)))
        modes[inner] = vectors[:, retained] / np.sqrt(mu[retained])
    return modes, static, values


def _inverse_squares(mass: Array, stiffness: Array) -> tuple[Array, Array]:
    """Solve M phi = mu K phi, mu ascending; what has no mass has mu = 0.

    Coordinates that do not act on one another are solved apart, so that rounding does not mix their modes.
    """
    mu, vectors = np.zeros(len(mass)), np.zeros(mass.shape)
    part = part_numbers((mass != 0.0) | (stiffness != 0.0))
    for number in range(part.max() + 1):
        own = np.flatnonzero(part == number)
        mu[own], vectors[np.ix_(own, own)] = eigh(mass[np.ix_(own, own)], stiffness[np.ix_(own, own)])
    order = np.argsort(mu, kind="stable")
    return mu[order], vectors[:, order]


def _matrix(pieces: Sequence[SharedRows], names: dict[str, int], points: Array, internal: int) -> Array:
    """The products of shared rows, with their coefficients, over the displacements of stations and internal ones."""
    count = len(points)
    result = np.zeros((6 * count + internal, 6 * count + internal))
    for shared in pieces:
        rows = np.zeros((len(shared.matrix), len(result)))
        for k, node in enumerate(shared.nodes):
            block = shared.matrix[:, 6 * k : 6 * k + 6]
            _add(rows, block, node, node.body, names, points)
            if node.relative_to in names and shared.damping is not None:  # the mass rows are those of a ground at rest
                _add(rows, -block, node, node.relative_to, names, points)
        value = np.ones(len(rows)) if shared.damping is None else shared.damping
        result += rows.T @ (value[:, None] * rows)
    return result


def _add(rows: Array, block: Array, node: Node, body: str, names: dict[str, int], points: Array) -> None:
    """Add rows on the displacements of a point of a body, as rows on those of its station."""
    i, count = names[body], len(points)
    if i >= count:  # the carrier of three internal coordinates
        start = 6 * count + 3 * (i - count)
        width = min(3, rows.shape[1] - start)
        rows[:, start : start + width] += block[:, :width]
        return
    rows[:, 6 * i : 6 * i + 3] += block[:, :3]
    rows[:, 6 * i + 3 : 6 * i + 6] += block[:, 3:] - block[:, :3] @ skew(np.array(node.point) - points[i])


def _check_carrier(model: Mechanism, block: ElasticBlock) -> None:
    """Refuse a part between moving bodies that the rest of the mechanism holds by itself."""
    others = [body for body in block.bodies if body in model.bodies]
    if block.root == "ground" or not others:
        return
    links = [(joint.first, joint.second) for joint in model.joints.values()]
    for part in model.composed.values():
        if part.name != block.name:
            ends = [body for body, _ in part.node_bodies]
            links += [(ends[0], end) for end in ends[1:]]
    reached, queue = {"ground"}, ["ground"]
    while queue:
        body = queue.pop()
        for pair in links:
            for near, far in (pair, pair[::-1]):
                if near == body and far not in reached and far != block.root:
                    reached.add(far)
                    queue.append(far)
    for body in others:
        if body in reached:
            raise ModelError(
                f"'{block.name}' bends between the moving bodies '{block.root}' and '{body}', which other joints hold "
                f"as well, so that neither carries it; its displacements would not stay small. Fix it to one body "
                f"only, or make rigid bodies and bushings of it.", element=block.name,
            )  # fmt: skip


def node_displacement(block: ElasticBlock, station: int, both: Expression) -> Frame:
    """Return the displacement of an interface node against the root, in the axes of the root as described.

    It is that since the pose as described. ``station``: number of the node among the elastic ones. ``both``
    (modes + interface,): coordinates (z, b) of the block.
    """
    rho, rows = block.state[6 * station + 3 : 6 * station + 6], block.span[6 * station : 6 * station + 6]
    b = ca.sparsify(ca.DM(rows)) @ both
    rotation = exponential(ca.SX(rho) + b[3:])
    if rho.any():
        rotation = rotation @ ca.DM(rotation_matrix(-rho))
    point = ca.SX(point_as_described(block, station))
    return Frame(rotation, point + b[:3] - rotation @ point)


def coordinates_of(block: ElasticBlock, station: int, relative: Frame) -> Expression:
    """Return the coordinates b (6,) of an interface node whose displacement against the root follows from others."""
    rho = block.state[6 * station + 3 : 6 * station + 6]
    point = ca.SX(point_as_described(block, station))
    rotation = relative.rotation @ ca.DM(rotation_matrix(-rho)).T if rho.any() else relative.rotation
    return ca.vertcat(relative.point(point) - point, logarithm(rotation) - ca.SX(rho))


def point_as_described(block: ElasticBlock, station: int) -> Array:
    """Return where a node is in the pose as described [m]."""
    return np.asarray(block.points[block.elastic[station]] + block.state[6 * station : 6 * station + 3])


def node_row(block: ElasticBlock, body: str, point: Sequence[float], wrench: Sequence[float]) -> Array:
    """Return the row (6 e + internal,) that makes of x the small displacement of a point along a direction; 0 for the
    root.

    ``body``: name of the node, or of the root, that carries the point. ``point`` (3,): the point as described [m].
    ``wrench`` (6,): the direction, translation and rotation, in the axes of the root as described.
    """
    row = np.zeros(len(block.state))
    if body in block.nodes:
        k = block.nodes.index(body)
        force = np.array(wrench[:3])
        row[6 * k : 6 * k + 3] = force
        row[6 * k + 3 : 6 * k + 6] = wrench[3:] + np.cross(np.array(point) - point_as_described(block, k), force)
    return row
