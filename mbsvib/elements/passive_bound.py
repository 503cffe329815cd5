"""The least error that any passive model of a stiffness over frequency has, by a linear programme.

Any passive K(s) has Im K(i w) = w h(w) with h >= 0, and Re K follows from h.

Source: Boyd & Chua, Int. J. Circuit Theory 10 (1982) 113, for positive real functions.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from mbsvib.common.arrays import Array, Complex

# Bins a decade, and so many decades beyond the band.
BINS, OUTSIDE = 40, 2


def least_error(factor: Callable[[Array], Complex], low: float, high: float) -> float:
    """Return the least relative error, of real and imaginary part, that any passive model has from ``low`` to ``high``
    [rad/s].

    K(i w) = c0 - w^2 c2 + i w h(w) - (w / pi) integral of h over pairs of bins, h constant in each bin
    """
    from scipy.optimize import linprog

    beyond = np.geomspace(low, low / 10**OUTSIDE, BINS * OUTSIDE // 4 + 1)[:0:-1]
    inside = np.geomspace(low, high, max(8, int(np.ceil(BINS * np.log10(high / low)))) + 1)
    above = np.geomspace(high, high * 10**OUTSIDE, BINS * OUTSIDE // 4 + 1)[1:]
    edges = np.concatenate((beyond, inside, above))
    start, end = np.concatenate(([0.0], edges)), np.concatenate((edges, [np.inf]))
    omega = np.sqrt(inside[:-1] * inside[1:])
    exact = factor(omega)
    w = omega[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        upper = np.where(np.isinf(end), 0.0, np.log(np.abs((end - w) / (end + w))))
        columns = -(w / np.pi) * (upper + np.log(np.abs((start + w) / (start - w))))
    within = (start < w) & (w < end)
    scale = 1.0 / np.sqrt(low * high)
    real = np.column_stack((np.ones(len(omega)), -((omega * scale) ** 2), columns * scale))
    imaginary = np.column_stack((np.zeros((len(omega), 2)), np.where(within, w, 0.0) * scale))
    size = np.abs(exact)[:, None]
    rows = np.concatenate((real / size, imaginary / size))
    target = np.concatenate((exact.real, exact.imag)) / np.concatenate((size, size))[:, 0]
    bound = -np.ones((len(rows), 1))
    found = linprog(np.append(np.zeros(rows.shape[1]), 1.0), np.block([[rows, bound], [-rows, bound]]),
                    np.concatenate((target, -target)), bounds=(0.0, None), method="highs")  # fmt: skip
    return float(found.fun) if found.success else float("nan")
