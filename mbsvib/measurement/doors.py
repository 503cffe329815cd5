"""Measurements from other programs and from time records, and back to them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Self, cast

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.common.arguments import shown
from mbsvib.common.columnar import pandas_for
from mbsvib.common.expected import one_of, reals
from mbsvib.common.labelled import Labelled, of_responses
from mbsvib.common.selection import selected
from mbsvib.errors import ResponseError
from mbsvib.linalg.bands import within
from mbsvib.measurement.array_files import ArrayFiles
from mbsvib.measurement.estimation import estimate
from mbsvib.measurement.points import point_of
from mbsvib.measurement.time_records import check_length, samples_of, si, stacked, step_of

METHODS = ("H1", "H2", "Hv", "local", "periodic")
HERTZ, ENDS = "frequency [Hz]", ["output", "input"]  # names of rows and columns in tables of pandas


def _dotted(labels: Sequence[str]) -> tuple[str, ...]:
    """Names of signals of python-control as they are here."""
    return tuple([label if point_of(label) else label.replace(":", ".") for label in labels])


class Doors(ArrayFiles):
    """The ways in and out of a ``Measurement``."""

    __slots__ = ()

    @classmethod
    def from_records(
        cls, t: ArrayLike, inputs: Mapping[str, ArrayLike], outputs: Mapping[str, ArrayLike], *, method: str = "H1",
        segments: int | None = None, period: float | None = None, reference: Mapping[str, ArrayLike] | None = None,
        noise_ratio: float | None = None, band: tuple[float, float] | None = None,
        lowest: tuple[float, float] | None = None, **channels: Any,
    ) -> Self:  # fmt: skip
        """Return frequency responses with their variance, estimated from time records.

        H1 = Syu Suu^-1,  H2 = Syy Suy^-1,  in a closed loop Syr Sur^-1

        Parameters
        ----------
        t : array-like, shape (N,), or float
            Even times [s], or the time between samples [s].
        inputs, outputs : dict of str to array-like, shape (N,) or (experiments, N)
            Records by name; what is excited in turn comes in several experiments.
        method : str
            "H1" (noise at the outputs), "H2" (at the inputs) and "Hv" (at both) average Hann windows that overlap by
            half. "local" fits polynomials over neighbouring lines of whole records, without leakage and with all their
            resolution, unbiased by noise at the outputs. "periodic" takes whole periods, Y U^-1 line by line.
        segments : int, optional
            Number of segments into which each record is divided, for averages.
        period : float, optional
            Period [s] of the excitation, for "periodic"; the last whole periods count.
        reference : dict of str to array-like, optional
            Records of signals from outside of a closed loop, with "H1" or "local": as many as inputs or more.
        noise_ratio : float, optional
            For "Hv": standard deviation of the noise of outputs over that of inputs [output unit / input unit];
            default: the same share of the power in each channel.
        band : (float, float), optional
            First and last frequency [Hz] that are kept; default: all above 0.
        lowest : (float, float), optional
            Frequency f [Hz] and damping ratio of the most lightly damped mode that the lines must resolve: segments and
            periods of 1 / (ratio f), records of 4 / (ratio f) for "local". Then its peak is off by less than 20 %; with
            4 times the length by 2 % for segments, 0.6 % for "local", whose variance covers it.
        **channels
            Quantities, units, points and nodes, as of a ``Measurement``.

        Returns
        -------
        Measurement
            The responses; ``notes`` tell method, resolution, averages and the condition of the inputs.

        Raises
        ------
        ResponseError
            If records do not match, times are uneven, a record is too short for the frequencies, inputs are not
            independent, or an option is missing or does not belong to the method.

        Source
        ------
        Pintelon, R., Schoukens, J., System Identification: A Frequency Domain Approach (2012), chapters 2 and 7.
        """
        windowed = one_of(method, METHODS, "from_records", "method") in ("H1", "H2", "Hv")
        for name, value, belongs in (("segments", segments, windowed), ("period", period, method == "periodic")):
            if (value is not None) != belongs:
                raise ResponseError(f"from_records: {name} = {shown(value)} with method={method!r}; expected "
                                    f"{'one' if belongs else 'none'}.")  # fmt: skip
        if noise_ratio is not None and (method != "Hv" or np.ndim(noise_ratio) or not 0.0 < reals(
                noise_ratio, "from_records", "noise_ratio", "a positive number") < np.inf):  # fmt: skip
            raise ResponseError(f"from_records: noise_ratio = {shown(noise_ratio)} with method={method!r}; expected a "
                                f"positive number with 'Hv', else none.")  # fmt: skip
        if reference is not None and method not in ("H1", "local"):
            raise ResponseError(f"from_records: reference with method={method!r}; expected 'H1' or 'local'.")
        loop = {} if reference is None else reference
        records, sizes = stacked({"output": outputs, "input": inputs, "reference": loop})
        step = step_of(t, records.shape[-1])
        samples = samples_of(records.shape[-1], step, segments, period)
        check_length(samples * step, band, lowest, method)
        resolution = 1.0 / (samples * step)
        low, high = band or (0.0, np.inf)
        numbers = np.arange(1, (samples + 1) // 2)  # below half the sampling rate
        numbers = numbers[within(numbers * resolution, low, high)]
        if not len(numbers):
            raise ResponseError(f"from_records: no line from {low:g} to {high:g} Hz; there are lines each "
                                f"{resolution:g} Hz up to {0.5 / step:g} Hz.")  # fmt: skip
        result = estimate(records, sizes, method, (samples, numbers), noise_ratio)
        worst = np.argmax(result.condition)
        notes = [f"method {method}", f"resolution {resolution:g} Hz"]
        notes += [f"{result.averages:.3g} independent averages"] if windowed else []
        notes += [] if sizes[1] == 1 else [f"condition of the inputs up to {result.condition[worst]:.3g}, at "
                                           f"{numbers[worst] * resolution:g} Hz"]  # fmt: skip
        return cls(
            omega=2 * np.pi * resolution * numbers, responses=result.responses, outputs=tuple(outputs),  # type: ignore[call-arg]
            inputs=tuple(inputs), variance=result.variance, coherence=result.coherence, averages=result.averages,
            noise_variance=result.noise, line_correlation=result.correlation, notes=tuple(notes), **channels,
        )  # fmt: skip

    @classmethod
    def from_sep005(
        cls, channels: Sequence[Mapping[str, Any]], inputs: str | Sequence[str],
        reference: str | Sequence[str] = (), **options: Any,
    ) -> Self:  # fmt: skip
        """Return frequency responses from time records as SEP 005 has them, dicts as many readers return.

        Parameters
        ----------
        channels : sequence of dict
            Each with "name", "data" (N,), "fs" [Hz] or "time" (N,) [s], and, if known, "unit_str" and
            "start_timestamp". Units such as g and mm are converted to SI units.
        inputs : str or sequence of str
            Names or patterns of those that are inputs; the others are outputs.
        reference : str or sequence of str
            Names or patterns of those from outside of a closed loop.
        **options
            As of ``from_records``.

        Returns
        -------
        Measurement
            The responses.

        Raises
        ------
        ResponseError
            If an entry is missing, or records have different rates, lengths or starts.

        Source
        ------
        SDyPy Enhancement Proposal 5, a format of time series.
        """
        channels = list(channels)
        if not all(hasattr(channel, "items") for channel in channels):
            raise ResponseError(f"from_sep005: channels = {shown(channels)}; expected dicts with 'name', 'data', and "
                                f"'fs' or 'time'.")  # fmt: skip
        missing = [key for key in ("name", "data") if any(key not in channel for channel in channels)]
        if missing or not channels:
            raise ResponseError(f"from_sep005: {'no channels' if not channels else f'{missing[0]!r} is missing'}; "
                                f"expected dicts with 'name', 'data', and 'fs' or 'time'.")  # fmt: skip
        twice = sorted({str(c["name"]) for c in channels if [d["name"] for d in channels].count(c["name"]) > 1})
        if twice:
            raise ResponseError(f"from_sep005: {', '.join(twice)} is there more than once; expected one record of each "
                                f"channel.")  # fmt: skip
        steps = {}
        for channel in channels:
            name, data = str(channel["name"]), reals(channel["data"], "from_sep005", "data", "numbers")
            if data.ndim != 1:
                raise ResponseError(f"from_sep005: 'data' of '{name}' has shape {data.shape}; expected one record.")
            times, rate = channel.get("time"), channel.get("fs") or 0.0
            rate = float(reals(rate, "from_sep005", f"'fs' of '{name}'", "a rate [Hz]")) if times is None else 0.0
            if times is None and not 0.0 < rate < np.inf:
                raise ResponseError(f"from_sep005: '{name}' has neither 'time' nor a positive 'fs'.")
            step = 1.0 / rate if times is None else step_of(times, len(data))
            steps[name] = (round(step, 12), len(data), str(channel.get("start_timestamp", "")))
        if len(set(steps.values())) > 1:
            listed = "; ".join(f"{name}: {n} samples each {step:g} s {start}"
                               for name, (step, n, start) in steps.items())  # fmt: skip
            raise ResponseError(f"from_sep005: records differ, expected one rate, length and start ({listed}).")
        names = list(steps)
        groups = [[names[k] for k in selected(wanted, names, "channel", "records")] if wanted else []
                  for wanted in (inputs, reference)]  # fmt: skip
        groups.append([name for name in names if name not in (*groups[0], *groups[1])])
        scaled = {str(c["name"]): si(c) for c in channels}
        taken, loop, outputs = ({name: scaled[name][0] for name in group} for group in groups)
        units = {f"{kind}_units": tuple(scaled[name][1] for name in group)
                 for kind, group in (("output", outputs), ("input", taken))}  # fmt: skip
        return cls.from_records(step, taken, outputs, reference=loop or None, **(units | options))

    @classmethod
    def from_frd(cls, frd: Any, **channels: Any) -> Self:
        """Return the responses of a frequency response data object of python-control, with its names.

        A colon is a dot here, as python-control allows none, but in labels such as ``"B:101X+"``.

        Parameters
        ----------
        frd : control.FRD
            Responses over angular frequencies, ascending.
        **channels
            Variance, quantities, units, points and nodes, as of a ``Measurement``.

        Returns
        -------
        Measurement
            The responses.

        Raises
        ------
        ResponseError
            If it has no frequency responses.
        """
        values = frd.frdata if hasattr(frd, "frdata") else getattr(frd, "fresp", None)  # the name in control 0.10.1
        if values is None or not hasattr(frd, "omega"):
            raise ResponseError(f"from_frd: {type(frd).__name__} has no frequency responses; expected a control.FRD.")
        order = np.argsort(frd.omega)
        return cls(omega=np.asarray(frd.omega)[order], responses=np.asarray(values)[..., order],
                   outputs=_dotted(frd.output_labels), inputs=_dotted(frd.input_labels), **channels)  # type: ignore[call-arg]  # fmt: skip

    def to_frd(self) -> Any:
        """Return the responses as frequency response data of python-control, with all names; a dot is a colon there.

        Returns
        -------
        control.FRD
            Responses (outputs, inputs, n) over angular frequencies [rad/s].
        """
        import control

        data: Any = self
        inputs, outputs = ([name.replace(".", ":") for name in names] for names in (data.inputs, data.outputs))
        return control.frd(data.responses.copy(), data.omega.copy(), inputs=inputs, outputs=outputs)

    def to_pandas(self) -> Any:
        """Return the responses as a table of pandas.

        Returns
        -------
        pandas.DataFrame
            One row a frequency [Hz], complex columns of output and input.

        Raises
        ------
        ExportError
            If pandas is not installed.
        """
        data, pandas = cast("Any", self), pandas_for("to_pandas")
        columns = pandas.MultiIndex.from_product([data.outputs, data.inputs], names=ENDS)
        index = pandas.Index(data.frequencies, name=HERTZ)
        return pandas.DataFrame(data.responses.reshape(len(columns), len(index)).T, index=index, columns=columns)

    def to_xarray(self) -> Any:
        """Return the responses and their noise as a data set of xarray.

        Returns
        -------
        xarray.Dataset
            "response" and, as far as known, "variance", "coherence" and "noise_variance" (output, input, frequency),
            "covariance" (output, other_output, frequency), "line_correlation" (distance); coordinates "frequency" [Hz],
            "output", "input", and "output_unit", "input_unit" of each.

        Raises
        ------
        ExportError
            If xarray is not installed.
        """
        data, axes = cast("Any", self), ("output", "input", "frequency")
        known: dict[str, Labelled] = {"response": (axes, data.responses, None)}
        known |= {name: (axes, array, None) for name in ("variance", "coherence", "noise_variance")
                  if (array := getattr(data, name)) is not None}  # fmt: skip
        if len(data.line_correlation):
            known["line_correlation"] = ("distance",), data.line_correlation, None
        if data.covariance is not None:
            known["covariance"] = ("output", "other_output", "frequency"), data.covariance, None
        return of_responses("to_xarray", data.frequencies, (data.outputs, data.inputs),
                            (data.output_units, data.input_units), known)  # fmt: skip

    @classmethod
    def from_pandas(cls, table: Any, **channels: Any) -> Self:
        """Return the responses of a table of pandas, as ``to_pandas`` returns it.

        Parameters
        ----------
        table : pandas.DataFrame
            One row a frequency [Hz], in any order, complex columns with two levels, output and input. A pair without
            column was not measured.
        **channels
            Variance, quantities, units, points and nodes, as of a ``Measurement``; arrays in the order of outputs and
            inputs in the columns, and of ascending frequencies.

        Returns
        -------
        Measurement
            The responses.

        Raises
        ------
        ResponseError
            If the columns do not have two levels, a pair is there twice, or the rows are no frequencies in Hz.
        """
        index: Any = getattr(table, "index", None)
        columns: Any = getattr(table, "columns", ())
        if getattr(columns, "nlevels", 0) != 2 or getattr(index, "name", None) not in (None, HERTZ):
            raise ResponseError(f"from_pandas: {type(table).__name__} with rows {getattr(index, 'name', None)!r} and "
                                f"{getattr(columns, 'nlevels', 0)} levels of columns; expected a DataFrame with rows "
                                f"'{HERTZ}' and columns of two levels, (output, input).")  # fmt: skip
        pairs = [(str(output), str(source)) for output, source in columns]
        if len(set(pairs)) < len(pairs):
            raise ResponseError("from_pandas: a pair of output and input has two columns; expected one of each.")
        frequencies = reals(index, "from_pandas", "rows", "frequencies [Hz]")
        order = np.argsort(frequencies)
        outputs, inputs = (tuple(dict.fromkeys(names)) for names in zip(*pairs, strict=True)) if pairs else ((), ())
        responses = np.full((len(outputs), len(inputs), len(order)), complex(np.nan, np.nan))
        for (output, source), values in zip(pairs, table.to_numpy().T, strict=True):
            responses[outputs.index(output), inputs.index(source)] = values[order]
        return cls(omega=2 * np.pi * frequencies[order], responses=responses, outputs=outputs, inputs=inputs,  # type: ignore[call-arg]
                   **channels)  # fmt: skip

    def virtual_point(self, name: str, position: ArrayLike, outputs: Any = None, inputs: Any = None) -> Self:
        """Return the measurement with six displacements and forces at one point of a rigid part, for ``mv.assemble``.

        q = (R^T R)^-1 R^T u, with a row e, (r - p) x e of R for a channel at r along e; forces alike

        Parameters
        ----------
        name : str
            Name P of the point: the channels become P.x ... P.rz, as far as they tell these.
        position : array-like, shape (3,)
            The point p [m], world axes.
        outputs, inputs : str or sequence of str, optional
            Sensors and impacts on the rigid part with known places, names or patterns; better nine than the needed six.

        Returns
        -------
        Measurement
            Other channels, then those of the point, with their variances; ``common_errors`` keeps for ``mv.assemble``
            and ``fit`` which sensors they come from. ``consistency`` says which share of each channel a rigid motion
            explains.

        Raises
        ------
        ResponseError
            If a place is not known, quantities differ, or the channels tell no direction.

        Source: van der Seijs, van den Bosch, Rixen & de Klerk, COMPDYN 2013.
        """
        from mbsvib.measurement.common_errors import with_virtual_point

        return cast("Self", with_virtual_point(self, name, position, outputs, inputs))
