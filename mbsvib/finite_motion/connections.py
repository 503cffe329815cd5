"""Connections in finite motion: deformation and its energy, by the law that each family states."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from mbsvib.elements.bushing import LARGEST_ANGLE
from mbsvib.elements.connection import Connection
from mbsvib.elements.deformations import Law
from mbsvib.errors import ModelError
from mbsvib.finite_motion.frames import Expression, entries
from mbsvib.finite_motion.numbers import Numbers
from mbsvib.linalg.displacements import Displacement

if TYPE_CHECKING:
    from mbsvib.finite_motion.kinematics import Kinematics


@dataclass(frozen=True)
class Connected:
    """What a connection stores and dissipates.

    ``potential`` V [J], ``dissipation`` R [W] (half the power that dampers take) and ``kinetic`` [J]. ``yields`` (k,)
    are its first-order states and ``yield_rates`` (k,) their derivatives; ``deformation`` (d,) [m, rad] is what its
    force acts along and ``force`` (d,) [N, N m] that force, positive where it pulls the first body to the second.
    ``cross_force`` (d,) is the part of it without energy, of the antisymmetric parts of stiffness and damping.
    ``coefficients`` are stiffness and damping (d, d) of the deformation.
    ``angle`` [rad] must stay below the limit of bushings, where it is not None; beyond it forces are NaN.
    """

    deformation: Expression
    force: Expression
    potential: Expression
    dissipation: Expression
    kinetic: Expression
    yields: Expression
    yield_rates: Expression
    cross_force: Expression
    coefficients: tuple[Expression, Expression]
    angle: Expression | None = None


def connected(part: Any, motion: Kinematics) -> Connected:
    """Return what a connection of any kind stores and dissipates (see ``elements.deformations.Law``).

    With a spring k1 and a damper c in series, the damper yields y: c y' = k1 (x - y).
    """
    law = part.law if isinstance(part, Connection) else None
    if law is None:
        raise ModelError(f"{part.family} '{part.name}': has no law for finite motion yet; leave it out, or make it "
                         f"of springs, bushings, torsion springs and the like.", element=part.name)  # fmt: skip
    numbers = motion.numbers
    columns = _columns(part, numbers)
    x, described = deformed(part, columns, motion)
    k, c, b = (_coefficients(part, field, numbers) for field in (law.stiffness, law.damping, law.inertance))
    rest = _force_at_rest(part, law, numbers, k, described)
    # a damper about one axis needs the rate of its angle alone, which has no limit
    angle = _largest_angle(x, law.rotations, [k, rest] if x.shape[0] == 1 else [k, c, rest])
    if law.across is not None:
        across = law.across(motion.relative(part.first, part.second).displacement, columns)
        angle = across if angle is None else ca.fmax(angle, across)
    if angle is not None:  # beyond the limit the moment is no number, so that nothing goes on with it
        defined = ca.if_else(angle < LARGEST_ANGLE, 1.0, ca.SX(np.nan))
        k, c = k * defined, c * defined
    xd = motion.rate(x)
    force, potential = rest + k @ x + c @ xd, 0.5 * ca.dot(x, k @ x) + ca.dot(rest, x)
    if law.energy is not None:
        d = ca.SX.sym("d", x.shape[0])
        stored = law.energy(ca.vertsplit(d), columns)
        pull, now, before = (ca.substitute(value, d, there) for value, there in (
            (ca.gradient(stored, d), x + described), (stored, x + described), (stored, described)))  # fmt: skip
        force, potential = force + pull, potential + now - before
    dissipation, y, rates = 0.5 * ca.dot(xd, c @ xd), ca.SX.zeros(0), ca.SX.zeros(0)
    if law.series is not None and getattr(part, law.series[1]):
        k1, c1 = (numbers.scalar(part, field) for field in law.series)
        y = ca.SX.sym(part.name)
        series = k1 * (x - y)
        force, potential = force + series, potential + 0.5 * k1 * (x - y) ** 2
        dissipation, rates = dissipation + 0.5 * series**2 / c1, series / c1
    for stiffness, time in () if law.relaxations is None else getattr(part, law.relaxations):
        array = np.array(stiffness) if isinstance(stiffness[0], tuple) else np.diag(stiffness)
        matrix, acts = ca.sparsify(ca.SX(array)), np.flatnonzero(array.any(axis=1)).tolist()
        own = ca.SX.sym(part.name, len(acts))
        stretch = ca.SX.zeros(x.shape)
        stretch[acts] = x[acts] - own
        series = matrix @ stretch
        force, potential = force + series, potential + 0.5 * ca.dot(stretch, series)
        dissipation = dissipation + 0.5 * ca.dot(stretch, series) / time
        y, rates = ca.vertcat(y, own), ca.vertcat(rates, stretch[acts] / time)
    crossed = ca.SX(*x.shape) if part.cross_coupling is None else 0.5 * ((k - k.T) @ x + (c - c.T) @ xd)
    return Connected(x, force, potential, dissipation, 0.5 * ca.dot(xd, b @ xd), y, rates, crossed, (k, c), angle)


def change(part: Any, motion: Kinematics) -> Expression:
    """Return by how much the one deformation of an output with a law has changed since as described."""
    return deformed(part, _columns(part, motion.numbers), motion)[0]


def deformed(part: Any, columns: Any, motion: Kinematics) -> tuple[Expression, Expression]:
    """Return the change (d,) of the deformation that a part states since as described, and its value then."""
    described: Expression = ca.vertcat(*part.law.deformation(Displacement(), columns))
    relative = motion.relative(part.first, part.second).displacement
    return ca.vertcat(*part.law.deformation(relative, columns)) - described, described


def _columns(part: Any, numbers: Numbers) -> Any:
    """The numbers of a part as components: its points, of which some may be symbols, and its axes."""
    points = {field: entries(numbers.vector(part, field)) for field in part.point_fields}
    others = {field: getattr(part, field) for field in ("orientation", "axis") if hasattr(part, field)}
    if part.law.energy is not None or not isinstance(part, Connection):
        others = {name: getattr(part, name) for name in part.roles if name not in points}
        others |= {name: numbers.scalar(part, name) for name, role in part.roles.items()
                   if role.unit is not None and role.suffixes is None}  # fmt: skip
    return SimpleNamespace(**points, **others)


def _force_at_rest(
    part: Connection, law: Law, numbers: Numbers, k: Expression, described: Expression
) -> Expression:
    if law.free is not None and getattr(part, law.free) is not None:
        return k * (described - numbers.scalar(part, law.free))
    if law.preload is None or getattr(part, law.preload) is None:
        return ca.SX.zeros(described.shape)
    value = getattr(part, law.preload)
    force = numbers.vector(part, law.preload) if isinstance(value, tuple) else numbers.scalar(part, law.preload)
    return -force if law.wrench else force


def _coefficients(part: Connection, field: str | None, numbers: Numbers) -> Expression:
    """A coefficient, or a matrix (d, d) of coefficients, of the deformation; 0 without a field."""
    value = 0.0 if field is None else getattr(part, field)
    if field is None or not isinstance(value, tuple):
        return ca.SX(0.0) if field is None else numbers.scalar(part, field)
    if isinstance(value[0], tuple):
        return ca.sparsify(ca.SX(np.array(value)))
    return ca.sparsify(ca.diag(numbers.vector(part, field)))


def _largest_angle(x: Expression, rotations: slice | None, moments: list[Expression]) -> Expression | None:
    """The size of the rotation among a deformation, None where no moment acts on it."""
    if rotations is None:
        return None
    acting = [value for value in moments if ca.sparsify(ca.SX(value))[rotations, :].nnz()]
    return ca.norm_2(x[rotations]) if acting else None
