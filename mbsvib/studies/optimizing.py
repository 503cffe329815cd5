"""Design by optimisation: exact values and gradients for scipy's SLSQP and trust-constr, and CasADi's IPOPT."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from importlib import util
from typing import Any

import numpy as np

from mbsvib.api.model import Model
from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array
from mbsvib.common.casadi_function import casadi_function
from mbsvib.errors import MbsvibError, ModelError, UnstableWarning
from mbsvib.responses.norms import growth
from mbsvib.studies.design import Ties
from mbsvib.studies.optimum import FEASIBLE, HELD, Descent, Optimum
from mbsvib.studies.plants import systems_of
from mbsvib.studies.quantities import Constraint, Quantity
from mbsvib.studies.search import Search, Value, scales

FTOL = 1e-12  # of SLSQP, in parts of the objective where the search began
ITERATIONS = 100  # of SLSQP before it begins anew; at a kink it stays, with more and more trials a step
INFINITE = 1e20  # IPOPT's value for no bound


@dataclass(frozen=True)
class SolverResult:
    """Result of a solver: unknowns, success, message, number of iterations, and the points of steps that led to no
    result, with the errors there.
    """

    z: Array
    success: bool
    message: str
    iterations: int
    failures: tuple[tuple[Array, MbsvibError], ...] = ()


def solver(method: str) -> Callable[[Search, Array, Mapping[str, Any]], SolverResult]:
    """Return a solver by its name: "SLSQP", "trust-constr" or "ipopt"."""
    known: dict[str, Callable[..., SolverResult]] = {
        "slsqp": partial(_scipy, method="SLSQP"), "trust-constr": partial(_scipy, method="trust-constr"),
        "ipopt": _ipopt,
    }  # fmt: skip
    name = str(method).lower()
    if name not in known:
        raise check.refuse("optimize", "method", method, "'SLSQP', 'trust-constr' or 'ipopt'")
    if name == "ipopt" and util.find_spec("casadi") is None:
        raise ModelError("optimize: method 'ipopt' is CasADi's; pip install \"mbsvib[casadi]\"", field="method")
    return known[name]


def _scipy(search: Search, z: Array, options: Mapping[str, Any], method: str) -> SolverResult:
    """A search by scipy; only line searches, as SLSQP's, go back from where there is no mechanism."""
    from scipy.optimize import Bounds, minimize

    slsqp, trials = method == "SLSQP", _Trials(search, search.at(z))

    def at(z: Array, part: str) -> Array:
        return trials.at(z, part) if slsqp else np.asarray(getattr(search.at(z), part).value)

    constraints = [
        {"type": kind, "fun": lambda z, part=part: at(z, part),
         "jac": lambda z, part=part: getattr(search.at(z), part).slope}
        for kind, part in (("ineq", "g"), ("eq", "h"))
        if len(getattr(trials.first, part).value)
    ]  # fmt: skip
    own = {"ftol": FTOL, "maxiter": ITERATIONS} if slsqp else {"maxiter": 1000, "gtol": 1e-9, "xtol": 1e-10}
    with warnings.catch_warnings():  # trust-constr's BFGS warns of steps that do not change the gradient
        if not slsqp:
            warnings.simplefilter("ignore", UserWarning)
        end = minimize(lambda z: float(at(z, "f")[0]), z, jac=lambda z: search.at(z).f.slope[0], method=method,
                       bounds=Bounds(*search.bounds(), keep_feasible=True), constraints=constraints,
                       options=own | dict(options))  # fmt: skip
    success = bool(end.success) if slsqp else end.status in (1, 2)
    return SolverResult(np.asarray(end.x), success, str(end.message), int(end.nit), tuple(trials.failures))


class _Trials:
    """Values at trial points of a line search.

    A step may lead to where the mechanism has no response or cannot be built. The objective is infinite there, so that
    the solver takes a shorter step; constraints keep their values at the first point, as the infinite objective
    decides.
    """

    def __init__(self, search: Search, first: Value) -> None:
        self.search, self.first = search, first
        self.failures: list[tuple[Array, MbsvibError]] = []

    def at(self, z: Array, part: str) -> Array:
        try:
            value = self.search.at(z)
        except MbsvibError as error:
            self.failures.append((z.copy(), error))
            return np.array([np.inf]) if part == "f" else np.asarray(getattr(self.first, part).value)
        return np.asarray(getattr(value, part).value)


