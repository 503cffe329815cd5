"""What pairs of eigenvalues say of their modes: frequency, damping, growth; any axes in front."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Complex

# A real part below the estimated error of its eigenvalue is rounding, but never one above this share of the eigenvalue.
ROUNDED = 1e-9


def natural_frequencies(pairs: Complex) -> Array:
    """Return |lambda|, of a real pair the geometric mean [rad/s], (...,), of pairs (..., 2)."""
    return np.asarray(np.sqrt(np.abs(pairs[..., 0] * pairs[..., 1])))


def damping_ratios(pairs: Complex) -> Array:
    """Return -Re(lambda) / |lambda| (...,) of pairs (..., 2): -1 if one diverges, of damped rigid motions infinite."""
    first, second = pairs[..., 0], pairs[..., 1]
    total, natural = 0.0 - (first + second).real, natural_frequencies(pairs)
    ratio = np.divide(total, 2.0 * natural, out=np.where(total > 0.0, np.inf, 0.0), where=natural > 0.0)
    return np.where((first * second).real < 0.0, -1.0, ratio)


def growing(values: Complex, errors: Array) -> NDArray[np.bool_]:
    """Tell which eigenvalues have real parts that are positive by more than rounding, for their relative errors."""
    return np.asarray(values.real > np.minimum(errors, ROUNDED) * np.abs(values))
