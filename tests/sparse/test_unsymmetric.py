"""Sparse equations with rotors, follower loads and torques: the responses of dense ones, forces included."""

import numpy as np
import pytest
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

import mbsvib as mv
from mbsvib.api.sparse_system import SparseSystem
from mbsvib.elements import Bushing, Output
from mbsvib.sparse.tableau import Factor
from tests.sparse import scenes
from tests.support import overconstrained
from tests.support.loaded_models import loaded
from tests.support.random_models import spatial

OMEGA = np.array([0.0, 0.3, 4.0, 60.0])


def same(model, **words):
    dense, sparse = model.linearize(**words), model.linearize(method="sparse", **words)
    assert dense.gyroscopic is not None or dense.circulatory is not None
    expected = dense.frequency_response(OMEGA)
    result = sparse.frequency_response(OMEGA)
    np.testing.assert_allclose(result, expected, rtol=1e-9, atol=1e-11 * np.abs(expected).max())
    symmetric = model.with_parts(rotors={}, loads={}).linearize().frequency_response(OMEGA)
    assert np.abs(expected - symmetric).max() > 1e-6 * np.abs(expected).max()  # the terms count
    return sparse


@pytest.mark.parametrize("loops", [0, 1])
@pytest.mark.parametrize("seed", range(4))
def test_wheels_on_bodies(seed, loops):
    model = with_ports(spatial(seed, bodies=4, loops=loops, kinds=("spherical", "universal"), ports=False))
    rng = np.random.default_rng(seed)
    for k, body in enumerate(list(model.bodies)):
        model.add_rotor(f"wheel{k}", body, rng.uniform(50, 300), rng.normal(size=3), inertia=rng.uniform(0.01, 0.1))
    same(model)


def with_ports(model):
    body = list(model.bodies)[-1]
    model.add_input("push", body, (1.0, 0.3, -0.2, 0.1, 0.2, 0.3))
    model.add_output("moves", body, (0.2, 1.0, 0.5, 0.3, -0.1, 0.2))
    return model


@pytest.mark.few(2)
@pytest.mark.parametrize(("follower", "torque"), [(True, False), (False, True), (True, True)])
@pytest.mark.parametrize("loops", [0, 1])
def test_follower_loads_and_torques(loops, follower, torque):
    model = with_ports(loaded(7 + loops, bodies=4, loops=loops, follower=follower, torque=torque))
    dense, sparse = model.linearize(), model.linearize(method="sparse")
    assert dense.circulatory is not None
    expected = dense.frequency_response(OMEGA)
    np.testing.assert_allclose(sparse.frequency_response(OMEGA), expected, rtol=1e-9,
                               atol=1e-11 * np.abs(expected).max())  # fmt: skip
    np.testing.assert_allclose(sparse.static_compliance(), expected[..., 0].real, rtol=1e-9,
                               atol=1e-11 * np.abs(expected).max())  # fmt: skip


@pytest.mark.parametrize("name", ["rotor_stator", "sleeping_top"])
def test_models_of_the_library_that_spin(name):
    model = getattr(mv.library, name)()
    model = model.with_parts(outputs={k: out for k, out in model.outputs.items() if isinstance(out, Output)})
    result = model.linearize(method="sparse").frequency_response(OMEGA[1:])
    expected = model.linearize().frequency_response(OMEGA[1:])
    np.testing.assert_allclose(result, expected, rtol=1e-9, atol=1e-11 * np.abs(expected).max())


def shaft(disks):
    """Disks on a shaft of beams, that spin on it."""
    model = mv.Model("shaft")
    model.add_beam("shaft", None, None, {"type": "circle", "radius": 0.01}, {"E": 2.1e11, "nu": 0.3, "rho": 7800},
                   (0, 0, 0), (0, 0, 1), elements=2 * disks)  # fmt: skip
    for k in (0, 2 * disks):
        model.add_bushing(f"bearing{k}", "ground", f"shaft.{k}", (0, 0, k / (2 * disks)), (1e6, 1e6, 1e6, 0, 0, 1e2))
    for k in range(disks):
        at = 2 * k + 1
        model.add_body(f"disk{k}", 1.0, (2e-3, 2e-3, 4e-3), (0, 0, at / (2 * disks)))
        model.add_joint(f"fit{k}", "fixed", f"shaft.{at}", f"disk{k}")
        model.add_rotor(f"spin{k}", f"disk{k}", 500.0, (0, 0, 1), inertia=4e-3)
    model.add_input("F", "disk0", "x")
    model.add_output("y", "disk0", "y")
    return model


