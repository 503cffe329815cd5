"""Names that a module does not have: the error tells which module has them, or which object as a method."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import NoReturn

from mbsvib.errors import nearest

MODULES = ("mbsvib", "mbsvib.isolation", "mbsvib.studies", "mbsvib.plots", "mbsvib.library", "mbsvib.report",
           "mbsvib.goals", "mbsvib_export")  # fmt: skip
# Classes of mbsvib, and how to get an object of each.
OBJECTS = {"System": "system = model.linearize()", "Modes": "modes = system.modes()",
           "StateSpace": "state_space = system.state_space()", "Model": "model = mbsvib.Model()",
           "isolation.ClosedLoop": "loop = system.feedback(controller)"}  # fmt: skip


def absent(module: str, name: str) -> AttributeError:
    """Return the error of a public module that has no such name."""
    text = f"module {module!r} has no attribute {name!r}"
    if name.startswith("_") or find_spec(f"{module}.{name}") is not None:  # a module about to be imported
        return AttributeError(text)
    public = {title: _resolved(title) for title in MODULES}
    for title, home in public.items():
        if name in dir(home):
            return AttributeError(f"{text}; it is {title}.{name}")
    for title, source in OBJECTS.items():
        kind = _resolved(f"mbsvib.{title}")
        if hasattr(kind, name) or name in getattr(kind, "__dataclass_fields__", ()):
            owner = source.split(" = ")[0]
            return AttributeError(f"{text}; it is {owner}.{name}, after {source}")
    return AttributeError(f"{text}.{nearest(name, dir(public[module]))}")


def missing(module: str, name: str) -> NoReturn:
    """Raise the error of ``absent``: ``__getattr__`` of a module."""
    raise absent(module, name)


def _resolved(title: str) -> object:
    """The module or class of a dotted name."""
    first, *rest = title.split(".")
    value: object = import_module(first)
    for word in rest:
        value = getattr(value, word)
    return value
