"""Wheels on the ground that couplers turn: what moves with a sum of joint coordinates, and nothing else.

A fixed tendon's length is L = sum of c_i q_i. A wheel without mass of radius R turns by L / R; a spring on it is one of
the tendon, its inertia I adds I L'^2 / 2 R^2 to the energy. A second wheel takes half of the inertia and turns the
other way, so that both push the ground with no moment and feel no turning of it: armature is inertia of a joint alone.
"""

from __future__ import annotations

from collections.abc import Mapping

from numpy.typing import ArrayLike

from mbsvib.api.model import Model

# Of the largest coefficient: the wheel turns by less than the joints, whose coordinates remain those of the model.
RADIUS = 10.0


def add_wheel(
    model: Model, name: str, terms: Mapping[str, float], inertia: float, at: ArrayLike, axes: ArrayLike, size: float
) -> tuple[str, float]:
    """Add a wheel on the ground that turns with a sum of coordinates; return its body and radius R.

    It turns by the sum over R about its axis. ``terms``: coefficients of joint coordinates, "JOINT.rz". ``inertia``: of
    the sum [kg m^2, kg]. ``at``, ``axes``: where it is drawn, z its axis. ``size`` of the model [m]. Of joints that
    turn by a rotation vector the sum is one of velocities in each pose.
    """
    radius = RADIUS * max(abs(value) * _unit(coordinate, size) for coordinate, value in terms.items())
    moment = inertia * radius**2
    rates = any(model.joints[coordinate.rpartition(".")[0]].turns_by_vector for coordinate in terms)
    wheels = [(fresh(model, name, "wheel"), 1.0)]
    if inertia:
        wheels.append((fresh(model, f"{name}.counter", "wheel"), -1.0))
    for body, sign in wheels:
        share = moment / len(wheels)
        model.add_body(body, 0.0, (0.5 * share, 0.5 * share, share), at, axes)
        axis = fresh(model, f"{body}.axis", "joint")
        model.add_joint(axis, "revolute", "ground", body, at, axes)
        ratios = {coordinate: -sign * value / radius for coordinate, value in terms.items()}
        model.add_coupler(fresh(model, f"{body}.turns", "coupler"), {f"{axis}.rz": 1.0, **ratios}, rates=rates)
    return wheels[0][0], radius


def fresh(model: Model, name: str, more: str) -> str:
    """Return an unused name: the name itself, or with a suffix."""
    groups = (model.bodies, model.joints, model.springs, model.couplers, model.loads)
    while name == "ground" or any(name in group for group in groups):
        name = f"{name}.{more}"
    return name


def _unit(coordinate: str, size: float) -> float:
    """Scale of a coordinate: 1 for rotations, the size of the model [m] for translations."""
    return 1.0 if coordinate.rpartition(".")[2].startswith("r") else size
