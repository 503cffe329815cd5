"""Points of mass that are fixed to bodies: equimomental systems and counterweights, whose masses are variables.

A point of mass is a body without inertia on a fixed joint. Whatever masses such points have, as long as none is
negative, there is a body like that: bounds on masses are all that a search needs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.expected import a_model, names
from mbsvib.errors import ModelError, nearest

if TYPE_CHECKING:

    from mbsvib.api.model import Model
    from mbsvib.common.arrays import Array
    from mbsvib.common.selection import Names
    from mbsvib.elements import Body

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
    if not isinstance(weights, Mapping) or not weights:
        raise check.refuse("with_counterweights", "weights", weights, "{'crank': (mass, (x, y, z)), ...}")
    result = model.with_parts()
    for name, pair in weights.items():
        _body(model, name, "with_counterweights")
        if not hasattr(pair, "__len__") or len(pair) != 2:
            raise check.refuse("with_counterweights", f"weights[{name!r}]", pair, "a mass [kg] and a point (x, y, z)")
        _add_point(result, f"{name}.counterweight", name, pair[0], pair[1])
    return result


def _body(model: Model, name: Any, who: str) -> Body:
    if name not in model.bodies:
        raise ModelError(f"{who}: '{name}' is not a body of model '{model.name}'.{nearest(str(name), model.bodies)}",
                         element=str(name), field="bodies")  # fmt: skip
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
