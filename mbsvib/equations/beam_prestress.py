"""Loaded beams: the forces in their elements at the pose, and their geometric stiffness.

The pose is the loaded one. Forces in the elements follow from statics; statically indeterminate ones (beams held at
both ends) are those of linear elasticity, with the least energy. A preloaded bushing at the middle of an element acts
as between two rigid halves, and its force F, on the end, turns with the first of them. In deformations of the element,
d and r about the middle, the term

F . (r x d) / 2

lets it turn with the mean of both, so that both ends are alike. The bent line between the nodes under a tension N adds
a quadratic form in d across and r; of constant section

N (s^2 / (10 L) + 1 / (2 L)) d^2 - N L r^2 / 12 - W (1 / 12 - s / 30) d r,   s = 1 / (1 + phi)

so that rigid halves and both terms add up to half the integral of N times the squared slope. W is the element's weight
along its axis, by which the tension falls along the element: what the weights at the nodes do as these turn is that of
straight halves, and the last term adds what the bent line does beyond it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.elements.beam import Beam
from mbsvib.elements.beam_element import Element
from mbsvib.elements.beam_expansion import elastic_part, rotated
from mbsvib.elements.elastic_part import ElasticPart
from mbsvib.elements.shared_rows import Node, SharedRows
from mbsvib.equations.scene import Scene, with_maxwell_nodes
from mbsvib.equations.scene import scene as scene_of
from mbsvib.kinematics.loops import Reduction
from mbsvib.kinematics.relative_motion import body_motion
from mbsvib.linalg.components import stacked
from mbsvib.linalg.products import concatenated
from mbsvib.linalg.qr import least_norm, rank_grows
from mbsvib.linalg.rank import DEPENDENT, EPS, STRAINED, ZERO_PRESTRESS
from mbsvib.linalg.rotations import skew
from mbsvib.mechanism.mechanism import Mechanism

# Directions of a deflection and, less 3, of a rotation whose product has geometric stiffness.
MIXED = np.array([(k, j) for k in range(3) for j in range(3) if k != j]).T
# Deflections and rotations of bending among the six deformations of an element.
BENDING = [1, 2, 4, 5]


def element_forces(
    model: Mechanism, beams: Sequence[Beam], reduced: Sequence[ElasticPart] = ()
) -> tuple[Array, list[Array]]:
    """Return the forces in the elements of loaded beams, in their axes, and those in superelements.

    Forces of given displacements are taken first, then forces of least energy are added for equilibrium.

    Returns (elements, 6), those of one beam after the other; forces in the rows of each superelement.
    """
    scene = scene_of(with_maxwell_nodes(model))
    names = [name for beam in beams for name in beam.element_names]
    number = {name: i for i, name in enumerate(names)}
    of_beams = np.array([element.name in number for element in scene.elements], dtype=bool)
    springs = scene.springs.take(of_beams.take(scene.springs.owner).nonzero()[0])
    element = np.array([number[scene.elements[owner].name] for owner in springs.owner.tolist()], dtype=np.intp)
    elastic = None if scene.shared is None else scene.shared.elastic
    shared_base = [] if elastic is None else [elastic.composite.rows]
    locked, deformed = scene.locked, scene.locked + len(springs.owner)
    relative = scene.relative_of(springs.rows, *shared_base)
    reduction = scene.reduced(scene.closure(relative))
    # of elements, then of each superelement: rows in joint coordinates, their stiffness, and forces of displacements
    deformations = _deformations(beams)[element, springs.unit.argmax(axis=1)]
    parts = [(relative.dense(locked, deformed), springs.stiffness, deformations * -springs.stiffness)]
    if elastic is not None:
        shared_rows = elastic.composite.of(relative.dense(deformed, relative.shape[0]))
        for part in reduced:
            of_part = np.array([owner == part.owner for owner in elastic.owner]) & (elastic.stiffness != 0.0)
            parts.append((shared_rows[of_part], elastic.stiffness[of_part], part.row_forces))
    rows = np.concatenate([reduction.apply_exactly(part) for part, _, _ in parts])
    open_rows, stiffness, forces = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    residual = _along_coordinates(scene, reduction)
    # rows of superelements in many coordinates lose digits; a second step restores them
    for _ in range(2 if reduced else 1):
        forces = forces + least_energy_forces(rows, open_rows, np.sqrt(stiffness), -residual - forces @ rows)
    preload = np.zeros((len(names), 6))
    preload[element, springs.unit.argmax(axis=1)] = forces[: len(element)]
    ends = np.cumsum([len(part) for part, _, _ in parts])
    return preload, [forces[start:end] for start, end in pairwise(ends)] or [np.zeros(0) for _ in reduced]


def _along_coordinates(scene: Scene, reduction: Reduction) -> Array:
    """Weights, loads and preloads along the minimal coordinates [N or N m]."""
    if scene.loads is None:
        return np.zeros(len(reduction.independent))
    motion = body_motion(scene.coordinates, scene.position)
    wrench, _ = scene.loads[0].on_bodies(scene.centres.T)
    along = wrench[:, :-1].T.reshape(-1) @ motion.reshape(6 * len(motion), motion.shape[2])
    return reduction.apply(along)


def _deformations(beams: Sequence[Beam]) -> Array:
    """Deformations (elements, 6) from the displacements of loaded beams, in the axes of the elements."""
    result = []
    for beam in beams:
        count = len(beam.element_names)
        if beam.displacements is None:
            result.append(np.zeros((count, 6)))
        else:
            part = elastic_part(beam)
            result.append(part.deformations.reshape(count, 6))
    return np.concatenate(result) if result else np.zeros((0, 6))


def least_energy_forces(rows: Array, open_rows: Array, root: Array, needed: Array) -> Array:
    """Return forces p of least energy with rows^T p = needed along coordinates that deform elements.

    ``rows`` (..., n, m): deformations of the elements per coordinate. ``open_rows`` (..., n, joint coordinates): the
    same per joint coordinate of the open tree. ``root`` (..., n): square roots of their stiffness. ``needed`` (..., m):
    forces along the coordinates. Returns (..., n): one force for each row. Leading axes are those of variants, also of
    complex steps; the imaginary part is not a number where a coordinate begins to deform an element along a step, as
    that element then takes a force at once.
    """
    energy, largest = (np.sqrt(np.square((part * root[..., None]).real).sum(axis=-2)) for part in (rows, open_rows))
    limit = STRAINED * np.maximum(energy.max(axis=-1, initial=0.0), largest.max(axis=-1, initial=0.0))
    deforms = energy > limit[..., None]
    forces = _of_patterns(rows * deforms[..., None, :], root, needed)
    if np.iscomplexobj(rows):
        change = np.sqrt(np.square(rows.imag * root.real[..., None]).sum(axis=-2))
        begins = (np.where(deforms, 0.0, change) > STRAINED * change.max(axis=-1, keepdims=True)).any(axis=-1)
        used = deforms.reshape(-1, deforms.shape[-1]).any(axis=0)
        per_energy = deforms / np.where(deforms, energy, 1.0)
        unit = (rows * root[..., None])[..., used] * per_energy[..., None, used]
        begins |= rank_grows(unit.swapaxes(-1, -2), DEPENDENT)
        forces = forces.astype(complex)
        forces.imag[np.broadcast_to(begins, forces.shape[:-1])] = np.nan
    return forces


def _of_patterns(rows: Array, root: Array, needed: Array) -> Array:
    """Forces (..., n), of the variants whose rows have the same nonzero entries at once."""
    if rows.ndim == 2 and root.ndim == needed.ndim == 1:
        return _of_pattern(rows, root, needed, rows != 0.0)
    lead = np.broadcast_shapes(rows.shape[:-2], root.shape[:-1], needed.shape[:-1])
    rows, root, needed = (np.broadcast_to(array, (*lead, *array.shape[-k:])) for array, k in (
        (rows, 2), (root, 1), (needed, 1)))  # fmt: skip
    acts = rows != 0.0
    if (acts == acts[:1]).all():
        return _of_pattern(rows, root, needed, acts[0])
    result = np.zeros(root.shape, np.result_type(rows, root, needed))
    for pattern in np.unique(acts, axis=0):
        own = (acts == pattern).all(axis=(-1, -2))
        result[own] = _of_pattern(rows[own], root[own], needed[own], pattern)
    return result


def _of_pattern(rows: Array, root: Array, needed: Array, acts: Array) -> Array:
    """Forces (..., n) where rows (..., n, m) have the same nonzero entries ``acts`` (n, m) in all variants."""
    single = np.count_nonzero(acts, axis=1) == 1
    row_of = {int(np.flatnonzero(acts[i])[0]): int(i) for i in np.flatnonzero(single)}
    deformed = np.flatnonzero(acts.any(axis=0))
    if len(row_of) < len(deformed):
        scaled = rows[..., deformed] * root[..., None]
        size = np.sqrt(np.square(scaled).sum(axis=-2))
        unit = (scaled / size[..., None, :]).swapaxes(-1, -2)
        energy = least_norm(unit, needed[..., deformed] / size, DEPENDENT)
        forces, size = root * energy, np.abs(energy.real)
        none = size <= ZERO_PRESTRESS * size.max(axis=-1, keepdims=True, initial=0.0)
        return np.where(none, forces - forces.real, forces)  # forces that are rounding keep their slopes
    # each coordinate is a deformation: forces of the other rows determine those of the tree exactly
    tree = np.array([row_of[j] for j in deformed.tolist()], dtype=np.intp)
    others = np.setdiff1d(np.arange(len(acts)), tree)
    entry, inverse = rows[..., tree, deformed], 1.0 / root
    of_tree = needed[..., deformed] / entry
    result = np.zeros((*of_tree.shape[:-1], len(acts)), np.result_type(of_tree, root))
    if len(others):
        ratios = (rows[..., others[:, None], deformed] / entry[..., None, :]).swapaxes(-1, -2)
        left = concatenated((ratios * inverse[..., tree, None], np.eye(len(others)) * inverse[..., None, others]), -2)
        right = concatenated((of_tree * inverse[..., tree], np.zeros(len(others))), -1)
        size = np.sqrt(np.square(left).sum(axis=-2))
        result[..., others] = least_norm(left / size[..., None, :], right, left.shape[-2] * EPS) / size
        of_tree = of_tree - (ratios @ result[..., others, None])[..., 0]
    result[..., tree] = of_tree
    return result


def _rows(elements: Sequence[Element], of: Callable[[Element], Sequence[Any]]) -> Array:
    """Numbers (..., elements, k) of all elements, those of one element computed once."""
    made = {key: np.stack(np.broadcast_arrays(*of(element)), axis=-1)
            for key, element in {id(element): element for element in elements}.items()}  # fmt: skip
    return np.stack(np.broadcast_arrays(*[made[id(element)] for element in elements]), axis=-2)


def per_tension(elements: Sequence[Element]) -> Array:
    """Return the geometric stiffness of bent lines per unit tension [N/m, N m per N], beyond that of rigid halves.

    Returns (..., elements, 6): the squares of the six deformations of each element, in its axes.
    """
    def of(element: Element) -> Sequence[Any]:
        (one, other), length = element.bent_lines(), element.length
        return (0.0, one.deflected + 1.0 / length, other.deflected + 1.0 / length,
                0.0, other.turned - 0.25 * length, one.turned - 0.25 * length)  # fmt: skip

    return _rows(elements, of)


def check_compression(beam: Beam, preload: Array) -> None:
    """Warn of elements that nearly buckle under forces (..., elements, 6)."""
    elements = beam.parts()
    stiffness = _rows(elements, lambda element: element.stiffness()[1:3])
    beam.check_compression(float((preload[..., :1] * per_tension(elements)[..., 1:3] / stiffness).real.max()))


def bent_lines(
    beam: Beam, preload: Array, fall: Array, every: bool = False
) -> list[SharedRows]:  # fmt: skip
    """Return the geometric stiffness of the bent lines of a beam's elements, in addition to that of rigid halves.

    ``preload`` (..., elements, 6) are the forces in its elements, in their axes, ``fall`` (..., elements, 3) is the
    acceleration of gravity and of hubs. The rows have signed stiffness, those without any only where ``every`` row is
    asked for.
    """
    result, unit, elements = [], np.eye(6), beam.parts()
    squares = -preload[..., :1] * per_tension(elements)
    unloaded = elements if beam.displacements is None else beam.without_forces().parts()
    for i, ((length, axes), element, rest) in enumerate(zip(beam.frames(), elements, unloaded, strict=True)):
        weight = rest.mass * (fall[..., i, :] * stacked(axes)[..., 0]).sum(axis=-1)
        lead = np.broadcast_shapes(np.shape(weight), preload.shape[:-2])
        products = np.zeros((*lead, 3, 3), np.result_type(preload, weight))
        products += 0.5 * skew(preload[..., i, :3])
        for k, j, sign, line in zip((1, 2), (2, 1), (1.0, -1.0), element.bent_lines(), strict=True):
            products[..., k, j] += sign * weight * line.weighed
        long = np.asarray(length)[..., None]
        of_products = 0.5 * long * products[..., MIXED[0], MIXED[1]]
        values = concatenated((squares[..., i, BENDING], of_products, -of_products), -1)
        across, about = unit[MIXED[0]] / long[..., None], unit[3 + MIXED[1]]
        rows = concatenated((unit[BENDING], across + about, across - about), -2)
        acts = np.full(values.shape[-1], every) | values.reshape(-1, values.shape[-1]).any(axis=0)
        if acts.any():
            node = Node(beam.body_of(i + 1), beam.middle(i), relative_to=beam.body_of(i))
            result.append(SharedRows(beam.name, (node,), rotated(rows[..., acts, :], axes),
                                     stiffness=values[..., acts]))  # fmt: skip
    return result


def unloaded_lines(beam: Beam) -> list[SharedRows]:
    """Return the rows of the bent lines of all elements of a beam, without forces."""
    count = len(beam.element_names)
    return bent_lines(beam, np.zeros((count, 6)), np.zeros((count, 3)), every=True)
