"""Tuning: the search for the values of a controller of a given structure, and of parameters of the mechanism.

Starts are stabilised first, by the growth of their rightmost pole; then the largest weighted norm is minimised, limits
being exact penalties whose weight grows until they hold. The best starts are continued, and begun anew about the best.

Source: Apkarian & Noll, Nonsmooth H-infinity synthesis, IEEE Trans. Autom. Control 51 (2006) 71; Burke, Henrion, Lewis
& Overton, HIFOO (2006), for stabilisation first and BFGS.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.display import Displayed
from mbsvib.common.expected import kind_of
from mbsvib.common.progress import counting
from mbsvib.errors import MbsvibError, ModelError, ResponseError, counted, nearest
from mbsvib.studies.design import design as study_variables
from mbsvib.studies.scales import scales
from mbsvib.tuning.goals import Goal, as_goals
from mbsvib.tuning.minimizing import Descent, bfgs
from mbsvib.tuning.problem import SPARE, Problem, Unknowns
from mbsvib.tuning.reach import unreached
from mbsvib.tuning.scene import Scene, linearized, mean_rate
from mbsvib.tuning.structures import FREE, Value, as_tunable, law

if TYPE_CHECKING:
    from collections.abc import Callable

    from mbsvib.api.loops import ClosedLoop
    from mbsvib.common.arrays import Array
    from mbsvib.common.progress import Progress
    from mbsvib.feedback.controller import Controller
    from mbsvib.tuning.structures import Tunable

SHORT, LONG = 150, 1500  # steps of the first descents, and of those that are continued
BEST = 3  # starts that are continued
RESTARTS, NEAR = 8, 0.02  # new searches about the best, and by how much values are changed for these
GAINED = 1e-4  # restarts end if two of them gain less than this share
PENALTIES = 7  # tenfold weights of limits
# Weights of barriers against hardly stable loops, of first, continued and last searches, in parts of the objective.
BARRIERS = (1e-2, 1e-4, 1e-7)
AWAY = 1e-3  # poles of a stabilised start decay by this share of the mean rate if the structure allows it


@dataclass(frozen=True, repr=False, eq=False)
class Design(Displayed):
    """A tuned ``controller`` with what it reaches.

    ``values`` {name: value} of the controller and of parameters; ``objective``: the largest weighted norm;
    ``achieved`` {goal: value}, the worst of all plants, of loops that were closed anew; ``reached`` {goal: bool} of the
    limits; ``model``, ``loop``: those of the plant, or tuples where there are several plants; ``history``: objectives
    after each step, of each search; ``stable`` starts of how many.
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

    @property
    def success(self) -> bool:
        """Whether all limits are reached."""
        return all(self.reached.values())

    def table(self) -> dict[str, Any]:
        """Return the table of goals as arguments of ``mbsvib.common.tables.text`` and ``show``.

        Returns
        -------
        dict
            Title, columns, rows and notes.
        """
        words = {True: "reached", False: "not reached"}
        rows = [(label, f"{value:.6g}", words[self.reached[label]] if label in self.reached else "minimised")
                for label, value in self.achieved.items()]  # fmt: skip
        missed = [label for label, reached in self.reached.items() if not reached]
        notes = [f"Not reached: {', '.join(missed)}."] if missed else []
        plants = len(next(iter(self.by_plant.values())))
        notes += [f"Values are the worst of {plants} plants."] if plants > 1 else []
        notes.append(f"{len(self.values)} values; {len(self.history)} searches.")
        columns = [("goal", "left"), ("value", "right"), ("", "left")]
        title = f"Tuned controller of {counted(len(self.controller.A), 'state')}"
        return {"title": title, "columns": columns, "rows": rows, "notes": notes}

    def __repr__(self) -> str:
        return f"Design({len(self.values)} values, objective {self.objective:.6g})"


