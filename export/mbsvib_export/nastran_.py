"""Nastran: matrices as OUTPUT4 text (OP4, through pyNastran) or as DMIG cards of a bulk data file.

OP4 holds matrices without names of rows; here MAA, BAA (damping), KAA (m, m), BU (m, inputs), CQ, CV, CA
(outputs, m), DU (outputs, inputs), in the order of ``system.coordinates``, ``inputs`` and ``outputs``. DMIG holds MAAX,
BAAX, KAAX with coordinate k as scalar point k; names stand in comments. ``mbsvib.superelements`` reads both.
"""

from __future__ import annotations

import os
import tempfile
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.errors import ExportError
from mbsvib_export.atomic_file import write_atomic
from mbsvib_export.neutral import SystemData, system_data_of
from mbsvib_export.packages import need

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mbsvib.api.system import System
    from mbsvib.common.arrays import Array


_INSTALL = "mbsvib[nastran]"
DMIG_NAMES = {"MAAX": "M", "BAAX": "C", "KAAX": "K"}
OP4_NAMES = {"MAA": "M", "BAA": "C", "KAA": "K", "BU": "B", "CQ": "Cq", "CV": "Cv", "CA": "Ca", "DU": "D"}
# forms of the format: 6 symmetric, 1 square, 2 rectangular
_SYMMETRIC, _SQUARE, _RECTANGULAR = 6, 1, 2


def to_op4(system: System | SystemData, path: str | os.PathLike[str]) -> Path:
    """Write the second-order matrices of a system to an OP4 text file of Nastran, every number to the last bit.

    Parameters
    ----------
    system : System or SystemData
        The equations of motion.
    path : str or path
        File to write, taken as it is: no suffix is added.

    Returns
    -------
    Path
        The path.

    Raises
    ------
    ExportError
        If pyNastran is not installed, the file cannot be written, or no system is given.
    """
    module = need("pyNastran.op4.op4", "to_op4", _INSTALL)
    data = system_data_of(system, "physical", "to_op4")
    matrices: dict[str, tuple[int, Array]] = {}
    for name, key in OP4_NAMES.items():
        array = getattr(data, key)
        if array.size:
            square = _SYMMETRIC if np.array_equal(array, array.T) else _SQUARE
            matrices[name] = (square if key in "MCK" else _RECTANGULAR, array)
    if not matrices:
        raise ExportError(f"to_op4: '{data.name}' has no degree of freedom and no ports; there is nothing to write.")
    with tempfile.TemporaryDirectory() as folder:
        draft = Path(folder) / "draft.op4"
        module.OP4(debug=False).write_op4(str(draft), matrices, name_order=list(matrices), precision="double",
                                          is_binary=False)  # fmt: skip
        content = draft.read_bytes()
    return write_atomic(path, lambda stream: stream.write(content))


def read_op4(path: str | os.PathLike[str]) -> dict[str, Array]:
    """Return the matrices that ``to_op4`` wrote, by their names in mbsvib.

    Parameters
    ----------
    path : str or path
        The file.

    Returns
    -------
    dict of str to array
        "M", "C", "K", "B", "Cq", "Cv", "Ca", "D"; matrices without entries are missing.

    Raises
    ------
    ExportError
        If pyNastran is not installed, or the file cannot be read or is damaged.
    """
    module = need("pyNastran.op4.op4", "read_op4", _INSTALL)
    where = os.fspath(path)
    if not Path(path).is_file():
        raise ExportError(f"{where}: cannot be read: there is no such file; expected a file of to_op4.")
    try:
        with redirect_stdout(StringIO()):  # the reader prints messages about damaged files
            matrices = module.OP4(debug=False).read_op4(where)
        result = {OP4_NAMES[name]: _dense(value) for name, value in matrices.items() if name in OP4_NAMES}
        if not result or not all(np.isfinite(array).all() for array in result.values()):
            raise ExportError("it holds none of the matrices, or not finite numbers")
        return result
    except Exception as error:  # pyNastran meets damage with errors of every kind
        raise ExportError(f"{where}: no OP4 file of to_op4, or a damaged one ({error}); write it again.") from error


