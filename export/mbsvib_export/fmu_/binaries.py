"""The binary for each platform: from the wheel, from the cache, or compiled now; it is the same for every model."""

from __future__ import annotations

import hashlib
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import warnings
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from mbsvib.common.arguments import known
from mbsvib.errors import ExportError

SOURCE = Path(__file__).parent / "source"
WHEEL = Path(__file__).parent / "binaries"
CACHE_VARIABLE = "MBSVIB_CACHE"
_FLAGS = ("-std=c11", "-O3", "-shared", "-fPIC", "-s", "-fvisibility=hidden", "-ffp-contract=off")
_NAME = "mbsvib_lti"


@dataclass(frozen=True, slots=True)
class Platform:
    """A platform: its tuple in FMI 3, the folder of FMI 2, the suffix of its libraries, zig's name of it."""

    name: str
    folder_2: str
    suffix: str
    target: str


PLATFORMS = {
    target.name: target
    for target in (
        Platform("x86_64-linux", "linux64", ".so", "x86_64-linux-gnu.2.17"),
        Platform("aarch64-linux", "aarch64-linux", ".so", "aarch64-linux-gnu.2.17"),
        Platform("x86_64-windows", "win64", ".dll", "x86_64-windows-gnu"),
        Platform("x86-windows", "win32", ".dll", "x86-windows-gnu"),
        Platform("x86_64-darwin", "darwin64", ".dylib", "x86_64-macos.11.0"),
        Platform("aarch64-darwin", "aarch64-darwin", ".dylib", "aarch64-macos.11.0"),
    )
}

# Platforms that plants are simulated on most: an export has them by default where zig can compile them.
COMMON = ("x86_64-linux", "x86_64-windows")


def this_platform() -> str:
    """Return the platform tuple of the running Python as FMI 3 names it; it may be one that is not in ``PLATFORMS``."""
    machine = {"amd64": "x86_64", "arm64": "aarch64", "i386": "x86", "i686": "x86"}
    word = platform.machine().lower()
    bits = machine.get(word, word)
    if sys.maxsize <= 2**32 and bits == "x86_64":
        bits = "x86"
    return f"{bits}-{platform.system().lower()}"


@cache
def source_hash() -> str:
    """Return a hash of the C source and of how it is compiled."""
    total = hashlib.sha256("\0".join(_FLAGS).encode())
    for path in sorted(SOURCE.iterdir()):
        if path.suffix in (".c", ".h"):
            total.update(path.name.encode() + b"\0" + path.read_bytes())
    return total.hexdigest()[:16]


def cache_folder() -> Path:
    """Return the folder of compiled binaries of this source, below ``MBSVIB_CACHE`` or the user's cache.
    """
    configured = os.environ.get(CACHE_VARIABLE)
    if configured:
        root = Path(configured)
    elif os.name == "nt":
        root = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local") / "mbsvib" / "Cache"
    elif sys.platform == "darwin":
        root = Path.home() / "Library" / "Caches" / "mbsvib"
    else:
        root = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "mbsvib"
    return root / "fmu" / source_hash()


def wanted_platforms(platforms: str | tuple[str, ...] | None) -> tuple[str, ...]:
    """Return platforms by names, ``"all"`` or None: this one, those of the wheel, with zig the ``COMMON`` ones."""
    if platforms is None:
        common = COMMON if find_spec("ziglang") else ()
        return tuple(dict.fromkeys((_known(this_platform()), *filter(_in_wheel, PLATFORMS), *common)))
    names = tuple(PLATFORMS) if platforms == "all" else (platforms,) if isinstance(platforms, str) else tuple(platforms)
    if not names:
        raise ExportError("to_fmu: platforms = (); expected at least one, or None for this one.")
    return tuple(_known(name) for name in dict.fromkeys(names))


def binaries(platforms: str | tuple[str, ...] | None) -> dict[str, bytes]:
    """Return the shared libraries of an export by platform, in the order of ``wanted_platforms``."""
    result = {}
    for name in wanted_platforms(platforms):
        try:
            result[name] = binary(name)
        except ExportError as error:
            if platforms is not None or name == this_platform():
                raise
            warnings.warn(f"to_fmu: the binary for {name} is left out. {error} Name the platforms that are needed, "
                          f"platforms=('{this_platform()}',).", stacklevel=3)  # fmt: skip
    return result


def _known(name: str) -> str:
    known(name, PLATFORMS, f"to_fmu: platforms: there is no binary for '{name}'", None, "There are", ExportError)
    return name


def _in_wheel(name: str) -> Path | None:
    path = WHEEL / source_hash() / name / f"{_NAME}{PLATFORMS[name].suffix}"
    return path if path.is_file() else None


def binary(name: str) -> bytes:
    """Return the binary for a platform of ``PLATFORMS``; it is compiled if necessary."""
    shipped = _in_wheel(name)
    if shipped:
        return shipped.read_bytes()
    cached = cache_folder() / name / f"{_NAME}{PLATFORMS[name].suffix}"
    if cached.is_file():
        return cached.read_bytes()
    with tempfile.TemporaryDirectory(prefix="mbsvib-") as folder:
        content = build(name, Path(folder)).read_bytes()
    with suppress(OSError, ExportError):  # a cache that cannot be written costs time, not the export
        cached.parent.mkdir(parents=True, exist_ok=True)
        from mbsvib.common.atomic_file import write_atomic  # needs numpy, which builds of wheels lack

        write_atomic(cached, lambda stream: stream.write(content))
    return content


def build(name: str, folder: Path, portable: bool = False) -> Path:
    """Compile the binary for a platform of ``PLATFORMS``; ``portable``: with zig, for old systems too."""
    goal = PLATFORMS[name]
    result = folder / f"{_NAME}{goal.suffix}"
    sources = sorted(path.name for path in SOURCE.glob("*.c"))
    command = [*_compiler(goal, portable), *_FLAGS, *sources, "-o", str(result.resolve())]
    if "darwin" in name:  # else the place of the build is in the file
        command += [f"-Wl,-install_name,@rpath/{result.name}"]
    elif "linux" in name:
        command += ["-lm"]
    ran = subprocess.run(command, cwd=SOURCE, capture_output=True, text=True)
    if ran.returncode or not result.is_file():
        lines = "\n".join(ran.stderr.strip().splitlines()[-8:])
        raise ExportError(f"to_fmu: the binary for {name} could not be compiled:\n{' '.join(command)}\n{lines}\nSee "
                          f"whether the compiler works, or install zig:  pip install \"mbsvib[fmu]\"")  # fmt: skip
    return result


def _compiler(goal: Platform, portable: bool) -> list[str]:
    """The compiler of this machine for itself, zig for the others."""
    if goal.name == this_platform() and not portable:
        system_compiler = next((path for word in ("gcc", "clang", "cc") if (path := shutil.which(word))), None)
        if system_compiler:
            return [system_compiler]
    if find_spec("ziglang"):
        return [sys.executable, "-m", "ziglang", "cc", "-target", goal.target, "-fno-sanitize=all"]
    raise ExportError(
        f"to_fmu: there is no binary for {goal.name}, and no compiler for it. Install zig with:  "
        f'pip install "mbsvib[fmu]"'
        + ("  or gcc or clang. " if goal.name == this_platform() else "  or leave this platform out. ")
        + "It is compiled once and kept."
    )
