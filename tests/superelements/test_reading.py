"""Reduced matrices back from files that scipy and pyNastran have written, and from DMIG cards."""

import struct

import numpy as np
import pytest
from scipy.io import savemat
from scipy.sparse import csc_matrix

import mbsvib as mv
from mbsvib.superelements import read_mat, read_op4, read_punch
from tests.superelements.craig_bampton import NODES, reduced

M, K = reduced(3)


def close(found, expected, rtol):
    size = np.sqrt(np.outer(expected.diagonal(), expected.diagonal()))
    assert np.abs((found - expected) / size).max() <= rtol


def test_mat(tmp_path):
    path = tmp_path / "pipe.mat"
    savemat(path, {"Mred": M, "Kred": csc_matrix(K), "Cred": 1e-5 * K})
    found = read_mat(path, "Mred", "Kred", "Cred")
    assert np.array_equal(found.M, M)
    assert np.array_equal(found.K, K)
    assert np.array_equal(found.C, 1e-5 * K)
    assert read_mat(path, "Mred", "Kred").C is None
    savemat(path, {"M": M + 0j, "K": K + 0j, "H": K + 1j * K})  # programs with structural damping write all as complex
    assert np.array_equal(read_mat(path).K, K)
    with pytest.raises(mv.ModelError, match=r"'H' is of type complex128"):
        read_mat(path, K="H")
    savemat(path, {"Mred": M, "Kred": csc_matrix(K), "Cred": 1e-5 * K})
    with pytest.raises(mv.ModelError, match=r"no matrix 'M'; the file has Cred, Kred, Mred"):
        read_mat(path)
    path.write_text("not a MATLAB file at all, though long enough to have a header" * 4)
    with pytest.raises(mv.ModelError, match=r"cannot be read as a MATLAB file"):
        read_mat(path)


def binary_op4(name, matrix):
    """Fortran records of a dense real double-precision matrix."""
    n = len(matrix)
    records = [struct.pack("<4i8s", n, n, 6, 2, f"{name:8}".encode())]
    records += [struct.pack(f"<3i{n}d", i + 1, 1, 2 * n, *matrix[:, i]) for i in range(n)]
    records.append(struct.pack("<3id", n + 1, 1, 2, 1.0))
    return b"".join(struct.pack("<i", len(r)) + r + struct.pack("<i", len(r)) for r in records)


def text_op4(name, matrix, style="3E23.16", exponent="E"):
    """A dense real matrix as text, every column whole."""
    n = len(matrix)
    lines = [f"{n:8}{n:8}{6:8}{2:8}{name:<8}1P,{style}"]
    for i in range(n):
        words = [f"{value:23.16E}".replace("E", exponent) for value in matrix[:, i]]
        lines += [f"{i + 1:8}{1:8}{n:8}", *("".join(words[k : k + 3]) for k in range(0, n, 3))]
    return "\n".join([*lines, f"{n + 1:8}{1:8}{1:8}", " 1.0000000000000000E+00", ""]).encode()


def text_op4_with_d(name, matrix):
    return text_op4(name, matrix, "3D23.16", "D")


@pytest.mark.parametrize("write", [binary_op4, text_op4, text_op4_with_d])
def test_op4(tmp_path, write):
    path = tmp_path / "pipe.op4"
    path.write_bytes(write("MAA", M) + write("KAA", K))
    found = read_op4(path)
    assert np.array_equal(found.M, M)
    assert np.array_equal(found.K, K)
    model = mv.Model("read")
    model.add_superelement("pipe", found.M, found.C, found.K, {"left": NODES[0], "right": NODES[-1]})
    assert model.linearize().dof == 15
    with pytest.raises(mv.ModelError, match=r"there is no such file"):
        read_op4(tmp_path / "other.op4")
    with pytest.raises(mv.ModelError, match=r"no matrix 'BAA'; the file has KAA, MAA"):
        read_op4(path, C="BAA")


def dmig(name, matrix, labels, large):
    lines = [f"DMIG    {name:8}{0:>8}{6:>8}{2 if large else 1:>8}{0:>8}"]
    for j, (grid, component) in enumerate(labels):
        rows = [i for i in range(j + 1) if matrix[i, j] != 0.0]
        if large:
            lines.append(f"DMIG*   {name:16}{grid:>16}{component:>16}")
            cells = [f"{labels[i][0]:>16}{labels[i][1]:>16}{matrix[i, j]:16.9E}" for i in rows]
            lines += [f"*       {cell}".replace("E", "D") for cell in cells]
        else:
            cells = [f"{labels[i][0]:>8}{labels[i][1]:>8}{matrix[i, j]:8.1E}{'':8}" for i in rows]
            lines.append(f"DMIG    {name:8}{grid:>8}{component:>8}{'':8}{cells[0]}")
            lines += ["+       " + "".join(cells[i : i + 2]) for i in range(1, len(cells), 2)]
    return lines


def test_punch_with_large_fields(tmp_path):
    labels = [(20, c) for c in range(1, 7)] + [(5, c) for c in range(1, 7)] + [(101, 0), (102, 0), (103, 0)]
    path = tmp_path / "pipe.pch"
    path.write_text("\n".join(["$TITLE = PIPE", *dmig("KAAX", K, labels, True), *dmig("MAAX", M, labels, True)]) + "\n")
    found = read_punch(path)
    assert found.labels[:6] == tuple((5, c) for c in range(1, 7))
    ordered = found.ordered([20, 5])
    assert ordered.labels == tuple(labels)
    close(ordered.K, K, 1e-8)
    close(ordered.M, M, 1e-8)
    model = mv.Model("read")
    model.add_superelement("pipe", ordered.M, ordered.C, ordered.K, {"left": NODES[0], "right": NODES[-1]})
    assert (model.linearize().modes().frequencies[:6] == 0.0).all()
    with pytest.raises(mv.ModelError, match=r"grid point 7 has no component 1"):
        found.ordered([7])


def test_punch_with_small_fields_and_odd_numbers(tmp_path):
    path = tmp_path / "small.pch"
    matrix = np.diag([1.0, 2.0, 4.0]) + 8.0 * (np.eye(3, k=1) + np.eye(3, k=-1))
    labels = [(1, 1), (1, 2), (9, 0)]
    text = "\n".join(dmig("KAAX", matrix, labels, False) + dmig("MAAX", np.eye(3), labels, False))
    path.write_text(text.replace(" 4.0E+00", "   4.0+0"))
    found = read_punch(path)
    assert np.array_equal(found.K, matrix)
    assert np.array_equal(found.M, np.eye(3))
    with pytest.raises(mv.ModelError, match=r"no matrix 'K2'; the file has KAAX, MAAX"):
        read_punch(path, K="K2")
    path.write_text("DMIG    KAAX           0       2       1       0\n")
    with pytest.raises(mv.ModelError, match=r"'KAAX' is not read: only square and symmetric"):
        read_punch(path)
    with pytest.raises(mv.ModelError, match=r"cannot be read"):
        read_punch(tmp_path / "none.pch")
