"""Time response: exact for inputs that are constant or linear between samples, for any step.

Every mode is advanced from sample to sample by its closed-form solution (``modal_steps``), so that a step costs work in
proportion to the number of modes. Equal steps are computed in many parallel segments: first all segments from rest, one
sample after the other, then the contributions of their initial states. If eigenvectors of coupled damping are nearly
dependent, the exponential of the full state matrix is used instead of the modes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.common.arrays import Array
from mbsvib.common.expected import ascending, one_of, reals
from mbsvib.equations.equations import Equations
from mbsvib.errors import ResponseError
from mbsvib.linalg.discrete import first_order_hold
from mbsvib.linalg.rank import EPS
from mbsvib.modes.damped import Damped
from mbsvib.modes.general import General
from mbsvib.responses.basis import Basis
from mbsvib.responses.modal_steps import Exponentials, Oscillators
from mbsvib.responses.modal_sum import half_spectrum

CHUNK = 4096  # samples whose states are held in memory at a time
SEGMENTS = 64  # of one chunk, side by side
STEPS_AT_ONCE = 256  # uneven steps whose closed forms are computed at a time


@dataclass(frozen=True, slots=True)
class Block:
    """States of one kind: ``motion`` advances them; ``force`` (k, inputs) are the inputs, ``show`` (outputs, states, k)
    the contributions to the outputs, of which the real part is taken; ``state`` (states, k) is the initial state.
    """

    motion: Oscillators | Exponentials
    force: Any
    show: Any
    state: Any


def run(block: Block, time: Array, u: Array, first: bool) -> Array:
    """Return the outputs of one block of states, (outputs, n)."""
    outputs = len(block.show)
    y = np.empty((outputs, len(time)))
    y[:, 0] = np.tensordot(block.show, block.state, axes=2).real
    steps, even = _steps(time)
    n = len(steps)
    march = _even_steps(block, steps[0]) if even and n > 1 else _uneven_steps(block, steps)
    state = block.state
    for start in range(0, n, CHUNK):
        stop = min(n, start + CHUNK)
        samples, change = u[:, start:stop], np.diff(u[:, start : stop + 1]) if first else None
        y[:, start + 1 : stop + 1], state = march(state, samples, change, start)
    return y


def _steps(time: Array) -> tuple[Array, bool]:
    """Lengths of the steps, and whether all are equal: those that are up to the rounding of times are made so."""
    steps = np.diff(time)
    even = (time[-1] - time[0]) / max(1, len(steps))
    equal = np.abs(time - (time[0] + even * np.arange(len(time)))).max() <= 4.0 * EPS * np.abs(time[[0, -1]]).max()
    return np.full_like(steps, even) if equal else steps, bool(equal)


def _even_steps(block: Block, h: float) -> Callable[[Any, Array, Array | None, int], tuple[Array, Any]]:
    """Return the function that advances a state through a chunk of even steps and computes the outputs."""
    transition, constant, ramp = block.motion.step(np.array([h]))
    hold, grow = constant * block.force, ramp * block.force
    powers: dict[int, Any] = {}

    def march(state: Any, u: Array, change: Array | None, _: int) -> tuple[Array, Any]:
        n = u.shape[1]
        length = -(-n // SEGMENTS)
        count = -(-n // length)
        if length not in powers:
            powers[length] = block.motion.step(h * np.arange(1.0, length + 1.0))[0]
        x = _forced(hold, u, length, count)
        if change is not None:
            x += _forced(grow, change, length, count)
        for j in range(1, length):  # all segments from rest
            x[j] += np.einsum("abk,bkp->akp", transition[..., 0], x[j - 1])
        starts = np.empty((*state.shape, count), dtype=x.dtype)
        for p in range(count):
            starts[..., p] = state
            state = np.einsum("abk,bk->ak", powers[length][..., -1], state) + x[-1, :, :, p]
        for j in range(length):
            x[j] += np.einsum("abk,bkp->akp", powers[length][..., j], starts)
        states, modes = x.shape[1:3]
        y = block.show.reshape(len(block.show), states * modes) @ x.reshape(length, states * modes, count)
        last = n - 1 - (count - 1) * length
        return y.real.transpose(1, 2, 0).reshape(len(y[0]), length * count)[:, :n], x[last, :, :, -1]

    return march


def _forced(gain: Any, u: Array, length: int, count: int) -> Any:
    """Contributions of the inputs to the states at each sample, (length, states, k, count), for parallel segments."""
    padded = np.zeros((len(u), length * count))
    padded[:, : u.shape[1]] = u
    parts = padded.reshape(len(u), count, length).transpose(2, 0, 1)
    return np.matmul(gain, parts[:, None])


def _uneven_steps(block: Block, steps: Array) -> Callable[[Any, Array, Array | None, int], tuple[Array, Any]]:
    """Return the function that advances a state through a chunk of steps of any length and computes the outputs."""

    def march(state: Any, u: Array, change: Array | None, start: int) -> tuple[Array, Any]:
        force = block.force @ u
        growth = None if change is None else block.force @ change
        x = np.empty((*state.shape, u.shape[1]), dtype=np.result_type(state, force))
        for k in range(u.shape[1]):
            at = k % STEPS_AT_ONCE
            if at == 0:
                lengths, which = np.unique(steps[start + k :][:STEPS_AT_ONCE], return_inverse=True)
                transition, constant, ramp = block.motion.step(lengths)
            i = which[at]
            state = np.einsum("abk,bk->ak", transition[..., i], state) + constant[..., i] * force[:, k]
            if growth is not None:
                state += ramp[..., i] * growth[:, k]
            x[..., k] = state
        return np.tensordot(block.show, x, axes=2).real, state

    return march


def stepped(a: Array, b: Array, start: Array, record: tuple[Array, Array, bool]) -> Array:
    """Return the states of x' = a x + b u at all samples, (n, len(time)), by exponentials."""
    time, u, first = record
    x = np.empty((len(a), len(time)))
    x[:, 0] = start
    steps: dict[float, tuple[Array, Array, Array]] = {}
    for i, h in enumerate(_steps(time)[0].tolist()):
        if h not in steps:
            steps[h] = first_order_hold(a, b, h)
        transition, constant, ramp = steps[h]
        x[:, i + 1] = transition @ x[:, i] + constant @ u[:, i]
        if first:
            x[:, i + 1] += ramp @ (u[:, i + 1] - u[:, i])
    return x


