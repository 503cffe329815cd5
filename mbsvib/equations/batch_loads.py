"""Loads of a batch: applied wrenches of all variants at once."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.equations.placing import with_values_at
from mbsvib.equations.wrenches import applied_wrenches
from mbsvib.linalg.rotations import exponential

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from mbsvib.common.arrays import Array
    from mbsvib.equations.batch_values import Values
    from mbsvib.equations.wrenches import AppliedWrenches
    from mbsvib.mechanism.mechanism import Mechanism


def loaded_in_variants(model: Mechanism, varying: Mapping[str, Mapping[str, Any]]) -> bool:
    """Return whether gravity, or the preload of an element, is among the fields that vary, by part and name."""
    return bool("gravity" in varying and model.gravity is not None) or bool(preloaded(model, varying))


def preloaded(model: Mechanism, varying: Mapping[str, Mapping[str, Any]]) -> frozenset[str]:
    """Return the names of the elements whose preload may differ in variants."""
    return frozenset(
        name for name, fields in varying.items() if name in model.springs and (
            "preload" in fields or getattr(model.springs[name], "free_length", None) is not None))  # fmt: skip


def applied_of_variants(
    model: Mechanism, values: Values, positions: Mapping[int, Array], also: Collection[str] = ()
) -> AppliedWrenches:
    """Return the applied wrenches of all variants; ``positions`` (3, variants): moved centres of mass by number.

    ``also``: elements that have one, even if it is zero.
    """
    number = {name: i for i, name in enumerate((*model.bodies, "ground"))}
    applied = applied_wrenches(model, number, preloaded(model, values.index).union(also))
    pairs, weight = applied.pairs, applied.weight
    arrays = {key: getattr(pairs, key) for key in ("start", "end", "force", "torque")}
    for k, name in enumerate(applied.names[: applied.loads]):
        fields, load = values.fields.get(name, {}), model.loads[name]
        if load.position is None and number[load.body] in positions:
            fields = {**fields, "position": positions[number[load.body]]}
        for field, keys in (("force", ("force",)), ("torque", ("torque",)), ("position", ("start", "end"))):
            for key in keys if field in fields else ():
                arrays[key] = with_values_at(arrays[key], slice(k, k + 1), fields[field], values.count)
    for k, name in enumerate(applied.names[applied.loads :], applied.loads):
        if name in values.fields:
            for key, vectors in _of_element(model.springs[name], values.fields[name], values.count).items():
                arrays[key] = with_values_at(arrays[key], slice(k, k + 1), vectors, values.count)
    masses = {number[name]: fields["mass"] for name, fields in values.fields.items()
              if name in model.bodies and "mass" in fields}  # fmt: skip
    gravity = values.fields.get("gravity", {}).get("")
    if model.gravity is not None and (gravity is not None or masses):
        mass = np.array([[body.mass for body in model.bodies.values()] + [0.0]])
        mass = values.repeated(mass[0])
        for body, array in masses.items():
            mass[:, body] = array
        direction = np.array(model.gravity)[:, None] if gravity is None else gravity
        weight = direction[:, :, None] * mass
    return replace(applied, pairs=replace(pairs, **arrays), weight=weight)


def _of_element(part: Any, fields: Mapping[str, Array], count: int) -> dict[str, Array]:
    """Points and wrenches (3, variants) of an element with other values of some fields."""

    def value(name: str) -> Array:
        return np.asarray(fields[name]) if name in fields else np.array(getattr(part, name), dtype=float)[..., None]

    if part.acts_along_line:
        start, end = value("start"), value("end")
        line = np.broadcast_to(end - start, (3, count))
        length = np.sqrt(np.square(line).sum(axis=0))
        if getattr(part, "free_length", None) is not None:
            tension = value("stiffness") * (length - value("free_length"))
        else:
            tension = value("preload") if getattr(part, "preload", None) is not None else np.zeros(1)
        return {"start": np.broadcast_to(start, (3, count)), "end": np.broadcast_to(end, (3, count)),
                "force": -tension / length * line}  # fmt: skip
    axes = np.array(part.orientation)
    if "orientation" in fields:
        axes = exponential(fields["orientation"].T) @ axes
    preload = np.zeros((6, 1)) if part.preload is None else value("preload")
    wrench: Any = np.broadcast_to(preload, (6, count)).T
    force, torque = ((axes @ vectors[..., None])[..., 0].T for vectors in (wrench[:, :3], wrench[:, 3:]))
    point = np.broadcast_to(value("position"), (3, count))
    return {"start": point, "end": point, "force": force, "torque": torque}
