"""Arrays of mechanisms in many poses at once: as of the parts that are made anew in each pose."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.equations.expansion import expanded
from mbsvib.equations.posed_scene import of_parts
from mbsvib.equations.scene import scene
from mbsvib.equilibrium.motion import kinematics_of
from mbsvib.equilibrium.moved_parts import model_in_pose
from mbsvib.linalg.products import weighted_gram

SPATIAL = np.diag((9.0, 8.0, 7.0, 6.0, 5.0, 4.0)) + 0.5


def connected():
    """Two free bodies with loads and a connection of each kind that has forces at rest."""
    model = mv.Model(gravity=(0.3, 0.2, -9.81))
    for name, x in (("a", 0.0), ("b", 0.7)):
        model.add_body(name, 2.0, (0.1, 0.2, 0.25), (x, 0.1, 0.2))
    model.add_spring("line", "ground", "a", (0.1, -0.5, 0.3), (0.2, 0.1, 0.3), 50.0, 0.4, preload=3.0)
    model.add_spring("free", "a", "b", (0.1, 0.2, 0.3), (0.6, 0.1, 0.2), 40.0, free_length=0.4)
    model.add_spring("new", "a", "b", (0.1, 0.0, 0.0), (0.6, 0.3, 0.1), 30.0)
    turned = (0.3, -0.2, 0.4)
    model.add_bushing("six", "a", "b", (0.3, 0.2, 0.1), (5, 6, 7, 1, 2, 3), (1, 2, 3, 0.1, 0.2, 0.3),
                      orientation=turned, preload=(1.0, -2.0, 0.5, 0.2, 0.3, -0.4))  # fmt: skip
    model.add_bushing("matrix", "ground", "b", (0.8, 0.0, 0.1), SPATIAL, 0.1 * SPATIAL, orientation=turned)
    model.add_bushing("straight", "a", "b", (0.4, 0.0, 0.1), (10, 0, 30, 0, 0, 0))
    model.add_torsion_spring("twist", "a", "b", (0.2, 0.6, 0.77), 3.0, 0.2, preload=0.7)
    model.add_load("dead", "a", (1.0, 2.0, 3.0), (0.3, 0.2, 0.1), (0.1, 0.1, 0.5))
    model.add_load("follower", "b", (2.0, 1.0, -3.0), (0.1, 0.2, 0.1), follower=True)
    return model


@pytest.mark.parametrize("relaxed", [False, True])
def test_forces_and_stiffness_are_those_of_parts_in_each_pose(relaxed):
    model = connected()
    plain = expanded(model)
    described = scene(plain)
    kinematics = kinematics_of(model)
    posed = of_parts(plain, described, kinematics, model)
    q = np.random.default_rng(2).uniform(-0.6, 0.6, (3, 12))
    poses = kinematics.motion.moved(q)
    many = posed.at(described, poses, relaxed)
    for i in range(3):
        of_model = scene(expanded(model_in_pose(model, poses[i], relaxed)))
        for found in (posed.at(described, poses[i], relaxed), many):
            at = i if found is many else slice(None)
            matrices = [matrices_of(numbers) for numbers in (found, of_model)]
            wrenches = [on_bodies(numbers) for numbers in (found, of_model)]
            for k in (0, 1):
                scale = np.abs(matrices[1][k]).max()
                np.testing.assert_allclose(matrices[0][k][at], matrices[1][k], rtol=0, atol=1e-13 * scale)
            found_wrench = wrenches[0][at]
            np.testing.assert_allclose(found_wrench, wrenches[1], rtol=0, atol=1e-12)


def matrices_of(numbers):
    """Stiffness and damping of the connections in the coordinates of the bodies."""
    rows = numbers.relative_of(numbers.springs.rows).dense(0, len(numbers.springs.owner))
    return [weighted_gram(rows, value) for value in (numbers.springs.stiffness, numbers.springs.damping)]


def on_bodies(numbers):
    """Wrenches (6, ..., bodies) of loads and connections."""
    position = np.concatenate((numbers.position, np.zeros((*numbers.position.shape[:-2], 1, 3))), axis=-2)
    return numbers.loads[0].on_bodies(np.moveaxis(position, -1, 0))[0][..., :-1]
