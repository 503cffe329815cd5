"""Re-reading of exports: frequency response and poles of what stands in a file against the model it came from.

Files are read as data. Only an FMU holds code, and this is run where the caller says so.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.api.system import System
from mbsvib.common import tables
from mbsvib.common.arguments import shown
from mbsvib.common.arrays import Array, Complex
from mbsvib.common.columnar import Columnar, by_name
from mbsvib.common.display import Displayed
from mbsvib.common.expected import a_path, flag, kind_of, reals
from mbsvib.errors import ExportError
from mbsvib.responses.state_space import StateSpace
from mbsvib_export import responses as answers
from mbsvib_export.neutral import Source, SystemData, data_of
from mbsvib_export.targets import BY_SUFFIX

if TYPE_CHECKING:
    from mbsvib.measurement.data import Measurement

Model = System | SystemData | StateSpace


LIMIT = 1e-6  # relative difference of responses: files with seven digits and transfer functions keep it
_ZERO = 1e-6  # poles below this share of the largest are taken for rigid-body modes
SUFFIXES = tuple([suffix for suffix, target in BY_SUFFIX.items() if target.checked])


@dataclass(frozen=True, slots=True, repr=False)
class Comparison(Displayed):
    """One line of a check: a ``quantity`` of the file, the reference ``against`` which it was compared, the largest
    relative ``error`` and its ``limit``.
    """

    quantity: str
    against: str
    error: float
    limit: float

    @property
    def passed(self) -> bool:
        """Whether the error is within its limit."""
        return self.error <= self.limit


@dataclass(frozen=True, slots=True, repr=False)
class ExportCheck(Columnar, Displayed):
    """What was compared in a file, and ``remarks`` on what was not; printed as a table."""

    path: Path
    comparisons: tuple[Comparison, ...]
    remarks: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether all errors are within their limits."""
        return all(comparison.passed for comparison in self.comparisons)

    def columns(self) -> dict[str, Any]:
        """Return the comparisons as columns ``quantity``, ``against``, ``error``, ``limit`` and ``passed``."""
        names = ("quantity", "against", "error", "limit", "passed")
        return by_name(names, [[getattr(row, name) for name in names] for row in self.comparisons])

    def __str__(self) -> str:
        rows = [(row.quantity, row.against, f"{row.error:.1e}", f"{row.limit:.0e}", "yes" if row.passed else "NO")
                for row in self.comparisons]  # fmt: skip
        table = tables.text(
            f"Check of {self.path.name}",
            [("in the file", "left"), ("against", "left"), ("error [1]", "right"), ("limit", "right"),
             ("passed", "right")], rows,
        )  # fmt: skip
        return "\n".join((table, *self.remarks))


def check_export(
    path: str | os.PathLike[str], system: Source | None = None, limit: float = LIMIT, *, run: bool = False
) -> ExportCheck:
    """Read a file of an exporter again, and compare frequency response and poles with the system.

    Without a system the equations in the file are compared with each other: state space, second-order equations, and
    the points that .mat files keep. Nothing of a file is run unless ``run`` is given. Of an FMU by mbsvib the
    description and the numbers that its binary computes with are compared; whether the binary does so, ``run`` tells.

    Parameters
    ----------
    path : str or path
        File of ``to_json``, ``to_npz``, ``to_mat``, ``to_hdf5``, ``to_uff``, ``to_op4``, ``to_dmig`` or
        ``to_fmu``, by its suffix.
    system : System, ClosedLoop, Controller, StateSpace, control.StateSpace or SystemData, optional
        What it came from.
    limit : float
        Largest relative error that passes.
    run : bool
        Whether to load the binary of an .fmu as well and compare its answers. It is a program and may do anything:
        only for files whose origin you trust. Other files hold nothing that could be run.

    Returns
    -------
    ExportCheck
        One line for each comparison, ``passed`` for all.

    Raises
    ------
    ExportError
        If the file cannot be read, its names are not those of the system, or it cannot be checked without one.
    """
    file = a_path(path, "check_export", ExportError)
    run, limit = flag(run, "check_export", "run", ExportError), _limit(limit)
    suffix = file.suffix.lower()
    model = None if system is None else _model(system, suffix)
    if suffix not in SUFFIXES:
        raise ExportError(f"{file}: no exporter writes '{suffix}' files that can be read again; expected one of "
                          f"{', '.join(SUFFIXES)}.")  # fmt: skip
    target = BY_SUFFIX[suffix]
    if target.checked == "equations":
        return ExportCheck(file, _of_equations(target.read(file), model, limit))
    if model is None:
        raise ExportError(f"{file}: a {suffix} file has nothing in it to compare with; give the system as well.")
    if target.checked == "unit":
        return _of_unit(file, model, limit, run)
    if target.checked == "responses":
        return ExportCheck(file, _of_responses(target.read(file), model, limit))
    return ExportCheck(file, _of_matrices(file, model, limit))


def _limit(value: object) -> float:
    expected = "a relative error, 0 or above"
    limit = reals(value, "check_export", "limit", expected, ExportError)
    if limit.ndim or not limit >= 0.0:
        raise ExportError(f"check_export: limit = {shown(value)}; expected {expected}.")
    return float(limit)


