"""Mean squares under filtered white noise, exact by Lyapunov equations.

A P + P A^T + b (S/2) b^T = 0,  mean square c P c^T, for white noise of the one-sided density S: A includes the filters
of the noise and of the outputs. The parts of poles that do not decay are taken out first, pair by pair of output and
source: where an output shows what a source does to them, the mean square is infinite, elsewhere they do not count.

Source: Zhou, Doyle & Glover, Robust and Optimal Control (1996), section 4.3.

Mean squares under noise of any density, as integrals over the frequency.

A panel is no longer than the distance from its middle to the nearest pole, where Gauss' rule of sixteen points leaves
an error of 1e-14 of the integrand, next to a fourfold pole as well, which noise on a free mass has at 0. Where
densities or weights are given by functions, panels are halved until both halves agree with the whole. Beyond the last
pole the frequency is replaced by its inverse.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag, expm

from mbsvib.common.arrays import Array, Complex
from mbsvib.errors import ResponseError
from mbsvib.linalg.balancing import exponents, scaled_by
from mbsvib.linalg.lasting import Separation, separated
from mbsvib.linalg.lyapunov import Lyapunov
from mbsvib.random.weights import Window
from mbsvib.responses.densities import Shaped
from mbsvib.responses.extrema import UNDAMPED, panels
from mbsvib.responses.norms import RoundingError, by_poles, form, more_accurate, pole_words, solved_forms

Integrand = Callable[[Array], Array]


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

    def to_plant(self, gradient: Array) -> Array:
        """Return the gradient to [A B; C D] of the plant, (n + outputs, n + sources), of one to those of ``all``.

        A change of the plant adds to the others that times what goes from (x, w) to (x, u) and from (x', y) to (x', z).
        """
        (x, f, z), source, output = self.slices, self.sources, self.outputs
        n, (states, white), shown = len(self.plant.a), self.all.b.shape, len(self.all.c)
        before = np.zeros((n + len(source.c), states + white))
        before[:n, x], before[n:, f], before[n:, states:] = np.eye(n), source.c, source.d
        after = np.zeros((states + shown, n + output.b.shape[1]))
        after[x, :n], after[z.start : states, n:], after[states:, n:] = np.eye(n), output.b, output.d
        return np.asarray(after.T @ gradient @ before.T)


@lru_cache(maxsize=64)
def in_rows(filters: tuple[Shaped | None, ...], levels: bool) -> Equations:
    """Return filters side by side, each with an input and an output of its own; None passes its signal on.

    ``levels``: whether each is driven by white noise of the density 1, half of which is its intensity.
    """
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
    a, b, c = scaled_by(exponents(*equations[:3]), *equations[:3])
    parts = separated(a, b, c)
    check_stable(parts, name)
    rest = parts.decaying
    solver, windowed = Lyapunov(rest.a), any(window is not None for window in windows)
    left = averaged(rest.a, rest.c, windows) if windowed else rest.c
    by_source = windowed or b.shape[1] <= len(c)
    if by_source:
        forms = [solved_forms(left, solver.controlled_within(np.outer(column, column)), rest.c) for column in rest.b.T]
    else:
        forms = [solved_forms(rest.b.T, solver.observed_within(np.outer(row, row)), rest.b.T) for row in rest.c]
    parts_of = (np.array([values[k] for values in forms]) for k in range(3))
    parts_of = (part.T if by_source else part for part in parts_of)
    squares, missing, terms = (part.reshape(len(c), b.shape[1]) for part in parts_of)
    extra = np.zeros(len(c))
    if cross is not None:
        extra = form(left, solver.controlled(rest.b @ cross @ rest.b.T), rest.c)
    for group in parts.shown:
        if group.part.errors[0].max() > UNRESOLVED * abs(group.pole) > 0.0:
            raise RoundingError(f"rms of '{name}': rounding leaves open whether {pole_words(group.pole)} decays, "
                                f"beside poles of up to {np.abs(rest.poles).max(initial=0.0):.2g} 1/s. Leave out what "
                                f"is that fast, such as the time constant of a derivative.")  # fmt: skip
        squares[group.shown] = np.inf
    squares[equations.d != 0.0] = np.inf
    squares = more_accurate(f"rms of '{name}'", rest, squares, (missing, terms), by_poles(rest, left),
                      "Give a band, (first, last) [Hz]")  # fmt: skip
    squares = np.maximum(squares, 0.0)
    extra[np.isinf(squares).any(axis=1)] = 0.0
    return squares, extra


def averaged(a: Array, c: Array, windows: Sequence[Window | None]) -> Array:
    """Return rows r (outputs, n) with r P c^T the mean square of an average over a time T, or of what varies in T.

    mean: 2 C phi_2(A T) P C^T;  within: -2 C A T phi_3(A T) P C^T;  phi_k(z) = sum of z^j / (j + k)!
    """
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


# Poles beside 0 whose bound of rounding exceeds this share of them may decay or not.
UNRESOLVED = 1e-6
GAUSS = 16  # points of Gauss' rule on a panel
# Damping ratio up to which a mode counts as undamped: its panels are next to those as narrow as rounding, left out.
NARROWEST = 10.0 * UNDAMPED
BATCH = 512  # frequencies at a time
BEYOND = 8.0  # times the highest pole or break-point: from there to infinity over 1/f
# Panels of unknown functions are halved so often at most, until both halves agree to this share of the sum.
HALVINGS, AGREE = 24, 1e-12
TAIL = 4  # panels over 1/f
MOST = 4096  # panels of unknown functions
FINER = 16  # panels in place of one for gradients of unknown functions


class Integral(NamedTuple):
    """Integrals (...) of the parts, and the largest ``error`` as a share of the largest of them."""

    value: Array
    error: float


@dataclass(frozen=True, eq=False)
class Rule:
    """Panels over a band: their ``ends`` (panels + 1,) [Hz] and, beyond the last, those over the inverse frequency.

    ``unknown``: whether the integrand has features that the poles do not tell.
    """

    ends: Array
    tail: Array
    unknown: bool

    def integral(self, of: Integrand, marks: bool = False) -> Integral:
        """Return the integral of a function of frequencies (n,) [Hz] with values (..., n).

        ``marks``: return those of each panel of ``ends`` in the last axis in place of their sum.
        """
        inside = _integrated(of, self.ends, self.unknown)
        if marks:
            return inside
        total, error = inside.value.sum(axis=-1), inside.error
        if len(self.tail):
            beyond = _integrated(lambda t: of(1.0 / t) / t**2, self.tail, self.unknown)
            total = total + beyond.value.sum(axis=-1)
            error += beyond.error
        largest = float(np.abs(total).max(initial=0.0))
        return Integral(total, error / largest if largest else 0.0)

    def nodes(self) -> tuple[Array, Array]:
        """Return frequencies and weights (n,) [Hz] of the integral, in finer panels where the integrand is unknown."""
        pieces = FINER if self.unknown else 1
        f, weight = _nodes(_split(self.ends, pieces))
        if not len(self.tail):
            return f, weight
        t, share = _nodes(_split(self.tail, pieces))
        return np.concatenate((f, 1.0 / t)), np.concatenate((weight, share / t**2))


def rule(
    poles: Complex, breaks: Array, span: tuple[float, float], unknown: bool, longest: float = np.inf,
    period: float = np.inf,
) -> Rule:  # fmt: skip
    """Return panels over the ``span`` [Hz], the end of which may be infinite.

    ``poles`` [1/s]: those of the responses and filters; ``breaks`` [Hz]: where panels are to end; ``longest``,
    ``period``: as of ``extrema.panels``.
    """
    low, high = span
    turns = poles / (2.0 * np.pi)
    known = np.concatenate((breaks, np.abs(turns)))
    last, tail = high, np.zeros(0)
    if high == np.inf:
        last = max(BEYOND * float(known.max(initial=1.0)), 2.0 * low)
        tail = np.linspace(0.0, 1.0 / last, TAIL + 1)
    if unknown or len(breaks):
        turns = np.append(turns, 0.0)  # tables are powers of the frequency
    return Rule(panels(turns, low, last, known, longest, period), tail, unknown)


def _integrated(of: Integrand, ends: Array, unknown: bool) -> Integral:
    """The integral over each panel (..., panels), and a bound of the largest error of their sum."""
    start, end = ends[:-1], ends[1:]
    whole = _by_gauss(of, start, end)
    if not unknown:
        return Integral(whole, 0.0)
    owner, total, error = np.arange(len(start)), np.zeros_like(whole), np.zeros(whole.shape[:-1])
    for level in range(HALVINGS):
        middle = 0.5 * (start + end)
        left, right = _by_gauss(of, start, middle), _by_gauss(of, middle, end)
        apart = np.abs(left + right - whole)
        size = np.abs(total).sum(axis=-1) + np.abs(whole).sum(axis=-1)
        far = (apart > AGREE * size[..., None]).reshape(-1, len(start)).any(axis=0)
        if level == HALVINGS - 1 or 2 * far.sum() > MOST:
            far[:] = False
        for k in np.flatnonzero(~far).tolist():
            total[..., owner[k]] += left[..., k] + right[..., k]
        error += apart[..., ~far].sum(axis=-1)
        if not far.any():
            break
        start, end = np.concatenate((start[far], middle[far])), np.concatenate((middle[far], end[far]))
        whole, owner = np.concatenate((left[..., far], right[..., far]), axis=-1), np.tile(owner[far], 2)
    return Integral(total, float(error.max(initial=0.0)))


def _by_gauss(of: Integrand, start: Array, end: Array) -> Array:
    """Gauss' rule on panels, (..., panels); 0 between ends that differ by rounding, such as two undamped poles."""
    wide = np.flatnonzero(end - start > UNDAMPED * end)
    f, weight = _gauss(start[wide], end[wide])
    values = np.concatenate([of(f[at : at + BATCH]) for at in range(0, max(len(f), 1), BATCH)], axis=-1)
    result = np.zeros((*values.shape[:-1], len(start)))
    result[..., wide] = (values * weight).reshape(*values.shape[:-1], len(wide), GAUSS).sum(axis=-1)
    return result


def _gauss(start: Array, end: Array) -> tuple[Array, Array]:
    """Nodes and weights (panels GAUSS,) of Gauss' rule on panels."""
    node, weight = np.polynomial.legendre.leggauss(GAUSS)
    half = 0.5 * (end - start)[:, None]
    return (0.5 * (start + end)[:, None] + half * node).reshape(-1), (half * weight).reshape(-1)


def _nodes(ends: Array) -> tuple[Array, Array]:
    return _gauss(ends[:-1], ends[1:])


def _split(ends: Array, pieces: int) -> Array:
    """The ends of panels in equal pieces."""
    share = np.arange(pieces) / pieces
    return np.append((ends[:-1, None] + np.diff(ends)[:, None] * share).reshape(-1), ends[-1])
