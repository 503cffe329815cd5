"""Derivatives of the eigenvalues of mechanisms on rolling wheels to their parameters.

l' = y^H A' x / (y^H x), with A' by central differences with extrapolation. A is a polynomial of second order in the
speed of travel, of which these differences are exact but for rounding; to other parameters they have some ten digits.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import eig

from mbsvib.common.arrays import Array, Complex
from mbsvib.errors import ModelError
from mbsvib.linalg.differences import slope
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.modes.result import Modes
from mbsvib.rolling.equations import rolling_equations
from mbsvib.sensitivities.shapes import ModeSensitivities

# Steps relative to the value of a parameter, or absolute for one that is 0 [m, m/s, rad].
STEP = 1e-2


@dataclass(frozen=True, repr=False)
class RollingSensitivities(ModeSensitivities):
    """Derivatives of the modes to ``variables`` (v,): ``eigenvalues`` (v, n), ``frequencies``, ``damping_ratios``."""

    units: Any = None

    @property
    def _units(self) -> Mapping[str, str]:
        result: Mapping[str, str] = self.units
        return result

    @property
    def shapes(self) -> Complex:
        """Refused: derivatives of shapes are those of systems without rolling wheels."""
        raise ModelError(f"mode_sensitivities: '{self.modes.name}' has rolling wheels; derivatives of its shapes are "
                         f"not available, those of eigenvalues are.")  # fmt: skip


def sensitivities(
    model: Mechanism, states: Sequence[str], independent: Sequence[str], modes: Modes, names: Sequence[str]
) -> RollingSensitivities:  # fmt: skip
    """Return the derivatives of ``modes``, those of a model with these ``states``, to parameters by their names."""
    parameters = model.parameters
    chosen = list(dict.fromkeys(name for pattern in names for name in parameters.matching(pattern)))
    base = rolling_equations(model, independent).a
    rows = [_eigenvalue_slopes(base, _matrix_slope(model, name, states, independent), modes.eigenvalues)
            for name in chosen]  # fmt: skip
    nothing: Any = None
    return RollingSensitivities(tuple(chosen), modes, np.array(rows).reshape(len(rows), -1), nothing, nothing,
                                units=parameters.units)  # fmt: skip


def _matrix_slope(model: Mechanism, name: str, states: Sequence[str], independent: Sequence[str]) -> Array:
    value = model.parameters[name]
    step = STEP * (abs(value) or 1.0)

    def at(change: float) -> Array:
        varied = rolling_equations(model.with_values({name: value + change}), independent)
        if varied.states != tuple(states):
            raise ModelError(f"mode_sensitivities: other states describe the model when '{name}' changes "
                             f"({', '.join(varied.states)}); name some by linearize(independent=[...]).",
                             element=name, field="parameters")  # fmt: skip
        return varied.a

    return slope(at, step)[0]


def _eigenvalue_slopes(a: Array, change: Array, values: Complex) -> Complex:
    """Derivatives of eigenvalues in the order of ``values``; those that are 0 by structure stay so."""
    poles, left, right = eig(a, left=True)
    result = np.zeros(len(values), dtype=complex)
    open_poles = list(range(len(poles)))
    for k, value in enumerate(values):
        nearest = min(open_poles, key=lambda i: abs(poles[i] - value))
        open_poles.remove(nearest)
        if value != 0.0:
            y, x = left[:, nearest].conj(), right[:, nearest]
            result[k] = (y @ change @ x) / (y @ x)
    return result
