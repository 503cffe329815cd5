"""DMIG and SPOINT cards of Nastran's bulk data: fields of 8 or 16 columns, or divided by commas.

Source: MSC Nastran Quick Reference Guide, bulk data entries DMIG and SPOINT.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.common.file_content import ContentError, check_dense
from mbsvib.common.number_text import nastran_integer, nastran_real

Label = tuple[int, int]

SYMMETRIC, SQUARE = "6", "1"
_FORMS = (SQUARE, "2", SYMMETRIC, "9")
_REAL_TYPES = ("0", "1", "2")
_TYPES = (*_REAL_TYPES, "3", "4")
_MOST_LISTED = 1_000_000  # scalar points of SPOINT cards
_MOST_POINTS = 100_000_000  # numbers of points have eight digits


@dataclass(frozen=True, slots=True, eq=False)
class Cards:
    """Square matrices (n, n) by name, their ``labels`` (n,): point and component, 0 for a scalar point, and the number
    of ``entries`` on the cards of each. ``left_out`` says of the names of other matrices why they are not read.
    """

    matrices: dict[str, Array]
    labels: tuple[Label, ...]
    entries: dict[str, int]
    left_out: dict[str, str]


@dataclass(slots=True)
class _Matrix:
    is_symmetric: bool
    entries: dict[tuple[Label, Label], float] = field(default_factory=dict)


@dataclass(slots=True)
class _Reading:
    """What was read so far: matrices, those left out and why, ranges of scalar points, and the column being read."""

    matrices: dict[str, _Matrix] = field(default_factory=dict)
    left_out: dict[str, str] = field(default_factory=dict)
    points: list[range] = field(default_factory=list)
    name: str = ""
    column: Label = (0, 0)
    listing: bool = False


def read_dmig_cards(raw: bytes) -> Cards:
    """Return the real square matrices of DMIG cards; other matrices, other cards and comments are passed over.

    Returns matrices on all points that occur: grid points in ascending order, then scalar points.
    """
    reading = _Reading()
    for number, line in enumerate(raw.decode("latin-1").splitlines(), 1):
        try:
            _read_line(reading, line.split("$", 1)[0])
        except (ValueError, IndexError) as error:
            raise ContentError(f"line {number}: the card is not understood: {error}") from error
    labels = {label for matrix in reading.matrices.values() for pair in matrix.entries for label in pair}
    if (count := sum(map(len, reading.points))) > _MOST_LISTED:
        raise ContentError(f"{count} scalar points; expected {_MOST_LISTED} at most")
    labels |= {(point, 0) for points in reading.points for point in points}
    check_dense(len(labels), len(labels) * max(1, len(reading.matrices)), len(raw), "the matrices of all points")
    ordered = sorted(labels, key=lambda label: (label[1] == 0, label))
    index_of = {label: i for i, label in enumerate(ordered)}
    result = {}
    for name, matrix in reading.matrices.items():
        dense = np.zeros((len(ordered), len(ordered)))
        for (row, column), value in matrix.entries.items():
            dense[index_of[row], index_of[column]] = value
            if matrix.is_symmetric:
                dense[index_of[column], index_of[row]] = value
        result[name] = dense
    entries = {name: len(matrix.entries) for name, matrix in reading.matrices.items()}
    return Cards(result, tuple(ordered), entries, reading.left_out)


def _read_line(reading: _Reading, line: str) -> None:
    if not line.strip():
        return
    card, fields = _fields(line)
    if card == "DMIG":
        reading.listing = False
        _begin(reading, fields)
    elif card == "SPOINT":
        reading.name, reading.listing = "", True
        _add_points(reading, fields)
    elif card in ("", "+", "*") and reading.listing:
        _add_points(reading, fields)
    elif card in ("", "+", "*") and reading.name:
        _add_entries(reading, fields)
    elif card not in ("", "+", "*"):
        reading.name, reading.listing = "", False


def _fields(line: str) -> tuple[str, list[str]]:
    """Name of the card without its star, and its fields; a continuation is named + or *, or not at all."""
    if "," in line:
        card, *fields = [word.strip() for word in line.upper().split(",")]
        fields = [*fields[:8], *[""] * (8 - len(fields))]
    else:
        line = line.expandtabs(8)
        card, text = line[:8].strip().upper(), line[8:72].ljust(64).upper()
        width = 16 if "*" in card else 8
        fields = [text[i : i + width].strip() for i in range(0, 64, width)]
    return card[:1] if card[:1] in ("+", "*") else card.rstrip("*"), fields


def _begin(reading: _Reading, fields: list[str]) -> None:
    """A header has 0 in the place of its column; other cards begin a column."""
    name = fields[0]
    if fields[1] in ("", "0"):
        reading.name = ""
        if name in reading.matrices or name in reading.left_out:
            raise ValueError(f"the matrix {name} is there twice")
        if fields[2] not in _FORMS or fields[3] not in _TYPES:
            raise ValueError(f"form {fields[2]!r} and type {fields[3]!r} of the matrix {name} are none")
        if fields[2] not in (SQUARE, SYMMETRIC):
            reading.left_out[name] = "only square and symmetric matrices are read"
            return
        if fields[3] not in _REAL_TYPES:
            reading.left_out[name] = "only real matrices are read"
            return
        reading.matrices[name] = _Matrix(fields[2] == SYMMETRIC)
        return
    if name in reading.left_out:
        reading.name = ""
        return
    if name not in reading.matrices:
        raise ValueError(f"there is no header of the matrix {name} before its columns")
    reading.name, reading.column = name, _label(fields[1], fields[2])
    if len(fields) > 4:
        _add_entries(reading, fields[4:])


def _add_entries(reading: _Reading, fields: list[str]) -> None:
    matrix = reading.matrices[reading.name]
    for i in range(0, len(fields) - 2, 4):
        if not fields[i]:
            continue
        row = _label(fields[i], fields[i + 1])
        if (row, reading.column) in matrix.entries or (
            matrix.is_symmetric and (reading.column, row) in matrix.entries
        ):
            raise ValueError(f"the entry of {row} and {reading.column} is there twice")
        matrix.entries[row, reading.column] = nastran_real(fields[i + 2])


def _add_points(reading: _Reading, fields: list[str]) -> None:
    numbers = [word for word in fields if word]
    if len(numbers) == 3 and numbers[1] == "THRU":
        first, last = nastran_integer(numbers[0]), nastran_integer(numbers[2])
        if not 0 < first <= last <= _MOST_POINTS:
            raise ValueError(f"scalar points from {first} to {last}")
        reading.points.append(range(first, last + 1))
        return
    reading.points += [range(point, point + 1) for point, _ in (_label(word, "0") for word in numbers)]


def _label(point: str, component: str) -> Label:
    label = nastran_integer(point), nastran_integer(component)
    if not 0 < label[0] <= _MOST_POINTS or not 0 <= label[1] <= 6:
        raise ValueError(f"{label} is not a point with a component from 0 to 6")
    return label
