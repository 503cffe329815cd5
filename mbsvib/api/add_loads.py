"""The calls that add loads, rotors, hubs and rolling wheels."""

from __future__ import annotations

from numpy.typing import ArrayLike

from mbsvib.elements import Body, Load
from mbsvib.elements import hub as _hub
from mbsvib.elements import load as _load
from mbsvib.elements import rolling as _rolling
from mbsvib.elements import rotor as _rotor
from mbsvib.elements.hub import Hub
from mbsvib.elements.rolling import Rolling
from mbsvib.elements.rotor import Rotor
from mbsvib.mechanism.mechanism import Mechanism


class LoadedMechanism(Mechanism):
    """A mechanism with what loads it, spins or rolls; preloads of springs and bushings are words of their own calls."""

    def add_load(
        self, name: str, body: str | Body, force: ArrayLike = _load.NONE, torque: ArrayLike = _load.NONE,
        position: ArrayLike | None = None, follower: bool = False,
    ) -> Load:  # fmt: skip
        """Add a constant force and torque on a body; the pose must be in balance with it.

        Parameters
        ----------
        name : str
            Name, unique among bodies, joints, bushings, springs and loads.
        body : str or Body
            The body it acts on.
        force : array-like, shape (3,)
            Force [N], world axes.
        torque : array-like, shape (3,)
            Torque [N m], world axes.
        position : array-like, shape (3,), optional
            The point of the body at which the force acts [m], world axes; default: its centre of mass.
        follower : bool
            False: force and torque stay fixed in the world. True: they turn with the body. A follower load, and a
            torque of either kind, may feed energy into a motion: it makes K unsymmetric.

        Returns
        -------
        Load
            The part.

        Raises
        ------
        ModelError
            If the body is unknown or ground, or neither force nor torque is given.
        """
        self._check_name(name, "load")
        part = _load.make(name, self._body_name(body, "load", name, "body"), force, torque, position, follower)
        return self._keep(self._loads, part)

    def add_hub(self, name: str, speed: float, axis: ArrayLike, position: ArrayLike = (0.0, 0.0, 0.0)) -> Hub:
        """Add a hub: a body that turns steadily with all that is on it, which is linearized in its rotating frame.

        M q'' + (C + G) q' + (K + K_c + K_g) q = B u: G are Coriolis and gyroscopic terms, K_c is the centrifugal
        stiffness, and K_g follows from the forces at rest under the centrifugal ones, such as the tension of a blade.

        All bodies, beams and flexures turn with it that joints, springs, bushings and these connect with it, not over
        the ground; they are described as they stand at rest in its frame, whose axes are those of the world at one
        moment. Forces, displacements, velocities and accelerations at ports are those in this frame. The hub has no
        mass of its own and does not give way: what drives it keeps its speed. ``simulate`` runs in the same frame; the
        centrifugal potential is part of its potential energy, 0 as described.

        Parameters
        ----------
        name : str
            Name, unique among bodies, joints, bushings and springs; other calls take it as that of a body.
        speed : float
            Speed [rad/s], right-handed about the axis.
        axis : array-like, shape (3,)
            Axis, world axes; its length does not matter.
        position : array-like, shape (3,)
            A point of the axis [m], world axes.

        Returns
        -------
        Hub
            The part, which other calls accept in place of its name.

        Raises
        ------
        ModelError
            If the name is taken, the speed is not a number, or the axis is zero. ``linearize`` refuses by name what
            would make the equations vary with time: gravity and loads that do not act along the axis, joints and
            springs between the ground and what turns, motion of the ground; and sums of forces on the ground.
        """
        self._check_name(name, "hub")
        return self._keep(self._bodies, _hub.make(name, speed, axis, position))

    def add_rotor(
        self, name: str, body: str | Body, speed: float, axis: ArrayLike, inertia: float | None = None
    ) -> Rotor:
        """Add a rotor: a constant angular momentum h = inertia speed axis, which adds -[h]x to C's rotations of a body.

        With ``inertia`` it is a wheel, disk or shaft that spins on the body, whose mass and tensor include it; the body
        itself does not turn. Without, the body itself spins about an axis through its centre of mass: its tensor must
        be symmetric about that axis, what joins it must let it spin, and what spins along with it (at the same speed
        about the same line) feels dampers between both as they turn, which makes K unsymmetric. Coordinates are those
        of axes that do not spin. A steady spin adds no stiffness: the axis is held, and all is symmetric about it.

        Parameters
        ----------
        name : str
            Name, unique among bodies, joints, bushings, springs and rotors.
        body : str or Body
            The body that carries it, or spins; a body may carry several.
        speed : float
            Speed [rad/s], right-handed about the axis.
        axis : array-like, shape (3,)
            Axis, world axes; its length does not matter.
        inertia : float, above 0, optional
            Its moment about the axis [kg m^2]; default: the body itself spins.

        Returns
        -------
        Rotor
            The part.

        Raises
        ------
        ModelError
            If the name is taken, the body is unknown or ground, the axis is zero, or the inertia is not positive.
        """
        self._check_name(name, "rotor")
        part = _rotor.make(name, self._body_name(body, "rotor", name, "body"), speed, axis, inertia)
        return self._keep(self._rotors, part)

    def add_rolling(
        self, name: str, body: str | Body, radius: float, axis: ArrayLike, normal: ArrayLike = (0.0, 0.0, 1.0)
    ) -> Rolling:
        """Add a wheel that rolls without slip on a plane of the ground: its edge is a circle, as sharp as a knife.

        The point of the edge that touches the plane has no velocity,

        v + w x r = 0,  r = -radius (n - (n.a) a) / |n - (n.a) a|,

        with the velocity v of the body's centre of mass, its angular velocity w, its axis a and the normal n. In the
        steady motion, ``travel`` of the model, the wheel spins at |travel| / radius, and forces at the contacts hold
        the loads. ``linearize`` then returns a ``RollingSystem``: first-order equations of deviations from that motion.
        The condition along the normal ties positions; the other two tie speeds only (they are nonholonomic), so that
        there are fewer independent speeds than coordinates. All that is fixed to the ground otherwise, by joints and
        springs, travels along: it is held by a car that tows, or the road is a belt that moves under a stand.

        Parameters
        ----------
        name : str
            Name, unique among bodies, joints, bushings, springs and rolling wheels.
        body : str or Body
            The wheel, axisymmetric about the axis through its centre of mass. It spins by itself: add no rotor.
        radius : float, above 0
            Radius of the edge [m].
        axis : array-like, shape (3,)
            Axis of the wheel, world axes; either sense.
        normal : array-like, shape (3,)
            Normal of the plane on the side of the wheel, world axes; the plane is where the wheel touches it.

        Returns
        -------
        Rolling
            The part.

        Raises
        ------
        ModelError
            If the name is taken, the body is unknown or ground, the radius is not positive, or the wheel lies flat.

        Source: Meijaard, Papadopoulos, Ruina & Schwab, Proc. R. Soc. A 463 (2007) 1955-1982.
        """
        self._check_name(name, "rolling wheel")
        part = _rolling.make(name, self._body_name(body, "rolling wheel", name, "body"), radius, axis, normal)
        return self._keep(self._rolling, part)
