"""Sensitivities of frequency responses and of time responses.

With R = T^-1 B and L = T^-T H^T, H = Cq + s Cv + s^2 Ca, the frequency response is G = H R + D, and
dG = dD + L^T dB + dH R - L^T dT R: products of what parameters change and of the fields of L and R. This is the
adjoint: all parameters for about one more solution a frequency.

With x' = A x + B u the derivative z = dx/dp follows z' = A z + dA x + dB u. Over a step both are the exponential of one
matrix and the derivative of this exponential, which Taylor's series and squaring give for all parameters at once: as
exact for held and linear inputs as the responses themselves.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, log2

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.common.arrays import Array, Complex, Index
from mbsvib.common.expected import angular
from mbsvib.common.selection import needed_ports
from mbsvib.equations.equations import Equations
from mbsvib.errors import ResponseError
from mbsvib.linalg.rank import EPS
from mbsvib.linalg.vectors import Field
from mbsvib.modes.damped import Damped
from mbsvib.responses import frequency_response as responses
from mbsvib.responses.basis import Basis
from mbsvib.responses.modal_sum import sum_of_motions
from mbsvib.responses.time_response import checked_question
from mbsvib.sensitivities.basis import SensitivityBasis
from mbsvib.sensitivities.matrix_derivatives import MatrixDerivatives
from mbsvib.sensitivities.parameter_groups import ParameterGroups
from mbsvib.sensitivities.ports import feedthrough, port_forms
from mbsvib.sensitivities.states import States, basis_rotation, changed, states
from mbsvib.sensitivities.variables import Requested, variables

Ports = str | Sequence[str] | None


def solutions(basis: Basis, b: Array, w: Array, *, adjoint: bool = False) -> Complex:
    """Return x = (K + i w C - w^2 M)^-1 b (m, columns, n).

    ``b`` (m, columns): right sides; ``w`` (n,): angular frequencies [rad/s], none negative; ``adjoint``: whether to
    solve with the transposed matrix. Raises an error if a frequency is an undamped pole.
    """
    system, modal = basis.equations, basis.modal
    if not isinstance(modal, Damped):
        result = _direct(system, b, w, adjoint)
    else:
        result = _modal(basis, modal, modal.shapes.T @ b, w)
    bad = np.flatnonzero(~np.isfinite(result).all(axis=(0, 1)))
    if len(bad):
        raise ResponseError(
            f"omega[{bad[0]}] = {w[bad[0]]:g} rad/s is a pole of '{system.name}', where responses and their "
            f"sensitivities are infinite; leave this frequency out, or give the mechanism damping."
        )
    return result


def _modal(basis: Basis, modal: Damped, b: Array, w: Array) -> Complex:
    s: Complex = (1j * w).astype(complex)
    if modal.vectors is None or (basis.strong_dampers is None and responses.trusted(modal, b, w)):
        eta = sum_of_motions(modal, b).at(s)
    else:
        eta = responses.solved_motions(basis, modal, b, w, np.arange(len(w)))
    with np.errstate(invalid="ignore"):  # infinite at poles, which the caller refuses
        flat = (modal.shapes @ eta.reshape(len(b), b.shape[1] * len(w)).view(float)).view(complex)
    return np.asarray(flat.reshape(len(modal.shapes), *eta.shape[1:]))


def _direct(system: Equations, b: Array, w: Array, adjoint: bool) -> Complex:
    result = np.empty((len(b), b.shape[1], len(w)), dtype=complex)
    for i, frequency in enumerate(w):
        matrix = system.K - frequency**2 * system.M + 1j * frequency * system.C
        try:
            result[:, :, i] = np.linalg.solve(matrix.T if adjoint else matrix, b)
        except np.linalg.LinAlgError:
            result[:, :, i] = np.nan
    return result


# Numbers that the fields of one block of frequencies may hold.
BLOCK = 2_000_000
# Numbers that a force at the pose takes for a pair of motions.
PAIRED = 48


def frequency_response_sensitivities(
    basis: SensitivityBasis, omega: ArrayLike, parameters: Requested = None, outputs: Ports = None, inputs: Ports = None
) -> Complex:
    """Return the derivatives (parameters, outputs, inputs, n), see ``System.frequency_response_sensitivities``.

    dG/dp = dD/dp + L^T dB/dp + dH/dp R - L^T (dK/dp + i w dC/dp - w^2 dM/dp) R
    """
    system = basis.equations
    w = angular(omega)
    o, i = needed_ports(outputs, inputs, (system.outputs, system.inputs), system.name)
    network, actuation, sensing = basis.ported(i, o)
    groups = basis.groups(parameters, network)
    turns = feedthrough(system, (i, actuation), (o, sensing))[1]
    result = np.empty((len(groups.variables.names), len(o), len(i), len(w)), dtype=complex)
    numbers = (len(network.point) + 1) * 12 * (len(i) + len(o))
    if groups.loaded is not None:  # forces see each pair of an input and an output
        numbers += len(groups.loaded.forces.first) * PAIRED * len(i) * len(o)
    block = max(1, BLOCK // max(1, numbers))
    for start in range(0, len(w), block):
        part = slice(start, start + block)
        size = np.abs(w[part])
        s: Complex = (1j * size).astype(complex)
        powers = np.ones(len(s), dtype=complex), s, s * s
        vectors = fields(basis.responses, i, o, size)
        forms = port_forms(groups, (actuation, sensing), powers, vectors, turns)
        if groups.matrix_group is not None:
            groups.matrix_group.with_ports(forms, (i, o), powers, vectors, sensing.excluded)
        solution = groups.chain(forms)
        for k in sensing.excluded:
            solution[:, k] += _excluded_outputs(groups, o[k], i, vectors[0][:, 0], powers)
        result[..., part] = solution
    result[..., w < 0.0] = result[..., w < 0.0].conj()
    return result


def fields(basis: Basis, i: list[int], o: list[int], w: Array) -> tuple[Complex, Complex]:
    """Return R (m, 1, inputs, n) and L (m, outputs, 1, n) at angular frequencies (n,), none negative."""
    system = basis.equations
    rates = np.array([c[o] for c in (system.Cq, system.Cv, system.Ca)])
    order, output = np.nonzero(rates.any(axis=2))
    right, rows = system.B[:, i], rates[order, output].T
    if system.gyroscopic is None and system.circulatory is None:
        both = solutions(basis, np.concatenate((right, rows), axis=1), w)
        solution, back = both[:, : len(i)], both[:, len(i) :]
    else:
        solution, back = solutions(basis, right, w), solutions(basis, rows, w, adjoint=True)
    left = np.zeros((system.dof, len(o), len(w)), dtype=complex)
    for k, (power, row) in enumerate(zip(order.tolist(), output.tolist(), strict=True)):
        left[:, row] += (1j * w) ** power * back[:, k]
    return solution[:, None], left[:, :, None]


def _excluded_outputs(
    groups: ParameterGroups, output: int, inputs: list[int], right: Field, powers: tuple[Field, Field, Field]
) -> Field:
    """dD + (dCq + s dCv + s^2 dCa) R (variables, inputs, n) of an output that is no motion, R (m, inputs, n)."""
    result = groups.variable_slopes["D"][:, output][:, inputs, None].astype(complex)
    for key, power in zip(("Cq", "Cv", "Ca"), powers, strict=True):
        result = result + power * np.tensordot(groups.variable_slopes[key][:, output], right, axes=1)
    return result


# Taylor's series of the exponential and of its derivative are exact to rounding for matrices of this norm.
SMALL, TERMS = 0.5, 16
# Numbers that what is kept of some parameters may hold.
KEPT = 4_000_000


def time_response_sensitivities(
    basis: SensitivityBasis, t: ArrayLike, u: ArrayLike, parameters: Requested = None, hold: str = "first",
    initial: tuple[ArrayLike, ArrayLike] | None = None,
) -> Array:  # fmt: skip
    """Return the derivatives (parameters, outputs, n) at the times ``t``, see ``System.time_response_sensitivities``.

    z(t + h) = exp(A h) z(t) + d exp(A h) x(t) + d (integral over the step of exp(A (h - s)) B u(t + s) ds)
    """
    system = basis.equations
    time, force, start = checked_question(system, t, u, hold, initial)
    ports = list(range(len(system.inputs))), list(range(len(system.outputs)))
    names = variables(system.parameters, parameters).names
    result = np.zeros((len(names), len(ports[1]), len(time)))
    base = states(basis.responses, *ports)
    steps, kind = _steps(time)
    begin = _begin(base, system, start)
    size = len(begin) + 2 * len(force)
    count = max(1, KEPT // max(size * size * len(steps), len(begin) * len(time), 1))
    for which, change in basis.matrix_derivatives_in_parts(parameters, count):
        da, db, dc, dd = changed(base, change, *ports)
        matrices = [exponential(base, h, da, db) for h in steps]
        x, z = _march(matrices, kind, force, (begin, _begun(base, system, change, start)), hold == "first")
        result[which] = base.C @ z + dc @ x + dd @ force
    return result


def _begin(base: States, system: Equations, start: Array) -> Array:
    """The states of q and q' (2, m)."""
    basis, k = base.basis, base.first
    eta, rate = (basis.vectors[:, :k].T @ (system.M @ state) for state in start)
    return np.concatenate((base.scale * eta, rate, basis.vectors[:, k:].T @ (system.C @ start[0])))


