"""The pose of equilibrium of a model."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

from mbsvib.common.expected import names
from mbsvib.elements.coupler import refuse_curved
from mbsvib.equilibrium.articulation import articulated
from mbsvib.equilibrium.balance import Balance, balance, unbalanced_force
from mbsvib.equilibrium.couplers import check_couplers
from mbsvib.equilibrium.linear_range import warn_beyond
from mbsvib.equilibrium.motion import PosedModel, posed_model
from mbsvib.equilibrium.moved_parts import model_in_pose, static_model
from mbsvib.equilibrium.path import BALANCED, SearchResult, descend, follow, is_stable, stiffness, with_share
from mbsvib.equilibrium.preloads import RESIDUAL, without_rounding
from mbsvib.equilibrium.report import Equilibrium, displacements
from mbsvib.errors import EquilibriumError, ModelError
from mbsvib.kinematics.pose import Pose
from mbsvib.mechanism.mechanism import Mechanism

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array

M = TypeVar("M", bound=Mechanism)


def equilibrium(model: M, snap: bool = False, cut: Sequence[str] = ()) -> Equilibrium[M]:
    """Return the model in equilibrium; see ``Model.equilibrium``."""
    cut = tuple(names(cut, "equilibrium", "cut", ModelError))
    first = posed_model(static_model(articulated(model)), cut=cut)
    before = balance(first)
    if before.share <= BALANCED:
        model_there = balanced_model(model, first.pose, before)
        return Equilibrium(model_there, 0, (before.share,), (), _displacements(model, first.pose))
    refuse_curved(model.couplers.values(), "so that no equilibrium elsewhere is looked for. Describe the model in "
                  "balance, or hold this pose by preloads: equilibrium(preload=...).")
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
