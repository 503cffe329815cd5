"""Derivatives of what systems with motions as inputs answer, to parameters of the mechanism.

With x' = A x + B u, y = C x + D u by the displacements, velocities and accelerations of ends and joints, z = dx/dp
follows z' = A z + dA x + dB u, dy = C z + dC x + dD u. These are equations with the same inputs, of which
``responses.driven`` makes those with the motions as inputs.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.api.state_space import StateSpace
from mbsvib.common.arrays import Array, Complex
from mbsvib.common.selection import Names
from mbsvib.errors import ResponseError
from mbsvib.responses.driven import driven_response, driven_space
from mbsvib.responses.linear import peak as peak_of
from mbsvib.responses.norms import Norm, h2
from mbsvib.sensitivities.responses import frequency_response_sensitivities as slopes_of_ends
from mbsvib.sensitivities.states import States, changed, states
from mbsvib.sensitivities.variables import Requested, variables

# A peak at rest is looked at by this share of the slowest pole, where inputs are integrated.
STATIC = 1e-4
# What derivatives of responses have at once, as a share of |C| |B|, is rounding below this.
DIRECT = 1e-9


def frequency_response_sensitivities(
    system: Any, omega: ArrayLike, parameters: Requested = None, outputs: Names = None, inputs: Names = None
) -> Complex:
    """Return derivatives (parameters, outputs, inputs, n), as ``System.frequency_response_sensitivities`` does."""
    part = system.with_ports(outputs, inputs)
    columns = [column for drive in part.drives for column in drive.columns]
    slopes = slopes_of_ends(system.ends.sensitivity_basis, omega, parameters, list(part.outputs), columns)
    result: Complex = driven_response(slopes, columns, part.drives, omega)
    return result


def time_response_sensitivities(
    system: Any, t: ArrayLike, u: ArrayLike, parameters: Requested = None, hold: str = "first", initial: Any = None
) -> Array:
    """Return derivatives (parameters, outputs, n), as ``System.time_response_sensitivities`` does, from rest."""
    if initial is not None:
        raise ResponseError(f"time_response_sensitivities: initial = {initial!r}; '{system.name}' has motions as "
                            f"inputs, and starts from rest here. Compare variants by model.with_values.")  # fmt: skip
    names, spaces = _derivatives(system, parameters)
    shape = len(system.outputs), np.size(t)
    return np.array([space.time_response(t, u, hold) for space in spaces]).reshape(len(names), *shape)


def h2_norm(system: Any, outputs: Names = None, inputs: Names = None, parameters: Requested = None) -> Norm:
    """Return the H2 norm with its derivatives, 4 <G, dG> = |G + dG|^2 - |G - dG|^2 with dG as large as G."""
    part = system.with_ports(outputs, inputs)
    space = part.state_space("modal")
    value = h2(space).value
    names, spaces = _derivatives(part, parameters)
    slopes = np.zeros(len(names))
    for k, change in enumerate(spaces):
        if (np.abs(change.D) > DIRECT * (np.abs(change.C) @ np.abs(change.B))).any():
            slopes[k] = np.inf
            continue
        change = replace(change, D=np.zeros_like(change.D))
        size = h2(change).value
        if size and value:
            share = value / size
            above, below = (h2(_sum(space, change, sign * share)).value for sign in (1.0, -1.0))
            slopes[k] = (above - below) * (above + below) / (4.0 * share * value)
    return Norm(value, names, slopes)


def hinf_norm(system: Any, outputs: Names = None, inputs: Names = None, parameters: Requested = None) -> Norm:
    """Return the peak with its derivatives, Re(u^H dG v) by the singular vectors there."""
    part = system.with_ports(outputs, inputs)
    peak = peak_of(part)
    omega = float(peak.omega or 0.0)
    if omega == np.inf:
        names, spaces = _derivatives(part, parameters)
        response, changes = part.state_space().D.astype(complex), [space.D.astype(complex) for space in spaces]
    else:
        names = _names(part, parameters)
        speeds = np.abs(part.poles())
        at = omega or STATIC * float(speeds[speeds > 0.0].min(initial=1.0))
        response = part.frequency_response([at])[..., 0]
        changes = [] if not names else list(frequency_response_sensitivities(part, [at], parameters)[..., 0])
    u, _, v = np.linalg.svd(response)
    slopes = np.array([(u[:, 0].conj() @ change @ v[0].conj()).real for change in changes])
    return replace(peak, variables=names, slopes=slopes)


def _names(system: Any, parameters: Requested) -> tuple[str, ...]:
    """The variables; of matrices without a mechanism there are none unless they are named."""
    if getattr(system.ends, "kind", "") != "system":
        raise ResponseError(f"'{system.name}' has sparse equations, for whose norms and time responses no derivatives "
                            f"are there; linearize(method='dense').")  # fmt: skip
    provenance = system.ends.provenance
    if parameters is None and (provenance.from_matrices or provenance.closed_loop):
        return ()
    return tuple(variables(system.ends.parameters, parameters).names)


def _derivatives(system: Any, parameters: Requested) -> tuple[tuple[str, ...], list[StateSpace]]:
    """The variables, and state spaces of the derivatives of the response to them, with the same inputs and outputs."""
    names, ends = _names(system, parameters), system.ends
    if not names:
        return (), []
    system.state_space()  # refuses what needs the derivative of an input
    basis = ends.sensitivity_basis
    ports = list(range(len(ends.inputs))), list(range(len(ends.outputs)))
    base = states(basis.responses, *ports)
    parts = changed(base, basis.matrix_derivatives(parameters), *ports)
    return names, [_augmented(system, base, change) for change in zip(*parts, strict=True)]


def _augmented(system: Any, base: States, change: tuple[Array, ...]) -> StateSpace:
    """The state space of the derivative to one variable, with the states x and z."""
    rows, force, measured, direct = change
    n = len(base.A)
    a, b = np.zeros((2 * n, 2 * n)), np.concatenate((base.B, np.zeros_like(base.B)))
    a[:n, :n] = a[n:, n:] = base.A
    a[n + base.first :, :n], b[n + base.first :] = rows, force
    space = StateSpace.from_arrays(a, b, np.concatenate((measured, base.C), axis=1), direct, system.ends.inputs,
                                   system.outputs, name=system.name)  # fmt: skip
    return driven_space(space, system.drives, None, system.name)


def _sum(first: StateSpace, second: StateSpace, share: float) -> StateSpace:
    """The state space of G + share dG."""
    n, m = len(first.A), len(second.A)
    a = np.zeros((n + m, n + m))
    a[:n, :n], a[n:, n:] = first.A, second.A
    return StateSpace.from_arrays(
        a, np.concatenate((first.B, second.B)), np.concatenate((first.C, share * second.C), axis=1),
        first.D + share * second.D, first.inputs, first.outputs, name=first.name,
    )  # fmt: skip
