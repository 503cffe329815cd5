"""Nastran's OUTPUT4 files (OP4), text and binary: every size is compared with the file before it is used.

A matrix is a header (columns, rows, form, type, name) and its columns: first row, number of words, numbers; where the
row is 0, a column is strings of numbers with a header each. A last column, one past the end, closes the matrix.

Source: MSC Nastran DMAP Programmer's Guide, OUTPUT4 module.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from mbsvib.common.arrays import AnyArray
from mbsvib.common.file_content import ContentError, check_dense
from mbsvib.common.number_text import nastran_integer, nastran_real

# Rows from which on strings have headers of two numbers (BIGMAT), whatever the sign of their number.
BIG = 65_536
_FORMAT = re.compile(r"(?:^|[ (,P])(\d{0,2})[ED][SN]?(\d{1,2})\.\d{1,2}")
_DEFAULT_FORMAT = 5, 16
_SHORT_HEADER, _LONG_HEADER = 24, 48  # bytes of the first record, by which byte order and size of integers are known


def read_op4_file(raw: bytes, names: Collection[str] | None = None) -> dict[str, AnyArray]:
    """Return the matrices of an OP4 file, dense, by their names in capitals.

    ``names``: matrices to read; others are only counted and None. Default: all.
    """
    if len(raw) < _SHORT_HEADER:
        raise ContentError(f"{len(raw)} bytes; expected a matrix")
    source = _Binary.of(raw) if 0 in raw[:4] else _Text.of(raw)
    result: dict[str, Any] = {}
    while source.more():
        head = source.header()
        if head.name in result:
            raise ContentError(f"the matrix '{head.name}' is there twice")
        if head.kind not in (1, 2, 3, 4) or head.rows < 0 or head.columns < 0 or not head.name:
            raise ContentError(f"the matrix '{head.name}' of {head.rows} x {head.columns} entries and type "
                               f"{head.kind}; expected types 1 to 4")  # fmt: skip
        is_wanted = names is None or head.name in names
        if is_wanted:
            check_dense(head.rows, head.columns * (1 + head.is_complex), len(raw), head.name)
            matrix = np.zeros((head.rows, head.columns), dtype=complex if head.is_complex else float)
        before = 0
        for column, row, values in source.columns(head):
            if column < before or row < 1 or row - 1 + len(values) > head.rows:
                raise ContentError(f"the matrix '{head.name}': {len(values)} numbers from row {row} of column {column} "
                                   f"on do not fit {head.rows} x {head.columns} entries")  # fmt: skip
            before = column
            if is_wanted:
                matrix[row - 1 : row - 1 + len(values), column - 1] = values
        result[head.name] = matrix if is_wanted else None
    return result


@dataclass(frozen=True, slots=True)
class _Head:
    columns: int
    rows: int
    is_big: bool
    kind: int
    name: str
    per_line: int = 0
    width: int = 0

    @property
    def is_complex(self) -> bool:
        return self.kind > 2


def _head(columns: int, rows: int, kind: int, name: str, per_line: int = 0, width: int = 0) -> _Head:
    return _Head(columns, abs(rows), rows < 0 or rows >= BIG, kind, name.strip().upper(), per_line, width)


@dataclass(slots=True)
class _Text:
    """Lines of a text file, taken one after the other."""

    lines: list[str]
    at: int = 0

    @classmethod
    def of(cls, raw: bytes) -> _Text:
        try:
            lines = raw.decode("ascii").splitlines()
        except UnicodeDecodeError as error:
            raise ContentError(f"the byte 0x{raw[error.start]:02x} is not a character of a text file") from error
        while lines and not lines[-1].strip():
            lines.pop()
        return cls(lines)

    def more(self) -> bool:
        while self.at < len(self.lines) and not self.lines[self.at].strip():
            self.at += 1
        return self.at < len(self.lines)

    def line(self) -> str:
        if self.at >= len(self.lines):
            raise ContentError("it ends within a matrix")
        self.at += 1
        return self.lines[self.at - 1]

    def integers(self, line: str, *widths: int) -> list[int]:
        result, start = [], 0
        for width in widths:
            try:
                result.append(nastran_integer(line[start : start + width]))
            except ValueError as error:
                raise ContentError(f"line {self.at}: {error}") from error
            start += width
        return result

    def header(self) -> _Head:
        line = self.line()
        wide = 16 if line.rstrip().endswith("|I16") else 8
        columns, rows, _, kind = self.integers(line, wide, wide, 8, 8)
        rest = line[2 * wide + 16 :].rstrip().removesuffix("|I16")
        style = _FORMAT.search(rest[8:].upper())
        per_line, width = (int(style[1] or 1), int(style[2])) if style else _DEFAULT_FORMAT
        if not per_line or not width:
            raise ContentError(f"line {self.at}: the format '{rest[8:]}' is none")
        return _head(columns, rows, kind, rest[:8], per_line, width)

    def columns(self, head: _Head) -> Iterator[tuple[int, int, AnyArray]]:
        per_value = 1 if head.kind % 2 else 2
        while True:
            column, row, words = self.integers(self.line(), 8, 8, 8)
            if column < 1 or row < 0 or words < 0:
                raise ContentError(f"line {self.at}: {column}, {row}, {words} begin no column")
            if column > head.columns:  # its number is no entry, and writers differ in how they count it
                while self.more() and "." in self.lines[self.at][: head.width]:
                    self.at += 1
                return
            if row:
                yield column, row, self.values(words, head, head.is_complex)
                continue
            while words > 0:
                line = self.line()
                if head.is_big or len(line.split()) == 2:
                    length, row = self.integers(line, 8, 8)
                    words -= length + 1
                    length -= 1
                else:
                    (packed,) = self.integers(line, len(line))
                    length, row = (packed >> 16) - 1, packed & 0xFFFF
                    words -= length + 1
                if length < per_value or words < 0:
                    raise ContentError(f"line {self.at}: a string of {length} words does not fit its column")
                yield column, row, self.values(length // per_value, head, head.is_complex)

    def values(self, count: int, head: _Head, is_complex: bool = False) -> AnyArray:
        lines = -(-count // head.per_line)
        if lines > len(self.lines) - self.at:
            raise ContentError(f"line {self.at}: {count} numbers are to follow; {len(self.lines) - self.at} lines are "
                               f"left")  # fmt: skip
        result: list[float] = []
        for _ in range(lines):
            line = self.line()
            for k in range(min(head.per_line, count - len(result))):
                try:
                    result.append(nastran_real(line[k * head.width : (k + 1) * head.width]))
                except ValueError as error:
                    raise ContentError(f"line {self.at}: {error}") from error
        return _combined(np.array(result), is_complex)


@dataclass(slots=True)
class _Binary:
    """Records of a binary file: length, content, length."""

    raw: memoryview
    order: str
    word: int
    at: int = 0

    @classmethod
    def of(cls, raw: bytes) -> _Binary:
        for order in "<>":
            length = struct.unpack(f"{order}I", raw[:4])[0]
            if length in (_SHORT_HEADER, _LONG_HEADER):
                return cls(memoryview(raw), order, 4 if length == _SHORT_HEADER else 8)
        raise ContentError("its first record is not a header of a matrix")

    def more(self) -> bool:
        return self.at < len(self.raw)

    def record(self) -> memoryview:
        start = self.at + 4
        length = self.integers(self.raw[self.at : start], 1, 4)[0]
        end = start + length
        if length < 0 or end + 4 > len(self.raw):
            raise ContentError(f"a record of {length} bytes; {max(len(self.raw) - start - 4, 0)} follow")
        if self.raw[end : end + 4] != self.raw[self.at : start]:
            raise ContentError(f"the record from byte {self.at} on is damaged: its lengths differ")
        self.at = end + 4
        return self.raw[start:end]

    def integers(self, data: memoryview, count: int, width: int = 0) -> list[int]:
        width = width or self.word
        if len(data) < count * width:
            raise ContentError(f"{len(data)} bytes where {count * width} should be")
        return list(np.frombuffer(data, f"{self.order}i{width}", count).tolist())

    def header(self) -> _Head:
        record = self.record()
        if len(record) != 6 * self.word:
            raise ContentError(f"a header of {len(record)} bytes; expected {6 * self.word}")
        columns, rows, _, kind = self.integers(record, 4)
        name = bytes(record[4 * self.word :]).decode("ascii", "replace").replace("\0", " ")
        return _head(columns, rows, kind, name)

    def columns(self, head: _Head) -> Iterator[tuple[int, int, AnyArray]]:
        width = 8 if head.kind % 2 == 0 else self.word
        per_value = width // self.word
        dtype = f"{self.order}f{width}"
        while True:
            record = self.record()
            column, row, words = self.integers(record, 3)
            data = record[3 * self.word :]
            if column > head.columns:  # its number is no entry, and writers count it as one word of eight bytes as well
                return
            if column < 1 or row < 0 or words * self.word != len(data):
                raise ContentError(f"a column that begins with {column}, {row}, {words} and has {len(data)} bytes")
            if row:
                yield column, row, self.numbers(data, dtype, head)
                continue
            while len(data):
                if head.is_big:
                    length, row = self.integers(data, 2)
                    length, data = length - 1, data[2 * self.word :]
                else:
                    packed = self.integers(data, 1)[0]
                    length, row, data = (packed >> 16) - 1, packed & 0xFFFF, data[self.word :]
                if length < per_value or length * self.word > len(data):
                    raise ContentError(f"a string of {length} words in column {column}; {len(data)} bytes follow")
                yield column, row, self.numbers(data[: length * self.word], dtype, head)
                data = data[length * self.word :]

    def numbers(self, data: memoryview, dtype: str, head: _Head) -> AnyArray:
        if len(data) % int(dtype[-1]):
            raise ContentError(f"{len(data)} bytes are no numbers of {dtype[-1]} bytes")
        return _combined(np.frombuffer(data, dtype).astype(float), head.is_complex)


def _combined(values: AnyArray, is_complex: bool) -> AnyArray:
    if not np.isfinite(values).all():
        raise ContentError("NaN or infinity among its numbers")
    if not is_complex:
        return values
    if len(values) % 2:
        raise ContentError(f"{len(values)} numbers are no real and imaginary parts")
    return values[0::2] + 1j * values[1::2]
