"""Mechanisms whose beams and superelements are joints between their nodes: free ones to bend, or fixed ones."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from mbsvib.elements import beam_expansion, superelement_expansion
from mbsvib.elements import body as _body
from mbsvib.elements import joint as _joint
from mbsvib.elements.elastic_part import second_order_rotation_rows, stiffness_rows, wrenches
from mbsvib.elements.shared_rows import Expansion
from mbsvib.equations.beam_prestress import beam_weights
from mbsvib.equations.expansion import expanded
from mbsvib.equilibrium.flexible_parts import attachment_points, flexible
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.mechanism.rebuilding import changed

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.elements.elastic_part import ElasticPart
    from mbsvib.elements.shared_rows import SharedRows
    from mbsvib.equilibrium.report import Equilibrium

M = TypeVar("M", bound=Mechanism)


def articulated(model: M) -> M:
    """Return the same mechanism with free joints between the nodes of beams and superelements, which bend.

    Nodes and internal coordinates become bodies. The parts stay in the model, as their forces depend on displacements.
    The weight of beams acts as loads on their nodes, as in ``linearize``. Without flexible parts the model is returned
    as it is.
    """
    if not model.composed:
        return model
    bodies, joints = dict(model.bodies), dict(model.joints)
    for part in model.superelements.values():
        bodies |= {body.name: body for body in superelement_expansion.node_bodies(part)}
        joints |= dict(superelement_expansion.links(part))
    for beam in model.beams.values():
        bodies |= {body.name: body for body in beam_expansion.node_bodies(beam)}
        line = beam_expansion.elastic_part(beam)
        for name, (node, point) in zip(line.names, line.nodes, strict=True):
            joints[name] = _joint.make(name, "free", line.root, node, point, None, None, None, None, None)
    loads = dict(model.loads) | beam_weights(model.beams.values(), model.gravity)
    return model.with_parts(bodies=bodies, joints=joints, loads=loads)


def expanded_articulation(model: M) -> M:
    """Return an articulated mechanism in plain parts, with the forces and stiffness of beams and superelements in its
    pose.

    These are preloaded bushings, loads, and stiffness between more than two bodies.
    """
    result = expanded(model.with_parts(composed={}) if model.composed else model)
    if not model.composed:
        return result
    springs, loads = dict(result.springs), dict(result.loads)
    elastic: list[SharedRows] = []
    parts = [*map(beam_expansion.elastic_part, model.beams.values()), *_reduced(model)]
    for part in parts:
        bushings, pulls = wrenches(part)
        springs |= {spring.name: spring for spring in bushings}
        loads |= {load.name: load for load in (*pulls, *part.loads)}
        elastic += [stiffness_rows(part)] if len(part.values) else []
        elastic += [*second_order_rotation_rows(part, part.forces()), *part.weight_stiffness]
    expansion = Expansion((), tuple(elastic), frozenset()) if result.expansion is None else \
        replace(result.expansion, elastic=(*result.expansion.elastic, *elastic))  # fmt: skip
    return result.with_parts(springs=springs, loads=loads, expansion=expansion)


def elastic_scale(model: Mechanism, names: Sequence[str], energy: Array) -> Array:
    """Return factors (m,) that scale coordinates of beams and superelements to a stiffness like that of the others.

    Parameters
    ----------
    model : Mechanism
        The articulated mechanism.
    names : sequence of str
        Names of its minimal coordinates.
    energy : array, shape (m,)
        Stiffness of each coordinate in units of equal size.

    Returns
    -------
    array, shape (m,)
        sqrt(smallest stiffness / own stiffness), at most one; one for all other coordinates.
    """
    if not model.composed:
        return np.ones(len(names))
    # names of the user have no dots, so that these parts own all names that begin with theirs
    elastic = np.array([name.partition(".")[0] in model.composed for name in names], dtype=bool) & (energy > 0.0)
    result = np.ones(len(names))
    if elastic.any():
        others = energy[~elastic & (energy > 0.0)]
        least = min(float(energy[elastic].min()), float(others.max()) if len(others) else np.inf)
        result[elastic] = np.minimum(1.0, np.sqrt(least / energy[elastic]))
    return result


def _reduced(model: Mechanism) -> list[ElasticPart]:
    """Superelements with their weight."""
    return [superelement_expansion.elastic_part(part, model.gravity) for part in model.superelements.values()]


def with_rigid_parts(model: M) -> M:
    """Return the same mechanism with fixed joints in place of beams and superelements, and their nodes as bodies.

    The weight of beams acts as loads on their nodes, as in ``linearize``. Inputs and outputs, which may refer to
    elements of beams, are left out. Without flexible parts the model is returned as it is.
    """
    if not model.composed:
        return model
    bodies, joints = dict(model.bodies), dict(model.joints)
    loads = dict(model.loads) | beam_weights(model.beams.values(), model.gravity)
    loads |= {load.name: load for reduced in _reduced(model) for load in reduced.loads}
    parts = flexible(model)
    for part in parts:
        for node, point in part.node_names.items():
            bodies[node] = _body.make(node, 0.0, (0.0, 0.0, 0.0), point, None)
    for part in parts:
        points = attachment_points(part)
        root = part.root
        for k, (body, point) in enumerate(points.items()):
            if body != root:
                name = f"{part.name} holds {k}"
                joints[name] = _joint.make(name, "fixed", root, body, point, None, None, None, None, None)
    return model.with_parts(bodies=bodies, composed={}, joints=joints, loads=loads, inputs={}, outputs={})


def with_preloads_of(model: M, equilibrium: Equilibrium[M]) -> Equilibrium[M]:
    """Return the equilibrium of a mechanism from that of the same mechanism with rigid parts.

    ``equilibrium`` is the equilibrium of ``with_rigid_parts(model)``; its preloads become those of the mechanism.
    """
    if not model.composed:
        return equilibrium

    changes = {name: {field.name: getattr(part, field.name) for field in fields(part)
                      if field.name in ("preload", "free_length")}
               for name, part in equilibrium.model.springs.items()}  # fmt: skip
    return replace(equilibrium, model=changed(model, changes))
