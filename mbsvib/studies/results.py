"""Points of a sweep, and its results there."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from math import prod
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array
from mbsvib.common.columnar import Columnar
from mbsvib.common.display import Displayed
from mbsvib.common.expected import one_of, reals
from mbsvib.common.labelled import Labelled, dataset
from mbsvib.errors import ModelError, counted
from mbsvib.plots._sheet import Given
from mbsvib.plots.studies import over_variables

HOW = ("grid", "paired")


@dataclass(frozen=True, slots=True)
class Points:
    """Values of variables: ``axes`` as given, ``columns`` (n,) point by point, ``shape`` of the grid or (n,)."""

    axes: Mapping[str, Array]
    columns: Mapping[str, Array]
    shape: tuple[int, ...]

    def __len__(self) -> int:
        return prod(self.shape)


def points(values: Mapping[str, Any], how: str) -> Points:
    """Return the points of a sweep.

    ``values`` (k,) or (): values of each variable. ``how``: "grid": every combination, the last variable runs fastest;
    "paired": the arrays have one length, and a number is the same at all points.
    """
    one_of(how, HOW, "sweep", "how", ModelError)
    check.mapping("sweep", "values", values, "a mapping from parameters to values, such as "
                  "{'leg*.k.stiffness': [1e6, 2e6]}")  # fmt: skip
    arrays = {str(name): _values(str(name), value) for name, value in values.items()}
    if how == "grid":
        axes = {name: np.atleast_1d(array) for name, array in arrays.items()}
        mesh = np.meshgrid(*axes.values(), indexing="ij")
        columns = {name: grid.reshape(-1) for name, grid in zip(axes, mesh, strict=True)}
        return Points(axes, columns, tuple([len(axis) for axis in axes.values()]))
    count = max([array.size for array in arrays.values()])
    for name, array in arrays.items():
        if array.ndim and array.size != count:
            longest = next(variable for variable, value in arrays.items() if value.size == count)
            raise ModelError(f"sweep: values['{name}'] has {counted(array.size, 'entry')}, values['{longest}'] "
                             f"{count}; a paired sweep has one for each point. For all combinations: how='grid'.",
                             element=name, field="values")  # fmt: skip
    columns = {name: np.broadcast_to(array, (count,)) for name, array in arrays.items()}
    return Points(columns, columns, (count,))


def _values(name: str, value: Any) -> Array:
    expected = "a number or a list of finite numbers"
    array = reals(value, "sweep", f"values['{name}']", expected, ModelError).copy()
    if array.ndim > 1 or not array.size or not np.isfinite(array).all():
        raise check.refuse("sweep", f"values['{name}']", value, expected)
    array.setflags(write=False)
    return array


SHOWN_ROWS, SHOWN_COLUMNS, SHOWN_ERRORS = 20, 8, 3


@dataclass(frozen=True, repr=False, eq=False)
class Sweep(Columnar, Displayed):
    """Results at n points: ``parameters`` (n,) by variable, ``results`` by label, one entry along the first axis for
    each point, not a number (NaN) where ``errors`` has the point's number and what went wrong there.

    ``shape`` is that of the grid, whose values are ``axes``; ``units`` of variables and results as far as known.
    Results whose shapes differ from point to point are arrays of objects, None where a point failed.
    """

    name: str
    """Name of the model."""
    axes: Mapping[str, Array]
    parameters: Mapping[str, Array]
    shape: tuple[int, ...]
    results: Mapping[str, NDArray[Any]]
    errors: Mapping[int, str]
    units: Mapping[str, str] = field(repr=False)

    def __len__(self) -> int:
        return int(np.prod(self.shape))

    def __iter__(self) -> Iterator[str]:
        return iter(self.results)

    def __getitem__(self, label: str) -> NDArray[Any]:
        if label in self.results:
            return self.results[label]
        if label in self.parameters:
            return self.parameters[label]
        raise check.unknown(label, [*self.results, *self.parameters],
                            f"sweep of '{self.name}': there is no result '{label}'", None, "There are:")  # fmt: skip

    @cached_property
    def failed(self) -> NDArray[np.bool_]:
        """Which points failed, shape (n,)."""
        result = np.zeros(len(self), dtype=bool)
        result[list(self.errors)] = True
        return result

    @property
    def entries(self) -> tuple[str, ...]:
        """Names of the entries of each result; none where they have no names."""
        return ()

    def grid(self, label: str) -> NDArray[Any]:
        """Return a result over the grid.

        Parameters
        ----------
        label : str
            Name of the result.

        Returns
        -------
        array, shape (values of the first variable, of the second, ..., shape of the result)
            The results.
        """
        return self[label].reshape(*self.shape, *self[label].shape[1:])

    def to_numpy(self) -> dict[str, NDArray[Any]]:
        """Return variables and results as arrays by name, the first axis that of the points."""
        return {**self.parameters, **self.results}

    def columns(self) -> dict[str, NDArray[Any]]:
        """Return everything as columns of n entries: ``label(1)``, ``label(2)``, ... of vectors, which count from 1 as
        modes do, ``label(1,2)`` of matrices, ``.re`` and ``.im`` of complex numbers;
        ``error`` of points that failed.
        """
        return self._by_entry(lambda label, index: label + (f"({','.join(map(str, index))})" if index else ""))

    def _by_entry(self, named: Callable[[str, tuple[int, ...]], str]) -> dict[str, NDArray[Any]]:
        """Variables, each entry of the results, with a name for its label and numbers from 1, and errors."""
        result: dict[str, NDArray[Any]] = dict(self.parameters)
        for label, values in self.results.items():
            for index in np.ndindex(*values.shape[1:]):
                name, column = named(label, tuple([k + 1 for k in index])), values[:, *index]
                if values.dtype.kind == "c":
                    result[f"{name}.re"], result[f"{name}.im"] = column.real, column.imag
                else:
                    result[name] = column
        return result | ({"error": self._messages()} if self.errors else {})

    def _messages(self) -> NDArray[np.str_]:
        """What went wrong at each point (n,), empty where nothing did."""
        return np.array([self.errors.get(i, "") for i in range(len(self))])

    def to_xarray(self) -> Any:
        """Return variables and results as a data set of xarray.

        Returns
        -------
        xarray.Dataset
            Results over the variables of a grid, or over "point" where these vary together; entries of vectors have
            the axis "mode" in tracks, else "LABEL entry", which counts from 1. "error" where points failed.

        Raises
        ------
        ExportError
            If xarray is not installed.
        """
        grid = len(self.shape) > 1 or len(self.axes) == 1
        axes = tuple(self.axes) if grid else ("point",)
        coordinates: dict[str, Labelled] = {name: ((name,) if grid else axes, values, self.units.get(name))
                                            for name, values in self.axes.items()}  # fmt: skip
        if self.entries:
            coordinates["mode"] = ("mode",), list(self.entries), None
        variables: dict[str, Labelled] = {}
        for label in self.results:
            values = self.grid(label)
            sizes = values.shape[len(axes) :]
            own = ["mode"] if self.entries else [f"{label} entry{f' {k + 1}' if len(sizes) > 1 else ''}"
                                                 for k in range(len(sizes))]  # fmt: skip
            for name, size in zip(own, sizes, strict=True):
                coordinates.setdefault(name, ((name,), np.arange(1, size + 1), None))
            variables[label] = (*axes, *own), values, self.units.get(label)
        if self.errors:
            variables["error"] = axes, self._messages().reshape(self.shape), None
        return dataset("to_xarray", variables, coordinates, self.name)

    def table(self) -> dict[str, Any]:
        """Return a table of the first points as arguments of ``mbsvib.common.tables.text`` and ``show``."""
        columns = self.columns()
        columns.pop("error", None)
        names = list(columns)[:SHOWN_COLUMNS]
        rows = [tuple(_cell(columns[name][i]) for name in names) for i in range(min(len(self), SHOWN_ROWS))]
        notes = []
        if len(self) > SHOWN_ROWS or len(columns) > SHOWN_COLUMNS:
            notes.append(f"The first of {counted(len(self), 'point')} and {counted(len(columns), 'column')}.")
        for i, error in list(self.errors.items())[:SHOWN_ERRORS]:
            notes.append(f"Point {i} failed: {error}")
        if len(self.errors) > SHOWN_ERRORS:
            notes.append(f"In all, {counted(len(self.errors), 'point')} failed.")
        units = {name: self.units.get(re.split(r"[(\[]", name)[0]) for name in names}
        heads = [(name + (f" [{unit}]" if unit is not None else ""), "right") for name, unit in units.items()]
        return {"title": f"Sweep of {self.name}", "columns": heads, "rows": rows, "notes": notes}

    def plot(self, label: str | None = None, *, ax: Given | None = None) -> Figure | Given:
        """Draw a result over what varies.

        Parameters
        ----------
        label : str, optional
            Which result; default: the first of real numbers.
        ax : Axes or sequence of Axes, optional
            Where to draw, a panel each, row by row; default: a new figure.

        Returns
        -------
        matplotlib.figure.Figure, or ``ax``
            Lines over one variable, a map over the grid of two, and histograms of samples of more.

        Raises
        ------
        ModelError
            If there is no result of real numbers to draw.
        """
        real = (key for key, result in self.results.items() if result.dtype.kind in "biuf")
        name = next(real, next(iter(self.results), "")) if label is None else label
        values = self[name]
        if values.dtype.kind not in "biuf":
            raise ModelError(f"plot of '{self.name}': '{name}' is not of real numbers; draw results of real numbers.",
                             element=name, field="label")  # fmt: skip
        modes = values.shape[1] if name.startswith("modes.") and values.ndim == 2 else 0
        return over_variables(values, name, self.parameters, self.axes, grid=len(self.shape) > 1, units=self.units,
                              name=self.name, entries=self.entries or tuple([f"{k + 1}" for k in range(modes)]), ax=ax)

    def __repr__(self) -> str:
        return (f"{type(self).__name__}({self.name!r}: {counted(len(self), 'point')} of {', '.join(self.parameters)}, "
                f"{len(self.errors)} failed)")  # fmt: skip


def gathered(count: int, outcomes: Mapping[int, Mapping[str, NDArray[Any]]]) -> dict[str, NDArray[Any]]:
    """Return arrays over all points by label; NaN where a point has no result, arrays of objects where shapes differ.
    """
    labels = list(dict.fromkeys(label for outcome in outcomes.values() for label in outcome))
    result = {}
    for label in labels:
        values = {i: outcome[label] for i, outcome in outcomes.items() if label in outcome}
        kind = np.result_type(*{value.dtype for value in values.values()})
        shapes = {value.shape for value in values.values()}
        if len(shapes) > 1:
            array: NDArray[Any] = np.full(count, None, dtype=object)
            for i, value in values.items():
                array[i] = value
        else:
            if len(values) < count and kind.kind in "biu":
                kind = np.dtype(float)
            array = np.full((count, *shapes.pop()), np.nan if kind.kind in "fc" else 0, dtype=kind)
            where = np.fromiter(values, dtype=np.intp, count=len(values))
            array[where] = np.array(list(values.values()))
        array.setflags(write=False)
        result[label] = array
    return result


def _cell(value: Any) -> str:
    if value is None:
        return "failed"
    return f"{value:.8g}" if np.ndim(value) == 0 and not isinstance(value, (bool, np.bool_)) else str(value)
