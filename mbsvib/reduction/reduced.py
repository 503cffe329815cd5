"""Reduced models of a system by four methods, to an order or to an error."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.equations.equations import Truncation
from mbsvib.errors import ResponseError, nearest
from mbsvib.reduction.balanced import balanced
from mbsvib.reduction.craig_bampton import CraigBampton
from mbsvib.reduction.error import error_bound, rounding_error
from mbsvib.reduction.modal import ModalTruncation

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.equations.equations import Equations
    from mbsvib.reduction.balanced import Balanced
    from mbsvib.responses.state_space import StateSpace

METHODS = ("balanced", "modal", "static-corrected", "craig-bampton")


def reduced_space(space: StateSpace, order: int | None = None, error: float | None = None) -> StateSpace:
    """Return a state space of an ``order``, or of an ``error`` at most, by balanced truncation: states hankel1,
    hankel2, ...

    States that do not decay are kept. The error is the largest singular value of that of the frequency response, output
    by input in SI units.
    """
    _check(space.name, order, error, len(space.states), "states")
    realization = balanced(space.A, space.B, space.C)
    lasting = realization.lasting
    if error is None:
        n = min(int(order or 0), lasting + len(realization.hankel))
        small, bound = _truncated(space, realization, n)
    else:
        n = realization.order(float(error))
        small, bound = _truncated(space, realization, n)
        if bound > error:  # rounding takes a part of it
            n = realization.order(max(0.0, 2.0 * error - bound))
            small, bound = _truncated(space, realization, n)
        if bound > error:
            raise ResponseError(f"reduced: error = {error:g}; rounding of the {len(space.states)} states of "
                                f"'{space.name}' alone leaves up to {bound:.3g}. Give a larger error, or reduce other "
                                f"states, such as state_space('modal') of a system.")  # fmt: skip
    a, b, c = small
    names = tuple([f"lasting{k + 1}" if k < lasting else f"hankel{k - lasting + 1}" for k in range(n)])
    return replace(
        space, realization="reduced", A=a, B=b, C=c, D=space.D.copy(),
        transform=space.transform @ realization.right[:, :n], states=names, state_units=("",) * n,
        error_bound=bound + (space.error_bound or 0.0),
    )  # fmt: skip


def check_first_order(name: str, method: str) -> None:
    """Refuse methods that project equations of motion for the state space ``name``."""
    if method == "balanced":
        return
    advice = ("it projects equations of motion, which a state space has not: reduce the system, or take 'balanced'."
              if method in METHODS else f"expected 'balanced'.{nearest(str(method), METHODS)}")  # fmt: skip
    raise ResponseError(f"reduced: method = {method!r} for the state space '{name}'; {advice}")


def _truncated(space: StateSpace, realization: Balanced, n: int) -> tuple[tuple[Array, Array, Array], float]:
    """A, B, C of the first n states, and a bound of their error: truncation, or what is seen about poles, and rounding.
    """
    if n < realization.lasting:
        raise ResponseError(f"reduced: order = {n}; {realization.lasting} of the {len(space.states)} states of "
                            f"'{space.name}' do not decay and are kept. Ask for at least as many, or give the "
                            f"mechanism damping.")  # fmt: skip
    small = realization.matrix(space.A, n), realization.left[:n] @ space.B, space.C @ realization.right[:, :n]
    about_poles, rounding = rounding_error(space, small, realization.lasting)
    return small, max(realization.bound(n), about_poles) + rounding


def hankel_singular_values(space: StateSpace) -> Array:
    """Return the Hankel singular values sqrt(lambda_i(P Q)) of the states that decay, P and Q the Gramians, descending.
    """
    return balanced(space.A, space.B, space.C).hankel


def reduced_equations(
    system: Equations, method: str, order: int | None = None, error: float | None = None
) -> Equations:
    """Return equations of motion in ``order`` coordinates, or in as few as an ``error`` of the response allows.

    modal: the modes that contribute most; static-corrected: these, and the static response of the others in D;
    craig-bampton: displacements of outputs and of the points where inputs act, and modes with these held
    """
    if method not in METHODS[1:]:
        about = " It is for systems of sparse matrices (System.from_matrices)." if method == "krylov" else ""
        raise ResponseError(f"reduced: method = {method!r}; expected one of {', '.join(map(repr, METHODS))}.{about}"
                            f"{nearest(str(method), METHODS)}")  # fmt: skip
    _check(system.name, order, error, system.dof, "coordinates")
    if system.massless or system.circulatory is not None:
        kind = "motions without mass" if system.massless else "forces that follow the motion"
        raise ResponseError(f"reduced: '{system.name}' has {kind}, which method = {method!r} does not project; take "
                            f"method='balanced'.")  # fmt: skip
    family = CraigBampton(system) if method == "craig-bampton" else ModalTruncation(system,
                                                                                   method == "static-corrected")
    if order is not None and order < family.least:
        kind = "coordinates of the interface" if method == "craig-bampton" else "free motions"
        raise ResponseError(f"reduced: order = {order}; '{system.name}' has {family.least} {kind}, which every reduced "
                            f"model keeps. Ask for at least as many.")  # fmt: skip
    if order is not None:
        small = family.model(order)
        bound = error_bound(system, small)
    else:
        small, bound = _smallest(system, family, float(error or 0.0))
    before = system.provenance.truncation
    truncation = Truncation(method, system.dof, bound + (0.0 if before is None else before.error_bound))
    return replace(small, provenance=replace(small.provenance, truncation=truncation))


def _smallest(system: Equations, family: CraigBampton | ModalTruncation, error: float) -> tuple[Equations, float]:
    """The smallest model within an error, found by bisection."""
    low, high = family.least, family.most
    models = {}
    while low < high:
        middle = (low + high) // 2
        small = family.model(middle)
        models[middle] = small, error_bound(system, small)
        low, high = (low, middle) if models[middle][1] <= error else (middle + 1, high)
    if low not in models:
        small = family.model(low)
        models[low] = small, error_bound(system, small)
    if models[low][1] > error:
        raise ResponseError(f"reduced: error = {error:g}; all {low} coordinates of '{system.name}' leave "
                            f"{models[low][1]:.3g}. Give a larger error, or take method='balanced'.")  # fmt: skip
    return models[low]


def _check(name: str, order: int | None, error: float | None, most: int, kind: str) -> None:
    if (order is None) == (error is None):
        raise ResponseError(f"reduced: order = {order}, error = {error}; expected one of both: the number of {kind}, "
                            f"or the largest error of the frequency response.")  # fmt: skip
    if order is not None and (isinstance(order, bool) or not isinstance(order, (int, np.integer))
                              or not 0 <= order <= most):
        raise ResponseError(f"reduced: order = {order!r}; expected a whole number up to {most}, the {kind} of "
                            f"'{name}'.")  # fmt: skip
    if error is not None and not (isinstance(error, (int, float, np.floating)) and 0.0 < error < np.inf):
        raise ResponseError(f"reduced: error = {error!r}; expected a positive number, output by input in SI units.")
