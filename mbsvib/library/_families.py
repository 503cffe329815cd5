"""The chapter's chain, ladder and binary tree, and their common parts: the data of Table 3, joint letters, and ports.

Source: Jiang, Chen and Luo (2011), section 5.1. Table 3 divides stiffness and damping by the number s of
spring-dampers between two bodies, so that the frequencies do not depend on s.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import pi
from typing import Any

from numpy.typing import ArrayLike

from mbsvib.api.model import Model
from mbsvib.common import arguments as check
from mbsvib.common.arguments import Vector
from mbsvib.elements import bushing
from mbsvib.errors import nearest

# The chapter's Table 3, of all spring-dampers of a joint together; it gives torsion per degree.
MASS = 1.0
INERTIA = (1.0, 1.0, 1.0)
STIFFNESS = (1e4, 1e4, 1e4, 1e4 * 180.0 / pi, 1e4 * 180.0 / pi, 1e4 * 180.0 / pi)
DAMPING = (10.0, 10.0, 10.0, 10.0 * 180.0 / pi, 10.0 * 180.0 / pi, 10.0 * 180.0 / pi)

LETTERS = {"R": "revolute", "P": "prismatic", "C": "cylindrical", "S": "spherical"}
X, Y, Z = UNITS = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


class FamilyBuilder:
    """A chain, tree or ladder under construction: equal bodies, joined everywhere by the same joint and bushings."""

    def __init__(
        self, who: str, size: tuple[str, Any], joint: Any, axis: Any, springs: Any, *, total: bool, mass: Any,
        inertia: Any, stiffness: Any, damping: Any,
    ) -> None:  # fmt: skip
        self.size = check.count(size[1], who, size[0])
        self.springs = check.count(springs, who, "springs", least=0)
        self.kind = joint_kind(joint, who)
        self.axis = check.axis(axis, who, "axis")
        self.mass, self.inertia = mass, inertia
        sharing = self.springs if total else 1
        self.stiffness = _share(bushing.coefficients(stiffness, who, "stiffness"), sharing)
        self.damping = _share(bushing.coefficients(damping, who, "damping"), sharing)
        # as in the chapter: the family's letter, its size, the joint's letter, F and the number of spring-dampers
        self.model = Model(f"{who[0].upper()}{self.size}{self.kind[0].upper()}F{self.springs}")
        # the usual axis is the default of joints and bushings, which then need no checks of their axes
        usual = self.axis == Z
        self._joint_axes: dict[str, Any] = {} if usual else {"axis": self.axis}
        self._spring_axes: dict[str, Any] = {} if usual else {"orientation": check.frame_along(self.axis)}

    def body(self, name: str, position: Vector) -> None:
        """Add a body."""
        self.model.add_body(name, self.mass, self.inertia, position)

    def join(self, joint: str, spring: str, first: str, second: str, point: Vector) -> None:
        """Add a joint, and its spring-dampers (numbered where there are several), between two bodies."""
        model = self.model
        model.add_joint(joint, self.kind, first, second, point, **self._joint_axes)
        for i in range(1, self.springs + 1):
            name = spring if self.springs == 1 else f"{spring}.{i}"
            model.add_bushing(name, first, second, point, self.stiffness, self.damping, **self._spring_axes)

    def moves(self, *arms: Vector) -> tuple[list[str], list[str]]:
        """Return the world directions (x y z, rx ry rz) in which such joints let a body move.

        ``arms`` are the directions in which the body may lie as seen from the joints.
        """
        slides = [self.axis] if self.kind in ("prismatic", "cylindrical") else []
        turns = {"prismatic": [], "spherical": list(UNITS)}.get(self.kind, [self.axis])
        shifts = slides + [
            (a[1] * r[2] - a[2] * r[1], a[2] * r[0] - a[0] * r[2], a[0] * r[1] - a[1] * r[0])
            for a in turns for r in arms
        ]  # fmt: skip
        return _components(shifts, ("x", "y", "z")), _components(turns, ("rx", "ry", "rz"))


def joint_kind(value: Any, who: str) -> str:
    """Return the kind of joint that a word or the chapter's letter stands for."""
    kind = LETTERS.get(value, value) if isinstance(value, str) else None
    if kind not in LETTERS.values():
        known = [*LETTERS.values(), *LETTERS]
        expected = "revolute, prismatic, cylindrical or spherical, or the letter R, P, C or S"
        raise check.refuse(who, "joint", value, expected, nearest(str(value), known).strip())
    return kind  # type: ignore[return-value]


def _share(value: Any, number: int) -> Any:
    """Return the part that each of ``number`` bushings has of the six values, or of the 6x6 matrix."""
    if number <= 1:
        return value
    return tuple(_share(row, number) if isinstance(row, tuple) else row / number for row in value)


