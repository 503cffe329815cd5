"""MATLAB's .mat files of level 5 (-v6, -v7): every size is compared with the bytes that are there before it is used.

Those of level 4 (-v4) are left to scipy.

Elements are a tag (type, bytes) and data, filled up to eight bytes; an array is an element of elements: flags,
dimensions, name, then numbers or further arrays.

Source: MathWorks, MAT-File Format (level 5).
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from io import BytesIO
from itertools import islice
from typing import Any

import numpy as np

from mbsvib.common.arrays import AnyArray
from mbsvib.common.file_content import LARGEST_UNPACKED, ContentError, check_dense, check_shape, shortened

HEADER = 128
LONGEST_NAME = 60  # characters of a name in MATLAB, which has 63, less what makes it differ
# Cells and structs within each other; to_mat writes three levels.
DEEPEST = 20
_DTYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_TEXTS = {1: "latin-1", 2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16", 18: "utf-32"}
_MATRIX, _COMPRESSED = 14, 15
_CELL, _STRUCT, _CHAR, _SPARSE = 1, 2, 4, 5
_NUMBERS = {6: "f8", 7: "f4", 8: "i1", 9: "u1", 10: "i2", 11: "u2", 12: "i4", 13: "u4", 14: "i8", 15: "u8"}
_COMPLEX = 0x0800
# Bytes of a packed variable in which its name is looked for; MATLAB's names have at most 63 characters.
_HEAD = 1024


def read_mat_file(raw: bytes, names: Collection[str] | None = None) -> dict[str, Any]:
    """Return variables of a .mat file of level 5 or 4.

    ``names``: variables to read; of level 5 others are only counted. Default: all. Returns numbers as arrays, sparse
    ones dense; texts as str (tuples of str for several rows), cells as arrays of objects, structs of one element as
    dicts. A variable that was not asked for is None.
    """
    if 0 in raw[:4]:
        return _level_4(raw)
    if len(raw) < HEADER or raw[126:128] not in (b"IM", b"MI"):
        raise ContentError("no MATLAB file of level 5")
    reader = _Reader("<" if raw[126:128] == b"IM" else ">", len(raw))
    if reader.number(raw[124:126], "u2") != 0x0100:
        raise ContentError(f"MATLAB file of version {reader.number(raw[124:126], 'u2'):#06x}; expected 0x0100")
    result: dict[str, Any] = {}
    for kind, data in reader.elements(memoryview(raw)[HEADER:]):
        if kind not in (_MATRIX, _COMPRESSED):
            raise ContentError(f"an element of type {kind} where a variable should be")
        head = data
        if kind == _COMPRESSED:
            head = memoryview(reader.unpacked(data, _HEAD)[0])[8:]
        name = reader.name(head)
        if name in result:
            raise ContentError(f"the variable '{name}' is there twice")
        if names is not None and name not in names:
            result[name] = None
            continue
        if kind == _COMPRESSED:
            content, complete = reader.unpacked(data, LARGEST_UNPACKED)
            if not complete:
                raise ContentError(f"the variable '{name}' is cut short or unpacks to more than "
                                   f"{LARGEST_UNPACKED / 1e9:g} GB")  # fmt: skip
            inner = list(reader.elements(memoryview(content)))
            if len(inner) != 1 or inner[0][0] != _MATRIX:
                raise ContentError(f"the packed variable '{name}' is damaged")
            data = inner[0][1]
        result[name] = reader.array(data, name, 0)
    return result


def _level_4(raw: bytes) -> dict[str, Any]:
    """Return the variables of a file of level 4, which scipy reads; sparse ones dense."""
    from scipy.io import loadmat

    try:
        content: dict[str, Any] = loadmat(BytesIO(raw))
        for name, value in content.items():
            if hasattr(value, "toarray"):
                rows, columns = value.shape
                check_dense(rows, columns, len(raw), name)
                content[name] = value.toarray()
    except ContentError:
        raise
    except Exception as error:  # the reader has no errors of its own
        raise ContentError(shortened(error)) from error
    return content


@dataclass(frozen=True, slots=True)
class _Reader:
    """Bytes to arrays in one byte order; ``size`` is that of the file."""

    order: str
    size: int

    def number(self, data: bytes | memoryview, dtype: str) -> int:
        return int(np.frombuffer(data, self.order + dtype, 1)[0])

    def elements(self, data: memoryview) -> Iterator[tuple[int, memoryview]]:
        """Yield type and data of each element in a row of them."""
        at = 0
        while at < len(data):
            if len(data) - at < 8:
                raise ContentError(f"{len(data) - at} bytes are left over")
            first, count = (self.number(data[at + k : at + k + 4], "u4") for k in (0, 4))
            if first >> 16:  # up to four bytes stand in the tag itself
                kind, count, start, after = first & 0xFFFF, first >> 16, at + 4, at + 8
                if count > 4:
                    raise ContentError(f"a short element of {count} bytes; expected 4 at most")
            else:
                kind, start = first, at + 8
                after = start + count + (0 if kind == _COMPRESSED else -count % 8)
            if start + count > len(data):
                raise ContentError(f"an element of {count} bytes; {len(data) - start} follow")
            yield kind, data[start : start + count]
            at = after

    def unpacked(self, data: memoryview, most: int) -> tuple[bytes, bool]:
        """Unpack at most that many bytes, and tell whether this is all and its checksum is right."""
        unpacking = zlib.decompressobj()
        try:
            content = unpacking.decompress(data, most)
            if not unpacking.eof and len(content) == most:
                return content, not unpacking.decompress(unpacking.unconsumed_tail, 1) and unpacking.eof
        except zlib.error as error:
            raise ContentError(f"a packed variable is damaged ({error})") from error
        return content, unpacking.eof

    def name(self, data: memoryview) -> str:
        """Return the name of an array, its third element."""
        third = next(islice(self.elements(data), 2, None), None)
        if third is None:
            raise ContentError("a variable without a name")
        return bytes(third[1]).decode("latin-1")

    def array(self, data: memoryview, subject: str, depth: int) -> Any:
        """Return the array of an element of type matrix."""
        if depth > DEEPEST:
            raise ContentError(f"{subject}: cells and structs are nested more than {DEEPEST} deep")
        if not len(data):
            return np.zeros((0, 0))
        parts = list(self.elements(data))
        if len(parts) < 3 or len(parts[0][1]) != 8 or parts[0][0] != 6 or parts[1][0] != 5 or len(parts[1][1]) % 4:
            raise ContentError(f"{subject}: no flags or no dimensions")
        flags = self.number(parts[0][1], "u4")
        shape = tuple(np.frombuffer(parts[1][1], self.order + "i4").tolist())
        if len(shape) < 2:
            raise ContentError(f"{subject}: {len(shape)} dimensions; expected two at least")
        kind, is_complex, rest = flags & 0xFF, bool(flags & _COMPLEX), parts[3:]
        if kind in _NUMBERS:
            return self.numbers(rest, shape, _NUMBERS[kind], is_complex, subject)
        if kind == _CHAR:
            return self.text(rest, shape, subject)
        if kind == _CELL:
            check_shape(shape, 8, len(data), subject)
            return cells(self.arrays(rest, int(np.prod(shape)), subject, depth), shape)
        if kind == _STRUCT:
            return self.struct(rest, shape, subject, depth)
        if kind == _SPARSE:
            return self.sparse(rest, shape, is_complex, subject)
        raise ContentError(f"{subject}: objects of class {kind} are not read; save numbers, texts, cells or structs")

    def numbers(
        self, parts: list[tuple[int, memoryview]], shape: tuple[int, ...], dtype: str, is_complex: bool, subject: str
    ) -> AnyArray:
        expected = 2 if is_complex else 1
        if len(parts) != expected:
            raise ContentError(f"{subject}: {len(parts)} blocks of numbers; expected {expected}")
        real = [self.vector(*part, subject) for part in parts]
        check_shape(shape, 1, max(map(len, real)), subject)
        count = int(np.prod(shape))
        if any(len(part) != count for part in real):
            raise ContentError(f"{subject}: {len(real[0])} numbers for {' x '.join(map(str, shape))} entries")
        values = real[0] + 1j * real[1] if is_complex else real[0].astype(dtype)
        return values.reshape(shape, order="F")

    def vector(self, kind: int, data: memoryview, subject: str) -> AnyArray:
        if kind not in _DTYPES or len(data) % int(_DTYPES[kind][1]):
            raise ContentError(f"{subject}: {len(data)} bytes of type {kind} are no numbers")
        return np.frombuffer(data, self.order + _DTYPES[kind])

    def text(self, parts: list[tuple[int, memoryview]], shape: tuple[int, ...], subject: str) -> str | tuple[str, ...]:
        if len(parts) != 1 or parts[0][0] not in _TEXTS or len(shape) != 2:
            raise ContentError(f"{subject}: no text that is read")
        kind, data = parts[0]
        code = _TEXTS[kind] + ({"<": "-le", ">": "-be"}[self.order] if kind in (4, 17, 18) else "")
        try:
            letters = bytes(data).decode(code, "surrogatepass" if kind in (4, 17) else "strict")
        except UnicodeDecodeError as error:
            raise ContentError(f"{subject}: no text that is read ({error})") from error
        check_shape(shape, 1, len(data), subject)
        rows, columns = shape
        if rows <= 1 or not columns:  # dimensions count bytes or 16-bit units in some programs
            return letters
        if len(letters) != rows * columns:
            raise ContentError(f"{subject}: {len(letters)} characters for {rows} x {columns}")
        return tuple(letters[k::rows] for k in range(rows))

    def arrays(self, parts: list[tuple[int, memoryview]], count: int, subject: str, depth: int) -> list[Any]:
        if len(parts) != count or any(kind != _MATRIX for kind, _ in parts):
            raise ContentError(f"{subject}: {len(parts)} arrays in it; expected {count}")
        return [self.array(data, subject, depth + 1) for _, data in parts]

    def struct(
        self, parts: list[tuple[int, memoryview]], shape: tuple[int, ...], subject: str, depth: int
    ) -> dict[str, Any]:
        if set(shape) != {1}:
            raise ContentError(f"{subject}: a struct of {' x '.join(map(str, shape))} elements; expected one")
        if len(parts) < 2 or len(parts[0][1]) != 4:
            raise ContentError(f"{subject}: a struct without names of its fields")
        width, words = self.number(parts[0][1], "i4"), bytes(parts[1][1])
        if width < 1 or len(words) % width:
            raise ContentError(f"{subject}: names of fields have {width} bytes each, of {len(words)}")
        names = [words[at : at + width].split(b"\0")[0].decode("latin-1") for at in range(0, len(words), width)]
        if len(set(names)) < len(names):
            raise ContentError(f"{subject}: a field is there twice")
        return dict(zip(names, self.arrays(parts[2:], len(names), subject, depth), strict=True))

    def sparse(
        self, parts: list[tuple[int, memoryview]], shape: tuple[int, ...], is_complex: bool, subject: str
    ) -> AnyArray:
        if len(parts) != (4 if is_complex else 3) or len(shape) != 2:
            raise ContentError(f"{subject}: no sparse matrix that is read")
        rows, starts, *blocks = (self.vector(*part, subject) for part in parts)
        check_dense(*shape, self.size, subject)
        n, m = shape
        # more entries than there are may be reserved
        ends = starts.astype(np.int64)
        if len(ends) != m + 1 or ends[0] != 0 or (np.diff(ends) < 0).any() or ends[-1] > min(map(len, (rows, *blocks))):
            raise ContentError(f"{subject}: the columns of the sparse matrix do not fit its entries")
        count = int(ends[-1])
        at = rows[:count].astype(np.int64)
        if ((at < 0) | (at >= n)).any():
            raise ContentError(f"{subject}: a row of the sparse matrix is not between 1 and {n}")
        values = blocks[0][:count] + 1j * blocks[1][:count] if is_complex else blocks[0][:count].astype(float)
        result = np.zeros(shape, dtype=values.dtype)
        np.add.at(result, (at, np.repeat(np.arange(m), np.diff(ends))), values)
        return result


def cells(values: Sequence[Any], shape: tuple[int, ...] | None = None) -> AnyArray:
    """Return values as a cell array, by default one in a column."""
    result = np.empty(len(values), dtype=object)
    for k, value in enumerate(values):
        result[k] = value
    return result.reshape((len(values), 1) if shape is None else shape, order="F")


def variable_names(names: Iterable[str]) -> tuple[str, ...]:
    """Return names of variables and fields in MATLAB, as close to the given ones as it allows, no two the same."""
    result: list[str] = []
    for name in names:
        word = "p_" * (not name[:1].isalpha() or not name[0].isascii()) + re.sub(r"[^0-9A-Za-z_]", "_", name)
        word = word[:LONGEST_NAME]
        result.append(word if word not in result else f"{word[: LONGEST_NAME - 4]}_{len(result) + 1}")
    return tuple(result)
