"""Atomic writing of files: completely or not at all, also where several processes write one file."""

from __future__ import annotations

import os
import re
import shutil
import sys
from collections.abc import Callable
from contextlib import suppress
from hashlib import sha256
from io import BufferedWriter, FileIO
from pathlib import Path
from time import time
from typing import IO
from uuid import uuid4

from mbsvib.common.expected import a_path
from mbsvib.errors import ExportError, MbsvibError

# Temporary files have the name of their file, eight digits, and this ending. Longer names than this are cut, as file
# systems hold 255 bytes, and get a checksum in place of the rest.
DRAFT = ".part"
LONGEST = 40
# Drafts that other writers take for abandoned ones before they are locked, one after the other.
ATTEMPTS = 100
# Where open files are not renamed, so that a draft has no lock for a moment, younger ones than this [s] are kept.
YOUNG = 60.0


def write_atomic(
    path: str | os.PathLike[str], write: Callable[[IO[bytes]], object],
    error: Callable[[str], MbsvibError] = ExportError,
) -> Path:  # fmt: skip
    """Write a temporary file in the same folder, then rename it to the path.

    An existing file is replaced and keeps its permissions, a link stays a link; devices and pipes are refused, as the
    rename would remove them. ``write`` writes to the binary stream
    it is given. Of several writers at a time each succeeds, and the file is that of the last.
    """
    a_path(path, "file", error)
    target, draft = Path(os.path.realpath(path)), None
    start = _start(target.name)
    _remove_abandoned(target.parent, start)
    try:
        if target.exists() and not target.is_file() and not target.is_dir():
            raise OSError("It is a device or a pipe")
        draft, stream = _new_draft(target, start)
        with stream:
            write(stream)
            stream.flush()
            os.fsync(stream.fileno())
            with suppress(FileNotFoundError):
                shutil.copymode(target, draft)
            if sys.platform == "win32":
                stream.close()
            os.replace(draft, target)  # within its lock: others must not remove it before
    except OSError as reason:
        raise error(
            f"{os.fspath(path)}: cannot be written: {reason.strerror or reason}. Give the path of a file in a folder "
            f"that exists and that you may write to; nothing was changed there."
        ) from reason
    finally:
        if draft is not None:
            with suppress(OSError):
                draft.unlink(missing_ok=True)
    return Path(path)


def _start(name: str) -> str:
    """Return the beginning of the names of a file's drafts, which those of no other file have."""
    if len(name) > LONGEST:
        name = f"{name[:LONGEST]}~{sha256(os.fsencode(name)).hexdigest()[:16]}"
    return f".{name}."


def _new_draft(target: Path, start: str) -> tuple[Path, IO[bytes]]:
    """Create a temporary file and lock it; one that another writer removed before it was locked is left to it."""
    for _ in range(ATTEMPTS):
        draft = target.with_name(f"{start}{uuid4().hex[:8]}{DRAFT}")
        stream = BufferedWriter(FileIO(draft, "x"))
        try:
            _lock(stream)
        except BlockingIOError:
            stream.close()
            draft.unlink(missing_ok=True)
            continue
        except OSError:  # some file systems have no locks; drafts are not removed there
            return draft, stream
        if draft.exists():
            return draft, stream
        stream.close()
    raise OSError(f"{ATTEMPTS} temporary files were removed by other writers")


def _remove_abandoned(folder: Path, start: str) -> None:
    """Remove temporary files of interrupted writers; those of active writers are locked."""
    pattern = re.compile(rf"{re.escape(start)}[0-9a-f]{{8}}{re.escape(DRAFT)}")
    try:
        drafts = [draft for draft in folder.iterdir() if pattern.fullmatch(draft.name)]
    except OSError:
        return
    for draft in drafts:
        with suppress(OSError):  # it is being written, or belongs to another user
            if sys.platform == "win32":  # which removes no open file, and has no such locks
                if time() - draft.stat().st_mtime > YOUNG:
                    draft.unlink(missing_ok=True)
                continue
            with open(draft, "rb") as stream:
                _lock(stream)
                draft.unlink(missing_ok=True)


def _lock(stream: IO[bytes]) -> None:
    """Lock a file for as long as it is open, or raise OSError."""
    if sys.platform != "win32":
        import fcntl

        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
