"""Files of exporters as bytes, with all errors as ``ExportError``; zip archives of unknown origin, whose entries are
counted, named once, and the same in both places that name them; arrays out of .npz archives: only those that are asked
for, and none larger than the bytes that stand for it.
"""

from __future__ import annotations

import os
import re
import stat
import zipfile
import zlib
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from io import BytesIO
from typing import Any

import numpy as np

from mbsvib.common.expected import a_path
from mbsvib.common.file_content import LARGEST_UNPACKED, MOST_ENTRIES, ContentError, check_shape, content_of, shortened
from mbsvib.errors import ExportError, MbsvibError

# The record at the end of an archive, and the number in it where a longer record has the number of entries.
_END, _UNCOUNTED = b"PK\x05\x06", 0xFFFF
_SUFFIX = ".npy"
_LAST_CHARACTER = 0x10FFFF
# The beginning of an array with its format, and its header: a Python dictionary of three entries.
_START = re.compile(rb"\x93NUMPY([\x01\x02])\x00")
_HEADER = re.compile(rb"\{'descr': '([<>=|]?(?:[iu][1248]|f[248]|U[0-9]{1,9}))', 'fortran_order': (True|False), "
                     rb"'shape': \(([0-9]{0,18}(?:, ?[0-9]{1,18})*,?)\),? ?\}\s*")  # fmt: skip


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


@contextmanager
def content_read(path: str | os.PathLike[str], kind: str, target: str) -> Iterator[bytes]:
    """Return a context that gives the content of a file of ``to_TARGET``, in which all errors become ``ExportError``.
    """
    file, writer = a_path(path, f"from_{target}", ExportError), f"to_{target}"
    content, name = content_of(file, ExportError, f"a file of {writer}"), os.fspath(file)
    try:
        yield content
    except OSError as error:
        raise ExportError(f"{name}: cannot be read: {error.strerror or error}; expected a file of {writer}.") from error
    except ExportError as error:
        raise ExportError(f"{name}: {error}") from error
    except Exception as error:  # readers of damaged files raise exceptions of many kinds
        raise ExportError(f"{name}: no {kind} of {writer}, or a damaged one ({shortened(error)}); write it "
                          f"again.") from error


def arrays_in(content: bytes, requested: Collection[str]) -> dict[str, Any]:
    """Return the ``requested`` arrays of a .npz file that it has, by their names; others are not unpacked."""
    with archive_of(content) as archive:
        entries = [entry for entry in archive.infolist() if entry.filename.removesuffix(_SUFFIX) in requested]
        packed = sum(entry.file_size for entry in entries if entry.compress_type != zipfile.ZIP_STORED)
        if packed > LARGEST_UNPACKED:
            raise ContentError(f"arrays that unpack to {packed / 1e9:.3g} GB; expected {LARGEST_UNPACKED / 1e9:g} GB "
                               f"at most, or arrays that are not packed, as numpy.savez writes them")  # fmt: skip
        return {entry.filename.removesuffix(_SUFFIX): _array(unpacked(archive, entry.filename), entry.filename)
                for entry in entries}  # fmt: skip


def _array(content: bytes, subject: str) -> Any:
    start = _START.match(content)
    if not start:
        raise ContentError(f"{subject} is not an array of numpy's format 1.0 or 2.0")
    width = 2 if start[1] == b"\1" else 4
    begin = start.end() + width
    end = begin + int.from_bytes(content[start.end() : begin], "little")
    header = _HEADER.fullmatch(content[begin:end])
    if end > len(content) or not header:
        raise ContentError(f"{subject} has no header of an array of numbers or texts")
    dtype, is_fortran = np.dtype(header[1].decode()), header[2] == b"True"
    shape = tuple([int(number) for number in header[3].split(b",") if number.strip()])
    rest = memoryview(content)[end:]
    if check_shape(shape, dtype.itemsize, len(rest), subject) != len(rest):
        raise ContentError(f"{subject} has {len(rest)} bytes for {' x '.join(map(str, shape))} entries")
    if dtype.kind == "U":  # numpy does not look at what is no character
        codes = np.frombuffer(rest, f"{dtype.byteorder.replace('|', '=')}u4")
        if ((codes > _LAST_CHARACTER) | ((codes >= 0xD800) & (codes < 0xE000))).any():
            raise ContentError(f"{subject} holds texts with what are no characters")
    flat = np.frombuffer(rest, dtype) if len(rest) else np.zeros(shape, dtype).ravel()
    return flat.reshape(shape, order="F" if is_fortran else "C").copy()
