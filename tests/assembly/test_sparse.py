"""Sparse parts: against dense assemblies, a lattice built as one, and what is refused."""

import numpy as np
import pytest
import scipy.sparse as sp

import mbsvib as mv
from mbsvib.errors import ModelError
from mbsvib.superelements import Reduced
from tests.assembly.scenes import RIGID, apart

LINES = 2 * np.pi * np.linspace(1.0, 100.0, 15)
SOFT = ((1e5, 2e5, 3e5, 10, 20, 30), (10, 20, 30, 1, 2, 3))


def sparse(system):
    """The same equations, sparse, with bare names."""
    matrices = (sp.csc_matrix(matrix) for matrix in (system.M, system.C, system.K))
    return mv.System.from_matrices(
        *matrices, system.B, system.Cq, system.Cv, system.Ca, system.D, inputs=system.inputs, outputs=system.outputs,
        coordinates=system.coordinates)  # fmt: skip


def systems():
    base, payload = (model.linearize() for model in apart())
    return base[[name for name in base.outputs if "force" not in name], :], payload


@pytest.mark.few(2)
@pytest.mark.parametrize("how", ["rigid", SOFT])
@pytest.mark.parametrize("which", ["base", "payload", "both"])
def test_sparse_parts_are_joined_as_dense_ones(how, which):
    """Bodies' ports, whose rows move several coordinates, with acceleration outputs elsewhere."""
    base, payload = systems()
    connect = [("base.tip", "payload.root", how)]
    dense = mv.assemble({"base": base, "payload": payload}, connect)
    parts = {name: sparse(part) if which in (name, "both") else part
             for name, part in (("base", base), ("payload", payload))}  # fmt: skip
    whole = mv.assemble(parts, connect)
    assert whole.kind == "sparse system"
    assert (whole.dof, whole.outputs, whole.inputs) == (dense.dof, dense.outputs, dense.inputs)
    expected = dense.frequency_response(LINES)
    size = np.abs(expected).max(axis=(0, 1))
    assert (np.abs(whole.frequency_response(LINES) - expected).max(axis=(0, 1)) < 2e-12 * size).all()
    np.testing.assert_allclose(whole.modes(5).frequencies, dense.modes().frequencies[:5], rtol=1e-9, atol=1e-5)
    assert "base.tip and payload.root: joined" in whole.explain()
    assert whole.output_units[-1] == ("" if which in ("payload", "both") else dense.output_units[-1])


def lattice(n, length, ends=(1.0, 1.0)):
    """M and K of n x n x length nodes with x, y and z, springs along all edges; the first and last layer by a share."""
    share = np.ones(length)
    share[[0, -1]] = ends

    def line(k):
        edge = sp.diags([-1.0, 1.0], [0, 1], (k - 1, k))
        return edge.T @ edge

    plane = sp.kron(line(n), sp.eye(n)) + sp.kron(sp.eye(n), line(n))
    K = sp.kron(sp.kron(sp.diags(share), plane), sp.diags([1e5, 2e5, 3e5]))
    K = K + sp.kron(sp.kron(line(length), sp.eye(n * n)), sp.diags([2e5, 3e5, 5e5]))
    M = sp.kron(sp.kron(sp.diags(share), sp.diags(1.0 + 0.1 * np.arange(n * n))), sp.eye(3))
    return M.tocsc(), K.tocsc()


def half(n, length, layer, ends, held):
    """A half of the lattice, with ports at all nodes of a layer; ``held``: the first layer on springs."""
    M, K = lattice(n, length, ends)
    if held:
        K = K + sp.diags(np.repeat([1e4, 0.0], [3 * n * n, 3 * n * n * (length - 1)]))
    at = 3 * n * n * layer + np.arange(3 * n * n)
    select = sp.eye(M.shape[0]).tocsr()[at]
    names = [f"n{k}.{axis}" for k in range(n * n) for axis in "xyz"]
    return mv.System.from_matrices(M, 1e-5 * K, K, select.T, select, inputs=names, outputs=names)


