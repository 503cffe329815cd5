"""Units, points, nodes and quantities of the channels of a measurement."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from mbsvib.common.arguments import shown
from mbsvib.common.expected import one_of
from mbsvib.elements.ports import QUANTITIES
from mbsvib.errors import ResponseError, an
from mbsvib.measurement.matching import ORDERS, unit_of
from mbsvib.measurement.points import nodes_of, points_of


def channels_of(of: Any, outputs: Sequence[str], inputs: Sequence[str], who: str) -> dict[str, Any]:
    """Return units, points and nodes of the channels of a measurement, and the quantities of outputs, by its fields."""
    result: dict[str, Any] = {"nodes": nodes_of(of.nodes)}
    for kind, names in (("output", outputs), ("input", inputs)):
        units = getattr(of, f"{kind}_units") or ("",) * len(names)
        if not all(isinstance(unit, str) for unit in units):
            raise ResponseError(f"{who}: {kind}_units = {shown(list(units))}; expected texts such as 'm/s^2', '' where "
                                f"a unit is not known.")  # fmt: skip
        if len(units) != len(names):
            raise ResponseError(f"{who}: {len(units)} {kind}_units for the {kind}s {', '.join(names)}; expected one of "
                                f"each.")  # fmt: skip
        points, nodes = points_of(getattr(of, f"{kind}_points"), names, result["nodes"], f"{who}: {kind}s")
        result |= {f"{kind}_units": tuple(map(unit_of, units)), f"{kind}_points": tuple(points), "nodes": tuple(nodes)}
    return result | {"quantity": _quantities(of.quantity, outputs, result["output_units"], who)}


def _quantities(given: Any, names: Sequence[str], units: Sequence[str], who: str) -> tuple[str, ...]:
    """Return the quantity of each output; "" where neither quantity nor unit says it."""
    listed: tuple[Any, ...] = (given,) * len(names) if given is None or isinstance(given, str) else tuple(given)
    if len(listed) != len(names):
        raise ResponseError(f"{who}: quantity = {shown(list(listed))}; expected one, or one of each output "
                            f"({', '.join(names)}).")  # fmt: skip
    result: list[str] = []
    for name, quantity, unit in zip(names, listed, units, strict=True):
        by_unit = QUANTITIES[ORDERS[unit][1]] if unit in ORDERS else ""
        if quantity:
            one_of(quantity, tuple(QUANTITIES), who, f"quantity of '{name}'")
        if quantity and by_unit and quantity != by_unit:
            raise ResponseError(f"{who}: quantity of '{name}' = {quantity!r}, yet its unit is {unit}, of "
                                f"{an(by_unit)}; expected the same.")  # fmt: skip
        result.append(quantity or by_unit)
    return tuple(result)
