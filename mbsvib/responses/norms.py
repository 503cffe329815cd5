"""Norms of linear equations by their responses: H2, the rms under white noise, and Hinf, the highest peak."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.common.arrays import Array, Complex
from mbsvib.common.columnar import Columnar
from mbsvib.common.display import Displayed
from mbsvib.errors import ResponseError
from mbsvib.linalg.lasting import Part, Separation, separated
from mbsvib.linalg.lyapunov import Lyapunov
from mbsvib.linalg.rank import EPS, ZERO_SUM
from mbsvib.linalg.spectrum import spectrum
from mbsvib.responses.extrema import Band, panels

# The response has its peaks below this times the fastest pole, and is D from there; heights that differ by less are
# the same.
LAST, ROUNDING = 1e3, 1e-9
LISTED = 4  # poles in a message
# A mean square is refused if the correction of it that rounding kept from being made is larger than this share.
UNSETTLED = 1e-3
# Mean squares of two methods that differ by less than this share are the same. Where they differ by more, those by
# poles count if the bound of their rounding is below the second number.
AGREED, TOLD = 1e-9, 1e-4
# Sums of products lose so much of their terms, and what is below this share of such a loss is rounding of zeros.
ROUNDED, NOTHING = 16.0 * EPS, 1e-5


class _Slopes:
    """A field that holds an array, or a function that returns it when it is first asked for."""

    def __get__(self, norm: Any, kind: type | None = None) -> Array:
        if norm is None:
            return ()  # type: ignore[return-value]  # the default, which __set__ makes an array
        held: Array | Callable[[], Array] = norm.__dict__["slopes"]
        if callable(held):
            held = norm.__dict__["slopes"] = held()
        return held

    def __set__(self, norm: Any, value: Array | Callable[[], Array]) -> None:
        norm.__dict__["slopes"] = value if callable(value) else np.asarray(value)


class RoundingError(ResponseError):
    """A mean square or norm of which rounding leaves a digit open in these states."""


@dataclass(frozen=True, repr=False)
class Norm(Columnar, Displayed):
    """A norm's ``value`` and its derivatives ``slopes`` (v,) to ``variables`` (v,); ``omega`` [rad/s] is the frequency
    of the peak, inf where the response only tends to it, None for the H2 norm.

    Slopes to all parameters, which nobody named, are computed when they are first asked for.
    """

    value: float
    variables: tuple[str, ...] = ()
    slopes: _Slopes = _Slopes()
    omega: float | None = None

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "slopes": self.slopes}

    def columns(self) -> dict[str, Any]:
        """Return the norm, in one row or one for each variable, as columns by name.

        Returns
        -------
        dict of str to array, shape (variables or 1,)
            ``parameter`` and ``slope``, if there are variables; ``value``; ``frequency_hz`` of a peak.
        """
        rows = max(len(self.variables), 1)
        result = {"parameter": np.array(self.variables), "slope": self.slopes} if self.variables else {}
        result["value"] = np.full(rows, self.value)
        return result if self.omega is None else {**result, "frequency_hz": np.full(rows, self.omega / (2.0 * np.pi))}


def pole_words(pole: complex) -> str:
    """Return a pole [1/s] in words, without a real part that is rounding."""
    real = 0.0 if abs(pole.real) <= ZERO_SUM * abs(pole.imag) else pole.real
    text = f"{complex(real, pole.imag):.6g}" if pole.imag else f"{real:.6g}"
    return f"the pole {text} 1/s" + (f" ({abs(pole) / (2.0 * np.pi):.4g} Hz)" if pole.imag else "")


def growth(linear: Any) -> str:
    """Return the pole of a system, loop or state space that grows fastest in words, "" where none grows."""
    modes = linear.modes()
    poles = modes.pairs[modes.growing].reshape(-1)
    return pole_words(complex(poles[np.argmax(poles.real)])) if len(poles) else ""


def decaying_part(space: Any, question: str, answer: str) -> Separation:
    """Return a state space in parts, of which no response contains poles that do not decay.

    Others are refused, as are poles that grow. ``question``, ``answer``: what is asked for, and why there is none.
    """
    parts = separated(space.A, space.B, space.C)
    shown = [group for group in parts.lasting if group.shown.any()]
    if shown:
        o, i = (int(k) for k in np.argwhere(shown[0].shown)[0])
        words = [f"{pole_words(group.pole)}{_origin(space, group)}" for group in shown[:LISTED]]
        more = f" and {len(shown) - LISTED} more" if len(shown) > LISTED else ""
        which = f"the poles {'; '.join(word.removeprefix('the pole ') for word in words)}{more} do not decay and " \
            f"appear" if len(words) > 1 else f"{words[0]} does not decay and appears"
        raise ResponseError(f"{question}: {which} in the response of '{space.outputs[o]}' to '{space.inputs[i]}', so "
                            f"that {answer}. Give {'them' if len(words) > 1 else 'it'} damping, change the controller, "
                            f"or choose other outputs or inputs.")  # fmt: skip
    for group in parts.lasting:
        pole, errors = group.pole, group.part.errors[0]
        if (group.part.poles.real > errors).any():
            raise ResponseError(f"{question}: {pole_words(pole)} grows, although no output shows what inputs do to it. "
                                f"Change the controller, or leave these states out.")  # fmt: skip
    return parts


def _origin(space: Any, group: Any) -> str:
    """The mode of a group of poles in words, where it is known."""
    names = {space.states[k].rstrip("'") for k in np.flatnonzero(group.part.right.any(axis=1))}
    mode = names.pop() if space.realization == "modal" and len(names) == 1 else ""
    return f" of mode {mode[4:]}" if mode.startswith("mode") else ""


def h2(space: Any) -> Norm:
    """Return the H2 norm of a state space.

    ||G||^2 = tr(C P C^T),  A P + P A^T + B B^T = 0

    Poles that do not decay are left out if the outputs do not show what the inputs do to them.
    """
    d = space.D
    if d.any():
        o, i = np.unravel_index(int(np.abs(d).argmax()), d.shape)
        raise ResponseError(f"H2 norm of '{space.name}': input '{space.inputs[i]}' acts directly on output "
                            f"'{space.outputs[o]}', so that the norm is infinite. Choose displacements or velocities: "
                            f"outputs=[...].")  # fmt: skip
    question = f"H2 norm of '{space.name}'"
    part = decaying_part(space, question, "the norm is infinite").decaying
    forms = solved_forms(part.c, Lyapunov(part.a).controlled_within(part.b @ part.b.T), part.c)
    square, missing, terms = (values.sum().reshape(1, 1) for values in forms)
    pairs = [values.sum().reshape(1, 1) for values in by_poles(part, part.c)]
    square = more_accurate(question, part, square, (missing, terms), pairs, "Ask for the rms in a band")
    return Norm(float(np.sqrt(np.maximum(square, 0.0))[0, 0]))


def by_poles(part: Part, left: Array) -> tuple[Array, Array]:
    """Return the diagonal of left P C^T for each input alone, (outputs, inputs), as sums over pairs of poles, and
    bounds of their rounding, infinite where none is known.

    Slow poles beside fast ones keep their digits, which Lyapunov's equation rounds against its largest entries.
    """
    of_a = spectrum(part.a)
    unit, poles = np.ldexp(1.0, of_a.power), of_a.values
    right, inverse = unit[:, None] * of_a.right, of_a.left.conj().T / unit
    product = inverse @ right
    size = product.diagonal()
    result = np.zeros((2, len(part.c), part.b.shape[1]))
    if not size.all() or not of_a.decaying.all():
        result[1] = np.inf
        return result[0], result[1]
    apart = float(np.abs(product / size[:, None] - np.eye(len(size))).max(initial=0.0))
    pairs = poles[:, None] + poles.conj()
    doubts = ((of_a.errors[:, None] + of_a.errors) / np.abs(pairs) + apart) / np.abs(pairs)
    shown, seen, driven = left @ right, part.c @ right, inverse @ part.b / size[:, None]
    for k, column in enumerate(driven.T):
        first, second = shown * column, seen * column
        result[0, :, k] = ((first @ (-1.0 / pairs)) * second.conj()).sum(axis=1).real
        result[1, :, k] = ((np.abs(first) @ doubts) * np.abs(second)).sum(axis=1)
    return result[0], result[1]


def more_accurate(
    question: str, part: Part, squares: Array, doubts: tuple[Array, Array], pairs: Sequence[Array], instead: str
) -> Array:  # fmt: skip
    """Return mean squares, those by poles where the others differ from them by more than their rounding, and refuse
    those of which rounding leaves a digit open.

    ``pairs``: what ``by_poles`` returns. Others: as of ``check_rounding``.
    """
    other, error = pairs
    apart = np.where(np.isfinite(squares) & (error <= UNSETTLED * other), np.abs(other - squares), 0.0)
    better = (error <= TOLD * other) & (apart > np.maximum(error, AGREED * other))
    squares = np.where(better, other, squares)
    missing, terms = (np.where(better, 0.0, values) for values in (np.maximum(np.abs(doubts[0]), apart), doubts[1]))
    check_rounding(question, part, squares, (missing, terms), instead)
    return squares


def form(left: Array, matrix: Array, right: Array) -> Array:
    """Return the diagonal of left P right^T."""
    return np.asarray((left @ matrix * right).sum(axis=1))


def solved_forms(left: Array, solved: tuple[Array, Array], right: Array) -> tuple[Array, Array, Array]:
    """Return the diagonal of left P right^T, that of the correction of P that is missing, and the sizes of the terms.
    """
    matrix, missing = solved
    return form(left, matrix, right), form(left, missing, right), form(np.abs(left), np.abs(matrix), np.abs(right))


def check_rounding(
    question: str, part: Part, squares: Array, doubts: tuple[Array, Array], instead: str
) -> None:  # fmt: skip
    """Refuse mean squares (outputs, sources), or their sum, of which rounding leaves a digit open.

    ``doubts``: corrections that rounding kept from being made, and sizes of the terms that were added; where these
    cancel, responses of the ``part`` tell what is 0. ``question``: what is asked for; ``instead``: what to ask for in
    place of it.
    """
    missing, terms = np.abs(doubts[0]), doubts[1]
    allowed = UNSETTLED * np.abs(squares)
    unsettled = np.isfinite(squares) & (missing > allowed) & (missing > ZERO_SUM * terms)
    rounding = ROUNDED * terms
    cancelled = np.isfinite(squares) & (rounding > allowed)
    if cancelled.any():
        unsettled |= cancelled & (_sizes(part, squares.shape) > NOTHING * rounding)
    if unsettled.any():
        rates = np.abs(part.poles.real)
        raise RoundingError(f"{question}: motions decay at rates of {rates.min():.2g} to {rates.max():.2g} 1/s, which "
                            f"rounding cannot tell apart in these states. {instead}, or leave out what decays that "
                            f"fast.")  # fmt: skip


def _sizes(part: Part, shape: tuple[int, ...]) -> Array:
    """About how large mean squares (outputs, sources) are, or their sum: |G|^2 w is what a pole of speed w adds."""
    result, unit = np.zeros((len(part.c), part.b.shape[1])), np.eye(len(part.a))
    for speed in np.unique(np.abs(part.poles)).tolist():
        g = part.c @ np.linalg.solve(1j * speed * unit - part.a, part.b)
        result = np.maximum(result, speed * np.abs(g) ** 2)
    return result if result.shape == shape else np.full(shape, result.sum())


def hinf(
    response: Callable[[Array], Complex], poles: Complex, direct: Array | Complex, marks: ArrayLike = (),
    span: tuple[float, float] = (0.0, np.inf),
) -> Norm:  # fmt: skip
    """Return the highest peak of a frequency response: max over w of sigma(G(i w)).

    ``response`` takes w (n,) [rad/s] and returns G (outputs, inputs, n); all ``poles`` have negative real parts;
    ``direct``: D, the response at infinite frequency; ``marks``: frequencies at which it is not smooth; ``span``: first
    and last frequency. The frequency is inf where the response only tends to its largest value.
    """
    if not direct.size:
        return Norm(0.0, omega=0.0)
    fastest = float(np.abs(poles).max(initial=0.0)) or 1.0
    band = Band(lambda w: response(w).transpose(2, 0, 1), panels(poles, span[0], min(span[1], LAST * fastest), marks))
    omega, value = band.highest(lambda g: np.asarray(np.linalg.svd(g, compute_uv=False)[:, 0]))
    far = float(np.linalg.svd(direct, compute_uv=False)[0]) if span[1] == np.inf else 0.0
    return Norm(far, omega=np.inf) if far > value * (1.0 + ROUNDING) else Norm(value, omega=omega)
