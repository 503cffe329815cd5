"""Stiffness as a file of Matrix Market, an export target that mbsvib does not have: one file and one row."""

import numpy as np

from mbsvib.common.atomic_file import write_atomic
from mbsvib_export.neutral import data_of
from mbsvib_export.targets import Target


def to_mtx(system, path, *, outputs=None, inputs=None):
    """Write the stiffness matrix of a system; values have 17 digits, which keep every bit."""
    stiffness = data_of(system, "physical", "to_mtx", outputs, inputs).K
    head = f"%%MatrixMarket matrix array real general\n{len(stiffness)} {len(stiffness)}\n"
    body = "".join(f"{value:.17g}\n" for value in np.asarray(stiffness).T.reshape(-1))
    return write_atomic(path, lambda stream: stream.write((head + body).encode()))


ROW = Target((".mtx",), "the stiffness matrix as Matrix Market", "to_mtx")
