"""The mechanism with elements that relax, each checked when it is added."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mbsvib.elements import maxwell as _maxwell
from mbsvib.mechanism.mechanism import Mechanism

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from mbsvib.elements import Body, Maxwell


class RelaxingMechanism(Mechanism):
    """A mechanism with springs in series with dampers."""

    def add_maxwell(
        self, name: str, first: str | Body, second: str | Body, start: ArrayLike, end: ArrayLike, stiffness: float,
        damping: float, static_stiffness: float = 0.0,
    ) -> Maxwell:  # fmt: skip
        """Add a Maxwell (relaxation) element: a spring in series with a damper along the line between two points.

        Its dynamic stiffness is k0 + k1 c s / (k1 + c s). The node between spring and damper has no mass, real or fake:
        what the damper yields is the coordinate ``"NAME.z"``, which has one first-order state.

        Parameters
        ----------
        name : str
            Name, unique among bodies, joints, bushings and springs.
        first, second : str or Body
            The two bodies.
        start, end : array-like, shape (3,)
            The point on ``first``, where the spring is, and the one on ``second``, where the damper is [m], world axes.
        stiffness : float
            Of the spring in series with the damper, k1 [N/m], positive.
        damping : float
            Of the damper, c [N s/m].
        static_stiffness : float
            Of a spring beside both, k0 [N/m].

        Returns
        -------
        Maxwell
            The part.

        Raises
        ------
        ModelError
            If a body is unknown, the points coincide, or a coefficient is refused.
        """
        self._check_name(name, "maxwell")
        a = self._body_name(first, "maxwell", name, "first")
        b = self._body_name(second, "maxwell", name, "second")
        part = _maxwell.make(name, a, b, start, end, stiffness, damping, static_stiffness)
        self._check_name(part.node, f"maxwell '{name}': node")
        springs: dict[str, Any] = self._springs
        springs[name] = part
        self._made[part.node] = part
        return part
