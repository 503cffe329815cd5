"""Files that ask for more than they hold: refused in words, before memory or disk is taken."""

import io
import os
import stat
import struct
import zipfile
import zlib

import numpy as np
import pytest

import mbsvib as mv
import mbsvib_export as mx
from mbsvib.common import mat_file
from mbsvib.superelements import read_mat
from mbsvib_export import reading as file_reading
from mbsvib_export.fmu_ import reading
from mbsvib_export.hdf5_ import HEAD, head
from tests.export.plants import slider, stewart


def with_member(path, name, content):
    """The archive with one more member, or another one in the place of the one of this name."""
    with zipfile.ZipFile(path) as archive:
        members = {each: archive.read(each) for each in archive.namelist()}
    with zipfile.ZipFile(path, "w") as archive:
        for each, old in (members | {name: content}).items():
            archive.writestr(each, old)


def npy(shape, dtype="<f8", content=b""):
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(stream, {"descr": dtype, "fortran_order": False, "shape": shape})
    return stream.getvalue() + content


@pytest.fixture
def small_limit(monkeypatch):
    """Ten megabytes in the place of a gigabyte."""
    for module in (file_reading, mat_file):
        monkeypatch.setattr(module, "LARGEST_UNPACKED", 10_000_000)


@pytest.mark.slow
@pytest.mark.usefixtures("small_limit")
def test_junk_in_an_archive_is_left_packed(tmp_path):
    path = mx.to_npz(stewart(), tmp_path / "x.npz")
    with (zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as archive,
          archive.open("junk.npy", "w", force_zip64=True) as stream):  # fmt: skip
        stream.write(npy((2_500_000,)) + bytes(20_000_000))
    assert path.stat().st_size < 300_000
    assert mx.from_npz(path).name == "stewart"


@pytest.mark.usefixtures("small_limit")
def test_arrays_that_unpack_to_gigabytes(tmp_path):
    path = mx.to_npz(stewart(), tmp_path / "x.npz")
    with zipfile.ZipFile(path) as archive:
        members = {each: archive.read(each) for each in archive.namelist() if each != "M.npy"}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
        with archive.open("M.npy", "w") as stream:
            stream.write(npy((1200, 1200)) + bytes(8 * 1200 * 1200))
    with pytest.raises(mv.ExportError, match=r"x\.npz: .*arrays that unpack to 0\.01\d+ GB; expected 0\.01 GB at most"):
        mx.from_npz(path)


@pytest.mark.parametrize(("content", "message"), [
    (npy((2**40, 2**40)), "size 1099511627776 x 1099511627776 in its header is not possible"),
    (npy((-1, -8), content=bytes(64)), "no header of an array"),
    (npy((100, 100), content=bytes(8)), "needs 80000 bytes; 8 follow"),
    (npy((0, 10**12)), "is not possible"),
    (npy((1,), "|O", bytes(8)), "no header of an array"),
    (npy((1,), "<c16", bytes(16)), "no header of an array"),
    (npy((1,), "<f8", bytes(16)), "has 16 bytes for 1 entries"),
    (b"\x93NUMPY\x03\x00" + bytes(100), "not an array of numpy's format"),
], ids=range(8))  # fmt: skip
def test_headers_of_arrays(content, message, tmp_path):
    path = mx.to_npz(slider(), tmp_path / "x.npz")
    with_member(path, "M.npy", content)
    with pytest.raises(mv.ExportError, match=rf"x\.npz: .*{message}"):
        mx.from_npz(path)


def test_a_name_in_the_table_that_is_not_that_of_the_array(tmp_path):
    path = mx.to_npz(slider(), tmp_path / "x.npz")
    raw = path.read_bytes()
    at = raw.rindex(b"Ca.npy")
    path.write_bytes(raw[:at] + b"Cz" + raw[at + 2 :])
    with pytest.raises(mv.ExportError, match=r"x\.npz: .*File name in directory"):
        mx.from_npz(path)


