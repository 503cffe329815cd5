"""The preloads of springs and bushings of all kinds that hold a model in the pose in which it is described."""

from __future__ import annotations

from fnmatch import fnmatchcase
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from mbsvib.elements import Bushing, Maxwell, Spring, torsion_spring
from mbsvib.elements.rows import Rows
from mbsvib.elements.torsion_spring import TorsionSpring
from mbsvib.equilibrium.balance import balance
from mbsvib.equilibrium.messages import unbalanced_force
from mbsvib.equilibrium.motion import posed_model
from mbsvib.equilibrium.moved_parts import static_model, static_spring
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
Preloadable = Spring | Bushing | TorsionSpring | Maxwell

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
        part.name: {"preload": None} | ({"free_length": None} if isinstance(part, Spring) else {}) for part in springs
    }
    at = posed_model(static_model(changed(model, none)), start(model))
    wrenches = _balancing(at, balance(at), springs, [1.0] * len(springs))
    result = changed(model, {
        part.name: none[part.name] | {"preload": _as_preload(part, wrench)}
        for part, wrench in zip(springs, wrenches, strict=True)
    })  # fmt: skip
    balanced = balance(posed_model(static_model(result), at.pose))
    if balanced.strict_share > BALANCE and balanced.share > BALANCE:  # forces that are rounding balance as well
        names = ", ".join(f"'{part.name}'" for part in springs[:6]) + (", ..." if len(springs) > 6 else "")
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
    resolutions = [_resolution(_acting(part), at.size) for part in springs]
    changes: dict[str, dict[str, Any]] = {}
    for part, least, wrench in zip(springs, resolutions, _balancing(at, forces, springs, resolutions), strict=True):
        if np.abs(wrench * (1.0, 1.0, 1.0, 1 / at.size, 1 / at.size, 1 / at.size)).max() > MOST_ROUNDING * least:
            return model
        free = {"free_length": None} if isinstance(part, Spring) else {}
        changes[part.name] = free | {"preload": _as_preload(part, _preload(_acting(part)) + wrench)}
    return changed(model, changes)


def _acting(part: Preloadable) -> Spring | Bushing:
    """The line spring or bushing whose preload a part has."""
    if isinstance(part, TorsionSpring):
        bushing = torsion_spring.expand(part).springs[part.name]
        assert isinstance(bushing, Bushing)
        return bushing
    return static_spring(part) if isinstance(part, Maxwell) else part


def _preload(part: Spring | Bushing) -> Array:
    """The wrench (6,) on the second body in the pose as described, in the part's axes."""
    if isinstance(part, Spring):
        return np.array((0.0, 0.0, -part.tension, 0.0, 0.0, 0.0))
    return np.array(part.preload or np.zeros(6))


def _resolution(part: Spring | Bushing, size: float) -> float:
    """The smallest force that the rounded positions of a spring's ends resolve [N]."""
    if isinstance(part, Spring):
        return EPS * abs(part.stiffness) * size
    stiffness = np.abs(np.array(part.stiffness))
    stiffness = stiffness if stiffness.ndim == 1 else stiffness.max(axis=1)
    return EPS * float(max(stiffness[:3].max() * size, stiffness[3:].max() / size))


def _as_preload(part: Preloadable, wrench: Array) -> float | list[float]:
    if isinstance(part, Bushing):
        return [float(value) for value in wrench]
    return float(wrench[5]) if isinstance(part, TorsionSpring) else -float(wrench[2])


def _balancing(
    at: PosedModel, forces: Balance, parts: Sequence[Preloadable], weight: Sequence[float]
) -> list[Array]:
    """The wrenches (6,) on the second bodies that balance the residual, of least norm relative to the weights."""
    if not parts:
        return []
    springs = [_acting(part) for part in parts]
    bases = [_directions(part, at.size) for part in springs]
    rows = _rows(at, springs, bases)
    weights = np.repeat(weight, [len(basis) for basis in bases])
    along = forces.scale * (rows if forces.reduction.matrix is None else rows @ forces.reduction.matrix)
    size = np.linalg.lstsq((weights[:, None] * along).T, -forces.scale * forces.residual, rcond=HOLDS_NOTHING)[0]
    sizes = np.split(weights * size, np.cumsum([len(basis) for basis in bases])[:-1])
    return [basis.T @ along for basis, along in zip(bases, sizes, strict=True)]


def _selected(model: Mechanism, selection: Sequence[Any] | str | bool) -> list[Preloadable]:
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
            why = "is not a spring or bushing" if not picked else "has no stiffness at rest"
            raise ModelError(f"equilibrium: preload = {pattern!r} {why} in model '{model.name}'; name springs or "
                             f"bushings with stiffness.{'' if picked else nearest(pattern, model.springs)}",
                             element=pattern, field="preload")  # fmt: skip
        names |= dict.fromkeys(stiff)
    return [part for name in names if isinstance(part := model.springs[name], Preloadable)]


def _is_stiff(part: Any) -> bool:
    if isinstance(part, Maxwell):
        return part.static_stiffness != 0.0
    return isinstance(part, Preloadable) and bool(np.any(part.stiffness))


def _directions(part: Spring | Bushing, size: float) -> Array:
    """Wrenches on the second body (n, 6) that the spring can carry, in its axes; orthonormal with moments over size."""
    if isinstance(part, Spring):
        return np.eye(6)[2:3]
    stiffness = np.array(part.stiffness)
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
    for part, basis in zip(springs, bases, strict=True):
        ends = at.pose.number[part.first], at.pose.number[part.second]
        if isinstance(part, Spring):
            tuples.append((*ends, *part.start, *part.line, 0.0, 0.0, 0.0))
        else:
            axes = np.array(part.orientation)
            tuples += [(*ends, *part.position, *(axes @ six[:3]), *(axes @ six[3:])) for six in basis]
    return relative_motion(at.coordinates, Rows.stack(tuples)).dense(0, len(tuples))
