"""Many variants at once: .npz files with the axis of variants in front.

``numpy.load(path)`` alone reads them. The keys are those of ``npz_``, with n variants in front of every matrix, and

    format, version                                    "mbsvib-batch", 1
    parameters (texts), values (parameters, n)         what varies, and its value in each variant
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common.atomic_file import write_atomic
from mbsvib.common.display import Displayed
from mbsvib.errors import ExportError
from mbsvib_export import record
from mbsvib_export.neutral import SECOND_ORDER, SystemData, first_order
from mbsvib_export.npz_ import record_in
from mbsvib_export.reading import arrays_in, content_read
from mbsvib_export.record import KEYS, STATE_TEXTS, TEXTS

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from mbsvib.api.batch import Batch
    from mbsvib.common.arrays import Array


FORMAT = "mbsvib-batch"
VERSION = 1


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
                          f"(model.linearize(values=...)). For a single system: to_npz.")  # fmt: skip
    if realization == "balanced":
        raise ExportError("to_npz_batch: realization = 'balanced'; expected 'physical' or 'modal': balanced "
                          "states have other units in each variant. Write them one by one, to_npz(batch[i], ...).")
    variants = [SystemData.of(system, realization) for system in batch]
    spaces = [data.state_space for data in variants]
    for i, space in enumerate(spaces):
        if space.states != spaces[0].states:
            raise ExportError(f"to_npz_batch: variant {i} has the states {', '.join(space.states)}, variant 0 "
                              f"{', '.join(spaces[0].states)}; expected one list for all. Write them one by one, "
                              f"to_npz(batch[i], ...).")  # fmt: skip
    first = variants[0]
    arrays: dict[str, Any] = {
        "format": np.array(FORMAT),
        "version": np.array(VERSION),
        "name": np.array(first.name),
        "realization": np.array(realization),
        "parameters": np.array(list(batch.parameters), dtype=str),
        "values": np.array(list(batch.parameters.values())).reshape(len(batch.parameters), len(batch)),
        **{key: np.array(getattr(first, key), dtype=str) for key in TEXTS},
        **{key: np.array(getattr(spaces[0], key), dtype=str) for key in STATE_TEXTS},
        **{key: np.stack([getattr(data, key) for data in variants]) for key in (*SECOND_ORDER, "body_motion")},
        **{f"state_space.{key}": np.stack([first_order(space)[key] for space in spaces])
           for key in first_order(spaces[0])},
    }  # fmt: skip
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
        arrays = arrays_in(content, (*KEYS, "parameters", "values"))
        kind, version = str(arrays.pop("format")), int(arrays.pop("version"))
        if (kind, version) != (FORMAT, VERSION):
            raise ExportError(f"format = {kind!r}, version {version}; expected {FORMAT!r}, version {VERSION}. A single "
                              f"system is read by from_npz.")  # fmt: skip
        names, values = arrays.pop("parameters").tolist(), arrays.pop("values")
        shared = {key: arrays.pop(key) for key in ("name", "realization", *TEXTS, *STATE_TEXTS)}
        if values.ndim != 2 or values.dtype != float:
            raise ExportError(f"the array 'values' has shape {values.shape}; expected floats (parameters, variants).")
        for key, array in arrays.items():
            if array.shape[:1] != values.shape[1:]:
                raise ExportError(f"the array '{key}' has shape {array.shape}; expected {values.shape[1]} variants.")
        shared |= {"format": record.FORMAT, "version": record.VERSION}
        systems = tuple([_variant(shared | {key: array[i].copy() for key, array in arrays.items()})
                         for i in range(values.shape[1])])  # fmt: skip
        return BatchData(str(shared["name"]), systems, dict(zip(names, values, strict=True)))


def _variant(arrays: dict[str, Any]) -> SystemData:
    data = record.data_from(record_in(arrays))
    assert isinstance(data, SystemData)
    return data
