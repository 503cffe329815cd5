"""Measured modes in a fit: frequencies, damping ratios and shapes, paired with those of the model by their shapes.

With Q(s) = s^2 M + s C + K a mode, Q(lambda) x = 0, moves by [Q, Q' x; x^H, 0] [dx; d lambda] = [-dQ x; 0]. Measured
shapes psi are known up to a complex factor, the best one: r = (a phi - psi) / sigma with a = phi^H psi / phi^H phi.
Modes of one eigenvalue, as symmetry makes them, have any shape x = V c of their space: the one nearest to psi is taken,
bordered by V, and d lambda is c^H mu / c^H c with what stands beside V in the solution.

Source: Friswell & Mottershead, Finite Element Model Updating in Structural Dynamics (1995), sections 2 and 5; Golub &
Pereyra, SIAM J. Numer. Anal. 10 (1973) 413, for the factor.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mbsvib.common.arrays import Array, Bools, Complex, Index
from mbsvib.errors import ResponseError
from mbsvib.fitting.response_data import Block
from mbsvib.linalg.rank import EPS
from mbsvib.modes import modes as modes_of

# A mode as far off as this factor in frequency loses as much as a correlation of shapes of 1 is worth.
FAR_APART = 4.0
# A mode without a shape that is farther from that of the model than by this factor may be another one.
GUESSED = 1.3
# Standard deviation of entries of shapes, in parts of the largest.
SHAPE = 0.05
# Shapes are real up to a factor if the sum of their squares is as large as that of sizes, but for this share.
REAL = 1e-9
# Relative difference of eigenvalues of one space.
EQUAL = 1e-6
SENSING = ("Cq", "Cv", "Ca")


@dataclass(frozen=True, eq=False)
class ModeData:
    """Natural ``frequencies`` (n,) [Hz], ``damping_ratios`` (n,) and ``shapes`` (outputs, n), NaN where not measured,
    with standard deviations: relative ones of the first two, and of the shapes in their own unit (outputs, n). They are
    displacements: ``sign`` lambda^``powers`` (outputs,) times what the ``rows`` of the model have, rotations among them
    times a radius.
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
    sign: Array
    powers: Index
    known: bool = True

    def with_radius(self, equations: Any) -> ModeData:
        """Return the same with rotations times the radius at which the modes of the model turn as much as they move,
        normalised by mass: units do not change what a shape tells.
        """
        turns = np.array([equations.output_units[row].startswith("rad") for row in self.rows], dtype=bool)
        if turns.all() or not turns.any():
            return self
        shapes = sum(getattr(equations, key)[self.rows] for key in SENSING) @ equations.modes().shapes
        moved, turned = np.linalg.norm(shapes[~turns]), np.linalg.norm(shapes[turns])
        scale = np.where(turns, moved / turned if moved * turned > 0.0 else 1.0, 1.0)
        shapes = self.shapes * scale[:, None]
        return replace(self, shapes=shapes, sign=self.sign * scale, shape_deviation=shape_deviations(shapes))

    @property
    def numbers(self) -> int:
        """How many real numbers were measured, one an entry of a shape that is real up to a factor, which is none."""
        shown = np.isfinite(self.shapes)
        square = np.where(shown, self.shapes, 0.0) ** 2
        parts = 1 + (np.abs(square.sum(axis=0)) < (1.0 - REAL) * np.abs(square).sum(axis=0))
        return int(np.isfinite(self.frequencies).sum() + np.isfinite(self.damping_ratios).sum()
                   + (parts * (shown.sum(axis=0) - shown.any(axis=0))).sum())  # fmt: skip

    def blocks(self, equations: Any, slopes: Mapping[str, Array] | None, values: Array, far: bool) -> Iterator[Block]:
        """Yield the residuals of all modes with their derivatives."""
        eigenvalues, spaces, shapes, pairs = self._modes(equations)
        parts = []
        for k, at in enumerate(pairs):
            change: tuple[Complex, Complex] = np.zeros(0, dtype=complex), np.zeros((0, len(self.rows)), dtype=complex)
            factors = self._factors(k, eigenvalues, at, shapes[at])
            if slopes is not None:
                change = _changes(equations, slopes, eigenvalues[at], (spaces[at], factors), (self.rows, self.powers))
            parts += list(self._residuals(k, eigenvalues[at], shapes[at] @ factors, *change))
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

    def _modes(self, equations: Any) -> tuple[Complex, list[Complex], list[Complex], Index]:
        """Eigenvalues of the model's modes, vectors (m, g) of the space of each, of g modes, and their shapes (outputs,
        g), and which mode each measured one is.
        """
        eigenvalues = self._oscillating(equations)
        spaces = [_space(equations, eigenvalues[_equal(eigenvalues, k)]) for k in range(len(eigenvalues))]
        sensing = [getattr(equations, key)[self.rows] for key in SENSING]
        shapes = [self.sign[:, None] * (_sensed(sensing, value, self.powers) @ space)
                  for value, space in zip(eigenvalues, spaces, strict=True)]  # fmt: skip
        return eigenvalues, spaces, shapes, self.paired(np.abs(eigenvalues) / (2.0 * np.pi), shapes)

    def _factors(self, k: int, eigenvalues: Complex, at: int, shapes: Complex) -> Complex:
        """What makes the shape of measured mode k of those (outputs, g) of the space of mode ``at``, of length 1."""
        own: Complex = np.eye(shapes.shape[1], dtype=complex)[int(_equal(eigenvalues, at)[:at].sum())]
        known = np.isfinite(self.shapes[:, k])
        if len(own) == 1 or not known.any():
            return own
        found = np.linalg.lstsq(shapes[known], self.shapes[known, k], rcond=None)[0]
        size = np.linalg.norm(found)
        return np.asarray(found / size) if size > 0.0 else own

    def _oscillating(self, equations: Any) -> Complex:
        eigenvalues: Complex = modes_of(equations).pairs[:, 0]
        result = np.where(eigenvalues.imag < 0.0, eigenvalues.conj(), eigenvalues)[eigenvalues.imag != 0.0]
        if len(result) < len(self.frequencies):
            raise ResponseError(f"fit: {self.name} has {len(self.frequencies)} modes, and the model {len(result)} that "
                                f"oscillate; leave modes out or give the model more freedom.")  # fmt: skip
        return np.asarray(result)

    def paired(self, frequencies: Array, shapes: Sequence[Complex]) -> Index:
        """Return the number of the model's mode of each measured one.

        ``frequencies`` (k,) [Hz], ``shapes`` (outputs, g) of the space of each: those of the model.
        """
        from scipy.optimize import linear_sum_assignment

        distance = np.abs(np.log(self.frequencies[:, None] / frequencies)) / np.log(FAR_APART)
        for k, shape in enumerate(self.shapes.T):
            known = np.isfinite(shape)
            if known.sum() > 1:
                distance[k] += [1.0 - _share(space[known], shape[known]) for space in shapes]
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


