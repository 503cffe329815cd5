"""Files are written whole or not at all."""

import os
import stat

import pytest

import mbsvib as mv
import mbsvib_export as mx
from mbsvib_export.whole_file import write_whole
from tests.export.plants import slider

WRITERS = {"json": mx.to_json, "npz": mx.to_npz, "mat": mx.to_mat, "pch": mx.to_dmig, "h5": mx.to_hdf5,
           "uff": lambda system, path: mx.to_uff(system, path, [1.0]), "op4": mx.to_op4}  # fmt: skip
NEEDS = {"h5": "h5py", "op4": "pyNastran"}


@pytest.fixture(autouse=True)
def _package(request):
    kind = request.node.callspec.params.get("kind") if hasattr(request.node, "callspec") else None
    if kind in NEEDS:
        pytest.importorskip(NEEDS[kind])


@pytest.mark.parametrize("kind", WRITERS)
def test_places_that_cannot_be_written(kind, tmp_path):
    (tmp_path / "file").write_text("content")
    (tmp_path / "folder").mkdir()
    for path in (tmp_path / "missing" / "a", tmp_path / "file" / "a", tmp_path / "folder", tmp_path / ("n" * 300)):
        with pytest.raises(mv.ExportError, match=r"cannot be written: .*Give the path") as caught:
            WRITERS[kind](slider(), path)
        assert str(path) in str(caught.value)
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["file", "folder"]
    assert not any((tmp_path / "folder").iterdir())
    assert (tmp_path / "file").read_text() == "content"


def test_a_failure_halfway_leaves_the_old_file(tmp_path):
    path = tmp_path / "kept"
    path.write_bytes(b"old")

    def full(stream):
        stream.write(b"new")
        raise OSError(28, "No space left on device")

    def interrupted(stream):
        stream.write(b"new")
        raise KeyboardInterrupt

    with pytest.raises(mv.ExportError, match="kept: cannot be written: No space left"):
        write_whole(path, full)
    with pytest.raises(KeyboardInterrupt):
        write_whole(path, interrupted)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("kind", WRITERS)
def test_an_old_file_is_replaced_and_keeps_its_mode(kind, tmp_path):
    path = tmp_path / "plant"
    path.write_bytes(b"x" * 100_000)
    path.chmod(0o640)
    WRITERS[kind](slider(), path)
    assert path.stat().st_size < 50_000
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    assert {each.name for each in tmp_path.iterdir()} - {"load_plant.m"} == {"plant"}


def test_a_new_file_has_the_usual_mode(tmp_path):
    write_whole(tmp_path / "a", lambda stream: stream.write(b""))
    (tmp_path / "b").touch()
    assert (tmp_path / "a").stat().st_mode == (tmp_path / "b").stat().st_mode


@pytest.mark.skipif(not hasattr(os, "symlink"), reason="no symbolic links here")
def test_a_link_stays_a_link(tmp_path):
    (tmp_path / "real").mkdir()
    link = tmp_path / "link"
    link.symlink_to(tmp_path / "real" / "plant.json")
    mx.to_json(slider(), link)
    assert link.is_symlink()
    assert mx.from_json(tmp_path / "real" / "plant.json").name == "slider"


def test_a_relative_path(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    mx.to_json(slider(), "plant.json")
    assert mx.from_json("plant.json").name == "slider"
