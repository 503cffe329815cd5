"""Adapters from a search to solvers: scipy's SLSQP and trust-constr, and CasADi's IPOPT."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.casadi_function import casadi_function
from mbsvib.errors import MbsvibError, ModelError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from mbsvib.common.arrays import Array
    from mbsvib.studies.search import Search, Value


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
    known = {"slsqp": _slsqp, "trust-constr": _trust, "ipopt": _ipopt}
    name = str(method).lower()
    if name not in known:
        raise check.refuse("optimize", "method", method, "'SLSQP', 'trust-constr' or 'ipopt'")
    if name == "ipopt":
        from importlib.util import find_spec

        if find_spec("casadi") is None:
            raise ModelError("optimize: method 'ipopt' is CasADi's; pip install mbsvib[casadi]", field="method")
    return known[name]


def _slsqp(search: Search, z: Array, options: Mapping[str, Any]) -> SolverResult:
    from scipy.optimize import minimize

    trials = _Trials(search, search.at(z))
    constraints = [
        {"type": kind, "fun": lambda z, part=part: trials.at(z, part),
         "jac": lambda z, part=part: getattr(search.at(z), part).slope}
        for kind, part in (("ineq", "g"), ("eq", "h"))
        if len(getattr(trials.first, part).value)
    ]  # fmt: skip
    end = minimize(lambda z: float(trials.at(z, "f")[0]), z, jac=lambda z: search.at(z).f.slope[0],
                   method="SLSQP", bounds=list(zip(*search.bounds(), strict=True)), constraints=constraints,
                   options={"ftol": FTOL, "maxiter": ITERATIONS, **options})  # fmt: skip
    return SolverResult(np.asarray(end.x), bool(end.success), str(end.message), int(end.nit), tuple(trials.failures))


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


def _trust(search: Search, z: Array, options: Mapping[str, Any]) -> SolverResult:
    import warnings

    from scipy.optimize import BFGS, Bounds, NonlinearConstraint, minimize

    constraints = [
        NonlinearConstraint(lambda z, part=part: getattr(search.at(z), part).value, 0.0, high,
                            jac=lambda z, part=part: getattr(search.at(z), part).slope, hess=BFGS())
        for part, high in (("g", np.inf), ("h", 0.0))
        if len(getattr(search.at(z), part).value)
    ]  # fmt: skip
    with warnings.catch_warnings():  # its BFGS warns of steps that do not change the gradient
        warnings.simplefilter("ignore", UserWarning)
        end = minimize(lambda z: float(search.at(z).f.value[0]), z, jac=lambda z: search.at(z).f.slope[0],
                       method="trust-constr", hess=BFGS(), bounds=Bounds(*search.bounds(), keep_feasible=True),
                       constraints=constraints,
                       options={"maxiter": 1000, "gtol": 1e-9, "xtol": 1e-10, **options})  # fmt: skip
    return SolverResult(np.asarray(end.x), end.status in (1, 2), str(end.message), int(end.nit))


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