def _ipopt(search: Search, z: Array, options: Mapping[str, Any]) -> SolverResult:
    import casadi as ca

    first = search.at(z)
    n, sizes = len(z), (1, len(first.g.value), len(first.h.value))

    def stacked(part: str) -> Callable[[Array], list[Array]]:
        def at(z: Array) -> list[Array]:
            value = search.at(z)
            return [np.concatenate([getattr(dual, part) for dual in (value.f, value.g, value.h)])]

        return at

    values = casadi_function("values", (sum(sizes), n), ("fgh",), stacked("value"), stacked("slope"))
    unknowns = ca.MX.sym("z", n)
    outputs = values(unknowns)
    quiet = {"ipopt.hessian_approximation": "limited-memory", "ipopt.print_level": 0, "print_time": False,
             "ipopt.sb": "yes", "ipopt.tol": 1e-9, "ipopt.max_iter": 500}  # fmt: skip
    ipopt_options = {name if name in ("print_time", "verbose") else f"ipopt.{name}": value
                     for name, value in options.items()}  # fmt: skip
    problem: Any = {"x": unknowns, "f": outputs[0], "g": outputs[1:]}
    kwargs: Any = {**quiet, **ipopt_options}
    solve = ca.nlpsol("search", "ipopt", problem, kwargs)
    low, high = (np.clip(bound, -INFINITE, INFINITE) for bound in search.bounds())
    answer = solve(x0=z, lbx=low, ubx=high, lbg=0.0,
                   ubg=np.concatenate((np.full(sizes[1], INFINITE), np.zeros(sizes[2]))))  # fmt: skip
    stats = solve.stats()
    return SolverResult(np.asarray(answer["x"], dtype=float).reshape(-1), bool(stats["success"]),
                        str(stats["return_status"]).replace("_", " "), int(stats["iter_count"]))  # fmt: skip


ROUNDS = 30
FLAT = 1e-9  # gradient, in parts of the objective, that counts as zero
OPTIMAL = 1e-4  # permitted projected gradient, in parts of the gradient
DOUBTED = 0.1  # the same where the solver states success, which it also does where rounding stops it
PROGRESS = 1e-6  # decrease of the objective, in parts of that where the search began, for which a solver begins anew
KINK = 1e-4  # largest step of an unknown to points of which the gradients count as well, at a kink
ACTIVE = 1e-5  # distance from a constraint, in parts of it or of the range of a variable, at which it is active


