"""Measured objects as data of a fit, with the values of their channels.

Measured modes in a fit: frequencies, damping ratios and shapes, paired with those of the model by their shapes.

With Q(s) = s^2 M + s C + K a mode, Q(lambda) x = 0, moves by [Q, Q' x; x^H, 0] [dx; d lambda] = [-dQ x; 0]. Measured
shapes psi are known up to a complex factor, the best one: r = (a phi - psi) / sigma with a = phi^H psi / phi^H phi.

Source: Friswell & Mottershead, Finite Element Model Updating in Structural Dynamics (1995), sections 2 and 5; Golub &
Pereyra, SIAM J. Numer. Anal. 10 (1973) 413, for the factor.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arguments import shown
from mbsvib.errors import ResponseError
from mbsvib.fitting.channels import HELD, Channels
from mbsvib.fitting.record_data import RecordData
from mbsvib.fitting.response_data import Block, ResponseData, weights
from mbsvib.fitting.variables import FARTHEST
from mbsvib.linalg.matching import mac
from mbsvib.linalg.rank import EPS
from mbsvib.measurement.data import Measurement
from mbsvib.measurement.estimation import local_polynomials
from mbsvib.measurement.modes import MeasuredModes
from mbsvib.measurement.records import Records
from mbsvib.modes import modes as modes_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from mbsvib.common.arrays import Array, Complex, Index
    from mbsvib.measurement.matching import Matching

    Channel = tuple[str, str, float, float, float, float, bool]


# A mode as far off as this factor in frequency loses as much as a correlation of shapes of 1 is worth.
FAR_APART = 4.0
# A mode without a shape that is farther from that of the model than by this factor may be another one.
GUESSED = 1.3
SENSING = ("Cq", "Cv", "Ca")


@dataclass(frozen=True, eq=False)
class ModeData:
    """Natural ``frequencies`` (n,) [Hz], ``damping_ratios`` (n,) and ``shapes`` (outputs, n), NaN where not measured,
    with standard deviations: relative ones of the first two, and of the shapes in their own unit (outputs, n). They are
    displacements: ``sign`` lambda^``powers`` (outputs,) times what the ``rows`` of the model have.
    """

    name: str
    scene: int
    frequencies: Array
    damping_ratios: Array
    shapes: Complex
    frequency_deviation: Array
    damping_deviation: Array
    shape_deviation: Array
    rows: Index
    sign: Index
    powers: Index
    known: bool = True

    @property
    def numbers(self) -> int:
        """How many real numbers were measured; the factor of each shape is none."""
        shown = np.isfinite(self.shapes)
        return int(np.isfinite(self.frequencies).sum() + np.isfinite(self.damping_ratios).sum() + 2 * shown.sum()
                   - 2 * shown.any(axis=0).sum())  # fmt: skip

    def blocks(self, equations: Any, slopes: Mapping[str, Array] | None, values: Array, far: bool) -> Iterator[Block]:
        """Yield the residuals of all modes with their derivatives."""
        eigenvalues, vectors, shapes, pairs = self._modes(equations)
        residuals, changes = [], []
        for k, at in enumerate(pairs):
            change = None if slopes is None else _changes(
                equations, slopes, eigenvalues[at], vectors[at], (self.rows, self.powers))  # fmt: skip
            for r, dr in self._residuals(k, eigenvalues[at], shapes[at], change):
                residuals.append(r)
                changes.append(dr)
        count = None if slopes is None else len(slopes["K"])
        every = None
        if count is not None:
            every = np.zeros((len(values), sum(map(len, residuals))), dtype=complex)
            every[:count] = np.concatenate(changes, axis=1)
        yield Block(np.concatenate(residuals), every)

    def guesses(self, equations: Any) -> Iterator[str]:
        """Yield in words which modes have no shape and are far from those of the model that are taken for them."""
        eigenvalues, _, _, pairs = self._modes(equations)
        for k, model in enumerate((np.abs(eigenvalues[pairs]) / (2.0 * np.pi)).tolist()):
            measured = self.frequencies[k]
            if np.isfinite(self.shapes[:, k]).sum() < 2 and abs(np.log(measured / model)) > np.log(GUESSED):
                yield (f"{self.name}: the mode at {measured:.4g} Hz has no shape, and the nearest one of the model, "
                       f"which is taken for it, is at {model:.4g} Hz")  # fmt: skip

    def _modes(self, equations: Any) -> tuple[Complex, list[Complex], Complex, Index]:
        """Eigenvalues, vectors and shapes of the model's modes, and which of them each measured mode is."""
        eigenvalues = self._oscillating(equations)
        vectors = [_null_vector(equations, value) for value in eigenvalues]
        sensing = [getattr(equations, key)[self.rows] for key in SENSING]
        shapes = np.array([self.sign * (_sensed(sensing, value, self.powers) @ x)
                           for value, x in zip(eigenvalues, vectors, strict=True)])  # fmt: skip
        return eigenvalues, vectors, shapes, self.paired(np.abs(eigenvalues) / (2.0 * np.pi), shapes)

    def _oscillating(self, equations: Any) -> Complex:
        eigenvalues: Complex = modes_of(equations).pairs[:, 0]
        result = np.where(eigenvalues.imag < 0.0, eigenvalues.conj(), eigenvalues)[eigenvalues.imag != 0.0]
        if len(result) < len(self.frequencies):
            raise ResponseError(f"fit: {self.name} has {len(self.frequencies)} modes, and the model {len(result)} that "
                                f"oscillate; leave modes out or give the model more freedom.")  # fmt: skip
        return np.asarray(result)

    def paired(self, frequencies: Array, shapes: Complex) -> Index:
        """Return the number of the model's mode of each measured one.

        ``frequencies`` (k,) [Hz], ``shapes`` (k, outputs): those of the model.
        """
        from scipy.optimize import linear_sum_assignment

        distance = np.abs(np.log(self.frequencies[:, None] / frequencies)) / np.log(FAR_APART)
        for k, shape in enumerate(self.shapes.T):
            known = np.isfinite(shape)
            if known.sum() > 1:
                distance[k] += 1.0 - mac(shape[known, None], shapes.T[known])[0]
        return np.asarray(linear_sum_assignment(distance)[1])

    def _residuals(self, k: int, value: complex, shape: Complex, change: tuple[Complex, Complex] | None) -> Any:
        """Residuals (n,) of measured mode k, with derivatives (v, n)."""
        size, none = abs(value), np.zeros((0, 0))
        d_value = None if change is None else change[0]
        slope = none if d_value is None else (np.conj(value) * d_value).real / size**2
        if np.isfinite(self.frequencies[k]):
            deviation = self.frequency_deviation[k]
            residual = np.log(size / (2.0 * np.pi * self.frequencies[k])) / deviation
            yield np.array([residual + 0j]), slope[:, None] / deviation if d_value is not None else none
        if np.isfinite(self.damping_ratios[k]):
            deviation = self.damping_deviation[k] * max(self.damping_ratios[k], np.finfo(float).tiny)
            ratio = -value.real / size
            d_ratio = none if d_value is None else (-d_value.real / size - ratio * slope)[:, None] / deviation
            yield np.array([(ratio - self.damping_ratios[k]) / deviation + 0j]), d_ratio
        known = np.isfinite(self.shapes[:, k])
        if known.any():
            measured, phi = self.shapes[known, k], shape[known]
            norm = float((np.abs(phi) ** 2).sum())
            factor = (phi.conj() @ measured) / norm if norm else 0.0
            deviation = self.shape_deviation[known, k]
            d_shape = none
            if change is not None:
                d_phi = change[1][:, known] * self.sign[known]
                d_factor = ((d_phi.conj() @ (measured - factor * phi)) - factor * (d_phi @ phi.conj())) / (norm or 1.0)
                d_shape = (factor * d_phi + d_factor[:, None] * phi) / deviation
            yield (factor * phi - measured) / deviation, d_shape


