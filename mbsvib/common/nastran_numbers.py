"""Numbers as Nastran writes them: blank integers are 0, and 1.5D+3 and 1.5+3 are 1.5e3."""

from __future__ import annotations

import math
import re

_INTEGER = re.compile(r"[+-]?\d{1,18}")
_REAL = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+))(?:[EDed]?([+-]\d{1,4})|[EDed](\d{1,4}))?")


def nastran_integer(text: str) -> int:
    """Return an integer; a blank field is 0."""
    word = text.strip()
    if word and not _INTEGER.fullmatch(word):
        raise ValueError(f"{word[:40]!r} is no integer")
    return int(word or 0)


def nastran_real(text: str) -> float:
    """Return a real number."""
    match = _REAL.fullmatch(text.strip())
    if not match:
        raise ValueError(f"{text.strip()[:40]!r} is no number")
    value = float(f"{match[1]}e{match[2] or match[3] or 0}")
    if not math.isfinite(value):
        raise ValueError(f"{text.strip()[:40]!r} exceeds the range of numbers")
    return value
