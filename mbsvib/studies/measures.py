"""What mechanisms are designed for: frequencies, damping, peaks and mean squares of responses, as quantities."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.api.system import System
from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array, Complex
from mbsvib.common.expected import band_of, mode_index, reals
from mbsvib.errors import ModelError, counted
from mbsvib.modes import Modes
from mbsvib.modes.batch import BatchModes
from mbsvib.studies.evaluation import DesignPoint, Dual
from mbsvib.studies.quantities import Leaf, Quantity
from mbsvib.studies.responses import Peak, PortResponses

Names = str | Iterable[str] | None
Band = tuple[float, float]

# natural frequency [rad/s], sum of the two eigenvalues, and changes of both, to a value and its change
Given = Callable[["System", Mapping[str, Mapping[str, float]]], "tuple[Any, Any]"]
Rule = Callable[["Array", "Array", "Array", "Array"], "tuple[Array, Array]"]

TOGETHER = 1e-9  # eigenvalues nearer to each other than this, relative, coincide
NEAR = 6.0  # standard deviations


class Modal(Leaf):
    """A quantity of modes: those with these ``indices`` in arrays, None for all but rigid-body modes."""

    def __init__(self, quantity: str, unit: str, mode: Any, rule: Rule) -> None:
        numbers = None if mode is None else np.ravel(np.array(mode, dtype=object)).tolist()
        self.indices = None if numbers is None else [mode_index(n, quantity, error=ModelError) for n in numbers]
        self.quantity, self.rule = quantity, rule
        if numbers is None:
            label = f"all {'frequencies' if quantity == 'frequency' else 'damping ratios'}"
        elif not numbers:
            raise check.refuse(quantity, "mode", mode,
                               "numbers of modes, 1, 2, ... as print(system.modes()) lists them")  # fmt: skip
        else:
            label = f"{quantity} of mode{'s' if len(numbers) > 1 else ''} {', '.join(map(str, numbers))}"
        super().__init__(f"{label} [{unit}]", self._at)
        self.unit = unit

    def of(self, modes: Modes, order: Any = None) -> list[int]:
        """Return the indices of the modes."""
        count, rigid = len(modes), modes.rigid
        which = list(range(rigid, count)) if self.indices is None else self.indices
        if self.indices is None and order is not None:
            which = np.flatnonzero(order >= rigid).tolist()
        if not which:
            raise ModelError(f"{self.quantity}: '{modes.name}' has no modes but {counted(rigid, 'rigid-body mode')}.",
                             element=self.quantity)  # fmt: skip
        if max(which) >= count:
            raise ModelError(f"{self.quantity}: mode {max(which) + 1} of '{modes.name}' is asked for, which has modes "
                             f"1 to {count}, {rigid} of them rigid-body modes.", element=self.quantity)  # fmt: skip
        return which

    def rate(self, value: complex) -> complex:
        """Return c at an eigenvalue: where that moves by d, the quantity moves by Re(c d)."""
        size, total = np.array([abs(value)]), np.array([2.0 * value.real])
        along, across = (self.rule(size, total, np.array([(value.conjugate() * d).real / abs(value)]),
                                   np.array([2.0 * d.real]))[1][0] for d in (1.0 + 0.0j, 1.0j))  # fmt: skip
        return complex(along, -across)

    def in_batch(self, modes: BatchModes, which: list[int]) -> Array:
        """Return the numbers of some modes of all variants, (variants, modes)."""
        first, second = np.moveaxis(modes.pairs[:, which], 2, 0)
        product = first * second
        natural = np.sqrt(np.abs(product))
        return self._known(product, *self.rule(natural, (first + second).real, 0.0 * natural, 0.0 * natural))[0]

    def _at(self, point: DesignPoint) -> Dual:
        which = self.of(point.modes, point.order)
        values, slopes = point.pairs
        (first, second), (d_first, d_second) = values[which].T, np.moveaxis(slopes[:, which], 2, 0)
        product = first * second
        natural = np.sqrt(np.abs(product))
        with np.errstate(divide="ignore", invalid="ignore"):
            d_natural = (0.5 * natural * ((d_first * second + first * d_second) / product)).real
            value, slope = self.rule(natural, (first + second).real, d_natural, (d_first + d_second).real)
        value, slope = self._known(product, value, slope)
        return point.dual(value, slope.T)

    def _known(self, product: Complex, value: Array, slope: Array) -> tuple[Array, Array]:
        """The values (..., modes) and slopes (..., modes): a mode of which one eigenvalue diverges, and the other
        decays, has the damping ratio -1, whatever their sum.
        """
        if self.quantity != "damping ratio":
            return value, slope
        diverges = product.real < 0.0
        return np.where(diverges, -1.0, value), np.where(diverges, 0.0, slope)


def together(values: Complex, scatter: Array, largest: int = 30) -> list[list[int]]:
    """Return groups of modes whose eigenvalues are close compared with their scatter.

    ``values`` (modes,): eigenvalues with positive imaginary parts; others are in no group. ``scatter`` (modes,):
    standard deviations of the single eigenvalues. ``largest``: maximum number of modes in a group; larger groups are
    omitted. A group has two modes at least, neighbours within ``NEAR`` standard deviations.
    """
    turns = np.flatnonzero(values.imag > 0.0)
    gap = np.abs(values[turns][:, None] - values[turns])
    limit = NEAR * np.hypot(scatter[turns][:, None], scatter[turns]) + TOGETHER * np.abs(values[turns])
    label = np.arange(len(turns))
    for i, j in np.argwhere(np.triu(gap <= limit, 1)):
        label[label == label[j]] = label[i]
    groups = [turns[label == name].tolist() for name in dict.fromkeys(label.tolist())]
    return [group for group in groups if 1 < len(group) <= largest]


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
    return Modal("frequency", "Hz", mode, _hertz)


def _hertz(natural: Array, _: Array, d_natural: Array, __: Array) -> tuple[Array, Array]:
    return natural / (2.0 * np.pi), d_natural / (2.0 * np.pi)


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
        -Re lambda / |lambda|, above 1 where a mode creeps, -1 where one diverges.
    """
    return Modal("damping ratio", "1", mode, _ratio)


