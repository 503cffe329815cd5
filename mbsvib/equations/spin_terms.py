"""Spin: gyroscopic terms -[h]x in C for rotations of bodies, and circulatory terms in K of rotating dampers.

The torque of a body with the angular momentum h is d/dt (I theta' + h + theta x h) = I theta'' - [h]x theta'. A damper
between two bodies that spin together at W acts on the rate of their relative displacement d in axes that rotate with
them, d' - W x d, and so adds -C_d [W]x to K: rotating, or internal, damping.

Source: Genta, Dynamics of Rotating Systems (2005), for gyroscopic matrices and rotating damping.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.elements.contribution import Contribution, Weights, rotation_rows
from mbsvib.elements.rows import Rows
from mbsvib.equations.inertia import inertia_tensor
from mbsvib.equations.statement import antisymmetric, minimal_rows
from mbsvib.equations.steady_spin import check_steady, point_of, rows_at_point, spin_together, spin_velocities
from mbsvib.errors import ModelError
from mbsvib.kinematics.relative_motion import Twists, relative_motion
from mbsvib.linalg.rotations import skew

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.elements import Body
    from mbsvib.elements.connection import Connection
    from mbsvib.equations.draft import Draft
    from mbsvib.equations.scene import Scene
    from mbsvib.kinematics.loops import Reduction
    from mbsvib.mechanism.mechanism import Mechanism


def spin_contribution(
    model: Mechanism, bodies: Sequence[Body], elements: Sequence[Connection]
) -> Contribution:
    """Return the contribution of rotors to C and of rotating dampers to K.

    ``bodies`` and ``elements`` are those of the mechanism in the order of their numbers.
    """
    check_steady(model, bodies, elements)
    _check_base_motion(model)
    ground = len(bodies)
    return Contribution.join([
        *(Contribution.of(rotation_rows(np.full(3, i), np.eye(3), ground), gyroscopic=_antisymmetric(skew(momentum)))
          for i, momentum in momenta(model, bodies)),
        *(Contribution.of(damper.rows, circulatory=_antisymmetric(damper.matrix))
          for damper in rotating_dampers(model, bodies, elements)),
    ])  # fmt: skip


def _antisymmetric(matrix: Array) -> Weights:
    """Weights of minus the antisymmetric part of a form R^T A R."""
    first, second = np.triu_indices(len(matrix), 1)
    value = 0.5 * (matrix[second, first] - matrix[first, second])
    used = np.flatnonzero(value)
    return Weights(first[used], second[used], value[used], np.zeros(len(used), dtype=np.intp))


def with_spin(draft: Draft) -> Draft:
    """Return equations of motion with the terms of rotors."""
    model, scene, reduction, terms = draft.model, draft.scene, draft.reduction, draft.terms
    part = spin_contribution(model, scene.bodies, scene.elements)
    rows = minimal_rows(part, scene.coordinates, reduction, terms.body_motion)
    terms = replace(terms, Cq=_with_forces(model, scene, reduction, terms.Cq)).with_antisymmetric(
        antisymmetric(part.gyroscopic, rows), antisymmetric(part.circulatory, rows))  # fmt: skip
    return replace(draft, terms=terms)


@dataclass(frozen=True, slots=True)
class RotatingDamper:
    """An element at ``point`` between bodies with the numbers ``first`` and ``second`` that spin together.

    ``matrix`` C_d [W]x (6, 6), world axes, times its relative displacement is the wrench on the second body. ``axes``
    (6, 6) times a wrench in the axes of the element is the same wrench in world axes, along the rows of the element.
    """

    name: str
    first: int
    second: int
    point: Array
    matrix: Array
    axes: Array

    @property
    def rows(self) -> Rows:
        """Relative displacements along and about x, y, z."""
        six = np.eye(6)
        return Rows(np.full(6, self.first), np.full(6, self.second), np.repeat(self.point[:, None], 6, axis=1),
                    six[:3], six[3:])  # fmt: skip

    def wrench(self, coordinates: Twists, reduction: Reduction) -> Array:
        """Return the wrench C_d [W]x d (6, m) in minimal coordinates."""
        relative = reduction.apply_exactly(relative_motion(coordinates, self.rows).dense(0, 6))
        return np.asarray(self.matrix @ relative)


def momenta(model: Mechanism, bodies: Sequence[Body]) -> list[tuple[int, Array]]:
    """Return the number of each body with a rotor, and the rotor's angular momentum (3,) [kg m^2/s], world axes."""
    number, result = {body.name: i for i, body in enumerate(bodies)}, []
    for rotor in model.rotors.values():
        i, axis = number[rotor.body], np.array(rotor.axis)
        moment = float(axis @ inertia_tensor(bodies[i]) @ axis) if rotor.inertia is None else rotor.inertia
        result.append((i, moment * rotor.speed * axis))
    return result


def rotating_dampers(
    model: Mechanism, bodies: Sequence[Body], elements: Sequence[Connection]
) -> list[RotatingDamper]:
    """Return the elements between bodies that spin together; those along lines are on the axis and do not rotate.

    ``bodies`` and ``elements`` are those of the mechanism in the order of their numbers.
    """
    number, spins, result = {body.name: i for i, body in enumerate(bodies)}, spin_velocities(model), []
    for spring in elements:
        if not spring.acts_along_line and spin_together(model, spins, spring.first, spring.second):
            wrenches, rows = rows_at_point(spring)
            if not rows.damping.any():
                continue
            spin = np.kron(np.eye(2), skew(spins[spring.first]))
            ends, damping = (number[spring.first], number[spring.second]), (wrenches * rows.damping) @ wrenches.T
            result.append(RotatingDamper(spring.name, *ends, np.array(point_of(spring)), damping @ spin,
                                         wrenches @ rows.unit))  # fmt: skip
    return result


def _with_forces(model: Mechanism, scene: Scene, reduction: Reduction, outputs: Array) -> Array:
    """Cq with the circulatory forces of rotating dampers in outputs that are forces in these."""
    result = outputs.copy() if scene.port.force_outputs else outputs
    for damper in rotating_dampers(model, scene.bodies, scene.elements) if scene.port.force_outputs else ():
        for row, owner, wrench in scene.port.force_outputs:
            if scene.elements[owner].name == damper.name:
                result[row] -= (damper.axes @ wrench) @ damper.wrench(scene.coordinates, reduction)
    return result


def _check_base_motion(model: Mechanism) -> None:
    """Refuse rotation of the ground, whose gyroscopic effect on rotors is not computed."""
    rotor = next(iter(model.rotors))
    for name, part in model.inputs.items():
        if part.moves_ground and any(part.wrench[3:]):
            raise ModelError(f"base motion '{name}' turns the ground, whose speed (not only its acceleration) acts on "
                             f"rotor '{rotor}'; this is not supported: let the ground only shift, or turn a body by "
                             f"a torque.", element=name, field="direction")  # fmt: skip
