"""Plants with tunable parameters: second-order matrices, affine in them, in the form E x' = A x + B u."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.equations.terms import MATRICES
from mbsvib.linalg.groups import part_numbers
from mbsvib_export.affine import physical_affine
from mbsvib_export.fmu_.nominal import scales
from mbsvib_export.fmu_.plant import Plant, Tunable

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array

    Mask = NDArray[np.bool_]


def tunable_plant(source: Any, realization: str, tunable: tuple[str, ...]) -> Plant:
    """Return a plant with tunable parameters, in physical states.

    ``realization``: "physical": others would change with the parameters.
    """
    form = physical_affine(source, tunable, realization, "to_fmu", "tunable")
    system = form.nominal
    space = system.state_space()
    descriptor = _first_order(*(getattr(system, label) for label in MATRICES), unit=1.0)
    sizes = [matrix.size for matrix in descriptor]
    starts = np.cumsum([0, *sizes])
    entries = []
    for i, name in enumerate(form.names):
        slopes = _first_order(*(form.slopes[label][i] for label in MATRICES), unit=0.0)
        cells = [np.flatnonzero(matrix) for matrix in slopes]
        entries.append(Tunable(
            name, form.units[i], float(form.values[i]),
            np.concatenate([start + matrix for start, matrix in zip(starts[:-1], cells, strict=True)]).astype(np.int64),
            np.concatenate([matrix.ravel()[k] for matrix, k in zip(slopes, cells, strict=True)]),
        ))  # fmt: skip
    a, b, c, d, e, f = descriptor
    return Plant(
        space.name, space.realization, a, b, c, d, space.states, space.state_units, space.inputs, space.input_units,
        space.outputs, space.output_units, *scales(space.A, space.B, space.C, space.D, space.state_units), e, f,
        tuple(entries),
    )  # fmt: skip


def _first_order(
    mass: Array, damping: Array, stiffness: Array, b: Array, cq: Array, cv: Array, ca: Array, d: Array, *, unit: float
) -> tuple[Array, Array, Array, Array, Array, Array]:
    """A, B, C, D, E, F with x = (q, q'); ``unit`` is 1 for the equations and 0 for their derivatives."""
    m = len(mass)
    identity, none = unit * np.eye(m), np.zeros((m, m))
    return (
        np.block([[none, identity], [-stiffness, -damping]]), np.concatenate((np.zeros_like(b), b)),
        np.concatenate((cq, cv), axis=1), d, np.block([[identity, none], [none, mass]]),
        np.concatenate((np.zeros_like(ca), ca), axis=1),
    )  # fmt: skip


def patterns(plant: Plant) -> dict[str, Mask]:
    """Return where E^-1 A, E^-1 B, C + F E^-1 A and D + F E^-1 B may differ from zero for any values of the parameters.

    Arrays of bool by "A", "B", "C" and "D".
    """
    assert plant.E is not None
    assert plant.F is not None
    matrices = (plant.A, plant.B, plant.C, plant.D, plant.E, plant.F)
    flat = np.concatenate([item.ravel() != 0 for item in matrices])
    for item in plant.tunable:
        flat[item.indices] = True
    ends = np.cumsum([item.size for item in matrices])[:-1]
    a, b, c, d, e, f = (part.reshape(item.shape) for part, item in zip(np.split(flat, ends), matrices, strict=True))
    part = part_numbers(e)
    joined = part[:, None] == part
    a, b = joined @ a, joined @ b
    return {"A": a, "B": b, "C": c | (f @ a), "D": d | (f @ b)}
