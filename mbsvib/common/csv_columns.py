"""Columns of numbers as a file of comma-separated values."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.common.atomic_file import write_atomic

if TYPE_CHECKING:
    import os
    from collections.abc import Sequence
    from pathlib import Path

    from mbsvib.common.arrays import Array


def write_columns(path: str | os.PathLike[str], names: Sequence[str], columns: Sequence[Array]) -> Path:
    """Write columns under their names, numbers with all their digits; whole or not at all.

    Parameters
    ----------
    path : str or path-like
        Name of the file.
    names : sequence of str
        The header.
    columns : sequence of array, shape (n,)
        The columns.

    Returns
    -------
    Path
        The path.

    Raises
    ------
    ExportError
        If the file cannot be written.
    """
    lines = [",".join(names), *(",".join(map(repr, row)) for row in np.stack(columns, axis=1).tolist())]
    return write_atomic(path, lambda stream: stream.write(("\n".join(lines) + "\n").encode()))
