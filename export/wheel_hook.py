"""Build hook of hatch: binaries of functional mock-up units for all platforms go into the wheel.

    MBSVIB_BINARIES=all uv build --wheel

Then zig is fetched for the build and compiles them, one or two minutes each the first time. Without it the wheel has
none, and each is compiled at the first export that needs it: an editable install, as tests use it, shall be quick.
"""

from __future__ import annotations

import importlib.util
import os
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

VARIABLE = "MBSVIB_BINARIES"
WANTED = os.environ.get(VARIABLE, "")


class BinariesHook(BuildHookInterface[Any]):  # type: ignore[misc]
    """Compiles before a wheel is put together, if that is wished."""

    def dependencies(self) -> list[str]:
        """Return what the build needs besides hatchling."""
        return ["ziglang>=0.13"] if WANTED else []

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile all binaries and add them to the wheel; an editable install has none."""
        if not WANTED or version == "editable":
            return
        binaries = _binaries(Path(self.root))
        self._folder = TemporaryDirectory(prefix="mbsvib-")
        for name in binaries.wanted_platforms(WANTED if WANTED == "all" else tuple(WANTED.split(","))):
            self.app.display_waiting(f"binary of units for {name}")
            folder = Path(self._folder.name) / name
            folder.mkdir()
            file = binaries.build(name, folder, portable=True)
            path_in_wheel = f"mbsvib_export/fmu_/binaries/{binaries.source_hash()}/{name}/{file.name}"
            build_data["force_include"][str(file)] = path_in_wheel

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Remove what was compiled."""
        folder = getattr(self, "_folder", None)
        if folder is not None:
            folder.cleanup()


def _binaries(root: Path) -> Any:
    """The module that compiles, without the packages around it: the environment of a build has no numpy."""
    bare = ModuleType("mbsvib")
    bare.__path__ = [str(root / "mbsvib")]
    sys.modules.setdefault("mbsvib", bare)
    path = root / "export" / "mbsvib_export" / "fmu_" / "binaries.py"
    spec = importlib.util.spec_from_file_location("_mbsvib_binaries", path)
    if spec is None or spec.loader is None:
        raise FileNotFoundError(path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module
