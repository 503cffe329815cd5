"""What goes into an FMU: a state space, sizes of its states, and parameters on which its matrices depend affinely."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbsvib.common.arrays import Array, Complex
from mbsvib.common.selection import Names
from mbsvib.equations.matrices import MATRICES
from mbsvib.errors import ExportError
from mbsvib.linalg.groups import part_numbers
from mbsvib.responses.from_control import is_control, is_transfer_function, of_control
from mbsvib.responses.state_space import StateSpace
from mbsvib_export.affine import physical_affine
from mbsvib_export.neutral import check_finite, state_space_of, with_ports

Mask = NDArray[np.bool_]


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


@dataclass(frozen=True, slots=True)
class Tunable:
    """A parameter on which the matrices depend affinely: derivatives ``slope`` of the entries at ``indices``, which
    counts from the start of A through B, C, D, E and F, row by row.
    """

    name: str
    unit: str
    value: float
    indices: NDArray[np.int64]
    slope: Array


@dataclass(frozen=True, slots=True)
class Plant:
    """E x' = A x + B u,  y = C x + F x' + D u; E and F are there only where parameters are ``tunable``.

    ``space`` has A, B, C, D; ``nominal`` are sizes of states, ``times`` stop time and step [s] of the experiment.
    """

    space: StateSpace
    nominal: Array
    times: tuple[float, float]
    E: Array | None = None
    F: Array | None = None
    tunable: tuple[Tunable, ...] = ()

    @property
    def blocks(self) -> NDArray[np.int64]:
        """First rows of the diagonal blocks of A, and the number of states."""
        n, coupled = len(self.space.states), self.space.A != 0
        if n == 0 or self.tunable:
            return np.unique(np.array([0, n], dtype=np.int64))
        index = np.arange(n)
        last_index = np.maximum(index, np.where(coupled | coupled.T, index, -1).max(axis=1))
        ends = np.flatnonzero(np.maximum.accumulate(last_index) == index) + 1
        return np.concatenate(([0], ends)).astype(np.int64)


def plant_of(source: Any, realization: str, tunable: tuple[str, ...], outputs: Names, inputs: Names) -> Plant:
    """Return what goes into an FMU; with ``tunable`` parameters states are physical: others would change with them."""
    if of_control(source):
        _check_control(source, tunable)
    if not tunable:
        space = state_space_of(source, realization, "to_fmu", outputs, inputs)
        check_finite(space, "to_fmu")
        return Plant(space, *_scales(space))
    form = physical_affine(with_ports(source, outputs, inputs), tunable, realization, "to_fmu", "tunable")
    space = form.nominal.state_space()
    a, b, c, d, e, f = descriptor = _first_order(*(getattr(form.nominal, label) for label in MATRICES), unit=1.0)
    starts = np.cumsum([0, *(matrix.size for matrix in descriptor[:-1])])
    entries = []
    for i, name in enumerate(form.names):
        slopes = _first_order(*(form.slopes[label][i] for label in MATRICES), unit=0.0)
        cells = [np.flatnonzero(matrix) for matrix in slopes]
        entries.append(Tunable(
            name, form.units[i], float(form.values[i]),
            np.concatenate([start + matrix for start, matrix in zip(starts, cells, strict=True)]).astype(np.int64),
            np.concatenate([matrix.ravel()[k] for matrix, k in zip(slopes, cells, strict=True)]),
        ))  # fmt: skip
    return Plant(replace(space, A=a, B=b, C=c, D=d), *_scales(space), e, f, tuple(entries))


def _scales(space: StateSpace) -> tuple[Array, tuple[float, float]]:
    """Nominal values of the states (n,), and stop time and step [s] of the default experiment."""
    values = np.linalg.eigvals(space.A).astype(complex)
    return nominal_values(space, values), experiment_times(values)


def _check_control(source: Any, tunable: tuple[str, ...]) -> None:
    """Refuse what is no continuous system of python-control, and parameters of one."""
    if not (is_control(source) or is_transfer_function(source)):
        raise ExportError(f"to_fmu: system = control.{type(source).__name__}; expected a control.StateSpace or "
                          f"control.TransferFunction.")  # fmt: skip
    name = str(source.name)
    if tunable:
        raise ExportError(f"to_fmu: tunable = {tunable!r}, but '{name}' comes from python-control, which knows no "
                          f"parameters; give a System (model.linearize()).")  # fmt: skip
    if source.dt not in (0, None):
        raise ExportError(f"to_fmu: '{name}' is discrete in time (dt = {source.dt}); expected one in continuous time. "
                          f"Design it in continuous time, or give control.d2c or an equivalent of it.")  # fmt: skip
    if is_control(source):
        check_finite(source, "to_fmu")


def _first_order(
    mass: Array, damping: Array, stiffness: Array, b: Array, cq: Array, cv: Array, ca: Array, d: Array, *, unit: float
) -> tuple[Array, Array, Array, Array, Array, Array]:
    """A, B, C, D, E, F with x = (q, q'); ``unit`` is 1 for the equations and 0 for their derivatives."""
    m = len(mass)
    identity, none = unit * np.eye(m), np.zeros((m, m))
    return (
        np.block([[none, identity], [-stiffness, -damping]]), np.concatenate((np.zeros_like(b), b)),
        np.concatenate((cq, cv), axis=1), d, np.block([[identity, none], [none, mass]]),
        np.concatenate((np.zeros_like(ca), ca), axis=1),
    )  # fmt: skip


def patterns(plant: Plant) -> dict[str, Mask]:
    """Return where E^-1 A, E^-1 B, C + F E^-1 A and D + F E^-1 B may differ from zero for any values of the parameters.
    """
    assert plant.E is not None
    assert plant.F is not None
    matrices = (*(getattr(plant.space, label) for label in "ABCD"), plant.E, plant.F)
    flat = np.concatenate([item.ravel() != 0 for item in matrices])
    for item in plant.tunable:
        flat[item.indices] = True
    ends = np.cumsum([item.size for item in matrices])[:-1]
    a, b, c, d, e, f = (part.reshape(item.shape) for part, item in zip(np.split(flat, ends), matrices, strict=True))
    part = part_numbers(e)
    joined = part[:, None] == part
    a, b = joined @ a, joined @ b
    return {"A": a, "B": b, "C": c | (f @ a), "D": d | (f @ b)}
