"""OP4 files: written and read here bit for bit, and exchanged with pyyeti and pyNastran in every layout."""

import numpy as np
import pytest

import mbsvib as mv
import mbsvib_export as mx
from mbsvib import library
from mbsvib.common.file_content import ContentError
from mbsvib.common.op4_file import read_op4_file
from mbsvib.superelements import read_op4 as read_reduced
from mbsvib_export.op4_ import NAMES, read_op4
from tests.export.plants import same_bits, slider, stewart

SYSTEMS = (stewart, lambda: library.chain(4, "spherical", line=(0, 1, 0)).linearize(), slider,
           lambda: slider(stiffness=0.0), lambda: slider(stiffness=1e-150), lambda: slider(locked=True))  # fmt: skip
YETI = "pyyeti is not installed: pip install 'mbsvib[test]'"
NASTRAN = "pyNastran is not installed: uv sync installs it"


def matrices(seed=0):
    """Real and complex ones, with zeros at the ends of columns, between strings, and everywhere.

    Exponents have two digits: other writers have no place for more.
    """
    rng = np.random.default_rng(seed)
    full = rng.standard_normal((7, 5)) * 10.0 ** rng.integers(-90, 90, (7, 5))
    holes = full * (rng.random((7, 5)) < 0.5)
    holes[:, 2] = 0.0
    return {"FULL": full, "HOLES": holes, "ZERO": np.zeros((3, 4)), "ROW": full[:1], "CPLX": holes + 1j * full,
            "TALL": np.eye(40)[:, ::3]}  # fmt: skip


@pytest.mark.parametrize("binary", [False, True])
def test_every_bit_is_kept(binary, tmp_path):
    for build in SYSTEMS:
        system = build()
        path = mx.to_op4(system, tmp_path / "x.op4", binary)
        result = read_op4(path)
        assert set(result) == {key for key in NAMES.values() if getattr(system, key).size}
        for key, array in result.items():
            assert same_bits(np.ascontiguousarray(array), getattr(system, key) + 0.0), key
        if system.dof:
            reduced = read_reduced(path, C="BAA")
            assert np.array_equal(reduced.K, system.K)
            assert np.array_equal(reduced.C, system.C)
            check = mx.check_export(path, system)
            assert check.passed
            assert [(item.quantity, item.against) for item in check.comparisons] == [
                (key, "the model") for key in result]  # fmt: skip
    with pytest.raises(mv.ExportError, match="nothing to write"):
        mx.to_op4(slider((), (), locked=True), path)


@pytest.mark.slow
@pytest.mark.parametrize("binary", [False, True])
def test_pyyeti_reads_what_is_written(binary, tmp_path):
    op4 = pytest.importorskip("pyyeti.nastran.op4", reason=YETI)
    for build in SYSTEMS:
        system = build()
        result = op4.load(str(mx.to_op4(system, tmp_path / "x.op4", binary)))
        assert list(result) == [name.lower() for name, key in NAMES.items() if getattr(system, key).size]
        for name, (array, form, kind) in result.items():
            truth = getattr(system, NAMES[name.upper()])
            assert np.array_equal(array, truth)
            symmetric = name in ("maa", "baa", "kaa") and np.array_equal(truth, truth.T)
            assert (form, kind) == (6 if symmetric else 1 if name in ("maa", "baa", "kaa") else 2, 2)


@pytest.mark.parametrize("layout", ["dense", "bigmat", "nonbigmat"])
@pytest.mark.parametrize(("binary", "order"), [(True, "<"), (True, ">"), (False, "<")])
def test_what_pyyeti_writes_is_read(binary, order, layout, tmp_path):
    op4 = pytest.importorskip("pyyeti.nastran.op4", reason=YETI)
    path, truth = tmp_path / "x.op4", matrices()
    op4.write(str(path), truth, binary=binary, endian=order, sparse=layout, digits=17)
    result = read_op4_file(path.read_bytes())
    assert list(result) == list(truth)
    for name, array in truth.items():
        assert np.array_equal(result[name], array), name
    assert [name for name, array in read_op4_file(path.read_bytes(), ("ROW",)).items() if array is not None] == ["ROW"]


@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::SyntaxWarning")
def test_pynastran_reads_what_is_written(tmp_path):
    op4 = pytest.importorskip("pyNastran.op4.op4", reason=NASTRAN)
    for build in SYSTEMS:
        system = build()
        for binary in (False, True):
            result = op4.read_op4(str(mx.to_op4(system, tmp_path / "x.op4", binary)), debug=False)
            assert list(result) == [name for name, key in NAMES.items() if getattr(system, key).size]
            for name, matrix in result.items():
                assert np.array_equal(matrix.data, getattr(system, NAMES[name])), name


@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::SyntaxWarning")
def test_what_pynastran_writes_is_read(tmp_path):
    op4 = pytest.importorskip("pyNastran.op4.op4", reason=NASTRAN)
    path = tmp_path / "x.op4"
    truth = {name: array for name, array in matrices().items() if name in ("FULL", "HOLES", "TALL")}
    given = {name: (2, array) for name, array in truth.items()}  # its sparse ones have wrong lengths of strings
    op4.OP4(debug=False).write_op4(str(path), given, precision="double", is_binary=False)
    result = read_op4_file(path.read_bytes())
    assert list(result) == sorted(truth)
    for name, array in truth.items():
        assert np.array_equal(result[name], array), name


