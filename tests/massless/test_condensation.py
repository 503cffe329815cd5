"""Condensation: motions that feel neither mass nor damper follow from statics, exactly."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
from tests.massless.scenes import along_z


@pytest.mark.slow
def test_springs_in_series():
    k1, k2, mass = 100.0, 300.0, 2.0
    springs = {"k1": ("ground", "node", k1, 0), "k2": ("node", "b", k2, 0)}
    system = along_z({"node": 0.0, "b": mass}, springs).linearize()
    assert system.dof == 1
    assert system.massless == 0
    assert_allclose(system.modes().natural, [np.sqrt(k1 * k2 / (k1 + k2) / mass)], rtol=2e-15)
    assert system.provenance.separation.condensed == ("node.rail.z",)
    assert "condensed statically, as no damper acts on them: node.rail.z" in system.explain()


@pytest.mark.parametrize(("k1", "k2"), [(1e-8, 1e8), (1e8, 1e-8), (1.0, 1.0)])
def test_the_softer_spring_keeps_its_digits(k1, k2):
    system = along_z({"node": 0.0, "b": 1.0}, {"k1": ("ground", "node", k1, 0), "k2": ("node", "b", k2, 0)}).linearize()
    assert_allclose(system.modes().natural ** 2, [1 / (1 / k1 + 1 / k2)], rtol=1e-14)


def test_a_node_between_three_springs():
    """Star to triangle: k_i k_j / (k1 + k2 + k3) between each two of the three."""
    k, mass = np.array([3.0, 5.0, 7.0]), np.array([1.0, 2.0])
    springs = {"k0": ("ground", "n", k[0], 0), "k1": ("n", "a", k[1], 0), "k2": ("n", "b", k[2], 0)}
    system = along_z({"a": mass[0], "b": mass[1], "n": 0.0}, springs).linearize()
    pair = np.outer(k, k) / k.sum()
    between = np.array([[pair[0, 1] + pair[1, 2], -pair[1, 2]], [-pair[1, 2], pair[0, 2] + pair[1, 2]]])
    assert system.coordinates == ("a.rail.z", "b.rail.z")
    assert_allclose(system.K, between, rtol=1e-15)
    assert_allclose(system.M, np.diag(mass), rtol=3e-16)
    assert_allclose(system.displacements([1, 2])["n"][2], (k[1] + 2 * k[2]) / k.sum(), rtol=1e-15)


@pytest.mark.parametrize("relative", [False, True])
def test_forces_on_the_node_and_its_displacement(relative):
    k1, k2, mass = 100.0, 300.0, 2.0
    model = along_z({"node": 0.0, "b": mass}, {"k1": ("ground", "node", k1, 0), "k2": ("node", "b", k2, 0)}, relative)
    for body in ("node", "b"):
        model.add_input(f"F{body}", body, "z")
        model.add_output(f"x{body}", body, "z")
    model.add_output("v", "b", "z", quantity="velocity")
    model.add_output("a", "b", "z", quantity="acceleration")
    model.add_force_output("f1", "k1")
    omega = np.array([0.0, 1.0, 5.0, 40.0])
    result = model.linearize().frequency_response(omega)
    for i, w in enumerate(omega):
        x = np.linalg.inv(np.array([[k1 + k2, -k2], [-k2, k2 - w**2 * mass]]))
        rows = np.array([x[0], x[1], 1j * w * x[1], -(w**2) * x[1], k1 * x[0]])
        assert_allclose(result[:, :, i], rows, rtol=1e-13, atol=1e-18)


@pytest.mark.parametrize("quantity", ["velocity", "acceleration"])
def test_what_would_need_the_derivative_of_an_input_is_refused(quantity):
    model = along_z({"node": 0.0, "b": 1.0}, {"k1": ("ground", "node", 1, 0), "k2": ("node", "b", 2, 0)})
    model.add_output("x", "node", "z", quantity=quantity)
    model.add_input("Fb", "b", "z")
    model.linearize()
    model.add_input("F", "node", "z")
    with pytest.raises(mv.ModelError, match=r"output 'x' would need the derivative of input 'F'") as caught:
        model.linearize()
    assert caught.value.element == "x"


def test_what_nothing_holds_is_refused_by_name():
    model = along_z({"node": 0.0, "b": 1.0}, {"k": ("ground", "b", 1, 0)})
    with pytest.raises(mv.ModelError, match=r"'node\.rail\.z'.*moves no mass, and no spring or damper holds it"):
        model.linearize()
    model = mv.Model()
    model.add_body("point", 1.0, (0, 0, 0))
    with pytest.raises(mv.ModelError, match=r"'point\.r[xyz]'.*no spring or damper holds it.*lock it in its joint"):
        model.linearize()


def test_springs_that_cancel_are_refused_by_name():
    model = along_z({"node": 0.0, "b": 1.0}, {"k": ("ground", "node", 1, 0), "minus": ("node", "b", -1, 0)})
    with pytest.raises(mv.ModelError, match=r"'node\.rail\.z'.*cancel each other"):
        model.linearize()


def test_negative_springs_in_series():
    model = along_z({"node": 0.0, "b": 1.0}, {"k": ("ground", "node", 3, 0), "minus": ("node", "b", -1, 0)})
    assert_allclose(model.linearize().K, [[1 / (1 / 3 - 1)]], rtol=1e-15)


def test_base_motion_moves_the_node_too():
    springs = {"k1": ("ground", "node", 3.0, 0), "k2": ("node", "b", 6.0, 0)}
    model = along_z({"node": 0.0, "b": 2.0}, springs, relative=True)
    model.add_base_motion("base", "z")
    model.add_output("node", "node", "z", quantity="acceleration")
    model.add_output("b", "b", "z", quantity="acceleration")
    omega = np.array([0.1, 0.9, 3.0])
    result = model.linearize().frequency_response(omega)[:, 0]
    ratio = 2.0 / (2.0 - 2.0 * omega**2)  # 3 and 6 in series are 2
    assert_allclose(result, [1 + (ratio - 1) * 2 / 3, ratio], rtol=1e-13)


def test_point_masses_without_inertia():
    """A triangle of point masses on springs turns, a point mass in a spherical joint at a distance swings."""
    model = mv.Model()
    model.add_body("bob", 2.0, (0, 0, 0), position=(0, 0, -0.5))
    model.add_joint("hook", "universal", "ground", "bob", position=(0, 0, 0), axis=(1, 0, 0), axis2=(0, 1, 0))
    model.add_bushing("k", "ground", "bob", position=(0, 0, 0), stiffness=(0, 0, 0, 3, 3, 0))
    system = model.linearize()
    assert system.provenance.separation is None
    assert_allclose(system.M, 0.5 * np.eye(2), rtol=1e-15)


def test_the_user_may_choose_what_stays():
    springs = {"k1": ("ground", "node", 3.0, 0), "k2": ("node", "b", 6.0, 0)}
    model = along_z({"node": 0.0, "b": 2.0}, springs, relative=True)
    for name in ("node.rail.z", "b.rail.z"):
        system = model.linearize(independent=[name])
        assert system.coordinates == (name,)
        assert_allclose(system.K / system.M, 1.0, rtol=1e-14)
    with pytest.raises(mv.ModelError, match=r"independent: coordinate '(node|b)\.rail\.z' cannot be kept"):
        model.linearize(independent=["node.rail.z", "b.rail.z"])


def test_rigid_body_modes_stay_exactly_zero():
    springs = {"k1": ("a", "node", 0.3, 0), "k2": ("node", "b", 0.7, 0)}
    system = along_z({"a": 1.1, "node": 0.0, "b": 2.3}, springs).linearize()
    omega = system.modes().natural
    assert omega[0] == 0.0
    assert_allclose(omega[1] ** 2, 0.21 * (1 / 1.1 + 1 / 2.3), rtol=1e-14)


def test_a_massless_body_that_nothing_holds_is_named():
    model = mv.Model("loose")
    model.add_body("a", 1.0, (1, 1, 1))
    model.add_body("flag", 0.0, (0, 0, 0), position=(1, 0, 0))
    model.add_joint("pin", "revolute", "a", "flag", (1, 0, 0), axis=(0, 0, 1))
    with pytest.raises(mv.ModelError, match=r"coordinate 'pin\.rz' of body 'flag': the mass matrix is singular"):
        model.linearize()
