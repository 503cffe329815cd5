"""Assembly of a batch: constant arrays are computed once, those that vary in chunks of variants that fit a cache."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.common.arrays import Array, Bools, Index
from mbsvib.common.memory import MANY, keep_freed_memory
from mbsvib.elements.beam import Beam
from mbsvib.elements.families import EXPANSIONS
from mbsvib.elements.pose import Pose
from mbsvib.equations import assembly as single
from mbsvib.equations.batch_equations import FACTORS, BatchEquations, chunk_size, joined
from mbsvib.equations.batch_loops import LoopPivots, closure_along, reduce_batch
from mbsvib.equations.batch_one_by_one import Separating, linearized_variant, one_by_one, stacked
from mbsvib.equations.batch_prestress import Prestress, prestress
from mbsvib.equations.batch_values import Values, checked
from mbsvib.equations.draft import Draft, Variants
from mbsvib.equations.equations import Equations
from mbsvib.equations.expansion import expanded, with_damping_that_varies
from mbsvib.equations.geometry_plan import GeometryPlan, geometry_plan
from mbsvib.equations.inertia import check_masses, unit_inertia
from mbsvib.equations.loaded import spins_otherwise
from mbsvib.equations.matrices import MATRICES, OPTIONAL, Matrices, MinimalRows, Terms, matrices, minimal_rows
from mbsvib.equations.placing import fixed_points, joint_axes, moved_bodies
from mbsvib.equations.posed_scene import PosedForces, PosedScene, keeps_couplers, posed_scene
from mbsvib.equations.scene import Scene, with_maxwell_nodes
from mbsvib.equations.scene import scene as scene_of
from mbsvib.equations.wrenches import (
    applied_of_variants,
    has_antisymmetric_forces,
    keeps_forces,
    loaded_in_variants,
    preloaded,
)
from mbsvib.errors import SingularPoseError
from mbsvib.kinematics.relative_motion import Triplets
from mbsvib.mechanism.changes import Slots
from mbsvib.mechanism.drives import driven_coordinates, with_drives_in_tree
from mbsvib.mechanism.mechanism import Mechanism

B = TypeVar("B", bound=BatchEquations)


def linearize_batch(
    model: Mechanism, values: Mapping[str, ArrayLike], independent: Sequence[str] | None = None,
    cut: Sequence[str] | None = None, form: type[Equations] = Equations,
    batch: type[B] = BatchEquations,  # type: ignore[assignment]
) -> B:  # fmt: skip
    """Return the minimal linear equations of motion of many variants of a model.

    M_i q'' + C_i q' + K_i q = B_i u,  y = Cq_i q + Cv_i q' + Ca_i q'' + D_i u

    ``values`` (n,) or (): values of parameters, by name or by a pattern that picks several.
    """
    variants = checked(model.parameters, values)
    return batch_plan(model, variants.slots, independent, cut, form).equations(variants, batch)


@dataclass(frozen=True)
class BatchPlan:
    """What all variants of a model share: the arrays of the ``nominal`` mechanism and the pivots of its loops.

    ``user_model`` is the model as described, ``model`` the one with internal bodies and nodes, whose arrays are in
    ``scene``; ``cut`` names the joints at which its loops are to be cut, ``slots`` has the places of what varies.
    ``posed`` takes values and returns the variants by their numbers where these are in other poses; ``poses`` takes
    values and the number of the first variant and returns their poses, where nothing else moves; ``relaxed`` is that of
    ``moved``. ``prestress`` are the loaded beams, None without any that are stated for variants. ``decided`` lists how
    many variants got rank decisions of their own, of each call in which some did.
    """

    user_model: Mechanism
    model: Mechanism
    scene: Scene
    nominal: Equations
    cut: tuple[str, ...] | None
    slots: Slots
    posed: Callable[[Values], Callable[[int], Mechanism]] | None = None
    poses: Callable[[Values, int], Pose] | None = None
    relaxed: bool = True
    prestress: Prestress | None = None
    decided: list[int] = field(default_factory=list, compare=False, repr=False)

    @cached_property
    def geometry(self) -> GeometryPlan:
        """How the arrays of the mechanism follow from the numbers that vary."""
        return geometry_plan(self.model, self.scene, self.slots)

    @cached_property
    def pivots(self) -> LoopPivots:
        """The pivots of the nominal pose, in all its coordinates, also those that inputs drive."""
        reduction, driven = self.nominal.provenance.reduction, self.model.derived(driven_coordinates)
        if driven:
            reduction = self.scene.reduced(_displacements(self.scene)[1], [*driven, *self.names])
        return LoopPivots(self.scene, reduction)

    @cached_property
    def posed_scene(self) -> PosedScene | None:
        """How the arrays of the mechanism follow from poses, None where that is not stated."""
        if self.poses is None:
            return None
        varying = preloaded(self.model, self.slots.complete) if loaded_in_variants(self.model, self.slots.index) else ()
        return posed_scene(self.user_model, self.model, self.scene, self.relaxed, varying)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the minimal coordinates before motions without mass are separated."""
        names = self.scene.coordinates.names
        return tuple([names[k] for k in self.nominal.provenance.reduction.independent.tolist()])

    @cached_property
    def loaded(self) -> bool:
        """Whether a variant may have gravity, a load or a preload, even if the model has none."""
        return self.scene.loads is not None or loaded_in_variants(self.model, self.slots.index)

    @cached_property
    def with_forces(self) -> bool:
        """Whether a variant may have forces at its pose, also of springs that deform on the way there."""
        return self.loaded or (self.posed_scene is not None and self.posed_scene.forces is not None)

    @cached_property
    def constant_rows(self) -> tuple[Triplets, Array, MinimalRows] | None:
        """Relative displacements, Phi and minimal rows where no geometry varies; else None."""
        if not self.geometry.constant:
            return None
        scene = replace(self.scene, springs=self.geometry.springs)
        relative, phi = _displacements(scene)
        return relative, phi, minimal_rows(scene, relative, self.pivots.reduction)

    @cached_property
    def element_columns(self) -> Index:
        """The columns of the elements of loaded beams among the rows of connections."""
        assert self.prestress is not None
        return self.prestress.columns(self.scene, self.geometry.springs)

    @property
    def own_decisions(self) -> bool:
        """Whether forces at the pose and motions without mass of a variant are described when it is asked for."""
        return self.with_forces or self.nominal.provenance.separation is not None

    @cached_property
    def one_by_one(self) -> bool:
        """Whether elements or fields that vary make it necessary to compute one variant after the other."""
        scene = self.scene
        # coordinates that inputs drive, and relations that are curved, do not follow other places
        fixed = any(coupler.curvatures for coupler in scene.couplers) or bool(self.model.derived(driven_coordinates))
        fixed = fixed and (self.posed is not None or not self.geometry.constant)
        # tension of beams follows the loads
        begins = "gravity" in self.slots.index and not any(self.model.gravity or ())
        shared = self.stressed and (self.posed is not None or begins or (
            self.prestress is None and not keeps_forces(self.user_model, self.slots.index)))  # fmt: skip
        parts = self.slots.parameters.parts
        varies = any(not fields.keys() <= parts[name].batched_fields for name, fields in self.slots.index.items())
        # strain follows the section of a beam
        ports = (*self.user_model.inputs.values(), *self.user_model.outputs.values())
        strained = bool(self.geometry.elastic) and any(type(part) in EXPANSIONS for part in ports)
        return bool(shared or fixed or varies or strained or self._replacing_alone)

    @property
    def stressed(self) -> bool:
        """Whether a variant may have forces in beams or superelements at its pose."""
        return self.with_forces and self.scene.shared is not None and bool(self.scene.shared.base)

    @property
    def _replacing_alone(self) -> bool:
        """Whether what replaces a connection that varies has no rows for it, or forces or poses that follow it."""
        owners = {owner.name: owner for owner, _, _ in self.geometry.replacing}
        varied = set(self.slots.target.tolist())
        rows = {int(row) for name, owner in owners.items() if not isinstance(owner, Beam)
                for array in self.slots.index[name].values() for row in array.reshape(-1)}  # fmt: skip
        absent = not self.slots.nominal[list(rows & varied)].all()
        follows = self.with_forces and any(getattr(owner, "free_length", None) is not None for owner in owners.values())
        return bool(owners) and (absent or follows or self.posed is not None)

    def chunk_size(self, count: int) -> int:
        """Return the number of variants to compute at once, of ``count``."""
        elastic = all(fields.keys() <= {"stiffness", "damping"} for fields in self.slots.index.values())
        return count if self.scene.loads is None and elastic and self.posed is None else chunk_size(self.scene)

    def at_once(self, variants: Values) -> bool:
        """Return whether the equations of these variants can be computed at once."""
        spins = self.model.derived(has_antisymmetric_forces) and spins_otherwise(self.model, variants)
        stated = self.poses is not None and self.posed_scene is not None and keeps_couplers(self.model)
        posed = self.posed is not None and not stated
        return not (posed or self.one_by_one or spins or self.model.hubs)

    def single(self, variant: Values) -> Matrices:
        """Return the matrices of a single variant, without an axis of variants."""
        if not self.at_once(variant):
            terms: Any = self.equations(variant, BatchEquations)[0]
            return Matrices(**{item.name: getattr(terms, item.name) for item in fields(Matrices)})
        part = assembled_variants(self, variant.in_equations, 0)
        self._count(part.decided)
        arrays = part.separated()
        terms = arrays.pop("separated", [None])[0]
        if terms is None:
            del arrays["closure"]
            terms = Terms(**arrays).of_variants(0)
        return Matrices(**terms.named())

    def system(self, variant: Values, batch: type[B]) -> Equations:
        """Return the equations of a single variant, with all that is described for it."""
        if self.posed is None:
            return self.equations(variant, batch)[0]
        return linearized_variant(self.posed(variant), self.nominal, self.cut, 0)

    def _one_by_one(self, variants: Values, batch: type[B]) -> B:
        self._count(variants.count)
        variant = self._variant(variants) if self.posed is None else self.posed(variants)
        return one_by_one(variant, self.nominal, variants, self.cut, batch)

    def _variant(self, variants: Values) -> Callable[[int], Mechanism]:
        """The function that returns the variants by their numbers."""
        values = variants.by_name
        return lambda i: self.user_model.with_values({name: float(array[i]) for name, array in values.items()})

    def _count(self, decided: int) -> None:
        if decided:
            self.decided.append(decided)

    def equations(self, variants: Values, batch: type[B]) -> B:
        """Return the equations of some variants as a batch."""
        keep_freed_memory(MANY)
        nominal = self.nominal
        if not self.at_once(variants):
            self._count(variants.count)
            return self._one_by_one(variants, batch)
        size = self.chunk_size(variants.count)
        try:
            parts = [assembled_variants(self, variants.in_equations.slice(start, start + size), start)
                     for start in range(0, variants.count, size)]  # fmt: skip
        except SingularPoseError:
            if self.posed is None:
                raise
            return self._one_by_one(variants, batch)
        if self.posed is not None and any(part.decided for part in parts):
            return self._one_by_one(variants, batch)
        chunks = [part.separated() for part in parts]
        self._count(sum(part.decided for part in parts))
        common: dict[str, Any] = {"nominal": nominal, "values": variants, "massless": nominal.massless,
                                  "own_decisions": self.own_decisions,
                                  "variant": None if self.posed is None else self.posed(variants)}  # fmt: skip
        if "separated" in chunks[0]:
            arrays = stacked([terms for chunk in chunks for terms in chunk["separated"]], nominal.dof)
            return batch(closure=None, **common, **arrays)
        arrays = {key: joined([chunk[key] for chunk in chunks], key, variants.count, size) for key in (
            *MATRICES, *FACTORS, *OPTIONAL, "closure")}  # fmt: skip
        return batch(row_owner=chunks[0]["row_owner"], **common, **arrays)


