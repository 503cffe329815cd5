"""From a model to its linear equations of motion: dense, sparse, or of many variants at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Literal, overload

from numpy.typing import ArrayLike

from mbsvib.api.system import System
from mbsvib.common.expected import a_model
from mbsvib.equations.alignment import aligned
from mbsvib.equations.assembly import is_small
from mbsvib.equations.assembly import linearized as dense_equations
from mbsvib.equations.self_stress import warn
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.responses.driven import differ, drives

if TYPE_CHECKING:
    from mbsvib.api.batch import Batch
    from mbsvib.api.driven import DrivenBatch, DrivenSystem
    from mbsvib.api.rolling_system import RollingSystem
    from mbsvib.api.sparse_system import SparseSystem


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
    independent, cut, values, method, align : optional
        As of ``Model.linearize``.

    Returns
    -------
    System, Batch or SparseSystem
        Matrices, names and the way back to the bodies, as of ``Model.linearize``. A ``DrivenSystem`` or ``DrivenBatch``
        where inputs are motions.

    Raises
    ------
    ModelError, SingularPoseError
        As of ``Model.linearize``.
    EquilibriumError
        If the loads do not balance in this pose.

    Warns
    -----
    UndeterminedForceWarning, LargeDisplacementWarning
        If an output is a force in joints that redundant constraints leave open; if beams or superelements are bent, as
        described, further than small displacements hold.

    Source: Jiang, Chen & Luo (2011), sections 2 and 3.
    """
    model = a_model(model, "linearize")
    if align is not None:
        model = aligned(model, align)
    if model.rolling:
        from mbsvib.api.rolling_system import rolling_system

        return rolling_system(model, independent, cut, values, method)  # type: ignore[no-any-return]
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
        return _with_motions(model, batch, batch=True)
    if method is None and is_small(model):
        system = dense_equations(model, independent, cut, System)
        warn(model.name, system.provenance.undetermined)
        return _with_motions(model, system)
    from mbsvib.api.sparse_system import SparseSystem
    from mbsvib.sparse.choice import linearized

    large = linearized(model, independent, cut, method, System, SparseSystem)
    warn(model.name, large.undetermined if isinstance(large, SparseSystem) else large.provenance.undetermined)
    return _with_motions(model, large)


def _with_motions(
    model: Mechanism, equations: System | Batch | SparseSystem, batch: bool = False
) -> System | Batch | SparseSystem | DrivenSystem | DrivenBatch:
    """The equations, or those with motions as inputs where the model has such inputs."""
    known = drives(model)
    if not differ(known):
        return equations
    from mbsvib.api.driven import DrivenBatch, DrivenSystem

    return DrivenBatch(equations, known) if batch else DrivenSystem(equations, known)
