"""Mean squares under filtered white noise, exact by Lyapunov equations.

A P + P A^T + b (S/2) b^T = 0,  mean square c P c^T, for white noise of the one-sided density S: A includes the filters
of the noise and of the outputs. The parts of poles that do not decay are taken out first, pair by pair of output and
source: where an output shows what a source does to them, the mean square is infinite, elsewhere they do not count.

Source: Zhou, Doyle & Glover, Robust and Optimal Control (1996), section 4.3.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mbsvib.errors import ResponseError
from mbsvib.linalg.balancing import exponents, scaled_by
from mbsvib.linalg.lasting import separated
from mbsvib.linalg.lyapunov import Lyapunov
from mbsvib.responses.norms import pole_words

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.linalg.lasting import Separation
    from mbsvib.random.weights import Window
    from mbsvib.responses.densities import Shaped


class Equations(NamedTuple):
    """x' = A x + B u,  y = C x + D u."""

    a: Array
    b: Array
    c: Array
    d: Array


@dataclass(frozen=True, eq=False)
class Filtered:
    """Equations behind the filters of their sources and before those of their outputs, under white noise.

    ``all`` from white noises (s,) of density 1 to filtered outputs; its states are those of the plant (n), of the
    source filters (k) and of the output filters.
    """

    plant: Equations
    sources: Equations
    outputs: Equations
    all: Equations

    @property
    def slices(self) -> tuple[slice, slice, slice]:
        """The states of the plant, of the source filters and of the output filters."""
        n, k = len(self.plant.a), len(self.sources.a)
        return slice(0, n), slice(n, n + k), slice(n + k, None)


@lru_cache(maxsize=64)
def in_rows(filters: tuple[Shaped | None, ...], levels: bool) -> Equations:
    """Return filters side by side, each with an input and an output of its own; None passes its signal on.

    ``levels``: whether each is driven by white noise of the density 1, half of which is its intensity.
    """
    from scipy.linalg import block_diag

    gains = [1.0 if f is None or not levels else float(np.sqrt(0.5 * f.level)) for f in filters]
    n = [0 if f is None else len(f.a) for f in filters]
    a = block_diag(*[np.zeros((0, 0)) if f is None else f.a for f in filters])
    b, c = np.zeros((sum(n), len(filters))), np.zeros((len(filters), sum(n)))
    for k, (f, start) in enumerate(zip(filters, np.cumsum([0, *n]).tolist(), strict=False)):
        if f is not None:
            b[start : start + n[k], k], c[k, start : start + n[k]] = f.b[:, 0] * gains[k], f.c[0]
    d = np.diag([1.0 if f is None else f.d * gain for f, gain in zip(filters, gains, strict=True)])
    result = Equations(a.reshape(sum(n), sum(n)), b, c, d)
    for part in result:
        part.setflags(write=False)
    return result


def filtered(plant: Equations, before: Sequence[Shaped | None], after: Sequence[Shaped | None]) -> Filtered:
    """Return equations with the filters of their sources (s,) and those of their outputs (o,), None for none."""
    source, output = in_rows(tuple(before), levels=True), in_rows(tuple(after), levels=False)
    a, b, c, d = plant
    n, k, m = len(a), len(source.a), len(output.a)
    whole = np.zeros((n + k + m, n + k + m))
    whole[:n, :n], whole[:n, n : n + k], whole[n : n + k, n : n + k] = a, b @ source.c, source.a
    seen = np.concatenate((c, d @ source.c), axis=1)
    whole[n + k :, : n + k], whole[n + k :, n + k :] = output.b @ seen, output.a
    through = d @ source.d
    drive = np.concatenate((b @ source.d, source.b, output.b @ through))
    leaves = np.concatenate((output.d @ seen, output.c), axis=1)
    return Filtered(plant, source, output, Equations(whole, drive, leaves, output.d @ through))


def moments(
    equations: Equations, name: str, cross: Array | None = None, windows: Sequence[Window | None] = ()
) -> tuple[Array, Array]:  # fmt: skip
    """Return the mean squares (outputs, sources) under independent white noises of unit intensity, and what their
    correlation ``cross`` (s, s), without its diagonal, adds (outputs,).

    ``windows`` (outputs,): averages over a time of which the mean square is asked for, None for that of the output.
    """
    power = exponents(*equations[:3]) if len(equations.a) else np.zeros(0, dtype=np.int64)
    a, b, c = scaled_by(power, *equations[:3]) if len(power) else equations[:3]
    parts = separated(a, b, c)
    check_stable(parts, name)
    rest = parts.decaying
    solver, windowed = Lyapunov(rest.a), any(window is not None for window in windows)
    left = averaged(rest.a, rest.c, windows) if windowed else rest.c
    if windowed or b.shape[1] <= len(c):
        squares = np.array([_form(left, solver.controlled(np.outer(column, column)), rest.c) for column in rest.b.T]).T
    else:
        squares = np.array([_form(rest.b.T, solver.observed(np.outer(row, row)), rest.b.T) for row in rest.c])
    squares = np.maximum(squares.reshape(len(c), b.shape[1]), 0.0)
    extra = np.zeros(len(c))
    if cross is not None:
        extra = _form(left, solver.controlled(rest.b @ cross @ rest.b.T), rest.c)
    for group in parts.shown:
        squares[group.shown] = np.inf
    squares[equations.d != 0.0] = np.inf
    extra[np.isinf(squares).any(axis=1)] = 0.0
    return squares, extra


def _form(left: Array, matrix: Array, right: Array) -> Array:
    """The diagonal of left P right^T."""
    return np.asarray((left @ matrix * right).sum(axis=1))


def averaged(a: Array, c: Array, windows: Sequence[Window | None]) -> Array:
    """Return rows r (outputs, n) with r P c^T the mean square of an average over a time T, or of what varies in T.

    mean: 2 C phi_2(A T) P C^T;  within: -2 C A T phi_3(A T) P C^T;  phi_k(z) = sum of z^j / (j + k)!
    """
    from scipy.linalg import expm

    result, n = c.copy(), len(a)
    for row, window in enumerate(windows):
        if window is None or not n:
            continue
        unit = float(np.linalg.norm(c[row])) or 1.0
        augmented = np.zeros((n + 3, n + 3))
        augmented[:n, :n], augmented[:n, n] = a.T * window.time, c[row] / unit
        augmented[[n, n + 1], [n + 1, n + 2]] = 1.0
        phi = expm(augmented)[:n, n:] * unit  # phi_1, phi_2, phi_3 of (A T)^T, times c
        result[row] = 2.0 * phi[:, 1] if window.mean else -2.0 * window.time * (a.T @ phi[:, 2])
    return result


def check_stable(parts: Separation, name: str) -> None:
    """Refuse equations with poles that grow."""
    for group in parts.lasting:
        if (group.part.poles.real > group.part.errors[0]).any():
            raise ResponseError(f"rms: '{name}' is not stable: {pole_words(group.pole)} grows, so that no mean square "
                                f"exists. Add stiffness or damping, or change the controller.")  # fmt: skip
