"""Sizes of the entries of all matrices of a system, by which differences of them are judged."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbsvib.common.arrays import Array
from mbsvib.elements import BaseMotion, Body, Input, Output
from mbsvib.equations.equations import Equations
from mbsvib.equations.matrices import MATRICES

# Entries are as good as this share of the largest in their matrix deserves.
SMALL = 1e-6
# Entries are as good as this share of the terms that are summed in them deserves: rounding of these, a hundred times
# where loops are closed, is 1e-12 of them over the first step, and as much as is accepted of entries of this size.
ROUNDED = 1e-5
_BY_ORDER = ("Cq", "Cv", "Ca")
# Outputs of forces are sums of rows of these matrices, and as good as these rows.
_LIKE = {"Cq": "K", "Cv": "C", "Ca": "M", "D": "B"}


class MatrixEntries:
    """Entries of M, C, K, B, Cq, Cv, Ca and D in one row."""

    def __init__(self, system: Equations) -> None:
        self.system = system

    @cached_property
    def count(self) -> int:
        """Number of all entries."""
        return sum(getattr(self.system, key).size for key in MATRICES)

    @cached_property
    def loads(self) -> float:
        """The largest of the forces that cancel in the pose along a coordinate, 0 without any load."""
        statics = self.system.provenance.statics
        return 0.0 if statics is None else float(statics.size.max(initial=0.0))

    @cached_property
    def sizes(self) -> Array:
        """What entries are measured by: those of the system's own matrices."""
        return self.measured(np.concatenate([getattr(self.system, key).reshape(-1) for key in MATRICES]))

    @cached_property
    def empty(self) -> NDArray[np.bool_]:
        """Entries of matrices that are zero, as C is without dampers: they are measured by what they become."""
        matrices = [getattr(self.system, key) for key in MATRICES]
        return np.concatenate([np.full(matrix.size, not matrix.any()) for matrix in matrices])

    def measured(self, values: Array) -> Array:
        """The geometric mean of the largest of the row and of the column of entries, and at least a small share of the
        largest in their matrix, coordinates being scaled alike, and of the terms that are summed in them.
        """
        system, parts, start = self.system, [], 0
        unit = np.sqrt(np.abs(np.diagonal(system.M)) / (np.abs(np.diagonal(system.M)).max(initial=0.0) or 1.0))
        unit[unit == 0.0] = 1.0
        scales = {"B": (unit, None), "D": (None, None), "Cq": (None, unit), "Cv": (None, unit), "Ca": (None, unit)}
        levers = self._levers[:, None]
        for key in MATRICES:
            shape = getattr(system, key).shape
            start, stop = start + getattr(system, key).size, start
            size = np.abs(values[stop:start]).reshape(shape)
            mean = np.sqrt(np.multiply.outer(size.max(axis=1, initial=0.0), size.max(axis=0, initial=0.0)))
            left, right = (np.ones(n) if scale is None else scale
                           for n, scale in zip(size.shape, scales.get(key, (unit, unit)), strict=True))  # fmt: skip
            unlike = np.multiply.outer(left, right)
            least = np.full((len(left), 1), (size / unlike).max(initial=0.0))
            if key in _LIKE:
                like = np.abs(getattr(system, _LIKE[key])) / (1.0 if key == "D" else unit)
                least = np.maximum(least, levers * like.max(initial=0.0))
            parts.append((mean + SMALL * least * unlike + ROUNDED * self._terms[key]).reshape(-1))
        return np.concatenate(parts)

    @cached_property
    def _terms(self) -> dict[str, Array]:
        """Sizes of the terms that are summed in entries of B, Cq, Cv and Ca, which may cancel; 0 of others.

        They are those of ports and masses of bodies that all move as far as any does.
        """
        system, parts, motions = self.system, self.system.provenance.parts, self._motions
        result = {key: np.zeros(getattr(system, key).shape) for key in MATRICES}
        mass = sum(part.mass for part in parts if isinstance(part, Body))
        ports: Any = system.provenance.ports
        for part in ports:
            wrench = np.abs(getattr(part, "wrench", np.zeros(6)))
            if part.name in system.inputs and isinstance(part, (Input, BaseMotion)):
                moves = mass * motions[0] * (wrench @ self._reach) if part.moves_ground else wrench @ motions
                result["B"][:, system.inputs.index(part.name)] = moves
            elif part.name in system.outputs and isinstance(part, Output):
                result[_BY_ORDER[part.order]][system.outputs.index(part.name)] = wrench @ motions
        return result

    @cached_property
    def _reach(self) -> Array:
        """How far (6,) a unit shift and a unit turn move any point of the mechanism, three times each."""
        points = np.array([getattr(part, key) for part in self.system.provenance.parts for key in part.point_fields])
        return np.repeat([1.0, float(np.linalg.norm(np.ptp(points, axis=0))) if len(points) else 0.0], 3)

    @cached_property
    def _motions(self) -> Array:
        """How far any point of a body shifts and any body turns along each coordinate, (6, m), three times each."""
        motion = self.system.body_motion
        shift, turn = np.linalg.norm(motion.reshape(len(motion), 2, 3, self.system.dof), axis=2).max(
            axis=0, initial=0.0)  # fmt: skip
        return np.repeat([shift + self._reach[-1] * turn, turn], 3, axis=0)

    @cached_property
    def _levers(self) -> Array:
        """How much (outputs,) of rows of K, C, M or B outputs of forces are at least, 0 for all other outputs."""
        system = self.system
        shares = [np.abs(rows).max(axis=1, initial=0.0) / (np.abs(of).max(initial=0.0) or np.inf)
                  for rows, of in ((system.Cq, system.K), (system.Cv, system.C), (system.Ca, system.M),
                                   (system.D, system.B))]  # fmt: skip
        force = np.array([unit.startswith("N") for unit in system.output_units], dtype=bool)
        return np.where(force, np.maximum(1.0, np.max(shares, axis=0)), 0.0)

    def compared(self, values: Array) -> Array:
        """Return what the entries of changed matrices are compared with: ``sizes``, of empty matrices their change."""
        return np.where(self.empty, self.measured(values), self.sizes)
