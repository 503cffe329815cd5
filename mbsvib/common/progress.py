"""Progress of studies: a bar on a terminal, or a function of the caller."""

from __future__ import annotations

import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

Progress: TypeAlias = "bool | Callable[[int, int], object] | None"


@contextmanager
def counting(progress: Progress, total: int, what: str, done: int = 0) -> Iterator[Callable[[int], None]]:
    """Count points that are done.

    Parameters
    ----------
    progress : bool, callable or None
        True: a bar on standard error; None: if that is a terminal; a function is called with how many are done, and
        how many there are.
    total : int
        How many there are.
    what : str
        Label of the bar.
    done : int
        How many are done before.

    Returns
    -------
    context manager
        Of a function of the number of further items that are done.
    """
    if callable(progress):
        count = [done]

        def tell(more: int) -> None:
            count[0] += more
            progress(count[0], total)

        yield tell
    elif progress or (progress is None and sys.stderr.isatty()):
        from rich import progress as rich
        from rich.console import Console

        columns = (rich.TextColumn("{task.description}"), rich.BarColumn(), rich.MofNCompleteColumn(),
                   rich.TimeElapsedColumn(), rich.TextColumn("left"), rich.TimeRemainingColumn())  # fmt: skip
        with rich.Progress(*columns, console=Console(file=sys.stderr)) as bar:
            task = bar.add_task(what, total=total, completed=done)
            yield lambda more: bar.advance(task, more)
    else:
        yield lambda more: None
