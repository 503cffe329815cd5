"""Frequencies of margins and figures, checked."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.errors import ResponseError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from mbsvib.common.arrays import Array


def checked(frequencies: ArrayLike) -> Array:
    """Return a copy of ascending ``frequencies`` (n,) [Hz], from 0 Hz on."""
    try:
        f = np.array(frequencies, dtype=float, ndmin=1)
    except (TypeError, ValueError) as error:
        raise ResponseError(f"isolation: frequencies = {frequencies!r}; expected numbers [Hz].") from error
    if f.ndim != 1 or not len(f) or not np.isfinite(f).all() or f[0] < 0.0 or (np.diff(f) <= 0.0).any():
        reason = "an empty range" if not f.size else f"shape {f.shape}, from {f.flat[0]:g} to {f.flat[-1]:g} Hz"
        raise ResponseError(f"isolation: frequencies: {reason}; expected at least one frequency from 0 Hz on, each "
                            f"higher than the one before.")  # fmt: skip
    return f
