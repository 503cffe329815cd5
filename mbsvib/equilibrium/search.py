"""The pose of equilibrium of a model, and whether a pose is one."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from typing import TypeVar

from mbsvib.common.arrays import Array
from mbsvib.common.expected import names
from mbsvib.elements.coupler import refuse_curved
from mbsvib.elements.pose import Pose
from mbsvib.equations.equations import Equations
from mbsvib.equilibrium.articulation import articulated, warn_beyond
from mbsvib.equilibrium.balance import Balance, balance, unbalanced_force
from mbsvib.equilibrium.motion import PosedModel, posed_model
from mbsvib.equilibrium.moved_parts import check_couplers, model_in_pose, refuse_unstated, static_model
from mbsvib.equilibrium.path import BALANCED, SearchResult, descend, follow, is_stable, stiffness, with_share
from mbsvib.equilibrium.preloads import RESIDUAL, without_rounding
from mbsvib.equilibrium.report import Equilibrium, displacements
from mbsvib.errors import EquilibriumError, ModelError
from mbsvib.linalg.rank import BALANCE
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.sparse.choice import linearized
from mbsvib.sparse.equations import SparseEquations

M = TypeVar("M", bound=Mechanism)
E = TypeVar("E", bound=Equations)
S = TypeVar("S", bound=SparseEquations)


def equilibrium(model: M, snap: bool = False, cut: Sequence[str] = ()) -> Equilibrium[M]:
    """Return the model in equilibrium; see ``Model.equilibrium``."""
    cut = tuple(names(cut, "equilibrium", "cut", ModelError))
    for name in model.hubs if model.composed else ():
        raise ModelError(f"hub '{name}': no equilibrium is looked for with beams on it; describe them as they stand, "
                         f"linearize() takes their forces from statics.", element=name, field="hub")  # fmt: skip
    first = posed_model(static_model(articulated(model)), cut=cut)
    before = balance(first)
    if before.share <= BALANCED:
        model_there = balanced_model(model, first.pose, before)
        return Equilibrium(model_there, 0, (before.share,), (), _displacements(model, first.pose))
    refuse_curved(model.couplers.values(), "so that no equilibrium elsewhere is looked for. Describe the model in "
                  "balance, or hold this pose by preloads: equilibrium(preload=...).")
    refuse_unstated(model.springs.values())
    result = descend(first, before) if snap or not _is_held(first) else follow(first, before)
    if result.stopped:
        raise _unreachable(result)
    model_there = balanced_model(model, result.at.pose, result.balance)
    warn_beyond(model_there)
    displaced = _displacements(model, result.at.pose)
    return Equilibrium(model_there, result.steps, result.residuals, result.shares, displaced)


def _displacements(model: Mechanism, pose: Pose) -> dict[str, Array]:
    """Displacements of bodies and nodes from the reference pose, without those of internal coordinates."""
    carriers = {name for part in model.composed.values() for name in part.carriers}
    return {name: six for name, six in displacements(pose).items() if name not in carriers}


def balanced_model(model: M, pose: Pose, forces: Balance) -> M:
    """The model in a pose of equilibrium, ``forces`` being those there."""
    model_there = model_in_pose(model, pose)
    if not model.composed and forces.strict_share > RESIDUAL:
        model_there = without_rounding(model_there)
    check_couplers(model, model_there)
    return model_there


def _is_held(first: PosedModel) -> bool:
    """Tell whether springs hold the mechanism in its pose when neither gravity nor loads act."""
    unloaded = balance(first.under(with_share(first.reference, 0.0)))
    return unloaded.share <= BALANCED and is_stable(stiffness(unloaded)[0])


def _unreachable(result: SearchResult) -> EquilibriumError:
    """The error of a search without equilibrium: its last pose and the unbalanced force there."""
    text, details = unbalanced_force(result.at, result.balance)
    return EquilibriumError(
        f"model '{result.at.reference.name}' has no equilibrium that can be reached from the given pose: "
        f"{result.stopped}. After {result.steps} steps {text}. Hold it with a spring or a load, lower the load, or "
        f"start from a pose nearer to the equilibrium.", **details,
    )  # fmt: skip


def at_equilibrium(
    model: M, independent: Sequence[str] | None = None, cut: Sequence[str] | None = None, method: str | None = None,
    dense: type[E] = Equations, sparse: type[S] = SparseEquations,  # type: ignore[assignment]
) -> tuple[M, E | S]:  # fmt: skip
    """Return a model in equilibrium with its equations: the model as it is if it balances.

    ``independent``, ``cut``: requested minimal coordinates and cut joints. ``method``: "dense" or "sparse"; default: by
    size. Returns the model in its pose of equilibrium; its equations.
    """
    try:
        check_displacements(model)
        return model, linearized(model, independent, cut, method, dense, sparse)
    except EquilibriumError:
        balanced = equilibrium(model).model
        equations = linearized(balanced, independent, cut, method, dense, sparse)
    if isinstance(equations, Equations):  # parameters act on the model before the motion
        provenance = replace(equations.provenance, origin=copy(model), moved_to_equilibrium=True)
        equations = replace(equations, provenance=provenance)
    return balanced, equations


def check_displacements(model: Mechanism) -> None:
    """Refuse a model whose beams and superelements state displacements that do not balance its loads.

    Without stated displacements nothing is checked, as forces then follow from statics. Warns if they are not small.
    """
    if all(part.displacements is None for part in model.composed.values()):
        return
    at = posed_model(static_model(articulated(model)))
    forces = balance(at)
    if forces.share > BALANCE:
        text, details = unbalanced_force(at, forces)
        raise EquilibriumError(
            f"model '{model.name}' is not in balance in the given pose: {text}, by the "
            f"displacements of its beams and superelements. Find the pose with model.equilibrium(), or leave "
            f"displacements out where the pose given is the loaded one.", **details,
        )  # fmt: skip
    warn_beyond(model)
