"""Loaded beams: what their elements carry in the given pose, and the geometric stiffness that comes of it.

The pose is the loaded one. Forces in the elements follow from statics; where they are not determined (beams held at
both ends), they spread as linear elasticity has it, with the least energy. A preloaded bushing at the middle of an
element acts on it as on two rigid halves; what the bent line between the nodes adds under a tension N is a form in the
element's own deformations, d across and r about the middle:

N (s^2 / (10 L) + 1 / (2 L)) d^2 + N d r / 2 - N L r^2 / 12,   s = 1 / (1 + phi)

so that rigid halves and this form are together N / 2 times the integral of the squared slope.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.elements import Bushing
from mbsvib.elements import beam_element as element
from mbsvib.elements import load as _load
from mbsvib.elements.beam_expansion import elastic_part, middle, turned
from mbsvib.elements.shared_rows import Node, Piece
from mbsvib.equations.maxwell_nodes import with_maxwell_nodes
from mbsvib.linalg.rank import STRAINED, ZERO_PRESTRESS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arguments import Vector
    from mbsvib.common.arrays import Array
    from mbsvib.elements import Load
    from mbsvib.elements.beam import Beam
    from mbsvib.elements.elastic_part import ElasticPart
    from mbsvib.mechanism.mechanism import Mechanism


def weights(beam: Beam, gravity: Vector) -> list[Load]:
    """Return the weight of a beam as forces at its nodes, half of each element's at either end.

    Parameters
    ----------
    beam : Beam
        The beam.
    gravity : tuple of 3 floats
        Acceleration of free fall [m/s^2].

    Returns
    -------
    list of Load
        One force for each node that is not on the ground.
    """
    line = beam.material.rho * beam.properties.A
    mass = np.zeros(len(beam.points))
    for i, length in enumerate(beam.lengths()):
        mass[i : i + 2] += 0.5 * line * length
    return [
        _load.make(f"{beam.name}.weight{i}", beam.node(i), [m * g for g in gravity], _load.NONE, point, False)
        for i, (m, point) in enumerate(zip(mass.tolist(), beam.points, strict=True)) if beam.node(i) != "ground"
    ]  # fmt: skip


def carried(
    model: Mechanism, beams: Sequence[Beam], reduced: Sequence[ElasticPart] = ()
) -> tuple[dict[str, Bushing], list[Array]]:
    """Return the elements of loaded beams with what they carry as preload, and the forces in superelements.

    Where displacements are known, their forces are taken, and statics are met by the least energy on top.

    Parameters
    ----------
    model : Mechanism
        The mechanism in plain parts, without forces in elements and superelements but those of weights.
    beams : sequence of Beam
        Its beams.
    reduced : sequence of ElasticPart
        Its superelements.

    Returns
    -------
    dict of str to Bushing
        The elements by name, in the order of the beams.
    list of array
        Forces in the rows of each superelement.
    """
    from mbsvib.equations.draft import begun
    from mbsvib.equations.loaded import with_loads
    from mbsvib.equations.scene import scene

    view = scene(with_maxwell_nodes(model))
    draft = begun(model, view, checked=False)
    relative, reduction = draft.relative, draft.reduction
    names = [name for beam in beams for name in beam.element_names]
    place = {name: i for i, name in enumerate(names)}
    which = [(row, place[view.elements[owner].name]) for row, owner in enumerate(view.springs.owner.tolist())
             if view.elements[owner].name in place]  # fmt: skip
    springs = np.array([row for row, _ in which], dtype=np.intp)
    element = np.array([i for _, i in which], dtype=np.intp)
    direction = view.springs.unit[springs].argmax(axis=1)
    apart = relative.dense(view.locked, relative.shape[0])
    opened = [apart[springs]]
    stiffness = view.springs.stiffness[springs]
    felt, root = [reduction.apply_exactly(apart[springs])], [np.sqrt(stiffness)]
    known = [_deformations(beams)[element, direction] * -stiffness]
    elastic = None if view.shared is None else view.shared.elastic
    if elastic is not None:
        every = elastic.composite.of(apart[len(apart) - len(elastic.composite.rows.first) :])
        for part in reduced:
            own = np.array([owner == part.owner for owner in elastic.owner]) & (elastic.stiffness != 0.0)
            opened.append(every[own])
            felt.append(reduction.apply_exactly(every[own]))
            root.append(np.sqrt(elastic.stiffness[own]))
            known.append(part.row_forces)
    rows, before = np.concatenate(felt), np.concatenate(known)
    residual = np.zeros(rows.shape[1])
    if view.loads is not None:
        statics = with_loads(draft).statics
        assert statics is not None
        residual = statics.residual
    open_rows, size = np.concatenate(opened), np.concatenate(root)
    forces = before + spread(rows, open_rows, size, -residual - before @ rows)
    if reduced:  # rows that feel many coordinates lose digits, which a second look finds again
        forces = forces + spread(rows, open_rows, size, -residual - forces @ rows)
    preload = np.zeros((len(names), 6))
    preload[element, direction] = forces[: len(springs)]
    result = {}
    for name, six in zip(names, preload.tolist(), strict=True):
        spring = model.springs[name]
        if isinstance(spring, Bushing):
            result[name] = replace(spring, preload=tuple(six)) if any(six) else spring
    ends = np.cumsum([len(part) for part in felt])
    along = [forces[start:end] for start, end in pairwise(ends)] or [np.zeros(0) for _ in reduced]
    return result, along


def _deformations(beams: Sequence[Beam]) -> Array:
    """Deformations (elements, 6) that displacements of loaded beams tell, in the axes of the elements."""
    result = []
    for beam in beams:
        count = len(beam.element_names)
        if beam.displacements is None:
            result.append(np.zeros((count, 6)))
        else:
            part = elastic_part(beam)
            result.append((part.rows @ part.state).reshape(count, 6))
    return np.concatenate(result) if result else np.zeros((0, 6))


def spread(rows: Array, apart: Array, root: Array, needed: Array) -> Array:
    """Return forces p of least energy with rows^T p = needed, where elements can hold it.

    Parameters
    ----------
    rows : array, shape (n, m)
        Deformations of the elements per coordinate.
    apart : array, shape (n, joint coordinates)
        The same per joint coordinate, as if loops were open.
    root : array, shape (n,)
        Square roots of their stiffness.
    needed : array, shape (m,)
        Forces along the coordinates.

    Returns
    -------
    array, shape (n,)
        One force for each row.
    """
    energy, most = (np.sqrt(np.square(part * root[:, None]).sum(axis=0)) for part in (rows, apart))
    rows = rows * (energy > STRAINED * max(energy.max(initial=0.0), most.max(initial=0.0)))
    single = np.count_nonzero(rows, axis=1) == 1
    own = {int(np.flatnonzero(rows[i])[0]): int(i) for i in np.flatnonzero(single)}
    held = np.flatnonzero(rows.any(axis=0))
    if len(own) < len(held):
        scaled = rows[:, held] * root[:, None]
        size = np.sqrt(np.square(scaled).sum(axis=0))
        found: Array = root * np.linalg.lstsq((scaled / size).T, needed[held] / size, rcond=1e-12)[0]
        return np.where(np.abs(found / root) > ZERO_PRESTRESS * np.abs(found / root).max(initial=0.0), found, 0.0)
    # each coordinate is a deformation: what elements of the tree carry follows exactly from those where it is cut
    tree = np.array([own[j] for j in held.tolist()], dtype=np.intp)
    rest = np.setdiff1d(np.arange(len(rows)), tree)
    entry = rows[tree, held]
    result = np.zeros(len(rows))
    result[tree] = needed[held] / entry
    if len(rest):
        follows = (rows[np.ix_(rest, held)] / entry).T
        left = np.concatenate((follows / root[tree, None], np.diag(1.0 / root[rest])))
        right = np.concatenate((result[tree] / root[tree], np.zeros(len(rest))))
        size = np.sqrt(np.square(left).sum(axis=0))
        result[rest] = np.linalg.lstsq(left / size, right, rcond=None)[0] / size
        result[tree] -= follows @ result[rest]
    return result


def bent_lines(beam: Beam, elements: dict[str, Bushing]) -> list[Piece]:
    """Return what the bent lines of a beam's elements add to the geometric stiffness of rigid halves.

    Parameters
    ----------
    beam : Beam
        The beam.
    elements : dict of str to Bushing
        Its elements with what they carry.

    Returns
    -------
    list of Piece
        Rows with signed stiffness for each element under tension or compression.
    """
    result = []
    for i, (name, (length, axes)) in enumerate(zip(beam.element_names, beam.frames(), strict=True)):
        spring = elements[name]
        if spring.preload is None:
            continue
        tension = -float(spring.preload[0])
        rows, values = [], []
        ratios = element.shear_ratios(length, beam.properties, beam.material, beam.shear)
        for (across, about, sign), phi in zip(((1, 5, 1.0), (2, 4, -1.0)), ratios, strict=True):
            for value, (d, r) in zip(*_rows(length, phi), strict=True):
                row = np.zeros(6)
                row[across], row[about] = d, sign * r
                rows.append(row)
                values.append(tension * value)
        node = Node(beam.node(i + 1), middle(beam, i), against=beam.node(i))
        result.append(Piece(beam.name, (node,), turned(np.array(rows), axes), stiffness=np.array(values)))
    return result


def bent_forms(beam: Beam) -> Array:
    """Return what unit tension adds to the stiffness of rigid halves, for each element in its axes.

    Parameters
    ----------
    beam : Beam
        The beam.

    Returns
    -------
    array, shape (elements, 6, 6)
        On the displacement of an element's end against its start, at the midpoint [N/m, N, N m per N].
    """
    result = []
    for length, _ in beam.frames():
        form = np.zeros((6, 6))
        ratios = element.shear_ratios(length, beam.properties, beam.material, beam.shear)
        for (across, about, sign), phi in zip(((1, 5, 1.0), (2, 4, -1.0)), ratios, strict=True):
            form[across, across] = (0.2 / (1.0 + phi) ** 2 + 1.0) / length
            form[across, about] = form[about, across] = 0.5 * sign
            form[about, about] = -length / 6.0
        result.append(form)
    return np.array(result)


def _rows(length: float, phi: float) -> tuple[Array, Array]:
    """Signed values and rows in (d, r) of the form above, for a unit tension; twice the form is a stiffness."""
    across = 0.2 / (1.0 + phi) ** 2 + 1.0
    # in d / L and r all entries are of the size of L
    values, vectors = np.linalg.eigh(length * np.array([[across, 0.5], [0.5, -1.0 / 6.0]]))
    return values, (vectors / np.array([[length], [1.0]])).T
