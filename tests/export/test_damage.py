"""Damaged files are refused in words, and never end the process: cut short, or with bytes changed."""

import numpy as np
import pytest

import mbsvib as mv
import mbsvib_export as mx
from mbsvib_export.dmig_ import read_dmig
from mbsvib_export.op4_ import read_op4
from tests.export.plants import slider
from tests.export.test_json import assert_same

KINDS = {
    "mat": (mx.to_mat, mx.from_mat, "scipy"),
    "h5": (mx.to_hdf5, mx.from_hdf5, "h5py"),
    "uff": (lambda system, path: mx.to_uff(system, path, [1.0, 2.0]), mx.from_uff, "numpy"),
    "text.uff": (lambda system, path: mx.to_uff(system, path, [1.0, 2.0], binary=False), mx.from_uff, "numpy"),
    "pch": (mx.to_dmig, read_dmig, "numpy"),
    "op4": (mx.to_op4, read_op4, "numpy"),
}


def damaged(raw, rng, k):
    result = bytearray(raw)
    if k % 2:
        return bytes(result[: rng.integers(len(raw))])
    for at in rng.integers(len(raw), size=3):
        result[at] = rng.integers(256)
    return bytes(result)


@pytest.mark.few(1)
@pytest.mark.parametrize("kind", KINDS)
def test_damage_is_refused_or_harmless(kind, tmp_path, capsys):
    write, read, package = KINDS[kind]
    pytest.importorskip(package)
    path, rng, refused = tmp_path / f"x.{kind}", np.random.default_rng(0), 0
    write(slider(), path)
    raw = path.read_bytes()
    for k in range(80):
        path.write_bytes(damaged(raw, rng, k))
        try:
            result = read(path)
        except mv.ExportError:
            refused += 1
            continue
        if kind in ("mat", "h5"):
            assert_same(result, slider())
    assert refused > (40 if kind not in ("mat", "h5") else 78)
    assert capsys.readouterr().out == ""


def test_a_changed_number_is_found(tmp_path):
    system = slider()
    pytest.importorskip("h5py")
    for name, write, read in (("x.mat", mx.to_mat, mx.from_mat), ("x.h5", mx.to_hdf5, mx.from_hdf5)):
        path = write(system, tmp_path / name)
        raw = path.read_bytes()
        at = raw.find(np.float64(1e4).tobytes())
        path.write_bytes(raw[:at] + np.float64(2e4).tobytes() + raw[at + 8 :])
        with pytest.raises(mv.ExportError, match=name):
            read(path)


@pytest.mark.parametrize("suffix", ["mat", "h5", "npz"])
def test_a_changed_letter_is_found(suffix, tmp_path):
    """A name or unit that is another one contradicts nothing in the file but its checksum."""
    write, read, package = KINDS.get(suffix, (mx.to_npz, mx.from_npz, "numpy"))
    pytest.importorskip(package)
    path = tmp_path / f"x.{suffix}"
    write(slider(outputs=("height",)), path)
    raw = path.read_bytes()
    letters = "".join(f"{letter}\0\0\0" for letter in "height").encode() if suffix == "npz" else b"height"
    assert letters in raw
    path.write_bytes(raw.replace(letters, letters.replace(b"g", b"x")))
    with pytest.raises(mv.ExportError, match=rf"x\.{suffix}: .*(damaged|CRC)"):
        read(path)
