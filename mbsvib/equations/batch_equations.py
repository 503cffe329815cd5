"""Equations of many variants of one mechanism, all in the same minimal coordinates."""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.common.arrays import Array
from mbsvib.equations.batch_values import Values
from mbsvib.equations.equations import Equations, Provenance
from mbsvib.equations.matrices import AXES, MATRICES, OPTIONAL, Matrices
from mbsvib.errors import ResponseError
from mbsvib.mechanism.mechanism import Mechanism

if TYPE_CHECKING:
    from mbsvib.equations.scene import Scene

# Chunks whose largest array has this many numbers fit a cache, and are large enough that calls cost little.
CHUNK = 2**20
FACTORS = ("inertia_factor", "elastic_rows", "row_stiffness", "row_damping", "body_motion")


@dataclass(frozen=True, repr=False, eq=False, kw_only=True)
class BatchEquations(Matrices):
    """Equations M_i q'' + C_i q' + K_i q = B_i u of n variants, all in the minimal coordinates of ``nominal``.

    Arrays are those of ``Equations`` with an axis of variants in front: ``M``, ``C``, ``K`` (n, m, m), ``B`` (n, m,
    inputs), ``Cq``, ``Cv``, ``Ca`` (n, outputs, m), ``D`` (n, outputs, inputs). They are read-only, and views of a
    single matrix if they are constant. ``batch[i]`` are the equations of variant i, ``nominal`` those of the model.
    ``values`` are the values that vary. ``closure`` (n, joint coordinates, m) is B'' if the geometry of loops varies,
    ``provenances`` are those of variants that were linearized one by one; if ``own_decisions``, forces at
    the pose and massless motions of a variant are described when it is asked for; ``variant`` returns those in other
    poses by their numbers. ``gyroscopic`` and ``circulatory``
    (n, m, m) and ``null_inertia`` (n, m, massless) are None if no variant has them.
    """

    _engine = "basis closure kind own_decisions provenances slice"

    kind: ClassVar[str] = "batch"

    nominal: Equations
    values: Values
    closure: Array | None
    provenances: tuple[Provenance, ...] | None = None
    own_decisions: bool = False
    variant: Callable[[int], Mechanism] | None = None

    def __post_init__(self) -> None:
        for name in (*MATRICES, *FACTORS, "row_owner", *self._parts):
            getattr(self, name).setflags(write=False)

    @property
    def _parts(self) -> tuple[str, ...]:
        """Names of the parts without symmetry or mass that some variant has."""
        return tuple(name for name in OPTIONAL if getattr(self, name) is not None)

    @property
    def symmetric(self) -> bool:
        """Whether in all variants M, C and K are symmetric, and M is regular."""
        return not self._parts

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
        """Names of the minimal coordinates, which are those of the nominal pose."""
        return self.nominal.coordinates

    @property
    def coordinate_units(self) -> tuple[str, ...]:
        """Units of the minimal coordinates."""
        return self.nominal.coordinate_units

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return self.nominal.inputs

    @property
    def input_units(self) -> tuple[str, ...]:
        """Units of the inputs."""
        return self.nominal.input_units

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return self.nominal.outputs

    @property
    def output_units(self) -> tuple[str, ...]:
        """Units of the outputs."""
        return self.nominal.output_units

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of the bodies."""
        return self.nominal.bodies

    @property
    def parameters(self) -> Mapping[str, Array]:
        """Values (n,) of the parameters and displacements of joint coordinates that vary, by name."""
        return {**self.values.by_name, **self.values.displacements}

    def displacements(self, q: ArrayLike) -> dict[str, Array]:
        """Return the displacements of the bodies in all variants, x_i = B'_i B''_i q.

        Parameters
        ----------
        q : array-like, shape (m,) or (n, m)
            Minimal coordinates [m, rad], the same for all variants or one set for each.

        Returns
        -------
        dict of str to array, shape (n, 6)
            Translation of each body's centre of mass [m] and its rotation [rad], world axes.

        Raises
        ------
        ResponseError
            If ``q`` does not have one entry for each coordinate.
        """
        vector = np.asarray(q)
        if vector.shape not in ((self.dof,), (len(self), self.dof)):
            raise ResponseError(f"displacements: q has shape {vector.shape}; expected ({self.dof},), or "
                                f"({len(self)}, {self.dof}) with one set for each variant.")  # fmt: skip
        motion = (self.body_motion @ vector.reshape(len(vector) if vector.ndim > 1 else 1, 1, self.dof, 1))[..., 0]
        return {name: motion[:, i] for i, name in enumerate(self.bodies)}

    def __len__(self) -> int:
        return self.values.count

    def __iter__(self) -> Iterator[Equations]:
        return (self[i] for i in range(len(self)))

    def __getitem__(self, i: int) -> Equations:
        count = len(self)
        if not -count <= operator.index(i) < count:
            raise IndexError(f"'{self.name}' has {count} variants, and none of number {i}; expected 0 to {count - 1}, "
                             f"or -{count} to -1 from the end.")  # fmt: skip
        k = range(count)[i]
        result, nominal = of_variant(self, k), self.nominal.provenance
        posed = self.variant is not None
        if self.provenances is None and (self.own_decisions or posed) and nominal.origin is not None:
            from mbsvib.equations.assembly import linearized

            values = {name: float(array[k]) for name, array in self.values.by_name.items()}
            variant = nominal.origin.with_values(values) if self.variant is None else self.variant(k)
            own: Equations = linearized(variant, self.nominal.coordinates, self.nominal.cut_joints or None)
            result = replace(result, provenance=own.provenance)
        return result

    def slice(self, start: int, stop: int) -> Self:
        """Return the variants start .. stop - 1 as a batch of their own, without copying anything."""
        if (start, stop) == (0, len(self)):
            return self
        arrays = {name: getattr(self, name)[start:stop] for name in (*MATRICES, *FACTORS, *self._parts)}
        closure = None if self.closure is None else self.closure[start:stop]
        provenances = None if self.provenances is None else self.provenances[start:stop]
        variant = None if self.variant is None else partial(_behind, self.variant, start)
        return replace(self, values=self.values.slice(start, stop), closure=closure, provenances=provenances,
                       variant=variant, **arrays)  # fmt: skip


def _behind(variant: Callable[[int], Mechanism], start: int, i: int) -> Mechanism:
    return variant(start + i)


def of_variant(batch: BatchEquations, k: int, parts: bool = True) -> Equations:
    """Return the equations of variant ``k`` for all that depends on matrices alone, as modes and responses do.

    They are ``batch[k]``, with what was decided for the nominal model on forces at the pose and motions without mass;
    if ``parts``, with the parts of the variant, which matrices do not tell.
    """
    used = (batch.row_stiffness[k] != 0.0) | (batch.row_damping[k] != 0.0)
    used &= batch.elastic_rows[k].any(axis=1)
    arrays = {name: getattr(batch, name)[k] for name in (*MATRICES, "inertia_factor", "body_motion")}
    arrays |= {name: getattr(batch, name)[k][used] for name in ("elastic_rows", "row_stiffness", "row_damping")}
    optional = {name: getattr(batch, name) for name in OPTIONAL}
    arrays |= {name: part[k] if part is not None and part[k].any() else None for name, part in optional.items()}
    return replace(batch.nominal, row_owner=batch.row_owner[used], provenance=_provenance(batch, k, parts), **arrays)


def _provenance(batch: BatchEquations, k: int, parts: bool) -> Provenance:
    """Provenance of a variant: that of the nominal pose with the variant's loops and, where asked for, its parts."""
    if batch.provenances is not None:
        return batch.provenances[k]
    nominal, values = batch.nominal.provenance, batch.values
    topology, reduction, origin = nominal.topology, nominal.reduction, nominal.origin
    if batch.closure is not None:
        reduction = replace(reduction, matrix=batch.closure[k])
    if not parts:
        return replace(nominal, reduction=reduction)
    changed: dict[str, Any] = {name: values.of_variant(values.parameters.parts[name], k) for name in values.index}

    def at(parts: Iterable[Any]) -> tuple[Any, ...]:  # the node of a connection has joints of its name
        return tuple([new if type(new := changed.get(part.name, part)) is type(part) else part for part in parts])

    return replace(nominal, topology=replace(topology, joints=at(topology.joints)), parts=at(nominal.parts),
                   reduction=reduction, origin=None if origin is None else origin.with_changed(changed))  # fmt: skip


def chunk_size(scene: Scene) -> int:
    """Return the number of variants of a scene whose arrays fit a cache."""
    rows, n = scene.coordinates.path.shape
    if scene.loads is not None:
        rows += len(scene.loads[0].names) + n
    if scene.shared is not None:
        rows += sum(len(part.first) for part in scene.shared.base)
    return int(max(16, CHUNK // max(1, rows * n * 6)))


def joined(parts: list[Any], key: str, count: int, size: int) -> Any:
    """Return an array of all variants, from those of chunks; those that are constant have no axis of variants there."""
    present = [part for part in parts if part is not None]
    if not present:
        return None
    axes = 1 if key == "residual" else AXES.get(key, 2)
    if len(parts) == 1 and present[0].ndim > axes:
        return present[0]
    array = next((part for part in present if part.ndim > axes), present[0])
    if len(parts) > 1 and array.ndim > axes:
        none = np.zeros((size, *array.shape[1:]))
        array = np.concatenate([none[: count - size * k] if part is None else part for k, part in enumerate(parts)])
    # a view of a single variant costs less than broadcast_to
    return array[None] if count == 1 else np.broadcast_to(array, (count, *array.shape[array.ndim - axes :]))
