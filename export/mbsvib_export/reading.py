"""Files of exporters as bytes, with all errors as ``ExportError``, and arrays out of .npz archives: only those that are
asked for, and none larger than the bytes that stand for it.
"""

from __future__ import annotations

import os
import re
import zipfile
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common.expected import a_path
from mbsvib.common.file_content import LARGEST_UNPACKED, ContentError, check_shape, content_of, shortened
from mbsvib.errors import ExportError
from mbsvib_export.archives import archive_of, unpacked

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator

_SUFFIX = ".npy"
_LAST_CHARACTER = 0x10FFFF
# The beginning of an array with its format, and its header: a Python dictionary of three entries.
_START = re.compile(rb"\x93NUMPY([\x01\x02])\x00")
_HEADER = re.compile(rb"\{'descr': '([<>=|]?(?:[iu][1248]|f[248]|U[0-9]{1,9}))', 'fortran_order': (True|False), "
                     rb"'shape': \(([0-9]{0,18}(?:, ?[0-9]{1,18})*,?)\),? ?\}\s*")  # fmt: skip


@contextmanager
def content_read(path: str | os.PathLike[str], kind: str, target: str) -> Iterator[bytes]:
    """Return a context that gives the content of a file, and in which all errors of a reader become ``ExportError``.

    ``kind``: of file, in words. ``target``: what follows ``to_`` and ``from_`` in the names of writer and reader.
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
        raise ContentError(f"{subject} is no array of numpy's format 1.0 or 2.0")
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
