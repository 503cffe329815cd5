"""Mechanisms whose beams and superelements are joints between their nodes: free ones to bend, or fixed ones.

Warnings where these parts bend beyond the range of small displacements.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import fields, replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.elements import joint as _joint
from mbsvib.elements.elastic_part import carrier_joints, massless_bodies, stiffness_of_forces, stiffness_rows
from mbsvib.elements.families import elastic_parts
from mbsvib.elements.shared_rows import Expansion, SharedRows
from mbsvib.equations.expansion import expanded, with_elastic_forces
from mbsvib.equations.hubs import on_held
from mbsvib.equilibrium.moved_parts import changed
from mbsvib.errors import LargeDisplacementWarning
from mbsvib.mechanism.mechanism import Mechanism

if TYPE_CHECKING:
    from mbsvib.equilibrium.report import Equilibrium


M = TypeVar("M", bound=Mechanism)


def articulated(model: M) -> M:
    """Return the same mechanism with free joints from the root of beams and superelements to their nodes.

    Nodes and internal coordinates become bodies. The parts stay in the model, as their forces depend on displacements.
    Without flexible parts the model is returned as it is.
    """
    model = on_held(model)
    if not model.composed:
        return model
    bodies, joints = dict(model.bodies), dict(model.joints)
    for part in model.composed.values():
        bodies |= massless_bodies(part.body_positions)
    for elastic in elastic_parts(model.composed.values(), None):
        for name, (node, point) in zip(elastic.names, elastic.nodes, strict=True):
            if node != elastic.root:
                joints[name] = _joint.make(name, "free", elastic.root, node, point, None, None, None, None, None)
        joints |= carrier_joints(elastic.owner, elastic.carriers, elastic.origin, elastic.internal)
    return model.with_parts(bodies=bodies, joints=joints)


def expanded_articulation(model: M) -> M:
    """Return an articulated mechanism in plain parts, with the forces and stiffness of beams and superelements in its
    pose.

    These are preloaded bushings, loads, and stiffness between more than two bodies.
    """
    if not model.composed:
        return expanded(model)
    parts = elastic_parts(model.composed.values(), model.gravity)
    result = with_elastic_forces(expanded(model.with_parts(composed={})), parts, [part.row_forces for part in parts])
    elastic: list[SharedRows] = []
    for part in parts:
        elastic += [stiffness_rows(part)] if len(part.values) else []
        elastic += stiffness_of_forces(part, part.row_forces)
    expansion = Expansion((), tuple(elastic), frozenset()) if result.expansion is None else \
        replace(result.expansion, elastic=(*result.expansion.elastic, *elastic))  # fmt: skip
    loads = dict(result.loads) | {load.name: load for part in parts for load in part.loads}
    return result.with_parts(loads=loads, expansion=expansion)


def elastic_scale(model: Mechanism, names: Sequence[str], energy: Array) -> Array:
    """Return factors (m,) that scale coordinates of beams and superelements to a stiffness like that of the others.

    ``energy`` (m,): stiffness of the coordinates ``names`` of the articulated mechanism in units of equal size. The
    factors are sqrt(smallest stiffness / own stiffness), at most one; one for all other coordinates.
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


def with_rigid_parts(model: M) -> M:
    """Return the same mechanism with fixed joints in place of beams and superelements, and their nodes as bodies.

    Fixed joints hold its hubs. Flexible parts have their weight as loads, as in ``linearize``; beside them inputs and
    outputs, which may refer to elements of beams, are left out.
    """
    model = on_held(model)
    if not model.composed:
        return model
    bodies, joints, loads = dict(model.bodies), dict(model.joints), dict(model.loads)
    for elastic in elastic_parts(model.composed.values(), model.gravity):
        loads |= {load.name: load for load in elastic.loads}
    for part in model.composed.values():
        bodies |= massless_bodies(part.node_names)
        for k, (body, point) in enumerate(dict(part.node_bodies).items()):
            if body != part.root:
                name = f"{part.name} holds {k}"
                joints[name] = _joint.make(name, "fixed", part.root, body, point, None, None, None, None, None)
    return model.with_parts(bodies=bodies, composed={}, joints=joints, loads=loads, inputs={}, outputs={})


def with_preloads_of(model: M, equilibrium: Equilibrium[M]) -> Equilibrium[M]:
    """Return the equilibrium of a mechanism from that of the same mechanism with rigid parts.

    ``equilibrium`` is the equilibrium of ``with_rigid_parts(model)``, which stands where wheels roll; its preloads
    become those of the mechanism.
    """
    if not (model.composed or model.hubs or model.rolling):
        return equilibrium
    changes = {name: {field.name: getattr(part, field.name) for field in fields(part)
                      if field.name in ("preload", "free_length")}
               for name, part in equilibrium.model.springs.items()}  # fmt: skip
    return replace(equilibrium, model=changed(model, changes))


# Rotation of a node [rad] against the body that carries the part; the relative error of displacements is about half its
# square.
TURNED = 0.15


def warn_beyond(deformed: Mechanism) -> None:
    """Warn of parts of a deformed model that bend beyond the range of small displacements, by ``TURNED``."""
    for part in deformed.composed.values():
        if part.displacements is None:
            continue
        six = np.array(part.displacements).reshape(-1)[: 6 * len(part.points)].reshape(-1, 6)
        angle = float(np.sqrt(np.square(six[:, 3:]).sum(axis=1)).max())
        if angle > TURNED:
            warnings.warn(f"{part.family} '{part.name}' bends by {angle:.2g} rad; displacements in the frame of the "
                          f"body that carries it are assumed to be small, which is accurate to about "
                          f"{0.5 * angle**2:.0%} there. Divide it into several parts with a body between them, or "
                          f"lower the load.", LargeDisplacementWarning, stacklevel=4)  # fmt: skip
