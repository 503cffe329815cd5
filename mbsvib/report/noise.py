"""Error budgets on the page: the table, and the figure of each output."""

from __future__ import annotations

from base64 import b64encode
from html import escape
from io import BytesIO
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mbsvib.random.budget import Budget

LINK = '<a href="#budget">Error budget</a>'
FIGURES = 6  # of the first outputs


def section(budget: Budget) -> str:
    """Return the section of an error budget as HTML."""
    table: dict[str, Any] = budget.table()
    words = ["words" if side == "left" else "" for _, side in table["columns"]]
    head = "".join(f'<th class="{kind}">{escape(name)}</th>' for (name, _), kind in
                   zip(table["columns"], words, strict=True))  # fmt: skip
    rows = "".join("<tr>" + "".join(f'<td class="{kind}">{escape(str(cell))}</td>' for cell, kind in
                                    zip(row, words, strict=True)) + "</tr>" for row in table["rows"])  # fmt: skip
    figures = "".join(_figure(budget, name) for name in budget.outputs[:FIGURES])
    notes = escape(" ".join(table["notes"]))
    return (f'<section id="budget"><div class="head"><h2>Error budget</h2><p class="remarks">{notes}</p></div>'
            '<div class="card wide"><div class="table" role="region" tabindex="0" aria-label="Contributions">'
            f"<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div></div>{figures}</section>")


def _figure(budget: Budget, output: str) -> str:
    stream = BytesIO()
    budget.plot(output).savefig(stream, format="png", bbox_inches="tight")
    words = escape(f"Density and cumulative root mean square of {output}", quote=True)
    code = b64encode(stream.getvalue()).decode("ascii")
    image = f'<img style="max-width:100%" src="data:image/png;base64,{code}" alt="{words}">'
    return f'<div class="card" style="margin-top:16px">{image}</div>'
