"""Interrupts from the keyboard that compiled code swallows."""

from __future__ import annotations

import signal
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from types import FrameType


@contextmanager
def noticing_interrupts() -> Iterator[Callable[[], bool]]:
    """Notice interrupts from the keyboard, also those that code in C turns into errors of its own.

    The context gives a function that tells whether there was one. In threads other than the main one there are none.
    """
    noticed = False
    before = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(before):
        yield lambda: False
        return

    def handle(number: int, frame: FrameType | None) -> None:
        nonlocal noticed
        noticed = True
        before(number, frame)

    signal.signal(signal.SIGINT, handle)
    try:
        yield lambda: noticed
    finally:
        signal.signal(signal.SIGINT, before)
