"""How far the last printed digit of the data moves the eigenvalues, to first order."""

from __future__ import annotations

from decimal import Decimal
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.errors import MbsvibError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mbsvib.api.rolling_system import RollingSystem
    from mbsvib.common.arrays import Array, Complex

# A number with as many significant digits was computed, or printed with all its digits: it is known to its rounding.
ALL_DIGITS = 15


def half_last_digit(value: float) -> float:
    """Return half a unit in the last printed digit of a number; half its spacing if it has all digits, 0 for zero.

    The digits are the shortest that give the number back. Zeros behind the last other digit and before the decimal
    point count as printed: 200.0 is known to 0.5.
    """
    if value == 0.0:
        return 0.0
    _, digits, exponent = Decimal(repr(value)).normalize().as_tuple()
    if len(digits) >= ALL_DIGITS:
        return 0.5 * float(np.spacing(abs(value)))
    return 0.5 * 10.0 ** min(int(exponent), 0)


def accuracy_radius(
    values: Mapping[str, float], eigenvalues: Complex, slopes: Complex
) -> tuple[float, float, str, int, tuple[str, ...]]:
    """Return bounds on the relative change of eigenvalues, to first order in all numbers of the model at once.

    ``values`` of the parameters (p) by name, ``slopes`` (p, eigenvalues) of the eigenvalues to them.

    |d lambda_k| <= sum over p of |d lambda_k / dp| delta_p,  delta_p half a unit in the last printed digit of p

    Returns the largest bound over all eigenvalues that are not 0; the same with delta_p = eps |p| / 2; the parameter
    with the largest part in the first; the number of its eigenvalue; and the parameters without a derivative, such as
    those that tilt one pin of a planar loop, which are taken as exact. Numbers that are 0 are taken as exact.
    """
    names, at = list(values), np.array(list(values.values()))
    slopes = np.abs(slopes)
    exact = ~np.asarray(np.isfinite(slopes).all(axis=1))
    slopes[exact] = 0.0
    moving = eigenvalues != 0.0
    if not moving.any() or not names:
        return 0.0, 0.0, "", 0, ()
    relative: Array = slopes[:, moving] / np.abs(eigenvalues[moving])
    parts = relative * np.array([half_last_digit(float(value)) for value in at])[:, None]
    total = parts.sum(axis=0)
    k = int(total.argmax())
    rounding = float((relative * (0.5 * np.finfo(float).eps * np.abs(at))[:, None]).sum(axis=0).max())
    known = zip(names, exact.tolist(), at.tolist(), strict=True)
    left_out = tuple(name for name, one, value in known if one and value != 0.0)
    return float(total[k]), rounding, names[int(parts[:, k].argmax())], int(np.flatnonzero(moving)[k]), left_out


def rolling_slopes(system: RollingSystem, values: Mapping[str, float]) -> Complex:
    """Return derivatives (p, eigenvalues) of a system on rolling wheels; not a number where a change is refused, as one
    of a wheel's axle alone, and zero for parameters that are 0.
    """
    result = np.zeros((len(values), len(system.states)), dtype=complex)
    for row, (name, value) in zip(result, values.items(), strict=True):
        if value != 0.0:
            try:
                row[:] = system.eigenvalue_sensitivities(name)[0]
            except MbsvibError:
                row[:] = np.nan
    return result
