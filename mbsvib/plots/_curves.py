"""Curves of frequency responses: computed where they bend, with a phase that can be read."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.errors import ResponseError
from mbsvib.plots import _choice as choice
from mbsvib.plots.grid import frequency_grid, upper_eigenvalues

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from mbsvib.system import System

    Array = NDArray[np.float64]
    Complex = NDArray[np.complex128]

ROUNDS = 6  # each halves the intervals in which a curve bends
BEND_MAGNITUDE, BEND_PHASE = 0.25, np.radians(15.0)
MOST_POINTS = 20_000
MOST_LEAD = 0.75 * np.pi  # a response that starts near +-180 degrees is drawn as a lag
NEGLIGIBLE = 1e-11


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """A response G over frequencies [Hz], both shape (n,), from ``source`` to ``output`` with their units.

    ``negligible``: next to the responses of the same units this one is rounding, as it is zero by symmetry.
    """

    source: str
    source_unit: str
    output: str
    output_unit: str
    frequencies: Array
    values: Complex
    negligible: bool

    def phase(self, wrap: bool = False) -> Array:
        """Return the phase [deg], shape (n,): continuous from within -225 to 135, or wrapped with gaps at leaps."""
        values = self.values
        # on the negative real axis the sign of a zero decides between -180 and 180: a lag is what is meant
        behind = (values.real < 0.0) & (np.abs(values.imag) <= 1e-13 * np.abs(values.real))
        phase = np.where(behind, -np.pi, np.angle(values))
        phase[values == 0.0] = np.nan
        if not wrap:
            seen = np.isfinite(phase)
            phase[seen] = np.unwrap(phase[seen])
            lead = bool(seen.any()) and phase[seen][0] > MOST_LEAD
            return np.degrees(phase - 2.0 * np.pi if lead else phase)
        result: Array = np.degrees(phase)
        result[:-1][np.abs(np.diff(result)) > 270.0] = np.nan
        return result


def curves(
    system: System, all_systems: Sequence[System], pairs: Sequence[tuple[str, str]], frequencies: ArrayLike | None,
    span: tuple[float | None, float | None],
) -> list[Curve]:  # fmt: skip
    """Return the curves of a system for pairs of (input, output).

    Parameters
    ----------
    system : System
        Whose responses.
    all_systems : sequence of System
        Whose modes decide about the range of frequencies.
    pairs : sequence of (str, str)
        Names of inputs and outputs.
    frequencies : array-like, shape (n,), optional
        Frequencies [Hz] to use as they are.
    span : (float or None, float or None)
        First and last frequency [Hz] otherwise.

    Returns
    -------
    list of Curve
        One for each pair.

    Raises
    ------
    ResponseError
        If a name is unknown or the frequencies are not positive.
    """
    sources = [system.inputs.index(choice.pick(system, "input", name)[0]) for name, _ in pairs]
    results = [system.outputs.index(choice.pick(system, "output", name)[0]) for _, name in pairs]
    if frequencies is None:
        grid = _refine(system, frequency_grid(all_systems, span), sources, results)
    else:
        grid = np.unique(np.asarray(frequencies, dtype=float))
        if not grid.size or not (np.isfinite(grid).all() and grid[0] > 0.0):
            raise ResponseError("frequencies: expected at least one, each finite and above 0 Hz (log axis).")
    response = system.frequency_response(2.0 * np.pi * grid)
    height = np.abs(response).max(axis=2)
    result = []
    for i, j in zip(sources, results, strict=True):
        alike = np.ix_(
            [unit == system.output_units[j] for unit in system.output_units],
            [unit == system.input_units[i] for unit in system.input_units],
        )
        negligible = bool(height[j, i] <= NEGLIGIBLE * height[alike].max())
        result.append(Curve(system.inputs[i], system.input_units[i], system.outputs[j], system.output_units[j],
                            grid, response[j, i], negligible))  # fmt: skip
    return result


def _refine(system: System, grid: Array, sources: Sequence[int], results: Sequence[int]) -> Array:
    poles = np.sort(np.abs(upper_eigenvalues([system]))) / (2.0 * np.pi)
    response = system.frequency_response(2.0 * np.pi * grid)
    shown = response[results, sources]
    weighty = np.abs(shown).max(axis=1) > NEGLIGIBLE * np.abs(response).max()
    shown = shown[weighty]
    for _ in range(ROUNDS):
        if not len(shown) or not shown.all() or len(grid) > MOST_POINTS:
            break
        step = shown[:, 1:] / shown[:, :-1]
        bends = ((np.abs(np.log(np.abs(step))) > BEND_MAGNITUDE) | (np.abs(np.angle(step)) > BEND_PHASE)).any(axis=0)
        bends &= np.searchsorted(poles, grid[1:]) == np.searchsorted(poles, grid[:-1])  # peaks have their points
        if not bends.any():
            break
        new = np.sqrt(grid[1:][bends] * grid[:-1][bends])
        values = system.frequency_response(2.0 * np.pi * new)[results, sources][weighty]
        order = np.argsort(np.concatenate([grid, new]), kind="stable")
        grid = np.concatenate([grid, new])[order]
        shown = np.concatenate([shown, values], axis=1)[:, order]
    return grid
