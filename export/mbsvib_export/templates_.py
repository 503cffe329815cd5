"""Texts of files that exports write: templates with ``$``, and files that stand next to the requested one."""

from __future__ import annotations

import os
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from string import Template

from mbsvib.errors import ExportError


def filled(name: str, **words: object) -> str:
    """Return the text of a file of the folder ``templates`` with its ``$`` words filled in."""
    return Template((files("mbsvib_export") / "templates" / name).read_text(encoding="utf-8")).substitute(words)


def check_companion(path: Path, is_own: Callable[[Path], bool], contents: str, instead: str) -> None:
    """Refuse to replace a file next to the requested one, unless ``is_own`` tells that the same export has written it.
    """
    if not os.path.lexists(path):
        return
    try:
        is_same_export = path.is_file() and is_own(path)
    except OSError:
        is_same_export = False
    if not is_same_export:
        raise ExportError(f"{path}: this file is there already and is not {contents}, so that it is not replaced. "
                          f"{instead} Nothing was written.")  # fmt: skip
