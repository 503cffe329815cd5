"""Spring-dampers of a batch: their rows with an axis of variants where something of them varies."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.elements import Bushing, Spring
from mbsvib.elements.rows import Rows
from mbsvib.equations.spring_rows import Elements, stack
from mbsvib.linalg.products import eigenrows
from mbsvib.mechanism.changes import rotations

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mbsvib.common.arrays import Array
    from mbsvib.equations.batch_values import Values
    from mbsvib.equations.scene import Scene


def stacked(array: Array, count: int) -> Array:
    """Return a copy (3, variants, n) of vectors (3, n), to be written to; what is one already comes back as it is."""
    if array.ndim == 3:
        return array
    return np.repeat(array[:, None], count, axis=1)


def springs_of(scene: Scene, values: Values, number: Mapping[str, int]) -> Elements:
    """Return the rows of all spring-dampers in all variants.

    Parameters
    ----------
    scene : Scene
        The mechanism in numbers, as it is.
    values : Values
        What varies.
    number : mapping
        Number of each body, ground included.

    Returns
    -------
    Elements
        Rows that no variant needs are left out, and those added that only some variant does.
    """
    springs, n = scene.springs, values.count
    names = [part.name for part in scene.elements]
    mine = {i: values.fields[name] for i, name in enumerate(names) if name in values.fields}
    if not mine:
        return springs
    springs = _restacked(scene, mine, number)
    owner = springs.owner
    rows = springs.rows
    stiffness, damping, unit = springs.stiffness, springs.damping, springs.unit
    point, force, moment = rows.point, rows.force, rows.moment
    for i, whole in mine.items():
        part, at = scene.elements[i], np.flatnonzero(owner == i)
        for field in ("stiffness", "damping"):
            if field not in whole or _is_full(part):
                continue
            value = stiffness if field == "stiffness" else damping
            value = np.repeat(value[None], n, axis=0) if value.ndim == 1 else value
            given = whole[field]
            value[:, at] = given[:, None] if isinstance(part, Spring) else given[unit[..., at, :].argmax(axis=-1)].T
            stiffness, damping = (value, damping) if field == "stiffness" else (stiffness, value)
        if isinstance(part, Spring) and ("start" in whole or "end" in whole):
            start, end = (whole.get(field, np.array(getattr(part, field))[:, None]) for field in ("start", "end"))
            gap = np.broadcast_to(end - start, (3, n))
            point = stacked(point, n)
            force = stacked(force, n)
            point[:, :, at] = np.broadcast_to(start, (3, n))[:, :, None]
            force[:, :, at] = (gap / np.sqrt(np.einsum("iv,iv->v", gap, gap)))[:, :, None]
        if isinstance(part, Bushing) and "position" in whole:
            point = stacked(point, n)
            point[:, :, at] = whole["position"][:, :, None]
        if isinstance(part, Bushing) and "orientation" in whole:
            axes = rotations(whole["orientation"]) @ np.array(part.orientation)
            force = stacked(force, n)
            moment = stacked(moment, n)
            own = unit[at]
            force[:, :, at] = np.einsum("vij,kj->ivk", axes, own[:, :3])
            moment[:, :, at] = np.einsum("vij,kj->ivk", axes, own[:, 3:])
    result = Elements(Rows(rows.first, rows.second, point, force, moment), stiffness, damping, owner, unit)
    for i, whole in mine.items():
        if _is_full(scene.elements[i]) and ("stiffness" in whole or "damping" in whole):
            result = _with_matrices(result, scene.elements[i], i, whole, number, n)
    return result


def _is_full(part: Bushing | Spring) -> bool:
    return isinstance(part, Bushing) and (isinstance(part.stiffness[0], tuple) or isinstance(part.damping[0], tuple))


def _restacked(scene: Scene, mine: Mapping[int, Mapping[str, Array]], number: Mapping[str, int]) -> Elements:
    """The rows again where values that are zero as given are not in some variant; 6x6 matrices that vary left out."""
    parts: list[Bushing | Spring] = list(scene.elements)
    again, left = False, []
    for i, whole in mine.items():
        part = parts[i]
        if not isinstance(part, Bushing) or not ("stiffness" in whole or "damping" in whole):
            continue
        again = True
        if _is_full(part):
            left.append(i)
            continue
        acts: dict[str, Any] = {field: tuple((whole[field] != 0.0).any(axis=1).astype(float).tolist())
                for field in ("stiffness", "damping") if field in whole}  # fmt: skip
        parts[i] = replace(part, **acts)
    if not again:
        return scene.springs
    result = stack(parts, number)
    return result.only(np.flatnonzero(~np.isin(result.owner, left)))


def _with_matrices(
    springs: Elements, part: Bushing | Spring, i: int, whole: Mapping[str, Array], number: Mapping[str, int], n: int
) -> Elements:
    """The rows of one more bushing, whose 6x6 matrices vary: six of its stiffness and six of its damping."""
    assert isinstance(part, Bushing)
    units, values = [], []
    for field in ("stiffness", "damping"):
        given = whole.get(field, np.array(getattr(part, field), dtype=float)[..., None])
        matrix = np.moveaxis(given if given.ndim == 3 else given * np.eye(6)[..., None], -1, 0)
        value, rows = eigenrows(matrix)
        units.append(np.broadcast_to(rows, (n, 6, 6)))
        values.append(np.broadcast_to(value, (n, 6)))
    unit, none = np.concatenate(units, axis=1), np.zeros((n, 6))
    axes = np.array(part.orientation)
    if "orientation" in whole:
        axes = rotations(whole["orientation"]) @ axes
    axes = np.broadcast_to(axes, (n, 3, 3))
    place = np.broadcast_to(whole.get("position", np.array(part.position)[:, None]), (3, n))
    more = Rows(
        np.full(12, number[part.first]), np.full(12, number[part.second]), np.repeat(place[:, :, None], 12, axis=2),
        np.einsum("vij,vkj->ivk", axes, unit[..., :3]), np.einsum("vij,vkj->ivk", axes, unit[..., 3:]),
    )  # fmt: skip
    return Elements(
        Rows.join([springs.rows, more]) if len(springs.owner) else more,
        _appended(springs.stiffness, np.concatenate((values[0], none), axis=1)),
        _appended(springs.damping, np.concatenate((none, values[1]), axis=1)),
        np.concatenate((springs.owner, np.full(12, i))),
        np.concatenate((np.broadcast_to(springs.unit, (n, *springs.unit.shape[-2:])), unit), axis=1),
    )  # fmt: skip


def _appended(first: Array, second: Array) -> Array:
    return np.concatenate((np.broadcast_to(first, (len(second), first.shape[-1])), second), axis=1)
