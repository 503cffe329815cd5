"""Modes of all variants, with an axis of variants in front."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from mbsvib.common.arrays import Array, Bools, Complex, Index
from mbsvib.common.columnar import Columnar, numbered
from mbsvib.common.display import Displayed
from mbsvib.equations.batch_equations import BatchEquations, of_variant
from mbsvib.errors import ResponseError
from mbsvib.modes import RTOL, Modes, modes
from mbsvib.modes.batch_damped import DampedBatch, damped_batch, joined, undamped_batch
from mbsvib.modes.damped import Damped
from mbsvib.modes.pairs import damping_ratios, growing, natural_frequencies, of_all

# State matrices of one piece of a batch stay in the second-level cache.
PIECE_BYTES = 2**20


@dataclass(frozen=True, repr=False, eq=False)
class BatchModes(Columnar, Displayed):
    """The modes of n variants, sorted by natural frequency in each variant; ``modes[i]`` are those of variant i.

    ``pairs`` and ``pair_errors`` (n, m, 2), ``shapes`` (n, m, m), ``classical`` (n,), ``rigid`` (n,) and
    ``first_order`` (n, m), None where no variant has such modes, are those of ``Modes`` with an axis of variants in
    front. Mode numbers do not track modes from variant to variant: where two frequencies cross, the modes swap
    numbers. ``damped`` are the modes computed for all variants together, None where each variant was solved separately.
    """

    batch: BatchEquations = field(repr=False)
    pairs: Complex
    pair_errors: Array
    shapes: Array | Complex
    classical: tuple[str, ...]
    rigid: Index
    damped: DampedBatch | None = field(repr=False)
    _separate_modes: Mapping[int, Modes] = field(repr=False)
    form: type[Modes] = field(default=Modes, repr=False)
    first_order: Bools | None = None

    @cached_property
    def eigenvalues(self) -> Complex:
        """Eigenvalues [1/s], shape (n, 2m), two for each mode; (n, 2m - massless) with modes of first order."""
        return np.asarray(of_all(self.pairs, self.first_order).reshape(len(self), -1))

    @cached_property
    def errors(self) -> Array:
        """Estimated relative errors of the eigenvalues, shape (n, 2m)."""
        return np.asarray(of_all(self.pair_errors, self.first_order).reshape(len(self), -1))

    def columns(self) -> dict[str, Any]:
        """Return a row for each variant: what varies, natural frequencies [Hz] and damping ratios of modes 1, 2, ..."""
        by_mode = {"frequency_hz": self.frequencies, "damping_ratio": self.damping_ratios}
        return {**self.batch.parameters, **numbered(by_mode)}

    @cached_property
    def natural(self) -> Array:
        """Natural angular frequencies [rad/s], shape (n, m): |lambda|, of a real pair the geometric mean."""
        return natural_frequencies(self.pairs)

    @cached_property
    def frequencies(self) -> Array:
        """Natural (undamped) frequencies [Hz], shape (n, m)."""
        return self.natural / (2.0 * np.pi)

    @cached_property
    def damped_frequencies(self) -> Array:
        """Damped frequencies [Hz], shape (n, m), 0 for modes that do not oscillate."""
        return np.abs(self.pairs[..., 0].imag) / (2.0 * np.pi)

    @cached_property
    def damping_ratios(self) -> Array:
        """Damping ratios, shape (n, m), as of a single system's modes."""
        return damping_ratios(self.pairs)

    @cached_property
    def body_shapes(self) -> dict[str, Array | Complex]:
        """Displacements of the bodies, {name: (n, 6, m)}: translation of the centre of mass and rotation, world."""
        motion = self.batch.body_motion @ self.shapes[:, None]
        return {name: motion[:, i] for i, name in enumerate(self.batch.bodies)}

    @cached_property
    def stable(self) -> Bools:
        """Whether no mode of a variant is unstable, shape (n,)."""
        return np.asarray(~growing(self.pairs, self.pair_errors).any(axis=(1, 2)))

    def __len__(self) -> int:
        return len(self.pairs)

    def __iter__(self) -> Iterator[Modes]:
        return (self[i] for i in range(len(self)))

    def __getitem__(self, i: int) -> Modes:
        k = range(len(self))[i]
        if k in self._separate_modes:
            return self._separate_modes[k]
        batch = self.batch
        assert self.damped is not None  # it is None only if every variant was solved separately
        shapes = self.shapes[k].real if self.classical[k] else self.shapes[k]
        return self.form(batch.name, batch.coordinates, batch.bodies, self.eigenvalues[k], self.errors[k], shapes,
                         self.classical[k], int(self.rigid[k]), batch.body_motion[k], batch.inertia_factor[k],
                         self.damped.single(k))  # fmt: skip

    def __repr__(self) -> str:
        low, high = (self.frequencies.min(), self.frequencies.max()) if self.frequencies.size else (0.0, 0.0)
        return f"BatchModes({self.batch.name!r}: {len(self)} variants, {low:.6g} to {high:.6g} Hz)"