def to_dmig(system: System | SystemData, path: str | os.PathLike[str]) -> Path:
    """Write M, C and K of a system as DMIG cards in Nastran's large fields, one scalar point for each coordinate.

    Large fields hold ten significant digits; ``to_op4`` holds all.

    Parameters
    ----------
    system : System or SystemData
        The equations of motion.
    path : str or path
        File to write, taken as it is: no suffix is added.

    Returns
    -------
    Path
        The path.

    Raises
    ------
    ExportError
        If the file cannot be written, no system is given, or it has no degree of freedom.
    """
    data = system_data_of(system, "physical", "to_dmig")
    if not data.coordinates:
        raise ExportError(f"to_dmig: '{data.name}' has no degree of freedom; there is nothing to write.")
    lines = [f"$ {data.name}: scalar point = coordinate [unit]".encode("ascii", "replace").decode()]
    for k, (name, unit) in enumerate(zip(data.coordinates, data.coordinate_units, strict=True)):
        lines.append(f"$ {k + 1} = {name} [{unit}]".encode("ascii", "replace").decode())
    for name, key in DMIG_NAMES.items():
        lines.extend(_cards(name, getattr(data, key)))
    text = "\n".join(lines) + "\n"
    return write_atomic(path, lambda stream: stream.write(text.encode("ascii")))


def read_dmig(path: str | os.PathLike[str]) -> dict[str, Array]:
    """Return M, C and K that ``to_dmig`` wrote, of ten digits.

    Parameters
    ----------
    path : str or path
        The file.

    Returns
    -------
    dict of str to array
        "M", "C", "K", each of shape (m, m).

    Raises
    ------
    ExportError
        If the file cannot be read or is damaged.
    """
    where, line = os.fspath(path), ""
    try:
        lines = Path(path).read_text(encoding="ascii").splitlines()
        size = max(sum(line.startswith("$") for line in lines) - 1, 0)
        result = {key: np.zeros((size, size)) for key in DMIG_NAMES.values()}
        missing, array, mirrored, column = set(DMIG_NAMES), np.zeros((0, 0)), False, 0
        for line in lines:
            if line.startswith("DMIG "):
                name = line[8:16].strip()
                missing.discard(name)
                array, mirrored = result[DMIG_NAMES[name]], int(line[24:32]) == _SYMMETRIC
            elif line.startswith("DMIG*"):
                column = int(line[24:40])
            elif line.startswith("*"):
                row, value = int(line[8:24]), float(line[40:56].replace("D", "E"))
                array[row - 1, column - 1] = value
                if mirrored:
                    array[column - 1, row - 1] = value
        if missing or size < 1:
            raise ExportError(f"{', '.join(sorted(missing)) or 'its coordinates'} missing")
        return result
    except OSError as error:
        raise ExportError(f"{where}: cannot be read: {error.strerror or error}; expected a file of "
                          f"to_dmig.") from error  # fmt: skip
    except (ValueError, LookupError, ExportError) as error:
        raise ExportError(f"{where}: no cards of to_dmig, or damaged ones (line '{line}': {error}); write them "
                          f"again.") from error  # fmt: skip


def _cards(name: str, array: Array) -> Iterator[str]:
    symmetric = np.array_equal(array, array.T)
    form = _SYMMETRIC if symmetric else _SQUARE
    yield f"DMIG    {name:<8}{0:>8}{form:>8}{2:>8}{0:>8}{'':8}{'':8}{'' if symmetric else len(array):>8}".rstrip()
    for column in range(len(array)):
        rows = [row for row in range(column if symmetric else 0, len(array)) if array[row, column]]
        if not rows:
            continue
        yield f"DMIG*   {name:<16}{column + 1:>16}{0:>16}"
        for row in rows:
            yield f"*       {row + 1:>16}{0:>16}{_number(array[row, column]):>16}"


def _number(value: float) -> str:
    return f"{value:.9E}".replace("E", "D")


def _dense(value: Any) -> Array:
    array: Any = getattr(value, "data", value[1] if isinstance(value, tuple) else value)
    sparse = getattr(array, "toarray", None)
    return np.asarray(array if sparse is None else sparse(), dtype=float)
