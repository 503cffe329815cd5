"""Inputs and outputs: how forces follow controls in MuJoCo, and how sites move with its coordinates."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.mjcf.compiled import compiled
from tests.mjcf.peer import forces
from tests.mjcf.scenes import ARM, GANTRY, HAND, write

pytest.importorskip("mujoco", reason="MuJoCo is not installed: pip install 'mbsvib[mjcf]'")

# Motors on a ball, in its body's and in its parent's axes, on a free joint, and on a site that is turned; no loads.
JETS = """
<worldbody><body name="ship"><joint name="float" type="free"/><geom size=".1 .2 .3" type="box"/>
  <body name="mast" pos="0 0 .4" euler=".2 .3 .1"><joint name="ball" type="ball" stiffness="4"/>
    <geom type="capsule" size=".01" fromto="0 0 0 0 .1 .5"/><site name="top" pos="0 .1 .5" euler=".4 .5 .6"/>
  </body></body></worldbody>
<actuator><motor name="in" joint="ball" gear="1 2 3"/><motor name="out" jointinparent="ball" gear="3 2 1"/>
  <motor name="push" joint="float" gear="1 2 3 4 5 6"/><motor name="world" jointinparent="float" gear="6 5 4 3 2 1"/>
  <motor name="jet" site="top" gear="1 -2 3 .1 .2 .3"/></actuator>"""


def model_of(path, **words):
    """The model in its pose without gravity and preloads, so that it is in balance, and MuJoCo's."""
    model = mv.load_mjcf(path, gravity=(0, 0, 0), **words)
    for name, spring in model.springs.items():
        if spring.preload is not None:
            model = model.replace(name, preload=None)
    pose, control = words.get("pose", {}), words.get("control", {})
    return model, compiled(path, pose, None, control, ())


def rows_of(file, system):
    """Where MuJoCo's coordinates are among those of the system."""
    names = []
    for i in range(file.m.njnt):
        own = (("x", "y", "z", "rx", "ry", "rz"), ("rx", "ry", "rz"), ("z",), ("rz",))[file.m.jnt_type[i]]
        names += [f"{file.name('joint', i)}.{d}" for d in own]
    return [system.coordinates.index(name) for name in names]


@pytest.mark.filterwarnings("ignore:.*turned spring")
@pytest.mark.parametrize(("scene", "words"), [
    (ARM, {"pose": {"yaw": 0.3, "roll": -0.4, "reach": 0.1}}),
    (GANTRY, {"control": {"belt": 0.1}}),
    (HAND, {"control": {"hold": 0.2, "odd": 0.7}, "pose": {"t": -0.2}}),
    (JETS, {"pose": {"ball": (0.9, 0.3, -0.1, 0.2), "float": (0, 0, 0, 0.8, 0.2, 0.3, -0.1)}}),
])  # fmt: skip
def test_inputs_and_outputs(tmp_path, scene, words):
    path = write(tmp_path, scene)
    model, file = model_of(path, **words)
    system, m = model.linearize(), file.m
    order, turn = rows_of(file, system), np.eye(m.nv)
    for i in np.flatnonzero(m.jnt_type == 0):  # MuJoCo turns a free body in its own axes
        start = m.jnt_dofadr[i] + 3
        turn[start : start + 3, start : start + 3] = np.array(file.d.xmat[m.jnt_bodyid[i]]).reshape(3, 3)
    d, rest = file.api.MjData(m), np.zeros(m.nv)
    at, u = np.array(file.d.qpos), np.array(file.d.ctrl)
    for i in range(m.nu):
        result = []
        for sign in (1.0, -1.0):
            file.d.ctrl[:] = u
            file.d.ctrl[i] += sign
            result.append(np.array(forces(file, d, at, rest)))
        file.d.ctrl[:] = u
        column = system.B[order, system.inputs.index(file.name("actuator", i))]
        np.testing.assert_allclose(column, turn @ (result[0] - result[1]) / 2, atol=1e-11 * np.abs(column).max())
    moving = [i for i in range(m.nsite) if m.site_bodyid[i]]
    for i in moving:
        straight, rotating = np.zeros((2, 3, m.nv))
        file.api.mj_jacSite(m, file.d, straight, rotating, i)
        first = system.outputs.index(f"{file.name('site', i)}.x")
        rows = system.Cq[first : first + 6][:, order]
        np.testing.assert_allclose(rows, np.concatenate((straight, rotating)) @ turn.T, atol=1e-13)
        first = system.inputs.index(f"{file.name('site', i)}.Fx")
        np.testing.assert_allclose(system.B[order, first : first + 6], rows.T, atol=1e-13)
    for i in range(m.njnt):
        if m.jnt_type[i] >= 2:
            what = f"{file.name('joint', i)}.{'angle' if m.jnt_type[i] == 3 else 'travel'}"
            own = f"{file.name('joint', i)}.{'rz' if m.jnt_type[i] == 3 else 'z'}"
            unit = np.eye(len(order))[system.coordinates.index(own)]
            np.testing.assert_allclose(system.Cq[system.outputs.index(what)], unit, atol=1e-14)
