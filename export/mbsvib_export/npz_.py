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

from mbsvib.api.state_space import StateSpace
from mbsvib.common.atomic_file import write_atomic
from mbsvib.common.expected import a_path
from mbsvib.common.file_content import content_of
from mbsvib.errors import ExportError
from mbsvib_export.consistency import consistent
from mbsvib_export.format_version import FORMAT, SPACE_FORMAT, VERSION, check_version
from mbsvib_export.neutral import (
    ERROR_BOUND,
    FIRST_ORDER,
    SECOND_ORDER,
    THROUGH,
    SystemData,
    checked,
    data_of,
    first_order,
)
from mbsvib_export.npz_reading import arrays_in
from mbsvib_export.read_errors import read_errors
from mbsvib_export.selection import with_ports

if TYPE_CHECKING:
    from pathlib import Path

    from mbsvib.api.system import System
    from mbsvib.common.selection import Names
    from mbsvib.feedback.closed_loop import ClosedLoop
    from mbsvib.feedback.controller import Controller
    from mbsvib.responses.state_space import StateSpace as FirstOrder

PORT_TEXTS = ("inputs", "input_units", "outputs", "output_units")
TEXTS = ("coordinates", "coordinate_units", *PORT_TEXTS, "bodies")
STATE_TEXTS = ("states", "state_units")
# All that is read of a file.
KEYS = ("format", "version", "name", "realization", *TEXTS, *STATE_TEXTS, *SECOND_ORDER, "body_motion",
        *(f"state_space.{key}" for key in (*FIRST_ORDER, THROUGH, ERROR_BOUND)))  # fmt: skip


def to_npz(
    system: System | ClosedLoop | Controller | StateSpace | SystemData, path: str | os.PathLike[str],
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


def arrays_of(data: SystemData | FirstOrder) -> dict[str, Any]:
    """Return everything that a file keeps of a system as arrays by the keys of the file; the inverse of ``data_from``.
    """
    texts: tuple[str, ...]
    if isinstance(data, SystemData):
        space, form, texts = data.state_space, FORMAT, TEXTS
        matrices = {key: getattr(data, key) for key in (*SECOND_ORDER, "body_motion")}
        states = first_order(space)
    else:
        space, form, texts, matrices = data, SPACE_FORMAT, PORT_TEXTS, {}
        bound = {} if data.error_bound is None else {ERROR_BOUND: np.array(data.error_bound)}
        states = {key: getattr(data, key) for key in "ABCD"} | bound
    return {
        "format": np.array(form), "version": np.array(VERSION), "name": np.array(data.name),
        "realization": np.array(space.realization),
        **{key: np.array(getattr(data, key), dtype=str) for key in texts},
        **{key: np.array(getattr(space, key), dtype=str) for key in STATE_TEXTS},
        **matrices,
        **{f"state_space.{key}": array for key, array in states.items()},
    }  # fmt: skip


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
    file = a_path(path, "from_npz", ExportError)
    content = content_of(file, ExportError, "a file of to_npz")
    with read_errors(file, ".npz file", "to_npz"):
        entries = arrays_in(content, KEYS)
        check_version(str(entries.get("format")), int(entries.get("version", 0)))
        return data_from(entries)


def data_from(arrays: dict[str, Any]) -> SystemData | StateSpace:
    """Return the system, or the state space, that arrays, by the keys of the file, describe."""
    if str(arrays["format"]) != SPACE_FORMAT:
        return system_data_from(arrays)
    matrices = [f"state_space.{key}" for key in "ABCD"]
    _check_keys(arrays, ("name", "realization", *PORT_TEXTS, *STATE_TEXTS, *matrices))
    texts: dict[str, Any] = {key: tuple(map(str, arrays[key].tolist())) for key in (*PORT_TEXTS, *STATE_TEXTS)}
    bound = arrays.get(f"state_space.{ERROR_BOUND}")
    return checked(StateSpace(
        str(arrays["name"]), str(arrays["realization"]), **{key[-1]: arrays[key] for key in matrices}, **texts,
        transform=np.zeros((0, len(texts["states"]))), error_bound=None if bound is None else float(bound.item()),
    ))  # fmt: skip


def system_data_from(arrays: dict[str, Any]) -> SystemData:
    """Return the system that arrays, by the keys of the file, describe."""
    expected = (*TEXTS, *STATE_TEXTS, *SECOND_ORDER, "name", "realization", "body_motion",
                *(f"state_space.{key}" for key in FIRST_ORDER))  # fmt: skip
    _check_keys(arrays, expected)
    texts: dict[str, Any] = {key: tuple(map(str, arrays[key].tolist())) for key in (*TEXTS, *STATE_TEXTS)}
    ports = {key: texts[key] for key in (*STATE_TEXTS, *TEXTS[2:6])}
    first: dict[str, Any] = {
        key: arrays[f"state_space.{key}"] for key in (*FIRST_ORDER, THROUGH) if f"state_space.{key}" in arrays
    }
    second: dict[str, Any] = {key: arrays[key] for key in (*SECOND_ORDER, "body_motion")}
    space = StateSpace(name=str(arrays["name"]), realization=str(arrays["realization"]), **first, **ports)
    return consistent(SystemData(name=space.name, state_space=space, **{key: texts[key] for key in TEXTS}, **second))


def _check_keys(arrays: dict[str, Any], expected: tuple[str, ...]) -> None:
    if missing := [key for key in expected if key not in arrays]:
        raise ExportError(f"the array '{missing[0]}' is missing; expected the arrays that to_npz writes.")
    words = (*TEXTS, *STATE_TEXTS, "name", "realization")
    if wrong := [key for key in expected if key not in words and arrays[key].dtype != float]:
        raise ExportError(f"the array '{wrong[0]}' holds {arrays[wrong[0]].dtype}; expected float64.")
