"""The call that adds another model as a part."""

from __future__ import annotations

import warnings
from typing import Any

from numpy.typing import ArrayLike

from mbsvib.common import arguments as check
from mbsvib.elements import Body
from mbsvib.errors import LeftOutWarning
from mbsvib.mechanism.copies import copies, placement
from mbsvib.mechanism.mechanism import GROUND, Mechanism
from mbsvib.mechanism.names import check_name

OWN_NAMES = ("inputs", "outputs")


class NestedMechanism(Mechanism):
    """A mechanism to which others are added as parts."""

    def add_model(
        self, name: str, other: Mechanism, position: ArrayLike = (0.0, 0.0, 0.0),
        orientation: ArrayLike | None = None, ground: str | Body = GROUND, mirror: str | None = None,
    ) -> tuple[str, ...]:  # fmt: skip
        """Add a copy of all parts of another model, in another place and mirrored if asked for.

        x -> position + R F x for points and forces, det(F) R F w for moments, rotations and spins

        A part is called ``"NAME.PART"``; so are inputs, outputs and coordinates, such as ``"left.pivot.rz"``, and
        parameters, of which patterns (``"*.strut.stiffness"``) pick those of all copies. All positions and directions
        turn along, also those of inputs, outputs, loads and preloads. Later changes of ``other`` do not reach the copy.
        Gravity is that of this model.

        Mirrored parts move as in a mirror when their inputs and outputs, also of torques and rotations, have the values
        of the original. Coordinates of joints are positive along mirrored axes, so that rotations change their sign,
        and so does the ratio of couplers between a rotation and a translation. The pitch of screws changes its sign.
        Three rotations cannot all change it in right-handed axes: of spherical, planar and free joints one axis is
        reversed, z where the joint turns about all three.

        Parameters
        ----------
        name : str
            What the names of the copies begin with; it may itself have several words, ``"front.left"``.
        other : Model
            The other model; models that it was made of are part of it.
        position : array-like, shape (3,)
            Where its origin is to be [m], world axes.
        orientation : array-like, shape (3, 3) or (3,), optional
            Where its axes are to point, as columns, or a rotation vector [rad]; default: world axes.
        ground : str or Body
            The body of this model that takes the place of its ground, which it then moves with: outputs are relative to
            that body but for those with ``absolute=True``.
        mirror : str, optional
            "x", "y" or "z": reflect it first, x -> -x for "x", in its own axes.

        Returns
        -------
        tuple of str
            The names of all parts added.

        Raises
        ------
        ModelError
            If a name is taken, a value is refused, or a part cannot be on ``ground``: base motions and sums of forces
            on the ground, where that is a body. Nothing is added then.

        Warns
        -----
        LeftOutWarning
            If the gravity of ``other``, or the travel of its rolling wheels, is not that of this model.
        """
        if not isinstance(other, Mechanism):
            raise check.refuse(f"model '{name}'", "other", other, "a Model")
        base = self._body_name(ground, "model", name, "ground")
        groups = copies(other, placement(name, other, position, orientation, base, mirror))
        for key, parts in groups.items():
            for part in parts:
                self._check_new(key, part)
        if other.gravity not in (None, self.gravity):
            warnings.warn(f"model '{name}': it was described under gravity = {other.gravity}, which is left out; that "
                          f"of model '{self.name}', {self.gravity}, acts on it.", LeftOutWarning, stacklevel=2)
        if other.rolling and other.travel not in (None, self.travel):
            warnings.warn(f"model '{name}': it was described at travel = {other.travel}, which is left out; that of "
                          f"model '{self.name}' is {self.travel}.", LeftOutWarning, stacklevel=2)
        for key, parts in groups.items():
            for part in parts:
                self._take(key, part)
        return tuple([part.name for parts in groups.values() for part in parts])

    def _check_new(self, key: str, part: Any) -> None:
        """Refuse a part whose names are taken."""
        if key in OWN_NAMES:
            return check_name(part.name, part.family, self._group(key))
        for new in (part.name, *_generated(key, part)):
            self._check_name(new, part.family)
        return None

    def _take(self, key: str, part: Any) -> None:
        """Add a part that is checked to its group, with the names that it generates."""
        if key == "composed":
            self._reserve_names(part)
        elif key == "springs":
            self._generated |= dict.fromkeys(_generated(key, part), part)
        self._keep(self._group(key), part)


def _generated(key: str, part: Any) -> tuple[str, ...]:
    """Names of what a beam, superelement or Maxwell element adds to the model."""
    return part.generated_names if key in ("composed", "springs") else ()
