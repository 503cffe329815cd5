"""Beams and superelements as linear blocks: eigenvalues at the pose are those of the linear model."""

import casadi as ca
import numpy as np
import pytest
from scipy.linalg import eigvals

import mbsvib as mv
from mbsvib.elements import beam_expansion
from mbsvib.finite_motion.statement import finite_motion
from mbsvib.linalg.rotations import skew

TUBE = {"type": "tube", "radius": 0.02, "wall": 0.003}
STEEL = {"E": 2.1e11, "nu": 0.3, "rho": 7800.0}


def eigenvalues(model, **options):
    """Eigenvalues of the statement linearized in the pose as described."""
    fm = finite_motion(model, **options)
    q, qd, multiplier = fm.motion.q, fm.motion.qd, ca.SX.sym("l", fm.jacobian.shape[0])
    wanted = [fm.mass, fm.forces, fm.jacobian, -ca.jacobian(fm.forces, q), -ca.jacobian(fm.forces, qd)]
    values = [np.zeros(q.shape)] * 2
    mass, force, jacobian, stiffness, damping = map(np.array, ca.Function("f", [q, qd], wanted)(*values))
    t = np.eye(len(mass))
    if len(jacobian):
        _, sizes, v = np.linalg.svd(jacobian)
        t = v[np.count_nonzero(sizes > 1e-9 * sizes[0]) :].T
        lagrange = np.linalg.lstsq(jacobian.T, -force[:, 0], rcond=1e-9)[0]
        second = ca.Function("s", [q, multiplier], [ca.jacobian(fm.jacobian.T @ multiplier, q)])
        stiffness = stiffness - np.array(second(values[0], lagrange))
        force = force + jacobian.T @ lagrange[:, None]
    assert np.abs(force).max() < 1e-8 * max(np.abs(stiffness).max(), 1.0)
    m, c, k = (t.T @ matrix @ t for matrix in (mass, damping, stiffness))
    n = len(m)
    a = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(m, k), -np.linalg.solve(m, c)]])
    return eigvals(a), fm


def assert_same(model, rtol=1e-8):
    ours, fm = eigenvalues(model)
    theirs = model.linearize().modes().eigenvalues
    ours, theirs = (values[np.argsort(np.abs(values))] for values in (ours, theirs))
    assert len(ours) == len(theirs)
    for value in ours:
        assert np.abs(theirs - value).min() <= rtol * max(abs(value), 1.0)
    return fm


def all_moved(model, body):
    """Inputs in all directions, so that no coordinate is left out."""
    for d in ("x", "y", "z", "rx", "ry", "rz"):
        model.add_input(f"in.{body}.{d}", body, d)
    return model


@pytest.mark.few(1)
@pytest.mark.parametrize("damping", [{}, {"beta": 1e-5}, {"alpha": 2.0}, {"damping_ratio": 0.02}])
def test_cantilever_on_the_ground(damping):
    model = mv.Model("c")
    model.add_body("tip", 1.5, (0.01, 0.02, 0.015), (0.5, 0.1, 0.0))
    model.add_beam("b", "ground", "tip", TUBE, STEEL, (0, 0, 0), (0.5, 0, 0), elements=3, **damping)
    fm = assert_same(model)
    assert fm.motion.names[:6] == tuple(f"b.3.{d}" for d in ("x", "y", "z", "rx", "ry", "rz"))
    assert len(fm.motion.names) == 18


@pytest.mark.slow
def test_beam_that_a_moving_body_carries():
    """A rotor arm on a pivot: rigid motion of the root and small displacements in its frame."""
    model = mv.Model("arm")
    model.add_body("hub", 2.0, (0.02, 0.02, 0.02), (0.0, 0.05, 0.0))
    model.add_joint("pivot", "spherical", "ground", "hub", (0, 0, 0))
    model.add_bushing("k", "ground", "hub", (0, 0, 0), (0, 0, 0, 50, 60, 70), (0, 0, 0, 0.1, 0.2, 0.3))
    model.add_beam("b", "hub", None, TUBE, STEEL, (0.1, 0, 0), (0.6, 0.2, 0), elements=3, beta=1e-5, alpha=0.3)
    fm = assert_same(all_moved(model, "b.3"))
    assert fm.total_kinetic.is_scalar()
    assert len(fm.motion.names) == 3 + 18


@pytest.mark.slow
def test_two_bodies_on_one_floating_beam():
    model = mv.Model("free")
    for name, x in (("left", 0.0), ("right", 0.7)):
        model.add_body(name, 1.0, (0.01, 0.01, 0.02), (x, 0.02, 0.0))
    model.add_beam("b", "left", "right", TUBE, STEEL, (0, 0, 0), (0.7, 0, 0), elements=2)
    ours, _ = eigenvalues(model)
    frequencies = np.sort(np.abs(ours.imag))[::2] / (2 * np.pi)
    np.testing.assert_allclose(frequencies[6:], np.sort(model.linearize().modes().frequencies)[6:], rtol=1e-8)


