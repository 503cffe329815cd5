"""Springs, bushings, torsion springs, inerters and Maxwell elements in finite motion: deformation and its energy.

A connection with the deformation x(q) has the potential V = 1/2 x . K x - f . x, f being its preload in the pose as
described, where x = 0, the dissipation function R = 1/2 x' . C x' and the kinetic energy 1/2 b x'^2.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from mbsvib.common.arguments import frame_along
from mbsvib.elements.bushing import LARGEST_ANGLE, Bushing
from mbsvib.elements.inerter import Inerter
from mbsvib.elements.maxwell import Maxwell
from mbsvib.elements.spring import Spring
from mbsvib.elements.torsion_spring import TorsionSpring
from mbsvib.errors import ModelError
from mbsvib.finite_motion.rotations import Expression, logarithm, twist_angle

if TYPE_CHECKING:
    from mbsvib.finite_motion.kinematics import Kinematics


@dataclass(frozen=True)
class Connected:
    """What a connection stores and dissipates.

    ``potential`` V [J], ``dissipation`` R [W] (half the power that dampers take) and ``kinetic`` [J]. ``yields`` (k,)
    are its first-order states and ``yield_rates`` (k,) their derivatives; ``deformation`` (d,) [m, rad] is what its
    force acts along and ``force`` (d,) [N, N m] that force, positive where it pulls the first body to the second.
    ``angle`` [rad] must stay below the limit of bushings, where it is not None; beyond it forces are NaN.
    """

    deformation: Expression
    force: Expression
    potential: Expression
    dissipation: Expression
    kinetic: Expression
    yields: Expression
    yield_rates: Expression
    angle: Expression | None = None


def connected(part: Any, motion: Kinematics) -> Connected:
    """Return what a connection of any kind stores and dissipates.

    ``part``: a spring, bushing, torsion spring, inerter or Maxwell element.
    """
    law = LAWS.get(type(part))
    if law is None:
        raise ModelError(f"{part.family} '{part.name}': has no law for finite motion yet; leave it out, or make it "
                         f"of springs, bushings, torsion springs and the like.", element=part.name)  # fmt: skip
    return law(part, motion)


def _line(part: Any, motion: Kinematics) -> tuple[Expression, Expression]:
    """Length of a line element, and that in the pose as described [m]."""
    start, end = motion.numbers.vector(part, "start"), motion.numbers.vector(part, "end")
    between = motion.point(part.second, end) - motion.point(part.first, start)
    return ca.norm_2(between), ca.norm_2(end - start)


def _spring_damper(
    motion: Kinematics, x: Expression, k: Expression, c: Expression, preload: Expression,
    angle: Expression | None = None,
) -> Connected:  # fmt: skip
    """A spring-damper of stiffness k and damping c (d, d) on the deformation x (d,)."""
    if angle is not None:  # beyond the limit the moment is no number, so that nothing goes on with it
        defined = ca.if_else(angle < LARGEST_ANGLE, 1.0, ca.SX(np.nan))
        k, c = k * defined, c * defined
    xd = motion.rate(x)
    force = preload + k @ x + c @ xd
    return Connected(x, force, 0.5 * ca.dot(x, k @ x) + ca.dot(preload, x), 0.5 * ca.dot(xd, c @ xd), ca.SX(0.0),
                     ca.SX.zeros(0), ca.SX.zeros(0), angle)  # fmt: skip


def _spring(part: Spring, motion: Kinematics) -> Connected:
    length, described = _line(part, motion)
    k = motion.numbers.scalar(part, "stiffness")
    tension = k * (described - motion.numbers.scalar(part, "free_length")) if part.free_length is not None else \
        motion.numbers.scalar(part, "preload")  # fmt: skip
    return _spring_damper(motion, length - described, k, motion.numbers.scalar(part, "damping"), tension)


def _bushing(part: Bushing, motion: Kinematics) -> Connected:
    axes, point = ca.SX(np.array(part.orientation)), motion.numbers.vector(part, "position")
    gap = motion.point(part.second, point) - motion.point(part.first, point)
    turn = motion.frames[part.first].rotation @ axes
    rotation = logarithm(turn.T @ (motion.frames[part.second].rotation @ axes))
    k, c = (_coefficients(part, field, motion) for field in ("stiffness", "damping"))
    # the wrench on the second body is its preload less stiffness times deformation
    preload = ca.SX.zeros(6) if part.preload is None else -motion.numbers.vector(part, "preload")
    moments = k[3:, :].nnz() or c[3:, :].nnz() or any((part.preload or (0.0,) * 6)[3:])
    angle = ca.norm_2(rotation) if moments else None
    return _spring_damper(motion, ca.vertcat(turn.T @ gap, rotation), k, c, preload, angle)


def _coefficients(part: Bushing, field: str, motion: Kinematics) -> Expression:
    value = getattr(part, field)
    if isinstance(value[0], tuple):
        return ca.sparsify(ca.SX(np.array(value)))
    return ca.sparsify(ca.diag(motion.numbers.vector(part, field)))


def _torsion_spring(part: TorsionSpring, motion: Kinematics) -> Connected:
    axes = np.array(frame_along(part.axis))
    relative = motion.relative(part.first, part.second).rotation
    angle = twist_angle(relative, ca.SX(axes[:, 0]), ca.SX(axes[:, 1]))
    k, c = (motion.numbers.scalar(part, field) for field in ("stiffness", "damping"))
    preload = ca.SX(0.0) if part.preload is None else -motion.numbers.scalar(part, "preload")
    return _spring_damper(motion, angle, k, c, preload, ca.fabs(angle))


def _inerter(part: Inerter, motion: Kinematics) -> Connected:
    length, described = _line(part, motion)
    none = ca.SX.zeros(0)
    kinetic = 0.5 * motion.numbers.scalar(part, "inertance") * motion.rate(length) ** 2
    return Connected(length - described, ca.SX(0.0), ca.SX(0.0), ca.SX(0.0), kinetic, none, none)


def _maxwell(part: Maxwell, motion: Kinematics) -> Connected:
    """The damper yields y: c y' = k1 (x - y), and k0 acts beside both."""
    length, described = _line(part, motion)
    k1, c, k0 = (motion.numbers.scalar(part, field) for field in ("stiffness", "damping", "static_stiffness"))
    tension = motion.numbers.scalar(part, "preload")
    x = length - described
    static = tension + k0 * x
    if not part.damping:
        return _spring_damper(motion, x, k0, ca.SX(0.0), tension)
    y = ca.SX.sym(part.name)
    series = k1 * (x - y)
    return Connected(x, static + series, 0.5 * k1 * (x - y) ** 2 + 0.5 * k0 * x**2 + tension * x,
                     0.5 * series**2 / c, ca.SX(0.0), y, series / c)  # fmt: skip


LAWS: dict[type, Callable[[Any, Any], Connected]] = {
    Spring: _spring, Bushing: _bushing, TorsionSpring: _torsion_spring, Inerter: _inerter, Maxwell: _maxwell,
}  # fmt: skip
