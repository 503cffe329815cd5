"""Numbers in texts: decimal digits of ASCII only, and numbers as Nastran writes them.

Python alone also reads ``1_0`` as 10, digits of other scripts, ``nan`` and ``infinity``, which no file format means.
"""

from __future__ import annotations

import math
import re

_INTEGER = re.compile(r"[+-]?[0-9]{1,18}")
_REAL = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_NASTRAN = re.compile(r"([+-]?[0-9.]+)(?:[EDed]?([+-][0-9]{1,4})|[EDed]([0-9]{1,4}))")
_BLANKS = " \t\r\n"
_SHOWN = 40


def real(text: str) -> float:
    """Return the finite decimal number that a text is, blanks around it aside; ValueError if it is none."""
    word = text.strip(_BLANKS)
    if not _REAL.fullmatch(word):
        raise ValueError(f"{word[:_SHOWN]!r} is not a number")
    value = float(word)
    if not math.isfinite(value):
        raise ValueError(f"{word[:_SHOWN]!r} exceeds the range of numbers")
    return value


def integer(text: str) -> int:
    """Return the integer that a text is, blanks around it aside; ValueError if it is none."""
    word = text.strip(_BLANKS)
    if not _INTEGER.fullmatch(word):
        raise ValueError(f"{word[:_SHOWN]!r} is not an integer")
    return int(word)


def nastran_integer(text: str) -> int:
    """Return an integer of Nastran; a blank field is 0."""
    return integer(text) if text.strip() else 0


def nastran_real(text: str) -> float:
    """Return a real number of Nastran; 1.5D+3 and 1.5+3 are 1.5e3."""
    match = _NASTRAN.fullmatch(text.strip())
    return real(f"{match[1]}e{match[2] or match[3]}" if match else text)
