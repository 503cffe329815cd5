"""Poses as arrays of displacements: how they are given, batches of systems there, and the words of errors."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.expected import reals
from mbsvib.equilibrium.posed_variants import pose_coordinates
from mbsvib.errors import EquilibriumError, MbsvibError, ModelError, SingularPoseError, UnreachableError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mbsvib.api.batch import Batch
    from mbsvib.api.plant import Plant
    from mbsvib.common.arrays import Array
    from mbsvib.mechanism.mechanism import Mechanism

# Coordinates that a message names.
NAMED = 6


def columns_of(model: Mechanism, values: Any, grid: bool) -> tuple[dict[str, Array], tuple[int, ...]]:
    """Displacements (n,) of each coordinate, and the shape of the grid or (n,)."""
    check_mapping(values, "family")
    arrays = {}
    for key, value in values.items():
        array = reals(value, "family", f"values['{key}']", "displacements [m, rad]", ModelError)
        if array.ndim > 1 or not array.size or not np.isfinite(array).all():
            raise ModelError(f"family: values['{key}'] = {check.shown(value)}; expected finite displacements [m, rad], "
                             f"one for each pose.", element=str(key), field="values")  # fmt: skip
        arrays[key] = np.atleast_1d(array)
    if grid:
        spread = [axis.ravel() for axis in np.meshgrid(*arrays.values(), indexing="ij")]
        shape = tuple([len(array) for array in arrays.values()])
    else:
        lengths = {key: len(array) for key, array in arrays.items() if len(array) > 1}
        if len(set(lengths.values())) > 1:
            listed = ", ".join(f"'{key}' {length}" for key, length in lengths.items())
            raise ModelError(f"family: values have different lengths: {listed}; expected equal ones. grid=True takes "
                             f"all combinations.", field="values")  # fmt: skip
        shape = (max(lengths.values(), default=1),)
        spread = [np.broadcast_to(array, shape) for array in arrays.values()]
    columns: dict[str, Array] = {}
    for key, column in zip(arrays, spread, strict=True):
        for name in pose_coordinates(model, key, "family"):
            if name in columns:
                raise ModelError(f"family: '{name}' has values twice; expected one vector for each coordinate.",
                                 element=name, field="values")  # fmt: skip
            columns[name] = column
    return columns, shape


def check_mapping(values: Any, caller: str) -> None:
    """Refuse what is no mapping of coordinates to displacements, or is empty."""
    if not hasattr(values, "items") or not values:
        raise check.refuse(caller, "values", values, "joint coordinates with displacements, {'leg1.slide.z': ...}")


def batch_of(plant: Plant, poses: Array, caller: str) -> Batch:
    """Return the batch of ``poses`` (n, coordinates); errors name the pose by its number and displacements."""
    try:
        return cast("Batch", plant(poses))
    except MbsvibError as error:
        match = re.match(r"variant (\d+):? ?", str(error))
        if match is None:
            raise
        i = int(match[1])
        pose = dict(zip(plant.names, poses[i].tolist(), strict=True))
        text = f"{caller}: {told(i, pose)}: {str(error)[match.end():]}"
        if isinstance(error, UnreachableError):
            raise SingularPoseError(text) from error
        if isinstance(error, (SingularPoseError, EquilibriumError, ModelError)):
            error.args = (text, *error.args[1:])
        raise


def told(i: int, pose: Mapping[str, float]) -> str:
    """Return a pose in words: its number and displacements."""
    shown = ", ".join(f"{name} = {value:.6g}" for name, value in list(pose.items())[:NAMED])
    return f"pose {i} ({shown}{', ...' if len(pose) > NAMED else ''})"
