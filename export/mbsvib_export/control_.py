"""python-control: StateSpace and FrequencyResponseData with all names kept."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any, overload

from numpy.typing import ArrayLike

from mbsvib.api.batch import Batch
from mbsvib.api.driven import DrivenBatch
from mbsvib.api.sparse_system import SparseSystem
from mbsvib.api.system import System
from mbsvib.common.selection import Names
from mbsvib.errors import ExportError
from mbsvib.feedback.controller import Controller
from mbsvib.feedback.feedback_loop import FeedbackLoop
from mbsvib.responses.state_space import StateSpace
from mbsvib.uncertain.plant import UncertainPlant
from mbsvib_export.names_ import SignalNames
from mbsvib_export.neutral import Source, linear_of, refusal, state_space_of
from mbsvib_export.packages import need
from mbsvib_export.sampling import discretised, doubt_step
from mbsvib_export.uncertain_ import centred, is_uncertain, refuse_steps

if TYPE_CHECKING:
    import control

    from mbsvib.feedback.closed_loop import ClosedLoop


SAME = 1e-9  # share by which two sample times may differ and be one


@overload
def to_control(
    system: Source | FeedbackLoop, realization: str = ..., dt: float | None = ..., *, method: str | None = ...,
    outputs: Names = ..., inputs: Names = ...,
) -> control.StateSpace: ...  # fmt: skip


@overload
def to_control(
    system: UncertainPlant, realization: str = ..., dt: float | None = ..., *, method: str | None = ...,
    outputs: Names = ..., inputs: Names = ...,
) -> tuple[control.StateSpace, dict[str, int]]: ...  # fmt: skip


@overload
def to_control(
    system: Batch | DrivenBatch, realization: str = ..., dt: float | None = ..., *, method: str | None = ...,
    outputs: Names = ..., inputs: Names = ...,
) -> list[control.StateSpace]: ...  # fmt: skip


def to_control(
    system: Source | FeedbackLoop | UncertainPlant | Batch | DrivenBatch, realization: str = "physical",
    dt: float | None = None, *, method: str | None = None, outputs: Names = None, inputs: Names = None,
) -> control.StateSpace | tuple[control.StateSpace, dict[str, int]] | list[control.StateSpace]:  # fmt: skip
    """Return a system as a state space of python-control, with the names of its states, inputs and outputs.

    x' = A x + B u,  y = C x + D u, the matrices bit for bit those of ``system.state_space(realization)``; no state is
    left out. Names go through ``SignalNames.to_control``, as python-control allows no dot in them: the signal
    ``"leg1.force"`` is ``"leg1:force"`` there, ``SignalNames.to_mbsvib`` leads back. Parts, sums, products and loops
    that python-control makes of the result keep names as well, see ``NamedStateSpace``.

    Modal states keep more digits. The entries of a physical A are rounded: at the resonances of a chain of 50 bodies
    the response is off by 4e-10, with modal states by 1e-11. Where slycot is installed, python-control also brings A to
    Hessenberg form, which costs the badly scaled physical states of a Stewart platform seven digits, modal and balanced
    ones (physical states times powers of two) none.

    An uncertain plant gives M of its linear fractional map and the repetitions of its parameters, as ``lftdata`` of
    MATLAB does: inputs "PARAMETER:w" and outputs "PARAMETER:z" come before those of the plant, w = delta z with delta
    from -1 at the lower to 1 at the upper limit, 0 in the middle.

    Next to a pole at 0 that no response contains, as that of PI on a velocity, python-control's ``dcgain`` is NaN;
    ``system.frequency_response([0.0])`` has the value.

    Parameters
    ----------
    system : System, ClosedLoop, SampledLoop, Controller, StateSpace, control.StateSpace, SystemData,
            UncertainPlant or Batch
        The equations of motion, a closed loop, or a state space that is ready; a batch gives a list. Of a system that
        is held sparse give some modes, ``system.reduced(20, correction=True)``; ``system.truncation_error`` tells what
        is missing. A sampled loop becomes a discrete system, exact for inputs that are held over each sample.
    realization : str
        The states of a System: "physical" (q and q'), "modal" or "balanced".
    dt : float, optional
        Step [s] of a discrete system; default: continuous in time. A sampled loop has its own.
    method : str, optional
        How a discrete system with the step ``dt`` is made: "zoh" (default), exact for inputs that are held over each
        step; "foh", exact for inputs that are linear over each step; "tustin", s = 2/dt (z - 1)/(z + 1).
    outputs, inputs : str or sequence of str, optional
        Names or patterns of those that are exported; default: all. ``control.interconnect`` warns of every signal that
        it does not connect, so that a loop is best made of the signals that it needs.

    Returns
    -------
    NamedStateSpace, of a batch a list of them, of an uncertain plant (NamedStateSpace, {name: repetitions})
        A control.StateSpace, SI units and radians; the names and repetitions are those of ``plant.blocks``.

    Raises
    ------
    ExportError
        If python-control is not installed or cannot hold the system, the step is not a positive number or that of a
        sampled loop, or the method is unknown or of no use there.
    ResponseError
        If the realization or a name is unknown.

    Warns
    -----
    AccuracyWarning
        If ``dt`` is many periods of all poles.
    UserWarning
        If an input and an output have one name: ``control.interconnect`` would wire the system to itself.
    """
    need("control", "to_control")
    from mbsvib.api.batch import Batch
    from mbsvib.api.driven import DrivenBatch
    from mbsvib.feedback.sampled import SampledLoop

    if isinstance(system, (Batch, DrivenBatch)):
        # outputs that have no proper state space are left out before there is one
        each: Any = map(system.__getitem__, range(len(system))) if isinstance(system, DrivenBatch) else \
            system.state_space(realization)  # fmt: skip
        return [to_control(variant, realization, dt, method=method, outputs=outputs, inputs=inputs) for variant in each]
    if is_uncertain(system):
        plant: Any = system
        refuse_steps(plant, dt, method)
        return to_control(centred(plant, realization, outputs, inputs)), dict(plant.blocks)
    if isinstance(system, SampledLoop):
        space: Any = system.with_ports(outputs, inputs)
        loop = space.sample_to_sample
        a, b, c, d, states = loop.A, loop.B, loop.C, loop.D, loop.states
        if dt is not None and abs(dt - space.period) > SAME * space.period:
            raise ExportError(f"to_control: dt = {dt!r}; expected {space.period!r}, the sample time of "
                              f"'{space.name}', or none.")  # fmt: skip
        if method not in (None, "zoh"):
            raise ExportError(f"to_control: method = {method!r}; '{space.name}' is a sampled loop, which is discrete "
                              f"already, exact for inputs that are held ('zoh'). Leave the method out.")  # fmt: skip
        dt = space.period
    elif dt is None and method is not None:
        raise ExportError(f"to_control: method = {method!r} without dt, the step [s]; expected both for a discrete "
                          f"system, or neither for one in continuous time.")  # fmt: skip
    else:
        space = state_space_of(system, realization, "to_control", outputs, inputs)
        states = space.states
        a, b, c, d = (space.A, space.B, space.C, space.D) if dt is None else discretised(
            space, dt, method or "zoh", "to_control")  # fmt: skip
        if dt is not None:
            doubt_step(space, dt, "to_control", "dt")
    if not space.inputs and 1 in (len(space.outputs), len(states)):
        raise ExportError(
            f"to_control: '{space.name}' has no inputs, and python-control cannot hold that together with a single "
            f"output or state; add an input (model.add_input), or another output (model.add_output)."
        )
    same = [name for name in space.inputs if name in space.outputs]
    if same:
        warnings.warn(f"to_control: input and output '{same[0]}' of '{space.name}' have one name, and "
                      f"control.interconnect closes a loop between signals of one name; rename one of them in the "
                      f"model, or connect by connections= and inplist=.", stacklevel=2)  # fmt: skip
    from mbsvib_export.control_space import NamedStateSpace

    # dt = 0: a system without states would be taken for one of no particular time.
    return NamedStateSpace(
        a, b, c, d, dt or 0,
        name=SignalNames.system_to_control(space.name, space.inputs + space.outputs),
        inputs=_names(space.inputs), outputs=_names(space.outputs), states=_names(states),
        remove_useless_states=False,
    )  # fmt: skip


def to_frd(
    system: System | SparseSystem | ClosedLoop | StateSpace | Controller, omega: ArrayLike, *, outputs: Names = None,
    inputs: Names = None,
) -> control.FrequencyResponseData:
    """Return the frequency response of a system as data of python-control, with the names of inputs and outputs.

    G(i w) as ``system.frequency_response`` computes it, from the factors of the matrices and not from a state space,
    so that resonances keep their digits.

    Parameters
    ----------
    system : System, SparseSystem, ClosedLoop, StateSpace, Controller or control.StateSpace
        The linear equations.
    omega : array-like, shape (n,)
        Angular frequencies [rad/s].
    outputs, inputs : str or sequence of str, optional
        Names or patterns of those that are exported; default: all.

    Returns
    -------
    control.FrequencyResponseData
        Response at these frequencies; SI units and radians. Names as in ``to_control``.

    Raises
    ------
    ExportError
        If python-control is not installed, or no System is given.
    ResponseError
        If a frequency is not finite or is an undamped pole of the system.
    """
    control = need("control", "to_frd")
    linear = linear_of(system)
    if linear is None:
        raise refusal(system, "to_frd", "a System (model.linearize()), a closed loop or a state space, which have a "
                      "frequency response")  # fmt: skip
    linear = linear.with_ports(outputs, inputs)
    return control.FrequencyResponseData(
        linear.frequency_response(omega), omega,
        name=SignalNames.system_to_control(linear.name, linear.inputs + linear.outputs),
        inputs=_names(linear.inputs), outputs=_names(linear.outputs),
    )  # fmt: skip


def _names(names: tuple[str, ...]) -> list[str]:
    return [SignalNames.to_control(name) for name in names]
