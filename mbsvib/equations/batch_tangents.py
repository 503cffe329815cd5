"""Derivatives of the matrices of variants along directions in the space of parameters, by complex steps.

With values x + i h v the functions of the numbers give F + i h dF: real parts are those of the variant, imaginary parts
the derivative along v, as exact as F itself, since nothing is subtracted. All decisions are those of the variant:
ranks, pivots, and what is zero, where the imaginary part keeps its value.

B'' of loops follows from Phi B'' = 0: dB'' = -A^-1 dPhi B'' in the dependent coordinates. A direction along which a
redundant constraint contradicts the others takes degrees of freedom away: it has no derivative.

Source: Martins, Sturdza & Alonso, The complex-step derivative approximation, ACM Trans. Math. Softw. 29 (2003) 245.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.elements.coupler import Coupling
from mbsvib.equations.batch_loops import inverse_of, near_singular
from mbsvib.linalg.rank import ZERO_ALONG

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Bools
    from mbsvib.equations.batch_loops import LoopPivots
    from mbsvib.equations.batch_values import Values
    from mbsvib.equations.scene import Scene
    from mbsvib.kinematics.loops import Reduction


def closure_along(
    scene: Scene, values: Values, phi: Array, pivots: LoopPivots, closure: Array | None
) -> tuple[Reduction, Bools]:
    """Return B'' + i h dB'' (variants, n, m), and a mask (variants,) of directions that take degrees of freedom away.

    ``phi`` (variants, locked rows, n): Phi + i h dPhi. ``closure`` (variants, n, m): B'', None for the nominal one.
    """
    cuts, coordinates, nominal = scene.cuts, scene.coordinates, pivots.reduction
    lost = np.zeros(len(phi), dtype=bool)
    if cuts is None or nominal.matrix is None:
        return nominal, lost
    before = nominal.matrix if closure is None else closure
    change = phi.imag @ before
    result = np.broadcast_to(before, (*change.shape[:-2], *before.shape[-2:])).astype(complex)
    for block in pivots.blocks:
        kept = len(block.dependent)
        row_scale = np.broadcast_to(cuts.row_scale(block.group.length), phi.shape[:-1])[:, block.rows, None]
        column_scale = np.where(coordinates.turns[block.dependent], 1.0, block.group.length)
        matrix = row_scale * phi.real[:, block.rows[:, None], block.dependent] * column_scale
        right = row_scale * change[:, block.rows]
        regular = ~near_singular(inverse_of(matrix[:, :kept])[1], block)
        solution = np.empty((len(phi), kept, right.shape[-1]))
        solution[regular] = np.linalg.solve(matrix[regular, :kept], right[regular, :kept])
        solution[~regular] = np.linalg.pinv(matrix[~regular]) @ right[~regular]
        result.imag[:, block.dependent] = -column_scale[:, None] * solution
        left = np.abs(right - matrix @ solution)
        unit = np.where(coordinates.turns, 1.0, block.group.length)[block.group.columns, None]
        largest = (np.abs(before[..., block.group.columns, :]) / unit).max(axis=-2, keepdims=True, initial=0.0)
        limit = ZERO_ALONG * _moved(values, block.group.length)[:, None, None] * largest
        lost |= (left > limit).any(axis=(1, 2))
    return replace(nominal, matrix=result), lost


def _moved(values: Values, length: float) -> Array:
    """The largest motion or rotation of a body or joint, and change of a ratio, of steps (variants,) per ``length``."""
    result = np.zeros(values.count)
    for name, array in values.displacements.items():
        result = np.maximum(result, np.abs(array.imag) / (1.0 if name.rpartition(".")[2][0] == "r" else length))
    for part, fields in values.fields.items():
        for field, array in fields.items():
            if field in ("position", "start", "end", "pitch"):
                size = length
            elif field == "orientation":
                size = 1.0
            elif isinstance(values.parameters.parts[part], Coupling):
                size = float(np.abs(array.real).max()) or 1.0
            else:
                continue
            result = np.maximum(result, np.abs(array.imag).reshape(-1, values.count).max(axis=0) / size)
    return result
