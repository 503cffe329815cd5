"""Measured data: frequency responses between named points of a structure with their noise, and modes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from mbsvib.common.arguments import shown
from mbsvib.common.arrays import Array, Complex
from mbsvib.common.columnar import Columnar, by_pair
from mbsvib.common.display import Displayed
from mbsvib.common.expected import ascending, limits, reals
from mbsvib.common.selection import key_ports, needed_ports, signal_names
from mbsvib.errors import ResponseError, counted
from mbsvib.linalg.bands import within
from mbsvib.linalg.covariances import are_covariances
from mbsvib.measurement.channels import channels_of
from mbsvib.measurement.common_errors import CommonErrors
from mbsvib.measurement.doors import Doors
from mbsvib.measurement.matching import Matched

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from mbsvib.plots._sheet import Given

# Coherence of 1, and symmetry of a covariance, up to rounding of the program that estimated them.
_ROUNDED = 1e-6
WHO = "Measurement"


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredMode:
    """A mode: undamped ``frequency`` [Hz], ``damping_ratio`` [1] and ``shape`` (nodes, 6), x y z rx ry rz, world axes,
    for the nodes with the numbers ``nodes``; real where the mode is a normal one, NaN where it is not known.
    """

    name: str
    frequency: float
    damping_ratio: float
    nodes: tuple[int, ...]
    shape: Array | Complex

    def __post_init__(self) -> None:
        self.shape.setflags(write=False)


@dataclass(frozen=True, repr=False, eq=False)
class Measurement(Matched, Columnar, Doors, Displayed):
    """Frequency responses of a structure, as measured, with their noise and the places of all channels.

    y(i w) = G(i w) u(i w) + n;  of G is known ``responses``, of its error the mean square E|n|^2

    Parameters
    ----------
    omega : array-like, shape (n,)
        Angular frequencies [rad/s], ascending.
    responses : array-like, shape (outputs, inputs, n)
        Complex responses [output unit / input unit]; NaN: a pair or line that was not measured.
    outputs, inputs : sequence of str
        Names; labels such as ``"101X+"`` (node 101, along x) are read as nodes and directions.
    variance : array-like, shape (outputs, inputs, n), optional
        E|n|^2 of the complex error of ``responses``, the mean of all averages; real and imaginary part have half each.
    coherence : array-like, shape (outputs, inputs, n), optional
        Coherence c of H1 estimates with one input; with ``averages`` m > 1 it gives variance
        |G|^2 (1 - c) / (c (m - 1)), without bias.
    averages : float, optional
        Number of independent averages, one more than the variance has degrees of freedom.
    covariance : array-like, shape (outputs, outputs, n), optional
        E[n_i conj(n_j)] of the errors of the outputs, the same for each input. Its diagonal is the variance.
    quantity : str or sequence of str, optional
        "displacement", "velocity" or "acceleration" of all or of each output; default: by ``output_units``, else that
        of the model's output.
    output_units, input_units : sequence of str, optional
        SI units such as ``"m/s^2"``, ``"N"``, or others, such as ``"V"``; default: unknown.
    output_points, input_points : sequence, optional
        A ``Point``, a pair of position [m] and direction, ``((0.1, 0, 0), "z")``, or None of each channel; default:
        from labels.
    nodes : sequence of Node, or dict of int to position, optional
        Nodes of the geometry [m], world axes.
    modes : sequence of MeasuredMode, optional
        Modes that were found from the data.
    lines : sequence of tuple of int, optional
        Connected nodes, for pictures.
    noise_variance : array-like, shape (outputs, inputs, n), optional
        The part of the variance that changes from period to period; the rest of it is nonlinear distortion.
    line_correlation : array-like, shape (m,), optional
        Correlation of the errors of a line with those of the next one, the one after it, and so on, as windows and
        polynomials over lines make it; default: none.
    left_out, notes : sequence of str, optional
        What a file holds beside these; how the responses were estimated.
    consistency : dict of str to float, optional
        Of channels that ``virtual_point`` used, the share that a rigid motion explains.
    common_errors : CommonErrors, optional
        How errors of several channels belong together, of those that ``virtual_point`` and ``mv.assemble`` make.

    Raises
    ------
    ResponseError
        If shapes do not match, frequencies do not ascend, a variance is negative, a coherence is not within 0 to 1, or
        variance and covariance, or quantities and units, disagree.

    Source
    ------
    Bendat, J. S., Piersol, A. G., Random Data (2010), 9.2.3 (variance of H1).
    """

    _engine = "by_line"

    by_line: ClassVar[tuple[str, ...]] = ("omega", "responses", "variance", "coherence", "covariance", "noise_variance")
    omega: Array
    responses: Complex
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    variance: Array | None = None
    coherence: Array | None = None
    averages: float | None = None
    covariance: Complex | None = None
    quantity: Any = None
    output_units: tuple[str, ...] = ()
    input_units: tuple[str, ...] = ()
    output_points: Any = None
    input_points: Any = None
    nodes: Any = ()
    modes: tuple[MeasuredMode, ...] = ()
    lines: tuple[tuple[int, ...], ...] = ()
    left_out: tuple[str, ...] = ()
    noise_variance: Array | None = None
    notes: tuple[str, ...] = ()
    consistency: Any = field(default_factory=dict)
    common_errors: CommonErrors | None = None
    line_correlation: Any = ()

    def __post_init__(self) -> None:
        set_: Callable[[str, Any], None] = partial(object.__setattr__, self)
        expected = "a vector of ascending angular frequencies [rad/s], from 0 on, each once"
        omega = ascending(self.omega, WHO, "omega", expected, least=0.0, count=0)
        try:
            known = np.shape(self.responses)
        except ValueError as error:
            raise ResponseError(f"{WHO}: responses have rows of different lengths; expected numbers of outputs, inputs "
                                f"and lines, NaN where nothing was measured.") from error  # fmt: skip
        for kind, count in (("outputs", -3), ("inputs", -2)):
            names = getattr(self, kind)
            size = known[count] if len(known) == 3 else len(names)
            set_(kind, signal_names(names, size, kind, WHO))
        shape = (len(self.outputs), len(self.inputs), len(omega))
        responses = _array(self.responses, shape, "responses", complex)
        if np.isinf(responses).any():
            raise ResponseError(f"{WHO}: responses are infinite; expected finite numbers, or NaN where nothing was "
                                f"measured.")  # fmt: skip
        set_("omega", omega)
        set_("responses", responses)
        self._check_noise(shape, set_)
        near = np.array(reals(self.line_correlation, WHO, "line_correlation", "correlations of lines 1, 2, ... apart"))
        if near.ndim != 1 or not (np.abs(near) <= 1.0).all() or not 1.0 + 2.0 * near.sum() > 0.0:
            raise ResponseError(f"{WHO}: line_correlation = {shown(near.tolist())}; expected correlations of errors of "
                                f"lines that are 1, 2, ... apart, from -1 to 1, with a sum above -1/2.")
        set_("line_correlation", near)
        for name, value in channels_of(self, self.outputs, self.inputs, WHO).items():
            set_(name, value)
        for name in ("modes", "lines", "left_out", "notes"):
            given = getattr(self, name)
            set_(name, (given,) if isinstance(given, str) else tuple(given))
        if not all(isinstance(mode, MeasuredMode) for mode in self.modes):
            raise ResponseError(f"{WHO}: modes = {shown(self.modes)}; expected MeasuredMode objects, as from_uff has "
                                f"them. Modes alone are mv.MeasuredModes.")  # fmt: skip
        for name in (*Measurement.by_line, "line_correlation"):
            if getattr(self, name) is not None:
                getattr(self, name).setflags(write=False)

    def _check_noise(self, shape: tuple[int, ...], set_: Any) -> None:
        known = ~np.isnan(self.responses)
        if self.coherence is not None:
            coherence = _array(self.coherence, shape, "coherence", float)
            wrong = known & ~((coherence >= -_ROUNDED) & (coherence <= 1.0 + _ROUNDED))
            self._refuse_at(wrong, coherence, "coherence", "values from 0 to 1")
            set_("coherence", np.clip(coherence, 0.0, 1.0))
        if self.averages is not None and not (np.asarray(self.averages).dtype.kind in "iuf"
                                              and np.ndim(self.averages) == 0 and 1 <= self.averages < np.inf):
            raise ResponseError(f"{WHO}: averages = {shown(self.averages)}; expected their number, 1 or more.")
        if self.covariance is not None:
            full = _array(self.covariance, (shape[0], shape[0], shape[2]), "covariance", complex)
            if not are_covariances(np.moveaxis(full, -1, 0), _ROUNDED):
                raise ResponseError(f"{WHO}: covariance is not Hermitian and positive semidefinite at each line; "
                                    f"expected E[n_i conj(n_j)] of the outputs.")  # fmt: skip
            set_("covariance", full)
        others: dict[str, Array] = {}  # what else states the variance
        if self.covariance is not None:
            diagonal = np.einsum("iin->in", self.covariance).real
            others["the diagonal of the covariance"] = np.repeat(diagonal[:, None], shape[1], axis=1)
        if self.common_errors is not None:
            others["that of common_errors"] = np.where(known, self.common_errors.power(), np.nan)
        if self.variance is None and others:
            set_("variance", next(iter(others.values())))
        elif self.variance is None and self.coherence is not None and self.averages is not None and self.averages > 1:
            with np.errstate(divide="ignore"):
                share = (1.0 - self.coherence) / (self.coherence * (self.averages - 1))
            set_("variance", np.where(known, np.abs(self.responses) ** 2 * share, np.nan))
        for name in ("variance", "noise_variance"):
            if getattr(self, name) is not None:
                variance = _array(getattr(self, name), shape, name, float)
                self._refuse_at(known & ~(variance >= 0.0), variance, name, "values of 0 or more")
                set_(name, variance)
        for name, stated in others.items():
            assert self.variance is not None
            limit = _ROUNDED * stated + _ROUNDED**2 * np.nanmax(stated, axis=(0, 1), initial=0.0)
            self._refuse_at(known & ~(np.abs(self.variance - stated) <= limit), self.variance, "variance",
                            f"{name} or no variance beside it,")  # fmt: skip

    def _refuse_at(self, wrong: Any, values: Array, field: str, expected: str) -> None:
        for i, j, k in np.argwhere(wrong)[:1]:
            raise ResponseError(f"{WHO}: {field} of '{self.outputs[i]}' to '{self.inputs[j]}' is {values[i, j, k]:g} "
                                f"at {self.frequencies[k]:g} Hz; expected {expected} wherever a response is known.")

    @property
    def frequencies(self) -> Array:
        """Frequencies of the lines [Hz], (n,)."""
        return np.asarray(self.omega / (2 * np.pi))

    def columns(self) -> dict[str, Any]:
        """Return the responses as columns (n,) by name: ``frequency_hz``; ``OUTPUT/INPUT_re`` and ``OUTPUT/INPUT_im``
        of each pair, and ``OUTPUT/INPUT_variance`` if it is known.
        """
        noise = {} if self.variance is None else by_pair(self.outputs, self.inputs, self.variance)
        return {"frequency_hz": self.frequencies, **by_pair(self.outputs, self.inputs, self.responses),
                **{f"{pair}_variance": values for pair, values in noise.items()}}  # fmt: skip

    @property
    def driving_points(self) -> tuple[tuple[str, str], ...]:
        """Pairs of output and input at the same node, in the same or in opposite directions."""
        return tuple((output, name) for output, at in zip(self.outputs, self.output_points, strict=True)
                     for name, point in zip(self.inputs, self.input_points, strict=True)
                     if (at.node, abs(at.direction)) == (point.node, abs(point.direction)))  # fmt: skip

    @property
    def is_measured(self) -> Array:
        """Which pairs were measured, (outputs, inputs), true or false."""
        return np.asarray(~np.isnan(self.responses).all(axis=2))

    def __getitem__(self, key: Any) -> Measurement:
        """Return some of the outputs and inputs: ``data[outputs, inputs]``, by names or patterns."""
        rows, columns = needed_ports(*key_ports(key, WHO), (self.outputs, self.inputs), WHO)
        pairs: dict[str, Any] = {
            name: None if (array := getattr(self, name)) is None else array[np.ix_(rows, columns)]
            for name in ("responses", "variance", "coherence", "noise_variance")}  # fmt: skip
        ends: dict[str, Any] = {
            field: tuple(getattr(self, field)[k] for k in chosen)
            for kind, chosen in (("output", rows), ("input", columns))
            for field in (f"{kind}s", f"{kind}_units", f"{kind}_points")}  # fmt: skip
        covariance = None if self.covariance is None else self.covariance[np.ix_(rows, rows)]
        errors = None if self.common_errors is None else self.common_errors.of(rows, columns)
        return replace(self, **pairs, **ends, covariance=covariance, common_errors=errors,
                       quantity=tuple(self.quantity[k] for k in rows))  # fmt: skip

    def within(self, low: float, high: float) -> Measurement:
        """Return the lines from ``low`` to ``high``.

        Parameters
        ----------
        low, high : float
            Limits [Hz], included.

        Returns
        -------
        Measurement
            The same channels with fewer lines.

        Raises
        ------
        ResponseError
            If there is no line between them, or they are not two numbers, the lower one first.
        """
        f, (low, high) = self.frequencies, limits(low, high, "within")
        if not (lines := within(f, low, high)).any():
            known = f"{len(f)} lines from {f[0]:g} to {f[-1]:g} Hz" if len(f) else "no lines"
            raise ResponseError(f"within: no line from {low:g} to {high:g} Hz; the measurement has {known}.")
        arrays: dict[str, Any] = {
            name: None if (array := getattr(self, name)) is None else array[..., lines] for name in self.by_line}
        errors = None if self.common_errors is None else self.common_errors.at(lines)
        return replace(self, **arrays, common_errors=errors)

    def smoothed(self, lines: int = 15) -> Measurement:
        """Return the data with variances that are means over neighbouring lines.

        Variances of few averages are noise themselves: of three, they are ten times too small at one line of fifty by
        chance. Where the noise is likelier to depend on the response, the means are of variance / (c + |H|^2). ``fit``
        needs no smoothing.

        Parameters
        ----------
        lines : int
            How many, around each line.

        Returns
        -------
        Measurement
            The same responses; a covariance is smoothed likewise.

        Raises
        ------
        ResponseError
            If there is no variance, or ``lines`` is not a positive whole number.
        """
        from mbsvib.measurement.noise_levels import local_mean, smoothed

        if self.variance is None or isinstance(lines, bool) or not isinstance(lines, (int, np.integer)) or lines < 1:
            what = "no variances" if self.variance is None else "variances"
            raise ResponseError(f"smoothed: lines = {shown(lines)} of {what}; expected a positive whole number, and a "
                                f"measurement with variance.")  # fmt: skip

        covariance, errors, noise, variance = self.covariance, self.common_errors, self.noise_variance, None
        if covariance is not None:  # it states all of them
            errors = None
            covariance = local_mean(covariance, lines)
        elif errors is not None:
            errors = replace(errors, variance=local_mean(errors.variance, lines))
        else:
            variance = smoothed(self.variance, self.responses, lines)
        if noise is not None:
            noise = smoothed(noise, self.responses, lines)
        return replace(self, variance=variance, noise_variance=noise, covariance=covariance, common_errors=errors)

    def plot(
        self, linear: Any = None, names: Mapping[str, str] | None = None, *, ax: Given | None = None
    ) -> Figure | Given:
        """Draw magnitude and phase of the responses with their standard deviation, and a model's over them.

        Parameters
        ----------
        linear : Model, System, ClosedLoop or StateSpace, optional
            The model, whose channels are found by ``matched``.
        names : dict of str to str, optional
            As of ``matched``.
        ax : Axes or sequence of Axes, optional
            Where to draw, a panel each, row by row; default: a new figure.

        Returns
        -------
        matplotlib.figure.Figure, or ``ax``
            One panel for each pair of input and output.
        """
        from mbsvib.plots.measured import measured

        if linear is None:
            return measured(self, None, ax=ax)
        matching = self.matched(linear, names)
        system = linear.linearize() if hasattr(linear, "linearize") else linear
        rows, columns = ([list(getattr(system, kind)).index(name) for name in listed] for kind, listed in (
            ("outputs", matching.output_names), ("inputs", matching.input_names)))  # fmt: skip
        responses = system.frequency_response(self.omega)[np.ix_(rows, columns)]
        return measured(self, responses * matching.factor(self.omega), system.name, ax=ax)

    def __repr__(self) -> str:
        groups = ((self.inputs, "input"), (self.outputs, "output"), (self.omega, "frequency"), (self.nodes, "node"),
                  (self.modes, "mode"))  # fmt: skip
        return f"Measurement({', '.join(counted(len(items), kind) for items, kind in groups)})"


def _array(value: Any, shape: tuple[int, ...], field: str, kind: type) -> Any:
    try:
        result: Any = np.array(reals(value, WHO, field, "real numbers") if kind is float else value, dtype=kind)
    except (TypeError, ValueError) as error:
        raise ResponseError(f"{WHO}: {field} = {shown(value)}; expected numbers of shape {shape}.") from error
    if result.shape != shape:
        ends = "outputs, outputs and lines" if field == "covariance" else "outputs, inputs and lines"
        raise ResponseError(f"{WHO}: {field} has shape {result.shape}; expected {shape}, {ends}.")
    return result
