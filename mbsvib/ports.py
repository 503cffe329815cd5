"""Ports: the model's inputs and outputs as rows of relative displacement, with their units."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.kinematics import Rows
from mbsvib.parts import BaseMotion, ForceOutput, Input
from mbsvib.parts.ports import QUANTITIES

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mbsvib.elements import Elements
    from mbsvib.kinematics import Array, Index
    from mbsvib.model import Model
    from mbsvib.parts import Body, Output

_FORCE = ("N", "N m")
_BASE = ("m/s^2", "rad/s^2")
_MOTION = (("m", "rad"), ("m/s", "rad/s"), _BASE)


@dataclass(frozen=True, slots=True)
class Ports:
    """Inputs and outputs in numbers: ``rows`` hold the force inputs, then the motion outputs.

    ``force_inputs`` and ``motion_outputs`` give the column of B and the row of the outputs that each row belongs to,
    ``derivative`` 0, 1 or 2 per motion output; the other kinds are listed with their place.
    """

    rows: Rows
    force_inputs: Index
    motion_outputs: Index
    derivative: Index
    base_motions: tuple[tuple[int, BaseMotion], ...]
    inertial_outputs: tuple[tuple[int, Output, tuple[float, float, float]], ...]
    force_outputs: tuple[tuple[int, int, Array], ...]
    input_units: tuple[str, ...]
    output_units: tuple[str, ...]


def ports(model: Model, bodies: list[Body], number: Mapping[str, int], springs: Elements) -> Ports:
    """Return the ports of a model.

    Parameters
    ----------
    model : Model
        The mechanism.
    bodies : list of Body
        Its bodies in order.
    number : mapping
        Number of each body, ground included.
    springs : Elements
        The rows of its spring-dampers, to which force outputs refer.

    Returns
    -------
    Ports
        Rows, places and units.
    """

    def row(part: Input | Output) -> tuple[float, ...]:
        a, b = number[part.relative_to], number[part.body]
        # a port on ground itself has no centre of mass: it sits at that of the body it refers to
        at = part.position or bodies[b if b < len(bodies) else a].position
        return (a, b, *at, *part.wrench)

    rows: list[tuple[float, ...]] = []
    force_inputs, motion_outputs, derivative = [], [], []
    base_motions, inertial, force_outputs = [], [], []
    input_units, output_units = [], []
    for i, source in enumerate(model.inputs.values()):
        if isinstance(source, BaseMotion):
            base_motions.append((i, source))
            input_units.append(unit(source.wrench, _BASE))
        else:
            force_inputs.append(i)
            rows.append(row(source))
            input_units.append(unit(source.wrench, _FORCE))
    order = {name: i for i, name in enumerate(model.springs)}
    for i, output in enumerate(model.outputs.values()):
        if isinstance(output, ForceOutput):
            force_outputs.append((i, order[output.element], np.array(output.wrench)))
            output_units.append(unit(output.wrench, _FORCE))
            continue
        motion_outputs.append(i)
        place = row(output)
        rows.append(place)
        order_of = QUANTITIES.index(output.quantity)
        derivative.append(order_of)
        output_units.append(unit(output.wrench, _MOTION[order_of]))
        if output.inertial and order_of == 2:
            inertial.append((i, output, (place[2], place[3], place[4])))
    return Ports(
        Rows.stack(rows), np.array(force_inputs, dtype=np.intp), np.array(motion_outputs, dtype=np.intp),
        np.array(derivative, dtype=np.intp), tuple(base_motions), tuple(inertial), tuple(force_outputs),
        tuple(input_units), tuple(output_units),
    )  # fmt: skip


@lru_cache
def unit(wrench: tuple[float, ...], units: tuple[str, str]) -> str:
    """Return the unit of a direction: of translations, of rotations, or both where it mixes them."""
    translates, turns = any(wrench[:3]), any(wrench[3:])
    return units[0] if not turns else units[1] if not translates else " + ".join(units)