def header(columns=1, rows=1, kind=2, name="MAA", style="1P,3E24.16"):
    return f"{columns:8}{rows:8}{6:8}{kind:8}{name:<8}{style}\n"


VALUES = (1.5, -2.25, 1e-12)


def column(width=24, digits=16, per_line=3, letter="E"):
    """A column of the three values, as text of one format."""
    words = [f"{value:{width}.{digits}E}".replace("E", letter) for value in VALUES]
    lines = ["".join(words[k : k + per_line]) for k in range(0, 3, per_line)]
    return "\n".join([f"{1:8}{1:8}{3:8}", *lines, ""])


def closing(words=1, number="1.4142135623730951E+00"):
    return f"{2:8}{1:8}{words:8}\n" + (f"{number:>24}\n" if number else "")


NUMBERS = "".join(f"{value:24.16E}" for value in VALUES) + "\n"


@pytest.mark.parametrize("text", [
    header(rows=3, style="1P,5E16.9") + column(16, 9, 5) + closing(),
    header(rows=3, style="") + column(16, 9, 5) + closing(),
    header(rows=3, style="E16.9") + column(16, 9, 1) + closing(),
    header(rows=3, style="(1P3D24.16)") + column(letter="D") + closing(),
    header(rows=3, style="3ES25.16E3") + column(25) + closing(),
    header(rows=3) + column() + closing(number=""),
    header(rows=3) + column() + closing(0, ""),
    header(rows=3) + column() + closing(2),
    header(rows=-3) + f"{1:8}{0:8}{8:8}\n{7:8}{1:8}\n{NUMBERS}" + closing(),
    header(rows=3) + f"{1:8}{0:8}{8:8}\n{7:8}{1:8}\n{NUMBERS}" + closing(),
    header(rows=3) + f"{1:8}{0:8}{7:8}\n{(7 << 16) + 1:12}\n{NUMBERS}" + closing(),
    "\r\n".join((header(rows=3) + column() + closing()).split("\n")),
], ids=["5E16.9", "default", "no repeat", "D", "ES", "no closing number", "closed by no word", "closed by two words",
        "long strings", "long strings of positive rows", "short strings", "line ends of two characters"])  # fmt: skip
def test_texts_of_other_writers_are_read(text):
    other = header(name="OTHER", rows=3) + column() + closing()
    result = read_op4_file((text + "\n\n" + other).encode())
    for name in ("MAA", "OTHER"):
        np.testing.assert_allclose(result[name][:, 0], VALUES, rtol=1e-9)


@pytest.mark.parametrize(("text", "message"), [
    ("nothing of the kind\n" * 3, "line 1: .*is not an integer"),
    (header(99_999_999, 99_999_999), "expected a reduced matrix"),
    (header(-1, 1), "of 1 x -1 entries"),
    (header(kind=7), "expected types 1 to 4"),
    (header() + f"{1:8}{1:8}{99_999_999:8}\n", "99999999 numbers are to follow; 0 lines are left"),
    (header() + f"{1:8}{1:8}{2:8}\n{1.0:24.16E}{1.0:24.16E}\n", "2 numbers from row 1 of column 1"),
    (header() + f"{1:8}{-1:8}{1:8}\n{1.0:24.16E}\n", "begin no column"),
    (header() + f"{1:8}{1:8}{1:8}\n{'nan':>24}\n", "'nan' is not a number"),
    (header() + f"{1:8}{1:8}{1:8}\n{'1.0+999':>24}\n", "exceeds the range"),
    (header() + f"{1:8}{0:8}{5:8}\n{65536:11}\n", "a string of 0 words"),
    (header() + f"{1:8}{1:8}{1:8}\n{1.0:24.16E}\n", "it ends within a matrix"),
    (2 * (header() + f"{2:8}{1:8}{1:8}\n{1.0:24.16E}\n"), "'MAA' is there twice"),
    (header(style="1P,0E24.16") + f"{1:8}{1:8}{1:8}\n{1.0:24.16E}\n", "is none"),
    ("", "0 bytes; expected a matrix"),
], ids=range(14))  # fmt: skip
def test_texts_that_are_refused(text, message, tmp_path):
    path = tmp_path / "x.op4"
    path.write_text(text)
    with pytest.raises(mv.ExportError, match=rf"x\.op4: no OP4 file of to_op4, or a damaged one \(.*{message}"):
        read_op4(path)
    with pytest.raises(mv.ModelError, match=rf"x\.op4: cannot be read as an OP4 file: .*{message}"):
        read_reduced(path)


def test_binary_files_that_are_refused(tmp_path):
    raw = mx.to_op4(slider(), tmp_path / "x.op4", binary=True).read_bytes()
    column = raw.index(b"MAA") + 12  # the record behind the header
    for content, message in (
        (raw[:-3], "a record of 20 bytes; 17 follow"), (raw[: column + 10], "a record of"),
        (raw[:4] + b"\xff\xff\xff\x7f" * 2 + raw[12:], "expected a reduced matrix"),
        (raw[:column] + b"\x15" + raw[column + 1 :], "its lengths differ|a record of"),
        (raw[: column + 12] + b"\x09" + raw[column + 13 :], "a column that begins with"),
        (b"\x19" + raw[1:], "not a header of a matrix"),
    ):  # fmt: skip
        with pytest.raises(ContentError, match=message):
            read_op4_file(content)