def test_weight_of_beams():
    """A beam that sags under its weight: what equilibrium states is at rest in finite motion."""
    model = mv.Model("sag", gravity=(0, 0, -9.81))
    model.add_beam("b", "ground", None, {"type": "circle", "radius": 0.003}, STEEL, (0, 0, 0), (0.3, 0, 0), elements=3)
    model = all_moved(model.equilibrium(), "b.3")
    ours, _ = eigenvalues(model)  # at rest: forces are asserted to be zero
    straight = np.sort(np.abs(eigvals_of(mv.Model("s"), "b")))
    np.testing.assert_allclose(np.sort(np.abs(ours)), straight, rtol=1e-6)  # its slope of 7e-4 rad has a square of 5e-7


def eigvals_of(model, name):
    model.add_beam(name, "ground", None, {"type": "circle", "radius": 0.003}, STEEL, (0, 0, 0), (0.3, 0, 0), elements=3)
    return model.linearize().modes().eigenvalues


def test_singular_beam_moves_in_its_plane_only():
    fm = finite_motion(mv.library.singular_beam(), without=("drop",))
    assert fm.motion.names[:4] == ("base.rz", "elbow.rz", "rail.z", "beam.4.z")
    assert len(fm.motion.names) == 10


@pytest.mark.slow
def test_interface_that_two_parts_hold():
    """A plate on two beams: the displacements of the second follow from those of the first."""
    model = mv.Model("plate")
    model.add_body("plate", 3.0, (0.05, 0.04, 0.08), (0.0, 0.0, 0.5))
    for i, x in enumerate((-0.2, 0.2)):
        model.add_beam(f"leg{i}", "ground", "plate", TUBE, STEEL, (x, 0, 0), (x, 0, 0.5), elements=2)
    fm = assert_same(model)
    assert len(fm.motion.names) == 6 + 2 * 6


def superelement(model, **bodies):
    """A beam of two elements, free at both ends, as the matrices of a superelement on three nodes."""
    beam = mv.Model("source").add_beam("s", None, None, TUBE, STEEL, (0, 0, 0), (0.6, 0, 0), elements=2)
    points = np.array(beam.points)
    relative = np.zeros((12, 18))  # the nodes against the first one, which carries them
    for k in (1, 2):
        relative[6 * k - 6 : 6 * k, 6 * k : 6 * k + 6] = np.eye(6)
        relative[6 * k - 6 : 6 * k, :6] = -np.eye(6)
        relative[6 * k - 6 : 6 * k - 3, 3:6] = skew(points[k] - points[0])
    part = beam_expansion.elastic_part(beam)
    rows = part.rows @ relative
    mass = np.zeros((18, 18))
    for i, piece in enumerate(beam_expansion.masses(beam)):
        mass[6 * i : 6 * i + 12, 6 * i : 6 * i + 12] += piece.matrix.T @ piece.matrix
    model.add_superelement("se", mass, 1e-5 * rows.T @ (part.values[:, None] * rows),
                           rows.T @ (part.values[:, None] * rows), dict(zip("abc", beam.points, strict=True)),
                           bodies)  # fmt: skip


@pytest.mark.parametrize("carrier", ["ground", "hub"])
def test_superelement(carrier):
    model = mv.Model("se")
    if carrier == "hub":
        model.add_body("hub", 2.0, (0.02, 0.02, 0.02), (0.0, 0.05, 0.0))
        model.add_joint("pivot", "spherical", "ground", "hub", (0, 0, 0))
        model.add_bushing("k", "ground", "hub", (0, 0, 0), (0, 0, 0, 50, 60, 70))
    superelement(model, a=carrier)
    assert_same(all_moved(model, "se.c"), rtol=1e-7)


def test_mass_of_a_bent_superelement():
    """The inertia about the pivot is that of the nodes where they are, as in linearize."""
    model = mv.Model("se")
    model.add_body("hub", 2.0, (0.02, 0.02, 0.02), (0.0, 0.05, 0.0))
    model.add_joint("pivot", "spherical", "ground", "hub", (0, 0, 0))
    model.add_bushing("k", "ground", "hub", (0, 0, 0), (0, 0, 0, 5e5, 6e5, 7e5))
    superelement(model, a="hub")
    model.add_load("push", "se.c", force=(0, 2000, 1500))
    model = all_moved(model.equilibrium(), "se.c")
    fm, system = finite_motion(model), model.linearize()
    mass = np.array(ca.Function("f", [fm.motion.q], [fm.mass])(np.zeros(fm.motion.q.shape)))
    ours, theirs = (matrix[np.ix_(i, i)] for matrix, i in (
        (mass, [fm.motion.names.index(f"pivot.r{d}") for d in "xyz"]),
        (system.M, [system.coordinates.index(f"pivot.r{d}") for d in "xyz"])))  # fmt: skip
    assert abs(theirs[0, 1]) > 3e-3  # its bend matters
    np.testing.assert_allclose(ours, theirs, rtol=1e-12, atol=1e-15)


def test_beam_between_bodies_that_joints_hold_is_refused():
    model = mv.Model("coupler")
    for name, x in (("crank", 0.0), ("rocker", 0.7)):
        model.add_body(name, 1.0, (0.01, 0.01, 0.02), (x, 0.1, 0.0))
        model.add_joint(f"{name}.pin", "revolute", "ground", name, (x, 0, 0), axis=(0, 0, 1))
    model.add_beam("b", "crank", "rocker", TUBE, STEEL, (0, 0.2, 0), (0.7, 0.2, 0))
    with pytest.raises(mv.ModelError, match="'b' bends between the moving bodies 'crank' and 'rocker'"):
        finite_motion(model)
