"""Equality constraints that are open in the pose asked for are closed, by the same steps as loops of URDF files."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.kinematics.closing import TOLERANCE
from mbsvib.linalg.rotations import jacobian
from mbsvib.urdf.least_norm import close

if TYPE_CHECKING:
    from collections.abc import Iterable

    from mbsvib.common.arrays import Array
    from mbsvib.mjcf.compiled import Compiled

# Constraints that are open by less, as shares of the size, are left as the file has them.
CLOSED = 1e-9


def close_equalities(file: Compiled, pose: Iterable[str]) -> None:
    """Move joints as little as it takes to close all equality constraints; joints that ``pose`` names stay.

    Positions are left as they are where that does not succeed, or nothing is open.
    """
    api, m, d = file.api, file.m, file.d
    if not m.neq or file.off("CONSTRAINT", "EQUALITY"):
        return
    held = [file.names("joint").index(name) for name in pose]
    size, start, sparsity = float(m.stat.extent), np.array(d.qpos), m.opt.jacobian
    scale, free = np.ones(m.nv), np.ones(m.nv, dtype=bool)
    turns = []  # first coordinates of rotation vectors
    for i in range(m.njnt):
        first, kind = int(m.jnt_dofadr[i]), int(m.jnt_type[i])
        scale[first : first + {0: 3, 2: 1}.get(kind, 0)] = size
        turns += [first + 3 * (kind == 0)] if kind < 2 else []
        free[first : first + (6, 3, 1, 1)[kind]] = i not in held

    def evaluate(x: Array) -> tuple[Array, Array]:
        d.qpos[:] = start
        api.mj_integratePos(m, d.qpos, x * scale, 1.0)
        api.mj_fwdPosition(m, d)
        rows = [j for j in range(int(d.nefc)) if int(d.efc_type[j]) == int(api.mjtConstraint.mjCNSTR_EQUALITY)]
        rates = np.eye(m.nv)
        for k in turns:  # R exp(w) turns by the right Jacobian of w in the axes of the body
            rates[k : k + 3, k : k + 3] = jacobian(-x[k : k + 3])
        slopes = np.array(d.efc_J).reshape(-1, m.nv)[rows] @ rates * scale
        unit = np.array([_unit(file, int(d.efc_id[j]), size) for j in rows])
        return np.array(d.efc_pos)[rows] / unit, slopes / unit[:, None]

    m.opt.jacobian = int(api.mjtJacobian.mjJAC_DENSE)
    try:
        gap = evaluate(np.zeros(m.nv))[0]
        if np.abs(gap).max(initial=0.0) > CLOSED:
            x = close(evaluate, np.zeros(m.nv), free)
            closed = np.abs(evaluate(x)[0]).max() <= TOLERANCE
            if not closed:
                d.qpos[:] = start
        else:
            d.qpos[:] = start
    finally:
        m.opt.jacobian = sparsity
        api.mj_forward(m, d)


def _unit(file: Compiled, i: int, size: float) -> float:
    kinds = file.api.mjtEq
    return size if int(file.m.eq_type[i]) in (int(kinds.mjEQ_CONNECT), int(kinds.mjEQ_WELD)) else 1.0
