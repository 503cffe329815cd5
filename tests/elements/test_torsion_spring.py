"""Torsion springs: closed forms, the twist of their law by extended precision, poses, refusals."""

import mpmath as mp
import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
from mbsvib.elements.bushing import Bushing
from mbsvib.elements.torsion_spring import TorsionSpring
from mbsvib.kinematics.pose import start
from mbsvib.linalg.rotations import exponential
from tests.support.random_models import rotation

K, C, J = 40.0, 0.3, 0.5


def hinge(kind="revolute", preload=None, **words):
    model = mv.Model("hinge")
    model.add_body("wheel", 2.0, (0.2, 0.3, J))
    model.add_joint("pin", kind, "ground", "wheel", (0, 0, 0), **({"axis": (0, 0, 1)} | words))
    model.add_torsion_spring("t", "ground", "wheel", (0, 0, 2), K, C, preload)
    return model


def test_it_is_a_spring_and_damper_about_one_axis():
    model = hinge()
    model.add_input("T", "wheel", "rz")
    model.add_force_output("moment", "t", "rz")
    for method in ("dense", "sparse"):
        omega = np.array([2.0, 9.0, 30.0])
        s = 1j * omega
        law = K + C * s
        assert_allclose(model.linearize(method=method).frequency_response(omega)[0, 0], law / (J * s**2 + law),
                        rtol=1e-13)  # fmt: skip
    assert model.parameters.units["t.stiffness"] == "N m/rad"
    assert model.parameters.units["t.damping"] == "N m s/rad"


def test_other_rotations_are_free():
    model = hinge("spherical", axis=None)
    assert_allclose(model.linearize().K, np.diag([0.0, 0.0, K]), atol=0.0)


def test_pendulum_in_balance():
    """m g d sin(angle) = k angle about a horizontal hinge, and the frequency there."""
    g, mass, arm = 9.81, 1.5, 0.4
    model = mv.Model("pendulum", gravity=(0, 0, -g))
    model.add_body("bob", mass, (0.0, 0.0, 0.0), (arm, 0, 0))
    model.add_joint("pin", "revolute", "ground", "bob", (0, 0, 0), axis=(0, 1, 0))
    model.add_torsion_spring("t", "ground", "bob", (0, 1, 0), 8.0)
    there = model.equilibrium()
    x, _, z = there.bodies["bob"].position
    angle = float(mp.findroot(lambda a: mass * g * arm * mp.cos(a) - 8 * a, 0.6))
    assert_allclose((x, z), (arm * np.cos(angle), -arm * np.sin(angle)), rtol=1e-9)
    assert there.springs["t"].preload == pytest.approx(-8.0 * angle, rel=1e-9)
    stiffness = 8.0 + mass * g * arm * np.sin(angle)
    assert there.linearize().modes().frequencies[0] == pytest.approx(
        np.sqrt(stiffness / (mass * arm**2)) / (2 * np.pi), rel=1e-9)  # fmt: skip


def quaternion(turn):
    """Quaternion of a rotation matrix in extended precision."""
    t = mp.matrix(turn.tolist())
    w = mp.sqrt(1 + t[0, 0] + t[1, 1] + t[2, 2]) / 2
    return [w, (t[2, 1] - t[1, 2]) / (4 * w), (t[0, 2] - t[2, 0]) / (4 * w), (t[1, 0] - t[0, 1]) / (4 * w)]


def twist_after(rho, q):
    """2 atan2(z, w) of exp(rho) after the rotation of a quaternion."""
    size = mp.sqrt(sum(r * r for r in rho))
    half = mp.sin(size / 2) / size if size else mp.mpf(1) / 2
    w, v = mp.cos(size / 2), [half * r for r in rho]
    return 2 * mp.atan2(w * q[3] + v[2] * q[0] + v[0] * q[2] - v[1] * q[1],
                        w * q[0] - v[0] * q[1] - v[1] * q[2] - v[2] * q[3])  # fmt: skip


def turned_by(pose, turn):
    """The pose after rotations (bodies + 1, 3, 3) about the centres of mass."""
    return pose.moved_by(np.concatenate((turn - np.eye(3), np.zeros((len(turn), 3, 1))), axis=2))


