"""Superelements under loads: the energy of point masses on massless shapes, minimised by another road."""

import dataclasses

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

import mbsvib as mv
from tests.beams.reference import matrices

G = np.array([1.0, -2.0, -9.0])
NODES = {"left": np.array([0.3, 0.1, -0.1]), "mid": np.array([0.7, 0.0, 0.1]), "right": np.array([1.1, 0.2, 0.0])}
HUB, HUB_MASS, SPRING = np.array([0.1, 0.05, -0.2]), 1.5, 40.0


def shapes(rng, internal=2, masses=9):
    """Point masses (j,), their places (j, 3) and displacements (j, 3, n) per coordinate, exact for rigid motions."""
    points = np.array(list(NODES.values()))
    size = 6 * len(points) + internal
    positions = rng.uniform(-0.2, 1.2, (masses, 3))
    shape = np.zeros((masses, 3, size))
    for j, position in enumerate(positions):
        share = rng.uniform(0.1, 1.0, len(points))
        share /= share.sum()
        for i, (point, part) in enumerate(zip(points, share, strict=True)):
            x, y, z = position - point
            shape[j, :, 6 * i : 6 * i + 6] = part * np.hstack((np.eye(3), [[0, z, -y], [-z, 0, x], [y, -x, 0]]))
        shape[j, :, 18:] = rng.normal(0, 0.3, (3, internal))
    return rng.uniform(0.1, 0.4, masses), positions, shape


def stiffness(rng, internal=2):
    """Springs between the nodes that no rigid motion strains, and between them and internal coordinates."""
    points = np.array(list(NODES.values()))
    rigid = np.zeros((18, 6))
    for i, point in enumerate(points):
        x, y, z = point - points[0]
        rigid[6 * i : 6 * i + 6] = np.eye(6)
        rigid[6 * i : 6 * i + 3, 3:] = [[0, z, -y], [-z, 0, x], [y, -x, 0]]
    basis = np.linalg.qr(rigid)[0]
    rows = rng.normal(size=(30, 18)) @ (np.eye(18) - basis @ basis.T)
    rows = np.hstack((rows, rng.normal(size=(30, internal))))
    return 300.0 * rows.T @ rows


class Reference:
    """Potential of a hub on a hinge about y with a spring, a superelement on it or on the ground, and a force."""

    def __init__(self, hinged, seed=3):
        rng = np.random.default_rng(seed)
        self.hinged, (self.mass, self.places, self.shape), self.k = hinged, shapes(rng), stiffness(rng)
        self.force = np.array([2.0, 1.0, -3.0])
        self.m = np.einsum("j,jia,jib->ab", self.mass, self.shape, self.shape)

    def model(self, **words):
        model = mv.Model("loaded", gravity=G)
        held = "ground"
        if self.hinged:
            held = "hub"
            model.add_body("hub", HUB_MASS, (0.02, 0.03, 0.04), HUB)
            model.add_joint("hinge", "revolute", "ground", "hub", (0, 0, 0), axis=(0, 1, 0))
            model.add_bushing("k", "ground", "hub", (0, 0, 0), (0, 0, 0, 0, SPRING, 0))
        model.add_superelement("part", self.m, None, self.k, NODES, bodies={"mid": held}, **words)
        model.add_load("push", "part.right", self.force)
        return model

    def state(self, q):
        """Angle of the hub, and the coordinates of the part in its frame, those of the middle node being none."""
        x = np.concatenate((q[1:7], np.zeros(6), q[7:]))
        return (q[0] if self.hinged else 0.0), x

    def potential(self, q):
        angle, x = self.state(q)
        frame = Rotation.from_rotvec((0, angle, 0)).as_matrix()
        masses = (self.places + self.shape @ x) @ frame.T
        value = 0.5 * x @ self.k @ x - (self.mass * (masses @ G)).sum()
        value -= self.force @ frame @ (NODES["right"] + x[12:15])
        if self.hinged:
            value += 0.5 * SPRING * angle**2 - HUB_MASS * G @ (frame @ HUB)
        return value

    def gradient(self, q, step=1e-5):
        """Central differences of the potential, exact up to third derivatives in the angle alone."""
        e = np.eye(len(q)) * step
        return np.array([(8 * (self.potential(q + d) - self.potential(q - d)) - self.potential(q + 2 * d)
                          + self.potential(q - 2 * d)) / (12 * step) for d in e])  # fmt: skip


@pytest.mark.parametrize("hinged", [True, False])
def test_the_pose_of_least_energy(hinged):
    reference = Reference(hinged)
    actual = reference.model().equilibrium(report=True)
    q = np.zeros(15)
    for _ in range(5):  # Newton, with the exact stiffness of the elastic part as the start of BFGS
        result = minimize(reference.potential, q, jac=reference.gradient, method="BFGS", options={"gtol": 1e-9})
        q = result.x
    angle, x = reference.state(q)
    frame = Rotation.from_rotvec((0, angle, 0))
    there = actual.model
    np.testing.assert_allclose(there.superelements["part"].displacements, x, atol=1e-7)
    np.testing.assert_allclose(actual.displacements["part.right"][:3],
                               frame.apply(NODES["right"] + x[12:15]) - NODES["right"], atol=1e-7)  # fmt: skip
    if hinged:
        np.testing.assert_allclose(actual.displacements["hub"][3:], (0, angle, 0), atol=1e-7)
        assert abs(angle) > 0.02
    assert actual.residuals[-1] < 1e-11
    assert there.equilibrium(report=True).iterations == 0


