"""Curves of frequency responses with adaptive frequencies and a continuous phase; systems, inputs and outputs.

What figures draw, by name: these classes are above ``plots``, which takes them as they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.common.arrays import Array, Bools, Complex
from mbsvib.common.expected import a_linear, reals
from mbsvib.common.selection import Names, selected
from mbsvib.errors import ResponseError
from mbsvib.responses.frequency_grid import resolving_frequencies, zeros_of
from mbsvib.responses.frequency_grid import span as range_of
from mbsvib.responses.frequency_response import zero_responses
from mbsvib.responses.from_control import is_control, is_transfer_function, of_control
from mbsvib.responses.state_space import StateSpace

# mbsvib.System
System: TypeAlias = Any
# A System, ClosedLoop, StateSpace or Controller: named inputs and outputs, modes, poles, zeros and responses.
Linear: TypeAlias = Any


Systems: TypeAlias = Linear | Sequence[Linear]

MOST_PANELS = 12


def linear(value: Any) -> Linear:
    """Return a system, closed loop, state space or controller; systems of python-control become state spaces.

    Raises ResponseError for anything else, or data without equations.
    """
    if is_control(value) or is_transfer_function(value):
        return StateSpace.from_control(value)
    if of_control(value):
        raise ResponseError(f"plots: systems = {type(value).__name__} '{value.name}'; expected equations, a "
                            f"control.StateSpace or control.TransferFunction. Data are drawn by python-control.")
    return a_linear(value, "plots", "systems")


def listed(systems: Systems, labels: Sequence[str] | None) -> list[tuple[str, Linear]]:
    """Return systems with their labels in a legend."""
    several = systems if isinstance(systems, (list, tuple)) else [systems]
    group = [linear(item) for item in several]
    if not group:
        raise ResponseError("no system is given; pass one or a list of them.")
    names = list(labels) if labels is not None else [system.name for system in group]
    if len(names) != len(group):
        raise ResponseError(f"{len(names)} labels for {len(group)} systems; give one for each.")
    if labels is None and len(set(names)) < len(names):  # a model and what is reduced of it
        sized = [f"{name}, {len(system.poles())} states" for name, system in zip(names, group, strict=True)]
        names = sized if len(set(sized)) == len(sized) else [f"{name} ({i})" for i, name in enumerate(names, 1)]
    return list(zip(names, group, strict=True))


def pick(system: Linear, kind: str, names: Names) -> list[str]:
    """Return the selected names of inputs or outputs; None selects all, a pattern those that it fits."""
    known, others = (system.inputs, system.outputs) if kind == "input" else (system.outputs, system.inputs)
    if not known:
        raise ResponseError(f"system '{system.name}' has no {kind}s, so there is no response to draw; "
                            f"add some to the model by add_{kind}().")  # fmt: skip
    result = [known[i] for i in selected(names, known, kind, system.name, others)]
    if not result:
        raise ResponseError(f"the list of {kind}s is empty; name at least one of {', '.join(known)}.")
    return result


def pairs_of(system: Linear, outputs: Names, inputs: Names) -> tuple[list[tuple[str, str]], int]:
    """Return the panels of a figure, row by row, as (output, input), and how many stand in a row.


    Several outputs and inputs make a matrix, as the transfer matrix is written; a single input or output fills rows
    of at most three.
    """
    results, sources = pick(system, "output", outputs), pick(system, "input", inputs)
    count = len(sources) * len(results)
    if count > MOST_PANELS:
        raise ResponseError(
            f"{len(results)} outputs x {len(sources)} inputs are {count} panels; a figure holds at "
            f"most {MOST_PANELS}: choose, for example, output {results[0]!r} and input {sources[0]!r}. "
            f"Outputs: {', '.join(results)}. Inputs: {', '.join(sources)}."
        )
    if len(sources) > 1 and len(results) > 1:
        return [(result, source) for result in results for source in sources], len(sources)
    return [(result, source) for source in sources for result in results], columns_of(count)


def columns_of(count: int) -> int:
    """Return how many of so many panels stand in a row."""
    return 2 if count in (2, 4) else min(count, 3)


MOST_LEAD = 0.75 * np.pi  # a response that starts near +-180 degrees is drawn as a lag
# Share of responses of the same units below which one is zero: as near to undamped poles as curves are drawn, rounding
# of these poles is some 1e-10 of a response.
NEGLIGIBLE = 1e-10


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """A response G over frequencies [Hz], both (n,), from ``source`` to ``output`` with their units.

    ``negligible``: the response is zero by symmetry, and mere rounding compared with responses of the same units.
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
        # on the negative real axis the sign of a zero imaginary part decides between -180 and 180: take the lag
        behind = (values.real < 0.0) & (np.abs(values.imag) <= 1e-13 * np.abs(values.real))
        phase = np.where(behind, -np.pi, np.angle(values))
        phase[values == 0.0] = np.nan
        if not wrap:
            finite = np.isfinite(phase)
            phase[finite] = np.unwrap(phase[finite])
            lead = bool(finite.any()) and phase[finite][0] > MOST_LEAD
            return np.degrees(phase - 2.0 * np.pi if lead else phase)
        result: Array = np.degrees(phase)
        result[:-1][np.abs(np.diff(result)) > 270.0] = np.nan
        return result


