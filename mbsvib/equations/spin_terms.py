"""Antisymmetric terms: gyroscopic ones in C, and circulatory ones in K, of rotors, rotating dampers and cross-coupling.

The torque of a body with the angular momentum h is d/dt (I theta' + h + theta x h) = I theta'' - [h]x theta'. A damper
between two bodies that spin together at W acts on the rate of their relative displacement d in axes that rotate with
them, d' - W x d, and so adds -C_d [W]x to K: rotating, or internal, damping. Elements with cross-coupling, as journal
bearings and seals, add the antisymmetric parts of their own matrices.

Source: Genta, Dynamics of Rotating Systems (2005), for gyroscopic matrices, rotating damping and cross-coupling.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mbsvib.common.arguments import IDENTITY
from mbsvib.common.arrays import Array
from mbsvib.elements import Body
from mbsvib.elements.connection import Connection
from mbsvib.elements.rows import Rows
from mbsvib.elements.shared_rows import Expansion
from mbsvib.equations.inertia import inertia_tensor
from mbsvib.equations.matrices import Terms
from mbsvib.equations.scene import Scene
from mbsvib.equations.steady_spin import (
    NONE,
    Fields,
    check_steady,
    point_of,
    rows_at_point,
    spin_together,
    spin_velocities,
)
from mbsvib.errors import ModelError
from mbsvib.kinematics.loops import Reduction
from mbsvib.kinematics.relative_motion import Twists, relative_motion
from mbsvib.kinematics.shared_rows import stack
from mbsvib.linalg.products import widened
from mbsvib.linalg.rank import ZERO_SUM
from mbsvib.linalg.rotations import skew
from mbsvib.mechanism.mechanism import Mechanism

Spin = tuple[Sequence[tuple[int, Array]], Sequence["CrossCoupling"]]


def check_spin(model: Mechanism, bodies: Sequence[Body], elements: Sequence[Connection]) -> None:
    """Refuse spins that are not steady, and rotation of the ground beside them."""
    if model.rotors:
        check_steady(model, bodies, elements)
        _check_base_motion(model)


def with_antisymmetric_terms(
    scene: Scene, reduction: Reduction, terms: Terms, momenta: Sequence[tuple[int, Array]],
    couplings: Sequence[CrossCoupling], expansion: Expansion | None = None,
) -> Terms:  # fmt: skip
    """Return terms with G and N of angular momenta (..., 3) of bodies, and of cross-coupled elements.

    G = sum of -R^T [h]x R over rotations R of bodies, C_a of elements and of an ``expansion``;
    N = K_a of elements (antisymmetric parts)
    """
    gyroscopic, circulatory = _AntisymmetricSum(), _AntisymmetricSum()
    for body, momentum in momenta:
        gyroscopic.add(-skew(momentum), terms.body_motion[..., body, 3:, :])
    if expansion is not None and expansion.gyroscopic:
        shared = stack(expansion.gyroscopic, scene.topology.body_numbers)
        base = relative_motion(scene.coordinates, shared.rows)
        twelve = shared.of(reduction.apply_exactly(base.dense(0, len(shared.rows.first))))
        for item, ends in zip(expansion.gyroscopic, np.split(twelve, len(expansion.gyroscopic), axis=-2), strict=True):
            assert item.gyroscopic is not None
            gyroscopic.add(item.gyroscopic, ends)
    force_of: dict[str, Array] = {}
    for part in couplings:
        relative = part.relative(scene.coordinates, reduction)
        gyroscopic.add(part.damping, relative)
        circulatory.add(part.stiffness, relative)
        both = np.broadcast_arrays(part.stiffness @ relative, part.damping @ relative)
        force_of[part.name] = part.axes.T @ -np.stack(both, axis=-3)
    changed = [(row, wrench, force_of[scene.elements[owner].name]) for row, owner, wrench in scene.port.force_outputs
               if scene.elements[owner].name in force_of]  # fmt: skip
    if changed:
        rates = np.stack(np.broadcast_arrays(terms.Cq, terms.Cv), axis=-3)
        outputs = widened(rates, *[forces for *_, forces in changed])
        for row, wrench, forces in changed:
            outputs[..., row, :] -= wrench @ forces
        terms = replace(terms, Cq=outputs[..., 0, :, :], Cv=outputs[..., 1, :, :])
    return terms.with_antisymmetric(gyroscopic.total(), circulatory.total())


class _AntisymmetricSum:
    """The antisymmetric parts of forms R^T A R in sum, with zeros for rounding errors."""

    def __init__(self) -> None:
        self._sum: Array | float = 0.0
        self._size: Array | float = 0.0

    def add(self, matrix: Array, rows: Array) -> None:
        """Add the form of a matrix (..., k, k) and rows (..., k, m)."""
        part = 0.5 * (matrix - matrix.swapaxes(-1, -2))
        if part.any():
            self._sum = self._sum + rows.swapaxes(-1, -2) @ part @ rows
            self._size = self._size + np.abs(rows).swapaxes(-1, -2) @ np.abs(part) @ np.abs(rows)

    def total(self) -> Array | None:
        """The sum (..., m, m), None if it is zero."""
        if isinstance(self._sum, float):
            return None
        result = np.asarray(0.5 * (self._sum - self._sum.swapaxes(-1, -2)))
        result.real[np.abs(result) <= ZERO_SUM * self._size] = 0.0
        return result if result.any() else None


@dataclass(frozen=True, slots=True)
class CrossCoupling:
    """Antisymmetric matrices of an element at ``point`` between bodies with the numbers ``first`` and ``second``.

    ``stiffness`` and ``damping`` (6, 6), world axes, times its relative displacement and velocity are minus the wrench
    on the second body. ``axes`` (6, 6) times a wrench in the axes of the element is the same wrench in world axes.
    """

    name: str
    first: int
    second: int
    point: Array
    stiffness: Array
    damping: Array
    axes: Array

    @property
    def rows(self) -> Rows:
        """Relative displacements along and about x, y, z."""
        six = np.eye(6)
        return Rows(np.full(6, self.first), np.full(6, self.second), np.repeat(self.point[:, None], 6, axis=1),
                    six[:3], six[3:])  # fmt: skip

    def relative(self, coordinates: Twists, reduction: Reduction) -> Array:
        """Return the relative displacements (..., 6, m) of its bodies at its point."""
        return reduction.apply_exactly(relative_motion(coordinates, self.rows).dense(0, 6))

    def wrenches(self, coordinates: Twists, reduction: Reduction) -> Array:
        """Return the wrenches (2, 6, m) on the second body per unit of the minimal coordinates, and of their rates."""
        return -np.stack((self.stiffness, self.damping)) @ self.relative(coordinates, reduction)


def momenta(model: Mechanism, bodies: Sequence[Body], fields: Fields = NONE) -> list[tuple[int, Array]]:
    """Return the number of each body with a rotor, and the rotor's angular momentum (..., 3) [kg m^2/s], world axes.

    ``fields`` has the values of variants by part and name, where they differ from those of the model.
    """
    number, result = {body.name: i for i, body in enumerate(bodies)}, []
    for rotor in model.rotors.values():
        i, own = number[rotor.body], fields.get(rotor.name, NONE)
        axis, moment = np.array(own.get("axis", rotor.axis)).T, own.get("inertia", rotor.inertia)
        if moment is None:
            moment = float(axis @ inertia_tensor(bodies[i]) @ axis)
        result.append((i, np.asarray(moment * own.get("speed", rotor.speed))[..., None] * axis))
    return result


def cross_couplings(
    model: Mechanism, bodies: Sequence[Body], elements: Sequence[Connection], fields: Fields = NONE
) -> list[CrossCoupling]:
    """Return the elements with antisymmetric matrices: those with cross-coupling, and dampers between bodies that spin
    together. Dampers along lines are on the axis and do not rotate.

    ``bodies`` and ``elements`` are those of the mechanism in the order of their numbers; ``fields`` as of ``momenta``.
    """
    number, spins, result = {body.name: i for i, body in enumerate(bodies)}, spin_velocities(model, fields), []
    ground = len(bodies)
    for part in elements:
        stiffness, damping = part.cross_coupling or (np.zeros((6, 6)), np.zeros((6, 6)))
        if spins and not part.acts_along_line and spin_together(model, spins, part.first, part.second):
            wrenches, rows = rows_at_point(part)
            rotation = np.kron(np.eye(2), skew(spins[part.first]))
            stiffness = stiffness - (wrenches * rows.damping) @ wrenches.T @ rotation
        if stiffness.any() or damping.any():
            ends = (number.get(part.first, ground), number.get(part.second, ground))
            axes = np.kron(np.eye(2), np.array(getattr(part, "orientation", IDENTITY)))
            result.append(CrossCoupling(part.name, *ends, np.array(point_of(part)), stiffness, damping, axes))
    return result


def _check_base_motion(model: Mechanism) -> None:
    """Refuse rotation of the ground, whose gyroscopic effect on rotors is not computed."""
    rotor = next(iter(model.rotors))
    for name, part in model.inputs.items():
        if part.moves_ground and any(part.wrench[3:]):
            raise ModelError(f"base motion '{name}' turns the ground, whose speed (not only its acceleration) acts on "
                             f"rotor '{rotor}'; this is not supported: let the ground only shift, or turn a body by "
                             f"a torque.", element=name, field="direction")  # fmt: skip
