"""Norms of frequency responses with their derivatives: H2, the rms under white noise, and Hinf, the highest peak.

With A P + P A^T + B B^T = 0 and A^T Q + Q A + C^T C = 0 the square of the H2 norm is tr(C P C^T) and moves by
2 tr(Q dA P) + 2 tr(Q dB B^T) + 2 tr(dC P C^T): two Lyapunov equations for all parameters. At the highest peak the
frequency does not count, and sigma moves by Re(u^H dG v).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_sylvester

from mbsvib.common.arrays import Array, Complex
from mbsvib.common.selection import needed_ports
from mbsvib.equations.equations import Equations
from mbsvib.errors import ResponseError
from mbsvib.linalg.lasting import Separation, separated
from mbsvib.linalg.lyapunov import Lyapunov
from mbsvib.responses.basis import Basis
from mbsvib.responses.energy_schur import last
from mbsvib.responses.first_order_solver import decaying_response
from mbsvib.responses.frequency_response import silent
from mbsvib.responses.norms import Norm, decaying_part, h2, hinf
from mbsvib.responses.realizations import accurate
from mbsvib.responses.state_space import StateSpace
from mbsvib.sensitivities.basis import SensitivityBasis
from mbsvib.sensitivities.responses import frequency_response_sensitivities, solutions
from mbsvib.sensitivities.states import changed, has_states, states
from mbsvib.sensitivities.variables import Requested, variables

Ports = str | Sequence[str] | None

BLOCK = 4_000_000
# Changes of what reaches or shows a group of poles below this share of their terms are rounding.
SHOWN = 1e-9
# Changes by a unit of a parameter below this share of what changes are rounding.
RESTS = 1e-12
# Where the largest response is static, its derivatives are taken at this share of the slowest pole: poles at 0 that no
# response contains cancel there to as many digits as are lost by it.
STATIC = 1e-4


def h2_norm(
    basis: SensitivityBasis, outputs: Ports = None, inputs: Ports = None, parameters: Requested = None
) -> Norm:
    """Return the H2 norm and its derivatives, see ``System.h2_norm``; 0 of a response that is 0, though a mode does not
    decay.

    ||G||^2 = 1 / 2 pi integral of tr(G(i w)^H G(i w)) dw over all frequencies

    ``parameters`` None: every parameter of the system, none where motions without mass are beside spin.
    """
    system = basis.equations
    ports = _ports(system, inputs, outputs)
    names = _names(system, parameters)
    if has_states(system) or parameters:
        base = states(basis.responses, *ports)
        d = base.D
    else:
        names, d = (), _space(basis.responses, ports).D
    _refuse_feedthrough(system, d, ports)
    if _silent(basis.responses, *ports):
        return Norm(0.0, names, np.zeros(len(names)))
    space = _space(basis.responses, ports)
    value = h2(replace(space, D=np.zeros_like(space.D))).value
    if not names:
        return Norm(value)

    def slopes() -> Array:
        result, k = np.zeros(len(names)), base.first
        parts = separated(base.A, base.B, base.C)
        p, q = gramians(parts)
        state, force, observed = (p @ q)[:, k:].T, (q @ base.B)[k:], base.C @ p
        for which, change in basis.matrix_derivatives_in_parts(parameters, _in_block(basis)):
            da, db, dc, dd = changed(base, change, *ports)
            total = (da * state).sum(axis=(1, 2)) + (db * force).sum(axis=(1, 2)) + (dc * observed).sum(axis=(1, 2))
            infinite = dd.any(axis=(1, 2)) | hidden_appear(parts, base.first, da, db, dc)
            result[which] = np.where(infinite, np.inf, total / value if value else total)
        return result

    return Norm(value, names, slopes if parameters is None else slopes())


def _silent(basis: Basis, inputs: list[int], outputs: list[int]) -> bool:
    """Whether the outputs show nothing of the inputs but rounding, beside modes that do not decay."""
    return bool(last(basis.poles).any() and silent(basis)[np.ix_(outputs, inputs)].all())


def _space(basis: Basis, ports: tuple[list[int], list[int]]) -> StateSpace:
    system, (i, o) = basis.equations, ports
    return accurate(basis).with_ports([system.outputs[k] for k in o], [system.inputs[k] for k in i])


def gramians(parts: Separation, weight: Array | None = None) -> tuple[Array, Array]:
    """Return Gramians P and Q in the states x; of groups of poles that no response contains only the parts with all
    others.

    ``weight`` W (inputs, inputs): A P + P A^T + B W B^T = 0; default: 1.
    """
    rest, hidden = parts.minimal, [group.part for group in parts.lasting if not group.shown.any()]
    driven = rest.b if weight is None else rest.b @ weight
    solver = Lyapunov(rest.a)
    p = rest.right @ solver.controlled(driven @ rest.b.T) @ rest.right.T
    q = rest.left.T @ solver.observed(rest.c.T @ rest.c) @ rest.left
    for group in hidden:
        cross = group.right @ solve_sylvester(group.a, rest.a.T, -group.b @ driven.T) @ rest.right.T
        dual = group.left.T @ solve_sylvester(group.a.T, rest.a, -group.c.T @ rest.c) @ rest.left
        p, q = p + cross + cross.T, q + dual + dual.T
    return p, q


def hidden_appear(parts: Separation, first: int, da: Array, db: Array, dc: Array) -> NDArray[np.bool_]:
    """Return whether each change, of rows of A and B from the ``first`` on and of C, shows poles that no response
    contains.
    """
    rest, result = parts.minimal, np.zeros(len(da), dtype=bool)
    for group in (group.part for group in parts.lasting if not group.shown.any()):
        a, b, c = (np.where(np.abs(x) > e, x, 0.0) for x, e in
                   zip((group.a, group.b, group.c), group.errors[1:], strict=True))  # fmt: skip
        for v in range(len(da)):
            turn = solve_sylvester(group.a, -rest.a, group.left[:, first:] @ da[v] @ rest.right)
            into = _sum_unless_rounding(group.left[:, first:] @ db[v], turn @ rest.b, rest.b)
            turn = solve_sylvester(rest.a, -group.a, -rest.left[:, first:] @ da[v] @ group.right)
            out = _sum_unless_rounding(dc[v] @ group.right, rest.c @ turn, rest.c)
            for _ in range(len(a)):
                result[v] |= any((left @ right).any() for left, right in ((c, into), (out, b), (out, into)))
                b, into = a @ b, a @ into
    return result


def _sum_unless_rounding(first: Array, second: Array, unchanged: Array) -> Array:
    """The sum, with zeros for terms that cancel, or that are rounding of what changes."""
    result, terms = first + second, float((np.abs(first) + np.abs(second)).max(initial=0.0))
    least = max(SHOWN * terms, RESTS * float(np.linalg.norm(unchanged)))
    return np.asarray(np.where(np.abs(result) > least, result, 0.0))


def hinf_norm(
    basis: SensitivityBasis, outputs: Ports = None, inputs: Ports = None, parameters: Requested = None
) -> Norm:
    """Return the highest peak of the largest singular value of the response, and its derivatives, see
    ``System.hinf_norm``.

    ||G|| = max over w of sigma(G(i w))

    The frequency is inf where the response only tends to its largest value. Where two singular values or peaks are
    equally high, derivatives are those of one of them. A response that is 0 has the norm 0, though a mode does not
    decay.
    """
    system = basis.equations
    i, o = _ports(system, inputs, outputs)
    names = _names(system, parameters)
    if _silent(basis.responses, i, o):
        return Norm(0.0, names, np.zeros(len(names)), 0.0)
    space = _space(basis.responses, (i, o))
    parts = decaying_part(space, f"Hinf norm of '{system.name}'", "its peak is infinite")
    named = [system.outputs[k] for k in o], [system.inputs[k] for k in i]
    values = parts.decaying.poles if parts.lasting else basis.responses.poles
    response = decaying_response(parts, space.D, system.name) if parts.lasting else (
        lambda w: _response(basis.responses, i, o, w).transpose(1, 2, 0))
    peak = hinf(response, values, space.D)
    value, omega = peak.value, float(peak.omega or 0.0)
    if omega == np.inf:
        return _at_infinity(basis, (i, o), names, parameters)
    at = omega or (STATIC * float(np.abs(values).min()) if parts.lasting else 0.0)
    if not names:
        return Norm(value, omega=omega)

    def slopes() -> Array:
        u, _, v = np.linalg.svd(_response(basis.responses, i, o, np.array([at]))[0])
        change = frequency_response_sensitivities(basis, [at], parameters, *named)[..., 0]
        return np.asarray(np.einsum("o,poi,i->p", u[:, 0].conj(), change, v[0].conj()).real)

    return Norm(value, names, slopes if parameters is None else slopes(), omega)


def _at_infinity(
    basis: SensitivityBasis, ports: tuple[list[int], list[int]], names: tuple[str, ...], parameters: Requested
) -> Norm:
    """The largest singular value of D, which the response tends to, and its derivatives Re(u^H dD v)."""
    base = states(basis.responses, *ports)
    u, sizes, v = np.linalg.svd(base.D)
    slopes = np.zeros(len(names))
    for which, change in basis.matrix_derivatives_in_parts(parameters, _in_block(basis)) if names else ():
        slopes[which] = changed(base, change, *ports)[3] @ v[0] @ u[:, 0]
    return Norm(float(sizes[0]), names, slopes, np.inf)


def _in_block(basis: SensitivityBasis) -> int:
    """How many parameters are taken together."""
    return max(1, BLOCK // max(1, basis.equations.dof**2))


def _names(system: Equations, parameters: Requested) -> tuple[str, ...]:
    """The variables; without a mechanism, or with a controller, there are none unless they are named."""
    if parameters is None and (system.provenance.from_matrices or system.provenance.closed_loop):
        return ()
    return tuple(variables(system.parameters, parameters).names)


def _response(basis: Basis, i: list[int], o: list[int], w: Array) -> Complex:
    """G (n, outputs, inputs) as good as its largest entry, which is all that the largest singular value asks for."""
    system = basis.equations
    motion, s = solutions(basis, system.B[:, i], w).transpose(2, 0, 1), 1j * w[:, None, None]
    return np.asarray((system.Cq[o] @ motion) + s * (system.Cv[o] @ motion + s * (system.Ca[o] @ motion))
                      + system.D[np.ix_(o, i)])  # fmt: skip


def _ports(system: Equations, inputs: Ports, outputs: Ports) -> tuple[list[int], list[int]]:
    o, i = needed_ports(outputs, inputs, (system.outputs, system.inputs), system.name)
    return i, o


def _refuse_feedthrough(system: Equations, d: Array, ports: tuple[list[int], list[int]]) -> None:
    size = np.abs(d)
    if d.size and size.max() > 0.0:
        o, i = np.unravel_index(int(np.argmax(size)), d.shape)
        raise ResponseError(
            f"H2 norm of '{system.name}': output '{system.outputs[ports[1][o]]}' sees input "
            f"'{system.inputs[ports[0][i]]}' at once, so that the norm is infinite. Ask for displacements or "
            f"velocities, or choose ports: inputs=[...], outputs=[...]."
        )
