"""Explain: the loads of a system and their effects."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.explain.energy_shares import ELASTIC, energies
from mbsvib.linalg.rank import BALANCE

if TYPE_CHECKING:
    from mbsvib.equations.equations import Equations

# Coordinates whose stiffness is shown.
SHOWN = 12


def explain_loads(system: Equations) -> list[str]:
    """Return the loads of a system, their balance, and their effect on stiffness."""
    statics = system.provenance.statics
    if statics is None:
        return []
    applied = statics.applied
    lines = []
    if applied.weight.any():
        lines.append("  gravity: acts at the centres of mass; its geometric stiffness is in the reactions and preloads")
    for names, kind in ((applied.names[: applied.loads], "loads"),
                        (applied.names[applied.loads :], "preloads")):  # fmt: skip
        if names:
            lines.append(f"  {kind}: {_listed(names)}")
    lines.append(f"  balance: relative residual of the forces {statics.imbalance:.1e} (allowed {BALANCE:g})")
    lines += _stiffness(system)
    if system.circulatory is not None:
        lines.append("  follower loads, torques or cross-coupled bushings make K unsymmetric")
    return lines


def _stiffness(system: Equations) -> list[str]:
    """The diagonal of K by kinds, and the largest contribution of each element of a loaded model."""
    names, kinds, parts = energies(system, np.eye(system.dof))
    total = np.diagonal(system.K)
    lines = []
    for i, coordinate in enumerate(system.coordinates[:SHOWN]):
        sums = {kind: sum(parts[k, i] for k in range(len(names)) if kinds[k] == kind) for kind in dict.fromkeys(kinds)}
        text = " ".join(f"{value:+.6g} {kind}" for kind, value in sums.items() if value)
        unit = "N/m" if system.coordinate_units[i] == "m" else "N m/rad"
        lines.append(f"  stiffness along {coordinate}: {total[i]:.6g} {unit} = {text or 'nothing'}")
    for name, kind, part in zip(names, kinds, parts, strict=True):
        if kind != ELASTIC:
            most = int(np.argmax(np.abs(part)))
            where = system.coordinates[most]
            unit = "N/m" if system.coordinate_units[most] == "m" else "N m/rad"
            lines.append(f"  {kind} of '{name}': {part[most]:+.6g} {unit} along {where}, its largest contribution")
    return lines


def _listed(names: tuple[str, ...]) -> str:
    from mbsvib.common.tables import listed

    return listed(names)
