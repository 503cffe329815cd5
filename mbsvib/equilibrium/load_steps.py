"""The same model with a share of its loads, for load steps."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

from mbsvib.mechanism.mechanism import Mechanism

if TYPE_CHECKING:
    from mbsvib.common.arguments import Vector

M = TypeVar("M", bound=Mechanism)

def with_share(model: M, share: float) -> M:
    """Return a model with a share of its gravity and of its loads; preloads of springs stay."""
    if share == 1.0:
        return model

    loads = {} if not share else {
        name: replace(load, force=_shared(load.force, share), torque=_shared(load.torque, share))
        for name, load in model.loads.items()
    }  # fmt: skip
    return model.with_parts(gravity=None if model.gravity is None else _shared(model.gravity, share), loads=loads)


def _shared(vector: Vector, share: float) -> Vector:
    x, y, z = vector
    return share * x, share * y, share * z
