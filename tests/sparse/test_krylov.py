"""Reduction by moments: orders of the error beside the frequencies, definiteness, free motions, refusals."""

import numpy as np
import pytest
import scipy.sparse as sp

import mbsvib as mv


def truss(n=60, held=True, damping="general", outputs=("z", "v", "a"), seed=0):
    """A chain with unequal masses, springs to the second neighbour, and dampers that are not proportional."""
    rng = np.random.default_rng(seed)
    near, far = (sp.diags([-1.0, 1.0], [0, k], (n - k, n)) for k in (1, 2))
    K = near.T @ sp.diags(4e4 * rng.uniform(0.5, 1.5, n - 1)) @ near
    K = K + far.T @ sp.diags(9e3 * rng.uniform(0.5, 1.5, n - 2)) @ far
    if held:
        K = K + sp.diags(np.eye(n)[0] * 2e4)
    dampers = near.T @ sp.diags(rng.uniform(0.0, 2.0, n - 1)) @ near
    C = {"general": dampers, "none": None, "stiffness": 1e-4 * K}[damping]
    unit = np.eye(n)
    b = unit[:, [5, n - 4]]
    rows = {"z": np.zeros((0, n)), "v": np.zeros((0, n)), "a": np.zeros((0, n))}
    points = {"z": 5, "v": 20, "a": 40}
    sensed = [np.array([unit[points[name]] if name == kind else 0.0 * unit[0] for name in outputs]) for kind in rows]
    return mv.System.from_matrices(sp.diags(rng.uniform(0.5, 1.5, n)), C, K, b, *sensed, inputs=["F", "G"],
                                   outputs=list(outputs))  # fmt: skip


def error(system, small, f):
    w = 2 * np.pi * np.atleast_1d(np.asarray(f, dtype=float))
    exact = system.frequency_response(w)
    return np.abs(small.frequency_response(w) - exact).max(axis=(0, 1)) / np.abs(exact).max()


@pytest.mark.few(1)
@pytest.mark.parametrize("damping", ["general", "none", "stiffness"])
def test_responses_are_exact_at_the_frequencies_and_flat_about_them(damping):
    """Displacement, velocity and acceleration: the error beside f grows at least with the fourth power."""
    system = truss(damping=damping)
    small = system.reduced(32, near=[0.0, 3.1, 9.3], method="krylov")
    assert small.dof == 32
    assert error(system, small, [0.0, 3.1, 9.3]).max() < 1e-10
    beside = np.array([error(system, small, 9.3 + step)[0] for step in (0.2, 0.4)])
    assert beside[0] < 1e-4
    assert beside[1] > 8.0 * beside[0] or beside[1] < 1e-10


@pytest.mark.slow
def test_each_coefficient_adds_two_derivatives():
    """Of one port whose input and output are one: after q rounds the error is of order 2 q or higher."""
    system = truss(outputs=("z",))["z", "F"]
    for order, power in ((2, 2), (4, 4)):
        small = system.reduced(order, near=6.0, method="krylov")
        off = error(system, small, [6.0 + 0.01, 6.0 + 0.02])
        assert np.log2(off[1] / off[0]) > power - 0.2


@pytest.mark.slow
def test_matrices_stay_symmetric_and_definite():
    system = truss()
    small = system.reduced(24, near=[0.0, 5.0], method="krylov")
    for matrix in (small.M, small.C, small.K):
        np.testing.assert_allclose(matrix, matrix.T, atol=1e-12 * np.abs(matrix).max())
        assert np.linalg.eigvalsh(matrix)[0] > -1e-12 * np.abs(matrix).max()
    assert (small.modes().eigenvalues.real < 0.0).all()
    assert small.coordinates[0] == "mode1"


@pytest.mark.slow
def test_free_motions_stay_free():
    """Through the mass that remains: total mass, and no frequency of rounding."""
    system = truss(held=False, outputs=("z",))
    small = system.reduced(20, near=[0.0, 4.0, 8.0], method="krylov")
    assert small.modes().frequencies[0] == 0.0
    assert small.modes().frequencies[1] > 0.1
    assert error(system, small, [4.0, 8.0]).max() < 1e-10
    low = 2 * np.pi * np.array([1e-3])
    np.testing.assert_allclose(small.frequency_response(low), system.frequency_response(low), rtol=1e-3)
    with pytest.raises(mv.ResponseError, match="moves freely, and has no static response"):
        system.reduced(20, method="krylov")


@pytest.mark.slow
def test_the_bound_holds():
    system = truss(damping="stiffness", outputs=("z",))
    small = system.reduced(16, near=[0.0, 6.0], method="krylov")
    w = 2 * np.pi * np.linspace(0.0, 80.0, 600)
    off = np.linalg.norm(np.moveaxis(small.frequency_response(w) - system.frequency_response(w), 2, 0), 2, (1, 2))
    assert off.max() <= small.error_bound < np.inf
    assert small.error_bound < 3.0 * off.max()


@pytest.mark.slow
def test_what_inputs_do_not_reach_is_left_out():
    """Two chains side by side: an order beyond what is excited gives the exact one."""
    one, other = truss(12, outputs=("z",), damping="stiffness"), truss(30, outputs=("z",), seed=1)
    both = [sp.block_diag((getattr(one.matrices, key), getattr(other.matrices, key))) for key in "MCK"]
    b = np.concatenate((np.eye(12)[:, [5]], np.zeros((30, 1))))
    system = mv.System.from_matrices(*both, b, b.T)
    small = system.reduced(20, near=5.0, method="krylov")
    assert small.dof <= 12
    assert error(system, small, np.linspace(0.0, 60.0, 20)).max() < 1e-9


@pytest.mark.parametrize(("words", "said"), [
    ({"order": 5, "near": -1.0}, r"near = -1\.0; expected .* method = 'krylov'"),
    ({"order": 5, "near": []}, r"near = \[\]; expected .* method = 'krylov'"),
    ({"order": None, "error": 1e-3}, "error = 0.001 with method = 'krylov'; expected an order"),
])  # fmt: skip
def test_what_cannot_be_reduced_is_named(words, said):
    with pytest.raises(mv.ResponseError, match=said):
        truss().reduced(**words, method="krylov")


def test_poles_ports_and_several_frequencies_of_modes_are_refused():
    system = truss(damping="none")
    with pytest.raises(mv.ResponseError, match="expected one frequency"):
        system.reduced(5, near=[1.0, 2.0])
    with pytest.raises(mv.ResponseError, match="has no inputs and outputs, about which"):
        mv.System.from_matrices(sp.eye(3), None, sp.eye(3), outputs=["a", "b", "c"])[[], []].reduced(2, method="krylov")
    with pytest.raises(mv.ResponseError, match="coordinates without mass"):
        mv.System.from_matrices(sp.diags([1.0, 0.0]), None, sp.csc_matrix([[2.0, -1.0], [-1.0, 1.0]]), [0.0, 1.0],
                                [[0.0, 1.0]]).reduced(2, method="krylov")  # fmt: skip
