"""Common interface of a system and of a mechanism with closed loops, for figures and mean squares."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, TypeAlias

import numpy as np

from mbsvib.api.system import System

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import ArrayLike

    from mbsvib.common.arrays import Array, Complex
    from mbsvib.common.selection import Names
    from mbsvib.feedback.resolution import Resolution
    from mbsvib.responses.state_space import StateSpace


class LoopResponse(Protocol):
    """Responses of a mechanism with closed loops."""

    @property
    def name(self) -> str:
        """Name of the mechanism, and those of the controllers."""

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""

    @property
    def open_loop(self) -> System:
        """The mechanism with open loops."""

    @property
    def resolution(self) -> Resolution:
        """Poles and panels of the responses."""

    @property
    def far(self) -> Linear:
        """The loop or system with the same response at high frequency."""

    def poles(self) -> Complex:
        """Return the poles [1/s]."""

    def frequency_response(self, omega: ArrayLike, outputs: Names = None, inputs: Names = None) -> Complex:
        """Return responses (outputs, inputs, n) at angular frequencies [rad/s]."""

    def state_space(self, realization: str = "modal") -> StateSpace:
        """Return first-order equations."""

    def direct(self) -> Array:
        """Return the feedthrough (outputs, inputs), with zeros where it is rounding."""


Linear: TypeAlias = System | LoopResponse


def numbers(linear: Linear, outputs: Iterable[str], inputs: Iterable[str]) -> tuple[list[int], list[int]]:
    """Return the numbers of some outputs and inputs."""
    return [linear.outputs.index(name) for name in outputs], [linear.inputs.index(name) for name in inputs]


def responses(linear: Linear, omega: Array, outputs: Iterable[str], inputs: Iterable[str]) -> Complex:
    """Return responses (outputs, inputs, n) at angular frequencies (n,) [rad/s], of all ports at once."""
    return np.asarray(linear.frequency_response(omega)[np.ix_(*numbers(linear, outputs, inputs))])
