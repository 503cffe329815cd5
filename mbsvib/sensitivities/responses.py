"""Sensitivities of frequency responses by the adjoint: all parameters for about one more solution a frequency.

With R = T^-1 B and L = T^-T H^T, H = Cq + s Cv + s^2 Ca, the response is G = H R + D, and
dG = dD + L^T dB + dH R - L^T dT R: products of what parameters change and of the fields of L and R.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.common.expected import angular
from mbsvib.common.selection import needed_ports
from mbsvib.errors import ResponseError
from mbsvib.modes.damped import Damped
from mbsvib.responses import frequency_response as responses
from mbsvib.responses.modal_sum import sum_of_motions
from mbsvib.sensitivities.port_forms import feedthrough, port_forms

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from mbsvib.common.arrays import Array, Complex
    from mbsvib.equations.equations import Equations
    from mbsvib.linalg.vectors import Field
    from mbsvib.responses.basis import Basis
    from mbsvib.sensitivities.basis import SensitivityBasis
    from mbsvib.sensitivities.parameter_groups import ParameterGroups
    from mbsvib.sensitivities.variables import Requested

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
    elif basis.strong_dampers is not None:
        eta = responses.separated_solutions(modal, basis.strong_dampers, b, w, np.arange(len(w)))
    else:
        eta = responses.refined_solutions(basis, modal, b, s)
        bad = np.flatnonzero(~np.isfinite(eta).all(axis=(0, 1)))
        eta[:, :, bad] = responses.direct_solutions(modal, b, w, bad)
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
    """Return the derivatives of the frequency response.

    dG/dp = dD/dp + L^T dB/dp + dH/dp R - L^T (dK/dp + i w dC/dp - w^2 dM/dp) R

    Parameters
    ----------
    basis : SensitivityBasis
        The equations of motion, their modes and their network.
    omega : array-like, shape (n,)
        Angular frequencies [rad/s]; 0 gives the static compliance.
    parameters : str, iterable of str, mapping or None
        Names, patterns or linear maps of parameters; None: every parameter of the system.
    outputs, inputs : str or sequence of str, optional
        Names of ports; default: all.

    Returns
    -------
    array, shape (parameters, outputs, inputs, n)
        Derivatives [output unit / input unit per unit of the parameter].

    Raises
    ------
    ModelError
        If a parameter is unknown, or the system does not change smoothly with it.
    ResponseError
        If a frequency is not finite or is an undamped pole, or a port is unknown.
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
