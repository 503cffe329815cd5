"""Checks of arguments of responses and exports: models, systems, names, real numbers, mode numbers and paths."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from mbsvib.common.arguments import names_in, shown
from mbsvib.common.arrays import Array
from mbsvib.errors import MbsvibError, ModelError, ResponseError, nearest

T = TypeVar("T")

# Squares of frequencies times large stiffness are to stay below 1e308.
HIGHEST = 1e100


def a_model(value: T, caller: str, field: str = "model") -> T:
    """Return ``value`` if it is a model."""
    if kind_of(value) == "model":
        return value
    hint = {
        "system": "Give the model that was linearized.", "sparse system": "Give the model that was linearized.",
        "batch": "Give the model that was linearized.",
        "closed loop": "Give the model that was linearized; how its controller isolates is told by "
                       "isolation.actuated(model, body, legs=[]).with_gains(controller).isolation().",
    }.get(kind_of(value) or "", "Read files by mv.load." if isinstance(value, str) else "")  # fmt: skip
    raise _refuse(ModelError, value, caller, field, "a Model", hint)


def a_system(value: T, caller: str, field: str = "system") -> T:
    """Return ``value`` if it is a system with dense equations."""
    if kind_of(value) == "system":
        return value
    raise _refuse(ResponseError, value, caller, field, "a System", way_to_system(value))


def a_linear(value: T, caller: str, field: str = "system") -> T:
    """Return ``value`` if it is a system, a closed loop, a state space or a controller, which all have responses."""
    if kind_of(value) in ("system", "closed loop", "state space", "controller"):
        return value
    hint = f"{way_to_system(value)} Closed loops and state spaces will do as well."
    raise _refuse(ResponseError, value, caller, field, "a System", hint)


def a_result(value: T, attribute: str, caller: str, field: str, expected: str) -> T:
    """Return ``value`` if it has the attribute that tells the ``expected`` result from others."""
    if hasattr(value, attribute):
        return value
    raise _refuse(ResponseError, value, caller, field, expected, "")


def way_to_system(value: Any) -> str:
    """Return advice on how to obtain a system from another object."""
    if kind_of(value) == "model":
        return "Give model.linearize()."
    if kind_of(value) == "batch":
        return "Give one of the variants, batch[0]."
    if kind_of(value) == "sparse system":
        return "It is held sparse: give some of its modes, system.reduced(20, correction=True)."
    return "It is what model.linearize() returns."


def kind_of(value: Any) -> str | None:
    """Return what an object of mbsvib is: "model", "system", "sparse system", "batch", "closed loop", "state space" or
    "controller"; None of all others.
    """
    kind = getattr(type(value), "kind", None)
    return kind if isinstance(kind, str) else None


def _refuse(
    error: Callable[..., MbsvibError], value: Any, caller: str, field: str, expected: str, hint: str
) -> MbsvibError:
    name = getattr(value, "name", None)
    text = repr(value) if isinstance(value, (str, type(None))) else \
        f"{type(value).__name__} '{name}'" if isinstance(name, str) else type(value).__name__  # fmt: skip
    return error(f"{caller}: {field} = {text}; expected {expected}. {hint}".rstrip())


def names(value: Any, caller: str, field: str, error: Callable[..., MbsvibError] = ResponseError) -> list[str]:
    """Return names as a list, from a text, a part that ``add_...`` returned, or several of either."""
    listed = names_in([value] if isinstance(value, str) or hasattr(value, "name") else value)
    if listed is None:
        text = f"{caller}: {field} = {shown(value)}; expected a name, or a list of names."
        raise error(text, field=field) if error is ModelError else error(text)
    return listed


def one_of(
    value: Any, known: Collection[str], caller: str, field: str, error: Callable[..., MbsvibError] = ResponseError
) -> str:
    """Return a word that is one of those known."""
    if isinstance(value, str) and value in known:
        return value
    *others, last = map(repr, known)
    text = f"{caller}: {field} = {shown(value)}; expected {', '.join(others)} or {last}.{nearest(str(value), known)}"
    raise error(text, element=caller, field=field) if error is ModelError else error(text)


def flag(value: Any, caller: str, field: str, error: Callable[[str], MbsvibError]) -> bool:
    """Return a choice of yes or no; others are refused, as "no" would count as yes."""
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    raise error(f"{caller}: {field} = {shown(value)}; expected True or False.")


def reals(value: Any, caller: str, field: str, expected: str, error: Callable[..., MbsvibError] = ResponseError) -> \
        Array:  # fmt: skip
    """Return ``value`` as an array of floats; numpy drops imaginary parts also where they are not 0, as of i omega."""
    try:
        array = np.asarray(value)
        if array.dtype.kind == "c":
            if array.imag.any():
                raise TypeError("complex")
            array = array.real
        if array.dtype.kind in "mM":
            raise TypeError("dates, of which numpy makes counts of nanoseconds")
        if array.dtype.kind in "SU" or (array.dtype == object and any(isinstance(x, (str, bytes)) for x in array.flat)):
            raise TypeError("text, of which numpy reads '1_0' as 10")
        return np.asarray(array, dtype=float)
    except (TypeError, ValueError, OverflowError) as reason:
        hint = " They are real: give omega, not 1j * omega." if "omega" in field else " Complex ones are refused."
        text = f"{caller}: {field} = {shown(value)}; expected {expected}.{hint if str(reason) == 'complex' else ''}"
        raise (error(text, element=caller, field=field) if error is ModelError else error(text)) from reason


def ascending(
    value: Any, caller: str, field: str, expected: str, error: Callable[..., MbsvibError] = ResponseError,
    least: float = -np.inf, count: int = 1, ndmin: int = 0,
) -> Array:  # fmt: skip
    """Return a copy of ``count`` or more finite numbers (n,) from ``least`` on, each above the one before."""
    x = np.array(reals(value, caller, field, expected, error), ndmin=ndmin)
    given = f"the shape {x.shape}"
    if x.ndim == 1 and len(x) >= count:
        bad = ~(np.isfinite(x) & (x >= least))
        bad[1:] |= x[1:] <= x[:-1]
        if not bad.any():
            return x
        at = int(bad.argmax())
        given = f"{x[at]:g}{f' behind {x[at - 1]:g}' if at else ''} at index {at}"
    text = f"{caller}: {field} with {given}; expected {expected}."
    raise error(text, element=caller, field=field) if error is ModelError else error(text)


def real(value: Any, caller: str, field: str, expected: str, least: float = -np.inf) -> float:
    """Return ``value`` as a finite float that is ``least`` or more."""
    array = reals(value, caller, field, expected)
    if array.ndim or not np.isfinite(array) or array < least:
        finite = ", finite" if not array.ndim and np.isinf(array) else ""
        raise ResponseError(f"{caller}: {field} = {shown(value)}; expected {expected}{finite}.")
    return float(array)


def limits(low: Any, high: Any, caller: str) -> tuple[float, float]:
    """Return two limits as floats, the lower one first; infinite ones are none."""
    expected = "two numbers, the lower one first"
    ends = reals([low, high], caller, "limits", expected)
    if ends.shape != (2,) or not ends[0] <= ends[1]:
        raise ResponseError(f"{caller}: limits = {shown([low, high])}; expected {expected}.")
    return float(ends[0]), float(ends[1])


def band_of(value: Any, caller: str, above: bool = False) -> tuple[float, float] | None:
    """Return the first and the last frequency [Hz] of a band; None: no band. ``above``: whether 0 Hz is refused."""
    if value is None:
        return None
    ends = reals(list(value) if hasattr(value, "__iter__") else value, caller, "band", "two frequencies [Hz]")
    if ends.shape != (2,):
        raise ResponseError(f"{caller}: band = {shown(value)}; expected two frequencies [Hz].")
    if not (np.nextafter(0.0, 1.0) if above else 0.0) <= ends[0] < ends[1] < np.inf:
        raise ResponseError(f"{caller}: band = {shown(value)} Hz; expected two finite frequencies, ascending from "
                            f"{'above ' if above else ''}0 Hz.")  # fmt: skip
    return float(ends[0]), float(ends[1])


def positive(caller: str, field: str, value: Any, expected: str) -> float:
    """Return a finite number above 0."""
    if (number := real(value, caller, field, f"{expected}, above 0")) <= 0.0:
        raise ResponseError(f"{caller}: {field} = {shown(value)}; expected {expected}, above 0.")
    return number


def near_frequency(value: Any) -> float:
    """Return the frequency [Hz] around which modes are wanted, whose square must not overflow."""
    expected = f"a frequency [Hz] from 0, for the lowest modes, to {HIGHEST:g}"
    result = real(value, "modes", "near", expected, least=0.0)
    if result > HIGHEST:
        raise ResponseError(f"modes: near = {shown(value)}; expected {expected}.")
    return result


def mode_index(
    number: Any, caller: str, count: int | None = None, table: str = "print(system.modes())",
    error: Callable[[str], MbsvibError] = ResponseError,
) -> int:  # fmt: skip
    """Return the index in arrays of the mode that has this number, which counts from 1 as in the printed table."""
    if isinstance(number, bool) or not isinstance(number, (int, np.integer)):
        raise error(f"{caller}: the number of a mode is expected, 1, 2, ... as {table} lists them; {shown(number)} was "
                    f"given.")  # fmt: skip
    if number < 1:
        raise error(f"{caller}: modes count from 1, as {table} lists them; {shown(number)} was given.")
    if count is not None and number > count:
        raise error(f"{caller}: mode {number} was given; {table} lists modes from 1 to {count}.")
    return int(number) - 1


def angular(omega: Any, caller: str = "frequency_response") -> Array:
    """Return angular frequencies [rad/s] as a vector whose squares neither overflow nor underflow."""
    w = np.atleast_1d(reals(omega, caller, "omega", "a vector of numbers [rad/s]"))
    if w.ndim != 1 or not np.isfinite(w).all():
        raise ResponseError(f"{caller}: omega has shape {np.shape(omega)}; expected a finite vector [rad/s].")
    beyond = w[(w != 0.0) & ((np.abs(w) < 1.0 / HIGHEST) | (np.abs(w) > HIGHEST))]
    if len(beyond):
        raise ResponseError(f"{caller}: omega = {beyond[0]:g} rad/s; expected 0, or from {1.0 / HIGHEST:g} "
                            f"to {HIGHEST:g} rad/s.")  # fmt: skip
    return w


def hertz(frequencies: Any) -> Array:
    """Return a copy of ascending ``frequencies`` (n,) [Hz], from 0 Hz on."""
    expected = "at least one frequency [Hz] from 0 on, each higher than the one before"
    return ascending(frequencies, "frequencies", "values", expected, least=0.0, ndmin=1)


def a_path(value: Any, caller: str, error: Callable[[str], MbsvibError]) -> Path:
    """Return ``value`` as a path; a number is refused, as ``open`` would take it for a file descriptor."""
    text = os.fspath(value) if isinstance(value, (str, os.PathLike)) else None
    if isinstance(text, str) and "\0" not in text:
        return Path(text)
    swapped = hasattr(value, "linearize") or hasattr(value, "modes")
    hint = f" Are its arguments in another order? help({caller}) tells it." if swapped else ""
    raise error(f"{caller}: path = {shown(value)}; expected the path of a file.{hint}")
