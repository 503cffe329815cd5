"""Static condensation: motions that feel neither mass nor damper follow the others, q = T z + S u.

With N the motions, N^T (K q - B u) = 0 holds at all times, so that X = (N^T K N)^-1 N^T K takes them out of what
others do: the coordinates z keep name and meaning (T is the identity on them), and the rows of every spring act on T z.
M S and C S are zero, which is why no derivative of u comes in.

Source: Guyan, AIAA J. 3 (1965) 380, where exact: no mass and no damper acts on what is condensed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import blas

from mbsvib.equations.massless_null_motion import unfelt
from mbsvib.errors import ModelError
from mbsvib.linalg.qr import pivoted_qr
from mbsvib.linalg.rank import CANCELLING_SPRINGS, EPS, MOVES_NOTHING

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Index
    from mbsvib.equations.terms import Terms

# Coordinates that a condensed motion moves itself are taken for dependent ones, unless others tie it this much more.
PREFERENCE = 1e-2


@dataclass(frozen=True, slots=True)
class Condensation:
    """q = T z + S u: ``transform`` T (m, z), ``response`` S (m, inputs), ``kept`` (z,) and ``dependent`` the numbers of
    the coordinates; ``motions`` N (m, k) are what was condensed.
    """

    transform: Array
    response: Array
    kept: Index
    dependent: Index
    motions: Array


def condense(
    null: Array, terms: Terms, unit: Array, names: tuple[str, ...], pinned: NDArray[np.bool_],
    bodies: tuple[str, ...] = (), acting: Mapping[str, Array] | None = None,
) -> Condensation:  # fmt: skip
    """Return the static condensation of motions that feel neither mass nor damper.

    T = [1; -X_d^-1 X_i],  X = (N^T K N)^-1 N^T K,  S = N (N^T K N)^-1 N^T B

    Parameters
    ----------
    null : array, shape (m, k)
        The motions N.
    terms : Terms
        The matrices and factors of the system.
    unit : array, shape (m,)
        One unit of length of each coordinate.
    names : tuple of str
        Names of the coordinates.
    pinned : array, shape (m,)
        Coordinates that the user wants to keep.
    bodies : tuple of str
        Names of the bodies, for refusals.
    acting : mapping of str to array, shape (rows, m), optional
        Forces of the ``circulatory`` term in other directions than those of the coordinates.

    Returns
    -------
    Condensation
        T, S and the choice of coordinates.

    Raises
    ------
    ModelError
        If no spring holds one of the motions, or a pinned coordinate cannot be kept.
    """
    _check_held(null, terms, unit, names, bodies, acting or {})
    follows, forces = _solved(null, terms, names)
    # own coordinates of the motions first: the others then keep their meaning beside a force that acts on a node too
    weight = np.where((null != 0.0).any(axis=1), 1.0, PREFERENCE) * np.where(pinned, PREFERENCE**2, 1.0)
    k = null.shape[1]
    order = pivoted_qr(follows * (unit * weight))[1] if k < len(names) else np.arange(k)
    dependent = np.sort(order[:k])
    if pinned[dependent].any():
        name = names[int(dependent[pinned[dependent]][0])]
        raise ModelError(
            f"independent: coordinate '{name}' cannot be kept: motions without mass and damper follow the others, and "
            f"the springs leave no other choice. Leave it out of independent=.",
            element=name, field="independent",
        )  # fmt: skip
    kept = np.setdiff1d(np.arange(len(names)), dependent)
    transform = np.zeros((len(names), len(kept)))
    transform[kept, np.arange(len(kept))] = 1.0
    transform[dependent] = -np.linalg.solve(follows[:, dependent], follows[:, kept])
    transform[dependent] += 0.0  # no -0.0
    return Condensation(transform, null @ forces, kept, dependent, null)


def _check_held(
    null: Array, terms: Terms, unit: Array, names: tuple[str, ...], bodies: tuple[str, ...],
    acting: Mapping[str, Array],
) -> None:  # fmt: skip
    """Refuse motions without mass and damper that no spring feels either."""
    parts = [terms.elastic_rows[terms.row_stiffness != 0.0]]
    if terms.circulatory is not None:
        parts.append(acting.get("circulatory", terms.circulatory))
    loose = unfelt(parts, null, unit)[0]
    if loose.shape[1]:
        moves = np.abs(terms.body_motion @ loose[:, 0]).max(axis=1)
        light = [name for name, size in zip(bodies, moves.tolist(), strict=False) if size > MOVES_NOTHING * moves.max()]
        raise unheld(loose[:, 0], unit, names, "no spring or damper holds it", light)


def unheld(
    motion: Array, unit: Array, names: tuple[str, ...], why: str, bodies: Sequence[str] = ()
) -> ModelError:
    """Return the error that names the coordinate which has most of a massless motion that nothing holds, and bodies."""
    name = names[int(np.argmax(np.abs(motion) / unit))]
    whose = ""
    if bodies:
        more = f" and {len(bodies) - 1} more" if len(bodies) > 1 else ""
        whose = f" of body '{bodies[0]}'{more}"
    return ModelError(
        f"coordinate '{name}'{whose}: the mass matrix is singular, this motion (alone or with others) moves no mass, "
        f"and {why}. Give the bodies it moves an inertia, hold it by a spring or damper, or lock it in its joint.",
        element=name,
    )  # fmt: skip


def _solved(null: Array, terms: Terms, names: tuple[str, ...]) -> tuple[Array, Array]:
    """Return X = (N^T K N)^-1 N^T K, exactly the identity on N but for rounding, and (N^T K N)^-1 N^T B."""
    pushed = null.T @ terms.B
    pushed[np.abs(pushed) <= 64.0 * EPS * (np.abs(null).T @ np.abs(terms.B))] = 0.0
    used = terms.row_stiffness != 0.0
    k, rows = terms.row_stiffness[used], terms.elastic_rows[used]
    if terms.circulatory is None and (k > 0.0).all():
        # least squares on the rows: as accurate as the springs' stiffness, however wide it spans
        rows = rows * np.sqrt(k)[:, None]
        rows = rows[(rows @ null).any(axis=1)]  # others would leave rounding where nothing acts
        rows = rows[np.argsort(-np.abs(rows).max(axis=1, initial=0.0), kind="stable")]
        own = rows @ null
        size = np.sqrt((own**2).sum(axis=0))
        q, r = np.linalg.qr(own / size)
        follows: Array = blas.dtrsm(1.0, r, q.T @ rows) / size[:, None]
        forces: Array = blas.dtrsm(1.0, r, blas.dtrsm(1.0, r, pushed / size[:, None], trans_a=1)) / size[:, None]
        return follows, forces
    square = null.T @ terms.K @ null
    size = np.sqrt(np.abs(square).sum(axis=1))
    size[size == 0.0] = 1.0
    scaled = square / size[:, None] / size
    if 1.0 / np.linalg.cond(scaled) < CANCELLING_SPRINGS:
        left = np.linalg.svd(scaled)[2][-1] / size
        raise unheld(null @ left, np.ones(len(names)), names, "the springs that hold it cancel each other")
    right = np.concatenate((null.T @ terms.K, pushed), axis=1) / size[:, None]
    solution = np.linalg.solve(scaled, right) / size[:, None]
    m = null.shape[0]
    return solution[:, :m], solution[:, m:]
