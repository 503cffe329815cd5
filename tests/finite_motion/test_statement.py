"""The statement of finite motion: its second derivatives at the pose are M, C, K; frames are those of moved models."""

import casadi as ca
import numpy as np
import pytest

import mbsvib as mv
from mbsvib.finite_motion.statement import finite_motion
from mbsvib.linalg.rotations import logarithm
from tests.support.slow_cases import some

LIBRARY = ["chain", "ladder", "stewart", "stewart_isolator", "cubic_hexapod", "inclined_chain", "hinged_rod",
           "pendulum_chain", "trifilar_pendulum", "four_bar", "slider_crank", "engine_on_mounts"]  # fmt: skip
KINDS = {
    "revolute": {"axis": (1, 2, 2)}, "prismatic": {"axis": (1, 2, 2)}, "cylindrical": {"axis": (1, 2, 2)},
    "screw": {"axis": (1, 2, 2), "pitch": 0.02}, "universal": {"axis": (1, 0, 0), "axis2": (0.3, 1, 0)},
    "homokinetic": {"orientation": (0.3, -0.2, 0.5)}, "spherical": {}, "planar": {"orientation": (0.3, -0.2, 0.5)},
    "fixed": {}, "free": {}, "point_on_line": {"axis": (1, 2, 2)}, "point_on_plane": {"axis": (1, 2, 2)},
    "distance": {"end": (0.3, 0.25, 0.6)},
}  # fmt: skip


def at_rest(model, **options):
    """Matrices of the statement in the pose as described, brought to the minimal coordinates of a system."""
    system = model.linearize()
    fm = finite_motion(model, cut=system.cut_joints or None, **options)
    q, qd, multiplier = fm.motion.q, fm.motion.qd, ca.SX.sym("l", fm.jacobian.shape[0])
    values = [np.zeros(q.shape), np.zeros(q.shape), fm.motion.numbers.values]
    symbols = [q, qd, fm.motion.numbers.symbols]
    wanted = [fm.mass, fm.forces, fm.jacobian, -ca.jacobian(fm.forces, q), -ca.jacobian(fm.forces, qd)]
    mass, force, jacobian, stiffness, damping = map(np.array, ca.Function("f", symbols, wanted)(*values))
    independent = [fm.motion.names.index(name) for name in system.coordinates]
    depends = [i for i in range(len(mass)) if i not in independent]
    t = np.eye(len(mass))[:, independent]
    if depends:
        t[depends] = -np.linalg.lstsq(jacobian[:, depends], jacobian[:, independent], rcond=None)[0]
        lagrange = np.linalg.lstsq(jacobian.T, -force[:, 0], rcond=None)[0]
        second = ca.Function("s", [*symbols, multiplier], [ca.jacobian(fm.jacobian.T @ multiplier, q)])
        stiffness = stiffness - np.array(second(*values, lagrange))
    return system, *(t.T @ matrix @ t for matrix in (mass, damping, stiffness))


def assert_same(system, mass, damping, stiffness):
    for ours, theirs in ((mass, system.M), (damping, system.C), (stiffness, system.K)):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-12 * max(np.abs(theirs).max(), 1e-6))


@pytest.mark.few(1)
@pytest.mark.parametrize("name", some(LIBRARY, "stewart", "hinged_rod", "pendulum_chain", "four_bar", "slider_crank"))
def test_second_derivatives_are_the_linear_model(name):
    assert_same(*at_rest(mv.library.models()[name][0]()))


def scene(kind, first="ground", second="b", extra=()):
    model = mv.Model(kind, gravity=None)
    model.add_body("a", 1.3, (0.02, 0.03, 0.04), (0.1, -0.2, 0.3), orientation=(0.2, 0.4, -0.3))
    model.add_body("b", 0.7, (0.03, 0.02, 0.025, 0.001, 0.002, -0.003), (0.4, 0.3, 0.5))
    position = None if kind == "fixed" else (0.2, 0.05, 0.4)
    model.add_joint("base", "revolute", "ground", "a", position=(0.0, 0.1, 0.0), axis=(0, 1, 1))
    model.add_joint("j", kind, first, second, position=position, **KINDS[kind])
    model.add_bushing("k", "a", "b", (0.3, 0.1, 0.2), (3e3, 2e3, 1e3, 30, 20, 10), (3, 2, 1, 0.3, 0.2, 0.1),
                      (0.1, 0.2, 0.3))  # fmt: skip
    model.add_bushing("g", "ground", "b", (0.1, 0.3, 0.2), (1e3,) * 3 + (10.0,) * 3)
    return model


