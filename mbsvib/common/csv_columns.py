"""Columns of numbers as a file of comma-separated values."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.common.atomic_file import write_atomic

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping
    from pathlib import Path

    from mbsvib.common.arrays import Array


def write_columns(path: str | os.PathLike[str], columns: Mapping[str, Array]) -> Path:
    """Write columns (n,) under their names, numbers with all their digits; whole or not at all."""
    rows = np.stack(list(columns.values()), axis=1).tolist()
    lines = [",".join(columns), *(",".join(map(repr, row)) for row in rows)]
    return write_atomic(path, lambda stream: stream.write(("\n".join(lines) + "\n").encode()))
