"""Balance: what is left of the forces in some pose, and the tangent that says how a motion changes it."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.equations.draft import begun
from mbsvib.equations.scene import scene
from mbsvib.equilibrium.articulation import elastic_scale, plain
from mbsvib.equilibrium.moved_parts import carried
from mbsvib.errors import NearSingularWarning
from mbsvib.linalg.rank import EPS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.equilibrium.motion import Stance
    from mbsvib.kinematics.loops import Reduction


# Positions are rounded by eps of the mechanism's size: what that does to its forces is this share of a size of them.
RESOLVED = 1e-12


@dataclass(frozen=True, slots=True)
class Balance:
    """The forces of a model in one pose, along its minimal coordinates.

    ``residual`` (m,) is what is left over, ``acting`` (m,) the size of what should cancel [N, N m] and ``size`` (m,)
    the same, or that of the least that positions can tell; ``tangent`` (m, m) is -d(residual)/dz, exact where the
    residual is zero. ``scale`` (m,) makes coordinates alike: 1 rad, or the size of the mechanism, less along what is
    stiff within a beam or superelement. ``names`` are the coordinates' and ``reduction`` leads to those of all joints.
    """

    reduction: Reduction
    names: tuple[str, ...]
    residual: Array
    acting: Array
    size: Array
    tangent: Array
    scale: Array

    @property
    def share(self) -> float:
        """The largest share of the forces along a coordinate that is left over."""
        return _share(self.residual, self.size)

    @property
    def strict_share(self) -> float:
        """The same without allowance for the rounding of positions, as ``linearize`` sees it."""
        return _share(self.residual, self.acting)

    def all_joints(self, step: Array) -> Array:
        """Return the motion of all joints of the tree for one of the minimal coordinates."""
        if self.reduction.matrix is None:
            return step
        return np.asarray(self.reduction.matrix @ step)


def _share(residual: Array, size: Array) -> float:
    return float(np.abs(residual / np.where(size > 0.0, size, 1.0)).max(initial=0.0))


def balance(at: Stance, independent: Sequence[str] | None = None) -> Balance:
    """Return the forces and their tangent in a pose; springs follow their exact law.

    Parameters
    ----------
    at : Stance
        The pose, with loops closed.
    independent : sequence of str, optional
        Joint coordinates that are to be among the minimal ones.

    Returns
    -------
    Balance
        Residual and tangent.
    """
    model = plain(at.described if at.pose.as_described else carried(at.described, at.pose))
    numbers = scene(model, at.cut)
    with warnings.catch_warnings():  # a pose on the way, not the one that is asked for
        warnings.simplefilter("ignore", NearSingularWarning)
        draft = begun(model, numbers, independent, checked=False)
    residual = acting = np.zeros(len(draft.kept))
    if numbers.loads is not None:
        from mbsvib.equations.loaded import with_loads

        draft = with_loads(draft)
        assert draft.statics is not None
        residual, acting = draft.statics.residual, draft.statics.size
    lengths, stiffness = at.scale[draft.reduction.independent], draft.terms.K
    size = np.maximum(acting, EPS / RESOLVED * (np.abs(stiffness) @ lengths))
    scale = lengths * elastic_scale(at.described, draft.names, stiffness.diagonal() * lengths**2)
    return Balance(draft.reduction, draft.names, residual, acting, size, stiffness, scale)
