"""Progress of studies: a bar on a terminal, or a function of the caller."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic
from typing import TypeAlias

Progress: TypeAlias = "bool | Callable[[int, int], object] | None"
BAR = 30  # characters
PAUSE = 0.1  # s between two states of the bar


@contextmanager
def counting(progress: Progress, total: int, label: str, done: int = 0) -> Iterator[Callable[[int], None]]:
    """Count points that are done: on a bar on standard error, by default if that is a terminal, or by a function.

    A function ``progress`` is called with how many are done, and how many there are.
    """
    if callable(progress):
        count = [done]

        def tell(more: int) -> None:
            count[0] += more
            progress(count[0], total)

        yield tell
    elif progress or (progress is None and sys.stderr.isatty()):
        with _line(total, label, done) as tell_line:
            yield tell_line
    else:
        yield lambda more: None


@contextmanager
def _line(total: int, label: str, done: int) -> Iterator[Callable[[int], None]]:
    """One line on standard error that is written anew."""
    stream, began = sys.stderr, monotonic()
    count, shown = [done], [0.0]

    def write() -> None:
        spent = monotonic() - began
        share = count[0] / total if total else 1.0
        advanced = count[0] - done
        remaining = f", {spent * (total - count[0]) / advanced:.0f} s left" if advanced > 0 and count[0] < total else ""
        bar = "#" * round(BAR * share)
        stream.write(f"\r{label} [{bar:.<{BAR}}] {count[0]}/{total}, {spent:.0f} s{remaining}\x1b[K")
        stream.flush()

    def tell(more: int) -> None:
        count[0] += more
        if monotonic() - shown[0] >= PAUSE or count[0] >= total:
            shown[0] = monotonic()
            write()

    write()
    try:
        yield tell
    finally:
        stream.write("\n")
        stream.flush()
