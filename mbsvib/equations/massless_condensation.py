"""Static condensation of motions with neither mass nor damping: q = T z + S u.

With the motions N, N^T (K q - B u) = 0 at all times, so that X = (N^T K N)^-1 N^T K gives their amplitudes for the
coordinates z. These keep their names and meaning (T is the identity on them), and the rows D of springs become D T.
M S and C S are zero, so that no derivative of u occurs.

Source: Guyan, AIAA J. 3 (1965) 380, which is exact here: no mass and no damper acts on the condensed motions.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import blas

from mbsvib.equations.massless_null_motion import unresisted
from mbsvib.errors import ModelError
from mbsvib.linalg.qr import pivoted_qr
from mbsvib.linalg.rank import CANCELLING_SPRINGS, EPS, MOVES_NOTHING

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Index
    from mbsvib.equations.terms import Terms

# Dependent coordinates are those that move in condensed motions, unless the pivot of another coordinate is larger by
# more than this factor.
PREFERENCE = 1e-2


@dataclass(frozen=True, slots=True)
class Condensation:
    """q = T z + S u with ``transform`` T (m, z) and ``response`` S (m, inputs), for the ``motions`` N (m, k).

    ``remaining`` (z,) and ``dependent`` (k,) are the numbers of the coordinates.
    """

    transform: Array
    response: Array
    remaining: Index
    dependent: Index
    motions: Array


def condense(
    null: Array, terms: Terms, unit: Array, names: tuple[str, ...], required: NDArray[np.bool_],
    bodies: tuple[str, ...] = (), force_rows: Mapping[str, Array] | None = None,
) -> Condensation:  # fmt: skip
    """Return the static condensation of motions with neither mass nor damping.

    T = [1; -X_d^-1 X_i],  X = (N^T K N)^-1 N^T K,  S = N (N^T K N)^-1 N^T B

    ``null`` (m, k): the motions N. ``unit`` (m,): one unit of length of each coordinate. ``required`` (m,): coordinates
    that must remain. ``force_rows`` has rows (rows, m) of the ``circulatory`` forces, by default those along the
    coordinates.
    """
    _check_stiffness(null, terms, unit, names, bodies, force_rows or {})
    amplitudes, response = _static_amplitudes(null, terms, names)
    # coordinates of the motions first: then forces on massless nodes do not change the meaning of the other coordinates
    weight = np.where((null != 0.0).any(axis=1), 1.0, PREFERENCE) * np.where(required, PREFERENCE**2, 1.0)
    k = null.shape[1]
    order = pivoted_qr(amplitudes * (unit * weight))[1] if k < len(names) else np.arange(k)
    dependent = np.sort(order[:k])
    if required[dependent].any():
        name = names[int(dependent[required[dependent]][0])]
        raise ModelError(
            f"independent: coordinate '{name}' cannot be kept: motions without mass and damping follow from statics, "
            f"and the springs allow no other choice of coordinates. Leave it out of independent=.",
            element=name, field="independent",
        )  # fmt: skip
    remaining = np.setdiff1d(np.arange(len(names)), dependent)
    transform = np.zeros((len(names), len(remaining)))
    transform[remaining, np.arange(len(remaining))] = 1.0
    transform[dependent] = -np.linalg.solve(amplitudes[:, dependent], amplitudes[:, remaining])
    transform[dependent] += 0.0  # no -0.0
    return Condensation(transform, null @ response, remaining, dependent, null)


def _check_stiffness(
    null: Array, terms: Terms, unit: Array, names: tuple[str, ...], bodies: tuple[str, ...],
    force_rows: Mapping[str, Array],
) -> None:  # fmt: skip
    """Refuse motions with neither mass nor damping that have no stiffness either."""
    parts = [terms.elastic_rows[terms.row_stiffness != 0.0]]
    if terms.circulatory is not None:
        parts.append(force_rows.get("circulatory", terms.circulatory))
    without_stiffness = unresisted(parts, null, unit)[0]
    if without_stiffness.shape[1]:
        motion = without_stiffness[:, 0]
        moves = np.abs(terms.body_motion @ motion).max(axis=1)
        moved = [name for name, size in zip(bodies, moves.tolist(), strict=False) if size > MOVES_NOTHING * moves.max()]
        raise massless_motion_error(motion, unit, names, "no spring or damper holds it", moved)


def massless_motion_error(
    motion: Array, unit: Array, names: tuple[str, ...], reason: str, bodies: Sequence[str] = ()
) -> ModelError:
    """Return the error for a massless motion, with its largest coordinate, the ``reason`` and the bodies it moves."""
    name = names[int(np.argmax(np.abs(motion) / unit))]
    of_bodies = ""
    if bodies:
        more = f" and {len(bodies) - 1} more" if len(bodies) > 1 else ""
        of_bodies = f" of body '{bodies[0]}'{more}"
    return ModelError(
        f"coordinate '{name}'{of_bodies}: the mass matrix is singular, this motion (alone or with others) moves no "
        f"mass, and {reason}. Give the bodies it moves an inertia, hold it by a spring or damper, or lock it in its "
        f"joint.", element=name,
    )  # fmt: skip


def _static_amplitudes(null: Array, terms: Terms, names: tuple[str, ...]) -> tuple[Array, Array]:
    """X = (N^T K N)^-1 N^T K, which is the identity on N to rounding, and (N^T K N)^-1 N^T B."""
    forces = null.T @ terms.B
    forces[np.abs(forces) <= 64.0 * EPS * (np.abs(null).T @ np.abs(terms.B))] = 0.0
    used = terms.row_stiffness != 0.0
    k, rows = terms.row_stiffness[used], terms.elastic_rows[used]
    if terms.circulatory is None and (k > 0.0).all():
        # least squares on the rows are accurate for any range of stiffness
        rows = rows * np.sqrt(k)[:, None]
        rows = rows[(rows @ null).any(axis=1)]  # other rows would add rounding errors
        rows = rows[np.argsort(-np.abs(rows).max(axis=1, initial=0.0), kind="stable")]
        null_rows = rows @ null
        size = np.sqrt((null_rows**2).sum(axis=0))
        q, r = np.linalg.qr(null_rows / size)
        amplitudes: Array = blas.dtrsm(1.0, r, q.T @ rows) / size[:, None]
        response: Array = blas.dtrsm(1.0, r, blas.dtrsm(1.0, r, forces / size[:, None], trans_a=1)) / size[:, None]
        return amplitudes, response
    square = null.T @ terms.K @ null
    size = np.sqrt(np.abs(square).sum(axis=1))
    size[size == 0.0] = 1.0
    scaled = square / size[:, None] / size
    if 1.0 / np.linalg.cond(scaled) < CANCELLING_SPRINGS:
        motion = null @ (np.linalg.svd(scaled)[2][-1] / size)
        raise massless_motion_error(motion, np.ones(len(names)), names, "the springs that hold it cancel each other")
    right = np.concatenate((null.T @ terms.K, forces), axis=1) / size[:, None]
    solution = np.linalg.solve(scaled, right) / size[:, None]
    m = null.shape[0]
    return solution[:, :m], solution[:, m:]
