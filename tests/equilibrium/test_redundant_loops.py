"""Equilibrium where loops are redundant as a whole: nothing is moved by what they are open by, which is rounding."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
from tests.kinematics.test_loops import scaled
from tests.support.random_models import moved, planar, rotation, turned


def door(rng, offset, arm, *second):
    turn = rotation(rng)
    origin = (1.0 + offset) * rng.uniform(-1, 1, size=3)
    model = mv.Model("door", gravity=(0, 0, -9.81))
    model.add_body("door", 2.0, (0.1, 0.2, 0.3), origin + turn @ (arm, 0.1, 0.3))
    model.add_joint("hinge", "revolute", "ground", "door", origin, axis=turn[:, 2])
    for k, kind in enumerate(second):
        model.add_joint(f"second{k}", kind, "ground", "door", origin + 0.7 * (k + 1) * turn[:, 2], axis=turn[:, 2])
    model.add_bushing("k", "ground", "door", origin, (0, 0, 0, 0, 0, 60.0 * arm), orientation=turn)
    return model


@pytest.mark.slow
@pytest.mark.parametrize("second", [("revolute",), ("cylindrical", "spherical")])
def test_a_door_sags_as_on_one_hinge(second):
    for seed in range(4):
        offset, arm = 1e3 * (seed % 2), 300.0 if seed > 1 else 0.5
        single, more = (door(np.random.default_rng(seed), offset, arm, *kinds).equilibrium() for kinds in ((), second))
        atol = 1e-12 * (1 + offset + arm)
        assert_allclose(more.bodies["door"].position, single.bodies["door"].position, rtol=0, atol=atol)
        single, dense, sparse = single.linearize(), more.linearize(), more.linearize(method="sparse")
        assert (dense.dof, sparse.dof) == (1, 1)
        assert_allclose(dense.K, single.K, rtol=1e-9)
        assert_allclose(sparse.modes(1).frequencies, single.modes().frequencies, rtol=1e-9)


@pytest.mark.parametrize("seed", [0, 1, 2, 5])
def test_loops_close_as_far_as_points_are_rounded(seed):
    """A four-bar of some centimetres ten kilometres off the origin: points are rounded by 1e-10 of its size."""
    origin = 1e4 * np.array([0.6, -0.64, 0.48])
    near = scaled(turned(planar(seed, 3, 1, damped=False, ports=False), rotation(np.random.default_rng(seed))), 1e-2)
    step = {near.linearize().coordinates[0]: 0.05}
    there, far = near.moved(step, relaxed=True), moved(near, origin).moved(step, relaxed=True)
    for body in near.bodies:
        location = np.array(far.bodies[body].position) - origin
        assert_allclose(location, there.bodies[body].position, rtol=0, atol=1e-10)
    assert (far.linearize().dof, len(far.linearize().redundant)) == (1, 3)
