"""Atomic writing of files: completely or not at all."""

from __future__ import annotations

import os
import shutil
import sys
from contextlib import suppress
from pathlib import Path
from typing import IO, TYPE_CHECKING
from uuid import uuid4

from mbsvib.common.expected import a_path
from mbsvib.errors import ExportError, MbsvibError

if TYPE_CHECKING:
    from collections.abc import Callable

# Temporary files have the name of their file, eight digits, and this ending.
DRAFT = ".part"


def write_atomic(
    path: str | os.PathLike[str], write: Callable[[IO[bytes]], object],
    error: Callable[[str], MbsvibError] = ExportError,
) -> Path:  # fmt: skip
    """Write a temporary file in the same folder, then rename it to the path.

    An existing file is replaced and keeps its permissions, a link stays a link. ``write`` writes to the binary stream
    it is given.
    """
    a_path(path, "file", error)
    target = Path(os.path.realpath(path))
    start = f".{target.name[:60]}."
    _remove_abandoned(target.parent, start)
    draft = target.with_name(f"{start}{uuid4().hex[:8]}{DRAFT}")
    try:
        with open(draft, "xb") as stream:
            with suppress(OSError):  # some file systems have no locks
                _lock(stream)
            write(stream)
            stream.flush()
            os.fsync(stream.fileno())
        if target.exists():
            shutil.copymode(target, draft)
        os.replace(draft, target)
    except OSError as reason:
        raise error(
            f"{os.fspath(path)}: cannot be written: {reason.strerror or reason}. Give the path of a file in a folder "
            f"that exists and that you may write to; nothing was changed there."
        ) from reason
    finally:
        with suppress(OSError):
            draft.unlink(missing_ok=True)
    return Path(path)


def _remove_abandoned(folder: Path, start: str) -> None:
    """Remove temporary files of interrupted writers; those of active writers are locked."""
    try:
        drafts = [draft for draft in folder.iterdir() if draft.name.startswith(start) and draft.name.endswith(DRAFT)
                  and len(draft.name) == len(start) + 8 + len(DRAFT)]  # fmt: skip
    except OSError:
        return
    for draft in drafts:
        try:
            with open(draft, "rb") as stream:
                _lock(stream)
            draft.unlink(missing_ok=True)
        except OSError:  # it is being written, or belongs to another user
            continue


def _lock(stream: IO[bytes]) -> None:
    """Lock a file for as long as it is open, or raise OSError; Windows removes no file that is open anyway."""
    if sys.platform != "win32":
        import fcntl

        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
