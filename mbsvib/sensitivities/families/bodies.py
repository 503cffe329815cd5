"""Bodies, what spins in them, and the loads on them.

Mass and inertia act on the motions of bodies; where a body moves, its weight and inertia act elsewhere. The angular
momentum h of a rotor adds x^T C y = h . (x x y), antisymmetric, of rotations of its body.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mbsvib.common.arrays import Array, Index
from mbsvib.elements import Body
from mbsvib.elements.load import Load
from mbsvib.elements.rotor import Rotor
from mbsvib.sensitivities.families.pose_changes import PoseRates, RowTerms
from mbsvib.sensitivities.families.rules import LoadRules, PartRules
from mbsvib.sensitivities.forces import Forces
from mbsvib.sensitivities.local_forms import (
    NONE,
    SHIFTED,
    UNIT,
    Local,
    LocalForm,
    Shift,
    displaced,
    entries,
    single_entries,
    six_axes,
    square,
)
from mbsvib.sensitivities.network import Network

_MASS = entries(np.diag((1.0, 1.0, 1.0, 0.0, 0.0, 0.0))[None, None])
_TURNED = entries(displaced(NONE, UNIT) * (np.arange(6) > 2)[:, None])
_CARRIED = entries(displaced(-UNIT, NONE))
_TENSOR = single_entries([(3, 3), (4, 4), (5, 5), (3, 4), (3, 5), (4, 5)])


def _body_forms(network: Network, parts: Sequence[Body], number: Index, field: str) -> list[LocalForm | Shift]:
    """A body that floats has the coordinates of its centre of mass, so that all that hangs on it follows."""
    body, wrench = Local("body", number), Local("body_wrench", number)
    if field == "mass":
        return [square("body", number, "square", _MASS)]
    if field == "inertia":
        axes = six_axes(np.array([part.orientation for part in parts]))
        return [square("body", number, "square", _TENSOR, axes)]
    if field == "orientation":
        return [LocalForm(wrench, body, *_TURNED)]
    floating = [network.floating_number[k] for k in number.tolist() if k in network.floating_number]
    return [Shift(number, UNIT), LocalForm(wrench, body, *SHIFTED), *(
        [LocalForm(Local("support", np.array(floating)), body, *_CARRIED)] if floating else [])]


def _add_weight(terms: RowTerms, _: Network, forces: Forces, body: Body, k: int) -> None:
    terms.put((body.name, "mass", ()), terms.at.wrench_of(k), forces.gravity)
    for i in range(3):
        terms.put(("gravity", "", (i,)), terms.at.wrench_of(k) + i, (body.mass,))


BODY = PartRules(
    "body", _body_forms, floats=True,
    alters_spin=lambda spin, body, field: body.name in spin.bodies and field != "mass",
    loaded=LoadRules(add_force_terms=_add_weight),
)


# The field of the axis, which is no parameter.
AXIS = "axis"


def _rotor_entry(network: Network, rotor: Rotor, field: str, _: tuple[int, ...]) -> list[LocalForm]:
    body, per_speed = _momentum(network, rotor)
    change = per_speed if field == "speed" else per_speed * (rotor.speed / (rotor.inertia or 1.0))
    return _momentum_forms(body, change[None])


def _rotor_axis(network: Network, rotor: Rotor) -> list[list[LocalForm]]:
    """Its axis goes with its body."""
    body, per_speed = _momentum(network, rotor)
    return [_momentum_forms(body, np.cross(np.eye(3), rotor.speed * per_speed))]


def _momentum(network: Network, rotor: Rotor) -> tuple[int, Array]:
    """The number of its body, and its momentum per unit of speed."""
    assert network.matrices.spin is not None
    return network.matrices.spin.rotor[rotor.name]


def _momentum_forms(body: int, changes: Array) -> list[LocalForm]:
    """The forms of changes (entries, 3) of the angular momentum of a body."""
    number, matrix = np.array([body]), np.zeros((1, len(changes), 6, 6))
    matrix[:, :, [4, 5, 3], [5, 3, 4]] = changes
    return [LocalForm(Local("body", number, "spin"), Local("body", number), *entries(matrix))]


def _follow(rates: PoseRates, rotor: Rotor, _: int) -> None:
    if rates.network.matrices.spin is not None:
        rates.put(rotor.name, AXIS, rates.motion[_momentum(rates.network, rotor)[0], 3:])


ROTOR = PartRules(
    "rotor", single=_rotor_entry,
    alters_spin=lambda spin, rotor, _: rotor.inertia is None and spin.coupling is not None,
    # bearings may leave the axis of a body that spins itself
    loaded=LoadRules(lambda rotor, *_: rotor.inertia is None, follow=_follow, internal=(AXIS, 3),
                     internal_forms=_rotor_axis),
)  # fmt: skip


def _add_load(terms: RowTerms, _: Network, __: Forces, load: Load, k: int) -> None:
    terms.along(load.name, "force", terms.at.wrench_of(k))
    terms.along(load.name, "torque", terms.at.wrench_of(k) + 3)
    if load.position is None:
        terms.along(load.body, "position", terms.at.point_of(k))


LOAD = PartRules("load", loaded=LoadRules(add_force_terms=_add_load))
GRAVITY = PartRules("gravity")
