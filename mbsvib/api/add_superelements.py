"""The call that adds a reduced finite element model."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

from mbsvib.api.add_beams import FlexibleMechanism
from mbsvib.elements import superelement as _superelement
from mbsvib.elements.superelement import Superelement

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


class ReducedMechanism(FlexibleMechanism):
    """A mechanism with parts that are known by their reduced matrices."""

    @property
    def superelements(self) -> Mapping[str, Superelement]:
        """Superelements by name, in the order in which they were added."""
        return MappingProxyType({k: part for k, part in self._composed.items() if isinstance(part, Superelement)})

    def add_superelement(
        self, name: str, M: ArrayLike, C: ArrayLike | None, K: ArrayLike, nodes: Mapping[str, ArrayLike],
        bodies: Mapping[str, str] | None = None, orientation: ArrayLike | None = None, grounded: bool = False,
    ) -> Superelement:  # fmt: skip
        """Add a reduced finite element model by its matrices, such as one after Craig and Bampton.

        Coordinates of the matrices: x y z rx ry rz of each node in the order of ``nodes``, then internal ones, which no
        rigid-body motion moves; these are called ``"NAME.mode1"``, ``"NAME.mode2"``, ... Nodes are bodies called
        ``"NAME.NODE"``, which joints, springs, inputs and outputs may name.

        Parameters
        ----------
        name : str
            Name, unique among bodies, joints, bushings and springs.
        M : array-like, shape (n, n)
            Mass matrix [kg, kg m, kg m^2].
        C : array-like, shape (n, n), or None
            Damping matrix.
        K : array-like, shape (n, n)
            Stiffness matrix [N/m, N, N m].
        nodes : mapping of str to array-like, shape (3,)
            Position of each interface node [m], world axes, by its name.
        bodies : mapping of str to str, optional
            Of nodes that a body holds, the name of this body; they are then no bodies of their own.
        orientation : array-like, shape (3, 3) or (3,), optional
            The axes in which all nodes move, as columns, or a rotation vector [rad]; default: world axes.
        grounded : bool
            True: the model is held by the ground within. False: K must let its nodes move as a rigid body.

        Returns
        -------
        Superelement
            The part; its ``rank`` gives the ranks of M and K.

        Raises
        ------
        ModelError
            If a matrix is not symmetric or has negative eigenvalues, shapes do not match, or K resists rigid motion.
        """
        self._check_name(name, "superelement")
        holds = {}
        for node, body in (bodies or {}).items():
            holds[node] = self._body_name(body, "superelement", name, "bodies")
        part = _superelement.make(name, M, C, K, nodes, holds, orientation, grounded)
        self._compose(part)
        return part
