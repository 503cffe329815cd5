"""Inerters against closed forms: mass matrices, frequencies, force outputs, and what a moving ground does to them."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv

M, K, B, C = 2.0, 800.0, 3.0, 5.0


def oscillator(damping=0.0):
    model = mv.Model("oscillator")
    model.add_body("m", M, (0.1, 0.1, 0.1))
    model.add_joint("guide", "prismatic", "ground", "m", axis=(0, 0, 1))
    model.add_spring("k", "ground", "m", (0, 0, -1), (0, 0, 0), K, damping)
    model.add_inerter("b", "ground", "m", (0, 0, -1), (0, 0, 0), B)
    return model


def test_an_inerter_to_ground_is_a_mass_that_the_moving_ground_does_not_feel():
    model = oscillator(C)
    model.add_base_motion("a", "z")
    model.add_output("z", "m", "z")
    model.add_force_output("Fb", "b")
    for method in ("dense", "sparse"):
        omega = np.array([3.0, 12.0, 40.0])
        s = 1j * omega
        response = model.linearize(method=method).frequency_response(omega)
        stroke = -M / ((M + B) * s**2 + C * s + K)
        assert_allclose(response[0, 0], stroke, rtol=1e-13)
        assert_allclose(response[1, 0], B * s**2 * stroke, rtol=1e-13)
        assert model.linearize(method=method).modes(1).frequencies[0] == pytest.approx(
            np.sqrt(K / (M + B)) / (2 * np.pi), rel=1e-14)  # fmt: skip


def test_it_acts_on_both_bodies_along_its_line():
    """Two masses on rails across each other: M = diag(m) + b e e^T with the components of the line."""
    model = mv.Model("pair")
    model.add_body("one", 1.0, (0.1, 0.1, 0.1), (0, 0, 0))
    model.add_body("two", 2.0, (0.1, 0.1, 0.1), (3, 0, 4))
    model.add_joint("x", "prismatic", "ground", "one", axis=(1, 0, 0))
    model.add_joint("z", "prismatic", "ground", "two", axis=(0, 0, 1))
    model.add_inerter("b", "one", "two", (0, 0, 0), (3, 0, 4), B)
    along = np.array([-0.6, 0.8])
    assert_allclose(model.linearize().M, np.diag([1.0, 2.0]) + B * np.outer(along, along), rtol=1e-15)


def test_its_reaction_goes_through_joints_to_the_ground():
    """The guide carries what the inerter pushes across it; the sum on the body is its own momentum."""
    model = oscillator()
    model = model.replace("b", start=(-1.0, 0.0, -1.0))
    model.add_input("F", "m", "z")
    model.add_force_output("side", "guide", "x")
    model.add_force_output("sum", "m", "z")
    model.add_force_output("ground", "ground", "z")
    half = np.sqrt(0.5)
    for method in ("dense", "sparse"):
        omega = np.array([5.0, 30.0])
        s2 = -(omega**2)
        side, total, ground = model.linearize(method=method).frequency_response(omega)[:, 0]
        z = 1 / ((M + 0.5 * B) * s2 + K)
        assert_allclose(side, -half * B * half * s2 * z, rtol=1e-12)  # pulls the ground to the body along -x
        assert_allclose(total, M * s2 * z, rtol=1e-12)
        assert_allclose(ground, -M * s2 * z, rtol=1e-11)


def test_a_massless_body_may_have_an_inerter_only():
    model = mv.Model("light")
    model.add_body("p", 0.0, (0, 0, 0))
    model.add_joint("guide", "prismatic", "ground", "p", axis=(0, 0, 1))
    model.add_spring("k", "ground", "p", (0, 0, -1), (0, 0, 0), K)
    model.add_inerter("b", "ground", "p", (0, 0, -1), (0, 0, 0), B)
    system = model.linearize()
    assert system.dof == 1
    assert system.modes().frequencies[0] == pytest.approx(np.sqrt(K / B) / (2 * np.pi), rel=1e-14)


def test_parameters_batches_sensitivities_and_poses():
    model = oscillator(C)
    batch = model.linearize(values={"b.inertance": [1.0, 4.0]})
    assert_allclose(batch.M[:, 0, 0], [M + 1.0, M + 4.0], rtol=1e-15)
    assert model.parameters.units["b.inertance"] == "kg"
    root = -C / (2 * (M + B)) + 1j * np.sqrt(K / (M + B) - (C / (2 * (M + B))) ** 2)
    slope = -(root**2) / (2 * root * (M + B) + C)
    system = model.linearize()
    upper = system.modes().eigenvalues.imag > 0
    assert_allclose(system.eigenvalue_sensitivities(["b.inertance"])[0, upper], [slope], rtol=1e-8)
    there = model.moved({"guide.z": 0.5}, relaxed=True)
    assert there.springs["b"].end == (0.0, 0.0, 0.5)


@pytest.mark.parametrize(("words", "message"), [
    ({"inertance": 0.0}, r"inerter 'b': inertance = 0.0; expected a positive number \[kg\]"),
    ({"inertance": -1.0}, "expected a positive number"),
    ({"end": (0, 0, -1)}, "An inerter of no length has no line"),
    ({"second": "ground"}, "connects body 'ground' with itself"),
])  # fmt: skip
def test_refusals(words, message):
    with pytest.raises(mv.ModelError, match=message):
        oscillator().replace("b", **words)


def test_explain_does_not_call_it_idle():
    for method in ("dense", "sparse"):
        assert "without effect" not in oscillator().linearize(method=method).explain()


def test_one_in_a_mechanism_that_cannot_move_does_nothing():
    model = mv.Model("locked")
    model.add_body("plate", 2.0, (0.1, 0.1, 0.1), position=(1, 0, 0))
    model.add_joint("weld", "fixed", "ground", "plate", (0, 0, 0))
    model.add_joint("rod", "distance", "ground", "plate", (0, 1, 0), end=(1, 0, 0))
    model.add_inerter("still", "ground", "plate", (0, 0, 1), (1, 0, 0), 3.0)
    system = model.linearize()
    assert system.dof == 0
    assert system.M.shape == (0, 0)
