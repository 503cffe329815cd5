"""Couplers of a batch: coefficients that vary, and cut joints that do."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.elements.rows import Rows
from mbsvib.kinematics.couplers import couplings

if TYPE_CHECKING:
    from mbsvib.equations.batch_values import Values
    from mbsvib.equations.scene import Scene
    from mbsvib.kinematics.couplings import Couplings


def varied_couplings(given: Couplings, scene: Scene, values: Values) -> Couplings:
    """Return the terms of all couplers in all variants.

    Parameters
    ----------
    given : Couplings
        Those of the pose as it is.
    scene : Scene
        The mechanism in numbers, as it is.
    values : Values
        What varies.

    Returns
    -------
    Couplings
        Coefficients (variants, t), and rows of cut joints with an axis of variants, where they vary.
    """
    cut = {scene.topology.joints[k].name for k in scene.topology.cut}
    named = {name.rpartition(".")[0] for part in scene.couplers for name, _ in part.terms}
    if not (named & cut | {part.name for part in scene.couplers}) & set(values.fields):
        return given
    number = {name: i for i, name in enumerate(scene.topology.bodies)}
    number["ground"] = len(scene.bodies)
    each = []
    for i in range(values.count):
        joints: list[Any] = [values.part(joint.name, i) for joint in scene.topology.joints]
        parts: list[Any] = [values.part(part.name, i) for part in scene.couplers]
        each.append(couplings(parts, replace(scene.topology, joints=tuple(joints)), scene.bodies, number,
                              scene.coordinates))  # fmt: skip
    rows = [one.measured for one in each]
    point, force, moment = (np.stack([getattr(row, key) for row in rows], axis=1)
                            for key in ("point", "force", "moment"))  # fmt: skip
    skew = tuple(
        (same[0][0], np.stack([one[1] for one in same], axis=1), np.stack([one[2] for one in same], axis=1), same[0][3])
        for same in zip(*(one.skew for one in each), strict=True)
    )
    measured = Rows(given.measured.first, given.measured.second, point, force, moment) if len(point[0, 0]) else \
        given.measured  # fmt: skip
    return replace(given, value=np.array([one.value for one in each]), measured=measured, skew=skew)


def couplings_of(given: Couplings, i: int) -> Couplings:
    """Return the terms of one variant."""
    rows = given.measured
    vectors = (rows.point, rows.force, rows.moment)
    point, force, moment = (array if array.ndim == 2 else array[:, i] for array in vectors)
    return replace(
        given, value=given.value if given.value.ndim == 1 else given.value[i],
        measured=Rows(rows.first, rows.second, point, force, moment),
        skew=tuple((k, a if a.ndim == 2 else a[:, i], b if b.ndim == 2 else b[:, i], which)
                   for k, a, b, which in given.skew),
    )  # fmt: skip
