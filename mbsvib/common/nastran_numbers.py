"""Numbers as Nastran writes them: blank integers are 0, and 1.5D+3 and 1.5+3 are 1.5e3."""

from __future__ import annotations

import re

from mbsvib.common.number_text import integer, real

_REAL = re.compile(r"([+-]?[0-9.]+)(?:[EDed]?([+-][0-9]{1,4})|[EDed]([0-9]{1,4}))")


def nastran_integer(text: str) -> int:
    """Return an integer; a blank field is 0."""
    return integer(text) if text.strip() else 0


def nastran_real(text: str) -> float:
    """Return a real number."""
    match = _REAL.fullmatch(text.strip())
    return real(f"{match[1]}e{match[2] or match[3]}" if match else text)
