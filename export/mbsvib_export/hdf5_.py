"""HDF5: the keys of ``npz_`` as datasets, those of the state space in a group; texts are UTF-8, numbers bit-exact.

    /format /version /name /realization /coordinates ... /M /C /K ... /bodies /body_motion
    /state_space/A .../transform
"""

from __future__ import annotations

import os
import zlib
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from mbsvib.common.atomic_file import write_atomic
from mbsvib.common.file_content import check_shape
from mbsvib.common.selection import Names
from mbsvib.errors import ExportError
from mbsvib.responses.state_space import StateSpace
from mbsvib_export.neutral import Source, SystemData, data_of
from mbsvib_export.npz_ import arrays_of, record_in
from mbsvib_export.packages import need
from mbsvib_export.reading import content_read
from mbsvib_export.record import KEYS, data_from

HEAD = 512  # bytes before the file itself, which HDF5 leaves to others


def head(content: bytes) -> bytes:
    """Return a line with a checksum of what follows: the HDF5 library does not survive some damaged files."""
    return f"mbsvib system in HDF5, crc32 {zlib.crc32(content):08x}\n".encode().ljust(HEAD, b"\0")


def to_hdf5(
    system: Source, path: str | os.PathLike[str], realization: str = "physical", *, outputs: Names = None,
    inputs: Names = None,
) -> Path:  # fmt: skip
    """Write a system to an HDF5 file, completely or not at all.

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
        If h5py is not installed, the file cannot be written, or no system is given.
    ResponseError
        If the realization, or the name of an output or input, is unknown.
    """
    h5py = need("h5py", "to_hdf5")
    arrays = arrays_of(data_of(system, realization, "to_hdf5", outputs, inputs))
    stream = BytesIO()
    with h5py.File(stream, "w", userblock_size=HEAD) as file:
        for key, array in arrays.items():
            is_text = array.dtype.kind == "U"
            value = array.astype(object) if is_text else array
            file.create_dataset(key.replace(".", "/"), data=value, dtype=h5py.string_dtype() if is_text else None)
    content = stream.getvalue()[HEAD:]
    return write_atomic(path, lambda target: target.write(head(content) + content))


def from_hdf5(path: str | os.PathLike[str]) -> SystemData | StateSpace:
    """Return the system, or the state space, that ``to_hdf5`` wrote.

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
        If h5py is not installed, or the file cannot be read, is damaged, or is of a later version of the format.
    """
    h5py = need("h5py", "from_hdf5")
    with content_read(path, "HDF5 file", "hdf5") as raw:
        if raw[:HEAD] != head(raw[HEAD:]):
            raise ExportError("no HDF5 file as to_hdf5 wrote it: damaged, or saved by another program; write it again.")
        with h5py.File(BytesIO(raw), "r") as datasets:
            entries = _entries(h5py, datasets, len(raw))
        return data_from(record_in(entries))


def _entries(h5py: Any, file: Any, size: int) -> dict[str, Any]:
    """Return the datasets by the keys of ``npz_``, those only whose numbers stand in the file itself."""
    result: dict[str, Any] = {}
    for key in KEYS:
        item = file.get(key.replace(".", "/"))
        if not isinstance(item, h5py.Dataset):
            continue
        needed = check_shape(item.shape, item.dtype.itemsize, size, key)
        if item.is_virtual or item.external or item.chunks or item.id.get_storage_size() < needed:
            raise ExportError(f"the numbers of '{key}' are packed, missing or in another file; expected them as "
                              f"to_hdf5 writes them.")  # fmt: skip
        is_text = h5py.check_string_dtype(item.dtype) is not None
        result[key] = np.array(item.asstr()[()], dtype=str) if is_text else np.array(item[()])
    return result
