"""Nominal values of states and times of the default experiment, which tell importers how accurate is accurate."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Complex
    from mbsvib.responses.state_space import StateSpace

# Importers take an absolute tolerance of the relative one times the nominal value. Errors of outputs add up over many
# steps, so that a state is as accurate as the outputs if its nominal value is this share of what outputs resolve.
SHARE = 0.1
# What an input does to an output is measured by this share at least of what it does to the others: symmetry makes some
# of it zero, whose rounding no integrator can resolve.
LEAST = 0.1
# Real s, at which no resonance is met, from below the slowest rate to above the fastest: so many, and how far beyond.
PROBES, BEYOND = 9, 3.0
# Rates below this share of the largest are rigid-body motions.
RIGID = 1e-9
# The default experiment takes so many periods of the slowest rate in so many steps, of which each takes no more than
# some periods of the fastest oscillation: integrators of importers give up after some hundred steps of their own.
PERIODS, STEPS, FAST = 20.0, 1000.0, 2.0
# Rates that decay within so many of their periods do not oscillate.
DECAYS = 1.0


def nominal_values(space: StateSpace, values: Complex) -> Array:
    """Return the nominal value of each state (n,), positive: the size at which its errors matter, to two digits.

    SHARE min |y_oj| / |v_oi| over outputs o and inputs j: y are the amplitudes of outputs for steps of one unit,
    |C (s - A)^-1 B + D|, and v those for an initial state of one unit, |s C (s - A)^-1|, each the largest for some
    real s. The value is at most SHARE times the largest amplitude for steps among the states of its unit, as it is for
    states that no output sees.

    ``values`` (n,): eigenvalues of A [1/s].
    """
    a, b, c, d = space.A, space.B, space.C, space.D
    if not len(a):
        return np.ones(0)
    if not b.any():  # no inputs: what an unknown force on everything would do
        b, d = np.eye(len(a)), np.zeros((len(c), len(a)))
    states, outputs, observed = _amplitudes((a, b, c, d), values)
    largest = outputs.max(axis=1, keepdims=True, initial=0.0)
    strength = (outputs / np.where(largest > 0.0, largest, 1.0)).max(axis=0, initial=0.0)
    outputs = np.maximum(outputs, LEAST * strength * largest)
    resolved = np.where(outputs > 0.0, outputs, np.inf).min(axis=1, initial=np.inf)
    with np.errstate(divide="ignore", over="ignore"):
        size = (resolved[:, None] / observed).min(axis=0, initial=np.inf)
    limit = np.empty(len(a))
    for unit in set(space.state_units):
        alike = np.array([own_unit == unit for own_unit in space.state_units])
        limit[alike] = states[alike].max() or 1.0
    return np.array([float(f"{value:.1e}") for value in np.clip(SHARE * np.minimum(size, limit), 1e-100, 1e100)])


def _amplitudes(space: tuple[Array, Array, Array, Array], values: Complex) -> tuple[Array, Array, Array]:
    """Amplitudes of states (n,) and of outputs (o, i) for steps of inputs, of outputs (o, n) for initial states."""
    a, b, c, d = space
    slow, fast = _rates(np.abs(values))
    start = max(0.0, float(values.real.max()))
    states, outputs, observed = np.zeros(len(a)), np.zeros(d.shape), np.zeros(c.shape)
    for s in start + np.geomspace(slow / BEYOND, BEYOND * fast, PROBES):
        inverse = np.linalg.inv(s * np.eye(len(a)) - a)
        static = inverse @ b
        states = np.maximum(states, np.abs(static).max(axis=1))
        outputs = np.maximum(outputs, np.abs(c @ static + d))
        observed = np.maximum(observed, s * np.abs(c @ inverse))
    return states, outputs, observed


def experiment_times(values: Complex) -> tuple[float, float]:
    """Return stop time and step [s] of the default experiment, of one digit: 1, 2 or 5.

    Some periods of the slowest rate of no rigid-body motion, or as many of the fastest as integrators can compute.
    """
    rates = np.abs(values)
    if not rates.any():
        return 1.0, 1.0 / STEPS
    swings = rates[np.abs(values.imag) > DECAYS / (2.0 * np.pi) * np.abs(values.real)]
    stop = 2.0 * np.pi * min(PERIODS / _rates(rates)[0], STEPS * FAST / max(swings.max(initial=0.0), 1e-300))
    power = 10.0 ** np.floor(np.log10(stop))
    digit = max(digit for digit in (1.0, 2.0, 5.0) if digit <= stop / power * (1.0 + 1e-9))
    return float(f"{digit * power:.1g}"), float(f"{digit * power / STEPS:.1g}")


def _rates(rates: Array) -> tuple[float, float]:
    """The slowest rate that is not of a rigid-body motion, and the fastest [1/s]."""
    fast = float(rates.max(initial=0.0)) or 1.0
    return float(rates[rates > RIGID * fast].min(initial=fast)), fast
