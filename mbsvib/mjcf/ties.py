"""Equality constraints: loops closed by ideal joints, coordinates tied by couplers, which polynomials give a curvature.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.kinematics.closing import TOLERANCE
from mbsvib.linalg.rank import ZERO_PRODUCT
from mbsvib.linalg.rotations import jacobian
from mbsvib.mjcf.compiled import Compiled
from mbsvib.mjcf.scene import Scene
from mbsvib.mjcf.tendons import Path, joint_path, single, sums
from mbsvib.urdf.least_norm import close

# Gaps of loops as shares of the model's size: rounding, which is left as the file has it, and limit for errors.
CLOSED, OPEN = 1e-9, 1e-3


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


def add_ties(scene: Scene, tendons: Mapping[int, Path | None]) -> None:
    """Add all active equality constraints."""
    file, m = scene.file, scene.file.m
    if file.off("CONSTRAINT", "EQUALITY"):
        return
    kinds = file.api.mjtEq
    for i in range(m.neq):
        if not m.eq_active0[i]:
            continue
        kind = int(m.eq_type[i])
        if kind in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD):
            _look_at_gap(scene, i)
            _close(scene, i, kind == kinds.mjEQ_WELD)
        elif kind in (kinds.mjEQ_JOINT, kinds.mjEQ_TENDON):
            _look_at_gap(scene, i)
            _couple(scene, i, tendons, kind == kinds.mjEQ_TENDON)
        else:
            name = str(kinds(kind)).rpartition("_")[2].lower()
            raise file.refuse("equality", i, f"is of kind {name}; connect, weld, joint and tendon are known here.")


def _look_at_gap(scene: Scene, i: int) -> None:
    """Refuse a constraint that the pose violates."""
    file, d = scene.file, scene.file.d
    equality = int(file.api.mjtConstraint.mjCNSTR_EQUALITY)
    rows = [j for j in range(int(d.nefc)) if int(d.efc_type[j]) == equality and int(d.efc_id[j]) == i]
    gap = max((abs(float(d.efc_pos[j])) for j in rows), default=0.0)
    size = float(file.m.stat.extent)
    if gap > OPEN * size:
        raise file.refuse("equality", i, f"gapes by {gap:.3g} in this pose. Read the file in a pose that closes it, "
                          f"and go on from there by model.moved().", "pose")  # fmt: skip
    if gap > CLOSED * size:
        scene.remark("gap in this pose of", f"'{file.name('equality', i)}' ({gap:.2g})")


def _close(scene: Scene, i: int, weld: bool) -> None:
    file, m, d = scene.file, scene.file.m, scene.file.d
    ends = [int(m.eq_obj1id[i]), int(m.eq_obj2id[i])]
    data = np.array(m.eq_data[i])
    if hasattr(m, "eq_objtype") and m.eq_objtype[i] == file.api.mjtObj.mjOBJ_SITE:
        at = np.array(d.site_xpos[ends[0]])
        ends = [int(m.site_bodyid[site]) for site in ends]
    else:
        carrier = ends[1] if weld else ends[0]
        at = np.array(d.xpos[carrier]) + np.array(d.xmat[carrier]).reshape(3, 3) @ data[:3]
    first, second = (scene.bodies[body] for body in ends)
    if first != second:
        # a weld with zero torque scale constrains only a point
        kind = "fixed" if weld and data[10] != 0.0 else "spherical"
        scene.model.add_joint(scene.fresh(file.name("equality", i), "tie"), kind, first, second, at)


def _couple(scene: Scene, i: int, tendons: Mapping[int, Path | None], of_tendons: bool) -> None:
    file, m = scene.file, scene.file.m
    slope, second_derivative = _slope(scene, i, of_tendons)
    curvature: dict[str, float] | None = None
    terms: dict[str, float] = {}
    for k, target, factor in ((0, int(m.eq_obj1id[i]), 1.0), (1, int(m.eq_obj2id[i]), -slope)):
        if target < 0 or factor == 0.0:
            continue
        path = tendons[target] if of_tendons else joint_path(scene, target)
        if path is None or path.ends:
            raise file.refuse("equality", i, f"its tendon '{file.name('tendon', target)}' is not a fixed one.")
        for coordinate, value in sums(scene, path, factor).items():
            terms[coordinate] = terms.get(coordinate, 0.0) + value
        if k and second_derivative is not None:
            coordinate, size = single(scene, path)
            curvature = {coordinate: -second_derivative * size**2}
    terms = {coordinate: value for coordinate, value in terms.items() if value}
    name = scene.fresh(file.name("equality", i), "tie")
    if len(terms) > 1:
        scene.model.add_coupler(name, terms, curvature)
    elif terms:  # a single fixed coordinate
        joint = scene.model.joints[next(iter(terms)).rpartition(".")[0]]
        if joint.kind == "free":
            raise file.refuse("equality", i, f"locks '{joint.name}', whose bearings give way; give it one stiffness, "
                              f"not six.", "stiffness")  # fmt: skip
        scene.model.add_joint(name, "fixed", joint.first, joint.second, joint.position)


def _slope(scene: Scene, i: int, of_tendons: bool) -> tuple[float, float | None]:
    """p' and p'' in this pose of a constraint x1 - x1_0 = p(x2 - x2_0) of positions or lengths, p of the fourth degree;
    None in place of p'' where p is a straight line.
    """
    file, m, second = scene.file, scene.file.m, int(scene.file.m.eq_obj2id[i])
    p = np.polynomial.Polynomial(np.array(m.eq_data[i])[:5])
    if second < 0 or not p.coef[2:].any():
        return float(p.coef[1]), None
    if of_tendons:
        x = float(file.d.ten_length[second] - m.tendon_length0[second])
    else:
        x = float(file.position(second)[0] - m.qpos0[int(m.jnt_qposadr[second])])
    slope, size = float(p.deriv()(x)), float(np.polynomial.Polynomial(np.abs(p.deriv().coef))(abs(x)))
    if abs(slope) <= ZERO_PRODUCT * len(p.coef) * size:
        kind = "tendon" if of_tendons else "joint"
        raise file.refuse("equality", i, f"its polynomial has the slope 0 in this pose, where it locks its first "
                          f"{kind} and is no relation of both. Give a pose beside it.", "polycoef")  # fmt: skip
    return slope, float(p.deriv(2)(x))
