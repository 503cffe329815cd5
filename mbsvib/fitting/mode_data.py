"""Measured modes in a fit: frequencies, damping ratios and shapes, paired with those of the model by their shapes.

With Q(s) = s^2 M + s C + K a mode, Q(lambda) x = 0, moves by [Q, Q' x; x^H, 0] [dx; d lambda] = [-dQ x; 0]. Measured
shapes psi are known up to a complex factor, the best one: r = (a phi - psi) / sigma with a = phi^H psi / phi^H phi.

Source: Friswell & Mottershead, Finite Element Model Updating in Structural Dynamics (1995), sections 2 and 5; Golub &
Pereyra, SIAM J. Numer. Anal. 10 (1973) 413, for the factor.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mbsvib.common.arrays import Array, Complex, Index
from mbsvib.errors import ResponseError
from mbsvib.fitting.response_data import Block
from mbsvib.linalg.matching import mac
from mbsvib.modes import modes as modes_of

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
        parts = []
        for k, at in enumerate(pairs):
            change: tuple[Complex, Complex] = np.zeros(0, dtype=complex), np.zeros((0, len(self.rows)), dtype=complex)
            if slopes is not None:
                change = _changes(equations, slopes, eigenvalues[at], vectors[at], (self.rows, self.powers))
            parts += list(self._residuals(k, eigenvalues[at], shapes[at], *change))
        residual, changes = (np.concatenate(part, axis=-1) for part in zip(*parts, strict=True))
        yield Block(residual, None if slopes is None else np.pad(changes, ((0, len(values) - len(changes)), (0, 0))))

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

    def _residuals(
        self, k: int, value: complex, shape: Complex, d_value: Complex, d_shape: Complex
    ) -> Iterator[tuple[Complex, Complex]]:
        """Residuals (n,) of measured mode k, with derivatives (v, n)."""
        size = abs(value)
        slope = (np.conj(value) * d_value).real / size**2
        if np.isfinite(self.frequencies[k]):
            deviation = self.frequency_deviation[k]
            residual = np.log(size / (2.0 * np.pi * self.frequencies[k])) / deviation
            yield np.array([residual + 0j]), slope[:, None] / deviation + 0j
        if np.isfinite(self.damping_ratios[k]):
            deviation = self.damping_deviation[k] * max(self.damping_ratios[k], np.finfo(float).tiny)
            ratio = -value.real / size
            d_ratio = -d_value.real / size - ratio * slope
            yield np.array([(ratio - self.damping_ratios[k]) / deviation + 0j]), d_ratio[:, None] / deviation + 0j
        known = np.isfinite(self.shapes[:, k])
        if known.any():
            measured, phi = self.shapes[known, k], shape[known]
            norm = float((np.abs(phi) ** 2).sum())
            factor = (phi.conj() @ measured) / norm if norm else 0.0
            d_phi, deviation = d_shape[:, known] * self.sign[known], self.shape_deviation[known, k]
            d_factor = ((d_phi.conj() @ (measured - factor * phi)) - factor * (d_phi @ phi.conj())) / (norm or 1.0)
            yield (factor * phi - measured) / deviation, (factor * d_phi + d_factor[:, None] * phi) / deviation


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
