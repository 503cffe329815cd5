"""Assembly: from a model to the factors of its matrices, and to the system of named equations.

M = W^T W with one row of W per translation and rotation of a body, K = D^T diag(k) D and C = D^T diag(c) D with one row
of D per elastic direction: everything comes from the geometry by the path rule, and products are formed last.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from operator import is_
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np

from mbsvib.api.system import Provenance, System
from mbsvib.common.expected import a_model
from mbsvib.common.memory import keep_freed_memory
from mbsvib.elements import Maxwell
from mbsvib.elements.rows import Rows, table
from mbsvib.equations import spring_rows as _elements
from mbsvib.equations.inertia import check_mass, spatial_inertia
from mbsvib.equations.ports import Ports, port_matrices, ports
from mbsvib.equations.self_stress import warn
from mbsvib.equations.wrenches import is_loaded
from mbsvib.kinematics.loops import Cuts, Reduction, reduce
from mbsvib.kinematics.mobility import check_mobility
from mbsvib.kinematics.relative_motion import Triplets, Twists, arm, body_motion, relative_motion, twists
from mbsvib.kinematics.shared_rows import shared_rows
from mbsvib.linalg.products import gram, product
from mbsvib.mechanism.topology import span

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike, NDArray

    from mbsvib.api.batch import Batch
    from mbsvib.api.model import Model
    from mbsvib.api.sparse_system import SparseSystem
    from mbsvib.common.arrays import Array
    from mbsvib.elements import Body, Bushing, Spring
    from mbsvib.elements.coupler import Coupling
    from mbsvib.elements.part import Part
    from mbsvib.equations.inertia import SpatialInertia
    from mbsvib.equations.second_order_rows import Felt
    from mbsvib.equations.self_stress import Undetermined
    from mbsvib.equations.spring_rows import Elements
    from mbsvib.equations.wrenches import Applied
    from mbsvib.kinematics.shared_rows import Shared
    from mbsvib.mechanism.topology import Topology


@dataclass(frozen=True, slots=True)
class Scene:
    """A mechanism in numbers, before anything is computed: what all its matrices are made of.

    ``position`` (..., bodies, 3) are the centres of mass; arrays may have an axis of variants, see ``kinematics``.
    """

    topology: Topology
    bodies: tuple[Body, ...]
    elements: tuple[Bushing | Spring, ...]
    position: Array
    coordinates: Twists
    cuts: Cuts | None
    springs: Elements
    port: Ports
    inertia: SpatialInertia
    shared: Shared | None = None
    loads: tuple[Applied, Felt, dict[str, Any]] | None = None
    couplers: tuple[Coupling, ...] = ()

    @property
    def locked(self) -> int:
        """Number of locked rows of cut joints, which come first among the rows."""
        return len(self.cuts.rows.first) if self.cuts else 0

    @property
    def owners(self) -> tuple[str, ...]:
        """Names of what owns elastic rows, in the order of their numbers."""
        names = tuple([part.name for part in self.elements])
        return names if self.shared is None else names + self.shared.names

    def relative(self) -> Triplets:
        """Return what cut joints lock, what springs feel, what ports see and what loads feel, in one pass."""
        rows = [*([self.cuts.rows] if self.cuts else []), self.springs.rows, self.port.rows]
        if self.shared is not None:
            rows += self.shared.base
        elif self.loads is not None:
            rows.append(self.loads[1].rows)
        return relative_motion(self.coordinates, Rows.join(rows))

    def closure(self, relative: Triplets) -> Array:
        """Return Phi (..., locked rows, n): what cut joints lock, out of ``relative()``, and behind it the couplers."""
        if self.cuts is None:
            return np.empty((*relative.value.shape[:-1], 0, relative.shape[1]))
        phi = relative.dense(0, self.locked)
        if self.cuts.couplings is None:
            return phi
        coupled = self.cuts.couplings.dense(self.coordinates)
        lead = max(phi.shape[:-2], coupled.shape[:-2], key=len)
        return np.concatenate([np.broadcast_to(part, (*lead, *part.shape[-2:])) for part in (phi, coupled)], axis=-2)


# So few bodies and joints have fewer coordinates than the sparse equations are taken for.
FEW = 100


@overload
def linearize(
    model: Model, independent: Sequence[str] | None = ..., cut: Sequence[str] | None = ..., values: None = ...,
    method: Literal["dense"] | None = ...,
) -> System: ...  # fmt: skip


@overload
def linearize(
    model: Model, independent: Sequence[str] | None = ..., cut: Sequence[str] | None = ..., values: None = ..., *,
    method: Literal["sparse"],
) -> SparseSystem: ...  # fmt: skip


@overload
def linearize(
    model: Model, independent: Sequence[str] | None = ..., cut: Sequence[str] | None = ..., *,
    values: Mapping[str, ArrayLike], method: Literal["dense"] | None = ...,
) -> Batch: ...  # fmt: skip


def linearize(
    model: Model, independent: Sequence[str] | None = None, cut: Sequence[str] | None = None,
    values: Mapping[str, ArrayLike] | None = None, method: str | None = None,
) -> System | Batch | SparseSystem:  # fmt: skip
    """Return the minimal linear equations of motion about the model's pose.

    M q'' + C q' + K q = B u,  y = Cq q + Cv q' + Ca q'' + D u

    Parameters
    ----------
    model : Model
        The mechanism.
    independent : sequence of str, optional
        Joint coordinates (``"hip1.rx"``) that are to be among the minimal ones.
    cut : sequence of str, optional
        Joints at which loops are to be cut; default: chosen by the smallest cumulative degree of freedom.
    values : mapping of str to array-like, shape (n,) or (), optional
        Values of parameters, by name or pattern, for n variants in one pass.
    method : str, optional
        "dense" or "sparse"; default: dense up to some hundred coordinates, sparse beyond.

    Returns
    -------
    System, Batch or SparseSystem
        Matrices, names and the way back to the bodies; of all variants where ``values`` is given; sparse, under the
        same names, where there are many bodies.

    Raises
    ------
    ModelError
        If a name is unknown, a cut leaves bodies hanging, a coordinate cannot be independent or has no inertia, or
        a variant has a value that is refused.
    SingularPoseError
        If the number of degrees of freedom is not defined in this pose, or is another one in a variant.

    Warns
    -----
    UndeterminedForceWarning
        If an output is a force in joints that redundant constraints leave open.

    Source: Jiang, Chen & Luo (2011), sections 2 and 3.
    """
    origin = a_model(model, "linearize")
    if model._composed:
        if values is not None:
            model._refuse_composed("linearize(values=...)", "linearize variants one by one, with model.with_values")
        model = model._expanded()
    if method is not None or len(model.bodies) + len(model.joints) > FEW:
        from mbsvib.api.engine_choice import wants_sparse

        if wants_sparse(model, method, independent, cut, values):
            from mbsvib.sparse.assembly import linearize as linearize_sparse

            large = linearize_sparse(model, cut)
            warn(model.name, large.undetermined)
            return large
    if values is not None:
        from mbsvib.equations.batch_assembly import linearize_batch

        batch = linearize_batch(model, values, independent, cut)
        warn(model.name, batch.nominal.provenance.undetermined)
        return batch
    keep_freed_memory(len(model.joints))
    result = system(model, scene(model, cut), independent, origin._snapshot())
    warn(model.name, result.provenance.undetermined)
    return result


def scene(model: Model, cut: Sequence[str] | None = None) -> Scene:
    """Return a mechanism in numbers.

    Parameters
    ----------
    model : Model
        The mechanism.
    cut : sequence of str, optional
        Joints at which loops are to be cut.

    Returns
    -------
    Scene
        Everything that its matrices are made of.
    """
    if model._composed:
        model = model._expanded()
    if Maxwell in map(type, model._springs.values()):
        from mbsvib.elements.maxwell_rows import with_nodes

        model = with_nodes(model)
    topology = span(model, cut)
    bodies = list(model.bodies.values())
    number = {name: i for i, name in enumerate(topology.bodies)}
    number["ground"] = len(bodies)
    elements = tuple(model.springs.values())
    coordinates, cuts = twists(topology, bodies), cut_rows(topology, bodies, number)
    couplers = tuple(model._couplers.values())
    if couplers:
        from mbsvib.kinematics.couplers import with_couplers

        cuts = with_couplers(cuts, couplers, topology, bodies, number, coordinates)
    return Scene(
        topology, tuple(bodies), elements, table([body.position for body in bodies], 3), coordinates, cuts,
        _elements.stack(elements, number), ports(model, bodies, number),
        spatial_inertia(bodies), None if model._pieces is None else shared_rows(model._pieces, number, len(elements)),
        _loads(model, topology, number) if is_loaded(model) else None, couplers,
    )  # fmt: skip


def _loads(model: Model, topology: Topology, number: Mapping[str, int]) -> tuple[Applied, Felt, dict[str, Any]]:
    """What loads a model, and what its forces feel: kept with the model as long as all parts are the same."""
    from mbsvib.equations.second_order_rows import felt
    from mbsvib.equations.wrenches import applied

    parts: list[Any] = [model.gravity]
    for group in (model._bodies, model._joints, model._springs, model._couplers, model._loads):
        parts += group.values()
    kept = model._loading
    if kept is not None and len(kept[0]) == len(parts) and all(map(is_, kept[0], parts)):
        return kept[1]
    acting = applied(model, number)
    coupled = {name.rpartition(".")[0] for coupler in model._couplers.values() for name, _ in coupler.terms}
    result: tuple[Applied, Felt, dict[str, Any]] = (acting, felt(acting, topology.joints, number, coupled), {})
    model._loading = (tuple(parts), result)
    return result


def system(
    model: Model, scene: Scene, independent: Sequence[str] | None = None, origin: Model | None = None,
    checked: bool = True,
) -> System:
    """Return the minimal linear equations of motion of a mechanism in numbers.

    Parameters
    ----------
    model : Model
        The mechanism, for the names of its inputs and outputs.
    scene : Scene
        The same in numbers.
    independent : sequence of str, optional
        Joint coordinates that are to be among the minimal ones.
    origin : Model, optional
        The model as the user gave it, which stays as it is.
    checked : bool
        Whether a pose that is not in balance is refused.

    Returns
    -------
    System
        Matrices, names and the way back to the bodies.
    """
    relative = scene.relative()
    locked, coordinates, felt = scene.locked, scene.coordinates, len(scene.springs.owner)
    phi = scene.closure(relative)
    reduction = reduce(coordinates, scene.cuts, phi, independent, partial(arm, scene.topology, scene.position))
    planar = check_mobility(scene.topology, coordinates, scene.cuts, reduction, scene.position)
    kept = reduction.independent.tolist()
    names = tuple([coordinates.names[i] for i in kept])
    found = matrices(scene, relative, reduction, relative.acting(locked, locked + felt))
    separation = statics = None
    said = model if origin is None else origin
    parts: tuple[Part, ...] = (  # in the order in which the model lists its parameters
        *said._falling, *scene.bodies, *scene.topology.joints, *scene.elements, *scene.couplers,
        *model.rotors.values(), *said.loads.values(),
    )  # fmt: skip
    if scene.loads is not None:
        from mbsvib.equations.loaded import load

        statics = load(scene, relative, reduction, found, model.name, checked, phi)
    undetermined: tuple[Undetermined, ...] = () if statics is None else statics.undetermined
    if scene.port.wrench_outputs:
        from mbsvib.equations.joint_forces import joint_force_rows

        undetermined = joint_force_rows(model, scene, relative, reduction, found, statics)
    if model._rotors:
        from mbsvib.equations.spin_terms import with_spin

        found = with_spin(model, scene, found)
    if scene.inertia.whole:
        check_mass(found["M"], names)
    else:
        from mbsvib.elements.maxwell_rows import given
        from mbsvib.equations.massless_separation import separate

        parts = given(parts)
        found, stays, separation = separate(scene, reduction, found, names, model, independent)
        names, kept = tuple([names[i] for i in stays]), [kept[i] for i in stays]
    if model._pieces is not None:
        parts = model._pieces.said(parts)
    return System(
        name=model.name, coordinates=names,
        coordinate_units=tuple(["rad" if turn else "m" for turn in coordinates.turns[kept].tolist()]),
        inputs=tuple(model.inputs), input_units=scene.port.input_units, outputs=tuple(model.outputs),
        output_units=scene.port.output_units, bodies=scene.topology.bodies, **found,
        provenance=Provenance(
            scene.topology, reduction, coordinates.names, scene.owners, parts, separation, statics,
            ports=(*model.inputs.values(), *model.outputs.values()), origin=origin, planar=planar,
            undetermined=undetermined,
        ),
    )  # fmt: skip


def matrices(
    scene: Scene, relative: Triplets, reduction: Reduction, acting: NDArray[np.bool_] | None = None
) -> dict[str, Any]:
    """Return the matrices of a mechanism and their factors, by the names that a system has for them.

    Parameters
    ----------
    scene : Scene
        The mechanism in numbers.
    relative : Triplets
        Its relative displacements.
    reduction : Reduction
        Its minimal coordinates.
    acting : array, shape (elastic rows,), optional
        Elastic rows that are to be kept, less those that loops hold still; default: all, whether they move or not.

    Returns
    -------
    dict of str to array
        M, C, K, B, Cq, Cv, Ca, D, the factors of M, K and C, and the motion of the bodies.
    """
    springs, locked, felt = scene.springs, scene.locked, len(scene.springs.owner)
    motion = reduction.apply_to_bodies(body_motion(scene.coordinates, scene.position))
    factor = scene.inertia.factor(motion)
    # elastic rows, those of ports and, where more than two bodies share mass or springs, the base rows of these
    end = felt + len(scene.port.rows.first) if scene.shared is None else relative.shape[0] - locked
    keep = None
    if acting is not None:
        keep, felt = np.empty(end, dtype=bool), int(np.count_nonzero(acting))
        keep[: len(acting)], keep[len(acting) :] = acting, True
    every = reduction.apply_exactly(relative.dense(locked, locked + end, keep), felt)
    ports_end = felt + len(scene.port.rows.first)
    elastic, seen = every[..., :felt, :], every[..., felt:ports_end, :]
    if acting is not None:
        kept = acting.nonzero()[0]
        if reduction.matrix is not None:
            moves = np.asarray(elastic.any(axis=1)).nonzero()[0]
            kept, elastic = kept.take(moves), elastic.take(moves, axis=0)
        springs = springs.only(kept)
    rows, k, c, owner = elastic, springs.stiffness, springs.damping, springs.owner
    if scene.shared is not None:
        base = every[..., ports_end:, :]
        factor = scene.shared.inertia_rows(factor, base)
        rows, k, c, owner = scene.shared.elastic_rows(base, rows, k, c, owner)
    return {
        "M": gram(factor), "C": product(rows, c), "K": product(rows, k),
        **port_matrices(scene.port, seen, springs, elastic, scene.inertia, factor, scene.position, scene.shared),
        "inertia_factor": factor, "elastic_rows": rows, "stiffness": k, "damping": c, "row_owner": owner,
        "body_motion": motion,
    }  # fmt: skip


def cut_rows(topology: Topology, bodies: Sequence[Body], number: Mapping[str, int]) -> Cuts | None:
    """Return the locked rows of the cut joints, or None where nothing is cut."""
    if not topology.cut:
        return None
    tuples: list[tuple[float, ...]] = []
    names: list[str] = []
    owner: list[int] = []
    start: list[int] = []
    for count, k in enumerate(topology.cut):
        joint = topology.joints[k]
        a, b = number[joint.first], number[joint.second]
        point = joint.point or bodies[min(a, b)].position
        if joint.locked:
            start.append(len(names))
        for direction, six in joint.locked:
            tuples.append((a, b, *point, *six))
            names.append(f"{joint.name}.{direction}")
            owner.append(count)
    rows = Rows.stack(tuples)
    return Cuts(rows, tuple(names), np.array(owner, dtype=np.intp), topology.cut_joints,
                np.array(start, dtype=np.intp), np.asarray(rows.force.any(axis=0)))  # fmt: skip
