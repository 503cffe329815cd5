"""Matrices from text files of Abaqus: triangles, boundary conditions, internal nodes, ports, and what is refused."""

import numpy as np
import pytest
import scipy.sparse as sp

import mbsvib as mv
from mbsvib.errors import ModelError
from mbsvib.superelements import Reduced, read_abaqus, system

# Two nodes that move along 1 and 2, one that is held, and an internal one; the lower triangle.
STIFFNESS = """** MATRIX OF A STEP
*MATRIX INPUT, NAME=STIF, TYPE=SYMMETRIC
7,1, 7,1,  3.000000000000000e+04
7,2, 7,2,  2.000000000000000e+04
9,1, 7,1, -1.000000000000000e+04
9,1, 9,1,  1.500000000000000e+04
9,2, 9,2,  4.000000000000000D+04
11,3, 11,3, 1.000000000000000e+36
-1,1, 9,2, -5.0e+03
-1,1, -1,1, 6.0e+03
"""
MASS = "7 1 7 1 2.0\n7 2 7 2 2.0\n9 1 9 1 1.0\n9 2 9 2 1.0\n-1 1 -1 1 0.5\n11 3 11 3 1.0\n"
LABELS = ((-1, 0), (7, 1), (7, 2), (9, 1), (9, 2))
K = np.diag([6e3, 3e4, 2e4, 1.5e4, 4e4])
K[[0, 4, 1, 3], [4, 0, 3, 1]] = -5e3, -5e3, -1e4, -1e4
M = np.diag([0.5, 2.0, 2.0, 1.0, 1.0])


def files(folder, stiffness=STIFFNESS, mass=MASS):
    paths = folder / "model_STIF1.mtx", folder / "model_MASS1.mtx"
    for path, text in zip(paths, (stiffness, mass), strict=True):
        path.write_text(text)
    return paths


def test_matrices_and_labels(tmp_path):
    read = read_abaqus(*files(tmp_path))
    assert read.labels == LABELS
    assert sp.issparse(read.K)
    np.testing.assert_array_equal(read.K.toarray(), K)
    np.testing.assert_array_equal(read.M.toarray(), M)
    assert read.C is None
    damped = read_abaqus(*files(tmp_path), damping=files(tmp_path)[0])
    np.testing.assert_array_equal(damped.C.toarray(), K)


def test_either_triangle_and_both_are_the_same(tmp_path):
    lines = STIFFNESS.splitlines()
    turned = []
    for line in lines[2:]:
        a, b, c, d, value = line.split(",")
        turned.append(f"{c},{d},{a},{b},{value}")
    for mixed in (turned, [*lines[2:], turned[2], turned[6]], [*lines[:4], *turned[2:]]):
        text = "\n".join(mixed)
        np.testing.assert_array_equal(read_abaqus(*files(tmp_path, text)).K.toarray(), K)


def test_ports_at_nodes(tmp_path):
    part = system(read_abaqus(*files(tmp_path)), [9, 7], name="fe")
    assert part.kind == "sparse system"
    assert part.outputs == part.inputs == ("9.x", "9.y", "7.x", "7.y")
    static = np.linalg.inv(K)[np.ix_([3, 4, 1, 2], [3, 4, 1, 2])]
    np.testing.assert_allclose(part.frequency_response([0.0])[:, :, 0].real, static, rtol=1e-12)
    held = mv.assemble({"fe": part, "other": system(Reduced(M, None, K, LABELS), [7])},
                       [("fe.9", "other.7", "rigid")])  # fmt: skip
    assert held.dof == 8
    with pytest.raises(ModelError, match="there is no node 8 among the 2 of the labels of 'part'"):
        system(Reduced(M, None, K, LABELS), [8])
    with pytest.raises(mv.ModelError, match="nodes = 7; expected a list of grid points"):
        system(Reduced(M, None, K, LABELS), 7)


@pytest.mark.parametrize(("stiffness", "said"), [
    ("1 1 3.0e4\n", "expected five columns"),
    ("1,1,1,1,abc\n", "expected five columns"),
    ("1,1,1,1,nan\n", "expected five columns"),
    ("1,1.5,1,1,2.0\n", "expected five columns"),
    ("", "expected five columns"),
    (STIFFNESS + "7,1, 9,1, -2.0e+04\n", "entries above and below the diagonal differ"),
    (STIFFNESS + "9,8, 9,8, 1.0\n", "node 9 has the degree of freedom 8"),
])  # fmt: skip
def test_what_is_no_such_file_is_refused(tmp_path, stiffness, said):
    with pytest.raises(ModelError, match=said):
        read_abaqus(*files(tmp_path, stiffness))
    with pytest.raises(ModelError, match="no such file"):
        read_abaqus(tmp_path / "none.mtx", tmp_path / "none.mtx")
