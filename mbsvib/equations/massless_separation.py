"""Separation of massless motions: static condensation, or first-order states.

Source: Campbell, Singular Systems of Differential Equations (1980), for the parts of a singular pencil.

Static condensation of motions with neither mass nor damping: q = T z + S u.

With the motions N, N^T (K q - B u) = 0 at all times, so that X = (N^T K N)^-1 N^T K gives their amplitudes for the
coordinates z. These keep their names and meaning (T is the identity on them), and the rows D of springs become D T.
M S and C S are zero, so that no derivative of u occurs.

Source: Guyan, AIAA J. 3 (1965) 380, which is exact here: no mass and no damper acts on the condensed motions.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import blas, lapack

from mbsvib.common.arrays import Array, Bools, Index
from mbsvib.equations.draft import Draft
from mbsvib.equations.equations import Separation
from mbsvib.equations.inertia import check_mass
from mbsvib.equations.matrices import Terms
from mbsvib.equations.unresisted_motion import (
    Scale,
    inertia_bounds,
    null_space,
    rounding_scale,
    scale_of,
    unresisted,
    without_free_motions,
    without_rounding,
)
from mbsvib.errors import ModelError, SingularPoseError
from mbsvib.linalg.products import weighted_gram
from mbsvib.linalg.qr import pivoted_qr
from mbsvib.linalg.rank import (
    CANCELLING_SPRINGS,
    CERTAIN_MASS,
    EPS,
    MOVES_NOTHING,
    RANK_FACTOR,
    ZERO_FEEDTHROUGH,
    ZERO_PRODUCT,
    ZERO_SUM,
)

# Smallest ratio of the last pivot that counts as mass to the first that counts as zero.
RANK_GAP = 1e3


def separated(draft: Draft) -> Draft:
    """Return equations of motion with massless motions condensed or separated; ``separation`` is None without any."""
    scene, terms, names, model = draft.scene, draft.terms, draft.names, draft.model
    if not names:
        return draft
    scale = scale_of(scene.coordinates, scene.position, draft.reduction.independent)
    bodies = inertia_bounds(scene.coordinates, draft.reduction, scene.inertia, scale)
    shared = terms.inertia_factor[6 * len(scene.bodies) :]
    size = np.sqrt(bodies**2 + np.einsum("ij,ij->j", shared, shared))
    if _all_have_mass(terms.M, size):
        return draft
    factor = terms.inertia_factor[terms.inertia_factor.any(axis=1)]
    null, smallest, largest = null_space(factor, size, RANK_FACTOR * scale.noise)
    if not null.shape[1]:
        check_mass(terms.M, names)
        return draft
    null = without_rounding(null, scale.unit, RANK_FACTOR * scale.noise)
    check_gap(null[:, 0], scale.unit, names, smallest, largest)
    required = np.array([name in draft.independent for name in names])
    ports = list(model.outputs), list(model.inputs)
    before = terms
    terms, condensation, first_order = separate_massless(null, terms, size, scale, names, scene.topology.bodies, ports,
                                                         required)  # fmt: skip
    if condensation is None:
        return replace(draft, terms=terms, separation=Separation((), first_order, smallest, largest))
    condensed = tuple(names[i] for i in condensation.dependent)
    mixed = bool(condensation.motions[condensation.remaining].any())
    minimal = tuple([draft.minimal[i] for i in condensation.remaining.tolist()])
    touched = _touched(before, condensation.motions, *ports)
    separation = Separation(condensed, first_order, smallest, largest, condensation.transform, mixed, *touched,
                            condensation.motions)
    return replace(draft, terms=terms, minimal=minimal, separation=separation)


def _touched(
    terms: Terms, motions: Array, outputs: Sequence[str], inputs: Sequence[str]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The inputs that load motions (m, k) and the outputs that see them."""
    acts, *sees = (np.asarray(np.abs(rows @ motions) > ZERO_SUM * (np.abs(rows) @ np.abs(motions))).any(axis=1)
                   for rows in (terms.B.T, terms.Cq, terms.Cv, terms.Ca))  # fmt: skip
    seen = np.asarray(sees).any(axis=0)
    return (tuple([inputs[k] for k in np.flatnonzero(acts).tolist()]),
            tuple([outputs[k] for k in np.flatnonzero(seen).tolist()]))