HOLDS = ("zero", "first")
# With strong dampers a sum over modes is more accurate than the exponential up to this condition number of eigenvalues.
DEPENDENT = 1e3
NEAR_POLE = 1.001  # factor of the poles' frequencies at which sums over modes are checked: at a pole they are infinite


def time_response(
    basis: Basis, t: ArrayLike, u: ArrayLike, hold: str = "first",
    initial: tuple[ArrayLike, ArrayLike] | None = None,
) -> Array:  # fmt: skip
    """Return the outputs (outputs, n) at the times ``t`` (n,) [s].

    x(t + h) = exp(A h) x(t) + integral over the step of exp(A (h - s)) B u(t + s) ds

    ``u`` (inputs, n): linear between samples, or held if ``hold`` is "zero". ``initial``: q and q' at t[0]; default:
    rest.
    """
    system, modal, first = basis.equations, basis.modal, hold == "first"
    time, inputs, state = checked_question(system, t, u, hold, initial)
    if not isinstance(modal, Damped):
        return _general(system, modal, (time, inputs, state, first))
    start = modal.shapes.T @ (system.M @ state.T) if system.dof else np.zeros((0, 2))
    b = modal.shapes.T @ system.B
    rates = tuple(c @ modal.shapes for c in (system.Cq, system.Cv, system.Ca))
    if modal.vectors is None:
        blocks = [_oscillators(modal.square, modal.gamma, b, rates, start)]
    elif _independent(basis, modal):
        blocks = _complex(modal, b, rates, start)
    else:
        return _by_exponential(system, modal, (time, inputs, start, first))
    y: Array = (system.D + rates[2] @ b) @ inputs
    for block in blocks:
        if block.show.shape[2]:
            y += run(block, time, inputs, first)
    return y


