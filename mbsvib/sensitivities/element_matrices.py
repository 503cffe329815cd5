"""Stiffness, damping and inertance of connections as matrices on the relative motion at one point of each."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.elements.families import connection_rows

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.elements.connection import Connection


def element_matrices(parts: Sequence[Connection], points: Array) -> tuple[Array, Array, Array | None]:
    """Return stiffness, damping and inertance (n, 6, 6) of connections, R^T diag(k) R with their rows R.

    ``points`` (n, 3): where the relative motion of each is taken, world axes. Inertance is None where all are zero.
    """
    number = {name: 0 for part in parts for name in (part.first, part.second)}
    elements = connection_rows(parts, number)
    rows, owner = elements.rows, elements.owner
    six = np.concatenate((rows.force, rows.moment))
    arm = rows.point - points[owner].T
    if arm.any():
        six[3:] += np.cross(arm, rows.force, axis=0)
    squares = (six[:, None] * six).reshape(36, len(owner))

    def of_owners(values: Array) -> Array:
        result = np.zeros((len(parts), 36))
        np.add.at(result, owner, (values * squares).T)
        return result.reshape(len(parts), 6, 6)

    return (of_owners(elements.stiffness), of_owners(elements.damping),
            None if elements.inertance is None else of_owners(elements.inertance))  # fmt: skip
