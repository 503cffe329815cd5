"""What beams and superelements are made of, in numbers, and how these change with numbers of a beam or its place.

Such a part is nodes, joints and bushings between them, and rows that several nodes share. Rows of mass, stiffness and
damping are forms d^T F d of the displacements d of nodes. Slopes to the numbers of a beam are complex steps of its own
closed formulas, as in batches. A part that keeps its shape under loads turns with its first node, by
w d F = [w]x F - F [w]x; forces and gravity stay, of which F is a linear function.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.elements import beam_expansion
from mbsvib.elements.beam import Beam
from mbsvib.elements.families import ELASTIC, EXPANSIONS
from mbsvib.elements.shared_rows import SharedRows
from mbsvib.elements.superelement import Superelement
from mbsvib.equations.batch_values import STEP
from mbsvib.equations.beam_prestress import bent_lines
from mbsvib.linalg.components import stacked_all
from mbsvib.linalg.rotations import axial, skew

# Bodies of nodes, and those against which their displacements are taken, with the power of s of a form.
Nodes = tuple[str, tuple[tuple[str, str, bool], ...]]
Entry = tuple[str, tuple[int, ...]]  # a field and an index


@dataclass(frozen=True, slots=True)
class Made:
    """What a part is made of, under forces in its elements and gravity: names of the ``bodies`` of its nodes, of its
    ``joints``, ``springs``, ``elements`` and ``weights``, and its ``numbers``.

    They are points of ``nodes`` (n, 3), ``joints`` (j, 3) and ``elements`` (e, 3), ``axes`` (j + s, 3, 3) of joints and
    bushings, ``stiffness`` and ``damping`` (s, 6, 6) of these in their axes, ``weight`` (w, 3) and its ``centres``
    (w, 3). ``forms`` F (6 k, 6 k) have their nodes and points (k, 3). Numbers of variants have an axis in front.
    """

    bodies: tuple[str, ...]
    joints: tuple[str, ...]
    springs: tuple[str, ...]
    elements: tuple[str, ...]
    weights: tuple[str, ...]
    numbers: dict[str, Array]
    forms: dict[Nodes, tuple[Array, Array]]


def _made(part: Any, force: Array, gravity: Array) -> Made:
    """What a part is made of under ``force`` (elements, 3) in its elements and ``gravity`` (3,)."""
    return (_of_beam if isinstance(part, Beam) else _of_superelement)(part, force, gravity)


def _of_beam(beam: Beam, force: Array, gravity: Array) -> Made:
    """The same of a beam, also of one with arrays of variants."""
    names, heavy, mass = beam.element_names, bool(gravity.any()), beam_expansion.masses(beam)
    forms = _forms((*mass, *beam_expansion.dampers(beam, mass)))
    if heavy or force.any():
        for key, form, points in loaded_forms(beam, force, gravity):
            _add(forms, key, form, points)
    middles = stacked_all([beam.middle(i) for i in range(len(names))])
    axes = stacked_all([axes for _, axes in beam.frames()])
    stiffness = stacked_all([element.stiffness() for element in beam.parts()])[..., None] * np.eye(6)
    masses, centres = beam.node_weights()
    held = [i for i in range(masses.shape[-1]) if heavy and beam.body_of(i) != "ground"]
    numbers: dict[str, Array] = {
        "nodes": stacked_all(list(beam.node_names.values())), "joints": middles, "elements": middles,
        "axes": np.concatenate((axes, axes), axis=-3), "stiffness": stiffness,
        "damping": np.asarray(beam.beta)[..., None, None, None] * stiffness,
        "weight": masses[..., held, None] * gravity, "centres": centres[..., held, :],
    }  # fmt: skip
    return Made(tuple(beam.node_names), names, names, names, tuple([f"{beam.name}.weight{i}" for i in held]), numbers,
                 forms)  # fmt: skip


def _of_superelement(part: Superelement, force: Array, gravity: Array) -> Made:
    made, weights = EXPANSIONS[type(part)](part, {}), weights_of(part, gravity)
    joints = {name: joint for name, joint in made.joints.items() if joint.name != part.name}
    elastic, springs = ELASTIC[type(part)](part), tuple[Any, ...](made.springs.values())
    forms = _forms((*made.mass, *made.elastic))
    for key, form, points in loaded_forms(part, force, gravity):
        _add(forms, key, form, points)
    numbers: dict[str, Array] = {
        "nodes": _vectors([body.position for body in made.bodies.values()]),
        "joints": _vectors([joint.point for joint in joints.values()]),
        "elements": _vectors([point for _, point in elastic.nodes]),
        "axes": np.array([*(joint.axes for joint in joints.values()), *(spring.orientation for spring in springs)],
                         dtype=float).reshape(-1, 3, 3),
        "stiffness": _matrices([spring.stiffness for spring in springs]),
        "damping": _matrices([spring.damping for spring in springs]),
        "weight": _vectors([load.force for load in weights]),
        "centres": _vectors([load.position for load in weights]),
    }  # fmt: skip
    return Made(tuple(made.bodies), tuple(joints), tuple(made.springs), elastic.names,
                 tuple([load.name for load in weights]), numbers, forms)  # fmt: skip


def _vectors(values: Sequence[Any]) -> Array:
    return np.array(values, dtype=float).reshape(-1, 3)


def _matrices(values: Sequence[Any]) -> Array:
    """Stiffness of bushings, six values or a matrix each, as matrices."""
    return np.array([np.diag(value) if np.ndim(value) == 1 else value for value in values]).reshape(-1, 6, 6)


def _forms(every: Sequence[SharedRows]) -> dict[Nodes, tuple[Array, Array]]:
    """Forms and points of nodes of all rows."""
    result: dict[Nodes, tuple[Array, Array]] = {}
    for rows in every:
        weights = [("stiff", rows.stiffness), ("rate", rows.damping)]
        if rows.stiffness is None and rows.damping is None:
            weights = [("square", np.ones(rows.matrix.shape[-2]))]
        nodes = tuple([(node.body, node.relative_to, node.moves_with_ground) for node in rows.nodes])
        for power, weight in weights:
            if weight is not None:
                form = rows.matrix.swapaxes(-1, -2) @ (weight[..., None] * rows.matrix)
                _add(result, (power, nodes), form, stacked_all([node.point for node in rows.nodes]))
    return result


def _add(forms: dict[Nodes, tuple[Array, Array]], key: Nodes, form: Array, points: Array) -> None:
    forms[key] = (forms[key][0] + form if key in forms else form, points)


def weights_of(part: Any, gravity: Array) -> tuple[Any, ...]:
    """Return the loads on bodies that are the weight of a part."""
    if not gravity.any():
        return ()
    way = tuple(gravity.tolist())
    return beam_expansion.weights(part, way) if isinstance(part, Beam) else ELASTIC[type(part)](part, way).loads


def loaded_forms(part: Any, force: Array, gravity: Array) -> list[tuple[Nodes, Array, Array]]:
    """Return forms of the stiffness under forces in elements (e, 3) and gravity, linear in both."""
    if isinstance(part, Beam):
        axes = stacked_all([axes for _, axes in part.frames()])
        local = (force[:, None] @ axes)[..., 0, :]
        rows: Sequence[SharedRows] = bent_lines(part, np.concatenate((local, np.zeros_like(local)), axis=-1),
                                                np.broadcast_to(gravity, local.shape), every=True)  # fmt: skip
    else:
        rows = ELASTIC[type(part)](part, tuple(gravity.tolist())).weight_stiffness if gravity.any() else ()
    return [(key, *values) for key, values in _forms(rows).items()]


def element_names(part: Any) -> tuple[str, ...]:
    """Return the names of what carries forces at rest."""
    return part.element_names if isinstance(part, Beam) else ELASTIC[type(part)](part).names


@lru_cache(maxsize=16)
def beam_slopes(beam: Beam, force: Any, gravity: Any) -> tuple[Made, dict[Entry, dict[Any, Array]]]:
    """Return what a beam is made of, and the slopes of these numbers to each of its own, by complex steps."""
    made = _made(beam, *(rest := (np.array(force), np.array(gravity))))
    numbers = {item.name: item.value for item in beam.parameter_fields() if item.name in beam.batched_fields}
    # damping that it may have is stepped by itself, as other numbers do not act by it
    absent = [name for name, value in numbers.items() if value == 0.0]
    result: dict[Entry, dict[Any, Array]] = {}
    forms: dict[Nodes, tuple[Array, Array]] = {}
    for names in ([name for name in numbers if name not in absent], *([name] for name in absent)):
        entries = [(name, index) for name in names for index in np.ndindex(np.shape(numbers[name]))]
        values: dict[str, Any] = {name: np.array(numbers[name])[..., None] + np.zeros(len(entries), dtype=complex)
                                  for name in names}  # fmt: skip
        for k, (name, index) in enumerate(entries):
            values[name][(*index, k)] += 1j * STEP
        varied = _made(beam.of_variants(values), *rest)
        forms |= varied.forms
        change: dict[Any, Array] = {key: _slope(array, len(entries), made.numbers[key].shape)
                                    for key, array in varied.numbers.items()}  # fmt: skip
        change["turns"] = axial(change.pop("axes") @ made.numbers["axes"].swapaxes(-1, -2))
        for key, pair in varied.forms.items():
            for i, array in enumerate(pair):
                change[key, i] = _slope(array, len(entries), array.shape[-2:])
        result |= {entry: {key: array[k] for key, array in change.items()} for k, entry in enumerate(entries)}
    none = {key: (np.zeros(form.shape[-2:]), points[0].real if points.ndim > 2 else points)
            for key, (form, points) in forms.items()}  # fmt: skip
    made = replace(made, forms=none | made.forms)
    for change in result.values():
        for key, (form, points) in made.forms.items():
            change.setdefault((key, 0), np.zeros_like(form))
            change.setdefault((key, 1), np.zeros_like(points))
    return made, result


def _slope(array: Array, count: int, shape: tuple[int, ...]) -> Array:
    """Slopes (count, *shape) of numbers after complex steps, zero where they have no axis of these."""
    return np.broadcast_to(array.imag / STEP, (count, *shape))


@lru_cache(maxsize=64)
def moved_as_rigid(part: Any, force: Any, gravity: Any, direction: int) -> tuple[Made, dict[Any, Array]]:
    """Return what a part is made of, and its change as it shifts along x, y, z (0 to 2), or turns about these at its
    first node.
    """
    force, gravity = np.array(force), np.array(gravity)
    made, axis = _made(part, force, gravity), np.eye(3)[direction % 3]
    origin, turns = np.array(part.points[0]), direction > 2
    change: dict[Any, Array] = {key: np.zeros_like(made.numbers[key]) for key in ("stiffness", "damping", "weight")}
    change["turns"] = np.tile(axis * turns, (len(made.numbers["axes"]), 1))
    less = {key: form for key, form, _ in loaded_forms(part, np.cross(axis, force), np.cross(axis, gravity))
            } if turns else {}
    points = {key: made.numbers[key] for key in ("nodes", "joints", "elements", "centres")}
    for key, (form, at) in made.forms.items():
        spin = np.zeros(form.shape)
        for i, (*_, goes) in enumerate(key[1]):
            spin[6 * i : 6 * i + 6, 6 * i : 6 * i + 6] = np.kron(np.eye(2), skew(axis)) * (goes and turns)
        change[key, 0] = spin @ form - form @ spin - less.get(key, 0.0)
        points[key, 1] = at  # type: ignore[index]
    change |= {key: np.cross(axis, at - origin) if turns else np.tile(axis, (len(at), 1)) for key, at in points.items()}
    return made, change
