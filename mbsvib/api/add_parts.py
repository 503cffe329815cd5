"""The calls that add rigid bodies, joints and spring-dampers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

from numpy.typing import ArrayLike

from mbsvib.elements import Body, Bushing, Joint, Maxwell, Spring
from mbsvib.elements import body as _body
from mbsvib.elements import bushing as _bushing
from mbsvib.elements import dynamic_bushing as _dynamic
from mbsvib.elements import dynamic_spring as _dynamic_spring
from mbsvib.elements import dynamic_torsion as _dynamic_torsion
from mbsvib.elements import inerter as _inerter
from mbsvib.elements import joint as _joint
from mbsvib.elements import maxwell as _maxwell
from mbsvib.elements.connection import Connection
from mbsvib.elements.dynamic import Dynamic
from mbsvib.elements.dynamic_bushing import DynamicBushing
from mbsvib.elements.dynamic_spring import DynamicSpring
from mbsvib.elements.dynamic_torsion import DynamicTorsionSpring
from mbsvib.elements.inerter import Inerter
from mbsvib.elements.torsion_spring import TorsionSpring
from mbsvib.mechanism.mechanism import Mechanism

C = TypeVar("C", bound="Connection")


class RigidMechanism(Mechanism):
    """A mechanism of rigid bodies, joints and spring-dampers."""

    def add_body(
        self, name: str, mass: float | None = None, inertia: ArrayLike | None = None,
        position: ArrayLike = (0.0, 0.0, 0.0), orientation: ArrayLike | None = None,
        shape: Mapping[str, Any] | None = None, density: float | None = None,
    ) -> Body:  # fmt: skip
        """Add a rigid body, by its mass and inertia or by its shape and density.

        With a shape, mass = density V and the inertia that of the solid; the body keeps these numbers, not the shape.

        Parameters
        ----------
        name : str
            Name, unique among bodies, joints, bushings and springs.
        mass : float, at least 0
            Mass [kg]; 0 for a massless node, which springs and dampers hold (its inertia then is zeros too). An error
            beside a shape, as is the inertia.
        inertia : array-like, shape (3,), (6,) or (3, 3)
            Inertia about the centre of mass in body axes [kg m^2]: principal moments, the tensor's entries
            xx yy zz xy xz yz (xy = -integral of x y dm), or the tensor.
        position : array-like, shape (3,)
            Centre of mass [m], world axes; of a mesh the origin of its file, from which the centre of mass follows.
        orientation : array-like, shape (3, 3) or (3,), optional
            Body axes as columns, or a rotation vector [rad]; default: world axes.
        shape : mapping, optional
            Its ``"type"`` and dimensions [m]: box (``size``, three edges), cylinder (``radius``, ``length``), tube
            (``radius`` outside, ``wall``, ``length``), both along z of the body, sphere (``radius``), or mesh
            (``file``: .stl or .obj, ``scale``: metres per unit of the file, 1 by default; extra ``mbsvib[mesh]``).
        density : float, above 0, optional
            Density of the shape [kg/m^3].

        Returns
        -------
        Body
            The part, which other calls accept in place of its name.

        Raises
        ------
        ModelError
            If the name is taken, the mass is negative, no body can have this inertia, a word of the shape is unknown or
            missing, or a mesh is not watertight.

        Source: as in ``mbsvib.elements.shapes``.
        """
        self._check_name(name, "body")
        if shape is not None or density is not None:
            return self._keep(self._bodies, _body.of_shape(name, mass, inertia, position, orientation, shape, density))
        part = _body.make(name, mass, inertia, position, orientation)
        return self._keep(self._bodies, part)

    def add_joint(
        self, name: str, kind: str | None, first: str | Body, second: str | Body, position: ArrayLike | None = None,
        orientation: ArrayLike | None = None, axis: ArrayLike | None = None, axis2: ArrayLike | None = None,
        pitch: float | None = None, free: Sequence[str] | None = None, end: ArrayLike | None = None,
    ) -> Joint:  # fmt: skip
        """Add an ideal joint; its coordinates are the free displacements of ``second`` relative to ``first``.

        Parameters
        ----------
        name : str
            Name, unique among bodies, joints, bushings and springs.
        kind : str or None
            revolute, prismatic, cylindrical, screw, universal, spherical, planar, fixed or free (axis: local z);
            homokinetic (a constant-velocity joint: rx and ry, the components of one rotation vector, are free; axis:
            that of both shafts, or where they are at an angle the line that bisects it); point_on_line (axis: the line,
            which ``first`` carries; the point is that of ``second``), point_on_plane (axis: its normal), distance (a
            rod without mass from ``position`` on ``first`` to ``end`` on ``second``); None together with ``free``.
        first, second : str or Body
            The two bodies.
        position : array-like, shape (3,)
            The joint's point [m], world axes; not needed for prismatic and fixed joints.
        orientation : array-like, shape (3, 3) or (3,), optional
            Joint axes as columns, or a rotation vector [rad]; default: world axes.
        axis : array-like, shape (3,), optional
            Instead of ``orientation``: the joint's axis, world. Universal: the axis that stays in ``first``.
        axis2 : array-like, shape (3,), optional
            Universal only: the axis that stays in ``second``, world.
        pitch : float, optional
            Screw only: advance per radian [m/rad].
        free : sequence of str, optional
            For any other joint: the free directions out of x y z rx ry rz, in the joint's axes. Two free rotations are
            those of a universal joint: the axis named first stays in ``first``, the other one in ``second``, so that
            under load ("ry", "rx") is another joint than ("rx", "ry"). A homokinetic joint is a kind of its own.
        end : array-like, shape (3,), optional
            Distance only: the rod's point on ``second`` [m], world axes. The joint's z is the rod; its coordinates are
            those of ``second`` at this point.

        Returns
        -------
        Joint
            The part.

        Raises
        ------
        ModelError
            If a body is unknown or joined with itself, the kind is unknown, or an axis is zero.
        """
        a, b = self._between("joint", name, first, second)
        part = _joint.make(name, kind, a, b, position, orientation, axis, axis2, pitch, free, end)
        return self._keep(self._joints, part)

    def add_bushing(
        self, name: str, first: str | Body, second: str | Body, position: ArrayLike,
        stiffness: ArrayLike = _bushing.ZERO, damping: ArrayLike = _bushing.ZERO,
        orientation: ArrayLike | None = None, preload: ArrayLike | None = None,
        *, dynamic: Dynamic | Mapping[str, Any] | None = None, dynamic_stiffness: ArrayLike | None = None,
    ) -> Bushing | DynamicBushing:  # fmt: skip
        """Add a spatial spring-damper that acts at a point.

        K*(s) = K + C s, or with ``dynamic`` f, as of rubber, K*(s) = K + C s + (f(s) - 1) K_d

        Parameters
        ----------
        name : str
            Name, unique among bodies, joints, bushings and springs.
        first, second : str or Body
            The two bodies.
        position : array-like, shape (3,)
            The point [m], world axes.
        stiffness, damping : array-like, shape (6,) or (6, 6)
            Along and about the bushing's axes, x y z rx ry rz: N/m and N m/rad; N s/m and N m s/rad. A matrix K gives
            the wrench -K d on ``second`` and need not be symmetric: cross-coupling, as that of journal bearings and
            seals, makes K (C) of the system unsymmetric and may let it whirl.
        orientation : array-like, shape (3, 3) or (3,), optional
            Axes as columns, or a rotation vector [rad]; default: world axes.
        preload : array-like, shape (6,), optional
            Wrench on ``second`` in the given pose, in the bushing's axes [N, N m]; ``first`` takes its reaction.
        dynamic : Dynamic or mapping, optional
            How the stiffness depends on frequency: a sum of relaxations, such as ``Dynamic.prony`` and ``rational``
            make; also its ``words``, as model files have them. Each relaxation k has first-order states ``"NAME.k.x"``,
            one for each direction with stiffness, and parameters ``NAME.gk`` and ``NAME.tauk`` [s].
        dynamic_stiffness : array-like, shape (6,) or (6, 6), optional
            The part K_d of the stiffness that depends on frequency; default: all of it. Symmetric, without negative
            eigenvalues.

        Returns
        -------
        Bushing or DynamicBushing
            The part.

        Raises
        ------
        ModelError
            If a body is unknown, the shape is wrong, neither stiffness, damping nor preload is given, or ``dynamic``
            has no states.
        """
        a, b = self._between("bushing", name, first, second)
        part = _dynamic.make(name, a, b, position, stiffness, damping, orientation, preload, dynamic, dynamic_stiffness)
        return self._keep_with_nodes(part)

    def _keep_with_nodes(self, part: C) -> C:
        """Add a connection with the names of what it is in the equations."""
        for name in part.generated_names:
            self._check_name(name, f"{part.family} '{part.name}': part")
        self._generated |= dict.fromkeys(part.generated_names, part)
        return self._keep(self._springs, part)

    def add_spring(
        self, name: str, first: str | Body, second: str | Body, start: ArrayLike, end: ArrayLike,
        stiffness: float = 0.0, damping: float = 0.0, preload: float | None = None,
        free_length: float | None = None, *, dynamic: Dynamic | Mapping[str, Any] | None = None,
    ) -> Spring | DynamicSpring:  # fmt: skip
        """Add a spring-damper along the line between two points.

        k*(s) = k + c s, or with ``dynamic`` f, as of rubber, k*(s) = f(s) k + c s

        Parameters
        ----------
        name : str
            Name, unique among bodies, joints, bushings and springs.
        first, second : str or Body
            The two bodies.
        start, end : array-like, shape (3,)
            The point on ``first`` and the one on ``second`` [m], world axes.
        stiffness, damping : float
            Of the change of its length [N/m], and of its rate [N s/m].
        preload : float, optional
            Tension in the given pose [N]; negative where it pushes.
        free_length : float, at least 0, optional
            Instead of ``preload``: the length without load [m]; the tension is stiffness (length - free_length), with
            ``dynamic`` times its factor at rest.
        dynamic : Dynamic or mapping, optional
            How the stiffness depends on frequency: a sum of relaxations, such as ``Dynamic.prony`` and ``rational``
            make; also its ``words``, as model files have them. Each relaxation k is a spring in
            series with a damper: a first-order state ``"NAME.k.z"``, parameters ``NAME.gk`` and ``NAME.tauk`` [s].

        Returns
        -------
        Spring or DynamicSpring
            The part.

        Raises
        ------
        ModelError
            If a body is unknown, the points coincide, neither stiffness, damping nor preload is given, or ``dynamic``
            has no states or no positive stiffness.
        """
        a, b = self._between("spring", name, first, second)
        part = _dynamic_spring.make(name, a, b, start, end, stiffness, damping, preload, free_length, dynamic)
        return self._keep_with_nodes(part)

    def add_maxwell(
        self, name: str, first: str | Body, second: str | Body, start: ArrayLike, end: ArrayLike, stiffness: float,
        damping: float, static_stiffness: float = 0.0, preload: float | None = None,
    ) -> Maxwell:  # fmt: skip
        """Add a Maxwell (relaxation) element: a spring in series with a damper along the line between two points.

        Its dynamic stiffness is k0 + k1 c s / (k1 + c s). The node between spring and damper has no mass, real or fake:
        the elongation of the damper is the coordinate ``"NAME.z"``, which has one first-order state.

        Parameters
        ----------
        name : str
            Name, unique among bodies, joints, bushings and springs.
        first, second : str or Body
            The two bodies.
        start, end : array-like, shape (3,)
            The point on ``first``, where the spring is, and the one on ``second``, where the damper is [m], world axes.
        stiffness : float, above 0
            Of the spring in series with the damper, k1 [N/m], positive.
        damping : float, at least 0
            Of the damper, c [N s/m].
        static_stiffness : float
            Of a spring in parallel with both, k0 [N/m].
        preload : float, optional
            Tension of that spring in the given pose [N]; the one in series carries nothing at rest.

        Returns
        -------
        Maxwell
            The part.

        Raises
        ------
        ModelError
            If a body is unknown, the points coincide, or a coefficient is refused.
        """
        a, b = self._between("maxwell", name, first, second)
        part = _maxwell.make(name, a, b, start, end, stiffness, damping, static_stiffness, preload)
        return self._keep_with_nodes(part)

    def add_inerter(
        self, name: str, first: str | Body, second: str | Body, start: ArrayLike, end: ArrayLike, inertance: float
    ) -> Inerter:
        """Add an inerter: a force along the line between two points in proportion to their relative acceleration.

        Parameters
        ----------
        name : str
            Name, unique among bodies, joints, bushings and springs.
        first, second : str or Body
            The two bodies.
        start, end : array-like, shape (3,)
            The point on ``first`` and the one on ``second`` [m], world axes.
        inertance : float, above 0
            Force per relative acceleration [kg], positive.

        Returns
        -------
        Inerter
            The part.

        Raises
        ------
        ModelError
            If a body is unknown, the points coincide, or the inertance is not positive.
        """
        a, b = self._between("inerter", name, first, second)
        return self._keep(self._springs, _inerter.make(name, a, b, start, end, inertance))

    def add_torsion_spring(
        self, name: str, first: str | Body, second: str | Body, axis: ArrayLike, stiffness: float = 0.0,
        damping: float = 0.0, preload: float | None = None, *, dynamic: Dynamic | Mapping[str, Any] | None = None,
    ) -> TorsionSpring | DynamicTorsionSpring:  # fmt: skip
        """Add a torsion spring-damper about one axis, which ``first`` carries; it takes no force.

        Parameters
        ----------
        name : str
            Name, unique among bodies, joints, bushings and springs.
        first, second : str or Body
            The two bodies.
        axis : array-like, shape (3,)
            The axis, world axes; its length does not matter.
        stiffness, damping : float
            Of the twist of ``second`` against ``first`` about the axis [N m/rad], and of its rate [N m s/rad].
        preload : float, optional
            Moment about the axis on ``second`` in the given pose [N m]; ``first`` takes its reaction.
        dynamic : Dynamic or mapping, optional
            How the stiffness depends on frequency, as that of a bushing (``add_bushing``), with the first-order state
            ``"NAME.k.rz"`` and the parameters ``NAME.gk`` and ``NAME.tauk`` [s] of each relaxation k.

        Returns
        -------
        TorsionSpring or DynamicTorsionSpring
            The part.

        Raises
        ------
        ModelError
            If a body is unknown, the axis is zero, neither stiffness, damping nor preload is given, or ``dynamic`` has
            no states or no positive stiffness.
        """
        a, b = self._between("torsion spring", name, first, second)
        return self._keep_with_nodes(_dynamic_torsion.make(name, a, b, axis, stiffness, damping, preload, dynamic))
