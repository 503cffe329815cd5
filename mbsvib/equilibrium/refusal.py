"""What a pose lacks, in words."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mbsvib.errors import EquilibriumError
from mbsvib.loads.statics import check_balance

if TYPE_CHECKING:
    from mbsvib.equilibrium.balance import Balance
    from mbsvib.equilibrium.motion import Stance


def lacking(at: Stance, forces: Balance) -> tuple[str, dict[str, Any]]:
    """Return what a pose lacks: a sentence, and the fields of an ``EquilibriumError``.

    Parameters
    ----------
    at : Stance
        The pose.
    forces : Balance
        The forces there.

    Returns
    -------
    str
        Body, coordinate and missing force.
    dict
        The same as keywords.
    """
    turns = dict(zip(at.coordinates.names, at.coordinates.turns.tolist(), strict=True))
    units = tuple(["rad" if turns[name] else "m" for name in forces.names])
    try:
        check_balance(forces.residual, forces.size, forces.names, units, at.topology, at.described.name)
    except EquilibriumError as error:
        where = {key: getattr(error, key) for key in ("body", "coordinate", "missing", "unit")}
        return (f"body '{error.body}' lacks {error.missing:.6g} {error.unit} along '{error.coordinate}' "
                f"({forces.share:.1e} of the forces that should cancel)"), where  # fmt: skip
    return f"{forces.share:.1e} of the forces is left over", {}
