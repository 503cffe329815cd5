"""The interfaces of systems, closed loops and state spaces for figures."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from mbsvib.common.arrays import Array, Complex
    from mbsvib.equations.equations import Provenance
    from mbsvib.explain.energy_shares import StiffnessShares
    from mbsvib.modes.result import Modes
    from mbsvib.responses.basis import Basis
    from mbsvib.responses.step_info import StepInfo


class LinearModes(Protocol):
    """Natural frequencies, and whether responses settle."""

    @property
    def frequencies(self) -> Array:
        """Natural frequencies [Hz]."""

    @property
    def rigid(self) -> int:
        """Number of modes at rest."""

    @property
    def stable(self) -> bool:
        """Whether no mode is unstable."""


class Linear(Protocol):
    """What response figures need; systems, closed loops and state spaces have it."""

    @property
    def name(self) -> str:
        """Name of the equations."""

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""

    @property
    def input_units(self) -> tuple[str, ...]:
        """Units of the inputs."""

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""

    @property
    def output_units(self) -> tuple[str, ...]:
        """Units of the outputs."""

    def modes(self) -> LinearModes:
        """Return the modes."""

    def poles(self) -> Complex:
        """Return the poles [1/s]."""

    def transmission_zeros(self, outputs: Any = None, inputs: Any = None) -> Complex:
        """Return the zeros [1/s]."""

    def frequency_response(self, omega: ArrayLike, outputs: Any = None, inputs: Any = None) -> Complex:
        """Return the frequency response (outputs, inputs, n) at angular frequencies [rad/s]."""

    def time_response(
        self, t: ArrayLike, u: ArrayLike, hold: str = "first", initial: Any = None, outputs: Any = None,
        inputs: Any = None,
    ) -> Array:  # fmt: skip
        """Return the outputs (outputs, n) at times [s]."""

    def step_info(self, outputs: Any = None, inputs: Any = None, band: float = 0.02) -> StepInfo:
        """Return rise time, overshoot and settling time of step responses."""


class System(Linear, Protocol):
    """Linear equations of motion, and the methods that figures of modes use; ``mbsvib.System`` is one."""

    @property
    def dof(self) -> int:
        """Number of degrees of freedom, m."""

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates."""

    @property
    def coordinate_units(self) -> tuple[str, ...]:
        """Units of the coordinates."""

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of the bodies."""

    @property
    def cut_joints(self) -> tuple[str, ...]:
        """Names of the joints at which loops are cut."""

    @property
    def redundant(self) -> tuple[str, ...]:
        """Names of redundant constraint rows."""

    @property
    def provenance(self) -> Provenance:
        """How the equations came about."""

    @property
    def basis(self) -> Basis:
        """Modes and derived quantities."""

    def modes(self) -> Modes:
        """Return the modes."""

    def stiffness_shares(self, modes: Modes | None = None) -> StiffnessShares:
        """Return the strain energy of modes by element."""