def check_gap(motion: Array, unit: Array, names: tuple[str, ...], smallest: float, largest: float) -> None:
    """Refuse a motion if the smallest pivot of W that counts as mass is close to the largest that counts as zero."""
    if largest * RANK_GAP > smallest and largest > 0.0:
        raise SingularPoseError(
            f"coordinate '{_largest_coordinate(motion, unit, names)}': it is in doubt whether this motion moves mass "
            f"(pivots {smallest:.1e} and {largest:.1e}). Make tiny masses zero, or give them their size."
        )


def separate_massless(
    null: Array, terms: Terms, size: Array, scale: Scale, names: tuple[str, ...], bodies: tuple[str, ...],
    ports: tuple[Sequence[str], Sequence[str]], required: Bools,
    force_rows: Mapping[str, Array] | None = None,
) -> tuple[Terms, Condensation | None, tuple[str, ...]]:  # fmt: skip
    """Return the equations of motion with massless motions condensed or separated.

    ``null`` (m, k): the motions. ``size`` (m,): upper bounds of the columns of W [sqrt kg m per unit]. ``ports``: names
    of the outputs and of the inputs. ``required`` (m,): coordinates that must remain. ``force_rows`` has rows (rows, m)
    of ``gyroscopic`` and ``circulatory`` forces, by default those along the coordinates. Returns the terms, the
    condensation or None, and the names of remaining coordinates with one first-order state.
    """
    static, damped = unresisted(_damping_parts(terms, force_rows or {}), null, scale.unit)
    condensation = None
    if static.shape[1]:
        static = without_rounding(static, scale.unit, RANK_FACTOR * scale.noise)
        condensation = condense(static, terms, scale.unit, names, required, bodies, force_rows)
        _check_proper(condensation.response, terms, *ports, ("Cv", "Ca"))
        terms = _condensed(terms, condensation, scale.unit)
        # the dependent coordinates move with the remaining ones
        length = condensation.transform / scale.unit[:, None] * scale.unit[condensation.remaining]
        size = size @ np.where(np.abs(length) > RANK_FACTOR * scale.noise, np.abs(condensation.transform), 0.0)
    remaining = np.arange(len(names)) if condensation is None else condensation.remaining
    remaining_names = tuple(names[i] for i in remaining)
    first_order: tuple[str, ...] = ()
    if len(damped):
        unit = scale.unit[remaining]
        terms, first_order = _first_order(terms, size, len(damped), unit, remaining_names, scale.noise)
        _check_first_order(terms, *ports)
    else:
        check_mass(terms.M, remaining_names)
    return terms, condensation, first_order


def _all_have_mass(mass: Array, size: Array) -> bool:
    """Whether the Cholesky pivots of M are certainly not zero; then the factors need no rank decision."""
    if float(size.min()) == 0.0:
        return False
    factor, failed = lapack.dpotrf(mass / size[:, None] / size)
    return not failed and float(factor.diagonal().min()) ** 2 > CERTAIN_MASS


def _largest_coordinate(motion: Array, unit: Array, names: tuple[str, ...]) -> str:
    return names[int(np.argmax(np.abs(motion) / unit))]


def _damping_parts(terms: Terms, force_rows: Mapping[str, Array]) -> list[Array]:
    """Rows of dampers and gyroscopic forces."""
    parts = [terms.elastic_rows[terms.row_damping != 0.0]]
    if terms.gyroscopic is not None:
        parts.append(force_rows.get("gyroscopic", terms.gyroscopic))
    return parts


def _condensed(terms: Terms, condensation: Condensation, unit: Array) -> Terms:
    """The terms for q = T z, K = (D T)^T diag(k) (D T); S adds to D and, if K is not symmetric, to B."""
    t, s = condensation.transform, condensation.response
    largest = ZERO_PRODUCT * len(t) * rounding_scale(t, unit)

    def moved(rows: Array) -> Array:
        """Rows in the remaining coordinates, with zeros for rounding errors."""
        result: Array = rows @ t
        result[np.abs(result) <= np.abs(rows) @ largest] = 0.0
        return result

    rows = _without_rigid_rounding(moved(terms.elastic_rows), terms, condensation.remaining)
    nonzero = rows.any(axis=1)
    rows, k, c = rows[nonzero], terms.row_stiffness[nonzero], terms.row_damping[nonzero]
    factor = terms.inertia_factor @ t
    gyroscopic, circulatory = (None if matrix is None else t.T @ matrix @ t
                               for matrix in (terms.gyroscopic, terms.circulatory))  # fmt: skip
    b = t.T @ terms.B
    return Terms(
        factor.T @ factor, weighted_gram(rows, c), weighted_gram(rows, k),
        b if circulatory is None else b - t.T @ terms.K @ s,
        moved(terms.Cq), moved(terms.Cv), moved(terms.Ca), terms.D + terms.Cq @ s, factor, rows, k, c,
        terms.row_owner[nonzero], terms.body_motion @ t,
    ).with_antisymmetric(gyroscopic, circulatory)  # fmt: skip


