"""Atomic writing of files, with the error class of exports."""

from __future__ import annotations

import os
from pathlib import Path
from typing import IO, TYPE_CHECKING

from mbsvib.common import atomic_file
from mbsvib.common.expected import a_path
from mbsvib.errors import ExportError

if TYPE_CHECKING:
    from collections.abc import Callable


def write_atomic(path: str | os.PathLike[str], write: Callable[[IO[bytes]], object]) -> Path:
    """Write a file atomically: to a temporary file in the same folder, which then replaces it.

    Parameters
    ----------
    path : str or path
        Where the file goes; one that is there is replaced, a link stays a link.
    write : callable
        Writes the content to the binary stream it is given.

    Returns
    -------
    Path
        The path.

    Raises
    ------
    ExportError
        If the file cannot be written. What was at the path is then still there, untouched.
    """
    a_path(path, "file", ExportError)
    try:
        return atomic_file.write_atomic(path, write)
    except OSError as error:
        raise ExportError(
            f"{os.fspath(path)}: cannot be written: {error.strerror or error}. Give the path of a file in a folder "
            f"that exists and that you may write to; nothing was changed there."
        ) from error


def check_companion(path: Path, is_own: Callable[[Path], bool], contents: str, instead: str) -> None:
    """Refuse to replace a further file next to the requested one, unless the same export has written it before.

    Parameters
    ----------
    path : Path
        Path of the companion.
    is_own : callable
        Tells whether the existing file comes from the same export.
    contents, instead : str
        Description of the companion and advice, for the message.

    Raises
    ------
    ExportError
        If another file is there. Nothing has been written then.
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
