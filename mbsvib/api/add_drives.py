"""The calls that add couplers (gears, worms, racks, other linear relations) and drives of several parts: ball screws,
belts and pairs of gears.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import pi
from typing import Any

from numpy.typing import ArrayLike

from mbsvib.api.add_parts import RigidMechanism
from mbsvib.common import arguments as check
from mbsvib.elements import Body, Joint
from mbsvib.elements import coupler as _coupler
from mbsvib.elements.coupler import Coupler, Gear, Rack, Worm
from mbsvib.mechanism.mechanism import Mechanism


class CoupledMechanism(Mechanism):
    """A mechanism whose joint coordinates may be coupled."""

    def add_coupler(
        self, name: str, coefficients: Mapping[str, float], curvature: Mapping[str, float] | None = None,
        rates: bool = False,
    ) -> Coupler:  # fmt: skip
        """Add a relation between joint coordinates, linear unless it has a curvature.

        sum of coefficient_i q_i = 0

        Parameters
        ----------
        name : str
            Name, unique among bodies, joints, springs, bushings and couplers.
        coefficients : mapping of str to float
            A coefficient for each of two or more joint coordinates, ``{"knee.rz": 1.0, "hip.rz": -2.0}``; of a joint
            with a single coordinate the direction may be left out. Rotations are in rad, translations in m.
        curvature : mapping of str to float, optional
            Of a relation that is not linear and is known to second order at the pose as described only: second
            derivatives h_k by coordinates, sum of coefficient_i q_i + sum of h_k q_k^2 / 2 = 0. They make stiffness of
            the coupler's force at rest. Other poses and runs, and loads in sparse equations, are refused.
        rates : bool
            True: a relation of velocities in each pose, sum of coefficient_i v_i = 0, in which the velocity of a
            component of a rotation vector is the angular velocity along the joint's axis in that pose. Default: of
            displacements from the pose as described, which is refused in poses across that component.

        Returns
        -------
        Coupler
            The part.

        Raises
        ------
        ModelError
            If a coordinate is unknown, a coefficient is zero, or there are fewer than two.
        """
        self._check_name(name, "coupler")
        part = _coupler.make_coupler(name, coefficients, curvature, rates, self._joints)
        return self._keep(self._couplers, part)

    def add_gear(self, name: str, first: str | Joint, second: str | Joint, ratio: float) -> Gear:
        """Add a pair of gears: the rotations of two joints in a fixed ratio.

        q_second = ratio q_first

        Parameters
        ----------
        name : str
            Name, unique among bodies, joints, springs, bushings and couplers.
        first, second : str or Joint
            The joints, or their coordinates as ``"shaft.rz"`` where they have several rotations.
        ratio : float
            Turns of ``second`` per turn of ``first``, each about its own axis, its second body against its first
            [rad/rad]. Two spur gears on parallel axes that mesh outside: -(teeth of first) / (teeth of second).

        Returns
        -------
        Gear
            The part.

        Raises
        ------
        ModelError
            If a joint is unknown or has no rotation, or the ratio is zero.
        """
        self._check_name(name, "gear")
        part = _coupler.make_gear(name, first, second, ratio, self._joints)
        return self._keep(self._couplers, part)

    def add_worm(self, name: str, worm: str | Joint, wheel: str | Joint, ratio: float) -> Worm:
        """Add a worm and its wheel.

        q_wheel = ratio q_worm

        Parameters
        ----------
        name : str
            Name, unique among bodies, joints, springs, bushings and couplers.
        worm, wheel : str or Joint
            The joints on which they turn, or their coordinates as ``"shaft.rz"``.
        ratio : float
            Turns of the wheel per turn of the worm [rad/rad]: starts / teeth; the sign follows from the hand of the
            thread and the directions of both axes. There is no friction, and therefore no self-locking.

        Returns
        -------
        Worm
            The part.

        Raises
        ------
        ModelError
            If a joint is unknown or has no rotation, or the ratio is zero.
        """
        self._check_name(name, "worm")
        part = _coupler.make_worm(name, worm, wheel, ratio, self._joints)
        return self._keep(self._couplers, part)

    def add_rack(self, name: str, pinion: str | Joint, rack: str | Joint, radius: float) -> Rack:
        """Add a pinion and its rack.

        q_rack = radius q_pinion

        Parameters
        ----------
        name : str
            Name, unique among bodies, joints, springs, bushings and couplers.
        pinion, rack : str or Joint
            The joint on which the pinion turns and the one along which the rack slides, or their coordinates.
        radius : float
            Pitch radius of the pinion [m], the advance per radian; negative where the rack goes against its axis as the
            pinion turns about its own.

        Returns
        -------
        Rack
            The part.

        Raises
        ------
        ModelError
            If a joint is unknown, the one has no rotation or the other no translation, or the radius is zero.
        """
        self._check_name(name, "rack")
        part = _coupler.make_rack(name, pinion, rack, radius, self._joints)
        return self._keep(self._couplers, part)


POINT = (0.0, 0.0, 0.0)
WEIGHTLESS = (0.0, 0.0, 0.0)


class DrivenMechanism(RigidMechanism, CoupledMechanism):
    """A mechanism with drives, which are joints, couplers, springs and bodies without mass."""

    def add_ball_screw(
        self, name: str, base: str | Body, screw: str | Body, nut: str | Body, position: ArrayLike, axis: ArrayLike,
        lead: float, stiffness: float = 0.0, damping: float = 0.0,
    ) -> tuple[str, ...]:  # fmt: skip
        """Add a ball screw: a screw that turns in a base, and a nut that slides along it and does not turn.

        x = lead phi / (2 pi), or with the stiffness k the force k (lead phi / (2 pi) - x) on the nut

        It is made of the revolute joint ``NAME.bearing``, with the coordinate phi = ``NAME.bearing.rz``, the prismatic
        joint ``NAME.guide``, with x = ``NAME.guide.z``, and the rack ``NAME.thread`` between both. With a stiffness the
        rack drives the body without mass ``NAME.nut`` instead, on the prismatic joint ``NAME.travel``, which the
        bushing ``NAME.axial`` joins to the nut; its z is the axis, so that its parameter is
        ``NAME.axial.stiffness.z``.

        Parameters
        ----------
        name : str
            What the names of its parts begin with.
        base : str or Body
            The body in which the screw turns and on which the nut is guided.
        screw : str or Body
            The body that turns, with the motor's rotor if that is fixed to it.
        nut : str or Body
            The body that slides, such as the table.
        position : array-like, shape (3,)
            A point on the axis [m], world axes.
        axis : array-like, shape (3,)
            The axis, world axes.
        lead : float
            Advance of the nut along the axis per turn of the screw about it [m]; negative if it goes against the axis.
        stiffness : float, at least 0
            Axial stiffness of nut, screw and bearing in series [N/m]; 0: rigid.
        damping : float, at least 0
            Damping parallel to it [N s/m]; needs a stiffness.

        Returns
        -------
        tuple of str
            The names of its parts.

        Raises
        ------
        ModelError
            If a name is taken, a body is unknown, the lead is zero, or the stiffness or damping is negative.
        """
        who = f"ball screw '{name}'"
        fixed, turning, sliding = self._bodies_of(who, base=base, screw=screw, nut=nut)
        advance = check.not_zero(lead, who, "lead", "the advance per turn [m]") / (2.0 * pi)
        k, c = _compliance(who, stiffness, damping)
        names = _names(name, ("bearing", "guide", "thread"), ("nut", "travel", "axial") if k else ())
        self._reserve(who, names)
        point, direction = check.vector(position, who, "position"), check.axis(axis, who, "axis")
        self.add_joint(f"{name}.bearing", "revolute", fixed, turning, point, axis=direction)
        self.add_joint(f"{name}.guide", "prismatic", fixed, sliding, point, axis=direction)
        driven = f"{name}.guide"
        if k:
            driven = self._slider(f"{name}.nut", f"{name}.travel", fixed, point, direction)
            self._axial(f"{name}.axial", f"{name}.nut", sliding, point, direction, k, c)
        self.add_rack(f"{name}.thread", f"{name}.bearing", driven, advance)
        return names

    def add_belt(
        self, name: str, base: str | Body, first: str | Body, second: str | Body, start: ArrayLike, end: ArrayLike,
        axis: ArrayLike, first_radius: float, second_radius: float, stiffness: float = 0.0, damping: float = 0.0,
        crossed: bool = False,
    ) -> tuple[str, ...]:  # fmt: skip
        """Add a belt or chain over two pulleys on parallel axes of one base.

        r_2 phi_2 = r_1 phi_1, or with the stiffness k the tension k (r_1 phi_1 - r_2 phi_2) between its runs

        The pulleys turn on the revolute joints ``NAME.first`` and ``NAME.second``; the gear ``NAME.belt`` couples them.
        With a stiffness the racks ``NAME.drive`` and ``NAME.driven`` pull the bodies without mass ``NAME.run`` and
        ``NAME.rim`` along ``start`` to ``end`` instead, on the prismatic joints ``NAME.pull`` and ``NAME.take``, and
        the bushing ``NAME.belt`` between them has the parameter ``NAME.belt.stiffness.z``. A tension in the belt at
        rest is within the base and has no effect.

        Parameters
        ----------
        name : str
            What the names of its parts begin with.
        base : str or Body
            The body in which both pulleys turn.
        first, second : str or Body
            The pulleys, or what turns with them.
        start, end : array-like, shape (3,)
            A point on the axis of the first and of the second pulley [m], world axes.
        axis : array-like, shape (3,)
            The direction of both axes, world axes.
        first_radius, second_radius : float, above 0
            Pitch radii [m].
        stiffness : float, at least 0
            Force between both rims per travel, of both runs together [N/m]: 2 E A / L of runs of the length L whose
            tension never ends; 0: rigid.
        damping : float, at least 0
            Damping parallel to it [N s/m]; needs a stiffness.
        crossed : bool
            Whether it crosses itself, so that the pulleys turn against each other.

        Returns
        -------
        tuple of str
            The names of its parts.

        Raises
        ------
        ModelError
            If a name is taken, a body is unknown, a radius is not positive, the stiffness or damping is negative, or
            both axes are the same line.
        """
        who = f"belt '{name}'"
        fixed, driver, driven = self._bodies_of(who, base=base, first=first, second=second)
        r, r2 = (check.above_zero(value, who, word, "a pitch radius [m], above zero") for value, word in (
            (first_radius, "first_radius"), (second_radius, "second_radius")))  # fmt: skip
        k, c = _compliance(who, stiffness, damping)
        if type(crossed) is not bool:
            raise check.refuse(who, "crossed", crossed, "True or False")
        compliant = ("run", "rim", "pull", "take", "drive", "driven") if k else ()
        names = _names(name, ("first", "second", "belt"), compliant)
        self._reserve(who, names)
        a, b, direction, along = _parallel_axes(who, start, end, axis)
        sense = -1.0 if crossed else 1.0
        self.add_joint(f"{name}.first", "revolute", fixed, driver, a, axis=direction)
        self.add_joint(f"{name}.second", "revolute", fixed, driven, b, axis=direction)
        if not k:
            self.add_gear(f"{name}.belt", f"{name}.first", f"{name}.second", sense * r / r2)
            return names
        pull = self._slider(f"{name}.run", f"{name}.pull", fixed, a, along)
        take = self._slider(f"{name}.rim", f"{name}.take", fixed, a, along)
        self.add_rack(f"{name}.drive", f"{name}.first", pull, r)
        self.add_rack(f"{name}.driven", f"{name}.second", take, sense * r2)
        self._axial(f"{name}.belt", f"{name}.run", f"{name}.rim", a, along, k, c)
        return names

    def add_gear_pair(
        self, name: str, base: str | Body, first: str | Body, second: str | Body, start: ArrayLike, end: ArrayLike,
        axis: ArrayLike, ratio: float, axis2: ArrayLike | None = None,
    ) -> tuple[str, ...]:  # fmt: skip
        """Add a pair of gears that turn in one base.

        phi_2 = ratio phi_1

        The gears turn on the revolute joints ``NAME.first`` and ``NAME.second``, which the gear ``NAME.mesh`` couples.

        Parameters
        ----------
        name : str
            What the names of its parts begin with.
        base : str or Body
            The body in which both turn: the housing, or the carrier of a planet.
        first, second : str or Body
            The gears, or what turns with them.
        start, end : array-like, shape (3,)
            A point on the axis of the first and of the second gear [m], world axes.
        axis : array-like, shape (3,)
            The axis of the first, world axes.
        ratio : float
            Turns of ``second`` per turn of ``first``, each about its own axis [rad/rad]. Spur gears that mesh outside:
            -(teeth of first) / (teeth of second).
        axis2 : array-like, shape (3,), optional
            The axis of the second, of bevel gears for instance; default: parallel to the first.

        Returns
        -------
        tuple of str
            The names of its parts.

        Raises
        ------
        ModelError
            If a name is taken, a body is unknown, an axis is zero, or the ratio is zero.
        """
        who = f"gear pair '{name}'"
        fixed, driver, driven = self._bodies_of(who, base=base, first=first, second=second)
        factor = check.not_zero(ratio, who, "ratio", "turns of second per turn of first")
        names = _names(name, ("first", "second", "mesh"))
        self._reserve(who, names)
        a, b = check.vector(start, who, "start"), check.vector(end, who, "end")
        direction = check.axis(axis, who, "axis")
        other = direction if axis2 is None else check.axis(axis2, who, "axis2")
        self.add_joint(f"{name}.first", "revolute", fixed, driver, a, axis=direction)
        self.add_joint(f"{name}.second", "revolute", fixed, driven, b, axis=other)
        self.add_gear(f"{name}.mesh", f"{name}.first", f"{name}.second", factor)
        return names

    def _bodies_of(self, who: str, **bodies: Any) -> list[str]:
        """Names of three different bodies."""
        family, _, name = who.partition(" '")
        names = [self._body_name(body, family, name[:-1], field) for field, body in bodies.items()]
        for i, (field, key) in enumerate(zip(bodies, names, strict=True)):
            if key in names[:i]:
                raise check.refuse(who, field, key, f"another body for each of {', '.join(bodies)}")
        return names

    def _reserve(self, who: str, names: tuple[str, ...]) -> None:
        """Refuse names that are taken before anything is added."""
        for name in names:
            self._check_name(name, f"{who}: part")

    def _slider(self, body: str, joint: str, base: str, point: Any, axis: Any) -> str:
        """Add a body without mass that slides along an axis of the base, and return the name of its joint."""
        self.add_body(body, 0.0, WEIGHTLESS, point)
        self.add_joint(joint, "prismatic", base, body, point, axis=axis)
        return joint

    def _axial(self, name: str, first: str, second: str, point: Any, axis: Any, k: float, c: float) -> None:
        """Add a bushing whose only direction with stiffness and damping is the axis, its z."""
        self.add_bushing(name, first, second, point, (0.0, 0.0, k, 0.0, 0.0, 0.0), (0.0, 0.0, c, 0.0, 0.0, 0.0),
                         check.frame_along(axis))  # fmt: skip


def _names(name: str, always: tuple[str, ...], compliant: tuple[str, ...] = ()) -> tuple[str, ...]:
    return tuple([f"{name}.{part}" for part in (*always, *compliant)])


def _compliance(who: str, stiffness: Any, damping: Any) -> tuple[float, float]:
    """Checked stiffness and damping; a damper alone would let the drive slip."""
    k, c = check.number(stiffness, who, "stiffness"), check.number(damping, who, "damping")
    for field, value in (("stiffness", k), ("damping", c)):
        if value < 0.0:
            raise check.refuse(who, field, value, "a number that is not negative")
    if c and not k:
        raise check.refuse(who, "damping", c, "a stiffness with it", "A rigid drive has none.")
    return k, c


def _parallel_axes(who: str, start: Any, end: Any, axis: Any) -> tuple[Any, Any, Any, Any]:
    """Points on two parallel axes, their direction, and the unit vector across from the first to the second."""
    a, b, z = check.vector(start, who, "start"), check.vector(end, who, "end"), check.axis(axis, who, "axis")
    line = [q - p for p, q in zip(a, b, strict=True)]
    height = sum(p * q for p, q in zip(line, z, strict=True))
    across = [p - height * q for p, q in zip(line, z, strict=True)]
    size = max(map(abs, (*a, *b)))
    if max(map(abs, across)) <= check.ROUNDED * size:
        raise check.refuse(who, "end", end, f"a point off the axis through start = {a}")
    return a, b, z, check.axis(across, who, "end")
