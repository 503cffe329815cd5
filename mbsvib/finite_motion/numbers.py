"""The numbers of a mechanism's parts in expressions: values, or symbols where derivatives to them are asked for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from mbsvib.common.arguments import DIRECTIONS
from mbsvib.common.arrays import Array
from mbsvib.errors import ModelError, nearest

if TYPE_CHECKING:
    from mbsvib.elements.part import Part
    from mbsvib.mechanism.mechanism import Mechanism

ENDS = {"inertia": ("xx", "yy", "zz", "xy", "xz", "yz"), "stiffness": DIRECTIONS, "damping": DIRECTIONS,
        "preload": DIRECTIONS}  # fmt: skip


class Numbers:
    """The numbers of parts by name; those of ``parameters``, ``"crank.mass"``, are symbols."""

    def __init__(self, model: Mechanism, parameters: Sequence[str] = ()) -> None:
        known = model.parameters
        for name in parameters:
            if name not in known:
                raise ModelError(f"parameters: {name!r} is not a parameter of model '{model.name}'."
                                 f"{nearest(str(name), known)}", element=str(name), field="parameters")  # fmt: skip
        if len(set(parameters)) != len(parameters):
            raise ModelError(f"parameters = {list(parameters)}: a name is given twice; give each once.",
                             field="parameters")  # fmt: skip
        self.names = tuple(parameters)
        self.symbols = ca.SX.sym("p", len(self.names))
        self.values: Array = np.array([float(known[name]) for name in self.names])
        self._symbol = {name: self.symbols[i] for i, name in enumerate(self.names)}
        self._used: set[str] = set()

    def scalar(self, part: Part, field: str) -> Any:
        """Return a number of a part, 0 for None."""
        value = getattr(part, field)
        return self._number(f"{part.name}.{field}", 0.0 if value is None else value)

    def vector(self, part: Part, field: str) -> Any:
        """Return numbers (k,) of a part."""
        ends = ENDS.get(field, DIRECTIONS)
        stem = f"{part.name}.{field}" if field else part.name
        values = getattr(part, field)
        return ca.vertcat(*(self._number(f"{stem}.{end}", value) for end, value in zip(ends, values, strict=False)))

    def gravity(self, model: Mechanism) -> Any:
        """Return the acceleration of free fall (3,) [m/s^2]."""
        gravity = model.gravity or (0.0, 0.0, 0.0)
        return ca.vertcat(*(self._number(f"gravity.{end}", value)
                            for end, value in zip(DIRECTIONS[:3], gravity, strict=True)))  # fmt: skip

    def check_taken(self) -> None:
        """Refuse parameters that entered no expression as symbols."""
        for name in self.names:
            if name not in self._used:
                raise not_a_symbol(name)

    def _number(self, name: str, value: float) -> Any:
        if name in self._symbol:
            self._used.add(name)
            return self._symbol[name]
        return ca.SX(float(value))


def not_a_symbol(name: str) -> ModelError:
    """Return the refusal of a parameter that is not in the expressions, such as one of a beam."""
    return ModelError(f"parameters: '{name}' cannot be a symbol in finite motion; masses, centres, inertias, "
                      f"positions of joints, and numbers of springs and loads can.",
                      element=name, field="parameters")  # fmt: skip
