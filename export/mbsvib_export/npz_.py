"""numpy's .npz: the whole neutral object as arrays, compact and bit-exact.

``numpy.load(path)`` alone reads it. The keys are

    format, version                                    "mbsvib-system", 1
    name, realization                                  texts
    coordinates, coordinate_units                      texts (m,);  likewise inputs, outputs
    M C K (m, m)   B (m, inputs)   Cq Cv Ca (outputs, m)   D (outputs, inputs)
    bodies (texts), body_motion (bodies, 6, m)         q -> displacements of the bodies, world axes
    states, state_units                                texts (n,)
    state_space.A .B .C .D, state_space.transform      x' = A x + B u, y = C x + D u, (q, q') = transform x
    state_space.through                                + through u; only where damped motions have no mass

First-order equations alone, as of loops whose controllers have states, have the format "mbsvib-state-space", and of
these keys name, realization, inputs, outputs, states, their units, A, B, C and D; state_space.error_bound if they are
reduced.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common.atomic_file import write_atomic
from mbsvib.errors import ExportError
from mbsvib_export.neutral import data_of, with_ports
from mbsvib_export.reading import arrays_in, content_read
from mbsvib_export.record import (
    KEYS,
    STATE_TEXTS,
    TEXTS,
    check_version,
    data_from,
    needed_keys,
    optional_key,
    record_of,
)

if TYPE_CHECKING:
    from pathlib import Path

    from mbsvib.common.selection import Names
    from mbsvib.responses.state_space import StateSpace
    from mbsvib_export.neutral import Source, SystemData

def to_npz(
    system: Source, path: str | os.PathLike[str],
    realization: str = "physical",
    *, outputs: Names = None, inputs: Names = None,
) -> Path:  # fmt: skip
    """Write a system to a .npz file of numpy, completely or not at all.

    Parameters
    ----------
    system : System, ClosedLoop, Controller, StateSpace, control.StateSpace or SystemData
        The equations of motion, or first-order equations alone, as of loops whose controllers have states.
    path : str or path
        File to write; no suffix is added.
    realization : str
        States of the state space: "physical", "modal" or "balanced".
    outputs, inputs : str or sequence of str, optional
        Names or patterns of those to export; default: all.

    Returns
    -------
    Path
        The path.

    Raises
    ------
    ExportError
        If the file cannot be written, or no system is given.
    ResponseError
        If the realization, or the name of an output or input, is unknown.
    """
    system = with_ports(system, outputs, inputs)
    arrays = arrays_of(data_of(system, realization, "to_npz"))
    return write_atomic(path, lambda stream: np.savez(stream, **arrays))


def arrays_of(data: SystemData | StateSpace) -> dict[str, Any]:
    """Return everything that a file keeps of a system as arrays by the keys of the file; the inverse of ``record_in``.
    """
    return {key: np.array(value, dtype=str) if isinstance(value, tuple) else np.asarray(value)
            for key, value in record_of(data).items()}  # fmt: skip


def from_npz(path: str | os.PathLike[str]) -> SystemData | StateSpace:
    """Return the system, or the state space, that ``to_npz`` wrote.

    Parameters
    ----------
    path : str or path
        The file.

    Returns
    -------
    SystemData, or StateSpace
        Matrices, names and units; ``to_control``, ``to_json`` and the other exporters take it. A StateSpace of
        first-order equations alone.

    Raises
    ------
    ExportError
        If the file cannot be read, is damaged, or is of a later version of the format.
    """
    with content_read(path, ".npz file", "npz") as content:
        return data_from(record_in(arrays_in(content, KEYS)))


def record_in(arrays: dict[str, Any]) -> dict[str, Any]:
    """Return the record that arrays, by the keys of the file, hold."""
    form = str(arrays.get("format"))
    check_version(form, int(arrays.get("version", 0)))
    record: dict[str, Any] = {"format": form}
    needed = needed_keys(form)
    if missing := [key for key in needed if key not in arrays]:
        raise ExportError(f"the array '{missing[0]}' is missing; expected the arrays that to_npz writes.")
    for key in (*needed, *arrays.keys() & {optional_key(form)}):
        array = arrays[key]
        if key in ("name", "realization"):
            record[key] = str(array)
        elif key in (*TEXTS, *STATE_TEXTS):
            record[key] = tuple(map(str, array.tolist()))
        elif array.dtype != float:
            raise ExportError(f"the array '{key}' holds {array.dtype}; expected float64.")
        else:
            record[key] = array if array.ndim else float(array)
    return record