def _without_rigid_rounding(rows: Array, terms: Terms, remaining: Index) -> Array:
    """Condensed rows without rounding errors in motions that deform no spring.

    A stiff spring in series with a soft one deforms so little that its rounding error would resist rigid-body motions.
    """
    stiff, acts = terms.row_stiffness != 0.0, (terms.row_stiffness != 0.0) | (terms.row_damping != 0.0)
    result = rows.copy()
    for which, all_rows in ((stiff, terms.elastic_rows[stiff]), (acts & ~stiff, terms.elastic_rows[acts])):
        result[which] = without_free_motions(rows[which], all_rows, remaining)
    return result


def _first_order(
    terms: Terms, size: Array, count: int, unit: Array, names: tuple[str, ...], noise: float
) -> tuple[Terms, tuple[str, ...]]:
    """The terms with the damped massless motions, each with one in a coordinate in which the others are zero."""
    factor = terms.inertia_factor
    null = null_space(factor[factor.any(axis=1)], size, 0.0, rank=len(names) - count)[0]
    null = without_rounding(null, unit, RANK_FACTOR * noise)
    independent = np.sort(pivoted_qr((null / unit[:, None]).T)[1][:count])
    null = null @ np.linalg.inv(null[independent])
    null[independent] = np.eye(count)
    null = np.where(np.abs(null) / unit[:, None] > RANK_FACTOR * noise / unit[independent], null, 0.0)
    square = null.T @ terms.C @ null
    scale = np.sqrt(np.abs(square).sum(axis=1))
    scale[scale == 0.0] = 1.0
    scaled = square / scale[:, None] / scale
    if 1.0 / np.linalg.cond(scaled) < CANCELLING_SPRINGS:
        worst = null @ (np.linalg.svd(scaled)[2][-1] / scale)
        reason = "the dampers that act on it cancel each other" if terms.gyroscopic is None else \
            "spin or cross-coupling alone ties it to others"  # fmt: skip
        raise massless_motion_error(worst, unit, names, reason)
    others = np.setdiff1d(np.arange(len(names)), independent)
    check_mass(terms.M[np.ix_(others, others)], tuple(names[i] for i in others))
    return replace(terms, massless=count, null_inertia=null), tuple(names[i] for i in independent)


def _check_proper(
    response: Array, terms: Terms, outputs: Sequence[str], inputs: Sequence[str], orders: Sequence[str]
) -> None:
    """Refuse outputs that depend on the derivative of an input."""
    for key in orders:
        rows = getattr(terms, key)
        feedthrough = rows @ response
        nonzero = np.abs(feedthrough) > ZERO_FEEDTHROUGH * (np.abs(rows) @ np.abs(response))
        if nonzero.any():
            i, j = np.argwhere(nonzero)[0].tolist()
            quantity = "displacement" if key == "Cv" else "displacement or velocity"
            raise ModelError(
                f"output '{outputs[i]}' would need the derivative of input '{inputs[j]}', which acts on a motion "
                f"without mass; use its {quantity} as output, or give the bodies that move a mass.",
                element=outputs[i], field="quantity",
            )  # fmt: skip


def _check_first_order(terms: Terms, outputs: Sequence[str], inputs: Sequence[str]) -> None:
    """Refuse accelerations of massless motions whose velocity depends directly on an input."""
    null = terms.null_inertia
    assert null is not None
    forces = null.T @ terms.B
    forces[np.abs(forces) <= ZERO_FEEDTHROUGH * (np.abs(null).T @ np.abs(terms.B))] = 0.0
    if forces.any():
        velocity = null @ lapack.dgesv(null.T @ terms.C @ null, forces)[2]
        _check_proper(velocity, terms, outputs, inputs, ("Ca",))


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
    null: Array, terms: Terms, unit: Array, names: tuple[str, ...], required: Bools,
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
