"""Mechanisms on rolling wheels as users get them: first-order equations of deviations from steady forward motion."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.api.elsewhere import tell_where
from mbsvib.api.state_space import StateSpace
from mbsvib.api.system import System
from mbsvib.common.arrays import Array, Complex
from mbsvib.common.expected import names as names_of
from mbsvib.errors import ModelError
from mbsvib.linalg.groups import part_numbers
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.rolling.equations import rolling_equations

if TYPE_CHECKING:
    from mbsvib.rolling.slopes import RollingSensitivities


@dataclass(frozen=True, repr=False, eq=False)
class RollingSystem(StateSpace):
    """x' = A x + B u, y = C x + D u of a mechanism on rolling wheels, about its steady forward motion.

    The states are coordinates, deviations from the steady motion seen by who travels along, and the fewer speeds
    ("d(NAME)/dt") that the wheels leave independent. Place, heading and wheel angles act on nothing: their eigenvalues
    are exactly 0, ``ignorable`` has their names. ``contact_forces`` [N] are the forces of the ground on each wheel in
    steady motion, world axes, ``spins`` [rad/s] the wheels' speeds about their axes. It has all methods of a state
    space, and the derivatives of its modes.
    """

    contact_forces: Mapping[str, Array] = field(default_factory=dict)
    """Forces of the ground on each wheel in steady motion (3,) [N], world axes."""
    spins: Mapping[str, float] = field(default_factory=dict)
    """Speeds of the wheels about their axes [rad/s]."""
    tied: tuple[str, ...] = ()
    """Coordinates that follow from others, as the wheels touch the ground."""
    driven: tuple[str, ...] = ()
    """Coordinates whose rates follow from other rates and positions, as the wheels do not slip."""
    origin: Any = None
    """The model that was linearized, and the coordinates that were asked for."""

    @property
    def ignorable(self) -> tuple[str, ...]:
        """Names of the states whose eigenvalues are 0 by structure: nothing drives them back, or depends on them."""
        part = part_numbers(self.A != 0.0, strong=True)
        alone = np.bincount(part)[part] == 1
        return tuple([name for name, single, value in zip(self.states, alone, np.diag(self.A), strict=True)
                      if single and value == 0.0])  # fmt: skip

    def mode_sensitivities(self, parameters: str | Iterable[str]) -> RollingSensitivities:
        """Return the derivatives of eigenvalues, frequencies and damping ratios to parameters of the model.

        Parameters
        ----------
        parameters : str or iterable of str
            Names or patterns, such as ``"travel.x"``, the speed, or ``"*.mass"``.

        Returns
        -------
        RollingSensitivities
            ``eigenvalues`` (parameters, states) in the order of ``modes().eigenvalues``, ``frequencies`` and
            ``damping_ratios`` (parameters, modes). To the speed they are exact but for rounding, to others good to
            some ten digits. Eigenvalues that are 0 by structure stay so.

        Raises
        ------
        ModelError
            If a parameter is unknown, or the mechanism does not roll when it changes.
        EquilibriumError
            If it is out of balance then.
        """
        from mbsvib.rolling.slopes import sensitivities

        model, independent = self._origin("mode_sensitivities")
        wanted = names_of(parameters, "mode_sensitivities", "parameters", ModelError)
        return sensitivities(model, self.states, independent, self.modes(), wanted)

    def eigenvalue_sensitivities(self, parameters: str | Iterable[str]) -> Complex:
        """Return the derivatives (parameters, states) of the eigenvalues, those of ``mode_sensitivities``."""
        return self.mode_sensitivities(parameters).eigenvalues

    def explain(self) -> str:
        """Return in words what the states are, what follows from them, and the steady motion."""
        lines = [super().explain()]
        for name, force in self.contact_forces.items():
            lines.append(f"  wheel '{name}': spins at {self.spins[name]:.6g} rad/s; the ground's force on it is "
                         f"({', '.join(f'{value:.6g}' for value in force)}) N")  # fmt: skip
        for text, listed in (("follow from others as wheels touch the ground", self.tied),
                             ("have rates that follow as wheels do not slip", self.driven),
                             ("are ignorable, with the eigenvalue 0", self.ignorable)):  # fmt: skip
            lines.append(f"  {text}: {', '.join(listed) or 'none'}")
        return "\n".join(lines)

    def _origin(self, caller: str) -> tuple[Mechanism, tuple[str, ...]]:
        if self.origin is None or self.realization != "rolling":
            raise ModelError(f"{caller}: the states of '{self.name}' are {self.realization!r}; derivatives are those "
                             f"of model.linearize() itself.")  # fmt: skip
        result: tuple[Mechanism, tuple[str, ...]] = self.origin
        return result


def rolling_system(model: Mechanism, independent: Sequence[str] | None, cut: Any, values: Any, method: Any) -> Any:
    """Return the equations of a model on rolling wheels, as ``linearize`` does; refuse what they cannot have."""
    for word, value, why in (("cut", cut, "loops are cut as they are by default"),
                             ("values", values, "vary them one by one, model.with_values({...}).linearize()"),
                             ("method", None if method == "dense" else method, "its equations are dense")):
        if value is not None:
            raise ModelError(f"linearize: {word} = {value!r}; model '{model.name}' has rolling wheels: {why}.",
                             element=model.name, field=word)  # fmt: skip
    wanted = () if independent is None else tuple(names_of(independent, "linearize", "independent", ModelError))
    got, wheels = rolling_equations(model, wanted), tuple(model.rolling)
    count = len(model.inputs)
    return RollingSystem(
        model.name, "rolling", got.a, got.b, got.c, got.d, got.transform, got.states, got.units,
        tuple(model.inputs), got.equations.input_units[:count], tuple(model.outputs), got.equations.output_units,
        contact_forces=dict(zip(wheels, got.contact_forces, strict=True)),
        spins=dict(zip(wheels, got.spins.tolist(), strict=True)), tied=got.tied, driven=got.driven,
        origin=(model.__copy__(), wanted),
    )  # fmt: skip


tell_where(RollingSystem, System, "a system on rolling wheels has first-order equations, A, B, C and D.")
