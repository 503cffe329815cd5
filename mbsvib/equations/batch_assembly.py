"""Assembly of a batch: constant arrays are computed once, those that vary in chunks of variants that fit a cache."""

from __future__ import annotations

from copy import copy
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from mbsvib.common.memory import MANY, keep_freed_memory
from mbsvib.equations import assembly as single
from mbsvib.equations.batch_equations import FACTORS, BatchEquations
from mbsvib.equations.batch_geometry import scene_of_variants
from mbsvib.equations.batch_loops import LoopPivots, loop_pivots, reduce_batch
from mbsvib.equations.batch_one_by_one import one_by_one
from mbsvib.equations.batch_values import Values, checked
from mbsvib.equations.equations import Equations
from mbsvib.equations.expansion import expanded
from mbsvib.equations.inertia import check_mass
from mbsvib.equations.matrices import matrices
from mbsvib.equations.maxwell_nodes import with_maxwell_nodes
from mbsvib.equations.scene import scene as scene_of
from mbsvib.equations.terms import MATRICES
from mbsvib.equations.wrenches import has_antisymmetric_forces
from mbsvib.errors import ModelError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike

    from mbsvib.common.arrays import Array
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
    expanded_model = expanded(model)
    is_expanded = expanded_model is not model
    scene = scene_of(with_maxwell_nodes(expanded_model), cut)
    nominal = single.assembled(expanded_model, scene, independent, copy(model) if is_expanded else None, form=form)
    if is_expanded or _adds_by_variant(model, scene, nominal) or _varies_otherwise(scene, variants):
        return one_by_one(model, nominal, variants, cut, batch)
    pivots = loop_pivots(scene, nominal.provenance.reduction)
    size = _chunk_size(scene, variants)
    chunks = [
        _matrices(model, scene, variants.slice(start, start + size), pivots, start, nominal.coordinates)
        for start in range(0, variants.count, size)
    ]
    arrays: dict[str, Any] = {"row_owner": chunks[0]["row_owner"]}
    for key in (*MATRICES, *FACTORS):
        array = chunks[0][key]
        if len(chunks) > 1 and array.ndim == _axes_without_variants(key) + 1:
            array = np.concatenate([chunk[key] for chunk in chunks])
        arrays[key] = np.broadcast_to(array, (variants.count, *array.shape[array.ndim - _axes_without_variants(key) :]))
    closure = None
    if chunks[0]["closure"] is not None:
        closure = np.concatenate([chunk["closure"] for chunk in chunks])
    return batch(nominal=nominal, values=variants, closure=closure, **arrays)


def _adds_by_variant(model: Mechanism, scene: Scene, nominal: Equations) -> bool:
    """Return whether a mechanism has loads, antisymmetric forces, inerters or motions without mass, by variant."""
    return bool(scene.loads is not None or scene.port.wrench_outputs or model.derived(has_antisymmetric_forces)
                or scene.springs.inertance is not None or nominal.provenance.separation is not None)  # fmt: skip


def _varies_otherwise(scene: Scene, values: Values) -> bool:
    """Return whether couplers or their joints vary, or fields of parts that many variants cannot have at once."""
    cut = {scene.topology.joints[k].name for k in scene.topology.cut}
    of_couplers = {part.name for part in scene.couplers} | cut & {
        name.rpartition(".")[0] for part in scene.couplers for name, _ in part.terms}  # fmt: skip
    return any(name in of_couplers or not fields.keys() <= values.parameters.parts[name].batched_fields
               for name, fields in values.fields.items())  # fmt: skip


def _axes_without_variants(key: str) -> int:
    """Number of axes of an array of a single system."""
    return {"row_stiffness": 1, "row_damping": 1, "body_motion": 3}.get(key, 2)


def _chunk_size(scene: Scene, values: Values) -> int:
    """Number of variants to compute at once."""
    if all(fields.keys() <= {"stiffness", "damping"} for fields in values.fields.values()):
        return values.count
    return max(16, CHUNK // max(1, scene.coordinates.path.size * 6))


def _matrices(
    model: Mechanism, scene: Scene, values: Values, pivots: LoopPivots, first: int, names: tuple[str, ...]
) -> dict[str, Any]:
    """The matrices of some variants; constant ones have no axis of variants."""
    scene = scene_of_variants(model, scene, values)
    relative = scene.relative()
    reduction = pivots.reduction
    phi = scene.closure(relative)
    if phi.ndim == 3:
        reduction = reduce_batch(scene, values, phi, pivots, first)
    terms = matrices(scene, relative, reduction)
    _check_masses(terms.M, names, first)
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

