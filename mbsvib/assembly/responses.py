"""Frequency responses of parts that are joined at ports, some of which are measured.

G = G0 - G0 L^T (L G0 L^T + Z^-1)^+ L G0

with the responses G0 of all parts side by side, L the relative displacements of joined ports and Z = k + i w c of the
connections, Z^-1 = 0 of rigid ones. Parts that are taken away have -G0. To first order the error of G is A n B with
A = 1 - G0 L^T X L and B = 1 - L^T X L G0; errors with common causes go on as such. Directions of the interface whose
compliance is below its noise are not joined; what they would have done counts as variance.

Source: de Klerk, Rixen & Voormeeren, AIAA J. 46 (2008) 1169, equation 31; D'Ambrogio & Fregolent, MSSP 45 (2014) 360,
for parts that are taken away.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar
from warnings import warn

import numpy as np

from mbsvib.assembly.connections import WHO, Part
from mbsvib.assembly.systems import Ends, ends_of
from mbsvib.common.arrays import Array, Bools, Complex, Index
from mbsvib.elements.ports import QUANTITIES
from mbsvib.equations.equations import Connection
from mbsvib.errors import AccuracyWarning, ModelError, ResponseError, counted
from mbsvib.linalg.rank import EPS
from mbsvib.measurement.common_errors import (
    CommonErrors,
    errors_of,
    independent_errors,
    joined,
    no_errors,
    side_by_side,
)
from mbsvib.measurement.data import Measurement
from mbsvib.measurement.matching import ORDERS, is_si

# Lines of two measurements are the same up to this share.
SAME_LINE = 1e-6
# Combinations of directions are joined if their compliance is so many deviations of its noise.
STANDS_OUT = 2.0
# Imaginary parts count above this share of the responses; ports give energy if this share of them is positive.
LOSSY, GIVES = 1e-3, 0.5
# Numbers that arrays of some lines may hold.
BLOCK = 4_000_000


@dataclass(frozen=True, repr=False, eq=False)
class AssembledMeasurement(Measurement):
    """Frequency responses of assembled parts, with all that a ``Measurement`` has.

    ``directions`` are those that connections join. ``condition`` (n,) is the condition of the interface compliance,
    scaled to a unit diagonal; ``kept`` (n,) how many combinations of directions stand above its noise and are joined.
    ``connections`` are the ports that were joined, with their distances.
    """

    by_line: ClassVar[tuple[str, ...]] = (*Measurement.by_line, "condition", "kept")

    directions: tuple[str, ...] = ()
    condition: Array = field(default_factory=lambda: np.zeros(0))
    kept: Index = field(default_factory=lambda: np.zeros(0, dtype=np.intp))
    connections: tuple[Connection, ...] = ()

    def table(self) -> dict[str, Any]:
        """Return what was joined and how well, as arguments of ``mbsvib.common.tables.text``."""
        rows = [(one.first, one.second, " ".join(one.directions), "rigid" if one.stiffness is None else "spring-damper",
                 "" if one.distance is None else f"{1e3 * one.distance:.3g}") for one in self.connections]  # fmt: skip
        notes = []
        if len(self.omega):
            notes.append(f"Condition of the interface: {np.nanmedian(self.condition):.3g} in the median, "
                         f"{np.nanmax(self.condition):.3g} at most.")  # fmt: skip
            less = np.flatnonzero(self.kept < len(self.directions))
            if len(less):
                low, high = self.frequencies[less[[0, -1]]]
                notes.append(f"{counted(len(less), 'line')} of {len(self.omega)}, from {low:.4g} to {high:.4g} Hz: "
                             f"fewer than the {len(self.directions)} directions are joined, {self.kept.min()} at "
                             f"least; others are below the noise.")  # fmt: skip
        return {"title": "Assembled responses", "rows": rows, "notes": notes, "columns": [
            ("port", "left"), ("port", "left"), ("directions", "left"), ("joined", "left"),
            ("distance [mm]", "right")]}  # fmt: skip


@dataclass(frozen=True)
class _Sides:
    """Responses G0 (n, outputs, inputs) of all parts side by side with the errors of those that have some, signs of
    parts that are taken away in it; ``orders`` (outputs,) of the time derivatives that outputs are.
    """

    omega: Array
    responses: Complex
    errors: CommonErrors
    orders: Index


def assembled_responses(
    parts: Sequence[Part], connections: Sequence[Connection], removed: Sequence[str]
) -> AssembledMeasurement:  # fmt: skip
    """Return the responses of parts that are joined, without the channels of those that are taken away."""
    ends = ends_of(parts, connections)
    sides = _side_by_side(parts, removed)
    _check_orders(parts, ends, sides)
    _check_measured(parts, ends, sides)
    _check_energy(parts, ends, sides, removed)
    compliance = _compliance(ends, sides.omega)
    blocks = [_joined(sides, ends, compliance, slice(at, at + _chunk(sides)))
              for at in range(0, len(sides.omega), _chunk(sides))]  # fmt: skip
    responses, ways_out, ways_in, left_out, condition, kept = map(np.concatenate, zip(*blocks, strict=True))
    directions = tuple([f"{one.connection.first}.{direction}" for one in ends
                        for direction in one.connection.directions])  # fmt: skip
    remaining = np.array([part.name not in removed for part in parts])
    rows, columns = (np.repeat(remaining, [len(getattr(part.linear, kind)) for part in parts])
                     for kind in ("outputs", "inputs"))  # fmt: skip

    def shown(array: Any) -> Any:
        return array[:, rows][:, :, columns].transpose(1, 2, 0)

    values, errors = shown(responses), None
    if sides.errors.variance.size:
        errors = CommonErrors(np.moveaxis(ways_out, 0, -1)[rows], sides.errors.variance,
                              np.moveaxis(ways_in, 0, -1)[columns])  # fmt: skip
        if left_out.any():
            errors = joined(errors, independent_errors(shown(left_out)))
    whole: dict[str, Any] = {}
    for kind in ("output", "input"):
        here = [(part, name) for part, stays in zip(parts, remaining, strict=True) if stays
                for name in getattr(part.linear, f"{kind}s")]  # fmt: skip
        whole[f"{kind}s"] = tuple([f"{part.name}.{name}" for part, name in here])
        whole[f"{kind}_units"] = sum((getattr(part.linear, f"{kind}_units") for part, stays in
                                      zip(parts, remaining, strict=True) if stays), ())  # fmt: skip
        whole[f"{kind}_points"] = [None if (place := part.places.get((kind, name))) is None
                                   else (place.position, place.direction) for part, name in here]  # fmt: skip
    measured = [part.linear for part in parts if part.is_measured]
    averages = [data.averages for data in measured if data.averages is not None]
    return AssembledMeasurement(
        sides.omega, values, common_errors=errors, averages=min(averages, default=None),
        line_correlation=max((data.line_correlation for data in measured), key=np.sum),
        quantity=tuple([QUANTITIES[k] if k >= 0 else "" for k in sides.orders[rows].tolist()]), **whole,
        directions=directions, condition=condition, kept=kept, connections=tuple(connections),
    )  # fmt: skip


def _chunk(sides: _Sides) -> int:
    """How many lines to compute at once."""
    return int(max(1, BLOCK // max(1, max(sides.responses.shape[1:]) ** 2)))


def _side_by_side(parts: Sequence[Part], removed: Sequence[str]) -> _Sides:
    measured = [part for part in parts if part.is_measured]
    omega = measured[0].linear.omega
    for part in measured[1:]:
        other = part.linear.omega
        if other.shape != omega.shape or (np.abs(other - omega) > SAME_LINE * np.maximum(omega, other)).any():
            raise ResponseError(f"{WHO}: '{measured[0].name}' has {len(omega)} lines and '{part.name}' {len(other)} "
                                f"others; expected the same frequencies. Measurements are cut by .within(low, high).")
    shape = [sum(len(getattr(part.linear, kind)) for part in parts) for kind in ("outputs", "inputs")]
    responses = np.zeros((len(omega), *shape), dtype=complex)
    row, column, orders, errors = 0, 0, [], []
    for part in parts:
        linear = part.linear
        values = linear.responses if part.is_measured else linear.frequency_response(omega)
        at = np.s_[:, row : row + len(linear.outputs), column : column + len(linear.inputs)]
        responses[at] = (-1.0 if part.name in removed else 1.0) * values.transpose(2, 0, 1)
        own = errors_of(linear) if part.is_measured else None
        errors.append(own or no_errors(len(linear.outputs), len(linear.inputs), len(omega)))
        orders += [QUANTITIES.index(one) if one else -1 for one in _quantities(part)]
        row, column = row + len(linear.outputs), column + len(linear.inputs)
    return _Sides(omega, responses, side_by_side(errors), np.array(orders, dtype=np.intp))


def _quantities(part: Part) -> tuple[str, ...]:
    """The quantity of each output, "" where it is not known or none of these."""
    if part.is_measured:
        return tuple(part.linear.quantity)
    # systems of matrices have no units: the check of ports tells whether outputs are displacements
    return tuple([QUANTITIES[ORDERS[unit][1]] if unit in ORDERS else "" if unit else QUANTITIES[0]
                  for unit in part.linear.output_units])  # fmt: skip


def _names(parts: Sequence[Part], kind: str) -> list[tuple[Part, str]]:
    return [(part, f"{part.name}.{name}") for part in parts for name in getattr(part.linear, kind)]


def _check_orders(parts: Sequence[Part], ends: Sequence[Ends], sides: _Sides) -> None:
    """Refuse channels of ports in other units, and outputs of which it is not known what they measure."""
    for kind in ("output", "input"):
        channels = [(part, f"{part.name}.{name}", unit) for part in parts for name, unit in zip(
            getattr(part.linear, f"{kind}s"), getattr(part.linear, f"{kind}_units"), strict=True)]  # fmt: skip
        for part, name, unit in [channels[k] for one in ends for side in getattr(one, f"{kind}s") for k in side]:
            if part.is_measured and unit and not is_si(unit):
                raise ModelError(f"{WHO}: {kind} '{name}' of a port is in {unit}; expected data in SI units.",
                                 element=name)  # fmt: skip
    names = _names(parts, "outputs")
    for row in [row for one in ends for side in one.outputs for row in side]:
        if sides.orders[row] < 0:
            name = names[row][1]
            raise ModelError(f"{WHO}: output '{name}' has neither quantity nor unit; expected a displacement, velocity "
                             f"or acceleration: give the measurement its quantity.", element=name)  # fmt: skip


def _check_measured(parts: Sequence[Part], ends: Sequence[Ends], sides: _Sides) -> None:
    """Refuse ports between whose directions responses are missing."""
    outputs, inputs = _names(parts, "outputs"), _names(parts, "inputs")
    rows, columns = ([k for one in ends for side in getattr(one, kind) for k in side] for kind in ("outputs", "inputs"))
    missing = np.asarray(np.isnan(sides.responses).all(axis=0))
    for row in rows:
        for column in columns:
            if outputs[row][0] is inputs[column][0] and missing[row, column]:
                raise ModelError(f"{WHO}: the response of '{outputs[row][1]}' to '{inputs[column][1]}' was not "
                                 f"measured; expected those between all directions that are joined.",
                                 element=outputs[row][1])  # fmt: skip


def _check_energy(parts: Sequence[Part], ends: Sequence[Ends], sides: _Sides, removed: Sequence[str]) -> None:
    """Warn of measured ports whose driving-point responses x/F have positive imaginary parts, that give energy."""
    names, w = _names(parts, "outputs"), np.where(sides.omega > 0.0, sides.omega, np.nan)[:, None]
    for one in ends:
        for rows, columns in zip(one.outputs, one.inputs, strict=True):
            part = names[rows[0]][0]
            motion = sides.responses[:, rows, columns] / (1j * w) ** sides.orders[rows]
            gain = np.nansum(-motion.imag if part.name in removed else motion.imag, axis=0)
            size = np.nansum(np.abs(motion.imag), axis=0)
            lossy = size > LOSSY * np.nansum(np.abs(motion), axis=0)
            if part.is_measured and lossy.any() and (gain[lossy] / size[lossy]).mean() > GIVES:
                warn(f"{WHO}: the measured part '{part.name}' gives energy at '{names[rows[0]][1]}' and the like. "
                     f"If its responses are those of exp(-i w t), give their complex conjugates, np.conj(responses).",
                     AccuracyWarning, stacklevel=4)  # fmt: skip


def _compliance(ends: Sequence[Ends], omega: Array) -> tuple[Complex, Bools]:
    """Z^-1 (n, d, d) of the connections, and which of the d directions act: those with stiffness or damping."""
    count = sum(len(one.connection.directions) for one in ends)
    total, acts, at = np.zeros((len(omega), count, count), dtype=complex), np.ones(count, dtype=bool), 0
    for one in ends:
        k, c, end = one.connection.stiffness, one.connection.damping, at + len(one.connection.directions)
        if k is not None and c is not None:
            acts[at:end] = which = (k != 0.0).any(axis=1) | (c != 0.0).any(axis=1)
            factor = 1.0 if one.connection.dynamic is None else one.connection.dynamic.factor(omega)[:, None, None]
            dynamic = k * factor + 1j * omega[:, None, None] * c
            rows = at + np.flatnonzero(which)
            total[:, rows[:, None], rows] = _inverse(dynamic[:, which][:, :, which], one)
        at = end
    return total, acts


def _inverse(dynamic: Complex, ends: Ends) -> Complex:
    size = np.sqrt(np.abs(np.einsum("nii->ni", dynamic)).max(axis=0, initial=0.0))
    scaled = dynamic / size[:, None] / size
    if scaled.size and (np.linalg.cond(scaled) * EPS * len(size) > 1.0).any():
        raise ModelError(f"{WHO}: the stiffness from {ends.name} is singular and not diagonal, or dampers act at 0 Hz "
                         f"alone; expected one that resists every combination of its directions. Name the directions "
                         f"that it acts along.", element=ends.connection.first)  # fmt: skip
    return np.asarray(np.linalg.inv(scaled) / size[:, None] / size)


def _joined(
    sides: _Sides, ends: Sequence[Ends], compliance: tuple[Complex, Bools], lines: slice
) -> tuple[Complex, Complex, Complex, Array, Array, Index]:
    """Responses of joined parts at some lines, what errors become in outputs and inputs, the variance by directions
    that are not joined, condition of the interface and directions kept.
    """
    g0 = sides.responses[lines]
    rows, variance, columns = (np.moveaxis(getattr(sides.errors.at(lines), side), -1, 0)
                               for side in ("rows", "variance", "columns"))  # fmt: skip
    omega, acts = sides.omega[lines], compliance[1]
    n = len(omega)
    # displacements L y, and forces L^T f
    out = np.zeros((n, sum(len(one.connection.directions) for one in ends), g0.shape[1]), dtype=complex)
    into = np.zeros((g0.shape[2], out.shape[1]))
    row = 0
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = np.array([np.ones(n), 1.0 / (1j * omega), -1.0 / omega**2])
    for one in ends:
        for k in range(len(one.connection.directions)):
            for sign, outputs, inputs in ((-1.0, one.outputs[0], one.inputs[0]), (1.0, one.outputs[1], one.inputs[1])):
                out[:, row, outputs[k]] = sign * inverse[sides.orders[outputs[k]]]
                into[inputs[k], row] = sign
            row += 1
    out, into = out[:, acts], into[:, acts]
    used = [k for k in range(g0.shape[1]) if (out[:, :, k] != 0.0).any()]
    pushes = into.any(axis=1)
    moved = out[:, :, used] @ g0[:, used]
    pushed = g0[:, :, pushes] @ into[pushes]
    interface = moved[:, :, pushes] @ into[pushes]
    errors = out[:, :, used] @ rows[:, used], variance, columns[:, pushes].swapaxes(1, 2) @ into[pushes]
    inverse_interface, dropped, condition, kept = _pseudo_inverse(
        interface + compliance[0][lines][:, acts][:, :, acts], interface, errors)  # fmt: skip
    responses = g0 - pushed @ inverse_interface @ moved
    ways_out = rows - pushed @ inverse_interface @ errors[0]
    ways_in = columns.swapaxes(1, 2) - errors[2] @ inverse_interface @ moved
    left_out = np.where(np.isnan(responses), 0.0, np.abs(pushed @ dropped @ moved) ** 2)
    return responses, ways_out, ways_in.swapaxes(1, 2), left_out, condition, kept


def _pseudo_inverse(
    matrix: Complex, own: Complex, errors: tuple[Complex, Array, Complex]
) -> tuple[Complex, Complex, Array, Index]:
    """The inverses of interface compliances (n, d, d) without combinations below their noise, what these would add at
    most, the condition, and the number of combinations that are kept.

    ``own`` is what the parts have of them, A e B its ``errors`` by A (n, d, a), variance of e and B (n, b, d). Lines
    with unknown entries are not numbers.
    """
    known = np.asarray(np.isfinite(matrix).all(axis=(1, 2)))
    size = np.sqrt(np.abs(np.einsum("nii->ni", np.where(known[:, None, None], matrix, 1.0))))
    size = np.where(size > 0.0, size, 1.0)
    unit = size[:, :, None] * size[:, None]
    u, values, vh = np.linalg.svd(np.where(known[:, None, None], matrix / unit, np.eye(matrix.shape[1])))
    largest = np.where(known[:, None, None], np.abs(own / unit), 0.0).max(axis=(1, 2), initial=0.0)
    by_row = np.abs(u.conj().swapaxes(1, 2) @ (errors[0] / size[:, :, None])) ** 2
    by_column = np.abs((errors[2] / size[:, None]) @ vh.conj().swapaxes(1, 2)) ** 2
    deviation = np.sqrt(((by_row @ errors[1]) * by_column.swapaxes(1, 2)).sum(axis=2))
    rounding = matrix.shape[1] * EPS * np.maximum(largest, values[:, 0] if values.size else 0.0)
    stands_out = values > np.maximum(STANDS_OUT * deviation, rounding[:, None])
    with np.errstate(divide="ignore"):
        inverse = 1.0 / np.maximum(values, np.where(stands_out, 0.0, deviation))
        condition = values[:, 0] / values[:, -1] if values.size else np.ones(len(values))
    left, right = vh.conj().swapaxes(1, 2), u.conj().swapaxes(1, 2)
    kept, dropped = ((left * np.where(which, inverse, 0.0)[:, None]) @ right / unit
                     for which in (stands_out, ~stands_out))  # fmt: skip
    kept[~known] = np.nan
    return kept, dropped, np.where(known, condition, np.nan), np.where(known, stands_out.sum(axis=1), 0)
