"""Explain: the loads of a system and what they do, in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsvib.loads.statics import BALANCE

if TYPE_CHECKING:
    from mbsvib.system import System


def explain_loads(system: System) -> list[str]:
    """Return what loads a system, how well it balances, and how the forces in redundant joints were chosen.

    Parameters
    ----------
    system : System
        The equations of motion.

    Returns
    -------
    list of str
        Lines of text; none where nothing loads it.
    """
    statics = system.provenance.statics
    if statics is None:
        return []
    applied = statics.applied
    lines = []
    if applied.weight.any():
        lines.append("  gravity: acts at the centres of mass; its stiffness comes through joints and preloads")
    for names, what in ((applied.names[: applied.loads], "loads"),
                        (applied.names[applied.loads :], "preloads")):  # fmt: skip
        if names:
            lines.append(f"  {what}: {_listed(names)}")
    lines.append(f"  balance: {statics.imbalance:.1e} of the forces is left over (allowed {BALANCE:g})")
    for joints in statics.spread:
        lines.append(f"  forces in the loops closed by {_listed(joints)} are redundant: those of least norm were "
                     f"taken, moments divided by the size of the loop; stiffness does not depend on it")  # fmt: skip
    if system.circulatory is not None:
        lines.append("  follower loads or torques make K unsymmetric")
    return lines


def _listed(names: tuple[str, ...]) -> str:
    from mbsvib.explain import listed

    return listed(names)