def _model(system: object, suffix: str) -> Model:
    """What responses and poles of a file are compared with; of loops the equations that exports write."""
    second = getattr(system, "second_order", None) if kind_of(system) == "closed loop" else None
    for known in (system, second):
        if isinstance(known, (System, SystemData)):
            return known
    # modal states keep most digits; matrices are compared entry by entry, in the states in which they are written
    states = "modal" if kind_of(system) == "closed loop" and suffix != ".op4" else "physical"
    return data_of(system, states, "check_export")


def _of_equations(
    data: SystemData | StateSpace, model: Model | None, limit: float, source: str = "A B C D"
) -> tuple[Comparison, ...]:
    """Equations of a file against the model, or without one the two forms that the file has against each other."""
    of_bodies = data if isinstance(data, SystemData) and not isinstance(model, StateSpace) else None
    reference, against = (model, "the model") if model is not None else (of_bodies, "its second-order equations")
    if reference is None:
        raise ExportError(f"'{data.name}' is a state space, and its file has nothing to compare it with; give the loop "
                          f"or state space that it came from as well.")  # fmt: skip
    _same_names(data, reference)
    space, values = data.state_space if isinstance(data, SystemData) else data, answers.poles_of(reference)
    omega = answers.check_points(values)
    truth, errors = answers.response_of(reference, omega), {}

    def compare(form: str, response: Complex) -> None:
        errors[f"response of {form}"] = answers.response_error(response, truth, reference, omega)

    compare(source, answers.state_space_response(space, omega))
    if model is not None:
        if of_bodies is not None:
            compare("M C K", answers.second_order_response(of_bodies, omega))
        errors["poles"] = pole_error(answers.poles(space.A), values)
    if of_bodies is not None and not isinstance(reference, StateSpace):
        errors["displacements of the bodies"] = _body_error(of_bodies, reference, omega)
    return tuple([Comparison(quantity, against, error, limit) for quantity, error in errors.items()])


def _body_error(data: SystemData, reference: System | SystemData, omega: Array) -> float:
    """Error of the displacements of the bodies (6 bodies, inputs, n), recovered from the states."""
    space, m = data.state_space, len(data.coordinates)
    direct = np.zeros((m, len(data.inputs))) if space.through is None else space.through[:m]
    rows = data.body_motion.reshape(6 * len(data.bodies), m)
    actual = answers.state_space_response(replace(space, C=rows @ space.transform[:m], D=rows @ direct), omega)
    rows = reference.body_motion.reshape(6 * len(reference.bodies), len(reference.coordinates))
    exact = np.stack([rows @ answers.motions(reference, w) for w in omega], axis=-1)
    scale = np.abs(exact).max(axis=(0, 2), keepdims=True, initial=0.0)
    return float(np.max(np.abs(actual - exact) / np.where(scale > 0.0, scale, 1.0), initial=0.0))


def _of_responses(data: Measurement, model: Model, limit: float) -> tuple[Comparison, ...]:
    _same_names(data, model)
    error = answers.response_error(data.responses, answers.response_of(model, data.omega), model, data.omega)
    return (Comparison("frequency responses", "the model", error, limit),)


def _of_matrices(path: Path, model: Model, limit: float) -> tuple[Comparison, ...]:
    from mbsvib_export.dmig_ import read_dmig
    from mbsvib_export.op4_ import read_op4

    matrices = read_dmig(path) if path.suffix.lower() == ".pch" else read_op4(path)
    data = SystemData.of(model) if isinstance(model, System) else model
    result = []
    for key, array in matrices.items():
        truth = getattr(data, key, np.zeros((0, 0)))
        if array.shape != truth.shape:
            raise ExportError(f"{path}: {key} has shape {array.shape}, that of the model {truth.shape}; it is the file "
                              f"of another model.")  # fmt: skip
        scale = np.abs(truth).max(initial=0.0) or 1.0
        result.append(Comparison(key, "the model", float(np.abs(array - truth).max() / scale), limit))
    return tuple(result)


def _of_unit(path: Path, model: Model, limit: float, run: bool) -> ExportCheck:
    from mbsvib_export.fmu_.reading import state_space_in

    if run:
        from mbsvib_export.cosimulation.unit import state_space_of_unit

        return ExportCheck(path, _of_equations(state_space_of_unit(path), model, limit, "its derivatives"))
    space, platforms = state_space_in(path)
    return ExportCheck(
        path, _of_equations(space, model, limit),
        (f"Not run: its binaries for {', '.join(platforms) or 'no platform'}. Where you trust the file: "
         "check_export(..., run=True), or --run.",),
    )  # fmt: skip


def _same_names(data: SystemData | StateSpace | Measurement, model: Model) -> None:
    for ports in ("inputs", "outputs"):
        exported, expected = getattr(data, ports), getattr(model, ports)
        if exported != expected:
            missing = sorted(set(expected) ^ set(exported)) or list(exported)
            raise ExportError(f"the {ports} of the file are not those of '{model.name}': {', '.join(missing[:6])}; it "
                              f"is the file of another model, or the model has changed. Export it again.")  # fmt: skip


def pole_error(poles: Complex, truth: Complex) -> float:
    """Return the largest relative difference [1] of poles matched in pairs (rigid-body ones: to the largest).
    """
    from scipy.optimize import linear_sum_assignment

    if len(poles) != len(truth):
        return float("inf")
    if not len(poles):
        return 0.0
    size = np.abs(truth)
    scale = np.where(size > _ZERO * size.max(), size, size.max() or 1.0)
    distance = np.abs(poles[:, None] - truth[None, :]) / scale
    rows, columns = linear_sum_assignment(distance)
    return float(distance[rows, columns].max())
