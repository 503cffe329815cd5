"""Each kind of joint and connection in finite motion: displacement, openings, deformation and rows cannot disagree."""

from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest

import mbsvib as mv
from mbsvib.elements import (
    bushing,
    dynamic_bushing,
    dynamic_spring,
    dynamic_torsion,
    inerter,
    joint,
    maxwell,
    spring,
    torsion_spring,
)
from mbsvib.elements.families import EXPANSIONS, FAMILIES, connection_rows, has_rows
from mbsvib.elements.joint_kinds import KINDS, Columns
from mbsvib.equilibrium.motion import kinematics_of
from mbsvib.linalg import components as c
from mbsvib.linalg import rotations
from mbsvib.linalg.displacements import Displacement, small
from mbsvib.linalg.jets import Jet, variables

AXES = rotations.exponential(np.array((0.4, -0.7, 0.5)))
POINT, START = (0.3, -0.2, 0.5), (0.1, 0.4, -0.1)
OBLIQUE = {"axis": tuple(AXES[:, 0]), "axis2": tuple(0.8 * AXES[:, 1] + 0.6 * AXES[:, 0])}
JOINTS = {kind: {"kind": kind} for kind in KINDS} | {
    "oblique universal": {"kind": "universal", **OBLIQUE},
    "slider that turns twice": {"free": ("y", "rz", "rx")},
    "plane of two axes": {"free": ("x", "z")},
}
SPATIAL = np.diag((9.0, 8.0, 7.0, 0.6, 0.5, 0.4)) + 0.1
WRENCH = (1.0, -2.0, 3.0, 0.4, -0.5, 0.6)
FACTOR = mv.Dynamic.prony([0.5], [0.1])
CONNECTIONS = {
    "spring": spring.make("s", "a", "b", START, POINT, 3.0, 0.2, 1.7),
    "spring of a free length": spring.make("s", "a", "b", START, POINT, 3.0, 0.2, None, 0.4),
    "inerter": inerter.make("s", "a", "b", START, POINT, 2.0),
    "maxwell": maxwell.make("s", "a", "b", START, POINT, 3.0, 0.2, 4.0, 1.7),
    "bushing": bushing.make("s", "a", "b", POINT, (1, 2, 3, 4, 5, 6), (6, 5, 4, 3, 2, 1), AXES, WRENCH),
    "bushing of matrices": bushing.make("s", "a", "b", POINT, SPATIAL, 0.1 * SPATIAL, AXES, WRENCH),
    "dynamic bushing": dynamic_bushing.make("s", "a", "b", POINT, SPATIAL, 0.1 * SPATIAL, AXES, WRENCH,
                                            FACTOR),
    "dynamic spring": dynamic_spring.make("s", "a", "b", START, POINT, 3.0, 0.2, 1.7, None, FACTOR),
    "dynamic torsion spring": dynamic_torsion.make("s", "a", "b", AXES[:, 2], 3.0, 0.2, 1.7, FACTOR),
    "torsion spring": torsion_spring.make("s", "a", "b", AXES[:, 2], 3.0, 0.2, 1.7),
}


def made(name):
    """A joint of this kind in oblique axes."""
    given = {"position": POINT} | JOINTS[name]
    given |= {"end": START} if name == "distance" else {} if "axis" in given else {"orientation": AXES}
    given |= {"pitch": 0.07} if name == "screw" else {}
    rest = dict.fromkeys(("kind", "position", "orientation", "axis", "axis2", "pitch", "free", "end"))
    return joint.make(name="j", first="a", second="b", **rest | given)


def columns(part):
    return Columns(part.freedom, part.locked, part.point or (0.0,) * 3, part.position or (0.0,) * 3, part.successive)


def fields(part):
    keys = (*part.point_fields, "orientation", "axis")
    return SimpleNamespace(**{key: getattr(part, key) for key in keys if hasattr(part, key)})


