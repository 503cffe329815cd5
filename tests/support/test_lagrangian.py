"""The exact reference itself: without loads it is the library's linearisation, with loads a pendulum in closed form."""

from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest

import mbsvib as mv
from tests.support.lagrangian import Lagrangian, exponential, finite, logarithm, projected
from tests.support.random_models import planar, spatial


def agree(model, system):
    stiffness, mass, residual = projected(model, system)
    assert np.abs(residual).max(initial=0.0) <= 1e-14 * np.abs(stiffness).max(initial=1e-3)
    assert np.allclose(stiffness, system.K, rtol=0, atol=1e-10 * np.abs(system.K).max(initial=1e-3))
    assert np.allclose(mass, system.M, rtol=0, atol=1e-11 * np.abs(system.M).max(initial=1e-3))


@pytest.mark.few(3)
@pytest.mark.parametrize("seed", range(12))
def test_without_loads_it_is_the_linearisation_of_random_trees(seed):
    model = spatial(seed, bodies=3, negative=True)
    agree(model, model.linearize())


@pytest.mark.few(2)
@pytest.mark.parametrize("seed", range(6))
def test_without_loads_it_is_the_linearisation_of_planar_loops(seed):
    model = planar(seed, bodies=4, loops=2)
    agree(model, model.linearize())


def test_rotations_and_their_logarithm():
    w = np.array([0.4, -1.1, 0.7])
    assert np.allclose(np.array(logarithm(ca.DM(finite(w)))).ravel(), w, rtol=1e-14)
    assert np.allclose(np.array(exponential(ca.DM(1e-3 * w))), finite(1e-3 * w), rtol=0, atol=1e-16)


def test_stewart_platform():
    model = mv.library.stewart()
    agree(model, model.linearize())


def test_equations_about_another_pose_count_what_springs_hold():
    model = mv.Model()
    model.add_body("bob", 2.0, (0.1, 0.1, 0.1), (1.0, 0.0, 0.0))
    model.add_joint("slide", "prismatic", "ground", "bob", axis=(1, 0, 0))
    model.add_spring("k", "ground", "bob", (0.0, 1.0, 0.0), (1.0, 0.0, 0.0), 100.0)
    exact = Lagrangian(model)
    x = 0.3
    local = exact.at((np.array([[1.0 + x, 0.0, 0.0]]), np.eye(3)[None]))
    length, before = np.hypot(1.0 + x, 1.0), np.sqrt(2.0)
    assert local.gradient[0] == pytest.approx(100.0 * (length - before) * (1.0 + x) / length, rel=1e-14)
    slope = 100.0 * ((1.0 + x) / length) ** 2 + 100.0 * (length - before) / length**3
    assert local.tangent[0, 0] == pytest.approx(slope, rel=1e-13)
    pose, step = exact.equilibrium((np.array([[1.0 + x, 0.0, 0.0]]), np.eye(3)[None]))
    assert step < 1e-13
    assert pose[0][0] == pytest.approx([1.0, 0.0, 0.0], abs=1e-13)


def with_loads(model, gravity=None, **loads):
    """A model as its exact equations see it when it carries loads; other parts of the library need not know them."""
    parts = {"bodies": model.bodies, "joints": model.joints, "springs": model.springs}
    return SimpleNamespace(**parts, gravity=gravity, loads=loads)


def pendulum():
    """A compound pendulum that hangs along -y and turns about z, its centre of mass 0.4 m below."""
    model = mv.Model()
    model.add_body("rod", 3.0, (0.3, 0.1, 0.2), (0.0, -0.4, 0.0))
    model.add_joint("hinge", "revolute", "rod", "ground", (0.0, 0.0, 0.0))
    return model


def test_pendulum_under_gravity():
    model = pendulum()
    stiffness, mass, residual = projected(with_loads(model, gravity=(0.0, -9.81, 0.0)), model.linearize())
    assert residual[0] == pytest.approx(0.0, abs=1e-14)
    assert stiffness[0, 0] == pytest.approx(3.0 * 9.81 * 0.4, rel=1e-14)
    assert mass[0, 0] == pytest.approx(0.2 + 3.0 * 0.4**2, rel=1e-14)


@pytest.mark.parametrize("follower", [False, True])
def test_pendulum_under_a_force_of_either_kind(follower):
    model = pendulum()
    load = SimpleNamespace(body="rod", force=(0.0, -7.0, 0.0), torque=(0.0, 0.0, 0.0), follower=follower,
                           position=(0.0, -0.6, 0.0))  # fmt: skip
    stiffness = projected(with_loads(model, tip=load), model.linearize())[0]
    assert stiffness[0, 0] == pytest.approx(0.0 if follower else 7.0 * 0.6, rel=1e-14, abs=1e-14)


def test_torques_of_either_kind_differ_by_twice_their_circulatory_part():
    model = mv.Model()
    model.add_body("ball", 1.0, (0.1, 0.1, 0.1))
    model.add_joint("socket", "spherical", "ground", "ball", (0.0, 0.0, 0.0))
    system = model.linearize()
    torque = np.array([0.3, -0.5, 0.8])
    words = {"body": "ball", "force": (0.0, 0.0, 0.0), "torque": torque, "position": None}
    dead = projected(with_loads(model, t=SimpleNamespace(**words, follower=False)), system)[0]
    follower = projected(with_loads(model, t=SimpleNamespace(**words, follower=True)), system)[0]
    half = 0.5 * np.cross(np.eye(3), torque).T  # columns e_k x torque
    # torque - theta x torque / 2 for the dead one, torque + theta x torque / 2 for the follower: less their slopes
    assert np.allclose(dead, half, rtol=0, atol=1e-15)
    assert np.allclose(follower, -half, rtol=0, atol=1e-15)


@pytest.mark.parametrize("tilt", [0.3, 2.0])
def test_equilibrium_of_a_pendulum_pushed_sideways(tilt):
    model = pendulum()
    push = SimpleNamespace(body="rod", force=(3.0 * 9.81 * np.tan(tilt), 0.0, 0.0), torque=(0.0, 0.0, 0.0),
                           follower=False, position=None)  # fmt: skip
    (centre, turn), step = Lagrangian(with_loads(model, gravity=(0.0, -9.81, 0.0), push=push)).equilibrium()
    angle = np.arctan(np.tan(tilt))  # the pendulum hangs along the force, from wherever it starts
    assert step < 1e-12
    assert abs(np.arctan2(*(centre[0] * [1, -1, 1])[:2]) - angle) % np.pi == pytest.approx(0.0, abs=1e-13)
    assert turn[0] == pytest.approx(finite(np.array([0.0, 0.0, np.arctan2(centre[0][0], -centre[0][1])])), abs=1e-12)