def test_disks_on_a_shaft_of_beams():
    sparse = same(shaft(3))
    assert sparse.gyroscopic.nnz


def with_all_forces(model):
    """Forces in joints, springs and bushings, sums on bodies and the ground."""
    springs = [name for name, part in model.springs.items() if isinstance(part, Bushing)]
    for name in (*model.joints, *model.bodies, *springs, "ground"):
        for direction in ("x", "y", "z", "rx", "ry", "rz"):
            model.add_force_output(f"{name}!{direction}", name, direction)
    return model if model.inputs else with_ports(model)


def same_forces(model):
    model = with_all_forces(model)
    dense, sparse = (model.linearize(method=method) for method in ("dense", "sparse"))
    expected, result = dense.frequency_response(OMEGA[1:]), sparse.frequency_response(OMEGA[1:])
    size = np.abs(expected).max(axis=1, keepdims=True)
    assert (np.abs(result - expected) <= 1e-10 * (size + 1e-2 * size.max(axis=0))).all()


@pytest.mark.slow
@pytest.mark.parametrize("floating", [False, True])
@pytest.mark.parametrize(("follower", "torque"), [(True, False), (False, True), (True, True)])
@pytest.mark.parametrize("loops", [0, 1])
def test_forces_beside_follower_loads_and_torques(loops, follower, torque, floating):
    same_forces(loaded(17 + loops, 4, loops, follower=follower, torque=torque, floating=floating))


@pytest.mark.slow
@pytest.mark.parametrize("loops", [0, 1])
@pytest.mark.filterwarnings("ignore::mbsvib.UndeterminedForceWarning")
def test_forces_beside_wheels(loops):
    model = spatial(1, bodies=4, loops=loops, kinds=("spherical", "universal"), ports=False)
    for k, body in enumerate(list(model.bodies)):
        model.add_rotor(f"wheel{k}", body, 100.0 + 30.0 * k, (0.3, 1.0, -0.2 * k), inertia=0.05)
    same_forces(model)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cardan", "locomotive", "bennett"])
@pytest.mark.filterwarnings("ignore::mbsvib.UndeterminedForceWarning")
def test_forces_beside_wheels_where_joints_are_redundant(name):
    model, _ = overconstrained.ALL[name]()
    for k, (body, part) in enumerate(list(model.bodies.items())):
        model.add_bushing(f"held{k}", "ground", body, part.position, (1e3,) * 6, (3.0,) * 6)
    model.add_rotor("wheel", next(iter(model.bodies)), 200.0, (0.3, 0.2, 1.0), inertia=0.05)
    same_forces(model)


@pytest.mark.slow
def test_forces_in_bushings_that_turn_along():
    model = scenes.shaft(4, damping=1e-3, rotating=1e-4)
    assert model.linearize(method="sparse").circulatory is not None
    same_forces(model)


def test_large_models_that_spin_become_sparse_of_their_own_accord(monkeypatch):
    monkeypatch.setattr("mbsvib.sparse.choice.MANY", 10)
    monkeypatch.setattr("mbsvib.sparse.choice.is_small", lambda _: False)
    assert isinstance(shaft(8).linearize(), SparseSystem)


@pytest.mark.parametrize("kind", [float, complex])
@pytest.mark.parametrize("transposed", [False, True])
def test_solutions_of_a_factored_matrix_and_of_its_transpose(kind, transposed):
    """A of SI units is that of the factor between both scales; real matrices take complex right sides, too."""
    rng = np.random.default_rng(3)
    scaled = (rng.normal(size=(9, 9)) + (1j * rng.normal(size=(9, 9)) if kind is complex else 0.0)).astype(kind)
    rows, columns = 2.0 ** rng.integers(-9, 9, (2, 9))
    factor = Factor(csc_matrix(scaled), splu(csc_matrix(scaled)), rows, columns)
    a = scaled / rows[:, None] / columns
    for right in (rng.normal(size=9), rng.normal(size=(9, 3)) + 1j * rng.normal(size=(9, 3))):
        exact = np.linalg.solve(a.T if transposed else a, right)
        np.testing.assert_allclose(factor.solve(right, transposed=transposed), exact, rtol=1e-11)
    if not transposed:
        np.testing.assert_allclose(factor.solve_closely(np.ones((9, 2)), 1e-6)[0], np.linalg.solve(a, np.ones((9, 2))))
