"""Rounding of transfer matrices at their zeros, and which zeros are determined despite it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.linalg.rank import EPS
from mbsvib.modes.damped import Damped
from mbsvib.responses.modal_sum import ModalSum

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Complex
    from mbsvib.equations.equations import Equations
    from mbsvib.modes.general import General
    from mbsvib.responses.resolvent import Resolvent


# Infinite zeros may come out finite if the deflation is ill-conditioned, for example along a chain of many masses. A
# value is a zero of the transfer matrix only if that grows a thousandfold within a quarter of the way to the nearest
# pole. Otherwise the transfer matrix is far from zero there, or it is rounding of its terms.
GROWTH = 1e3
COARSE = 0.25
AT_POLE = 1e-6  # zeros so near to a pole are those of uncontrollable or unobservable modes


def determined_zeros(
    modal: Damped | General, total: ModalSum | Resolvent, z: Complex, noise: Array, rank: int
) -> NDArray[np.bool_]:
    """Tell which zeros are determined despite rounding; ``rank``: normal rank of the transfer matrix."""
    if not len(z):
        return np.zeros(0, dtype=bool)
    distance = np.abs(z[:, None] - np.unique(modal.pairs)).min(axis=1)
    size = np.abs(z)
    offset = COARSE * distance * np.where(size > 0.0, z / np.where(size > 0.0, size, 1.0), 1.0)
    with np.errstate(all="ignore"):
        value, left, right = smallest_singular_value(total.at(z), rank)
        change = np.abs(np.einsum("no,oin,ni->n", left.conj(), total.at(z + offset), right))
        rounding = np.einsum("no,oin,ni->n", np.abs(left), noise, np.abs(right))
        clear = change > GROWTH * np.maximum(value, rounding)
    return np.asarray(clear | (distance <= AT_POLE * size) | (size == 0.0))


def transfer_rounding(
    system: Equations, modal: Damped | General, total: ModalSum | Resolvent, ports: tuple[list[int], list[int]],
    z: Complex,
) -> Array:
    """Return the rounding of the transfer matrix at the points z, (outputs, inputs, n).

    That of a sum over modes is the rounding of the largest entry of each vector.
    """
    if not isinstance(total, ModalSum):
        return total.noise(z)
    sources, results = ports
    result = np.zeros((len(results), len(sources), len(z)))
    with np.errstate(all="ignore"):
        if isinstance(modal, Damped):
            right: NDArray[Any] = modal.shapes
            left: NDArray[Any] = modal.shapes
            down = 1.0 / np.abs((z - modal.pairs[:, :1]) * (z - modal.pairs[:, 1:]))
        else:
            values, right, left, slopes = modal.spectrum.complete()
            left, down = left / slopes, 1.0 / np.abs(z - values[:, None])
        b = np.abs(left.T @ system.B[:, sources])
        highest = b.max(axis=0, initial=0.0)
        for order, rate in enumerate((system.Cq, system.Cv, system.Ca)):
            c = np.abs(rate[results] @ right)
            terms = np.einsum("om,i->oim", c, highest) + np.einsum("o,mi->oim", c.max(axis=1, initial=0.0), b)
            result += np.tensordot(terms, down, axes=1) * np.abs(z) ** order
    return EPS * result


def smallest_singular_value(matrices: Complex, rank: int) -> tuple[Array, Complex, Complex]:
    """Return the singular value (n,) number ``rank`` of matrices (outputs, inputs, n), with its vectors (n, ...)."""
    stack = matrices.transpose(2, 0, 1)
    good: NDArray[np.bool_] = np.asarray(np.isfinite(stack).all(axis=(1, 2)))
    u, s, v = np.linalg.svd(np.where(good[:, None, None], stack, 0.0), full_matrices=False)
    return np.where(good, s[:, rank - 1], np.nan), u[:, :, rank - 1], v[:, rank - 1, :].conj()
