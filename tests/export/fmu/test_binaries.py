"""Binaries: compiled on first use, kept, brought by the wheel, and asked for in words where there is no compiler."""

import zipfile

import pytest

import mbsvib as mv
import mbsvib_export as mx
from mbsvib_export.fmu_ import binaries
from tests.export.plants import slider

# what files of executable code begin with
MAGIC = {"linux": b"\x7fELF", "windows": b"MZ", "darwin": b"\xcf\xfa\xed\xfe"}
HERE = binaries.this_platform()
COMMON = binaries.COMMON  # tests run without them


@pytest.fixture
def fake(monkeypatch, tmp_path):
    """A compiler that counts its calls, a cache and a wheel of its own."""
    calls = []

    def build(name, folder, portable=False):
        calls.append(name)
        path = folder / f"library{binaries.PLATFORMS[name].suffix}"
        path.write_bytes(name.encode())
        return path

    monkeypatch.setattr(binaries, "build", build)
    monkeypatch.setattr(binaries, "WHEEL", tmp_path / "wheel")
    monkeypatch.setenv(binaries.CACHE_VARIABLE, str(tmp_path / "cache"))
    return calls


def test_each_is_compiled_once_and_kept(fake):
    for _ in range(2):
        assert binaries.binary("x86_64-windows") == b"x86_64-windows"
    assert fake == ["x86_64-windows"]
    assert binaries.source_hash() in str(binaries.cache_folder())


def test_a_cache_that_cannot_be_written_costs_time_only(fake, monkeypatch, tmp_path):
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setenv(binaries.CACHE_VARIABLE, str(tmp_path / "file"))
    for _ in range(2):
        assert binaries.binary("x86_64-windows") == b"x86_64-windows"
    assert len(fake) == 2


def test_the_wheel_is_asked_first_and_all_that_it_brings_is_written(fake, monkeypatch, tmp_path):
    for name in ("x86-windows", HERE):
        target = tmp_path / "wheel" / binaries.source_hash() / name / f"mbsvib_lti{binaries.PLATFORMS[name].suffix}"
        target.parent.mkdir(parents=True)
        target.write_bytes(b"from the wheel")
    monkeypatch.setattr(binaries, "find_spec", lambda name: None)
    file = mx.to_fmu(slider(), tmp_path / "unit.fmu")
    assert file.platforms == (HERE, "x86-windows")
    assert fake == []
    with zipfile.ZipFile(file.path) as archive:
        assert archive.read("binaries/x86-windows/slider.dll") == b"from the wheel"


def test_linux_and_windows_are_in_by_default_where_zig_is(fake, monkeypatch, tmp_path):
    monkeypatch.setattr(binaries, "find_spec", lambda name: object())
    monkeypatch.setattr(binaries, "COMMON", COMMON)
    file = mx.to_fmu(slider(), tmp_path / "unit.fmu")
    assert set(file.platforms) == {HERE, "x86_64-linux", "x86_64-windows"}
    assert set(file.platforms) | set(file.other_platforms) == set(binaries.PLATFORMS)
    assert 'not for aarch64-linux, x86-windows' in repr(file)
    assert repr(file).endswith('platforms="all")')
    assert "not for" not in repr(mx.to_fmu(slider(), tmp_path / "all.fmu", platforms="all"))


def test_what_nobody_asked_for_is_left_out_with_a_warning(fake, monkeypatch, tmp_path):
    def broken(name, folder, portable=False):
        if name != HERE:
            raise mv.ExportError("to_fmu: the binary could not be compiled.")
        return build(name, folder, portable)

    build = binaries.build
    monkeypatch.setattr(binaries, "build", broken)
    monkeypatch.setattr(binaries, "find_spec", lambda name: object())
    monkeypatch.setattr(binaries, "COMMON", COMMON)
    with pytest.warns(UserWarning, match="is left out. to_fmu: the binary could not be compiled"):
        file = mx.to_fmu(slider(), tmp_path / "unit.fmu")
    assert file.platforms == (HERE,)
    other = next(name for name in COMMON if name != HERE)
    with pytest.raises(mv.ExportError, match="could not be compiled"):
        mx.to_fmu(slider(), tmp_path / "unit.fmu", platforms=(HERE, other))


def test_folders_are_those_of_each_version(fake, tmp_path):
    files = mx.to_fmu(slider(), tmp_path / "unit.fmu", ("2.0", "3.0"), platforms="all")
    for file, folder in zip(files, ("win64", "x86_64-windows"), strict=True):
        with zipfile.ZipFile(file.path) as archive:
            result = [name for name in archive.namelist() if name.startswith("binaries/")]
        assert len(result) == len(binaries.PLATFORMS) == 6
        assert f"binaries/{folder}/slider.dll" in result


def test_no_compiler_is_told_with_what_to_install(monkeypatch, tmp_path):
    monkeypatch.setenv(binaries.CACHE_VARIABLE, str(tmp_path / "cache"))
    monkeypatch.setattr(binaries, "find_spec", lambda name: None)
    monkeypatch.setattr(binaries.shutil, "which", lambda name: None)
    for name in (HERE, "aarch64-darwin"):
        with pytest.raises(mv.ExportError, match=r'no compiler for it.*pip install "mbsvib\[fmu\]"'):
            mx.to_fmu(slider(), tmp_path / "unit.fmu", platforms=name)
    assert not list(tmp_path.glob("*.fmu*"))


def test_a_compiler_that_fails_is_quoted(monkeypatch, tmp_path):
    monkeypatch.setenv(binaries.CACHE_VARIABLE, str(tmp_path / "cache"))
    monkeypatch.setattr(binaries, "_FLAGS", ("--no-such-flag",))
    with pytest.raises(mv.ExportError, match="could not be compiled"):
        mx.to_fmu(slider(), tmp_path / "unit.fmu")


@pytest.mark.parametrize(("given", "words"), [("x86_64-linus", "Did you mean 'x86_64-linux'"), ((), "at least one")])
def test_platforms_are_checked(given, words, tmp_path):
    with pytest.raises(mv.ExportError, match=words):
        mx.to_fmu(slider(), tmp_path / "unit.fmu", platforms=given)


@pytest.mark.skipif("linux" not in HERE, reason="other platforms have their mathematics elsewhere")
def test_a_binary_brings_the_mathematics_that_it_calls():
    """Else it loads in programs only that have loaded them, as Python has."""
    assert b"libm.so" in binaries.binary(HERE)


@pytest.mark.slow
@pytest.mark.parametrize("name", binaries.PLATFORMS)
def test_zig_compiles_for_every_platform(name, tmp_path):
    pytest.importorskip("ziglang", reason="zig is not installed: pip install ziglang")
    content = binaries.build(name, tmp_path, portable=True).read_bytes()
    assert content.startswith(MAGIC[name.split("-")[1]])
    assert b"fmi2DoStep" in content
    assert b"fmi3DoStep" in content
