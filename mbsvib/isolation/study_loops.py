"""Closed loops of a study: the loops of any plant, with the figures of isolation."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsvib.api import loops
from mbsvib.feedback import closed_loop
from mbsvib.feedback.feedback_loop import FeedbackLoop
from mbsvib.isolation.isolation_study import figures

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from mbsvib.feedback.controller import Controller
    from mbsvib.isolation.isolation_study import Isolation
    from mbsvib.isolation.plant import Plant


class StudyFigures(FeedbackLoop):
    """What closed loops of a study answer, in continuous or discrete time."""

    plant: Plant
    """The system with force actuators and sensors in its legs."""

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
        self.check_stable()
        return figures(self.plant.scene, self, frequencies)


class SampledLoop(StudyFigures, loops.SampledLoop):
    """A closed loop of a study whose controllers run in discrete time."""


class ClosedLoop(StudyFigures, loops.ClosedLoop):
    """A mechanism with controllers; has the inputs and outputs of ``plant.system``, actuators take further forces."""

    sampled_form = SampledLoop


def close(plant: Plant, *controllers: Controller) -> ClosedLoop:
    """Return a plant of a study with its loops closed."""
    loop = closed_loop.close(plant, *controllers, form=ClosedLoop)
    assert isinstance(loop, ClosedLoop)
    return loop
