"""What is certain of uncertain plants, as tables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common.columnar import Columnar, by_name
from mbsvib.common.display import Displayed
from mbsvib.common.display import upper as rounded_up
from mbsvib.common.units import pretty
from mbsvib.errors import counted

if TYPE_CHECKING:
    from mbsvib.uncertain.blocks import Block

SHOWN = 2  # parameters in a row of a table
ROUNDING = 1e-8  # share of half the width of limits below which a table shows a value as 0


@dataclass(frozen=True, repr=False, eq=False)
class _AtValues(Columnar, Displayed):
    """A result with the ``values`` of ``parameters`` at which it is reached."""

    name: str
    """Name of the system or loop."""
    lower: float
    upper: float
    values: Mapping[str, float]
    omega: float
    parameters: tuple[Block, ...] = field(default=(), repr=False)

    _index = "parameter"

    def columns(self) -> dict[str, Any]:
        """Return the parameters with their limits and the values at which the result is reached, as columns
        (parameters,) by name: ``parameter``, ``unit``, ``lower``, ``nominal``, ``upper``, ``value``.
        """
        shown = [block for block in self.parameters if block.name in self.values]
        return by_name(("parameter", "unit", "lower", "nominal", "upper", "value"), [
            (block.name, block.unit, block.low, block.nominal, block.high, self.values[block.name])
            for block in shown])  # fmt: skip

    def _table(self, title: str, notes: list[str]) -> dict[str, Any]:
        known = {block.name: block for block in self.parameters}
        rows = []
        for name, value in self.values.items():
            block = known.get(name)
            nominal, unit = (f"{block.nominal:.6g}", block.unit) if block else ("", "")
            shown = 0.0 if block and abs(value) < ROUNDING * block.half else value
            rows.append((name, nominal, f"{shown:.7g}", unit))
        columns = [("parameter", "left"), ("nominal", "right"), ("value", "right"), ("unit", "left")]
        return {"title": title, "columns": columns, "rows": rows, "notes": notes}


@dataclass(frozen=True, repr=False, eq=False)
class RobustStability(_AtValues):
    """How far all limits may be moved: the plant is stable for factors below ``lower`` on the distances from nominal,
    and not stable at ``values``, which are at the factor ``upper``; 1 stands for the limits as stated.

    ``omega`` [rad/s] is the frequency of the pole there, infinite where the equations become singular, as by a mass
    that vanishes. Without such values ``upper`` is infinite, ``values`` are empty and ``omega`` is not a number.
    ``parameters`` are those of the plant.
    """

    def table(self) -> dict[str, Any]:
        """Return the table of factors and values as arguments of ``mbsvib.common.tables.text`` and ``show``."""
        verdict = ("Stable at all values within the limits." if self.lower >= 1.0 else
                   "Not stable at all values within the limits." if self.upper <= 1.0 else
                   "Whether it is stable at all values within the limits is neither proven nor refuted.")  # fmt: skip
        notes = [verdict, f"Proven: stable with all limits {self.lower:.4g} times as far from the nominal values."]
        if self.values:
            what = f"a pole of {self.omega / (2.0 * np.pi):.4g} Hz does not decay" if np.isfinite(self.omega) else \
                "the equations become singular"  # fmt: skip
            notes.append(f"At the values of the table, {self.upper:.4g} times as far, {what}.")
        return self._table(f"Robust stability of {self.name}", notes)

    def __repr__(self) -> str:
        return f"RobustStability({self.name!r}: {self.lower:.4g} to {self.upper:.4g})"


@dataclass(frozen=True, repr=False, eq=False)
class WorstGain(_AtValues):
    """The largest gain within limits: it is reached, ``lower``, at ``values`` and ``omega`` [rad/s], and never above
    ``upper``. It is that from ``inputs`` to ``outputs``, with the ``unit`` of one pair; ``parameters`` are those
    of the plant.
    """

    outputs: tuple[str, ...] = ()
    inputs: tuple[str, ...] = ()
    unit: str = ""

    def table(self) -> dict[str, Any]:
        """Return the table of bounds and values as arguments of ``mbsvib.common.tables.text`` and ``show``."""
        unit = "" if self.unit in ("", "1") else f" {pretty(self.unit)}"
        notes = [f"Reached at the values of the table: {self.lower:.6g}{unit} at {self.omega / (2.0 * np.pi):.4g} Hz.",
                 f"Proven for all values within the limits: no more than {self.upper:.6g}{unit}."]  # fmt: skip
        if np.isinf(self.lower):
            notes = ["Infinite: the plant is not stable at these values."]
        ports = f", {_named(self.inputs, 'input')} → {_named(self.outputs, 'output')}" if self.outputs else ""
        return self._table(f"Worst gain of {self.name}{ports}", notes)

    def __repr__(self) -> str:
        return f"WorstGain({self.name!r}: {self.lower:.6g} to {self.upper:.6g})"


def _named(names: tuple[str, ...], kind: str) -> str:
    return ", ".join(names) if len(names) <= SHOWN else counted(len(names), kind)


@dataclass(frozen=True, repr=False, eq=False)
class WorstRms(Columnar, Displayed):
    """The largest root mean squares within limits: they are reached, ``lower`` {output: rms}, at ``values`` {output:
    {parameter: value}}, and never above ``upper`` {output: rms}, infinite where nothing is proven.
    """

    name: str
    """Name of the system or loop."""
    lower: Mapping[str, float]
    values: Mapping[str, Mapping[str, float]]
    upper: Mapping[str, float]

    def columns(self) -> dict[str, Any]:
        """Return a row for each output as columns (outputs,) by name: ``output``, ``lower``, ``upper``, and by their
        names the parameters at which ``lower`` is reached.
        """
        names = dict.fromkeys(name for values in self.values.values() for name in values)
        return by_name(("output", "lower", "upper", *names), [
            (output, value, self.upper[output], *[self.values[output][name] for name in names])
            for output, value in self.lower.items()])  # fmt: skip

    def table(self) -> dict[str, Any]:
        """Return the table of outputs as arguments of ``mbsvib.common.tables.text`` and ``show``."""
        rows = []
        for name, value in self.lower.items():
            places = [f"{p} = {v:.5g}" for p, v in self.values[name].items()]
            rows.append((name, f"{value:.5g}", rounded_up(self.upper[name]),
                         ", ".join(places[:SHOWN]) + (", ..." if len(places) > SHOWN else "")))  # fmt: skip
        open_ = tuple([name for name, value in self.lower.items() if np.isfinite(value) and np.isinf(self.upper[name])])
        notes = [f"No bound is proven for {_named(open_, 'output')}: the limits move resonances by many times their "
                 f"widths. Narrower limits, fewer parameters or more damping help."] * bool(open_)  # fmt: skip
        return {"title": f"Worst root mean squares of {self.name}", "columns": [("output", "left"),
                ("reached", "right"), ("proven", "right"), ("at", "left")], "rows": rows, "notes": notes}  # fmt: skip

    def __repr__(self) -> str:
        return f"WorstRms({self.name!r}: {', '.join(f'{name} {value:.4g}' for name, value in self.lower.items())})"