def _components(vectors: list[Vector], names: tuple[str, ...]) -> list[str]:
    return [name for k, name in enumerate(names) if any(abs(v[k]) > 1e-9 for v in vectors)]


def add_inputs(model: Model, body: str, directions: Iterable[str]) -> None:
    """Add forces Fx Fy Fz and torques Mx My Mz at a body's centre of mass."""
    for d in directions:
        model.add_input(f"M{d[1]}" if d[0] == "r" else f"F{d}", body, d)


def add_outputs(model: Model, body: str, directions: Iterable[str], prefix: str = "") -> None:
    """Add the displacements x y z rx ry rz of a body's centre of mass."""
    for d in directions:
        model.add_output(f"{prefix}{d}", body, d)


def chain(
    n: int = 10, joint: str = "revolute", *, axis: ArrayLike = Z, line: ArrayLike = Z, springs: int = 1,
    total: bool = True, spacing: float = 0.2, mass: float = MASS, inertia: ArrayLike = INERTIA,
    stiffness: ArrayLike = STIFFNESS, damping: ArrayLike = DAMPING,
) -> Model:  # fmt: skip
    """Build the chapter's chain (its models C10RF1, C50RF1 and so on).

    Body i is joined to body i - 1, body 1 to ground; joint i lies (i - 1) spacing from the origin along the line and
    the centre of mass of body i half a spacing farther on. The chapter's chain runs along z, the axis of its joints:
    a revolute one only twists. With ``line=(0, 1, 0)`` it bends. Bodies are ``body1``, joints ``joint1``, bushings
    ``spring1`` (``spring1.1``, ``spring1.2`` where there are several) and so on. Force inputs (Fx, ...) and
    displacement outputs (x, ...) sit at the centre of mass of the last body, in the directions in which it can move.

    Parameters
    ----------
    n : int
        Number of bodies.
    joint : str
        revolute, prismatic, cylindrical or spherical, or the chapter's letter R, P, C or S.
    axis : array-like, shape (3,)
        Axis of all joints, world axes; bushings have it along their z.
    line : array-like, shape (3,)
        Direction of the chain, world axes; z as in the chapter.
    springs : int
        Number s of bushings at every joint; 0 leaves them out.
    total : bool
        Whether the bushings of a joint have ``stiffness`` and ``damping`` together, each one an s-th, as in the
        chapter's Table 3. With False each has all of it, and frequencies grow with s.
    spacing : float
        Distance between joints [m].
    mass : float
        Mass of every body [kg].
    inertia : array-like, shape (3,), (6,) or (3, 3)
        Inertia of every body about its centre of mass [kg m^2], world axes.
    stiffness, damping : array-like, shape (6,) or (6, 6)
        Of the bushings of a joint, in their axes: N/m and N m/rad; N s/m and N m s/rad. The default is the chapter's
        Table 3.

    Returns
    -------
    Model
        The chain; n degrees of freedom (2 n cylindrical, 3 n spherical).

    Raises
    ------
    ModelError
        If n < 1, the joint is unknown, or a value is refused by the part it is for.

    Source: Jiang, Chen and Luo (2011), section 5.1 A, Table 3.
    """
    parts = FamilyBuilder("chain", ("n", n), joint, axis, springs, total=total,
                          mass=mass, inertia=inertia, stiffness=stiffness, damping=damping)  # fmt: skip
    along = check.axis(line, "chain", "line")
    distance = check.number(spacing, "chain", "spacing", "the distance between joints [m]")
    x, y, z = (distance * e for e in along)
    before = "ground"
    for i in range(1, parts.size + 1):
        body, s = f"body{i}", i - 0.5
        parts.body(body, (s * x, s * y, s * z))
        s = i - 1.0
        parts.join(f"joint{i}", f"spring{i}", before, body, (s * x, s * y, s * z))
        before = body
    shifts, turns = parts.moves(along)
    add_inputs(parts.model, before, shifts + turns)
    add_outputs(parts.model, before, shifts + turns)
    return parts.model