@pytest.mark.parametrize("seed", range(3))
def test_across_the_axis_a_bushing_has_the_same_energy_to_second_order(seed):
    rng = np.random.default_rng(seed)
    model = hinge("spherical", preload=7.0, axis=None, orientation=rotation(rng))
    pose = start(model)
    turn = exponential(np.array([rng.uniform(-0.9, 0.9, 3), np.zeros(3)]))
    part = model.springs["t"].in_pose(turned_by(pose, turn), False)
    assert isinstance(part, Bushing)
    axes = np.array(part.orientation)
    stiffness, damping, preload = np.array(part.stiffness), np.array(part.damping), np.array(part.preload)
    with mp.workdps(40):
        q = quaternion(axes.T @ turn[0] @ axes)

        def energy(*rho):
            twist = twist_after(rho, q)
            return K * twist**2 / 2 - 7 * twist

        slope = [mp.diff(energy, (0, 0, 0), tuple(int(i == k) for i in range(3))) for k in range(3)]
        curve = [[mp.diff(energy, (0, 0, 0), tuple(int(i == j) + int(i == k) for i in range(3))) for k in range(3)]
                 for j in range(3)]  # fmt: skip
        rate = [mp.diff(lambda *rho: twist_after(rho, q), (0, 0, 0), tuple(int(i == k) for i in range(3)))
                for k in range(3)]  # fmt: skip
    assert_allclose(preload[3:], [-float(value) for value in slope], rtol=1e-10, atol=1e-11)
    assert_allclose(stiffness[3:, 3:], [[float(value) for value in row] for row in curve], rtol=1e-10, atol=1e-9)
    assert_allclose(damping[3:, 3:], C * np.outer(*[[float(value) for value in rate]] * 2), rtol=1e-10, atol=1e-11)
    assert not stiffness[:3].any()
    assert not preload[:3].any()


def test_about_the_axis_it_stays_a_torsion_spring():
    there = hinge(preload=5.0).moved({"pin.rz": 0.3}, relaxed=True)
    assert there.springs["t"] == hinge(preload=5.0).springs["t"]
    model = hinge()
    turn = exponential(np.array([[0.0, 0.0, 0.3], [0.0, 0.0, 0.0]]))
    turned = model.springs["t"].in_pose(turned_by(start(model), turn), False)
    assert turned["preload"] == pytest.approx(-0.3 * K, rel=1e-15)
    assert "stiffness" in turned
    assert tuple(turned["axis"]) == (0.0, 0.0, 1.0)


@pytest.mark.parametrize(("words", "message"), [
    ({"axis": (0, 0, 0)}, "torsion spring 't': axis"),
    ({"stiffness": 0.0, "damping": 0.0}, "neither stiffness nor damping"),
    ({"second": "ground"}, "connects body 'ground' with itself"),
    ({"preload": "much"}, "torsion spring 't': preload"),
])  # fmt: skip
def test_refusals(words, message):
    with pytest.raises(mv.ModelError, match=message):
        hinge().replace("t", **words)


def test_sensitivities_and_batches():
    model = hinge()
    batch = model.linearize(values={"t.stiffness": [10.0, 20.0]})
    assert_allclose(batch.K[:, 0, 0], [10.0, 20.0], rtol=1e-15)
    root = -C / (2 * J) + 1j * np.sqrt(K / J - (C / (2 * J)) ** 2)
    system = model.linearize()
    upper = system.modes().eigenvalues.imag > 0
    result = system.eigenvalue_sensitivities(["t.stiffness", "t.damping"])[:, upper]
    slope = -1 / (2 * root * J + C)
    assert_allclose(result, [[slope], [root * slope]], rtol=1e-8)


def test_many_in_one_pose_are_those_one_by_one():
    """Unmoved ones, ones near half a turn, ones with swing; an equal turn has the moment preload - k angle."""
    rng = np.random.default_rng(5)
    model = mv.Model("many")
    for i in range(6):
        model.add_body(f"b{i}", 1.0, (1, 1, 1), rng.normal(size=3))
    for i in range(5):
        model.add_torsion_spring(f"t{i}", f"b{i}", f"b{i + 1}", rng.normal(size=3), 3.0 + i, preload=1.0)
    vectors = np.zeros((7, 3))
    vectors[2] = 3.0 * np.array(model.springs["t1"].axis)
    vectors[3] = vectors[2] + 0.4 * np.array(model.springs["t1"].axis)
    vectors[4:6] = vectors[3]
    pose = turned_by(start(model), exponential(vectors))
    parts = list(model.springs.values())
    together = TorsionSpring.all_in_pose(parts, pose, False)
    assert together[0] is parts[0]
    assert together[1]["preload"] == pytest.approx(1.0 - 4.0 * 3.0, rel=1e-14)
    for part, one in zip(parts, together, strict=True):
        alone = part.in_pose(pose, False)
        assert type(alone) is type(one)
        if isinstance(one, dict):
            assert_allclose(np.array([one[k] for k in ("preload", "stiffness")]),
                            [alone[k] for k in ("preload", "stiffness")], rtol=1e-14)  # fmt: skip
            assert_allclose(one["axis"], alone["axis"], rtol=1e-14)
        elif one is not part:
            assert_allclose(one.stiffness, alone.stiffness, rtol=0, atol=1e-13)
