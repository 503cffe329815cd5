"""The residual of the forces in some pose along minimal coordinates, and its tangent."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.equations.draft import first_draft
from mbsvib.equations.scene import scene
from mbsvib.equations.statics import shares, unbalanced_in_words
from mbsvib.equilibrium.articulation import elastic_scale, expanded_articulation
from mbsvib.equilibrium.moved_parts import model_in_pose
from mbsvib.errors import NearSingularWarning
from mbsvib.linalg.rank import EPS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array
    from mbsvib.equilibrium.motion import PosedModel
    from mbsvib.kinematics.loops import Reduction


# Positions are rounded by eps of the mechanism's size: forces of which this share is that rounding count as resolved.
RESOLVED = 1e-12


@dataclass(frozen=True, slots=True)
class Balance:
    """The forces of a model in one pose, along its minimal coordinates.

    ``residual`` (m,) is the sum of the forces, ``balanced_forces`` (m,) the size of those that should cancel [N, N m].
    ``size`` (m,) is the same, but no less than the smallest force that rounded positions can resolve. ``tangent``
    (m, m) is -d(residual)/dz, exact where the residual is zero. ``scale`` (m,) makes coordinates comparable: 1 rad or
    the size of the mechanism, and less along stiff coordinates of a beam or superelement. ``names`` (m,) are the
    names of the coordinates; ``reduction`` maps them to those of all joints.
    """

    reduction: Reduction
    names: tuple[str, ...]
    residual: Array
    balanced_forces: Array
    size: Array
    tangent: Array
    scale: Array

    @property
    def share(self) -> float:
        """The residual over the forces along its coordinate, the largest of all coordinates."""
        return float(shares(self.residual, self.size).max(initial=0.0))

    @property
    def strict_share(self) -> float:
        """The same without allowance for the rounding of positions, as in ``linearize``."""
        return float(shares(self.residual, self.balanced_forces).max(initial=0.0))

    @property
    def depends(self) -> NDArray[np.bool_]:
        """Which joint coordinates of the tree (n,) depend on the minimal ones."""
        matrix = self.reduction.matrix
        result = np.ones(len(self.names) if matrix is None else len(matrix), dtype=bool)
        result[self.reduction.independent] = False
        return result

    def all_joints(self, step: Array) -> Array:
        """Return the motion of all joints of the tree (n,) for a step (m,) of the minimal coordinates."""
        if self.reduction.matrix is None:
            return step
        return np.asarray(self.reduction.matrix @ step)


def balance(at: PosedModel, independent: Sequence[str] | None = None) -> Balance:
    """Return the forces and their tangent in a pose, with the exact geometry of springs.

    ``independent``: joint coordinates that shall be among the minimal ones.
    """
    model = expanded_articulation(at.reference if at.pose.as_described else model_in_pose(at.reference, at.pose))
    numbers = scene(model, at.cut)
    with warnings.catch_warnings():  # an intermediate pose, not the requested one
        warnings.simplefilter("ignore", NearSingularWarning)
        draft = first_draft(model, numbers, independent, checked=False)
    residual = balanced_forces = np.zeros(len(draft.minimal))
    if numbers.loads is not None:
        from mbsvib.equations.loaded import with_loads

        draft = with_loads(draft)
        assert draft.statics is not None
        residual, balanced_forces = draft.statics.residual, draft.statics.size
    if any(part.cross_coupling is not None for part in model.springs.values()):
        from mbsvib.equations.spin_terms import with_spin

        draft = with_spin(replace(draft, model=model.with_parts(rotors={})))
    lengths, stiffness = at.scale[draft.reduction.independent], draft.terms.K
    size = np.maximum(balanced_forces, EPS / RESOLVED * (np.abs(stiffness) @ lengths))
    scale = lengths * elastic_scale(at.reference, draft.names, stiffness.diagonal() * lengths**2)
    return Balance(draft.reduction, draft.names, residual, balanced_forces, size, stiffness, scale)


def unbalanced_force(at: PosedModel, forces: Balance) -> tuple[str, dict[str, Any]]:
    """Return the largest unbalanced force of a pose in words, and the fields of an ``EquilibriumError``."""
    worst = int(np.argmax(shares(forces.residual, forces.size)))
    share, missing = shares(forces.residual, forces.balanced_forces)[worst], -float(forces.residual[worst])
    k = int(forces.reduction.independent[worst])
    text, details = unbalanced_in_words(at.coordinates.names[k], bool(at.coordinates.turns[k]), missing, float(share),
                                        at.reference.joints)  # fmt: skip
    return f"{text})", details
