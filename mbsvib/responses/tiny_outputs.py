"""Outputs that see next to nothing of what moves: where a sum over modes cannot tell them, the equations do.

Modes are right to rounding of the largest amplitudes. An output that sees 1e-12 of these (the slip of a joint that a
strong damper locks, the force that is left in a soft spring far below resonance) has four digits then. A bound of that
rounding, looked at in a few frequencies, tells which entries are in doubt. Most of them are zeros, by symmetry say,
which rounding of the model's own numbers fills: with forward and adjoint motions x and z an error of eps in every
number changes a response by no more than

    eps (sum over rows of |k + i w c| (|D z| |D||x| + |D||z| |D x|), of w^2 likewise with W, + |C||x| + |B||z|).

Those that stand out of that are computed again from the equations (``refined``).
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.errors import AccuracyWarning
from mbsvib.responses.refined import Factors, Refined, refined

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from mbsvib.modes.damped import Damped
    from mbsvib.system import System

    Array = NDArray[np.float64]
    Complex = NDArray[np.complex128]
    Bools = NDArray[np.bool_]
    Solver = Callable[[Array], Callable[[Complex], Complex]]

EPS = float(np.finfo(float).eps)
# Rounding of a sum over modes in parts of its terms' size.
ROUNDING = 16.0
# Responses stand out from what an error of this many eps in every number of the model changes, or are zero.
LEFT = 64.0
# Entries whose bound exceeds this part of themselves are computed again.
DIGITS = 1e-8
# Zeros move with every correction by more than this part of themselves.
RESTLESS = 1e-3
PROBES, CLOSER = 8, 4
# Arrays of this size stay in the cache.
BATCH_BYTES = 2**19


def mended(system: System, modal: Damped, w: Array, found: tuple[Complex, bool], solver: Solver) -> Complex:
    """Return the responses with those that a sum over modes leaves in doubt from the equations themselves.

    Parameters
    ----------
    system : System
        The equations of motion.
    modal : Damped
        Its modes.
    w : array, shape (n,)
        Angular frequencies [rad/s], none negative.
    found : pair
        Responses (outputs, inputs, n), and whether they are sums over modes.
    solver : callable
        Of some frequencies (k,): what solves the equations in the basis there for loads (m, inputs, k).

    Returns
    -------
    array, shape (outputs, inputs, n)
        Transfer functions.
    """
    value, summed = found
    if not value.size or not system.dof:
        return value
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        entries = _entries(system, modal, w, found, solver)
        if not entries.any():
            return value
        limit = noise(system, modal, w, summed)
        doubt = (limit > DIGITS * np.abs(value)) & entries[:, :, None]
        result, failed = value.copy(), np.zeros_like(doubt)
        at = np.flatnonzero(doubt.any(axis=(0, 1)))
        batch = max(1, BATCH_BYTES // (16 * len(system.elastic_rows) * len(system.inputs)))
        for start in range(0, len(at), batch):
            part = at[start : start + batch]
            columns = np.flatnonzero(doubt[:, :, part].any(axis=(0, 2)))
            place = np.ix_(np.arange(len(value)), columns, part)
            new = _forward(system, modal, w[part], solver, columns)
            better = new.change + EPS * new.size <= limit[place]
            result[place] = np.where(doubt[place] & better, new.value, value[place])
            failed[place] = doubt[place] & ~(new.change <= limit[place])
    result.imag[:, :, w == 0.0] = 0.0
    _warn(system, w, failed)
    return result


def noise(system: System, modal: Damped, w: Array, summed: bool) -> Array:
    """Return a bound of what rounding does to responses, up to a factor of some units.

    Parameters
    ----------
    system : System
        The equations of motion.
    modal : Damped
        Its modes.
    w : array, shape (n,)
        Angular frequencies [rad/s], none negative.
    summed : bool
        Whether responses are sums over modes, which know what cancels above a mode; else they are solutions.

    Returns
    -------
    array, shape (outputs, inputs, n)
        In the outputs' units.
    """
    b = modal.shapes.T @ system.B
    beta = np.linalg.norm(b, axis=0)
    terms = _Terms.of(modal, w)
    right = np.abs(b if terms.vectors is None else terms.vectors.T @ b)
    gain = terms.gain * terms.fade if summed else terms.gain
    result = np.zeros((len(system.outputs), b.shape[1], len(w)))
    for order, rows in _rows(system):
        used = np.flatnonzero(rows.any(axis=1))
        c = rows[used] @ modal.shapes
        gamma, seen = np.linalg.norm(c, axis=1), np.abs(c if terms.vectors is None else c @ terms.vectors)
        both = gamma[:, None, None] * right.T + seen[:, None, :] * beta[:, None]
        part = (both.reshape(-1, both.shape[2]) @ gain).reshape(*both.shape[:2], -1)
        if summed:
            part += terms.left(both, np.abs(system.D[used]) if order == 2 else None, w)
        result[used] += part * w**order if order else part
    if not summed:
        result += np.abs(system.D)[:, :, None]
    return EPS * ROUNDING * result


@dataclass(frozen=True, slots=True)
class _Terms:
    """Sizes of the terms of a sum over modes: ``gain`` (k, n) is that of 1 / (s - lambda), ``fade`` (k, n) what is left
    of it above the mode once the sums of all R and lambda R are known, which are of the size ``strength`` (k,) over
    w^power; ``vectors`` (m, k) if they are not the basis, ``corner`` (k,) as in ``ModalSum``.
    """

    gain: Array
    fade: Array
    strength: Array
    power: int
    corner: Array
    vectors: Complex | None

    @staticmethod
    def of(modal: Damped, w: Array) -> _Terms:
        if modal.vectors is None or modal.slopes is None:
            root, brake = np.sqrt(np.abs(modal.square))[:, None], np.abs(modal.gamma)[:, None] * w
            square = modal.square[:, None]
            stiff = np.where(square >= 0.0, (root - w) * (root + w), square - w * w)
            corner = np.abs(modal.pairs).max(axis=1)
            fade = np.where(corner[:, None] < w, (np.abs(square) + brake) / (w * w), 1.0)
            return _Terms(1.0 / np.maximum(np.abs(stiff), brake), fade, np.ones(len(root)), 2, corner, None)
        turns, free = modal.pairs[:, 0].imag != 0.0, (modal.pairs == 0.0).all(axis=1)
        first, second = ~free, ~free & ~turns
        value = np.concatenate((modal.pairs[first, 0], modal.pairs[second, 1]))
        size = 2.0 / np.abs(np.concatenate((modal.slopes[first, 0], modal.slopes[second, 1])))
        y = modal.vectors
        vectors: Complex = np.concatenate((y[:, first, 0], y[:, second, 1], y[:, free, 0]), axis=1)
        gain = size[:, None] / np.maximum(np.abs(value.real)[:, None], np.abs(w - value.imag[:, None]))
        rigid = int(np.count_nonzero(free))
        corner = np.concatenate((np.abs(value), np.zeros(rigid)))
        gain = np.concatenate((gain, np.broadcast_to(1.0 / (w * w), (rigid, len(w)))))
        fade = np.minimum(1.0, (corner[:, None] / w) ** 2)
        return _Terms(gain, fade, np.concatenate((size, np.zeros(rigid))), 1, corner, vectors)

    def left(self, both: Array, direct: Array | None, w: Array) -> Array:
        """Rounding of the known sums, (rows, inputs, n): they are added up below w or above it, where less cancels."""
        order = np.argsort(self.corner, kind="stable")
        terms = (both * self.strength)[:, :, order]
        below, above = np.zeros((2, *terms.shape[:2], terms.shape[2] + 1))
        np.cumsum(terms, axis=2, out=below[:, :, 1:])
        above[:, :, :-1] = np.cumsum(terms[:, :, ::-1], axis=2)[:, :, ::-1]
        least = np.minimum(below if direct is None else below + direct[:, :, None], above)
        inverse = np.divide(1.0, w, out=np.zeros_like(w), where=w > 0.0) ** self.power
        return np.asarray(least[:, :, np.searchsorted(self.corner[order], w)] * inverse)


def _entries(system: System, modal: Damped, w: Array, found: tuple[Complex, bool], solver: Solver) -> Bools:
    """Entries (outputs, inputs) that are in doubt at some of the frequencies, and stand out of rounding there."""
    probes = np.unique(np.linspace(0, len(w) - 1, PROBES).astype(int)) if len(w) > PROBES else np.arange(len(w))
    value = np.abs(found[0][:, :, probes])
    doubt = np.asarray(noise(system, modal, w[probes], found[1]) > DIGITS * value)
    if doubt.any():
        at = w[probes]
        doubt[~(value > LEFT * EPS * _least_changes(system, modal, at, solver(at)))] = False
    result: Bools = np.asarray(doubt.any(axis=2))
    if result.any():
        some = np.flatnonzero(doubt.any(axis=(0, 1)))
        at = w[probes[some[np.unique(np.linspace(0, len(some) - 1, CLOSER).astype(int))]]]
        forward, adjoint = _forward(system, modal, at, solver), _adjoint(system, modal, at, solver)
        change = _changes(system, Factors.of(system, at), (forward.motion, adjoint.motion),
                          (np.abs(forward.felt), np.abs(adjoint.felt)))  # fmt: skip
        least = np.maximum(LEFT * EPS * change, np.maximum(forward.change / RESTLESS, forward.floor))
        result &= (np.abs(forward.value) > least).any(axis=2)
    return result


def _rows(system: System) -> list[tuple[int, Array]]:
    return [(order, c) for order, c in enumerate((system.Cq, system.Cv, system.Ca)) if c.any()]


def _adjoint_load(system: System, w: Array) -> Complex:
    """Columns (m, outputs, n) of Cq^T + i w Cv^T - w^2 Ca^T."""
    result: Complex = np.zeros((system.dof, len(system.outputs), len(w)), dtype=complex)
    for order, c in _rows(system):
        result += c.T[:, :, None] * (1j * w) ** order
    return result


def _forward(system: System, modal: Damped, w: Array, solver: Solver, inputs: Any = slice(None)) -> Refined:
    b = system.B[:, inputs]
    load: Complex = np.broadcast_to(b[:, :, None], (*b.shape, len(w))).astype(complex)
    return refined(Factors.of(system, w), modal.shapes, load, (_rows(system), system.D[:, inputs]), solver(w))


def _adjoint(system: System, modal: Damped, w: Array, solver: Solver) -> Refined:
    outputs = [(0, np.ascontiguousarray(system.B.T))], np.zeros(system.D.T.shape)
    return refined(Factors.of(system, w), modal.shapes, _adjoint_load(system, w), outputs, solver(w))


def _least_changes(system: System, modal: Damped, w: Array, solve: Callable[[Complex], Complex]) -> Array:
    """Changes as ordinary solutions show them, forces that may be nothing but rounding left out."""
    b = modal.shapes.T @ system.B
    load = _adjoint_load(system, w)
    right: Complex = (modal.shapes.T @ load.reshape(len(load), -1)).reshape(load.shape)
    both = np.concatenate((np.broadcast_to(b[:, :, None], (*b.shape, len(w))), right), axis=1, dtype=complex)
    motion: Complex = (modal.shapes @ solve(both).reshape(len(both), -1)).reshape(both.shape)
    factors = Factors.of(system, w)
    flat = motion.reshape(len(motion), -1)
    felt = np.abs(factors.rows @ flat) - ROUNDING * EPS * (np.abs(factors.rows) @ np.abs(flat))
    least = np.maximum(felt, 0.0).reshape(len(factors.rows), *motion.shape[1:])
    i = b.shape[1]
    return _changes(system, factors, (motion[:, :i], motion[:, i:]), (least[:, :i], least[:, i:]))


def _changes(system: System, factors: Factors, motions: tuple[Complex, Complex], felt: tuple[Array, Array]) -> Array:
    """Changes of the responses (outputs, inputs, n) by relative changes of one of all numbers of the equations."""
    moved = [np.abs(motion) for motion in motions]
    rows = _sizes(factors.rows)
    near = [(rows @ m.reshape(len(m), -1)).reshape(len(rows), *m.shape[1:]) for m in moved]
    size = factors.size()[:, None]
    first, second = ((size * a).transpose(2, 1, 0) @ b.transpose(2, 0, 1)
                     for a, b in ((felt[1], near[0]), (near[1], felt[0])))  # fmt: skip
    result = (first + second).transpose(1, 2, 0) + np.abs(system.D)[:, :, None]
    for order, c in _rows(system):
        part = _sizes(c) @ moved[0].reshape(len(moved[0]), -1)
        result += part.reshape(result.shape) * factors.w**order
    load = _sizes(system.B.T) @ moved[1].reshape(len(moved[1]), -1)
    return np.asarray(result + load.reshape(len(system.inputs), -1, len(factors.w)).transpose(1, 0, 2))


def _sizes(rows: Array) -> Array:
    """What rounding of entries is relative to: the largest of the row, as 6e-17 may be a zero; zeros are exact."""
    return np.asarray((rows != 0.0) * np.abs(rows).max(axis=1, keepdims=True))


def _warn(system: System, w: Array, failed: Bools) -> None:
    if failed.any():
        i, j, k = (int(v) for v in np.argwhere(failed)[0])
        warnings.warn(
            f"frequency_response of {system.name}: {system.outputs[i]!r} sees so little of what {system.inputs[j]!r} "
            f"moves at {w[k]:g} rad/s that rounding may leave no digit, and corrections from the equations do not "
            f"settle ({np.count_nonzero(failed)} such values in all).", AccuracyWarning, stacklevel=4,
        )  # fmt: skip
