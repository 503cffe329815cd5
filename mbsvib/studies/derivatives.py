"""Derivatives of eigenvalues and responses to the variables of a study: exact ones of systems and of continuous loops
around them, differences of all else.

With dM the change of [A B; C D] of a loop, G' = [C R 1] dM [R B; 1], R = (i w - A)^-1, and lambda' = l^H dA r / l^H r.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from mbsvib.api.system import System
from mbsvib.common.arrays import Array, Complex, Index
from mbsvib.errors import MbsvibError, ModelError
from mbsvib.linalg.matching import clusters
from mbsvib.linalg.spectrum import Spectrum, spectrum
from mbsvib.modes import Modes
from mbsvib.random.slopes import Scene
from mbsvib.responses.first_order_solver import first_order_solver
from mbsvib.sensitivities.matrix_derivatives import MatrixDerivatives
from mbsvib.sensitivities.responses import fields

Rates = Mapping[str, Mapping[str, float]]

DENSE = 60  # degrees of freedom up to which responses take the derivatives of whole matrices, which are computed once
# Offsets and weights of differences of fourth order: central ones, and one-sided ones where values end.
STENCILS = (
    ((-2, 1 / 12), (-1, -2 / 3), (1, 2 / 3), (2, -1 / 12)),
    ((0, -25 / 12), (1, 4.0), (2, -3.0), (3, 4 / 3), (4, -1 / 4)),
    ((0, 25 / 12), (-1, -4.0), (-2, 3.0), (-3, -4 / 3), (-4, 1 / 4)),
)


@dataclass(frozen=True)
class OfSystem:
    """Those of a system of a mechanism."""

    system: System
    rates: Rates

    @cached_property
    def _change(self) -> MatrixDerivatives:
        return self.system.matrix_derivatives(self.rates)

    def eigenvalues(self, modes: Modes) -> Complex:
        """Return those of eigenvalues, (variables, eigenvalues)."""
        return self.system.eigenvalue_sensitivities(self.rates)

    def response(self, w: Array, outputs: Sequence[str], inputs: Sequence[str]) -> Complex:
        """Return those of the frequency response, (variables, outputs, inputs, n).

        dG = dH R + L^T dB - L^T (dK + i w dC - w^2 dM) R + dD,  H = Cq + i w Cv - w^2 Ca
        """
        system, d = self.system, self._change if self.system.dof <= DENSE else None
        if d is None:
            return system.frequency_response_sensitivities(w, self.rates, list(outputs), list(inputs))
        o, i = [system.outputs.index(name) for name in outputs], [system.inputs.index(name) for name in inputs]
        right, left = fields(system.basis, i, o, w)
        r, rows, s = right[:, 0].transpose(2, 0, 1), left[:, :, 0].transpose(2, 1, 0), 1j * w[:, None, None]
        slopes = []
        for p in range(len(self.rates)):
            slope = rows @ (d.B[p][:, i] - (d.K[p] + s * d.C[p] + s * s * d.M[p]) @ r) + d.D[p][np.ix_(o, i)]
            slopes.append((slope + (d.Cq[p][o] + s * d.Cv[p][o] + s * s * d.Ca[p][o]) @ r).transpose(1, 2, 0))
        return np.array(slopes)

    def close_modes(self, modes: Modes, group: list[int]) -> tuple[Complex, Complex] | None:
        """Return A (k, k), whose eigenvalues approximate k close ones, and its derivatives (variables, k, k), if these
        are supported.

        dA_ij = -x_i^T (l_i l_j dM + (l_i + l_j) / 2 dC + dK) x_j, with x_i^T ((l_i + l_j) M + C) x_j = 1 for i = j,
        else 0
        """
        system = self.system
        if system.gyroscopic is not None or system.circulatory is not None:
            return None
        x, values = modes.shapes[:, group], modes.pairs[group, 0]
        change = self._change
        total, product = values[:, None] + values, values[:, None] * values
        norm = total * (x.T @ system.M @ x) + x.T @ system.C @ x
        form = product * (x.T @ change.M @ x) + 0.5 * total * (x.T @ change.C @ x) + x.T @ change.K @ x
        return np.diag(values).astype(complex), np.asarray(-np.linalg.solve(norm, form), dtype=complex)


@dataclass(frozen=True)
class OfLoop:
    """Those of a continuous loop around a system of a mechanism; ``law`` (variables, ...): those of [A B; C D] of its
    controller, None where that stays as it is.
    """

    loop: Any
    rates: Rates
    law: Array | None = None

    @cached_property
    def _scene(self) -> Scene:
        return Scene(self.loop)

    @cached_property
    def _changes(self) -> Array:
        scene, moving = self._scene, [any(rates.values()) for rates in self.rates.values()]
        equations, count = scene.equations, len(self.rates)
        result = np.zeros((count, len(equations.a) + len(equations.c), len(equations.a) + equations.b.shape[1]))
        if self.law is not None:
            result += scene.along(None, self.law)
        if any(moving):
            rates = {name: rates for (name, rates), moves in zip(self.rates.items(), moving, strict=True) if moves}
            result[moving] += scene.along(scene.system.matrix_derivatives(rates))
        return result

    @cached_property
    def _spectrum(self) -> Spectrum:
        return spectrum(self._scene.equations.a)

    def _projected(self, group: Sequence[int]) -> Complex:
        """Derivatives of A in the right and left eigenvectors of some eigenvalues, (variables, k, k)."""
        of_a, n = self._spectrum, len(self._scene.equations.a)
        x = np.ldexp(1.0, of_a.power)[:, None] * of_a.right[:, group]
        y = (np.ldexp(1.0, -of_a.power)[:, None] * of_a.left[:, group]).conj().T
        return np.asarray(np.linalg.solve(y @ x, y @ self._changes[:, :n, :n] @ x))

    def eigenvalues(self, modes: Modes) -> Complex:
        """Return those of eigenvalues; of those that coincide those of their branches, in ascending order."""
        values, known = modes.eigenvalues, self._spectrum.values
        slopes = np.empty((len(self.rates), len(known)), dtype=complex)
        for group in {tuple(np.flatnonzero(row).tolist()) for row in clusters(known)}:
            try:
                slopes[:, group] = np.sort_complex(np.linalg.eigvals(self._projected(group)))
            except np.linalg.LinAlgError:
                slopes[:, group] = np.inf  # defective ones part with a root
        upper = values.imag >= 0.0
        first = slopes[:, nearest(values[upper], known)]
        result = np.empty((len(slopes), len(values)), dtype=complex)
        result[:, upper] = first
        lower = np.flatnonzero(~upper)
        ends = modes.starts[:-1] + modes.starts[1:] - 1
        result[:, lower] = result[:, ends[np.searchsorted(modes.starts, lower, side="right") - 1] - lower].conj()
        return result

    def close_modes(self, modes: Modes, group: list[int]) -> tuple[Complex, Complex] | None:
        """Return A and its derivatives as ``OfSystem``."""
        values = modes.pairs[group, 0]
        return np.diag(values), self._projected(nearest(values, self._spectrum.values).tolist())

    def response(self, w: Array, outputs: Sequence[str], inputs: Sequence[str]) -> Complex:
        """Return those of the frequency response."""
        a, b, c, _ = self._scene.equations
        o, i = ([names.index(name) for name in wanted]
                for names, wanted in ((self.loop.outputs, outputs), (self.loop.inputs, inputs)))  # fmt: skip
        n = len(a)
        rows, columns = [*range(n), *[n + k for k in o]], [*range(n), *[n + k for k in i]]
        s = np.asarray(1j * w, dtype=complex)
        x, y = _resolvent(a, b[:, i], s, w, self.loop.name), _resolvent(a.T, c[o].T, s, w, self.loop.name)
        ends = [np.concatenate((part, np.repeat(np.eye(part.shape[1])[:, :, None], len(w), axis=2))).transpose(2, 0, 1)
                for part in (x, y)]  # fmt: skip
        changes = self._changes[:, rows][:, :, columns]
        return np.array([(ends[1].swapaxes(1, 2) @ change @ ends[0]).transpose(1, 2, 0) for change in changes])


@dataclass(frozen=True)
class Differences:
    """Differences of fourth order; ``at`` returns what is asked with some variables off their values."""

    at: Callable[[Mapping[str, float]], Any]
    steps: Mapping[str, float]

    def of(self, function: Callable[[Any], Any]) -> Any:
        """Return the differences of a function of what is asked, (variables, ...)."""
        return np.array([self._one(function, name, step) for name, step in self.steps.items()])

    def _one(self, function: Callable[[Any], Any], name: str, step: float) -> Any:
        for stencil in STENCILS:
            try:
                return sum(weight * function(self.at({name: offset * step})) for offset, weight in stencil) / step
            except MbsvibError as error:
                refusal = error
        refusal.add_note(f"around the variable '{name}', to which there are differences")
        raise refusal

    def eigenvalues(self, modes: Modes) -> Complex:
        """Return those of eigenvalues, each with the nearest one."""
        def function(asked: Any) -> Complex:
            values: Complex = asked.modes().eigenvalues
            return values[nearest(modes.eigenvalues, values)]

        return np.asarray(self.of(function))

    def response(self, w: Array, outputs: Sequence[str], inputs: Sequence[str]) -> Complex:
        """Return those of the frequency response."""
        return np.asarray(self.of(lambda asked: asked.frequency_response(w, list(outputs), list(inputs))))

    def close_modes(self, modes: Modes, group: list[int]) -> None:
        """Return nothing: only single eigenvalues are followed."""


Derivatives = OfSystem | OfLoop | Differences


def nearest(values: Complex, others: Complex) -> Index:
    """Return the numbers of those among the others that are nearest to some eigenvalues, all together."""
    from scipy.optimize import linear_sum_assignment

    if len(others) < len(values):
        raise ModelError(f"studies: there are {len(others)} eigenvalues beside {len(values)}: the number of states "
                         f"changes with the variables; ask responses instead.", field="plant")  # fmt: skip
    return np.asarray(linear_sum_assignment(np.abs(values[:, None] - others))[1])


def _resolvent(a: Array, b: Array, s: Complex, w: Array, name: str) -> Complex:
    """(s - A)^-1 B, (states, columns, n)."""
    solver = first_order_solver(a, b, b.T, name)
    parts = [x for _, x in solver.states(s, w, b)]
    return np.ldexp(1.0, solver.power)[:, None, None] * np.concatenate(parts, axis=2)
