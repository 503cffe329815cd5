"""Files are written whole or not at all."""

import os
import shutil
import stat
from functools import partial

import pytest

import mbsvib as mv
import mbsvib_export as mx
from mbsvib.common import atomic_file
from mbsvib.common.atomic_file import write_atomic
from tests.export.plants import slider

WRITERS = {"json": mx.to_json, "npz": mx.to_npz, "mat": partial(mx.to_mat, loader=False), "pch": mx.to_dmig,
           "h5": mx.to_hdf5, "uff": partial(mx.to_uff, omega=[1.0]), "op4": mx.to_op4}  # fmt: skip
NEEDS = {"h5": "h5py"}


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
        write_atomic(path, full)
    with pytest.raises(KeyboardInterrupt):
        write_atomic(path, interrupted)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_what_a_kill_left_behind_is_removed(tmp_path):
    """Drafts of the same file, but not those that somebody writes at the time, nor other files."""
    dead, other = tmp_path / ".plant.json.0123abcd.part", tmp_path / ".plant.json.txt.part"
    dead.write_bytes(b"half")
    os.utime(dead, (1e9, 1e9))
    other.write_bytes(b"mine")

    def write(stream):
        mine = next(item for item in tmp_path.iterdir() if item not in (dead, other))
        write_atomic(tmp_path / "plant.json", lambda inner: inner.write(b"second"))
        assert mine.exists() or os.name == "nt"
        stream.write(b"first")

    write_atomic(tmp_path / "plant.json", write)
    assert not dead.exists()
    assert sorted(item.name for item in tmp_path.iterdir()) == [other.name, "plant.json"]
    assert (tmp_path / "plant.json").read_bytes() == b"first"


@pytest.mark.skipif(os.name == "nt", reason="drafts are not locked there")
@pytest.mark.parametrize("name", ["plant.json", "n" * 200 + ".json"])
@pytest.mark.parametrize("step", ["_lock", "replace"])
def test_another_writer_comes_in_between(tmp_path, monkeypatch, name, step):
    """Before the draft is locked, and before it is renamed: the other one took it for an abandoned draft."""
    place, path, calls = (atomic_file if step == "_lock" else os), tmp_path / name, []
    original = getattr(place, step)

    def interrupted(*arguments):
        calls.append(arguments)
        if len(calls) == 1:
            write_atomic(path, lambda stream: stream.write(b"second"))
            assert path.read_bytes() == b"second"
        return original(*arguments)

    monkeypatch.setattr(place, step, interrupted)
    write_atomic(path, lambda stream: stream.write(b"first"))
    assert len(calls) > 1
    assert path.read_bytes() == b"first"
    assert list(tmp_path.iterdir()) == [path]


def test_a_removed_file_is_written_again(tmp_path, monkeypatch):
    """The old file goes away between the question whether it is there and the copy of its mode."""
    path = tmp_path / "plant"
    path.write_bytes(b"old")
    copy = shutil.copymode

    def removed(source, target):
        path.unlink()
        copy(source, target)

    monkeypatch.setattr(shutil, "copymode", removed)
    write_atomic(path, lambda stream: stream.write(b"new"))
    assert path.read_bytes() == b"new"


def test_files_whose_names_begin_alike_have_drafts_of_their_own(tmp_path):
    one, two = (tmp_path / f"{'n' * 70}-{letter}.json" for letter in "ab")
    seen = []

    def abandoned(stream):
        seen.extend(item for item in tmp_path.iterdir() if item.name.endswith(".part"))
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_atomic(one, abandoned)
    seen[0].write_bytes(b"half")
    os.utime(seen[0], (1e9, 1e9))
    write_atomic(two, lambda stream: stream.write(b"two"))
    assert seen[0].exists()
    write_atomic(one, lambda stream: stream.write(b"one"))
    assert sorted(tmp_path.iterdir()) == [one, two]


def test_fmus_of_others_are_not_replaced(tmp_path):
    pytest.importorskip("fmpy")
    own = tmp_path / "plant-fmi3.fmu"
    mx.to_fmu(slider(name="another"), own, "3.0")
    before = own.read_bytes()
    with pytest.raises(mv.ExportError, match=r"plant-fmi3\.fmu: .* is not an FMU of 'slider' by mbsvib"):
        mx.to_fmu(slider(), tmp_path / "plant.fmu", ("2.0", "3.0"))
    assert [item.name for item in tmp_path.iterdir()] == [own.name]
    assert own.read_bytes() == before
    own.unlink()
    for _ in range(2):
        assert len(mx.to_fmu(slider(), tmp_path / "plant.fmu", ("2.0", "3.0"))) == 2


@pytest.mark.parametrize("kind", WRITERS)
def test_an_old_file_is_replaced_and_keeps_its_mode(kind, tmp_path):
    path = tmp_path / "plant"
    path.write_bytes(b"x" * 100_000)
    path.chmod(0o640)
    WRITERS[kind](slider(), path)
    assert path.stat().st_size < 50_000
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    assert {item.name for item in tmp_path.iterdir()} - {"load_plant.m"} == {"plant"}


def test_a_new_file_has_the_usual_mode(tmp_path):
    write_atomic(tmp_path / "a", lambda stream: stream.write(b""))
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


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names")
def test_devices_and_pipes_stay(tmp_path):
    """Written by the superuser, /dev/null would be a file from then on."""
    path = tmp_path / "pipe"
    os.mkfifo(path)
    with pytest.raises(mv.ExportError, match="pipe: cannot be written: It is a device or a pipe"):
        write_atomic(path, lambda stream: stream.write(b"content"))
    assert path.is_fifo()
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("path", ["a\0b", os.fsencode("name")])
@pytest.mark.parametrize("export", [*WRITERS.values(), mx.to_modelica, mx.to_c, mx.from_npz, mx.from_uff])
def test_names_that_no_file_has(export, path, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(mv.ExportError, match="expected the path of a file"):
        export(*([] if "from" in getattr(export, "__name__", "") else [slider()]), path)
    assert not list(tmp_path.iterdir())


def test_a_relative_path(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    mx.to_json(slider(), "plant.json")
    assert mx.from_json("plant.json").name == "slider"
