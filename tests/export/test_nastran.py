"""Nastran files: OP4 bit for bit through pyNastran, DMIG cards to ten digits, both read as superelements."""

import numpy as np
import pytest

import mbsvib as mv
import mbsvib_export as mx
from mbsvib import library
from mbsvib.elements.superelement_files import read_op4 as read_reduced
from mbsvib.elements.superelement_files import read_punch
from mbsvib_export.nastran_ import read_dmig, read_op4
from tests.export.plants import same_bits, slider, stewart


def test_op4_keeps_every_bit(tmp_path):
    pytest.importorskip("pyNastran", reason="pyNastran is not installed: pip install 'mbsvib[nastran]'")
    for system in (stewart(), library.chain(4, "spherical", line=(0, 1, 0)).linearize(), slider()):
        path = mx.to_op4(system, tmp_path / "x.op4")
        for key, array in read_op4(path).items():
            assert same_bits(np.ascontiguousarray(array), getattr(system, key) + 0.0), key
        reduced = read_reduced(path, C="BAA")
        assert np.array_equal(reduced.K, system.K)
        assert np.array_equal(reduced.C, system.C)


def test_op4_damage(tmp_path):
    pytest.importorskip("pyNastran", reason="pyNastran is not installed: pip install 'mbsvib[nastran]'")
    path = mx.to_op4(slider(), tmp_path / "x.op4")
    path.write_bytes(b"nothing of the kind\n" * 3)
    with pytest.raises(mv.ExportError, match=r"x\.op4: no OP4 file"):
        read_op4(path)
    with pytest.raises(mv.ExportError, match="nothing to write"):
        mx.to_op4(slider((), (), locked=True), path)


def test_dmig_cards_are_read_as_a_superelement(tmp_path):
    system = stewart()
    result = read_punch(mx.to_dmig(system, tmp_path / "x.pch"), C="BAAX")
    assert result.labels == tuple((k + 1, 0) for k in range(system.dof))
    for first, second in ((result.M, system.M), (result.C, system.C), (result.K, system.K)):
        assert np.abs(first - second).max() < 1e-9 * np.abs(second).max()
    text = (tmp_path / "x.pch").read_text(encoding="ascii")
    assert f"$ 1 = {system.coordinates[0]} [rad]" in text
    assert max(map(len, text.splitlines())) <= 72


def test_cards_that_are_none(tmp_path):
    path = mx.to_dmig(stewart(), tmp_path / "x.pch")
    text = path.read_text(encoding="ascii")
    for wrong, message in ((text.replace("BAAX", "ABAX"), "ABAX"), (text[:200], "line 'D"), ("", "missing"),
                           (text.replace("D+0", "D+x"), "could not convert")):  # fmt: skip
        path.write_text(wrong, encoding="ascii")
        with pytest.raises(mv.ExportError, match=rf"x\.pch: no cards of to_dmig.*{message}"):
            read_dmig(path)
    with pytest.raises(mv.ExportError, match=r"none\.pch: cannot be read"):
        read_dmig(tmp_path / "none.pch")


def test_unsymmetric_matrices_are_square_cards(tmp_path):
    """Spinning rotors make C unsymmetric: form 1, with the number of columns, and all entries."""
    from dataclasses import replace

    data = mx.from_json(mx.to_json(stewart()))
    skew = data.C + 1e3 * (np.triu(np.ones((6, 6)), 1) - np.tril(np.ones((6, 6)), -1))
    lines = mx.to_dmig(replace(data, C=skew), tmp_path / "x.pch").read_text(encoding="ascii").splitlines()
    head = next(line for line in lines if line.startswith("DMIG    BAAX"))
    assert head.split()[3] == "1"
    assert head.split()[-1] == "6"
    assert head[64:72].strip() == "6"
    assert np.abs(read_dmig(tmp_path / "x.pch")["C"] - skew).max() < 1e-9 * np.abs(skew).max()
    with pytest.raises(mv.ExportError, match="no degree of freedom"):
        mx.to_dmig(slider(locked=True), tmp_path / "y.pch")
