"""Mechanisms in plain parts: beams and others as bodies, joints, springs, outputs and shared rows."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, TypeVar

from mbsvib.elements.families import FAMILIES
from mbsvib.elements.shared_rows import Piece, Pieces
from mbsvib.errors import ModelError
from mbsvib.mechanism.mechanism import Mechanism

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
        If a superelement stands in a model under load.
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
    for part in parts:
        plain = EXPANSIONS[type(part)](part, model.composed)
        for key, group in groups.items():
            group.update(getattr(plain, key))
            made.update(getattr(plain, key) if key != "outputs" else ())
        mass += plain.mass
        elastic += plain.elastic
    nodes = frozenset(groups["bodies"]) - frozenset(model.bodies)
    pieces = Pieces(tuple(mass), tuple(elastic), nodes, owners, frozenset(made))
    result = model.with_parts(**groups, composed={}, pieces=pieces)
    return _prestressed(result, model) if model.composed and is_loaded(result) else result


def _prestressed(plain: M, model: M) -> M:
    """Return the plain mechanism with what the elements of beams carry in the loaded pose."""
    from mbsvib.equations.beam_prestress import bent_lines, carried, weights

    for name in model.superelements:
        raise ModelError(f"superelement '{name}': a model under load does not support superelements yet; leave the "
                         f"load out, or model it by beams.", element=name)  # fmt: skip
    beams = tuple(model.beams.values())
    if plain.gravity is not None:
        weight = {load.name: load for beam in beams for load in weights(beam, plain.gravity)}
        plain = plain.with_parts(loads=dict(plain.loads) | weight)
    carrying = carried(plain, beams)
    assert plain.pieces is not None
    bent = [piece for beam in beams for piece in bent_lines(beam, carrying)]
    pieces = replace(plain.pieces, elastic=(*plain.pieces.elastic, *bent))
    return plain.with_parts(springs=dict(plain.springs) | carrying, pieces=pieces)
