"""Assembly of a batch: what does not vary is computed once, what varies in one pass over pieces that fit a cache."""

from __future__ import annotations

from copy import copy
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from mbsvib.common.memory import MANY, keep_freed_memory
from mbsvib.elements import Body, Bushing, Joint
from mbsvib.equations import assembly as single
from mbsvib.equations.batch_equations import FACTORS, BatchEquations
from mbsvib.equations.batch_geometry import moves_geometry, varied
from mbsvib.equations.batch_loops import Pivots, pivots, reduce_batch
from mbsvib.equations.batch_one_by_one import one_by_one
from mbsvib.equations.batch_values import checked
from mbsvib.equations.equations import Equations
from mbsvib.equations.expansion import expanded
from mbsvib.equations.inertia import check_mass
from mbsvib.equations.matrices import matrices
from mbsvib.equations.maxwell_nodes import with_maxwell_nodes
from mbsvib.equations.scene import scene as scene_of
from mbsvib.equations.terms import MATRICES
from mbsvib.errors import ModelError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike

    from mbsvib.common.arrays import Array
    from mbsvib.equations.batch_values import Values
    from mbsvib.equations.scene import Scene
    from mbsvib.mechanism.mechanism import Mechanism


B = TypeVar("B", bound=BatchEquations)

# Pieces of a batch whose largest array has this many numbers stay in a cache, and take more time than calls do.
PIECE = 2**19
# Pivots of a scaled mass matrix below this are looked at by the check of single systems, whose limit is lower.
SUSPECT_MASS = 1e-12


def linearize_batch(
    model: Mechanism, values: Mapping[str, ArrayLike], independent: Sequence[str] | None = None,
    cut: Sequence[str] | None = None, form: type[Equations] = Equations,
    batch: type[B] = BatchEquations,  # type: ignore[assignment]
) -> B:  # fmt: skip
    """Return the minimal linear equations of motion of many variants of a model.

    M_i q'' + C_i q' + K_i q = B_i u,  y = Cq_i q + Cv_i q' + Ca_i q'' + D_i u

    Parameters
    ----------
    model : Mechanism
        The mechanism.
    values : mapping of str to array-like, shape (n,) or ()
        Values of parameters, by name or by a pattern that picks several.
    independent, cut : sequence of str, optional
        As for a single linearization.
    form, batch : type
        The classes of single equations, and of all.

    Returns
    -------
    BatchEquations
        All variants, in the minimal coordinates of the pose as given.

    Raises
    ------
    ModelError
        If a parameter is unknown or a value refused, by parameter and index of the variant.
    SingularPoseError
        If a variant has another number of degrees of freedom, by index.
    """
    keep_freed_memory(MANY)
    variants = checked(model.parameters, values)
    plain = expanded(model)
    scene = scene_of(with_maxwell_nodes(plain), cut)
    nominal = single.assembled(plain, scene, independent, None if plain is model else copy(model), form=form)
    if plain is not model or _adds_by_variant(model, scene, nominal) or _varies_otherwise(scene, variants):
        return one_by_one(model, nominal, variants, cut, batch)
    chosen = pivots(scene, nominal.provenance.reduction)
    size = _piece(scene, variants)
    pieces = [
        _matrices(model, scene, variants.slice(start, start + size), chosen, start, nominal.coordinates)
        for start in range(0, variants.count, size)
    ]
    arrays: dict[str, Any] = {"row_owner": pieces[0]["row_owner"]}
    for key in (*MATRICES, *FACTORS):
        array = pieces[0][key]
        if len(pieces) > 1 and array.ndim == _depth(key) + 1:
            array = np.concatenate([piece[key] for piece in pieces])
        arrays[key] = np.broadcast_to(array, (variants.count, *array.shape[array.ndim - _depth(key) :]))
    closure = None
    if pieces[0]["closure"] is not None:
        closure = np.concatenate([piece["closure"] for piece in pieces])
    return batch(nominal=nominal, values=variants, closure=closure, **arrays)


def _adds_by_variant(model: Mechanism, scene: Scene, nominal: Equations) -> bool:
    """Tell whether a mechanism has what is computed variant by variant: loads, spin, inerters, motions without mass."""
    return bool(scene.loads is not None or scene.port.wrench_outputs or model.rotors
                or scene.springs.inertance is not None or nominal.provenance.separation is not None)  # fmt: skip


def _varies_otherwise(scene: Scene, values: Values) -> bool:
    """Tell whether couplers or what they measure, lines of distance joints, or 6x6 matrices vary."""
    cut = {scene.topology.joints[k].name for k in scene.topology.cut}
    coupled = {part.name for part in scene.couplers} | cut & {
        name.rpartition(".")[0] for part in scene.couplers for name, _ in part.terms}  # fmt: skip
    for name, fields in values.fields.items():
        part = values.parameters.parts[name]
        if name in coupled or (isinstance(part, Joint) and part.kind == "distance"):
            return True
        if isinstance(part, Bushing) and any(
            field in fields and isinstance(value[0], tuple)
            for value in (part.stiffness, part.damping) for field in ("stiffness", "damping")
        ):
            return True
    return False


def _depth(key: str) -> int:
    """Number of axes of an array of a single system."""
    return {"row_stiffness": 1, "row_damping": 1, "body_motion": 3}.get(key, 2)


def _piece(scene: Scene, values: Values) -> int:
    """How many variants to compute at once."""
    if not moves_geometry(values) and not values.varies((Body,)):
        return values.count
    return max(16, PIECE // max(1, scene.coordinates.path.size * 6))


def _matrices(
    model: Mechanism, scene: Scene, values: Values, chosen: Pivots, first: int, names: tuple[str, ...]
) -> dict[str, Any]:
    """The matrices of some variants; those that do not vary without an axis of variants."""
    scene = varied(model, scene, values)
    relative = scene.relative()
    reduction = chosen.reduction
    phi = scene.closure(relative)
    if phi.ndim == 3:
        reduction = reduce_batch(scene, values, phi, chosen, first)
    terms = matrices(scene, relative, reduction)
    _check_masses(terms.M, names, first)
    return terms.named() | {"closure": None if reduction is chosen.reduction else reduction.matrix}


def _check_masses(mass: Array, names: tuple[str, ...], first: int) -> None:
    """Refuse variants in which the motion of a coordinate moves no mass, by index."""
    if mass.ndim == 2 or not names:
        return
    diagonal = np.einsum("vii->vi", mass)
    try:
        pivots = np.einsum("vii->vi", np.linalg.cholesky(mass)) ** 2  # those of a unit diagonal, times the diagonal
        suspects = np.flatnonzero((pivots < SUSPECT_MASS * diagonal).any(axis=1))
    except np.linalg.LinAlgError:
        suspects = np.arange(len(mass))
    for i in suspects.tolist():
        try:
            check_mass(mass[i], names)
        except ModelError as error:
            raise ModelError(f"variant {first + i}: {error} All variants of a batch have the same motions without "
                             f"mass, and the model as given has none.", element=error.element) from error  # fmt: skip

