"""Norms of frequency responses with their derivatives: H2, the rms under white noise, and Hinf, the highest peak.

With A P + P A^T + B B^T = 0 and A^T Q + Q A + C^T C = 0 the square of the H2 norm is tr(C P C^T) and moves by
2 tr(Q dA P) + 2 tr(Q dB B^T) + 2 tr(dC P C^T): two Lyapunov equations for all parameters. At the highest peak the
frequency does not count, and sigma moves by Re(u^H dG v).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import solve_continuous_lyapunov

from mbsvib.common.selection import needed_ports
from mbsvib.equations.controllable_part import reachable
from mbsvib.errors import ResponseError
from mbsvib.linalg.rank import EPS
from mbsvib.responses.extrema import Band, panels
from mbsvib.responses.norms import Norm, h2
from mbsvib.responses.realizations import state_space
from mbsvib.sensitivities.basis import SensitivityBasis
from mbsvib.sensitivities.responses import frequency_response_sensitivities, solutions
from mbsvib.sensitivities.states import changed, states
from mbsvib.sensitivities.variables import variables

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array, Complex
    from mbsvib.equations.equations import Equations
    from mbsvib.responses.basis import Basis
    from mbsvib.responses.state_space import StateSpace
    from mbsvib.sensitivities.variables import Requested

    Ports = str | Sequence[str] | None

BLOCK = 4_000_000
# The response has its peaks below this times the fastest eigenvalue, and is that at infinity from there; heights that
# differ by less are the same.
LAST, FAR, ROUNDING = 1e3, 1e6, 1e-9
# Points at which a response is looked at for being 0, times a pole's size: right of the imaginary axis, on no pole.
ASIDE = np.array([0.83 + 0.41j, 1.07 + 0.29j, 0.91 + 0.57j])
# A response below this share of what it were if nothing cancelled is 0.
NOTHING = 1e-12


def h2_norm(
    basis: SensitivityBasis, outputs: Ports = None, inputs: Ports = None, parameters: Requested = None
) -> Norm:
    """Return the H2 norm and its derivatives.

    ||G||^2 = 1 / 2 pi integral of tr(G(i w)^H G(i w)) dw over all frequencies

    Parameters
    ----------
    basis : SensitivityBasis
        The equations of motion, their modes and their network.
    outputs, inputs : str or sequence of str, optional
        Names of ports; default: all.
    parameters : str, iterable of str, mapping or None
        Names, patterns or linear maps of parameters; None: every parameter of the system.

    Returns
    -------
    Norm
        Value and derivatives.

    Raises
    ------
    ModelError
        If a parameter is unknown, or the system does not change smoothly with it.
    ResponseError
        If the norm is infinite: an output sees an input at once, or a mode of what these ports act on or see does not
        decay. A response that is 0 has the norm 0 all the same.
    """
    system = basis.equations
    ports = _ports(system, inputs, outputs)
    base = states(basis.responses, *ports)
    names = _names(system, parameters)
    _refuse_feedthrough(system, base.D, ports)
    k = base.first
    undamped = _undamped(basis.responses)
    if undamped is not None:
        if _silent(basis.responses, *ports):
            return Norm(0.0, names, np.zeros(len(names)))
        part = _separate_part(system, *ports)
        if part is not None:
            return h2_norm(part, parameters=parameters)
        raise ResponseError(
            f"H2 norm of '{system.name}': mode {undamped} does not decay, so that the norm is infinite. Give it "
            f"damping, or leave it out: system.reachable(outputs, inputs) drops what these ports do not reach or see."
        )
    p = solve_continuous_lyapunov(base.A, -base.B @ base.B.T)
    q = solve_continuous_lyapunov(base.A.T, -base.C.T @ base.C)
    value = _rms(basis.responses, ports)
    if value is None:
        value = float(np.sqrt(max(0.0, np.sum(base.C @ p * base.C))))
    if not names:
        return Norm(value)
    slopes = np.zeros(len(names))
    state, force, observed = (p @ q)[:, k:].T, (q @ base.B)[k:], base.C @ p
    for which, change in basis.matrix_derivatives_in_parts(parameters, _in_block(basis)):
        da, db, dc, dd = changed(base, change, *ports)
        total = (da * state).sum(axis=(1, 2)) + (db * force).sum(axis=(1, 2)) + (dc * observed).sum(axis=(1, 2))
        size = np.abs(dd).max(axis=(1, 2), initial=0.0)
        slopes[which] = np.where(size > 0.0, np.inf, total / value if value else total)
    return Norm(value, names, slopes)


def _rms(basis: Basis, ports: tuple[list[int], list[int]]) -> float | None:
    """The H2 norm by modal states, which slow modes beside fast ones lose no digits in; None if they are dependent."""
    system, (i, o) = basis.equations, ports
    try:
        space: StateSpace = state_space(basis, "modal")
        return h2((space.A, space.B[:, i], space.C[o], np.zeros((len(o), len(i)))), ((), ()), system.name).value
    except ResponseError:
        return None


def hinf_norm(
    basis: SensitivityBasis, outputs: Ports = None, inputs: Ports = None, parameters: Requested = None
) -> Norm:
    """Return the highest peak of the largest singular value of the frequency response, and its derivatives.

    ||G|| = max over w of sigma(G(i w))

    Parameters
    ----------
    basis : SensitivityBasis
        The equations of motion, their modes and their network.
    outputs, inputs : str or sequence of str, optional
        Names of ports; default: all.
    parameters : str, iterable of str, mapping or None
        Names, patterns or linear maps of parameters; None: every parameter of the system.

    Returns
    -------
    Norm
        Value, frequency (inf where the response only tends to its largest value) and derivatives; where two singular
        values or peaks are equally high, those of one of them.

    Raises
    ------
    ModelError
        If a parameter is unknown, or the system does not change smoothly with it.
    ResponseError
        If the response is infinite: a mode of what these ports act on or see does not
        decay. A response that is 0 has the norm 0 all the same.
    """
    system = basis.equations
    i, o = _ports(system, inputs, outputs)
    names, undamped = _names(system, parameters), _undamped(basis.responses)
    if undamped is not None:
        if _silent(basis.responses, i, o):
            return Norm(0.0, names, np.zeros(len(names)), 0.0)
        part = _separate_part(system, i, o)
        if part is not None:
            return hinf_norm(part, parameters=parameters)
        raise ResponseError(f"Hinf norm of '{system.name}': mode {undamped} does not decay, so that its peak is "
                            f"infinite. Give it damping, or ask system.reachable(outputs, inputs) for its norm."
                            )  # fmt: skip
    named = [system.outputs[k] for k in o], [system.inputs[k] for k in i]
    values = basis.responses.poles
    fastest = float(np.abs(values).max(initial=0.0)) or 1.0
    band = Band(lambda w: _response(basis.responses, i, o, w), panels(values, 0.0, LAST * fastest))
    omega, value = band.highest(_largest)
    far = float(_largest(band.response(np.array([FAR * fastest])))[0])
    if far > value * (1.0 + ROUNDING):
        return _at_infinity(basis, (i, o), names, parameters)
    if not names:
        return Norm(value, omega=omega)
    u, _, v = np.linalg.svd(_response(basis.responses, i, o, np.array([omega]))[0])
    change = frequency_response_sensitivities(basis, [omega], parameters, *named)[..., 0]
    slopes = np.einsum("o,poi,i->p", u[:, 0].conj(), change, v[0].conj()).real
    return Norm(value, names, slopes, omega)


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


def _largest(g: Complex) -> Array:
    return np.asarray(np.linalg.svd(g, compute_uv=False)[:, 0])


def _ports(system: Equations, inputs: Ports, outputs: Ports) -> tuple[list[int], list[int]]:
    o, i = needed_ports(outputs, inputs, (system.outputs, system.inputs), system.name)
    return i, o


def _undamped(basis: Basis) -> int | None:
    """The number, from 1, of the first mode that does not decay by more than rounding of its frequency."""
    pairs = basis.response_modes.pairs
    modes = np.flatnonzero((pairs.real >= -EPS * np.abs(pairs)).any(axis=1))
    return int(modes[0]) + 1 if len(modes) else None


def _separate_part(system: Equations, inputs: list[int], outputs: list[int]) -> SensitivityBasis | None:
    """The part that the ports have to do with, if all its modes decay; None if it is all, or they reach or see more."""
    part = reachable(system, [system.outputs[k] for k in outputs], [system.inputs[k] for k in inputs])
    removed = ~np.isin(system.coordinates, part.coordinates)
    rows = np.concatenate([c[outputs] for c in (system.Cq, system.Cv, system.Ca)])
    more = system.B[removed][:, inputs].any() or rows[:, removed].any()
    basis = SensitivityBasis.of(part)
    return None if more or not removed.any() or _undamped(basis.responses) is not None else basis


def _silent(basis: Basis, inputs: list[int], outputs: list[int]) -> bool:
    """Whether the outputs see nothing of the inputs but rounding, at points between the slowest and fastest pole."""
    system, speeds = basis.equations, np.abs(basis.poles)
    slow, fast = speeds[speeds > 0.0].min(initial=np.inf), speeds.max(initial=0.0)
    b, d = system.B[:, inputs], system.D[np.ix_(outputs, inputs)]
    for s in ASIDE * (np.geomspace(slow, fast, len(ASIDE)) if fast else np.ones(len(ASIDE))):
        square = system.K + s * (system.C + s * system.M)
        unit = 1.0 / np.sqrt(np.abs(square.diagonal()))
        motion = np.linalg.solve(unit[:, None] * square * unit, unit[:, None] * b)
        rows = (system.Cq[outputs] + s * (system.Cv[outputs] + s * system.Ca[outputs])) * unit
        terms = np.abs(rows).sum(axis=1)[:, None] * np.abs(motion).max(axis=0, initial=0.0) + np.abs(d)
        if (np.abs(rows @ motion + d) > NOTHING * terms).any():
            return False
    return True


def _refuse_feedthrough(system: Equations, d: Array, ports: tuple[list[int], list[int]]) -> None:
    size = np.abs(d)
    if d.size and size.max() > 0.0:
        o, i = np.unravel_index(int(np.argmax(size)), d.shape)
        raise ResponseError(
            f"H2 norm of '{system.name}': output '{system.outputs[ports[1][o]]}' sees input "
            f"'{system.inputs[ports[0][i]]}' at once, so that the norm is infinite. Ask for displacements or "
            f"velocities, or choose ports: inputs=[...], outputs=[...]."
        )