def shared_grid(
    systems: Sequence[Linear], pairs: Sequence[tuple[Names, Names]], frequencies: ArrayLike | None,
    span: tuple[float | None, float | None],
) -> Array:  # fmt: skip
    """Return ascending frequencies (points,) [Hz] for curves of several systems: as given, or dense at peaks and dips.

    ``pairs``: names of outputs and inputs. ``frequencies`` (n,): frequencies [Hz] to use as they are; otherwise
    ``span``: first and last frequency [Hz].
    """
    if frequencies is not None:
        return positive_frequencies(frequencies, "plots")
    poles = np.concatenate([system.poles() for system in systems])
    low, high = range_of(poles, *span)
    for system in systems:
        for output, source in pairs:
            pick(system, "output", output)
            pick(system, "input", source)
    # zeros of a sampled loop are near those of its continuous one
    alike: list[Linear] = [getattr(system, "continuous", system) for system in systems]
    values = [poles, *(zeros_of(system, *pair) for system in alike for pair in pairs)]
    return resolving_frequencies(np.concatenate(values), poles, low, high)


def positive_frequencies(frequencies: ArrayLike, who: str) -> Array:
    """Return frequencies [Hz] in ascending order, each once; refuse those that a logarithmic axis does not have."""
    grid = np.unique(reals(frequencies, who, "frequencies", "frequencies above 0 [Hz]"))
    if not grid.size or not (np.isfinite(grid).all() and grid[0] > 0.0):
        raise ResponseError("frequencies: expected at least one, each finite and above 0 Hz (log axis).")
    return grid


def finer(grid: Array) -> Array:
    """Return frequencies (n,) with three more between neighbours, for curves that are circles and not polygons."""
    for _ in range(2):
        grid = np.sort(np.concatenate((grid, np.sqrt(grid[1:] * grid[:-1]))))
    return grid


def curves(system: Linear, pairs: Sequence[tuple[str, str]], grid: Array) -> list[Curve]:
    """Return the curves of a system for ``pairs`` (output, input) at the frequencies ``grid`` (n,) [Hz], 0 where the
    numbers of the model determine no digit.
    """
    results = [system.outputs.index(pick(system, "output", name)[0]) for name, _ in pairs]
    sources = [system.inputs.index(pick(system, "input", name)[0]) for _, name in pairs]
    response = system.frequency_response(2.0 * np.pi * grid)
    response[zeros(system)] = 0.0
    zero = negligible(system, np.abs(response).max(axis=2))
    return [Curve(system.inputs[i], system.input_units[i], system.outputs[j], system.output_units[j], grid,
                  response[j, i], bool(zero[j, i])) for i, j in zip(sources, results, strict=True)]  # fmt: skip


def zeros(system: Linear) -> Bools:
    """Return which responses (outputs, inputs) of a mechanism are zero but for rounding of its numbers."""
    basis = getattr(system, "basis", None)
    if basis is None:
        return np.zeros((len(system.outputs), len(system.inputs)), dtype=bool)
    return zero_responses(basis)


def negligible(system: Linear, height: Array) -> Bools:
    """Return which responses (outputs, inputs) of largest magnitudes ``height`` are rounding beside others of the same
    units.
    """
    result = zeros(system)
    for output in set(system.output_units):
        for source in set(system.input_units):
            alike = np.ix_([unit == output for unit in system.output_units],
                           [unit == source for unit in system.input_units])  # fmt: skip
            result[alike] |= height[alike] <= NEGLIGIBLE * height[alike].max()
    return result
