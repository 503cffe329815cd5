"""Spinning mechanisms: the call that adds rotors."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

from mbsvib.elements import rotor as _rotor
from mbsvib.mechanism.mechanism import Mechanism

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from mbsvib.elements import Body
    from mbsvib.elements.rotor import Rotor


class SpinningMechanism(Mechanism):
    """A mechanism on whose bodies something may spin."""

    @property
    def rotors(self) -> Mapping[str, Rotor]:
        """Rotors by name, in the order in which they were added."""
        return MappingProxyType(self._rotors)

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
        inertia : float, optional
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
        self._rotors[name] = part
        return part
