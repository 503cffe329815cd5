"""Mechanisms in plain parts: beams and superelements as bodies, joints, springs and shared rows."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, TypeVar

from mbsvib.errors import ModelError
from mbsvib.mechanism.mechanism import Mechanism

M = TypeVar("M", bound=Mechanism)


def expanded(model: M) -> M:
    """Return a mechanism in plain parts: nodes of beams and superelements as bodies, elements as joints and bushings.

    Parameters
    ----------
    model : Mechanism
        The mechanism.

    Returns
    -------
    Mechanism
        The same mechanism, with what more than two bodies share in ``pieces``; itself if nothing in it bends.

    Raises
    ------
    ModelError
        If a superelement stands in a model under load.
    """
    if not model.composed:
        return model
    from mbsvib.elements import superelement_expansion as _reduced
    from mbsvib.elements.beam_expansion import dampers, elements, masses, node_bodies
    from mbsvib.elements.shared_rows import Pieces
    from mbsvib.equations.wrenches import is_loaded

    bodies: dict[str, Any] = dict(model.bodies)
    joints: dict[str, Any] = dict(model.joints)
    springs: dict[str, Any] = dict(model.springs)
    mass, elastic = [], []
    for part in model.superelements.values():
        bodies |= {body.name: body for body in _reduced.node_bodies(part)}
        joints |= dict(_reduced.links(part))
        mass += _reduced.masses(part)
        elastic += _reduced.elastic(part)
    for beam in model.beams.values():
        bodies |= {body.name: body for body in node_bodies(beam)}
        for joint, spring in elements(beam):
            joints[joint.name], springs[spring.name] = joint, spring
        mass += masses(beam)
        elastic += dampers(beam)
    nodes = frozenset(bodies) - frozenset(model.bodies)
    pieces = Pieces(tuple(mass), tuple(elastic), nodes, tuple(model.composed.values()))
    plain = model.with_parts(bodies=bodies, joints=joints, springs=springs, composed={}, pieces=pieces)
    return _prestressed(plain, model) if is_loaded(plain) else plain


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
