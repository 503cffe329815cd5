"""What time responses and norms need of a plant with discrete-time controllers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.feedback.plant import LoopPlant


class Sampled(Protocol):
    """A plant whose controllers take ``rate`` samples a second [Hz] and act ``delay`` [s] later."""

    @property
    def plant(self) -> LoopPlant:
        """The plant."""

    @property
    def rate(self) -> float:
        """Samples a second [Hz]."""

    @property
    def delay(self) -> float:
        """Between measuring and acting [s]."""

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the sensors."""

    @property
    def actuators(self) -> tuple[str, ...]:
        """Names of the actuators."""

    @property
    def ports(self) -> tuple[list[int], list[int]]:
        """Numbers of the sensors among the outputs of the plant, and of the actuators among its inputs."""

    @property
    def name(self) -> str:
        """Name of the loop."""

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs wanted."""

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs given."""

    @property
    def selected_ports(self) -> tuple[list[int], list[int]]:
        """Numbers of the outputs wanted and of the inputs given, among those of the plant."""

    @property
    def discrete(self) -> tuple[Array, Array, Array, Array]:
        """The controllers, z+ = A z + B y, u = C z + D y."""
