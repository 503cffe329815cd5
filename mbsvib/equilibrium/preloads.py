"""The preloads of springs and bushings that hold a model in the pose in which it is described."""

from __future__ import annotations

from fnmatch import fnmatchcase
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from mbsvib.elements import Bushing, Spring
from mbsvib.elements.rows import Rows
from mbsvib.equilibrium.balance import balance
from mbsvib.equilibrium.messages import unbalanced_force
from mbsvib.equilibrium.motion import posed_model
from mbsvib.equilibrium.moved_parts import static_model
from mbsvib.equilibrium.pose import start
from mbsvib.errors import EquilibriumError, ModelError, nearest
from mbsvib.kinematics.relative_motion import relative_motion
from mbsvib.linalg.products import eigenrows
from mbsvib.linalg.rank import BALANCE, EPS, HOLDS_NOTHING
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.mechanism.rebuilding import changed

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.equilibrium.balance import Balance
    from mbsvib.equilibrium.motion import PosedModel

M = TypeVar("M", bound=Mechanism)

# Accepted residual of an equilibrium as a share of the forces, and the largest correction in units of rounding.
RESIDUAL, MOST_ROUNDING = 1e-12, 1e4


def preloaded(model: M, selection: Sequence[Any] | str | bool) -> M:
    """Return the model with the preloads that hold it; see ``Model.equilibrium``.

    The preloads have the least norm, with moments divided by the size of the model.

    Raises
    ------
    ModelError
        If a name or pattern selects no spring, or only springs without stiffness.
    EquilibriumError
        If no preload of these holds the pose.
    """
    springs = _selected(model, selection)
    none: dict[str, dict[str, Any]] = {
        spring.name: {"preload": None} | ({"free_length": None} if isinstance(spring, Spring) else {})
        for spring in springs
    }
    at = posed_model(static_model(changed(model, none)), start(model))
    wrenches = _balancing(at, balance(at), springs, [1.0] * len(springs))
    result = changed(model, {
        spring.name: none[spring.name] | {"preload": _as_preload(spring, wrench)}
        for spring, wrench in zip(springs, wrenches, strict=True)
    })  # fmt: skip
    balanced = balance(posed_model(static_model(result), at.pose))
    if balanced.strict_share > BALANCE and balanced.share > BALANCE:  # forces that are rounding balance as well
        names = ", ".join(f"'{spring.name}'" for spring in springs[:6]) + (", ..." if len(springs) > 6 else "")
        text, details = unbalanced_force(at, balanced)
        raise EquilibriumError(
            f"model '{model.name}': no preload of {names} holds the given pose; {text}. Choose springs that act along "
            f"it as well, or let model.equilibrium() find another pose.", **details,
        )  # fmt: skip
    return result


def without_rounding(model: M) -> M:
    """Return a model in equilibrium with preloads that correct the rounding of its positions.

    The length L of a spring of stiffness k resolves no force below eps k L. Where that is more than the check of
    statics accepts, the spring is given its force as a preload.
    """
    at = posed_model(static_model(model), start(model))
    forces = balance(at)
    if forces.strict_share <= RESIDUAL:
        return model
    springs = _selected(model, True) if any(map(_is_stiff, model.springs.values())) else []
    resolutions = [_resolution(spring, at.size) for spring in springs]
    changes: dict[str, dict[str, Any]] = {}
    for spring, least, wrench in zip(springs, resolutions, _balancing(at, forces, springs, resolutions), strict=True):
        if np.abs(wrench * (1.0, 1.0, 1.0, 1 / at.size, 1 / at.size, 1 / at.size)).max() > MOST_ROUNDING * least:
            return model
        before = np.array(spring.preload or np.zeros(6)) if isinstance(spring, Bushing) else \
            np.array((0.0, 0.0, -spring.tension, 0.0, 0.0, 0.0))  # fmt: skip
        free = {"free_length": None} if isinstance(spring, Spring) else {}
        changes[spring.name] = free | {"preload": _as_preload(spring, before + wrench)}
    return changed(model, changes)


