"""Plants whose values are also displacements of joint coordinates: as of models that are moved and linearized."""

import pickle

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.equations.terms import MATRICES
from tests.equilibrium.test_moved import four_bar
from tests.kinematics.test_dead_centre import rocker

MODELS = {
    "stewart": (mv.library.stewart, ["leg1.slide.z", "leg4.slide.z"], ["leg*.k.stiffness"], True),
    "moved points": (mv.library.stewart, ["leg2.slide.z"], ["platform.position.x", "leg3.k.start.y"], True),
    "puma": (mv.library.puma, None, ["*.mass"], True),
    "hexapod": (mv.library.cubic_hexapod, None, ["*.mass"], True),
    "branches": (mv.library.tree, None, ["*.stiffness*"], True),
    "rssr": (mv.library.rssr, None, [], True),
    "beams": (mv.library.hoeken, None, [], True),
}


def first_coordinate(model):
    return [model.linearize().coordinates[0]]


@pytest.mark.parametrize("name", MODELS)
def test_matrices_are_those_of_the_moved_model(name):
    make, pose, parameters, relaxed = MODELS[name]
    model = make()
    pose = pose or first_coordinate(model)
    plant = model.compile(parameters, pose=pose, relaxed=relaxed)
    assert plant.names[-len(pose) :] == tuple(pose)
    assert not plant.nominal[-len(pose) :].any()
    rng = np.random.default_rng(3)
    count = len(plant.names) - len(pose)
    values = np.tile(plant.nominal, (2, 1))
    values[:, :count] *= 1.0 + 0.01 * rng.normal(size=(2, count))
    values[:, count:] = 0.02 * rng.normal(size=(2, len(pose)))
    batch = plant(values)
    for i, row in enumerate(values):
        own = dict(zip(plant.names, row.tolist(), strict=True))
        moves = {key: own.pop(key) for key in pose}
        there = (model.with_values(own) if own else model).moved(moves, relaxed=relaxed)
        expected = there.linearize(independent=plant.coordinates)
        for key in MATRICES:
            found, wanted = getattr(batch, key)[i], getattr(expected, key)
            np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-12 * np.abs(wanted).max(initial=1e-300))
        places = [[body.position for body in each.bodies.values()] for each in (
            batch.slice(i, i + 1)[0].provenance.origin, there)]  # fmt: skip
        np.testing.assert_allclose(*places, rtol=0, atol=1e-13)
        np.testing.assert_allclose(plant.system(row).K, batch.K[i], rtol=0, atol=1e-12 * np.abs(batch.K[i]).max())


def hanging_crank():
    """A four-bar linkage whose rocker turns against a torsion spring of 10 N m/rad."""
    model, _ = four_bar(angle=0.8)
    model.add_bushing("spring", "ground", "rocker", (1.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 10.0))
    return model


def test_stiffness_of_a_spring_at_the_rocker_over_the_angle_of_the_crank():
    plant = hanging_crank().compile("spring.stiffness.rz", pose="A.rz", independent=["A.rz"], relaxed=True)
    assert plant.units == ("N m/rad", "rad")
    angles = np.linspace(-1.5, 3.0, 4)
    values = np.stack((np.full(4, 10.0), angles), axis=-1)
    ratio = [(rocker(0.8 + a + 1e-6) - rocker(0.8 + a - 1e-6)) / 2e-6 for a in angles.tolist()]
    batch = pickle.loads(pickle.dumps(plant))(values)
    np.testing.assert_allclose(batch.K[:, 0, 0], 10.0 * np.square(ratio), rtol=1e-7)
    np.testing.assert_array_equal(batch.parameters["A.rz"], angles)


def test_poses_and_derivatives_that_there_are_none_of_are_refused_by_name():
    model = hanging_crank()
    plant = model.compile("spring.stiffness.rz", pose="D.*", relaxed=True)
    with pytest.raises(mv.ModelError, match=r"^variant 1: the loops closed by .* up to D\.rz = 0\.\d+ and no further"):
        plant([[10.0, -0.1], [10.0, 1.5]])
    for asked in (lambda: plant.tangent([10.0, 0.0], [1.0, 0.0]), lambda: plant.eigenvalues([10.0, 0.0], True)):
        with pytest.raises(mv.ModelError, match=r"pose coordinate 'D\.rz', and no derivatives in poses that vary"):
            asked()
    with pytest.raises(mv.ModelError, match=r"pose = 'D\.rx' matches no joint coordinate of model .* 'D\.rz'"):
        model.compile("spring.*", pose="D.rx")
    with pytest.raises(mv.ModelError, match=r"pose = \(\); expected names or patterns"):
        model.compile("spring.*", pose=())
