"""Bilinear forms of the derivatives, x^T (dT/dp) y, for many parameters and many pairs of motions at once."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.parts import Body, Bushing, Joint, Spring
from mbsvib.sensitivities.factors import body_factors, joint_factors, spring_factors
from mbsvib.sensitivities.fields import fields, in_joints, motions

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from mbsvib.parameters import Parameter
    from mbsvib.sensitivities.factors import Pair
    from mbsvib.sensitivities.fields import Field, Fields
    from mbsvib.sensitivities.network import Network
    from mbsvib.system import System

_SIX = {(i, j): n for n, (i, j) in enumerate((i, j) for i in range(6) for j in range(i, 6))}
# Numbers that one family of products may hold at once.
CHUNK = 4_000_000
# Work of a state of self-stress is rounding below this share of the largest force times the largest motion anywhere.
WORKS = 1e-9


def products(
    network: Network, parameters: Sequence[Parameter], left: Fields, right: Fields | None = None
) -> Field:
    """Return x^T (dT/dp) y for every parameter.

    Parameters
    ----------
    network : Network
        Bodies and connections.
    parameters : sequence of Parameter
        What changes.
    left, right : Fields
        The motions x and y, as many of each; right None: y = x.

    Returns
    -------
    array, shape (parameters, n)
        The forms.
    """
    n = left.square.shape[-1]
    kind = np.result_type(left.body_wrench, left.wrench, *(() if right is None else (right.body_wrench, right.wrench)))
    result = np.zeros((len(parameters), n), dtype=kind)
    for family, field, members in _families(network, parameters):
        step = max(1, CHUNK // (24 * max(1, n)))
        for start in range(0, len(members), step):
            part = members[start : start + step]
            which, inverse = np.unique([number for _, number, _ in part], return_inverse=True)
            other = None if right is None else family(network, right, which, field)
            form = _form(family(network, left, which, field), other)
            result[[place for place, _, _ in part]] = form[inverse, [slot for _, _, slot in part]]
    return result


def breaking(system: System, network: Network, parameters: Sequence[Parameter]) -> NDArray[np.bool_]:
    """Return which parameters, changed alone, take degrees of freedom away: redundant constraints then contradict.

    A change does so where a state of self-stress, forces in the locked rows that load no coordinate, works on it.

    Parameters
    ----------
    system : System
        The equations of motion.
    network : Network
        Its bodies and connections.
    parameters : sequence of Parameter
        What changes.

    Returns
    -------
    array, shape (parameters,)
        True where the mechanism has fewer degrees of freedom nearby.
    """
    result = np.zeros(len(parameters), dtype=bool)
    ties = network.constraints
    if ties is None or not ties.stress.shape[1] or not system.dof:
        return result
    joints = len(network.joints)
    one = np.ones(system.dof)
    motion = fields(network, motions(system, network, np.eye(system.dof)), one, one, one)
    none = np.zeros((len(network.bodies), 6, ties.stress.shape[1]))
    stress = replace(motion, wrench=np.concatenate((
        in_joints(network, none, ties.stress, network.point[:joints].mean(axis=0)),
        np.zeros((len(network.springs), 6, ties.stress.shape[1])),
    )))  # fmt: skip
    length = float(np.ptp(network.point, axis=0).max()) or 1.0
    per_length = np.repeat([1.0, length], 3)[:, None]
    moves = float(np.abs(motion.relative * per_length).max(initial=0.0)) / length
    loads = float(np.abs(stress.wrench[:joints] / per_length).max(initial=0.0))
    for family, field, members in _families(network, parameters):
        if family is not joint_factors:
            continue
        which, inverse = np.unique([number for _, number, _ in members], return_inverse=True)
        force = family(network, stress, which.tolist(), field)[0]
        change = family(network, motion, which.tolist(), field)[1]
        work = np.abs(np.einsum("kstr,kstm->ksrm", force, change)).max(axis=(2, 3))
        broken = work > WORKS * moves * (length if field == "orientation" else 1.0) * loads
        result[[place for place, _, _ in members]] = broken[inverse, [slot for _, _, slot in members]]
    return result


def _form(left: Pair, right: Pair | None) -> Field:
    if right is None:
        result: Field = np.einsum("kstn,kstn->ksn", *left)
        result *= 2.0
    else:
        result = np.einsum("kstn,kstn->ksn", left[0], right[1]) + np.einsum("kstn,kstn->ksn", left[1], right[0])
    return result


def _families(
    network: Network, parameters: Sequence[Parameter]
) -> Iterator[tuple[Any, str, list[tuple[int, int, int]]]]:
    """Group parameters by kind of part and field: (place among the parameters, number of the part, entry)."""
    numbers = {part.name: (kind, i) for kind, parts in ((body_factors, network.bodies), (joint_factors, network.joints),
               (spring_factors, network.springs)) for i, part in enumerate(parts)}  # fmt: skip
    groups: dict[tuple[Any, ...], list[tuple[int, int, int]]] = {}
    for place, parameter in enumerate(parameters):
        kind, number = numbers[parameter.part]
        part: Body | Joint | Bushing | Spring = (
            network.bodies[number] if kind is body_factors else network.joints[number] if kind is joint_factors
            else network.springs[number]
        )  # fmt: skip
        index = parameter.index
        slot = 0 if not index else index[0] if len(index) == 1 else _SIX[index[0], index[1]]
        rod = isinstance(part, Joint) and part.end is not None
        key = (kind, parameter.field, type(part), len(index), rod)
        groups.setdefault(key, []).append((place, number, slot))
    for (kind, field, *_), members in groups.items():
        yield kind, field, members