@pytest.mark.few(1)
@pytest.mark.parametrize("kind", sorted(KINDS))
@pytest.mark.parametrize("reversed_", [False, True])
def test_frames_of_tree_joints_are_those_of_moved(kind, reversed_):
    model = scene(kind, "b" if reversed_ else "a", "a" if reversed_ else "b")
    model.add_spring("s", "a", "b", (0, 0, 0), (0.5, 0.5, 0.2), 1e3, 2.0)
    assert_same(*at_rest(model))
    fm = finite_motion(model)
    generator = np.random.default_rng(3)
    for name in fm.motion.names:
        values = {"base.rz": 0.7, name: float(generator.uniform(0.2, 0.9)) * (1.0 if ".r" in name else 0.1)}
        there = model.moved(values)
        q = [values.get(name, 0.0) for name in fm.motion.names]
        for body in ("a", "b"):
            frame = fm.motion.frames[body]
            evaluate = ca.Function("f", [fm.motion.q], [frame.point(model.bodies[body].position), frame.rotation])
            centre, rotation = (np.array(value) for value in evaluate(q))
            np.testing.assert_allclose(centre[:, 0], there.bodies[body].position, atol=1e-13)
            turned = rotation @ np.array(model.bodies[body].orientation)
            np.testing.assert_allclose(turned, there.bodies[body].orientation, atol=1e-13)


@pytest.mark.few(1)
@pytest.mark.parametrize("kind", sorted(set(KINDS) - {"fixed", "free"}))
def test_cut_joints_are_closed_where_moved_closes_them(kind):
    """The second joint between a and b is cut; closures are zero in the pose of the moved model."""
    model = scene(kind, "a", "b")
    model.add_joint("other", "free", "a", "b", position=(0.1, 0.1, 0.1))
    system = model.linearize(cut=["j"])
    fm = finite_motion(model, cut=["j"])
    assert system.cut_joints == ("j",)
    assert_same(*at_rest(model))
    far = {name: 0.25 if ".r" in name else 0.02 for name in system.coordinates if name != "base.rz"}
    there = model.moved(far, cut=["j"])
    rows = len(fm.motion.closure_names)
    assert rows == 6 - len(model.joints["j"].freedom)
    # the coordinates of the free joint are those of the pose reached
    a, b = (there.bodies[name] for name in "ab")
    turns = [np.array(body.orientation) @ np.array(model.bodies[body.name].orientation).T for body in (a, b)]
    rotation = logarithm(turns[0].T @ turns[1])
    at = np.array((0.1, 0.1, 0.1))
    ends = [np.array(body.position) + turn @ (at - np.array(model.bodies[body.name].position))
            for body, turn in zip((a, b), turns, strict=True)]  # fmt: skip
    q = dict(zip([f"other.{d}" for d in ("x", "y", "z", "rx", "ry", "rz")],
                 [*turns[0].T @ (ends[1] - ends[0]), *rotation], strict=True))  # fmt: skip
    opening = ca.Function("f", [fm.motion.q], [fm.motion.closures])([q.get(name, 0.0) for name in fm.motion.names])
    np.testing.assert_allclose(np.array(opening), 0.0, atol=1e-12)
    assert np.linalg.norm(list(q.values())) > 0.02


