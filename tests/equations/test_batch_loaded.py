"""Batches of loaded models: the same as linearizing each variant, with statics of its own."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.library import four_bar, hinged_rod, pendulum_chain
from tests.hunt.generate import example


def test_gravity_varies():
    batch = hinged_rod().linearize(values={"gravity.z": [-1.62, -3.7, -9.81]})
    squares = np.square(2 * np.pi * batch.modes().frequencies[:, 0])
    np.testing.assert_allclose(squares, 14.678304239401497 * np.array([1.62, 3.7, 9.81]) / 9.81, rtol=1e-13)
    np.testing.assert_allclose([system.reactions["hinge"][2] for system in batch], [16.2, 37.0, 98.1], rtol=1e-14)
    assert batch[1].parameters["gravity.z"] == -3.7
    assert batch.coordinates == ("hinge.rz",)


@pytest.mark.parametrize(("make", "name", "values"), [
    (lambda: pendulum_chain(4), "m3.mass", [0.5, 1.0, 2.0]),
    (four_bar, "spring.stiffness", [10.0, 60.0, 500.0]),
    (hinged_rod, "rod.position.y", [0.0, 0.0]),
])  # fmt: skip
def test_variants_are_those_of_single_models(make, name, values):
    model = make()
    batch = model.linearize(values={name: values})
    assert len(batch) == len(values)
    omega = [0.3, 2.0, 11.0]
    responses, modes = batch.frequency_response(omega), batch.modes()
    for i, value in enumerate(values):
        single = model.with_values({name: value}).linearize(independent=batch.coordinates)
        for matrix in ("M", "C", "K", "B", "Cq", "Ca", "D"):
            np.testing.assert_allclose(getattr(batch, matrix)[i], getattr(single, matrix), rtol=1e-14, atol=1e-14)
        expected = single.frequency_response(omega)
        np.testing.assert_allclose(responses[i], expected, rtol=0, atol=1e-12 * np.abs(expected).max())
        np.testing.assert_allclose(modes.eigenvalues[i], single.modes().eigenvalues, rtol=1e-12)
        assert batch[i].stiffness_shares() is not None
        again = batch[i].frequency_response(omega)
        np.testing.assert_allclose(again, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


def test_rows_that_only_some_variants_have():
    model = mv.Model("mast", gravity=(0, 0, -9.81))
    model.add_body("rod", 2.0, (0.3, 0.3, 0.1), position=(0, 0, 0.5))
    model.add_joint("hinge", "revolute", "ground", "rod", (0, 0, 0), axis=(1, 0, 0))
    model.add_spring("stay", "ground", "rod", (0, 0, -1.0), (0, 0, 1.0), 100.0, preload=5.0)
    model.add_input("F", "rod", "y")
    batch = model.linearize(values={"stay.preload": [0.0, 5.0, 50.0], "gravity.z": [-9.81, 0.0, -9.81]})
    # the stay is 2 cos(angle / 2) long, the centre of mass half as high as it: both pull the rod over
    expected = -0.5 * np.array([0.0, 5.0, 50.0]) - 2.0 * 0.5 * np.array([9.81, 0.0, 9.81])
    np.testing.assert_allclose(batch.K[:, 0, 0], expected, rtol=1e-13)
    np.testing.assert_allclose([system.K[0, 0] for system in batch], expected, rtol=1e-13)


def test_a_variant_out_of_balance_is_named_by_its_index():
    model = four_bar()
    preload = model.springs["spring"].preload
    with pytest.raises(mv.EquilibriumError, match=r"variant 1: model 'four_bar' is not in balance"):
        model.linearize(values={"spring.preload": [preload, 2 * preload]})


def post(gravity=None, **spring):
    model = mv.Model("post", gravity=gravity)
    model.add_body("rod", 1.0, (0.1, 0.1, 0.1), position=(0, 0, 1))
    model.add_joint("foot", "universal", "ground", "rod", (0, 0, 0))
    model.add_spring("stay", "ground", "rod", (0, 0, 3), (0, 0, 1.5), 100.0, **spring)
    model.add_bushing("pad", "ground", "rod", (0, 0, 0.5), (0, 0, 0, 5, 5, 5), preload=(0, 0, 0, 0, 0, 0))
    model.add_input("F", "rod", "x")
    return model


@pytest.mark.parametrize(("model", "name", "value"), [
    (post(preload=0.0), "stay.preload", 50.0),
    (post(free_length=1.5), "stay.free_length", 1.0),
    (post(free_length=1.5), "stay.start.z", 2.5),
    (post(gravity=(0, 0, 0)), "gravity.z", -9.81),
    (post(), "pad.preload.z", 20.0),
])  # fmt: skip
def test_a_model_without_loads_has_variants_with_loads(model, name, value):
    batch = model.linearize(values={name: [0.5 * value, value]})
    for system, part in zip(batch, (0.5, 1.0), strict=True):
        expected = model.with_values({name: part * value}).linearize()
        np.testing.assert_allclose(system.K, expected.K, rtol=1e-14)


def test_values_that_an_element_refuses_are_named_by_variant():
    model = post()
    model.add_inerter("flywheel", "ground", "rod", (0, 0, 3), (0, 0, 1.5), 2.0)
    with pytest.raises(mv.ModelError, match=r"variant 1: values\['flywheel.inertance'\]\[1\] = -1"):
        model.linearize(values={"flywheel.inertance": [1.0, -1.0]})


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::mbsvib.UndeterminedForceWarning")
def test_the_point_of_a_cut_joint_without_locked_rows_weighs_forces_of_least_norm():
    """Moments in the redundant loop are weighed by the points of all of its joints, that of a free joint included."""
    model = example(40168).scene.model()
    value = model.parameters["j1.position.x"]
    batch = model.linearize(values={"j1.position.x": [value, value + 1e-3]})
    alone = model.with_values({"j1.position.x": value + 1e-3}).linearize(method="dense")
    np.testing.assert_allclose(batch[1].Cq, alone.Cq, rtol=1e-11, atol=1e-11 * np.abs(alone.Cq).max())