def outputs(name):
    """The functions of a displacement that a joint, or a connection, states."""
    if name in CONNECTIONS:
        part = CONNECTIONS[name]
        return partial(part.law.deformation, j=fields(part))
    part = made(name)
    return partial(part.motion.openings, j=columns(part))


def far(samples=7):
    """Displacements of some samples, up to 1 rad and 0.3 m."""
    rng = np.random.default_rng(5)
    theta, shift = rng.uniform(-0.57, 0.57, (3, samples)), rng.uniform(-0.3, 0.3, (3, samples))
    return Displacement(c.exponential(tuple(theta)), tuple(shift), POINT), theta, shift


def at_rest(name):
    """Gradient (outputs, 6) and Hessian of outputs to (rotation, translation) of the point."""
    xi = variables(np.zeros(6))
    jets = outputs(name)(small(tuple(xi[:3]), tuple(xi[3:]), POINT))
    return np.array([jet.gradient for jet in jets]), np.array([jet.hessian for jet in jets])


def direct_parts(part):
    """What it is in the equations between its two bodies: itself, or those of its stand-ins that have no node."""
    if has_rows(part):
        return [part]
    made = EXPANSIONS[type(part)](part, {}).springs.values()
    return [item for item in made if {item.first, item.second} == {"a", "b"}]


BOTH = [*JOINTS, *CONNECTIONS]
OPEN = [name for name in BOTH if name != "free"]


def test_all_families_are_tried():
    tried = {type(part) for part in CONNECTIONS.values()}
    assert {family.part for family in FAMILIES if family.section == "springs"} == tried


@pytest.mark.parametrize("name", JOINTS)
def test_motions_along_free_directions_open_no_joint(name):
    part, rng = made(name), np.random.default_rng(3)
    q = list(rng.uniform(-0.4, 0.4, (len(part.freedom), 9)))
    moved = part.motion.displacement(q, columns(part))
    opened = part.motion.openings(moved, columns(part))
    assert len(opened) == len(part.locked) == 6 - len(q)
    for value in opened:
        np.testing.assert_allclose(value, 0.0, atol=3e-16)
    for row in c.product(c.transpose(moved.rotation), moved.rotation):
        np.testing.assert_allclose(c.norm(row), 1.0, rtol=1e-14)


@pytest.mark.parametrize("name", JOINTS)
def test_first_derivatives_are_the_directions_of_the_joint(name):
    part = made(name)
    q = variables(np.zeros(len(part.freedom)))
    moved = part.motion.displacement(q, columns(part))
    twist = [*moved.shift, *c.axial(moved.rotation)]
    slope = [entry.gradient if isinstance(entry, Jet) else np.zeros(len(q)) for entry in twist]
    np.testing.assert_allclose(slope, np.array([six for _, six in part.freedom]).reshape(-1, 6).T, atol=1e-16)
    gradient, _ = at_rest(name) if name != "free" else (np.zeros((0, 6)), None)
    point = part.point or POINT
    rows = [np.concatenate((np.array(six[3:]) + np.cross(np.subtract(point, POINT), six[:3]), six[:3]))
            for _, six in part.locked]  # fmt: skip
    np.testing.assert_allclose(gradient, np.array(rows).reshape(-1, 6), atol=2e-16)


