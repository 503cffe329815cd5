"""HDF5: bit-exact, and errors that name the file."""

import sys

import numpy as np
import pytest

import mbsvib as mv
import mbsvib_export as mx
from mbsvib_export.hdf5_ import HEAD, head
from tests.export.plants import same_bits, slider, stewart
from tests.export.test_json import SYSTEMS, assert_same
from tests.export.test_massless import plant as massless

h5py = pytest.importorskip("h5py", reason="h5py is not installed: pip install 'mbsvib[hdf5]'")


@pytest.mark.few(2)
@pytest.mark.parametrize("case", SYSTEMS)
@pytest.mark.parametrize("realization", ["physical", "modal", "balanced"])
def test_there_and_back(case, realization, tmp_path):
    system = SYSTEMS[case]()
    path = tmp_path / "system.h5"
    assert mx.to_hdf5(system, path, realization) == path
    assert_same(mx.from_hdf5(path), system, realization)
    assert_same(mx.from_hdf5(mx.to_hdf5(mx.from_hdf5(path), tmp_path / "b.h5")), system, realization)


def test_massless_motions(tmp_path):
    result = mx.from_hdf5(mx.to_hdf5(massless(), tmp_path / "x.h5")).state_space
    assert same_bits(result.through, massless().state_space().through)


def test_h5py_alone_reads_it(tmp_path):
    system = stewart()
    mx.to_hdf5(system, tmp_path / "x.h5")
    with h5py.File(tmp_path / "x.h5") as file:
        assert same_bits(file["K"][()], system.K)
        assert same_bits(file["state_space/A"][()], system.state_space().A)
        assert tuple(file["inputs"].asstr()[()]) == system.inputs


def test_damage(tmp_path):
    path = mx.to_hdf5(slider(), tmp_path / "x.h5")
    raw = path.read_bytes()
    for content in (raw[:100], b"", b"text"):
        path.write_bytes(content)
        with pytest.raises(mv.ExportError, match=r"x\.h5: no HDF5 file as to_hdf5 wrote it"):
            mx.from_hdf5(path)
    with h5py.File(path, "w") as file:
        file["K"] = np.eye(2)
    with pytest.raises(mv.ExportError, match="saved by another program"):
        mx.from_hdf5(path)
    with pytest.raises(mv.ExportError, match=r"none\.h5: cannot be read"):
        mx.from_hdf5(tmp_path / "none.h5")


def test_files_of_later_versions(tmp_path):
    path = mx.to_hdf5(slider(), tmp_path / "x.h5")
    with h5py.File(path, "r+") as file:
        file["version"][...] = 99
    raw = path.read_bytes()[HEAD:]
    path.write_bytes(head(raw) + raw)
    with pytest.raises(mv.ExportError, match=r"x\.h5: version = 99"):
        mx.from_hdf5(path)


def test_h5py_is_asked_for(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(mv.ExportError, match=r'to_hdf5: .*pip install "mbsvib\[hdf5\]"'):
        mx.to_hdf5(slider(), tmp_path / "x.h5")
