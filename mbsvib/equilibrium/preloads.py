"""The preloads of springs and bushings of all kinds that hold a model in the pose in which it is described."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from mbsvib.common.arguments import DIRECTIONS
from mbsvib.common.arrays import Array
from mbsvib.common.patterns import matching
from mbsvib.elements.connection import PreloadForm
from mbsvib.elements.rows import Rows
from mbsvib.equations.hubs import on_held
from mbsvib.equilibrium.balance import Balance, balance, unbalanced_force
from mbsvib.equilibrium.motion import PosedModel, posed_model
from mbsvib.equilibrium.moved_parts import changed, static_model
from mbsvib.errors import EquilibriumError, ModelError, nearest
from mbsvib.kinematics.relative_motion import relative_motion
from mbsvib.linalg.rank import BALANCE, HOLDS_NOTHING
from mbsvib.mechanism.mechanism import Mechanism

M = TypeVar("M", bound=Mechanism)

# Accepted residual of an equilibrium as a share of the forces, and the largest correction in units of rounding.
RESIDUAL, MOST_ROUNDING = 1e-12, 1e4


def preloaded(model: M, selection: Sequence[Any] | str | bool) -> M:
    """Return the model with the preloads that hold it; see ``Model.equilibrium``.

    The preloads have the least norm, with moments divided by the size of the model.
    """
    names = _selected(model, selection)
    none = {name: form.arguments(None) for name, form in _forms(model, names, 1.0).items()}
    at = posed_model(static_model(changed(model, none)))
    forms = _forms(model, names, at.size)
    wrenches = _balancing(at, balance(at), forms, [1.0] * len(forms))
    result = changed(model, {name: none[name] | form.arguments(wrench)
                             for (name, form), wrench in zip(forms.items(), wrenches, strict=True)})  # fmt: skip
    balanced = balance(posed_model(static_model(result), at.pose))
    if balanced.strict_share > BALANCE and balanced.share > BALANCE:  # forces that are rounding balance as well
        listed = ", ".join(f"'{name}'" for name in list(names)[:6]) + (", ..." if len(names) > 6 else "")
        text, details = unbalanced_force(at, balanced)
        raise EquilibriumError(
            f"model '{model.name}': no preload of {listed} holds the given pose; {text}. Choose springs that act along "
            f"it as well, or let model.equilibrium() find another pose.", **details,
        )  # fmt: skip
    return result


def without_rounding(model: M) -> M:
    """Return a model in equilibrium with preloads that correct the rounding of its positions.

    The length L of a spring of stiffness k resolves no force below eps k L. Where that is more than the check of
    statics accepts, the spring is given its force as a preload.
    """
    at = posed_model(static_model(on_held(model)))
    forces = balance(at)
    if forces.strict_share <= RESIDUAL:
        return model
    forms = _forms(model, list(model.springs), at.size)
    resolutions = [form.resolution for form in forms.values()]
    changes: dict[str, dict[str, Any]] = {}
    for (name, form), wrench in zip(forms.items(), _balancing(at, forces, forms, resolutions), strict=True):
        if np.abs(wrench / ([1.0] * 3 + [at.size] * 3)).max() > MOST_ROUNDING * form.resolution:
            return model
        changes[name] = form.arguments(form.wrench + wrench)
    return changed(model, changes)


def _forms(model: Mechanism, names: Iterable[str], size: float) -> dict[str, PreloadForm]:
    """How connections can carry a preload, without those that cannot; along the directions that a mapping names."""
    forms = {name: model.springs[name].preload_form(size) for name in names}
    result = {name: form for name, form in forms.items() if form is not None}
    if isinstance(names, dict):
        result = {name: _along(form, model.springs[name], names[name], size) for name, form in result.items()}
    return result


def _along(form: PreloadForm, part: Any, directions: Sequence[str], size: float) -> PreloadForm:
    """The form with preloads along some of its own axes alone; all where no direction is named."""
    if not directions:
        return form
    axes = np.kron(np.eye(2), np.array(part.orientation))
    unit = np.array([1.0] * 3 + [size] * 3)
    six = axes.T[[DIRECTIONS.index(direction) for direction in directions]] * unit[
        [DIRECTIONS.index(direction) for direction in directions], None]  # fmt: skip
    return replace(form, wrenches=six)


def _balancing(
    at: PosedModel, forces: Balance, forms: Mapping[str, PreloadForm], weights: Sequence[float]
) -> list[Array]:
    """The wrenches (6,) on the second bodies that balance the residual, of least norm relative to the weights."""
    if not forms:
        return []
    count = [len(form.wrenches) for form in forms.values()]
    weight = np.repeat(weights, count)
    rows = _rows(at, forms)
    along = forces.scale * (rows if forces.reduction.matrix is None else rows @ forces.reduction.matrix)
    sizes = np.linalg.lstsq((weight[:, None] * along).T, -forces.scale * forces.residual, rcond=HOLDS_NOTHING)[0]
    parts = np.split(weight * sizes, np.cumsum(count)[:-1])
    return [part @ form.wrenches for part, form in zip(parts, forms.values(), strict=True)]


def _selected(model: Mechanism, selection: Sequence[Any] | str | bool) -> dict[str, tuple[str, ...]]:
    """Names of the springs that are named or match a pattern, without those that have no stiffness, with the
    directions of bushings that a pattern such as ``"*.tyre.z"`` names; none: all.
    """
    if isinstance(selection, bool):
        patterns = ["*"] if selection else []
    else:
        items = [selection] if isinstance(selection, str) or not hasattr(selection, "__iter__") else list(selection)
        patterns = [item if isinstance(item, str) else getattr(item, "name", str(item)) for item in items]
    names: dict[str, tuple[str, ...]] = {}
    for pattern in patterns:
        along = _directions(model, pattern)
        if along:
            for name, directions in along.items():
                if names.get(name, directions):  # a bushing that was named without directions keeps all of them
                    names[name] = tuple(dict.fromkeys((*names.get(name, ()), *directions)))
            continue
        picked = matching(pattern, model.springs)
        stiff = _forms(model, picked, 1.0)
        if not stiff:
            why = "is not a spring or bushing" if not picked else "has no stiffness at rest"
            raise ModelError(f"equilibrium: preload = {pattern!r} {why} in model '{model.name}'; name springs or "
                             f"bushings with stiffness.{'' if picked else nearest(pattern, model.springs)}",
                             element=pattern, field="preload")  # fmt: skip
        for name in stiff:
            names[name] = ()
    return names


def _directions(model: Mechanism, pattern: str) -> dict[str, tuple[str, ...]]:
    """The directions with stiffness of bushings that a pattern names, none if it matches names of elements."""
    if matching(pattern, model.springs):
        return {}
    picked = set(matching(pattern, [f"{name}.{direction}" for name in model.springs for direction in DIRECTIONS]))
    result: dict[str, tuple[str, ...]] = {}
    for name, part in model.springs.items():
        if not hasattr(part, "orientation"):
            if part.acts_along_line and f"{name}.z" in picked and part.preload_form(1.0) is not None:
                result[name] = ()
            continue
        stiffness = np.abs(np.array(part.stiffness))
        stiff = stiffness if stiffness.ndim == 1 else stiffness.max(axis=1)
        named = tuple([direction for direction, value in zip(DIRECTIONS, stiff.tolist(), strict=True)
                       if value and f"{name}.{direction}" in picked])  # fmt: skip
        if named:
            result[name] = named
    return result


def _rows(at: PosedModel, forms: Mapping[str, PreloadForm]) -> Array:
    """The generalized forces of unit wrenches along the joint coordinates of the tree (wrenches, n)."""
    tuples: list[tuple[float, ...]] = []
    for name, form in forms.items():
        part = at.reference.springs[name]
        ends = at.pose.number[part.first], at.pose.number[part.second]
        tuples += [(*ends, *form.point, *wrench) for wrench in form.wrenches.tolist()]
    return relative_motion(at.coordinates, Rows.stack(tuples)).dense(0, len(tuples))
