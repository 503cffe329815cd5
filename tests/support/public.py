"""The classes that users get: what public functions, methods and properties return, by their annotations."""

import ast
import importlib
import inspect
import re
from functools import cache
from pathlib import Path

import mbsvib
import mbsvib_export
from mbsvib import isolation, library, plots, studies

ENTRANCES = (mbsvib, mbsvib_export, isolation, library, plots, studies)


@cache
def _imported(module):
    """Names that a module imports, also for types only, and where they come from."""
    tree = ast.parse(Path(importlib.import_module(module).__file__).read_text(encoding="utf-8"))
    return {alias.asname or alias.name: (node.module, alias.name) for node in ast.walk(tree)
            if isinstance(node, ast.ImportFrom) and node.module for alias in node.names}  # fmt: skip


@cache
def _class_of(name, module):
    """The class that a name in a module stands for, if it is one of this project."""
    value = getattr(importlib.import_module(module), name, None)
    if value is None and name in _imported(module):
        home, original = _imported(module)[name]
        if not home.startswith("mbsvib"):
            return None
        value = getattr(importlib.import_module(home), original, None)
    return value if inspect.isclass(value) and value.__module__.startswith("mbsvib") else None


def _functions(value):
    """The public methods and properties of a class, or a function itself."""
    if inspect.isfunction(value):
        yield value
    elif inspect.isclass(value):
        for owner in value.__mro__:
            for name, part in vars(owner).items():
                part = getattr(part, "func", getattr(part, "fget", getattr(part, "__func__", part)))
                if inspect.isfunction(part) and not name.startswith("_"):
                    yield part


def returned_classes():
    """Return the classes of mbsvib and of the exporters that users get, by their full names."""
    waiting = [getattr(module, name) for module in ENTRANCES for name in module.__all__]
    waiting.append(importlib.import_module("mbsvib.campbell").campbell)
    result = {}
    while waiting:
        value = waiting.pop()
        if inspect.isclass(value) and f"{value.__module__}.{value.__name__}" in result:
            continue
        if inspect.isclass(value) and not issubclass(value, BaseException):
            result[f"{value.__module__}.{value.__name__}"] = value
        for function in _functions(value):
            for name in re.findall(r"[A-Za-z_]\w*", str(function.__annotations__.get("return", ""))):
                found = _class_of(name, function.__module__)
                if found is not None:
                    waiting.append(found)
    return dict(sorted(result.items()))
