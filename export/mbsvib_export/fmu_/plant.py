"""What goes into an FMU: a state space, sizes of its states, and parameters on which its matrices depend affinely."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.equations.matrices import MATRICES
from mbsvib.errors import ExportError
from mbsvib.linalg.groups import part_numbers
from mbsvib.responses.from_control import is_control, is_transfer_function, of_control
from mbsvib_export.affine import physical_affine
from mbsvib_export.fmu_.nominal import experiment_times, nominal_values
from mbsvib_export.neutral import check_finite, state_space_of, with_ports

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array
    from mbsvib.common.selection import Names
    from mbsvib.responses.state_space import StateSpace

    Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Tunable:
    """A parameter on which the matrices depend affinely: derivatives ``slope`` of the entries at ``indices``, which
    counts from the start of A through B, C, D, E and F, row by row.
    """

    name: str
    unit: str
    value: float
    indices: NDArray[np.int64]
    slope: Array


@dataclass(frozen=True, slots=True)
class Plant:
    """E x' = A x + B u,  y = C x + F x' + D u; E and F are there only where parameters are ``tunable``.

    ``space`` has A, B, C, D; ``nominal`` are sizes of states, ``times`` stop time and step [s] of the experiment.
    """

    space: StateSpace
    nominal: Array
    times: tuple[float, float]
    E: Array | None = None
    F: Array | None = None
    tunable: tuple[Tunable, ...] = ()

    @property
    def blocks(self) -> NDArray[np.int64]:
        """First rows of the diagonal blocks of A, and the number of states."""
        n, coupled = len(self.space.states), self.space.A != 0
        if n == 0 or self.tunable:
            return np.unique(np.array([0, n], dtype=np.int64))
        index = np.arange(n)
        last_index = np.maximum(index, np.where(coupled | coupled.T, index, -1).max(axis=1))
        ends = np.flatnonzero(np.maximum.accumulate(last_index) == index) + 1
        return np.concatenate(([0], ends)).astype(np.int64)


def plant_of(source: Any, realization: str, tunable: tuple[str, ...], outputs: Names, inputs: Names) -> Plant:
    """Return what goes into an FMU; with ``tunable`` parameters states are physical: others would change with them."""
    if of_control(source):
        _check_control(source, tunable)
    if not tunable:
        space = state_space_of(source, realization, "to_fmu", outputs, inputs)
        check_finite(space, "to_fmu")
        return Plant(space, *_scales(space))
    form = physical_affine(with_ports(source, outputs, inputs), tunable, realization, "to_fmu", "tunable")
    space = form.nominal.state_space()
    a, b, c, d, e, f = descriptor = _first_order(*(getattr(form.nominal, label) for label in MATRICES), unit=1.0)
    starts = np.cumsum([0, *(matrix.size for matrix in descriptor[:-1])])
    entries = []
    for i, name in enumerate(form.names):
        slopes = _first_order(*(form.slopes[label][i] for label in MATRICES), unit=0.0)
        cells = [np.flatnonzero(matrix) for matrix in slopes]
        entries.append(Tunable(
            name, form.units[i], float(form.values[i]),
            np.concatenate([start + matrix for start, matrix in zip(starts, cells, strict=True)]).astype(np.int64),
            np.concatenate([matrix.ravel()[k] for matrix, k in zip(slopes, cells, strict=True)]),
        ))  # fmt: skip
    return Plant(replace(space, A=a, B=b, C=c, D=d), *_scales(space), e, f, tuple(entries))


def _scales(space: StateSpace) -> tuple[Array, tuple[float, float]]:
    """Nominal values of the states (n,), and stop time and step [s] of the default experiment."""
    values = np.linalg.eigvals(space.A).astype(complex)
    return nominal_values(space, values), experiment_times(values)


def _check_control(source: Any, tunable: tuple[str, ...]) -> None:
    """Refuse what is no continuous system of python-control, and parameters of one."""
    if not (is_control(source) or is_transfer_function(source)):
        raise ExportError(f"to_fmu: system = control.{type(source).__name__}; expected a control.StateSpace or "
                          f"control.TransferFunction.")  # fmt: skip
    name = str(source.name)
    if tunable:
        raise ExportError(f"to_fmu: tunable = {tunable!r}, but '{name}' comes from python-control, which knows no "
                          f"parameters; give a System (model.linearize()).")  # fmt: skip
    if source.dt not in (0, None):
        raise ExportError(f"to_fmu: '{name}' is discrete in time (dt = {source.dt}); expected one in continuous time. "
                          f"Design it in continuous time, or give control.d2c or an equivalent of it.")  # fmt: skip
    if is_control(source):
        check_finite(source, "to_fmu")


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
    """
    assert plant.E is not None
    assert plant.F is not None
    matrices = (*(getattr(plant.space, label) for label in "ABCD"), plant.E, plant.F)
    flat = np.concatenate([item.ravel() != 0 for item in matrices])
    for item in plant.tunable:
        flat[item.indices] = True
    ends = np.cumsum([item.size for item in matrices])[:-1]
    a, b, c, d, e, f = (part.reshape(item.shape) for part, item in zip(np.split(flat, ends), matrices, strict=True))
    part = part_numbers(e)
    joined = part[:, None] == part
    a, b = joined @ a, joined @ b
    return {"A": a, "B": b, "C": c | (f @ a), "D": d | (f @ b)}
