"""Origin of closed-loop poles, modes of the mechanism or controllers, by participation and in words."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from mbsvib.common.arrays import Array, Complex, Index
from mbsvib.feedback.pole_track import vibrates
from mbsvib.linalg.spectrum import Spectrum
from mbsvib.modes.state_modes import FORGOTTEN

ALIKE = 1e-6  # poles that differ by less than this share are repeated: any basis of their eigenspace is valid

LEAST = 0.1  # minimum participation of the mechanism in poles that are assigned to its modes


def eigen(of_a: Spectrum, rate: float | None = None) -> tuple[Complex, Array, Array]:
    """Return poles (poles,) of x' = A x, or of x+ = A x at a rate, bounds (poles,) of their rounding, and participation
    (n, poles) of states in them.

    p_ik = |v_ik w_ik| / sum over i, with the right and left eigenvectors v_k and w_k, w_k^H v_k = 1: the diagonal of
    the projection on the eigenvectors, which does not depend on units

    ``of_a``: spectrum of A. ``rate``: sampling rate [Hz]. Poles [1/s] are in ascending magnitude, without those that
    decay within a few samples; those that rounding cannot tell from 0 are 0. Columns of the participation have the sum
    1.

    Source: I. J. Perez-Arriaga, G. C. Verghese and F. C. Schweppe, IEEE Trans. Power Appar. Syst. 101 (1982) 3117.
    """
    values, errors, left, right = of_a.values, of_a.errors, of_a.left, of_a.right
    if rate is not None:
        remembered = np.abs(values) > FORGOTTEN
        errors = rate * errors[remembered] / np.abs(values[remembered])
        values, left, right = np.log(values[remembered]) * rate, left[:, remembered], right[:, remembered]
    values = np.where(np.abs(values) <= errors, 0.0, values)
    order = np.lexsort((-values.imag, np.abs(values)))
    values, errors, left, right = values[order], errors[order], left[:, order], right[:, order]
    share = np.empty(left.shape)
    todo = np.ones(len(values), dtype=bool)
    for k in range(len(values)):
        if todo[k]:
            same = np.flatnonzero(todo & (np.abs(values - values[k]) <= ALIKE * np.abs(values[k])))
            v, w = right[:, same], left[:, same]
            products = w.conj().T @ v
            products /= np.abs(products).max() or 1.0  # it is as small as the coupling of chains
            projection = np.abs(np.einsum("ij,ji->i", v, np.linalg.pinv(products) @ w.conj().T))
            share[:, same] = (projection / (projection.sum() or 1.0))[:, None]
            todo[same] = False
    return values, errors, share


def sources(poles: Complex, errors: Array, participation: Array, states: Sequence[str]) -> list[int | None]:
    """Return the mode of the mechanism, from 0, that each pole comes from, None where that is a controller.

    Oscillating poles are assigned to different modes so that the total participation is maximal.

    ``poles`` (poles,) [1/s], with their ``errors``. ``participation`` (states, poles): states of the mechanism come
    first. ``states``: their names: "mode1", "mode1'", ...
    """
    from scipy.optimize import linear_sum_assignment

    number = np.array([int(name.strip("modelrig'")) - 1 for name in states], dtype=int)
    count = int(number.max(initial=-1)) + 1
    rest = participation[len(number) :]
    table = np.zeros((count, len(poles)))
    np.add.at(table, number, participation[: len(number)])
    largest = table.argmax(axis=0) if count else np.zeros(len(poles), dtype=int)
    modes: list[int | None] = [
        int(mode) if count and table[mode, k] > rest[:, k].sum() else None for k, mode in enumerate(largest)
    ]
    waves = np.flatnonzero(vibrates(poles, errors) & (poles.imag > 0.0))
    row, column = linear_sum_assignment(-table[:, waves])
    assigned = dict(zip(waves[column].tolist(), row.tolist(), strict=True))
    for k in waves.tolist():
        modes[k] = assigned.get(k) if table[:, k].sum() >= LEAST else None
    return modes


def origins(system: Any, states: Sequence[str], poles: Complex, errors: Array, participation: Array) -> tuple[str, ...]:
    """Return where each pole comes from: a mode of the plant, or the controller.

    ``states``: names of the plant's states, which come before those of controllers. ``poles`` (poles,) of the closed
    loop [1/s], with their ``errors``. ``participation`` (states, poles).
    """
    if getattr(system, "basis", None) is None:  # given states belong to no mode of their own
        plant = participation[: len(states)].sum(axis=0)
        return tuple(["plant" if share >= 0.5 else "controller" for share in plant.tolist()])
    modes = system.modes()
    strongest = modes.strongest()
    return tuple([
        "controller" if mode is None
        else f"mode {mode + 1} ({modes.frequencies[mode]:.4g} Hz, {' '.join(strongest[mode])})"
        for mode in sources(poles, errors, participation, states)
    ])  # fmt: skip


def unstable(poles: Complex, errors: Array) -> Index:
    """Return the numbers of unstable poles (poles,) [1/s], one of each pair; those within their ``errors`` of the
    imaginary axis are stable.
    """
    return np.flatnonzero((poles.real > errors) & (poles.imag >= 0.0))


def shown_damping(poles: Complex, errors: Array) -> Array:
    """Return damping ratios -Re(pole)/|pole| (poles,) for tables: 0 where real parts are nothing but rounding.

    ``poles`` (poles,) [1/s], none of them 0, with their ``errors``.
    """
    return np.where(np.abs(poles.real) > errors, -poles.real / np.abs(poles), 0.0)


def described(poles: Complex, comes_from: Sequence[str], numbers: Index) -> tuple[str, ...]:
    """Return origin, frequency and damping ratio of poles with some numbers, in words."""
    return tuple([
        f"{comes_from[i]} at {abs(poles[i]) / (2.0 * np.pi):.4g} Hz, damping ratio "
        f"{-100.0 * poles[i].real / abs(poles[i]):.3g} %" for i in numbers.tolist()
    ])  # fmt: skip
