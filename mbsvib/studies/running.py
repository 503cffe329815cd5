"""Running a study: what is asked, of many variants at once where batches can, else one by one, or in processes."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor
from dataclasses import dataclass
from functools import partial
from operator import getitem
from time import perf_counter
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from mbsvib.api.batch import Batch
from mbsvib.api.system import System
from mbsvib.common import arguments as check
from mbsvib.equations.batch_values import refused
from mbsvib.errors import MbsvibError, ModelError, UnstableWarning, nearest
from mbsvib.studies.plants import NO_PLANT, Plant, Systems, name_of

Answer: TypeAlias = dict[str, NDArray[Any]]

Asked: TypeAlias = "str | Callable[[Any], Any] | Mapping[str, str | Callable[[Any], Any]]"

# Attributes of batches with an axis of variants in front, as of single systems; units of frequent results.
BATCHED = frozenset((
    "M", "C", "K", "B", "Cq", "Cv", "Ca", "D", "modes.eigenvalues", "modes.errors", "modes.natural",
    "modes.frequencies", "modes.damped_frequencies", "modes.damping_ratios", "modes.stable",
))  # fmt: skip
UNITS = {"modes.eigenvalues": "1/s", "poles": "1/s", "modes.natural": "rad/s", "modes.frequencies": "Hz",
         "modes.damped_frequencies": "Hz", "modes.damping_ratios": "1", "modes.errors": "1"}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Question:
    """Results by label: a path such as "modes.frequencies", or a function of a system (``takes_batch``: of a batch).

    ``plant``: what it makes of a system is asked in its place, such as a closed loop.
    """

    items: Mapping[str, str | Callable[[Any], Any]]
    takes_batch: bool = False
    plant: Plant = NO_PLANT

    @property
    def batched(self) -> bool:
        """Whether a batch can compute all results at once."""
        return self.plant.function is None and all(
            item in BATCHED if isinstance(item, str) else self.takes_batch for item in self.items.values())

    @property
    def units(self) -> dict[str, str]:
        """Units of the results, where known."""
        return {label: UNITS[item] for label, item in self.items.items() if isinstance(item, str) and item in UNITS}

    def ask(self, system: Any, values: Mapping[str, Any]) -> Answer:
        """Return the results of one system, at values of the variables, as arrays."""
        result: Answer = {}
        asked = self.plant(system, values)
        for label, item in self.items.items():
            value = follow(asked, item) if isinstance(item, str) else item(asked)
            if isinstance(value, Mapping):
                prefix = "" if len(self.items) == 1 else f"{label}."
                result |= {f"{prefix}{key}": _numbers(f"{prefix}{key}", entry) for key, entry in value.items()}
            else:
                result[label] = _numbers(label, value)
        natural = [item in ("modes.natural", "modes.frequencies") or getattr(item, "quantity", None) == "frequency"
                   for item in self.items.values()]  # fmt: skip
        if any(natural) and not np.all(asked.modes().stable):  # which does not show whether modes grow
            warnings.warn(f"modes of '{asked.name}' grow at some of the points. Their natural frequency is the "
                          f"magnitude of the eigenvalue, also where they do not vibrate; 'modes.stable' tells where.",
                          UnstableWarning, stacklevel=2)  # fmt: skip
        return result

    def ask_batch(self, batch: Batch) -> Answer:
        """Return the results of all variants, which have an axis of variants in front."""
        results = self.ask(batch, {})
        for label, value in results.items():
            if value.shape[:1] != (len(batch),):
                raise ModelError(f"of: '{label}' of a batch of {len(batch)} has shape {value.shape}; expected one "
                                 f"entry for each along the first axis. Leave batched=True away for functions of "
                                 f"single systems.", field="of")  # fmt: skip
        return results


def question(of: Asked, batched: bool = False, plant: Plant = NO_PLANT) -> Question:
    """Return the results to be computed at each point, checked.

    ``of``: a path from a system ("modes.frequencies", "poles", "K"), a function of a system, or several by label.
    ``batched``: whether functions accept batches too and return an axis of variants in front. ``plant``: what is asked
    in place of the system.
    """
    if plant.function is not None and batched:
        raise check.refuse("study", "batched", batched, "False beside plant, which is a function of single systems")
    name = of if isinstance(of, str) else name_of(of, "__name__")
    items: Mapping[Any, Any] = of if isinstance(of, Mapping) else {"value" if name == "<lambda>" else name: of}
    for item in items.values():
        if not callable(item) and not (isinstance(item, str) and item):
            raise check.refuse("study", "of", item, "a result such as 'modes.frequencies', or a function of a system")
    if not items:
        raise check.refuse("study", "of", of, "at least one result")
    return Question({str(label): item for label, item in items.items()}, batched, plant)


def follow(system: Any, path: str) -> Any:
    """Return the value of a path of attributes, and of methods that need no arguments."""
    value = system
    for name in path.split("."):
        kind = type(value).__name__
        if name.startswith("_") or not (hasattr(type(value), name) or hasattr(value, name)):
            known = [attribute for attribute in dir(value) if not attribute.startswith("_")]
            raise ModelError(f"of = '{path}': {kind} has no '{name}'.{nearest(name, known)}", element=path, field="of")
        value = getattr(value, name)
        if callable(value):
            try:
                value = value()
            except TypeError as error:
                raise ModelError(f"of = '{path}': {name}() of a {kind} needs arguments; give a function, such as "
                                 f"lambda system: system.{name}(...). ({error})", element=path,
                                 field="of") from error  # fmt: skip
    return value


def _numbers(label: str, value: Any) -> NDArray[Any]:
    array = np.asarray(value)
    if array.dtype.kind not in "biufc":
        raise ModelError(f"of: '{label}' is {check.shown(value)}; expected numbers.", element=label, field="of")
    return array


Outcome: TypeAlias = "Answer | str"
Outcomes: TypeAlias = "list[tuple[int, Outcome]]"

# Unless their number is given, processes are started if they save more than this; starting each takes 1.5 s.
WORTH_PROCESSES = 3.0
# Approximate duration of a piece, after which progress and record are updated; numbers in the matrices of a batch.
PIECE_SECONDS = 0.25
PIECE_NUMBERS = 2_000_000
LARGEST_PIECE = 1000
# Errors of a batch: those of mbsvib, and those of numpy for singular matrices.
REFUSED = (MbsvibError, np.linalg.LinAlgError)


@dataclass(frozen=True, slots=True)
class Task:
    """The work at points; ``kind``: "batch" (computed at once), "variants" (linearized at once) or "single"."""

    systems: Systems
    question: Question
    kind: str
    dof: int = 1

    def run(self, numbers: Sequence[int], columns: Mapping[str, Any]) -> Outcomes:
        """Return the outcomes at the points with these numbers, whose variables have the values of the columns."""
        if self.kind == "single":
            return [(number, self._single(_at(columns, i))) for i, number in enumerate(numbers)]
        try:
            design, model = self.systems.design, self.systems.model
            moves = design.pose or design.values(columns)
            batch: Any = self.systems.batch(columns) if moves else [model.linearize()] * len(numbers)
            if self.kind == "batch":
                results = self.question.ask_batch(batch)
                return [(number, {label: value[i] for label, value in results.items()})
                        for i, number in enumerate(numbers)]  # fmt: skip
        except REFUSED:
            return self._sorted_out(numbers, columns)
        return [(number, self._single(_at(columns, i), partial(getitem, batch, i)))
                for i, number in enumerate(numbers)]  # fmt: skip

    def _sorted_out(self, numbers: Sequence[int], columns: Mapping[str, Any]) -> Outcomes:
        """Run a refused piece without the points with invalid values; these are run separately."""
        changed = self.systems.design.values(columns)
        if len(numbers) == 1 or not changed:
            return self._halved(numbers, columns)
        odd = refused(self.systems.model.parameters, changed)
        if not odd.any():
            return self._halved(numbers, columns)
        few, many = np.flatnonzero(odd).tolist(), np.flatnonzero(~odd).tolist()
        result = [(numbers[i], self._single(_at(columns, i))) for i in few]
        remaining = [numbers[i] for i in many]
        return result + (self.run(remaining, {name: x[many] for name, x in columns.items()}) if remaining else [])

    def _halved(self, numbers: Sequence[int], columns: Mapping[str, Any]) -> Outcomes:
        """Bisect a refused piece to separate the points that fail from the others."""
        if len(numbers) == 1:
            return [(numbers[0], self._single(_at(columns, 0)))]
        half = len(numbers) // 2
        result: Outcomes = []
        for part in (slice(None, half), slice(half, None)):
            result += self.run(numbers[part], {name: column[part] for name, column in columns.items()})
        return result

    def _single(self, values: Mapping[str, Any], known: Callable[[], Any] | None = None) -> Outcome:
        try:
            if known is not None:
                return self.question.ask(known(), values)
            model, system = self.systems.balanced(values)
            if self.kind == "batch" and self.question.takes_batch:
                name, value = next(iter(model.parameters.items()))
                batch = model.linearize(values={name: np.array([value])})
                return {label: value[0] for label, value in self.question.ask_batch(batch).items()}
            return self.question.ask(system, values)
        except Exception as error:  # any error of a point is its outcome
            return error_text(error)


def task(systems: Systems, question: Question) -> Task:
    """Return the work at each point, after a check at the given model."""
    model, design = systems.model, systems.design
    try:
        system = model.linearize()
    except MbsvibError:
        return Task(systems, question, "single")
    for item in question.items.values():
        if isinstance(item, str) and question.plant.function is None:
            follow(system, item)
    if not isinstance(system, System):
        return Task(systems, question, "single")
    if system.provenance.statics is not None and not question.batched:  # the pose is computed point by point
        return Task(systems, question, "single", system.dof)
    try:
        if design.pose or design.values(design.start):
            batch = systems.batch({name: np.repeat(value, 2) for name, value in design.start.items()})
    except REFUSED:
        return Task(systems, question, "single")
    if question.batched:
        question.ask_batch(batch)
    return Task(systems, question, "batch" if question.batched else "variants", system.dof)


def run(task: Any, columns: Mapping[str, Any], todo: Sequence[int], workers: int | None) -> Iterator[Outcomes]:
    """Compute the remaining points and yield their outcomes as they are available.

    ``task``: a ``Task``, or other work with ``run``, ``kind`` and ``dof``, which tells how many points go together.
    ``columns`` (n,): values of the variables at all points. ``workers``: number of processes; 1: only this one.
    Default: joblib's configuration, else the number of processors if these save time. What a point costs is known as
    soon as pieces no longer grow: the first one includes what is computed once, small ones cost more for each point.
    """
    if workers is not None and (not isinstance(workers, int) or isinstance(workers, bool) or workers < 1):
        raise check.refuse("study", "workers", workers, "a whole number of processes, at least 1")
    many = max(1, min(LARGEST_PIECE, PIECE_NUMBERS // max(1, task.dof) ** 2))
    configured = workers is None and _configured()
    done, size = 0, 1 if task.kind != "batch" else min(many, 32)
    while done < len(todo) and not configured and (workers in (None, 1)):
        chunk = todo[done : done + size]
        start = perf_counter()
        outcomes = task.run(chunk, _part(columns, chunk))
        point_seconds = (perf_counter() - start) / len(chunk)
        yield outcomes
        grown = max(1, min(many, int(PIECE_SECONDS / max(point_seconds, 1e-9)), 8 * size))
        known, done, size = done > 0 and grown < 2 * size, done + len(chunk), grown
        remaining = point_seconds * (len(todo) - done)
        long = workers is None and known and remaining > WORTH_PROCESSES
        if long and remaining * (1.0 - 1.0 / _processors()) > WORTH_PROCESSES:
            break
    if done < len(todo):
        yield from _parallel(task, columns, todo[done:], workers, configured, many)


def processes(workers: int | None, seconds: float) -> int | None:
    """Return how many processes work that takes so many seconds is worth: as given, by joblib's configuration (None),
    or all processors.
    """
    if workers is not None or _configured():
        return workers
    return _processors() if seconds > WORTH_PROCESSES else 1


def error_text(error: BaseException) -> str:
    """Return an error as a line of text."""
    return f"{type(error).__name__}: {error}".splitlines()[0].rstrip(": ")


def _parallel(
    task: Any, columns: Mapping[str, Any], todo: Sequence[int], workers: int | None, configured: bool, many: int
) -> Iterator[Outcomes]:
    from joblib import Parallel, delayed
    from joblib.parallel import get_active_backend

    backend, jobs = get_active_backend()
    count = workers or (None if configured else _processors())
    known = count or backend.effective_n_jobs(jobs if jobs is not None else backend.default_n_jobs)
    size = max(1, min(many, -(-len(todo) // (8 * max(1, known)))))
    together = None if getattr(backend, "supports_return_generator", False) else 2 * max(1, known)
    left = list(todo)

    def answers(pieces: Sequence[Sequence[int]]) -> Iterator[Outcomes]:
        """Outcomes of pieces as they come, which are then no longer ``left``."""
        calls = [delayed(task.run)(piece, _part(columns, piece)) for piece in pieces]
        # some back-ends return when all pieces are done: submit some at a time there
        for i in range(0, len(calls), together or len(calls)):
            how = {} if together else {"return_as": "generator_unordered"}
            for outcomes in Parallel(n_jobs=count, **how)(calls[i : i + (together or len(calls))]):
                done = {number for number, _ in outcomes}
                left[:] = [number for number in left if number not in done]
                yield outcomes

    while left:
        try:
            yield from answers([left[i : i + size] for i in range(0, len(left), size)])
        except BrokenExecutor:  # a process was killed, and all that were computing with it
            yield from _around_killed(answers, left, size)


def _around_killed(
    answers: Callable[[Sequence[Sequence[int]]], Iterator[Outcomes]], left: list[int], size: int
) -> Iterator[Outcomes]:
    """Compute the points that are left piece by piece up to the one that kills its process, which is its outcome."""
    while left:
        try:
            yield from answers([left[:size]])
        except BrokenExecutor as error:
            if size == 1:
                reason = (f"{type(error).__name__}: the process that computed this point was ended from outside, for "
                          f"want of memory or by a fault in compiled code")  # fmt: skip
                yield [(left.pop(0), reason)]
                return
            size = (size + 1) // 2


def _at(columns: Mapping[str, Any], i: int) -> dict[str, Any]:
    return {name: column[i] for name, column in columns.items()}


def _part(columns: Mapping[str, Any], numbers: Sequence[int]) -> dict[str, Any]:
    return {name: column[list(numbers)] for name, column in columns.items()}


def _configured() -> bool:
    """Tell whether the caller has set up joblib, by its parallel_config."""
    if "joblib" not in sys.modules:
        return False
    from joblib.parallel import BACKENDS, DEFAULT_BACKEND, get_active_backend

    backend, jobs = get_active_backend()
    return jobs not in (None, 1) or type(backend) is not BACKENDS[DEFAULT_BACKEND]


def _processors() -> int:
    from joblib import cpu_count

    return int(cpu_count())
