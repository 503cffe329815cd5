"""Motions without mass in batches: separated in each variant as in the nominal model."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.equations.batch_geometry import scene_of_variant
from mbsvib.equations.batch_one_by_one import check_massless
from mbsvib.equations.massless_separation import separated
from mbsvib.errors import MbsvibError, ModelError
from mbsvib.linalg.rank import CERTAIN_MASS, ZERO_SUM

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.equations.draft import Draft
    from mbsvib.equations.equations import Equations
    from mbsvib.equations.terms import Terms

# Variants whose dampers hold the motions worse than this (inverse condition) are separated by themselves.
SUSPECT_DAMPING = 1e-6


@dataclass(frozen=True)
class Separating:
    """The ``draft`` of some variants before motions without mass are separated; ``first`` is the index of the first
    variant.
    """

    draft: Draft
    first: int
    nominal: Equations

    @property
    def terms(self) -> Terms:
        """The terms before the separation."""
        return self.draft.terms

    @property
    def constant(self) -> bool:
        """Whether these motions move dampers, and are the same in all variants: none of them gets a mass, and all
        others keep theirs.
        """
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