def batch_plan(
    model: Mechanism, slots: Slots, independent: Sequence[str] | None = None, cut: Sequence[str] | None = None,
    form: type[Equations] = Equations, forces_alone: bool = False,
) -> BatchPlan:  # fmt: skip
    """Return what all variants of a model share, in the minimal coordinates of its pose.

    ``slots``: places of the parameters that vary. ``forces_alone``: nobody asks for the inertia, so that motions
    without mass stay.
    """
    user_model, model = model, expanded(model)
    with_nodes = with_maxwell_nodes(model)
    cut = with_drives_in_tree(model, cut)
    scene = scene_of(with_nodes, cut)
    if forces_alone:
        scene = replace(scene, inertia=unit_inertia(len(scene.bodies)))
    nominal = single.assembled(model, scene, independent, copy(user_model), form=form)
    if (damped := with_damping_that_varies(user_model, slots)) is not user_model:
        with_nodes = with_maxwell_nodes(expanded(damped))
        scene = replace(scene_of(with_nodes, cut), inertia=scene.inertia)
    if (stated := prestress(with_nodes, scene)) is not None:
        with_nodes, scene = stated[0].model, stated[1]
    return BatchPlan(user_model, with_nodes, scene, nominal, None if cut is None else tuple(cut), slots,
                     prestress=None if stated is None else stated[0])  # fmt: skip


