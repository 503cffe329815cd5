"""Running a study: many variants at once where batches take the model, else one by one, in processes if long."""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from mbsvib.api.settled import settled
from mbsvib.api.system import System
from mbsvib.common import arguments as check
from mbsvib.equations.batch_values import refused
from mbsvib.errors import MbsvibError
from mbsvib.studies.question import follow

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from mbsvib.api.model import Model
    from mbsvib.studies.design import Design
    from mbsvib.studies.question import Answer, Question

Outcome: TypeAlias = "Answer | str"
Outcomes: TypeAlias = "list[tuple[int, Outcome]]"

# Processes are started, unless asked for by number, where what is left takes longer than this; they take about one.
WORTH_PROCESSES = 3.0
# Pieces last about so long, so that progress and the record move on; a batch has so many numbers in its matrices.
PIECE_SECONDS = 0.25
PIECE_NUMBERS = 2_000_000
LARGEST_PIECE = 1000
# What linear algebra says of a matrix that it cannot take; every other error of a batch is one of mbsvib.
REFUSED = (MbsvibError, np.linalg.LinAlgError)


@dataclass(frozen=True, slots=True)
class Task:
    """What is done at points; ``kind`` says how: "batch" (asked at once), "variants" (linearized at once), "single"."""

    model: Model
    design: Design
    question: Question
    kind: str
    dof: int = 1

    def run(self, numbers: Sequence[int], columns: Mapping[str, Any]) -> Outcomes:
        """Return the outcomes at the points with these numbers, whose variables have the values of the columns."""
        if self.kind == "single":
            return [(number, self._single({name: column[i] for name, column in columns.items()}))
                    for i, number in enumerate(numbers)]  # fmt: skip
        try:
            batch = self.model.linearize(values=self.design.values(columns))
            if self.kind == "batch":
                found = self.question.ask_batch(batch)
                return [(number, {label: value[i] for label, value in found.items()})
                        for i, number in enumerate(numbers)]  # fmt: skip
        except REFUSED:
            return self._sorted_out(numbers, columns)
        return [(number, self._asked(batch, i)) for i, number in enumerate(numbers)]

    def _sorted_out(self, numbers: Sequence[int], columns: Mapping[str, Any]) -> Outcomes:
        """A piece that is refused has points with values that no part may have: those go by themselves."""
        if len(numbers) == 1:
            return self._halved(numbers, columns)
        odd = refused(self.model.parameters, self.design.values(columns))
        if not odd.any():
            return self._halved(numbers, columns)
        few, many = np.flatnonzero(odd).tolist(), np.flatnonzero(~odd).tolist()
        result = [(numbers[i], self._single({name: column[i] for name, column in columns.items()})) for i in few]
        others = [numbers[i] for i in many]
        return result + (self.run(others, {name: x[many] for name, x in columns.items()}) if others else [])

    def _halved(self, numbers: Sequence[int], columns: Mapping[str, Any]) -> Outcomes:
        """A piece that is refused has a point that is: look for it, and keep the others."""
        if len(numbers) == 1:
            return [(numbers[0], self._single({name: column[0] for name, column in columns.items()}))]
        half = len(numbers) // 2
        result: Outcomes = []
        for part in (slice(None, half), slice(half, None)):
            result += self.run(numbers[part], {name: column[part] for name, column in columns.items()})
        return result

    def _single(self, values: Mapping[str, Any]) -> Outcome:
        try:
            model, system = settled(self.model.with_values(self.design.values(values)))
            if self.kind == "batch" and self.question.takes_batch:
                name, value = next(iter(model.parameters.items()))
                batch = model.linearize(values={name: np.array([value])})
                return {label: value[0] for label, value in self.question.ask_batch(batch).items()}
            return self.question.ask(system)
        except Exception as error:  # whatever fails in a point is kept as its outcome
            return said(error)

    def _asked(self, batch: Any, i: int) -> Outcome:
        try:
            return self.question.ask(batch[i])
        except Exception as error:
            return said(error)


