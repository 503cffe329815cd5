"""Spring-dampers as stacked rows: any symmetric matrix, in any axes, whatever its rank, sign and scale."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import mbsvib as mv
from tests.support.compare import assert_same_eigenvalues, assert_same_matrices, assert_same_response, frequencies
from tests.support.exact import Exact
from tests.support.random_models import rotation, seeds

ROWS = np.random.default_rng(0).normal(size=(6, 6))
SCALE = np.diag([1e5, 1e5, 1e5, 1e-2, 1e-2, 1e-2])
MATRICES = {
    "positive": 100 * ROWS @ ROWS.T + np.eye(6),
    "of rank one": 1e3 * np.outer(ROWS[0], ROWS[0]),
    "of rank three": 100 * ROWS[:3].T @ ROWS[:3],
    "indefinite": 100 * (ROWS + ROWS.T),
    "without diagonal": 100 * ((ROWS + ROWS.T) - np.diag(np.diag(ROWS + ROWS.T))),
    "over fourteen decades": SCALE @ (ROWS @ ROWS.T + np.eye(6)) @ SCALE,
    "diagonal over twelve decades": np.diag([1e9, 1e9, 1e9, 1e-3, 1e-3, 1e-3]),
    "a single entry": np.diag([0.0, 0.0, 5.0, 0.0, 0.0, 0.0]),
}
DAMPING = {
    "none": lambda k: {},
    "in proportion": lambda k: {"damping": 1e-3 * k},
    "opposite": lambda k: {"damping": -1e-3 * k},
    "of its own": lambda k: {"damping": ROWS.T @ ROWS},
    "six values": lambda k: {"damping": range(1, 7)},
}


def held(stiffness, damping, seed=0):
    """A floating body on one bushing, and on a soft one that keeps it from drifting."""
    rng = np.random.default_rng(seed)
    model = mv.Model("held")
    model.add_body("b", 2.0, (0.3, 0.4, 0.5))
    symmetric = (stiffness + stiffness.T) / 2
    model.add_bushing("k", "ground", "b", (0.1, 0.2, 0.3), symmetric, orientation=rotation(rng), **damping(symmetric))
    model.add_bushing("soft", "ground", "b", (0, 0, 0), (10.0,) * 6)
    model.add_input("f", "b", (1, 2, 3, 1, 1, 1))
    model.add_output("x", "b", (1, 2, 3, 1, 1, 1))
    model.add_force_output("F", "k", rng.normal(size=6))
    return model


@pytest.mark.few(6)
@pytest.mark.parametrize("damping", DAMPING)
@pytest.mark.parametrize("stiffness", MATRICES)
def test_any_symmetric_matrix(stiffness, damping):
    model = held(MATRICES[stiffness], DAMPING[damping])
    system, reference = model.linearize(), Exact(model)
    assert_same_matrices(system, reference, rtol=1e-13)
    wide = "decades" in stiffness
    assert_same_eigenvalues(system.modes().eigenvalues, reference.eigenvalues, rtol=1e-9)
    omega = frequencies(reference)
    # a force that is the product of 1e9 N/m and a displacement a billion times smaller than the others
    rtol = 1e-5 if wide else 1e-9
    assert_same_response(system.frequency_response(omega), reference.frequency_response(omega), rtol=rtol)


@given(seeds(), st.integers(1, 6))
def test_rows_times_coefficients_give_the_matrix_back(seed, rank):
    """One body at the bushing: K is the bushing's matrix in world axes."""
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=(rank, 6)) * 10 ** rng.uniform(-3, 3, size=6)
    matrix = rows.T @ (rng.choice([-1, 1], size=rank)[:, None] * rows)
    matrix = (matrix + matrix.T) / 2
    axes = rotation(rng)
    model = mv.Model()
    model.add_body("b", 1.0, (1, 1, 1), position=(1, 2, 3))
    model.add_bushing("k", "ground", "b", (1, 2, 3), matrix, orientation=axes)
    system = model.linearize()
    turn = np.kron(np.eye(2), axes)
    size = np.linalg.norm(np.abs(turn) @ np.abs(rows.T), axis=1)  # of the terms, which may cancel along an axis
    assert (np.abs(system.K - turn @ matrix @ turn.T) <= 1e-13 * np.outer(size, size)).all()


def test_springs_in_a_row_and_side_by_side():
    """A spring split among many adds up; a spring that bodies slide along does not act."""
    model = mv.Model()
    model.add_body("b", 1.0, (1, 1, 1), position=(0, 0, 1))
    model.add_joint("j", "prismatic", "ground", "b")
    for i in range(10):
        model.add_spring(f"k{i}", "ground", "b", (0, 0, 0), (0, 0, 1), stiffness=7.0, damping=0.1)
    model.add_spring("across", "ground", "b", (5, 0, 1), (0, 0, 1), stiffness=1e6)
    system = model.linearize()
    assert_allclose((system.K, system.C), ([[70.0]], [[1.0]]), rtol=1e-14)
    assert "across" in system.explain()


def test_an_inclined_spring_acts_with_the_square_of_its_cosine():
    model = mv.Model()
    model.add_body("b", 1.0, (1, 1, 1))
    model.add_joint("j", "prismatic", "ground", "b", axis=(0, 0, 1))
    model.add_spring("k", "ground", "b", (3, 0, -4), (0, 0, 0), stiffness=100.0)
    model.add_force_output("F", "k")
    system = model.linearize()
    assert_allclose(system.K, [[64.0]], rtol=1e-15)
    assert_allclose(system.Cq, [[80.0]], rtol=1e-15)
