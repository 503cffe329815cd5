"""The call that adds rolling wheels."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsvib.elements import rolling as _rolling
from mbsvib.mechanism.mechanism import Mechanism

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from mbsvib.elements import Body
    from mbsvib.elements.rolling import Rolling


class RollingMechanism(Mechanism):
    """A mechanism on wheels that roll on the ground."""

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
