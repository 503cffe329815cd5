"""The unbalanced force of a pose, for messages."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from mbsvib.equilibrium.balance import Balance
    from mbsvib.equilibrium.motion import PosedModel


def unbalanced_force(at: PosedModel, forces: Balance) -> tuple[str, dict[str, Any]]:
    """Return the largest unbalanced force of a pose: a sentence, and the fields of an ``EquilibriumError``.

    Both name the body, the coordinate and the missing force.
    """
    share = np.abs(forces.residual / np.where(forces.balanced_forces > 0.0, forces.balanced_forces, 1.0))
    worst = int(np.argmax(np.abs(forces.residual) / np.where(forces.size > 0.0, forces.size, 1.0)))
    coordinate = int(forces.reduction.independent[worst])
    name = at.coordinates.names[coordinate]
    owner = name.rpartition(".")[0]
    joint = at.reference.joints.get(owner)
    body = owner if joint is None else joint.first if joint.second == "ground" else joint.second
    unit = "N m" if at.coordinates.turns[coordinate] else "N"
    missing = -float(forces.residual[worst])
    kind = "moment" if unit == "N m" else "force"
    text = (f"unbalanced {kind} on body '{body}', {missing:.6g} {unit} missing along '{name}' ({share[worst]:.1e} of "
            f"the forces that should cancel)")  # fmt: skip
    return text, {"body": body, "coordinate": name, "missing": missing, "unit": unit}
