"""Names that one class does not have and another has: asking for them tells where they are."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, NoReturn

from mbsvib.common.display import completed_names

# What answers names that systems have in other programs.
FUNCTIONS = {
    **{name: f"it is a figure: mbsvib.plots.{name}(system)."
       for name in ("bode", "nyquist", "step", "singular_values", "pole_zero_map")},
    **{name: f"it is a function: mbsvib_export.{name}(system, path)."
       for name in ("to_fmu", "to_json", "to_mat", "to_modelica", "to_npz", "to_uff")},
    **{name: f"it is a function: mbsvib_export.{name}(system)." for name in ("to_casadi", "to_control", "to_scipy")},
    **{name: f"modes have it: system.modes().{name}."
       for name in ("damped_frequencies", "damping_ratios", "eigenvalues", "frequencies", "shapes")},
    "A": "state spaces have it: system.state_space().A.",
    "step_response": "give a step over time to system.time_response(t, u), or draw it by mbsvib.plots.step(system).",
    "save": "models are saved by mbsvib.save(model, path), matrices by mbsvib_export.to_json(system, path).",
}
OF_MODELS = {
    "bode": "it is a figure of systems: mbsvib.plots.bode(model.linearize()).",
    "frequencies": "modes have it: model.linearize().modes().frequencies.",
    "plot": "it is a figure: mbsvib.plots.mechanism(model).",
    "save": "it is a function: mbsvib.save(model, path).",
}


class Elsewhere:
    """An attribute that a class does not have; asking for it raises an AttributeError that tells which object has it.

    A ``__getattr__`` of the class would do the same, but makes access to all its attributes slower.
    """

    def __init__(self, name: str, hint: str) -> None:
        self._name, self._hint = name, hint

    def __get__(self, instance: Any, owner: type) -> NoReturn:
        text = f"'{owner.__name__}' object has no attribute '{self._name}'; {self._hint}"
        raise AttributeError(text, name=self._name, obj=instance)


def tell_where(owner: type, other: type, hint: str) -> None:
    """Let a class tell where the public names are that it does not have and another class has.

    ``hint`` is the sentence that tells it, with {name} for the name. ``dir`` does not list such names.
    """
    for name in _attributes(other) - _attributes(owner):
        if not name.startswith("_"):
            setattr(owner, name, Elsewhere(name, hint.format(name=name)))
    owner.__dir__ = _names  # type: ignore[method-assign, assignment]


def tell_functions(owner: type, hints: Mapping[str, str], called: str = "system") -> None:
    """Let a class, an object of which is ``called`` so, tell which functions answer names that users of other programs
    expect of it, by name.
    """
    for name in hints.keys() - _attributes(owner):
        setattr(owner, name, Elsewhere(name, re.sub(r"\bsystem\b", called, hints[name])))
    owner.__dir__ = _names  # type: ignore[method-assign, assignment]


def _attributes(kind: type) -> set[str]:
    return {name for name in dir(kind) if hasattr(kind, name)} | {*getattr(kind, "__dataclass_fields__", ())}


def _names(value: Any) -> list[str]:
    absent = {name for kind in type(value).__mro__ for name, item in vars(kind).items() if isinstance(item, Elsewhere)}
    return [name for name in completed_names(value) if name not in absent]