@pytest.mark.few(1)
@pytest.mark.parametrize("hinged", [True, False])
def test_stiffness_is_the_hessian_there(hinged):
    """K over the coordinates of the reference, and what modes and sparse equations make of the same."""
    reference = Reference(hinged)
    there = reference.model().equilibrium()
    system = there.linearize(method="dense")
    angle = 0.0
    if hinged:
        turn = np.array(there.bodies["hub"].orientation)
        angle = float(np.arctan2(turn[0, 2], turn[0, 0]))
    x = np.array(there.superelements["part"].displacements)
    q = np.concatenate(([angle], x[:6], x[12:]))
    step, unit = 1e-4, np.eye(15)
    hessian = np.array([(reference.gradient(q + step * e, 1e-3) - reference.gradient(q - step * e, 1e-3)) / (2 * step)
                        for e in unit])  # fmt: skip
    # displacements of the nodes per coordinate of the system, as changes of the reference's coordinates
    frame = Rotation.from_rotvec((0, angle, 0)).as_matrix()
    motion = {name: system.body_motion[i] for i, name in enumerate(system.bodies)}
    hub = motion["hub"] if hinged else np.zeros((6, system.dof))
    middle = frame @ NODES["mid"]
    rows = [hub[4]]
    for node, first in (("left", 0), ("right", 12)):
        here = dict(there.superelements["part"].nodes)[node]
        arm = np.array(here) - middle
        root = np.concatenate((hub[:3] + np.cross(hub[3:].T, middle - frame @ HUB).T, hub[3:]))
        change = motion[f"part.{node}"] - root
        change[:3] -= np.cross(hub[3:].T, arm).T
        rho = x[first + 3 : first + 6]
        jacobian = np.array([(Rotation.from_rotvec(1e-6 * e) * Rotation.from_rotvec(rho)).as_rotvec()
                             - (Rotation.from_rotvec(-1e-6 * e) * Rotation.from_rotvec(rho)).as_rotvec()
                             for e in np.eye(3)]).T / 2e-6  # fmt: skip
        rows += [*(frame.T @ change[:3]), *(jacobian @ frame.T @ change[3:])]
    rows += list(motion["part.internal1"][:2])
    basis = np.array(rows)
    if not hinged:
        basis[0] = 0.0
    np.testing.assert_allclose(system.K, basis.T @ hessian @ basis, atol=2e-6 * np.abs(system.K).max())
    sparse = there.linearize(method="sparse").modes(3)
    np.testing.assert_allclose(sparse.natural, system.modes().natural[:3], rtol=1e-8)


def test_a_loaded_model_as_described():
    """The pose is the loaded one: forces follow from statics, and are to first order those of the pose without."""
    model = Reference(True).model().with_values({"gravity.x": 1e-5, "gravity.y": -2e-5, "gravity.z": -9e-5} | {
        f"push.force.{axis}": 1e-5 * value for axis, value in zip("xyz", (2.0, 1.0, -3.0), strict=True)})  # fmt: skip
    there = model.equilibrium()
    part = there.superelements["part"]
    stated = there.with_parts(composed={"part": dataclasses.replace(part, displacements=None)})
    result, expected = (item.linearize().provenance.statics.pairs for item in (stated, there))
    assert np.abs(expected.force).max() > 1e-5
    np.testing.assert_allclose(result.force, expected.force, atol=1e-4 * np.abs(expected.force).max())
    np.testing.assert_allclose(result.torque, expected.torque, atol=1e-4 * np.abs(expected.torque).max())


def test_gravity_on_what_the_mass_does_not_tell():
    model = mv.Model("held", gravity=(0, 0, -9.81))
    model.add_superelement("lump", np.eye(6), None, 1e3 * np.eye(6), {"node": (0, 0, 0)}, grounded=True)
    with pytest.raises(mv.ModelError, match=r"superelement 'lump': its mass matrix .* nodes on the ground"):
        model.linearize()
    model = mv.Model("uneven", gravity=(0, 0, -9.81))
    model.add_superelement("lump", np.diag((1.0, 2.0, 3.0, 1, 1, 1)), None, np.zeros((6, 6)), {"node": (0, 0, 0)})
    model.add_bushing("k", "ground", "lump.node", (0, 0, 0), (1e3,) * 6, preload=(0, 0, 9.81, 0, 0, 0))
    with pytest.raises(mv.ModelError, match=r"superelement 'lump': its mass for translations .* \[1\.0, 2\.0, 3\.0\]"):
        model.equilibrium()


def test_a_cantilever_under_its_weight():
    """One element with its consistent mass: tip and slope are those of the text books."""
    length, area, second, modulus, rho = 0.8, 3e-4, 2e-8, 7e10, 2700.0
    k, m = (np.array(part) for part in matrices(length, area, second, 5e-9, 1e-8, modulus, 2.6e10, rho))
    for nodes in ({"root": (0, 0, 0), "tip": (length, 0, 0)}, {"tip": (length, 0, 0), "root": (0, 0, 0)}):
        order = np.arange(12) if next(iter(nodes)) == "root" else np.r_[6:12, 0:6]
        model = mv.Model("weight", gravity=(0, 0, -9.81))
        model.add_superelement("rod", m[np.ix_(order, order)], None, k[np.ix_(order, order)], nodes,
                               bodies={"root": "ground"})  # fmt: skip
        six = model.equilibrium(report=True).displacements["rod.tip"]
        load = rho * area * 9.81
        assert six[2] == pytest.approx(-load * length**4 / (8 * modulus * second), rel=1e-9)
        assert six[4] == pytest.approx(load * length**3 / (6 * modulus * second), rel=1e-9)


def test_files_keep_the_displacements(tmp_path):
    there = Reference(True).model().equilibrium()
    mv.save(there, tmp_path / "there.yaml")
    assert mv.load(tmp_path / "there.yaml").superelements["part"] == there.superelements["part"]
