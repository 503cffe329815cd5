"""Files of figures: their formats, and how they are written."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from mbsvib.cli import _shell as shell

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMATS = (".png", ".pdf", ".svg")


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


def check_format(path: Path | None) -> None:
    """Refuse a ``path`` whose suffix figures do not have; None passes."""
    if path is not None and path.suffix.lower() not in FORMATS:
        raise shell.UsageProblem(f"'{path}': figures end in {', '.join(FORMATS)}.")


def default_path(name: str, figure: str) -> Path:
    """Return where a figure goes if no file is named."""
    return Path(f"{name}-{figure}".replace("/", "_"))
