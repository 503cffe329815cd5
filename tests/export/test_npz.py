"""numpy's .npz: bit-exact, readable by numpy alone, and errors that name the file."""

import struct
import zipfile

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import mbsvib as mv
import mbsvib_export as mx
from tests.export.plants import same_bits, slider, stewart
from tests.export.test_json import SYSTEMS, assert_same


@pytest.mark.few(8)
@pytest.mark.parametrize("case", SYSTEMS)
@pytest.mark.parametrize("realization", ["physical", "modal", "balanced"])
def test_there_and_back(case, realization, tmp_path):
    system = SYSTEMS[case]()
    path = tmp_path / "system.npz"
    assert mx.to_npz(system, path, realization) == path
    data = mx.from_npz(path)
    assert_same(data, system, realization)
    again = mx.to_npz(data, str(tmp_path / "again"))
    assert_same(mx.from_npz(again), system, realization)
    assert mx.to_json(data) == mx.to_json(system, realization=realization)


def test_numpy_alone_reads_it(tmp_path):
    system = stewart()
    mx.to_npz(system, tmp_path / "plant")  # no suffix is added
    with np.load(tmp_path / "plant") as arrays:
        assert arrays["format"] == "mbsvib-system"
        assert arrays["version"] == 1
        assert arrays["inputs"].tolist() == list(system.inputs)
        assert same_bits(arrays["K"], system.K)
        assert same_bits(arrays["state_space.A"], system.state_space().A)
        assert all(array.dtype != object for array in arrays.values())


def repacked(path, **changes):
    with np.load(path) as arrays:
        content = {**arrays, **changes}
    np.savez(path, **{key: array for key, array in content.items() if array is not None})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"format": "other"}, "format = 'other'"),
        ({"format": None}, "format = 'None'"),
        ({"version": 2}, "version = 2.*upgrade"),
        ({"K": None}, "'K' is missing"),
        ({"state_space.A": None}, "'state_space.A' is missing"),
        ({"K": np.zeros((2, 2))}, r"K has shape \(2, 2\); expected \(1, 1\)"),
        ({"K": np.array([[1]])}, "'K' holds int64; expected float64"),
        ({"K": np.array([[np.nan]])}, "K holds NaN"),
        ({"input_units": np.array([], dtype=str)}, "0 units for 1 inputs"),
        ({"K": np.array([[None]])}, "damaged"),
    ],
)
def test_mistakes_are_found(changes, message, tmp_path):
    path = mx.to_npz(slider(), tmp_path / "wrong.npz")
    repacked(path, **changes)
    with pytest.raises(mv.ExportError, match=rf"wrong\.npz: .*{message}"):
        mx.from_npz(path)


def test_an_array_with_fewer_bytes_than_the_archive_says(tmp_path):
    """Both places that name the size of K are changed; its checksum is that of the bytes that are there."""
    path = mx.to_npz(slider(), tmp_path / "short.npz")
    with np.load(path) as arrays:
        np.savez_compressed(path, **arrays)
    with zipfile.ZipFile(path) as archive:
        size = archive.getinfo("K.npy").file_size
    raw = bytearray(path.read_bytes())
    local, central = raw.index(b"K.npy") - 30, raw.rindex(b"PK\x01\x02", 0, raw.rindex(b"K.npy"))
    extra = raw.find(struct.pack("<Q", size), local, local + 60)
    raw[central + 24 : central + 28] = struct.pack("<I", size + 8)
    if extra > 0:
        raw[extra : extra + 8] = struct.pack("<Q", size + 8)
    path.write_bytes(raw)
    with pytest.raises(mv.ExportError, match=rf"short\.npz: .*K\.npy has {size} bytes; expected {size + 8}"):
        mx.from_npz(path)


def test_files_of_another_kind(tmp_path):
    other = tmp_path / "other"
    with zipfile.ZipFile(other, "w") as archive:
        archive.writestr("a.txt", "text")
    array = tmp_path / "array"
    with open(array, "wb") as stream:
        np.save(stream, np.eye(2))
    empty = tmp_path / "empty"
    empty.touch()
    for path in (other, array, empty):
        with pytest.raises(mv.ExportError, match=f"{path.name}: .*to_npz|written by mbsvib"):
            mx.from_npz(path)
    for path in (tmp_path / "none", tmp_path):
        with pytest.raises(mv.ExportError, match=f"{path.name}: cannot be read"):
            mx.from_npz(path)


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(place=st.floats(0.0, 1.0, exclude_max=True), flip=st.integers(0, 255))
def test_a_damaged_file_is_refused_or_whole(place, flip, tmp_path_factory):
    """Cut short (flip = 0) or one byte changed; zip keeps checksums of the content, not of its own dates."""
    system = slider()
    path = mx.to_npz(system, tmp_path_factory.mktemp("npz") / "file.npz")
    raw = bytearray(path.read_bytes())
    at = int(place * len(raw))
    if flip:
        raw[at] ^= flip
    else:
        del raw[at:]
    path.write_bytes(raw)
    try:
        read = mx.from_npz(path)
    except mv.ExportError:
        return
    assert flip
    assert_same(read, system)


def test_an_archive_with_another_count_of_entries_is_refused(tmp_path):
    """Its end states one entry more than its table has, as after a damage that swallows the last."""
    path = mx.to_npz(slider(), tmp_path / "x.npz")
    raw = bytearray(path.read_bytes())
    raw[raw.rfind(b"PK\5\6") + 10] += 1
    path.write_bytes(raw)
    with pytest.raises(mv.ExportError, match=r"files in the archive; its end says \d+"):
        mx.from_npz(path)
