"""What a model can do about its pose."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from mbsvib.model import Model


class Posed:
    """Methods of ``Model`` that lead to other poses."""

    def moved(
        self, values: Mapping[str, float], *, relaxed: bool = False, cut: Sequence[str] | None = None
    ) -> Model:
        """Return a new model in another pose: joints moved by finite amounts, loops closed.

        Everything that belongs to a body goes with it: joints and their axes, ends of springs, points of inputs,
        outputs and loads, and follower loads turn with it. The directions of inputs and outputs stay as they are in the
        world. Springs and bushings get the preload that the motion gives them.

        Parameters
        ----------
        values : mapping of str to float
            How far joint coordinates (``"knee.rz"``) move from where they are [m, rad]. The other coordinates stay
            where they are, but for those that loops tie to these. Three free rotations are one rotation vector.
        relaxed : bool
            True: springs and bushings keep the forces that they have here, as if they were mounted in the new pose.
        cut : sequence of str, optional
            Joints at which loops are to be cut; default: none of those that are moved.

        Returns
        -------
        Model
            The model in that pose; this one stays as it is.

        Raises
        ------
        ModelError
            If a coordinate is unknown or tied to the others, or the loops cannot be closed in that pose.
        """
        from mbsvib.equilibrium.moved import moved

        return moved(cast("Model", self), values, relaxed, cut)