def _independent(basis: Basis, modal: Damped) -> bool:
    """Tell whether eigenvectors are accurate enough for any initial states and inputs."""
    from mbsvib.responses.frequency_response import conditions, trusted

    if basis.strong_dampers is not None:  # a residual with Gamma would show its rounding, not that of the modes
        return bool((conditions(modal) <= DEPENDENT).all())
    return trusted(modal, np.eye(len(modal.square)), np.sort(np.abs(modal.pairs).reshape(-1)))


def _oscillators(square: Array, gamma: Array, b: Array, rates: tuple[Array, ...], start: Array) -> Block:
    cq, cv, ca = rates
    show = np.stack((cq - ca * square, cv - ca * gamma), axis=1)
    return Block(Oscillators(square, gamma), b, show, start.T)


def _complex(modal: Damped, b: Array, rates: tuple[Array, ...], start: Array) -> list[Block]:
    """One state for each conjugate pair and for each real eigenvalue, two for each free rigid-body mode."""
    value, y, slope, _, vectors = half_spectrum(modal)
    left, twice = y.T / slope[:, None], 1.0 + (value.imag != 0.0)
    cq, cv, ca = (c @ y * twice for c in rates)
    matrices = np.eye(len(start)), modal.gamma, np.diag(modal.square)
    state = _amplitudes(value, left, matrices, start.T)[None]
    none = np.zeros(vectors.shape[1])
    rigid = _oscillators(none, none, vectors.T @ b, tuple(c @ vectors for c in rates), vectors.T @ start)
    return [Block(Exponentials(value), left @ b, (cq + value * (cv + value * ca))[:, None], state), rigid]


def _amplitudes(value: Any, left: Any, matrices: tuple[Array, Array, Array], initial: Array) -> Any:
    """Share of each eigenvalue in q and q' (2, m): y^T ((lambda M + C) q + M q') for rows y (k, m) of unit slope.

    y^T (lambda M + C) q equals -y^T K q / lambda. The sum with smaller terms is taken: large spin or damping cancels in
    the first, and a stiff spring that a slow motion hardly strains in the second.
    """
    (inertia, damping, stiffness), (q, v) = matrices, initial

    def sums(y: Any, size: Any, inertia: Array, damping: Array, stiffness: Array, q: Array) -> tuple[Any, Any]:
        fast = size * (y @ (inertia @ q)) + y @ (damping @ q)
        return fast, np.divide(y @ (stiffness @ q), size, out=np.full_like(fast, np.inf), where=size != 0.0)

    first, second = sums(left, value, inertia, damping, stiffness, q)
    large, small = sums(np.abs(left), np.abs(value), *map(np.abs, (inertia, damping, stiffness, q)))
    return left @ (inertia @ v) + np.where(large <= small, first, -second)


def _by_exponential(system: Equations, modal: Damped, record: tuple[Array, Array, Array, bool]) -> Array:
    """Outputs by the exponential of the full state matrix; the step matrices of each length are computed once."""
    from mbsvib.responses.energy_schur import energy_matrix

    time, u, start, first = record
    m = len(modal.square)
    scale, a = energy_matrix(modal)
    b = np.concatenate((np.zeros((m, len(u))), modal.shapes.T @ system.B))
    x = stepped(a, b, np.concatenate((scale * start[:, 0], start[:, 1])), (time, u, first))
    eta, rate = x[:m] / scale[:, None], x[m:]
    y = system.Cq @ (modal.shapes @ eta) + system.Cv @ (modal.shapes @ rate) + system.D @ u
    if system.Ca.any():
        acceleration = modal.shapes.T @ (system.B @ u) - modal.square[:, None] * eta - modal.gamma @ rate
        y += system.Ca @ (modal.shapes @ acceleration)
    return y