def _begun(base: States, system: Equations, change: MatrixDerivatives, start: Array) -> Array:
    """How these states change (v, 2m) as the basis does; q and q' stay."""
    if not start.any():
        return np.zeros((len(change.M), len(base.A)))
    basis, k = base.basis, base.first
    theta, massive_vectors = basis_rotation(basis, change), basis.vectors[:, :k]
    within = np.concatenate((massive_vectors.T @ (system.M @ start[0]), basis.vectors[:, k:].T @ (system.C @ start[0])))
    displacement = -(theta @ within)
    mass = massive_vectors.T @ change.M @ start[1]
    rate = mass + (theta[:, :, :k].swapaxes(1, 2) @ (basis.vectors.T @ (system.M @ start[1])))
    return np.concatenate((base.scale * displacement[:, :k], rate, displacement[:, k:]), axis=1)


def _steps(time: Array) -> tuple[Array, Index]:
    """Different steps, and which of them each is; stamps that differ from even ones by their rounding are even."""
    step = np.diff(time)
    order = np.argsort(step, kind="stable")
    distinct = np.diff(step[order], prepend=-np.inf) > 8.0 * EPS * np.abs(time).max(initial=0.0)
    group = np.empty(len(step), dtype=np.intp)
    group[order] = np.cumsum(distinct) - 1
    number = int(distinct.sum())
    return np.bincount(group, step, number) / np.maximum(np.bincount(group, minlength=number), 1), group


