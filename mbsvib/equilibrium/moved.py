"""The same mechanism in another pose, by the values of joint coordinates."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, TypeVar

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array, Index
from mbsvib.common.expected import names
from mbsvib.elements.bushing import LARGEST_ANGLE
from mbsvib.elements.pose import Pose
from mbsvib.equilibrium.articulation import warn_beyond, with_rigid_parts
from mbsvib.equilibrium.bending import elastic_mechanism, pose_of_least_energy
from mbsvib.equilibrium.motion import kinematics_of
from mbsvib.equilibrium.moved_parts import model_in_pose
from mbsvib.errors import ModelError, NearSingularWarning, SingularPoseError, UnreachableError
from mbsvib.kinematics.closing import TOLERANCE, Closing, Reached
from mbsvib.kinematics.loops import kept_rows, reduce
from mbsvib.kinematics.relative_motion import arm
from mbsvib.linalg.dead_points import is_unknown
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.mechanism.topology import cut_elsewhere
from mbsvib.mechanism.unit_warnings import angles_doubted, with_angles

M = TypeVar("M", bound=Mechanism)

# Frames from the warning up to the call of the user.
USER = 6
# Motions that turn bodies by more than springs allow are looked at in steps of at most this [rad], less than the angles
# beyond the limit of springs, from 3 rad to 2 pi - 3 rad.
LOOK = 0.25
# Share of the mechanism's size up to which loops are closed but for rounding.
ROUNDED_GAP = 1e-9


def moved(
    model: M, values: Mapping[str, float], relaxed: bool = False, cut: Sequence[str] | None = None
) -> M:
    """Return the model in another pose, refused and warned of as ``Model.moved`` says.

    ``values``: displacements of joint coordinates [m, rad]. ``relaxed``: whether springs keep the forces of the
    reference pose. ``cut``: joints at which loops are to be cut.
    """
    check.mapping("moved", "values", values, "a mapping of joint coordinates to values, {'hinge.rz': 0.1}", empty=True)
    displacements = {str(name): check.number(value, "moved", str(name)) for name, value in values.items()}
    model = with_angles(model, displacements)
    stiff = with_rigid_parts(model)
    cut_joints = None if cut is None else tuple(names(cut, "moved", "cut", ModelError))
    try:
        with angles_doubted(displacements):
            pose = rigid_pose(stiff, displacements, cut_joints, {} if relaxed else model.springs)
            return model_in_pose(model, pose, relaxed)
    except ModelError:
        if relaxed or not model.composed or not set(displacements) <= _all_coordinates(stiff):
            raise
        bent = _bent_model(model, displacements, cut_joints)
        if bent is None:
            raise
        return bent


def rigid_pose(
    stiff: Mechanism, displacements: Mapping[str, float], cut: Sequence[str] | None, springs: Mapping[str, Any]
) -> Pose:
    """Return the pose of a mechanism of rigid parts, by joint coordinates [m, rad]; ``springs`` as of ``Poses.at``."""
    poses = stiff.derived(Poses.of, tuple(displacements), None if cut is None else tuple(cut))
    return poses.at(np.array([list(displacements.values())]), springs=springs)[0]


@dataclass(frozen=True)
class Poses:
    """The poses of a mechanism with rigid parts by displacements of the joint coordinates ``names`` (p,).

    ``closing`` closes its loops; ``places`` (p,) are the numbers of the coordinates in its tree.
    """

    closing: Closing
    names: tuple[str, ...]
    places: Index

    @staticmethod
    def of(stiff: Mechanism, names: Iterable[str], cut: Sequence[str] | None, caller: str = "moved") -> Poses:
        """Return how a mechanism is moved; ``cut``: joints at which loops are cut, None: none of those that move."""
        asked = tuple(names)
        kinematics = kinematics_of(stiff, cut_elsewhere_of(stiff, asked, caller) if cut is None else cut)
        known = kinematics.coordinates.names
        for name in asked:
            check.known(name, known, f"{caller}: '{name}' is not a joint coordinate of model '{stiff.name}'", "values")
        blocks: tuple[tuple[Index, Index], ...] = ()
        if kinematics.cuts is not None:
            arms = partial(arm, kinematics.topology, kinematics.described.centre[:-1])
            with asked_for(asked, caller):
                reduction = reduce(kinematics.coordinates, kinematics.cuts, kinematics.closure, list(asked), arms)
            blocks = tuple(kept_rows(kinematics.cuts, reduction))
        places = np.array([known.index(name) for name in asked], dtype=np.intp)
        return Poses(Closing(kinematics, tuple(stiff.couplers.values()), blocks), asked, places)

    def to_second_order(self) -> Poses:
        """Return the same for many poses: the first guess of each is of second order."""
        return replace(self, closing=replace(self.closing, curved=self.places))

    def at(
        self, values: Array, caller: str = "moved", first: int | None = None, springs: Mapping[str, Any] | None = None
    ) -> Pose:  # fmt: skip
        """Return the poses for displacements (v, p) [m, rad], of which all are reached, or a ``ModelError``.

        ``caller`` is named in messages, with the number of the pose from ``first``, if given. Complex displacements are
        steps from those that their real parts are. ``springs`` are refused where the way to a pose turns them beyond
        where their moment is defined; default: none take a moment from the motion.
        """
        if np.iscomplexobj(values):
            return self._along(values)
        target = np.zeros((len(values), len(self.closing.kinematics.coordinates.names)))
        target[:, self.places] = values
        reached, lost, done = self.closing.poses(target)
        if lost.any():
            i = int(np.argmax(lost))
            raise self._unreachable(values[i], float(done[i]), float(reached.opening[i]),
                                    caller if first is None else f"{caller} {first + i}")  # fmt: skip
        for i in np.flatnonzero(reached.doubtful).tolist():
            self._warn_of_dead_point(reached, i, values[i], caller if first is None else f"{caller} {first + i}")
        families: dict[type[Any], list[Any]] = {}
        for part in (springs or {}).values():
            if part.law is not None and part.law.rotations is not None:
                families.setdefault(type(part), []).append(part)
        if families:
            self._check_turns(target, reached.q, families)
        return reached.pose

    def _check_turns(self, target: Array, q: Array, families: Mapping[type[Any], list[Any]]) -> None:
        """Let springs refuse poses on the way to others, with the values q (v, n), that turn them too far."""
        turns = [name.rpartition(".")[2][0] == "r" for name in self.closing.kinematics.coordinates.names]
        turned = np.abs(q[:, turns]).sum(axis=1)
        for i in np.flatnonzero(turned > LARGEST_ANGLE).tolist():
            count = int(turned[i] / LOOK) + 1
            way = self.closing.poses(np.arange(1, count)[:, None] / count * target[i])[0].pose
            for k in range(count - 1):
                for family, parts in families.items():
                    family.all_in_pose(parts, way[k], False)

    def _warn_of_dead_point(self, reached: Reached, i: int, values: Array, caller: str) -> None:
        """Warn if the loops that rounding leaves open hide where the dependent coordinates of a pose are."""
        known = self.closing.kinematics.coordinates.names
        smallest, most = min(self.closing.weakest(reached, i), default=(1.0, 0))
        opening = max(TOLERANCE, float(reached.rounding[i]))
        if is_unknown(smallest, opening):
            warnings.warn(
                f"{caller}: at {self._in_words(values)} the mechanism is at a dead centre of {', '.join(self.names)}, "
                f"or next to it: '{known[most]}' could move by itself, so that the pose is known to "
                f"{np.sqrt(opening):.0e} only, and rates and forces of these coordinates have no digits. Ask for a "
                f"value of '{known[most]}', or for a pose further off.", NearSingularWarning, stacklevel=USER,
            )  # fmt: skip

    def _in_words(self, values: Array) -> str:
        return ", ".join(f"{name} = {value:.6g}" for name, value in zip(self.names, values, strict=True))

    def _along(self, values: Array) -> Pose:
        """Return steps from poses that are reached, each pose computed once."""
        some, which = np.unique(values.real, axis=0, return_inverse=True)
        target, change = np.zeros((2, len(values), len(self.closing.kinematics.coordinates.names)))
        target[: len(some), self.places], change[:, self.places] = some, values.imag
        reached, _, _ = self.closing.poses(target[: len(some)])
        return self.closing.along(reached[which.reshape(-1)], change)

    def _unreachable(self, values: Array, done: float, gap: float, caller: str) -> ModelError:
        upto = self._in_words(done * values)
        cuts = self.closing.kinematics.cuts
        loops = ", ".join(cuts.joints if cuts else ())
        why = "there the other joints would have to jump"
        if np.isfinite(gap):
            why = (f"beyond it they stay open by {gap:.1e} of the mechanism's size" if gap > ROUNDED_GAP else
                   "there they come to a singular pose, such as a dead centre or flat bars")  # fmt: skip
        return UnreachableError(
            f"{caller}: the loops closed by {loops} can be closed up to {upto} and no further; {why}. Ask for a "
            f"pose short of it, or name another coordinate.", field="values",
            element=self.names[0] if self.names else None,
        )  # fmt: skip


def _all_coordinates(model: Mechanism) -> set[str]:
    return {f"{joint.name}.{name}" for joint in model.joints.values() for name, _ in joint.freedom}


def _bent_model(model: M, displacements: Mapping[str, float], cut: tuple[str, ...] | None) -> M | None:
    """The model in the pose with its beams and superelements bent, or None if that pose cannot be reached either."""
    mechanism = elastic_mechanism(model)
    cut = cut_elsewhere_of(mechanism, displacements) if cut is None else cut
    reached = pose_of_least_energy(mechanism, displacements, cut)
    if reached is None:
        return None
    result = model_in_pose(model, reached[0].pose)
    warn_beyond(result)
    return result


@contextmanager
def asked_for(names: Iterable[str], caller: str, field: str = "values") -> Iterator[None]:
    """Say of which coordinates a caller was asked where loops do not leave them independent."""
    asked = ", ".join(names)
    try:
        yield
    except ModelError as error:
        if error.field != "independent":
            raise
        raise ModelError(f"{caller}: loops and couplers leave no choice for {asked}: in this pose they lock one of "
                         f"these, as at a dead centre, or tie them to each other. Ask for fewer, or for others.",
                         element=error.element, field=field) from error  # fmt: skip
    except SingularPoseError as error:
        if not str(error).startswith("independent:"):
            raise
        raise SingularPoseError(f"{caller}: {asked} is at a dead centre in the described pose, where loops move others "
                                f"while it stands still. Ask for a value of a coordinate that moves there.") from error


def cut_elsewhere_of(model: Mechanism, coordinates: Iterable[str], caller: str = "moved") -> tuple[str, ...]:
    """Return joints to cut so that the joints of the coordinates asked for are part of the tree."""
    cut, closing = cut_elsewhere(model, {name.rsplit(".", 1)[0] for name in coordinates} & set(model.joints))
    if closing is not None:
        raise ModelError(f"{caller}: all joints of the loop that '{closing}' closes have a value; leave one of them to "
                         f"follow from the others.", element=closing, field="values")  # fmt: skip
    return cut
