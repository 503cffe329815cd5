"""Variants of a model in other poses, for plants whose values are also displacements of joint coordinates."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.common.arguments import names_in, shown, unknown
from mbsvib.common.arrays import Array
from mbsvib.common.patterns import matching
from mbsvib.elements.pose import Pose
from mbsvib.equilibrium.articulation import with_rigid_parts
from mbsvib.equilibrium.moved import Poses, moved
from mbsvib.equilibrium.moved_parts import check_couplers, model_in_pose
from mbsvib.errors import ModelError
from mbsvib.mechanism.mechanism import Mechanism

if TYPE_CHECKING:
    from mbsvib.equations.batch_values import Values
    from mbsvib.mechanism.parameters import Parameters

# Fields of which poses depend: with other values of these, each variant is moved by itself.
PLACES = frozenset(("position", "orientation", "start", "end", "pitch", "axis"))
# Poses are computed in chunks of so many, whose arrays fit a cache.
CHUNK = 256


@dataclass(frozen=True)
class PosedVariants:
    """Variants of a ``model`` in other poses: with displacements of the joint coordinates ``names`` (r,).

    ``poses`` are those of the model, None where parameters that vary move its joints or points. ``relaxed``, ``cut``
    are those of ``moved``.
    """

    model: Mechanism
    names: tuple[str, ...]
    poses: Poses | None
    relaxed: bool
    cut: tuple[str, ...] | None

    @staticmethod
    def of(
        model: Mechanism, names: tuple[str, ...], parameters: Sequence[str], relaxed: bool, cut: Sequence[str] | None
    ) -> PosedVariants:
        """Return how variants of a model are moved; ``parameters``: those that vary."""
        poses = Poses.of(with_rigid_parts(model), names, cut, "compile").to_second_order()
        known: Parameters = model.parameters
        fixed = not any(known.entry(name).field in PLACES for name in parameters)
        return PosedVariants(model, names, poses if fixed else None, relaxed, None if cut is None else tuple(cut))

    def __call__(self, values: Values) -> Callable[[int], Mechanism]:
        """Return the function of the variants by their numbers."""
        return _Variants(self, values, np.array([values.displacements[name] for name in self.names]).T)

    def poses_of(self, values: Values, first: int) -> Pose:
        """Return the poses of some variants, ``first`` the number of the first of them."""
        return self.at(np.array([values.displacements[name] for name in self.names]).T, first)

    def at(self, displacements: Array, first: int) -> Pose:
        """Return the poses for displacements (v, r), ``first`` the number of the first of them."""
        assert self.poses is not None
        return self.poses.at(displacements, "variant", first, {} if self.relaxed else self.model.springs)


@dataclass(frozen=True)
class _Variants:
    """Variants with ``values`` and ``displacements`` (v, r); ``chunks`` has the poses that are known, by the number of
    their first variant, None where each is moved by itself.
    """

    posed: PosedVariants
    values: Values
    displacements: Array
    chunks: dict[int, Pose | None] = field(default_factory=dict)

    def __call__(self, i: int) -> Mechanism:
        """Return a variant by its number."""
        posed = self.posed
        own = {name: float(array[i]) for name, array in self.values.by_name.items()}
        described = posed.model.with_values(own) if own else posed.model
        poses = self._poses(i - i % CHUNK)
        if poses is not None:
            result = model_in_pose(described, poses[i % CHUNK], posed.relaxed)
        else:
            asked = dict(zip(posed.names, self.displacements[i].tolist(), strict=True))
            result = moved(described, asked, posed.relaxed, posed.cut)
        check_couplers(described, result)
        return result

    def _poses(self, first: int) -> Pose | None:
        posed = self.posed
        if first not in self.chunks:
            self.chunks[first] = None
            try:
                if posed.poses is not None:
                    self.chunks[first] = posed.at(self.displacements[first : first + CHUNK], first)
            except ModelError:
                if posed.relaxed or not posed.model.composed:
                    raise  # parts that bend may reach poses that rigid ones do not
        return self.chunks[first]


def pose_coordinates(model: Mechanism, patterns: str | Sequence[str], caller: str = "compile") -> tuple[str, ...]:
    """Return the joint coordinates that names or patterns pick, in the order of these, then of the model."""
    known = [f"{joint.name}.{name}" for joint in model.joints.values() for name, _ in joint.freedom]
    asked = names_in([patterns] if isinstance(patterns, str) else patterns)
    if not asked:
        raise ModelError(f"{caller}: pose = {shown(patterns)}; expected names or patterns of joint coordinates.",
                         field="pose")  # fmt: skip
    result: list[str] = []
    for pattern in asked:
        found = matching(pattern, known)
        if not found:
            raise unknown(pattern, known, f"{caller}: pose = '{pattern}' matches no joint coordinate of model "
                          f"'{model.name}'", "pose")  # fmt: skip
        result += found
    return tuple(dict.fromkeys(result))
