"""Forces of loads and connections in other poses, and the stiffness of bushings there, for one pose or many.

Points go with their bodies, follower loads turn with them. A tension changes by the stiffness at rest times the change
of length. The wrench of a bushing, or torsion spring, is the first derivative of its potential (``elements.bushing``),
its stiffness the second.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.elements import bushing, torsion_spring
from mbsvib.elements.deformations import twist
from mbsvib.elements.element_rows import ElementRows
from mbsvib.elements.rows import Rows
from mbsvib.elements.spring import ROUNDING
from mbsvib.equations.wrench_pairs import WrenchPairs
from mbsvib.equations.wrenches import applied_wrenches
from mbsvib.linalg.products import signed_rows
from mbsvib.linalg.rotations import components_first, components_last, logarithm

if TYPE_CHECKING:
    from collections.abc import Iterable

    from mbsvib.common.arrays import Array, Bools, Index
    from mbsvib.equations.batch_values import Values
    from mbsvib.equations.wrenches import AppliedWrenches
    from mbsvib.kinematics.pose import Pose
    from mbsvib.mechanism.mechanism import Mechanism


@dataclass(frozen=True)
class Bushings:
    """Bushings and torsion springs (b,) as described: their ``parts``, numbers ``owner`` among the connections, bodies
    ``first`` and ``second``, points ``at`` (b, 3) [m], ``axes`` (b, 3, 3), and which ``twists`` (b,) about z alone.

    ``stiffness`` and ``damping`` (..., b, 6, 6) are in these axes. Those that are ``bent`` (b,) have another stiffness
    in other poses.
    """

    parts: tuple[Any, ...]
    owner: Index
    first: Index
    second: Index
    at: Array
    axes: Array
    twists: Bools
    bent: Bools
    stiffness: Array
    damping: Array

    def about(self, pose: Pose, preload: Array) -> tuple[Array, Array, Array]:
        """Return stiffness, damping and preload about a pose, from the preload (..., b, 6), all in their own axes."""
        first, second = (pose.rotations.take(body, axis=-3) @ self.axes for body in (self.first, self.second))
        back = first.swapaxes(-1, -2)
        relative = back @ second
        apart = pose.points(self.second, self.at) - pose.points(self.first, self.at)
        rho = logarithm(relative)
        k, c, wrench, has_moment = bushing.about(self.stiffness, self.damping, preload,
                                                 (back @ apart[..., None])[..., 0], rho)  # fmt: skip
        bushing.check_angles(self.parts, rho, has_moment & ~self.twists)
        if self.twists.any():
            at = self.twists.nonzero()[0]
            stiffness, damping = (np.broadcast_to(array, k.shape)[..., at, 5, 5] for array in (
                self.stiffness, self.damping))  # fmt: skip
            moment = np.broadcast_to(preload, wrench.shape)[..., at, 5]
            parts = [self.parts[i] for i in at.tolist()]
            k[..., at, :, :], c[..., at, :, :], wrench[..., at, :] = torsion_spring.about(
                parts, stiffness, damping, moment, relative[..., at, :, :])  # fmt: skip
        return k, c, wrench

    def rows(self, pose: Pose, stiffness: Array, damping: Array) -> ElementRows:
        """Return the rows of those that are bent: eigenvectors of their stiffness, then of damping (..., b, 6, 6)."""
        at = self.bent.nonzero()[0]
        axes = pose.rotations.take(self.first[at], axis=-3) @ self.axes[at]
        matrices = [bushing.symmetric_part(array[..., at, :, :]) for array in (stiffness, damping)]
        values, units = (np.concatenate(arrays, axis=-2) for arrays in zip(
            *[(value[..., None, :], unit) for value, unit in map(signed_rows, matrices)], strict=True))  # fmt: skip
        lead, each = units.shape[:-3], units.shape[-2]
        count = each * len(at)
        zero = np.zeros_like(values[..., 0, :])
        k, c = (np.concatenate(pair, axis=-1).reshape(*lead, count) for pair in (
            (values[..., 0, :], zero), (zero, values[..., 1, :])))  # fmt: skip
        turned = units.reshape(*units.shape[:-1], 2, 3) @ axes.swapaxes(-1, -2)[..., None, :, :]
        force, moment = (components_first(turned[..., i, :].reshape(*lead, count, 3)) for i in (0, 1))
        place = np.repeat(pose.points(self.second[at], self.at[at]), each, axis=-2)
        ends = [np.repeat(array[at], each) for array in (self.first, self.second, self.owner)]
        rows = Rows(ends[0], ends[1], components_first(place), force, moment)
        return ElementRows(rows, k, c, ends[2], units.reshape(*lead, count, 6))


@dataclass(frozen=True)
class PosedForces:
    """The ``applied`` wrenches as described, of all elements that have some in other poses, and how they follow.

    Of the elements along lines, ``stiffness`` (..., l) is that at rest and ``lines`` (l, 3) from start to end [m];
    ``bushings`` are the others.
    """

    applied: AppliedWrenches
    stiffness: Array
    lines: Array
    bushings: Bushings

    def of_variants(self, applied: AppliedWrenches, values: Values) -> PosedForces:
        """Return the forces of variants with these ``applied`` wrenches as described, at points that do not vary."""
        pairs = self.applied.pairs
        applied = replace(applied, pairs=replace(applied.pairs, start=pairs.start, end=pairs.end))
        names = applied.names[applied.loads :]
        stiffness, bushings = self.stiffness, self.bushings
        for k, name in enumerate(names[: applied.lines]):
            if "stiffness" in values.fields.get(name, {}):
                stiffness = np.array(np.broadcast_to(stiffness, (values.count, applied.lines)), values.numbers.dtype)
                stiffness[:, k] = values.fields[name]["stiffness"]
        changes: dict[str, Any] = {}
        for k, name in enumerate(names[applied.lines :]):
            for key in ("stiffness", "damping"):
                if key in values.fields.get(name, {}):
                    matrix = changes.get(key, getattr(bushings, key))
                    changes[key] = matrix = np.array(
                        np.broadcast_to(matrix, (values.count, *matrix.shape[-3:])), values.numbers.dtype)
                    array = np.moveaxis(values.fields[name][key], -1, 0)
                    matrix[:, k] = array if array.ndim == 3 else array[..., None] * np.eye(6)
        return replace(self, applied=applied, stiffness=stiffness, bushings=replace(bushings, **changes))

    def at(self, pose: Pose, relaxed: bool = False) -> tuple[AppliedWrenches, Array, Array]:
        """Return the wrenches in a pose, or in many, and stiffness and damping (..., b, 6, 6) of the bushings there.

        If ``relaxed``, elements keep the forces that they have as described.
        """
        applied, bushings = self.applied, self.bushings
        pairs, n, end = applied.pairs, applied.loads, applied.loads + applied.lines
        start, stop = pose.points(pairs.first, pairs.start.T), pose.points(pairs.second, pairs.end.T)
        start[..., :n, :], start[..., end:, :] = stop[..., :n, :], stop[..., end:, :]
        lead = pose.centre.shape[:-2]
        shape = (*lead, len(applied.names), 3)
        force, torque = (np.array(np.broadcast_to(components_last(array), shape), pose.centre.dtype)
                         for array in (pairs.force, pairs.torque))  # fmt: skip
        follows = applied.follower.nonzero()[0]
        for array in (force, torque):
            if len(follows):
                turned = pose.rotations.take(pairs.second[follows], axis=-3) @ array[..., follows, :, None]
                array[..., follows, :] = turned[..., 0]
        if applied.lines:
            force[..., n:end, :] = self._tensions(force[..., n:end, :], stop[..., n:end, :] - start[..., n:end, :],
                                                  relaxed)  # fmt: skip
        k, c = bushings.stiffness, bushings.damping
        if len(bushings.parts):
            axes = pose.rotations.take(bushings.first, axis=-3) @ bushings.axes
            local = [(bushings.axes.swapaxes(-1, -2) @ array[..., end:, :, None])[..., 0] for array in (force, torque)]
            wrench = np.concatenate(local, axis=-1)
            if not relaxed:
                k, c, wrench = bushings.about(pose, wrench)
            for array, half in ((force, wrench[..., :3]), (torque, wrench[..., 3:])):
                array[..., end:, :] = (axes @ half[..., None])[..., 0]
        vectors = [np.ascontiguousarray(components_first(array)) for array in (start, stop, force, torque)]
        return replace(applied, pairs=WrenchPairs(pairs.first, pairs.second, *vectors)), k, c

    def _tensions(self, force: Array, line: Array, relaxed: bool) -> Array:
        """Forces (..., l, 3) on the second bodies, from those as described, for lines (..., l, 3) in the pose."""
        before = np.sqrt(np.square(self.lines).sum(axis=-1))
        tension = -(force * self.lines).sum(axis=-1) / before
        length = np.sqrt(np.square(line).sum(axis=-1))
        if not relaxed:
            tension = tension + self.stiffness * (length - before)
            none = np.abs(tension) < ROUNDING * np.abs(self.stiffness) * before
            tension = np.where(none, tension - tension.real, tension)
        return np.asarray(-(tension / length)[..., None] * line)


def posed_forces(described: Mechanism, model: Mechanism, also: Iterable[str] = ()) -> PosedForces | None:
    """Return the forces of a mechanism in other poses, None without any; ``model`` has bushings for torsion springs.

    ``also``: elements that may have forces in variants.
    """
    number = {name: k for k, name in enumerate((*model.bodies, "ground"))}
    order = {name: k for k, name in enumerate(model.springs)}
    at_rest = {name: _stiffness_at_rest(part) for name, part in model.springs.items()}
    acting = {name for name, part in model.springs.items() if np.any(at_rest[name]) or (
        not part.acts_along_line and np.any(part.damping))}  # fmt: skip
    applied = applied_wrenches(model, number, acting.union(also))
    if not applied.names and not applied.weight.any():
        return None
    names = applied.names[applied.loads :]
    lines, others = names[: applied.lines], names[applied.lines :]
    parts = [model.springs[name] for name in others]
    ends: Any = np.array([model.springs[name].points for name in lines]).reshape(-1, 2, 3)
    k, c = (np.array([bushing.matrix6(getattr(part, key)) for part in parts]).reshape(-1, 6, 6)
            for key in ("stiffness", "damping"))  # fmt: skip
    twists = np.array([_law(described.springs.get(name)) is twist for name in others], dtype=bool)
    preload = np.array([part.preload or bushing.ZERO for part in parts]).reshape(-1, 6)
    first, second, owner = (np.array(values, dtype=np.intp) for values in (
        [number[part.first] for part in parts], [number[part.second] for part in parts],
        [order[name] for name in others]))  # fmt: skip
    return PosedForces(applied, np.array([at_rest[name] for name in lines]), ends[:, 1] - ends[:, 0], Bushings(
        tuple(parts), owner, first, second, np.array([part.position for part in parts]).reshape(-1, 3),
        np.array([part.orientation for part in parts]).reshape(-1, 3, 3), twists,
        twists | k[:, 3:].any(axis=(1, 2)) | c[:, 3:].any(axis=(1, 2)) | preload[:, 3:].any(axis=1), k, c))  # fmt: skip


def _law(part: Any) -> Any:
    return None if part is None or part.law is None else part.law.deformation


def _stiffness_at_rest(part: Any) -> Any:
    return 0.0 if part.law is None or part.law.stiffness is None else getattr(part, part.law.stiffness)