def tune(
    plant: Any, controller: Tunable | Any, goals: Sequence[Goal] | Goal, parameters: Mapping[str, Any] | None = None,
    starts: int = 10, seed: int = 0, initial: Mapping[str, float] | None = None, progress: Progress = None,
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
        ``mv.goals.hinf`` and ``rms`` are minimised, ``damping`` and ``margin`` are limits. Noise of sensors and
        actuators are inputs "SENSOR.noise", "ACTUATOR.noise".
    parameters : mapping, optional
        Bounds (lowest, highest) of parameters of the models by name or pattern; a pattern is one value for all.
    starts : int
        Number of starts: the first one is that of the structure, the others lie about it.
    seed : int
        Seed of the random starts.
    initial : mapping of str to float, optional
        Values at which the first start begins, such as ``values`` of an earlier design.
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
    stable = _stabilised(problem, points)
    with counting(progress, len(stable) + min(BEST, len(stable)) + RESTARTS, "tune") as tell:
        best, histories = _searched(problem, stable, random, tell)
    return _design(problem, best, histories, not isinstance(plant, (list, tuple)))


def _problem(plant: Any, structure: Any, goals: tuple[Goal, ...], parameters: Mapping[str, Any]) -> Problem:
    plants = list(plant) if isinstance(plant, (list, tuple)) else [plant]
    if not plants:
        raise check.refuse("tune", "plant", plant, "a model, a system, a state space, or several")
    if not isinstance(parameters, Mapping):
        raise check.refuse("tune", "parameters", parameters, "bounds by name, {'leg*.k.damping': (1, 500)}")
    systems = [linearized(part) for part in plants]
    known = as_tunable(structure).for_ports(systems[0].inputs, systems[0].outputs)
    rate = float(np.exp(np.mean([np.log(mean_rate(system.poles())) for system in systems])))
    scenes: list[Any] = []
    own: list[Any] = []
    for part, system in zip(plants, systems, strict=True):
        for kind, names, has in (("actuator", known.outputs, system.inputs), ("sensor", known.inputs, system.outputs)):
            for name in names:
                if name not in has:
                    raise ResponseError(f"tune: '{system.name}' has no {kind} '{name}', which the controller needs."
                                        f"{nearest(name, has)}")  # fmt: skip
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
    bounds = tuple([tuple([goal.at(scene) for scene in scenes]) for goal in goals])
    for of_goal in bounds:
        for bound in of_goal:
            bound.rate = rate
    unknowns = Unknowns.of([*of_law.values, *own])
    return Problem(tuple(scenes), of_law, tuple(parameters), unknowns, goals, bounds)


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
        if name not in problem.names:
            raise ModelError(f"tune: initial has '{name}', which is no value of this problem."
                             f"{nearest(str(name), problem.names)}", element=str(name), field="initial")  # fmt: skip
        k = problem.names.index(name)
        share = check.number(value, "tune", f"initial of '{name}'") / problem.unknowns.size[k]
        if problem.unknowns.positive[k] and share <= 0.0:
            raise check.refuse("tune", f"initial of '{name}'", value, "a positive number")
        t[k] = np.log(share) if problem.unknowns.positive[k] else share
    return problem.unknowns.at(t)


def _stabilised(problem: Problem, points: list[Array]) -> list[Array]:
    """Starts whose poles decay; an error that says why if there is none."""
    stable = []
    for point in points:
        if not np.isfinite(problem.objective(point, 1.0)[0]):
            point = bfgs(problem.growth, point, LONG, -AWAY).x
        loops = problem.loops(problem.unknowns.values(point)[0])
        if loops is not None and all(loop.decays for loop in loops):
            stable.append(point)
    if not stable:
        modes = [words for scene in problem.scenes for words in unreached(scene)]
        if modes:
            raise ResponseError(f"tune: no controller of these sensors and actuators stabilises the plant: "
                                f"{'; '.join(modes)}. Give it stiffness or damping, or add an actuator or a sensor.")
        raise ResponseError(f"tune: none of {len(points)} starts was stabilised by this structure, although actuators "
                            f"reach and sensors see all modes that do not decay. Give the controller more freedom, "
                            f"such as derivative action or states, or more starts. An integrator behind a sensor of "
                            f"velocity leaves a pole at 0: take lead_lag in its place.")  # fmt: skip
    finite = [point for point in stable if np.isfinite(problem.objective(point, 1.0)[0])]
    if not finite:
        _refuse_infinite(problem, stable[0])
    return finite


def _refuse_infinite(problem: Problem, point: Array) -> None:
    p = problem.unknowns.values(point)[0]
    loops = problem.closed(p, _noise(problem))
    for goal in problem.goals:
        for loop in loops:
            value = goal.of(loop)
            if not np.isfinite(value):
                raise ResponseError(f"tune: the goal '{goal.label}' is infinite although the loop is stable: noise "
                                    f"without a last frequency comes through directly. Give a band, filtered noise, or "
                                    f"other outputs.")  # fmt: skip
    raise ResponseError("tune: goals have no gradient at any stable start; give other starts by seed or initial.")


def _noise(problem: Problem) -> bool:
    return any(bound.noise for of_goal in problem.bounds for bound in of_goal)


def _searched(problem: Problem, points: list[Array], random: np.random.Generator, tell: Callable[[int], None]
              ) -> tuple[Array, tuple[tuple[float, ...], ...]]:  # fmt: skip
    """The best unknowns, and the history of each search, of which ``tell`` is told."""
    ends = []
    for point in points:
        ends.append(_penalised(problem, point, SHORT, BARRIERS[0]))
        tell(1)
    histories = [end.history for end in ends]
    order = sorted(range(len(ends)), key=lambda k: _rank(problem, ends[k].x))
    continued = []
    for k in order[:BEST]:
        _compare(problem, ends[k].x)
        end = _penalised(problem, ends[k].x, LONG, BARRIERS[1])
        histories[k] += end.history
        continued.append(end.x)
        tell(1)
    best = min((*continued, *points), key=lambda x: _rank(problem, x))  # barriers may lead away from a good start
    without = 0
    for _ in range(RESTARTS):
        _compare(problem, best)
        near = best + NEAR * random.normal(size=len(best)) * np.maximum(np.abs(best), 0.1)
        end = _penalised(problem, near, LONG, BARRIERS[2])
        histories.append(end.history)
        tell(1)
        old, new = _rank(problem, best), _rank(problem, end.x)
        without = 0 if new[0] < old[0] or new[1] < old[1] - GAINED * abs(old[1]) else without + 1
        best = end.x if new < old else best
        if without == 2:
            break
    return best, tuple(histories)


def _penalised(problem: Problem, x: Array, steps: int, barrier: float) -> Descent:
    """A descent with limits as penalties, whose weight grows until they hold."""
    norms = any(not goal.limit for goal in problem.goals)
    value, violation = problem.measured(x)
    penalty = size = max(abs(value), 1e-300) if np.isfinite(value) else 1.0
    history: tuple[float, ...] = ()
    for _ in range(PENALTIES):
        function = partial(problem.objective, penalty=penalty, barrier=barrier * size)
        end = bfgs(function, x, steps, -np.inf if norms else -2.0 * SPARE)
        history += end.history
        x = end.x
        value, violation = problem.measured(x)
        if violation <= 0.0 or not norms:
            break
        penalty *= 10.0
    return Descent(x, value, history)


def _rank(problem: Problem, x: Array) -> tuple[float, float]:
    value, violation = problem.measured(x)
    return max(violation, 0.0), value


def _compare(problem: Problem, x: Array) -> None:
    """Compare with the norms that the library computes on panels, and remember their peaks."""
    loops = problem.closed(problem.unknowns.values(x)[0], _noise(problem))
    for of_goal in problem.bounds:
        for bound, loop in zip(of_goal, loops, strict=True):
            try:
                bound.remember(loop)
            except MbsvibError:  # the search knows no peak that the library refuses
                continue


def _design(problem: Problem, x: Array, histories: tuple[tuple[float, ...], ...], single: bool) -> Design:
    p = problem.unknowns.values(x)[0]
    own, variables = problem.split(p)
    loops: list[Any] = problem.closed(p, _noise(problem))
    for loop in loops:
        loop.check_stable()
    labels = [goal.label for goal in problem.goals]
    labels = [label if labels.count(label) == 1 else f"{label} ({k + 1})" for k, label in enumerate(labels)]
    by_plant = {label: tuple([goal.of(loop) for loop in loops])
                for label, goal in zip(labels, problem.goals, strict=True)}  # fmt: skip
    achieved = {label: (min if goal.limit else max)(by_plant[label])
                for label, goal in zip(labels, problem.goals, strict=True)}  # fmt: skip
    norms = [goal.weight * achieved[label] for label, goal in zip(labels, problem.goals, strict=True) if not goal.limit]
    reached = {label: bool(goal.reached(achieved[label]))
               for label, goal in zip(labels, problem.goals, strict=True) if goal.limit}  # fmt: skip
    models = tuple([scene.model_at(variables) for scene in problem.scenes])
    return Design(problem.law.controller(own), models[0] if single else models, loops[0] if single else tuple(loops),
                  problem.values(p), max(norms, default=0.0), achieved, reached, histories, by_plant)  # fmt: skip
