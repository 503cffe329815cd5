"""Measurements as numpy files of arrays."""

from __future__ import annotations

import os
import zipfile
import zlib
from io import BytesIO
from pathlib import Path
from typing import Any, Self, cast

import numpy as np

from mbsvib.common.atomic_file import write_atomic
from mbsvib.common.expected import a_path
from mbsvib.common.file_content import LARGEST_UNPACKED, content_of, shortened
from mbsvib.errors import ResponseError
from mbsvib.measurement.common_errors import CommonErrors

# Entries of a file of arrays that are channels and noise; the others of a measurement are not kept there.
ARRAYS = ("omega", "responses", "outputs", "inputs", "variance", "coherence", "averages", "covariance", "quantity",
          "output_units", "input_units", "noise_variance", "line_correlation")  # fmt: skip
# Entries that say how errors of several channels belong together.
COMMON = ("common_rows", "common_variance", "common_columns")


class ArrayFiles:
    """Reading and writing of files of arrays."""

    __slots__ = ()

    @classmethod
    def from_npz(cls, path: str | os.PathLike[str], **entries: str) -> Self:
        """Return the measurement in a numpy file of arrays.

        Parameters
        ----------
        path : str or path
            The file, of ``to_npz`` or of others with the same entries.
        **entries
            Names in the file of arrays that have another name there: ``responses="responses_100"``.
            ``frequencies`` [Hz] stands in for ``omega``.

        Returns
        -------
        Measurement
            Responses, names, units and noise; without points and modes.

        Raises
        ------
        ResponseError
            If the file cannot be read, or an entry is missing.
        """
        where = a_path(path, "from_npz", ResponseError)
        unknown = sorted(set(entries) - {*ARRAYS, "frequencies"})
        if unknown:
            raise ResponseError(f"from_npz: {', '.join(unknown)} is nothing that a measurement has; expected "
                                f"{', '.join(ARRAYS)}.")  # fmt: skip
        keys = {name: entries.get(name, name) for name in (*ARRAYS, "frequencies")}
        file = _arrays(where, {*keys.values(), *COMMON})
        missing = [keys[name] for name in (*entries, "responses", "outputs", "inputs") if keys[name] not in file]
        if missing or not (keys["omega"] in file or keys["frequencies"] in file):
            raise ResponseError(f"from_npz: {where}: {', '.join(missing) or 'omega'} is missing; the file has "
                                f"{', '.join(file)}.")  # fmt: skip
        values: dict[str, Any] = {
            name: file[key] if file[key].dtype.kind not in "US" else tuple(map(str, np.atleast_1d(file[key])))
            for name, key in keys.items() if key in file}  # fmt: skip
        hertz = values.pop("frequencies", None)
        values.setdefault("omega", None if hertz is None else 2 * np.pi * hertz)
        if "averages" in values:
            values["averages"] = values["averages"].item(0)
        if set(COMMON) <= file.keys():
            values["common_errors"] = _common(where, [file[name] for name in COMMON], values["responses"].shape)
        return cls(**values)

    def to_npz(self, path: str | os.PathLike[str]) -> Path:
        """Write responses, names, units and noise to a numpy file of arrays; points and modes are left out.

        What channels share of the noise, as those of a virtual point, is in ``common_rows``, ``common_variance`` and
        ``common_columns``.

        Parameters
        ----------
        path : str or path
            The file.

        Returns
        -------
        Path
            The path.
        """
        arrays = {name: np.asarray(value) for name in ARRAYS if (value := getattr(self, name)) is not None}
        errors = cast("Any", self).common_errors
        if errors is not None:
            arrays |= dict(zip(COMMON, (errors.rows, errors.variance, errors.columns), strict=True))
        return write_atomic(path, lambda stream: np.savez_compressed(stream, **arrays), ResponseError)  # type: ignore[arg-type]


def _arrays(path: Path, wanted: set[str]) -> dict[str, Any]:
    """The arrays of a file by name; None for those that are not ``wanted``."""
    raw = BytesIO(content_of(path, ResponseError, "a file of arrays"))
    try:
        with zipfile.ZipFile(raw) as archive:
            size = sum(entry.file_size for entry in archive.infolist())
            if size > LARGEST_UNPACKED:
                raise ValueError(f"{size:.3g} bytes of arrays")
        with np.load(raw, allow_pickle=False) as file:
            return {name: np.asarray(file[name]) if name in wanted else None for name in file.files}
    except (OSError, ValueError, LookupError, EOFError, RuntimeError, TypeError, MemoryError, SyntaxError,
            zipfile.BadZipFile, zlib.error) as error:  # fmt: skip
        raise ResponseError(f"from_npz: {path}: no file of arrays that can be read: {shortened(error)}.") from error


def _common(path: Path, arrays: list[Any], shape: tuple[int, ...]) -> CommonErrors:
    errors = CommonErrors(*arrays)
    try:
        if errors.power().shape == shape and (errors.variance >= 0.0).all():
            return errors
    except (ValueError, TypeError):
        pass
    shapes = ", ".join(f"{name} {array.shape}" for name, array in zip(COMMON, arrays, strict=True))
    raise ResponseError(f"from_npz: {path}: {shapes} with responses {shape}; expected (outputs, a, lines), (a, b, "
                        f"lines) of 0 or more, and (inputs, b, lines).")  # fmt: skip
