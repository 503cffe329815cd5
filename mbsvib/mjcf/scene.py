"""From MuJoCo's model in a pose to a model of bodies, joints, springs, couplers and ports."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.api.model import Model
from mbsvib.common import arguments as check
from mbsvib.errors import LeftOutWarning
from mbsvib.mjcf.compiled import Compiled, compiled

if TYPE_CHECKING:
    from collections.abc import Iterable
    from os import PathLike

    from numpy.typing import ArrayLike

    from mbsvib.common.arrays import Array


MOST_NAMES = 8  # that a warning lists of each sort
UNNAMED = "MuJoCo Model"  # what MuJoCo calls a model whose file gives it no name


@dataclass(slots=True, eq=False)
class Link:
    """A joint in the model: its bodies, its point and axis z (world), and the place of z or rz among x ... rz; None
    where it has several freedoms.
    """

    name: str
    first: str
    second: str
    at: Array
    z: Array
    own: int | None

    @property
    def axes(self) -> Array:
        """The joint's axes as columns, z along its axis."""
        return np.array(check.frame_along(check.axis(tuple(self.z), self.name, "axis")))

    @property
    def coordinate(self) -> str:
        """Name of its only coordinate."""
        return f"{self.name}.{'z' if self.own == 2 else 'rz'}"


@dataclass(slots=True, eq=False)
class Scene:
    """The file, the model as far as it is built, and what its parts are called there.

    ``bodies`` gives the body of the model by the number of MuJoCo's, ``links`` the joint. ``felt`` sums up the forces
    of springs and actuators along MuJoCo's coordinates, to be compared with its own. ``remarks`` tell what was left.
    """

    file: Compiled
    model: Model
    felt: Array
    bodies: dict[int, str] = field(default_factory=dict)
    links: dict[int, Link] = field(default_factory=dict)
    wheels: dict[str, tuple[str, float]] = field(default_factory=dict)
    remarks: dict[str, list[str]] = field(default_factory=dict)

    def fresh(self, name: str, more: str) -> str:
        """Return a name that no part has: the name itself, or with an ending."""
        model = self.model
        groups = (model.bodies, model.joints, model.springs, model.couplers, model.loads)
        result = name
        while result == "ground" or any(result in group for group in groups):
            result = f"{result}.{more}"
        return result

    def remark(self, what: str, name: str) -> None:
        """Keep in mind that something of an element was left."""
        self.remarks.setdefault(what, []).append(name)


def load_mjcf(
    path: str | PathLike[str], *, pose: Mapping[str, Any] | None = None, keyframe: str | int | None = None,
    control: Mapping[str, float] | None = None, stiffness: Any = None, damping: Any = None,
    sites: Iterable[str] = ("*",), gravity: ArrayLike | None = None, leave: Iterable[str] = (), name: str | None = None,
) -> Model:  # fmt: skip
    """Read a model from a MuJoCo file (MJCF), in a pose; MuJoCo itself resolves what the file says.

    Bodies without joints are one with their parents, those of the world are the ground. Several joints of a body have
    bodies without mass between them. Springs and dampers of joints are bushings ``JOINT.k``; armature and fixed tendons
    of several joints are wheels on the ground that couplers turn. Servos are spring-dampers ``ACTUATOR.servo``. Loops
    closed by connect and weld are ideal joints, joints and tendons tied by equality are couplers. Inputs: of each
    hinge and slide ``JOINT.torque`` or ``JOINT.force``, of each actuator its control under its own name, of each site
    with a name ``SITE.Fx`` ... ``SITE.Mz``. Outputs: ``JOINT.angle`` or ``JOINT.travel``, ``SITE.x`` ... ``SITE.rz``,
    world axes. What is nonlinear or has no place in a model is refused by name; friction, and limits and contacts that
    touch in this pose, are left with a ``LeftOutWarning``.

    Parameters
    ----------
    path : str or path-like
        The file.
    pose : mapping of str to float or array-like, optional
        Positions of joints as in MuJoCo's qpos [rad, m], quaternions of ball joints; default: the keyframe's, or qpos0.
    keyframe : str or int, optional
        Name or number of a keyframe, whose positions and controls are taken.
    control : mapping of str to float, optional
        Controls of actuators in this pose; default: the keyframe's, or 0. Where an actuator has a state of its own,
        this is the state.
    stiffness : float, array-like of shape (6,), or mapping of str to these, optional
        Of all hinges and slides, or by joint: one number about or along the axis [N m/rad, N/m]; six values x y z rx ry
        rz, z along the axis, where bearings give way too. Such springs are without load in the pose. Default: what the
        file says.
    damping : float, array-like of shape (6,), or mapping of str to these, optional
        Likewise [N m s/rad, N s/m]; default: what the file says.
    sites : iterable of str
        Names or patterns of the sites that become ports; default: all that move and have a name.
    gravity : array-like, shape (3,), optional
        As for a model, (0, 0, 0) for none; default: what the file says. The pose has to be in balance with it: see
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
    from mbsvib.mjcf import actuators, bodies, checking, tendons, ties

    file = compiled(path, pose or {}, keyframe, control or {}, leave)
    checking.refuse_unknown(file)
    model = Model(_name(file) if name is None else name, _gravity(file, gravity))
    scene = Scene(file, model, np.zeros(file.m.nv))
    bodies.add_bodies(scene)
    bodies.add_springs(scene, stiffness, damping)
    bodies.add_armature(scene)
    paths = tendons.add_tendons(scene)
    actuators.add_actuators(scene, paths)
    ties.add_ties(scene, paths)
    bodies.add_ports(scene, [sites] if isinstance(sites, str) else list(sites))
    checking.compare(scene)
    checking.look_for_left(scene)
    if scene.remarks:
        told = "; ".join(f"{what} {_listed(names)}" for what, names in scene.remarks.items())
        warnings.warn(f"{path}: left out: {told}.", LeftOutWarning, stacklevel=2)
    return model


def _listed(names: list[str]) -> str:
    more = len(names) - MOST_NAMES
    return ", ".join(names[:MOST_NAMES]) + (f" and {more} more" if more > 0 else "")


def _name(file: Compiled) -> str:
    given = str(bytes(file.m.names).split(b"\0", 1)[0].decode("utf-8", "replace")).strip()
    return given if given and given != UNNAMED else Path(file.path).stem


def _gravity(file: Compiled, given: ArrayLike | None) -> Array | None:
    if given is not None:
        value = np.array(check.vector(given, "model", "gravity"))
    else:
        value = np.zeros(3) if file.off("GRAVITY") else np.array(file.m.opt.gravity)
    return value if value.any() else None
