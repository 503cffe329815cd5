"""The calls that add couplers: gears, worms, racks and other linear relations of joint coordinates."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsvib.elements import coupler as _coupler
from mbsvib.mechanism.mechanism import Mechanism

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mbsvib.elements import Joint
    from mbsvib.elements.coupler import Coupler, Gear, Rack, Worm


class CoupledMechanism(Mechanism):
    """A mechanism whose joint coordinates may be coupled."""

    def add_coupler(
        self, name: str, coefficients: Mapping[str, float], curvature: Mapping[str, float] | None = None
    ) -> Coupler:
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
        part = _coupler.make_coupler(name, coefficients, curvature, self._joints)
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
