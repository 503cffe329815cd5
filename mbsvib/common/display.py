"""How results show themselves: one line in lists and in the interpreter, a table in print and in notebooks.

What completions list: the names for users, without those by which folders of mbsvib use each other's results.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from decimal import ROUND_CEILING, Context
from typing import Any

import numpy as np

from mbsvib.common import tables


class Completed:
    """A class whose ``dir`` leaves out the names in ``_engine``, of itself and of the classes it is made of."""

    __slots__ = ()
    _engine = ""  # names, by spaces, that are public between the folders of mbsvib and of no use in scripts

    def __dir__(self) -> list[str]:
        return completed_names(self)


def completed_names(value: Any) -> list[str]:
    """Return the names of ``dir`` without those of the engine."""
    hidden = " ".join([vars(kind).get("_engine", "") for kind in type(value).__mro__]).split()
    return [name for name in object.__dir__(value) if name not in hidden]


MOST = 4  # entries of a sequence that are shown
LONGEST = 60  # characters of one value
LINE = 120  # characters of a line
NAMES = ("coordinates", "states", "inputs", "outputs", "parameters", "variables", "sensors", "actuators")
_TWO_COLUMNS: list[tuple[str, tables.Justify]] = [("", "left"), ("", "left")]


class Displayed(Completed):
    """A result: ``repr`` is one short line, ``str`` and notebooks have its ``table()``, or else its fields.

    A table is a dict of title, columns, rows and notes, the arguments of ``tables.text`` and ``tables.html``.
    """

    __slots__ = ()

    def __str__(self) -> str:
        columns = _table(self)
        return repr(self) if columns is None else tables.text(**columns)

    def __repr__(self) -> str:
        line = ""
        for name, value in _fields(self):
            if len(line) + len(name) + len(value) > LINE:
                line += ", ..."
                break
            line += f"{', ' if line else ''}{name}={value}"
        return f"{type(self).__name__}({line})"

    def _repr_html_(self) -> str:
        columns = _table(self)
        if columns is not None:
            return tables.html(**columns)
        if type(self).__str__ is not Displayed.__str__:
            from html import escape

            return f"<pre>{escape(str(self))}</pre>"
        if type(self).__repr__ is Displayed.__repr__:
            return tables.html(_title(self), _TWO_COLUMNS, _fields(self))
        return tables.html(repr(self), _TWO_COLUMNS, _names(self))


def brief(value: Any) -> str:
    """Return a value in few characters: numbers to six digits, long sequences and arrays by their size."""
    if isinstance(value, (bool, int, np.integer)) or value is None:
        return str(value)
    if isinstance(value, (float, complex, np.number)):
        return f"{value:.6g}"
    if isinstance(value, np.ndarray):
        if value.ndim == 0:
            return brief(value[()])
        if value.ndim == 1 and value.size <= MOST:
            return f"[{', '.join(map(brief, value))}]"
        return f"array of {' x '.join(map(str, value.shape))}"
    if isinstance(value, Mapping):
        return _in_brackets("{}", [f"{key}: {brief(entry)}" for key, entry in list(value.items())[:MOST]], len(value))
    if isinstance(value, (tuple, list)):
        return _in_brackets("()" if isinstance(value, tuple) else "[]", list(map(brief, value[:MOST])), len(value))
    words = repr(value)
    if "\n" in words or len(words) > LONGEST:
        return f"{words[: LONGEST - 5]}...'" if isinstance(value, str) else type(value).__name__
    return words


def upper(bound: float) -> str:
    """Return a bound in three digits, rounded up."""
    return f"{float(Context(prec=3, rounding=ROUND_CEILING).create_decimal_from_float(bound)):.3g}"


def _in_brackets(brackets: str, entries: list[str], count: int) -> str:
    inside = ", ".join(entries)
    if count > MOST or len(inside) > LONGEST:
        return f"{count} entries"
    return f"{brackets[0]}{inside}{',' if brackets == '()' and count == 1 else ''}{brackets[1]}"


def _table(result: Any) -> dict[str, Any] | None:
    """The result's ``table()`` if it is one to print: of a run, for instance, it is columns of numbers."""
    method = getattr(result, "table", None)
    content = None if method is None else method()
    return content if isinstance(content, dict) and {"columns", "rows"} <= content.keys() else None


def _title(result: Any) -> str:
    name = getattr(result, "name", "")
    return f"{type(result).__name__} {name}".rstrip() if isinstance(name, str) else type(result).__name__


def _fields(result: Any) -> list[tuple[str, str]]:
    """Names and brief values of the fields that the representation has."""
    if not is_dataclass(result):
        return []
    named = [field.name for field in fields(result) if field.repr and not field.name.startswith("_")]
    return [(name, brief(getattr(result, name))) for name in named]


def _names(result: Any) -> list[tuple[str, str]]:
    """The lists of names that a result has, cut where they are long."""
    groups = [(name, getattr(result, name, None)) for name in NAMES]
    return [(name, tables.listed(list(map(str, group)))) for name, group in groups
            if isinstance(group, (tuple, list, Mapping)) and group]  # fmt: skip
