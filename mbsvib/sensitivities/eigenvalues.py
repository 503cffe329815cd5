"""Sensitivities of the eigenvalues, repeated ones included.

With y^T (2 lambda M + C) x = 1 an eigenvalue moves by d lambda = -y^T (lambda^2 dM + lambda dC + dK) x. Where
eigenvalues coincide, those of this form in their common subspace are the directions in which they part.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.sensitivities.fields import check_complete, fields, motions
from mbsvib.sensitivities.network import network
from mbsvib.sensitivities.products import breaking, products
from mbsvib.sensitivities.spectrum import spectrum
from mbsvib.sensitivities.variables import variables

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from numpy.typing import NDArray

    from mbsvib.kinematics import Index
    from mbsvib.parameters import Parameter
    from mbsvib.sensitivities.fields import Field
    from mbsvib.sensitivities.network import Network
    from mbsvib.sensitivities.spectrum import Spectrum
    from mbsvib.sensitivities.variables import Variables
    from mbsvib.system import System

    Complex = NDArray[np.complex128]

EPS = float(np.finfo(float).eps)
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
    check_complete(system, net)
    groups = found.clusters()
    pairs = [np.array(pair).reshape(2, -1) for pair in (np.meshgrid(group, group, indexing="ij") for group in groups)]
    left, right = np.concatenate([np.tile(np.arange(len(found.lead)), (2, 1)), *pairs], axis=1)
    forms = _forms(system, net, chosen, found, left, right)
    forms[breaking(system, net, chosen.parameters)] = np.nan
    form = chosen.chain(forms)
    gram = found.gram(system, left, right)
    simple = len(found.lead)
    resting = np.flatnonzero(found.lead == 0.0)
    size = np.abs(form).max(axis=1, keepdims=True, initial=0.0) if len(resting) else 0.0
    still = np.abs(form[:, resting]) <= ZERO_FORM * size
    gram[resting] = -1.0
    form[:, :simple] *= -1.0 / gram[:simple]
    form[:, resting] = np.where(still, 0.0, np.inf)
    start = simple
    for group in groups:
        part = slice(start, start := start + len(group) ** 2)
        form[:, group] = _branches(form[:, part], gram[part], len(group))
    source = np.empty(found.count, dtype=np.intp)
    source[found.place], source[found.mirror] = np.arange(simple), found.mirrored
    sign = np.ones(found.count)
    sign[found.mirror] = -1.0
    result: Complex = form[:, source]
    result.imag *= sign
    return result


def _forms(
    system: System, net: Network, chosen: Variables, found: Spectrum, left: Index, right: Index
) -> Complex:
    """Return y_i^T (lambda^2 dM + lambda dC + dK) x_j for pairs (i, j) of eigenvectors, lambda that of j."""
    values = found.lead[right]
    square, one, none = values * values, np.ones(len(values)), np.zeros(len(values))
    x = motions(system, net, found.right)
    repeats = len(values) > len(found.lead)
    if repeats or found.left is not None:
        y = x if found.left is None else motions(system, net, found.left)
        first = y[0][..., left], y[1][..., left]
        second: tuple[Field, Field] | None = (x[0][..., right], x[1][..., right])
    else:
        first, second = x, None

    def at(factors: tuple[Field, Field, Field], parameters: Sequence[Parameter]) -> Field:
        other = None if second is None else fields(net, second, *factors)
        return products(net, parameters, fields(net, first, *factors), other)

    if found.right.dtype.kind == "c":
        return at((one, values, square), chosen.parameters).astype(complex, copy=False)
    # real shapes: real arithmetic, once for the real and once for the imaginary parts of the eigenvalues
    result: Complex = at((one, values.real, square.real), chosen.parameters).astype(complex)
    some = np.arange(len(chosen.parameters))
    if not (net.damping.any() or square.imag.any()):
        some = np.array([i for i, entry in enumerate(chosen.parameters) if entry.field == "damping"], dtype=np.intp)
    if len(some) and values.imag.any():
        result[some] += 1j * at((none, values.imag, square.imag), [chosen.parameters[i] for i in some])
    return result


def _branches(form: Complex, gram: Complex, size: int) -> Complex:
    """Derivatives of eigenvalues that coincide, (variables, size), from their forms and y^T (2 lambda M + C) x."""
    pair = gram.reshape(size, size)
    if np.linalg.cond(pair) * EPS > 1.0:  # a defective pair parts with the square root of any change
        return np.full((len(form), size), np.inf, dtype=complex)
    matrix: Complex = np.asarray(-np.linalg.solve(pair, form.reshape(-1, size, size)), dtype=complex)
    if size == 2:
        half = 0.5 * (matrix[:, 0, 0] - matrix[:, 1, 1])
        root = np.sqrt(half * half + matrix[:, 0, 1] * matrix[:, 1, 0])
        mean: Complex = 0.5 * (matrix[:, 0, 0] + matrix[:, 1, 1])
        values: Complex = np.stack((mean - root, mean + root), axis=1)
    else:
        values = _eigenvalues(np.where(np.isfinite(matrix), matrix, 0.0))
        values[~np.isfinite(matrix).all(axis=(1, 2))] = np.nan
    along = np.where(np.abs(values.imag).max(axis=1, keepdims=True) > np.abs(values.real).max(axis=1, keepdims=True),
                     values.imag, values.real)  # fmt: skip
    result: Complex = np.take_along_axis(values, np.argsort(along, axis=1), axis=1)
    return result


def _eigenvalues(matrices: Complex) -> Complex:
    return np.asarray(np.linalg.eigvals(matrices), dtype=complex)
