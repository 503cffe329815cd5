"""The mechanism under load: gravity and forces on bodies, each checked when it is added."""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from mbsvib.common import arguments as check
from mbsvib.elements import load as _load
from mbsvib.mechanism.mechanism import Mechanism, check_name

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike

    from mbsvib.elements import Body, Load
    from mbsvib.equations.second_order_rows import Felt
    from mbsvib.equations.wrenches import Applied


class LoadedMechanism(Mechanism):
    """A mechanism with what loads it; preloads of springs and bushings are words of their own adders.

    Parameters
    ----------
    name : str
        Name of the mechanism, used in titles and files.
    gravity : array-like, shape (3,), optional
        Acceleration of free fall [m/s^2], world axes; default: none.

    Raises
    ------
    ModelError
        If the name is no text or gravity no vector.
    """

    def __init__(self, name: str, gravity: ArrayLike | None = None) -> None:
        super().__init__(name)
        expected = "None, or the acceleration of free fall (x, y, z) [m/s^2], such as (0, 0, -9.81)"
        self.gravity = None if gravity is None else check.vector(gravity, "model", "gravity", expected)
        self._loads: dict[str, Load] = {}
        # its loads in numbers, and the parts they were made of
        self._loading: tuple[tuple[Any, ...], tuple[Applied, Felt, dict[str, Any]]] | None = None

    @property
    def _falling(self) -> tuple[_load.Gravity, ...]:
        """Gravity as a part that has parameters, where it is given and nothing else has its name."""
        groups = (self._bodies, self._composed, self._joints, self._springs, self._couplers, self._rotors, self._loads)
        if self.gravity is None or any("gravity" in group for group in groups):
            return ()
        return (_load.Gravity("gravity", self.gravity),)

    @property
    def loads(self) -> Mapping[str, Load]:
        """Forces and torques on bodies by name, in the order in which they were added."""
        return MappingProxyType(self._loads)

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
        self._loads[name] = part
        return part

    def _check_name(self, name: str, what: str) -> None:
        check_name(name, what, self._loads)
        super()._check_name(name, what)
