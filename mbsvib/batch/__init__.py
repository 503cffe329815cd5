"""Batches: many variants of one model, linearized in one vectorised pass.

values (what varies, checked by name and index) -> geometry (the mechanism in numbers with an axis of variants)
-> loops (B'' of all variants with the pivots of the nominal pose) -> assembly (the matrices) -> systems -> modes,
responses.
"""

from mbsvib.batch.assembly import linearize_batch
from mbsvib.batch.systems import Batch

__all__ = ["Batch", "linearize_batch"]
