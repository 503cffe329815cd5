"""Gradients of mean squares to the entries of first-order equations, and to the parameters behind these.

With A P + P A^T + B W B^T = 0 and A^T Q + Q A + C^T C = 0 the mean square c P c^T has the gradients 2 Q P to A,
2 Q B W to B and 2 C P to C: two Lyapunov equations for all parameters. Where the mean square is an integral, that of
T S T^H has the gradient 2 Re([C R 1]^T (S T^H)^T [R B; 1]^T), R = (s - A)^-1, at each frequency. Those of sampled loops
come from the parts of a period, ``feedback.sampled_slopes``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.errors import ModelError, ResponseError
from mbsvib.feedback.closing import Closure, Gathered
from mbsvib.linalg.balancing import exponents, scaled_by
from mbsvib.linalg.lasting import separated
from mbsvib.linalg.lyapunov import Lyapunov
from mbsvib.random.mean_squares import Random
from mbsvib.random.moments import Equations, Filtered
from mbsvib.responses.first_order_solver import first_order_solver
from mbsvib.sensitivities.matrix_derivatives import MatrixDerivatives
from mbsvib.sensitivities.norms import gramians, hidden_appear
from mbsvib.sensitivities.states import States, changed, states

Requested = str | Sequence[str] | Mapping[str, Mapping[str, float]] | None

BLOCK = 4_000_000  # numbers of the derivatives of some parameters


class Scene:
    """A system, or a loop around one, as equations of the plant whose entries have derivatives to its parameters."""

    def __init__(self, linear: Any) -> None:
        self.loop = linear if linear.kind == "closed loop" else None
        self.system = linear if self.loop is None else self.loop.plant.source
        outputs, inputs = self.system.outputs, self.system.inputs
        everything = Gathered(list(range(len(outputs))), list(range(len(inputs))))
        self.gathered: Gathered = everything if self.loop is None else self.loop.plant.gathered or everything
        self.base: States | None = None
        if self.system.kind == "system":
            self.base = states(self.system.basis, list(range(len(inputs))), list(range(len(outputs))))
        space = self.base or self.system.state_space()
        self.space = space.A, space.B, space.C, space.D
        self.plant = self.gathered.of(self.space)

    @cached_property
    def closure(self) -> Closure | None:
        """The continuous loop around the plant, if there is one."""
        if self.loop is None:
            return None
        law, (y, u), (o, i) = self.loop.law, self.loop.ports, self.loop.selected_ports
        return Closure(self.plant, (law.A, law.B, law.C, law.D), y, u, o, i)

    @cached_property
    def equations(self) -> Equations:
        """The equations of the system, or those of the continuous loop."""
        return Equations(*(self.plant if self.closure is None else self.closure.closed))

    def gradients(self, under: Any, row: int) -> tuple[Array, Array]:
        """Return the gradients of the mean square of one output to [A B; C D] of the system, and of the controller if
        there is one.
        """
        if self.loop is not None and self.loop.period is not None:
            known = self.loop.plant.space
            space = known.from_arrays(*self.plant, known.inputs, known.outputs)
            loop = replace(self.loop, plant=replace(self.loop.plant, system=space))
            plant, law = replace(under, linear=loop).square_gradient(row)
        else:
            plant = law = gradient(under, self.equations, row)
            if self.closure is not None:
                plant, law = self.closure.to_plant(plant), self.closure.to_law(law)
        return self.gathered.back(plant, self.space), law

    def along(self, change: MatrixDerivatives | None, law: Array | None = None) -> Array:
        """Return the derivatives of [A B; C D] of the equations to variables, (v, states + outputs, states + inputs).

        ``change``: those of the matrices of the system. ``law`` (v, ...): those of [A B; C D] of the controller.
        """
        plant = None
        if change is not None and self.base is not None:
            da, db, dc, dd = changed(self.base, change, list(range(len(self.system.inputs))),
                                     list(range(len(self.system.outputs))))  # fmt: skip
            n, first, rows = len(self.plant[0]), self.base.first, self.gathered.rows
            columns = np.array(self.gathered.columns, dtype=np.intp)
            known = np.flatnonzero(columns >= 0)
            plant = np.zeros((len(da), n + len(rows), n + len(columns)))
            plant[:, first:n, :n], plant[:, n:, :n] = da, dc[:, rows]
            plant[:, first:n, n + known] = db[:, :, columns[known]]
            plant[:, n:, n + known] = dd[:, rows][:, :, columns[known]]
        return np.asarray(plant if self.closure is None else self.closure.along(plant, law))


def sensitivities(under: Random, parameters: Requested) -> dict[str, dict[str, float]]:
    """Return the derivatives of root mean squares {output: {parameter: value}}.

    ``parameters``: as of the sensitivities of systems; None: all. An infinite root mean square, or one of 0, has none:
    not a number.
    """
    scene = Scene(under.linear)
    if scene.base is None:
        if hasattr(scene.system, "ends"):
            raise ModelError(f"sensitivities: '{under.linear.name}' has motions as inputs, and derivatives of mean "
                             f"squares are those of systems with forces; compare variants by model.with_values.")
        raise ModelError(f"sensitivities: '{under.linear.name}' has matrices and no parameters; derivatives are those "
                         f"of a system of a mechanism, model.linearize().")  # fmt: skip
    result: dict[str, dict[str, float]] = {}
    squares = under.mean_squares().total
    basis, first = scene.system.sensitivity_basis, scene.base.first
    ports = list(range(len(scene.system.inputs))), list(range(len(scene.system.outputs)))
    finite = np.flatnonzero((squares > 0.0) & (squares < np.inf)).tolist()
    if parameters is None and not finite:
        return {name: dict.fromkeys(scene.system.parameters, np.nan) for name in under.outputs}
    gradients = {row: scene.gradients(under, row)[0] for row in finite}
    n = len(scene.base.A)
    parts = {}  # of open loops: groups of poles that no response contains, which changes may bring into them
    if scene.loop is None and under.band is None:
        a, b, c, _ = scene.equations
        parts = {row: separated(a, b, c[[row]]) for row in gradients}
    count = max(1, BLOCK // max(1, scene.system.dof**2))
    for name in under.outputs:
        result[name] = {}
    for _, change in basis.matrix_derivatives_in_parts(parameters, count):
        da, db, dc, dd = changed(scene.base, change, *ports)
        for row, name in enumerate(under.outputs):
            if row not in gradients:
                result[name] |= dict.fromkeys(change.variables, np.nan)
                continue
            to = gradients[row]
            pairs = (da, to[first:n, :n]), (db, to[first:n, n:]), (dc, to[n:, :n]), (dd, to[n:, n:])
            slope = np.asarray(sum(np.einsum("vij,ij->v", d, g) for d, g in pairs)) * 0.5 / np.sqrt(squares[row])
            if row in parts and len(parts[row].shown) < len(parts[row].lasting):
                slope = np.where(hidden_appear(parts[row], first, da, db, dc[:, [row]]), np.inf, slope)
            result[name] |= dict(zip(change.variables, slope.tolist(), strict=True))
    return result


def law_sensitivities(under: Random) -> dict[str, dict[str, Array]]:
    """Return the derivatives of root mean squares to the entries of the controller, {output: {"A": (k, k), ...}}."""
    scene = Scene(under.linear)
    if scene.loop is None:
        raise ResponseError(f"controller_sensitivities: '{under.linear.name}' has no controller; ask a closed loop.")
    squares, result, law = under.mean_squares().total, {}, scene.loop.law
    k = len(law.A)
    for row, name in enumerate(under.outputs):
        value = np.full((k + len(law.outputs), k + len(law.inputs)), np.nan)
        if 0.0 < squares[row] < np.inf:
            value = scene.gradients(under, row)[1] * (0.5 / np.sqrt(squares[row]))
        result[name] = {"A": value[:k, :k], "B": value[:k, k:], "C": value[k:, :k], "D": value[k:, k:]}
    return result


def gradient(of: Random, equations: Equations, row: int) -> Array:
    """Return the gradient of the mean square of one output to the entries of the equations, (states + outputs, states +
    sources).
    """
    a, b, c, d = equations
    one = Equations(a, b, c[[row]], d[[row]])
    under = replace(of, weights=(of.weights[row],))
    if under.weights[0] is not None and under.weights[0].window is not None:
        raise ResponseError("sensitivities: those of averages over a time are not available; choose another weighting.")
    names = range(len(under.sources.names))
    rational = under.rational
    result = np.zeros((len(a) + len(c), len(a) + b.shape[1]))
    rows = [*range(len(a)), len(a) + row]
    if rational:
        columns = [*range(len(a)), *[len(a) + k for k in rational]]
        result[np.ix_(rows, columns)] += mean_square_gradient(under, one, rational)
    others = [k for k in names if k not in rational]
    if others:
        columns = [*range(len(a)), *[len(a) + k for k in others]]
        result[np.ix_(rows, columns)] += _by_quadrature(under, one, others)
    return result


def mean_square_gradient(under: Random, one: Equations, which: list[int]) -> Array:
    """Return the gradient of the mean square of an output due to some sources of rational spectra, (states + 1, states
    + sources), to the entries of its equations.
    """
    whole = under.behind_filters(which, one)
    a, b, c, _ = whole.all
    weight = _weight(under, which)
    unit, scaled = _scaled(a, b, c)
    parts = separated(*scaled)
    if parts.lasting:
        p, q = gramians(parts, weight)
    else:
        a, b, c = scaled
        solver = Lyapunov(a)
        p, q = solver.controlled(b @ weight @ b.T), solver.observed(c.T @ c)
    return _before_filters(whole, p * unit, q / unit, weight)


def stable_squares(under: Random, equations: Equations) -> tuple[float, Callable[[], Array]]:
    """Return the sum of all mean squares of equations whose poles decay, and a function that returns its gradient to
    their entries.

    Moments of all sources, without the separation of what does not decay: for searches, which know that all does. A sum
    of which rounding leaves no digit is infinite where it is negative.
    """
    whole = under.behind_filters(under.rational, equations)
    a, b, c, d = whole.all
    if d.any():
        return np.inf, lambda: np.zeros((len(equations.a) + len(c), len(equations.a) + b.shape[1]))
    weight = _weight(under, under.rational)
    unit, (a, b, c) = _scaled(a, b, c)
    solver = Lyapunov(a)
    p = solver.controlled(b @ weight @ b.T)
    square = float((c @ p * c).sum())

    def slope() -> Array:
        return _before_filters(whole, p * unit, solver.observed(c.T @ c) / unit, weight)

    return square if square >= 0.0 else np.inf, slope


def _scaled(a: Array, b: Array, c: Array) -> tuple[Array, tuple[Array, Array, Array]]:
    """Return the equations in states of like size, and the units (n, n) that their Gramian P has there; 1 / unit: Q."""
    power = exponents(a, b, c)
    return np.ldexp(1.0, power[:, None] + power), scaled_by(power, a, b, c)


def _weight(under: Random, which: list[int]) -> Array:
    """The correlation of white noises of some sources."""
    return np.eye(len(which)) if under.cross is None else np.eye(len(which)) + under.cross


def _before_filters(whole: Filtered, p: Array, q: Array, weight: Array) -> Array:
    """The gradient by Gramians to the entries of the plant among filters, (states + outputs, states + sources)."""
    _, b, c, d = whole.all
    to_a, to_b, to_c = 2.0 * q @ p, 2.0 * q @ b @ weight, 2.0 * c @ p
    return whole.to_plant(np.block([[to_a, to_b], [to_c, np.zeros_like(d)]]))


def _by_quadrature(under: Random, one: Equations, which: list[int]) -> Array:
    a, b, c, d = one
    f, weight = under.rule().nodes()
    s, w = np.asarray(2j * np.pi * f, dtype=complex), 2.0 * np.pi * f
    inputs, n = b[:, which], len(a)
    right, left = first_order_solver(a, inputs, c, under.linear.name), first_order_solver(
        a.T, c.T, inputs.T, under.linear.name)  # fmt: skip
    density = np.sqrt(under.sources.of(f)[which])
    cross, gain = under.sources.across(f), under.weights[0]
    factor = 2.0 * weight * (1.0 if gain is None else np.abs(gain.at(f)) ** 2)
    result = np.zeros((n + 1, n + len(which)))
    for (part, x), (_, y) in zip(right.states(s, w, inputs), left.states(s, w, c.T), strict=True):
        x, y = np.ldexp(1.0, right.power)[:, None, None] * x, np.ldexp(1.0, left.power)[:, None] * y[:, 0]
        t = np.tensordot(c, x, axes=1)[0] + d[0, which][:, None]  # (sources, n)
        root = density[:, part]
        seen = root * t.conj()
        if cross is not None:
            block = cross[part if len(cross) > 1 else slice(None)][:, which][:, :, which]
            seen = seen + np.einsum("nij,jn->in", np.broadcast_to(block, (t.shape[1], *block.shape[1:])), seen)
        v = root * seen  # S T^H
        drive = np.concatenate((np.einsum("xkn,kn->xn", x, v), v))
        result += ((np.concatenate((y, np.ones((1, y.shape[1])))) * factor[part]) @ drive.T).real
    return result
