"""Universal files as data sets: lines of fixed columns between lines of -1, some with binary numbers behind. Data sets
58 are functions of frequency or time between two points.

Source: University of Cincinnati, Structural Dynamics Research Laboratory, Universal File Formats for Modal Analysis
Testing.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbsvib.common.arrays import Array, Complex
from mbsvib.common.file_content import ContentError, check_shape
from mbsvib.common.number_text import nastran_integer, nastran_real
from mbsvib.measurement.matching import is_si, unit_of
from mbsvib.measurement.points import Point

_END = "-1"
# Byte orders and formats of binary numbers that are read: IEEE, little- and big-endian.
_ORDERS, _IEEE = {1: "<", 2: ">"}, 2
# Lines before the numbers.
HEAD = 11
# Types of functions that are read.
RECORD, AUTO_SPECTRUM, RESPONSE, COHERENCE, DENSITY = 1, 2, 4, 6, 9
_SQUARES = (AUTO_SPECTRUM, DENSITY)
# Units of squares, (m/s^2)^2/Hz, and of accelerations in parts of that of gravity.
_SQUARED, _GRAVITY = re.compile(r"\(?([^()]+?)\)?(\^2)?(/Hz)?"), ("g", "G", "gn", "g_n", "g0")
MARK = "written by mbsvib"
# Specific data types: of the abscissa, and of motions and forces, with their exponents of length and force.
_ABSCISSA = {RECORD: (0, 17)}
_FREQUENCY = (0, 18)
_EXPONENTS = {8: (1, 0), 11: (1, 0), 12: (1, 0), 9: (0, 1), 13: (0, 1)}
_SI = {8: ("m", "rad"), 11: ("m/s", "rad/s"), 12: ("m/s^2", "rad/s^2"), 9: ("N", "N m"), 13: ("N", "N m")}
_AXES = {0: "", 1: "X", 2: "Y", 3: "Z", 4: "RX", 5: "RY", 6: "RZ"}
# Types of data: their columns beside the abscissa, and whether they are of double precision.
_DATA = {2: (1, False), 4: (1, True), 5: (2, False), 6: (2, True)}
# Widths of columns by double precision or not, of even abscissas, and of others by the columns of the data.
_EVEN = {False: (13,) * 6, True: (20,) * 4}
_UNEVEN: dict[bool, dict[int, tuple[int, ...]]] = {
    False: {1: (13,) * 6, 2: (13,) * 6}, True: {1: (13, 20, 13, 20), 2: (13, 20, 20)}}


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
        raw = self._raw[self._at : end]
        try:
            text = raw.decode().rstrip("\r")
        except UnicodeDecodeError:
            text = raw.decode("latin-1").rstrip("\r")
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


@dataclass(frozen=True, slots=True, eq=False)
class Axis:
    """An end of a frequency response: its name, unit, point, and the specific type of its data."""

    name: str
    unit: str
    point: Point
    kind: int


@dataclass(frozen=True, slots=True, eq=False)
class Function:
    """A function as the file has it: its ``kind``, ``frequency`` (n,) [Hz] or times [s], ``values`` (n,), its output
    and its input, which time records and densities do not have.
    """

    kind: int
    frequency: Array
    values: Array | Complex
    output: Axis
    input: Axis


def function_of(
    data: DataSet, length: float, force: float, wanted: tuple[int, ...] = (RESPONSE, COHERENCE)
) -> Function | str:
    """Return the function of a data set 58 in SI units, or a text that says what it is if its type is not ``wanted``.

    ``length``, ``force``: units of the file per metre and per newton.
    """
    function, *_ = data.integers(5, 5)
    response_node, response_direction, reference_node, reference_direction = data.integers(
        5, -30, -11, 10, 4, -11, 10, 4)  # fmt: skip
    kind, count, spacing = data.integers(6, 10, 10, 10)
    types = [data.integers(k, 10)[0] for k in (7, 8, 9)]
    columns, double = _DATA.get(kind, (0, False))
    if function not in wanted or columns != (2 if function == RESPONSE else 1) \
            or types[0] not in _ABSCISSA.get(function, _FREQUENCY):  # fmt: skip
        return f"data set 58: function type {function}, data type {kind}, abscissa of type {types[0]}"
    frequency, values = _numbers(data, (columns, double), count, spacing == 1)
    if function != RECORD and frequency[0] < 0.0:
        raise ContentError(f"the frequencies of data set 58 at line {data.start} do not ascend from 0 on")
    points = (Point(response_node, _direction(response_direction)),
              Point(reference_node, _direction(reference_direction)))  # fmt: skip
    names, units = _names(data, points, types[1:])
    ends = 0 if function == COHERENCE else 2 if function == RESPONSE else 1
    scale = [_unit_factor(t, p, length, force, data.start) if k < ends else 1.0
             for k, (t, p) in enumerate(zip(types[1:], points, strict=True))]  # fmt: skip
    for k in range(ends):
        _check_label(data.line(8 + k)[47:67].strip(), scale[k], function in _SQUARES, data.start)
    if length != 1.0 or force != 1.0:
        units = [_SI[t][abs(p.direction) > 3] if k < ends else unit
                 for k, (t, p, unit) in enumerate(zip(types[1:], points, units, strict=True))]  # fmt: skip
    output, source = (Axis(names[k], units[k], points[k], types[1 + k]) for k in (0, 1))
    factor = scale[1] / scale[0] ** (2 if function in _SQUARES else 1)
    return Function(function, frequency, values * factor, output, source)


def _check_label(label: str, scale: float, squared: bool, line: int) -> None:
    """Refuse a unit beside numbers that is not that of the file, or of squares, whose units are not kept, not of SI."""
    parts = _SQUARED.fullmatch(unit_of(label)) if squared else None
    unit = unit_of(label) if parts is None else parts[1]
    known = is_si(unit)
    if (known if scale != 1.0 else squared and known is False) or (scale != 1.0 and unit in _GRAVITY):
        raise ContentError(f"data set 58 at line {line} has the unit {label!r}, where data set 164 has {scale:g} units "
                           f"of the file per unit of SI; correct one of both, or convert the data to SI units")


def _direction(number: int) -> int:
    if abs(number) > 6:
        raise ContentError(f"the direction {number} of a node; expected -6 to 6")
    return number


def _numbers(data: DataSet, layout: tuple[int, bool], count: int, even: bool) -> tuple[Array, Array | Complex]:
    """Abscissas and values; ``layout``: columns of the values, and whether they are of double precision."""
    first, step = data.reals(6, -30, 13, 13)
    if count < 1:
        raise ContentError(f"data set 58 at line {data.start} has {count} points")
    values, double = layout
    columns = values if even else 1 + values
    if data.binary is None:
        width = _EVEN[double] if even else _UNEVEN[double][values]
        table = data.table(HEAD, columns * count, width).reshape(count, columns)
    else:
        table = _binary(data, double, count, columns)
    if not np.isfinite(table).all():
        raise ContentError(f"data set 58 at line {data.start} holds NaN or infinity")
    frequency = first + step * np.arange(count) if even else table[:, 0]
    if (np.diff(frequency) <= 0.0).any():
        raise ContentError(f"the frequencies or times of data set 58 at line {data.start} do not ascend from 0 on")
    return np.array(frequency), table[:, -1] if values == 1 else table[:, -2] + 1j * table[:, -1]


def _binary(data: DataSet, double: bool, count: int, columns: int) -> Array:
    raw, width = data.binary or b"", 8 if double else 4
    subject = f"data set 58 at line {data.start}"
    check_shape((count, columns), 4, len(raw), subject)
    if len(raw) == count * columns * width:
        return np.frombuffer(raw, f"{data.order}f{width}").reshape(count, columns).astype(float)
    if double and len(raw) == (8 * columns - 4) * count:  # some write the abscissa in single precision
        table = np.frombuffer(raw, np.dtype([("x", f"{data.order}f4"), ("y", f"{data.order}f8", (columns - 1,))]))
        return np.column_stack((table["x"].astype(float), table["y"]))
    raise ContentError(f"{subject} has {len(raw)} bytes for {count} points")


def _names(data: DataSet, points: tuple[Point, Point], types: list[int]) -> tuple[list[str], list[str]]:
    """Names and units of output and input; files of mbsvib have them whole in their first lines."""
    names_and_units = [data.line(k).strip().split(" / ") for k in (0, 1)]
    if data.line(2).strip() == MARK and len(names_and_units[0]) == 2:
        first, _, second = f"{data.line(1)[:80]} ".partition(" / ")
        return [word.strip() for word in names_and_units[0]], [first.strip(), second.strip()]
    names: list[str] = []
    units: list[str] = []
    for k, (start, point, kind) in enumerate(zip((31, 56), points, types, strict=True)):
        entity = data.line(5)[start : start + 10].strip()
        sign = "-" if point.direction < 0 else "+"
        node_name = f"{point.node}{sign if point.direction else ''}{_AXES[abs(point.direction)]}"
        names.append(node_name if entity in ("", "NONE") else f"{entity}:{node_name}")
        unit = data.line(8 + k)[47:67].strip()
        units.append(_SI.get(kind, ("", ""))[abs(point.direction) > 3] if unit in ("", "NONE") else unit)
    return names, units


def _unit_factor(kind: int, point: Point, length: float, force: float, line: int) -> float:
    """Unit of the file in that of SI."""
    if length == force == 1.0:
        return 1.0
    if kind not in _EXPONENTS:
        raise ContentError(f"data set 58 at line {line} has data of type {kind} in a file whose units are not SI; "
                           f"expected types 8, 9, 11, 12 or 13, which can be converted")  # fmt: skip
    lengths, forces = _EXPONENTS[kind]
    if abs(point.direction) > 3:  # an angle, or a moment
        lengths = lengths - 1 if lengths else forces
    return float(length**lengths * force**forces)
