"""Tolerance analysis: effect of scatter of parameters on quantities, to first order and by random samples."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from os import PathLike
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mbsvib.api.batch import Batch
from mbsvib.api.model import Model
from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array
from mbsvib.common.columnar import Columnar
from mbsvib.common.display import Displayed
from mbsvib.common.expected import a_model, limits, one_of
from mbsvib.common.number_text import real
from mbsvib.common.progress import Progress
from mbsvib.errors import ModelError, counted
from mbsvib.mechanism.changes import resolved
from mbsvib.plots import studies as figures
from mbsvib.plots._sheet import Given
from mbsvib.plots.studies import MOST_LINES
from mbsvib.studies.design import StudyVariables, Ties, design, posed_names
from mbsvib.studies.evaluation import DesignPoint
from mbsvib.studies.first_order import first_order, no_order
from mbsvib.studies.measures import Modal, damping_ratio, frequency
from mbsvib.studies.plants import PlantFunction, Systems, plant_of
from mbsvib.studies.quantities import Quantity
from mbsvib.studies.results import Sweep
from mbsvib.studies.sweeps import sweep

# standard deviation over tolerance
DEVIATION = {"normal": 1.0 / 3.0, "uniform": 1.0 / np.sqrt(3.0)}


def parameter_tolerances(
    model: Model, tolerances: Mapping[str, Any], ties: Ties | None, gains: Mapping[str, float], relaxed: bool
) -> tuple[StudyVariables, dict[str, float]]:
    """Return the variables and their tolerances.

    ``tolerances``: by name or pattern, in the unit of the parameter, or as a share of its value, "2 %". Names of
    ``ties`` and ``gains`` may be among them; these and ``relaxed`` are as of ``design``.
    """
    check.mapping("tolerances", "tolerances", tolerances, "how far each parameter may be off, such as "
                  "{'leg*.k.stiffness': '2 %'}")  # fmt: skip
    if ties is not None and not isinstance(ties, Mapping):
        raise check.refuse("tolerances", "ties", ties, "a mapping of variables to the parameters that they move")
    used = {name: rates for name, rates in (ties or {}).items() if name in tolerances}
    mapped = {name: value for name, value in tolerances.items() if name in used or name in gains}
    unmapped = {name: value for name, value in tolerances.items() if name not in mapped}
    parameters = a_model(model, "study").parameters
    picked = {name: (name,) for name in mapped} | posed_names(model, list(unmapped))
    known = resolved(parameters, {name: value for name, value in unmapped.items() if name not in picked})
    known |= {name: tolerances[pattern] for pattern, names in picked.items() for name in names}
    values = {name: known[name] for pattern in tolerances
              for name in picked.get(pattern) or parameters.matching(pattern)}  # fmt: skip
    variables = design(model, values, used or None, gains, relaxed)
    return variables, {name: _tolerance(name, value, variables.start[name]) for name, value in values.items()}


def _tolerance(name: str, tolerance: Any, value: float) -> float:
    expected = "how far it may be off, in its unit or as a share of its value, such as '2 %'"
    if isinstance(tolerance, str):
        text = tolerance.strip()
        try:
            share = real(text.removesuffix("%")) / 100.0
        except ValueError as error:
            raise check.refuse(f"tolerance of '{name}'", "value", tolerance, expected) from error
        if not text.endswith("%"):
            raise check.refuse(f"tolerance of '{name}'", "value", tolerance, expected)
        if value == 0.0:
            raise ModelError(f"tolerance of '{name}': {tolerance} of 0 is nothing; give it in the parameter's unit.",
                             element=name, field="tolerances")  # fmt: skip
        result = share * abs(value)
    else:
        result = check.number(tolerance, f"tolerance of '{name}'", "value", expected)
    if not 0.0 < result < np.inf:
        raise check.refuse(f"tolerance of '{name}'", "value", tolerance, "more than 0")
    return result


def random_values(
    centre: Mapping[str, float], tolerance: Mapping[str, float], samples: int, distribution: str, seed: int | None
) -> dict[str, Array]:
    """Return random values (samples,) by variable.

    ``centre``, ``tolerance``: nominal value and tolerance of each variable. ``distribution``: "normal": the tolerance
    is three standard deviations; "uniform": all values within it are equally likely.
    """
    check.count(samples, "tolerances", "samples", 2)
    one_of(distribution, DEVIATION, "tolerances", "distribution", ModelError)
    random = np.random.default_rng(None if seed is None else check.count(seed, "tolerances", "seed", 0))
    result = {}
    for name, width in tolerance.items():
        off = random.standard_normal(samples) / 3.0 if distribution == "normal" else random.uniform(-1.0, 1.0, samples)
        result[name] = centre[name] + width * off
    return result


# What a tolerance is in each distribution.
MEANING = {"normal": "Normal distribution: a tolerance is three standard deviations.",
           "uniform": "Uniform distribution: all values within a tolerance are equally likely."}  # fmt: skip


@dataclass(frozen=True, repr=False, eq=False)
class Tolerances(Columnar, Displayed):
    """What scatter of parameters does to some numbers, ``labels`` (k,), whose ``nominal`` values (k,) are those of the
    model as it is. Quantities of several numbers have labels with the mode's number, "frequency 2 [Hz]", or count them,
    both from 1.

    To first order, from the derivatives: ``first`` (k,) are standard deviations, ``worst`` (k,) by how much all
    ``tolerance`` at once can change them, up or down, ``shares`` (k, variables) the part of each variable in the
    variance. By random samples: ``sweep`` holds them all, ``sampled`` (n, k) the numbers and ``linear`` (n, k) their
    first-order values.
    Modes within a few standard deviations of each other, ``close_modes``, repel each other, which is not linear: their
    first order is that of all of them together, ``first`` the standard deviation of ``linear``, ``worst`` a bound.
    """

    _engine = "index labels linear"

    name: str
    """Name of the model."""
    labels: tuple[str, ...]
    nominal: Array
    first: Array
    worst: Array
    shares: Array
    tolerance: Mapping[str, float]
    distribution: str
    """Distribution of the parameters within their tolerances."""
    sweep: Sweep
    sampled: Array = field(repr=False)
    linear: Array = field(repr=False)
    close_modes: NDArray[np.bool_] = field(repr=False)

    @cached_property
    def _good(self) -> NDArray[np.bool_]:
        return np.asarray(np.isfinite(self.sampled).all(axis=1))

    @cached_property
    def mean(self) -> Array:
        """Mean values of the samples, shape (k,)."""
        return np.asarray(self.sampled[self._good].mean(axis=0))

    @cached_property
    def std(self) -> Array:
        """Standard deviations of the samples, shape (k,)."""
        return np.asarray(self.sampled[self._good].std(axis=0, ddof=1))

    def quantile(self, share: float) -> Array:
        """Return what that share of the samples does not exceed.

        Parameters
        ----------
        share : float
            From 0 to 1.

        Returns
        -------
        array, shape (k,)
            Values of the numbers.
        """
        return np.asarray(np.quantile(self.sampled[self._good], share, axis=0))

    def within(self, label: str, low: float = -np.inf, high: float = np.inf) -> float:
        """Return the share of the samples in which a number lies between two limits: the yield.

        Parameters
        ----------
        label : str
            Which number.
        low, high : float
            The limits.

        Returns
        -------
        float
            From 0 to 1; samples that failed are not within.

        Raises
        ------
        ModelError, ResponseError
            If there is no such number, or the limits are not two numbers, the lower one first.
        """
        values, (low, high) = self.sampled[:, self.index(label)], limits(low, high, "within")
        return float(((values >= low) & (values <= high)).mean())

    def index(self, label: str) -> int:
        """Return the index of a number.

        Parameters
        ----------
        label : str
            Its label.

        Returns
        -------
        int
            The index in ``labels``.

        Raises
        ------
        ModelError
            If there is no such number.
        """
        check.known(label, self.labels, f"tolerances of '{self.name}': there is no '{label}'", told="There is:")
        return self.labels.index(label)

    _index = "quantity"

    def columns(self) -> dict[str, NDArray[Any]]:
        """Return nominal value, mean, standard deviations and worst-case deviation of each quantity as columns (k,) by
        name: ``quantity``, ``nominal``, ``mean``, ``std``, ``std_first_order``, ``worst_first_order``.
        """
        return {"quantity": np.array(self.labels), "nominal": self.nominal, "mean": self.mean, "std": self.std,
                "std_first_order": self.first, "worst_first_order": self.worst}  # fmt: skip

    def table(self) -> dict[str, Any]:
        """Return the table of all numbers as arguments of ``mbsvib.common.tables.text`` and ``show``."""
        names = list(self.tolerance)
        rows = []
        for i, label in enumerate(self.labels):
            known = bool(np.isfinite(self.first[i]))
            most = int(self.shares[i].argmax())
            low, high = self.nominal[i] - self.worst[i], self.nominal[i] + self.worst[i]
            rows.append((label, *(f"{x:.5g}" for x in (self.nominal[i], self.mean[i], self.std[i])),
                         *((f"{self.first[i]:.5g}", f"{low:.5g} ... {high:.5g}") if known else "--"),
                         *((names[most], f"{100.0 * self.shares[i, most]:.0f}") if known else "--")))  # fmt: skip
        heads = ("nominal", "mean", "std", "std, 1st order", "worst cases, 1st order", "most by", "share [%]")
        columns = [("", "left"), *((head, "left" if head == "most by" else "right") for head in heads)]
        notes = [f"{counted(len(names), 'variable')}, {counted(len(self.sampled), 'sample')}, "
                 f"{counted(int((~self._good).sum()), 'failure')}. {MEANING[self.distribution]}"]  # fmt: skip
        if self.close_modes.any():
            notes.append("Neighbouring modes repel each other as soon as anything is off: their means are not nominal.")
        return {"title": f"Tolerances of {self.name}", "columns": columns, "rows": rows, "notes": notes}

    def plot(self, label: str | None = None, *, ax: Given | None = None) -> Figure | Given:
        """Draw the samples and their first-order values.

        Parameters
        ----------
        label : str, optional
            Which number; default: up to twelve.
        ax : Axes or sequence of Axes, optional
            Where to draw, a panel each, row by row; default: a new figure.

        Returns
        -------
        matplotlib.figure.Figure, or ``ax``
            A histogram of samples for each number, first order as a line.
        """
        which = slice(MOST_LINES) if label is None else slice(self.index(label), self.index(label) + 1)
        return figures.tolerances(self.labels[which], self.sampled[:, which], self.linear[:, which],
                                  self.nominal[which], self.name, ax)  # fmt: skip

    def __repr__(self) -> str:
        return (f"Tolerances({self.name!r}: {counted(len(self.labels), 'number')}, "
                f"{counted(len(self.tolerance), 'variable')}, {counted(len(self.sampled), 'sample')})")  # fmt: skip


def tolerances(
    model: Model, tolerances: Mapping[str, Any], of: Quantity | Mapping[str, Quantity] | None = None, *,
    samples: int = 10_000, distribution: str = "normal", seed: int | None = 0, ties: Ties | None = None,
    derivatives: bool = True, workers: int | None = None, file: str | PathLike[str] | None = None,
    progress: Progress = None, plant: PlantFunction | None = None, relaxed: bool = False,
) -> Tolerances:  # fmt: skip
    """Return what scatter of parameters does to quantities, to first order and by random samples.

    variance = sum over variables of (d quantity / d variable x standard deviation)^2

    Parameters
    ----------
    model : Model
        The mechanism.
    tolerances : mapping of str to float or str
        How far each parameter may be off, up and down: a number in its unit, or a share of its value, "2 %". A pattern
        gives all that it picks the same tolerance; each is off by itself. What is off together is a name in ``ties``.
        Joint coordinates are off by displacements from the described pose [m, rad].
    of : Quantity or mapping of str to Quantity, optional
        The quantities of interest, as for ``optimize``. Default: all natural frequencies and damping ratios.
    samples : int
        How many random samples.
    distribution : str
        "normal": a tolerance is three standard deviations; "uniform": all values within it have the same density.
    seed : int, optional
        Of the random numbers; None: others each time.
    ties : mapping of str to mapping of str to float or Tie, optional
        Linear maps: {variable: {parameter or pattern: rate}}, and other functions, as for ``sweep``.
    derivatives : bool
        False: only random samples, for models whose derivatives are not supported; first-order results are then not a
        number.
    workers : int, optional
        How many processes.
    file : str or path-like, optional
        Record of the samples, from which it is resumed; needs a seed. It is identified as that of ``sweep``.
    progress : bool, callable or None
        True: a progress bar; None: on terminals.
    plant : callable, optional
        A function of the system that returns what quantities are those of in its place, such as a closed loop. Its
        further arguments, such as gains, may be among the tolerances by their names; their nominal values are their
        defaults. Derivatives are as of ``optimize``.
    relaxed : bool
        Whether springs keep their forces where joints are displaced, as for ``sweep``.

    Returns
    -------
    Tolerances
        Standard deviations, worst cases, shares of each variable, and all samples; prints as a table.

    Raises
    ------
    ModelError
        If a parameter is unknown, a tolerance is not positive, or derivatives to a parameter are not supported or do
        not exist.
    """
    quantities = _quantities(of)
    around = plant_of(plant, tolerances, model)
    variables, width = parameter_tolerances(model, tolerances, ties, around.gains, relaxed)
    used = {name: rates for name, rates in (ties or {}).items() if name in width}
    centre = {name: variables.start[name] for name in width}
    sizes = [abs(value) or width[name] for name, value in centre.items()]
    point = DesignPoint.at(Systems(model, variables, around), centre, np.ones(len(width)), np.array(sizes))
    columns = random_values(centre, width, samples, distribution, seed)
    off = np.array([columns[name] - centre[name] for name in width]).T
    if derivatives:
        linear = first_order(point, quantities, off, np.array(list(width.values())), DEVIATION[distribution])
    else:
        linear = no_order(point, quantities, off)
    indices = {label: quantity.of(point.modes) for label, quantity in quantities.items() if isinstance(quantity, Modal)}
    ask = _Ask(quantities, indices, plant is None and len(indices) == len(quantities))
    swept = sweep(model, columns, {" ".join(quantities): ask}, how="paired", ties=used or None, batched=ask.batched,
                  workers=workers, file=file, progress=progress, plant=plant, relaxed=relaxed)  # fmt: skip
    sampled = np.concatenate([swept[label].reshape(samples, -1) for label in quantities], axis=1)
    return Tolerances(model.name, _labels(quantities, linear.counts, ask), linear.nominal, linear.deviation,
                      linear.worst, linear.shares, width, distribution, swept, sampled, linear.linear,
                      linear.close_modes)  # fmt: skip


class _Ask:
    """The quantities of each sample; for a batch at once, if all are quantities of modes."""

    def __init__(self, quantities: Mapping[str, Quantity], indices: Mapping[str, list[int]], batched: bool) -> None:
        self.quantities, self.indices, self.batched = quantities, indices, batched

    def __call__(self, system: Any) -> dict[str, Any]:
        if not isinstance(system, Batch):
            return {label: np.atleast_1d(quantity(system)) for label, quantity in self.quantities.items()}
        modes = system.modes()
        return {label: quantity.in_batch(modes, self.indices[label]) for label, quantity in self.quantities.items()
                if isinstance(quantity, Modal)}  # fmt: skip


def _quantities(of: Any) -> dict[str, Quantity]:
    if of is None:
        return {"frequency [Hz]": frequency(), "damping ratio [1]": damping_ratio()}
    if isinstance(of, Quantity):
        return {f"{of.quantity} [{of.unit}]" if isinstance(of, Modal) else of.label: of}
    items = dict(of) if isinstance(of, Mapping) else {}
    for quantity in items.values():
        if not isinstance(quantity, Quantity):
            raise check.refuse("tolerances", "of", quantity, "a quantity, such as frequency()")
    if not items:
        raise check.refuse("tolerances", "of", of, "a quantity, such as frequency(), or several by label")
    return {str(label): quantity for label, quantity in items.items()}


def _labels(quantities: Mapping[str, Quantity], counts: tuple[int, ...], ask: _Ask) -> tuple[str, ...]:
    result: list[str] = []
    for label, count in zip(quantities, counts, strict=True):
        name, bracket, unit = label.partition(" [")
        result += [label] if count == 1 else [f"{name} {index + 1}{bracket}{unit}"
                                              for index in ask.indices.get(label, range(count))]  # fmt: skip
    return tuple(result)
