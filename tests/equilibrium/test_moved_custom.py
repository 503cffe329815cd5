"""Custom joints in other poses against the exact constraints: each number of free rotations, axes in each order."""

import numpy as np
import pytest

import mbsvib as mv
from tests.equilibrium.test_moved import check_pose, values_of
from tests.support.random_models import add_random_body, rotation

FREE = [("rx", "ry"), ("ry", "rz"), ("rx", "rz"), ("x", "y", "z", "rx", "rz"), ("x", "y", "z", "ry", "rz"), ("x", "ry"),
        ("y", "z", "rx"), ("x", "rx", "ry", "rz"), ("x", "z"), ("y", "rz")]  # fmt: skip


@pytest.mark.few(5)
@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("free", FREE, ids="-".join)
def test_custom_joints_stay_the_same_joint(free, swap):
    rng = np.random.default_rng(len("".join(free)))
    model = mv.Model()
    for name in ("near", "far"):
        add_random_body(model, rng, name, rng.uniform(-1, 1, size=3))
    pair = ("near", "ground") if swap else ("ground", "near")
    model.add_joint("joint", None, *pair, (0.2, 0.1, -0.3), orientation=rotation(rng), free=free)
    model.add_joint("weld", "fixed", "near", "far")
    there = model.moved(values_of(model, rng))
    check_pose(model, there)
    assert there.joints["joint"].free == free
    assert there.linearize().coordinates == model.linearize().coordinates
