"""What spin adds to the equations: -[h]x in C for each body's rotation, and in K what dampers do that turn along.

The torque of a body with the angular momentum h is d/dt (I theta' + h + theta x h) = I theta'' - [h]x theta'. A damper
between two bodies that spin together at W sees the rate of their relative displacement d in axes that turn with them,
d' - W x d, and so adds -C_d [W]x to K: rotating, or internal, damping.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.elements import BaseMotion, Bushing
from mbsvib.equations.steady_spin import check_steady, cross, own_spin, tensor, together, world
from mbsvib.equations.unresisted_motion import CANCELLED
from mbsvib.errors import ModelError

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.equations.scene import Scene
    from mbsvib.mechanism.mechanism import Mechanism


def with_spin(model: Mechanism, scene: Scene, found: dict[str, Any]) -> dict[str, Any]:
    """Return the matrices of a mechanism with what its rotors add.

    Parameters
    ----------
    model : Mechanism
        The mechanism.
    scene : Scene
        The same in numbers.
    found : dict of str to array
        Its matrices without spin.

    Returns
    -------
    dict of str to array
        The same with ``gyroscopic`` and ``circulatory``, where they are not zero, and as part of C and K.

    Raises
    ------
    ModelError
        If a spin is not steady, or a body is not symmetric about the axis on which it spins.
    """
    check_steady(model, scene)
    _check_surroundings(model)
    motion = found["body_motion"]
    m = motion.shape[-1]
    parts = {name: (np.zeros((m, m)), np.zeros((m, m))) for name in ("gyroscopic", "circulatory")}
    for i, momentum in momenta(model, scene):
        _add(parts["gyroscopic"], motion[i, 3:], cross(momentum))
    for damper in rotating_dampers(model, scene, motion):
        _add(parts["circulatory"], damper.relative, damper.matrix)
    _with_forces(model, scene, found)
    result = dict(found)
    for name, letter in (("gyroscopic", "C"), ("circulatory", "K")):
        whole, terms = parts[name]
        part = 0.5 * (whole - whole.T)
        part[np.abs(part) <= CANCELLED * terms] = 0.0
        if part.any():
            before = found.get(name)
            result[name] = part if before is None else before + part
            result[letter] = found[letter] + part
    return result


def _add(part: tuple[Array, Array], rows: Array, matrix: Array) -> None:
    """Subtract R^T A R, and add up the sizes of its terms."""
    part[0][:] -= rows.T @ matrix @ rows
    part[1][:] += np.abs(rows).T @ (np.abs(matrix) + np.abs(matrix).T) @ np.abs(rows)


@dataclass(frozen=True, slots=True)
class RotatingDamper:
    """A bushing between bodies ``first`` and ``second`` (numbers) that spin together: its ``relative`` displacement
    (6, m) at its ``point``, and the ``matrix`` C_d [W]x (6, 6) that makes it a wrench on the second body, world axes.
    """

    name: str
    first: int
    second: int
    point: Array
    relative: Array
    matrix: Array

    @property
    def wrench(self) -> Array:
        """The wrench C_d [W]x relative (6, m)."""
        return self.matrix @ self.relative


def momenta(model: Mechanism, scene: Scene) -> list[tuple[int, Array]]:
    """Return the number of each body with a rotor, and the rotor's angular momentum (3,) [kg m^2/s], world axes.

    Parameters
    ----------
    model : Mechanism
        The mechanism.
    scene : Scene
        The same in numbers.

    Returns
    -------
    list of (int, array)
        One for each rotor.
    """
    number, result = {body.name: i for i, body in enumerate(scene.bodies)}, []
    for rotor in model.rotors.values():
        i, axis = number[rotor.body], np.array(rotor.axis)
        moment = float(axis @ tensor(scene.bodies[i]) @ axis) if rotor.inertia is None else rotor.inertia
        result.append((i, moment * rotor.speed * axis))
    return result


def rotating_dampers(model: Mechanism, scene: Scene, motion: Array) -> list[RotatingDamper]:
    """Return the bushings that turn along with spinning bodies, and what their dampers do on that account.

    Parameters
    ----------
    model : Mechanism
        The mechanism.
    scene : Scene
        The same in numbers.
    motion : array, shape (bodies, 6, m)
        Motion of the bodies.

    Returns
    -------
    list of RotatingDamper
        One for each bushing with damping.
    """
    number, spins, result = {body.name: i for i, body in enumerate(scene.bodies)}, own_spin(model), []
    for spring in scene.elements:
        if isinstance(spring, Bushing) and together(model, spins, spring.first, spring.second):
            damping = world(spring, spring.damping)
            if not damping.any():
                continue
            turning = np.kron(np.eye(2), cross(spins[spring.first]))
            a, b = number[spring.first], number[spring.second]
            seen = [_at(motion[i], scene.bodies[i].position, spring.position) for i in (a, b)]
            relative = seen[1] - seen[0]
            relative[np.abs(relative) <= CANCELLED * (np.abs(seen[0]) + np.abs(seen[1]))] = 0.0
            result.append(RotatingDamper(spring.name, a, b, np.array(spring.position), relative, damping @ turning))
    return result


def _with_forces(model: Mechanism, scene: Scene, found: dict[str, Any]) -> None:
    """Take what rotating dampers do on that account to the outputs that are forces in them."""
    if not scene.port.force_outputs:
        return
    for damper in rotating_dampers(model, scene, found["body_motion"]):
        for row, owner, wrench in scene.port.force_outputs:
            spring = scene.elements[owner]
            if spring.name == damper.name and isinstance(spring, Bushing):
                axes = np.array(spring.orientation)
                found["Cq"][row] -= np.concatenate((axes @ wrench[:3], axes @ wrench[3:])) @ damper.wrench


def _at(motion: Array, center: Any, point: Any) -> Array:
    """Motion (6, m) of the point of a body."""
    arm = np.array(point) - np.array(center)
    return np.concatenate((motion[:3] - cross(arm) @ motion[3:], motion[3:]))


def _check_surroundings(model: Mechanism) -> None:
    """Refuse what would act on spinning bodies in ways that are not computed."""
    rotor = next(iter(model.rotors))
    for name, part in model.inputs.items():
        if isinstance(part, BaseMotion) and any(part.wrench[3:]):
            raise ModelError(f"base motion '{name}' turns the ground, whose speed (not only its acceleration) acts on "
                             f"rotor '{rotor}'; this is not supported: let the ground only shift, or turn a body by "
                             f"a torque.", element=name, field="direction")  # fmt: skip
