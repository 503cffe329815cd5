"""From a model to its linear equations of motion: dense, sparse, or of many variants at once."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, TypeVar, overload

from mbsvib.api.system import System
from mbsvib.common.expected import a_model
from mbsvib.equations.assembly import is_small
from mbsvib.equations.assembly import linearized as dense_equations
from mbsvib.equations.self_stress import warn
from mbsvib.responses.driven import differ, drives

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import ArrayLike

    from mbsvib.api.batch import Batch
    from mbsvib.api.driven import DrivenSystem
    from mbsvib.api.driven_batch import DrivenBatch
    from mbsvib.api.rolling_system import RollingSystem
    from mbsvib.api.sparse_system import SparseSystem
    from mbsvib.mechanism.mechanism import Mechanism
    from mbsvib.responses.driven import Drive


E = TypeVar("E")
D = TypeVar("D")


@overload
def linearize(
    model: Mechanism, independent: Sequence[str] | None = ..., cut: Sequence[str] | None = ..., values: None = ...,
    method: Literal["dense"] | None = ..., align: float | None = ...,
) -> System: ...  # fmt: skip


@overload
def linearize(
    model: Mechanism, independent: Sequence[str] | None = ..., cut: Sequence[str] | None = ..., values: None = ..., *,
    method: Literal["sparse"], align: float | None = ...,
) -> SparseSystem: ...  # fmt: skip


@overload
def linearize(
    model: Mechanism, independent: Sequence[str] | None = ..., cut: Sequence[str] | None = ..., *,
    values: Mapping[str, ArrayLike], method: Literal["dense"] | None = ..., align: float | None = ...,
) -> Batch: ...  # fmt: skip


def linearize(
    model: Mechanism, independent: Sequence[str] | None = None, cut: Sequence[str] | None = None,
    values: Mapping[str, ArrayLike] | None = None, method: str | None = None, align: float | None = None,
) -> System | Batch | SparseSystem | DrivenSystem | DrivenBatch | RollingSystem:  # fmt: skip
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
    align : float, optional
        Tolerance [rad, share of the size of loops] within which axes are taken as meant to be aligned, as of
        ``Model.aligned``; default: axes are as given.

    Returns
    -------
    System, Batch or SparseSystem
        Matrices, names and the way back to the bodies; of all variants where ``values`` is given; sparse, under the
        same names, where there are many bodies. A ``DrivenSystem`` or ``DrivenBatch`` where inputs are motions. Of a
        model on rolling wheels, a ``RollingSystem`` of first-order equations.

    Raises
    ------
    ModelError
        If a name is unknown, a cut leaves bodies hanging, a coordinate cannot be independent or has no inertia, or
        a variant has a value that is refused.
    SingularPoseError
        If the number of degrees of freedom is not defined in this pose, or is another one in a variant.
    EquilibriumError
        If the loads do not balance in this pose.

    Warns
    -----
    UndeterminedForceWarning
        If an output is a force in joints that redundant constraints leave open.
    LargeDisplacementWarning
        If beams or superelements are bent, as described, further than small displacements hold.

    Source: Jiang, Chen & Luo (2011), sections 2 and 3.
    """
    model = a_model(model, "linearize")
    if align is not None:
        from mbsvib.equations.alignment import aligned

        model = aligned(model, align)
    if model.rolling:
        from mbsvib.api.rolling_system import rolling_system

        rolling: RollingSystem = rolling_system(model, independent, cut, values, method)
        return rolling
    if model.composed:
        from mbsvib.equilibrium.search import check_displacements

        check_displacements(model)
    if values is not None:
        from mbsvib.api.batch import Batch
        from mbsvib.equations.batch_assembly import linearize_batch

        if method is not None:
            from mbsvib.sparse.choice import wants_sparse

            wants_sparse(model, method, independent, cut, values)  # refuses the sparse method
        batch = linearize_batch(model, values, independent, cut, System, Batch)
        warn(model.name, batch.nominal.provenance.undetermined)
        return _with_motions(model, batch, _driven_batch)
    if method is None and is_small(model):
        system = dense_equations(model, independent, cut, System)
        warn(model.name, system.provenance.undetermined)
        return _with_motions(model, system, _driven)
    from mbsvib.api.sparse_system import SparseSystem
    from mbsvib.sparse.choice import linearized

    large = linearized(model, independent, cut, method, System, SparseSystem)
    warn(model.name, large.undetermined if isinstance(large, SparseSystem) else large.provenance.undetermined)
    return _with_motions(model, large, _driven)


def _with_motions(model: Mechanism, equations: E, form: Callable[[E, tuple[Drive, ...]], D]) -> E | D:
    """The equations, or those with motions as inputs where the model has such inputs."""
    known = drives(model)
    return form(equations, known) if differ(known) else equations


def _driven(equations: System | SparseSystem, known: tuple[Drive, ...]) -> DrivenSystem:
    from mbsvib.api.driven import DrivenSystem

    return DrivenSystem(equations, known)


def _driven_batch(equations: Batch, known: tuple[Drive, ...]) -> DrivenBatch:
    from mbsvib.api.driven_batch import DrivenBatch

    return DrivenBatch(equations, known)