def task(model: Model, design: Design, question: Question) -> Task:
    """Return what is to be done at each point, after a look at the model as it is.

    Parameters
    ----------
    model : Model
        The mechanism.
    design : Design
        Its variables.
    question : Question
        What is asked.

    Returns
    -------
    Task
        The work at any point.

    Raises
    ------
    ModelError
        If systems have no such result.
    """
    try:
        system = model.linearize()
    except MbsvibError:
        return Task(model, design, question, "single")
    for item in question.items.values():
        if isinstance(item, str):
            follow(system, item)
    if not isinstance(system, System):
        return Task(model, design, question, "single")
    if system.provenance.statics is not None and not question.batched:  # where the pose follows, point by point
        return Task(model, design, question, "single", system.dof)
    moved = set(design.values(design.start))
    try:
        batch = model.linearize(values={name: np.repeat(model.parameters[name], 2) for name in moved})
    except REFUSED:
        return Task(model, design, question, "single")
    if question.batched:
        question.ask_batch(batch)
    return Task(model, design, question, "batch" if question.batched else "variants", system.dof)


def run(task: Task, columns: Mapping[str, Any], todo: Sequence[int], workers: int | None) -> Iterator[Outcomes]:
    """Go through the points that are to do and give their outcomes as they come.

    Parameters
    ----------
    task : Task
        What is done.
    columns : mapping of str to array, shape (n,)
        Values of the variables at all points.
    todo : sequence of int
        Numbers of the points that are to do.
    workers : int, optional
        How many processes; 1: none beside this one. Default: what joblib is configured to do, and else as many as there
        are processors if it takes long.

    Returns
    -------
    iterator of list
        Numbers of points with their answers or errors.

    Raises
    ------
    ModelError
        If ``workers`` is no positive number.
    """
    if workers is not None and (not isinstance(workers, int) or isinstance(workers, bool) or workers < 1):
        raise check.refuse("study", "workers", workers, "a whole number of processes, at least 1")
    many = max(1, min(LARGEST_PIECE, PIECE_NUMBERS // max(1, task.dof) ** 2))
    configured = workers is None and _configured()
    done, size = 0, 1 if task.kind != "batch" else min(many, 32)
    while done < len(todo) and not configured and (workers in (None, 1)):
        start = perf_counter()
        piece = todo[done : done + size]
        yield task.run(piece, _part(columns, piece))
        done += len(piece)
        each = (perf_counter() - start) / len(piece)
        if workers is None and done > 1 and each * (len(todo) - done) > WORTH_PROCESSES and _processors() > 1:
            break
        size = max(1, min(many, int(PIECE_SECONDS / max(each, 1e-9)), 8 * size))
    if done < len(todo):
        yield from _parallel(task, columns, todo[done:], workers, configured, many)


def said(error: BaseException) -> str:
    """Return an error as a line of text."""
    return f"{type(error).__name__}: {error}".splitlines()[0].rstrip(": ")


def _parallel(
    task: Task, columns: Mapping[str, Any], todo: Sequence[int], workers: int | None, configured: bool, many: int
) -> Iterator[Outcomes]:
    from joblib import Parallel, delayed
    from joblib.parallel import get_active_backend

    backend, jobs = get_active_backend()
    count = workers or (None if configured else _processors())
    known = count or backend.effective_n_jobs(jobs if jobs is not None else backend.default_n_jobs)
    size = max(1, min(many, -(-len(todo) // (8 * max(1, known)))))
    calls = [delayed(task.run)(piece, _part(columns, piece))
             for piece in (todo[i : i + size] for i in range(0, len(todo), size))]  # fmt: skip
    if getattr(backend, "supports_return_generator", False):
        yield from Parallel(n_jobs=count, return_as="generator_unordered")(calls)
        return
    together = 2 * max(1, known)  # such back-ends answer when all is done: some pieces at a time
    for i in range(0, len(calls), together):
        yield from Parallel(n_jobs=count)(calls[i : i + together])


def _part(columns: Mapping[str, Any], numbers: Sequence[int]) -> dict[str, Any]:
    return {name: column[list(numbers)] for name, column in columns.items()}


def _configured() -> bool:
    """Tell whether the caller has set up joblib, by its parallel_config."""
    import sys

    if "joblib" not in sys.modules:
        return False
    from joblib.parallel import BACKENDS, DEFAULT_BACKEND, get_active_backend

    backend, jobs = get_active_backend()
    return jobs not in (None, 1) or type(backend) is not BACKENDS[DEFAULT_BACKEND]


def _processors() -> int:
    from joblib import cpu_count

    return int(cpu_count())
