"""What a fit returns: the model that the data tell, with the confidence of its values.

Which further sensor or exciter tells most about the values of a fit.

With the information F = J^T J + 1 of x, of which prior knowledge is taken as 100 % each, a candidate with the rows j
adds log det(1 + j F^-1 j^T): what is not told counts before what is told well. Its noise is the median of that of the
measured channels of its kind.

Source: Atkinson, Donev & Tobias, Optimum Experimental Designs, with SAS (2007), section 10 (D-optimality).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any
from warnings import catch_warnings, simplefilter

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.common.arrays import Array, Complex
from mbsvib.common.columnar import Columnar
from mbsvib.common.display import Displayed
from mbsvib.common.selection import selected
from mbsvib.errors import ResponseError, counted
from mbsvib.fitting.knowledge import ResidualTest
from mbsvib.fitting.problem import Problem
from mbsvib.fitting.record_data import RecordData
from mbsvib.fitting.response_data import ResponseData, responses
from mbsvib.linalg.rank import TIE_BREAK
from mbsvib.measurement.data import Measurement
from mbsvib.measurement.modes import MeasuredModes
from mbsvib.measurement.records import Records

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from mbsvib.plots._sheet import Given


@dataclass(frozen=True, slots=True, repr=False)
class Candidate(Displayed):
    """A further channel: its ``name``, its ``gain`` of information log det, and the factor by which the widest interval
    would become narrower, ``narrower``, of the value ``widest``.
    """

    name: str
    gain: float
    narrower: float
    widest: str


def ranked(problem: Problem, x: Array, candidates: Any = None) -> tuple[Candidate, ...]:
    """Return candidates in the order of what they tell, the best first.

    ``candidates``: names or patterns of outputs and inputs of the model; None: all without data.
    """
    data = [part for part in problem.data if isinstance(part, ResponseData)]
    if not data:
        raise ResponseError("next_sensor: no frequency responses were fitted, at whose lines a sensor could be added.")
    information = np.eye(len(x)) + problem.sums(x, far=False).normal
    before = np.linalg.inv(information)
    variances = before.diagonal()
    widest = int((variances >= (1.0 - TIE_BREAK) * variances.max()).argmax())
    equations = problem.scenes[data[0].scene](problem.variables.map @ problem.variables.values(x), None)[0]
    ports = selected(candidates, equations.outputs + equations.inputs, "output or input", equations.name)
    bare = replace(problem.variables, prior=np.full_like(problem.variables.prior, np.nan))
    result = []
    for kind, known in (("output", equations.outputs), ("input", equations.inputs)):
        first = 0 if kind == "output" else len(equations.outputs)
        for number in [k - first for k in ports if 0 <= k - first < len(known)]:
            parts = tuple([part for one in data if (part := _with(one, kind, number, equations)) is not None])
            if not parts:
                continue
            more = information + replace(problem, data=parts, variables=bare).sums(x, far=False).normal
            gain = float(np.linalg.slogdet(more)[1] - np.linalg.slogdet(information)[1])
            after = np.linalg.inv(more)
            result.append(Candidate(known[number], gain, float(np.sqrt(before[widest, widest] / after[widest, widest])),
                                    problem.variables.names[widest]))  # fmt: skip
    if not result:
        raise ResponseError("next_sensor: no candidate is left; expected outputs or inputs of the model without data.")
    return tuple(sorted(result, key=lambda one: -float(f"{one.gain:.6g}")))  # equal gains: in the order of the model


def _with(data: ResponseData, kind: str, number: int, equations: Any) -> ResponseData | None:
    """The data that a further output or input would give; None where it has data.

    Its noise, and the factor to what would be measured, are those of measured channels of its unit; where there are
    none, its noise is as large against its responses as that of the others.
    """
    axis, units = (1, equations.output_units) if kind == "output" else (2, equations.input_units)
    measured = (data.rows if kind == "output" else data.columns).tolist()
    if number in measured:
        return None
    alike = [k for k, other in enumerate(measured) if units[other] == units[number]]
    weight, sign = (np.moveaxis(array, axis, 0) for array in (data.weight, data.sign))
    chosen = np.where(weight > 0.0, weight, np.nan)[alike or slice(None)]
    if not alike:
        chosen = chosen * np.moveaxis(np.abs(data.measured), axis, 0)
    with np.errstate(all="ignore"), catch_warnings():
        simplefilter("ignore", RuntimeWarning)  # lines without data
        typical = np.nan_to_num(np.nanmedian(chosen, axis=0))[None]
    end: dict[str, Any] = {"rows": np.array([number])} if kind == "output" else {"columns": np.array([number])}
    channels = data.channels.of_new_output() if kind == "output" else data.channels.of_new_input()
    factor = sign[alike[0]][None] if alike else np.ones(sign[:1].shape)
    weight, sign = np.moveaxis(typical, 0, axis), np.moveaxis(factor, 0, axis)
    result: ResponseData = replace(data, weight=weight, sign=sign.astype(complex), whitening=None, channels=channels,
                                   measured=np.zeros(weight.shape, dtype=complex), **end)  # fmt: skip
    if alike:
        return result
    size = np.abs(responses(equations, data.omega, result.rows, result.columns))
    return replace(result, weight=np.where(size > 0.0, result.weight / np.where(size > 0.0, size, 1.0), 0.0))


# Sizes of numbers that a table shows without a power of ten.
LEAST, MOST = 1e-3, 1e7


NOT_CONVERGED = ("The search did not converge. Begin with a model nearer to the data, bound values or give a prior, or "
                 "free fewer of them.")  # fmt: skip


@dataclass(frozen=True, repr=False, eq=False)
class Fit(Columnar, Displayed):
    """The ``model`` that measured data tell, and what is known of its ``values``, {name: value}.

    ``intervals`` {name: (low, high)} hold each value with a probability of 95 %, ``quantile`` standard deviations to
    both sides; they are infinite where the data do not tell it. ``covariance`` (v, v) of the values, in the order of
    ``names``. ``residual_test`` tells whether the residuals are noise; where they are not, intervals come from the
    residuals. ``unidentified`` names combinations of values that the data do not tell, which stay where they started.
    ``converged`` tells whether the search ended at a minimum. ``rates`` has for each value of the model the parameters
    that move with it, as ``parameters`` of all sensitivities; ``data`` is what was measured.
    """

    model: Any
    values: Mapping[str, float]
    intervals: Mapping[str, tuple[float, float]]
    covariance: Array
    units: Mapping[str, str]
    """Units of the values by name."""
    residual_test: ResidualTest
    unidentified: tuple[str, ...]
    converged: bool
    quantile: float = field(repr=False)
    rates: Mapping[str, Mapping[str, float]] = field(repr=False)
    data: tuple[Measurement | Records | MeasuredModes, ...] = field(repr=False)
    _problem: Problem = field(repr=False)
    _x: Array = field(repr=False)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the values (v,)."""
        return tuple(self.values)

    def deviation(self, slopes: ArrayLike) -> Array:
        """Return the standard deviation of a result that depends on the values.

        sd = sqrt(s^T C s) with the derivatives s of the result and the covariance C

        Parameters
        ----------
        slopes : array-like, shape (k, ...)
            Derivatives of the result to the values of the model, in the order of ``rates``: those of
            ``model.linearize().mode_sensitivities(fit.rates)``, of frequency responses, norms and budgets.

        Returns
        -------
        array, shape (...)
            Standard deviations in the unit of the result, infinite where it depends on what the data do not tell.

        Raises
        ------
        ResponseError
            If there is not one derivative for each value of the model.
        """
        array = np.asarray(slopes)
        k = len(self.rates)
        if array.ndim < 1 or len(array) != k:
            raise ResponseError(f"deviation: slopes have the shape {array.shape}; expected ({k}, ...), one for each "
                                f"value of the model in the order of fit.rates.")  # fmt: skip
        flat = array.reshape(k, -1)
        told = np.isfinite(self.covariance.diagonal()[:k])
        part = self.covariance[:k, :k][np.ix_(told, told)]
        square = np.einsum("ki,kl,li->i", flat[told].conj(), part, flat[told]).real
        matters = (np.abs(flat[~told]) > 0.0).any(axis=0)
        return np.where(matters, np.inf, np.sqrt(np.maximum(square, 0.0))).reshape(array.shape[1:])

    def half_width(self, slopes: ArrayLike) -> Array:
        """Return half the width of the 95 % interval of a result that depends on the fitted values.

        Parameters
        ----------
        slopes : array-like, shape (k, ...)
            As of ``deviation``.

        Returns
        -------
        array, shape (...)
            In the unit of the result: its deviation times the quantile of the normal distribution, or of Student's
            where residuals tell the noise.
        """
        return self.quantile * self.deviation(slopes)

    def next_sensor(self, candidates: Any = None) -> tuple[Candidate, ...]:
        """Return which further sensor or exciter tells most about the values, the best first.

        Parameters
        ----------
        candidates : str or sequence of str, optional
            Names or patterns of outputs and inputs of the model; default: all without data.

        Returns
        -------
        tuple of Candidate
            Each with ``name``, ``gain`` and ``narrower``, the factor by which the widest interval shrinks.

        Raises
        ------
        ResponseError
            If no frequency responses were fitted, a name is unknown, or all candidates have data.

        Source: Atkinson, Donev & Tobias (2007), section 10.
        """
        return ranked(self._problem, self._x, candidates)

    def responses(self, number: int = 1) -> Complex:
        """Return what the fit says of measured responses.

        Parameters
        ----------
        number : int
            Which of the measurements with responses, from 1.

        Returns
        -------
        array, shape (outputs, inputs, n)
            Responses of the model through the channels, NaN where nothing was measured.

        Raises
        ------
        ResponseError
            If there is no such measurement.
        """
        return self._of_responses(self._drawn(number, (Measurement,), "responses")[0])

    def plot(self, number: int = 1, *, ax: Given | None = None) -> Figure | Given:
        """Draw measured and fitted responses, or time records.

        Parameters
        ----------
        number : int
            Which of the measured responses and time records, from 1 in the order of ``data``.
        ax : Axes or sequence of Axes, optional
            Where to draw, a panel each, row by row; default: a new figure.

        Returns
        -------
        matplotlib.figure.Figure, or ``ax``
            One panel for each pair of input and output; of records one for each output, of the first experiment and
            within the band of the lines.

        Raises
        ------
        ResponseError
            If there is no such measurement.
        """
        from mbsvib.plots.measured import measured, recorded

        k, data = self._drawn(number, (Measurement, Records), "responses or records")
        label = f"fit of {self.model.name}"
        if isinstance(data, Measurement):
            return measured(data, self._of_responses(k), label, ax=ax)
        known = self._problem.data[k]
        assert isinstance(known, RecordData)
        spectra = data.spectra("output"), known.fitted(self._problem.residuals(self._x)[k])
        shown, fitted = (data.in_time(one)[:, 0] for one in spectra)
        return recorded(data, shown, fitted, label, ax=ax)

    def _drawn(self, number: int, kinds: tuple[type, ...], words: str) -> tuple[int, Any]:
        """Place and data of one of those of some kinds."""
        known = [(k, one) for k, one in enumerate(self.data) if isinstance(one, kinds)]
        if number not in range(1, len(known) + 1):
            raise ResponseError(f"number = {number}; expected 1 to {len(known)}, the number of one of the measurements "
                                f"with {words}.")  # fmt: skip
        return known[number - 1]

    def _of_responses(self, k: int) -> Complex:
        return np.moveaxis(self._problem.fitted(self._x, k), 0, 2)

    _index = "name"

    def columns(self) -> dict[str, Any]:
        """Return the values with their units and limits of the 95 % intervals as columns (values,) by name: ``name``,
        ``unit``, ``value``, ``low``, ``high``.
        """
        low, high = np.array([self.intervals[name] for name in self.values]).reshape(-1, 2).T
        return {"name": np.array(list(self.values)), "unit": np.array([self.units[name] for name in self.values]),
                "value": np.array(list(self.values.values())), "low": low, "high": high}  # fmt: skip

    def table(self) -> dict[str, Any]:
        """Return the values with their intervals, as arguments of ``mbsvib.common.tables.text``."""
        rows = []
        for name, value in self.values.items():
            low, high = self.intervals[name]
            shown, *both = _rounded(value, low, high)
            width = " ... ".join(both) if np.isfinite(high - low) else "not determined by the data"
            rows.append((name, shown, width, self.units[name]))
        test = self.residual_test
        notes = [] if self.converged else [NOT_CONVERGED]
        notes += [f"Not determined by the data: {words}." for words in self.unidentified]
        free = self._problem.variables
        ends = zip(free.names, free.low, free.high, strict=True)
        notes += [f"{name} is at its bound." for name, *limits in ends if self.values.get(name) in limits]
        if test.passed:
            notes.append("The residuals are noise.")
        else:
            size = "" if np.isnan(test.ratio) else f" {np.sqrt(test.ratio):.3g} times as large as the stated noise,"
            notes.append(f"The model does not explain the data: residuals{size} with a correlation of "
                         f"{test.correlation:.2f} from line to line are no noise.")  # fmt: skip
            notes.append("Intervals come from the residuals.")
            if test.bands:
                shown = ", ".join(f"{low:.4g} to {high:.4g}" for low, high in test.bands[:6])
                notes.append(f"Not reached: {shown}{' ...' if len(test.bands) > 6 else ''} Hz.")
        return {"title": f"Fit of {self.model.name}", "columns": [("value", "left"), ("", "right"), ("95 %", "right"),
                ("unit", "left")], "rows": rows, "notes": notes}  # fmt: skip

    def __repr__(self) -> str:
        return f"Fit({self.model.name!r}: {counted(len(self.values), 'value')})"


def _rounded(value: float, low: float, high: float) -> list[str]:
    """A value and its interval to as many digits as the interval leaves, two of its width."""
    largest, width = max(abs(value), abs(low), abs(high)), high - low
    if not 0.0 < width < np.inf:
        return [f"{one:.6g}" for one in (value, low, high)]
    last = int(np.floor(np.log10(width))) - 1  # the last digit, as a power of ten
    if LEAST <= largest < MOST:
        return [f"{one:.{max(0, -last)}f}" for one in (value, low, high)]
    digits = max(1, int(np.floor(np.log10(largest))) - last)
    return [f"{one:.{digits}e}" for one in (value, low, high)]
