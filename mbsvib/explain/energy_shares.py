"""Strain energy by element: the share of each spring, preload, load and joint reaction in each mode."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common.display import Displayed
from mbsvib.elements.contribution import Contribution
from mbsvib.kinematics.mobility import crossed_product
from mbsvib.linalg.rank import ZERO_SUM
from mbsvib.sparse.geometric_terms import forms, geometric_terms
from mbsvib.sparse.load_terms import load_stiffness

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Complex
    from mbsvib.equations.equations import Equations
    from mbsvib.equations.statics import Statics
    from mbsvib.equations.wrench_pairs import WrenchPairs
    from mbsvib.modes import Modes
    from mbsvib.responses.basis import Basis

# Maximum number of modes in a table, and smallest share that is shown.
SHOWN_MODES, SHOWN_SHARE = 8, 5e-4
ELASTIC, PRELOAD, LOAD, REACTION = "elastic", "preload", "load", "reaction"


@dataclass(frozen=True, repr=False, eq=False)
class StiffnessShares(Displayed):
    """Shares of the strain energy phi^H K phi of modes: signed, and 1 in sum for each mode.

    ``elements`` are the names of elements with a share and ``kinds`` their kinds: "elastic" (a spring's or bushing's
    stiffness), "preload" (what its force adds to that), "load" (a force on a body), "reaction" (the force in a joint).
    ``shares`` (elements, modes); ``frequencies`` (modes,) [Hz]. Modes without strain energy, the rigid-body modes, have
    zeros. Gravity acts at the centres of mass, where a force has no stiffness: it shows in the joints that carry it.
    """

    name: str
    elements: tuple[str, ...]
    kinds: tuple[str, ...]
    frequencies: Array
    shares: Array

    def of(self, element: str) -> Array:
        """Return the shares of one element, all kinds together.

        Parameters
        ----------
        element : str
            Name of a spring, bushing, load or joint.

        Returns
        -------
        array, shape (modes,)
            Its share of each mode; zeros where it has none.
        """
        mine = [i for i, name in enumerate(self.elements) if name == element]
        return np.asarray(self.shares[mine].sum(axis=0))

    def by_kind(self) -> dict[str, Array]:
        """Return the shares of each kind, all elements together.

        Returns
        -------
        dict of str to array, shape (modes,)
            "elastic", "preload", "load" and "reaction" as far as they are there.
        """
        kinds = np.array(self.kinds)
        return {kind: self.shares[kinds == kind].sum(axis=0) for kind in dict.fromkeys(self.kinds)}

    def __str__(self) -> str:
        from mbsvib.common.tables import text

        count = min(SHOWN_MODES, self.shares.shape[1])
        shown = [i for i, row in enumerate(self.shares) if np.abs(row[:count]).max(initial=0.0) >= SHOWN_SHARE]
        percent = np.round(100.0 * self.shares, 1) + 0.0  # no "-0.0"
        rows = [(self.elements[i], self.kinds[i], *(f"{value:.1f}" for value in percent[i, :count])) for i in shown]
        columns: list[tuple[str, Any]] = [("element", "left"), ("kind", "left")]
        columns += [(f"{frequency:.4g} Hz", "right") for frequency in self.frequencies[:count]]
        notes = ["Shares of the strain energy in %. Elements below 0.05 % in all modes shown are omitted."]
        if count < self.shares.shape[1]:
            notes.append(f"The first {count} of {self.shares.shape[1]} modes.")
        return text(f"Strain energy by element: {self.name}", columns, rows, notes)

    def __repr__(self) -> str:
        return f"StiffnessShares({self.name!r}: {len(self.elements)} elements, {self.shares.shape[1]} modes)"


def stiffness_shares(basis: Basis, modes: Modes | None = None) -> StiffnessShares:
    """Return the shares of all elements in the strain energy of ``modes``; default: all modes."""
    system, modes = basis.equations, basis.modes if modes is None else modes
    system.provenance.check_mechanism(system.name, "stiffness_shares")
    names, kinds, energy = energies(system, modes.shapes)
    total = energy.sum(axis=0)
    rigid = (modes.natural == 0.0) | (np.abs(total) <= ZERO_SUM * np.abs(energy).sum(axis=0))
    shares = np.where(rigid, 0.0, energy / np.where(rigid, 1.0, total))
    return StiffnessShares(system.name, names, kinds, modes.frequencies, shares)


def energies(system: Equations, shapes: Array | Complex) -> tuple[tuple[str, ...], tuple[str, ...], Array]:
    """Return names and kinds of elements, and twice their strain energy phi^H K_e phi (elements, n) [J].

    ``shapes`` (m, n): shapes phi in minimal coordinates, real or complex.
    """
    springs, statics = system.provenance.springs, system.provenance.statics
    rows = system.row_stiffness[:, None] * np.square(np.abs(system.elastic_rows @ shapes))
    names, kinds = list(springs), [ELASTIC] * len(springs)
    count = 0 if statics is None else len(statics.pairs.first)
    # rows of all forces together come last: here each force has its own entry
    energy = _sums_by_owner(rows, np.minimum(system.row_owner, len(springs) + count), len(springs) + count + 1)[:-1]
    if statics is not None:
        energy[len(springs) :] += _of_forces(system, statics, shapes)
        applied = statics.applied
        names += statics.owners[:count]
        kinds += [LOAD] * applied.loads + [PRELOAD] * (len(applied.names) - applied.loads)
        kinds += [REACTION] * (count - len(applied.names))
    used = np.flatnonzero(energy.any(axis=1))
    return tuple([names[i] for i in used]), tuple([kinds[i] for i in used]), energy[used]


def _of_forces(system: Equations, statics: Statics, shapes: Array | Complex) -> Array:
    """Contribution of each pair of forces, (pairs, n): by its lever arms from the centres of mass, and by its turns."""
    motion: Any = system.body_motion @ shapes
    motion = np.concatenate((motion, np.zeros((1, *motion.shape[1:]))))
    pairs, count = statics.pairs, len(statics.pairs.first)
    parts = [geometric_terms(pairs, statics.applied, statics.second_order, statics.position)
             .contribution(pairs.force, pairs.torque)]  # fmt: skip
    of_loads = load_stiffness(statics.applied, statics.position)
    contribution = Contribution.join(parts if of_loads is None else [*parts, of_loads])
    rows, weights = contribution.rows, contribution.stiffness
    moved = [motion[body, :3].transpose(1, 0, 2) + crossed_product(
        motion[body, 3:].transpose(1, 0, 2), (rows.point - statics.position[:, body])[:, :, None])
        for body in (rows.first, rows.second)]  # fmt: skip
    turned = (motion[rows.second, 3:] - motion[rows.first, 3:]).transpose(1, 0, 2)
    base = np.einsum("cr,crn->rn", rows.force, moved[1] - moved[0]) + np.einsum("cr,crn->rn", rows.moment, turned)
    sums = np.zeros((contribution.count, base.shape[1]), base.dtype)
    np.add.at(sums, contribution.row, base)
    products = (sums[weights.first].conj() * sums[weights.second]).real
    products *= (weights.value * np.where(weights.first == weights.second, 1.0, 2.0))[:, None]
    result = _sums_by_owner(products, weights.owner, max(count, 1 + weights.owner.max(initial=0)))
    # without the sums over bodies: here each force has its own entry
    return np.asarray(result[:count] + _of_forms(statics, system.body_motion, shapes))


def _of_forms(statics: Statics, motion: Array, shapes: Array | Complex) -> Array:
    """Contribution of each pair of forces by its lever arms from the centres of mass, (pairs, n)."""
    rotation = motion[:, 3:] @ shapes
    rotation = np.concatenate((rotation, np.zeros((1, *rotation.shape[1:]))))
    pairs = _fixed(statics)
    result = np.zeros((len(pairs.first), rotation.shape[2]))
    for form, body in zip(forms(pairs, statics.position), (pairs.first, pairs.second), strict=True):
        rotated = rotation[body]
        result += np.einsum("pin,ijp,pjn->pn", rotated.conj(), form, rotated, optimize=True).real
    return result


def _sums_by_owner(rows: Array, owner: Sequence[int] | NDArray[np.intp], count: int) -> Array:
    result = np.zeros((count, rows.shape[1]))
    np.add.at(result, np.asarray(owner), rows)
    return result


def _fixed(statics: Statics) -> WrenchPairs:
    """All pairs of forces; those of follower loads, which have a form of their own, set to zero."""
    follower, pairs = statics.applied.follower, statics.pairs
    if not follower.any():
        return pairs
    force = pairs.force.copy()
    force[:, : len(follower)][:, follower] = 0.0
    return replace(pairs, force=force)
