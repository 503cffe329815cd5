"""Coordinates pinned where they stand still: at and near the dead centre of a rocker."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.equilibrium.moved import Poses
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
    with pytest.warns(mv.NearSingularWarning, match=r"moved: at D\.rz"):
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


@pytest.mark.parametrize("distance", [1e-6, 1e-13, 0.0])
def test_moved_to_a_dead_centre_warns_and_names_what_reaches_it(distance):
    """The crank turns as the root of what the rocker is short of its dead centre, and of what loops are open."""
    model, _ = four_bar(angle=0.8)
    target = (rocker(0.8) - rocker(STRETCHED)) * (1.0 - distance)
    if distance > 1e-7:
        there = model.moved({"D.rz": target})
    else:
        with pytest.warns(mv.NearSingularWarning, match=r"moved: at D\.rz = .* centre of D\.rz.* value of '[ABC]\.rz'"):
            there = model.moved({"D.rz": target})
    (cosine, *_), (sine, *_), _ = there.bodies["crank"].orientation
    assert abs(np.arctan2(sine, cosine) - STRETCHED) < 3.0 * np.sqrt(max(distance, 1e-12))
    beside = model.moved({"A.rz": STRETCHED - 0.8})
    assert np.allclose(there.bodies["rocker"].position, beside.bodies["rocker"].position, rtol=0,
                       atol=distance + 1e-11)  # fmt: skip


def test_poses_at_dead_centres_are_told_by_their_number():
    model, _ = four_bar(angle=0.8)
    targets = (rocker(0.8) - rocker(STRETCHED)) * np.array([[0.1], [1.0], [0.5]])
    with pytest.warns(mv.NearSingularWarning) as caught:
        Poses.of(model, ["D.rz"], None).at(targets, "variant", 0)
    assert [str(one.message)[:10] for one in caught] == ["variant 1:"]


@pytest.mark.parametrize("off", [0.0, 1e-9, 1e-6])
def test_a_mechanism_described_at_a_dead_centre_is_not_moved_by_what_stands_still(off):
    model, _ = four_bar(angle=STRETCHED - off)
    words = r"moved: (D\.rz is at a dead centre.* Ask for a value of a coordinate|loops .* no choice for D\.rz)"
    with pytest.raises((mv.SingularPoseError, mv.ModelError), match=words):
        model.moved({"D.rz": 0.0})
