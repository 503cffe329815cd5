"""Nastran's OUTPUT4 (OP4): all matrices of a system to the last bit, as text or binary.

OP4 holds matrices without names of rows; here MAA, BAA (damping), KAA (m, m), BU (m, inputs), CQ, CV, CA
(outputs, m), DU (outputs, inputs), in the order of ``system.coordinates``, ``inputs`` and ``outputs``; of first-order
equations alone A, B, C, D in the order of ``states``, ``inputs`` and ``outputs``.
``mbsvib.superelements`` reads them as well.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.common.atomic_file import write_atomic
from mbsvib.common.expected import flag
from mbsvib.common.file_content import ContentError
from mbsvib.common.op4_file import read_op4_file
from mbsvib.common.selection import Names
from mbsvib.errors import ExportError
from mbsvib_export.neutral import Source, SystemData, data_of
from mbsvib_export.reading import content_read

NAMES = {"MAA": "M", "BAA": "C", "KAA": "K", "BU": "B", "CQ": "Cq", "CV": "Cv", "CA": "Ca", "DU": "D"}
SPACE_NAMES = ("A", "B", "C", "D")
# forms of the format, and its type of real numbers in double precision
_SYMMETRIC, _SQUARE, _RECTANGULAR = 6, 1, 2
_DOUBLE = 2
# 17 digits keep every bit; three numbers of 24 characters in a line, also where the exponent has three digits
_PER_LINE, _FORMAT = 3, "1P,3E24.16"


def to_op4(
    system: Source, path: str | os.PathLike[str], binary: bool = False, *, outputs: Names = None, inputs: Names = None
) -> Path:
    """Write the second-order matrices of a system to an OP4 file of Nastran, every number to the last bit.

    Of first-order equations alone, as of loops whose controllers have states, the matrices A, B, C and D.

    Parameters
    ----------
    system : System, ClosedLoop, Controller, StateSpace, control.StateSpace or SystemData
        The equations.
    path : str or path
        File to write, taken as it is: no suffix is added.
    binary : bool
        Whether numbers are binary (little-endian, integers of 32 bits) and not text.
    outputs, inputs : str or sequence of str, optional
        Names or patterns of those to export; default: all.

    Returns
    -------
    Path
        The path.

    Raises
    ------
    ExportError
        If the file cannot be written, no system is given, or it has neither coordinates nor ports.
    """
    data = data_of(system, "physical", "to_op4", outputs, inputs)
    names = NAMES if isinstance(data, SystemData) else dict(zip(SPACE_NAMES, SPACE_NAMES, strict=True))
    arrays = {name: getattr(data, key) for name, key in names.items()}
    arrays = {name: array for name, array in arrays.items() if array.size}
    if not arrays:
        raise ExportError(f"to_op4: '{data.name}' has neither motions nor ports; there is nothing to write.")
    write = _binary if flag(binary, "to_op4", "binary", ExportError) else _text
    content = b"".join(write(name, array) for name, array in arrays.items())
    return write_atomic(path, lambda stream: stream.write(content))


def read_op4(path: str | os.PathLike[str]) -> dict[str, Array]:
    """Return the matrices that ``to_op4`` wrote by their names in mbsvib; those without entries are missing."""
    with content_read(path, "OP4 file", "op4") as raw:
        matrices = read_op4_file(raw, (*NAMES, *SPACE_NAMES))
        result = {NAMES[name]: array for name, array in matrices.items() if name in NAMES} or \
            {name: array for name, array in matrices.items() if name in SPACE_NAMES}  # fmt: skip
        if not result:
            raise ContentError(f"none of the matrices {', '.join((*NAMES, *SPACE_NAMES))}, but "
                               f"{', '.join(matrices) or 'nothing'}")  # fmt: skip
        if wrong := [key for key, array in result.items() if array.dtype != float]:
            raise ContentError(f"{wrong[0]} is complex")
        return result


def _form(name: str, array: Array) -> int:
    if NAMES.get(name, name) not in ("M", "K", "A") and name != "BAA":
        return _RECTANGULAR
    return _SYMMETRIC if np.array_equal(array, array.T) else _SQUARE


def _columns(array: Array) -> Iterator[tuple[int, int, Array]]:
    """Number, first row and numbers of each column from its first to its last entry, those with entries only."""
    for j, column in enumerate(array.T):
        rows = np.flatnonzero(column)
        if len(rows):
            yield j + 1, int(rows[0]) + 1, column[rows[0] : rows[-1] + 1]


def _text(name: str, array: Array) -> bytes:
    rows, columns = array.shape
    lines = [f"{columns:8}{rows:8}{_form(name, array):8}{_DOUBLE:8}{name:<8}{_FORMAT}"]
    for column, row, values in (*_columns(array), (columns + 1, 1, np.ones(1))):
        lines.append(f"{column:8}{row:8}{len(values):8}")
        words = [f"{value:24.16E}" for value in values.tolist()]
        lines += ["".join(words[k : k + _PER_LINE]) for k in range(0, len(words), _PER_LINE)]
    return ("\n".join(lines) + "\n").encode("ascii")


def _binary(name: str, array: Array) -> bytes:
    rows, columns = array.shape
    records = [struct.pack("<4i8s", columns, rows, _form(name, array), _DOUBLE, name.ljust(8).encode())]
    for column, row, values in (*_columns(array), (columns + 1, 1, np.ones(1))):
        records.append(struct.pack("<3i", column, row, 2 * len(values)) + values.astype("<f8").tobytes())
    return b"".join(struct.pack("<i", len(record)) + record + struct.pack("<i", len(record)) for record in records)
