"""Sensitivities of the eigenvalues, repeated ones included.

With y^T (2 lambda M + C) x = 1 an eigenvalue moves by d lambda = -y^T (lambda^2 dM + lambda dC + dK) x. Where
eigenvalues coincide, those of this form in their common subspace are the directions in which they part.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.sensitivities.fields import check_complete, fields
from mbsvib.sensitivities.network import network
from mbsvib.sensitivities.products import breaking, products
from mbsvib.sensitivities.spectrum import spectrum
from mbsvib.sensitivities.variables import variables

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from numpy.typing import NDArray

    from mbsvib.kinematics import Index
    from mbsvib.sensitivities.fields import Field, Fields
    from mbsvib.sensitivities.network import Network
    from mbsvib.sensitivities.spectrum import Spectrum
    from mbsvib.sensitivities.variables import Variables
    from mbsvib.system import System

    Complex = NDArray[np.complex128]

# A form in a rigid-body motion below this share of the largest in any motion is zero but for rounding.
ZERO_FORM = 1e-12


def eigenvalue_sensitivities(
    system: System, parameters: str | Iterable[str] | Mapping[str, Mapping[str, float]] | None = None
) -> Complex:
    """Return the derivatives of all eigenvalues.

    d lambda / dp = -y^T (lambda^2 dM/dp + lambda dC/dp + dK/dp) x / y^T (2 lambda M + C) x

    Parameters
    ----------
    system : System
        The equations of motion.
    parameters : str, iterable of str, mapping or None
        Names, patterns or linear maps of parameters; None: every parameter of the system.

    Returns
    -------
    array, shape (parameters, eigenvalues)
        Derivatives [1/s per unit of the parameter], eigenvalues in the order of ``modes().eigenvalues``. Eigenvalues
        that coincide have the derivatives of their branches, in ascending order. An eigenvalue 0 has 0 where the
        parameter leaves the motion free, infinity where it does not. Not a number where a parameter, changed alone,
        takes degrees of freedom away (it tilts one pin of a planar loop).

    Raises
    ------
    ModelError
        If a parameter is unknown.

    Source: Jiang, Chen & Luo (2011), sensitivities of eigenvalues; Friswell, J. Vib. Acoust. 118 (1996) 390, for
    repeated ones.
    """
    chosen = variables(system.parameters, parameters)
    found, net = spectrum(system), network(system)
    right = _motions(system, net, found.lead, found.right)
    left = None if found.left is None else _motions(system, net, found.lead, found.left)
    check_complete(system, found.lead, found.right, right)
    forms = products(net, chosen.parameters, right if left is None else left, None if left is None else right)
    forms[breaking(system, net, chosen.parameters)] = np.nan
    form = chosen.chain(forms)
    result = np.empty((len(chosen.names), found.count), dtype=complex)
    moving = found.lead != 0.0
    slope = np.where(moving, found.slopes(system), 1.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        result[:, found.place] = -form / slope
    result[:, found.place[~moving]] = np.where(np.abs(form[:, ~moving]) <= ZERO_FORM * _largest(form), 0.0, np.inf)
    for group in found.clusters():
        result[:, found.place[group]] = _branches(system, net, chosen, found, (left or right, right), group)
    result[:, found.mirror] = result[:, found.place[found.mirrored]].conj()
    return result


def _motions(system: System, net: Network, values: Complex, vectors: Field) -> Fields:
    """Motions that belong to eigenvalues; real where nothing is complex but the eigenvalue."""
    square: Field = values * values
    if not (net.damping.any() or values.real.any() or vectors.dtype.kind == "c"):
        square = square.real
    return fields(system, net, vectors, np.ones(len(values)), values, square)


def _largest(form: Field) -> Field:
    return np.asarray(np.abs(form).max(axis=1, keepdims=True, initial=0.0))


def _branches(
    system: System, net: Network, chosen: Variables, found: Spectrum, motions: tuple[Fields, Fields], group: Index
) -> Complex:
    """Derivatives of eigenvalues that coincide, (variables, group)."""
    i, j = (axis.ravel() for axis in np.meshgrid(group, group, indexing="ij"))
    size = len(group)
    left, right = motions
    form = chosen.chain(products(net, chosen.parameters, left.take(i), right.take(j))).reshape(-1, size, size)
    gram = found.gram(system, i, j).reshape(size, size)
    try:
        values: Complex = np.linalg.eigvals(-np.linalg.solve(gram, form.astype(complex))).astype(complex)
    except np.linalg.LinAlgError:  # a defective pair parts with the square root of any change
        return np.full((len(chosen.names), size), np.inf, dtype=complex)
    along = np.where(np.abs(values.imag).max(axis=1, keepdims=True) > np.abs(values.real).max(axis=1, keepdims=True),
                     values.imag, values.real)  # fmt: skip
    result: Complex = np.take_along_axis(values, np.argsort(along, axis=1), axis=1)
    return result