def exponential(base: States, h: float, da: Array, db: Array) -> tuple[Array, Array]:
    """Return exp of [[A, B, 0], [0, 0, 1 / h], [0, 0, 0]] h, first rows, and its derivatives (v, 2m, 2m + 2 inputs)."""
    n, i = base.B.shape
    matrix, change = np.zeros((n + 2 * i, n + 2 * i)), np.zeros((len(da), n + 2 * i, n + 2 * i))
    matrix[:n, :n], matrix[:n, n : n + i], matrix[n : n + i, n + i :] = h * base.A, h * base.B, np.eye(i)
    # inputs of any unit, as large as what they drive
    unit = np.abs(matrix[:n, n : n + i]).max(axis=0, initial=0.0)
    unit[unit == 0.0] = 1.0
    matrix[:n, n : n + i] /= unit
    change[:, base.first : n, :n], change[:, base.first : n, n : n + i] = h * da, h * db / unit
    halvings = max(0, ceil(log2(max(np.abs(matrix).sum(axis=0).max(initial=0.0) / SMALL, 1.0))))
    matrix, change = matrix * 0.5**halvings, change * 0.5**halvings
    power, slope = np.eye(len(matrix)), np.zeros_like(change)
    exponential, derivative = power.copy(), slope.copy()
    for k in range(1, TERMS):
        slope = (matrix @ slope + change @ power) / k
        power = matrix @ power / k
        exponential += power
        derivative += slope
    for _ in range(halvings):
        derivative = exponential @ derivative + derivative @ exponential
        exponential = exponential @ exponential
    back = np.concatenate((np.ones(n), unit, unit))
    return exponential[:n] * back, derivative[:, :n] * back


def _march(
    matrices: list[tuple[Array, Array]], kind: Index, u: Array, start: tuple[Array, Array], first: bool
) -> tuple[Array, Array]:
    """States (2m, n) and their derivatives (v, 2m, n)."""
    begin, begun = start
    n, i = len(begin), len(u)
    x = np.empty((n, u.shape[1]))
    x[:, 0] = begin
    constant, rise = u[:, :-1], np.diff(u) if first else np.zeros((i, u.shape[1] - 1))
    for k, step in enumerate(kind):
        exponential = matrices[step][0]
        at_once, by_input, by_rise = exponential[:, :n], exponential[:, n : n + i], exponential[:, n + i :]
        x[:, k + 1] = at_once @ x[:, k] + by_input @ constant[:, k] + by_rise @ rise[:, k]
    drive = np.concatenate((x[:, :-1], constant, rise))
    z = np.empty((len(begun), n, u.shape[1]))
    z[:, :, 0] = begun
    inputs = np.empty((*z.shape[:2], len(kind)))
    for step, (_, derivative) in enumerate(matrices):
        inputs[:, :, kind == step] = derivative @ drive[:, kind == step]
    state = z[:, :, 0]
    for k, step in enumerate(kind):
        state = state @ matrices[step][0][:, :n].T + inputs[:, :, k]
        z[:, :, k + 1] = state
    return x, z
