"""Expansion: mechanisms whose beams, superelements and others are bodies, joints, springs, outputs and shared rows."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from mbsvib.elements.beam import Beam
from mbsvib.elements.families import FAMILIES
from mbsvib.elements.shared_rows import Piece, Pieces
from mbsvib.mechanism.mechanism import Mechanism

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.elements.elastic_part import ElasticPart

EXPANSIONS = {family.part: family.plain for family in FAMILIES if family.plain is not None}
_EXPANDED = ("bodies", "joints", "springs", "outputs")
M = TypeVar("M", bound=Mechanism)


def expanded(model: M) -> M:
    """Return a mechanism in plain parts: parts with an expansion in the table of families are replaced by it.

    Parameters
    ----------
    model : Mechanism
        The mechanism.

    Returns
    -------
    Mechanism
        The same mechanism, with rows that more than two bodies share in ``pieces``; itself if all parts are plain.

    Raises
    ------
    ModelError
        If gravity acts on a superelement whose mass matrix does not determine its weight.
    """
    parts = [part for group in (model.composed, model.springs, model.outputs) for part in group.values()
             if type(part) in EXPANSIONS]  # fmt: skip
    if not parts:
        return model
    from mbsvib.equations.wrenches import is_loaded

    groups: Any = {key: dict(getattr(model, key)) for key in _EXPANDED}
    owners = tuple([part for part in parts if model.outputs.get(part.name) is not part])
    mass: list[Piece] = []
    elastic: list[Piece] = []
    names = {part.name for part in owners}
    # superelements first, then beams: the order of coordinates does not depend on the order of calls
    for part in sorted(parts, key=lambda part: isinstance(part, Beam)):
        plain = EXPANSIONS[type(part)](part, model.composed)
        for key, group in groups.items():
            group.update(getattr(plain, key))
            names.update(getattr(plain, key) if key != "outputs" else ())
        mass += plain.mass
        elastic += plain.elastic
    nodes = frozenset(groups["bodies"]) - frozenset(model.bodies)
    pieces = Pieces(tuple(mass), tuple(elastic), nodes, owners, frozenset(names),
                    tuple([part.name for part in model.declared_parts]))  # fmt: skip
    result = model.with_parts(**groups, composed={}, pieces=pieces)
    displaced = any(beam.displacements is not None for beam in model.beams.values()) or any(
        part.displacements is not None for part in model.superelements.values())  # fmt: skip
    return _prestressed(result, model) if displaced or (model.composed and is_loaded(result)) else result


def _prestressed(plain: M, model: M) -> M:
    """Return the plain mechanism with the forces in beams and superelements in the loaded pose."""
    from mbsvib.elements.elastic_part import rotation_rows
    from mbsvib.elements.superelement_expansion import elastic_part
    from mbsvib.equations.beam_prestress import beam_weights, bent_lines, element_forces

    beams = tuple(model.beams.values())
    reduced = tuple([elastic_part(part, model.gravity) for part in model.superelements.values()])
    weights = beam_weights(beams, plain.gravity) | {load.name: load for part in reduced for load in part.loads}
    plain = plain.with_parts(loads=dict(plain.loads) | weights)
    unloaded = _with_node_wrenches(plain, [(part, np.zeros(len(part.values))) for part in reduced])
    loaded_elements, forces = element_forces(unloaded, beams, reduced)
    assert plain.pieces is not None
    stiffness = [piece for beam in beams for piece in bent_lines(beam, loaded_elements)]
    for part, rows in zip(reduced, forces, strict=True):
        stiffness += [*part.extra, *rotation_rows(part, part.forces(rows))]
    pieces = replace(plain.pieces, elastic=(*plain.pieces.elastic, *stiffness))
    plain = _with_node_wrenches(plain, list(zip(reduced, forces, strict=True)))
    return plain.with_parts(springs=dict(plain.springs) | loaded_elements, pieces=pieces)


def _with_node_wrenches(plain: M, parts: Sequence[tuple[ElasticPart, Array]]) -> M:
    """Return a mechanism with the wrenches of superelements on their nodes, by the forces in their rows."""
    from mbsvib.elements.elastic_part import wrenches

    springs: dict[str, Any] = dict(plain.springs)
    loads: dict[str, Any] = dict(plain.loads)
    for part, rows in parts:
        bushings, node_loads = wrenches(part, rows)
        springs |= {spring.name: spring for spring in bushings}
        loads |= {load.name: load for load in node_loads}
    return plain.with_parts(loads=loads, springs=springs)
