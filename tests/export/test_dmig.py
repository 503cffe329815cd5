"""DMIG cards: ten digits, read again here, as a superelement, and by pyyeti and pyNastran."""

from dataclasses import replace

import numpy as np
import pytest

import mbsvib as mv
import mbsvib_export as mx
from mbsvib.common.dmig_cards import read_dmig_cards
from mbsvib.common.file_content import ContentError
from mbsvib.superelements import read_punch
from mbsvib_export.dmig_ import NAMES, read_dmig
from tests.export.plants import slider, stewart


def close(one, two):
    return np.abs(one - two).max() < 1e-9 * np.abs(two).max()


def with_skew_damping():
    """Spinning rotors make C unsymmetric."""
    data = mx.from_json(mx.to_json(stewart()))
    return replace(data, C=data.C + 1e3 * (np.triu(np.ones((6, 6)), 1) - np.tril(np.ones((6, 6)), -1)))


def test_cards_are_read_as_a_superelement(tmp_path):
    system = stewart()
    result = read_punch(mx.to_dmig(system, tmp_path / "x.pch"), C="BAAX")
    assert result.labels == tuple((k + 1, 0) for k in range(system.dof))
    for one, two in ((result.M, system.M), (result.C, system.C), (result.K, system.K)):
        assert close(one, two)
    text = (tmp_path / "x.pch").read_text(encoding="ascii")
    assert f"$ 1 = {system.coordinates[0]} [rad]" in text
    assert "\nSPOINT         1    THRU       6\n" in text
    assert max(map(len, text.splitlines())) <= 72


def test_matrices_of_zeros_have_no_cards(tmp_path):
    """Nastran ends with an error at a header without columns; a point without entries is still one."""
    data = mx.from_json(mx.to_json(slider(stiffness=0.0)))
    path = mx.to_dmig(replace(data, C=np.zeros((1, 1))), tmp_path / "x.pch")
    text = path.read_text(encoding="ascii")
    assert "\nSPOINT         1\n" in text
    assert [line[8:16].strip() for line in text.splitlines() if line.startswith("DMIG ")] == ["MAAX"]
    result = read_dmig(path)
    assert result["M"] == 2.0
    assert (result["C"].shape, result["C"].any(), result["K"].any()) == ((1, 1), False, False)
    massless = replace(mx.from_json(mx.to_json(stewart())), M=np.diag([1.0, 0, 0, 0, 0, 2.0]))
    assert np.array_equal(read_dmig(mx.to_dmig(massless, path))["M"], massless.M)
    assert len(read_punch(path).labels) == 6


def test_unsymmetric_matrices_are_square_cards(tmp_path):
    """Form 1, with the number of columns, and all entries."""
    data = with_skew_damping()
    lines = mx.to_dmig(data, tmp_path / "x.pch").read_text(encoding="ascii").splitlines()
    head = next(line for line in lines if line.startswith("DMIG    BAAX"))
    assert head.split()[3] == "1"
    assert head[64:72].strip() == "6"
    for result in (read_dmig(tmp_path / "x.pch")["C"], read_punch(tmp_path / "x.pch", C="BAAX").C):
        assert close(result, data.C)
    with pytest.raises(mv.ExportError, match="no degree of freedom"):
        mx.to_dmig(slider(locked=True), tmp_path / "y.pch")


def test_names_cannot_begin_a_card(tmp_path):
    data = mx.from_json(mx.to_json(slider()))
    for words in ({"name": "a\nDMIG    KAAX\x85b"}, {"coordinates": ("q\r\nENDDATA",)}):
        with pytest.raises(mv.ExportError, match="not printed"):
            replace(data, **words)
    data = replace(data, name="DMIG    KAAX ü", coordinates=("ENDDATA",))
    lines = mx.to_dmig(data, tmp_path / "x.pch").read_text(encoding="ascii").splitlines()
    assert all(line.startswith("$") for line in lines[:5])
    assert close(read_dmig(tmp_path / "x.pch")["K"], data.K)


def test_many_comments_take_no_memory(tmp_path):
    """The number of points is that of the cards, not of the comments."""
    path = mx.to_dmig(slider(), tmp_path / "x.pch")
    text = path.read_text(encoding="ascii")
    path.write_text("$ a comment\n" * 60_000 + text.replace("\n", "\n$ and another\n"), encoding="ascii")
    assert close(read_dmig(path)["K"], slider().K)
    assert read_punch(path).K.shape == (1, 1)


