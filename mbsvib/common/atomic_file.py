"""Files that are written whole or not at all."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import IO, TYPE_CHECKING
from uuid import uuid4

if TYPE_CHECKING:
    from collections.abc import Callable


def write_whole(path: str | os.PathLike[str], write: Callable[[IO[bytes]], object]) -> Path:
    """Write a file beside its place, then put it there in one step.

    Parameters
    ----------
    path : str or path-like
        Where the file goes; one that is there is replaced and keeps its permissions, a link stays a link.
    write : callable
        Writes the content to the binary stream it is given.

    Returns
    -------
    Path
        The path. Where an OSError is raised instead, what was there is still there, untouched.
    """
    target = Path(os.path.realpath(path))
    draft = target.with_name(f".{target.name[:60]}.{uuid4().hex[:8]}.part")
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
    return Path(path)
