"""Covariances of signals whose units may differ."""

from __future__ import annotations

from typing import Any

import numpy as np

from mbsvib.linalg.rank import SEMIDEFINITE


def are_covariances(power: Any, rounded: float = SEMIDEFINITE, definite: bool = False) -> bool:
    """Return whether matrices (..., n, n) are those of some noise: finite, Hermitian, without negative eigenvalues.

    All are scaled to correlations, so that units do not matter. ``rounded``: what rounding of printed digits may add to
    entries and eigenvalues. ``definite``: no eigenvalue is 0 either.
    """
    diagonal = np.einsum("...ii->...i", power)
    if not np.isfinite(power).all() or (diagonal.real < 0.0).any():
        return False
    size = np.sqrt(diagonal.real)
    size = np.where(size > 0.0, size, size.max(axis=-1, initial=0.0, keepdims=True))
    size = np.where(size > 0.0, size, 1.0)
    scaled = power / size[..., :, None] / size[..., None, :]
    apart = float(np.abs(scaled - scaled.conj().swapaxes(-1, -2)).max(initial=0.0))
    least = float(np.linalg.eigvalsh(scaled).min(initial=np.inf))
    return apart <= rounded and (least > 0.0 if definite else least >= -rounded)