def _displacements(scene: Scene) -> tuple[Triplets, Array]:
    """Relative displacements, and the locked rows Phi among them."""
    relative = scene.relative()
    return relative, scene.closure(relative)


@dataclass(frozen=True)
class AssembledVariants:
    """Some variants of a ``plan`` with all their motions; ``first`` is the index of the first of them.

    ``lost`` (variants,): steps without derivative. ``decided``: how many variants got a rank decision of their own.
    """

    plan: BatchPlan
    draft: Draft
    first: int
    lost: Bools
    decided: int

    @property
    def terms(self) -> Terms:
        """The terms; constant arrays have no axis of variants."""
        return self.draft.terms

    @property
    def residual(self) -> Array | None:
        """What is left of the forces along all coordinates, (variants, m), None without any."""
        return None if self.draft.statics is None else self.draft.statics.residual

    @property
    def separating(self) -> Separating:
        """The variants as their motions without mass are separated."""
        return Separating(self.draft, self.first, self.plan.nominal)

    def separated(self) -> dict[str, Any]:
        """Return the arrays of all variants, from which motions without mass are separated."""
        terms, reduction = self.terms, self.draft.reduction
        if self.plan.nominal.provenance.separation is not None:
            variants, count = self.separating, len(self.lost)
            if not variants.constant:
                return {"separated": [variants.separated(i) for i in range(count)]}
            terms = variants.with_constant_motions(count)
        return terms.named() | {"closure": None if reduction is self.plan.pivots.reduction else reduction.matrix}


