"""Figures of step responses: rise time, settling time, overshoot, peak.

With distinct poles the response to a unit step is y(t) = G(0) + sum over k of R_k exp(lambda_k t), R_k the residue of
G(s) / s at lambda_k. Largest values and crossings are those of the sum at all times (``decaying_sum``).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import matrix_balance, schur

from mbsvib.common.arrays import Array, Complex
from mbsvib.common.columnar import Columnar
from mbsvib.common.display import Displayed
from mbsvib.common.units import pretty, ratio
from mbsvib.errors import ResponseError
from mbsvib.linalg.groups import linked_items
from mbsvib.responses.decaying_sum import DecayingSum
from mbsvib.responses.first_order_solver import decaying_response
from mbsvib.responses.frequency_response import zero_responses
from mbsvib.responses.norms import decaying_part

# Rise is from the first to the second share of the final value.
RISE = (0.1, 0.9)
# Less overshoot, as a share of the final value, is none: whether a response ends at it or beyond.
NO_OVERSHOOT = 1e-7
# A final value below this share of the largest one is zero but for rounding.
ZERO_FINAL = 1e-11
ROUNDING = 1e-14  # of a sum, as a share of its terms, which cancel where poles coincide
# Condition of the eigenvectors of balanced equations up to which the sum has seven digits: a double pole makes it 1e8,
# or infinite, in which case its two values are moved apart by this share of it; a triple pole makes it larger.
WORST_CONDITION, APART = 1e9, 1e-7


@dataclass(frozen=True, eq=False, repr=False)
class StepInfo(Columnar, Displayed):
    """How outputs follow a step of one unit of each input, from rest; arrays are (outputs, inputs).

    ``final`` is the value in the end and ``peak`` the largest magnitude, ``peak_time`` [s] when it occurs, infinite
    where it is the final value.
    ``rise_time`` [s] is that from 10 % to 90 % of the final value, ``settling_time`` [s] the time after which the
    response stays within a ``band`` (share) around the final value. ``overshoot`` [%] is how far the response goes
    beyond the final value, ``undershoot`` [%] how far to the other side of zero. Where the final value is zero the band
    is a share of the peak, and rise time, overshoot and undershoot are NaN. A response that is zero but for rounding of
    the model's numbers has 0 as final value, peak and settling time.
    """

    name: str
    """Name of the system."""
    outputs: tuple[str, ...]
    """Names of the outputs."""
    inputs: tuple[str, ...]
    """Names of the inputs."""
    output_units: tuple[str, ...]
    """Units of the outputs."""
    input_units: tuple[str, ...]
    """Units of the inputs."""
    band: float
    final: Array
    rise_time: Array
    settling_time: Array
    overshoot: Array
    undershoot: Array
    peak: Array
    peak_time: Array

    def columns(self) -> dict[str, Any]:
        """Return the values of each pair of an output and an input as columns by name.

        Returns
        -------
        dict of str to array, shape (outputs * inputs,)
            ``output``, ``input``, ``final``, ``rise_time`` [s], ``settling_time`` [s], ``overshoot`` [%],
            ``undershoot`` [%], ``peak``, ``peak_time`` [s].
        """
        names = ("final", "rise_time", "settling_time", "overshoot", "undershoot", "peak", "peak_time")
        return {"output": np.repeat(self.outputs, len(self.inputs)), "input": np.tile(self.inputs, len(self.outputs)),
                **{name: getattr(self, name).ravel() for name in names}}  # fmt: skip

    def table(self) -> dict[str, Any]:
        """Return the figures as arguments of ``mbsvib.common.tables.text`` and ``show``."""
        rows = []
        for i, output in enumerate(self.outputs):
            for j, source in enumerate(self.inputs):
                values = (self.final, self.rise_time, self.settling_time, self.overshoot, self.peak, self.peak_time)
                words = ["" if np.isnan(value[i, j]) else f"{value[i, j]:.4g}" for value in values]
                rows.append((output, source, pretty(ratio(self.output_units[i], self.input_units[j])), *words))
        headers = ("output", "input", "unit", "final", "rise time [s]", "settling time [s]", "overshoot [%]", "peak",
                   "peak time [s]")  # fmt: skip
        return {"title": f"Step responses of {self.name}",
                "columns": [(header, "left" if k < 3 else "right") for k, header in enumerate(headers)], "rows": rows,
                "notes": [f"Rise from 10 % to 90 %; settled within {100.0 * self.band:g} %."]}  # fmt: skip


def step_info(linear: Any, band: float = 0.02) -> StepInfo:
    """Return the figures of step responses. ``band``: share of the final value within which they have settled."""
    if not 0.0 < band < 1.0:
        raise ResponseError(f"step_info: band = {band!r}; expected a share between 0 and 1, such as 0.02.")
    space = linear.state_space("modal") if linear.kind == "system" else linear.state_space()
    parts = decaying_part(space, f"step_info: '{linear.name}'", "a step response has no final value; time_response "
                          "computes it")  # fmt: skip
    part = parts.decaying
    a, b, c = (part.a, part.b, part.c) if parts.lasting else (space.A, space.B, space.C)
    values, vectors = _eigen(a, linear.name)
    residues = _residues(b, c, values, vectors)
    static = decaying_response(parts, space.D, linear.name) if parts.lasting else linear.frequency_response
    final = np.asarray(static(np.zeros(1))[:, :, 0].real)
    shape = final.shape
    zero = zero_responses(linear.basis) if linear.kind == "system" else np.zeros(shape, dtype=bool)
    final, residues = np.where(zero, 0.0, final), np.where(zero, 0.0, residues)
    result = np.array([_figures(linear.name, float(final[i, j]), residues[:, i, j], values, band)
                       for i, j in np.ndindex(shape)]).reshape(*shape, 6)  # fmt: skip
    rise, settling, over, under, peak, peak_time = np.moveaxis(result, 2, 0)
    return StepInfo(linear.name, tuple(space.outputs), tuple(space.inputs), tuple(space.output_units),
                    tuple(space.input_units), band, final, rise, settling, over, under, peak, peak_time)  # fmt: skip


def _eigen(a: Array, name: str) -> tuple[Complex, Complex]:
    """Eigenvalues and eigenvectors; an error where these are nearly dependent."""
    if not len(a):
        return np.zeros(0, dtype=complex), np.zeros((0, 0), dtype=complex)
    even, scale = matrix_balance(a, permute=False)
    values, vectors = np.linalg.eig(even)
    if np.linalg.cond(vectors) > WORST_CONDITION:
        values, vectors = _apart(even)
    if np.linalg.cond(vectors) > WORST_CONDITION:
        raise ResponseError(f"step_info: three or more poles of '{name}' coincide, so that its step "
                            f"responses are no sum of exponentials; use time_response.")  # fmt: skip
    return values.astype(complex), (scale @ vectors).astype(complex)


def _apart(a: Array) -> tuple[Complex, Complex]:
    """Eigenvalues and eigenvectors of a matrix whose coinciding eigenvalues are moved apart from their mean.

    The sum over two of them is a divided difference, whose error is of second order in their distance.
    """
    upper, basis = schur(a, output="complex")
    values = upper.diagonal().copy()
    size = np.abs(values)
    for group in linked_items(np.abs(values[:, None] - values) <= APART * np.maximum(size, size[:, None])):
        values[group] = values[group].mean() * (1.0 + APART * (np.arange(len(group)) - 0.5 * (len(group) - 1)))
    upper[np.arange(len(a)), np.arange(len(a))] = values
    values, vectors = np.linalg.eig(upper)
    return values, basis @ vectors


def _residues(b: Array, c: Array, values: Complex, vectors: Complex) -> Complex:
    """R_k of the step response, (poles, outputs, inputs)."""
    if not len(values):
        return np.zeros((0, len(c), b.shape[1]), dtype=complex)
    left = np.linalg.solve(vectors, b.astype(complex))
    return np.asarray(np.einsum("ok,ki->koi", c @ vectors, left) / values[:, None, None])


def _figures(name: str, final: float, residues: Complex, values: Complex, band: float) -> tuple[float, ...]:
    """Rise time, settling time, overshoot, undershoot, peak and its time of one response."""
    start, terms = final + float(residues.sum().real), float(np.abs(residues).sum())
    if terms <= ZERO_FINAL * max(abs(final), abs(start)):  # a step at once
        return (0.0, 0.0, 0.0, 0.0, abs(final), 0.0) if final else (np.nan, 0.0, np.nan, np.nan, 0.0, 0.0)
    motion = DecayingSum(name, residues, values)
    none = ZERO_FINAL * motion.envelope(0.0)
    if abs(final) <= none:
        peak, at = max(motion.highest(sign, max(none, ROUNDING * terms)) for sign in (1.0, -1.0))
        if peak <= 0.0:  # terms that cancel at all times
            return np.nan, 0.0, np.nan, np.nan, 0.0, 0.0
        return np.nan, motion.last(band * peak), np.nan, np.nan, peak, at
    sign, size = float(np.sign(final)), abs(final)
    over, at = motion.highest(sign, max(NO_OVERSHOOT * size, none, ROUNDING * terms))
    under, at_under = motion.highest(-sign, size)
    low, high = (motion.first((share - 1.0) * size, sign) for share in RISE)
    peak, at = max((size + max(0.0, over), at), (under - size, at_under))
    return (high - low, motion.last(band * size), max(0.0, 100.0 * over / size), max(0.0, 100.0 * (under / size - 1.0)),
            peak, at)  # fmt: skip
