"""Nastran's bulk data: M, C and K of a system as DMIG cards, coordinate k as scalar point k.

Names of coordinates stand in comments. A matrix of zeros has no cards, as Nastran refuses a header without columns.
``mbsvib.superelements.read_punch`` reads them as well.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.api.system import System
from mbsvib.common.arrays import Array
from mbsvib.common.atomic_file import write_atomic
from mbsvib.common.dmig_cards import read_dmig_cards
from mbsvib.common.file_content import ContentError
from mbsvib.errors import ExportError
from mbsvib_export.fmu_.names import printable
from mbsvib_export.neutral import SystemData, system_data_of
from mbsvib_export.reading import content_read

if TYPE_CHECKING:
    from mbsvib.feedback.closed_loop import ClosedLoop


NAMES = {"MAAX": "M", "BAAX": "C", "KAAX": "K"}
# forms of the format: 6 symmetric, 1 square; and its type of real numbers in double precision
_SYMMETRIC, _SQUARE, _DOUBLE = 6, 1, 2
_ENTRIES = re.compile(rb"^\$ ([MBK]AAX): (\d{1,9}) entries\r?$", re.MULTILINE)


def to_dmig(system: System | ClosedLoop | SystemData, path: str | os.PathLike[str]) -> Path:
    """Write M, C and K of a system as DMIG cards in Nastran's large fields, one scalar point for each coordinate.

    Large fields hold ten significant digits; ``to_op4`` holds all.

    Parameters
    ----------
    system : System, ClosedLoop or SystemData
        The equations of motion; of a loop those with static gains.
    path : str or path
        File to write, taken as it is: no suffix is added.

    Returns
    -------
    Path
        The path.

    Raises
    ------
    ExportError
        If the file cannot be written, no system is given, it has no degree of freedom, or it is of first order only.
    """
    data = system_data_of(system, "physical", "to_dmig", "DMIG cards add to Nastran's M, C and K, and first-order "
                          "equations have none. to_op4 writes their A, B, C and D.")  # fmt: skip
    count = len(data.coordinates)
    if count == 0:
        raise ExportError(f"to_dmig: '{data.name}' has no degree of freedom; there is nothing to write.")
    lines = [_comment(f"{data.name}: scalar point = coordinate [unit]")]
    for k, (name, unit) in enumerate(zip(data.coordinates, data.coordinate_units, strict=True)):
        lines.append(_comment(f"{k + 1} = {name} [{unit}]"))
    cards = {name: list(_cards(name, getattr(data, key))) for name, key in NAMES.items()}
    for name, listed in cards.items():  # by which a file that is cut short is known
        lines.append(_comment(f"{name}: {sum(card.startswith('* ') for card in listed)} entries"))
    lines.append(f"SPOINT  {1:>8}{'THRU':>8}{count:>8}" if count > 1 else f"SPOINT  {1:>8}")
    lines += [card for listed in cards.values() for card in listed]
    text = "\n".join(lines) + "\n"
    return write_atomic(path, lambda stream: stream.write(text.encode("ascii")))


def _comment(text: str) -> str:
    """A line of comment; a line break in a name would begin a card."""
    return "$ " + printable(text).encode("ascii", "replace").decode()


def read_dmig(path: str | os.PathLike[str]) -> dict[str, Array]:
    """Return "M", "C", "K" (m, m) that ``to_dmig`` wrote, to ten digits; a matrix without cards is zero."""
    with content_read(path, "file with cards", "dmig") as raw:
        cards = read_dmig_cards(raw)
        count = len(cards.labels)
        if not count or cards.labels != tuple((k + 1, 0) for k in range(count)):
            raise ContentError("scalar points from 1 on are missing")
        entries = {name.decode(): int(number) for name, number in _ENTRIES.findall(raw) if number != b"0"}
        for name, reason in cards.left_out.items():
            raise ContentError(f"matrix {name}: {reason}")
        if entries != cards.entries:
            raise ContentError(f"entries of matrices: {cards.entries}; expected {entries}, as its comments say")
        return {key: cards.matrices.get(name, np.zeros((count, count))) for name, key in NAMES.items()}


def _cards(name: str, array: Array) -> Iterator[str]:
    if not array.any():
        return
    symmetric = np.array_equal(array, array.T)
    form = _SYMMETRIC if symmetric else _SQUARE
    yield f"DMIG    {name:<8}{0:>8}{form:>8}{_DOUBLE:>8}{0:>8}{'':8}{'':8}{'' if symmetric else len(array):>8}".rstrip()
    for column in range(len(array)):
        rows = [row for row in range(column if symmetric else 0, len(array)) if array[row, column]]
        if not rows:
            continue
        yield f"DMIG*   {name:<16}{column + 1:>16}{0:>16}"
        for row in rows:
            yield f"*       {row + 1:>16}{0:>16}{_number(array[row, column]):>16}"


def _number(value: float) -> str:
    return f"{value:.9E}".replace("E", "D")
