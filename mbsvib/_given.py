"""Models where models are asked for, systems where systems are: whoever hands over the other one is told the way."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mbsvib.errors import MbsvibError, ModelError, ResponseError

if TYPE_CHECKING:
    from collections.abc import Callable

    from mbsvib.model import Model
    from mbsvib.system import System


def a_model(value: Any, caller: str, field: str = "model") -> Model:
    """Return ``value`` if it is a model."""
    from mbsvib.model import Model

    if isinstance(value, Model):
        return value
    hint = "Give the model that was linearized." if hasattr(value, "provenance") or _variants(value) else \
        "Read files by mv.load." if isinstance(value, str) else ""  # fmt: skip
    raise _refuse(ModelError, value, caller, field, "a Model", hint)


def a_system(value: Any, caller: str, field: str = "system") -> System:
    """Return ``value`` if it is a system with dense equations."""
    from mbsvib.system import System

    if isinstance(value, System):
        return value
    raise _refuse(ResponseError, value, caller, field, "a System", way_to_system(value))


def way_to_system(value: Any) -> str:
    """Say what to do with something else than a system."""
    if hasattr(value, "with_values"):
        return "Give model.linearize()."
    if _variants(value):
        return "Give one of the variants, batch[0]."
    return "It is what model.linearize() returns."


def _variants(value: Any) -> bool:
    from mbsvib.batch import Batch

    return isinstance(value, Batch)


def _refuse(
    error: Callable[..., MbsvibError], value: Any, caller: str, field: str, expected: str, hint: str
) -> MbsvibError:
    name = getattr(value, "name", None)
    given = repr(value) if isinstance(value, (str, type(None))) else \
        f"{type(value).__name__} '{name}'" if isinstance(name, str) else type(value).__name__  # fmt: skip
    return error(f"{caller}: {field} = {given}; expected {expected}. {hint}".rstrip())
