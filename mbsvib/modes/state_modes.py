"""Modes of first-order equations x' = A x: eigenvalues, natural frequencies and damping ratios."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import ClassVar, Self

import numpy as np

from mbsvib.common.arrays import Array, Bools, Complex, Index
from mbsvib.linalg.rank import EPS
from mbsvib.linalg.spectrum import spectrum
from mbsvib.modes.damped import Damped
from mbsvib.modes.result import Modes

# Eigenvalues from sample to sample below this size belong to delays, which are forgotten within a few samples.
FORGOTTEN = EPS**0.5
# States whose participations differ by less than this share are named by the first of them.
ALIKE = 1e-2


@dataclass(frozen=True, repr=False, eq=False)
class StateModes(Modes):
    """The modes of a state matrix in ascending natural frequency: one for each conjugate pair and each real eigenvalue.

    ``shapes`` (states, n) are the eigenvectors, one of each pair; ``first_order`` marks modes with a real eigenvalue.
    ``errors`` bounds the rounding of each eigenvalue, relative, by its condition number. ``participation`` (states, n)
    is the product of each state's entries in the left and right eigenvectors, abs(l_i r_i) / abs(l^H r), which does
    not depend on units and scales of the states; NaN where a mode is defective. Eigenvalues of at most ``zero_bound``
    [1/s] are given as 0, as rounding does not tell them from it.

    Source: Perez-Arriaga, Verghese & Schweppe (1982), Selective modal analysis, IEEE Trans. PAS 101(9).
    """

    MOST: ClassVar[str] = "largest participation"

    participation: Array = field(default_factory=lambda: np.zeros((0, 0)), repr=False)
    zero_bound: float = 0.0

    def strongest(self) -> tuple[tuple[str, ...], ...]:
        """Return for each mode the state with the largest participation.

        Returns
        -------
        tuple of (str,)
            One entry a mode; the first of states that take part alike, as a displacement and its rate do.
        """
        if not len(self):
            return ()
        size = np.nan_to_num(self.participation)
        alike = size >= (1.0 - ALIKE) * size.max(axis=0)
        return tuple([(self.coordinates[i],) for i in alike.argmax(axis=0)])

    def _selected(self, modes: Index) -> Self:
        return replace(super()._selected(modes), participation=self.participation[:, modes])

    def remarks(self) -> tuple[str, ...]:
        """Return notes on the table."""
        if not len(self):
            return ("There are no states.",)
        growing = np.flatnonzero(self.growing)
        unstable = [f"Unstable: mode{'s' if len(growing) > 1 else ''} {', '.join(str(i + 1) for i in growing)}."]
        at_rest = [f"At 0 Hz are eigenvalues up to {self.zero_bound:.1e} 1/s, which rounding does not tell from 0."]
        return (*(at_rest if self.zero_bound > 0.0 and self.rigid else ()), *(unstable if len(growing) else ()),
                f"Estimated relative error of the eigenvalues: {self.errors.max():.1e} at most.")  # fmt: skip

    def _shown(self) -> str:
        return f"{len(self.coordinates)} states"


def state_modes(a: Array, name: str, states: tuple[str, ...], rate: float | None = None) -> StateModes:
    """Return the modes of a state matrix (n, n), x' = A x, or of one from sample to sample, x+ = A x.

    With a ``rate`` [Hz] of samples eigenvalues are rate log z; those that are forgotten within a few samples are left
    out.
    """
    of_a = spectrum(a)
    values, change, left, right = of_a.values, of_a.errors, of_a.left, np.ldexp(1.0, of_a.power)[:, None] * of_a.right
    product = np.abs(left * of_a.right)
    with np.errstate(divide="ignore", invalid="ignore"):
        participation = product / np.abs(np.einsum("ij,ij->j", left.conj(), of_a.right))
        if rate is not None:
            kept = np.abs(values) > FORGOTTEN
            change, values = rate * change[kept] / np.abs(values[kept]), rate * np.log(values[kept])
            right, participation = right[:, kept], participation[:, kept]
        zero = np.abs(values) <= change
        zero_bound = float(change[zero].max(initial=0.0))
        values = np.where(zero, 0.0, values)
        errors = np.where(values == 0.0, 0.0, change / np.abs(values))
    order = np.lexsort((-values.imag, np.abs(values)))
    values, errors, right = values[order], errors[order], right[:, order]
    participation = participation[:, order]
    first = values.imag >= 0.0
    single = values[first].imag == 0.0
    n, none = int(first.sum()), np.zeros((0, 6, len(a)))
    at_rest = int((values[first] == 0.0).sum())
    pairs: Complex = np.zeros((0, 2), dtype=complex)
    nothing = Damped(pairs, pairs.real, np.zeros((0, 0)), np.zeros(0), np.zeros(0), "", None, None)
    return StateModes(name, states, (), _together(values, first), np.repeat(errors[first], 2 - single),
                      right[:, first].reshape(len(a), n), "", at_rest, none,
                      np.zeros((0, len(a))), nothing, single if single.any() else None,
                      participation=participation[:, first].reshape(len(a), n), zero_bound=zero_bound)  # fmt: skip


def _together(values: Complex, first: Bools) -> Complex:
    """Eigenvalues with each conjugate behind its own."""
    pairs = [(value, value.conj()) if value.imag else (value,) for value in values[first]]
    return np.array([value for pair in pairs for value in pair], dtype=complex)
