"""Universal files as data sets: lines of fixed columns between lines of -1, some with binary numbers behind.

Source: University of Cincinnati, Structural Dynamics Research Laboratory, Universal File Formats for Modal Analysis
Testing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common.file_content import ContentError, check_shape
from mbsvib.common.nastran_numbers import nastran_integer, nastran_real

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

_END = "-1"
# Byte orders and formats of binary numbers that are read: IEEE, little- and big-endian.
_ORDERS, _IEEE = {1: "<", 2: ">"}, 2


@dataclass(frozen=True, slots=True)
class DataSet:
    """A data set: its ``kind`` (58, 2411), its ``lines`` behind the first one, the number of the line ``start`` in the
    file, and its binary numbers, if any, with their byte order.
    """

    kind: int
    lines: tuple[str, ...]
    start: int
    binary: bytes | None = None
    order: str = "<"

    def line(self, k: int) -> str:
        """Return a line, counted from 0 behind that of the kind."""
        if k >= len(self.lines):
            raise ContentError(f"data set {self.kind} at line {self.start} ends after {len(self.lines)} lines")
        return self.lines[k]

    def integers(self, k: int, *widths: int) -> list[int]:
        """Return integers of a line by the widths of their columns; a negative width is passed over."""
        return [self._read(nastran_integer, k, word) for word in _columns(self.line(k), widths)]

    def reals(self, k: int, *widths: int) -> list[float]:
        """Return real numbers of a line by the widths of their columns; a blank one is 0."""
        return [self._read(nastran_real, k, word) if word.strip() else 0.0 for word in _columns(self.line(k), widths)]

    def table(self, k: int, count: int, widths: Sequence[int]) -> NDArray[np.float64]:
        """Return that many real numbers from a line on, each line with columns of these widths."""
        lines = -(-count // len(widths))
        check_shape((count,), 1, sum(map(len, self.lines[k:])), f"data set {self.kind} at line {self.start}")
        if k + lines > len(self.lines):
            raise ContentError(f"data set {self.kind} at line {self.start}: {count} numbers are to follow; "
                               f"{max(len(self.lines) - k, 0)} lines are left")  # fmt: skip
        result: list[float] = []
        for i in range(k, k + lines):
            result += self.reals(i, *widths[: count - len(result)])
        return np.array(result)

    def _read(self, read: Any, k: int, word: str) -> Any:
        try:
            return read(word)
        except ValueError as error:
            raise ContentError(f"line {self.start + k + 1}: {error}") from error


def _columns(line: str, widths: Sequence[int]) -> Iterator[str]:
    at = 0
    for width in widths:
        if width > 0:
            yield line[at : at + width]
        at += abs(width)


def data_sets(raw: bytes) -> Iterator[DataSet]:
    """Yield the data sets of a universal file one after the other."""
    source = _Source(raw)
    while (line := source.next_filled()) is not None:
        if line.strip() != _END:
            raise ContentError(f"line {source.number}: {line.strip()[:40]!r} where a data set should begin with -1")
        start, head = source.number + 1, source.line()
        try:
            kind = nastran_integer(head[:6])
        except ValueError as error:
            raise ContentError(f"line {source.number}: {error}, where the number of a data set should be") from error
        if head[6:7] in ("b", "B"):
            yield _binary_set(source, kind, head, start)
            continue
        lines = []
        while (line := source.line()).strip() != _END:
            lines.append(line)
        yield DataSet(kind, tuple(lines), start)


def _binary_set(source: _Source, kind: int, head: str, start: int) -> DataSet:
    header = DataSet(kind, (head,), start - 1)
    order, style, lines, size = header.integers(0, -7, 6, 6, 12, 12)
    if order not in _ORDERS or style != _IEEE:
        raise ContentError(f"data set {kind} at line {start} has numbers of byte order {order} and format {style}; "
                           f"expected 1 or 2, and 2 (IEEE)")  # fmt: skip
    if not 0 <= lines <= source.remaining or not 0 <= size <= source.remaining:
        raise ContentError(f"data set {kind} at line {start}: {lines} lines and {size} bytes are to follow; "
                           f"{source.remaining} bytes are left")  # fmt: skip
    text = tuple([source.line() for _ in range(lines)])
    content = source.take(size)
    if (line := source.next_filled()) is None or line.strip() != _END:
        raise ContentError(f"data set {kind} at line {start} does not end behind its {size} bytes")
    return DataSet(kind, text, start, content, _ORDERS[order])


class _Source:
    """Lines and bytes of a file, taken one after the other."""

    def __init__(self, raw: bytes) -> None:
        self._raw, self._at, self.number = raw, 0, 0

    @property
    def remaining(self) -> int:
        return len(self._raw) - self._at

    def line(self) -> str:
        if not self.remaining:
            raise ContentError("it ends within a data set")
        end = self._raw.find(b"\n", self._at)
        end = len(self._raw) if end < 0 else end
        text = self._raw[self._at : end].decode("latin-1").rstrip("\r")
        self._at, self.number = min(end + 1, len(self._raw)), self.number + 1
        return text

    def next_filled(self) -> str | None:
        while self.remaining:
            if (text := self.line()).strip():
                return text
        return None

    def take(self, count: int) -> bytes:
        content = self._raw[self._at : self._at + count]
        if len(content) < count:
            raise ContentError(f"{count} bytes are to follow; {len(content)} are left")
        self._at += count
        return content