def optimize(
    model: Model, variables: Mapping[str, tuple[float | None, float | None] | None], objective: Quantity,
    constraints: Constraint | Iterable[Constraint] = (), *, ties: Ties | None = None,
    start: Mapping[str, float] | None = None, method: str = "SLSQP", options: Mapping[str, Any] | None = None,
    starts: int = 1, seed: int = 0, observed: Mapping[str, Quantity] | None = None,
    plant: Callable[..., Any] | None = None, relaxed: bool = False,
) -> Optimum:  # fmt: skip
    """Return the values of some parameters at which a quantity is smallest, by its exact gradient.

    The search is local: it ends in a minimum that is downhill from where it begins, which need not be the smallest one
    within the bounds. ``starts`` begins at several points and keeps the best end.

    Quantities are made by ``mbsvib.studies``: ``frequency``, ``damping_ratio``, ``placement``, ``gain``, ``peak``,
    ``rms``, ``variable``, those of a ``cycle``, and sums, products, ``largest`` and ``smallest`` of these.
    Comparing one with a number makes a constraint: ``damping_ratio() >= 0.05``.

    Parameters
    ----------
    model : Model
        The mechanism.
    variables : mapping of str to (float, float) or None
        Lower and upper bound of each variable, None for none: a parameter, a pattern that ties several to one value
        (``"leg*.k.stiffness"``), a joint coordinate (its displacement from the described pose [m, rad], as of
        ``moved``; derivatives are then differences of fourth order), or a name that ``ties`` explains. Those with
        positive bounds are searched for by their logarithm.
    objective : Quantity
        The quantity to be minimised; the negative of a quantity to be maximised.
    constraints : Constraint or iterable of Constraint
        What has to hold.
    ties : mapping of str to mapping of str to float or Tie, optional
        Linear maps: {variable: {parameter or pattern: rate}} adds rate x variable to the values of the model. Other
        functions are objects with ``values(variables)`` and ``rates(variables)``, such as ``isolation.platform``.
    start : mapping of str to float, optional
        Initial values; default: those of the model.
    method : str
        "SLSQP" or "trust-constr" of scipy, or "ipopt" of CasADi (extra ``casadi``). Unless ``options`` are given, a
        solver that stops before an optimum begins anew where it stopped, as long as the objective decreases; where
        SLSQP fails with an objective above that of the start, trust-constr searches from there.
    options : mapping of str to object, optional
        The solver's own.
    starts : int
        Number of searches: from ``start``, and from points of a Latin hypercube within the bounds, which all variables
        must then have (logarithmic for positive bounds).
    seed : int
        Of the Latin hypercube: the same seed gives the same points.
    observed : mapping of str to Quantity, optional
        Quantities by name that are wanted at the optimum, but neither minimised nor bounded.
    plant : callable, optional
        A function of the system that returns what quantities are those of in its place, such as the closed loop
        ``lambda system, gain=1.0: system.feedback(-gain * K)``. Its further arguments may be variables by their names,
        which start at their defaults. Derivatives are exact for continuous loops around the system whose controller
        does not depend on the parameters; those of its matrices to gains, and all of other plants, such as sampled
        loops and controllers that are designed for each system, are differences of fourth order.
    relaxed : bool
        Whether springs keep their forces where joints are displaced, as for ``sweep``.

    Returns
    -------
    Optimum
        The best design found, and how good it is; prints as a table.

    Raises
    ------
    ModelError
        If a variable is unknown, derivatives to it are not supported, bounds are invalid, or a peak is to be maximised.
        If there are several starts, and all searches fail.
    """
    check.mapping("optimize", "variables", variables, "bounds for each variable, such as "
                  "{'leg*.k.stiffness': (1e6, 1e8)}")  # fmt: skip
    if not isinstance(objective, Quantity):
        hint = "studies.given makes one of a function that returns derivatives too." if callable(objective) else ""
        raise check.refuse("optimize", "objective", objective, "a quantity, such as -smallest(damping_ratio())", hint)
    constraint_list: tuple[Any, ...] = tuple(constraints) if isinstance(constraints, Iterable) else (constraints,)
    for constraint in constraint_list:
        if not isinstance(constraint, Constraint):
            raise check.refuse("optimize", "constraints", constraint, "a constraint, such as damping_ratio() >= 0.05")
    solve = solver(method)
    watched = {} if observed is None else observed
    if not isinstance(watched, Mapping) or not all(isinstance(part, Quantity) for part in watched.values()):
        raise check.refuse("optimize", "observed", observed, "quantities by name, such as {'stroke': rms('stroke')}")
    systems = systems_of(model, variables, ties, plant, relaxed)
    search = Search(systems, scales(systems.design, variables, start), objective, constraint_list, dict(watched))
    ends: list[Optimum] = []
    descents: list[Descent] = []
    for x in _points(search, starts, seed):
        try:
            end = _descended(search, x, lambda at, z: solve(at, z, dict(options or {})), options is None)
            ends.append(end)
            if options is None and method.lower() == "slsqp" and not end.success and end.objective > end.began:
                other = _descended(search, x, lambda at, z: solver("trust-constr")(at, z, {}), True)
                ends[-1] = min(end, other, key=_rank)
            descents.append(ends[-1].starts[0])
        except MbsvibError as error:  # another start may be no mechanism, or lead to none
            if starts == 1:
                raise
            nowhere = dict.fromkeys(systems.design.variables, np.nan)
            descents.append(Descent(search.values(x), nowhere, np.nan, np.nan, False, str(error)))
    if not ends:
        raise ModelError(f"optimize: none of {starts} starts leads anywhere, the first: {descents[0].message}",
                         field="starts")  # fmt: skip
    best = min(ends, key=_rank)
    if best.unstable:
        warnings.warn(f"optimize: '{model.name}' is not stable at the optimum: {best.unstable} grows. {HELD}",
                      UnstableWarning, stacklevel=2)  # fmt: skip
    iterations = sum(end.iterations for end in ends)
    return replace(best, starts=tuple(descents), iterations=iterations, evaluations=search.evaluations)


def _points(search: Search, starts: int, seed: int) -> Array:
    """Unknowns (starts, variables) to begin at: those of the start, then a Latin hypercube within the bounds."""
    check.count(starts, "optimize", "starts", 1)
    check.count(seed, "optimize", "seed", 0)
    own_start = np.zeros((1, len(search.scales.start)))
    if starts == 1:
        return own_start
    from scipy.stats import qmc

    low, high = search.scales.bounds()
    for name, size in zip(search.design.variables, high - low, strict=True):
        if not np.isfinite(size):
            raise ModelError(f"optimize: variable '{name}' has no bounds on both sides, within which starts = {starts} "
                             f"could lie; give them, or leave starts out.", element=name, field="starts")  # fmt: skip
    shares = qmc.LatinHypercube(own_start.shape[1], seed=np.random.default_rng(seed)).random(starts - 1)
    return np.concatenate((own_start, low + shares * (high - low)))


