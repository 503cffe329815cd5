"""Tables as text: one look for ``str(modes)``, the command line and whatever else lists things."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Sequence
from itertools import starmap
from typing import Literal, TextIO, TypeAlias

Justify: TypeAlias = Literal["left", "center", "right"]

SHOWN = 12  # names in one list
_LOOKS = {"left": "text-align:left", "right": "text-align:right;font-variant-numeric:tabular-nums"}
_RULE, _ASCII_RULE = "─", "-"
_BOLD, _DIM, _PLAIN = "\x1b[1m", "\x1b[2m", "\x1b[0m"
_ASCII_WORDS = {"→": "->", "−": "-", "·": ".", "°": " deg", "±": "+-", "×": "x", "…": "...", "µ": "u"}


def text(
    title: str,
    columns: Sequence[tuple[str, Justify]],
    rows: Iterable[Sequence[object]],
    notes: Sequence[str] = (),
    *,
    ascii_only: bool | None = None,
) -> str:
    """Return a table as plain text that is as wide as its content, without trailing blanks or a final newline.

    ``columns``: header of each column, and ``left``, ``center`` or ``right``. ``rows``: one entry a column, shown by
    ``str``. ``ascii_only``: default: if standard output cannot encode the rules or the content.
    """
    body = [[str(cell) for cell in row] for row in rows]
    if ascii_only is None:
        ascii_only = not encodable("".join([_RULE, title, *(h for h, _ in columns), *map("".join, body), *notes]))
    above, header, rule, lines, below = _lines(title, columns, body, notes, ascii_only)
    return "\n".join([*above, rule, header, rule, *lines, rule, *below])


def show(
    title: str,
    columns: Sequence[tuple[str, Justify]],
    rows: Iterable[Sequence[object]],
    notes: Sequence[str] = (),
    *,
    stream: TextIO | None = None,
) -> None:
    """Print a table to a ``stream``: with bold headers on a terminal unless ``NO_COLOR`` is set, else as plain text."""
    to = sys.stdout if stream is None else stream
    body = [[str(cell) for cell in row] for row in rows]
    words = "".join([_RULE, title, *(h for h, _ in columns), *map("".join, body), *notes])
    above, header, rule, lines, below = _lines(title, columns, body, notes, not encodable(words, to.encoding))
    if to.isatty() and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb":
        above, header = [_BOLD + line + _PLAIN for line in above], _BOLD + header + _PLAIN
        rule, below = _DIM + rule + _PLAIN, [_DIM + line + _PLAIN for line in below]
    to.write("\n".join([*above, rule, header, rule, *lines, rule, *below, ""]))


def encodable(words: str, encoding: str | None = None) -> bool:
    """Return whether ``words`` can be written in an ``encoding``; default: that of standard output."""
    try:
        words.encode(encoding or getattr(sys.stdout, "encoding", None) or "utf-8")
    except (UnicodeEncodeError, LookupError):
        return False
    return True


def to_ascii(words: str) -> str:
    """Return ``words`` in ASCII: arrows and signs as words, any other character as its escape."""
    for sign, plain in _ASCII_WORDS.items():
        words = words.replace(sign, plain)
    return words.encode("ascii", "backslashreplace").decode("ascii")


def width(words: str) -> int:
    """Return how many cells of a terminal a line takes: two for wide characters of East Asia, none for accents."""
    if words.isascii():
        return len(words)
    from unicodedata import combining, east_asian_width

    return sum(0 if combining(sign) else 2 if east_asian_width(sign) in "WF" else 1 for sign in words)


def _lines(
    title: str, columns: Sequence[tuple[str, Justify]], rows: list[list[str]], notes: Sequence[str], ascii_only: bool
) -> tuple[list[str], str, str, list[str], list[str]]:
    """Return the lines above a table, its header, its rule, its rows, and the lines below."""
    for row in rows:
        if len(row) != len(columns):
            raise ValueError(f"a row has {len(row)} entries, the table {len(columns)} columns: {row}")
    cells = [[name for name, _ in columns], *rows]
    if ascii_only:
        cells = [list(map(to_ascii, row)) for row in cells]
    widths = [max(map(width, column)) for column in zip(*cells, strict=True)]

    def line(row: list[str]) -> str:
        parts = starmap(_aligned, zip(row, widths, (side for _, side in columns), strict=True))
        return ("  " + "   ".join(parts)).rstrip()

    header, *lines = map(line, cells)
    rule = " " + (_ASCII_RULE if ascii_only else _RULE) * (sum(widths) + 3 * len(widths) - 1)
    above, below = [title] if title else [], list(notes)
    if ascii_only:
        above, below = list(map(to_ascii, above)), list(map(to_ascii, below))
    return above, header, rule, lines, below


def _aligned(words: str, cells: int, side: Justify) -> str:
    blank = cells - width(words)
    before = {"left": 0, "center": blank // 2, "right": blank}[side]
    return " " * before + words + " " * (blank - before)


def listed(names: Sequence[str]) -> str:
    """Return names in a row, cut after the first dozen."""
    return ", ".join(names[:SHOWN]) + (f", ... ({len(names)} in all)" if len(names) > SHOWN else "")


def html(
    title: str, columns: Sequence[tuple[str, str]], rows: Iterable[Sequence[object]], notes: Sequence[str] = ()
) -> str:
    """Return a table as HTML; arguments as those of ``text``."""
    from html import escape

    looks = [_LOOKS.get(side, _LOOKS["left"]) for _, side in columns]
    head = "".join(f'<th style="{look}">{escape(name)}</th>' for (name, _), look in zip(columns, looks, strict=True))
    body = "".join(
        "<tr>" + "".join(f'<td style="{look}">{escape(str(cell))}</td>' for cell, look in zip(row, looks, strict=True))
        + "</tr>" for row in rows
    )  # fmt: skip
    words = "".join(f"<div>{escape(note)}</div>" for note in notes)
    above = f"<b>{escape(title)}</b>" if title else ""
    return f"<div>{above}<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{words}</div>"
