"""Units as they are written on axes and in tables: quotients, superscripts and prefixes."""

from __future__ import annotations

from math import floor, log10

_PREFIXES = {-12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}
_POWERS = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


def pretty(unit: str) -> str:
    """Return a unit with superscripts: ``m/s^2`` becomes ``m/s²``."""
    head, *rest = unit.split("^")
    for piece in rest:
        digits = len(piece) - len(piece.lstrip("-0123456789"))
        head += piece[:digits].translate(_POWERS) + piece[digits:]
    return head


def ratio(output: str, source: str) -> str:
    """Return the unit of output over input, what divides both cancelled: ``m/N``, ``rad/(N m)``, ``s^2``, ``1``."""
    if output == source or not output:
        return "1" if output == source or not source else f"1/{_grouped(source, ' /+')}"
    if not source:  # signals of python-control have no units
        return output
    top, _, top_below = output.partition("/")
    bottom, _, bottom_below = source.partition("/")
    if not top_below and output == bottom:
        return bottom_below
    if top_below == bottom_below and top_below and "+" not in output + source:
        output, source = top, bottom
    return f"{_grouped(output, '/+')}/{_grouped(source, ' /+')}"


def _grouped(unit: str, signs: str) -> str:
    return f"({unit})" if any(sign in unit for sign in signs) else unit


def time_unit(largest: float) -> tuple[float, str]:
    """Return the factor and the unit of times up to ``largest`` [s]: ms of usual controllers, else by ``prefix``."""
    return (1e3, "ms") if not largest or 1e-6 <= largest < 1.0 else prefix("s", largest)


def prefix(unit: str, largest: float) -> tuple[float, str]:
    """Return the factor and the prefixed unit in which values up to ``largest`` are easy to read.

    ``prefix("m", 2.8e-8)`` is ``(1e9, "nm")``: 28 nm. Sums and powers of units and zeros stay as they are.
    """
    if not unit:  # systems of python-control have none
        return 1.0, unit
    bracket = "(" if unit.startswith("(") else ""
    first = unit.removeprefix("(").replace("/", " ").split()[0]
    if not 0.0 < largest < float("inf") or "+" in unit or "^" in first or first == "1":  # µs² is (µs)²
        return 1.0, unit
    exponent = 3 * floor(log10(largest) / 3 + 1e-9)
    exponent = max(-12, min(9, exponent))
    if first == "rad" and exponent > 0:
        exponent = 0
    return 10.0**-exponent, bracket + _PREFIXES[exponent] + unit.removeprefix("(")
