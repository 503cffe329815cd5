"""Forces in a bearing of a rotor that turns about the bearing's own axis."""

import numpy as np

import mbsvib as mv
from tests.support.random_models import rotation


def test_turning_about_its_axis_a_rotor_exerts_no_gyroscopic_moment():
    axes = rotation(np.random.default_rng(4))
    model = mv.Model("disc")
    model.add_body("disc", 0.6, (0.02, 0.02, 0.03), (0.1, 0.2, 0.3), axes)
    model.add_joint("bearing", "revolute", "ground", "disc", (0.1, 0.2, 0.3), axes)
    model.add_rotor("spin", "disc", 10.0, axis=axes[:, 2])
    model.add_force_output("force", "bearing", (0.7, 0.1, -0.9, -0.6, 2.4, 0.6))
    system = model.linearize(method="dense")
    assert not system.Cv.any()
    assert system.Ca.all()
