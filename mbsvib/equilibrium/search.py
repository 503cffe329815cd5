"""The pose of equilibrium of a model."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

from mbsvib.common.expected import names
from mbsvib.equilibrium.articulation import articulated
from mbsvib.equilibrium.balance import balance
from mbsvib.equilibrium.couplers import check_couplers
from mbsvib.equilibrium.linear_range import warn_beyond
from mbsvib.equilibrium.load_steps import with_share
from mbsvib.equilibrium.messages import lacking
from mbsvib.equilibrium.motion import stance
from mbsvib.equilibrium.moved_parts import bare, carried
from mbsvib.equilibrium.path import FOUND, descend, follow, is_stable, stiffness
from mbsvib.equilibrium.pose import start
from mbsvib.equilibrium.preloads import without_rounding
from mbsvib.equilibrium.report import Equilibrium, displacements
from mbsvib.errors import EquilibriumError, ModelError
from mbsvib.mechanism.mechanism import Mechanism

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.equilibrium.motion import Stance
    from mbsvib.equilibrium.path import Found
    from mbsvib.equilibrium.pose import Pose

M = TypeVar("M", bound=Mechanism)


def equilibrium(model: M, snap: bool = False, cut: Sequence[str] = ()) -> Equilibrium[M]:
    """Return the model in equilibrium; see ``Model.equilibrium``.

    Parameters
    ----------
    model : Mechanism
        The model, in a pose from which to start.
    snap : bool
        Whether a mechanism that its springs hold may snap through to a pose elsewhere.
    cut : sequence of str
        Joints at which loops are to be cut.

    Returns
    -------
    Equilibrium
        The model there, and how it was found.

    Raises
    ------
    EquilibriumError
        If no such pose can be reached.
    """
    cut = tuple(names(cut, "equilibrium", "cut", ModelError))
    jointed = bare(articulated(model))
    pose = start(jointed)
    first = stance(jointed, pose, cut)
    before = balance(first)
    if before.share <= FOUND:
        there = _described(model, pose)
        return Equilibrium(there, 0, (before.share,), (), _displacements(model, pose))
    found = descend(first) if snap or not _held(first) else follow(first)
    if found.stopped:
        raise _unreachable(found)
    there = _described(model, found.stance.pose)
    warn_beyond(there, found.stance, found.balance.reduction)
    return Equilibrium(there, found.steps, found.residuals, found.shares, _displacements(model, found.stance.pose))


def _displacements(model: Mechanism, pose: Pose) -> dict[str, Array]:
    """How far bodies and nodes are from where they were described; internal coordinates are no bodies."""
    carriers = {name for part in model.superelements.values() for name in part.carriers}
    return {name: six for name, six in displacements(pose).items() if name not in carriers}


def _described(model: M, pose: Pose) -> M:
    """The model in the pose that was found."""
    there = carried(model, pose)
    if not model.composed:
        there = without_rounding(there)
    check_couplers(model, there)
    return there


def _held(first: Stance) -> bool:
    """Tell whether springs hold the mechanism in its pose when neither gravity nor loads act."""
    alone = balance(first.under(with_share(first.described, 0.0)))
    return alone.share <= FOUND and is_stable(stiffness(alone)[0])


def _unreachable(found: Found) -> EquilibriumError:
    """Say where the search ended, and what is left over there."""
    what, where = lacking(found.stance, found.balance)
    return EquilibriumError(
        f"model '{found.stance.described.name}' has no equilibrium that can be reached from the given pose: "
        f"{found.stopped}. After {found.steps} steps {what}. Hold it with a spring or a load, lower the load, or start "
        f"from a pose nearer to the equilibrium.", **where,
    )  # fmt: skip
