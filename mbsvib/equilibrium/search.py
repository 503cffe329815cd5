"""The pose of equilibrium of a model."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsvib.common.expected import names
from mbsvib.equilibrium.balance import balance
from mbsvib.equilibrium.load_steps import with_share
from mbsvib.equilibrium.messages import lacking
from mbsvib.equilibrium.motion import stance
from mbsvib.equilibrium.moved_parts import bare, carried
from mbsvib.equilibrium.path import FOUND, descend, follow, is_stable, stiffness
from mbsvib.equilibrium.pose import start
from mbsvib.equilibrium.preloads import without_rounding
from mbsvib.equilibrium.report import Equilibrium, displacements
from mbsvib.errors import EquilibriumError, ModelError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.api.model import Model
    from mbsvib.equilibrium.path import Found


def equilibrium(model: Model, snap: bool = False, cut: Sequence[str] = ()) -> Equilibrium:
    """Return the model in equilibrium; see ``Model.equilibrium``.

    Parameters
    ----------
    model : Model
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
    pose, plain = start(model), bare(model)
    first = stance(plain, pose, cut)
    before = balance(first)
    if before.share <= FOUND:
        return Equilibrium(without_rounding(carried(model, pose)), 0, (before.share,), (), displacements(pose))
    found = descend(first) if snap or not _held(plain, cut) else follow(plain, first, cut)
    if found.stopped:
        raise _unreachable(found)
    return Equilibrium(without_rounding(carried(model, found.stance.pose)), found.steps, found.residuals, found.shares,
                       displacements(found.stance.pose))  # fmt: skip


def _held(model: Model, cut: tuple[str, ...]) -> bool:
    """Tell whether springs hold the mechanism in its pose when neither gravity nor loads act."""
    alone = balance(stance(with_share(model, 0.0), start(model), cut))
    return alone.share <= FOUND and is_stable(stiffness(alone)[0])


def _unreachable(found: Found) -> EquilibriumError:
    """Say where the search ended, and what is left over there."""
    what, where = lacking(found.stance, found.balance)
    return EquilibriumError(
        f"model '{found.stance.described.name}' has no equilibrium that can be reached from the given pose: "
        f"{found.stopped}. After {found.steps} steps {what}. Hold it with a spring or a load, lower the load, or start "
        f"from a pose nearer to the equilibrium.", **where,
    )  # fmt: skip