def test_cards_that_are_none(tmp_path):
    path = mx.to_dmig(stewart(), tmp_path / "x.pch")
    text = path.read_text(encoding="ascii")
    for wrong, message in (
        (text.replace("BAAX  ", "ABAX  "), "ABAX"), (text[:300], "not understood"), ("", "missing"),
        (text[: text.index("DMIG    KAAX")], "as its comments say"), (text.replace("D+0", "D+x"), "is not a number"),
        (text[: len(text) - 100], "as its comments say|not understood"),
        (text.replace("THRU       6", "THRU 9999999"), "9999999 scalar points; expected"),
        (text.replace("THRU       6", "THRU       0"), "from 1 to 0"),
        (text.replace(f"*       {1:>16}{0:>16}", f"*       {-1:>16}{0:>16}", 1), "is not a point"),
    ):  # fmt: skip
        path.write_text(wrong, encoding="ascii")
        with pytest.raises(mv.ExportError, match=rf"x\.pch: no file with cards of to_dmig.*({message})"):
            read_dmig(path)
    with pytest.raises(mv.ExportError, match=r"none\.pch: cannot be read"):
        read_dmig(tmp_path / "none.pch")


HEAD = "DMIG    KAAX           0       6       2       0\n"


def test_small_free_and_continued_fields():
    small = HEAD + "DMIG    KAAX           1       1               1       1    4.+3\n" \
                   "+              2       2 -1.5-2\n"  # fmt: skip
    free = "DMIG,KAAX,0,6,2,0\nDMIG,KAAX,1,1,,1,1,4.E3\n+,2,2,-1.5D-2\n"
    large = "SPOINT,7,8\nDMIG*   KAAX                           1               1\n" \
            "*                      1               1            4.D3\n" \
            "*                      2               2         -1.5D-2\n"  # fmt: skip
    for text in (small, free, HEAD + large):
        cards = read_dmig_cards(text.encode())
        assert cards.labels[:2] == ((1, 1), (2, 2))
        assert np.array_equal(cards.matrices["KAAX"][:2, :2], [[4000.0, -0.015], [-0.015, 0.0]])
    assert cards.labels[2:] == ((7, 0), (8, 0))


def test_matrices_of_loads_and_complex_ones_beside_are_passed_over():
    """As punch files of external superelements have them: rectangular loads (form 9), complex damping (type 4)."""
    loads = "DMIG    PAX            0       9       2       0                       2\n" \
            "DMIG*   PAX                            1               0\n" \
            "*                      5               1            4.D3\n"  # fmt: skip
    damping = "DMIG    BC             0       6       4       0\nDMIG,BC,1,1,,1,1,1.,2.\n"
    cards = read_dmig_cards((loads + HEAD + "DMIG,KAAX,1,1,,1,1,4.E3\n" + damping).encode())
    assert cards.labels == ((1, 1),)
    assert np.array_equal(cards.matrices["KAAX"], [[4000.0]])
    assert cards.left_out == {"PAX": "only square and symmetric matrices are read", "BC": "only real matrices are read"}


@pytest.mark.parametrize(("text", "message"), [
    (HEAD + HEAD, "KAAX is there twice"), (HEAD.replace("0", "1", 1), "no header of the matrix KAAX"),
    (HEAD + "DMIG,KAAX,1,0,,1,0,1.0\n+,1,0,2.0", "entry of .* is there twice"),
    (HEAD + "DMIG,KAAX,1,0,,2,0,1.0\nDMIG,KAAX,2,0,,1,0,1.0", "entry of .* is there twice"),
    (HEAD + "DMIG,KAAX,1,7,,1,0,1.0", "is not a point with a component"),
    (HEAD + "DMIG,KAAX,1,0,,1,0,inf", "'INF' is not a number"),
])  # fmt: skip
def test_cards_that_are_not_understood(text, message):
    with pytest.raises(ContentError, match=rf"line \d: the card is not understood: .*{message}"):
        read_dmig_cards(text.encode())


@pytest.mark.slow
def test_pyyeti_reads_the_cards(tmp_path):
    bulk = pytest.importorskip("pyyeti.nastran.bulk", reason="pyyeti is not installed: pip install 'mbsvib[test]'")
    for system in (stewart(), slider(), with_skew_damping()):
        result = bulk.rddmig(str(mx.to_dmig(system, tmp_path / "x.pch")))
        for name, key in NAMES.items():
            frame = result[name.lower()]
            assert [int(point) for point, _ in frame.index] == list(range(1, len(system.coordinates) + 1))
            assert close(frame.to_numpy(), getattr(system, key)), name


@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::SyntaxWarning")
def test_pynastran_reads_the_cards(tmp_path, monkeypatch):
    pytest.importorskip("pyNastran", reason="pyNastran is not installed: uv sync installs it")
    monkeypatch.setattr(np, "in1d", np.isin, raising=False)  # which numpy 2.4 has no longer
    from pyNastran.bdf.bdf import BDF

    for system in (stewart(), slider(), with_skew_damping()):
        model = BDF(debug=None)
        model.read_bdf(str(mx.to_dmig(system, tmp_path / "x.pch")), punch=True, xref=False)
        assert sorted(model.spoints) == list(range(1, len(system.coordinates) + 1))
        for name, key in NAMES.items():
            array, rows, columns = model.dmigs[name].get_matrix(is_sparse=False, apply_symmetry=True)
            order = [[index for index, (point, _) in sorted(labels.items(), key=lambda item: item[1])]
                     for labels in (rows, columns)]  # fmt: skip
            assert close(array[np.ix_(*order)], getattr(system, key)), name
