"""Time records as they were measured: inputs and outputs on an even grid, with the noise of the outputs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mbsvib.common.arguments import shown
from mbsvib.common.arrays import Array, Complex, Index
from mbsvib.common.columnar import Columnar
from mbsvib.common.display import Displayed
from mbsvib.common.expected import one_of, reals
from mbsvib.common.selection import signal_names
from mbsvib.errors import ResponseError, counted
from mbsvib.linalg.bands import BAND_END, within
from mbsvib.linalg.covariances import are_covariances
from mbsvib.measurement.channels import channels_of
from mbsvib.measurement.matching import Matched
from mbsvib.measurement.time_records import check_length, stacked, step_of
from mbsvib.responses.densities import density

WHO = "Records"
HOLDS = ("first", "zero", "band-limited")
# Highest line of signals that are band-limited, in parts of the sampling rate: beyond it what is folded back from above
# is no polynomial of the low order that a fit takes for it.
HIGHEST = 0.4


@dataclass(frozen=True, repr=False, eq=False)
class Records(Matched, Columnar, Displayed):
    """Time records of inputs and outputs, as data of ``Model.fit``; what went before them need not be known.

    y_k = (G u)_k + transient + n_k

    Parameters
    ----------
    t : array-like, shape (N,), or float
        Even times [s], or the time between samples [s].
    inputs, outputs : dict of str to array-like, shape (N,) or (experiments, N)
        Records by name; labels such as ``"101X+"`` are read as nodes and directions. Without inputs: free decay.
    variance : float or dict of str to float, optional
        Variance of the noise of the samples of all outputs, or of each [unit^2]; the noise is white.
    covariance : array-like, shape (outputs, outputs), optional
        Covariance of the noise of the samples of the outputs, instead.
    noise : dict of str to density, optional
        One-sided density of the noise of each output [unit^2/Hz], instead: a number, pairs (frequency [Hz], density) or
        a function of frequencies. With none of the three, residuals tell the noise of each output.
    hold : str
        What inputs are between samples: "first": linear; "zero": constant from each sample to the next, as behind a
        converter; "band-limited": measured, as the outputs are, behind filters against aliasing.
    band : (float, float), optional
        First and last frequency [Hz] of the lines that count; default: all from 1 / (length of the record) to half the
        sampling rate, to 0.4 of it where signals are band-limited. Means, and drifts that are
        linear in time, do not count.
    quantity, output_units, input_units, output_points, input_points, nodes : optional
        Of the channels, as of a ``Measurement``.

    Raises
    ------
    ResponseError
        If records do not match, times are uneven, a record is too short for the band, or the noise is not one.

    Source: Pintelon & Schoukens, System Identification: A Frequency Domain Approach (2012), sections 6.3 and 13.
    """

    t: Any
    inputs: Any
    outputs: Any
    variance: Any = None
    covariance: Any = None
    noise: Any = None
    hold: str = "first"
    band: tuple[float, float] | None = None
    quantity: Any = None
    output_units: tuple[str, ...] = ()
    input_units: tuple[str, ...] = ()
    output_points: Any = None
    input_points: Any = None
    nodes: Any = ()

    def __post_init__(self) -> None:
        records, sizes = stacked({"output": self.outputs, "input": self.inputs, "reference": {}}, WHO, ("output",))
        count = records.shape[-1]
        values: dict[str, Any] = {"t": step_of(self.t, count, WHO)}
        one_of(self.hold, HOLDS, WHO, "hold")
        check_length(count * values["t"], self.band, None, "local", WHO)
        for kind, part in zip(("outputs", "inputs"), np.split(records, [sizes[0]], axis=1), strict=True):
            names = signal_names(tuple(getattr(self, kind)), part.shape[1], kind, WHO)
            part.setflags(write=False)
            values[kind] = {name: part[:, k] for k, name in enumerate(names)}
        values |= channels_of(self, tuple(values["outputs"]), tuple(values["inputs"]), WHO)
        for name, value in values.items():
            object.__setattr__(self, name, value)
        if sum(one is not None for one in (self.variance, self.covariance, self.noise)) > 1:
            raise ResponseError(f"{WHO}: variance, covariance and noise state the same; expected one of them.")
        self.power()
        self.lines()

    @property
    def samples(self) -> int:
        """How many samples each record has."""
        return int(next(iter(self.outputs.values())).shape[-1])

    @property
    def experiments(self) -> int:
        """How many experiments there are."""
        return int(next(iter(self.outputs.values())).shape[0])

    def columns(self) -> dict[str, Any]:
        """Return the records, one experiment after the other, as columns (experiments * N,) by name: ``experiment``,
        from 1, ``time_s``, and the channels by their names.
        """
        count, times = self.experiments, np.arange(self.samples) * self.t
        channels = {**self.outputs, **self.inputs}
        return {"experiment": np.repeat(np.arange(1, count + 1), self.samples), "time_s": np.tile(times, count),
                **{name: values.ravel() for name, values in channels.items()}}  # fmt: skip

    def lines(self) -> Index:
        """Return the numbers of the lines that count; line k is at k / (length of the record).

        Returns
        -------
        array of int, shape (n,)
            In ascending order.

        Raises
        ------
        ResponseError
            If the band has no line, or reaches beyond what the samples tell.
        """
        length, last = self.samples * self.t, (self.samples - 1) // 2
        numbers = np.arange(1, last + 1)
        most = min(last, HIGHEST * self.samples) if self.hold == "band-limited" else last
        low, high = self.band or (0.0, most / length)
        if self.band is not None and np.floor(high * length * (1.0 - BAND_END)) > most:
            raise ResponseError(f"{WHO}: band = {shown(self.band)} Hz, with a sampling rate of {1 / self.t:g} Hz and "
                                f"hold='{self.hold}'; expected no more than {most / length:g} Hz.")  # fmt: skip
        numbers = numbers[within(numbers, low * length, high * length)]
        if not len(numbers):
            raise ResponseError(f"{WHO}: no line from {low:g} to {high:g} Hz; there are lines each {1 / length:g} Hz "
                                f"up to {most / length:g} Hz.")  # fmt: skip
        return np.asarray(numbers)

    def spectra(self, kind: str) -> Complex:
        """Return Fourier coefficients (n, channels, experiments) of "output" or "input" at the lines.

        Parameters
        ----------
        kind : str
            "output" or "input".

        Returns
        -------
        array, shape (n, channels, experiments)
            Those of white noise have its variance.
        """
        records = list(getattr(self, f"{kind}s").values())
        values = np.array(records).reshape(len(records), self.experiments, self.samples)
        return np.moveaxis(np.fft.rfft(values)[..., self.lines()] / np.sqrt(self.samples), 2, 0)

    def in_time(self, spectra: Complex) -> Array:
        """Return the records (channels, experiments, N) of Fourier coefficients at the lines, as ``spectra`` has them.

        Parameters
        ----------
        spectra : array, shape (n, channels, experiments)
            Coefficients at the lines; at other frequencies there is nothing.

        Returns
        -------
        array, shape (channels, experiments, N)
            What the band of the lines holds of the records.
        """
        every = np.zeros((*spectra.shape[1:], self.samples // 2 + 1), dtype=complex)
        every[..., self.lines()] = np.moveaxis(spectra, 0, 2) * np.sqrt(self.samples)
        return np.asarray(np.fft.irfft(every, self.samples))

    def power(self) -> Array | None:
        """Return the noise of these coefficients, None where it is not known.

        Returns
        -------
        array, shape (n or 1, outputs, outputs), or None
            Covariances.

        Raises
        ------
        ResponseError
            If the noise is not stated for each output, or is not positive.
        """
        names = tuple(self.outputs)
        if self.covariance is not None:
            full = np.array(reals(self.covariance, WHO, "covariance", "that of the outputs"))
            if full.shape != (len(names),) * 2 or not are_covariances(full, definite=True):
                raise ResponseError(f"{WHO}: covariance has shape {full.shape}; expected a symmetric positive definite "
                                    f"matrix of the {counted(len(names), 'output')}.")  # fmt: skip
            return full[None]
        given = self.noise if self.noise is not None else self.variance
        if given is None:
            return None
        field = "noise" if self.noise is not None else "variance"
        if not hasattr(given, "items"):
            given = dict.fromkeys(names, given)
        if set(given) != set(names):
            raise ResponseError(f"{WHO}: {field} of {', '.join(map(str, given)) or 'no output'}; expected one of each "
                                f"of {', '.join(names)}.")  # fmt: skip
        frequencies = self.lines() / (self.samples * self.t)
        scale = 0.5 / self.t if field == "noise" else 1.0
        rows = np.array([density(given[name], f"{WHO}: {field} of '{name}'").at(frequencies) for name in names]) * scale
        if not (np.isfinite(rows) & (rows > 0.0)).all():
            k = int(np.argmin((np.isfinite(rows) & (rows > 0.0)).all(axis=1)))
            raise ResponseError(f"{WHO}: {field} of '{names[k]}' is not positive at all lines; expected a positive "
                                f"number there.")  # fmt: skip
        return np.asarray(np.einsum("on,op->nop", rows, np.eye(len(names))))

    def __repr__(self) -> str:
        return (f"Records({counted(len(self.inputs), 'input')}, {counted(len(self.outputs), 'output')}, "
                f"{counted(self.experiments, 'experiment')} of {self.samples * self.t:g} s)")  # fmt: skip

    def table(self) -> dict[str, Any]:
        """Return title, columns and rows of the table that ``print`` shows."""
        rows = [(kind, name, unit or "?", f"{np.sqrt(np.mean(values**2)):.4g}")
                for kind in ("output", "input") for (name, values), unit in
                zip(getattr(self, f"{kind}s").items(), getattr(self, f"{kind}_units"), strict=True)]  # fmt: skip
        names = ("", "channel", "unit", "rms")
        return {"title": repr(self), "columns": [(name, "right" if name == "rms" else "left") for name in names],
                "rows": rows}  # fmt: skip
