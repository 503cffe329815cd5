"""Joints, and the couplers of their coordinates.

Where a joint is moved or turned, the wrench that it transmits works on what its bodies do against each other. Couplers
tie coordinates by sum of c q = 0 with a force mu: where a coefficient changes by dc, dependent coordinates follow, and
x^T T y changes by -dc (mu_x q_y + q_x mu_y).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from mbsvib.common.arrays import Index
from mbsvib.elements import Joint
from mbsvib.elements.coupler import Coupling
from mbsvib.kinematics.couplers import measure
from mbsvib.sensitivities.families.pose_changes import PoseRates, ReferenceTerms, RowTerms
from mbsvib.sensitivities.families.rules import LoadRules, PartRules, joins_spinning_body, line_turn_rates
from mbsvib.sensitivities.forces import Forces
from mbsvib.sensitivities.local_forms import NONE, ONE, UNIT, Local, LocalForm, displaced, entries, moved_connection
from mbsvib.sensitivities.network import Network

_SHIFTED, _TURNED = entries(-displaced(UNIT, NONE)), entries(-displaced(NONE, UNIT))


def _joint_forms(_: Network, parts: Sequence[Any], number: Index, field: str) -> list[LocalForm]:
    """Rods turn with their ends."""
    if field == "pitch":
        axes = np.array([part.axes for part in parts])[:, None, :, 2]
        along, about = (np.pad(axes, ((0, 0), (0, 0), width)) for width in ((0, 3), (3, 0)))
        return [LocalForm(Local("wrench", number, "", along), Local("relative", number, "", about), *ONE)]
    if field == "orientation" or parts[0].end is None:
        return [moved_connection(number, _TURNED if field == "orientation" else _SHIFTED)]
    turn = line_turn_rates(np.array([np.subtract(part.end, part.position) for part in parts]))
    move, turn = (-UNIT, -turn) if field == "end" else (NONE, turn)
    return [moved_connection(number, entries(displaced(move, turn)))]


def _is_exception(joint: Joint, *_: Any) -> bool:
    """Whether the first of two successive rotations turns the axes of the second away from locked translations."""
    if not joint.successive:
        return False
    about = next(name[1:] for name, _ in joint.freedom if name[0] == "r")
    return sum(name[0] != "r" and name != about for name, _ in joint.locked) == 1


def _add_force_terms(terms: RowTerms, _: Network, forces: Forces, joint: Joint, k: int) -> None:
    if k in forces.twice:
        terms.along(joint.name, "orientation", int(terms.at.turn.start) + 3 * int(np.searchsorted(forces.twice, k)))


def _follow(rates: PoseRates, joint: Joint, k: int) -> None:
    """Its point goes with the second body, its axes may turn against the first."""
    if joint.end is None:
        rates.put(joint.name, "position", rates.second[k, :3])
        rates.put(joint.name, "orientation", rates.axes[k])


def _add_reference_terms(terms: ReferenceTerms, joint: Joint, k: int) -> None:
    """Both bodies carry its point and axes; how far it has moved along its free directions turns with the first."""
    described, pose, openings = terms.origin.joints[joint.name], terms.pose, terms.openings
    if described.end is not None:
        _add_rod_terms(terms, described, joint, k)
        return
    first, second = terms.turn(joint.first), terms.turn(joint.second)
    at = described.position or (0.0, 0.0, 0.0)  # joints without a point turn nothing: any will do
    gap = np.subtract(pose.point(joint.second, at), pose.point(joint.first, at))
    terms.turns(joint.name, "orientation", first + terms.turned_axes[k])
    if described.position is not None:
        terms.turns(joint.name, "position", second)
    for i in range(3):
        if described.position is not None:
            openings.put((joint.name, "position", (i,)), 6 * k, (first - second)[:, i])
        openings.put((joint.name, "orientation", (i,)), 6 * k, np.cross(first[:, i], gap))
        openings.put((joint.name, "orientation", (i,)), 6 * k + 3, (first - second)[:, i])
    if joint.pitch:
        axis = np.array(joint.axes)[:, 2]
        openings.put((joint.name, "pitch", ()), 6 * k, (axis @ gap) / joint.pitch * axis)


def _add_rod_terms(terms: ReferenceTerms, described: Any, joint: Any, k: int) -> None:
    """It keeps its length as described."""
    before, after = (np.subtract(rod.end, rod.position) for rod in (described, joint))
    before, after = before / np.linalg.norm(before), after / np.linalg.norm(after)
    for field, body, sign in (("position", joint.first, -1.0), ("end", joint.second, 1.0)):
        turn = terms.turn(body)
        for i in range(3):
            change = sign * (before[i] - after @ turn[:, i]) * after
            terms.openings.put((joint.name, field, (i,)), 6 * k, change)


JOINT = PartRules(
    "joint", _joint_forms, alters_spin=joins_spinning_body,
    loaded=LoadRules(_is_exception, _add_force_terms, _follow, _add_reference_terms),
)


def _coupler_entry(network: Network, coupler: Coupling, field: str, index: tuple[int, ...]) -> list[LocalForm]:
    tied, forms = Local("tied", np.array([network.coupler_row[coupler.name]])), []
    for name, rate in _rates(coupler, field, index):
        owner, _, direction = name.rpartition(".")
        k = network.joint_number[owner]
        six = -rate * np.concatenate(measure(network.joints[k], direction))
        forms.append(LocalForm(tied, Local("relative", np.array([k])), *entries(six[None, None, None])))
    return forms


def _rates(coupler: Coupling, field: str, index: tuple[int, ...]) -> list[tuple[str, float]]:
    """How fast coefficients change, which are linear in all numbers of couplers."""
    numbers = {item.name: item.value for item in coupler.parameter_fields()}
    value = numbers[field]
    twice: Any = 2.0 * value if not index else tuple(2.0 * v if i == index[0] else v for i, v in enumerate(value))
    size = value if not index else value[index[0]]
    changed = coupler.with_values(numbers | {field: twice})
    return [(name, (b - a) / size) for (name, a), (_, b) in zip(coupler.terms, changed.terms, strict=True)]


COUPLER = PartRules("coupler", single=_coupler_entry,
                    loaded=LoadRules(lambda part, moved, _: moved or part.curvatures is not None))  # fmt: skip
