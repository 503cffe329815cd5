"""Results as columns: files of comma-separated values and pandas."""

from __future__ import annotations

import csv
import os
from abc import abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from importlib import import_module
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from mbsvib.common.atomic_file import write_atomic
from mbsvib.errors import ExportError


class Columnar:
    """A result that is a number of columns of equal length."""

    __slots__ = ()
    _index: str | None = None  # the column that numbers the rows of a DataFrame

    @abstractmethod
    def columns(self) -> dict[str, Any]:
        """Return the columns (n,) by name, as ``to_csv`` and ``to_dataframe`` have them."""

    def to_csv(self, path: str | os.PathLike[str]) -> Path:
        """Write the columns to a file of comma-separated values; numbers keep all their digits.

        Parameters
        ----------
        path : str or path-like
            Where to.

        Returns
        -------
        Path
            The path.

        Raises
        ------
        ExportError
            If the file cannot be written.
        """
        return write_csv(path, self.columns())

    def to_dataframe(self) -> Any:
        """Return the columns as a pandas DataFrame.

        Returns
        -------
        pandas.DataFrame
            One row for each entry.

        Raises
        ------
        ExportError
            If pandas is not installed.
        """
        frame = pandas_for("to_dataframe").DataFrame(self.columns())
        return frame if self._index is None else frame.set_index(self._index)


def csv_text(columns: Mapping[str, Any]) -> str:
    """Return columns as comma-separated values with a header and every digit, lines ended by a line feed."""
    text = StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*[np.asarray(column).tolist() for column in columns.values()], strict=True))
    return text.getvalue()


def write_csv(path: str | os.PathLike[str], columns: Mapping[str, Any]) -> Path:
    """Write columns to a file, completely or not at all."""
    return write_atomic(path, lambda stream: stream.write(csv_text(columns).encode()))


def by_pair(outputs: Sequence[str], inputs: Sequence[str], values: Any) -> dict[str, Any]:
    """Return the columns of an array (outputs, inputs, n): OUTPUT/INPUT, of complex ones with _re and _im behind it."""
    parts = {"_re": np.real(values), "_im": np.imag(values)} if np.iscomplexobj(values) else {"": values}
    return {f"{output}/{name}{end}": part[i, j] for i, output in enumerate(outputs) for j, name in enumerate(inputs)
            for end, part in parts.items()}  # fmt: skip


def numbered(arrays: Mapping[str, Any]) -> dict[str, Any]:
    """Return the columns of arrays (n, k) by name, as "NAME(1)", "NAME(2)", ..., those of all arrays in turn."""
    return {f"{name}({k})": column for name, array in arrays.items() for k, column in enumerate(np.transpose(array), 1)}


def by_name(names: Iterable[str], rows: Iterable[Iterable[Any]]) -> dict[str, Any]:
    """Return rows of entries as columns by name."""
    entries = list(rows)
    return {name: np.array(column) for name, column in zip(names, zip(*entries, strict=True), strict=True)} \
        if entries else {name: np.zeros(0) for name in names}


def pandas_for(caller: str) -> Any:
    """Return the module pandas; ``caller``: what needs it."""
    try:
        return import_module("pandas")
    except ImportError as error:
        raise ExportError(f"{caller}: needs pandas, which is not installed; pip install pandas.") from error
