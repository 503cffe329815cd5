"""Running machines as quantities: shaking force, shaking moment and drive torques over a cycle, for balancing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.api.running import compiled_for, cycle_of
from mbsvib.common import arguments as check
from mbsvib.common.display import Displayed
from mbsvib.errors import ModelError, nearest
from mbsvib.studies.evaluation import Dual
from mbsvib.studies.quantities import Leaf, Quantity, quantity

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from mbsvib.api.model import Model
    from mbsvib.api.running import Cycle
    from mbsvib.cycles.sensitivities import CycleSensitivities
    from mbsvib.studies.evaluation import DesignPoint

UNITS = {"force": "N", "moment": "N m", "torque": "N m"}


class CycleMeasures(Displayed):
    """A cycle that is asked for at every point of a search; its quantities share one evaluation, which it keeps.

    ``mean_square`` and ``rms`` are quantities; ``weighted`` is their weighted sum, without unit.
    """

    def __init__(self, kwargs: Mapping[str, Any]) -> None:
        self._kwargs = dict(kwargs)
        self._last: _Evaluated | None = None

    def cycle(self, model: Model) -> Cycle:
        """Return the cycle of a model.

        Parameters
        ----------
        model : Model
            The machine.

        Returns
        -------
        Cycle
            ``model.cycle`` with the arguments given to ``studies.cycle``.

        Raises
        ------
        ModelError, SingularPoseError
            As ``Model.cycle`` does.
        """
        return model.cycle(**self._kwargs)

    def mean_square(self, quantity: str, drive: str | None = None) -> Quantity:
        """Return the mean square of a quantity, which has a derivative where it is zero, too.

        Parameters
        ----------
        quantity : str
            "force" [N^2], "moment" or "torque" [(N m)^2].
        drive : str, optional
            Which drive's torque; default: the only one.

        Returns
        -------
        Quantity
            1/n sum of |x_i|^2 over the samples.

        Raises
        ------
        ModelError
            If there is no such quantity.
        """
        _checked(quantity)
        unit = UNITS[quantity] if " " not in UNITS[quantity] else f"({UNITS[quantity]})"
        return _OfCycle(f"mean square {quantity} [{unit}^2]", partial(self._square, quantity=quantity, drive=drive))

    def rms(self, quantity: str, drive: str | None = None) -> Quantity:
        """Return the root mean square of a quantity, for constraints; it has no derivative where it is zero.

        Parameters
        ----------
        quantity : str
            "force" [N], "moment" or "torque" [N m].
        drive : str, optional
            Which drive's torque; default: the only one.

        Returns
        -------
        Quantity
            sqrt(1/n sum of |x_i|^2).

        Raises
        ------
        ModelError
            If there is no such quantity.
        """
        root = self.mean_square(quantity, drive) ** 0.5
        root.label = f"rms {quantity} [{UNITS[quantity]}]"
        return root

    def weighted(self, model: Model, weights: Mapping[str, float]) -> Quantity:
        """Return a weighted sum of mean squares, each divided by its value of a model.

        sum of w_x <x^2> / <x^2>_model

        Parameters
        ----------
        model : Model
            The machine that is compared with; mean squares that are zero there are not divided.
        weights : mapping of str to float
            Weights w of "force", "moment" and "torque", not negative.

        Returns
        -------
        Quantity
            The sum.

        Raises
        ------
        ModelError
            If there is no such quantity, or no positive weight.
        """
        if not isinstance(weights, Mapping) or not weights:
            raise check.refuse("cycle", "weights", weights, "weights by name, {'force': 1.0, 'torque': 0.5}")
        factors = {name: check.number(value, "cycle", f"weights[{name!r}]") for name, value in weights.items()}
        for name in factors:
            _checked(name)
        if min(factors.values()) < 0.0 or not any(factors.values()):
            raise check.refuse("cycle", "weights", weights, "weights that are not negative, and one that is positive")
        cycle = self.cycle(model)
        total: Quantity = quantity(0.0)
        for name, weight in factors.items():
            if weight:
                for drive in cycle.drives if name == "torque" else (None,):
                    total = total + (weight / (cycle.rms(name, drive) ** 2 or 1.0)) * self.mean_square(name, drive)
        total.label = "weighted mean square of " + ", ".join(f"{name} ({weight:g})" for name, weight in factors.items())
        return total

    def __repr__(self) -> str:
        return f"CycleMeasures({', '.join(name for name, value in self._kwargs.items() if value is not None)})"

    def _square(self, point: DesignPoint, quantity: str, drive: str | None) -> Dual:
        last = self._last
        if last is None or not last.belongs_to(point):
            last = self._last = _evaluated(self._kwargs, point, last)
        slope = np.zeros((1, len(point.rates)))
        if last.slopes is not None:
            by_parameter = dict(zip(last.slopes.parameters, last.slopes.square(quantity, drive), strict=True))
            slope[0] = [sum(rate * by_parameter[name] for name, rate in rates.items())
                        for rates in point.rates.values()]  # fmt: skip
        return point.dual(np.array([last.cycle.rms(quantity, drive) ** 2]), slope)


@dataclass(frozen=True)
class _Evaluated:
    """The cycle at a design point, with its derivatives if variables are asked for."""

    point: DesignPoint
    cycle: Cycle
    slopes: CycleSensitivities | None

    def belongs_to(self, point: DesignPoint) -> bool:
        """Whether it is that of the same point."""
        return self.point.rates is point.rates and self.point.values is point.values


def _evaluated(kwargs: Mapping[str, Any], point: DesignPoint, last: _Evaluated | None) -> _Evaluated:
    """The cycle at a point; equations compiled at the last one serve again where only their symbols differ."""
    for variable, rates in point.rates.items():
        if not rates:
            raise ModelError(f"cycle: variable '{variable}' displaces joints, to which cycles have no derivatives; "
                             f"leave it out, or search in a model moved there.", element=variable)  # fmt: skip
    names = tuple(dict.fromkeys(name for rates in point.rates.values() for name in rates))
    if not names:
        return _Evaluated(point, point.model.cycle(**kwargs), None)
    like = last is not None and set(names) == set(last.cycle.machine.statement.names) and _same_but(
        names, last.point.model, point.model)  # fmt: skip
    cycle = cycle_of(point.model, kwargs,
                     last.cycle.machine if last is not None and like else compiled_for(point.model, kwargs, names)
                     )  # fmt: skip
    return _Evaluated(point, cycle, cycle.sensitivities(names))


def _same_but(names: tuple[str, ...], first: Model, second: Model) -> bool:
    """Whether two models differ by nothing but the values of some parameters."""
    after = second.parameters
    if not set(names) <= set(after) or not set(names) <= set(first.parameters):
        return False
    like = first.with_values({name: after[name] for name in names})
    return like.gravity == second.gravity and like.groups() == second.groups()


class _OfCycle(Leaf):
    """A number of a cycle, which no equations of small motion are needed for."""

    equations = False


def cycle(
    drive: str | None = None, angles: ArrayLike | None = None, *, speed: float | None = None,
    motion: Mapping[str, Any] | None = None, about: ArrayLike | None = None,
) -> CycleMeasures:  # fmt: skip
    """Return a cycle whose shaking force, shaking moment and drive torques are quantities for ``optimize``.

    Parameters
    ----------
    drive : str, optional
        Driven joint coordinate, ``"crank.rz"``; this and the others as for ``Model.cycle``.
    angles : array-like, shape (n,), optional
        Its values at the samples [rad, m].
    speed : float, optional
        Its rate [rad/s, m/s].
    motion : mapping of str to (q, qd, qdd), optional
        Instead of these: values, rates and accelerations of each driven coordinate.
    about : array-like, shape (3,), optional
        Point of the shaking moment [m]; default: the joint of the first drive.

    Returns
    -------
    CycleMeasures
        Its quantities are ``rms``, ``mean_square`` and ``weighted``.

    Source: H. Chaudhary, S. K. Saha, "Dynamics and Balancing of Multibody Systems" (2009), chapters 6 and 7.
    """
    return CycleMeasures({"drive": drive, "angles": angles, "speed": speed, "motion": motion, "about": about})


def _checked(quantity: Any) -> None:
    if quantity not in UNITS:
        raise check.refuse("cycle", "quantity", quantity, "'force', 'moment' or 'torque'",
                           nearest(str(quantity), UNITS).strip())  # fmt: skip
