"""The fit of a model to measurements, in the public classes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any
from warnings import warn

import numpy as np

from mbsvib.api.plant import Plant, compiled
from mbsvib.api.system import System
from mbsvib.common.arguments import count, names_in, refuse
from mbsvib.common.arrays import Array
from mbsvib.common.progress import Progress, counting
from mbsvib.equations.matrices import MATRICES
from mbsvib.equilibrium.search import at_equilibrium
from mbsvib.errors import AccuracyWarning, MbsvibError, ModelError
from mbsvib.fitting.data import KINDS, conditioned, mode_data, record_data, response_data
from mbsvib.fitting.knowledge import Knowledge, knowledge
from mbsvib.fitting.mode_data import ModeData
from mbsvib.fitting.problem import STEPS, STEPS_FAR, Found, Problem, minimized
from mbsvib.fitting.record_data import RecordData
from mbsvib.fitting.response_data import ResponseData
from mbsvib.fitting.result import Fit
from mbsvib.fitting.variables import Variables, limited, variables
from mbsvib.measurement.data import Measurement
from mbsvib.measurement.records import Records
from mbsvib.mechanism.changes import to_angular_velocities

# Factor of positive values, and change of others in parts of their size, by which starts differ from the first.
SPREAD = 1.5
# Noise that is not known is told by residuals, which change the weights, which change the residuals: so many times.
REWEIGHTED = 3


class Scene:
    """The equations of a model as a function of some parameters, with derivatives, in equilibrium under its loads."""

    def __init__(self, model: Any, parameters: Sequence[str]) -> None:
        self.model = model
        self.plant: Plant = compiled(model, list(parameters))

    def __call__(self, values: Array, directions: Array | None) -> tuple[System, dict[str, Array] | None]:
        if self.plant.loaded:
            return self._in_equilibrium(values, directions)
        system = self.plant.system(values)
        if directions is None:
            return system, None
        tangent = self.plant.tangent(values, directions.T)
        return system, {key: getattr(tangent, key) for key in MATRICES}

    def _in_equilibrium(self, values: Array, directions: Array | None) -> tuple[System, dict[str, Array] | None]:
        by_name = dict(zip(self.plant.names, values.tolist(), strict=True))
        _, system = at_equilibrium(self.model.with_values(by_name), method="dense", dense=System)
        if directions is None:
            return system, None
        rates = [dict(zip(self.plant.names, column.tolist(), strict=True)) for column in directions.T]
        to_angular_velocities(rates, by_name)
        slopes = system.matrix_derivatives({f"value {k}": one for k, one in enumerate(rates)})
        return system, {key: getattr(slopes, key) for key in MATRICES}


def fitted(
    model: Any, data: Any, free: Any, tied: Any = (), prior: Any = None, bounds: Any = None,
    channels: str | Sequence[str] = (), starts: int = 1, seed: int = 0, progress: Progress = None,
) -> Fit:  # fmt: skip
    """Return the model that measured data tell; see ``Model.fit``."""
    kinds = names_in([channels] if isinstance(channels, str) else channels)
    if kinds is None or set(kinds) - set(KINDS):
        raise refuse("fit", "channels", channels, f"some of {', '.join(map(repr, KINDS))}")
    count(starts, "fit", "starts", 1)
    count(seed, "fit", "seed", 0)
    measured = conditioned(data)
    problem = _started(_problem(model, measured, variables(model.parameters, free, tied), kinds, (prior, bounds)))
    most = starts * (STEPS_FAR + STEPS) + REWEIGHTED * STEPS
    with counting(progress, most, "fit") as tell:
        found = _best(problem, starts, seed, lambda cost: tell(1))
        problem, found = _weighted(problem, found, lambda cost: tell(1))
    return _result(model, problem, found, tuple([one for _, one in measured]))


def _problem(
    model: Any, data: Sequence[tuple[dict[str, float], Any]], chosen: Variables, kinds: Sequence[str],
    known: tuple[Any, Any] = (None, None),
) -> Problem:  # fmt: skip
    """All data, one scene for each condition in which they were measured; ``known``: prior and bounds of values."""
    conditions: list[dict[str, float]] = []
    scenes: list[Scene] = []
    parts: list[ResponseData | RecordData | ModeData] = []
    for k, (values, measured) in enumerate(data, start=1):
        if values not in conditions:
            conditions.append(values)
            scenes.append(Scene(_in_condition(model, values, chosen), chosen.parameters))
        number = conditions.index(values)
        name, scene = f"data {k}", scenes[number]
        if isinstance(measured, (Measurement, Records)):
            of: Any = response_data if isinstance(measured, Measurement) else record_data
            part, added = of(measured, name, number, scene, kinds, len(chosen.names), chosen.names)
            chosen = chosen.with_channels(added)
            parts.append(part)
        else:
            parts.append(mode_data(measured, name, number, scene))
    chosen = limited(chosen, *known)
    for k, part in enumerate(parts):
        if isinstance(part, RecordData):
            parts[k] = part.with_free_states(scenes[part.scene](chosen.map @ chosen.start, None)[0], chosen.start)
        elif isinstance(part, ModeData) and len(part.shapes):
            parts[k] = part.with_radius(scenes[part.scene](chosen.map @ chosen.start, None)[0])
    problem = Problem(chosen, tuple(scenes), tuple(parts))
    if problem.numbers < len(chosen.names):
        raise ModelError(f"fit: {len(chosen.names)} values are free, and {problem.numbers:.4g} numbers were measured; "
                         f"give more data, fix values or tie them.", field="free")  # fmt: skip
    return problem


def _in_condition(model: Any, values: Mapping[str, float], chosen: Variables) -> Any:
    """The model with other values of some parameters, moved along joint coordinates."""
    known = set(model.parameters)
    numbers = {name: value for name, value in values.items() if name in known}
    moves = {name: value for name, value in values.items() if name not in known}
    for name in numbers:
        if name in chosen.parameters:
            raise ModelError(f"fit: '{name}' is fitted, and given for some of the data; leave it out of one of both.",
                             element=name, field="data")  # fmt: skip
    changed = model.with_values(numbers) if numbers else model
    if not moves:
        return changed
    moved = changed.moved(moves, relaxed=True)
    for name in chosen.parameters:
        if moved.parameters[name] != changed.parameters[name]:
            raise ModelError(f"fit: '{name}' changes with the pose, and data were measured in several poses; such "
                             f"numbers can be fitted in one pose only.", element=name, field="free")  # fmt: skip
    return moved


def _started(problem: Problem) -> Problem:
    """The problem with starts of gains and delays; modes alone that may be others than those of the start are named."""
    values = problem.variables.start
    alone = all(isinstance(data, ModeData) for data in problem.data)
    for data in problem.data:
        if not isinstance(data, ModeData) or alone:
            equations, _ = problem.scenes[data.scene](problem.variables.map @ values, None)
        if isinstance(data, ResponseData):
            data.check_phases(equations)
        if not isinstance(data, ModeData):
            values = data.started(equations, values)
        elif alone:
            for guess in data.guesses(equations):
                warn(f"fit: {guess}. Give shapes or responses, or start nearer, or it may be another mode.",
                     AccuracyWarning, stacklevel=4)  # fmt: skip
    return Problem(problem.variables.starting(values), problem.scenes, problem.data)


def _best(problem: Problem, starts: int, seed: int, tell: Any) -> Found:
    """The best of some searches, each from afar and then to the end: the first start is the model's."""
    rng, first = np.random.default_rng(seed), problem.variables.unknowns(problem.variables.start)
    share = np.where(first == 0.0, 1.0, np.minimum(np.abs(first), 1.0))  # of their size, which may be larger than they
    spread = np.where(problem.variables.positive, np.log(SPREAD), (SPREAD - 1.0) * share)
    spread[len(spread) - int((~problem.variables.map.any(axis=0)).sum()) :] = 0.0  # channels have starts of their own
    found, refused = [], None
    # responses that short records tell may lead astray, so that these are searched without them as well
    both = any(isinstance(part, RecordData) and part.estimate is not None for part in problem.data)
    for k in range(starts):
        try:
            start = first + (spread * rng.standard_normal(len(first)) if k else 0.0)
            far = minimized(problem, start, True, tell)
            found += [minimized(problem, x, False, tell) for x in ([far.x, start] if both else [far.x])]
        except MbsvibError as error:  # a start that is no mechanism
            refused = error
    if not found:
        assert refused is not None
        raise refused
    return min(found, key=lambda one: one.cost)


