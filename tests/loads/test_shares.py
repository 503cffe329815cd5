"""Reactions of joints, and shares of the strain energy, against statics and matrices done otherwise."""

import numpy as np
import pytest

import mbsvib as mv
from tests.loads.test_against_lagrangian import linearized


@pytest.mark.few(2)
@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("loops", [0, 1])
def test_reactions_balance_every_body(seed, loops):
    """Newton's third law: all that acts on each body, joints included, is zero; joints do no work."""
    model, system = linearized(seed, bodies=4, loops=loops, hold="loads", torque=True)
    if system is None or not system.dof:
        pytest.skip("the random bodies are locked")
    total = {name: np.zeros(6) for name in model.bodies}

    def act(body, at, wrench):
        if body != "ground":
            force, torque = np.split(np.asarray(wrench), 2)
            arm = np.subtract(at, model.bodies[body].position)
            total[body] += np.concatenate((force, torque + np.cross(arm, force)))

    for body in model.bodies.values():
        act(body.name, body.position, (*np.multiply(body.mass, model.gravity), 0, 0, 0))
    for load in model.loads.values():
        act(load.body, load.position or model.bodies[load.body].position, (*load.force, *load.torque))
    for spring in model.springs.values():
        if isinstance(spring, mv.elements.Spring):
            pull = np.multiply(-spring.tension, spring.line)
            act(spring.second, spring.end, (*pull, 0, 0, 0))
            act(spring.first, spring.start, (*-pull, 0, 0, 0))
        elif spring.preload is not None:
            wrench = (np.array(spring.orientation) @ np.reshape(spring.preload, (2, 3)).T).T.ravel()
            act(spring.second, spring.position, wrench)
            act(spring.first, spring.position, -wrench)
    for name, wrench in system.reactions.items():
        joint = model.joints[name]
        at = joint.point or model.bodies[joint.first if joint.second == "ground" else joint.second].position
        act(joint.second, at, wrench)
        act(joint.first, at, -wrench)
        assert all(abs(np.dot(wrench, six)) < 1e-8 for _, six in joint.freedom)
    assert max(np.abs(wrench).max() for wrench in total.values()) < 1e-8


@pytest.mark.few(1)
@pytest.mark.parametrize("scene", [{}, {"loops": 1}, {"hold": "loads", "torque": True, "follower": True}])
def test_shares_add_up_to_one(scene):
    _, system = linearized(2, bodies=4, **scene)
    modes = system.modes()
    shares = system.stiffness_shares(modes)
    assert np.allclose(shares.shares.sum(axis=0), 1.0, rtol=0, atol=1e-9)
    assert np.allclose(sum(shares.by_kind().values()), 1.0, rtol=0, atol=1e-9)
    assert set(shares.by_kind()) == {"elastic", "preload", "load", "reaction"}
    assert "reaction" in str(shares)


def test_shares_are_those_of_the_matrices():
    """Without its geometric stiffness a system has the elastic shares alone."""
    _, system = linearized(5, bodies=3)
    elastic = system.row_owner < len(system.provenance.springs)
    rows, k, shapes = system.elastic_rows[elastic], system.row_stiffness[elastic], system.modes().shapes
    part = np.abs(np.einsum("mi,mn,ni->i", shapes.conj(), rows.T @ (k[:, None] * rows), shapes))
    full = np.einsum("mi,mn,ni->i", shapes.conj(), system.K, shapes).real
    assert np.allclose(system.stiffness_shares().by_kind()["elastic"], part / full, rtol=1e-9)


def test_a_pendulum_is_held_by_its_hinge_alone():
    model = mv.Model("pendulum", gravity=(0, 0, -10.0))
    model.add_body("bob", 2.0, (0.1, 0.1, 0.1), position=(0, 0, -1))
    model.add_joint("hinge", "revolute", "ground", "bob", position=(0, 0, 0), axis=(0, 1, 0))
    system = model.linearize()
    shares = system.stiffness_shares()
    assert (shares.elements, shares.kinds) == (("hinge",), ("reaction",))
    assert shares.of("hinge") == pytest.approx([1.0])
    assert system.reactions["hinge"] == pytest.approx([0, 0, 20.0, 0, 0, 0])
    assert "gravity" in system.explain()


def test_an_unloaded_mechanism_has_elastic_shares_and_no_reactions():
    system = mv.library.stewart().linearize()
    shares = system.stiffness_shares(system.modes(3))
    assert set(shares.kinds) == {"elastic"}
    assert shares.shares.shape == (6, 3)
    assert not any(wrench.any() for wrench in system.reactions.values())


def test_rigid_body_modes_have_no_shares():
    model = mv.Model("pair")
    for k in range(2):
        model.add_body(f"b{k}", 1.0, (1, 1, 1), position=(0, 0, k))
        model.add_joint(f"j{k}", "prismatic", "ground", f"b{k}")
    model.add_spring("k", "b0", "b1", (0, 0, 0), (0, 0, 1), stiffness=5.0)
    shares = model.linearize().stiffness_shares().shares
    assert shares.tolist() == [[0.0, pytest.approx(1.0)]]


def test_shares_of_a_loop_under_loads_are_those_of_spring_controller_and_joint():
    """5 N m/rad of a spring, 10 of a controller and 2 kg 9.81 m/s^2 1 m of the weight add up to 34.62 N m/rad."""
    model = mv.Model("pendulum", gravity=(0, 0, -9.81))
    model.add_body("rod", 2.0, (0.3, 0.3, 0.1), position=(0, 0, -1.0))
    model.add_joint("hinge", "revolute", "ground", "rod", (0, 0, 0), axis=(1, 0, 0))
    model.add_bushing("spring", "ground", "rod", (0, 0, 0), (0, 0, 0, 5.0, 0, 0))
    model.add_input("torque", "rod", "rx")
    model.add_output("angle", "rod", "rx")
    loop = model.linearize().feedback(np.array([[-10.0]]), sensors=["angle"], actuators=["torque"])
    shares = loop.second_order.stiffness_shares()
    for name, part in (("spring", 5.0), ("controller", 10.0), ("hinge", 19.62)):
        np.testing.assert_allclose(shares.of(name), part / 34.62, rtol=1e-12, err_msg=name)
