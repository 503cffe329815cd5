"""Tables as text: one look for ``str(modes)``, the command line and whatever else lists things."""

from __future__ import annotations

import sys
from html import escape
from typing import TYPE_CHECKING, Literal, TypeAlias

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from rich.console import Console
    from rich.table import Table

    Justify: TypeAlias = Literal["left", "center", "right"]

SHOWN = 12  # names in one list
_LOOKS = {"left": "text-align:left", "right": "text-align:right;font-variant-numeric:tabular-nums"}
_RULES = " ── \n    \n ── \n    \n    \n ── \n    \n ── \n"
_ASCII_RULES = _RULES.replace("─", "-")
_ASCII_WORDS = {"→": "->", "−": "-", "·": ".", "°": " deg", "±": "+-", "×": "x", "…": "..."}


def text(
    title: str,
    columns: Sequence[tuple[str, Justify]],
    rows: Iterable[Sequence[object]],
    notes: Sequence[str] = (),
    *,
    ascii_only: bool | None = None,
) -> str:
    """Return a table as plain text that is as wide as its content.

    Parameters
    ----------
    title : str
        A line above the table; empty for none.
    columns : sequence of (str, str)
        Header of each column, and ``left``, ``center`` or ``right``.
    rows : iterable of sequences
        One entry a column; other types are shown by ``str``.
    notes : sequence of str
        Lines below the table.
    ascii_only : bool, optional
        Keep to ASCII. Default: only if standard output cannot encode the rules or the content.

    Returns
    -------
    str
        Lines without escape codes, trailing blanks or a final newline.

    Raises
    ------
    ValueError
        If a row has more or fewer entries than there are columns.
    """
    from io import StringIO

    from rich.console import Console

    body = [[str(cell) for cell in row] for row in rows]
    if ascii_only is None:
        ascii_only = not encodable("".join([_RULES, title, *(h for h, _ in columns), *map("".join, body), *notes]))
    stream = StringIO()
    console = Console(file=stream, force_terminal=False, force_jupyter=False, color_system=None)
    _print(console, title, _build(columns, body, ascii_only), notes)
    result = "\n".join(line.rstrip() for line in stream.getvalue().splitlines())
    return to_ascii(result) if ascii_only else result


def show(
    console: Console,
    title: str,
    columns: Sequence[tuple[str, Justify]],
    rows: Iterable[Sequence[object]],
    notes: Sequence[str] = (),
) -> None:
    """Print a table on a live console: styled on a terminal, plain text of full width anywhere else.

    Parameters
    ----------
    console : rich.console.Console
        Where it goes.
    title : str
        As for ``text``, like the three that follow.
    columns : sequence of (str, str)
        Header and justification.
    rows : iterable of sequences
        One entry a column.
    notes : sequence of str
        Lines below the table.
    """
    body = [[str(cell) for cell in row] for row in rows]
    if console.is_terminal and encodable(_RULES, console.encoding):
        _print(console, title, _build(columns, body, ascii_only=False), notes)
        return
    plain = text(title, columns, body, notes, ascii_only=not encodable(_RULES, console.encoding) or None)
    console.print(plain, markup=False, highlight=False, emoji=False, soft_wrap=True)


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


def _build(columns: Sequence[tuple[str, Justify]], rows: list[list[str]], ascii_only: bool) -> Table:
    from rich.box import Box
    from rich.table import Table
    from rich.text import Text

    def cell(words: str) -> Text:
        return Text(to_ascii(words) if ascii_only else words)

    box = Box(_ASCII_RULES if ascii_only else _RULES)
    table = Table(box=box, safe_box=False, header_style="bold", border_style="dim")
    for header, justify in columns:
        table.add_column(cell(header), justify=justify, no_wrap=True)
    for row in rows:
        if len(row) != len(columns):
            raise ValueError(f"a row has {len(row)} entries, the table {len(columns)} columns: {row}")
        table.add_row(*map(cell, row))
    return table


def _print(console: Console, title: str, table: Table, notes: Sequence[str]) -> None:
    from rich.measure import Measurement
    from rich.segment import Segments
    from rich.text import Text

    boundless = console.options.update(width=100_000)
    options = boundless.update(width=Measurement.get(console, boundless, table).maximum)
    if title:
        console.print(Text(title, style="bold"), soft_wrap=True)
    # A terminal that is too narrow wraps whole lines: uglier than squeezed columns, but no digit is lost.
    console.print(Segments(console.render(table, options)), soft_wrap=True, end="")
    for note in notes:
        console.print(Text(note, style="dim"), soft_wrap=True)


def listed(names: Sequence[str]) -> str:
    """Return names in a row, cut after the first dozen."""
    return ", ".join(names[:SHOWN]) + (f", ... ({len(names)} in all)" if len(names) > SHOWN else "")


def html(
    title: str, columns: Sequence[tuple[str, str]], rows: Iterable[Sequence[object]], notes: Sequence[str] = ()
) -> str:
    """Return a table as HTML; arguments as those of ``text``.

    Parameters
    ----------
    title : str
        A line above the table; empty for none.
    columns : sequence of (str, str)
        Header of each column, and ``left`` or ``right``.
    rows : iterable of sequences
        One entry a column.
    notes : sequence of str
        Lines below the table.

    Returns
    -------
    str
        HTML.
    """
    looks = [_LOOKS.get(side, _LOOKS["left"]) for _, side in columns]
    head = "".join(f'<th style="{look}">{escape(name)}</th>' for (name, _), look in zip(columns, looks, strict=True))
    body = "".join(
        "<tr>" + "".join(f'<td style="{look}">{escape(str(cell))}</td>' for cell, look in zip(row, looks, strict=True))
        + "</tr>" for row in rows
    )  # fmt: skip
    words = "".join(f"<div>{escape(note)}</div>" for note in notes)
    above = f"<b>{escape(title)}</b>" if title else ""
    return f"<div>{above}<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{words}</div>"
