"""Serial arms from Denavit-Hartenberg rows."""

from __future__ import annotations

from collections.abc import Mapping
from math import cos, pi, sin
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.api.model import Model
from mbsvib.common import arguments as check
from mbsvib.errors import ModelError, nearest

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from mbsvib.common.arrays import Array


JOINTS = {"revolute": "revolute", "prismatic": "prismatic", "R": "revolute", "P": "prismatic"}
ABOUT = ("cm", "origin")
WORDS = ("a", "b", "alpha", "theta", "joint", "mass", "cm", "inertia", "about", "name")
# Angles this near to a multiple of a right angle are rounded to it: its cosine or sine is then exactly zero.
RIGHT = 1e-15


def from_dh(
    rows: Sequence[Mapping[str, Any]], *, name: str = "arm", position: ArrayLike = (0.0, 0.0, 0.0),
    orientation: ArrayLike | None = None, gravity: ArrayLike | None = None,
) -> Model:  # fmt: skip
    """Build a serial arm from its Denavit-Hartenberg rows, in the pose that they give.

    Q_i = R_z(theta_i) R_x(alpha_i),  O_i+1 = O_i + b_i z_i + a_i x_i+1,  [I]_i = Q_i [I]_i+1 Q_i^T

    Frame i, of origin O_i, has its z along the axis of joint i; link i, which joint i moves, carries frame i + 1.
    Bodies are ``link1``, ... with the axes of the frames that they carry, joints ``joint1``, ... Inputs ``tau1``, ...
    are the joints' torques or forces, outputs ``q1``, ... their displacements, ``x`` ... ``rz`` those of the last
    frame's origin.

    Parameters
    ----------
    rows : sequence of mapping
        A row a link, from the base on: ``a`` [m], distance from z_i to z_i+1 along x_i+1; ``b`` [m], from O_i to
        x_i+1 along z_i; ``alpha`` [rad], angle from z_i to z_i+1 about x_i+1; ``theta`` [rad], from x_i to x_i+1 about
        z_i (each 0 where left out); ``joint``, "revolute" (theta varies; the default) or "prismatic" (b varies), or R
        or P; ``mass`` [kg]; ``cm`` [m], the centre of mass from O_i+1 in axes of frame i + 1 (default: there);
        ``inertia`` [kg m^2], 3, 6 or 3x3 values as for a body, in axes of frame i + 1, about ``about``: "cm" (the
        default) or "origin", O_i+1; ``name`` of the link.
    name : str
        Name of the model.
    position : array-like, shape (3,)
        O_1 [m], world axes.
    orientation : array-like, shape (3, 3) or (3,), optional
        Axes of frame 1 as columns, or a rotation vector [rad]; default: world axes.
    gravity : array-like, shape (3,), optional
        As for a model.

    Returns
    -------
    Model
        The arm, without springs.

    Raises
    ------
    ModelError
        If a word is unknown or missing, or a value is refused; the message names the link.

    Source: H. Chaudhary, S. K. Saha, "Dynamics and Balancing of Multibody Systems" (2009), appendix A, (A.2)-(A.9).
    """
    if isinstance(rows, (str, Mapping)) or not hasattr(rows, "__len__") or not len(rows):
        raise check.refuse("from_dh", "rows", rows, "a mapping for each link, such as {'a': 0.4, 'mass': 2.0, ...}")
    model = Model(name, gravity)
    origin = np.array(check.vector(position, "from_dh", "position"))
    axes = np.array(check.orientation(orientation, "from_dh"))
    before = "ground"
    for i, description in enumerate(rows, 1):
        row = _checked(description, i)
        link, joint = row["name"], f"joint{i}"
        x, z = axes @ _about_z(row["theta"])[:, 0], axes[:, 2].copy()
        rotation = axes @ _about_z(row["theta"]) @ _about_x(row["alpha"])
        end = origin + row["b"] * z + row["a"] * x
        model.add_body(link, row["mass"], _inertia(row, link), end + rotation @ row["cm"], rotation)
        model.add_joint(joint, row["joint"], before, link, origin, orientation=axes)
        along = (0.0, 0.0, 0.0, *z) if row["joint"] == "revolute" else (*z, 0.0, 0.0, 0.0)
        model.add_input(f"tau{i}", link, along, origin, relative_to=before)
        model.add_output(f"q{i}", link, along, origin, relative_to=before)
        before, origin, axes = link, end, rotation
    for direction in check.DIRECTIONS:
        model.add_output(direction, before, direction, origin)
    return model


