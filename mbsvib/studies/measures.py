"""What mechanisms are designed for: frequencies, damping, peaks and mean squares of responses, as quantities."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.expected import mode_index
from mbsvib.errors import ModelError, nearest
from mbsvib.studies.dual import Dual
from mbsvib.studies.modal import Modal
from mbsvib.studies.quantities import Leaf, Quantity
from mbsvib.studies.responses import Peak, PortResponses, band_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike

    from mbsvib.api.system import System
    from mbsvib.common.arrays import Array
    from mbsvib.studies.evaluation import DesignPoint

    Names = str | Iterable[str] | None
    Band = tuple[float, float]

def frequency(mode: int | Iterable[int] | None = None) -> Quantity:
    """Return natural frequencies.

    Parameters
    ----------
    mode : int or iterable of int, optional
        Number of a mode, from 1 as ``print(system.modes())`` lists them, or several. Default: all but rigid-body
        modes. In a search it is the number where that starts: modes are followed by their shapes. Where modes coincide,
        the derivative to each variable is that along its own branch.

    Returns
    -------
    Quantity
        |lambda| / 2 pi [Hz].
    """

    def rule(natural: Array, _: Array, d_natural: Array, __: Array) -> tuple[Array, Array]:
        return natural / (2.0 * np.pi), d_natural / (2.0 * np.pi)

    return Modal("frequency", "Hz", mode, rule)


def damping_ratio(mode: int | Iterable[int] | None = None) -> Quantity:
    """Return damping ratios.

    Parameters
    ----------
    mode : int or iterable of int, optional
        Number of a mode, from 1 as ``print(system.modes())`` lists them, or several. Default: all but rigid-body
        modes.

    Returns
    -------
    Quantity
        -Re lambda / |lambda|, above 1 where a mode creeps.
    """

    def rule(natural: Array, total: Array, d_natural: Array, d_total: Array) -> tuple[Array, Array]:
        ratio = -0.5 * total / natural
        return ratio, -(0.5 * d_total + ratio * d_natural) / natural

    return Modal("damping ratio", "1", mode, rule)


def placement(targets: Mapping[int, float]) -> Quantity:
    """Return how far natural frequencies are from where they ought to be.

    Parameters
    ----------
    targets : mapping of int to float
        Frequency [Hz] that each mode, by its number from 1, ought to have.

    Returns
    -------
    Quantity
        Sum of (f / target - 1)^2.

    Raises
    ------
    ModelError
        If there is no target, one is not positive, or a mode's number is below 1.
    """
    if not isinstance(targets, Mapping) or not targets:
        raise check.refuse("placement", "targets", targets, "a frequency [Hz] for each mode, such as {1: 120.0}")
    for mode in targets:
        mode_index(mode, "placement", error=ModelError)
    targets_hz = [check.number(f, "placement", f"targets[{mode}]", "a frequency [Hz]") for mode, f in targets.items()]
    if min(targets_hz) <= 0.0:
        raise check.refuse("placement", "targets", targets, "frequencies [Hz] above 0")
    result = ((frequency(list(targets)) / targets_hz - 1.0) ** 2).sum()
    result.label = "misplacement of frequencies [1]"
    return result


def gain(outputs: Names, inputs: Names, frequencies: ArrayLike) -> Quantity:
    """Return magnitudes of a frequency response.

    Parameters
    ----------
    outputs, inputs : str or iterable of str, optional
        Names of ports; of several, the Frobenius norm. None: all.
    frequencies : array-like, shape (n,) or ()
        Where [Hz]; 0 is the static compliance.

    Returns
    -------
    Quantity
        |G| at each frequency [output unit / input unit].

    Raises
    ------
    ModelError
        If frequencies are not numbers.
    """
    try:
        f = np.atleast_1d(np.asarray(frequencies, dtype=float))
    except (TypeError, ValueError) as error:
        raise check.refuse("gain", "frequencies", frequencies, "frequencies [Hz]") from error
    ports = PortResponses(outputs, inputs)
    where = f"{f[0]:g} Hz" if len(f) == 1 else f"{f.min():g} to {f.max():g} Hz"
    return Leaf(f"gain of {ports.label} at {where}", lambda point: ports.size(point, 2.0 * np.pi * f))


def peak(outputs: Names = None, inputs: Names = None, band: Band | None = None) -> Quantity:
    """Return the peak of a frequency response over a band: transmissibility, compliance, whatever the ports say.

    Parameters
    ----------
    outputs, inputs : str or iterable of str, optional
        Names of ports; of several, the Frobenius norm. None: all.
    band : (float, float), optional
        First and last frequency [Hz]; default: from a tenth of the lowest to three times the highest mode, as they are.

    Returns
    -------
    Quantity
        max |G| [output unit / input unit]; infinite where an undamped mode is excited.

    Raises
    ------
    ResponseError
        If the band does not ascend from above 0.
    """
    return Peak(PortResponses(outputs, inputs), band_of(band))


def variable(name: str) -> Quantity:
    """Return the value of a variable of the search itself, for budgets and bounds on several.

    Parameters
    ----------
    name : str
        Its name, as the search has it.

    Returns
    -------
    Quantity
        The value.

    Raises
    ------
    ModelError
        In a search that has no such variable.
    """
    def at(point: DesignPoint) -> Dual:
        if name not in point.values:
            raise ModelError(f"variable('{name}'): there is no such variable.{nearest(name, point.values)} Variables "
                             f"are: {', '.join(point.values)}.", element=name)  # fmt: skip
        slope = np.zeros((1, len(point.scale)))
        slope[0, list(point.rates).index(name)] = 1.0
        return point.dual(np.array([point.values[name]]), slope)

    return _Variable(name, at)


class _Variable(Leaf):
    """The value of a variable, which no equations are needed for."""

    equations = False


def given(function: Callable[[System, Mapping[str, Mapping[str, float]]], tuple[Any, Any]], label: str) -> Quantity:
    """Return a quantity of one's own.

    Parameters
    ----------
    function : callable
        Takes a system and variables {name: {parameter: rate}}, and returns numbers (k,) with derivatives
        (k, variables), for which ``system.eigenvalue_sensitivities(variables)`` and others are made.
    label : str
        What it is, for tables.

    Returns
    -------
    Quantity
        The numbers.
    """
    def of(system: Any) -> Array:
        return np.atleast_1d(np.asarray(function(system, {})[0], dtype=float))

    def at(point: DesignPoint) -> Dual:
        if point.of_parameters:
            value, slope = function(point.system, point.rates)
        else:
            value, slope = of(point.system), point.by_differences(of)
        value = np.atleast_1d(np.asarray(value, dtype=float))
        return point.dual(value, np.asarray(slope, dtype=float).reshape(len(value), len(point.rates)))

    return Leaf(label, at)
