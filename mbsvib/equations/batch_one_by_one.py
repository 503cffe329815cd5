"""Batches whose variants are linearized one after the other, for mechanisms with any elements.

Rows and parts of matrices that only some variants have, such as those of geometric stiffness or spin, are zero in the
others.

Motions without mass are separated in each variant as in the nominal model.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.equations.assembly import linearized
from mbsvib.equations.batch_equations import FACTORS, BatchEquations
from mbsvib.equations.batch_loops import HELP, check_freedom
from mbsvib.equations.batch_values import Values
from mbsvib.equations.draft import Draft
from mbsvib.equations.equations import Equations, Separation
from mbsvib.equations.massless_separation import separated
from mbsvib.equations.matrices import MATRICES, OPTIONAL, Matrices, Terms
from mbsvib.equations.placing import scene_of_variant
from mbsvib.errors import MbsvibError, ModelError, NearSingularWarning, SingularPoseError
from mbsvib.linalg.rank import CERTAIN_MASS, ZERO_SUM
from mbsvib.mechanism.mechanism import Mechanism

B = TypeVar("B", bound=BatchEquations)

ROWS = ("elastic_rows", "row_stiffness", "row_damping")


def one_by_one(
    variant: Callable[[int], Mechanism], nominal: Equations, variants: Values, cut: Sequence[str] | None, batch: type[B]
) -> B:
    """Return a batch of any model, whose variants are linearized one after the other; ``variant`` returns them."""
    systems = [linearized_variant(variant, nominal, cut, i) for i in range(variants.count)]
    provenances = tuple([system.provenance for system in systems])
    return batch(nominal=nominal, values=variants, closure=None, massless=nominal.massless, provenances=provenances,
                 **stacked(systems, nominal.dof))  # fmt: skip


def stacked(systems: Sequence[Matrices], dof: int) -> dict[str, Any]:
    """Return the arrays of systems with an axis of variants in front; rows of one owner are in the same places."""
    arrays: dict[str, Any] = {key: np.array([getattr(system, key) for system in systems])
                              for key in (*MATRICES, *FACTORS) if key not in ROWS}  # fmt: skip
    arrays |= {key: _stacked([getattr(system, key) for system in systems]) for key in OPTIONAL}
    counts = [np.bincount(system.row_owner, minlength=1) for system in systems]
    width = max(map(len, counts))
    rows_per_owner = np.max([np.pad(count, (0, width - len(count))) for count in counts], axis=0)
    first_row = np.concatenate(([0], np.cumsum(rows_per_owner)))
    rows, values, damping = (np.zeros((len(systems), first_row[-1], *shape)) for shape in ((dof,), (), ()))
    for i, system in enumerate(systems):
        order = np.argsort(system.row_owner, kind="stable")
        owner = system.row_owner[order]
        row_number = first_row[owner] + np.arange(len(owner)) - np.searchsorted(owner, owner)
        at = (i, row_number)
        rows[at], values[at], damping[at] = (getattr(system, key)[order] for key in ROWS)
    return arrays | {"elastic_rows": rows, "row_stiffness": values, "row_damping": damping,
                     "row_owner": np.repeat(np.arange(width), rows_per_owner)}  # fmt: skip


def linearized_variant(
    variant: Callable[[int], Mechanism], nominal: Equations, cut: Sequence[str] | None, i: int
) -> Equations:
    """Return the equations of variant ``i`` in the coordinates of the nominal pose, of the same class."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", NearSingularWarning)
        try:
            system = _in_coordinates(variant(i), nominal, cut)
            check_massless(system.provenance.separation, nominal)
            check_freedom(system.dof, nominal.dof)
        except MbsvibError as error:
            error.args = (_of_variant(i, error), *error.args[1:])
            raise
    for warning in caught:
        warnings.warn(_of_variant(i, warning.message), warning.category, stacklevel=5)
    return system


def _of_variant(i: int, message: Exception | str) -> str:
    """A message with the number of the variant in front, if it does not begin with one."""
    text = str(message)
    return text if text.startswith("variant ") else f"variant {i}: {text}"


def _in_coordinates(variant: Mechanism, nominal: Equations, cut: Sequence[str] | None) -> Equations:
    """Equations of a variant in the coordinates of the nominal pose."""
    try:
        result: Equations = linearized(variant, nominal.coordinates, cut, form=type(nominal))
    except ModelError as error:
        if error.field != "independent":
            raise
        # more motions without mass, and so fewer coordinates
        check_massless(linearized(variant, None, cut).provenance.separation, nominal)
        raise SingularPoseError(f"its loops tie the coordinates {', '.join(nominal.coordinates)} of the nominal pose "
                                f"to each other. {HELP}") from error  # fmt: skip
    return result