def described_variants(plan: BatchPlan, values: Values) -> tuple[Scene, PosedForces | None]:
    """Return the arrays of variants in the described pose, and their forces in other poses, None without any."""
    scene, posed = plan.geometry.at(values), plan.posed_scene
    forces = None if posed is None else posed.forces
    if not plan.with_forces:
        return scene, forces
    also, made = () if forces is None else forces.applied.names, {}
    if plan.prestress is not None:
        also, made = plan.prestress.elements, plan.prestress.weights(values)
    applied = applied_of_variants(plan.model, values, moved_bodies(scene, values), also, made)
    return replace(scene, loads=(applied, {})), None if forces is None else forces.of_variants(applied, values)


def _scene_of_variants(plan: BatchPlan, values: Values, first: int) -> tuple[Scene, Variants]:
    """The arrays of variants, and what differs in them."""
    scene, forces = described_variants(plan, values)
    posed, topology = plan.posed_scene, scene.topology
    if posed is None or plan.poses is None:
        points = fixed_points(topology, values, None)
        return scene, Variants(first, *joint_axes(topology.joints, values), values.fields, points)
    pose = posed.whole(plan.poses(values, first))
    fields = dict(values.fields)
    for name, rotor in plan.model.rotors.items():
        axis = pose.vectors(np.array([topology.body_numbers[rotor.body]]), np.array([rotor.axis]))
        fields[name] = {**fields.get(name, {}), "axis": axis[..., 0, :].T}
    turned = plan.with_forces or plan.pivots.redundant or scene.port.wrench_outputs
    axes = posed.joint_axes(pose) if turned else {}
    variants = Variants(first, axes, {}, fields, fixed_points(topology, values, pose))
    alone = values.count == 1 and not plan.with_forces
    return posed.at(scene, pose[0] if alone else pose, plan.relaxed, forces=forces), variants


def assembled_variants(plan: BatchPlan, values: Values, first: int, closure: Array | None = None) -> AssembledVariants:
    """Return the terms of some variants, with all their motions.

    Complex values are steps from variants whose decisions are known; ``closure`` (variants, n, m) is B'' of these, None
    if it is the nominal one.
    """
    pivots, nominal = plan.pivots, plan.nominal
    scene, variants = _scene_of_variants(plan, values, first)
    reduction, stepped = pivots.reduction, values.stepped
    lost, decided = np.zeros(values.count, dtype=bool), 0
    constant = plan.constant_rows if plan.posed is None else None
    relative, phi, rows = constant or (*_displacements(scene), None)
    if phi.ndim == 2 and plan.posed is not None:
        phi = phi[None]
    if phi.ndim == 3 and stepped:
        reduction, lost = closure_along(scene, values, phi, pivots, closure)
    elif phi.ndim == 3:
        reduction, decided = reduce_batch(scene, values, phi, pivots, variants)
    if rows is None:
        rows = minimal_rows(scene, relative, reduction)
    if plan.prestress is not None:
        scene, begins = plan.prestress.loaded(scene, relative, rows, plan.element_columns, values)
        lost |= begins
    terms = matrices(scene, rows, closed=reduction.matrix is not None)
    draft = Draft(plan.model, scene, relative, phi, reduction, tuple(reduction.independent.tolist()), terms,
                  nominal.coordinates, not stepped, pivots.kept, variants=variants)  # fmt: skip
    for step in single.STEPS[:-1]:
        draft = step(draft)
    if nominal.provenance.separation is None and not stepped:
        check_masses(draft.terms.M, nominal.coordinates, first)
    return AssembledVariants(plan, draft, first, lost, decided)
