"""Zip archives of unknown origin: entries counted, named once, and the same in both places that name them."""

from __future__ import annotations

import stat
import zipfile
import zlib
from contextlib import contextmanager
from io import BytesIO
from typing import TYPE_CHECKING

from mbsvib.common.file_content import MOST_ENTRIES, ContentError, shortened
from mbsvib.errors import MbsvibError

if TYPE_CHECKING:
    from collections.abc import Iterator

# The record at the end of an archive, and the number in it where a longer record has the number of entries.
_END, _UNCOUNTED = b"PK\x05\x06", 0xFFFF


@contextmanager
def archive_of(raw: bytes) -> Iterator[zipfile.ZipFile]:
    """Open an archive, without unpacking, for the time of a with statement, within which damage is a ``ContentError``.
    """
    try:
        with zipfile.ZipFile(BytesIO(raw)) as archive:
            entries = archive.infolist()
            if len(entries) > MOST_ENTRIES:
                raise ContentError(f"{len(entries)} files in the archive; expected {MOST_ENTRIES} at most")
            if len({entry.filename for entry in entries}) < len(entries):
                raise ContentError("a name is there twice in the archive")
            end = raw.rfind(_END)  # it counts the entries; a damaged one can swallow the next
            if (counted := int.from_bytes(raw[end + 10 : end + 12], "little")) not in (len(entries), _UNCOUNTED):
                raise ContentError(f"{len(entries)} files in the archive; its end says {counted}")
            for entry in entries:
                _check_place(entry)
                with archive.open(entry):  # compares its name here and in the table at the end
                    pass
            yield archive
    except (ContentError, MbsvibError):
        raise
    except (zipfile.BadZipFile, zlib.error, EOFError, OSError, LookupError, RuntimeError, NotImplementedError,
            ValueError, OverflowError) as error:  # fmt: skip
        raise ContentError(f"the archive is damaged ({shortened(error)})") from error


def _check_place(entry: zipfile.ZipInfo) -> None:
    """Refuse an entry that would be unpacked elsewhere, by its name or as a link."""
    name = entry.orig_filename
    if name.startswith("/") or "\\" in name or "\0" in name or name[1:2] == ":" or ".." in name.split("/"):
        raise ContentError(f"the entry {name[:60]!r} leads out of the archive; expected relative paths with slashes")
    if stat.S_ISLNK(entry.external_attr >> 16):
        raise ContentError(f"the entry {name[:60]!r} is a link; expected files and folders")


def unpacked(archive: zipfile.ZipFile, name: str) -> bytes:
    """Return the content of an entry, after comparing its checksum."""
    entry = archive.getinfo(name)
    with archive.open(entry) as stream:
        content = stream.read(entry.file_size + 1)  # to its end, where the checksum is compared
    if len(content) != entry.file_size:
        raise ContentError(f"{name} has {len(content)} bytes; expected {entry.file_size}")
    return content
