"""Strain energy by element: the share of each spring, preload, load and joint reaction in each mode."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mbsvib.common.arrays import Array, Complex
from mbsvib.common.columnar import Columnar, numbered
from mbsvib.common.display import Displayed
from mbsvib.common.tables import text
from mbsvib.core.pairs import duals, own_curvatures, shift_hessian, twists_of
from mbsvib.equations.equations import Equations
from mbsvib.equations.load_stiffness import applied_pairs
from mbsvib.equations.statics import Statics
from mbsvib.linalg.rank import ZERO_FORM, ZERO_SUM
from mbsvib.linalg.rotations import crossed_product

if TYPE_CHECKING:
    from mbsvib.modes import Modes
    from mbsvib.responses.basis import Basis

# Maximum number of modes in a table, and smallest share that is shown.
SHOWN_MODES, SHOWN_SHARE = 8, 5e-4
ELASTIC, PRELOAD, LOAD, REACTION = "elastic", "preload", "load", "reaction"


@dataclass(frozen=True, repr=False, eq=False)
class StiffnessShares(Columnar, Displayed):
    """Shares of the strain energy phi^H K phi of modes: signed, and 1 in sum for each mode.

    ``elements`` are the names of elements with a share and ``kinds`` their kinds: "elastic" (a spring's or bushing's
    stiffness), "preload" (what its force adds to that), "load" (a force on a body), "reaction" (the force in a joint).
    ``shares`` (elements, modes); ``frequencies`` (modes,) [Hz]. Modes without strain energy, the rigid-body modes, have
    zeros. Gravity acts at the centres of mass, where a force has no stiffness: it shows in the joints that carry it.
    """

    name: str
    """Name of the model."""
    elements: tuple[str, ...]
    kinds: tuple[str, ...]
    frequencies: Array
    shares: Array

    def columns(self) -> dict[str, Any]:
        """Return a row for each element: its name, its kind, and its shares of modes 1, 2, ..."""
        return {"element": np.array(self.elements), "kind": np.array(self.kinds), **numbered({"mode": self.shares})}

    def of(self, element: str) -> Array:
        """Return the shares (modes,) of a spring, bushing, load or joint, all kinds together; zeros where it has none.
        """
        mine = [i for i, name in enumerate(self.elements) if name == element]
        return np.asarray(self.shares[mine].sum(axis=0))

    def by_kind(self) -> dict[str, Array]:
        """Return the shares (modes,) of each kind that is there, all elements together."""
        kinds = np.array(self.kinds)
        return {kind: self.shares[kinds == kind].sum(axis=0) for kind in dict.fromkeys(self.kinds)}

    def __str__(self) -> str:
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
        motion = system.body_motion @ shapes
        energy[len(springs) :] += _of_forces(statics, np.concatenate((motion, np.zeros((1, *motion.shape[1:])))))
        applied = statics.applied
        names += statics.owners[:count]
        kinds += [LOAD] * applied.loads + [PRELOAD] * (len(applied.names) - applied.loads)
        kinds += [REACTION] * (count - len(applied.names))
    used = np.flatnonzero(energy.any(axis=1))
    return tuple([names[i] for i in used]), tuple([kinds[i] for i in used]), energy[used]


def _of_forces(statics: Statics, motion: Any) -> Array:
    """Contribution of each pair of forces, (pairs, n), in ``motion`` (bodies + 1, 6, n), see ``core.shift_forms``."""
    pairs, count = statics.pairs, len(statics.applied.names)
    force, moment = pairs.force[..., None], pairs.torque[..., None]
    turns, moved, reach, result = [], [], np.zeros(()), np.zeros(())
    for body, sign in ((pairs.first, -1.0), (pairs.second, 1.0)):
        arm = (pairs.end - statics.position[:, body])[..., None]
        arm[:, body == len(motion) - 1] = 0.0
        turn = motion[body, 3:].transpose(1, 0, 2)
        turns.append(turn)
        moved.append(motion[body, :3].transpose(1, 0, 2) + crossed_product(turn, arm))
        by_arms = (force * arm).sum(axis=0) * np.square(np.abs(turn)).sum(axis=0)
        by_arms -= ((force * turn).sum(axis=0).conj() * (arm * turn).sum(axis=0)).real
        result, reach = result + sign * by_arms, reach + _lengths(arm) * _lengths(turn)
    delta, shift = turns[1] - turns[0], moved[1] - moved[0]
    turning = crossed_product(shift, force) + 0.5 * crossed_product(delta, moment)
    result = result + 2.0 * (turns[0].conj() * turning).sum(axis=0).real
    bound = _lengths(force) * (reach + _lengths(shift)) * (_lengths(turns[0]) + _lengths(turns[1]))
    bound += _lengths(moment) * _lengths(delta) * _lengths(turns[0])
    result[np.abs(result) <= ZERO_FORM * bound] = 0.0
    xi = np.concatenate((delta, shift)).transpose(1, 0, 2)
    if count:
        applied = replace(statics.applied, weight=np.zeros_like(statics.applied.weight))
        result[:count] += _form(shift_hessian(applied_pairs(applied, statics.position[:, :-1].T)), xi[:count])
    joints = statics.topology.joints
    for alike, numbers, curvature in own_curvatures(joints):
        q = duals(twists_of(alike)).swapaxes(1, 2)[:, : curvature.shape[-1]] @ xi[count + numbers]
        wrench = np.concatenate((pairs.torque, pairs.force))[:, count + numbers]
        result[count + numbers] += _form(np.einsum("in,nifg->nfg", wrench, curvature), q)
    return np.asarray(result)


def _lengths(vectors: Any) -> Array:
    """Lengths (p, n) of vectors (3, p, n)."""
    return np.asarray(np.sqrt(np.square(np.abs(vectors)).sum(axis=0)))


def _form(matrix: Array, motion: Any) -> Array:
    """Quadratic forms x^H A x (p, n) of matrices (p, f, f) and motions x (p, f, n)."""
    return np.asarray((motion.conj() * (matrix @ motion)).sum(axis=1).real)


def _sums_by_owner(rows: Array, owner: Sequence[int] | NDArray[np.intp], count: int) -> Array:
    result = np.zeros((count, rows.shape[1]))
    np.add.at(result, np.asarray(owner), rows)
    return result
