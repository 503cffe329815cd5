"""Files of figures and of the tables behind them: their formats, and how they are written."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from mbsvib.cli import _shell as shell

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.figure import Figure

FORMATS, TABLE = (".png", ".pdf", ".svg"), ".csv"


def write_figure(figure: Figure, path: Path) -> Path:
    """Write a figure in the format of the path's suffix, completely or not at all."""
    from mbsvib.common.atomic_file import write_atomic

    check_format(path)
    return write_atomic(path, lambda stream: figure.savefig(stream, format=path.suffix[1:].lower()))


def deliver(figure: Figure, path: Path, as_json: bool, remark: str = "") -> None:
    """Write a figure, and say so below a ``remark`` where standard output does not have numbers."""
    write_figure(figure, path)
    if not as_json:
        shell.say("\n".join(filter(None, [remark, f"Written: {shell.shown(path)}"])))


def is_table(path: Path | None) -> bool:
    """Whether a path is that of a table."""
    return path is not None and path.suffix.lower() == TABLE


def deliver_table(columns: Mapping[str, Any], path: Path, as_json: bool) -> None:
    """Write columns as comma-separated values, and say so where standard output does not have numbers."""
    from mbsvib.common.columnar import write_csv

    write_csv(path, columns)
    if not as_json:
        shell.say(f"Written: {shell.shown(path)}")


def check_format(path: Path | None, *, table: bool = False) -> None:
    """Refuse a ``path`` whose suffix figures do not have; None passes, and with ``table`` that of a table."""
    if path is not None and path.suffix.lower() not in FORMATS and not (table and is_table(path)):
        more = f", tables in {TABLE}" if table else ""
        raise shell.UsageProblem(f"'{path}': figures end in {', '.join(FORMATS)}{more}.")


def default_path(name: str, figure: str) -> Path:
    """Return where a figure goes if no file is named."""
    return Path(f"{name}-{figure}".replace("/", "_"))
