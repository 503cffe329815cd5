"""Functions of numpy, with derivatives of their own, as functions of CasADi."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array

    Arrays = Callable[[Array], list[Array]]


def casadi_function(name: str, shape: tuple[int, int], parts: tuple[str, ...], value: Arrays, slopes: Arrays) -> Any:
    """Return a callback of CasADi, p -> (part, part, ...); keep it as long as expressions of it are used.

    ``shape``: numbers of rows of each part, and of entries of p. ``parts``: their names. ``value``: p (columns,) to the
    parts (rows,). ``slopes``: p to the derivatives of each, (rows, columns).
    """
    return _function_class()(name, shape, parts, value, slopes)


@cache
def _function_class() -> Any:
    """Return the class of functions, with that of derivatives; they exist where CasADi is."""
    import casadi

    class Slopes(casadi.Callback):
        """(p, part, ...) -> derivatives of each part to p."""

        def __init__(self, name: str, owner: Any, options: Any) -> None:
            casadi.Callback.__init__(self)
            self.owner = owner
            self.construct(name, options)

        def get_n_in(self) -> int:
            return 1 + len(self.owner.parts)

        def get_n_out(self) -> int:
            return len(self.owner.parts)

        def get_sparsity_in(self, k: int) -> Any:
            return casadi.Sparsity.dense(self.owner.columns if k == 0 else self.owner.rows, 1)

        def get_sparsity_out(self, k: int) -> Any:
            return casadi.Sparsity.dense(self.owner.rows, self.owner.columns)

        def eval(self, arguments: Any) -> Any:
            return [casadi.DM(array) for array in self.owner.slopes(arguments[0].full().ravel())]

    class Parts(casadi.Callback):
        """p -> the parts."""

        def __init__(self, name: str, shape: tuple[int, int], parts: tuple[str, ...], value: Any, slopes: Any) -> None:
            casadi.Callback.__init__(self)
            (self.rows, self.columns), self.parts, self.value, self.slopes = shape, parts, value, slopes
            self.jacobians: list[Any] = []  # CasADi keeps no reference to them
            self.construct(name, {})

        def get_n_in(self) -> int:
            return 1

        def get_n_out(self) -> int:
            return len(self.parts)

        def get_name_in(self, k: int) -> str:
            return "p"

        def get_name_out(self, k: int) -> str:
            return self.parts[k]

        def get_sparsity_in(self, k: int) -> Any:
            return casadi.Sparsity.dense(self.columns, 1)

        def get_sparsity_out(self, k: int) -> Any:
            return casadi.Sparsity.dense(self.rows, 1)

        def eval(self, arguments: Any) -> Any:
            return [casadi.DM(array) for array in self.value(arguments[0].full().ravel())]

        def has_jacobian(self) -> bool:
            return True

        def get_jacobian(self, name: str, inputs: Any, outputs: Any, options: Any) -> Any:
            self.jacobians.append(Slopes(name, self, options))
            return self.jacobians[-1]

    return Parts
