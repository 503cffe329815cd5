"""The equations of motion where some motions move no mass: condensed, or told apart as first-order states.

Source: Campbell, Singular Systems of Differential Equations (1980), for the parts of a singular pencil.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import lapack

from mbsvib.equations.equations import Separation
from mbsvib.equations.inertia import check_mass
from mbsvib.equations.massless_condensation import Condensation, condense, unheld
from mbsvib.equations.massless_null_motion import cleaned, null_space, possible, scale_of, unfelt
from mbsvib.equations.terms import Terms
from mbsvib.equations.unresisted_motion import largest, unmoved
from mbsvib.errors import ModelError, SingularPoseError
from mbsvib.linalg.products import weighted_gram
from mbsvib.linalg.qr import pivoted_qr
from mbsvib.linalg.rank import CANCELLING_SPRINGS, CERTAIN_MASS, RANK_FACTOR, ZERO_FEEDTHROUGH, ZERO_PRODUCT

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Index
    from mbsvib.equations.draft import Draft
    from mbsvib.equations.massless_null_motion import Scale

# Pivots kept and dropped closer than this leave in doubt what is massless.
RANK_GAP = 1e3


def separated(draft: Draft) -> Draft:
    """Return equations of motion with the motions that move no mass told apart.

    Parameters
    ----------
    draft : Draft
        The equations, in which such motions may be among the coordinates.

    Returns
    -------
    Draft
        The equations in the coordinates that stay; ``separation`` is None where every motion moves mass.

    Raises
    ------
    ModelError
        If nothing holds a motion without mass, or an output would need the derivative of an input.
    SingularPoseError
        If it is in doubt which motions move mass.
    """
    scene, terms, names, model = draft.scene, draft.terms, draft.names, draft.model
    if not names:
        return draft
    scale = scale_of(scene.coordinates, scene.position, draft.reduction.independent)
    bodies = possible(scene.coordinates, draft.reduction, scene.inertia, scale)
    shared = terms.inertia_factor[6 * len(scene.bodies) :]
    size = np.sqrt(bodies**2 + np.einsum("ij,ij->j", shared, shared))
    if _regular(terms.M, size):
        return draft
    factor = terms.inertia_factor[terms.inertia_factor.any(axis=1)]
    null, least, most = null_space(factor, size, RANK_FACTOR * scale.noise)
    if not null.shape[1]:
        check_mass(terms.M, names)
        return draft
    null = cleaned(null, scale.unit, RANK_FACTOR * scale.noise)
    check_gap(null[:, 0], scale.unit, names, least, most)
    pins = np.array([name in draft.pins for name in names])
    ports = list(model.outputs), list(model.inputs)
    terms, condensation, slow = resolved(null, terms, size, scale, names, scene.topology.bodies, ports, pins)
    if condensation is None:
        return replace(draft, terms=terms, separation=Separation((), slow, least, most))
    gone = tuple(names[i] for i in condensation.dependent)
    mixed = bool(condensation.motions[condensation.kept].any())
    kept = tuple([draft.kept[i] for i in condensation.kept.tolist()])
    return replace(draft, terms=terms, kept=kept,
                   separation=Separation(gone, slow, least, most, condensation.transform, mixed))  # fmt: skip


def check_gap(motion: Array, unit: Array, names: tuple[str, ...], kept: float, dropped: float) -> None:
    """Refuse a motion of which it is in doubt whether it moves mass, by the pivots of W that were kept and dropped."""
    if dropped * RANK_GAP > kept and dropped > 0.0:
        raise SingularPoseError(
            f"coordinate '{_largest(motion, unit, names)}': it is in doubt whether this motion moves mass "
            f"(pivots {kept:.1e} and {dropped:.1e}). Make tiny masses zero, or give them their size."
        )


def resolved(
    null: Array, terms: Terms, size: Array, scale: Scale, names: tuple[str, ...], bodies: tuple[str, ...],
    ports: tuple[Sequence[str], Sequence[str]], pins: NDArray[np.bool_], acting: Mapping[str, Array] | None = None,
) -> tuple[Terms, Condensation | None, tuple[str, ...]]:  # fmt: skip
    """Return the equations of motion with motions that move no mass condensed or told apart.

    Parameters
    ----------
    null : array, shape (m, k)
        The motions.
    terms : Terms
        The matrices and factors.
    size : array, shape (m,)
        What each coordinate could move at most [sqrt kg m per unit].
    scale : Scale
        What counts as large.
    names : tuple of str
        Names of the coordinates.
    bodies : tuple of str
        Names of the bodies, for refusals.
    ports : tuple of sequences of str
        Names of the outputs and of the inputs.
    pins : array, shape (m,)
        Coordinates that the user wants to keep.
    acting : mapping of str to array, shape (rows, m), optional
        Forces of ``gyroscopic`` and ``circulatory`` terms in other directions than those of the coordinates.

    Returns
    -------
    tuple
        The matrices and factors; what was condensed, None where nothing is; names of the coordinates that stay and have
        one first-order state.
    """
    static, damped = unfelt(_damping_parts(terms, acting or {}), null, scale.unit)
    condensation = None
    if static.shape[1]:
        static = cleaned(static, scale.unit, RANK_FACTOR * scale.noise)
        condensation = condense(static, terms, scale.unit, names, pins, bodies, acting)
        _check_proper(condensation.response, terms, *ports, ("Cv", "Ca"))
        terms = _condensed(terms, condensation, scale.unit)
        # what follows a coordinate moves with it
        length = condensation.transform / scale.unit[:, None] * scale.unit[condensation.kept]
        moves = np.where(np.abs(length) > RANK_FACTOR * scale.noise, np.abs(condensation.transform), 0.0)
        size = size @ moves
    kept = np.arange(len(names)) if condensation is None else condensation.kept
    left = tuple(names[i] for i in kept)
    slow: tuple[str, ...] = ()
    if len(damped):
        terms, slow = _first_order(terms, size, len(damped), scale.unit[kept], left, scale.noise)
        _check_first_order(terms, *ports)
    else:
        check_mass(terms.M, left)
    return terms, condensation, slow


def _regular(mass: Array, size: Array) -> bool:
    """Whether every motion moves mass beyond doubt, which spares the look at the factors."""
    if float(size.min()) == 0.0:
        return False
    factor, failed = lapack.dpotrf(mass / size[:, None] / size)
    return not failed and float(factor.diagonal().min()) ** 2 > CERTAIN_MASS


def _largest(motion: Array, unit: Array, names: tuple[str, ...]) -> str:
    return names[int(np.argmax(np.abs(motion) / unit))]


def _damping_parts(terms: Terms, acting: Mapping[str, Array]) -> list[Array]:
    parts = [terms.elastic_rows[terms.row_damping != 0.0]]
    if terms.gyroscopic is not None:
        parts.append(acting.get("gyroscopic", terms.gyroscopic))
    return parts


def _condensed(terms: Terms, condensation: Condensation, unit: Array) -> Terms:
    """Every row acts on q = T z, K = (D T)^T diag(k) (D T); what the inputs do at once goes to D and, where K is not
    symmetric, to B.
    """
    t, s = condensation.transform, condensation.response
    rows = terms.elastic_rows @ t
    rows[np.abs(rows) <= ZERO_PRODUCT * len(t) * (np.abs(terms.elastic_rows) @ largest(t, unit))] = 0.0
    rows = _resting(rows, terms, condensation.kept)
    stays = rows.any(axis=1)
    rows, k, c, factor = rows[stays], terms.row_stiffness[stays], terms.row_damping[stays], terms.inertia_factor @ t
    gyroscopic, circulatory = (None if matrix is None else t.T @ matrix @ t
                               for matrix in (terms.gyroscopic, terms.circulatory))  # fmt: skip
    b = t.T @ terms.B
    return Terms(
        factor.T @ factor, weighted_gram(rows, c), weighted_gram(rows, k),
        b if circulatory is None else b - t.T @ terms.K @ s,
        terms.Cq @ t, terms.Cv @ t, terms.Ca @ t, terms.D + terms.Cq @ s, factor, rows, k, c, terms.row_owner[stays],
        terms.body_motion @ t,
    ).with_antisymmetric(gyroscopic, circulatory)  # fmt: skip


def _resting(rows: Array, terms: Terms, kept: Index) -> Array:
    """Condensed rows without their rounding in motions that leave the springs as they are.

    In series with a soft spring a stiff one changes its length so little that rounding would hold rigid-body motions.
    """
    stiff, acts = terms.row_stiffness != 0.0, (terms.row_stiffness != 0.0) | (terms.row_damping != 0.0)
    result = rows.copy()
    for which, all_rows in ((stiff, terms.elastic_rows[stiff]), (acts & ~stiff, terms.elastic_rows[acts])):
        result[which] = unmoved(rows[which], all_rows, kept)
    return result


def _first_order(
    terms: Terms, size: Array, count: int, unit: Array, names: tuple[str, ...], noise: float
) -> tuple[Terms, tuple[str, ...]]:
    """Add the massless motions that dampers feel, each with one at a coordinate of its own."""
    factor = terms.inertia_factor
    null = null_space(factor[factor.any(axis=1)], size, 0.0, rank=len(names) - count)[0]
    null = cleaned(null, unit, RANK_FACTOR * noise)
    own = np.sort(pivoted_qr((null / unit[:, None]).T)[1][:count])
    null = null @ np.linalg.inv(null[own])
    null[own] = np.eye(count)
    null = np.where(np.abs(null) / unit[:, None] > RANK_FACTOR * noise / unit[own], null, 0.0)
    square = null.T @ terms.C @ null
    scale = np.sqrt(np.abs(square).sum(axis=1))
    scale[scale == 0.0] = 1.0
    scaled = square / scale[:, None] / scale
    if 1.0 / np.linalg.cond(scaled) < CANCELLING_SPRINGS:
        worst = null @ (np.linalg.svd(scaled)[2][-1] / scale)
        spins = terms.gyroscopic is not None
        raise unheld(worst, unit, names, "spin alone ties it to others" if spins else
                     "the dampers that act on it cancel each other")  # fmt: skip
    others = np.setdiff1d(np.arange(len(names)), own)
    check_mass(terms.M[np.ix_(others, others)], tuple(names[i] for i in others))
    return replace(terms, massless=count, null_inertia=null), tuple(names[i] for i in own)


def _check_proper(
    response: Array, terms: Terms, outputs: Sequence[str], inputs: Sequence[str], orders: Sequence[str]
) -> None:
    """Refuse outputs that would see the rate at which an input changes."""
    for key in orders:
        rows = getattr(terms, key)
        seen = rows @ response
        felt = np.abs(seen) > ZERO_FEEDTHROUGH * (np.abs(rows) @ np.abs(response))
        if felt.any():
            i, j = np.argwhere(felt)[0].tolist()
            what = "displacement" if key == "Cv" else "displacement or velocity"
            raise ModelError(
                f"output '{outputs[i]}' would need the derivative of input '{inputs[j]}', which acts on a motion "
                f"without mass; ask for its {what}, or give what moves a mass.",
                element=outputs[i], field="quantity",
            )  # fmt: skip


def _check_first_order(terms: Terms, outputs: Sequence[str], inputs: Sequence[str]) -> None:
    """Refuse accelerations of motions without mass whose velocity the inputs change at once."""
    null = terms.null_inertia
    assert null is not None
    pushed = null.T @ terms.B
    pushed[np.abs(pushed) <= ZERO_FEEDTHROUGH * (np.abs(null).T @ np.abs(terms.B))] = 0.0
    if pushed.any():
        at_once = null @ lapack.dgesv(null.T @ terms.C @ null, pushed)[2]
        _check_proper(at_once, terms, outputs, inputs, ("Ca",))
