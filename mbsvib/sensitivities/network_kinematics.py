"""Motions of a network: its coordinates, what closes its loops, and what keeps elements of beams in shape.

The forces in the rows of Phi that close loops and couple coordinates follow from what dependent coordinates feel.

Beams and superelements that keep their shape do not deform as the pose moves, so that only motions q with R q = 0 are
left, R being the deformations of all their elements and internal coordinates along the minimal ones. Where R has full
rank, statics determines their forces: there are motions that open the elements by any gaps.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from scipy.linalg import qr
from scipy.sparse import csr_array

from mbsvib.common.arrays import Array, Index
from mbsvib.elements import Body
from mbsvib.elements.coupler import Coupling
from mbsvib.elements.rows import Rows
from mbsvib.equations.equations import Equations
from mbsvib.equations.scene import cut_rows
from mbsvib.kinematics.couplers import with_couplers
from mbsvib.kinematics.relative_motion import Twists, in_order, relative_motion, twists
from mbsvib.linalg.rank import DEPENDENT_DEFORMATION
from mbsvib.linalg.vectors import DENSE, Field, entries_matrix
from mbsvib.mechanism.topology import FLOATS, Topology

Elements = tuple[tuple[str, ...], tuple[str, ...], int]


@dataclass(frozen=True, slots=True)
class Constraints:
    """What cut joints lock and couplers tie: rows of Phi. A force in one is ``share`` (t, rows) of ``wrench`` (t, 6)
    of each term, a locked row or what a coupler measures in a cut joint, at its joint's point, world axes; ``closing``
    (j, t) adds them up by joint. Of ``dependent`` coordinates (d,): the ``body`` behind and from the network's origin
    the ``arm`` (d, 3) of the ``twist`` (d, 6); ``pull`` (rows, d), a matrix or what multiplies like one, leads from
    what they feel to the forces in the rows, the smallest; ``stress`` (rows, r) are combinations of redundant rows that
    load nothing.
    """

    wrench: Array
    closing: Any
    share: Any
    dependent: Index
    body: Index
    arm: Array
    twist: Array
    pull: Any
    stress: Array


def constraints(
    system: Equations, coordinates: Twists, bodies: Sequence[Body], number: dict[str, int], origin: Array
) -> Constraints | None:
    """Return what closes the loops of a system and couples its coordinates.

    ``origin`` (3,): the point that sums of wrenches are taken about.
    """
    topology, reduction = system.provenance.topology, system.provenance.reduction
    couplers = [part for part in system.provenance.parts if isinstance(part, Coupling)]
    cuts = cut_rows(topology, bodies, number)
    if couplers:
        cuts = with_couplers(cuts, couplers, topology, bodies, number, coordinates)
    if cuts is None or not cuts.names:
        return None
    behind, sign = _coordinates(system)
    free = np.zeros(len(coordinates.names), dtype=bool)
    free[reduction.independent] = True
    dependent, locked = np.flatnonzero(~free), len(cuts.rows.first)
    phi = relative_motion(coordinates, cuts.rows).dense(0, locked)
    joint, coupled = np.array(topology.cut, dtype=np.intp)[cuts.joint[:locked]], None
    if (couplings := cuts.couplings) is not None:
        phi = np.concatenate((phi, couplings.dense(coordinates)))
        coupled = couplings.measured, couplings.owner, *couplings.of_measured
    pull, stress = _solution(phi[:, dependent])
    twist = np.concatenate((coordinates.linear, coordinates.angular))[:, dependent].T * sign[dependent, None]
    return Constraints(
        *closing_terms(topology, len(cuts.names), (cuts.rows, joint), coupled), dependent, behind[dependent],
        origin - coordinates.point[:, dependent].T, twist, pull, stress,
    )  # fmt: skip


def closing_terms(
    topology: Topology, count: int, locked: tuple[Rows, Index], coupled: tuple[Rows, Index, Index, Array] | None
) -> tuple[Array, Any, Any]:
    """Return ``wrench``, ``closing`` and ``share`` of ``Constraints`` with ``count`` rows.

    ``locked``: the rows that cut joints lock, with the numbers of their joints; ``coupled``: those that couplers
    measure, with the numbers of joints and of couplers, and the rates.
    """
    rows, joint = locked
    column, value = np.arange(len(joint)), np.ones(len(joint))
    if coupled is not None:
        rows, joint = Rows.join([rows, coupled[0]]), np.concatenate((joint, coupled[1]))
        column, value = np.concatenate((column, len(column) + coupled[2])), np.concatenate((value, coupled[3]))
    terms = np.arange(len(joint))
    closing = entries_matrix(np.ones(len(terms)), joint, terms, (len(topology.joints), len(terms)))
    wrench = np.concatenate((rows.force, rows.moment)).T
    return wrench, closing, entries_matrix(value, terms, column, (len(terms), count))


def _solution(phi: Array) -> tuple[Array, Array]:
    """The least mu = ``pull`` f (rows, d) with phi^T mu = f, and what may be added to it, phi^T ``stress`` = 0."""
    rows, d = phi.shape
    if rows == d:
        return np.asarray(np.linalg.inv(phi).T, dtype=float), np.zeros((rows, 0))
    q, r = np.linalg.qr(phi, mode="complete")
    return np.linalg.solve(r[:d], q[:, :d].T).T, q[:, d:]


def _coordinates(system: Equations) -> tuple[Index, Array]:
    """Body behind each joint coordinate and its sign; those of floating bodies come last."""
    topology = system.provenance.topology
    order = in_order(topology.branches)
    count = [6 if branch.joint == FLOATS else len(topology.joints[branch.joint].freedom) for branch in order]
    body = np.array([branch.body for branch in order], dtype=np.intp)
    return body.repeat(count), np.array([float(branch.sign) for branch in order]).repeat(count)


@dataclass(frozen=True)
class Kinematics:
    """Coordinates of a network, joint coordinates or amplitudes of modes.

    ``coordinates`` are the twists of joint coordinates, None where these are too many to hold all their paths, and
    ``reduction`` (n, m) leads to them from minimal ones; None: they are the same. ``relative`` returns relative
    displacements (rows, n) over the coordinates, ``constraints`` what closes loops and couples coordinates, with
    moments about a point.
    """

    coordinates: Twists | None
    reduction: Array | None
    relative: Callable[[Rows], Any]
    constraints: Callable[[Sequence[Body], dict[str, int], Array], Constraints | None]


def joint_coordinates(system: Equations, bodies: Sequence[Body]) -> Kinematics:
    """Return the joint coordinates of a system with these bodies, by the path rule.

    Motions that follow from statics do no work, and need no derivative.
    """
    coordinates = twists(system.provenance.topology, list(bodies))
    matrix, massless = system.provenance.reduction.matrix, system.provenance.separation
    condensed = None if massless is None else massless.transform

    def relative(rows: Rows) -> Any:
        entries = relative_motion(coordinates, rows)
        if entries.shape[0] * entries.shape[1] > DENSE:
            return csr_array((entries.value, (entries.row, entries.column)), shape=entries.shape)
        return entries.dense(0, entries.shape[0])

    return Kinematics(coordinates, matrix if condensed is None else condensed if matrix is None else matrix @ condensed,
                      relative, partial(constraints, system, coordinates))  # fmt: skip


@dataclass(frozen=True, slots=True)
class ElementReactions:
    """Elements by their number among all springs (e,), with the coordinates that are ``dependent`` and those left (r,)
    where no element deforms; ``inverse`` leads from deformations, then internal coordinates, to the dependent ones,
    ``motions`` (m, r) from those left to all.
    """

    springs: Index
    dependent: Index
    independent: Index
    inverse: Array
    motions: Array

    def opened(self, gap: Field) -> Field:
        """Return the motion (m, ...) along dependent coordinates that opens elements by gaps (e, 6, ...)."""
        flat = gap.reshape(6 * len(gap), -1)
        result = np.zeros((len(self.motions), flat.shape[1]), dtype=flat.dtype)
        result[self.dependent] = self.inverse[:, : len(flat)] @ flat
        return result.reshape(len(result), *gap.shape[2:])


def element_reactions(
    elements: Sequence[Elements | None], number: Mapping[str, int], moves: Array, body_motion: Mapping[str, Array]
) -> ElementReactions | None:  # fmt: skip
    """Return the elements of beams and superelements whose forces statics gives, None if it does not determine them.

    ``elements`` are the names of those of each part, the bodies of its internal coordinates, and their number; None:
    statics does not determine their forces. ``number`` is that of each spring by its name, ``moves`` (s, 6, m) the
    relative motions of all springs and ``body_motion`` (6, m) those of bodies.
    """
    springs: list[int] = []
    internal: list[Array] = []
    for of_part in elements:
        if of_part is None or not all(name in number for name in of_part[0]):
            return None
        names, carriers, count = of_part
        if carriers:
            internal.append(np.concatenate([body_motion[name][:3] for name in carriers])[:count])
        springs += [number[name] for name in names]
    deformations = np.concatenate((moves[springs].reshape(6 * len(springs), moves.shape[2]), *internal))
    count, m = deformations.shape
    if count > m:
        return None
    scaled = deformations / _largest(deformations, 0)
    scaled = scaled / _largest(scaled, 1)
    _, r, order = qr(scaled, mode="economic", pivoting=True)
    if count and abs(r[-1, count - 1]) <= DEPENDENT_DEFORMATION * abs(r[0, 0]):
        return None
    dependent, independent = np.sort(order[:count]), np.sort(order[count:])
    inverse = np.asarray(np.linalg.inv(deformations[:, dependent]), dtype=float)
    motion = np.zeros((m, len(independent)))
    motion[independent, np.arange(len(independent))] = 1.0
    motion[dependent] = -inverse @ deformations[:, independent]
    return ElementReactions(np.array(springs, dtype=np.intp), dependent, independent, inverse, motion)


def _largest(array: Array, axis: int) -> Array:
    """The largest entry of each row or column, 1 where all are zero."""
    size = np.abs(array).max(axis=axis, initial=0.0, keepdims=True)
    return np.where(size > 0.0, size, 1.0)
