"""Coordinates pinned where they stand still: at and near the dead centre of a rocker."""

import numpy as np
import pytest

import mbsvib as mv
from tests.equilibrium.test_moved import four_bar

# where crank (0.3 m) and coupler (0.9 m) are in line, with a ground of 1 m and a rocker of 0.7 m
STRETCHED = float(np.arccos((1.0 + 1.2**2 - 0.7**2) / 2.4))


def driven(start=0.8):
    """The four-bar linkage with a torsion spring of 10 N m/rad at its crank."""
    model, _ = four_bar(angle=start)
    model.add_bushing("spring", "ground", "crank", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 10.0))
    return model


def rocker(crank):
    """The angle of the rocker at that of the crank, by the triangles of the diagonal."""
    diagonal = 1.0 - 0.3 * np.exp(1j * crank)
    length = abs(diagonal)
    along = (0.9**2 - 0.7**2 + length**2) / (2.0 * length)
    return float(np.angle(0.3 * np.exp(1j * crank) + diagonal / length * (along + 1j * np.sqrt(0.81 - along**2)) - 1.0))


@pytest.mark.parametrize("start", [0.3, 0.8, 2.2])
def test_a_rocker_at_its_dead_centre_cannot_be_pinned(start):
    model = driven(start)
    there = model.moved({"D.rz": rocker(start) - rocker(STRETCHED)}, relaxed=True)
    with pytest.raises(mv.SingularPoseError, match=r"D\.rz at a dead centre.*Leave out independent="):
        there.linearize(independent=["D.rz"])
    assert there.linearize(independent=["A.rz"]).K[0, 0] == pytest.approx(10.0, rel=1e-12)


@pytest.mark.parametrize("off", [0.02, -0.3])
def test_stiffness_per_unit_of_the_rocker_beside_its_dead_centre(off):
    there = driven().moved({"A.rz": STRETCHED + off - 0.8}, relaxed=True)
    step = 1e-4
    ratio = (rocker(STRETCHED + off + step) - rocker(STRETCHED + off - step)) / (2.0 * step)
    assert there.linearize(independent=["D.rz"]).K[0, 0] == pytest.approx(10.0 / ratio**2, rel=1e-5)