def _null_vector(equations: Any, value: complex) -> Complex:
    """The vector x with Q(lambda) x = 0."""
    q = equations.K + value * equations.C + value**2 * equations.M
    return np.asarray(np.linalg.svd(q)[2][-1].conj())


def _changes(
    equations: Any, slopes: Mapping[str, Array], value: complex, x: Complex, ends: tuple[Index, Index]
) -> tuple[Complex, Complex]:
    """Derivatives of the eigenvalue (v,) and of the shape at the outputs (v, outputs)."""
    m = len(x)
    q = equations.K + value * equations.C + value**2 * equations.M
    rate = (equations.C + 2.0 * value * equations.M) @ x
    scale = float(np.abs(q).max()) or 1.0  # borders as large as Q
    bordered = np.zeros((m + 1, m + 1), dtype=complex)
    bordered[:m, :m], bordered[:m, m], bordered[m, :m] = q, rate * (scale / np.linalg.norm(rate)), scale * x.conj()
    force = np.array([-(k + value * c + value**2 * mass) @ x for k, c, mass in zip(
        slopes["K"], slopes["C"], slopes["M"], strict=True)])  # fmt: skip
    solution = np.linalg.solve(bordered, np.pad(force, ((0, 0), (0, 1))).T).T
    d_value = solution[:, m] * (scale / np.linalg.norm(rate))
    rows, powers = ends
    sensing = [getattr(equations, key)[rows] for key in SENSING]
    moved = _sensed([(k + powers)[:, None] * matrix for k, matrix in enumerate(sensing)], value, powers - 1) @ x
    turned = _sensed([slopes[key][:, rows] for key in SENSING], value, powers) @ x
    return d_value, solution[:, :m] @ _sensed(sensing, value, powers).T + d_value[:, None] * moved + turned


