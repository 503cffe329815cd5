"""Running machines as quantities: shaking force, shaking moment and drive torques over a cycle, for balancing.

Points of mass that are fixed to bodies: equimomental systems and counterweights, whose masses are variables.

A point of mass is a body without inertia on a fixed joint. Whatever masses such points have, as long as none is
negative, there is a body like that: bounds on masses are all that a search needs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.api.model import Model
from mbsvib.api.running import Cycle, compiled_for, cycle_of
from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array
from mbsvib.common.display import Displayed
from mbsvib.common.expected import a_model, names, one_of
from mbsvib.common.selection import Names
from mbsvib.elements import Body
from mbsvib.errors import ModelError
from mbsvib.studies.evaluation import DesignPoint, Dual
from mbsvib.studies.quantities import Leaf, Quantity, quantity

if TYPE_CHECKING:
    from mbsvib.cycles.sensitivities import CycleSensitivities


UNITS = {"force": "N", "moment": "N m", "torque": "N m"}


class CycleMeasures(Displayed):
    """A cycle that is asked for at every point of a search; its quantities share one evaluation, which it keeps.

    ``mean_square`` and ``rms`` are quantities; ``weighted`` is their weighted sum, without unit.
    """

    def __init__(self, kwargs: Mapping[str, Any]) -> None:
        self._kwargs = dict(kwargs)
        self._last: _Evaluated | None = None

    def cycle(self, model: Model) -> Cycle:
        """Return the cycle of a model.

        Parameters
        ----------
        model : Model
            The machine.

        Returns
        -------
        Cycle
            ``model.cycle`` with the arguments given to ``studies.cycle``.

        Raises
        ------
        ModelError, SingularPoseError
            As ``Model.cycle`` does.
        """
        return model.cycle(**self._kwargs)

    def mean_square(self, quantity: str, drive: str | None = None) -> Quantity:
        """Return the mean square of a quantity, which has a derivative where it is zero, too.

        Parameters
        ----------
        quantity : str
            "force" [N^2], "moment" or "torque" [(N m)^2].
        drive : str, optional
            Which drive's torque; default: the only one.

        Returns
        -------
        Quantity
            1/n sum of |x_i|^2 over the samples.

        Raises
        ------
        ModelError
            If there is no such quantity.
        """
        one_of(quantity, UNITS, "cycle", "quantity", ModelError)
        unit = UNITS[quantity] if " " not in UNITS[quantity] else f"({UNITS[quantity]})"
        return Leaf(f"mean square {quantity} [{unit}^2]", partial(self._square, quantity=quantity, drive=drive), False)

    def rms(self, quantity: str, drive: str | None = None) -> Quantity:
        """Return the root mean square of a quantity, for constraints; it has no derivative where it is zero.

        Parameters
        ----------
        quantity : str
            "force" [N], "moment" or "torque" [N m].
        drive : str, optional
            Which drive's torque; default: the only one.

        Returns
        -------
        Quantity
            sqrt(1/n sum of |x_i|^2).

        Raises
        ------
        ModelError
            If there is no such quantity.
        """
        root = self.mean_square(quantity, drive) ** 0.5
        root.label = f"rms {quantity} [{UNITS[quantity]}]"
        return root

    def weighted(self, model: Model, weights: Mapping[str, float]) -> Quantity:
        """Return a weighted sum of mean squares, each divided by its value of a model.

        sum of w_x <x^2> / <x^2>_model

        Parameters
        ----------
        model : Model
            The machine that is compared with; mean squares that are zero there are not divided.
        weights : mapping of str to float
            Weights w of "force", "moment" and "torque", not negative.

        Returns
        -------
        Quantity
            The sum.

        Raises
        ------
        ModelError
            If there is no such quantity, or no positive weight.
        """
        check.mapping("cycle", "weights", weights, "weights by name, {'force': 1.0, 'torque': 0.5}")
        factors = {name: check.number(value, "cycle", f"weights[{name!r}]") for name, value in weights.items()}
        for name in factors:
            one_of(name, UNITS, "cycle", "quantity", ModelError)
        if min(factors.values()) < 0.0 or not any(factors.values()):
            raise check.refuse("cycle", "weights", weights, "weights that are not negative, and one that is positive")
        cycle = self.cycle(model)
        total: Quantity = quantity(0.0)
        for name, weight in factors.items():
            if weight:
                for drive in cycle.drives if name == "torque" else (None,):
                    total = total + (weight / (cycle.rms(name, drive) ** 2 or 1.0)) * self.mean_square(name, drive)
        total.label = "weighted mean square of " + ", ".join(f"{name} ({weight:g})" for name, weight in factors.items())
        return total

    def __repr__(self) -> str:
        return f"CycleMeasures({', '.join(name for name, value in self._kwargs.items() if value is not None)})"

    def _square(self, point: DesignPoint, quantity: str, drive: str | None) -> Dual:
        last = self._last
        if last is None or not last.belongs_to(point):
            last = self._last = _evaluated(self._kwargs, point, last)
        slope = np.zeros((1, len(point.rates)))
        if last.slopes is not None:
            by_parameter = dict(zip(last.slopes.parameters, last.slopes.square(quantity, drive), strict=True))
            slope[0] = [sum(rate * by_parameter[name] for name, rate in rates.items())
                        for rates in point.rates.values()]  # fmt: skip
        return point.dual(np.array([last.cycle.rms(quantity, drive) ** 2]), slope)


@dataclass(frozen=True)
class _Evaluated:
    """The cycle at a design point, with its derivatives if variables are asked for."""

    point: DesignPoint
    cycle: Cycle
    slopes: CycleSensitivities | None

    def belongs_to(self, point: DesignPoint) -> bool:
        """Whether it is that of the same point."""
        return self.point.rates is point.rates and self.point.values is point.values


def _evaluated(kwargs: Mapping[str, Any], point: DesignPoint, last: _Evaluated | None) -> _Evaluated:
    """The cycle at a point; equations compiled at the last one serve again where only their symbols differ."""
    for variable, rates in point.rates.items():
        if not rates:
            raise ModelError(f"cycle: variable '{variable}' displaces joints, to which cycles have no derivatives; "
                             f"leave it out, or search in a model moved there.", element=variable)  # fmt: skip
    names = tuple(dict.fromkeys(name for rates in point.rates.values() for name in rates))
    if not names:
        return _Evaluated(point, point.model.cycle(**kwargs), None)
    model, machine = point.model, None
    if last is not None and set(names) == set(last.cycle.machine.statement.names):
        before, after = last.point.model, model.parameters
        if set(names) <= set(after) and set(names) <= set(before.parameters):
            like = before.with_values({name: after[name] for name in names})
            same = like.gravity == model.gravity and like.groups() == model.groups()
            machine = last.cycle.machine if same else None
    cycle = cycle_of(model, kwargs, compiled_for(model, kwargs, names) if machine is None else machine)
    return _Evaluated(point, cycle, cycle.sensitivities(names))


def cycle(
    drive: str | None = None, angles: ArrayLike | None = None, *, speed: float | None = None,
    motion: Mapping[str, Any] | None = None, about: ArrayLike | None = None,
) -> CycleMeasures:  # fmt: skip
    """Return a cycle whose shaking force, shaking moment and drive torques are quantities for ``optimize``.

    Parameters
    ----------
    drive : str, optional
        Driven joint coordinate, ``"crank.rz"``; this and the others as for ``Model.cycle``.
    angles : array-like, shape (n,), optional
        Its values at the samples [rad, m].
    speed : float, optional
        Its rate [rad/s, m/s].
    motion : mapping of str to (q, qd, qdd), optional
        Instead of these: values, rates and accelerations of each driven coordinate.
    about : array-like, shape (3,), optional
        Point of the shaking moment [m]; default: the joint of the first drive.

    Returns
    -------
    CycleMeasures
        Its quantities are ``rms``, ``mean_square`` and ``weighted``.

    Source: H. Chaudhary, S. K. Saha, "Dynamics and Balancing of Multibody Systems" (2009), chapters 6 and 7.
    """
    return CycleMeasures({"drive": drive, "angles": angles, "speed": speed, "motion": motion, "about": about})


M = TypeVar("M", bound="Model")

NO_INERTIA = (0.0, 0.0, 0.0)
# Corners of a cube whose products of coordinates cancel, and ends of its axes with the centre.
CORNERS = ((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1))
# Second moments below this share of the largest are rounding of a body that is thin.
THIN = 1e-12


def equimomental(model: M, bodies: Names = None, *, points: int = 4, reach: float = 2.0) -> M:
    """Return the same mechanism with points of mass in place of the mass and inertia of bodies.

    With E = tr(J) / 2 - J, whose eigenvalues a_k are the second moments of mass along the principal axes: four points
    of m / 4 at (+-1, +-1, +-1) sqrt(a_k / m) with an even number of minus signs; or seven, two at +-d on every axis of
    a_k / (2 d^2) each, d^2 = reach tr(E) / m, and what is left of m at the centre. Mass, centre of mass and inertia are
    those of the body.

    Parameters
    ----------
    model : Model
        The mechanism.
    bodies : str or sequence of str, optional
        Names of the bodies; default: all that have mass.
    points : int
        4 or 7.
    reach : float
        Of seven points: at least 1, where no mass is left at the centre.

    Returns
    -------
    Model
        It has bodies ``BODY.1``, ``BODY.2``, ... on fixed joints ``BODY.1.fixed``, ...; the bodies themselves are
        without mass.

    Raises
    ------
    ModelError
        If there is no such body, or the number of points or the reach are refused.

    Source: H. Chaudhary, S. K. Saha, "Dynamics and Balancing of Multibody Systems" (2009), chapter 5; E. J. Routh,
    "Dynamics of a system of rigid bodies" (1905).
    """
    a_model(model, "equimomental")
    if points not in (4, 7):
        raise check.refuse("equimomental", "points", points, "4 or 7")
    wide = check.number(reach, "equimomental", "reach", "a number of at least 1")
    if wide < 1.0:
        raise check.refuse("equimomental", "reach", reach, "a number of at least 1")
    selected = [name for name, body in model.bodies.items() if body.mass] if bodies is None else \
        names(bodies, "equimomental", "bodies", ModelError)  # fmt: skip
    result = model.with_parts()
    for name in selected:
        body = _body(model, name, "equimomental")
        result = result.with_parts(bodies=dict(result.bodies) | {name: replace(body, mass=0.0, inertia=(0.0,) * 6)})
        for i, (mass, point) in enumerate(_points(body, points, wide), 1):
            _add_point(result, f"{name}.{i}", name, mass, point)
    return result


def with_counterweights(model: M, weights: Mapping[str, Any]) -> M:
    """Return the same mechanism with points of mass that balance it.

    Parameters
    ----------
    model : Model
        The mechanism.
    weights : mapping of str to (mass, position)
        By body: mass [kg], 0 for one that a search is to find, and where it is fixed to the body (x, y, z) [m], world
        axes, in the pose as described.

    Returns
    -------
    Model
        It has bodies ``BODY.counterweight`` on fixed joints ``BODY.counterweight.fixed``.

    Raises
    ------
    ModelError
        If there is no such body, or a value is refused.
    """
    a_model(model, "with_counterweights")
    check.mapping("with_counterweights", "weights", weights, "{'crank': (mass, (x, y, z)), ...}")
    result = model.with_parts()
    for name, pair in weights.items():
        _body(model, name, "with_counterweights")
        if not hasattr(pair, "__len__") or len(pair) != 2:
            raise check.refuse("with_counterweights", f"weights[{name!r}]", pair, "a mass [kg] and a point (x, y, z)")
        _add_point(result, f"{name}.counterweight", name, pair[0], pair[1])
    return result


def _body(model: Model, name: Any, who: str) -> Body:
    check.known(name, model.bodies, f"{who}: '{name}' is not a body of model '{model.name}'", "bodies")
    return model.bodies[name]


def _add_point(model: Model, name: str, body: str, mass: Any, point: Any) -> None:
    model.add_body(name, mass, NO_INERTIA, point)
    model.add_joint(f"{name}.fixed", "fixed", body, name)


def _points(body: Body, number: int, reach: float) -> list[tuple[float, Array]]:
    """Masses and places of an equimomental system, world axes."""
    if not body.mass:
        raise ModelError(f"equimomental: body '{body.name}' has no mass, which no points can stand for; leave it out.",
                         element=body.name, field="bodies")  # fmt: skip
    xx, yy, zz, xy, xz, yz = body.inertia
    tensor = np.array(((xx, xy, xz), (xy, yy, yz), (xz, yz, zz)))
    moments, axes = np.linalg.eigh(0.5 * np.trace(tensor) * np.eye(3) - tensor)
    moments = np.where(moments > THIN * moments.max(), moments, 0.0)
    axes = np.array(body.orientation) @ axes
    centre = np.array(body.position)
    if number == 4:
        arms = np.sqrt(moments / body.mass)
        return [(0.25 * body.mass, centre + axes @ (np.array(corner) * arms)) for corner in CORNERS]
    square = reach * moments.sum() / body.mass
    result = [(body.mass * (1.0 - 1.0 / reach) if square else body.mass, centre)]
    for moment, axis in zip(moments, axes.T, strict=True):
        share = 0.5 * moment / square if square else 0.0
        result += [(share, centre + sign * np.sqrt(square) * axis) for sign in (1.0, -1.0)]
    return result
