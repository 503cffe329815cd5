"""Mechanisms in plain parts: beams and others as bodies, joints, springs, outputs and shared rows."""

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
_MADE = ("bodies", "joints", "springs", "outputs")
M = TypeVar("M", bound=Mechanism)


def expanded(model: M) -> M:
    """Return a mechanism in plain parts: each part in place of which its family has others becomes these.

    Parameters
    ----------
    model : Mechanism
        The mechanism.

    Returns
    -------
    Mechanism
        The same mechanism, with what more than two bodies share in ``pieces``; itself if all parts are plain.

    Raises
    ------
    ModelError
        If gravity acts on a superelement whose mass does not tell how.
    """
    parts = [part for group in (model.composed, model.springs, model.outputs) for part in group.values()
             if type(part) in EXPANSIONS]  # fmt: skip
    if not parts:
        return model
    from mbsvib.equations.wrenches import is_loaded

    groups: Any = {key: dict(getattr(model, key)) for key in _MADE}
    owners = tuple([part for part in parts if model.outputs.get(part.name) is not part])
    mass: list[Piece] = []
    elastic: list[Piece] = []
    made = {part.name for part in owners}
    # the order of coordinates does not depend on which of both was added first: superelements, then beams
    for part in sorted(parts, key=lambda part: isinstance(part, Beam)):
        plain = EXPANSIONS[type(part)](part, model.composed)
        for key, group in groups.items():
            group.update(getattr(plain, key))
            made.update(getattr(plain, key) if key != "outputs" else ())
        mass += plain.mass
        elastic += plain.elastic
    nodes = frozenset(groups["bodies"]) - frozenset(model.bodies)
    pieces = Pieces(tuple(mass), tuple(elastic), nodes, owners, frozenset(made),
                    tuple([part.name for part in model.declared_parts]))  # fmt: skip
    result = model.with_parts(**groups, composed={}, pieces=pieces)
    bent = any(beam.displacements is not None for beam in model.beams.values()) or any(
        part.displacements is not None for part in model.superelements.values())  # fmt: skip
    return _prestressed(result, model) if bent or (model.composed and is_loaded(result)) else result


def _prestressed(plain: M, model: M) -> M:
    """Return the plain mechanism with what beams and superelements carry in the loaded pose."""
    from mbsvib.elements.elastic_part import rotation_rows
    from mbsvib.elements.superelement_expansion import elastic_part
    from mbsvib.equations.beam_prestress import bent_lines, carried, weights

    beams = tuple(model.beams.values())
    reduced = tuple([elastic_part(part, model.gravity) for part in model.superelements.values()])
    loads: dict[str, Any] = dict(plain.loads)
    if plain.gravity is not None:
        loads |= {load.name: load for beam in beams for load in weights(beam, plain.gravity)}
        loads |= {load.name: load for part in reduced for load in part.loads}
    plain = plain.with_parts(loads=loads)
    carrying, forces = carried(_pulled(plain, [(part, np.zeros(len(part.values))) for part in reduced]), beams, reduced)
    assert plain.pieces is not None
    bent = [piece for beam in beams for piece in bent_lines(beam, carrying)]
    for part, rows in zip(reduced, forces, strict=True):
        bent += [*part.extra, *rotation_rows(part, part.forces(rows))]
    pieces = replace(plain.pieces, elastic=(*plain.pieces.elastic, *bent))
    plain = _pulled(plain, list(zip(reduced, forces, strict=True)))
    return plain.with_parts(springs=dict(plain.springs) | carrying, pieces=pieces)


def _pulled(plain: M, parts: Sequence[tuple[ElasticPart, Array]]) -> M:
    """Return a mechanism with what superelements do to their nodes, by the forces in their rows."""
    from mbsvib.elements.elastic_part import wrenches

    springs: dict[str, Any] = dict(plain.springs)
    loads: dict[str, Any] = dict(plain.loads)
    for part, rows in parts:
        bushings, pulls = wrenches(part, rows)
        springs |= {spring.name: spring for spring in bushings}
        loads |= {load.name: load for load in pulls}
    return plain.with_parts(loads=loads, springs=springs)
