"""Norms of linear equations by their responses: H2, the rms under white noise, and Hinf, the highest peak."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.common.arrays import Array, Complex
from mbsvib.common.columnar import Columnar
from mbsvib.common.display import Displayed
from mbsvib.errors import ResponseError
from mbsvib.linalg.lasting import Separation, separated
from mbsvib.linalg.rank import ZERO_SUM
from mbsvib.responses.extrema import Band, panels

# The response has its peaks below this times the fastest pole, and is D from there; heights that differ by less are
# the same.
LAST, ROUNDING = 1e3, 1e-9
LISTED = 4  # poles in a message


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
    part = decaying_part(space, f"H2 norm of '{space.name}'", "the norm is infinite").decaying
    return Norm(float(np.sqrt(mean_squares(part.a, part.b, part.c, space.name).sum())))


def mean_squares(a: Array, b: Array, c: Array, name: str) -> Array:
    """Return the mean squares (outputs,) of C x with x' = A x + B w under white noise w, the diagonal of C P C^T.

    A P + P A^T + B B^T = 0
    """
    from scipy.linalg import solve_continuous_lyapunov

    if not len(a):
        return np.zeros(len(c))
    covariance = solve_continuous_lyapunov(a, -b @ b.T)
    result = np.sum(c @ covariance * c, axis=1)
    terms = np.sum(np.abs(c) @ np.abs(covariance) * np.abs(c), axis=1)
    if (result < -ZERO_SUM * len(a) * terms).any():
        raise ResponseError(f"mean squares of '{name}' are negative by rounding: its states are nearly dependent, or "
                            f"a mode decays by less than rounding. Take other states, as realization='modal'."
                            )  # fmt: skip
    return np.asarray(np.where(result > 0.0, result, 0.0))


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
