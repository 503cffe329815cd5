"""Arms, trees and closed chains from Denavit-Hartenberg rows."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.api.model import Model
from mbsvib.common import arguments as check
from mbsvib.library._dh_rows import about_x, about_z, checked_closing, checked_row, frame, inertia_about_centre

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike


def from_dh(
    rows: Sequence[Mapping[str, Any]], *, name: str = "arm", position: ArrayLike = (0.0, 0.0, 0.0),
    orientation: ArrayLike | None = None, gravity: ArrayLike | None = None,
    closing: Sequence[Mapping[str, Any]] = (),
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
