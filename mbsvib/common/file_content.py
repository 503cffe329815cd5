"""Files of unknown origin: plain bytes, no array larger than its file, JSON with finite numbers and each key once, and
XML of elements and attributes only, without document type, entities or deep nesting.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Callable, Sequence
from typing import Any, NoReturn
from xml.etree import ElementTree
from xml.parsers import expat

from mbsvib.errors import MbsvibError

# Packed content is refused beyond: a gigabyte of nothing packs into one megabyte, so that the file's size says little.
LARGEST_UNPACKED = 1_000_000_000
# Sparse matrices are made dense up to this many bytes where their file is smaller: ten thousand rows.
LARGEST_DENSE = 800_000_000
# Entries of an archive; those that mbsvib writes have some tens.
MOST_ENTRIES = 10_000
# Rows of an array without columns, which takes no bytes, but the time of whoever counts them.
_MOST_EMPTY = 1_000_000
# Characters of a message of another library.
_LONGEST_MESSAGE = 160


class ContentError(ValueError):
    """Content that does not fit its format; readers add the file's name and what to do."""


def content_of(path: str | os.PathLike[str], error: Callable[[str], MbsvibError], expected: str) -> bytes:
    """Return the bytes of a regular file; folders, devices and pipes, which may never end, are refused.

    ``expected``: what the file should be, for the message: "a file of to_npz".
    """
    name = os.fspath(path)
    if isinstance(name, str) and "\n" in name:
        first = name.lstrip().partition("\n")[0]
        raise error(f"path = '{first} ...': this is the content of a file; expected the path of {expected}.")
    try:
        mode = os.stat(path).st_mode
        if stat.S_ISREG(mode):
            with open(path, "rb") as stream:
                return stream.read()
    except FileNotFoundError as reason:
        raise error(f"{name}: cannot be read: there is no such file; expected {expected}.") from reason
    except (OSError, ValueError, MemoryError) as reason:  # ValueError: a zero byte in the path
        message = getattr(reason, "strerror", None) or str(reason) or "not enough memory"
        raise error(f"{name}: cannot be read: {message}; expected {expected}.") from reason
    kind = "a folder" if stat.S_ISDIR(mode) else "no regular file"
    raise error(f"{name}: cannot be read: it is {kind}; expected {expected}.")


def check_shape(shape: Sequence[int], itemsize: int, available: int, subject: str) -> int:
    """Return the number of bytes of an array after comparing it with what the file holds.

    ``shape``: rows, columns and so on, as a header says.
    """
    size = itemsize
    for number in shape:
        if number < 0 or number > max(available, _MOST_EMPTY):
            raise ContentError(f"{subject}: the size {_product(shape)} in its header is not possible; {available} "
                               f"bytes follow")  # fmt: skip
        size *= number
    if size > available:
        raise ContentError(f"{subject}: the size {_product(shape)} in its header needs {size} bytes; {available} "
                           f"follow")  # fmt: skip
    return size


def check_dense(rows: int, columns: int, available: int, subject: str) -> None:
    """Refuse a sparse matrix that would be too large as a dense one."""
    if rows < 0 or columns < 0 or 8 * rows * columns > max(LARGEST_DENSE, available):
        raise ContentError(f"{subject}: {rows} x {columns} entries; expected a reduced matrix, of at most "
                           f"{max(LARGEST_DENSE, available) / 1e9:.3g} GB")  # fmt: skip


def shortened(error: BaseException) -> str:
    """Return what another library says of a file, shortened: it may repeat all of the file's bytes."""
    text = " ".join(str(error).split())
    return text if len(text) <= _LONGEST_MESSAGE else f"{text[:_LONGEST_MESSAGE]} ..."


def read_json_content(content: str | bytes, nan: bool = False) -> Any:
    """Return what a JSON text, or its UTF-8 bytes, holds; ContentError if it is damaged.

    ``nan``: whether NaN and Infinity are numbers, which JSON does not have.
    """
    import json

    try:
        text = content if isinstance(content, str) else content.decode("utf-8-sig")
        constant = float if nan else _refuse_constant
        return json.loads(text, parse_constant=constant, object_pairs_hook=_without_duplicates)
    except ContentError:
        raise
    except json.JSONDecodeError as error:
        raise ContentError(f"line {error.lineno}, column {error.colno}: {error.msg}") from error
    except RecursionError as error:
        raise ContentError("no JSON that is read: lists and objects are nested too deep") from error
    except ValueError as error:  # no UTF-8, or an integer of thousands of digits
        raise ContentError(f"no JSON that is read: {shortened(error)}") from error


def _refuse_constant(word: str) -> NoReturn:
    raise ContentError(f"{word} is not a number; expected finite numbers only")


def _without_duplicates(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    result = dict(pairs)
    if len(result) < len(pairs):
        seen: set[str] = set()
        twice = next(key for key, _ in pairs if key in seen or seen.add(key))  # type: ignore[func-returns-value]
        raise ContentError(f"the key '{twice[:60]}' is there twice in one object; each key can be there only once. "
                           f"Remove one")  # fmt: skip
    return result


def _product(shape: Sequence[int]) -> str:
    return " x ".join(map(str, shape)) or "1"


# Elements within each other; a chain of a hundred bodies in MJCF has as many. Recursion ends at about a thousand.
DEEPEST = 500
# Elements of a file, each of which takes a hundred bytes and a microsecond; five million pack into 20 kB. Robots of
# ten thousand bodies and units of a hundred thousand variables stay below.
MOST_ELEMENTS = 500_000


def read_xml(content: bytes) -> ElementTree.Element:
    """Return the root element of an XML text.

    Document types are refused: their entities can unfold to any size, or name other files.
    """
    parser, builder, depth, count = expat.ParserCreate(), ElementTree.TreeBuilder(), 0, 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth, count
        depth += 1
        count += 1
        if count > MOST_ELEMENTS:
            raise ContentError(f"line {parser.CurrentLineNumber}: more than {MOST_ELEMENTS} elements.")
        if depth > DEEPEST:
            raise ContentError(f"line {parser.CurrentLineNumber}: elements are nested more than {DEEPEST} deep.")
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    def refuse(*_: Any) -> None:
        raise ContentError(f"line {parser.CurrentLineNumber}: a document type (<!DOCTYPE>) is not read, as its "
                           f"entities can unfold to any size; remove it.")  # fmt: skip

    parser.buffer_text = True
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler, parser.StartDoctypeDeclHandler = builder.data, refuse
    try:
        parser.Parse(content, True)
        return builder.close()
    except ContentError:
        raise
    except (expat.ExpatError, ValueError, LookupError) as error:  # the latter two: encodings
        raise ContentError(f"it is no XML: {error}.") from error
