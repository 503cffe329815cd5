"""Files that are written whole or not at all."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import IO, TYPE_CHECKING
from uuid import uuid4

from mbsvib.errors import ExportError

if TYPE_CHECKING:
    from collections.abc import Callable


def write_whole(path: str | os.PathLike[str], write: Callable[[IO[bytes]], object]) -> Path:
    """Write a file beside its place, then put it there in one step.

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
    target = Path(os.path.realpath(path))
    draft = target.with_name(f".{target.name[:60]}.{uuid4().hex[:8]}.part")
    try:
        try:
            with open(draft, "xb") as stream:
                write(stream)
                stream.flush()
                os.fsync(stream.fileno())
            if target.exists():
                shutil.copymode(target, draft)
            os.replace(draft, target)
        finally:
            draft.unlink(missing_ok=True)
    except OSError as error:
        raise ExportError(
            f"{os.fspath(path)}: cannot be written: {error.strerror or error}. Give the path of a file in a folder "
            f"that exists and that you may write to; nothing was changed there."
        ) from error
    return Path(path)
