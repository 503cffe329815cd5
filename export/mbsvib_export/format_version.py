"""The format of the files of mbsvib that hold a system, and its version."""

from __future__ import annotations

from typing import Any

from mbsvib.errors import ExportError

FORMAT = "mbsvib-system"
SPACE_FORMAT = "mbsvib-state-space"  # first-order equations alone
VERSION = 1  # counts up when a key changes its meaning or goes; readers skip keys they do not know


def check_version(name: Any, version: Any) -> None:
    """Refuse a file of another format, or of a version this release does not know."""
    if name not in (FORMAT, SPACE_FORMAT):
        raise ExportError(f"format = {name!r}; expected {FORMAT!r} or {SPACE_FORMAT!r}. This is not a system written "
                          f"by mbsvib.")  # fmt: skip
    if version != VERSION or isinstance(version, bool):
        raise ExportError(f"version = {version!r}; this release of mbsvib reads version {VERSION}. A later release "
                          f"wrote it: upgrade mbsvib (pip install -U mbsvib), or export it again.")  # fmt: skip