def batch_modes(batch: BatchEquations, rtol: float = RTOL, form: type[Modes] = Modes) -> BatchModes:
    """Return the modes of all variants, (lambda^2 M_i + lambda C_i + K_i) phi = 0.

    ``rtol``: required relative accuracy of every eigenvalue; variants that the common solution does not solve to it are
    solved separately.
    """
    if not batch.symmetric:
        return _solved_separately(batch, rtol, form)
    size = max(1, PIECE_BYTES // (64 * max(1, batch.dof) ** 2))
    parts = [batch.slice(start, min(start + size, len(batch))) for start in range(0, len(batch), size)]
    result = joined([damped_batch(part, undamped_batch(part, rtol), rtol) for part in parts])
    classical = np.array([bool(reason) for reason in result.classical])
    shapes: Array | Complex = result.shapes.copy()
    if not classical.all():
        together = result.shapes @ result.vectors[..., 0]
        largest = np.take_along_axis(together, np.abs(together).argmax(axis=1)[:, None], 1)
        aligned_shapes = together * np.divide(np.abs(largest), largest, out=np.ones_like(largest), where=largest != 0.0)
        shapes = np.where(classical[:, None, None], result.shapes, aligned_shapes)
    reasons, rigid = list(result.classical), np.zeros(len(batch), dtype=np.intp)
    separate_modes: dict[int, Modes] = {}
    for i in np.flatnonzero(~result.accurate).tolist():
        variant = modes(of_variant(batch, i, parts=False), rtol, True, form)
        separate_modes[i] = variant
        result.pairs[i], result.errors[i] = variant.pairs, variant.pair_errors
        reasons[i], rigid[i] = variant.classical, variant.rigid
        if np.iscomplexobj(variant.shapes) and not np.iscomplexobj(shapes):
            shapes = shapes.astype(complex)
        shapes[i] = variant.shapes
        modal = variant.damped
        assert isinstance(modal, Damped)  # these variants are symmetric
        result.shapes[i], result.square[i] = modal.shapes, modal.square
        result.gamma[i] = np.diag(modal.gamma) if modal.gamma.ndim == 1 else modal.gamma
    return BatchModes(batch, result.pairs, result.errors, shapes, tuple(reasons), rigid, result, separate_modes, form)


def _solved_separately(batch: BatchEquations, rtol: float, form: type[Modes]) -> BatchModes:
    """Modes of variants with unsymmetric matrices or massless motions, each variant solved separately."""
    separate_modes = [modes(of_variant(batch, i, parts=False), rtol, True, form) for i in range(len(batch))]
    counts = [len(variant) for variant in separate_modes]
    if other := next((i for i, count in enumerate(counts) if count != counts[0]), None):
        raise ResponseError(
            f"modes: real eigenvalues of variant {other} belong to {counts[other]} modes, those of variant 0 to "
            f"{counts[0]}. Batches do not support different numbers of modes; take batch[i].modes() of each variant."
        )
    first_order = np.array([np.zeros(len(variant), dtype=bool) if variant.first_order is None else variant.first_order
                            for variant in separate_modes])  # fmt: skip
    return BatchModes(
        batch, np.array([variant.pairs for variant in separate_modes]),
        np.array([variant.pair_errors for variant in separate_modes]),
        np.array([variant.shapes for variant in separate_modes]),
        tuple(variant.classical for variant in separate_modes),
        np.array([variant.rigid for variant in separate_modes], dtype=np.intp), None, dict(enumerate(separate_modes)),
        form,
        first_order if first_order.any() else None,
    )  # fmt: skip
