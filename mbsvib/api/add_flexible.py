"""The calls that add beams, flexures and reduced finite element models."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

from numpy.typing import ArrayLike

from mbsvib.common import arguments as check
from mbsvib.elements import Body
from mbsvib.elements import beam as _beam
from mbsvib.elements import flexure as _flexure
from mbsvib.elements import superelement as _superelement
from mbsvib.elements.beam import Beam
from mbsvib.elements.flexure import Flexure
from mbsvib.elements.material import Material
from mbsvib.elements.part import Composed
from mbsvib.elements.sections import Circle, Rectangle, Section, Tube
from mbsvib.elements.superelement import Superelement
from mbsvib.mechanism.mechanism import Mechanism

P = TypeVar("P", bound=Composed)


class FlexibleMechanism(Mechanism):
    """A mechanism whose bodies may bend."""

    def add_beam(
        self, name: str, a: str | Body | None, b: str | Body | None,
        section: Tube | Circle | Rectangle | Section | Mapping[str, Any], material: Material | Mapping[str, Any],
        start: ArrayLike | None = None, end: ArrayLike | None = None, axis: ArrayLike | None = None,
        length: float | None = None, nodes: ArrayLike | None = None, elements: int | None = None, shear: bool = False,
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
        length : float, above 0, optional
            Length [m].
        nodes : array-like, shape (n, 3), optional
            Instead of these: its nodes [m], world axes, with a straight element from each to the next.
        elements : int, at least 1, optional
            How many elements; default: 8.
        shear : bool
            False: Euler-Bernoulli. True: Timoshenko, with shear deformation and rotary inertia.
        y_axis : array-like, shape (3,) or (elements, 3), optional
            Direction towards which the section's y axis points, of all elements or of each; default: horizontal, of a
            vertical beam world y.
        alpha, beta : float, at least 0
            Rayleigh damping, C = alpha M + beta K of the beam [1/s, s].
        damping_ratio : float, at least 0
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

    def add_flexure(
        self, name: str, a: str | Body, b: str | Body, shape: Mapping[str, Any],
        material: Material | Mapping[str, Any], position: ArrayLike = (0.0, 0.0, 0.0),
        orientation: ArrayLike | None = None, shear: bool = False, alpha: float = 0.0, beta: float = 0.0,
        damping_ratio: float = 0.0, displacements: ArrayLike | None = None, second_order: bool = True,
    ) -> Flexure:  # fmt: skip
        """Add a flexure: a leaf spring or a notch hinge, whose ends two bodies hold clamped.

        About its middle its stiffness is diagonal in its axes, z along it and y along its width. For a leaf of the
        length L, width b and thickness t,

        k_x = 12 E I_y / L^3,  k_y = 12 E I_x / L^3,  k_z = E A / L,
        k_rx = E I_x / L,  k_ry = E I_y / L,  k_rz = G J / L

        with I_y = b t^3 / 12, I_x = t b^3 / 12, and J that of a rectangle whose ends do not warp. The compliances of a
        notch are integrals of its thickness h(z):

        1/k_ry = int 12 / (E b h^3),  1/k_x = int 12 z^2 / (E b h^3) + 1.2 / (G b h),  1/k_z = int 1 / (E b h),
        1/k_rx = int 12 / (E b^3 h),  1/k_y = int 12 z^2 / (E b^3 h) + 1.2 / (G b h),  1/k_rz = int 1 / (G J),

        without what the bodies beside it give way, and with free warping. Its mass is consistent with these
        deflections, and the axial force changes its stiffness to first order: a guided leaf under the compression P has
        12 E I_y / L^3 - 6 P / (5 L), which is 0.6 % more than the exact value at 0.5 pi^2 E I_y / L^2 and vanishes at
        1.013 of the buckling load; ``add_beam`` with several elements is exact there. Its element is called
        ``"NAME.e1"``, with x along it; force outputs may name it.

        Parameters
        ----------
        name : str
            Name, unique among bodies, joints, bushings and springs.
        a, b : str or Body
            The bodies that hold its ends: ``a`` that at -z, ``b`` that at +z.
        shape : mapping
            Lengths [m] by the type: ``{"type": "leaf", "length": ..., "width": ..., "thickness": ...}``, the circular
            ``"notch"`` with ``radius``, ``thickness`` of the neck and ``width`` (its length is twice the radius),
            ``"elliptic"`` with ``length`` and ``depth`` of the cuts, ``thickness`` and ``width``, or
            ``"corner_filleted"`` with ``length``, ``radius`` of the fillets, ``thickness`` and ``width``.
        material : Material or mapping
            The material, or its words: ``{"E": 2.1e11, "nu": 0.3, "rho": 7800}``.
        position : array-like, shape (3,)
            Its middle [m], world axes.
        orientation : array-like, shape (3, 3) or (3,), optional
            Its axes as columns, or a rotation vector [rad]; default: world axes.
        shear : bool
            Of a leaf: True for shear deformation, with the factor 5/6, and rotary inertia, which count where it is not
            much longer than wide. Notches always have both.
        alpha, beta : float, at least 0
            Rayleigh damping, C = alpha M + beta K of the flexure [1/s, s].
        damping_ratio : float, at least 0
            Damping ratio of every elastic mode of the flexure with both ends free.
        displacements : array-like, shape (2, 6), optional
            How far its ends and their rotation vectors are [m, rad], world axes, from where they would be without
            forces in the frame of the ground, if that holds an end, else of ``a``. ``equilibrium`` states it.
        second_order : bool
            True: in ``equilibrium``, ``moved``, ``path`` and ``simulate`` its slopes add to its strain, so that a bent
            leaf is shorter. False: linear there. Bending by more than 0.15 rad gives a warning.

        Returns
        -------
        Flexure
            The part.

        Raises
        ------
        ModelError
            If a body is unknown, both are the same, or a number of shape or material is refused.

        Source: Paros, Weisbord, How to design flexure hinges, Machine Design 37 (1965), 151-156 (circular); Smith,
        Flexures (2000) (elliptic); Lobontiu, Compliant Mechanisms (2003) (corner-filleted); Timoshenko, Goodier, Theory
        of Elasticity, section 109, and Meijaard, Brouwer, Jonker, Multibody Syst. Dyn. 23 (2010), 271-289 (torsion).
        """
        self._check_name(name, "flexure")
        first, second = self._body_name(a, "flexure", name, "a"), self._body_name(b, "flexure", name, "b")
        part = _flexure.make(name, first, second, shape, material, position, orientation, shear, alpha, beta,
                             damping_ratio, displacements, second_order)  # fmt: skip
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
        if not isinstance(bodies, Mapping | None):
            raise check.refuse(f"superelement '{name}'", "bodies", bodies, "{'NODE': 'BODY', ...}")
        holds = {}
        for node, body in (bodies or {}).items():
            holds[node] = self._body_name(body, "superelement", name, "bodies")
        part = _superelement.make(name, M, C, K, nodes, holds, orientation, grounded, displacements)
        return self._compose(part)

    def _compose(self, part: P) -> P:
        for name in part.generated_names:
            self._check_name(name, f"{part.family} '{part.name}': part")
        self._reserve_names(part)
        return self._keep(self._composed, part)
