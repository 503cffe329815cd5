"""The batch: systems of many variants of one model, with the methods of a single system."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, overload

import numpy as np

from mbsvib.system import System

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from numpy.typing import NDArray

    from mbsvib.assembly import Scene
    from mbsvib.batch.values import Values

    Array = NDArray[np.float64]

MATRICES = ("M", "C", "K", "B", "Cq", "Cv", "Ca", "D")
FACTORS = ("inertia_factor", "elastic_rows", "stiffness", "damping", "body_motion")


@dataclass(frozen=True, repr=False, eq=False)
class Batch:
    """Systems M_i q'' + C_i q' + K_i q = B_i u of n variants, all in the minimal coordinates of ``nominal``.

    Arrays are those of ``System`` with an axis of variants in front: ``M``, ``C``, ``K`` (n, m, m), ``B`` (n, m,
    inputs), ``Cq``, ``Cv``, ``Ca`` (n, outputs, m), ``D`` (n, outputs, inputs). They are read-only, and views of a
    single matrix where nothing varies. ``batch[i]`` is the system of variant i, ``nominal`` that of the model as given;
    ``values`` holds what varies.
    """

    nominal: System
    values: Values
    scene: Scene = field(repr=False)
    moves: bool
    M: Array
    C: Array
    K: Array
    B: Array
    Cq: Array
    Cv: Array
    Ca: Array
    D: Array
    inertia_factor: Array
    elastic_rows: Array
    stiffness: Array
    damping: Array
    row_owner: NDArray[np.intp]
    body_motion: Array

    def __post_init__(self) -> None:
        for name in (*MATRICES, *FACTORS, "row_owner"):
            getattr(self, name).setflags(write=False)

    @property
    def name(self) -> str:
        """Name of the model."""
        return self.nominal.name

    @property
    def dof(self) -> int:
        """Number of degrees of freedom, m."""
        return self.nominal.dof

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the minimal coordinates, those of the pose as given."""
        return self.nominal.coordinates

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return self.nominal.inputs

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return self.nominal.outputs

    @property
    def parameters(self) -> Mapping[str, Array]:
        """Values (n,) of the parameters that vary, by name."""
        return self.values.by_name

    def __len__(self) -> int:
        return self.values.count

    def __iter__(self) -> Iterator[System]:
        return (self[i] for i in range(len(self)))

    @overload
    def __getitem__(self, i: int) -> System: ...

    @overload
    def __getitem__(self, i: slice) -> list[System]: ...

    def __getitem__(self, i: int | slice) -> System | list[System]:
        if isinstance(i, slice):
            return [self[k] for k in range(*i.indices(len(self)))]
        k = range(len(self))[i]
        used = (self.stiffness[k] != 0.0) | (self.damping[k] != 0.0)
        arrays = {name: getattr(self, name)[k] for name in (*MATRICES, "inertia_factor", "body_motion")}
        arrays |= {name: getattr(self, name)[k][used] for name in ("elastic_rows", "stiffness", "damping")}
        return replace(self.nominal, row_owner=self.row_owner[used], **arrays)

    def __repr__(self) -> str:
        return f"Batch({self.name!r}: {len(self)} variants, {self.dof} DOF)"
