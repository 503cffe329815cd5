"""Arms, trees and closed chains from Denavit-Hartenberg rows, with the checks and frames of these rows."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import cos, pi, sin
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.api.model import Model
from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array
from mbsvib.elements.joint_kinds import KINDS
from mbsvib.errors import nearest

JOINTS = {"revolute": "revolute", "prismatic": "prismatic", "R": "revolute", "P": "prismatic"}
ABOUT = ("cm", "origin")
WORDS = ("a", "b", "alpha", "theta", "joint", "mass", "cm", "inertia", "about", "name", "parent", "offset", "turn")
CLOSING_WORDS = ("first", "second", "joint", "name", "offset", "turn")
# Angles this near to a multiple of a right angle are rounded to it: its cosine or sine is then exactly zero.
RIGHT = 1e-15


def checked_row(description: Any, i: int, links: Iterable[str]) -> dict[str, Any]:
    """Return one row with all its entries, checked; ``links`` are the names of those before it, ground among them."""
    who, known = f"link {i}", list(links)
    _check_words(description, who, WORDS)
    for word, expected in (("mass", "a mass [kg]"), ("inertia", "3, 6 or 3x3 values [kg m^2]")):
        if word not in description:
            raise check.refuse(who, word, None, expected)
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
    return row | _offset_and_turn(description, who) | {
        "joint": JOINTS[joint], "mass": description["mass"], "inertia": description["inertia"], "about": about,
        "cm": np.array(check.vector(description.get("cm", (0.0, 0.0, 0.0)), who, "cm")),
        "name": description.get("name", f"link{i}"),
        "parent": _link(description.get("parent", known[-1]), who, "parent", known),
    }  # fmt: skip


def checked_closing(description: Any, i: int, links: Iterable[str]) -> dict[str, Any]:
    """Return what describes a closing joint, with all its entries, checked."""
    who, known = f"closing joint {i}", list(links)
    _check_words(description, who, CLOSING_WORDS)
    joint = description.get("joint", "revolute")
    kinds = [kind for kind in KINDS if kind not in ("screw", "distance", "free")]
    word = JOINTS.get(joint, joint) if isinstance(joint, str) else joint
    if word not in kinds:
        raise check.refuse(who, "joint", joint, f"one of {', '.join(kinds)}", "Add any other with add_joint.")
    if "first" not in description:
        raise check.refuse(who, "first", None, "the link whose last frame the joint is in")
    return _offset_and_turn(description, who) | {
        "joint": word, "name": description.get("name", f"closing{i}"),
        "first": _link(description["first"], who, "first", known),
        "second": _link(description.get("second", "ground"), who, "second", known),
    }  # fmt: skip


def frame(origin: Array, axes: Array, row: Mapping[str, Any]) -> tuple[Array, Array]:
    """Return a frame moved by the ``offset`` and turned by the ``turn`` of a row, both in its own axes."""
    return origin + axes @ row["offset"], axes @ row["turn"]


def inertia_about_centre(row: Mapping[str, Any], link: str) -> Any:
    """Return the tensor about the centre of mass, moved there from the frame's origin where it is given about that."""
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


def about_z(angle: float) -> Array:
    """Return the rotation about z."""
    c, s = _cosine_sine(angle)
    return np.array(((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)))


def about_x(angle: float) -> Array:
    """Return the rotation about x."""
    c, s = _cosine_sine(angle)
    return np.array(((1.0, 0.0, 0.0), (0.0, c, -s), (0.0, s, c)))


def _check_words(description: Any, who: str, words: tuple[str, ...]) -> None:
    check.mapping(who, "row", description, f"a mapping with the words {', '.join(words)}", empty=True)
    for word in description:
        check.known(word, words, f"{who}: there is no word {word!r}", str(word), "A row has", element=who)


def _offset_and_turn(description: Mapping[str, Any], who: str) -> dict[str, Array]:
    return {"offset": np.array(check.vector(description.get("offset", (0.0, 0.0, 0.0)), who, "offset")),
            "turn": np.array(check.orientation(description.get("turn"), who))}  # fmt: skip


