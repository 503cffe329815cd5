"""Check that stated displacements of beams and superelements balance the loads."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsvib.equilibrium.articulation import articulated
from mbsvib.equilibrium.balance import balance, unbalanced_force
from mbsvib.equilibrium.linear_range import warn_beyond
from mbsvib.equilibrium.motion import posed_model
from mbsvib.equilibrium.moved_parts import static_model
from mbsvib.errors import EquilibriumError
from mbsvib.linalg.rank import BALANCE

if TYPE_CHECKING:
    from mbsvib.mechanism.mechanism import Mechanism


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
