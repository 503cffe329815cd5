"""Parameters whose derivatives are whole matrices, as a group beside those that one part's rule tells."""

from __future__ import annotations

from dataclasses import dataclass
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.errors import ModelError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mbsvib.common.arrays import Array, Index
    from mbsvib.linalg.vectors import Field
    from mbsvib.sensitivities.adjoint_fields import Fields

# What differences leave of a number that is zero, against the largest of a matrix.
ROUNDING = 1e-10
_POWERS = {"K": "stiff", "C": "rate", "M": "square"}


@dataclass(frozen=True, slots=True)
class MatrixDerivativeGroup:
    """The derivatives ``slopes`` of all matrices to the parameters ``rows`` (k, 1)."""

    rows: Index
    slopes: Mapping[str, Array]
    stride: int = 0

    def forms(self, left: Fields, right: Fields | None = None) -> Field:
        """Return x^T (dK + s dC + s^2 dM) y, (k, 1, ...); right None: y = x, and half of each form is returned.

        Parameters
        ----------
        left, right : Fields
            The motions x and y.

        Returns
        -------
        array, shape (k, 1, ...)
            Forms.
        """
        other = left if right is None else right
        result: Any = 0.0
        for key, power in _POWERS.items():
            change = self.slopes[key]
            if not change.any():
                continue
            weight = getattr(left, power) if right is None else getattr(left, power) + getattr(right, power)
            shape = other.vectors.shape
            pushed = change @ other.vectors.reshape(len(other.vectors), prod(shape[1:]))
            works = np.stack([(left.vectors * each.reshape(shape)).sum(axis=0) for each in pushed])
            result = result + 0.5 * weight * works
        if isinstance(result, float):
            tail = np.broadcast_shapes(left.vectors.shape[1:], other.vectors.shape[1:], np.shape(left.stiff))
            result = np.zeros((len(self.rows), *tail), dtype=left.vectors.dtype)
        return np.asarray(result[:, None])

    @property
    def symmetric(self) -> bool:
        """Whether all derivatives of K are symmetric."""
        change = np.nan_to_num(self.slopes["K"])
        apart = np.abs(change - change.swapaxes(1, 2)).max(initial=0.0)
        return bool(apart <= ROUNDING * np.abs(change).max(initial=0.0))

    def with_ports(
        self, result: Field, ports: tuple[list[int], list[int]], powers: tuple[Field, Field, Field],
        vectors: tuple[Field, Field], beside: tuple[int, ...] = (),
    ) -> None:  # fmt: skip
        """Add dD + L^T dB + (dCq + s dCv + s^2 dCa) R to the derivatives of responses, in place.

        Parameters
        ----------
        result : array, shape (parameters, outputs, inputs, n)
            Derivatives to all parameters of a plan.
        ports : pair of list of int
            Numbers of the inputs and of the outputs.
        powers : tuple of three arrays, shape (n,)
            1, s and s^2.
        vectors : pair of array, shape (m, 1, inputs, n) and (m, outputs, 1, n)
            R and L.
        beside : tuple of int
            Places of outputs whose D and H are counted elsewhere.
        """
        (i, o), (right, left) = ports, vectors
        counts = np.array([k not in beside for k in range(len(o))])[:, None, None]
        for k, row in enumerate(self.rows[:, 0].tolist()):
            result[row] += counts * self.slopes["D"][k][np.ix_(o, i)][:, :, None]
            result[row] += np.einsum("mi,mon->oin", self.slopes["B"][k][:, i], left[:, :, 0])
            for key, power in zip(("Cq", "Cv", "Ca"), powers, strict=True):
                result[row] += counts * power * np.einsum("om,min->oin", self.slopes[key][k][o], right[:, 0])

    def factors(self, row: int, matrix: str, name: str) -> tuple[Array, Array]:
        """Return P and Q (rank, m) with P^T Q + Q^T P the derivative of a matrix to one parameter.

        Parameters
        ----------
        row : int
            The parameter.
        matrix : str
            "M", "C" or "K".
        name : str
            What the derivative is to, for the message.

        Returns
        -------
        pair of array, shape (rank, m)
            Factors.

        Raises
        ------
        ModelError
            If the derivative is not symmetric, or not a number.
        """
        return factored(self.slopes[matrix][self.rows[:, 0].tolist().index(row)], matrix, name, ROUNDING)


def factored(change: Array, matrix: str, name: str, rounding: float) -> tuple[Array, Array]:
    """Return P and Q (rank, m) with P^T Q + Q^T P a symmetric matrix.

    Parameters
    ----------
    change : array, shape (m, m)
        The derivative of a matrix.
    matrix, name : str
        Which, and to what, for the message.
    rounding : float
        What is zero, against the largest entry.

    Returns
    -------
    pair of array, shape (rank, m)
        Factors.

    Raises
    ------
    ModelError
        If the derivative is not symmetric, or not a number.
    """
    size = np.abs(change).max(initial=0.0)
    if not np.abs(change - change.T).max(initial=0.0) <= rounding * size:
        raise ModelError(f"factors: the derivative of {matrix} to '{name}' is not symmetric, or not a number, and has "
                         f"no such factors; take the matrix itself.", element=name)  # fmt: skip
    sizes, vectors = np.linalg.eigh(0.5 * (change + change.T))
    acts = np.abs(sizes) > rounding * size
    return 0.5 * sizes[acts, None] * vectors.T[acts], vectors.T[acts]