@pytest.mark.parametrize("name", CONNECTIONS)
def test_first_derivatives_are_the_rows_and_forces_of_the_connection(name):
    part = CONNECTIONS[name]
    gradient, _ = at_rest(name)
    slope = np.concatenate((gradient[:, 3:], gradient[:, :3]), axis=1)
    law, d = part.law, len(gradient)

    def value(field):
        return np.array(0.0 if field is None or getattr(part, field) is None else getattr(part, field)) * np.ones(d)

    if direct := direct_parts(part):
        expected = connection_rows(direct, {"a": 0, "b": 1, "s.node": 2})
        expected = expected.take(np.flatnonzero(expected.rows.first + expected.rows.second == 1))
        rows = np.concatenate((expected.rows.force, expected.rows.moment + np.cross(
            expected.rows.point - np.array(POINT)[:, None], expected.rows.force, axis=0))).T  # fmt: skip
        inertance = np.zeros(len(rows)) if expected.inertance is None else expected.inertance
        for key, coefficient in (("stiffness", expected.stiffness), ("damping", expected.damping),
                                 ("inertance", inertance)):  # fmt: skip
            matrix = value(getattr(law, key))
            matrix = matrix if matrix.ndim == 2 else np.diag(matrix)
            np.testing.assert_allclose(slope.T @ matrix @ slope, rows.T @ (coefficient[:, None] * rows), atol=1e-13)
        assert sum(np.array(item.rest_wrench) for item in direct) == pytest.approx(part.rest_wrench, abs=1e-15)
    described = law.deformation(Displacement(), fields(part))
    rest = value(law.preload) * (-1.0 if law.wrench else 1.0)
    if law.free and getattr(part, law.free) is not None:
        rest = part.stiffness * (np.array(described) - part.free_length)
    wrench = np.array(part.rest_wrench)
    wrench[3:] += np.cross(np.subtract(part.points[-1], POINT), wrench[:3]) if part.points else 0.0
    np.testing.assert_allclose(-slope.T @ rest, wrench, atol=1e-15)


@pytest.mark.parametrize("name", [name for name, part in CONNECTIONS.items() if part.law and part.law.relaxations])
def test_relaxations_of_a_law_are_the_springs_and_dampers_in_series(name):
    part = CONNECTIONS[name]
    made = EXPANSIONS[type(part)](part, {}).springs
    terms = getattr(part, part.law.relaxations)
    assert len(made) == 1 + 2 * len(terms)
    for i, (stiffness, time) in enumerate(terms, 1):
        for word, factor in (("spring", 1.0), ("damper", time)):
            item = made[f"s.{i}.{word}"]
            value = np.array(item.stiffness if word == "spring" else item.damping)
            expected = factor * np.array(stiffness)
            np.testing.assert_allclose(value, expected if value.shape == expected.shape else
                                       [0, 0, 0, 0, 0, *expected] if value.shape == (6,) else expected[0])


@pytest.mark.parametrize("name", OPEN)
def test_jets_are_derivatives_of_the_function_itself(name):
    """Hessians by CasADi's algorithmic differentiation, which knows nothing of jets."""
    xi = ca.SX.sym("xi", 6)
    x = small(tuple(ca.vertsplit(xi[:3])), tuple(ca.vertsplit(xi[3:])), POINT)
    _, hessian = at_rest(name)
    for value, ours in zip(outputs(name)(x), hessian, strict=True):
        theirs = ca.Function("h", [xi], [ca.hessian(value, xi)[0]])(np.zeros(6))
        np.testing.assert_allclose(ours, np.array(theirs), atol=5e-15)


@pytest.mark.parametrize("name", OPEN)
def test_expressions_have_the_values_of_arrays(name):
    moved, theta, shift = far()
    xi = ca.SX.sym("xi", 6)
    symbolic = Displacement(c.exponential(tuple(ca.vertsplit(xi[:3]))), tuple(ca.vertsplit(xi[3:])), POINT)
    call = ca.Function("f", [xi], [ca.vertcat(*outputs(name)(symbolic))])
    ours = np.array(outputs(name)(moved))
    theirs = np.array([np.array(call(np.concatenate(both)))[:, 0] for both in zip(theta.T, shift.T, strict=True)]).T
    np.testing.assert_allclose(ours, theirs, atol=3e-15)


