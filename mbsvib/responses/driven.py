"""Inputs that are motions: responses and state spaces from those of the forces of moved ends.

The equations have the displacement, the velocity and, of a driven joint, the acceleration as inputs of their own, G_0,
G_1 and G_2. With n = 0, 1, 2 for an input that is the displacement, velocity or acceleration,

    G = (G_0 + s G_1 + s^2 G_2) / s^n .

No derivative of an input enters the states: x' = A x + b_0 u + b_1 u' + b_2 u'' becomes, with s_2 = b_2,
s_1 = b_1 + A s_2 and z = x - s_1 u - s_2 u',

    z' = A z + (b_0 + A s_1) u,   y = C z + (D_0 + C s_1) u + (D_1 + C s_2) u' + D_2 u'' ,

which is proper where the last two are 0 by structure. A velocity has the state r' = u, an acceleration r'' = u.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.common.arrays import Array, Complex
from mbsvib.elements.motion_input import MotionInput
from mbsvib.elements.ports import QUANTITIES
from mbsvib.errors import ResponseError
from mbsvib.linalg.rank import ZERO_SUM
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.responses.feedthrough import direct

if TYPE_CHECKING:
    from mbsvib.responses.state_space import StateSpace

S = TypeVar("S", bound="StateSpace")


@dataclass(frozen=True, slots=True)
class Drive:
    """An input ``name`` with its ``unit``, and the inputs of the equations by which it acts.

    ``columns``: names of one input, or of those by the displacement, the velocity and the acceleration. ``order`` n:
    how often the input is integrated to the displacement. ``state_units``: those of displacement, velocity, ....
    """

    name: str
    unit: str
    columns: tuple[str, ...]
    order: int = 0
    state_units: tuple[str, ...] = ()

    @property
    def states(self) -> tuple[str, ...]:
        """Names of its states."""
        return tuple([f"{self.name}.{quantity}" for quantity in QUANTITIES[: self.order]])


def drives(model: Mechanism) -> tuple[Drive, ...]:
    """Return the inputs of the user's mechanism and how they act in its equations."""
    result = []
    for name, part in model.inputs.items():
        if isinstance(part, MotionInput):
            columns = part.column_names(model.springs.get(part.element))
            result.append(Drive(name, part.unit, columns, part.order, part.units))
        else:
            result.append(Drive(name, part.unit, (name,)))
    return tuple(result)


def differ(known: Sequence[Drive]) -> bool:
    """Tell whether the equations have other inputs than the model."""
    return any(drive.columns != (drive.name,) for drive in known)


def driven_response(response: Any, inputs: Sequence[str], known: Sequence[Drive], omega: ArrayLike) -> Any:
    """Return responses (..., outputs, inputs, n) to motions, (G_0 + s G_1 + s^2 G_2) / s^n, from those to the forces of
    moved ends.

    ``response`` (..., outputs, columns, n): that of the equations, ``inputs`` the names of its columns, ``known`` the
    inputs, ``omega`` (n,) [rad/s]. Raises an error if a frequency is 0 and an input is integrated.
    """
    s: Complex = 1j * np.asarray(omega, dtype=float).reshape(-1)
    at = {name: k for k, name in enumerate(inputs)}
    result = np.empty((*response.shape[:-2], len(known), len(s)), dtype=complex)
    for k, drive in enumerate(known):
        if drive.order and not s.all():
            raise ResponseError(
                f"frequency_response: omega[{int(np.argmin(np.abs(s)))}] = 0 rad/s; input '{drive.name}' is integrated "
                f"to the displacement of its element's end or joint, which is infinite there. Leave this "
                f"frequency out, or take quantity='displacement'."
            )  # fmt: skip
        result[..., k, :] = sum(response[..., at[name], :] * s ** (order - drive.order)
                                for order, name in enumerate(drive.columns))  # fmt: skip
    return result


def driven_space(space: S, known: Sequence[Drive], through: Array | None, name: str) -> S:
    """Return first-order equations with motions as inputs, whose states are those of the equations, less b_v u of
    displacements, then those of the inputs.

    ``space``: that of the equations, with the columns of all inputs. ``through`` (outputs, columns): D of these
    equations, 0 where it is rounding of its terms; None where no output needs a derivative. Raises an error if an
    output needs the derivative of an input.
    """
    at = {column: k for k, column in enumerate(space.inputs)}
    start, added = len(space.A), sum(drive.order for drive in known)
    n, inputs = start + added, len(known)
    rates = len(space.transform)
    a, c, transform = np.zeros((n, n)), np.zeros((len(space.C), n)), np.zeros((rates, n))
    b, d, moved = np.zeros((n, inputs)), np.zeros((len(space.C), inputs)), np.zeros((rates, inputs))
    a[:start, :start], c[:, :start], transform[:, :start] = space.A, space.C, space.transform
    direct_rates = np.zeros((rates, len(space.inputs))) if space.through is None else space.through
    lost = False  # whether q and q' themselves need the derivative of an input
    place = start
    for k, drive in enumerate(known):
        columns = [at[column] for column in drive.columns]
        shift = np.zeros(start)  # by the derivative of the input that comes next
        for order in reversed(range(drive.order, len(columns))):
            column = columns[order]
            if order > drive.order:
                if through is not None:
                    _check_proper(space, drive, through[:, column], shift)
                lost |= bool((direct_rates[:, column] + space.transform @ shift).any())
            else:
                d[:, k] = _direct(space.C, space.D[:, column], shift)
                moved[:, k] = direct_rates[:, column] + space.transform @ shift
            shift = space.B[:, column] + space.A @ shift
        b[:start, k] = shift
        for order, column in enumerate(columns[: drive.order]):  # it acts by a state
            state = place + order
            a[:start, state], c[:, state], transform[:, state] = (
                space.B[:, column], space.D[:, column], direct_rates[:, column])
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


def _check_proper(space: StateSpace, drive: Drive, through: Array, shift: Array) -> None:
    """Refuse outputs that need a derivative of an input, by ``through`` (outputs,) and what states are shifted by."""
    needs = np.flatnonzero(_direct(space.C, through, shift))
    if len(needs):
        joint = len(drive.columns) > 2
        higher = QUANTITIES[max(drive.order + 1, len(drive.columns) - 1)]
        how = "acts through the damper of its element" if not joint else "acts by the inertia that the joint moves"
        raise ResponseError(
            f"output '{space.outputs[needs[0]]}' needs the derivative of input '{drive.name}', a "
            f"{QUANTITIES[drive.order]} whose {higher} {how}, so that there is no proper state space. "
            f"Give the input quantity='{higher}', or leave this output out; the frequency response exists."
        )  # fmt: skip


def _direct(c: Array, d: Array, shift: Array) -> Array:
    """D + C s (outputs,) by the shift s of the states (n,), 0 where it is rounding of its terms."""
    terms = np.concatenate((d[:, None], c * shift), axis=1)
    result = terms.sum(axis=1)
    result[np.abs(result) <= ZERO_SUM * len(shift) * np.abs(terms).sum(axis=1)] = 0.0
    return np.asarray(result)


def feedthrough_of(linear: Any, space: StateSpace) -> Array:
    """Return D (outputs, columns) of a system or of sparse equations, 0 where it is rounding of its terms."""
    return direct(linear) if getattr(linear, "kind", "") == "system" else space.D