def _link(value: Any, who: str, field: str, known: list[str]) -> str:
    if not isinstance(value, str) or value not in known:
        raise check.refuse(who, field, value, f"the name of a link before it, or 'ground': {', '.join(known)}",
                           nearest(str(value), known).strip())  # fmt: skip
    return value


def _cosine_sine(angle: float) -> tuple[float, float]:
    quarter = round(angle / (0.5 * pi))
    if abs(angle - quarter * 0.5 * pi) <= RIGHT * max(1.0, abs(angle)):
        return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[quarter % 4]
    return cos(angle), sin(angle)


def from_dh(
    rows: Sequence[Mapping[str, Any]], *, name: str = "arm", position: ArrayLike = (0.0, 0.0, 0.0),
    orientation: ArrayLike | None = None, gravity: ArrayLike | None = None, closing: Sequence[Mapping[str, Any]] = (),
) -> Model:  # fmt: skip
    """Build an arm, a tree or a closed chain from its Denavit-Hartenberg rows, in the pose that they give.

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
        default) or "origin", O_i+1; ``name`` of the link. In a tree, ``parent`` names the link (or ground) that the
        joint is on (default: the link before), and ``offset`` [m] and ``turn`` (rotation vector [rad] or 3x3) take
        the frame that the parent carries to the frame of the joint, in axes of the former (default: none).
    name : str
        Name of the model.
    position : array-like, shape (3,)
        Origin of the base's frame [m], world axes: O_1 where the first row has no offset.
    orientation : array-like, shape (3, 3) or (3,), optional
        Axes of the base's frame as columns, or a rotation vector [rad]; default: world axes.
    gravity : array-like, shape (3,), optional
        As for a model.
    closing : sequence of mapping
        A row for each joint that closes a loop: ``first`` and ``second``, the names of its links (second: ground where
        left out); ``joint``, a kind as for ``add_joint`` (default: revolute); ``name`` (default: ``closing1``, ...).
        It is at the origin of the frame that the first link carries, in its axes, moved by ``offset`` and ``turn``.

    Returns
    -------
    Model
        The mechanism, without springs.

    Raises
    ------
    ModelError
        If a word is unknown or missing, or a value is refused; the message names the link.

    Source: H. Chaudhary, S. K. Saha, "Dynamics and Balancing of Multibody Systems" (2009), appendix A, (A.2)-(A.9).
    """
    _check_several(rows, "rows", "a mapping for each link, such as {'a': 0.4, 'mass': 2.0, ...}", least=1)
    _check_several(closing, "closing", "a mapping for each joint that closes a loop, such as {'first': 'link3'}")
    model = Model(name, gravity)
    base = np.array(check.vector(position, "from_dh", "position"))
    frames = {"ground": (base, np.array(check.orientation(orientation, "from_dh")))}
    for i, description in enumerate(rows, 1):
        row = checked_row(description, i, frames)
        link, joint, parent = row["name"], f"joint{i}", row["parent"]
        origin, axes = frame(*frames[parent], row)
        x, z = axes @ about_z(row["theta"])[:, 0], axes[:, 2].copy()
        rotation = axes @ about_z(row["theta"]) @ about_x(row["alpha"])
        end = origin + row["b"] * z + row["a"] * x
        model.add_body(link, row["mass"], inertia_about_centre(row, link), end + rotation @ row["cm"], rotation)
        model.add_joint(joint, row["joint"], parent, link, origin, orientation=axes)
        along = (0.0, 0.0, 0.0, *z) if row["joint"] == "revolute" else (*z, 0.0, 0.0, 0.0)
        model.add_input(f"tau{i}", link, along, origin, relative_to=parent)
        model.add_output(f"q{i}", link, along, origin, relative_to=parent)
        frames[link] = (end, rotation)
    for direction in check.DIRECTIONS:
        model.add_output(direction, link, direction, end)
    for i, description in enumerate(closing, 1):
        row = checked_closing(description, i, frames)
        point, axes = frame(*frames[row["first"]], row)
        model.add_joint(row["name"], row["joint"], row["first"], row["second"], point, orientation=axes)
    return model


def _check_several(rows: Any, field: str, expected: str, least: int = 0) -> None:
    if isinstance(rows, (str, Mapping)) or not hasattr(rows, "__len__") or len(rows) < least:
        raise check.refuse("from_dh", field, rows, expected)
