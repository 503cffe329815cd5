"""Poles of closed loops in words: where each comes from, and which are unstable."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.feedback.participation import sources

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array, Complex, Index

def origins(
    system: Any, states: Sequence[str], poles: Complex, errors: Array, participation: Array
) -> tuple[str, ...]:  # fmt: skip
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
