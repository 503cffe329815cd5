"""Closed loops as users get them: with what they answer under noise."""

from __future__ import annotations

from mbsvib.api.elsewhere import FUNCTIONS, tell_functions
from mbsvib.feedback import closed_loop, sampled
from mbsvib.random.verbs import RandomVerbs


class SampledLoop(RandomVerbs, sampled.SampledLoop):
    """A closed loop whose controllers, discretised by Tustin's rule, run at ``rate`` [Hz] and act ``delay`` [s] later.

    Sensors are read before forces change. Poles, margins and stability are exact, those of the mechanism from sample to
    sample; poles as 1/s. Frequency responses are the components at the frequency of the excitation, exact as
    well; what sampling folds from there to other frequencies is not in them. ``continuous`` is the loop with the
    controllers in continuous time.
    """


class ClosedLoop(RandomVerbs, closed_loop.ClosedLoop):
    """A plant with controllers, u = w + K y; has the inputs w and outputs of ``plant.system``, or some of them.

    It has all methods of a system. Under static gains without feedthrough the loop is a system of second order again,
    ``second_order``, of which its modes and states are; accelerations may add mass to it.
    """

    sampled_form = SampledLoop


tell_functions(ClosedLoop, FUNCTIONS, "loop")