@pytest.mark.slow
@pytest.mark.parametrize("n", [6, pytest.param(33, marks=pytest.mark.slow)])
def test_nodes_are_matched_by_position_and_become_one(n):
    """Two halves against the lattice built as one: 3 x 36 and 3 x 1089 pairs of coordinates, in another order."""
    first, second = half(n, 4, 3, (1.0, 0.5), True), half(n, 3, 0, (0.5, 1.0), False)
    places = 0.1 * np.array([(k // n, k % n, 0.3) for k in range(n * n)])
    order = np.random.default_rng(0).permutation(n * n)
    names = [f"n{k}.{axis}" for k in order for axis in "xyz"]
    turned = second[names, names]
    positions = {f"lower.n{k}": places[k] for k in range(n * n)}
    positions |= {f"upper.n{k}": places[k] + (0.0, 1e-4, 0.0) for k in order}
    whole = mv.assemble({"lower": first, "upper": turned}, [("lower.n*", "upper.n*", "rigid")], positions=positions)
    M, K = lattice(n, 6)
    K = K + sp.diags(np.repeat([1e4, 0.0], [3 * n * n, 3 * n * n * 5]))
    one = mv.System.from_matrices(M, 1e-5 * K, K)
    assert whole.dof == one.dof == 18 * n * n
    assert whole.matrices.K.nnz == one.matrices.K.nnz
    np.testing.assert_allclose(whole.modes(8).frequencies, one.modes(8).frequencies, rtol=1e-10)
    lines = whole.explain().splitlines()
    assert lines[2] == "  lower.n0 and upper.n0: joined rigidly along x y z, 0.1 mm apart"
    assert lines[10] == f"  and {n * n - 8} more, at most 0.1 mm apart"


def test_nodes_on_a_rigid_body_and_loops_of_connections():
    """A dense body joined to four nodes, and three nodes joined in a circle: rows that repeat others count once."""
    first = half(3, 3, 2, (1.0, 1.0), True)
    body = mv.Model("body")
    body.add_body("lid", 2.0, (0.1, 0.1, 0.1), position=(0.1, 0.1, 0.2))
    for k in range(4):
        body.add_port(f"p{k}", "lid", position=(0.1 * (k // 2), 0.1 * (k % 2), 0.2))
    nodes = [0, 1, 3, 4]
    connect = [(f"fe.n{node}", f"lid.p{k}", "rigid", ("x", "y", "z")) for k, node in enumerate(nodes)]
    whole = mv.assemble({"fe": first, "lid": body}, connect)
    assert whole.dof == 81 + 6 - 12
    rows = np.zeros((12, 81 + 6))
    lid = body.linearize()
    for k, node in enumerate(nodes):
        for axis in range(3):
            rows[3 * k + axis, 54 + 3 * node + axis] = 1.0
            rows[3 * k + axis, 81:] = -lid.Cq[lid.outputs.index(f"p{k}.{'xyz'[axis]}")]
    null = np.linalg.svd(rows)[2][12:].T
    given = first.matrices
    m, k = (null.T @ sp.block_diag(pair).toarray() @ null for pair in ((given.M, lid.M), (given.K, lid.K)))
    square = np.sort(np.linalg.eigvals(np.linalg.solve(m, k)).real)
    np.testing.assert_allclose(whole.modes(6).frequencies, np.sqrt(square[:6]) / 2 / np.pi, rtol=1e-9)
    mass = mv.System.from_matrices(sp.eye(1), None, 100.0 * sp.eye(1), [1.0], [[1.0]], inputs=["p.x"], outputs=["p.x"])
    circle = [("a.p", "b.p", "rigid"), ("b.p", "c.p", "rigid"), ("c.p", "a.p", "rigid")]
    one = mv.assemble(dict.fromkeys("abc", mass), circle)
    assert one.dof == 1
    assert one.modes(1).frequencies[0] == pytest.approx(10.0 / 2 / np.pi, rel=1e-12)


def test_sparse_parts_join_measured_ones_and_reduced_matrices():
    base, payload = systems()
    exact = payload.frequency_response(LINES)
    tested = mv.Measurement(LINES, exact, payload.outputs, payload.inputs, output_units=payload.output_units,
                            input_units=payload.input_units)  # fmt: skip
    joined = mv.assemble({"base": sparse(base), "payload": tested}, RIGID)
    expected = mv.assemble({"base": base, "payload": payload}, RIGID).frequency_response(LINES)
    np.testing.assert_allclose(joined.responses, expected, atol=1e-8 * np.abs(expected).max())
    labels = (*((grid, component) for grid in (7, 9) for component in range(1, 7)), (0, 0))
    rng = np.random.default_rng(1)
    root = rng.standard_normal((13, 13))
    K = root @ root.T + 13.0 * np.eye(13)
    reduced = Reduced(np.eye(13), None, K, labels)
    system = mv.System.from_matrices(np.eye(13), None, K, np.eye(13)[:, 6:12], np.eye(13)[6:12],
                                     inputs=[f"9.{d}" for d in ("x", "y", "z", "rx", "ry", "rz")],
                                     outputs=[f"9.{d}" for d in ("x", "y", "z", "rx", "ry", "rz")])  # fmt: skip
    both = [mv.assemble({"base": base, "part": part}, [("base.tip", "part.9", "rigid")]) for part in (reduced, system)]
    np.testing.assert_allclose(both[0].modes().frequencies, both[1].modes().frequencies, rtol=1e-12)
    assert "part.7.rz" in both[0].outputs
    with pytest.raises(ModelError, match="'part' have no labels of grid points"):
        mv.assemble({"base": base, "part": Reduced(np.eye(13), None, K)}, RIGID)


def test_what_sparse_parts_cannot_be_joined_with_is_named():
    base, payload = apart()
    one = sparse(payload.linearize())
    moved = apart()[0]
    moved.add_base_motion("floor", "z")
    moved = moved.linearize()
    moved = moved[[name for name in moved.outputs if "force" not in name], :]
    rotor = apart()[0]
    rotor.add_rotor("wheel", "base", axis=(0, 0, 1), speed=10.0, inertia=0.1)
    rotor = rotor.linearize()
    rotor = rotor[[name for name in rotor.outputs if "force" not in name], :]
    for part, said in ((base, "output 'base.(arm|link).force' is a velocity, an acceleration or a force"),
                       (moved, "'base' has a motion of the ground"), (rotor, "'base' has gyroscopic terms")):
        with pytest.raises(ModelError, match=said):
            mv.assemble({"base": part, "payload": one}, RIGID)
    plain = systems()[0]
    rubber = mv.Dynamic.prony([0.5], [0.01])
    with pytest.raises(ModelError, match=r"base\.tip to payload\.root is joined by a Dynamic"):
        mv.assemble({"base": plain, "payload": one}, [("base.tip", "payload.root", ((1e5,) * 6, rubber))])
    with pytest.raises(ModelError, match=r"positions has 'payload\.rot', which is not a port"):
        mv.assemble({"base": plain, "payload": one}, RIGID, positions={"payload.rot": (0, 0, 0)})
    with pytest.raises(ModelError, match=r"positions has 'other\.p', which belongs to none of base, payload"):
        mv.assemble({"base": plain, "payload": one}, RIGID, positions={"other.p": (0, 0, 0)})
    with pytest.raises(ModelError, match="apart; expected at most distance"):
        mv.assemble({"base": plain, "payload": one}, RIGID, positions={"payload.root": (0, 0, 9.0)})
    wrong = one.matrices
    bad = mv.System.from_matrices(wrong.M, wrong.C, wrong.K, one.input_rows.T * 1.01, *one.output_rows, one.D,
                                  inputs=one.inputs, outputs=one.outputs)  # fmt: skip
    with pytest.raises(ModelError, match=r"input '(base\.tip|payload\.root)\.x' does not act where"):
        mv.assemble({"base": plain, "payload": bad}, RIGID)