def test_rotations_of_components_are_those_of_arrays():
    w = np.random.default_rng(1).normal(size=(3, 40)) * np.geomspace(1e-9, 1.7, 40)
    rotation = c.exponential(tuple(w))
    expected = rotations.exponential(w.T)
    np.testing.assert_allclose(np.array(rotation).transpose(2, 0, 1), expected, atol=5e-16)
    near = w[:, np.linalg.norm(w, axis=0) < 3.0]
    np.testing.assert_allclose(c.rotation_vector(c.exponential(tuple(near))), near, rtol=1e-13, atol=1e-24)


def test_complex_steps_are_derivatives():
    """The derivative of a length to its end is the direction of the line, of a rotation vector by its own axis 1."""
    step, line = 1e-30, np.subtract(POINT, START)
    for k in range(3):
        shift = tuple(1j * step if i == k else 0.0 for i in range(3))
        value = outputs("spring")(Displacement(shift=shift))[0]
        np.testing.assert_allclose(np.imag(value) / step, line[k] / np.linalg.norm(line), rtol=1e-15)
    for angle in (1e-9, 0.1, 0.6, 3.0):
        turned = c.turn((0.0, 0.6, 0.8), angle + 1j * step)
        np.testing.assert_allclose(np.imag(c.rotation_vector(turned)) / step, (0.0, 0.6, 0.8), rtol=1e-12, atol=1e-14)


def placed(displacement, body, first):
    """Centre and rotation of a body that is displaced against the first one, which is moved, too: (turn, shift)."""
    turn, shift = first
    rotation = np.array(displacement.rotation, dtype=float)
    return turn @ np.array(displacement.point(tuple(body)), dtype=float) + shift, turn @ rotation


@pytest.mark.parametrize("name", [name for name in JOINTS if name != "free"])
def test_openings_in_a_pose_are_zero_where_displacements_lead_and_grow_along_the_rows(name):
    """What equilibria and moved models close: after several turns of a screw, and in all other poses of both bodies."""
    model, part, rng = mv.Model(), made(name), np.random.default_rng(7)
    for body, at in (("a", (0.2, 0.1, -0.3)), ("b", (-0.1, 0.6, 0.2))):
        model.add_body(body, 1.0, (1, 1, 1), at)
        model.add_joint(f"to {body}", "free", "ground", body, at)
    kinematics = kinematics_of(model.with_parts(joints=dict(model.joints) | {"j": part}), ("j",))
    start = kinematics.described
    q = rng.uniform(-0.9, 0.9, len(part.freedom))
    if name == "screw":
        q[:] = 16.0
    elif name == "slider that turns twice":
        q[:2] = 0.0  # poses in which its first rotation has turned its slide are refused
    first = rotations.exponential(rng.normal(size=3)), rng.normal(size=3)
    here = part.motion.displacement(list(q), columns(part))

    def opened(displacement):
        centre, turn = start.centre.copy(), start.rotations.copy()
        for k, body in ((start.number["a"], Displacement()), (start.number["b"], displacement)):
            centre[k], turn[k] = placed(body, start.origin[k], first)
        pose = replace(start, centre=centre, rotations=turn)
        cuts = kinematics.at(pose)[1]
        return kinematics.openings(pose), cuts.rows

    values, rows = opened(here)
    np.testing.assert_allclose(values, 0.0, atol=2e-15 * np.abs(q).max(initial=1.0))
    e = 1e-6 * rng.normal(size=(2, 3))  # a small rotation and translation at the joint's point, in axes of the first
    point = here.point(part.point or POINT)
    both = [opened(small(tuple(sign * e[0]), tuple(sign * e[1]), point).then(here))[0] for sign in (1.0, -1.0)]
    turn, shift = first
    at_row = turn @ np.array(point, dtype=float) + shift
    moved = turn @ e[1][:, None] + np.cross(turn @ e[0], rows.point - at_row[:, None], axis=0)
    expected = (rows.force * moved).sum(axis=0) + (turn @ e[0]) @ rows.moment
    np.testing.assert_allclose(0.5 * (both[0] - both[1]), expected, atol=1e-12)