def shape_deviations(shapes: Complex) -> Array:
    """Standard deviations (outputs, n) of the entries of shapes."""
    with np.errstate(all="ignore"):
        largest = np.nanmax(np.abs(shapes), axis=0, initial=0.0)
    deviation = np.broadcast_to(SHAPE * largest, shapes.shape)
    return np.where(deviation > 0.0, deviation, 1.0)


def _equal(eigenvalues: Complex, k: int) -> Bools:
    return np.asarray(np.abs(eigenvalues - eigenvalues[k]) <= EQUAL * np.abs(eigenvalues[k]))


def _space(equations: Any, eigenvalues: Complex) -> Complex:
    """Orthonormal vectors (m, g) with Q(lambda) x = 0 of g equal eigenvalues."""
    value = eigenvalues.mean()
    q = equations.K + value * equations.C + value**2 * equations.M
    return np.asarray(np.linalg.svd(q)[2][-len(eigenvalues) :].conj().T)


def _share(space: Complex, shape: Complex) -> float:
    """The share of a shape (outputs,) in the span of some (outputs, g); of one of these the MAC."""
    u, size, _ = np.linalg.svd(space, full_matrices=False)
    power = (np.abs(u[:, size > EPS * size.max(initial=0.0)].conj().T @ shape) ** 2).sum()
    total = (np.abs(shape) ** 2).sum()
    return float(power / total) if total else 0.0


def _changes(
    equations: Any, slopes: Mapping[str, Array], value: complex, of: tuple[Complex, Complex], ends: tuple[Index, Index]
) -> tuple[Complex, Complex]:
    """Derivatives of the eigenvalue (v,) and of the shape at the outputs (v, outputs); ``of``: V (m, g) and c (g,)."""
    space, factors = of
    x, m = space @ factors, len(space)
    q = equations.K + value * equations.C + value**2 * equations.M
    rate = (equations.C + 2.0 * value * equations.M) @ space
    scale = float(np.abs(q).max()) or 1.0  # borders as large as Q
    unit = scale / np.linalg.norm(rate)
    bordered = np.block([[q, rate * unit], [scale * space.conj().T, np.zeros((len(factors), len(factors)))]])
    force = np.array([-(k + value * c + value**2 * mass) @ x for k, c, mass in zip(
        slopes["K"], slopes["C"], slopes["M"], strict=True)])  # fmt: skip
    solution = np.linalg.solve(bordered, np.pad(force, ((0, 0), (0, len(factors)))).T).T
    d_value = solution[:, m:] @ factors.conj() * unit
    rows, powers = ends
    sensing = [getattr(equations, key)[rows] for key in SENSING]
    moved = _sensed([(k + powers)[:, None] * matrix for k, matrix in enumerate(sensing)], value, powers - 1) @ x
    turned = _sensed([slopes[key][:, rows] for key in SENSING], value, powers) @ x
    return d_value, solution[:, :m] @ _sensed(sensing, value, powers).T + d_value[:, None] * moved + turned


def _sensed(matrices: Sequence[Any], value: complex, powers: Index) -> Any:
    """sum_k lambda^(k + powers) C_k of Cq, Cv, Ca (..., outputs, m)."""
    return sum(value ** (k + powers)[:, None] * matrix for k, matrix in enumerate(matrices))
