"""Sweeps: one question at many points of a model's parameters, each recorded as a line of JSON at once.

The first line identifies the study. A line that was truncated by an interruption is dropped.
"""

from __future__ import annotations

import json
import os
import pickle
import warnings
from collections.abc import Iterable, Mapping
from contextlib import nullcontext
from functools import partial
from hashlib import sha256
from os import PathLike
from time import monotonic
from types import TracebackType
from typing import IO, Any

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.api.model import Model
from mbsvib.common.atomic_file import write_atomic
from mbsvib.common.expected import a_path
from mbsvib.common.file_content import ContentError, content_of, read_json_content
from mbsvib.common.progress import Progress, counting
from mbsvib.errors import ModelError
from mbsvib.studies.design import Ties
from mbsvib.studies.plants import PlantFunction, name_of, systems_of
from mbsvib.studies.quantities import Quantity
from mbsvib.studies.results import Points, Sweep, gathered, points
from mbsvib.studies.running import Asked, Outcome, Question, question, run, task


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
        record is identified by model, values, quantities and names of functions; bodies of functions are not compared.
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
    systems = systems_of(model, columns, ties, plant, relaxed)
    variables, quantities = systems.design, question(of, batched, systems.plant)
    work = task(systems, quantities)
    outcomes: dict[int, Outcome] = {}
    if file is not None:
        varied = variables.values(columns) | variables.displacements(columns)
        varied |= {name: columns[name] for name in systems.plant.gains}
        varied |= {"relaxed": relaxed} if variables.pose else {}
        record = Record(file, head(model, sweep_points, varied, quantities))
        outcomes.update((i, outcome) for i, outcome in record.known.items() if not (retry and isinstance(outcome, str)))
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


VERSION = 1
# Lines are flushed to the operating system at once, and to the disk after this many seconds.
SYNC = 1.0


class Record:
    """A file of results: ``known`` are those of the file, ``add`` appends more; a context manager."""

    def __init__(self, path: str | os.PathLike[str], head: Mapping[str, Any]) -> None:
        self.path = a_path(path, "sweep", partial(ModelError, field="file"))
        self.known: dict[int, Outcome] = {}
        self._stream: IO[bytes] | None = None
        self._synced = monotonic()
        content = b""
        if os.path.lexists(self.path):
            content = content_of(self.path, partial(ModelError, field="file"), "the record of a study, or a new file")
        complete = content[: content.rfind(b"\n") + 1]
        lines = complete.splitlines()
        if lines:
            self._check(lines[0], head)
        for number, line in enumerate(lines[1:], 2):
            self._add_known(line, number, head["points"])
        if len(complete) < len(content) or not lines:
            start = complete or (json.dumps(head) + "\n").encode()
            write_atomic(self.path, lambda stream: stream.write(start), partial(ModelError, field="file"))

    def _check(self, line: bytes, head: Mapping[str, Any]) -> None:
        try:
            header = read_json_content(line)
        except ContentError:
            header = None
        if not isinstance(header, dict) or "study" not in header:
            raise ModelError(f"{self.path}: this is not a record of a study; give another file.", field="file")
        for key, value in head.items():
            if header.get(key) != value:
                raise ModelError(f"{self.path}: it is the record of another study ({key} is not the same); delete it, "
                                 f"or give another file.", field="file")  # fmt: skip

    def _add_known(self, line: bytes, number: int, points: int) -> None:
        """Read a line; a point is there again only if it failed before, as points that failed are asked again."""
        try:
            entry = read_json_content(line, nan=True)
            if not isinstance(entry, dict) or set(entry) not in ({"point", "error"}, {"point", "result"}):
                raise ContentError("expected a point and its result or error")
            point = entry["point"]
            if type(point) is not int or not 0 <= point < points:
                raise ContentError(f"point {str(point)[:40]}; expected one from 0 to {points - 1}")
            if not isinstance(self.known.get(point, ""), str):
                raise ContentError(f"the result of point {point} is there twice")
            outcome: Any = entry.get("error", entry.get("result"))
            if "result" in entry:
                outcome = {label: _decoded(value) for label, value in outcome.items()}
            elif not isinstance(outcome, str):
                raise ContentError("an error that is not a text")
        except (ContentError, AttributeError, ValueError, KeyError, TypeError, OverflowError) as error:
            reason = error if isinstance(error, ContentError) else "a result that is not an array of numbers"
            raise ModelError(f"{self.path}, line {number}: this is not a line of a record: {reason}. Remove the line "
                             f"to compute its point again, or give another file.", field="file") from error  # fmt: skip
        self.known[point] = outcome

    def add(self, outcomes: Iterable[tuple[int, Outcome]]) -> None:
        """Append results."""
        assert self._stream is not None
        self._stream.write("".join([_line(point, outcome) for point, outcome in outcomes]).encode())
        self._stream.flush()
        if monotonic() - self._synced > SYNC:
            os.fsync(self._stream.fileno())
            self._synced = monotonic()

    def __enter__(self) -> Record:
        self._stream = open(self.path, "ab")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._stream is not None:
            self._stream.flush()
            os.fsync(self._stream.fileno())
            self._stream.close()


def head(model: Model, points: Points, values: Mapping[str, Any], question: Question) -> dict[str, Any]:
    """Return the header that identifies a study: the model, the values of its parameters, names of the results, and
    the numbers of quantities, such as noise and bands.

    ``values`` (n,): values of parameters at the points.
    """
    from mbsvib.files.saving import described, json_text

    digest = sha256()
    for name, column in values.items():
        digest.update(name.encode() + b"\0" + np.ascontiguousarray(column, dtype="<f8").tobytes())
    results: dict[str, Any] = {label: item if isinstance(item, str) else name_of(item)
                               for label, item in question.items.items()}  # fmt: skip
    if question.plant.name is not None:
        results = {"plant": question.plant.name, "of": results}
    text = json_text(described(model))
    return {"study": VERSION, "name": model.name, "model": sha256(text.encode()).hexdigest(), "of": results,
            "variables": list(points.columns), "points": len(points), "values": digest.hexdigest(),
            **_quantities(question)}  # fmt: skip


def _quantities(question: Question) -> dict[str, str]:
    """A digest of the quantities that are asked for, none of those with functions that do not pickle."""
    asked = [getattr(item, "quantities", item) for item in question.items.values()]
    known = [item for item in asked if isinstance(item, (Quantity, Mapping))]
    try:
        return {"quantities": sha256(pickle.dumps(known)).hexdigest()} if known else {}
    except (pickle.PicklingError, AttributeError, TypeError):
        return {}


def _line(point: int, outcome: Outcome) -> str:
    if isinstance(outcome, str):
        return json.dumps({"point": point, "error": outcome}) + "\n"
    encoded = {label: {"real": value.real.tolist(), "imag": value.imag.tolist()} if np.iscomplexobj(value)
               else value.tolist() for label, value in outcome.items()}  # fmt: skip
    return json.dumps({"point": point, "result": encoded}) + "\n"


def _decoded(value: Any) -> Any:
    """Return an array of numbers; ValueError of anything else."""
    if isinstance(value, dict):
        real, imag = (_decoded(value[part]) for part in ("real", "imag"))
        if real.shape != imag.shape or len(value) > 2:
            raise ValueError("real and imaginary parts of other shapes")
        return real + 1j * imag
    result = np.asarray(value)
    if result.dtype.kind not in "biuf":
        raise ValueError("no numbers")
    return result
