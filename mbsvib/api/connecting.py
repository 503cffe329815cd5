"""Loops closed around systems and state spaces."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mbsvib.api.loops import ClosedLoop
    from mbsvib.common.selection import Names


class Connecting:
    """Linear equations to which controllers can be connected."""

    inputs: tuple[str, ...]
    """Names of the inputs."""
    outputs: tuple[str, ...]
    """Names of the outputs."""

    # Any stands for a SampledLoop: the type of a controller does not tell whether it is discrete

    def feedback(
        self, controller: Any, sensors: Names = None, actuators: Names = None,
        name: str | None = None, noise: bool = False,
    ) -> ClosedLoop | Any:  # fmt: skip
        """Return the closed loop with a controller from sensors to actuators, u = w + K y: positive feedback.

        G + G_u (1 - K G_yu)^-1 K G_y, with the inputs w and outputs of the open loop; a controller that opposes what it
        measures has a negative gain

        Parameters
        ----------
        controller : Controller, StateSpace, control.StateSpace, control.TransferFunction or array-like
            An array, shape (actuators, sensors), is a static gain. One of python-control in discrete time runs at its
            sample time, behind a zero-order hold; ``loop.sampled(rate, delay)`` adds a delay.
        sensors, actuators : str or sequence of str, optional
            Names or patterns of outputs and of inputs, in the order of the controller's signals; default: the names
            that the controller has.
        name : str, optional
            Name of the controller in tables.
        noise : bool
            True: more inputs, "SENSOR.noise" [unit of the sensor], which the controller sees beside what is measured,
            and "ACTUATOR.noise" [unit of the actuator], which acts beside what it commands: u = K (y + n) + d.

        Returns
        -------
        ClosedLoop, or SampledLoop with a discrete controller
            With all methods of a system, ``margins`` and ``sampled``.

        Raises
        ------
        ResponseError
            If a name is unknown, shapes do not match, or a discrete controller has no sample time or a pole at z = -1.
        """
        from mbsvib.api.loops import ClosedLoop
        from mbsvib.feedback.closed_loop import connected
        from mbsvib.feedback.loop import LoopPlant

        return connected(LoopPlant(self), controller, sensors, actuators, name, ClosedLoop, noise)
