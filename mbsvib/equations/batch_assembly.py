"""Assembly of a batch: constant arrays are computed once, those that vary in chunks of variants that fit a cache."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from mbsvib.common.memory import MANY, keep_freed_memory
from mbsvib.equations import assembly as single
from mbsvib.equations.batch_equations import FACTORS, BatchEquations
from mbsvib.equations.batch_geometry import joint_axes, moved_bodies, scene_of_variants
from mbsvib.equations.batch_loads import applied_of_variants, loaded_in_variants, with_loads_of_variants
from mbsvib.equations.batch_loops import LoopPivots, loop_pivots, reduce_batch
from mbsvib.equations.batch_massless import Separating
from mbsvib.equations.batch_one_by_one import one_by_one, stacked
from mbsvib.equations.batch_spin import spin_of_variants, spins_otherwise
from mbsvib.equations.batch_values import Values, checked
from mbsvib.equations.equations import Equations
from mbsvib.equations.expansion import expanded
from mbsvib.equations.inertia import check_mass
from mbsvib.equations.joint_forces import with_forces_in_joints
from mbsvib.equations.matrices import matrices
from mbsvib.equations.maxwell_nodes import with_maxwell_nodes
from mbsvib.equations.scene import scene as scene_of
from mbsvib.equations.spin_terms import with_antisymmetric_terms
from mbsvib.equations.terms import AXES, MATRICES, OPTIONAL
from mbsvib.equations.wrenches import has_antisymmetric_forces
from mbsvib.errors import ModelError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike

    from mbsvib.common.arrays import Array
    from mbsvib.equations.load_stiffness import LoadedPairs
    from mbsvib.equations.scene import Scene
    from mbsvib.mechanism.mechanism import Mechanism


B = TypeVar("B", bound=BatchEquations)

# Chunks whose largest array has this many numbers fit a cache, and are large enough that calls cost little.
CHUNK = 2**19
# Variants with smaller pivots of the scaled mass matrix are checked as single systems, with a lower limit.
SUSPECT_MASS = 1e-12


def linearize_batch(
    model: Mechanism, values: Mapping[str, ArrayLike], independent: Sequence[str] | None = None,
    cut: Sequence[str] | None = None, form: type[Equations] = Equations,
    batch: type[B] = BatchEquations,  # type: ignore[assignment]
) -> B:  # fmt: skip
    """Return the minimal linear equations of motion of many variants of a model.

    M_i q'' + C_i q' + K_i q = B_i u,  y = Cq_i q + Cv_i q' + Ca_i q'' + D_i u

    ``values`` (n,) or (): values of parameters, by name or by a pattern that picks several.
    """
    keep_freed_memory(MANY)
    variants = checked(model.parameters, values)
    user_model, model = model, expanded(model)
    with_nodes = with_maxwell_nodes(model)
    scene = scene_of(with_nodes, cut)
    nominal = single.assembled(model, scene, independent, copy(user_model), form=form)
    if _adds_by_variant(with_nodes, scene, variants, nominal) or _varies_otherwise(variants):
        return one_by_one(user_model, nominal, variants, cut, batch)
    pivots = loop_pivots(scene, nominal.provenance.reduction)
    size = _chunk_size(scene, variants)
    chunks = [
        _matrices(with_nodes, scene, variants.in_equations.slice(start, start + size), pivots, start, nominal)
        for start in range(0, variants.count, size)
    ]
    own_decisions = bool(scene.loads is not None or loaded_in_variants(model, variants)
                         or nominal.provenance.separation is not None)  # fmt: skip
    if "separated" in chunks[0]:
        arrays = stacked([terms for chunk in chunks for terms in chunk["separated"]], nominal.dof)
        return batch(nominal=nominal, values=variants, closure=None, massless=nominal.massless,
                     own_decisions=own_decisions, **arrays)  # fmt: skip
    arrays = {key: _joined([chunk[key] for chunk in chunks], key, variants.count, size) for key in (
        *MATRICES, *FACTORS, *OPTIONAL, "closure")}  # fmt: skip
    return batch(nominal=nominal, values=variants, row_owner=chunks[0]["row_owner"], massless=nominal.massless,
                 own_decisions=own_decisions, **arrays)  # fmt: skip


def _joined(parts: list[Any], key: str, count: int, size: int) -> Any:
    """An array of all variants, from those of chunks; those that are constant have no axis of variants there."""
    present = [part for part in parts if part is not None]
    if not present:
        return None
    axes = AXES.get(key, 2)
    array = next((part for part in present if part.ndim > axes), present[0])
    if len(parts) > 1 and array.ndim > axes:
        none = np.zeros((size, *array.shape[1:]))
        array = np.concatenate([none[: count - size * k] if part is None else part for k, part in enumerate(parts)])
    return np.broadcast_to(array, (count, *array.shape[array.ndim - axes :]))


def _adds_by_variant(model: Mechanism, scene: Scene, values: Values, nominal: Equations) -> bool:
    """Return whether a mechanism has elements whose forces are computed for one variant after the other."""
    curved = any(coupler.curvatures for coupler in scene.couplers)
    shared = scene.shared is not None and bool(scene.shared.base)
    spin = model.derived(has_antisymmetric_forces) and spins_otherwise(model, values)
    redundant = any(group.surplus for group in nominal.provenance.reduction.groups)
    forces = redundant and any(kind == "joint" for _, kind, _, _ in scene.port.wrench_outputs)
    return bool(shared or forces or spin or curved)


def _varies_otherwise(values: Values) -> bool:
    """Return whether fields vary that many variants cannot have at once."""
    return any(not fields.keys() <= values.parameters.parts[name].batched_fields
               for name, fields in values.fields.items())  # fmt: skip


def _chunk_size(scene: Scene, values: Values) -> int:
    """Number of variants to compute at once."""
    if scene.loads is None and all(fields.keys() <= {"stiffness", "damping"} for fields in values.fields.values()):
        return values.count
    rows, n = scene.coordinates.path.shape
    if scene.loads is not None:
        rows += len(scene.loads[0].names) + n
    return int(max(16, CHUNK // max(1, rows * n * 6)))


def _matrices(
    model: Mechanism, scene: Scene, values: Values, pivots: LoopPivots, first: int, nominal: Equations
) -> dict[str, Any]:
    """The matrices of some variants; constant ones have no axis of variants."""
    scene = scene_of_variants(model, scene, values)
    if scene.loads is not None or loaded_in_variants(model, values):
        applied = applied_of_variants(model, values, moved_bodies(scene, values))
        scene = replace(scene, loads=(applied, {}))
    relative = scene.relative()
    reduction = pivots.reduction
    phi = scene.closure(relative)
    if phi.ndim == 3:
        reduction = reduce_batch(scene, values, phi, pivots, first)
    terms = matrices(scene, relative, reduction)
    massless = nominal.provenance.separation is not None
    if not massless:
        _check_masses(terms.M, nominal.coordinates, first)
    loaded: tuple[LoadedPairs, Array] | None = None
    if scene.loads is not None:
        terms, pairs, multipliers = with_loads_of_variants(
            model, scene, values, terms, reduction, phi, pivots, first)  # fmt: skip
        loaded = pairs, multipliers
    spin = spin_of_variants(model, scene, values) if model.derived(has_antisymmetric_forces) else ([], [])
    if scene.port.wrench_outputs:
        axes, _ = joint_axes(scene.topology.joints, values)
        terms = with_forces_in_joints(model, scene, (relative, phi, reduction, pivots.kept), terms, loaded, spin, axes)
    if any(spin):
        terms = with_antisymmetric_terms(scene, reduction, terms, *spin)
    if massless:
        variants = Separating(model, scene, reduction, terms, first, nominal)
        if not variants.constant:
            return {"separated": [variants.separated(i) for i in range(values.count)]}
        terms = variants.with_constant_motions(values.count)
    return terms.named() | {"closure": None if reduction is pivots.reduction else reduction.matrix}


def _check_masses(mass: Array, names: tuple[str, ...], first: int) -> None:
    """Refuse variants in which the motion of a coordinate moves no mass, by index."""
    if mass.ndim == 2 or not names:
        return
    diagonal = np.einsum("vii->vi", mass)
    try:
        pivots = np.einsum("vii->vi", np.linalg.cholesky(mass)) ** 2  # times the diagonal
        suspects = np.flatnonzero((pivots < SUSPECT_MASS * diagonal).any(axis=1))
    except np.linalg.LinAlgError:
        suspects = np.arange(len(mass))
    for i in suspects.tolist():
        try:
            check_mass(mass[i], names)
        except ModelError as error:
            raise ModelError(f"variant {first + i}: {error} All variants of a batch have the same motions without "
                             f"mass, and the nominal model has none.", element=error.element) from error  # fmt: skip

