"""Cached modes of one system and quantities derived from them, computed on first access.

Dampers so strong that rounding of their products would affect the motions that they nearly lock.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, cast

import numpy as np

from mbsvib.common.arrays import Array, Complex
from mbsvib.common.expected import real
from mbsvib.equations.equations import Equations
from mbsvib.modes.classical import damper_rows
from mbsvib.modes.damped import Damped
from mbsvib.modes.general import General
from mbsvib.modes.result import RTOL, Modes, modes

if TYPE_CHECKING:
    from mbsvib.responses.energy_schur import EnergySchur
    from mbsvib.responses.modal_sum import ModalSum
    from mbsvib.responses.rounding import Changes, Noise


# Accuracy of modes for responses; modes that do not reach it are used nevertheless.
RESPONSE_RTOL = 1e-13


class Basis:
    """Modes of the class ``form`` and bases of one set of equations; each is computed once.

    ``source``: the basis of the same equations with other inputs and outputs, whose modes are shared.
    """

    def __init__(self, equations: Equations, form: type[Modes] = Modes, source: Basis | None = None) -> None:
        self.equations = equations
        self.form = form
        self.source = source

    def with_equations(self, equations: Equations) -> Basis:
        """Return the basis of the same equations with other inputs and outputs; modes are computed once for both."""
        return Basis(equations, self.form, self)

    def assume(self, modal: Damped | General) -> None:
        """Set the basis of the responses, if it is already known, such as one of a batch."""
        self.__dict__["modal"] = modal

    @property
    def computed(self) -> frozenset[str]:
        """Names of the quantities computed so far."""
        return frozenset(self.__dict__) - {"equations", "form", "source"}

    @cached_property
    def modes(self) -> Modes:
        """All modes at the default accuracy."""
        if self.source is not None:
            return self.source.modes
        return modes(self.equations, RTOL, False, self.form)

    def modes_within(self, rtol: float) -> Modes:
        """Return all modes at a relative accuracy ``rtol``; cached ones if they are accurate enough."""
        rtol = real(rtol, "modes", "rtol", "a relative accuracy such as 1e-12", least=0.0)
        good = float(self.modes.errors.max(initial=0.0)) <= rtol
        return self.modes if good else modes(self.equations, rtol, False, self.form)

    @cached_property
    def response_modes(self) -> Modes:
        """Modes as accurate as responses need them.

        Near a resonance a relative error of a frequency is amplified by 1 / (2 damping ratio); one of a shape is not.
        """
        if self.source is not None:
            return self.source.response_modes
        known = self.modes
        good = max(known.mixed, float(known.errors.max(initial=0.0))) <= RESPONSE_RTOL
        return known if good else modes(self.equations, RESPONSE_RTOL, True, self.form)

    @cached_property
    def modal(self) -> Damped | General:
        """The basis of the responses."""
        return self.response_modes.damped if self.source is None else self.source.modal

    @property
    def poles(self) -> Complex:
        """All eigenvalues [1/s], as accurate as responses need them."""
        return self.response_modes.eigenvalues

    @cached_property
    def modal_sum(self) -> ModalSum:
        """Transfer functions as sums over modes."""
        from mbsvib.responses.modal_sum import modal_sum

        return modal_sum(self.equations, self.modal)

    @cached_property
    def schur(self) -> EnergySchur:
        """The Schur form of the state matrix in energy coordinates."""
        if self.source is not None:
            return self.source.schur
        from mbsvib.responses.energy_schur import energy_schur

        return energy_schur(cast("Damped", self.modal))

    @cached_property
    def strong_dampers(self) -> Array | None:
        """Rows L with Gamma = L^T L if rounding of Gamma affects the other motions, else None."""
        if self.source is not None:
            return self.source.strong_dampers

        return strong_dampers(self.equations, cast("Damped", self.modal))

    @cached_property
    def rounding(self) -> Noise:
        """Bound of the rounding errors of sums over modes."""
        from mbsvib.responses.rounding import Noise

        return Noise.of(self.equations, cast("Damped", self.modal))

    @cached_property
    def rounding_changes(self) -> tuple[Changes, Changes]:
        """Bounds of the changes of responses by rounding of the equations: an approximate one, and the full one."""
        from mbsvib.responses.rounding import Changes

        return Changes.of(self.equations, cast("Damped", self.modal))


# Dampers are strong where rounding in Gamma exceeds that: eps |L|^T |L| in parts of omega_i + omega_j.
STRONG = 200.0


def strong_dampers(system: Equations, modal: Damped) -> Array | None:
    """Return rows L (dampers, m) with Gamma = L^T L if rounding of Gamma is significant, else None."""
    rows = None if modal.vectors is None else damper_rows(system, modal.shapes)
    if rows is None:
        return None
    dampers, terms = rows
    omega = np.sqrt(np.abs(modal.square))
    together = omega[:, None] + omega
    together[together == 0.0] = np.inf  # rigid-body modes do not share a damper: Gamma is diagonal there
    return dampers if (terms.T @ np.abs(dampers) > STRONG * together).any() else None
