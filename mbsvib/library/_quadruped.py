"""The quadruped robot: an open tree with a floating trunk on elastic feet."""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING

from mbsvib.api.model import Model
from mbsvib.common import arguments as check
from mbsvib.common.arguments import DIRECTIONS
from mbsvib.library._stewart import LOADS, box, cylinder

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from mbsvib.common.arguments import Vector

# A leg in its own plane: sideways and upward from the ground under the trunk's edge [m], hip to foot.
HIP, FIRST_GEAR, SECOND_GEAR, FOOT = (0.12, 0.30), (0.20, 0.30), (0.32, 0.24), (0.30, 0.0)
LENGTHWISE = 0.25
PARTS = (("hip", HIP, FIRST_GEAR, 0.6), ("thigh", FIRST_GEAR, SECOND_GEAR, 0.8), ("shank", SECOND_GEAR, FOOT, 0.5))
RADIUS = 0.02
# A worm with its motor's rotor: mass [kg], radius and length [m] of a cylinder across the leg's plane's normal.
WORM = (0.08, 0.012, 0.04)


def quadruped(
    *, trunk_mass: float = 12.0, yaw_stiffness: float = 4e6, yaw_damping: float = 60.0,
    gear_stiffness: float = 2e6, gear_damping: float = 60.0,
    foot_stiffness: ArrayLike = (4e7, 4e7, 8e7), foot_damping: ArrayLike = (1200.0, 1200.0, 2400.0),
    worm_ratio: float | None = None,
) -> Model:  # fmt: skip
    """Build the chapter's quadruped robot: 13 bodies, 18 degrees of freedom.

    The trunk floats. At each corner (``fl``, ``fr``, ``rl``, ``rr``: front and rear, left and right) a leg of three
    bodies ``fl.hip``, ``fl.thigh``, ``fl.shank`` hangs on it: ``fl.yaw`` is a revolute joint about z, ``fl.gear1``
    and ``fl.gear2`` are worm gears, revolute joints about x; each has a torsion spring-damper, ``fl.yaw.k`` and so
    on. The foot ``fl.foot`` is a spring-damper in three directions between shank and ground. Forces Fx ... Mz act at
    the trunk's centre of mass, displacements x ... rz are measured there.

    With ``worm_ratio`` the worms are bodies of their own (21 bodies, still 18 degrees of freedom): ``fl.worm1`` and
    ``fl.worm2`` turn about y on ``fl.worm1.shaft`` ... in the part before, and drive the gear by ``fl.worm1.mesh`` ...

    The chapter gives the topology only; masses, geometry, stiffness and damping are chosen, the latter two so that
    natural frequencies and damping ratios are in the range of the chapter's figure 10: 247 to 5452 Hz, 0.02 to 0.5.

    Parameters
    ----------
    trunk_mass : float
        Mass of the trunk, a box of 0.6 x 0.24 x 0.1 m [kg].
    yaw_stiffness, yaw_damping : float
        About z, between trunk and leg [N m/rad, N m s/rad].
    gear_stiffness, gear_damping : float
        Of a worm gear, about x [N m/rad, N m s/rad].
    foot_stiffness, foot_damping : array-like, shape (3,)
        Of a foot along x, y, z [N/m, N s/m].
    worm_ratio : float, optional
        Turns of a leg's part per turn of its worm [rad/rad], such as 1/40; default: worms without inertia.

    Returns
    -------
    Model
        The robot.

    Raises
    ------
    ModelError
        If a value is refused by the part it is for.

    Source: W. Jiang, X. Chen, X. Luo, "Vibration and sensitivity analysis of spatial multibody systems based on
    constraint topology transformation" (2011), section 5.2 a.
    """
    who = "quadruped"
    trunk = check.number(trunk_mass, who, "trunk_mass", "a positive number [kg]")
    zeros = (0.0, 0.0, 0.0)
    foot = tuple(
        check.vector(value, who, field, "three finite numbers (x, y, z)") + zeros
        for field, value in (("foot_stiffness", foot_stiffness), ("foot_damping", foot_damping))
    )
    yaw = ((*zeros, 0.0, 0.0, yaw_stiffness), (*zeros, 0.0, 0.0, yaw_damping))
    gear = ((*zeros, gear_stiffness, 0.0, 0.0), (*zeros, gear_damping, 0.0, 0.0))
    model = Model(who)
    centre = (0.0, 0.0, HIP[1])
    model.add_body("trunk", trunk, box(trunk, 0.6, 0.24, 0.1), centre)
    model.add_joint("trunk.free", "free", "ground", "trunk", centre)
    for corner, x, side in (("fl", 1.0, 1.0), ("fr", 1.0, -1.0), ("rl", -1.0, 1.0), ("rr", -1.0, -1.0)):
        points = [(LENGTHWISE * x, side * sideways, up) for sideways, up in (HIP, FIRST_GEAR, SECOND_GEAR, FOOT)]
        before = "trunk"
        for (part, _, _, mass), start, end in zip(PARTS, points[:-1], points[1:], strict=True):
            _add_rod(model, f"{corner}.{part}", mass, start, end)
        for joint, part, axis, spring, point in (
            ("yaw", "hip", (0.0, 0.0, 1.0), yaw, points[0]),
            ("gear1", "thigh", (1.0, 0.0, 0.0), gear, points[1]),
            ("gear2", "shank", (1.0, 0.0, 0.0), gear, points[2]),
        ):
            body, name = f"{corner}.{part}", f"{corner}.{joint}"
            model.add_joint(name, "revolute", before, body, point, axis=axis)
            model.add_bushing(f"{name}.k", before, body, point, *spring)
            if worm_ratio is not None and joint != "yaw":
                _add_worm(model, f"{corner}.worm{joint[-1]}", before, name, point, worm_ratio)
            before = body
        model.add_bushing(f"{corner}.foot", "ground", before, points[3], *foot)
    for load, direction in zip(LOADS, DIRECTIONS, strict=True):
        model.add_input(load, "trunk", direction)
        model.add_output(direction, "trunk", direction)
    return model


def _add_rod(model: Model, name: str, mass: float, start: Vector, end: Vector) -> None:
    line = (end[0] - start[0], end[1] - start[1], end[2] - start[2])
    length = sqrt(line[0] ** 2 + line[1] ** 2 + line[2] ** 2)
    middle = (0.5 * (start[0] + end[0]), 0.5 * (start[1] + end[1]), 0.5 * (start[2] + end[2]))
    axes = check.frame_along((line[0] / length, line[1] / length, line[2] / length))
    model.add_body(name, mass, cylinder(mass, RADIUS, length), middle, axes)


def _add_worm(model: Model, name: str, carrier: str, gear: str, point: Vector, ratio: float) -> None:
    mass, radius, length = WORM
    across = (0.0, 1.0, 0.0)
    model.add_body(name, mass, cylinder(mass, radius, length), point, check.frame_along(across))
    model.add_joint(f"{name}.shaft", "revolute", carrier, name, point, axis=across)
    model.add_worm(f"{name}.mesh", f"{name}.shaft", gear, ratio)