def _general(system: Equations, modal: General, record: tuple[Array, Array, Array, bool]) -> Array:
    """Outputs of a system without symmetry."""
    from mbsvib.responses import general_responses as responses

    time, u, initial, first = record
    state = modal.state
    equations = responses.realization(system, state)
    start = state.position @ initial[0] + state.rate @ initial[1]
    speeds = np.sort(np.abs(modal.spectrum.values))
    if not responses.trusted(modal, np.eye(len(state.basis)), NEAR_POLE * speeds):
        return equations.c @ stepped(equations.a, equations.b, start, (time, u, first)) + equations.d @ u
    y: Array = equations.d @ u
    for block in _general_blocks(system, modal, (initial, start)):
        if block.show.shape[2]:
            y += run(block, time, u, first)
    return y


def _general_blocks(system: Equations, modal: General, initial: tuple[Array, Array]) -> list[Block]:
    """One state for each nonzero eigenvalue, conjugates together; for 0 the motions at rest and those that drift."""
    spectrum, state = modal.spectrum, modal.state
    value, x = spectrum.values, spectrum.right * np.where(spectrum.turns, 2.0, 1.0)
    left = spectrum.left.T / spectrum.slopes[:, None]
    begin = _amplitudes(value, left, (system.M, system.C, system.K), initial[0])
    show = system.Cq @ x + value * (system.Cv @ x + value * (system.Ca @ x))
    blocks = [Block(Exponentials(value), left @ system.B, show[:, None], begin[None])]
    if state.right.shape[1]:
        rates = [c @ state.show for c in (system.Cq, system.Cv, system.Ca)]
        stands, moves = rates[0] @ state.right, rates[1] @ state.right
        driven, momentum = state.left.T @ (state.force @ system.B), state.left.T @ initial[1]
        j, none = state.nilpotent, np.zeros(len(momentum))
        blocks.append(Block(Exponentials(none.astype(complex)), driven, (stands + moves @ j)[:, None], momentum[None]))
        # drift: J acts once, as for a free mass
        begin = np.stack((none, j @ momentum))
        blocks.append(Block(Oscillators(none, none), j @ driven, np.stack((stands, moves * 0.0), axis=1), begin))
    return blocks


def checked_record(names: Sequence[str], t: ArrayLike, u: ArrayLike, hold: str) -> tuple[Array, Array]:
    """Return times (n,) and inputs (inputs, n) of a time response, checked; ``names`` are those of the inputs."""
    one_of(hold, HOLDS, "time_response", "hold")
    time = ascending(t, "time_response", "t", "a vector of times [s], each later than the one before")
    inputs = _numbers("u", u, "inputs")
    if inputs.ndim == 1 and len(names) == 1:
        inputs = inputs[None, :]
    if inputs.shape != (len(names), len(time)) or not np.isfinite(inputs).all():
        raise ResponseError(
            f"time_response: u has shape {np.shape(u)}; expected finite values of shape ({len(names)}, "
            f"{len(time)}), one row for each of the inputs {', '.join(names) or '(none)'}."
        )
    return time, inputs


def checked_question(
    system: Equations, t: ArrayLike, u: ArrayLike, hold: str, initial: tuple[ArrayLike, ArrayLike] | None
) -> tuple[Array, Array, Array]:
    """Return times (n,), inputs (inputs, n) and the initial state of a time response, checked."""
    time, inputs = checked_record(system.inputs, t, u, hold)
    state = np.zeros((2, system.dof)) if initial is None else _numbers("initial", initial, "q and q'")
    if state.shape != (2, system.dof) or not np.isfinite(state).all():
        raise ResponseError(f"time_response: initial has shape {state.shape}; expected q and q', {system.dof} finite "
                            f"values each.")  # fmt: skip
    return time, inputs, state


def _numbers(name: str, value: Any, entries: str) -> Array:
    return reals(value, "time_response", name, f"an array of {entries}")