def _ratio(natural: Array, total: Array, d_natural: Array, d_total: Array) -> tuple[Array, Array]:
    ratio = -0.5 * total / natural
    return ratio, -(0.5 * d_total + ratio * d_natural) / natural


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
    check.mapping("placement", "targets", targets, "a frequency [Hz] for each mode, such as {1: 120.0}")
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
    f = np.atleast_1d(reals(frequencies, "gain", "frequencies", "frequencies [Hz]", ModelError))
    ports = PortResponses(outputs, inputs)
    where = f"{f[0]:g} Hz" if len(f) == 1 else f"{f.min():g} to {f.max():g} Hz"
    return Leaf(f"gain of {ports.label} at {where}", partial(ports.size, w=2.0 * np.pi * f))


def peak(outputs: Names = None, inputs: Names = None, band: Band | None = None) -> Quantity:
    """Return the peak of a frequency response over a band, such as a transmissibility or a compliance.

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
    return Peak(PortResponses(outputs, inputs), band_of(band, "peak", above=True))


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
    return Leaf(name, partial(_value_of, name), equations=False)


def _value_of(name: str, point: DesignPoint) -> Dual:
    check.known(name, point.values, f"variable('{name}'): there is no such variable", told="Variables are:")
    slope = np.zeros((1, len(point.scale)))
    slope[0, list(point.rates).index(name)] = 1.0
    return point.dual(np.array([point.values[name]]), slope)


def given(function: Given, label: str) -> Quantity:
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
        The numbers; it pickles if the function does, as one that a module defines.
    """
    return Leaf(label, partial(_given, function))


def _given(function: Given, point: DesignPoint) -> Dual:
    def of(system: Any) -> Array:
        return _reals(function(system, {})[0])

    if point.of_parameters:
        value, slope = function(point.system, point.rates)
    else:
        value, slope = of(point.system), point.by_differences(of)
    value = _reals(value)
    return point.dual(value, _reals(slope).reshape(len(value), len(point.rates)))


def _reals(value: Any) -> Array:
    return np.atleast_1d(reals(value, "given", "function's value", "real numbers and their slopes", ModelError))
