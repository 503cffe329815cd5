"""Expansion of beams to bodies, joints, bushings and shared rows.

Each node is a body. Each element is a free joint between its nodes and a bushing at its midpoint. The mass of an
element and mass-proportional and modal damping are rows that both ends share. The coordinates are the deformations of
the elements, so that the stiffness is diagonal and no digits cancel.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from typing import Any

import numpy as np

from mbsvib.common.arguments import Matrix3, Vector
from mbsvib.common.arrays import Array
from mbsvib.elements import Bushing, Joint
from mbsvib.elements import bushing as _bushing
from mbsvib.elements import joint as _joint
from mbsvib.elements.beam import Beam
from mbsvib.elements.elastic_part import ElasticPart, Slopes, massless_bodies
from mbsvib.elements.load import Load
from mbsvib.elements.shared_rows import ExpandedPart, Node, SharedRows
from mbsvib.linalg.components import stacked
from mbsvib.linalg.products import concatenated
from mbsvib.linalg.rotations import rigid_transport


def expand(beam: Beam, *_: Any) -> ExpandedPart:
    """Return nodes, joints and bushings of a beam, its mass rows, and rows of mass-proportional and modal damping."""
    pairs, mass = elements(beam), masses(beam)
    return ExpandedPart(
        massless_bodies(beam.node_names), {joint.name: joint for joint, _ in pairs},
        {spring.name: spring for _, spring in pairs}, mass=tuple(mass), elastic=tuple(dampers(beam, mass)),
    )  # fmt: skip


def elements(beam: Beam) -> list[tuple[Joint, Bushing]]:
    """Return joint and bushing of each element, both in its axes at its midpoint."""
    result = []
    for i, (length, axes) in enumerate(beam.frames()):
        midpoint = beam.middle(i)
        k = beam.element(length).stiffness()
        first, second = beam.body_of(i), beam.body_of(i + 1)
        name = beam.element_names[i]
        joint = _joint.make(name, "free", first, second, midpoint, axes, None, None, None, None)
        bushing = _bushing.make(name, first, second, midpoint, k, tuple([beam.beta * value for value in k]), axes)
        result.append((joint, bushing))
    return result


def masses(beam: Beam) -> list[SharedRows]:
    """Return the mass rows of all elements, in world axes."""
    frames, parts, result = beam.frames(), beam.parts(), []
    rows = {id(part): part.mass_rows() for part in {id(part): part for part in parts}.values()}
    unloaded = [length for length, _ in frames] if beam.displacements is None else beam.lengths()
    for i, ((length, axes), part, before) in enumerate(zip(frames, parts, unloaded, strict=True)):
        # the mass is that of the length without forces
        matrix = rows[id(part)] if before is length else rows[id(part)] * sqrt(before / length)
        result.append(SharedRows(beam.name, (_node(beam, i), _node(beam, i + 1)), rotated(matrix, axes)))
    return result


def weights(beam: Beam, gravity: Vector | None) -> tuple[Load, ...]:
    """Return the weight of a beam as forces on its nodes that are not on the ground, see ``Beam.node_weights``."""
    if gravity is None or not any(gravity):
        return ()
    (x, y, z), (masses, points) = gravity, beam.node_weights()
    return tuple([
        Load(f"{beam.name}.weight{i}", beam.body_of(i), (m * x, m * y, m * z), position=(a, b, c))
        for i, (m, (a, b, c)) in enumerate(zip(masses.tolist(), points.tolist(), strict=True))
        if beam.body_of(i) != "ground"
    ])  # fmt: skip


def elastic_part(beam: Beam, gravity: Vector | None = None) -> ElasticPart:
    """Return a beam as an elastic part in the frame of its root, in the displacements of its nodes.

    If ``second_order``, a bent element is longer than its projection by half the integral of its squared slope,

    L psi^2 / 2 + s^2 d^2 / (10 L) + L r^2 / 24,  s = 1 / (1 + phi)

    in either plane, with the slope psi of the chord, and the deflection d and rotation r of its end against its start,
    about the midpoint.

    Source: Przemieniecki, Theory of Matrix Structural Analysis (1968), section 15.3, for Euler-Bernoulli beams.
    """
    unloaded, root, bodies = beam.without_forces(), beam.root, beam.node_bodies
    nodes = [i for i, (body, _) in enumerate(bodies) if body != root]
    count = len(beam.points) - 1
    rows = np.zeros((6 * count, 6 * count + 6))
    values: list[float] = []
    slopes: list[Array] = []
    factors: list[float] = []
    for i, (length, axes) in enumerate(unloaded.frames()):
        to_local, midpoint = np.kron(np.eye(2), np.array(axes).T), np.array(unloaded.middle(i))
        for j, sign in ((i, -1.0), (i + 1, 1.0)):
            arm = midpoint - np.array(unloaded.points[j])
            rows[6 * i : 6 * i + 6, 6 * j : 6 * j + 6] = sign * to_local @ rigid_transport(arm)
        element = beam.element(length)
        values += element.stiffness()
        chord = np.zeros((2, rows.shape[1]))
        chord[:, 6 * i + 6 : 6 * i + 9] = np.array(axes)[:, 1:].T / length
        chord[:, 6 * i : 6 * i + 3] = -chord[:, 6 * i + 6 : 6 * i + 9]
        slopes += [*chord, *rows[[6 * i + 1, 6 * i + 2, 6 * i + 4, 6 * i + 5]]]
        lines = element.bent_lines()
        factors += [length, length, *(line.deflected for line in lines), *(line.turned for line in lines[::-1])]
    state = np.zeros((len(beam.points), 6)) if beam.displacements is None else np.array(beam.displacements)
    columns = [6 * i + j for i in nodes for j in range(6)]
    return ElasticPart(
        beam.name, root, tuple([f"{beam.name}.{i}" for i in nodes]), tuple([bodies[i] for i in nodes]), (),
        beam.points[0], rows[:, columns], np.array(values), state[nodes].reshape(-1),
        slopes=Slopes(np.array(slopes)[:, columns], np.array(factors), np.repeat(6 * np.arange(count), 6))
        if beam.second_order else None, loads=weights(beam, gravity), damping=beam.beta * np.array(values),
    )  # fmt: skip


def dampers(beam: Beam, mass: Sequence[SharedRows]) -> list[SharedRows]:
    """Return the rows of mass-proportional and of modal damping, if the beam has any; ``mass``: its mass rows."""
    result = []
    if np.ndim(beam.alpha) or beam.alpha:
        alpha = np.asarray(beam.alpha)[..., None]
        result += [SharedRows(beam.name, rows.nodes, rows.matrix, damping=alpha * np.ones(rows.matrix.shape[-2]))
                   for rows in mass]  # fmt: skip
    if np.ndim(beam.damping_ratio) or beam.damping_ratio:
        result.append(modal_damper(beam, mass))
    return result


def modal_damper(beam: Beam, mass: Sequence[SharedRows]) -> SharedRows:
    """Return damping rows that give all modes of the free beam the same damping ratio zeta.

    C = sum over its elastic modes of 2 zeta omega M phi phi^T M = 2 zeta K^1/2 (E^T E)^1/2 K^1/2

    K acts on deformations only, so that no rigid-body motion of the beam is damped. With the mass rows W_r of
    rigid-body motions and W_e of deformations, E = (1 - Q Q^T) W_e K^-1/2, where W_r = Q R; its singular values are
    1 / omega.
    """
    frames = beam.frames()
    values = np.broadcast_arrays(*[value for part in beam.parts() for value in part.stiffness()])
    root = np.sqrt(np.stack(values, axis=-1))
    rows = _free_mass_rows(beam, mass)
    forces = _root_of_gram(rows[..., :6], rows[..., 6:] / root[..., None, :]) * root[..., None, :]
    matrix = concatenated([rotated(forces[..., 6 * i : 6 * i + 6], axes) for i, (_, axes) in enumerate(frames)], -1)
    nodes = tuple([Node(beam.body_of(i + 1), beam.middle(i), relative_to=beam.body_of(i)) for i in range(len(frames))])
    ratio = np.asarray(beam.damping_ratio)[..., None]
    return SharedRows(beam.name, nodes, matrix, damping=2.0 * ratio * np.ones(matrix.shape[-2]))


def _root_of_gram(rigid: Array, elastic: Array) -> Array:
    """Rows L with L^T L = (E^T E)^1/2 of the part E of elastic rows (..., r, n) beyond rigid ones (..., r, 6).

    With E = U diag(s) V^T, L = diag(s)^1/2 V^T. Along a complex step E changes by (1 - Q Q^T) (dW_e - dW_r R^-1 Q^T
    W_e), and L^T L by V X V^T, X_ij = (s_i G_ij + s_j G_ji) / (s_i + s_j) with G = U^T dE V.
    """
    q, r = np.linalg.qr(rigid.real)
    shares = q.swapaxes(-1, -2) @ elastic.real
    _, s, modes = np.linalg.svd(elastic.real - q @ shares, full_matrices=False)
    root = np.sqrt(s)
    if not (np.iscomplexobj(rigid) or np.iscomplexobj(elastic)):
        return np.asarray(root[..., None] * modes)
    change = np.imag(elastic) - np.imag(rigid) @ np.linalg.solve(r, shares)
    left = (elastic.real - q @ shares) @ modes.swapaxes(-1, -2)  # U diag(s), normal to Q
    g = left.swapaxes(-1, -2) @ change @ modes.swapaxes(-1, -2)  # s_i G_ij
    x = (g + g.swapaxes(-1, -2)) / (s[..., None] + s[..., None, :])
    step = x / (root[..., None] + root[..., None, :])
    return np.asarray((root[..., None] * np.eye(s.shape[-1]) + 1j * step) @ modes)


def _free_mass_rows(beam: Beam, mass: Sequence[SharedRows]) -> Array:
    """Mass rows of the free beam, on its rigid-body motion and then on the deformations of its elements."""
    count = len(beam.points)
    turns = [stacked(axes) for _, axes in beam.frames()]
    points = [stacked(point) for point in beam.points]
    motions = [np.eye(6, 6 * count)]
    for i, axes in enumerate(turns):
        start, end, midpoint = points[i], points[i + 1], stacked(beam.middle(i))
        own = np.zeros((*axes.shape[:-2], 6, 6 * count), axes.dtype)
        own[..., :3, 6 * i + 6 : 6 * i + 9] = own[..., 3:, 6 * i + 9 : 6 * i + 12] = axes
        motions.append(rigid_transport(end - start) @ motions[i] + rigid_transport(end - midpoint) @ own)
    return np.asarray(concatenated([rows.matrix[..., :6] @ motions[i] + rows.matrix[..., 6:] @ motions[i + 1]
                                    for i, rows in enumerate(mass)], -2))  # fmt: skip


def rotated(rows: Array, axes: Matrix3) -> Array:
    """Return rows (..., n, 6 k) on vectors in local axes as rows on the same vectors in world axes."""
    turned = rows.reshape(*rows.shape[:-1], -1, 3) @ stacked(axes).swapaxes(-1, -2)[..., None, :, :]
    result: Array = np.asarray(turned).reshape(*turned.shape[:-2], -1)
    return result


def _node(beam: Beam, i: int) -> Node:
    return Node(beam.body_of(i), beam.points[i])
