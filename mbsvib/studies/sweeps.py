"""Sweeps: one question at many points of a model's parameters."""

from __future__ import annotations

import warnings
from contextlib import nullcontext
from typing import TYPE_CHECKING

from mbsvib.common.progress import counting
from mbsvib.studies.design import design
from mbsvib.studies.plants import Systems, plant_of
from mbsvib.studies.results import Sweep, gathered, points
from mbsvib.studies.running import question, run, task

if TYPE_CHECKING:
    from collections.abc import Mapping
    from os import PathLike

    from numpy.typing import ArrayLike

    from mbsvib.api.model import Model
    from mbsvib.common.progress import Progress
    from mbsvib.studies.design import Ties
    from mbsvib.studies.plants import PlantFunction
    from mbsvib.studies.running import Asked, Outcome


def sweep(
    model: Model, values: Mapping[str, ArrayLike], of: Asked, *, how: str = "grid", ties: Ties | None = None,
    batched: bool = False, workers: int | None = None, file: str | PathLike[str] | None = None, retry: bool = False,
    progress: Progress = None, plant: PlantFunction | None = None, relaxed: bool = False,
) -> Sweep:  # fmt: skip
    """Ask one question at many points of a model's parameters.

    Results such as ``"modes.frequencies"`` are computed for all points in one vectorised pass; functions are called
    with the system of each point, in several processes where that takes long. ``joblib.parallel_config`` says where
    else: ``with joblib.parallel_config("dask"):`` on the workers of a dask client.

    Parameters
    ----------
    model : Model
        The mechanism.
    values : mapping of str to array-like, shape (k,) or ()
        Values of each variable: a parameter, a pattern that ties several to one value (``"leg*.k.stiffness"``), a
        joint coordinate (``"knee.rz"``) whose values are displacements from the described pose [m, rad], as of
        ``moved``, or a name that ``ties`` explains.
    of : str, callable or mapping of str to str or callable
        A result of systems by its path ("modes.frequencies", "poles", "K"), a function of a system that returns
        numbers, an array or a mapping of these, or several by label.
    how : str
        "grid": all combinations; "paired": point by point, for samples.
    ties : mapping of str to mapping of str to float or Tie, optional
        Linear maps: {variable: {parameter or pattern: rate}} adds rate x variable to the values of the model. Other
        functions are objects with ``values(variables)`` and ``rates(variables)``, such as ``isolation.platform``.
    batched : bool
        Say that functions take a batch and return an axis of points in front.
    workers : int, optional
        How many processes, 1 for none. Default: as many as processors where these save seconds, or joblib's own choice
        within ``parallel_config``.
    file : str or path-like, optional
        Record of the sweep, one line for each computed point. If the file exists, only missing points are computed. The
        record is identified by model, values and names of functions; the body of a function is not compared.
    retry : bool
        Ask points of the record again that failed.
    progress : bool, callable or None
        True: a progress bar; None: on terminals; a function is called with how many are done and how many there are.
    plant : callable, optional
        A function of the system of each point that returns what is asked in its place, such as the loop
        ``lambda system: system.feedback(controller, noise=True)``. Its further arguments may be variables by their
        names, such as gains.
    relaxed : bool
        As of ``moved``: whether springs and bushings keep their forces where joints are displaced.

    Returns
    -------
    Sweep
        Variables and results by point, and the errors of those that failed; the others are kept.

    Raises
    ------
    ModelError
        If a parameter is unknown, a pattern picks nothing, values are not numbers, systems have no such result, or the
        file is the record of another sweep.
    """
    sweep_points = points(values, how)
    columns = sweep_points.columns
    around = plant_of(plant, columns, model)
    variables = design(model, columns, ties, around.gains, relaxed)
    quantities = question(of, batched, around)
    work = task(Systems(model, variables, around), quantities)
    outcomes: dict[int, Outcome] = {}
    if file is not None:
        from mbsvib.studies.record import Record, head

        varied = variables.values(columns) | variables.displacements(columns)
        varied |= {name: columns[name] for name in around.gains} | ({"relaxed": relaxed} if variables.pose else {})
        record = Record(file, head(model, sweep_points, varied, quantities))
        outcomes.update((i, outcome) for i, outcome in record.known.items()
                        if not (retry and isinstance(outcome, str)))  # fmt: skip
    todo = [i for i in range(len(sweep_points)) if i not in outcomes]
    with (record if file is not None else nullcontext()) as book, \
            counting(progress, len(sweep_points), f"sweep of {model.name}", len(outcomes)) as tell:  # fmt: skip
        for chunk in run(work, columns, todo, workers):
            outcomes.update(chunk)
            if book is not None:
                book.add(chunk)
            tell(len(chunk))
    by_point = {i: outcomes[i] for i in sorted(outcomes)}
    errors = {i: outcome for i, outcome in by_point.items() if isinstance(outcome, str)}
    if len(errors) == len(sweep_points):
        warnings.warn(f"sweep of '{model.name}': all {len(errors)} points failed, the first by {errors[0]}",
                      stacklevel=2)  # fmt: skip
    answers = {i: outcome for i, outcome in by_point.items() if not isinstance(outcome, str)}
    results = gathered(len(sweep_points), answers)
    units = dict(variables.units) | quantities.units
    return Sweep(model.name, sweep_points.axes, columns, sweep_points.shape, results, errors, units)