def _sensed(matrices: Sequence[Any], value: complex, powers: Index) -> Any:
    """sum_k lambda^(k + powers) C_k of Cq, Cv, Ca (..., outputs, m)."""
    return sum(value ** (k + powers)[:, None] * matrix for k, matrix in enumerate(matrices))


# What a channel may have, each with its unit, its value if it is held, and its natural size.
KINDS = ("gain", "delay", "lag", "lowpass", "highpass")
# A filter of second order starts with this damping ratio, and so many times beyond the lines.
BUTTERWORTH, BEYOND = 0.5**0.5, 2.0
# Estimated responses count from afar where they are so many times their noise.
CLEAR = 3.0
# and where the power of inputs around is at least this share of its median over all lines.
QUIET, SMOOTHED = 1e-3, 15
# Relative standard deviations of frequencies and damping ratios, and that of shapes in parts of their largest entry.
FREQUENCY, DAMPING, SHAPE = 1e-3, 0.1, 0.05


def response_data(
    measurement: Measurement, name: str, number: int, scene: Any, kinds: Sequence[str], first: int, known: Sequence[str]
) -> tuple[ResponseData, list[Channel]]:
    """Return measured responses as data, and the values of their channels: name, unit, start, size and limits of each.

    ``number``: that of the ``scene`` in which they were measured; ``kinds``: what the channels have; ``first``: the
    number of the first of these values; ``known``: names of values
    that there are.
    """
    match = _scaled(measurement.matched(scene.model), kinds, name)
    outputs, inputs = scene.plant.outputs, scene.plant.inputs
    rows = np.array([outputs.index(one) for one in match.output_names], dtype=np.intp)
    columns = np.array([inputs.index(one) for one in match.input_names], dtype=np.intp)
    responses = np.moveaxis(measurement.responses, 2, 0)
    variance = None if measurement.variance is None else np.moveaxis(measurement.variance, 2, 0)
    sign = np.moveaxis(match.factor(measurement.omega), 2, 0)
    whitening = None
    if measurement.covariance is not None:
        whitening, size = _whitening(measurement, np.isfinite(responses), name)
        weight, is_known = np.where(np.isfinite(responses), np.sqrt(2.0) / size[:, :, None], 0.0), True
    else:
        weight, is_known = weights(responses, variance, measurement.averages)
    weight = np.where(np.isfinite(sign), weight, 0.0)
    if not (weight > 0.0).any():
        raise ResponseError(f"fit: {name} has no line that was measured with a known noise; expected finite responses "
                            f"and variances.")  # fmt: skip
    channels, added = _channels(measurement, measurement.omega, kinds, first, known, name)
    return ResponseData(
        name, number, measurement.omega, np.where(weight > 0.0, responses, 0.0), weight,
        whitening, rows, columns, np.where(np.isfinite(sign), sign, 0.0), channels, is_known,
    ), added  # fmt: skip


def _scaled(match: Matching, kinds: Sequence[str], name: str) -> Matching:
    """The same; channels in volts or unknown units are refused unless their gains are fitted."""
    for partner in () if "gain" in kinds else (*match.outputs, *match.inputs):
        if not partner.scale_known:
            raise ResponseError(f"fit: the channel '{partner.measured}' of {name} is in {partner.measured_unit}, that "
                                f"of the model in {partner.unit}, and the factor between them is not known; fit it, "
                                f"channels=['gain'], or convert the data to SI units: m, rad, N, N m, m/s, m/s^2.")
    return match


