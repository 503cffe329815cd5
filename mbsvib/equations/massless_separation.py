"""The equations of motion where some motions move no mass: condensed, or told apart as first-order states.

Source: Campbell, Singular Systems of Differential Equations (1980), for the parts of a singular pencil.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.linalg import lapack

from mbsvib.equations.inertia import check_mass
from mbsvib.equations.massless_condensation import CANCELS, Condensation, condense, unheld
from mbsvib.equations.massless_null_motion import RANK_FACTOR, cleaned, null_space, possible, scale_of, unfelt
from mbsvib.equations.unresisted_motion import largest, unmoved
from mbsvib.errors import ModelError, SingularPoseError
from mbsvib.kinematics.loops import ZERO_ENTRY
from mbsvib.linalg.products import product
from mbsvib.linalg.qr import pivoted_qr

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Index
    from mbsvib.equations.massless_null_motion import Scale
    from mbsvib.equations.scene import Scene
    from mbsvib.kinematics.loops import Reduction
    from mbsvib.mechanism.mechanism import Mechanism

# Pivots kept and dropped closer than this leave in doubt what is massless.
RANK_GAP = 1e3
# Pivots of M, each column over what it could be, above this are no rounding.
BEYOND_DOUBT = 1e-10
# What inputs do at once is zero below this share of the terms it is the sum of.
AT_ONCE = 1e-12
_ROWS = ("inertia_factor", "elastic_rows", "body_motion", "Cq", "Cv", "Ca")


@dataclass(frozen=True, slots=True)
class Separation:
    """What became of the motions without mass, for ``explain``.

    ``condensed`` names the coordinates that follow from statics, ``first_order`` those with one state in place of two;
    ``kept`` and ``dropped`` are the smallest pivot of W that counts as mass and the largest that does not.
    ``transform`` T (n, m) leads back to all coordinates before condensation, None where nothing is condensed.
    """

    condensed: tuple[str, ...]
    first_order: tuple[str, ...]
    kept: float
    dropped: float
    transform: Array | None = None


def separate(
    scene: Scene, reduction: Reduction, found: dict[str, Any], names: tuple[str, ...], model: Mechanism,
    independent: Sequence[str] | None = None,
) -> tuple[dict[str, Any], Index, Separation | None]:  # fmt: skip
    """Return the equations of motion with the motions that move no mass told apart.

    Parameters
    ----------
    scene : Scene
        The mechanism in numbers.
    reduction : Reduction
        Its minimal coordinates.
    found : dict of str to array
        Its matrices and factors, by the names that a system has for them.
    names : tuple of str
        Names of the minimal coordinates.
    model : Mechanism
        The mechanism, for the names of its inputs and outputs.
    independent : sequence of str, optional
        Coordinates that the user wants to keep.

    Returns
    -------
    tuple of dict, array and Separation or None
        The matrices and factors; the numbers of the coordinates that stay; None where every motion moves mass.

    Raises
    ------
    ModelError
        If nothing holds a motion without mass, or an output would need the derivative of an input.
    SingularPoseError
        If it is in doubt which motions move mass.
    """
    everything = np.arange(len(names))
    if not names:
        return found, everything, None
    scale = scale_of(scene.coordinates, scene.position, reduction.independent)
    bodies = possible(scene.coordinates, reduction, scene.inertia, scale)
    shared = found["inertia_factor"][6 * len(scene.bodies) :]
    size = np.sqrt(bodies**2 + np.einsum("ij,ij->j", shared, shared))
    if _regular(found["M"], size):
        return found, everything, None
    factor = found["inertia_factor"][found["inertia_factor"].any(axis=1)]
    null, least, most = null_space(factor, size, RANK_FACTOR * scale.noise)
    if not null.shape[1]:
        check_mass(found["M"], names)
        return found, everything, None
    null = cleaned(null, scale.unit, RANK_FACTOR * scale.noise)
    check_gap(null[:, 0], scale.unit, names, least, most)
    pins = np.array([name in (independent or ()) for name in names])
    ports = list(model.outputs), list(model.inputs)
    found, condensation, slow = resolved(null, found, size, scale, names, scene.topology.bodies, ports, pins)
    if condensation is None:
        return found, everything, Separation((), slow, least, most)
    gone = tuple(names[i] for i in condensation.dependent)
    return found, condensation.kept, Separation(gone, slow, least, most, condensation.transform)


def check_gap(motion: Array, unit: Array, names: tuple[str, ...], kept: float, dropped: float) -> None:
    """Refuse a motion of which it is in doubt whether it moves mass, by the pivots of W that were kept and dropped."""
    if dropped * RANK_GAP > kept and dropped > 0.0:
        raise SingularPoseError(
            f"coordinate '{_largest(motion, unit, names)}': it is in doubt whether this motion moves mass "
            f"(pivots {kept:.1e} and {dropped:.1e}). Make tiny masses zero, or give them their size."
        )


def resolved(
    null: Array, found: dict[str, Any], size: Array, scale: Scale, names: tuple[str, ...], bodies: tuple[str, ...],
    ports: tuple[Sequence[str], Sequence[str]], pins: NDArray[np.bool_],
) -> tuple[dict[str, Any], Condensation | None, tuple[str, ...]]:  # fmt: skip
    """Return the equations of motion with motions that move no mass condensed or told apart.

    Parameters
    ----------
    null : array, shape (m, k)
        The motions.
    found : dict of str to array
        The matrices and factors, by the names that a system has for them.
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

    Returns
    -------
    tuple
        The matrices and factors; what was condensed, None where nothing is; names of the coordinates that stay and have
        one first-order state.
    """
    static, damped = unfelt(_damping_parts(found), null, scale.unit)
    condensation = None
    if static.shape[1]:
        static = cleaned(static, scale.unit, RANK_FACTOR * scale.noise)
        condensation = condense(static, found, scale.unit, names, pins, bodies)
        _check_proper(condensation.response, found, *ports, ("Cv", "Ca"))
        found = _condensed(found, condensation)
        # what follows a coordinate moves with it
        length = condensation.transform / scale.unit[:, None] * scale.unit[condensation.kept]
        moves = np.where(np.abs(length) > RANK_FACTOR * scale.noise, np.abs(condensation.transform), 0.0)
        size = size @ moves
    kept = np.arange(len(names)) if condensation is None else condensation.kept
    left = tuple(names[i] for i in kept)
    slow: tuple[str, ...] = ()
    if len(damped):
        found, slow = _first_order(found, size, len(damped), scale.unit[kept], left, scale.noise)
        _check_first_order(found, *ports)
    else:
        check_mass(found["M"], left)
    return found, condensation, slow


def _regular(mass: Array, size: Array) -> bool:
    """Whether every motion moves mass beyond doubt, which spares the look at the factors."""
    if float(size.min()) == 0.0:
        return False
    factor, failed = lapack.dpotrf(mass / size[:, None] / size)
    return not failed and float(factor.diagonal().min()) ** 2 > BEYOND_DOUBT


def _largest(motion: Array, unit: Array, names: tuple[str, ...]) -> str:
    return names[int(np.argmax(np.abs(motion) / unit))]


def _damping_parts(found: Mapping[str, Any]) -> list[Array]:
    parts = [found["elastic_rows"][found["damping"] != 0.0]]
    if found.get("gyroscopic") is not None:
        parts.append(found.get("gyroscopic_rows", found["gyroscopic"]))
    return parts


def _condensed(found: dict[str, Any], condensation: Condensation) -> dict[str, Any]:
    """Every row acts on q = T z, K = (D T)^T diag(k) (D T); what the inputs do at once goes to D and, where K is not
    symmetric, to B.
    """
    t, s = condensation.transform, condensation.response
    result = dict(found)
    for key in _ROWS:
        result[key] = found[key] @ t
    rows = result["elastic_rows"]
    rows[np.abs(rows) <= ZERO_ENTRY * len(t) * largest(found["elastic_rows"], t)] = 0.0
    result["elastic_rows"] = _resting(rows, found, condensation.kept)
    stays = result["elastic_rows"].any(axis=1)
    for key in ("elastic_rows", "stiffness", "damping", "row_owner"):
        result[key] = (result if key == "elastic_rows" else found)[key][stays]
    b = t.T @ found["B"]
    for key in ("gyroscopic", "circulatory"):
        if found.get(key) is not None:
            result[key] = t.T @ found[key] @ t
    result["M"] = result["inertia_factor"].T @ result["inertia_factor"]
    result["C"] = product(result["elastic_rows"], result["damping"])
    result["K"] = product(result["elastic_rows"], result["stiffness"])
    if result.get("gyroscopic") is not None:
        result["C"] = result["C"] + result["gyroscopic"]
    if result.get("circulatory") is not None:
        result["K"] = result["K"] + result["circulatory"]
        b = b - t.T @ found["K"] @ s
    result["B"], result["D"] = b, found["D"] + found["Cq"] @ s
    return result


def _resting(rows: Array, found: Mapping[str, Any], kept: Index) -> Array:
    """Condensed rows without their rounding in motions that leave the springs as they are.

    In series with a soft spring a stiff one changes its length so little that rounding would hold rigid-body motions.
    """
    stiff, acts = found["stiffness"] != 0.0, (found["stiffness"] != 0.0) | (found["damping"] != 0.0)
    result = rows.copy()
    for which, all_rows in ((stiff, found["elastic_rows"][stiff]), (acts & ~stiff, found["elastic_rows"][acts])):
        result[which] = unmoved(rows[which], all_rows, kept)
    return result


def _first_order(
    found: dict[str, Any], size: Array, count: int, unit: Array, names: tuple[str, ...], noise: float
) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Add the massless motions that dampers feel, each with one at a coordinate of its own."""
    factor = found["inertia_factor"]
    null = null_space(factor[factor.any(axis=1)], size, 0.0, rank=len(names) - count)[0]
    null = cleaned(null, unit, RANK_FACTOR * noise)
    own = np.sort(pivoted_qr((null / unit[:, None]).T)[1][:count])
    null = null @ np.linalg.inv(null[own])
    null[own] = np.eye(count)
    null = np.where(np.abs(null) / unit[:, None] > RANK_FACTOR * noise / unit[own], null, 0.0)
    square = null.T @ found["C"] @ null
    scale = np.sqrt(np.abs(square).sum(axis=1))
    scale[scale == 0.0] = 1.0
    scaled = square / scale[:, None] / scale
    if 1.0 / np.linalg.cond(scaled) < CANCELS:
        worst = null @ (np.linalg.svd(scaled)[2][-1] / scale)
        spins = found.get("gyroscopic") is not None
        raise unheld(worst, unit, names, "spin alone ties it to others" if spins else
                     "the dampers that act on it cancel each other")  # fmt: skip
    others = np.setdiff1d(np.arange(len(names)), own)
    check_mass(found["M"][np.ix_(others, others)], tuple(names[i] for i in others))
    return found | {"massless": count, "null_inertia": null}, tuple(names[i] for i in own)


