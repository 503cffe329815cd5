"""Expansion: bodies, joints, springs, ports and shared rows replace beams, superelements and others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.elements.beam import Beam
from mbsvib.elements.beam_expansion import weights
from mbsvib.elements.elastic_part import ElasticPart, stiffness_of_forces, wrenches
from mbsvib.elements.families import EXPANSIONS, elastic_parts
from mbsvib.elements.shared_rows import Expansion, SharedRows
from mbsvib.errors import ModelError
from mbsvib.mechanism.mechanism import Mechanism

if TYPE_CHECKING:
    from mbsvib.mechanism.changes import Slots


_EXPANDED = ("bodies", "joints", "springs", "inputs", "outputs")
M = TypeVar("M", bound=Mechanism)


def expanded(model: M) -> M:
    """Return a mechanism in which bodies, joints, springs, inputs and outputs replace all parts with an expansion.

    Without such parts it is the same mechanism; shared rows are in its ``expansion``.
    """
    parts = [part for group in (model.composed, model.springs, model.inputs, model.outputs)
             for part in group.values() if type(part) in EXPANSIONS]  # fmt: skip
    if not parts and (not model.hubs or model.expansion is not None):
        return model
    from mbsvib.equations.wrenches import is_loaded

    groups: Any = {key: dict(getattr(model, key)) for key in _EXPANDED}
    ports = {id(part) for group in (model.inputs, model.outputs) for part in group.values()}
    owners = tuple([part for part in parts if id(part) not in ports])
    mass: list[SharedRows] = []
    elastic: list[SharedRows] = []
    carriers: dict[str, tuple[str, ...]] = {}
    names = {part.name for part in owners}
    order = list(EXPANSIONS)
    others = dict(model.composed) | dict(model.springs)
    # family by family, beams last: the order of coordinates does not depend on the order of calls
    for part in sorted(parts, key=lambda part: -order.index(type(part))):
        replacement = EXPANSIONS[type(part)](part, others)
        for key, group in groups.items():
            if part.name not in getattr(replacement, key) and group.get(part.name) is part:
                del group[part.name]
            group.update(getattr(replacement, key))
            names.update(getattr(replacement, key) if key not in ("inputs", "outputs") else ())
        mass += replacement.mass
        elastic += replacement.elastic
        carriers |= {part.name: replacement.carriers} if replacement.carriers else {}
    for output in groups["outputs"].values():
        if output.element in model.springs and not {output.element} & (groups["springs"].keys() | carriers):
            family = model.springs[output.element].family
            raise ModelError(f"output '{output.name}': the {family} '{output.element}' acts by several elements and "
                             f"has no force of its own.", element=output.name, field="element")  # fmt: skip
    nodes = frozenset(groups["bodies"]) - frozenset(model.bodies)
    expansion = Expansion(tuple(mass), tuple(elastic), nodes, owners, frozenset(names),
                          tuple([part.name for part in model.declared_parts]), carriers=carriers)  # fmt: skip
    result = model.with_parts(**groups, composed={}, expansion=expansion)
    if model.hubs:
        from mbsvib.equations.hubs import refuse_superelements, turning

        refuse_superelements(model)
        result = turning(result, model.beams)
    displaced = any(part.displacements is not None for part in model.composed.values())
    return _prestressed(result, model) if displaced or (model.composed and is_loaded(result)) else result


def with_damping_that_varies(model: M, slots: Slots) -> M:
    """Return a mechanism whose beams have the damping that varies; where it is zero it has no rows.

    Without such beams it is the same mechanism.
    """
    entries = [model.parameters.entry(name) for name in slots.names]
    begins = {entry.name: 1.0 for entry in entries if not entry.value and entry.field in ("alpha", "damping_ratio")
              and isinstance(slots.parameters.parts[entry.part], Beam)}  # fmt: skip
    return model.with_values(begins) if begins else model


def _prestressed(result: M, model: M) -> M:
    """The expanded mechanism with the forces in beams and superelements in the loaded pose."""
    from mbsvib.equations.beam_prestress import bent_lines, check_compression, element_forces
    from mbsvib.equations.hubs import falls

    beams, gravity = tuple(model.beams.values()), model.gravity
    reduced = elastic_parts(model.superelements.values(), gravity)
    loads = [load for group in (*(weights(beam, gravity) for beam in beams), *(part.loads for part in reduced))
             for load in group]  # fmt: skip
    result = result.with_parts(loads=dict(result.loads) | {load.name: load for load in loads})
    unloaded = with_elastic_forces(result, reduced, [np.zeros(len(part.values)) for part in reduced])
    preload, forces = element_forces(unloaded, beams, reduced)
    assert result.expansion is not None
    elements: dict[str, Any] = {}
    stiffness: list[SharedRows] = []
    for beam, fall in zip(beams, falls(result, beams), strict=True):
        own, preload = np.split(preload, [len(beam.element_names)])
        check_compression(beam, own)
        stiffness += bent_lines(beam, own, fall)
        elements |= {name: replace(result.springs[name], preload=tuple(six)) if any(six) else result.springs[name]
                     for name, six in zip(beam.element_names, own.tolist(), strict=True)}  # fmt: skip
    for part, row_forces in zip(reduced, forces, strict=True):
        stiffness += stiffness_of_forces(part, row_forces)
    expansion = replace(result.expansion, elastic=(*result.expansion.elastic, *stiffness))
    result = with_elastic_forces(result, reduced, forces)
    return result.with_parts(springs=dict(result.springs) | elements, expansion=expansion)


def with_elastic_forces(model: M, parts: Sequence[ElasticPart], forces: Sequence[Array]) -> M:
    """Return a mechanism with the wrenches of elastic parts on their nodes, for forces (r,) in the rows of each."""
    springs: dict[str, Any] = dict(model.springs)
    loads: dict[str, Any] = dict(model.loads)
    for part, row_forces in zip(parts, forces, strict=True):
        bushings, node_loads = wrenches(part, row_forces)
        springs |= {spring.name: spring for spring in bushings}
        loads |= {load.name: load for load in node_loads}
    return model.with_parts(loads=loads, springs=springs)
