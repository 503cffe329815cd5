"""What all sensitivities of one system share: its network of connections and the vectors of its eigenvalues."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

from mbsvib.responses.basis import Basis
from mbsvib.sensitivities.adjoint_fields import complete_network
from mbsvib.sensitivities.network import bare
from mbsvib.sensitivities.spectrum import spectrum

if TYPE_CHECKING:
    from mbsvib.equations.equations import Equations
    from mbsvib.sensitivities.network import Network
    from mbsvib.sensitivities.spectrum import Pairs, Spectrum


class SensitivityBasis:
    """The network and the spectrum of one set of equations, each kept once it is known.

    Parameters
    ----------
    responses : Basis
        The equations of motion and their modes.
    """

    def __init__(self, responses: Basis) -> None:
        self.responses = responses

    @staticmethod
    def of(equations: Equations) -> SensitivityBasis:
        """Return the basis of some equations of which nothing is known yet."""
        return SensitivityBasis(Basis(equations))

    @property
    def equations(self) -> Equations:
        """The equations of motion."""
        return self.responses.equations

    @cached_property
    def network(self) -> Network:
        """Bodies and connections, without any parts where these do not make up all forces."""
        return complete_network(self.equations)

    @cached_property
    def bare_network(self) -> Network:
        """The same network without any parts."""
        return self.network if self.network.bare else bare(self.equations)

    @cached_property
    def spectrum(self) -> tuple[Spectrum, Pairs]:
        """Eigenvalues with their vectors, and the pairs of those that coincide."""
        known = spectrum(self.responses)
        return known, known.pairs()
