"""MuJoCo's own matrices of a file in a pose, as the reference: M, and K and C by central differences of its forces."""

from __future__ import annotations

import numpy as np

from mbsvib.mjcf.compiled import compiled

STEP = 1e-5


def full_mass(api, m, d):
    result = np.zeros((m.nv, m.nv))
    try:
        api.mj_fullM(m, result, d.qM)
    except (AttributeError, TypeError):  # later versions take the data themselves
        api.mj_fullM(m, d, result)
    return result


def forces(file, d, qpos, qvel):
    """All forces but those of constraints, along MuJoCo's coordinates."""
    d.qpos[:], d.qvel[:], d.ctrl[:], d.act[:] = qpos, qvel, file.d.ctrl, file.d.act
    file.api.mj_forward(file.m, d)
    return d.qfrc_passive + d.qfrc_actuator - d.qfrc_bias


def matrices(file):
    """Mass, damping and stiffness of a compiled file in its pose."""
    api, m = file.api, file.m
    d, at, rest = api.MjData(m), np.array(file.d.qpos), np.zeros(m.nv)
    forces(file, d, at, rest)
    mass, K, C = full_mass(api, m, d), np.zeros((m.nv, m.nv)), np.zeros((m.nv, m.nv))
    for i in range(m.nv):
        step = np.zeros(m.nv)
        step[i] = STEP
        moved = [at.copy(), at.copy()]
        for qpos, sign in zip(moved, (1.0, -1.0), strict=True):
            api.mj_integratePos(m, qpos, step, sign)
        K[:, i] = -(forces(file, d, moved[0], rest) - forces(file, d, moved[1], rest)) / (2 * STEP)
        C[:, i] = -(forces(file, d, at, step) - forces(file, d, at, -step)) / (2 * STEP)
    return mass, C, K


def settled(path, control):
    """A file without loops in balance by Newton's method on MuJoCo's own forces, and that pose, by joint."""
    file = compiled(path, {}, None, control, ())
    d, rest = file.api.MjData(file.m), np.zeros(file.m.nv)
    for _ in range(20):
        force = forces(file, d, file.d.qpos, rest)
        if np.abs(force).max() < 1e-11 * max(1.0, np.abs(d.qfrc_bias).max()):
            break
        file.api.mj_integratePos(file.m, file.d.qpos, np.linalg.solve(matrices(file)[2], force), 1.0)
    file.api.mj_forward(file.m, file.d)
    return file, {file.name("joint", i): file.position(i) for i in range(file.m.njnt)}


def projected(file):
    """Angular frequencies of a file with loops and no load: on the null space of MuJoCo's constraint Jacobian."""
    from scipy.linalg import eigh, null_space

    M, _, K = matrices(file)
    m, d = file.m, file.d
    J = np.zeros((d.nefc, m.nv))
    for row, unit in zip(J, np.eye(d.nefc), strict=True):
        file.api.mj_mulJacTVec(m, d, row, unit)
    free = null_space(J, rcond=1e-9)
    return np.sqrt(eigh(free.T @ K @ free, free.T @ M @ free, eigvals_only=True))


def closed(file, driven, value):
    """Potential energy where one coordinate has a value and the others close the loops; MuJoCo's pose is left there."""
    api, m, d = file.api, file.m, file.d
    others = [i for i in range(m.nv) if i != driven]
    d.qpos[driven] = value
    for _ in range(20):
        api.mj_forward(m, d)
        if np.abs(d.efc_pos).max() < 1e-15:
            break
        J = np.zeros((d.nefc, m.nv))
        for row, unit in zip(J, np.eye(d.nefc), strict=True):
            api.mj_mulJacTVec(m, d, row, unit)
        d.qpos[others] -= np.linalg.lstsq(J[:, others], d.efc_pos, rcond=1e-9)[0]
    api.mj_energyPos(m, d)
    return float(d.energy[0])