def _weighted(problem: Problem, found: Found, tell: Any) -> tuple[Problem, Found]:
    """The same with noise that residuals tell, where it is not known."""
    for _ in range(0 if problem.known else REWEIGHTED):
        problem = problem.reweighted(found.x)
        found = minimized(problem, found.x, False, tell)
    return problem, found


def _result(model: Any, problem: Problem, found: Found, data: tuple[Any, ...]) -> Fit:
    chosen, values = problem.variables, problem.variables.values(found.x)
    known = knowledge(problem, found.x)
    rates = chosen.rates(values)
    with np.errstate(invalid="ignore"):
        covariance = known.covariance * np.abs(np.outer(rates, rates))
    covariance[np.isinf(known.covariance)] = np.inf
    by_parameter = dict(zip(chosen.parameters, (chosen.map @ values).tolist(), strict=True))
    result: Any = model.with_values(by_parameter)
    if problem.scenes[0].plant.loaded:  # type: ignore[attr-defined]
        result = at_equilibrium(result, method="dense")[0]
    slopes = [{chosen.parameters[k]: 1.0 for k in np.flatnonzero(column)} for column in chosen.map.T if column.any()]
    to_angular_velocities(slopes, by_parameter)
    return Fit(
        result, dict(zip(chosen.names, values.tolist(), strict=True)), _intervals(chosen, known, found.x), covariance,
        dict(zip(chosen.names, chosen.units, strict=True)), known.test,
        tuple([_in_words(one, chosen) for one in known.combinations]), found.converged,
        known.quantile,
        dict(zip(chosen.names, slopes, strict=False)), data, problem, found.x,
    )  # fmt: skip


def _intervals(chosen: Variables, known: Knowledge, x: Array) -> dict[str, tuple[float, float]]:
    deviation = known.quantile * np.sqrt(known.covariance.diagonal())
    result = {}
    for name, at, half, size, positive in zip(chosen.names, x, deviation, chosen.size, chosen.positive, strict=True):
        ends = (0.0, np.inf) if np.isinf(half) and positive else (at - half, at + half)
        if np.isfinite(half):
            with np.errstate(over="ignore"):
                ends = tuple(np.exp(ends)) if positive else tuple(size * np.array(ends))
        result[name] = float(ends[0]), float(ends[1])
    return result


def _in_words(combination: Mapping[str, float], chosen: Variables) -> str:
    """A direction that the data do not tell, by changes that leave them as they are: relative ones of positive values.
    """
    if len(combination) == 1:
        return next(iter(combination))
    known = dict(zip(chosen.names, zip(chosen.positive, chosen.size, chosen.units, strict=True), strict=True))
    changes = []
    for name, share in combination.items():
        positive, size, unit = known[name]
        changes.append(f"{name} {share:+.2g} %" if positive else f"{name} {0.01 * size * share:+.2g} {unit}".rstrip())
    return f"{', '.join(changes[:-1])} and {changes[-1]} together leave the data as they are"
