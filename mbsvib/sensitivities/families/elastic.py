"""Beams and superelements: how their numbers, and motions of them as wholes, enter the equations by what they are made
of.

Such a part is nodes, joints and bushings between them, and rows that several nodes share. Rows of mass, stiffness and
damping are forms d^T F d of the displacements d of nodes. Slopes of all of these to a number of the part are
differences of its own closed formulas, extrapolated to rounding (12 digits): nothing of the mechanism is differenced.
Where points and axes move, the wrenches there do work as on any other connection that is moved. A part that keeps its
shape under loads turns with its first node, by w d F = [w]x F - F [w]x; forces and gravity stay, of which F is a linear
function.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.elements import beam_expansion
from mbsvib.elements.beam import Beam
from mbsvib.elements.families import ELASTIC, EXPANSIONS
from mbsvib.equations.beam_prestress import bent_lines, per_tension
from mbsvib.linalg.rotations import skew
from mbsvib.linalg.vectors import moved, transformed
from mbsvib.sensitivities.families.rules import InternalRule, LoadRules, PartRules, factors, form_terms, part_slopes

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.elements.shared_rows import SharedRows
    from mbsvib.elements.superelement import Superelement
    from mbsvib.linalg.vectors import Field
    from mbsvib.sensitivities.adjoint_fields import Fields
    from mbsvib.sensitivities.families.pose_changes import PoseRates, RowTerms
    from mbsvib.sensitivities.families.rules import Rule, RuleAndData, Terms
    from mbsvib.sensitivities.forces import Forces
    from mbsvib.sensitivities.network import Network

    # Bodies of nodes, and those against which their displacements are taken, with the power of s of a form.
    Nodes = tuple[str, tuple[tuple[str, str, bool], ...]]

# The field of the place and orientation of a part that keeps its shape, which are no parameters.
MOTION = "motion"


class _Made:
    """What a ``part`` is made of, under ``force`` (elements, 3) in its elements and ``gravity`` (3,), in ``numbers``.

    They are points of ``nodes`` (n, 3), ``joints`` (j, 3) and ``elements`` (e, 3), ``axes`` (j + s, 3, 3) of joints and
    bushings, ``stiffness`` and ``damping`` (s, 6, 6) of these in their axes, ``weight`` (w, 3) and its ``centres``
    (w, 3) and, with their nodes, forms F (6 k, 6 k) and points (k, 3).
    """

    def __init__(self, part: Any, force: Array, gravity: Array) -> None:
        made, weights = EXPANSIONS[type(part)](part, {}), _weights(part, gravity)
        joints = {name: joint for name, joint in made.joints.items() if joint.name != part.name}
        self.bodies, self.joints, self.springs = tuple(made.bodies), tuple(joints), tuple(made.springs)
        elements = _elements(part)
        self.elements, self.weights = tuple(elements), tuple([load.name for load in weights])
        springs: list[Any] = list(made.springs.values())
        self.forms = _forms((*made.mass, *made.elastic))
        for key, form, points in _loaded_forms(part, force, gravity):
            _add(self.forms, key, form, points)
        self.numbers: dict[str, Array] = {
            "nodes": _vectors([body.position for body in made.bodies.values()]),
            "joints": _vectors([joint.point for joint in joints.values()]),
            "elements": _vectors(list(elements.values())),
            "axes": np.array([part.axes for part in joints.values()] + [part.orientation for part in springs],
                             ).reshape(-1, 3, 3),
            "stiffness": _matrices([part.stiffness for part in springs]),
            "damping": _matrices([part.damping for part in springs]),
            "weight": _vectors([load.force for load in weights]),
            "centres": _vectors([load.position for load in weights]),
        }  # fmt: skip

    def in_one(self, forms: Mapping[Nodes, tuple[Array, Array]]) -> dict[Any, Array]:
        """Return all numbers with ``forms``, zero where it has none of these."""
        result: dict[Any, Array] = dict(self.numbers)
        for key, like in forms.items():
            own = self.forms.get(key)
            result[key, 0], result[key, 1] = like if own is None else own
            result[key, 0] = result[key, 0] * (own is not None)
        return result


def _vectors(values: Sequence[Any]) -> Array:
    return np.array(values, dtype=float).reshape(-1, 3)


def _matrices(values: Sequence[Any]) -> Array:
    """Stiffness of bushings, six values or a matrix each, as matrices."""
    return np.array([np.diag(value) if np.ndim(value) == 1 else value for value in values]).reshape(-1, 6, 6)


def _forms(every: Sequence[SharedRows]) -> dict[Nodes, tuple[Array, Array]]:
    """Forms and points of nodes of all rows."""
    result: dict[Nodes, tuple[Array, Array]] = {}
    for rows in every:
        weights = [("stiff", rows.stiffness), ("rate", rows.damping)]
        if rows.stiffness is None and rows.damping is None:
            weights = [("square", np.ones(len(rows.matrix)))]
        nodes = tuple([(node.body, node.relative_to, node.moves_with_ground) for node in rows.nodes])
        for power, weight in weights:
            if weight is not None:
                form = rows.matrix.T @ (weight[:, None] * rows.matrix)
                _add(result, (power, nodes), form, _vectors([node.point for node in rows.nodes]))
    return result


def _add(forms: dict[Nodes, tuple[Array, Array]], key: Nodes, form: Array, points: Array) -> None:
    forms[key] = (forms[key][0] + form if key in forms else form, points)


def _weights(part: Any, gravity: Array) -> tuple[Any, ...]:
    """The loads on bodies that are the weight of a part."""
    if not gravity.any():
        return ()
    way = tuple(gravity.tolist())
    return beam_expansion.weights(part, way) if isinstance(part, Beam) else ELASTIC[type(part)](part, way).loads


def _elements(part: Any) -> dict[str, Any]:
    """Names and points of what carries forces at rest."""
    if isinstance(part, Beam):
        return {name: part.middle(i) for i, name in enumerate(part.element_names)}
    elastic = ELASTIC[type(part)](part)
    return dict(zip(elastic.names, (point for _, point in elastic.nodes), strict=True))


def _loaded_forms(part: Any, force: Array, gravity: Array) -> list[tuple[Nodes, Array, Array]]:
    """Forms of the stiffness under forces in elements (e, 3) and gravity, linear in both."""
    if isinstance(part, Beam):
        axes = np.array([axes for _, axes in part.frames()])
        local = np.concatenate((np.einsum("eji,ej->ei", axes, force), np.zeros_like(force)), axis=1)
        rows: Sequence[SharedRows] = bent_lines(part, local,
                                                np.broadcast_to(gravity, force.shape))  # fmt: skip
    else:
        rows = ELASTIC[type(part)](part, tuple(gravity.tolist())).weight_stiffness if gravity.any() else ()
    return [(key, *values) for key, values in _forms(rows).items()]


def _at_rest(network: Network, part: Any) -> tuple[tuple[tuple[float, ...], ...], tuple[float, ...]]:
    """The forces (elements, 3) in the elements of a part at the pose, and gravity there; zero without loads."""
    none, number = (0.0, 0.0, 0.0), network.spring_number
    if network.forces is None:
        return (none,) * len(_elements(part)), none
    wrench = network.forces.wrench[len(network.joints) :]
    return tuple([tuple(wrench[number[name], :3].tolist()) if name in number else none for name in _elements(part)]
                 ), tuple(network.gravity.tolist())  # fmt: skip


@lru_cache(maxsize=64)
def _slopes(part: Any, force: Any, gravity: Any, field: str, index: tuple[int, ...]) -> tuple[_Made, dict[Any, Array]]:
    """What a part is made of, and the slopes of these numbers to one of its own."""
    rest = np.array(force), np.array(gravity)
    made, value = _Made(part, *rest), getattr(part, field, None)
    forms = made.forms
    if value == 0.0:  # damping that it may have
        forms = _Made(part.with_values({field: 1.0}), *rest).forms | forms
    length = min(size for size, _ in part.frames())
    change = part_slopes(part, field, index, lambda varied: _Made(varied, *rest).in_one(forms),
                         length if index or field == "length" else None)
    spin = change.pop("axes") @ made.numbers["axes"].swapaxes(1, 2)
    change["turns"] = 0.5 * np.stack((spin[:, 2, 1] - spin[:, 1, 2], spin[:, 0, 2] - spin[:, 2, 0],
                                      spin[:, 1, 0] - spin[:, 0, 1]), axis=1)  # fmt: skip
    made.forms = {key: (made.forms[key] if key in made.forms else (0.0 * form, points))
                  for key, (form, points) in forms.items()}
    return made, change


@lru_cache(maxsize=64)
def _moved(part: Any, force: Any, gravity: Any, direction: int) -> tuple[_Made, dict[Any, Array]]:
    """What a part is made of, and its change as it shifts along x, y, z (0 to 2), or turns about these at its first
    node.
    """
    force, gravity = np.array(force), np.array(gravity)
    made, axis = _Made(part, force, gravity), np.eye(3)[direction % 3]
    origin, turns = np.array(part.points[0]), direction > 2
    change: dict[Any, Array] = {key: np.zeros_like(made.numbers[key]) for key in ("stiffness", "damping", "weight")}
    change["turns"] = np.tile(axis * turns, (len(made.numbers["axes"]), 1))
    less = {key: form for key, form, _ in _loaded_forms(part, np.cross(axis, force), np.cross(axis, gravity))
            } if turns else {}
    points = {key: made.numbers[key] for key in ("nodes", "joints", "elements", "centres")}
    for key, (form, at) in made.forms.items():
        spin = np.zeros(form.shape)
        for i, (*_, goes) in enumerate(key[1]):
            spin[6 * i : 6 * i + 6, 6 * i : 6 * i + 6] = np.kron(np.eye(2), skew(axis)) * (goes and turns)
        change[key, 0] = spin @ form - form @ spin - less.get(key, 0.0)
        points[key, 1] = at  # type: ignore[index]
    change |= {key: np.cross(axis, at - origin) if turns else np.tile(axis, (len(at), 1)) for key, at in points.items()}
    return made, change


def _rule(network: Network, made: _Made, change: Mapping[Any, Array]) -> RuleAndData:
    """The rule of a change of a part.

    Its data are the bodies (1, n) that nodes of the part are, and how their centres of mass move (1, n, 3).
    """
    first, floats = len(network.joints), network.floating_number
    which = [network.spring_number[name] for name in made.springs]
    joints = np.array([network.joint_number[name] for name in made.joints], dtype=np.intp)
    connections = np.concatenate((joints, first + np.array(which, dtype=np.intp)))
    sign = np.repeat((-1.0, 1.0), (len(joints), len(which)))
    ways = np.concatenate((change["joints"], change["elements"][: len(which)]))
    moving = np.zeros((len(ways), 6, 6))
    moving[:, :3, :3] = moving[:, 3:, 3:] = -sign[:, None, None] * skew(change["turns"])
    moving[:, :3, 3:] = -sign[:, None, None] * skew(ways)
    acting, axis = np.nonzero(moving.any(axis=2))
    axes = np.zeros((len(which), 6, 6))
    axes[:, :3, :3] = axes[:, 3:, 3:] = made.numbers["axes"][len(joints) :]
    coefficients = [(power, factors(axes @ change[key] @ axes.swapaxes(1, 2))) for power, key in (
        ("stiff", "stiffness"), ("rate", "damping")) if change[key].any()]  # fmt: skip
    forms = []
    for key, (form, points) in made.forms.items():
        nodes = [(network.body_number[body], network.body_number[other], point)
                 for (body, other, _), point in zip(key[1], points, strict=True)]
        shift = np.zeros(form.shape)
        for i, (way, (*_, goes)) in enumerate(zip(change[key, 1], key[1], strict=True)):
            shift[6 * i : 6 * i + 3, 6 * i + 3 : 6 * i + 6] = -skew(way) * goes
        rows = shift.any(axis=1)
        forms.append((key[0], nodes, factors(change[key, 0][None])[0], shift[rows], form[rows]))
    numbers = [network.body_number[name] for name in made.bodies[: len(change["nodes"])]]
    hanging = [(floats[body], body, -skew(way)) for body, way in zip(numbers, change["nodes"], strict=True)
               if body in floats]  # fmt: skip

    def rule(fields: Fields, _: Any, __: tuple[Array, ...]) -> list[Terms]:
        result: Terms = []
        for power, of_springs in coefficients:
            for k, form in zip(which, of_springs, strict=True):
                result += form_terms(form, fields.strain[k], 0.5 * getattr(fields, power))
        if len(acting):
            taken, wrench = transformed(moving, fields.relative[connections]), fields.wrench[connections]
            result += _products(wrench[acting, axis], taken[acting, axis])
        for power, nodes, changed, shift, acts in forms:
            if not (len(changed[0]) or len(shift)):
                continue
            d, weight = _displacements(network, fields.body, nodes), getattr(fields, power)
            result += form_terms(changed, d, 0.5 * weight)
            result += _products(np.tensordot(shift, d, axes=1), np.tensordot(acts, d, axes=1) * weight)
        for k, body, across in hanging:
            result += _products(-np.tensordot(across, fields.body[body, 3:], axes=1), fields.support[k, :3])
        return [result]

    return rule, (np.array([numbers], dtype=np.intp), change["nodes"][None])


def _displacements(network: Network, body: Field, nodes: Sequence[tuple[int, int, Array]]) -> Field:
    """Displacements (6 n, ...) of nodes against others at their points; -1 is the ground."""
    return np.concatenate([_displacement(network, body, number, point) - (
        0.0 if other < 0 else _displacement(network, body, other, point)) for number, other, point in nodes])


def _displacement(network: Network, body: Field, number: int, point: Array) -> Field:
    """The displacement (6, ...) of a point of a body."""
    if number < 0:
        return np.zeros((6, *body.shape[2:]), dtype=body.dtype)
    return np.asarray(moved(body[number][None], (point - network.position[number])[None])[0])


def _products(left: Field, right: Field) -> Terms:
    """Terms of the sum of products of entries."""
    return [(p[None], q[None]) for p, q in zip(left, right, strict=True)]


def _single(network: Network, beam: Beam, field: str, index: tuple[int, ...]) -> RuleAndData:
    return _rule(network, *_slopes(beam, *_at_rest(network, beam), field, index))


def _internal_rules(network: Network, part: Any) -> list[InternalRule]:
    """It goes with its first node."""
    ruled = [_rule(network, *_moved(part, *_at_rest(network, part), i)) for i in range(6)]
    return [InternalRule(rule, 1, np.zeros(1, dtype=np.intp), data) for rule, data in ruled]


def _gravity_rule(network: Network, parts: Sequence[Any]) -> Rule:
    """The rule by which gravity changes the stiffness of parts under their weight."""
    of_ways: list[Any] = []
    for unit in np.eye(3):
        forms = chain.from_iterable(_loaded_forms(part, np.zeros((len(_elements(part)), 3)), unit) for part in parts)
        of_ways.append([([(network.body_number[body], network.body_number[other], point)
                          for (body, other, _), point in zip(key[1], points, strict=True)], factors(form[None])[0])
                        for key, form, points in forms])  # fmt: skip

    def rule(fields: Fields, _: Any, __: tuple[Array, ...]) -> list[Terms]:
        return [list(chain.from_iterable(
            form_terms(form, _displacements(network, fields.body, nodes), 0.5 * fields.stiff)
            for nodes, form in forms)) for forms in of_ways]  # fmt: skip

    return rule


def _add_force_terms(terms: RowTerms, network: Network, forces: Forces, part: Any, _: int) -> None:
    """It carries forces in its elements, and at its nodes its weight and loads without points of their own."""
    at, joints, rest = terms.at, len(network.joints), _at_rest(network, part)
    loads = list(zip(network.loads, forces.loads.tolist(), strict=True))
    load_of = {load.name: k for load, k in loads}
    for key in [key for key in terms.row if key[0] == part.name]:
        made, change = _moved(part, *rest, key[2][0]) if key[1] == MOTION else _slopes(part, *rest, *key[1:])
        for name, way in zip(made.elements, change["elements"], strict=True):
            if name in network.spring_number:
                terms.put(key, at.point_of(joints + network.spring_number[name]), way)
        node_of = dict(zip(made.bodies, change["nodes"], strict=False))
        for load, k in loads:
            if load.position is None and load.body in node_of:
                terms.put(key, at.point_of(k), node_of[load.body])
        for name, centre, weight in zip(made.weights, change["centres"], change["weight"], strict=True):
            terms.put(key, at.point_of(load_of[name]), centre)
            terms.put(key, at.wrench_of(load_of[name]), weight)
    for i, unit in enumerate(np.eye(3) if network.gravity.any() else ()):
        for weight in _weights(part, unit):
            terms.put(("gravity", "", (i,)), at.wrench_of(load_of[weight.name]), weight.force)


def _follow(rates: PoseRates, part: Any, _: int) -> None:
    """It shifts and turns with its first node."""
    body, point = part.node_bodies[0]
    number = rates.network.body_number[body]
    if number >= 0:
        arm = np.array(point) - rates.network.position[number]
        rates.put(part.name, MOTION, moved(rates.motion[number][None], arm[None])[0])


def _has_rule(beam: Beam, field: str) -> bool:
    """Whether a beam changes smoothly with a number."""
    return field not in ("start", "end") or beam.turns_smoothly


def _reactions(part: Superelement) -> tuple[tuple[str, ...], tuple[str, ...], int] | None:
    """Statics does not determine the forces of one that some motion does not strain."""
    stiff = ELASTIC[type(part)](part)
    return None if len(stiff.values) < stiff.rows.shape[1] else (stiff.names, part.carriers, part.internal)


_COMMON: dict[str, Any] = {"add_force_terms": _add_force_terms, "follow": _follow, "internal": (MOTION, 6),
                           "internal_rules": _internal_rules, "gravity_rule": _gravity_rule}  # fmt: skip
BEAM = PartRules(
    "composed", single=_single, has_rule=_has_rule,
    loaded=LoadRules(
        lambda beam, *_: beam.displacements is not None or not _has_rule(beam, "start"),
        bent_lines=lambda beam: (beam.element_names, np.array([axes for _, axes in beam.frames()]),
                                 per_tension(beam.parts())[..., None] * np.eye(6)),
        reactions=lambda beam: (beam.element_names, (), 0), **_COMMON),
)  # fmt: skip
SUPERELEMENT = PartRules("composed", loaded=LoadRules(
    lambda part, *_: part.displacements is not None, reactions=_reactions, **_COMMON))  # fmt: skip
