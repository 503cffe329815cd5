"""Measured data: frequency responses between named points of a structure, its nodes, and modes found from them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.common.display import Displayed
from mbsvib.errors import ResponseError, counted

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Complex


@dataclass(frozen=True, slots=True)
class Node:
    """A point of the structure: its ``number`` in the file, ``name`` (of its body, where known), ``position`` [m]."""

    number: int
    name: str
    position: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Point:
    """Where and how something is measured or excited: number of the node, and ``direction``.

    1, 2, 3 are translations along x, y, z, 4, 5, 6 rotations about them, with their sign, in the displacement
    coordinate system of the node; 0 is none of these, such as a relative displacement.
    """

    node: int
    direction: int


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredMode:
    """A mode: undamped ``frequency`` [Hz], ``damping_ratio`` [1] and ``shape`` (nodes, 6), x y z rx ry rz, world axes,
    for the nodes with the numbers ``nodes``; real where the mode is a normal one, NaN where it is not known.
    """

    name: str
    frequency: float
    damping_ratio: float
    nodes: tuple[int, ...]
    shape: Array | Complex

    def __post_init__(self) -> None:
        self.shape.setflags(write=False)


@dataclass(frozen=True, repr=False, eq=False)
class Measurement(Displayed):
    """Frequency responses ``responses`` (outputs, inputs, n) at ``omega`` (n,) [rad/s], in SI units, with all names.

    A pair that was not measured is NaN. ``output_points`` and ``input_points`` say where each output and input is,
    ``nodes`` are the points of the geometry, ``lines`` connect numbers of nodes for pictures, ``modes`` are those in
    the file. ``left_out`` lists what the file holds beside these. Arrays are read-only.
    """

    omega: Array
    responses: Complex
    outputs: tuple[str, ...]
    output_units: tuple[str, ...]
    output_points: tuple[Point, ...]
    inputs: tuple[str, ...]
    input_units: tuple[str, ...]
    input_points: tuple[Point, ...]
    nodes: tuple[Node, ...] = ()
    modes: tuple[MeasuredMode, ...] = ()
    lines: tuple[tuple[int, ...], ...] = ()
    left_out: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        shape = (len(self.outputs), len(self.inputs), len(self.omega))
        if self.responses.shape != shape:
            raise ResponseError(f"Measurement: responses has shape {self.responses.shape}; expected {shape}, outputs, "
                                f"inputs and frequencies.")  # fmt: skip
        for kind, names, units, points in (
            ("outputs", self.outputs, self.output_units, self.output_points),
            ("inputs", self.inputs, self.input_units, self.input_points),
        ):
            if len(set(names)) < len(names) or not len(names) == len(units) == len(points):
                raise ResponseError(f"Measurement: {kind} = {', '.join(names)} with {len(units)} units and "
                                    f"{len(points)} points; expected names that differ, with one of each.")  # fmt: skip
        self.omega.setflags(write=False)
        self.responses.setflags(write=False)

    @property
    def driving_points(self) -> tuple[tuple[str, str], ...]:
        """Pairs of output and input at the same node in the same direction, either sign."""
        return tuple((output, name) for output, at in zip(self.outputs, self.output_points, strict=True)
                     for name, point in zip(self.inputs, self.input_points, strict=True)
                     if (at.node, abs(at.direction)) == (point.node, abs(point.direction)))  # fmt: skip

    @property
    def is_measured(self) -> Array:
        """Which pairs were measured, (outputs, inputs), true or false."""
        return np.asarray(~np.isnan(self.responses).all(axis=2))

    def __repr__(self) -> str:
        groups = ((self.inputs, "input"), (self.outputs, "output"), (self.omega, "frequency"), (self.nodes, "node"),
                  (self.modes, "mode"))  # fmt: skip
        return f"Measurement({', '.join(counted(len(items), kind) for items, kind in groups)})"
