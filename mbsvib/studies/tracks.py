"""Modes over the points of a sweep, each followed by its shape, so that it keeps its name through crossings."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from os import PathLike
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from mbsvib.api.model import Model
from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array, Complex
from mbsvib.common.expected import mode_index, names
from mbsvib.common.progress import Progress
from mbsvib.errors import MbsvibError, ModelError
from mbsvib.linalg.matching import Reference, Station, match_next, reference
from mbsvib.modes import Modes
from mbsvib.plots._sheet import Given
from mbsvib.plots.studies import root_locus
from mbsvib.studies.design import Ties
from mbsvib.studies.evaluation import frame, framed, station
from mbsvib.studies.plants import PlantFunction, Systems, systems_of
from mbsvib.studies.results import Sweep
from mbsvib.studies.sweeps import sweep

UNITS = {"eigenvalues": "1/s", "frequencies": "Hz", "damped_frequencies": "Hz", "damping_ratios": "1"}


@dataclass(frozen=True, repr=False, eq=False)
class Tracks(Sweep):
    """Modes over the points of a sweep: results "eigenvalues" (n, modes), those of them without negative imaginary
    parts, "frequencies", "damped_frequencies" and "damping_ratios", one column for each of ``modes``, their names.
    """

    modes: tuple[str, ...] = field(default=())

    @property
    def entries(self) -> tuple[str, ...]:
        """Names of the modes, which are the entries of each result."""
        return self.modes

    def mode(self, name: str, result: str = "frequencies") -> NDArray[Any]:
        """Return a result of one mode.

        Parameters
        ----------
        name : str
            Name of the mode.
        result : str
            "eigenvalues", "frequencies", "damped_frequencies" or "damping_ratios".

        Returns
        -------
        array, shape (n,)
            The result at all points.

        Raises
        ------
        ModelError
            If there is no such mode.
        """
        check.known(name, self.modes, f"tracks of '{self.name}': there is no mode '{name}'", told="Modes are:")
        return np.asarray(self[result][:, self.modes.index(name)])

    def columns(self) -> dict[str, NDArray[Any]]:
        """Return everything as columns of n entries, results by the names of their modes; ``error`` of points that
        failed.
        """
        return self._by_entry(lambda label, index: f"{label}[{self.modes[index[0] - 1]}]")

    def root_locus(self, modes: Sequence[str] | None = None, *, ax: Given | None = None) -> Figure | Given:
        """Draw the eigenvalues in the complex plane.

        Parameters
        ----------
        modes : sequence of str, optional
            Names of modes; default: the first 12.
        ax : Axes or sequence of Axes, optional
            Where to draw, a panel each, row by row; default: a new figure.

        Returns
        -------
        matplotlib.figure.Figure, or ``ax``
            A line for each mode through the points of the sweep, from a circle at the first to a square at the last.

        Raises
        ------
        ModelError
            If there is no such mode.
        """
        shown = self.modes if modes is None else names(modes, "root_locus", "modes", ModelError)
        values = np.stack([self.mode(name, "eigenvalues") for name in shown], axis=1)
        return root_locus(values, shown, self.parameters, self.name, samples=len(self.shape) > 1, ax=ax)


def track(
    model: Model, values: Mapping[str, ArrayLike], names: Mapping[str, int] | None = None, *, how: str = "grid",
    ties: Ties | None = None, workers: int | None = None, file: str | PathLike[str] | None = None,
    progress: Progress = None, plant: PlantFunction | None = None, relaxed: bool = False,
) -> Tracks:  # fmt: skip
    """Follow modes over the points of a sweep by their shapes.

    The modes of each point are followed from the previous one, on a grid along an axis. If shapes change much between
    two points, intermediate points are computed.

    Parameters
    ----------
    model : Model
        The mechanism.
    values : mapping of str to array-like, shape (k,) or ()
        Values of each variable, as for ``sweep``; neighbours should be neighbours in the arrays too.
    names : mapping of str to int, optional
        Names of modes, by their numbers at the first point, which count from 1. Default, and for all others: the body
        of largest motion there, and the direction.
    how : str
        "grid": all combinations; "paired": point by point.
    ties : mapping of str to mapping of str to float or Tie, optional
        Linear maps and other functions, as for ``sweep``.
    workers : int, optional
        How many processes.
    file : str or path-like, optional
        Record of the sweep, from which it is resumed.
    progress : bool, callable or None
        True: a progress bar; None: on terminals.
    plant : callable, optional
        A function of the system that returns what has the modes in its place, such as a closed loop, as for ``sweep``.
    relaxed : bool
        Whether springs keep their forces where joints are displaced, as for ``sweep``.

    Returns
    -------
    Tracks
        A sweep whose columns are modes.

    Raises
    ------
    ModelError
        If a parameter is unknown, a pattern picks nothing, a name is that of no mode, or all points fail.
    """
    swept = sweep(model, values, modal, how=how, ties=ties, workers=workers, file=file, progress=progress,
                  plant=plant, relaxed=relaxed)  # fmt: skip
    good = np.flatnonzero(~swept.failed)
    if not len(good):
        raise ModelError(f"track: all {len(swept)} points failed, the first by {swept.errors[0]}", field="values")
    if swept["eigenvalues"].dtype == object:
        raise ModelError("track: the number of modes is not the same at all points; leave out what changes it, such "
                         "as a mass that vanishes, or poles of a loop that meet on the real axis.",
                         field="values")  # fmt: skip
    interval = _Interval(systems_of(model, swept.parameters, ties, plant, relaxed), swept.parameters)
    first = int(good[0])
    asked = interval.asked(first)
    titles = _titles(asked.modes(), names)
    interval = replace(interval, frame=frame(asked, Station(1.0, swept["eigenvalues"][first], swept["shapes"][first])))
    order = _followed(swept, interval)
    results = {label: np.take_along_axis(swept[label], order, axis=1) for label in UNITS}
    for values_ in results.values():
        values_.setflags(write=False)
    attributes = {field_.name: getattr(swept, field_.name) for field_ in fields(Sweep)}
    units = {name: unit for name, unit in swept.units.items() if name in swept.parameters} | UNITS
    return Tracks(**(attributes | {"results": results, "units": units}), modes=titles)


def modal(asked: Any) -> dict[str, NDArray[Any]]:
    """Return the results at each point: eigenvalues, quantities derived from them, and weighted shapes."""
    modes = asked.modes()
    modal_station = station(asked, modes=modes)
    return {"eigenvalues": modal_station.values, "frequencies": modes.frequencies, "shapes": modal_station.vectors,
            "damped_frequencies": modes.damped_frequencies, "damping_ratios": modes.damping_ratios}  # fmt: skip


@dataclass(frozen=True)
class _Interval:
    """The systems between points, whose shapes become comparable by ``frame``."""

    systems: Systems
    columns: Mapping[str, Array]
    frame: Array | Complex | None = None

    def asked(self, first: int, second: int = 0, share: float = 0.0) -> Any:
        values = {name: float(x[first] + share * (x[second] - x[first])) for name, x in self.columns.items()}
        return self.systems.asked(values)

    def between(self, first: int, second: int) -> Callable[[float], Station]:
        return lambda share: framed(station(self.asked(first, second, share), share), self.frame)


def _followed(swept: Sweep, interval: _Interval) -> NDArray[np.intp]:
    """The mode that each track has at each point, (n, modes)."""
    values, shapes = swept["eigenvalues"], swept["shapes"]
    order = np.tile(np.arange(values.shape[1]), (len(swept), 1))
    references: dict[int, Reference] = {}
    for i in np.flatnonzero(~swept.failed).tolist():
        modes_here = framed(Station(1.0, values[i], shapes[i]), interval.frame)
        before = _before(i, swept.shape, references)
        if before is None:
            references[i] = reference(modes_here)
            continue
        try:
            order[i], references[i] = match_next(references[before], 0.0, modes_here, interval.between(before, i))
        except MbsvibError:  # there may be no valid mechanism between two points
            order[i], references[i] = match_next(references[before], 0.0, modes_here, None)
    return order


def _before(i: int, shape: tuple[int, ...], references: Mapping[int, Reference]) -> int | None:
    """The nearest previous point with modes along the last possible axis, else any previous one."""
    index = list(np.unravel_index(i, shape))
    for axis in reversed(range(len(shape))):
        for steps in range(1, int(index[axis]) + 1):
            neighbour = list(index)
            neighbour[axis] = index[axis] - steps
            number = int(np.ravel_multi_index(tuple(neighbour), shape))
            if number in references:
                return number
    return max(references, default=None)


def _titles(modes: Modes, names: Mapping[str, int] | None) -> tuple[str, ...]:
    named: dict[int, str] = {}
    for name, number in (names or {}).items():
        index = mode_index(number, f"track: names['{name}']", len(modes), error=ModelError)
        if index in named:
            raise ModelError(f"track: mode {number} has two names, '{named[index]}' and '{name}'.", field="names")
        named[index] = str(name)
    result: list[str] = []
    for index, most in enumerate(modes.strongest()):
        plain = named.get(index, " ".join(most))
        used = [*result, *named.values()] if index not in named else []
        title, count = plain, 1
        while title in used:
            count += 1
            title = f"{plain} ({count})"
        result.append(title)
    return tuple(result)
