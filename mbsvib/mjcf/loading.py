"""From MuJoCo's model in a pose to a model of bodies, joints, springs, couplers and ports."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.api.model import Model
from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array
from mbsvib.common.expected import names
from mbsvib.errors import LeftOutWarning, ModelError
from mbsvib.mechanism.unit_warnings import with_angles
from mbsvib.mjcf import actuators, bodies, checking, tendons, ties
from mbsvib.mjcf.compiled import Compiled, compiled
from mbsvib.mjcf.scene import Scene
from mbsvib.urdf.extensions import in_words

UNNAMED = "MuJoCo Model"  # MuJoCo's default name of a model


def load_mjcf(
    path: str | PathLike[str], *, pose: Mapping[str, Any] | None = None, keyframe: str | int | None = None,
    control: Mapping[str, float] | None = None, stiffness: Any = None, damping: Any = None,
    sites: Iterable[str] = ("*",), gravity: ArrayLike | None = None, leave: Iterable[str] = (), name: str | None = None,
) -> Model:  # fmt: skip
    """Read a model from a MuJoCo file (MJCF), in a pose; MuJoCo itself compiles the file.

    Bodies without joints are one with their parents, those of the world are the ground. Several joints of a body have
    bodies without mass between them. Springs and dampers of joints are bushings ``JOINT.k``; armature and fixed tendons
    of several joints are wheels on the ground that couplers turn. Servos are spring-dampers ``ACTUATOR.servo``. Loops
    closed by connect and weld are ideal joints, joints and tendons tied by equality are couplers, of a polynomial with
    slope and ``curvature`` in the pose. Inputs: of each hinge and slide ``JOINT.torque`` or ``JOINT.force``, of each
    actuator its control under its own name, of each site with a name ``SITE.Fx`` ... ``SITE.Mz``. Outputs:
    ``JOINT.angle`` or ``JOINT.travel``, ``SITE.x`` ... ``SITE.rz``, world axes. What is nonlinear or has no place in a
    model is refused by name; friction, and limits and contacts that touch in this pose, are left with a
    ``LeftOutWarning``.

    Parameters
    ----------
    path : str or path-like
        The file.
    pose : mapping of str to float or array-like, optional
        Positions of joints as in MuJoCo's qpos [rad, m], quaternions of ball joints; default: the keyframe's, or qpos0.
        Equality constraints that are open there are closed by Newton's method: joints that are named are held, the
        others move as little as that takes. Positions beyond the range of a hinge or slide are refused.
    keyframe : str or int, optional
        Name or number of a keyframe, whose positions and controls are taken.
    control : mapping of str to float, optional
        Controls of actuators in this pose; default: the keyframe's, or 0. Where an actuator has a state of its own,
        this is the state.
    stiffness : float, array-like of shape (6,), or mapping of str to these, optional
        Of all hinges and slides, or by joint, "*" being all others: one number about or along the axis [N m/rad, N/m];
        six values x y z rx ry rz, z along the axis, where bearings give way too. Such springs are without load in the
        pose. Default: what the file says.
    damping : float, array-like of shape (6,), or mapping of str to these, optional
        Likewise [N m s/rad, N s/m]; default: as in the file.
    sites : iterable of str
        Names or patterns of the sites that become ports; default: all that move and have a name.
    gravity : array-like, shape (3,), optional
        As for a model, (0, 0, 0) for none; default: as in the file. The pose has to be in balance with it: see
        ``Model.equilibrium``.
    leave : iterable of str
        Names or patterns of actuators, tendons and equality constraints to be left out.
    name : str, optional
        Name of the model; default: the file's.

    Returns
    -------
    Model
        The model.

    Raises
    ------
    ModelError
        If MuJoCo is not installed or refuses the file, or a name, a value or an element is refused.
    """
    file = compiled(path, pose or {}, keyframe, control or {}, leave)
    checking.refuse_beyond(file, pose or {})
    ties.close_equalities(file, pose or {})
    checking.refuse_unknown(file)
    model = with_angles(Model(_name(file) if name is None else name, _gravity(file, gravity)),
                        checking.angles(file, pose or {}))
    scene = Scene(file, model, np.zeros(file.m.nv))
    bodies.add_bodies(scene)
    bodies.add_springs(scene, stiffness, damping)
    bodies.add_armature(scene)
    paths = tendons.add_tendons(scene)
    actuators.add_actuators(scene, paths)
    ties.add_ties(scene, paths)
    bodies.add_ports(scene, names(sites, "load_mjcf", "sites", ModelError))
    checking.compare(scene)
    checking.look_for_left(scene)
    if not model.joints:
        warnings.warn(f"{path}: nothing moves: {file.m.nbody - 1} bodies without joints, which are part of the ground. "
                      f"Give those that move a <joint> or <freejoint>.", LeftOutWarning, stacklevel=2)  # fmt: skip
    if scene.remarks:
        warnings.warn(f"{path}: left out: {in_words(scene.remarks)}.", LeftOutWarning, stacklevel=2)
    return model


def _name(file: Compiled) -> str:
    model_name = str(bytes(file.m.names).split(b"\0", 1)[0].decode("utf-8", "replace")).strip()
    return model_name if model_name and model_name != UNNAMED else Path(file.path).stem


def _gravity(file: Compiled, gravity: ArrayLike | None) -> Array | None:
    if gravity is not None:
        value = np.array(check.vector(gravity, "model", "gravity"))
    else:
        value = np.zeros(3) if file.off("GRAVITY") else np.array(file.m.opt.gravity)
    return value if value.any() else None