def _resolution(spring: Spring | Bushing, size: float) -> float:
    """The smallest force that the rounded positions of a spring's ends resolve [N]."""
    if isinstance(spring, Spring):
        return EPS * abs(spring.stiffness) * size
    stiffness = np.abs(np.array(spring.stiffness))
    stiffness = stiffness if stiffness.ndim == 1 else stiffness.max(axis=1)
    return EPS * float(max(stiffness[:3].max() * size, stiffness[3:].max() / size))


def _as_preload(spring: Spring | Bushing, wrench: Array) -> float | list[float]:
    return -float(wrench[2]) if isinstance(spring, Spring) else [float(value) for value in wrench]


def _balancing(
    at: PosedModel, forces: Balance, springs: Sequence[Spring | Bushing], weight: Sequence[float]
) -> list[Array]:
    """The wrenches (6,) on the second bodies that balance the residual, of least norm relative to the weights."""
    if not springs:
        return []
    bases = [_directions(spring, at.size) for spring in springs]
    rows = _rows(at, springs, bases)
    weights = np.repeat(weight, [len(basis) for basis in bases])
    along = forces.scale * (rows if forces.reduction.matrix is None else rows @ forces.reduction.matrix)
    size = np.linalg.lstsq((weights[:, None] * along).T, -forces.scale * forces.residual, rcond=HOLDS_NOTHING)[0]
    parts = np.split(weights * size, np.cumsum([len(basis) for basis in bases])[:-1])
    return [basis.T @ part for basis, part in zip(bases, parts, strict=True)]


def _selected(model: Mechanism, selection: Sequence[Any] | str | bool) -> list[Spring | Bushing]:
    """The springs that are named or match a pattern, without those that have no stiffness."""
    if isinstance(selection, bool):
        patterns = ["*"] if selection else []
    else:
        items = [selection] if isinstance(selection, str) or not hasattr(selection, "__iter__") else list(selection)
        patterns = [item if isinstance(item, str) else getattr(item, "name", str(item)) for item in items]
    names: dict[str, None] = {}
    for pattern in patterns:
        picked = [name for name in model.springs if name == pattern or fnmatchcase(name, pattern)]
        stiff = [name for name in picked if _is_stiff(model.springs[name])]
        if not stiff:
            why = "is not a spring or bushing" if not picked else "has no stiffness"
            raise ModelError(f"equilibrium: preload = {pattern!r} {why} of model '{model.name}'."
                             f"{'' if picked else nearest(pattern, model.springs)}",
                             element=pattern, field="preload")  # fmt: skip
        names |= dict.fromkeys(stiff)
    return [spring for name in names if isinstance(spring := model.springs[name], (Spring, Bushing))]


def _is_stiff(part: Any) -> bool:
    if isinstance(part, Bushing):
        return bool(np.any(part.stiffness))
    return isinstance(part, Spring) and part.stiffness != 0.0


def _directions(spring: Spring | Bushing, size: float) -> Array:
    """Wrenches on the second body (n, 6) that the spring can carry, in its axes; orthonormal with moments over size."""
    if isinstance(spring, Spring):
        return np.eye(6)[2:3]
    stiffness = np.array(spring.stiffness)
    if stiffness.ndim == 1:
        units = np.eye(6)[stiffness != 0.0]
    else:
        values, vectors = eigenrows(stiffness)
        units = vectors[values != 0.0]
    scale = np.array([1.0] * 3 + [1.0 / size] * 3)
    return np.asarray(np.linalg.qr((units * scale).T)[0].T / scale)


def _rows(at: PosedModel, springs: Sequence[Spring | Bushing], bases: list[Array]) -> Array:
    """The generalized forces of unit wrenches along the joint coordinates of the tree (wrenches, n)."""
    tuples: list[tuple[float, ...]] = []
    for spring, basis in zip(springs, bases, strict=True):
        ends = at.pose.number[spring.first], at.pose.number[spring.second]
        if isinstance(spring, Spring):
            tuples.append((*ends, *spring.start, *spring.line, 0.0, 0.0, 0.0))
        else:
            axes = np.array(spring.orientation)
            tuples += [(*ends, *spring.position, *(axes @ six[:3]), *(axes @ six[3:])) for six in basis]
    return relative_motion(at.coordinates, Rows.stack(tuples)).dense(0, len(tuples))
