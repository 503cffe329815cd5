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
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common.expected import a_path
from mbsvib.common.file_content import content_of
from mbsvib.errors import ExportError
from mbsvib.responses.state_space import StateSpace
from mbsvib_export.atomic_file import write_atomic
from mbsvib_export.format_version import FORMAT, VERSION, check_version
from mbsvib_export.neutral import FIRST_ORDER, SECOND_ORDER, THROUGH, SystemData, first_order, system_data_of
from mbsvib_export.npz_reading import arrays_in
from mbsvib_export.read_errors import read_errors

if TYPE_CHECKING:
    from pathlib import Path

    from mbsvib.api.system import System

TEXTS = ("coordinates", "coordinate_units", "inputs", "input_units", "outputs", "output_units", "bodies")
STATE_TEXTS = ("states", "state_units")
# All that is read of a file.
KEYS = ("format", "version", "name", "realization", *TEXTS, *STATE_TEXTS, *SECOND_ORDER, "body_motion",
        *(f"state_space.{key}" for key in (*FIRST_ORDER, THROUGH)))  # fmt: skip


def to_npz(system: System | SystemData, path: str | os.PathLike[str], realization: str = "physical") -> Path:
    """Write a system to a .npz file of numpy, completely or not at all.

    Parameters
    ----------
    system : System or SystemData
        The equations of motion.
    path : str or path
        File to write; no suffix is added.
    realization : str
        States of the state space: "physical", "modal" or "balanced".

    Returns
    -------
    Path
        The path.

    Raises
    ------
    ExportError
        If the file cannot be written, or no system is given.
    ResponseError
        If the realization is unknown.
    """
    arrays = arrays_of(system_data_of(system, realization, "to_npz"))
    return write_atomic(path, lambda stream: np.savez(stream, **arrays))


def arrays_of(data: SystemData) -> dict[str, Any]:
    """Return all that a file keeps of a system as arrays, by the keys of the file.

    Parameters
    ----------
    data : SystemData
        Matrices, names and units.

    Returns
    -------
    dict
        Texts and matrices; ``system_data_from`` leads back.
    """
    space = data.state_space
    return {
        "format": np.array(FORMAT),
        "version": np.array(VERSION),
        "name": np.array(data.name),
        "realization": np.array(space.realization),
        **{key: np.array(getattr(data, key), dtype=str) for key in TEXTS},
        **{key: np.array(getattr(space, key), dtype=str) for key in STATE_TEXTS},
        **{key: getattr(data, key) for key in (*SECOND_ORDER, "body_motion")},
        **{f"state_space.{key}": array for key, array in first_order(space).items()},
    }


def from_npz(path: str | os.PathLike[str]) -> SystemData:
    """Return the system that ``to_npz`` wrote.

    Parameters
    ----------
    path : str or path
        The file.

    Returns
    -------
    SystemData
        Matrices, names and units; ``to_control``, ``to_json`` and the other exporters take it.

    Raises
    ------
    ExportError
        If the file cannot be read, is damaged, or is of a later version of the format.
    """
    file = a_path(path, "from_npz", ExportError)
    content = content_of(file, ExportError, "a file of to_npz")
    with read_errors(file, ".npz file", "to_npz"):
        entries = arrays_in(content, KEYS)
        check_version(str(entries.get("format")), int(entries.get("version", 0)))
        return system_data_from(entries)


def system_data_from(arrays: dict[str, Any]) -> SystemData:
    """Return the system that arrays, by the keys of the file, describe.

    Parameters
    ----------
    arrays : dict
        Texts and matrices.

    Returns
    -------
    SystemData
        Matrices, names and units.

    Raises
    ------
    ExportError
        If an array is missing or of another kind.
    """
    expected = (*TEXTS, *STATE_TEXTS, *SECOND_ORDER, "name", "realization", "body_motion",
                *(f"state_space.{key}" for key in FIRST_ORDER))  # fmt: skip
    if missing := [key for key in expected if key not in arrays]:
        raise ExportError(f"the array '{missing[0]}' is missing; expected the arrays that to_npz writes.")
    texts: dict[str, Any] = {key: tuple(map(str, arrays[key].tolist())) for key in (*TEXTS, *STATE_TEXTS)}
    if wrong := [key for key in expected if key not in (*texts, "name", "realization") and arrays[key].dtype != float]:
        raise ExportError(f"the array '{wrong[0]}' holds {arrays[wrong[0]].dtype}; expected float64.")
    ports = {key: texts[key] for key in (*STATE_TEXTS, *TEXTS[2:6])}
    first: dict[str, Any] = {
        key: arrays[f"state_space.{key}"] for key in (*FIRST_ORDER, THROUGH) if f"state_space.{key}" in arrays
    }
    second: dict[str, Any] = {key: arrays[key] for key in (*SECOND_ORDER, "body_motion")}
    space = StateSpace(name=str(arrays["name"]), realization=str(arrays["realization"]), **first, **ports)
    return SystemData(name=space.name, state_space=space, **{key: texts[key] for key in TEXTS}, **second)
