"""Inputs that are motions: responses and state spaces from those of the forces of moved ends.

The equations have the displacement and the velocity of a moved end as two inputs, G_d and G_v. With n = 0, 1, 2 for an
input that is the displacement, velocity or acceleration,

    G = (G_d + s G_v) / s^n .

No derivative of an input enters the states: x' = A x + b_d u + b_v u' becomes, with z = x - b_v u,

    z' = A z + (b_d + A b_v) u,   y = C z + (D_d + C b_v) u + D_v u' ,

which is proper where D_v is 0 by structure. A velocity has the state r' = u, an acceleration r'' = u.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from mbsvib.elements.motion_input import MotionInput
from mbsvib.errors import ResponseError
from mbsvib.responses.feedthrough import direct

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike

    from mbsvib.common.arrays import Array, Complex
    from mbsvib.mechanism.mechanism import Mechanism
    from mbsvib.responses.state_space import StateSpace

S = TypeVar("S", bound="StateSpace")
QUANTITIES = ("displacement", "velocity")


@dataclass(frozen=True, slots=True)
class Drive:
    """An input ``name`` with its ``unit``, and the inputs of the equations by which it acts.

    ``columns``: names of one input, or of those by the displacement and the velocity of a moved end. ``order`` n: how
    often the input is integrated to the displacement. ``state_units``: those of displacement and velocity.
    """

    name: str
    unit: str
    columns: tuple[str, ...]
    order: int = 0
    state_units: tuple[str, str] = ("", "")

    @property
    def states(self) -> tuple[str, ...]:
        """Names of its states."""
        return tuple([f"{self.name}.{quantity}" for quantity in QUANTITIES[: self.order]])


def drives(model: Mechanism) -> tuple[Drive, ...]:
    """Return the inputs of a model and how they act in its equations.

    Parameters
    ----------
    model : Mechanism
        The mechanism of the user.

    Returns
    -------
    tuple of Drive
        One for each input.
    """
    result = []
    for name, part in model.inputs.items():
        if isinstance(part, MotionInput):
            columns = part.column_names(model.springs[part.element])
            result.append(Drive(name, part.unit, columns, part.order, part.state_units))
        else:
            result.append(Drive(name, part.unit, (name,)))
    return tuple(result)


def differ(known: Sequence[Drive]) -> bool:
    """Tell whether the equations have other inputs than the model."""
    return any(drive.columns != (drive.name,) for drive in known)


def driven_response(response: Any, inputs: Sequence[str], known: Sequence[Drive], omega: ArrayLike) -> Any:
    """Return responses to motions from those to the forces of moved ends.

    Parameters
    ----------
    response : array, shape (..., outputs, columns, n)
        Responses of the equations.
    inputs : sequence of str
        Names of the columns.
    known : sequence of Drive
        The inputs.
    omega : array-like, shape (n,)
        Angular frequencies [rad/s].

    Returns
    -------
    array, shape (..., outputs, inputs, n)
        (G_d + s G_v) / s^n.

    Raises
    ------
    ResponseError
        If a frequency is 0 and an input is integrated.
    """
    s: Complex = 1j * np.asarray(omega, dtype=float).reshape(-1)
    at = {name: k for k, name in enumerate(inputs)}
    result = np.empty((*response.shape[:-2], len(known), len(s)), dtype=complex)
    for k, drive in enumerate(known):
        if drive.order and not s.all():
            raise ResponseError(
                f"frequency_response: omega[{int(np.argmin(np.abs(s)))}] = 0 rad/s; input '{drive.name}' is integrated "
                f"to the displacement of its element's end, which is infinite there. Leave this frequency out, or "
                f"take quantity='displacement'."
            )  # fmt: skip
        result[..., k, :] = sum(response[..., at[name], :] * s ** (order - drive.order)
                                for order, name in enumerate(drive.columns))  # fmt: skip
    return result


def driven_space(space: S, known: Sequence[Drive], through: Array, name: str) -> S:
    """Return first-order equations with motions as inputs.

    Parameters
    ----------
    space : StateSpace
        That of the equations, with the columns of all inputs.
    known : sequence of Drive
        The inputs.
    through : array, shape (outputs, columns)
        D of these equations, 0 where it is rounding of its terms.
    name : str
        Name of the system.

    Returns
    -------
    StateSpace
        Its states are those of the equations, less b_v u of displacements, then those of the inputs.

    Raises
    ------
    ResponseError
        If an output needs the derivative of an input.
    """
    at = {column: k for k, column in enumerate(space.inputs)}
    _check_proper(space, known, through, at)
    start, added = len(space.A), sum(drive.order for drive in known)
    n, inputs = start + added, len(known)
    rates = len(space.transform)
    a, c, transform = np.zeros((n, n)), np.zeros((len(space.C), n)), np.zeros((rates, n))
    b, d, moved = np.zeros((n, inputs)), np.zeros((len(space.C), inputs)), np.zeros((rates, inputs))
    a[:start, :start], c[:, :start], transform[:, :start] = space.A, space.C, space.transform
    direct_rates = np.zeros((rates, len(space.inputs))) if space.through is None else space.through
    lost = False  # whether q' itself needs the derivative of an input
    place = start
    for k, drive in enumerate(known):
        columns = [at[column] for column in drive.columns]
        for order, column in enumerate(columns):
            given = space.B[:, column], space.D[:, column], direct_rates[:, column]
            if order < drive.order:  # it acts by a state
                state = place + order
                a[:start, state], c[:, state], transform[:, state] = given
            elif order == drive.order:
                b[:start, k] += given[0]
                d[:, k] += given[1]
                moved[:, k] += given[2]
            else:
                b[:start, k] += space.A @ given[0]
                d[:, k] += space.C @ given[0]
                moved[:, k] += space.transform @ given[0]
                lost |= bool(given[2].any())
        for order in range(drive.order):
            if order + 1 < drive.order:
                a[place + order, place + order + 1] = 1.0
            else:
                b[place + order, k] = 1.0
        place += drive.order
    states = tuple([state for drive in known for state in drive.states])
    units = tuple([unit for drive in known for unit in drive.state_units[: drive.order]])
    return replace(
        space, name=name, A=a, B=b, C=c, D=d, transform=transform[:0] if lost else transform,
        states=space.states + states, state_units=space.state_units + units,
        inputs=tuple([drive.name for drive in known]), input_units=tuple([drive.unit for drive in known]),
        through=moved if moved.any() and not lost else None, error_bound=None,
    )  # fmt: skip


def _check_proper(space: StateSpace, known: Sequence[Drive], through: Array, at: Mapping[str, int]) -> None:
    """Refuse outputs that need the derivative of an input."""
    for drive in known:
        if len(drive.columns) <= drive.order + 1:
            continue
        needs = np.flatnonzero(through[:, at[drive.columns[1]]])
        if len(needs):
            raise ResponseError(
                f"output '{space.outputs[needs[0]]}' needs the derivative of input '{drive.name}', a displacement "
                f"whose velocity acts through the damper of its element, so that there is no proper state space. "
                f"Give the input quantity='velocity', or leave this output out; the frequency response exists."
            )  # fmt: skip


def feedthrough_of(linear: Any, space: StateSpace) -> Array:
    """Return D (outputs, columns) of a system or of sparse equations, 0 where it is rounding of its terms."""
    return direct(linear) if getattr(linear, "kind", "") == "system" else space.D
