"""Tuning: the search for the values of a controller of a given structure, and of parameters of the mechanism.

Source: Apkarian & Noll, Nonsmooth H-infinity synthesis, IEEE Trans. Autom. Control 51 (2006) 71.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from time import process_time
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array
from mbsvib.common.columnar import Columnar, by_name
from mbsvib.common.display import Displayed
from mbsvib.common.expected import kind_of
from mbsvib.common.progress import Progress, counting
from mbsvib.errors import ModelError, ResponseError, counted
from mbsvib.feedback.controller import Controller
from mbsvib.linalg.spectrum import mean_size
from mbsvib.studies.design import design as study_variables
from mbsvib.studies.running import processes
from mbsvib.studies.search import scales
from mbsvib.tuning.goals import as_goals
from mbsvib.tuning.measures import Goal
from mbsvib.tuning.problem import Problem, Unknowns
from mbsvib.tuning.scene import Scene, linearized, unreached
from mbsvib.tuning.searching import BEST, RESTARTS, Descents, searched, stabilised
from mbsvib.tuning.structures import FREE, Tunable, Value, as_tunable, law

if TYPE_CHECKING:
    from mbsvib.api.loops import ClosedLoop

# Fastest pole of a loop over that of its plant, above which its gains grow without a reason in the plant.
FAR = 1e4


@dataclass(frozen=True, repr=False, eq=False)
class Design(Columnar, Displayed):
    """A tuned ``controller`` with what it reaches.

    ``values`` {name: value} of the controller and of parameters; ``objective``: the largest weighted norm;
    ``achieved`` {goal: value}, the worst of all plants, of loops that were closed anew; ``reached`` {goal: bool} of the
    limits; ``model``, ``loop``: those of the plant, or tuples where there are several plants; ``history``: objectives
    after each step, of each search.
    """

    controller: Controller
    model: Any = field(repr=False)
    loop: ClosedLoop | Any = field(repr=False)
    values: Mapping[str, float]
    objective: float
    achieved: Mapping[str, float]
    reached: Mapping[str, bool]
    history: tuple[tuple[float, ...], ...] = field(repr=False)
    by_plant: Mapping[str, tuple[float, ...]] = field(repr=False)
    """Achieved values of each goal, one for each plant."""

    @property
    def success(self) -> bool:
        """Whether all limits are reached."""
        return all(self.reached.values())

    def columns(self) -> dict[str, Any]:
        """Return goals and tuned values as columns (goals + values,) by name: ``kind`` ("goal" or "value"), ``name``,
        ``value``, ``result`` ("reached", "not reached" or "minimised" of goals).
        """
        rows = [("goal", label, value, self._verdict(label)) for label, value in self.achieved.items()]
        return by_name(("kind", "name", "value", "result"),
                       [*rows, *[("value", name, value, "") for name, value in self.values.items()]])  # fmt: skip

    def _verdict(self, label: str) -> str:
        """Whether the limit of a goal is reached, in words."""
        reached = self.reached.get(label)
        return "minimised" if reached is None else "reached" if reached else "not reached"

    def table(self) -> dict[str, Any]:
        """Return the table of goals as arguments of ``mbsvib.common.tables.text`` and ``show``."""
        rows = [(label, f"{value:.6g}", self._verdict(label)) for label, value in self.achieved.items()]
        missed = [label for label, reached in self.reached.items() if not reached]
        notes = [f"Not reached: {', '.join(missed)}."] if missed else []
        plants = len(next(iter(self.by_plant.values())))
        notes += [f"Values are the worst of {plants} plants."] if plants > 1 else []
        notes += [] if (words := _runaway(self.loop)) is None else [words]
        notes.append(f"{counted(len(self.values), 'value')}; {len(self.history)} "
                     f"search{'es' if len(self.history) > 1 else ''}.")  # fmt: skip
        columns = [("goal", "left"), ("value", "right"), ("", "left")]
        title = f"Tuned controller of {counted(len(self.controller.A), 'state')}"
        return {"title": title, "columns": columns, "rows": rows, "notes": notes}

    def __repr__(self) -> str:
        return f"Design({len(self.values)} values, objective {self.objective:.6g})"


def _runaway(loops: Any) -> str | None:
    """A remark on loops with poles far beyond those of their plants: no goal limits the gains."""
    for loop in loops if isinstance(loops, tuple) else (loops,):
        fastest, plant = (float(np.abs(part.poles()).max(initial=0.0)) / (2.0 * np.pi)
                          for part in (loop, loop.plant.system))  # fmt: skip
        if fastest > FAR * plant > 0.0:
            return (f"Nothing limits the gains: a pole of the loop is at {fastest:.2g} Hz, those of the plant are up "
                    f"to {plant:.2g} Hz. Add a goal that does, such as a roll-off or the rms of the force.")
    return None


def tune(
    plant: Any, controller: Tunable | Any, goals: Sequence[Goal] | Goal, parameters: Mapping[str, Any] | None = None,
    starts: int = 10, seed: int = 0, initial: Mapping[str, float] | None = None, workers: int | None = None,
    progress: Progress = None,
) -> Design:  # fmt: skip
    """Return the controller of a given structure that reaches goals best, with parameters of the mechanism if wanted.

    minimise over p the largest weighted norm of all goals and plants, subject to the limits, u = w + K(p) y

    Parameters
    ----------
    plant : Model, System or StateSpace, or a sequence of these
        Several, such as poses or payloads, get one controller that is good for all.
    controller : Tunable
        Structure, such as ``mv.tunable.gain("F", "x")``.
    goals : sequence of Goal
        ``mv.goals.hinf`` and ``rms`` are minimised unless they have a limit ``most``; ``damping``, ``margin`` and
        ``rolloff`` are limits. Noise of sensors and actuators are inputs "SENSOR.noise", "ACTUATOR.noise".
    parameters : mapping, optional
        Bounds (lowest, highest) of parameters of the models by name or pattern; a pattern is one value for all.
    starts : int
        Number of starts: the first one is that of the structure, the others lie about it.
    seed : int
        Seed of the random starts.
    initial : mapping of str to float, optional
        Values at which the first start begins, such as ``values`` of an earlier design.
    workers : int, optional
        Number of processes, which changes nothing of the result; default: as many as processors if the search is long.
    progress : bool or callable, optional
        A bar, or a function of searches done and the most there may be; default: a bar on a terminal.

    Returns
    -------
    Design
        ``controller``, ``loop``, ``values``, ``objective``, ``achieved``; printed goal by goal. The search is local.

    Raises
    ------
    ModelError
        If parameters, bounds or counts are invalid.
    ResponseError
        If a name is unknown, no start can be stabilised (modes out of reach are named), or a goal is infinite.

    Source: Apkarian & Noll, Nonsmooth H-infinity synthesis, IEEE Trans. Autom. Control 51 (2006) 71.
    """
    check.count(starts, "tune", "starts", 1)
    random = np.random.default_rng(check.count(seed, "tune", "seed", 0))
    problem = _problem(plant, controller, as_goals(goals), parameters or {})
    points = [_initial(problem, initial)]
    points += [problem.unknowns.begin(random) for _ in range(starts - 1)]
    with counting(progress, starts + min(BEST, starts) + RESTARTS, "tune") as tell:
        began, descend = process_time(), partial(stabilised, problem)
        descents = Descents(descend, points[:1]).ends(1, tell)
        workers = processes(workers, (process_time() - began) * starts)
        descents += Descents(descend, points[1:]).ends(workers, tell)
        stable, first = ([end for end in part if end is not None] for part in zip(*descents, strict=True))
        if not stable:
            _refuse_unstable(problem, starts)
        if not first:
            _refuse_infinite(problem, stable[0].x)
        best, histories = searched(stable, first, random, workers, tell)
    return _design(problem, best, histories, not isinstance(plant, (list, tuple)))


def _problem(plant: Any, structure: Any, goals: tuple[Goal, ...], parameters: Mapping[str, Any]) -> Problem:
    plants = list(plant) if isinstance(plant, (list, tuple)) else [plant]
    if not plants:
        raise check.refuse("tune", "plant", plant, "a model, a system, a state space, or several")
    check.mapping("tune", "parameters", parameters, "bounds by name, {'leg*.k.damping': (1, 500)}", empty=True)
    systems = [linearized(part) for part in plants]
    known = as_tunable(structure).for_ports(systems[0].inputs, systems[0].outputs, systems[0].name)
    rate = float(np.exp(np.mean([np.log(mean_size(system.poles())) for system in systems])))
    scenes: list[Any] = []
    own: list[Any] = []
    for part, system in zip(plants, systems, strict=True):
        for kind, names, has in (("actuator", known.outputs, system.inputs), ("sensor", known.inputs, system.outputs)):
            for name in names:
                check.known(name, has, f"tune: '{system.name}' has no {kind} '{name}', which the controller needs",
                            None, "The system has", ResponseError)  # fmt: skip
        variables = None
        if parameters:
            if kind_of(part) != "model":
                raise ModelError(f"tune: parameters are those of a model; '{system.name}' is a {kind_of(part)}. Give "
                                 f"the model that was linearized.")  # fmt: skip
            variables = study_variables(part, parameters)
            own = own or _parameter_values(variables, parameters)
        scenes.append(Scene(part, system, variables, known.inputs, known.outputs, rate))
    of_law = law(known, scenes[0].signals(), rate)
    if not of_law.names and not own:
        raise ResponseError(f"tune: {known!r} has no values to tune; expected one that mv.tunable makes.")
    measures = tuple([tuple([goal.at(scene) for scene in scenes]) for goal in goals])
    return Problem(tuple(scenes), of_law, tuple(parameters), Unknowns.of([*of_law.values, *own]), goals, measures,
                   (((),) * len(scenes),) * len(goals))  # fmt: skip


def _parameter_values(variables: Any, parameters: Mapping[str, Any]) -> list[Value]:
    of = scales(variables, parameters, None)
    values = []
    for name, start, low, high in zip(variables.variables, of.start, of.low, of.high, strict=True):
        positive = bool(low > 0.0)
        size = abs(float(start)) or (float(high - low) if np.isfinite(high - low) else 1.0)
        ends = (float(low), float(high)) if np.isfinite([low, high]).any() else FREE
        values.append(Value(name, size, float(start) / size, 0.3, positive, ends))
    return values


def _initial(problem: Problem, initial: Mapping[str, float] | None) -> Array:
    t = problem.unknowns.start.copy()
    for name, value in (initial or {}).items():
        check.known(name, problem.names, f"tune: initial has '{name}', which is not a value of this problem", "initial")
        k = problem.names.index(name)
        share = check.number(value, "tune", f"initial of '{name}'") / problem.unknowns.size[k]
        if problem.unknowns.positive[k] and share <= 0.0:
            raise check.refuse("tune", f"initial of '{name}'", value, "a positive number")
        t[k] = np.log(share) if problem.unknowns.positive[k] else share
    return problem.unknowns.at(t)


def _refuse_unstable(problem: Problem, count: int) -> None:
    """Say why none of so many starts was stabilised."""
    modes = [words for scene in problem.scenes for words in unreached(scene)]
    if modes:
        raise ResponseError(f"tune: no controller of these sensors and actuators stabilises the plant: "
                            f"{'; '.join(modes)}. Give it stiffness or damping, or add an actuator or a sensor.")
    raise ResponseError(f"tune: none of {count} starts was stabilised by this structure, although actuators "
                        f"reach and sensors see all modes that do not decay. Give the controller more freedom, "
                        f"such as derivative action or states, or more starts. An integrator behind a sensor of "
                        f"velocity leaves a pole at 0: take lead_lag in its place.")  # fmt: skip


def _refuse_infinite(problem: Problem, point: Array) -> None:
    """Name the goal that has no value although the loop is stable."""
    for goal in problem.goals:
        for loop in problem.closed(problem.unknowns.values(point)[0]):
            if not np.isfinite(goal.of(loop).value):
                raise ResponseError(f"tune: the goal '{goal.label}' is infinite although the loop is stable: noise "
                                    f"without a last frequency comes through directly. Give a band, filtered noise, or "
                                    f"other outputs.")  # fmt: skip
    raise ResponseError("tune: goals have no gradient at any stable start; give other starts by seed or initial.")


def _design(problem: Problem, x: Array, histories: tuple[tuple[float, ...], ...], single: bool) -> Design:
    p = problem.unknowns.values(x)[0]
    own, variables = problem.split(p)
    loops = problem.closed(p)
    for loop in loops:
        loop.check_stable()
    labels = [goal.label for goal in problem.goals]
    labels = [label if labels.count(label) == 1 else f"{label} ({k + 1})" for k, label in enumerate(labels)]
    named = dict(zip(labels, problem.goals, strict=True))
    by_plant = {label: tuple([goal.of(loop).value for loop in loops]) for label, goal in named.items()}
    achieved = {label: (min if goal.least else max)(by_plant[label]) for label, goal in named.items()}
    norms = [goal.weight * achieved[label] for label, goal in named.items() if goal.limit is None]
    reached = {label: answer for label, goal in named.items() if (answer := goal.reached(achieved[label])) is not None}
    models = tuple([scene.plant_at(variables)[0] for scene in problem.scenes])
    return Design(problem.law.controller(own), models[0] if single else models, loops[0] if single else tuple(loops),
                  problem.values(p), max(norms, default=0.0), achieved, reached, histories, by_plant)  # fmt: skip