def check_massless(separation: Separation | None, nominal: Equations) -> None:
    """Refuse a variant that has other massless motions than the nominal model, by name."""
    in_variant, in_nominal = _without_mass(separation), _without_mass(nominal.provenance.separation)
    if sorted(in_variant.values()) == sorted(in_nominal.values()):
        return  # a motion of several coordinates without mass may be named by any of them
    name = next(name for name in (*in_variant, *in_nominal) if in_variant.get(name) != in_nominal.get(name))
    moves = "moves mass"
    raise ModelError(
        f"coordinate '{name}' {in_variant.get(name, moves)}, in the nominal model it {in_nominal.get(name, moves)}. "
        f"All variants of a batch have the same motions without mass; linearize this one by itself "
        f"(model.with_values).",
        element=name, field="values",
    )  # fmt: skip


def _without_mass(separation: Separation | None) -> dict[str, str]:
    """Description of each motion without mass, by coordinate."""
    if separation is None:
        return {}
    return (dict.fromkeys(separation.condensed, "moves no mass and follows from statics")
            | dict.fromkeys(separation.first_order, "moves no mass but dampers"))  # fmt: skip


def _stacked(parts: list[Array | None]) -> Array | None:
    """Matrices of all variants, zero where a variant has none; None if all have none."""
    shape = next((part.shape for part in parts if part is not None), None)
    if shape is None:
        return None
    return np.array([np.zeros(shape) if part is None else part for part in parts])


# Variants whose dampers hold the motions worse than this (inverse condition) are separated by themselves.
SUSPECT_DAMPING = 1e-6


@dataclass(frozen=True)
class Separating:
    """The ``draft`` of variants before motions without mass are separated; ``first`` is the index of the first one."""

    draft: Draft
    first: int
    nominal: Equations

    @property
    def terms(self) -> Terms:
        """The terms before the separation."""
        return self.draft.terms

    @property
    def constant(self) -> bool:
        """Whether they move dampers and are the same in all variants: none gets a mass, and all others keep theirs."""
        separation, null, terms = self.nominal.provenance.separation, self.nominal.null_inertia, self.terms
        if separation is None or separation.condensed or null is None:
            return False
        if terms.inertia_factor.ndim == 2:
            return True
        others = np.array([name not in separation.first_order for name in self.nominal.coordinates]).nonzero()[0]
        masses = terms.M[..., others[:, None], others]
        diagonal = np.einsum("...ii->...i", masses)
        if not (diagonal > 0.0).all() or not _nothing(terms.inertia_factor, null) or (
                terms.B.ndim == 3 and not _nothing(terms.B.swapaxes(1, 2), null)):
            return False
        scaled = masses / np.sqrt(diagonal[..., None] * diagonal[..., None, :])
        return bool((np.linalg.eigvalsh(scaled)[..., :1] > CERTAIN_MASS).all())

    def with_constant_motions(self, count: int) -> Terms:
        """Return the terms with the motions of the nominal model, after a check of the dampers of all variants."""
        null = self.nominal.null_inertia
        assert null is not None
        square = np.broadcast_to(null.T @ self.terms.C @ null, (count, null.shape[1], null.shape[1]))
        size = np.sqrt(np.abs(square).sum(axis=-1))
        size = np.where(size > 0.0, size, 1.0)
        values = np.linalg.svd(square / size[..., None] / size[..., None, :], compute_uv=False)
        for i in np.flatnonzero(~(values[:, -1] > SUSPECT_DAMPING * values[:, 0])).tolist():
            self.separated(i)
        return replace(self.terms, massless=self.nominal.massless, null_inertia=null)

    def separated(self, i: int) -> Terms:
        """Return the terms of a variant with its own separation; an error names the variant by its index."""
        return self.separation_of(i).terms

    def separation_of(self, i: int) -> Draft:
        """Return a variant with its own separation; an error names the variant by its index."""
        reduction = self.draft.reduction
        if reduction.matrix is not None and reduction.matrix.ndim == 3:
            reduction = replace(reduction, matrix=reduction.matrix[i])
        draft = replace(self.draft, scene=scene_of_variant(self.draft.scene, i), reduction=reduction,
                        terms=self.terms.of_variants(i))  # fmt: skip
        try:
            return self._as_nominal(draft)
        except MbsvibError as error:
            error.args = (f"variant {self.first + i}: {error}", *error.args[1:])
            raise

    def _as_nominal(self, draft: Draft) -> Draft:
        try:
            result = separated(draft)
        except ModelError as error:
            if error.field == "independent":  # more motions without mass than in the nominal model
                check_massless(separated(replace(draft, independent=())).separation, self.nominal)
            raise
        check_massless(result.separation, self.nominal)
        return result


def _nothing(rows: Array, null: Array) -> bool:
    """Whether rows (..., n, m) are zero to rounding in motions (m, k)."""
    return bool((np.abs(rows @ null) <= ZERO_SUM * (np.abs(rows) @ np.abs(null))).all())