def _check_proper(
    response: Array, found: Mapping[str, Any], outputs: Sequence[str], inputs: Sequence[str], orders: Sequence[str]
) -> None:
    """Refuse outputs that would see the rate at which an input changes."""
    for key in orders:
        seen = found[key] @ response
        felt = np.abs(seen) > AT_ONCE * (np.abs(found[key]) @ np.abs(response))
        if felt.any():
            i, j = np.argwhere(felt)[0].tolist()
            what = "displacement" if key == "Cv" else "displacement or velocity"
            raise ModelError(
                f"output '{outputs[i]}' would need the derivative of input '{inputs[j]}', which acts on a motion "
                f"without mass; ask for its {what}, or give what moves a mass.",
                element=outputs[i], field="quantity",
            )  # fmt: skip


def _check_first_order(found: Mapping[str, Any], outputs: Sequence[str], inputs: Sequence[str]) -> None:
    """Refuse accelerations of motions without mass whose velocity the inputs change at once."""
    null = found["null_inertia"]
    pushed = null.T @ found["B"]
    pushed[np.abs(pushed) <= AT_ONCE * (np.abs(null).T @ np.abs(found["B"]))] = 0.0
    if pushed.any():
        at_once = null @ lapack.dgesv(null.T @ found["C"] @ null, pushed)[2]
        _check_proper(at_once, found, outputs, inputs, ("Ca",))
