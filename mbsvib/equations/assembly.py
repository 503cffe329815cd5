"""Assembly: from a mechanism in numbers to the factors of its matrices, and to equations with names.

M = W^T W with one row of W per translation and rotation of a body, K = D^T diag(k) D and C = D^T diag(c) D with one row
of D per elastic direction: everything comes from the geometry by the path rule, and products are formed last.
"""

from __future__ import annotations

from copy import copy
from functools import partial
from typing import TYPE_CHECKING, TypeVar

from mbsvib.common.memory import keep_freed_memory
from mbsvib.equations.equations import Equations, Provenance
from mbsvib.equations.expansion import expanded
from mbsvib.equations.inertia import check_mass
from mbsvib.equations.matrices import matrices
from mbsvib.equations.maxwell_nodes import with_maxwell_nodes
from mbsvib.equations.scene import scene
from mbsvib.kinematics.loops import reduce
from mbsvib.kinematics.mobility import check_mobility
from mbsvib.kinematics.relative_motion import arm

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.elements.part import Part
    from mbsvib.equations.scene import Scene
    from mbsvib.equations.self_stress import Undetermined
    from mbsvib.mechanism.mechanism import Mechanism

E = TypeVar("E", bound=Equations)

# So few bodies and joints have fewer coordinates than sparse equations are taken for.
FEW = 100


def is_small(model: Mechanism) -> bool:
    """Return whether a mechanism is so small that its equations are dense unless sparse ones are asked for."""
    return not model.composed and len(model.bodies) + len(model.joints) <= FEW


def linearized(
    model: Mechanism, independent: Sequence[str] | None = None, cut: Sequence[str] | None = None,
    form: type[E] = Equations, origin: Mechanism | None = None,  # type: ignore[assignment]
) -> E:  # fmt: skip
    """Return the minimal linear equations of motion about the pose of a mechanism.

    M q'' + C q' + K q = B u,  y = Cq q + Cv q' + Ca q'' + D u

    Parameters
    ----------
    model : Mechanism
        The mechanism.
    independent : sequence of str, optional
        Joint coordinates (``"hip1.rx"``) that are to be among the minimal ones.
    cut : sequence of str, optional
        Joints at which loops are to be cut; default: chosen by the smallest cumulative degree of freedom.
    form : type
        The class of the equations.
    origin : Mechanism, optional
        The mechanism as the user gave it, where ``model`` is what it has been expanded to.

    Returns
    -------
    Equations
        Matrices, names and the way back to the bodies.

    Source: Jiang, Chen & Luo (2011), sections 2 and 3.
    """
    keep_freed_memory(len(model.joints))
    plain = expanded(model)
    return assembled(plain, scene(with_maxwell_nodes(plain), cut), independent, copy(origin or model), form=form)


def assembled(
    model: Mechanism, scene: Scene, independent: Sequence[str] | None = None, origin: Mechanism | None = None,
    checked: bool = True, form: type[E] = Equations,  # type: ignore[assignment]
) -> E:
    """Return the minimal linear equations of motion of a mechanism in numbers.

    Parameters
    ----------
    model : Mechanism
        The mechanism, for the names of its inputs and outputs.
    scene : Scene
        The same in numbers.
    independent : sequence of str, optional
        Joint coordinates that are to be among the minimal ones.
    origin : Mechanism, optional
        The model as the user gave it, which stays as it is.
    checked : bool
        Whether a pose that is not in balance is refused.
    form : type
        The class of the equations.

    Returns
    -------
    Equations
        Matrices, names and the way back to the bodies.
    """
    relative = scene.relative()
    locked, coordinates, felt = scene.locked, scene.coordinates, len(scene.springs.owner)
    phi = scene.closure(relative)
    reduction = reduce(coordinates, scene.cuts, phi, independent, partial(arm, scene.topology, scene.position))
    planar = check_mobility(scene.topology, coordinates, scene.cuts, reduction, scene.position)
    kept, turns = reduction.independent.tolist(), coordinates.turns.take(reduction.independent).tolist()
    names = tuple([coordinates.names[i] for i in kept])
    terms = matrices(scene, relative, reduction, relative.acting(locked, locked + felt))
    separation = statics = None
    said = model if origin is None else origin
    parts: tuple[Part, ...] = (  # in the order in which the model lists its parameters
        *said.gravity_parts, *scene.bodies, *scene.topology.joints, *scene.elements, *scene.couplers,
        *model.rotors.values(), *said.loads.values(),
    )  # fmt: skip
    if scene.loads is not None:
        from mbsvib.equations.loaded import load

        terms, statics = load(scene, relative, reduction, terms, model.name, checked, phi)
    undetermined: tuple[Undetermined, ...] = () if statics is None else statics.undetermined
    if scene.port.wrench_outputs:
        from mbsvib.equations.joint_forces import joint_force_rows

        terms, undetermined = joint_force_rows(model, scene, relative, reduction, terms, statics)
    if model.rotors:
        from mbsvib.equations.spin_terms import with_spin

        terms = with_spin(model, scene, reduction, terms)
    if scene.inertia.whole:
        check_mass(terms.M, names)
    else:
        from mbsvib.elements.maxwell_rows import given
        from mbsvib.equations.massless_separation import separate

        parts = given(parts)
        terms, stays, separation = separate(scene, reduction, terms, names, model, independent)
        names, turns = tuple([names[i] for i in stays]), [turns[i] for i in stays]
    if model.pieces is not None:
        parts = model.pieces.declared(parts)
    return form(
        name=model.name, coordinates=names,
        coordinate_units=tuple(["rad" if turn else "m" for turn in turns]),
        inputs=tuple(model.inputs), input_units=scene.port.input_units, outputs=tuple(model.outputs),
        output_units=scene.port.output_units, bodies=scene.topology.bodies, **terms.named(),
        provenance=Provenance(
            scene.topology, reduction, coordinates.names, scene.owners, parts, separation, statics,
            ports=(*model.inputs.values(), *model.outputs.values()), origin=origin, planar=planar,
            undetermined=undetermined,
        ),
    )  # fmt: skip