def test_all_connections_loads_and_rotors():
    model = mv.Model("all", gravity=(0.0, 0.0, -9.81))
    model.add_body("b", 2.0, (0.02, 0.03, 0.04), (0.0, 0.0, 0.1))
    model.add_bushing("k", "ground", "b", (0.0, 0.0, 0.0), (3e3, 2e3, 4e3, 300, 200, 100), (3, 2, 1, 0.3, 0.2, 0.1),
                      preload=(0.0, 0.0, 19.62 + 2.0 - 5.0, 0.0, 0.0, -0.4))  # fmt: skip
    model.add_load("dead", "b", (0, 0, -2.0), position=(0, 0, 0.3))
    model.add_load("follower", "b", (0, 0, 5.0), position=(0, 0, 0.2), follower=True)
    model.add_load("moment", "b", torque=(0, 0, 0.4))
    model.add_inerter("i", "ground", "b", (0.3, 0, 0), (0.1, 0, 0.1), 0.4)
    model.add_torsion_spring("t", "ground", "b", (0, 1, 0), 40.0, 0.3)
    model.add_spring("s", "ground", "b", (0.0, 0.3, 0.1), (0.0, 0.1, 0.1), 50.0, 0.2, free_length=0.2)
    model.add_rotor("wheel", "b", 300.0, (0, 0, 1), inertia=1e-3)
    assert_same(*at_rest(model))


@pytest.mark.slow
def test_derivatives_to_parameters_are_those_of_changed_models():
    model = mv.library.four_bar()
    names = ("crank.mass", "coupler.inertia.yy", "rocker.position.x", "B.position.x", "C.position.z", "gravity.z",
             "spring.stiffness", "spring.start.x")  # fmt: skip
    fm = finite_motion(model, names)
    q = np.array([0.3, -0.2, 0.4])
    wanted = ca.vertcat(fm.total_kinetic, fm.total_potential, fm.motion.closures)
    symbols = [fm.motion.q, fm.motion.qd, fm.motion.numbers.symbols]
    evaluate = ca.Function("f", symbols, [wanted, ca.jacobian(wanted, fm.motion.numbers.symbols)])
    p = fm.motion.numbers.values
    value, slope = (np.array(array) for array in evaluate(q, 2.0 * q, p))
    for i, name in enumerate(names):
        step = 1e-5 * max(abs(p[i]), 0.1)
        ends = []
        for sign in (1.0, -1.0):
            changed = finite_motion(model.with_values({name: p[i] + sign * step}), cut=fm.motion.topology.cut_joints)
            total = ca.vertcat(changed.total_kinetic, changed.total_potential, changed.motion.closures)
            ends.append(np.array(ca.Function("f", [changed.motion.q, changed.motion.qd], [total])(q, 2.0 * q)))
        np.testing.assert_allclose(slope[:, i], ((ends[0] - ends[1]) / (2.0 * step))[:, 0], rtol=1e-6, atol=1e-6)
    assert np.abs(value).max() > 1.0


def test_bases_turn_first_and_change_nothing():
    """A rotation split into a base and what comes on top is the same rotation."""
    model = scene("spherical", "a", "b")
    fm = finite_motion(model, bases=True)
    assert fm.motion.based == ("j",)
    evaluate = ca.Function("f", [fm.motion.q, fm.motion.bases], [fm.motion.frames["b"].rotation])
    eye = np.eye(3).reshape(-1)
    half, w = np.array([0.2, 0.3, -0.1]), np.zeros(3)
    whole = np.array(evaluate([0.0, *(2.0 * half)], eye))
    base = np.array(evaluate([0.0, *half], eye))
    np.testing.assert_allclose(np.array(evaluate([0.0, *half], base.reshape(-1, order="F"))), whole, atol=1e-15)
    np.testing.assert_allclose(np.array(evaluate([0.0, *w], whole.reshape(-1, order="F"))), whole, atol=1e-15)


@pytest.mark.parametrize(("name", "words"), [
    ("crank.orientation.rx", "cannot be a symbol"), ("crank.mas", "Did you mean 'crank.mass'"),
])
def test_parameters_that_cannot_be_symbols_are_refused(name, words):
    with pytest.raises(mv.ModelError, match=words):
        finite_motion(mv.library.four_bar(), [name])
