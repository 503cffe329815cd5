"""hinfsyn and mixsyn of python-control by ctrlsys, which has wheels where slycot has none, and h2syn; with names."""

from __future__ import annotations

from numbers import Integral
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common.arguments import shown
from mbsvib.common.arrays import Array
from mbsvib.errors import ExportError
from mbsvib.isolation.synthesis import Synthesis, h2_synthesis, hinf_synthesis
from mbsvib.responses.from_control import is_control, is_transfer_function
from mbsvib_export.packages import need

if TYPE_CHECKING:
    import control

    from mbsvib_export.control_space import NamedStateSpace


def hinfsyn(plant: control.StateSpace, nmeas: int, ncon: int) -> tuple[NamedStateSpace, NamedStateSpace, float, Array]:
    """Return the controller u = K y that minimises the H-infinity norm of a plant, as ``control.hinfsyn`` does.

    (z, y) = P (w, u):  minimise over stabilising K the norm of P11 + P12 K (1 - P22 K)^-1 P21

    Parameters
    ----------
    plant : control.StateSpace
        The generalized plant P in continuous time.
    nmeas, ncon : int
        Number of measurements y, its last outputs, and of controls u, its last inputs.

    Returns
    -------
    controller, loop, norm, rcond : NamedStateSpace, NamedStateSpace, float, array
        The controller from the plant's last outputs to its last inputs, the closed loop of the others, its norm, and
        reciprocal condition numbers: controls, measurements, both Riccati equations.

    Raises
    ------
    ExportError
        If ctrlsys is not installed, or the plant or the numbers do not fit.
    ResponseError
        If no controller is found.

    Source: as ``mbsvib.isolation.hinf``.
    """
    matrices = _checked(plant, nmeas, ncon, "hinfsyn")
    synthesis = hinf_synthesis(matrices, nmeas, ncon, "hinfsyn")
    controller = _controller(synthesis, plant.output_labels[-nmeas:], plant.input_labels[-ncon:], plant)
    return controller, _loop(plant, controller), float(synthesis.norm or 0.0), synthesis.reciprocal_conditions


def h2syn(plant: control.StateSpace, nmeas: int, ncon: int) -> NamedStateSpace:
    """Return the controller u = K y that minimises the H2 norm of a plant, as ``control.h2syn`` does.

    Parameters
    ----------
    plant : control.StateSpace
        The generalized plant in continuous time, without feedthrough from w to z.
    nmeas, ncon : int
        Number of measurements, its last outputs, and of controls, its last inputs.

    Returns
    -------
    NamedStateSpace
        The controller from the plant's last outputs to its last inputs.

    Raises
    ------
    ExportError
        If the plant or the numbers do not fit.
    ResponseError
        If no controller is found.

    Source: Zhou, Doyle & Glover, Robust and Optimal Control (1996), section 14.5.
    """
    matrices = _checked(plant, nmeas, ncon, "h2syn")
    synthesis = h2_synthesis(matrices, nmeas, ncon, "h2syn")
    return _controller(synthesis, plant.output_labels[-nmeas:], plant.input_labels[-ncon:], plant)


def mixsyn(
    g: control.StateSpace, w1: Any = None, w2: Any = None, w3: Any = None
) -> tuple[NamedStateSpace, NamedStateSpace, tuple[float, Array]]:  # fmt: skip
    """Return the controller of mixed sensitivity, as ``control.mixsyn`` does.

    minimise the H-infinity norm of (w1 S, w2 K S, w3 T),  S = (1 + G K)^-1,  T = G K S

    The loop is one of negative feedback, u = K (r - y): ``system.feedback(-controller)`` closes it.

    Parameters
    ----------
    g : control.StateSpace
        The plant G in continuous time.
    w1, w2, w3 : system of python-control or float, optional
        Weights of errors, controls and outputs; of one input and output, for each signal alike.

    Returns
    -------
    controller, loop, (norm, rcond) : NamedStateSpace, NamedStateSpace, tuple
        The controller from the plant's outputs to its inputs; the loop from references to weighted signals, its norm,
        and reciprocal condition numbers as of ``hinfsyn``.

    Raises
    ------
    ExportError
        If ctrlsys is not installed, or weights do not fit.
    ResponseError
        If no controller is found.
    """
    plant = augw(g, w1, w2, w3)
    synthesis = hinf_synthesis(_checked(plant, g.noutputs, g.ninputs, "mixsyn"), g.noutputs, g.ninputs, "mixsyn")
    controller = _controller(synthesis, g.output_labels, g.input_labels, g)
    return controller, _loop(plant, controller), (float(synthesis.norm or 0.0), synthesis.reciprocal_conditions)