def ladder(
    layers: int = 5, joint: str = "revolute", *, axis: ArrayLike = Z, springs: int = 1, total: bool = True,
    mass: float = MASS, inertia: ArrayLike = INERTIA, stiffness: ArrayLike = STIFFNESS, damping: ArrayLike = DAMPING,
) -> Model:  # fmt: skip
    """Build the chapter's ladder (its models L5RF1, L20RF1 and so on) of 3 bodies and one closed loop a layer.

    Layer i has the upright bodies ``left<i>`` and ``right<i>`` with centres of mass at (-+0.1, 0.2 i - 0.1, 0) and
    the body ``rung<i>`` on top, at (0, 0.2 i, 0). An upright's joints are ``left<i>.foot``, with the rung below or
    ground, and ``left<i>.head``, with its own rung; the bushing beside a joint is ``left<i>.foot.spring``. Where
    joints lock more than a plane mechanism needs (revolute about z: 3 rows a loop) the spare rows are redundant.
    Force inputs (Fx, ...) and displacement outputs (x, ...) sit at the centre of mass of the top rung.

    Parameters
    ----------
    layers : int
        Number of layers.
    joint, axis, springs, total, mass, inertia, stiffness, damping : as for ``chain``
        Of all joints, of their bushings, and of every body.

    Returns
    -------
    Model
        The ladder; a layer adds 1 degree of freedom (revolute about z; about x 2), 3 (prismatic), 4 (cylindrical
        along z) or 6 (spherical).

    Raises
    ------
    ModelError
        If layers < 1, the joint is unknown, or a value is refused by the part it is for.

    Source: Jiang, Chen and Luo (2011), section 5.1 C, Table 3. The text there puts both joints of an upright at its
    centre of mass, where revolute joints would let no rung move; here they are at its ends.
    """
    parts = FamilyBuilder("ladder", ("layers", layers), joint, axis, springs, total=total,
                          mass=mass, inertia=inertia, stiffness=stiffness, damping=damping)  # fmt: skip
    below = "ground"
    for i in range(1, parts.size + 1):
        rung, foot, middle, head = f"rung{i}", (i - 1) / 5.0, (2 * i - 1) / 10.0, i / 5.0
        sides = ((f"left{i}", -0.1), (f"right{i}", 0.1))
        for side, x in sides:
            parts.body(side, (x, middle, 0.0))
        parts.body(rung, (0.0, head, 0.0))
        for side, x in sides:
            parts.join(f"{side}.foot", f"{side}.foot.spring", below, side, (x, foot, 0.0))
            parts.join(f"{side}.head", f"{side}.head.spring", side, rung, (x, head, 0.0))
        below = rung
    shifts, _ = parts.moves(Y)
    add_inputs(parts.model, below, shifts)
    add_outputs(parts.model, below, shifts)
    return parts.model


def tree(
    layers: int = 5, joint: str = "revolute", *, axis: ArrayLike = Z, springs: int = 1, total: bool = True,
    mass: float = MASS, inertia: ArrayLike = INERTIA, stiffness: ArrayLike = STIFFNESS, damping: ArrayLike = DAMPING,
) -> Model:  # fmt: skip
    """Build the chapter's binary tree (its models T5RF1, T7RF1 and so on) of 2^layers - 1 bodies.

    Layer i holds the bodies ``body<i>.1`` ... ``body<i>.<2^(i-1)>``; the centre of mass of ``body<i>.<j>`` is at
    (j, i, 0). Bodies 2j - 1 and 2j of the next layer hang on it, joined half way between the centres of mass, and
    ``body1.1`` on ground at (1, 1/2, 0). Joints ``joint<i>.<j>`` and bushings ``spring<i>.<j>`` carry the number of
    the outer body. Force inputs (Fx, ...) and displacement outputs (x, ...) sit at the first body of the last layer;
    outputs ``last.x``, ... at the last body of that layer.

    Parameters
    ----------
    layers : int
        Number of layers.
    joint, axis, springs, total, mass, inertia, stiffness, damping : as for ``chain``
        Of all joints, of their bushings, and of every body.

    Returns
    -------
    Model
        The tree; one degree of freedom a body (2 cylindrical, 3 spherical).

    Raises
    ------
    ModelError
        If layers < 1, the joint is unknown, or a value is refused by the part it is for.

    Source: Jiang, Chen and Luo (2011), section 5.1 B, Table 3. The text there also turns the axes of the
    joints about z, which changes nothing where they are about or along z.
    """
    parts = FamilyBuilder("tree", ("layers", layers), joint, axis, springs, total=total,
                          mass=mass, inertia=inertia, stiffness=stiffness, damping=damping)  # fmt: skip
    for i in range(1, parts.size + 1):
        y = float(i)
        for j in range(1, 2 ** (i - 1) + 1):
            number, carrier = f"{i}.{j}", (j + 1) // 2
            parts.body(f"body{number}", (float(j), y, 0.0))
            parent = f"body{i - 1}.{carrier}" if i > 1 else "ground"
            point = (0.5 * (j + carrier), y - 0.5, 0.0)
            parts.join(f"joint{number}", f"spring{number}", parent, f"body{number}", point)
    first, last = f"body{parts.size}.1", f"body{parts.size}.{2 ** (parts.size - 1)}"
    # the first bodies of all layers are in line, those of the other branches spread over the plane
    shifts, turns = parts.moves(Y)
    add_inputs(parts.model, first, shifts + turns)
    add_outputs(parts.model, first, shifts + turns)
    if first != last:
        shifts, turns = parts.moves(X, Y)
        add_outputs(parts.model, last, shifts + turns, prefix="last.")
    return parts.model