def _checked(description: Any, i: int) -> dict[str, Any]:
    """One row with all its entries, checked."""
    who = f"link {i}"
    if not isinstance(description, Mapping):
        raise check.refuse(who, "row", description, f"a mapping with the words {', '.join(WORDS)}")
    for word in description:
        if word not in WORDS:
            raise ModelError(f"{who}: there is no word {word!r}.{nearest(str(word), WORDS)} A row has "
                             f"{', '.join(WORDS)}.", element=who, field=str(word))  # fmt: skip
    for word, what in (("mass", "a mass [kg]"), ("inertia", "3, 6 or 3x3 values [kg m^2]")):
        if word not in description:
            raise check.refuse(who, word, None, what)
    row = {word: check.number(description.get(word, 0.0), who, word, f"a finite number [{unit}]")
           for word, unit in (("a", "m"), ("b", "m"), ("alpha", "rad"), ("theta", "rad"))}  # fmt: skip
    joint = description.get("joint", "revolute")
    if not isinstance(joint, str) or joint not in JOINTS:
        raise check.refuse(who, "joint", joint, "revolute or prismatic, or R or P",
                           nearest(str(joint), JOINTS).strip() or "Joints of several freedoms are several rows, links "
                           "without mass between them.")  # fmt: skip
    about = description.get("about", "cm")
    if about not in ABOUT:
        raise check.refuse(who, "about", about, "'cm' or 'origin', the point about which the inertia is taken")
    return row | {
        "joint": JOINTS[joint], "mass": description["mass"], "inertia": description["inertia"], "about": about,
        "cm": np.array(check.vector(description.get("cm", (0.0, 0.0, 0.0)), who, "cm")),
        "name": description.get("name", f"link{i}"),
    }  # fmt: skip


def _inertia(row: Mapping[str, Any], link: str) -> Any:
    """The tensor about the centre of mass, moved there from the frame's origin where it is given about that."""
    if row["about"] == "cm":
        return row["inertia"]
    tensor = np.array(row["inertia"], dtype=float)
    if tensor.shape == (6,):
        xx, yy, zz, xy, xz, yz = tensor
        tensor = np.array(((xx, xy, xz), (xy, yy, yz), (xz, yz, zz)))
    elif tensor.shape == (3,):
        tensor = np.diag(tensor)
    elif tensor.shape != (3, 3):
        raise check.refuse(f"body '{link}'", "inertia", row["inertia"], "3, 6 or 3x3 values [kg m^2]")
    mass = check.number(row["mass"], f"body '{link}'", "mass", "a positive number [kg]")
    c = row["cm"]
    return tensor - mass * ((c @ c) * np.eye(3) - np.outer(c, c))


def _cosine_sine(angle: float) -> tuple[float, float]:
    quarter = round(angle / (0.5 * pi))
    if abs(angle - quarter * 0.5 * pi) <= RIGHT * max(1.0, abs(angle)):
        return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[quarter % 4]
    return cos(angle), sin(angle)


def _about_z(angle: float) -> Array:
    c, s = _cosine_sine(angle)
    return np.array(((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)))


def _about_x(angle: float) -> Array:
    c, s = _cosine_sine(angle)
    return np.array(((1.0, 0.0, 0.0), (0.0, c, -s), (0.0, s, c)))
