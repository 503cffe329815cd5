"""Assembly: from a mechanism to the factors of its matrices, and to equations with names.

M = W^T W with one row of W per translation and rotation of a body, K = D^T diag(k) D and C = D^T diag(c) D with one row
of D per elastic direction. All rows follow from the geometry by the path rule, and products are formed last.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from typing import TypeVar

from mbsvib.common.memory import keep_freed_memory
from mbsvib.equations.draft import Draft, first_draft
from mbsvib.equations.equations import Equations, Provenance
from mbsvib.equations.expansion import expanded
from mbsvib.equations.inertia import check_mass
from mbsvib.equations.locked_loops import check_loops
from mbsvib.equations.scene import Scene, scene, with_maxwell_nodes
from mbsvib.equations.wrenches import has_antisymmetric_forces
from mbsvib.kinematics.mobility import check_mobility
from mbsvib.mechanism.drives import driven_coordinates, with_drives_in_tree
from mbsvib.mechanism.mechanism import Mechanism

E = TypeVar("E", bound=Equations)

# Mechanisms with up to this number of bodies and joints have dense equations by default.
FEW = 100
# Frames from a warning to the line that asks for linear equations.
STACK = 6


def is_small(model: Mechanism) -> bool:
    """Return whether a mechanism is so small that its equations are dense by default."""
    return not model.composed and len(model.bodies) + len(model.joints) <= FEW


def linearized(
    model: Mechanism, independent: Sequence[str] | None = None, cut: Sequence[str] | None = None,
    form: type[E] = Equations, origin: Mechanism | None = None,  # type: ignore[assignment]
) -> E:  # fmt: skip
    """Return the minimal linear equations of motion about the pose of a mechanism.

    M q'' + C q' + K q = B u,  y = Cq q + Cv q' + Ca q'' + D u

    ``independent``: joint coordinates (``"hip1.rx"``) that must be among the minimal ones. ``cut``: joints at which
    loops are to be cut; None: chosen by the smallest cumulative degree of freedom. ``form``: the class of the
    equations. ``origin``: the user's mechanism, if ``model`` is its expansion.

    Source: Jiang, Chen & Luo (2011), sections 2 and 3.
    """
    keep_freed_memory(len(model.joints))
    model, origin = expanded(model), copy(origin or model)
    cut = with_drives_in_tree(model, cut)
    return assembled(model, scene(with_maxwell_nodes(model), cut), independent, origin, form=form)


def assembled(
    model: Mechanism, scene: Scene, independent: Sequence[str] | None = None, origin: Mechanism | None = None,
    checked: bool = True, form: type[E] = Equations,  # type: ignore[assignment]
) -> E:
    """Return the minimal linear equations of motion of a mechanism from its arrays, of the class ``form``.

    ``independent``: joint coordinates that must be among the minimal ones. ``origin``: the user's mechanism, which must
    not change later. If ``checked``, a pose that is not in balance is refused.
    """
    draft = first_draft(model, scene, independent, checked)
    check_loops(model, draft.reduction.groups, scene.coordinates.names, STACK)
    planar = check_mobility(scene.topology, scene.coordinates, scene.cuts, draft.reduction, scene.position)
    for step in STEPS:
        draft = step(draft)
    turns = scene.coordinates.turns
    return form(
        name=model.name, coordinates=draft.names,
        coordinate_units=tuple(["rad" if turns[k] else "m" for k in draft.minimal]),
        inputs=tuple(model.inputs), input_units=scene.port.input_units, outputs=tuple(model.outputs),
        output_units=scene.port.output_units, bodies=scene.topology.bodies, **draft.terms.named(),
        provenance=Provenance(
            scene.topology, draft.reduction, scene.coordinates.names, scene.owners,
            (model if origin is None else origin).declared_parts, draft.separation, draft.statics,
            ports=(*model.inputs.values(), *model.outputs.values()), origin=origin, planar=planar,
            undetermined=draft.undetermined,
        ),
    )  # fmt: skip


def _loads(draft: Draft) -> Draft:
    if draft.scene.loads is None:
        return draft
    from mbsvib.equations.loaded import with_loads

    return with_loads(draft)


def _joint_forces(draft: Draft) -> Draft:
    if not draft.scene.port.wrench_outputs:
        return draft
    from mbsvib.equations.joint_forces import with_joint_forces

    return with_joint_forces(draft)


def _spin(draft: Draft) -> Draft:
    if not draft.model.derived(has_antisymmetric_forces):
        return draft
    from mbsvib.equations.loaded import with_spin

    return with_spin(draft)


def _drives(draft: Draft) -> Draft:
    if not draft.model.derived(driven_coordinates):
        return draft
    from mbsvib.equations.loaded import with_driven_coordinates

    return with_driven_coordinates(draft)


def _masses(draft: Draft) -> Draft:
    if draft.scene.inertia.regular:
        check_mass(draft.terms.M, draft.names)
        return draft
    from mbsvib.equations.massless_separation import separated

    return separated(draft)


# Contributions of other parts than bodies and connections, in this order; a step without such parts returns its draft,
# and does not load its module. All but the last take many variants at once.
STEPS: tuple[Callable[[Draft], Draft], ...] = (_loads, _joint_forces, _spin, _drives, _masses)
