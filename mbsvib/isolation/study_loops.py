"""Closed loops of a study: the loops of any plant, with the figures of isolation."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.feedback import closed_loop, sampled
from mbsvib.feedback.feedback_loop import FeedbackLoop
from mbsvib.isolation.asymptote import direct, without_rounding
from mbsvib.isolation.isolation_study import figures

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from mbsvib.api.system import System
    from mbsvib.common.arrays import Array
    from mbsvib.feedback.controller import Controller
    from mbsvib.isolation.isolation_study import Isolation
    from mbsvib.isolation.plant import Plant


class StudyFigures(FeedbackLoop):
    """What closed loops of a study answer, in continuous or discrete time."""

    plant: Plant

    @property
    @abstractmethod
    def far(self) -> System | ClosedLoop:
        """The loop or system with the same response at high frequency."""

    def direct(self) -> Array:
        """Return the feedthrough (outputs, inputs), with zeros where it is rounding."""
        plant, (y, u) = direct(self.plant.system), self.ports
        back = np.linalg.inv(np.eye(len(u)) - self.law.D @ plant[np.ix_(y, u)]) @ self.law.D
        value = plant + plant[:, u] @ back @ plant[y]
        terms = np.abs(plant) + np.abs(plant[:, u]) @ np.abs(back) @ np.abs(plant[y])
        return without_rounding(value, terms)

    def isolation(self, frequencies: ArrayLike | None = None) -> Isolation:
        """Return the figures of the closed loop.

        Parameters
        ----------
        frequencies : array-like, shape (n,), optional
            Ascending frequencies [Hz]; default: the band of the mechanism with open loops, resolving every resonance of
            open and closed ones.

        Returns
        -------
        Isolation
            Transmissibility, compliance and figures.

        Raises
        ------
        ResponseError
            If the loop is not stable.
        """
        return figures(self.plant.scene, self, frequencies)


class ClosedLoop(StudyFigures, closed_loop.ClosedLoop):
    """A mechanism with controllers; has the inputs and outputs of ``plant.system``, actuators take further forces."""

    @property
    def far(self) -> ClosedLoop:
        """The loop or system with the same response at high frequency."""
        return self

    def sampled(self, rate: float, delay: float = 0.0) -> SampledLoop:
        """Return the loop with discrete-time controllers.

        Parameters
        ----------
        rate : float
            Samples a second [Hz].
        delay : float
            Between measuring and acting [s].

        Returns
        -------
        SampledLoop
            The same loop with discrete controllers and a zero-order hold.
        """
        return sampled.sampled(self, rate, delay, SampledLoop)


class SampledLoop(StudyFigures, sampled.SampledLoop):
    """A closed loop of a study whose controllers run in discrete time."""

    @property
    def far(self) -> System:
        """The mechanism: a hold blocks high frequencies."""
        return self.plant.system


def close(plant: Plant, *controllers: Controller) -> ClosedLoop:
    """Return a plant of a study with its loops closed."""
    loop = closed_loop.close(plant, *controllers, form=ClosedLoop)
    assert isinstance(loop, ClosedLoop)
    return loop