def _whitening(measurement: Measurement, counts: Any, name: str) -> tuple[Complex, Array]:
    """Inverse Cholesky factors (n, outputs, outputs) of the correlation of outputs, and their deviations (n, outputs).
    """
    if not (counts.all(axis=(1, 2)) | ~counts.any(axis=(1, 2))).all():
        raise ResponseError(f"fit: {name} has a covariance of its outputs, and pairs that were not measured at some "
                            f"lines; leave these outputs or lines out.")  # fmt: skip
    power: Any = np.moveaxis(np.asarray(measurement.covariance), 2, 0)
    size: Any = np.sqrt(np.einsum("nii->ni", power).real)
    size = np.where(size > 0.0, size, size.max(axis=1, initial=0.0, keepdims=True))
    least = len(measurement.outputs) * EPS * (size > 0.0)[:, :, None] * np.eye(power.shape[1])
    size = np.where(size > 0.0, size, 1.0)
    try:
        factor: Any = np.linalg.cholesky(power / size[:, :, None] / size[:, None] + least)
        return np.linalg.inv(factor), size
    except np.linalg.LinAlgError:
        raise ResponseError(f"fit: the covariance of the outputs of {name} is singular at some lines; expected a "
                            f"positive definite one, or a variance.") from None  # fmt: skip


def _channels(
    measured: Measurement | Records, omega: Array, kinds: Sequence[str], first: int, known: Sequence[str], name: str
) -> tuple[Channels, list[Channel]]:
    """Gains of the first input, and delays and filters of all inputs, are held: only products and sums are measured."""
    added: list[Channel] = []
    taken, lowest, highest = set(known), float(omega[omega > 0.0].min(initial=np.inf)), float(omega[-1])
    corner = {"lowpass": BEYOND * highest / (2.0 * np.pi), "highpass": min(lowest, highest) / BEYOND / (2.0 * np.pi)}

    def number(signal: str, kind: str) -> int:
        if kind not in kinds:
            return HELD
        label = f"{signal}.{kind}"
        if label in taken:
            label = f"{name}.{label}"
        taken.add(label)
        if kind in corner:
            entries: list[Channel] = [
                (f"{label}.{field}", unit, start, start, start / FARTHEST, start * FARTHEST, True)
                for field, unit, start in (("frequency", "Hz", corner[kind]), ("damping_ratio", "", BUTTERWORTH))]
        elif kind == "gain":
            entries = [(label, "", 1.0, 1.0, -np.inf, np.inf, False)]
        else:
            least = 0.0 if kind == "lag" else -np.inf
            entries = [(label, "s", 0.0, 2.0 * np.pi / highest, least, np.inf, False)]
        added.extend(entries)
        return first + len(added) - len(entries)

    outer = {kind: np.array([number(signal, kind) for signal in measured.outputs], dtype=np.intp) for kind in KINDS}
    inner = np.array([number(signal, "gain") if i else HELD for i, signal in enumerate(measured.inputs)], dtype=np.intp)
    lowpass, highpass = (np.where(outer[kind][:, None] >= 0, outer[kind][:, None] + np.arange(2), HELD)
                         for kind in ("lowpass", "highpass"))  # fmt: skip
    return Channels(outer["gain"], outer["delay"], outer["lag"], lowpass, highpass, inner), added


def record_data(
    records: Records, name: str, number: int, scene: Any, kinds: Sequence[str], first: int, known: Sequence[str]
) -> tuple[RecordData, list[Channel]]:
    """Return time records as data, and the values of their channels, as ``response_data`` does."""
    match = _scaled(records.matched(scene.model), kinds, name)
    outputs, inputs = scene.plant.outputs, scene.plant.inputs
    for partner in match.inputs:
        if partner.derivatives:
            raise ResponseError(f"fit: the input '{partner.measured}' of {name} is in {partner.measured_unit}, that of "
                                f"the model in {partner.unit}; give records of what the model has as its input.")
    rows, columns = (np.array([listed.index(one) for one in names], dtype=np.intp)
                     for listed, names in ((outputs, match.output_names), (inputs, match.input_names)))  # fmt: skip
    numbers = records.lines()
    omega = 2.0 * np.pi * numbers / (records.samples * records.t)
    channels, added = _channels(records, omega, kinds, first, known, name)
    measured, driven = records.spectra("output"), records.spectra("input")
    driven = driven * np.array([partner.sign for partner in match.inputs]).reshape(-1, 1)
    power, whitening = records.power(), None
    if power is None:
        size = np.median(np.abs(measured), axis=(0, 2))[None]
    else:
        size = np.sqrt(np.einsum("nii->ni", power))
        if records.covariance is not None:
            whitening = np.linalg.inv(np.linalg.cholesky(power[0] / size[0][:, None] / size[0]))
    weight = np.broadcast_to(np.sqrt(2.0) / size[:, :, None], measured.shape)
    result = RecordData(
        name, number, omega, records.t, records.hold, driven, measured, weight, whitening, rows, columns,
        np.array([partner.sign for partner in match.outputs]),
        np.array([partner.derivatives for partner in match.outputs], dtype=np.intp),
        channels, power is not None, None)
    return replace(result, estimate=_estimated(records, numbers, result, match)), added


