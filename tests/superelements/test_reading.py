"""Reduced matrices back from files that scipy and pyNastran have written, and from DMIG cards."""

import struct
import sys
from types import ModuleType

import numpy as np
import pytest
from scipy.io import savemat
from scipy.sparse import csc_matrix

import mbsvib as mv
from mbsvib.superelements import read_mat, read_op4, read_punch
from tests.superelements.craig_bampton import NODES, reduced

M, K = reduced(3)


def close(result, expected, rtol):
    size = np.sqrt(np.outer(expected.diagonal(), expected.diagonal()))
    assert np.abs((result - expected) / size).max() <= rtol


def test_mat(tmp_path):
    path = tmp_path / "pipe.mat"
    savemat(path, {"Mred": M, "Kred": csc_matrix(K), "Cred": 1e-5 * K})
    result = read_mat(path, "Mred", "Kred", "Cred")
    assert np.array_equal(result.M, M)
    assert np.array_equal(result.K, K)
    assert np.array_equal(result.C, 1e-5 * K)
    assert read_mat(path, "Mred", "Kred").C is None
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


@pytest.mark.parametrize("binary", [True, False])
def test_op4(tmp_path, binary):
    op4 = pytest.importorskip("pyNastran.op4.op4")
    path = tmp_path / "pipe.op4"
    if binary:  # its own writer of binary files leaves the records' lengths out
        path.write_bytes(binary_op4("MAA", M) + binary_op4("KAA", K))
    else:
        op4.OP4(debug=False).write_op4(str(path), {"MAA": (6, M), "KAA": (6, K)}, is_binary=False, precision="double")
    result = read_op4(path)
    close(result.M, M, 1e-15 if binary else 1e-8)
    close(result.K, K, 1e-15 if binary else 1e-8)
    model = mv.Model("read")
    model.add_superelement("pipe", result.M, result.C, result.K, {"left": NODES[0], "right": NODES[-1]})
    assert model.linearize().dof == 15
    with pytest.raises(mv.ModelError, match=r"there is no such file"):
        read_op4(tmp_path / "other.op4")


def test_op4_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyNastran.op4.op4", None)
    with pytest.raises(mv.ModelError, match=r"read_op4 needs pyNastran: pip install 'mbsvib\[nastran\]'"):
        read_op4(tmp_path / "pipe.op4")
    monkeypatch.setitem(sys.modules, "pyNastran.op4.op4", ModuleType("op4"))
    for name in ("pyNastran", "pyNastran.op4"):
        monkeypatch.setitem(sys.modules, name, ModuleType(name))
    with pytest.raises(mv.ModelError, match=r"pipe\.op4: there is no such file"):
        read_op4(tmp_path / "pipe.op4")


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
    result = read_punch(path)
    assert result.labels[:6] == tuple((5, c) for c in range(1, 7))
    ordered = result.ordered([20, 5])
    assert ordered.labels == tuple(labels)
    close(ordered.K, K, 1e-8)
    close(ordered.M, M, 1e-8)
    model = mv.Model("read")
    model.add_superelement("pipe", ordered.M, ordered.C, ordered.K, {"left": NODES[0], "right": NODES[-1]})
    assert (model.linearize().modes().frequencies[:6] == 0.0).all()
    with pytest.raises(mv.ModelError, match=r"grid point 7 has no component 1"):
        result.ordered([7])


def test_punch_with_small_fields_and_odd_numbers(tmp_path):
    path = tmp_path / "small.pch"
    matrix = np.diag([1.0, 2.0, 4.0]) + 8.0 * (np.eye(3, k=1) + np.eye(3, k=-1))
    labels = [(1, 1), (1, 2), (9, 0)]
    text = "\n".join(dmig("KAAX", matrix, labels, False) + dmig("MAAX", np.eye(3), labels, False))
    path.write_text(text.replace(" 4.0E+00", "   4.0+0"))
    result = read_punch(path)
    assert np.array_equal(result.K, matrix)
    assert np.array_equal(result.M, np.eye(3))
    with pytest.raises(mv.ModelError, match=r"no matrix 'K2'; the file has KAAX, MAAX"):
        read_punch(path, K="K2")
    path.write_text("DMIG    KAAX           0       2       1       0\n")
    with pytest.raises(mv.ModelError, match=r"line 1: the DMIG card is not understood: only square and symmetric"):
        read_punch(path)
    with pytest.raises(mv.ModelError, match=r"cannot be read"):
        read_punch(tmp_path / "none.pch")
