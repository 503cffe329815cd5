"""Other poses and equilibrium: methods of models, and poses as arrays of displacements."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, Self, cast, overload

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array
from mbsvib.common.expected import reals
from mbsvib.elements import Bushing, Spring
from mbsvib.equilibrium.articulation import with_preloads_of, with_rigid_parts
from mbsvib.equilibrium.moved import moved
from mbsvib.equilibrium.moved_parts import check_couplers
from mbsvib.equilibrium.posed_variants import pose_coordinates
from mbsvib.errors import EquilibriumError, MbsvibError, ModelError, SingularPoseError, UnreachableError
from mbsvib.mechanism.mechanism import Mechanism

if TYPE_CHECKING:
    from mbsvib.api.batch import Batch
    from mbsvib.api.plant import Plant
    from mbsvib.equilibrium.equilibrium_path import EquilibriumPath
    from mbsvib.equilibrium.report import Equilibrium

Preloaded = Sequence[str | Spring | Bushing] | str | bool


class Posed(Mechanism):
    """Methods of ``Model`` that lead to other poses."""

    def aligned(self, tolerance: float) -> Self:
        """Return a new model in which axes of loops that are meant to be aligned are so; bodies do not move.

        In loops that gain degrees of freedom by it, and nowhere else, axes that are nearly parallel take their mean
        direction, those nearly on one line their mean line, those nearly through one point that point. Nothing else
        changes by a bit. ``linearize(align=...)`` is the same in one step; ``moved``, ``equilibrium``, ``family`` and
        ``simulate`` are methods of the result.

        Parameters
        ----------
        tolerance : float
            Largest angle of an axis from the mean [rad], at most 0.05; largest distance of an axis from a common line
            or point, as a share of the largest distance between joints of the loops.

        Returns
        -------
        Model
            The model with axes aligned, named in its ``alignments`` and by ``explain()``; itself if there are none.

        Raises
        ------
        ModelError
            If the tolerance is out of range, or loops of more than 1500 coordinates hang together.
        """
        from mbsvib.equations.alignment import aligned

        return aligned(self, tolerance)

    def moved(self, values: Mapping[str, float], *, relaxed: bool = False, cut: Sequence[str] | None = None) -> Self:
        """Return a new model in another pose: joints moved by finite amounts, loops closed.

        Everything that belongs to a body goes with it: joints and their axes, ends of springs, points of inputs,
        outputs and loads, and follower loads turn with it. The directions of inputs and outputs turn with the body
        ``relative_to``, that of a torque in a joint with the joint. Springs get the tension that the motion gives them.
        The force of a bushing turns with its first body, its moment goes with the rotation vector between its bodies,
        up to 172 degrees on the way there.

        Parameters
        ----------
        values : mapping of str to float
            How far joint coordinates (``"knee.rz"``) move from where they are [m, rad]. The other coordinates stay
            where they are, but for those that loops tie to these. Three free rotations are one rotation vector, as are
            the two of a homokinetic joint. Beams and superelements go along as they are where the mechanism moves
            without bending them; else they bend with the least energy, and joints that this moves follow.
        relaxed : bool
            True: springs and bushings keep the forces that they have here, as if they were mounted in the new pose;
            nothing bends.
        cut : sequence of str, optional
            Joints at which loops are to be cut; default: none of those that are moved.

        Returns
        -------
        Model
            The model in that pose; this one stays as it is.

        Raises
        ------
        ModelError
            If a coordinate is unknown or tied to the others, the loops cannot be closed in that pose, or a coupler acts
            on a component of a rotation vector, or on a translation, of a joint that has turned across it.
        SingularPoseError
            If a coordinate stands still at a dead centre here.

        Warns
        -----
        LargeDisplacementWarning
            If beams or superelements bend further than small displacements hold.
        NearSingularWarning
            If the new pose is a dead centre of the coordinates, by which it is known to a few digits only.
        """
        result = moved(self, values, relaxed, cut)
        check_couplers(self, result)
        return result

    @overload
    def equilibrium(
        self, preload: Preloaded | None = ..., *, report: Literal[False] = ..., snap: bool = ...,
        cut: Sequence[str] = ...,
    ) -> Self: ...  # fmt: skip

    @overload
    def equilibrium(
        self, preload: Preloaded | None = ..., *, report: Literal[True], snap: bool = ..., cut: Sequence[str] = ...
    ) -> Equilibrium[Self]: ...

    def equilibrium(
        self, preload: Preloaded | None = None, *, report: bool = False, snap: bool = False, cut: Sequence[str] = ()
    ) -> Self | Equilibrium[Self]:
        """Return a new model in equilibrium: where its loads take it, or with preloads that hold it in this pose.

        The pose is found by Newton's method on the exact equations, with the tangent K + K_g and loops closed at every
        step. A mechanism that its springs hold follows its loads as they grow, and is refused where it would snap
        through; one that hangs goes downhill. Motions that nothing moves stay as they are.

        Beams and superelements bend by displacements that are small in the frame of the body that carries them, which
        moves finitely: ground if it holds an end or node, else the first body that does, else the first node. As
        described they are without forces, unless ``displacements`` are stated; the model returned states these, and its
        beams run through the bent nodes. The equations are exact to first order in these displacements.

        Parameters
        ----------
        preload : str, sequence of str, or True, optional
            Names or patterns (``"leg*.k"``) of springs and bushings of any kind that have stiffness at rest, whose
            preloads are to be found, True for all: the pose stays, and of all preloads that hold it those of least
            norm are taken: the least sum over these of |force|^2 + |moment / L|^2, moments about the bushing's
            position. ``"*.tyre.z"`` names directions of bushings, in their own axes.
            L is the root mean square distance from their mean of all centres of mass, points of joints and
            bushings, contacts of rolling wheels, and ends of springs. Default: the pose is found, but not of models on
            rolling wheels.
        report : bool
            True: return how it was found as well, ``Equilibrium`` with the model, whether it is stable and the modes
            that grow if not, the residual after every step, load steps, and how far each body moved.
        snap : bool
            True: a mechanism that its springs hold may snap through to a pose elsewhere.
        cut : sequence of str
            Joints at which loops are to be cut.

        Returns
        -------
        Model or Equilibrium
            The model, or the report with it; this model stays as it is.

        Raises
        ------
        EquilibriumError
            If no such pose can be reached, with what is left over in the last one, or no such preload holds this one.
        ModelError
            If a name or pattern picks no spring, a part cannot be taken to another pose, or gravity acts on a
            superelement whose mass does not tell how.

        Warns
        -----
        LargeDisplacementWarning
            If beams or superelements bend further than small displacements hold.
        """
        from mbsvib.equilibrium.search import equilibrium

        if not preload:
            result = equilibrium(self, snap, cut)
        else:
            from mbsvib.equilibrium.preloads import preloaded
            from mbsvib.rolling.contact import standing

            held = preloaded(with_rigid_parts(standing(self)), preload)
            result = with_preloads_of(self, equilibrium(held, snap, cut))
        return result if report else result.model

    def path(self, coordinate: str, values: ArrayLike, switch: int = 0) -> EquilibriumPath[Self]:
        """Return the equilibria while one joint coordinate is led to values in turn, with their stability.

        r_free(z) = 0:  the forces along all other coordinates vanish, and a force along this one holds it

        The path is followed through extremes of the force, where the mechanism would snap if the force stayed, through
        extremes of the coordinate, where it would snap though the coordinate is held, and through points where another
        path crosses. These points are located and listed. After an extreme of the coordinate the path goes back until
        it reaches the value asked for on another way.

        Parameters
        ----------
        coordinate : str
            Joint coordinate (``"elbow.rz"``); its joint has one free rotation at most.
        values : array-like, shape (n,)
            Displacements from where the coordinate is [m, rad], in the order in which they are reached. The path
            reverses where the next value lies in the other direction.
        switch : int
            1 or -1: at the first branch point go on along the path that crosses, along or against the ``direction`` of
            that point. Default: stay on the path.

        Returns
        -------
        EquilibriumPath
            ``values``, holding ``forces``, ``models``, ``frequencies``, ``stable``, ``stable_held`` and special
            ``points``; ``print`` shows a table, ``plots.path`` a figure.

        Raises
        ------
        ModelError
            If the coordinate is unknown, or its joint has several rotations.
        EquilibriumError
            If the model is not in balance while the coordinate is held, or a value is not reached.

        Source: E. L. Allgower and K. Georg, Introduction to Numerical Continuation Methods (SIAM 2003), chapters 2-8.
        """
        from mbsvib.equilibrium.equilibrium_path import equilibrium_path

        return equilibrium_path(self, coordinate, values, switch)


# Coordinates that a message names.
NAMED = 6


def columns_of(model: Mechanism, values: Any, grid: bool) -> tuple[dict[str, Array], tuple[int, ...]]:
    """Displacements (n,) of each coordinate, and the shape of the grid or (n,)."""
    check_mapping(values, "family")
    arrays = {}
    for key, value in values.items():
        array = reals(value, "family", f"values['{key}']", "displacements [m, rad]", ModelError)
        if array.ndim > 1 or not array.size or not np.isfinite(array).all():
            raise ModelError(f"family: values['{key}'] = {check.shown(value)}; expected finite displacements [m, rad], "
                             f"one for each pose.", element=str(key), field="values")  # fmt: skip
        arrays[key] = np.atleast_1d(array)
    if grid:
        spread = [axis.ravel() for axis in np.meshgrid(*arrays.values(), indexing="ij")]
        shape = tuple([len(array) for array in arrays.values()])
    else:
        lengths = {key: len(array) for key, array in arrays.items() if len(array) > 1}
        if len(set(lengths.values())) > 1:
            listed = ", ".join(f"'{key}' {length}" for key, length in lengths.items())
            raise ModelError(f"family: values have different lengths: {listed}; expected equal ones. grid=True takes "
                             f"all combinations.", field="values")  # fmt: skip
        shape = (max(lengths.values(), default=1),)
        spread = [np.broadcast_to(array, shape) for array in arrays.values()]
    columns: dict[str, Array] = {}
    for key, column in zip(arrays, spread, strict=True):
        for name in pose_coordinates(model, key, "family"):
            if name in columns:
                raise ModelError(f"family: '{name}' has values twice; expected one vector for each coordinate.",
                                 element=name, field="values")  # fmt: skip
            columns[name] = column
    return columns, shape


def check_mapping(values: Any, caller: str) -> None:
    """Refuse what is no mapping of coordinates to displacements, or is empty."""
    if not hasattr(values, "items") or not values:
        raise check.refuse(caller, "values", values, "joint coordinates with displacements, {'leg1.slide.z': ...}")


def batch_of(plant: Plant, poses: Array, caller: str) -> Batch:
    """Return the batch of ``poses`` (n, coordinates); errors name the pose by its number and displacements."""
    try:
        return cast("Batch", plant(poses))
    except MbsvibError as error:
        match = re.match(r"variant (\d+):? ?", str(error))
        if match is None:
            raise
        i = int(match[1])
        pose = dict(zip(plant.names, poses[i].tolist(), strict=True))
        text = f"{caller}: {told(i, pose)}: {str(error)[match.end():]}"
        if isinstance(error, UnreachableError):
            raise SingularPoseError(text) from error
        if isinstance(error, (SingularPoseError, EquilibriumError, ModelError)):
            error.args = (text, *error.args[1:])
        raise


def told(i: int, pose: Mapping[str, float]) -> str:
    """Return a pose in words: its number and displacements."""
    shown = ", ".join(f"{name} = {value:.6g}" for name, value in list(pose.items())[:NAMED])
    return f"pose {i} ({shown}{', ...' if len(pose) > NAMED else ''})"