def _descended(search: Search, x: Array, solve: Callable[[Search, Array], SolverResult], again: bool) -> Optimum:
    """The end of a local search that begins at the unknowns of variables; ``again``: a solver that stops before an
    optimum begins anew where it stopped, as long as this improves the objective.
    """
    z, iterations = search.begin(x), 0
    failures: tuple[tuple[Array, MbsvibError], ...] = ()
    began = search.true(z)[0]
    for _ in range(ROUNDS):
        before = search.at(z)
        solver_result = solve(search, z)
        iterations += solver_result.iterations
        z, exchanged = search.exchange(np.clip(solver_result.z, *search.bounds()))
        now = search.at(z)
        improved = again and (max(_violation(now), FEASIBLE), float(now.f.value[0]) + PROGRESS) < (
            max(_violation(before), FEASIBLE), float(before.f.value[0]))  # fmt: skip
        failures += solver_result.failures
        if not exchanged and not (improved and not _ended(search, z, solver_result)):
            break
    solver_result = replace(solver_result, iterations=iterations, failures=failures)
    for at, error in failures:  # of steps from which the solver did not get away to an optimum
        if np.abs(at - z).max() <= ACTIVE:
            raise error
    if failures and not _ended(search, z, solver_result):
        raise failures[0][1]
    return _optimum(search, z, solver_result, x, began)


def _violation(evaluation: Value) -> float:
    """The largest violation of a constraint, in parts of its bound."""
    return max(0.0, -float(evaluation.g.value.min(initial=0.0)), float(np.abs(evaluation.h.value).max(initial=0.0)))


def _ended(search: Search, z: Array, solver_result: SolverResult) -> bool:
    """Whether so little of the gradient is left over that the solver may end there."""
    return _left_over(search, z) <= (DOUBTED if solver_result.success else OPTIMAL)


def _rank(end: Optimum) -> tuple[float, float]:
    return max(end.violation, FEASIBLE), end.objective


def _optimum(search: Search, z: Array, solver_result: SolverResult, x: Array, began: float) -> Optimum:
    point = search.point(z[: len(search.scales.start)])
    objective, numbers = search.true(z)
    evaluation = search.at(z)
    violation, optimality = _violation(evaluation), _left_over(search, z)
    parameters, values = search.design.values(point.values), dict(point.values)
    success = violation <= FEASIBLE and optimality <= (DOUBTED if solver_result.success else OPTIMAL)
    descent = Descent(search.values(x), values, objective, violation, success, solver_result.message)
    model = (search.systems.balanced(point.values)[0] if search.needs_equations
             else search.systems.described(point.values))  # fmt: skip
    return Optimum(
        model, values, parameters, descent.start, objective, began,
        search.objective.label,
        dict(zip(search.labels, numbers, strict=True)),
        search.observations(z), search.violations(numbers), violation, search.at_bounds(z, ACTIVE), optimality,
        success, solver_result.message, solver_result.iterations, search.evaluations, search.design.units, (descent,),
        None if search.systems.plant.function is None else point.system,
        growth(point.system) if search.needs_equations else "",
    )  # fmt: skip


def _left_over(search: Search, z: Array) -> float:
    """Norm of the objective's gradient minus its projection on active constraints' gradients, relative to it.

    Bounds of a maximum have kinks themselves where eigenvalues coincide: no single basis of their modes has the
    gradients that balance there, so those of points within ``KINK`` are added.
    Source: Burke, Lewis, Overton, "A robust gradient sampling algorithm", SIAM J. Optim. 15 (2005), 751-779.
    """
    evaluation, (low, high) = search.at(z), search.bounds()
    gradient = evaluation.f.slope[0]
    size = max(float(np.linalg.norm(gradient)), search.steepest, FLAT)
    unit_, h = np.eye(len(z)), evaluation.h.slope
    rows = [unit_[z <= low + ACTIVE], -unit_[z >= high - ACTIVE], h, -h, _active(evaluation, z)]
    residual = _outside(rows, gradient) / size
    if residual > OPTIMAL and search.largest:
        n = len(search.scales.start)
        for step in KINK * np.random.default_rng(0).uniform(-1.0, 1.0, (n + 1, n)):
            near = np.concatenate((np.clip(z[:n] + step, low[:n], high[:n]), z[n:]))
            with suppress(MbsvibError):
                rows.append(_active(search.at(near), z))
        residual = _outside(rows, gradient) / size
    return residual


def _active(evaluation: Value, z: Array) -> Array:
    """Gradients of constraints g that are active at ``z`` by their tangents."""
    return evaluation.g.slope[evaluation.g.value + evaluation.g.slope @ (z - evaluation.z) <= ACTIVE]


def _outside(rows: list[Array], gradient: Array) -> float:
    """Distance of a gradient from the cone of others."""
    from scipy.optimize import nnls

    matrix = np.concatenate(rows).T
    if not matrix.shape[1]:
        return float(np.linalg.norm(gradient))
    scale = np.linalg.norm(matrix, axis=0)
    return float(nnls(matrix / np.where(scale > 0.0, scale, 1.0), gradient)[1])
