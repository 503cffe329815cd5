"""Frequency responses that files carry along, to be checked by whoever reads them, and the points for it."""

from __future__ import annotations

from typing import Any

import numpy as np

from mbsvib.api.system import System
from mbsvib.common.arrays import Array, Complex
from mbsvib.errors import ExportError
from mbsvib.linalg.balancing import exponents, scaled_by
from mbsvib.responses.state_space import StateSpace
from mbsvib_export.neutral import SystemData

MOST_POINTS = 12
CANCELLED = 1e-4  # of the size of terms that cancel each other, which their sum is measured by at least


def check_points(eigenvalues: Complex) -> Array:
    """Return ascending angular frequencies [rad/s] near, below and above resonances, none of them an undamped pole."""
    size = np.unique(np.abs(eigenvalues[np.abs(eigenvalues) > 1e-9 * np.abs(eigenvalues).max(initial=0.0)]))
    if not len(size):
        return np.array([1.0, 10.0])
    distinct = size[np.concatenate(([True], np.diff(size) > 1e-3 * size[1:]))]
    selected = distinct[np.unique(np.linspace(0, len(distinct) - 1, MOST_POINTS - 2).round().astype(int))]
    return np.unique(np.concatenate(([0.1 * size[0]], 1.002 * selected, [3.0 * size[-1]])))


def poles(a: Array) -> Complex:
    """Return the eigenvalues of A (n, n), complex (n,) [1/s], computed from balanced states."""
    none = np.zeros((len(a), 0))
    power = exponents(a, none, none.T)
    return np.asarray(np.linalg.eigvals(np.ldexp(a, power[None, :] - power[:, None])), dtype=complex)


def poles_of(model: System | SystemData | StateSpace) -> Complex:
    """Return the poles (n,) [1/s] of a system, or of what was read from a file."""
    return poles(model.state_space.A) if isinstance(model, SystemData) else model.poles()


def response_of(model: System | SystemData | StateSpace, omega: Array) -> Complex:
    """Return the frequency response (outputs, inputs, n) of a system, or of what was read from a file."""
    return second_order_response(model, omega) if isinstance(model, SystemData) else model.frequency_response(omega)


def state_space_response(space: StateSpace, omega: Array) -> Complex:
    """Return C (i w - A)^-1 B + D (outputs, inputs, n) of a state space at ``omega`` (n,) [rad/s]."""
    power = exponents(space.A, space.B, space.C)
    a, b, c = scaled_by(power, space.A, space.B, space.C)
    identity = np.eye(len(a))
    return np.stack([c @ np.linalg.solve(1j * w * identity - a, b) + space.D for w in omega], axis=-1)


def motions(model: System | SystemData, w: float) -> Complex:
    """Return (K + i w C - w^2 M)^-1 B (coordinates, inputs) at an angular frequency [rad/s]."""
    return np.asarray(np.linalg.solve(model.K + 1j * w * model.C - w * w * model.M, model.B), dtype=complex)


def second_order_response(data: SystemData, omega: Array) -> Complex:
    """Return (Cq + i w Cv - w^2 Ca) (K + i w C - w^2 M)^-1 B + D, (outputs, inputs, n), at ``omega`` (n,) [rad/s]."""
    return np.stack([(data.Cq + 1j * w * data.Cv - w * w * data.Ca) @ motions(data, w) + data.D for w in omega],
                    axis=-1)  # fmt: skip


def response_scale(response: Complex, model: System | SystemData | StateSpace, omega: Array) -> Array:
    """Return the scale (outputs, inputs, n) of errors of a response: its largest entry between ports of equal units.

    Large terms may cancel in an output, by symmetry or above all resonances. The scale is at least ``CANCELLED`` times
    the size of these terms, as their rounding remains; it is 1 where all is zero.
    """
    terms: Any = _terms_of_states if isinstance(model, StateSpace) else _terms_of_coordinates
    result = CANCELLED * np.stack([terms(model, w) for w in omega], axis=-1)
    size = np.abs(response)
    for output in set(model.output_units):
        rows = [i for i, unit in enumerate(model.output_units) if unit == output]
        for input_unit in set(model.input_units):
            block = np.ix_(rows, [i for i, unit in enumerate(model.input_units) if unit == input_unit])
            result[block] = np.maximum(result[block], size[block].max(axis=(0, 1), initial=0.0))
    return np.where(result > 0.0, result, 1.0)


def _terms_of_states(space: StateSpace, w: float) -> Array:
    """Sizes (outputs, inputs) of the terms that outputs are sums of."""
    states = np.linalg.solve(1j * w * np.eye(len(space.A)) - space.A, space.B)
    return np.asarray(np.abs(space.C) @ np.abs(states) + np.abs(space.D))


def _terms_of_coordinates(model: System | SystemData, w: float) -> Array:
    """Sizes (outputs, inputs) of terms, each coordinate having the energy of the one with most."""
    size = np.sqrt(np.abs(np.diag(model.K)) + w * w * np.abs(np.diag(model.M)))[:, None]
    size[size == 0.0] = 1.0
    largest = (np.abs(motions(model, w)) * size).max(axis=0, initial=0.0) / size
    weights = np.abs(model.Cq) + w * np.abs(model.Cv) + w * w * np.abs(model.Ca)
    return np.asarray(weights @ largest + np.abs(model.D))


def response_error(actual: Complex, truth: Complex, model: System | SystemData | StateSpace, omega: Array) -> float:
    """Return the largest difference [1] of two responses by the ``response_scale`` of a model; infinity if not finite.
    """
    if actual.shape != truth.shape:
        raise ExportError(f"responses have shapes {actual.shape} and {truth.shape}; expected the same inputs, outputs "
                          f"and frequencies.")  # fmt: skip
    if not np.isfinite(actual).all():
        return float("inf")
    return float(np.max(np.abs(actual - truth) / response_scale(truth, model, omega), initial=0.0))
