"""Expansion: bodies, joints, springs, outputs and shared rows replace beams, superelements and others."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from mbsvib.elements.families import FAMILIES
from mbsvib.elements.shared_rows import Expansion, SharedRows
from mbsvib.errors import ModelError
from mbsvib.mechanism.mechanism import Mechanism

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.elements.elastic_part import ElasticPart

EXPANSIONS = {family.part: family.expand for family in FAMILIES if family.expand is not None}
_EXPANDED = ("bodies", "joints", "springs", "outputs")
M = TypeVar("M", bound=Mechanism)


def expanded(model: M) -> M:
    """Return a mechanism in which bodies, joints, springs and outputs replace all parts with an expansion.

    Parameters
    ----------
    model : Mechanism
        The mechanism.

    Returns
    -------
    Mechanism
        The expanded mechanism, with shared rows in ``expansion``; the same mechanism if no part has an expansion.

    Raises
    ------
    ModelError
        If gravity acts on a superelement whose mass matrix does not determine its weight, or a force is asked of a
        part that several others replace.
    """
    parts = [part for group in (model.composed, model.springs, model.outputs) for part in group.values()
             if type(part) in EXPANSIONS]  # fmt: skip
    if not parts:
        return model
    from mbsvib.equations.wrenches import is_loaded

    groups: Any = {key: dict(getattr(model, key)) for key in _EXPANDED}
    owners = tuple([part for part in parts if model.outputs.get(part.name) is not part])
    mass: list[SharedRows] = []
    elastic: list[SharedRows] = []
    names = {part.name for part in owners}
    order = list(EXPANSIONS)
    # family by family, beams last: the order of coordinates does not depend on the order of calls
    for part in sorted(parts, key=lambda part: -order.index(type(part))):
        replacement = EXPANSIONS[type(part)](part, model.composed)
        for key, group in groups.items():
            if part.name not in getattr(replacement, key) and group.get(part.name) is part:
                del group[part.name]
            group.update(getattr(replacement, key))
            names.update(getattr(replacement, key) if key != "outputs" else ())
        mass += replacement.mass
        elastic += replacement.elastic
    for output in groups["outputs"].values():
        if output.element in model.springs and output.element not in groups["springs"]:
            family = model.springs[output.element].family
            raise ModelError(f"output '{output.name}': the {family} '{output.element}' acts by several elements and "
                             f"has no force of its own.", element=output.name, field="element")  # fmt: skip
    nodes = frozenset(groups["bodies"]) - frozenset(model.bodies)
    expansion = Expansion(tuple(mass), tuple(elastic), nodes, owners, frozenset(names),
                          tuple([part.name for part in model.declared_parts]))  # fmt: skip
    result = model.with_parts(**groups, composed={}, expansion=expansion)
    displaced = any(part.displacements is not None for part in model.composed.values())
    return _prestressed(result, model) if displaced or (model.composed and is_loaded(result)) else result


def _prestressed(result: M, model: M) -> M:
    """The expanded mechanism with the forces in beams and superelements in the loaded pose."""
    from mbsvib.elements.elastic_part import second_order_rotation_rows
    from mbsvib.elements.superelement_expansion import elastic_part
    from mbsvib.equations.beam_prestress import beam_weights, bent_lines, element_forces

    beams = tuple(model.beams.values())
    reduced = tuple([elastic_part(part, model.gravity) for part in model.superelements.values()])
    weights = beam_weights(beams, result.gravity) | {load.name: load for part in reduced for load in part.loads}
    result = result.with_parts(loads=dict(result.loads) | weights)
    unloaded = _with_node_wrenches(result, [(part, np.zeros(len(part.values))) for part in reduced])
    loaded_elements, forces = element_forces(unloaded, beams, reduced)
    assert result.expansion is not None
    stiffness = [rows for beam in beams for rows in bent_lines(beam, loaded_elements, result.gravity)]
    for part, rows in zip(reduced, forces, strict=True):
        stiffness += [*part.weight_stiffness, *second_order_rotation_rows(part, part.forces(rows))]
    expansion = replace(result.expansion, elastic=(*result.expansion.elastic, *stiffness))
    result = _with_node_wrenches(result, list(zip(reduced, forces, strict=True)))
    return result.with_parts(springs=dict(result.springs) | loaded_elements, expansion=expansion)


def _with_node_wrenches(model: M, parts: Sequence[tuple[ElasticPart, Array]]) -> M:
    """The mechanism with the wrenches of superelements on their nodes, by the forces in their rows."""
    from mbsvib.elements.elastic_part import wrenches

    springs: dict[str, Any] = dict(model.springs)
    loads: dict[str, Any] = dict(model.loads)
    for part, rows in parts:
        bushings, node_loads = wrenches(part, rows)
        springs |= {spring.name: spring for spring in bushings}
        loads |= {load.name: load for load in node_loads}
    return model.with_parts(loads=loads, springs=springs)
