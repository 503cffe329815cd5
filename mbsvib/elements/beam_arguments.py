"""Arguments that beams and flexures share, checked."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mbsvib.common import arguments as check

if TYPE_CHECKING:
    from mbsvib.elements.joint_kinds import Six


def check_flags(who: str, shear: Any, second_order: Any) -> None:
    """Refuse what is neither True nor False."""
    if type(shear) is not bool:
        raise check.refuse(who, "shear", shear, "True (Timoshenko) or False (Euler-Bernoulli)")
    if type(second_order) is not bool:
        raise check.refuse(who, "second_order", second_order, "True (slopes add to the strain) or False (linear)")


def checked_displacements(who: str, value: Any, nodes: int) -> tuple[Six, ...]:
    """Return displacements (nodes, 6) of the nodes of a beam, checked."""
    expected = f"x y z [m] and rx ry rz [rad] of each of the {nodes} nodes"
    items = check.listed(value, who, "displacements", expected)
    if len(items) != nodes:
        raise check.refuse(who, "displacements", value, expected)
    return tuple([check.numbers(item, (6,), who, "displacements", expected) for item in items])


def checked_damping(who: str, word: str, value: Any) -> float:
    """Return a coefficient of damping, which is not negative."""
    result = check.number(value, who, word)
    if result < 0.0:
        raise check.refuse(who, word, value, "a number that is not negative")
    return result
