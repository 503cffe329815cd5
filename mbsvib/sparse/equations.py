"""Equations of motion of many bodies, as sparse rows over displacements and joint coordinates, or as sparse matrices of
another program.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

import numpy as np

from mbsvib.common.arrays import Array, Index
from mbsvib.common.selection import port_numbers
from mbsvib.equations.equations import Connection, Removed
from mbsvib.equations.selection import port_fields
from mbsvib.errors import ModelError, ResponseError
from mbsvib.linalg.multifrontal import LARGEST, Fronts, SymmetricFactor, factored, fronts
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.mechanism.topology import Topology
from mbsvib.sparse.layout import Layout
from mbsvib.sparse.tableau import Tableau
from mbsvib.sparse.tree import Tree

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

    from mbsvib.equations.self_stress import Undetermined
    from mbsvib.sparse.constraints import Constraints
    from mbsvib.sparse.massless import SparseSeparation


@dataclass(frozen=True)
class SparseMatrices:
    """Symmetric ``M``, ``C`` and ``K`` (n, n) of the system ``name``, sparse by columns."""

    name: str
    M: Any
    C: Any
    K: Any

    @cached_property
    def fronts(self) -> Fronts:
        """The fronts of factors of all sums of the matrices."""
        result = fronts((abs(self.M) + abs(self.C) + abs(self.K)).tocsr())
        size = 8 * result.entries
        if size > LARGEST:
            raise ResponseError(
                f"'{self.name}': the factor of its matrices, of {len(result.permutation)} coordinates, takes "
                f"{size / 1e9:.3g} GB; expected at most {LARGEST / 1e9:g} GB. Reduce the model in the program that "
                f"wrote the matrices, and give the reduced ones."
            )
        return result

    def factor(self, square: float = 0.0, s: complex = 0.0, pivot: float | None = None) -> SymmetricFactor:
        """Factor K + s C + (s^2 - square) M; a singular matrix is a LinAlgError.

        Pivots are chosen in their front. A ``pivot`` is given where eigenvalues are counted: the inertia alone is kept.
        """
        matrix = self.K + s * self.C if s else self.K
        shift = s * s - square
        return factored((matrix + shift * self.M).tocsc() if shift else matrix, self.fronts, keep=pivot is None)

    def motions(self) -> Array | None:
        """Return a basis (n, m) of all motions; None: all coordinates."""
        return None

    @cached_property
    def massless(self) -> Index:
        """The coordinates without mass, which follow from statics."""
        return np.flatnonzero(self.M.diagonal() == 0.0)


S = TypeVar("S", bound="SparseEquations")


@dataclass(frozen=True, repr=False, eq=False)
class SparseEquations:
    """The linear equations of motion of a large mechanism, as sparse rows over displacements and joint coordinates.

    Names and units are those of ``Equations``. ``joint_coordinates`` are all coordinates of the spanning tree, the
    dependent ones of loops included. The size of all data is proportional to the number of bodies.

    ``elastic_rows`` (rows, unknowns) with ``row_stiffness``, ``row_damping``, ``row_owner`` (rows,), ``inertia_factor``
    W of M = W^T W (6 bodies, unknowns), ``input_rows`` (inputs, unknowns) and ``output_rows`` (three of them, for
    displacement, velocity and acceleration, each (outputs, unknowns)) are scipy sparse; ``D`` (outputs, inputs).
    ``model`` is the linearized model, ``removed`` are the bodies that ``reachable`` removed. Owners of rows are
    ``springs`` and then ``loading``: loads, preloads, joints and bodies whose forces cause geometric stiffness;
    ``undetermined`` lists output forces in joints that redundant constraints do not determine. ``circulatory`` and
    ``gyroscopic`` (unknowns, unknowns) are the antisymmetric parts of K and C from follower loads, torques, rotors
    and cross-coupling, or None. ``separation`` describes the motions without mass, None if there is none. They stay
    among the unknowns; ``D`` includes the direct contribution of the static ones, ``separation.at_once``,
    as in dense equations. If the equations are those of ``matrices`` from elsewhere, unknowns are their coordinates,
    and there are neither bodies nor rows.
    """

    _engine = (
        "connections constraints elastic_rows inertia_factor input_rows kind layout loading loop_rows matrices "
        "output_rows removed row_damping row_owner row_stiffness separation structure tableau undetermined"
    )

    kind: ClassVar[str] = "sparse system"

    name: str
    joint_coordinates: tuple[str, ...]
    inputs: tuple[str, ...]
    input_units: tuple[str, ...]
    outputs: tuple[str, ...]
    output_units: tuple[str, ...]
    bodies: tuple[str, ...]
    springs: tuple[str, ...]
    topology: Topology = field(repr=False)
    structure: Tree = field(repr=False)
    constraints: Constraints = field(repr=False)
    layout: Layout = field(repr=False)
    tableau: Tableau = field(repr=False)
    elastic_rows: csr_matrix
    loop_rows: csr_matrix
    inertia_factor: csr_matrix
    row_stiffness: Array
    row_damping: Array
    row_owner: Index
    input_rows: csr_matrix
    output_rows: tuple[csr_matrix, csr_matrix, csr_matrix]
    D: Array
    model: Mechanism = field(repr=False)
    removed: Removed | None = None
    loading: tuple[str, ...] = ()
    undetermined: tuple[Undetermined, ...] = ()
    circulatory: csr_matrix | None = None
    gyroscopic: csr_matrix | None = None
    separation: SparseSeparation | None = None
    matrices: SparseMatrices | None = None
    connections: tuple[Connection, ...] = ()

    @property
    def dof(self) -> int:
        """Number of degrees of freedom: tree coordinates minus independent loop rows and static motions.

        Motions with neither mass nor damping follow from statics and are no degrees of freedom.
        """
        static = 0 if self.separation is None else len(self.separation.condensed)
        massless = 0 if self.matrices is None else len(self.matrices.massless)
        return len(self.joint_coordinates) - len(self.layout.multiplier) - static - massless

    @property
    def dense_form(self) -> str:
        """What gives the dense equations, in words."""
        return "linearize(method='dense')" if self.matrices is None else "dense matrices, such as K.toarray()"

    def _check_mechanism(self, request: str) -> None:
        """Refuse a request that needs a mechanism."""
        if self.matrices is not None:
            raise ModelError(f"{request}: '{self.name}' was made of matrices and has no bodies, joints and elements; "
                             f"this needs a mechanism: build a Model and linearize it.")  # fmt: skip

    @property
    def massless(self) -> int:
        """Number of motions without mass that dampers resist: each has one first-order state in place of two."""
        return 0 if self.separation is None else len(self.separation.first_order)

    @property
    def tree(self) -> tuple[str, ...]:
        """Names of the joints of the spanning tree, from ground outwards."""
        return self.topology.tree

    @property
    def cut_joints(self) -> tuple[str, ...]:
        """Names of the joints at which loops are cut."""
        return self.topology.cut_joints

    @property
    def redundant(self) -> tuple[str, ...]:
        """Names of the constraint rows of cut joints that the others imply (``"pin4.rx"``)."""
        return tuple(name for group in self.constraints.groups for name in group.redundant)


def with_ports(system: S, outputs: Any = None, inputs: Any = None) -> S:
    """Return a system with some of its outputs and inputs, by name or pattern, and the same unknowns."""
    o, i = port_numbers(outputs, inputs, (system.outputs, system.inputs), system.name)
    ports = port_fields(system, o, i)
    separation: SparseSeparation | None = system.separation
    if separation is not None:
        separation = replace(separation, at_once=separation.at_once[np.ix_(o, i)])
    displacement, velocity, acceleration = (rows[o] for rows in system.output_rows)
    return replace(
        system, input_rows=system.input_rows[i], output_rows=(displacement, velocity, acceleration),
        undetermined=tuple([forces.among(ports["outputs"]) for forces in system.undetermined]), separation=separation,
        **ports,
    )  # fmt: skip