def _estimated(records: Records, numbers: Index, data: RecordData, match: Matching) -> ResponseData | None:
    """Responses of the records by local polynomials, None where these do not tell them."""
    if not len(records.inputs):
        return None
    from scipy.ndimage import uniform_filter1d

    every = np.array([*records.outputs.values(), *records.inputs.values()]).swapaxes(0, 1)
    try:
        found = local_polynomials(every, (len(records.outputs), len(records.inputs), 0), numbers - 1)
    except ResponseError:
        return None
    ports = tuple(records.outputs), tuple(records.inputs)
    smooth = Measurement(data.omega, found.responses, *ports, found.variance).smoothed()
    responses, variance = np.moveaxis(found.responses, 2, 0), np.moveaxis(np.asarray(smooth.variance), 2, 0)
    weight, known = weights(responses, variance, None)
    drive = uniform_filter1d((np.abs(data.driven) ** 2).mean(axis=2), SMOOTHED, axis=0)
    driven = (drive > QUIET * np.median(drive, axis=0)).all(axis=1)
    clear = np.abs(responses) > CLEAR * np.sqrt(variance)  # logarithms of noise tell nothing
    weight = np.where(clear & driven[:, None, None], weight, 0.0)
    if not (weight > 0.0).any():
        return None
    sign = np.moveaxis(match.factor(data.omega), 2, 0)
    return ResponseData(data.name, data.scene, data.omega, responses, weight, None, data.rows, data.columns, sign,
                        data.channels, known)


def mode_data(measured: MeasuredModes, name: str, number: int, scene: Any) -> ModeData:
    """Return measured modes as data."""
    n = len(measured.frequencies)
    ratios = np.full(n, np.nan) if measured.damping_ratios is None else np.where(
        measured.damping_ratios > 0.0, measured.damping_ratios, np.nan)  # fmt: skip
    shapes: Any = np.full((0, n), np.nan + 0j)
    rows = sign = powers = np.zeros(0, dtype=np.intp)
    if measured.shapes is not None:
        match, shapes = measured.matched(scene.model), np.asarray(measured.shapes, dtype=complex)
        rows = np.array([scene.plant.outputs.index(one) for one in match.output_names], dtype=np.intp)
        sign, powers = np.array([(partner.sign, partner.derivatives) for partner in match.outputs], dtype=np.intp).T
    return ModeData(name, number, measured.frequencies, ratios, shapes, *_deviations(measured, shapes), rows, sign,
                    powers)  # fmt: skip


def _deviations(measured: MeasuredModes, shapes: Complex) -> tuple[Array, Array, Array]:
    """Standard deviations of frequencies and damping ratios, relative, and of shapes."""
    n = len(measured.frequencies)
    frequency = np.full(n, FREQUENCY) if measured.sd is None else measured.sd / measured.frequencies
    with np.errstate(all="ignore"):
        largest = np.nanmax(np.abs(shapes), axis=0, initial=0.0) if len(shapes) else np.zeros(n)
    shape = np.broadcast_to(SHAPE * largest, shapes.shape)
    return frequency, np.full(n, DAMPING), np.where(shape > 0.0, shape, 1.0)


def conditioned(data: Any) -> list[tuple[dict[str, float], Any]]:
    """Return each of the data with the values of parameters and joint coordinates that it was measured with.

    ``data``: one measured object or several, each alone or as (values, measured object).
    """
    several = list(data) if isinstance(data, list) else [data]
    if not several:
        raise ResponseError("fit: data is empty; expected a Measurement, Records, MeasuredModes or a list "
                            "of these.")  # fmt: skip
    result = []
    for item in several:
        values, measured = item if isinstance(item, tuple) and len(item) == 2 else ({}, item)
        if not isinstance(measured, (Measurement, Records, MeasuredModes)) or not hasattr(values, "items"):
            raise ResponseError(f"fit: data = {shown(item)}; expected a Measurement, Records, MeasuredModes, or a "
                                f"pair of values and one of these, ({{'payload.mass': 12.0}}, measurement).")
        result.append(({str(key): check.number(value, "fit", str(key)) for key, value in values.items()}, measured))
    return result
