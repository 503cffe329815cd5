"""The calls that add beams and reduced finite element models."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

from mbsvib.elements import beam as _beam
from mbsvib.elements import superelement as _superelement
from mbsvib.elements.part import Composed
from mbsvib.mechanism.mechanism import Mechanism

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike

    from mbsvib.elements import Body
    from mbsvib.elements.beam import Beam
    from mbsvib.elements.material import Material
    from mbsvib.elements.sections import Circle, Rectangle, Section, Tube
    from mbsvib.elements.superelement import Superelement

P = TypeVar("P", bound=Composed)


class FlexibleMechanism(Mechanism):
    """A mechanism whose bodies may bend."""

    def add_beam(
        self, name: str, a: str | Body | None, b: str | Body | None,
        section: Tube | Circle | Rectangle | Section | Mapping[str, Any],
        material: Material | Mapping[str, Any], start: ArrayLike | None = None, end: ArrayLike | None = None,
        axis: ArrayLike | None = None, length: float | None = None, nodes: ArrayLike | None = None,
        elements: int | None = None, shear: bool = False,
        y_axis: ArrayLike | None = None, alpha: float = 0.0, beta: float = 0.0, damping_ratio: float = 0.0,
        displacements: ArrayLike | None = None, second_order: bool = True,
    ) -> Beam:  # fmt: skip
        """Add a beam: straight elements that stretch, twist and bend in two planes, with consistent mass.

        Its nodes are called ``"NAME.0"``, ``"NAME.1"``, ...; they are bodies, which joints, springs, inputs and outputs
        may name, but for an end that a body holds. Its elements ``"NAME.e1"``, ... have deformations as coordinates.

        Parameters
        ----------
        name : str
            Name, unique among bodies, joints, bushings and springs.
        a, b : str, Body or None
            The bodies that hold its ends clamped, wherever their centres of mass are; None: a free end.
        section : Tube, Circle, Rectangle, Section or mapping
            The cross section, or its words: ``{"type": "tube", "radius": 0.1, "wall": 0.01}``.
        material : Material or mapping
            The material, or its words: ``{"E": 2.1e11, "nu": 0.3, "rho": 7800}``.
        start, end : array-like, shape (3,), optional
            Its ends [m], world axes, with ``elements`` equal elements between them.
        axis : array-like, shape (3,), optional
            Together with ``length`` instead of ``end``: the direction from ``start`` on.
        length : float, optional
            Length [m].
        nodes : array-like, shape (n, 3), optional
            Instead of these: its nodes [m], world axes, with a straight element from each to the next.
        elements : int, optional
            How many elements; default: 8.
        shear : bool
            False: Euler-Bernoulli. True: Timoshenko, with shear deformation and rotary inertia.
        y_axis : array-like, shape (3,) or (elements, 3), optional
            Direction towards which the section's y axis points, of all elements or of each; default: horizontal, of a
            vertical beam world y.
        alpha, beta : float
            Rayleigh damping, C = alpha M + beta K of the beam [1/s, s].
        damping_ratio : float
            Damping ratio of every elastic mode of the beam with both ends free, C = sum of 2 zeta omega M phi phi^T M.
            Modes of the beam as it is held have less where they are below these; ``beta = 2 zeta / omega`` gives the
            ratio zeta to a mode of ``omega`` [rad/s] in which this beam alone bends.
        displacements : array-like, shape (nodes, 6), optional
            How far its nodes and their rotation vectors are [m, rad], world axes, from where they would be without
            forces in the frame of the body that carries it: ground if that holds an end, else body a, b or the first
            node. ``equilibrium`` states it; default: the beam as described has its shape without forces.
        second_order : bool
            True: in ``equilibrium``, ``moved``, ``path`` and ``simulate`` slopes add to its strain as it bends, by half
            their squares, so that tension resists bending and ends that are held apart stretch it. False: linear there.
            ``linearize`` always has the stiffness of its tension.

        Returns
        -------
        Beam
            The part.

        Raises
        ------
        ModelError
            If a body is unknown, a length is zero, or a number of section or material is refused.
        """
        self._check_name(name, "beam")
        first = None if a is None else self._body_name(a, "beam", name, "a")
        second = None if b is None else self._body_name(b, "beam", name, "b")
        part = _beam.make(name, first, second, section, material, start, end, axis, length, nodes, elements, shear,
                          y_axis, alpha, beta, damping_ratio, displacements, second_order)  # fmt: skip
        return self._compose(part)

    def add_superelement(
        self, name: str, M: ArrayLike, C: ArrayLike | None, K: ArrayLike, nodes: Mapping[str, ArrayLike],
        bodies: Mapping[str, str] | None = None, orientation: ArrayLike | None = None, grounded: bool = False,
        displacements: ArrayLike | None = None,
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
        displacements : array-like, shape (n,), optional
            How far its coordinates are from where they would be without forces, in the frame of the node that carries
            it: one on the ground, else one that a body holds, else the first one. ``equilibrium`` states it.

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
        part = _superelement.make(name, M, C, K, nodes, holds, orientation, grounded,
                                   displacements)  # fmt: skip
        return self._compose(part)

    def _compose(self, part: P) -> P:
        for name in part.generated_names:
            self._check_name(name, f"{part.family} '{part.name}': part")
        self._reserve_names(part)
        return self._keep(self._composed, part)
