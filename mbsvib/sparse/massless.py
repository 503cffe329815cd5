"""What becomes of motions without mass in equations over sparse unknowns, in which nothing has to be condensed.

K + s C + s^2 M is regular there but for poles, so that responses need no more than a look at what holds these motions.
Springs and dampers tie them into parts, mostly of one motion; each part is resolved by the dense path itself, in the
amplitudes of its motions: what neither spring nor damper resists is refused, what dampers do not resist follows from
statics and is no degree of freedom, and the others have one first-order state each.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.equations.massless_null_motion import EPS, ROW_RANK, Scale
from mbsvib.equations.massless_separation import Separation, resolved

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray
    from scipy.sparse import csc_matrix, csr_matrix

    from mbsvib.common.arrays import Array, Index
    from mbsvib.sparse.layout import Layout
    from mbsvib.sparse.massless_motions import Motions
    from mbsvib.sparse.tree import Tree


def separation(
    motions: Motions, tree: Tree, place: Layout, bodies: Sequence[str], elastic: tuple[csr_matrix, Array, Array],
    antisymmetric: tuple[csr_matrix | None, csr_matrix | None], inputs: csr_matrix,
    outputs: tuple[csr_matrix, csr_matrix, csr_matrix], ports: tuple[Sequence[str], Sequence[str]],
) -> tuple[Separation, Array]:  # fmt: skip
    """Return what becomes of the motions without mass.

    Parameters
    ----------
    motions : Motions
        The motions.
    tree : Tree
        The spanning tree.
    place : Layout
        Where the unknowns are.
    bodies : sequence of str
        Names of the bodies.
    elastic : tuple of csr_matrix, shape (rows, size), and arrays, shape (rows,)
        Elastic rows with their stiffness and damping.
    antisymmetric : pair of csr_matrix, shape (size, size), or None
        Antisymmetric parts of stiffness and damping.
    inputs : csr_matrix, shape (inputs, size)
        Rows of the inputs.
    outputs : tuple of csr_matrix, shape (outputs, size)
        Rows of the outputs for displacement, velocity and acceleration.
    ports : pair of sequences of str
        Names of the outputs and of the inputs.

    Returns
    -------
    Separation
        Names of the coordinates that follow from statics, and of those with one first-order state.
    array, shape (outputs, inputs)
        What motions that follow from statics add to the outputs at once, Cq N (N^T K N)^-1 N^T B.

    Raises
    ------
    ModelError
        If nothing holds one of the motions, or an output would need the derivative of an input.
    """
    z = motions.shapes
    acts = np.flatnonzero((elastic[1] != 0.0) | (elastic[2] != 0.0))
    parts = _Parts(
        motions, place, np.array([tree.names[k] for k in motions.own.tolist()], dtype=object), bodies, ports,
        _clean(elastic[0][acts], z).tocsc(), elastic[1][acts], elastic[2][acts],
        tuple([None if matrix is None else _clean(matrix, z) for matrix in antisymmetric]),
        _clean(inputs, z).T.tocsr(), tuple([_clean(rows, z).tocsc() for rows in outputs]),
    )  # fmt: skip
    tied, alone = parts.tied()
    condensed, slow, at_once, others = parts.single(alone)
    for part in [*tied, *others[:, None]]:
        gone, states, which, through = parts.resolved(part)
        condensed += gone
        slow += states
        at_once[which] += through
    order = {name: i for i, name in enumerate(tree.names)}
    first, second = (tuple(sorted(names, key=order.__getitem__)) for names in (condensed, slow))
    return Separation(first, second, motions.kept, motions.dropped), at_once


def _clean(rows: csr_matrix, z: csc_matrix) -> csr_matrix:
    """Rows times motions with zeros where terms cancel to rounding."""
    result = (rows @ z).tocsr()
    kept = result.multiply(abs(result) > ROW_RANK * (abs(rows) @ abs(z))).tocsr()
    kept.eliminate_zeros()
    return kept


@dataclass(frozen=True, slots=True)
class _Parts:
    """The equations of the ``motions`` alone, in their amplitudes: elastic ``rows`` (rows, n) with ``stiffness`` and
    ``damping``, forces of the ``antisymmetric`` parts of both (size, n), inputs ``b`` (n, inputs) and outputs ``c``
    (outputs, n).
    """

    motions: Motions
    place: Layout
    names: NDArray[np.object_]
    bodies: Sequence[str]
    ports: tuple[Sequence[str], Sequence[str]]
    rows: csc_matrix
    stiffness: Array
    damping: Array
    antisymmetric: tuple[csr_matrix | None, ...]
    b: csr_matrix
    c: tuple[csc_matrix, ...]

    def tied(self) -> tuple[list[Index], Index]:
        """Motions that springs and dampers tie together, part by part, and those that are tied to no other."""
        from scipy.sparse import vstack
        from scipy.sparse.csgraph import connected_components

        rows = vstack([self.rows, *(matrix for matrix in self.antisymmetric if matrix is not None)]).tocsr()
        rows.data = np.ones(len(rows.data))
        count, label = connected_components((rows.T @ rows).tocsr(), directed=False)
        order = np.argsort(label, kind="stable")
        parts = np.split(order, np.searchsorted(label[order], np.arange(1, count)))
        single = np.array([part[0] for part in parts if len(part) == 1], dtype=np.intp)
        return [part for part in parts if len(part) > 1], single

    def single(self, alone: Index) -> tuple[list[str], list[str], Array, Index]:
        """What becomes of motions that are tied to no other, all at once: those condensed, those of first order, what
        they add to the outputs; and the motions about which there is more to say.
        """
        from scipy.sparse import diags

        square = self.rows[:, alone].power(2).T
        size, sums = ((square @ kind(part) for part in (self.stiffness, self.damping)) for kind in (np.abs, np.array))
        (k_size, c_size), (k, c) = size, sums
        velocity, acceleration = (np.diff(matrix[:, alone].indptr) > 0 for matrix in self.c[1:])
        damped = (c_size > 0.0) & (c == c_size) & ~acceleration
        static = (c_size == 0.0) & (k_size > 0.0) & (k == k_size) & ~velocity & ~acceleration
        if any(matrix is not None for matrix in self.antisymmetric):
            damped[:] = static[:] = False
        still, pushed = alone[static], self.b[alone[static]]
        at_once = (self.c[0][:, still] @ diags(1.0 / k[static]) @ pushed).toarray()
        return ([*self.names[still]], [*self.names[alone[damped]]], at_once, alone[~static & ~damped])

    def resolved(self, part: Index) -> tuple[tuple[str, ...], tuple[str, ...], Index, Array]:
        """What becomes of some motions that are tied together: names of those condensed and of first order, numbers of
        outputs and what is added to them.
        """
        on = self.rows[:, part].tocsr()
        row = np.flatnonzero(np.diff(on.indptr))
        rows, k, c = on[row].toarray(), self.stiffness[row], self.damping[row]
        seen = [matrix[:, part].tocsr() for matrix in self.c]
        which = np.flatnonzero(sum(np.diff(matrix.indptr) for matrix in seen))
        m = len(part)
        found: dict[str, Any] = {
            "M": np.zeros((m, m)), "K": rows.T @ (k[:, None] * rows), "C": rows.T @ (c[:, None] * rows),
            "inertia_factor": np.zeros((0, m)), "elastic_rows": rows, "stiffness": k, "damping": c, "row_owner": row,
            "B": self.b[part].toarray(), "D": np.zeros((len(which), self.b.shape[1])),
            **{key: matrix[which].toarray() for key, matrix in zip(("Cq", "Cv", "Ca"), seen, strict=True)},
        }  # fmt: skip
        for key, into, matrix in zip(("circulatory", "gyroscopic"), "KC", self.antisymmetric, strict=True):
            if matrix is not None:
                forces = matrix[:, part]
                found[key] = (self.motions.shapes[:, part].T @ forces).toarray()
                found[f"{key}_rows"] = forces[np.unique(forces.tocsc().indices)].toarray()
                found[into] = found[into] + found[key]
        body, found["body_motion"] = self._moved(part)
        ports = [self.ports[0][i] for i in which.tolist()], self.ports[1]
        found, _, gone, slow, _ = resolved(
            np.eye(m), found, np.ones(m), Scale(1.0, np.ones(m), EPS * m), tuple(self.names[part].tolist()),
            tuple([self.bodies[i] for i in body.tolist()]), ports, np.zeros(m, dtype=bool),
        )  # fmt: skip
        return gone, slow, which, found["D"]

    def _moved(self, part: Index) -> tuple[Index, Array]:
        """Numbers of the bodies that some motions move, and their displacements (bodies, 6, n)."""
        z = self.motions.shapes[:, part].tocsr()
        used = np.zeros(self.place.size + 1, dtype=bool)
        used[:-1] = np.diff(z.indptr) > 0
        body = np.flatnonzero(used[self.place.displacement].any(axis=1))
        x = self.place.displacement[body]
        result = np.zeros((*x.shape, len(part)))
        result[x >= 0] = z[x[x >= 0]].toarray()
        return body, result
