"""The preloads of springs and bushings that hold a model in the pose in which it is described."""

from __future__ import annotations

from fnmatch import fnmatchcase
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from mbsvib.elements import Bushing, Spring
from mbsvib.elements.rows import Rows
from mbsvib.equilibrium.balance import balance
from mbsvib.equilibrium.messages import lacking
from mbsvib.equilibrium.motion import stance
from mbsvib.equilibrium.moved_parts import bare
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
    from mbsvib.equilibrium.motion import Stance

M = TypeVar("M", bound=Mechanism)

# Poses of equilibrium are settled to this share of the forces; corrections larger than so many roundings are none.
SETTLED, MOST_ROUNDING = 1e-12, 1e4


def preloaded(model: M, chosen: Sequence[Any] | str | bool) -> M:
    """Return the model with the preloads that hold it; see ``Model.equilibrium``.

    Parameters
    ----------
    model : Mechanism
        The model in the pose to be held.
    chosen : sequence of str, or True
        Names or patterns of springs and bushings, or all of them.

    Returns
    -------
    Mechanism
        The model in the same pose, with the preloads of least norm that hold it (moments divided by its size).

    Raises
    ------
    ModelError
        If a name or pattern picks no spring, or only some without stiffness.
    EquilibriumError
        If no preload of these holds the pose.
    """
    springs = _chosen(model, chosen)
    none: dict[str, dict[str, Any]] = {
        spring.name: {"preload": None} | ({"free_length": None} if isinstance(spring, Spring) else {})
        for spring in springs
    }
    at = stance(bare(changed(model, none)), start(model))
    wrenches = _balancing(at, balance(at), springs, [1.0] * len(springs))
    result = changed(model, {
        spring.name: none[spring.name] | {"preload": _as_preload(spring, wrench)}
        for spring, wrench in zip(springs, wrenches, strict=True)
    })  # fmt: skip
    held = balance(stance(bare(result), at.pose))
    if held.strict_share > BALANCE and held.share > BALANCE:  # forces that are rounding balance as well
        names = ", ".join(f"'{spring.name}'" for spring in springs[:6]) + (", ..." if len(springs) > 6 else "")
        what, where = lacking(at, held)
        raise EquilibriumError(
            f"model '{model.name}': no preload of {names} holds the given pose; {what}. Choose springs that act along "
            f"it as well, or let model.equilibrium() find another pose.", **where,
        )  # fmt: skip
    return result


def without_rounding(model: M) -> M:
    """Return a model in equilibrium with what the rounding of its positions costs taken out of its springs' forces.

    A spring of stiffness k and length L cannot tell forces below eps k L by its length; where that is more than statics
    allow, its force is a preload, which can.

    Parameters
    ----------
    model : Mechanism
        The model, in balance but for rounding.

    Returns
    -------
    Mechanism
        The same, with other preloads if need be.
    """
    at = stance(bare(model), start(model))
    forces = balance(at)
    if forces.strict_share <= SETTLED:
        return model
    springs = _chosen(model, True) if any(map(_is_stiff, model.springs.values())) else []
    told = [_told(spring, at.size) for spring in springs]
    changes: dict[str, dict[str, Any]] = {}
    for spring, least, wrench in zip(springs, told, _balancing(at, forces, springs, told), strict=True):
        if np.abs(wrench * (1.0, 1.0, 1.0, 1 / at.size, 1 / at.size, 1 / at.size)).max() > MOST_ROUNDING * least:
            return model
        before = np.array(spring.preload or np.zeros(6)) if isinstance(spring, Bushing) else \
            np.array((0.0, 0.0, -spring.tension, 0.0, 0.0, 0.0))  # fmt: skip
        free = {"free_length": None} if isinstance(spring, Spring) else {}
        changes[spring.name] = free | {"preload": _as_preload(spring, before + wrench)}
    return changed(model, changes)


def _told(spring: Spring | Bushing, size: float) -> float:
    """The least force that the position of a spring's ends can tell [N]."""
    if isinstance(spring, Spring):
        return EPS * abs(spring.stiffness) * size
    stiffness = np.abs(np.array(spring.stiffness))
    stiffness = stiffness if stiffness.ndim == 1 else stiffness.max(axis=1)
    return EPS * float(max(stiffness[:3].max() * size, stiffness[3:].max() / size))


def _as_preload(spring: Spring | Bushing, wrench: Array) -> float | list[float]:
    return -float(wrench[2]) if isinstance(spring, Spring) else [float(value) for value in wrench]


def _balancing(
    at: Stance, forces: Balance, springs: Sequence[Spring | Bushing], weight: Sequence[float]
) -> list[Array]:
    """The smallest wrenches on the second bodies (6,) that take away what is left over, each over its weight."""
    if not springs:
        return []
    bases = [_directions(spring, at.size) for spring in springs]
    rows = _rows(at, springs, bases)
    each = np.repeat(weight, [len(basis) for basis in bases])
    acting = forces.scale * (rows if forces.reduction.matrix is None else rows @ forces.reduction.matrix)
    size = each * np.linalg.lstsq((each[:, None] * acting).T, -forces.scale * forces.residual, rcond=HOLDS_NOTHING)[0]
    parts = np.split(size, np.cumsum([len(basis) for basis in bases])[:-1])
    return [basis.T @ part for basis, part in zip(bases, parts, strict=True)]


def _chosen(model: Mechanism, chosen: Sequence[Any] | str | bool) -> list[Spring | Bushing]:
    """The springs that are named or picked, without those that have no stiffness to be stretched."""
    if isinstance(chosen, bool):
        patterns = ["*"] if chosen else []
    else:
        given = [chosen] if isinstance(chosen, str) or not hasattr(chosen, "__iter__") else list(chosen)
        patterns = [item if isinstance(item, str) else getattr(item, "name", str(item)) for item in given]
    names: dict[str, None] = {}
    for pattern in patterns:
        picked = [name for name in model.springs if name == pattern or fnmatchcase(name, pattern)]
        stiff = [name for name in picked if _is_stiff(model.springs[name])]
        if not stiff:
            why = "is no spring or bushing" if not picked else "has no stiffness to be stretched"
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


def _rows(at: Stance, springs: Sequence[Spring | Bushing], bases: list[Array]) -> Array:
    """What such a wrench of one unit does along each joint coordinate of the tree, one row each."""
    tuples: list[tuple[float, ...]] = []
    for spring, basis in zip(springs, bases, strict=True):
        ends = at.pose.number[spring.first], at.pose.number[spring.second]
        if isinstance(spring, Spring):
            tuples.append((*ends, *spring.start, *spring.line, 0.0, 0.0, 0.0))
        else:
            axes = np.array(spring.orientation)
            tuples += [(*ends, *spring.position, *(axes @ six[:3]), *(axes @ six[3:])) for six in basis]
    return relative_motion(at.coordinates, Rows.stack(tuples)).dense(0, len(tuples))
