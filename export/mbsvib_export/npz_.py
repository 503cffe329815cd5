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
reduced. Many variants at once have the axis of n variants in front of every matrix, and

    format, version                                    "mbsvib-batch", 1
    parameters (texts), values (parameters, n)         what varies, and its value in each variant
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mbsvib.api.batch import Batch
from mbsvib.common.arrays import Array
from mbsvib.common.atomic_file import write_atomic
from mbsvib.common.display import Displayed
from mbsvib.common.selection import Names
from mbsvib.errors import ExportError
from mbsvib.responses.state_space import StateSpace
from mbsvib_export import record as kept
from mbsvib_export.neutral import Source, SystemData, data_of
from mbsvib_export.reading import arrays_in, content_read

BATCH_FORMAT, BATCH_VERSION = "mbsvib-batch", 1


def to_npz(
    system: Source, path: str | os.PathLike[str], realization: str = "physical", *, outputs: Names = None,
    inputs: Names = None,
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
    arrays = arrays_of(data_of(system, realization, "to_npz", outputs, inputs))
    return write_atomic(path, lambda stream: np.savez(stream, **arrays))


def arrays_of(data: SystemData | StateSpace) -> dict[str, Any]:
    """Return everything that a file keeps of a system as arrays by the keys of the file; the inverse of ``record_in``.
    """
    return {key: np.array(value, dtype=str) if isinstance(value, tuple) else np.asarray(value)
            for key, value in kept.record_of(data).items()}  # fmt: skip


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
        return kept.data_from(record_in(arrays_in(content, kept.KEYS)))


def record_in(arrays: dict[str, Any]) -> dict[str, Any]:
    """Return the record that arrays, by the keys of the file, hold."""
    form = str(arrays.get("format"))
    kept.check_version(form, int(arrays.get("version", 0)))
    record: dict[str, Any] = {"format": form}
    if missing := [key for key in kept.NEEDED[form] if key not in arrays]:
        raise ExportError(f"the array '{missing[0]}' is missing; expected the arrays that to_npz writes.")
    for key in (*kept.NEEDED[form], *arrays.keys() & {kept.OPTIONAL[form]}):
        array = arrays[key]
        if key in ("name", "realization"):
            record[key] = str(array)
        elif key in (*kept.TEXTS, *kept.STATE_TEXTS):
            record[key] = tuple(map(str, array.tolist()))
        elif array.dtype != float:
            raise ExportError(f"the array '{key}' holds {array.dtype}; expected float64.")
        else:
            record[key] = array if array.ndim else float(array)
    return record


@dataclass(frozen=True, repr=False, eq=False)
class BatchData(Displayed):
    """What a file keeps of a batch: one ``SystemData`` for each variant, and the ``values`` (n,) of what varies."""

    name: str
    systems: tuple[SystemData, ...]
    values: Mapping[str, Array]

    def __len__(self) -> int:
        return len(self.systems)

    def __getitem__(self, i: int) -> SystemData:
        return self.systems[i]

    def __repr__(self) -> str:
        return f"BatchData({self.name!r}: {len(self)} variants of {', '.join(self.values)})"


def to_npz_batch(batch: Batch, path: str | os.PathLike[str], realization: str = "physical") -> Path:
    """Write all variants of a batch to one .npz file of numpy, completely or not at all.

    Parameters
    ----------
    batch : Batch
        Variants of one model, ``model.linearize(values=...)``.
    path : str or path
        File to write; no suffix is added.
    realization : str
        States of the state spaces: "physical" or "modal".

    Returns
    -------
    Path
        The path.

    Raises
    ------
    ExportError
        If the file cannot be written, no batch is given, or states are to be balanced: each variant by its own scale.
    ResponseError
        If the realization is unknown.
    """
    from mbsvib.api.batch import Batch

    if not isinstance(batch, Batch):
        raise ExportError(f"to_npz_batch: batch = {type(batch).__name__}; expected a Batch "
                          f"(model.linearize(values=...)), or its .ends if motions are inputs. For a single system: "
                          f"to_npz.")  # fmt: skip
    if isinstance(realization, str) and realization == "balanced":
        raise ExportError("to_npz_batch: realization = 'balanced'; expected 'physical' or 'modal': balanced "
                          "states have other units in each variant. Write them one by one, to_npz(batch[i], ...).")
    variants = [arrays_of(SystemData.of(system, realization)) for system in batch]
    first = variants[0]
    for i, variant in enumerate(variants):
        if (states := variant["states"].tolist()) != first["states"].tolist():
            raise ExportError(f"to_npz_batch: variant {i} has the states {', '.join(states)}, variant 0 "
                              f"{', '.join(first['states'])}; expected one list for all. Write them one by one, "
                              f"to_npz(batch[i], ...).")  # fmt: skip
    arrays: dict[str, Any] = {
        "format": np.array(BATCH_FORMAT), "version": np.array(BATCH_VERSION), "name": first["name"],
        "realization": first["realization"], "parameters": np.array(list(batch.parameters), dtype=str),
        "values": np.array(list(batch.parameters.values())).reshape(len(batch.parameters), len(batch)),
    }  # fmt: skip
    arrays |= {key: np.stack([variant[key] for variant in variants]) if array.dtype == float else array
               for key, array in first.items() if key not in arrays}  # fmt: skip
    return write_atomic(path, lambda stream: np.savez(stream, **arrays))


def from_npz_batch(path: str | os.PathLike[str]) -> BatchData:
    """Return the variants that ``to_npz_batch`` wrote.

    Parameters
    ----------
    path : str or path
        The file.

    Returns
    -------
    BatchData
        Matrices, names and units of each variant, and the values of what varies.

    Raises
    ------
    ExportError
        If the file cannot be read, is damaged, holds a single system, or is of a later version of the format.
    """
    with content_read(path, ".npz file", "npz_batch") as content:
        arrays = arrays_in(content, (*kept.KEYS, "parameters", "values"))
        kind, version = str(arrays.pop("format")), int(arrays.pop("version"))
        if (kind, version) != (BATCH_FORMAT, BATCH_VERSION):
            raise ExportError(f"format = {kind!r}, version {version}; expected {BATCH_FORMAT!r}, version "
                              f"{BATCH_VERSION}. A single system is read by from_npz.")  # fmt: skip
        names, values = arrays.pop("parameters").tolist(), arrays.pop("values")
        shared = {key: arrays.pop(key) for key in ("name", "realization", *kept.TEXTS, *kept.STATE_TEXTS)}
        if values.ndim != 2 or values.dtype != float:
            raise ExportError(f"the array 'values' has shape {values.shape}; expected floats (parameters, variants).")
        for key, array in arrays.items():
            if array.shape[:1] != values.shape[1:]:
                raise ExportError(f"the array '{key}' has shape {array.shape}; expected {values.shape[1]} variants.")
        shared |= {"format": kept.FORMAT, "version": kept.VERSION}
        variants = ({key: array[i].copy() for key, array in arrays.items()} for i in range(values.shape[1]))
        systems: Any = tuple([kept.data_from(record_in(shared | variant)) for variant in variants])
        return BatchData(str(shared["name"]), systems, dict(zip(names, values, strict=True)))
