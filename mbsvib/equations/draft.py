"""Drafts: the arrays of a mechanism, with its equations of motion as far as they are assembled."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from mbsvib.common.arrays import Array
from mbsvib.common.expected import names
from mbsvib.common.fast_init import fast_init
from mbsvib.equations.equations import Separation
from mbsvib.equations.load_stiffness import LoadedPairs
from mbsvib.equations.matrices import Terms, matrices, minimal_rows
from mbsvib.equations.scene import Scene
from mbsvib.equations.self_stress import Undetermined
from mbsvib.equations.statics import Reactions, Statics
from mbsvib.equations.virtual_motions import Kept
from mbsvib.errors import ModelError
from mbsvib.kinematics.loops import Reduction, kept_rows
from mbsvib.kinematics.relative_motion import Triplets
from mbsvib.mechanism.drives import driven_coordinates
from mbsvib.mechanism.mechanism import Mechanism


@dataclass(frozen=True, slots=True)
class Variants:
    """What differs in variants, of which ``first`` is the number of the first one: ``axes`` (..., 3, 3) and ``lengths``
    (...) of joints by name, the ``fields`` that vary, by part and name, and the ``points`` (..., 3) of joints without
    coordinates, by number.
    """

    first: int = 0
    axes: Mapping[str, Array] = field(default_factory=dict)
    lengths: Mapping[str, Array] = field(default_factory=dict)
    fields: Mapping[str, Mapping[str, Array]] = field(default_factory=dict)
    points: Mapping[int, Array] = field(default_factory=dict)


NONE = Variants()


@fast_init
@dataclass(frozen=True, slots=True)
class Draft:
    """Incomplete equations of motion: each step of the assembly returns a draft with the contribution of its parts.

    ``scene`` has the arrays of the expanded ``model``. ``relative`` are its relative displacements, ``phi`` the rows of
    loop constraints, ``reduction`` the minimal coordinates. ``minimal`` are the numbers of these among the joint
    coordinates, ``independent`` names that the user requires among them; ``kept`` are the independent rows and the
    dependent coordinates of each group of loops. ``loaded`` and ``multipliers`` (..., locked rows) are the forces at
    the pose, ``reactions`` the map to wrenches in joints, None until a step needs it. If ``checked``, a pose not
    in balance is refused.

    The arrays of many variants have an axis of these in front; ``variants`` tells what differs in them.
    """

    model: Mechanism
    scene: Scene
    relative: Triplets
    phi: Array
    reduction: Reduction
    minimal: tuple[int, ...]
    terms: Terms
    independent: tuple[str, ...] = ()
    checked: bool = True
    kept: Kept = ()
    statics: Statics | None = None
    undetermined: tuple[Undetermined, ...] = ()
    reactions: Reactions | None = None
    loaded: LoadedPairs | None = None
    multipliers: Array | None = None
    separation: Separation | None = None
    variants: Variants | None = None

    @property
    def varied(self) -> Variants:
        """What differs in variants: nothing in a single model."""
        return NONE if self.variants is None else self.variants

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the minimal coordinates."""
        names = self.scene.coordinates.names
        return tuple([names[k] for k in self.minimal])


def first_draft(
    model: Mechanism, scene: Scene, independent: Sequence[str] | None = None, checked: bool = True
) -> Draft:
    """Return the equations of motion of bodies, joints, connections and ports, without those of other parts.

    ``independent``: joint coordinates that must be among the minimal ones. If ``checked``, later steps refuse a pose
    that is not in balance.
    """
    displacements = scene.relative()
    phi = scene.closure(displacements)
    asked = [] if independent is None else names(independent, "linearize", "independent", ModelError)
    reduction = scene.reduced(phi, [*model.derived(driven_coordinates), *asked] or None)
    locked = scene.locked
    strained = displacements.nonzero_rows(locked, locked + len(scene.springs.owner))
    rows = minimal_rows(scene, displacements, reduction, strained)
    terms = matrices(scene, rows, closed=reduction.matrix is not None)
    needs_pivots = scene.loads is not None or scene.port.wrench_outputs
    return Draft(model, scene, displacements, phi, reduction, tuple(reduction.independent.tolist()), terms,
                 tuple(asked), checked, kept_rows(scene.cuts, reduction) if needs_pivots else ())  # fmt: skip
