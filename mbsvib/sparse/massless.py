"""Classification of motions without mass in equations over sparse unknowns, without condensation.

K + s C + s^2 M is regular there except at poles, so that responses only need the stiffness and damping of these
motions. Springs and dampers couple them into parts, mostly of one motion; the dense path resolves each part, in the
amplitudes of its motions. Motions with neither stiffness nor damping are an error. Motions without damping follow from
statics and are no degrees of freedom. The others have one first-order state each.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csc_matrix, csr_matrix, diags, hstack, vstack

from mbsvib.common.arrays import Array, Index
from mbsvib.equations.equations import Separation
from mbsvib.equations.massless_separation import separate_massless
from mbsvib.equations.matrices import Terms
from mbsvib.equations.unresisted_motion import Scale
from mbsvib.linalg.groups import by_label, part_numbers
from mbsvib.linalg.rank import DEPENDENT_ROWS, EPS
from mbsvib.sparse.layout import Layout
from mbsvib.sparse.massless_motions import Motions
from mbsvib.sparse.tree import Tree


@dataclass(frozen=True, slots=True, kw_only=True)
class SparseSeparation(Separation):
    """Massless motions over the unknowns: ``static`` (size, n) without and ``damped`` (size, n) with damping.

    Static motions follow from statics; damped motions include the static motions that they cause. Only one damped
    motion is nonzero at each of the unknowns ``amplitude_of`` (n,). ``at_once`` (outputs, inputs) is the feedthrough of
    static motions, Cq N (N^T K N)^-1 N^T B.
    """

    static: csc_matrix
    damped: csc_matrix
    amplitude_of: Index
    at_once: Array


def separation(
    motions: Motions, tree: Tree, layout: Layout, bodies: Sequence[str], elastic: tuple[csr_matrix, Array, Array],
    antisymmetric: tuple[csr_matrix | None, csr_matrix | None], inputs: csr_matrix,
    outputs: tuple[csr_matrix, csr_matrix, csr_matrix], ports: tuple[Sequence[str], Sequence[str]],
) -> SparseSeparation:  # fmt: skip
    """Return the classification of the motions without mass; refused if one has neither stiffness nor damping.

    ``elastic``: rows (rows, size) with their stiffness and damping. ``antisymmetric``: parts of both (size, size).
    ``inputs`` (inputs, size) and ``outputs`` (outputs, size) of displacement, velocity and acceleration, ``ports`` the
    names of outputs and inputs. An output that would need the derivative of an input is refused.
    """
    z = motions.shapes
    used = np.flatnonzero((elastic[1] != 0.0) | (elastic[2] != 0.0))
    parts = _Parts(
        motions, layout, np.array([tree.names[k] for k in motions.coordinate.tolist()], dtype=object), bodies, ports,
        _clean(elastic[0][used], z).tocsc(), elastic[1][used], elastic[2][used],
        tuple([None if matrix is None else _clean(matrix, z) for matrix in antisymmetric]),
        _clean(inputs, z).T.tocsr(), tuple([_clean(rows, z).tocsc() for rows in outputs]),
    )  # fmt: skip
    coupled, uncoupled = parts.coupled_motions()
    results = [parts.of_uncoupled(uncoupled)]
    results += [parts.of_coupled(part) for part in [*coupled, *results[0].undecided[:, None]]]
    at_once = np.zeros((outputs[0].shape[0], inputs.shape[0]))
    for part in results:
        at_once[part.outputs] += part.at_once
    number = {name: i for i, name in enumerate(tree.names)}
    condensed = sorted([number[name] for part in results for name in part.condensed])
    first_order = np.array([number[name] for part in results for name in part.first_order], dtype=np.intp)
    order = np.argsort(first_order)
    static, damped = ((z @ hstack([getattr(part, key) for part in results])).tocsc() for key in ("static", "damped"))
    return SparseSeparation(
        tuple([tree.names[i] for i in condensed]), tuple([tree.names[i] for i in first_order[order].tolist()]),
        motions.kept_pivot, motions.dropped_pivot, at_once=at_once, static=static, damped=damped[:, order],
        amplitude_of=layout.coordinate[first_order[order]],
    )  # fmt: skip


def _clean(rows: csr_matrix, z: csc_matrix) -> csr_matrix:
    """Rows times motions, with zeros where terms cancel to rounding."""
    result = (rows @ z).tocsr()
    significant = result.multiply(abs(result) > DEPENDENT_ROWS * (abs(rows) @ abs(z))).tocsr()
    significant.eliminate_zeros()
    return significant


@dataclass(frozen=True, slots=True)
class _Classification:
    """Classification of some motions: names of those ``condensed`` and of ``first_order``, numbers of ``outputs`` and
    their feedthrough ``at_once``, amplitudes (n, k) of ``static`` and ``damped`` motions; and ``undecided`` ones.
    """

    condensed: list[str]
    first_order: list[str]
    outputs: Index
    at_once: Array
    static: Any
    damped: Any
    undecided: Index = field(default_factory=lambda: np.zeros(0, dtype=np.intp))


@dataclass(frozen=True, slots=True)
class _Parts:
    """The equations of the ``motions`` alone, in their amplitudes: elastic ``rows`` (rows, n) with ``stiffness`` and
    ``damping``, forces of the ``antisymmetric`` parts of both (size, n), inputs ``b`` (n, inputs) and outputs ``c``
    (outputs, n).
    """

    motions: Motions
    layout: Layout
    names: NDArray[np.object_]
    bodies: Sequence[str]
    ports: tuple[Sequence[str], Sequence[str]]
    rows: csc_matrix
    stiffness: Array
    damping: Array
    antisymmetric: tuple[csr_matrix | None, ...]
    b: csr_matrix
    c: tuple[csc_matrix, ...]

    def coupled_motions(self) -> tuple[list[Index], Index]:
        """Motions that springs and dampers couple, part by part, and uncoupled motions."""
        forces = [matrix for matrix in self.antisymmetric if matrix is not None]
        rows = vstack([self.rows, *forces]).tocsr()
        rows.data = np.ones(len(rows.data))
        # and by forces of one motion along another, as those of a spin about two axes
        along = [abs(self.motions.shapes.T) @ abs(matrix) for matrix in forces]
        parts = by_label(part_numbers(sum(along, rows.T @ rows)))
        single = np.array([part[0] for part in parts if len(part) == 1], dtype=np.intp)
        return [part for part in parts if len(part) > 1], single

    def of_uncoupled(self, part: Index) -> _Classification:
        """Classification of uncoupled motions, vectorized."""
        square = self.rows[:, part].power(2).T
        k, k_size, c, c_size = (square @ values for values in (self.stiffness, np.abs(self.stiffness), self.damping,
                                                               np.abs(self.damping)))  # fmt: skip
        velocity, acceleration = (np.diff(matrix[:, part].indptr) > 0 for matrix in self.c[1:])
        damped = (c_size > 0.0) & (c == c_size) & ~acceleration
        static = (c_size == 0.0) & (k_size > 0.0) & (k == k_size) & ~velocity & ~acceleration
        if any(matrix is not None for matrix in self.antisymmetric):
            damped[:] = static[:] = False
        condensed, first_order = part[static], part[damped]
        at_once = (self.c[0][:, condensed] @ diags(1.0 / k[static]) @ self.b[condensed]).toarray()
        return _Classification(
            [*self.names[condensed]], [*self.names[first_order]], np.arange(len(at_once)), at_once,
            self._amplitudes(condensed), self._amplitudes(first_order), part[~static & ~damped],
        )  # fmt: skip

    def _amplitudes(self, part: Index, shapes: Array | None = None) -> Any:
        """Amplitudes (n, k) of all motions for ``shapes`` of some of them; default: unit amplitudes."""
        n, count = len(self.names), len(part)
        if shapes is None:
            return coo_matrix((np.ones(count), (part, np.arange(count))), shape=(n, count))
        row, column = np.nonzero(shapes)
        return coo_matrix((shapes[row, column], (part[row], column)), shape=(n, shapes.shape[1]))

    def of_coupled(self, part: Index) -> _Classification:
        """Classification of some coupled motions."""
        elastic = self.rows[:, part].tocsr()
        row = np.flatnonzero(np.diff(elastic.indptr))
        rows, k, c = elastic[row].toarray(), self.stiffness[row], self.damping[row]
        outputs = [matrix[:, part].tocsr() for matrix in self.c]
        which = np.flatnonzero(sum(np.diff(matrix.indptr) for matrix in outputs))
        m = len(part)
        body, displacements = self._body_displacements(part)
        cq, cv, ca = (matrix[which].toarray() for matrix in outputs)
        terms, force_rows = Terms(
            np.zeros((m, m)), rows.T @ (c[:, None] * rows), rows.T @ (k[:, None] * rows), self.b[part].toarray(),
            cq, cv, ca, np.zeros((len(which), self.b.shape[1])), np.zeros((0, m)), rows, k, c, row, displacements,
        ), {}  # fmt: skip
        for key, matrix in zip(("circulatory", "gyroscopic"), self.antisymmetric, strict=True):
            if matrix is not None:
                forces = matrix[:, part]
                terms = terms.with_antisymmetric(**{"circulatory": None, "gyroscopic": None} | {
                    key: (self.motions.shapes[:, part].T @ forces).toarray()})  # fmt: skip
                force_rows[key] = forces[np.unique(forces.tocsc().indices)].toarray()
        ports = [self.ports[0][i] for i in which.tolist()], self.ports[1]
        names = tuple(self.names[part].tolist())
        terms, condensation, first_order = separate_massless(
            np.eye(m), terms, np.ones(m), Scale(1.0, np.ones(m), EPS * m), names,
            tuple([self.bodies[i] for i in body.tolist()]), ports, np.zeros(m, dtype=bool), force_rows,
        )  # fmt: skip
        transform, static, condensed = np.eye(m), np.zeros((m, 0)), []
        if condensation is not None:
            transform, static = condensation.transform, condensation.motions
            condensed = [names[i] for i in condensation.dependent.tolist()]
        damped = transform @ (np.zeros((transform.shape[1], 0)) if terms.null_inertia is None else terms.null_inertia)
        return _Classification(condensed, list(first_order), which, terms.D, self._amplitudes(part, static),
                               self._amplitudes(part, damped))  # fmt: skip

    def _body_displacements(self, part: Index) -> tuple[Index, Array]:
        """Numbers of the bodies in some motions, and their displacements (bodies, 6, n)."""
        z = self.motions.shapes[:, part].tocsr()
        used = np.zeros(self.layout.size + 1, dtype=bool)
        used[:-1] = np.diff(z.indptr) > 0
        body = np.flatnonzero(used[self.layout.displacement].any(axis=1))
        x = self.layout.displacement[body]
        result = np.zeros((*x.shape, len(part)))
        result[x >= 0] = z[x[x >= 0]].toarray()
        return body, result