def test_batches_whose_arrays_have_other_numbers_of_variants(tmp_path):
    model = mv.library.quarter_car()
    batch = model.linearize(values={next(iter(model.parameters)): [1.0, 2.0]})
    path = mx.to_npz_batch(batch, tmp_path / "x.npz")
    with_member(path, "values.npy", npy((1, 10**9)))
    with pytest.raises(mv.ExportError, match=r"values.*is not possible"):
        mx.from_npz_batch(path)
    with_member(path, "values.npy", npy((1, 1), content=bytes(8)))
    with pytest.raises(mv.ExportError, match=r"has shape .*; expected 1 variants"):
        mx.from_npz_batch(path)


@pytest.mark.parametrize(("old", "new"), [
    ('"name": "slider"', '"name": "slider", "name": "other"'), ('"M": ', '"M": [[1.0]], "M": '),
    ('"name": "F"', '"unit": "m", "name": "F"'),
])  # fmt: skip
def test_keys_that_are_there_twice(old, new, tmp_path):
    path = tmp_path / "x.json"
    text = mx.to_json(slider())
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(mv.ExportError, match=r"x\.json: the key '\w+' is there twice in one object"):
        mx.from_json(path)


def test_halves_of_characters_are_no_text():
    with pytest.raises(mv.ExportError, match="halves of characters"):
        mx.from_json(mx.to_json(slider()).replace('"slider"', '"\\ud800"'))


def test_numbers_of_hdf5_that_are_elsewhere(tmp_path):
    """Datasets that were never written, are packed or stand in another file have any size at no cost."""
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "x.h5"
    (tmp_path / "secret").write_bytes(bytes(8))
    for more in ({"shape": (10**6, 10**6), "dtype": float}, {"shape": (1, 1), "dtype": float},
                 {"data": np.ones((1, 1)), "compression": "gzip"},
                 {"shape": (1, 1), "dtype": float, "external": [(str(tmp_path / "secret"), 0, 8)]}):  # fmt: skip
        mx.to_hdf5(slider(), path)
        with h5py.File(path, "r+") as file:
            del file["M"]
            file.create_dataset("M", **more)
        raw = path.read_bytes()[HEAD:]
        path.write_bytes(head(raw) + raw)
        with pytest.raises(mv.ExportError, match=r"x\.h5: .*(in its header|packed, missing or in another file)"):
            mx.from_hdf5(path)


def element(kind, content):
    return struct.pack("<2I", kind, len(content)) + content + bytes(-len(content) % 8)


def matrix(name, flags, shape, *parts):
    words = element(6, struct.pack("<2I", *flags)) + element(5, struct.pack(f"<{len(shape)}i", *shape))
    return element(14, words + element(1, name) + b"".join(parts))


def matlab(*variables):
    return b"MATLAB 5.0".ljust(124) + struct.pack("<H", 0x0100) + b"IM" + b"".join(variables)


ONE = element(9, struct.pack("<d", 1.0))
GOOD = matrix(b"K", (6, 0), (1, 1), ONE)


@pytest.mark.parametrize(("variable", "message"), [
    (matrix(b"M", (6, 0), (2**30, 2**30), ONE), "is not possible"),
    (matrix(b"M", (6, 0), (-1, -1), ONE), "is not possible"),
    (matrix(b"M", (6, 0), (1, 2), ONE), "needs 2 bytes; 1 follow"),
    (matrix(b"M", (1, 0), (2**30, 1)), "is not possible"),
    (matrix(b"M", (5, 1), (2**30, 2**30), element(5, b""), element(5, bytes(8)), ONE), "expected a reduced matrix"),
    (matrix(b"M", (5, 1), (2, 1), element(5, struct.pack("<i", 7)), element(5, struct.pack("<2i", 0, 1)), ONE),
     "a row of the sparse matrix is not between 1 and 2"),
    (matrix(b"M", (5, 1), (2, 1), element(5, struct.pack("<i", 1)), element(5, struct.pack("<2i", 0, 9)), ONE),
     "columns of the sparse matrix do not fit"),
    (matrix(b"M", (3, 0), (1, 1), ONE), "objects of class 3 are not read"),
    (matrix(b"M", (0x0806, 0), (1, 1), ONE, ONE), "expected a square matrix of real numbers"),
    (matrix(b"M", (6, 0), (1, 1), element(9, struct.pack("<d", np.nan))), "'M' holds NaN or infinity"),
    (matrix(b"M", (6, 0), (2, 2), element(9, bytes(32))), "2, 1 rows; expected as many in each"),
    (GOOD, "'K' is there twice"),
    (element(15, zlib.compress(matrix(b"M", (6, 0), (1, 1), ONE))[:32]), "'M' is cut short or unpacks"),
    (struct.pack("<2I", 14, 2**32 - 1), "an element of 4294967295 bytes; 0 follow"),
], ids=range(14))  # fmt: skip
def test_matlab_files(variable, message, tmp_path):
    path = tmp_path / "x.mat"
    path.write_bytes(matlab(GOOD, variable))
    with pytest.raises(mv.ModelError, match=rf"x\.mat: .*({message})"):
        read_mat(path)


