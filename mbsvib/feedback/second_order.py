"""Closed loops of second order: static gains from displacements and velocities change C and K of a system."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from mbsvib.equations.equations import Equations
from mbsvib.feedback.closing import regular
from mbsvib.linalg.rank import EPS

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array


E = TypeVar("E", bound=Equations)


def closed_system(system: E, gain: Array, sensors: list[int], actuators: list[int], name: str) -> E | None:
    """Return the system under u = w + G y with a static gain G, or None if that is no such system.

    M q'' + (C - B_u G' Cv_y) q' + (K - B_u G' Cq_y) q = (B + B_u G' D_y) w,  G' = (1 - G D_yu)^-1 G, and likewise for
    the outputs; symmetric parts of the changes become rows with weights, antisymmetric ones gyroscopic and circulatory
    terms

    ``gain`` (actuators, sensors): static gains. Returns None if a sensor of acceleration would change M, there are
    motions without mass, or the loop is algebraic.
    """
    product = gain @ system.D[np.ix_(sensors, actuators)]
    if system.massless or (gain @ system.Ca[sensors]).any() or not regular(product):
        return None
    back: Array = np.asarray(np.linalg.solve(np.eye(len(actuators)) - product, gain), dtype=float)
    forces = system.B[:, actuators]
    stiffness, k_rows, k_weights, circulatory = _change(forces, back, system.Cq[sensors])
    damping, c_rows, c_weights, gyroscopic = _change(forces, back, system.Cv[sensors])
    through, direct = system.D[:, actuators] @ back, back @ system.D[sensors]
    count = len(k_weights) + len(c_weights)
    owner = len(system.provenance.springs)
    return replace(
        system, name=name, C=system.C + damping, K=system.K + stiffness, B=system.B + forces @ direct,
        Cq=system.Cq + through @ system.Cq[sensors], Cv=system.Cv + through @ system.Cv[sensors],
        D=system.D + system.D[:, actuators] @ direct,
        elastic_rows=np.concatenate((system.elastic_rows, k_rows, c_rows)),
        row_stiffness=np.concatenate((system.row_stiffness, k_weights, np.zeros(len(c_weights)))),
        row_damping=np.concatenate((system.row_damping, np.zeros(len(k_weights)), c_weights)),
        row_owner=np.concatenate((system.row_owner + (system.row_owner >= owner), np.full(count, owner))),
        gyroscopic=_sum(system.gyroscopic, gyroscopic), circulatory=_sum(system.circulatory, circulatory),
        provenance=replace(system.provenance, springs=(*system.provenance.springs, "controller"), closed_loop=True,
                           truncation=None),
    )  # fmt: skip


def _change(forces: Array, back: Array, observed: Array) -> tuple[Array, Array, Array, Array | None]:
    """-B_u G' C_y, rows and weights of its symmetric part, and its antisymmetric part, None where that is rounding."""
    change = -forces @ (back @ observed)
    terms = np.abs(forces) @ (np.abs(back) @ np.abs(observed))
    noise = len(forces) * EPS * np.maximum(terms, terms.T)
    skew = 0.5 * (change - change.T)
    skew[np.abs(skew) <= noise] = 0.0
    symmetric = 0.5 * (change + change.T)
    scale = np.sqrt(np.maximum(np.abs(symmetric).max(axis=0, initial=0.0), np.finfo(float).tiny))
    weights, vectors = np.linalg.eigh(symmetric / scale[:, None] / scale) if len(change) else (np.zeros(0), symmetric)
    used = np.abs(weights) > len(forces) * EPS * np.abs(weights).max(initial=0.0)
    rows = vectors[:, used].T * scale
    return symmetric + skew, rows, weights[used], skew if skew.any() else None


def _sum(first: Array | None, second: Array | None) -> Array | None:
    if first is None or second is None:
        return second if first is None else first
    return first + second
