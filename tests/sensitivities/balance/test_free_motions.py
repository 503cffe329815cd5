"""Where a motion is held by nothing, of all poses that balance the nearest follows, by rules and by variants."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.sensitivities.variables import Direction
from mbsvib.sensitivities.variants import Variants

PER_TURN, FORCE, STIFFNESS = 0.3, 40.0, 100.0


def free_along_a_screw(far):
    """A bushing that holds the advance less a share of the turn; a second body is ``far`` from the first."""
    model = mv.Model("free")
    model.add_body("nut", 2.0, (0.1, 0.2, 0.3), position=(0.1, 0.0, 0.0))
    model.add_joint("shaft", "cylindrical", "ground", "nut", position=(0, 0, 0), axis=(0, 0, 1))
    row = np.array((0, 0, 1.0, 0, 0, -PER_TURN))
    model.add_bushing("thread", "ground", "nut", (0, 0, 0), (STIFFNESS * np.outer(row, row)).tolist(),
                      preload=-FORCE * row)
    model.add_load("press", "nut", force=(0, 0, FORCE), torque=(0, 0, -FORCE * PER_TURN), position=(0, 0, 0))
    model.add_body("other", 1.0, (0.1, 0.1, 0.1), position=(far, 0, 0))
    model.add_joint("way", "prismatic", "ground", "other", position=(far, 0, 0), axis=(1, 0, 0))
    model.add_bushing("hold", "ground", "other", (far, 0, 0), (5, 0, 0, 0, 0, 0))
    model.add_output("rim", "nut", "x", position=(0.5, 0, 0))
    return model


@pytest.mark.few(1)
@pytest.mark.parametrize("far", [0.5, 3.0, 100.0])
def test_the_nearest_pose_is_the_same_to_rules_and_to_variants(far):
    system = free_along_a_screw(far).linearize()
    rates = {"press.force.z": 1.0, "press.torque.z": -PER_TURN}  # moves the thread, and nothing along the free motion
    result = system.matrix_derivatives({"press": rates}).Cq
    expected = Variants(system).slopes([Direction("press", tuple(rates.items()))])["Cq"]
    turn = system.coordinates.index("shaft.rz")
    assert abs(expected[0, 0, turn]) > 1e-3
    np.testing.assert_allclose(result, expected, rtol=0, atol=1e-10)