def augw(g: control.StateSpace, w1: Any = None, w2: Any = None, w3: Any = None) -> NamedStateSpace:
    """Return the generalized plant of mixed sensitivity, as ``control.augw`` does, with names.

    (w1 e, w2 u, w3 y, e) from (r, u), where e = r - y and y = G u

    Parameters
    ----------
    g : control.StateSpace
        The plant G.
    w1, w2, w3 : system of python-control or float, optional
        Weights of errors, controls and outputs; of one input and output, for each signal alike.

    Returns
    -------
    NamedStateSpace
        From ``r:...`` and the plant's inputs to ``w1:...``, ``w2:...``, ``w3:...`` and ``e:...``; its states are those
        of the plant and of the weights.

    Raises
    ------
    ExportError
        If there is no weight, or its number of inputs is another one than that of the signals.
    """
    need("control", "augw")
    from mbsvib_export.control_space import NamedStateSpace

    _check_continuous(g, "augw", "g")
    ny, nu, n = g.noutputs, g.ninputs, g.nstates
    weights = {name: _weight(value, count, name) for name, value, count in (
        ("w1", w1, ny), ("w2", w2, nu), ("w3", w3, ny)) if value is not None}  # fmt: skip
    if not weights:
        raise ExportError("augw: there is no weight; give one of w1, w2 and w3.")
    total = n + sum(weight.nstates for weight in weights.values())
    # (e, u, y) = observed x + direct (r, u), with the plant's states first
    observed = {"w1": -g.C, "w2": np.zeros((nu, n)), "w3": g.C}
    direct = {"w1": np.hstack((np.eye(ny), -g.D)), "w2": np.hstack((np.zeros((nu, ny)), np.eye(nu))),
              "w3": np.hstack((np.zeros((ny, ny)), g.D))}  # fmt: skip
    a, b = np.zeros((total, total)), np.zeros((total, ny + nu))
    a[:n, :n], b[:n, ny:] = g.A, g.B
    rows, through, states, outputs, start = [], [], list(g.state_labels), [], n
    for name, weight in weights.items():
        part = slice(start, start + weight.nstates)
        a[part, :n], a[part, part], b[part] = weight.B @ observed[name], weight.A, weight.B @ direct[name]
        row = np.zeros((weight.noutputs, total))
        row[:, :n], row[:, part] = weight.D @ observed[name], weight.C
        rows.append(row)
        through.append(weight.D @ direct[name])
        labels = g.input_labels if name == "w2" else g.output_labels
        same = weight.noutputs == len(labels)
        outputs += [f"{name}:{labels[k] if same else k + 1}" for k in range(weight.noutputs)]
        states += [f"{name}:{k + 1}" for k in range(weight.nstates)]
        start = part.stop
    rows.append(np.hstack((observed["w1"], np.zeros((ny, total - n)))))
    through.append(direct["w1"])
    return NamedStateSpace(
        a, b, np.vstack(rows), np.vstack(through), 0, name=f"{g.name}_weighted", states=states,
        inputs=[*(f"r:{label}" for label in g.output_labels), *g.input_labels],
        outputs=[*outputs, *(f"e:{label}" for label in g.output_labels)], remove_useless_states=False,
    )  # fmt: skip


def _weight(value: Any, count: int, name: str) -> Any:
    """A weight as a state space with as many inputs as there are signals."""
    import control

    if isinstance(value, (int, float, np.number)) and not isinstance(value, bool) and np.isfinite(value):
        return control.ss([], [], [], float(value) * np.eye(count))
    if not (is_control(value) or is_transfer_function(value)) or value.dt not in (None, 0):
        raise ExportError(f"augw: {name} = {shown(value)}; expected a finite number, or a StateSpace or "
                          f"TransferFunction of python-control in continuous time.")  # fmt: skip
    space = control.ss(value)
    if space.ninputs == space.noutputs == 1 and count > 1:
        eye = np.eye(count)
        return control.StateSpace(*(np.kron(eye, getattr(space, key)) for key in "ABCD"), remove_useless_states=False)
    if space.ninputs != count:
        raise ExportError(f"augw: {name} has {space.ninputs} inputs; expected {count}, as many as there are signals, "
                          f"or one input and one output.")  # fmt: skip
    return space


def _check_continuous(value: Any, caller: str, field: str) -> None:
    if not is_control(value) or value.dt not in (None, 0):
        raise ExportError(f"{caller}: {field} = {type(value).__name__}; expected a control.StateSpace in continuous "
                          f"time, as to_control makes it.")  # fmt: skip


def _checked(plant: Any, nmeas: int, ncon: int, caller: str) -> tuple[Array, Array, Array, Array]:
    _check_continuous(plant, caller, "plant")
    whole = all(isinstance(each, Integral) and not isinstance(each, bool) for each in (nmeas, ncon))
    if not (whole and 0 < nmeas < plant.noutputs and 0 < ncon < plant.ninputs):
        raise ExportError(f"{caller}: nmeas = {shown(nmeas)}, ncon = {shown(ncon)}; the plant has {plant.noutputs} "
                          f"outputs and {plant.ninputs} inputs; expected smaller whole numbers from 1 on.")  # fmt: skip
    return plant.A, plant.B, plant.C, plant.D


def _controller(synthesis: Synthesis, inputs: list[str], outputs: list[str], plant: Any) -> NamedStateSpace:
    from mbsvib_export.control_space import NamedStateSpace

    return NamedStateSpace(
        synthesis.A, synthesis.B, synthesis.C, synthesis.D, 0, name=f"{plant.name}_controller", inputs=list(inputs),
        outputs=list(outputs),
        states=[f"controller{k + 1}" for k in range(len(synthesis.A))], remove_useless_states=False,
    )  # fmt: skip


def _loop(plant: Any, controller: NamedStateSpace) -> NamedStateSpace:
    from mbsvib_export.control_space import NamedStateSpace

    loop: NamedStateSpace = NamedStateSpace.of(plant).lft(controller, controller.noutputs, controller.ninputs)
    return loop
