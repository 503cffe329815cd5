"""Docstrings hold to the rule of the house: one sentence, every argument with a type, returns, raises.

All of it is asked of the public surface, which is what the packages list in ``__all__`` and the methods of these
classes. A function that other modules share may say everything in its sentence; where it lists its arguments, it
lists them all.
"""

import ast
import inspect
import pkgutil
import re
from importlib import import_module

import mbsvib
import mbsvib_export

SECTION = re.compile(r"^(\w[\w ]*)\n-+$", re.MULTILINE)
ENTRY = re.compile(r"^([*\w][\w*, ]*?)(?: : (.+))?$")
INDENTED = re.compile(r"^ +\S")


def modules():
    for package in (mbsvib, mbsvib_export):
        yield package
        for info in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            if not any(part.startswith("_") for part in info.name.split(".")):
                yield import_module(info.name)


def public(owner, module):
    """Functions and classes that a module or class defines itself, with their methods and properties."""
    for name, item in vars(owner).items():
        if name.startswith("_"):
            continue
        item = inspect.unwrap(item) if callable(item) else item
        if inspect.isclass(item) and item.__module__ == module and inspect.isclass(owner) is False:
            yield f"{module}.{name}", item
            yield from public(item, module)
        elif inspect.isfunction(item) and item.__module__ == module:
            where = owner.__qualname__ + "." if inspect.isclass(owner) else ""
            yield f"{module}.{where}{name}", item
        elif inspect.isclass(owner):
            function = getattr(item, "fget", None) or getattr(item, "func", None) or getattr(item, "__func__", None)
            if inspect.isfunction(function):
                kind = "property" if not isinstance(item, (staticmethod, classmethod)) else ""
                found = item if isinstance(item, property) else function  # a property has the text of its base class
                yield f"{module}.{owner.__qualname__}.{name}{':property' if kind else ''}", found


def surface():
    """Functions and classes in the packages' ``__all__``, and the functions of the classes."""
    for package in modules():
        for name in getattr(package, "__all__", ()):
            item = getattr(package, name)
            if inspect.isfunction(item):
                yield f"{item.__module__}.{item.__qualname__}"
            elif inspect.isclass(item):
                starts = tuple(f"{base.__module__}.{base.__name__}." for base in item.__mro__)
                yield from (known for known in ITEMS if known.startswith(starts))


ITEMS = {name: item for module in modules() for name, item in public(module, module.__name__)}
FUNCTIONS = {name: item for name, item in ITEMS.items() if inspect.isfunction(item) and not name.endswith(":property")}
SURFACE = sorted(set(surface()) & set(FUNCTIONS))
SHARED = sorted(set(FUNCTIONS) - set(SURFACE))


def sections(text):
    marks = list(SECTION.finditer(text))
    ends = [mark.start() for mark in marks[1:]] + [len(text)] * bool(marks)
    return {mark[1]: text[mark.end() : end] for mark, end in zip(marks, ends, strict=True)}


def entries(section):
    """{name: type} of the unindented lines of a section."""
    result = {}
    for line in section.splitlines():
        match = None if INDENTED.match(line) else ENTRY.match(line.strip())
        if match and line.strip():
            for name in match[1].split(","):
                result[name.strip()] = match[2]
    return result


def own_arguments(function):
    bound = ("self", "cls") if "." in function.__qualname__ else ()
    return [p for p in inspect.signature(function).parameters.values() if p.name not in bound]


def names(function):
    stars = {inspect.Parameter.VAR_KEYWORD: "**", inspect.Parameter.VAR_POSITIONAL: "*"}
    return [stars.get(p.kind, "") + p.name for p in own_arguments(function)]


def test_something_is_looked_at():
    assert {"mbsvib.api.add_parts.RigidMechanism.add_joint", "mbsvib.api.model.Model.replace"} <= set(SURFACE)
    assert "mbsvib.modes.result.Modes.frequencies:property" in ITEMS
    assert {"mbsvib.equations.equations.Equations.displacements", "mbsvib.api.linearize.linearize"} <= set(SURFACE)
    assert any(name.startswith("mbsvib_export.") for name in SURFACE)


def test_summary_is_one_sentence():
    """A capital letter or an equation at its beginning, a full stop at its end."""
    wrong = []
    for name, item in ITEMS.items():
        summary = (inspect.getdoc(item) or "").split("\n\n")[0]
        begins = summary[:1].isupper() or not summary[:1].isalpha() or "=" in summary
        if not (summary.rstrip().endswith(".") and begins):
            wrong.append((name, summary))
    assert not wrong


def test_every_argument_is_listed_with_its_type():
    for name in SURFACE:
        function = FUNCTIONS[name]
        listed = entries(sections(inspect.getdoc(function)).get("Parameters", ""))
        assert list(listed) == names(function), name
        assert not [n for n, kind in listed.items() if not kind and not n.startswith("*")], name


def test_what_is_returned_is_said():
    for name in SURFACE:
        function = FUNCTIONS[name]
        returned = inspect.signature(function).return_annotation
        assert returned is not inspect.Signature.empty, name
        if returned not in (None, "None") and own_arguments(function):
            assert sections(inspect.getdoc(function)).get("Returns", "").strip(), name


def test_what_is_raised_is_said():
    for name in SURFACE:
        function = FUNCTIONS[name]
        tree = ast.parse(inspect.cleandoc("\n" + inspect.getsource(function)))
        if any(isinstance(node, ast.Raise) and node.exc is not None for node in ast.walk(tree)):
            assert entries(sections(inspect.getdoc(function)).get("Raises", "")), f"{name} does not say what it raises"


def test_lists_of_shared_functions_are_whole():
    for name in SHARED:
        function = FUNCTIONS[name]
        result = sections(inspect.getdoc(function))
        if "Parameters" in result:
            assert list(entries(result["Parameters"])) == names(function), name
            if inspect.signature(function).return_annotation not in (None, "None"):
                assert result.get("Returns", "").strip(), name