@pytest.mark.usefixtures("small_limit")
def test_packed_variables_of_gigabytes(tmp_path):
    """A variable that is not asked for is not unpacked; one that is, up to a limit."""
    packing = zlib.compressobj(9)
    inner = matrix(b"M", (6, 0), (1, 1), ONE)[8:-16]
    content = packing.compress(struct.pack("<2I", 14, 2**31) + inner + struct.pack("<2I", 9, 2**31 - 200))
    content += packing.compress(bytes(11_000_000)) + packing.flush()
    path = tmp_path / "x.mat"
    path.write_bytes(matlab(GOOD, struct.pack("<2I", 15, len(content)) + content, matrix(b"N", (6, 0), (1, 1), ONE)))
    assert path.stat().st_size < 20_000
    assert read_mat(path, M="N").M == 1.0
    with pytest.raises(mv.ModelError, match=r"'M' is cut short or unpacks to more than 0.01 GB"):
        read_mat(path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes here")
@pytest.mark.parametrize("read", [mx.from_json, mx.from_npz, mx.from_npz_batch, mx.from_mat, mx.check_export, read_mat,
                                  mv.load_urdf, mv.load])  # fmt: skip
def test_pipes_and_folders_are_no_files(read, tmp_path):
    """A pipe would wait for ever, and a device never ends."""
    suffix = {mv.load: ".yaml", mx.check_export: ".fmu"}.get(read, ".x")
    os.mkfifo(tmp_path / f"pipe{suffix}")
    (tmp_path / f"folder{suffix}").mkdir()
    more = (slider(),) if read is mx.check_export else ()
    for name in ("pipe", "folder"):
        with pytest.raises(mv.MbsvibError, match=rf"{name}.*cannot be read"):
            read(tmp_path / f"{name}{suffix}", *more)


@pytest.mark.parametrize("name", ["../x", "a/../../x", "/etc/x", "C:/x", "a\\..\\x", "..", "\\\\host\\x"])
def test_entries_that_lead_out_of_an_archive(tmp_path, name):
    path = mx.to_npz(slider(), tmp_path / "x.npz")
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr(name, b"")
    with pytest.raises(mv.ExportError, match="leads out of the archive"):
        mx.from_npz(path)


def test_links_in_an_archive(tmp_path):
    path = mx.to_npz(slider(), tmp_path / "x.npz")
    link = zipfile.ZipInfo("link")
    link.create_system, link.external_attr = 3, (stat.S_IFLNK | 0o777) << 16
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr(link, "/etc/passwd")
    with pytest.raises(mv.ExportError, match="'link' is a link"):
        mx.from_npz(path)


@pytest.mark.parametrize(
    ("element", "count", "message"),
    [(b"<a/>", 1001, "more than 1000 elements"), (b" " * 1000, 101, "has 0.101 MB; expected at most 0.1 MB")],
)
def test_small_units_with_large_descriptions(tmp_path, monkeypatch, element, count, message):
    """Five million elements, in 20 kB, took 0.3 GB and five seconds; the limits are smaller here."""
    monkeypatch.setattr("mbsvib.common.file_content.MOST_ELEMENTS", 1000)
    monkeypatch.setattr(reading, "LARGEST_DESCRIPTION", 100_000)
    path = tmp_path / "x.fmu"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", b"<fmiModelDescription>" + element * count + b"</fmiModelDescription>")
    with pytest.raises(mv.ExportError, match=message):
        mx.check_export(path, slider())
