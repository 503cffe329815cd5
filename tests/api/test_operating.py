"""Operating deflection shapes and contributions of modes against direct solutions of the matrices."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
from mbsvib import library

W = 2 * np.pi * np.array([3.0, 9.7, 40.0, 300.0])


def solved(system, w, u):
    return np.linalg.solve(system.K + 1j * w * system.C - w**2 * system.M, system.B @ u)


def test_a_deflection_shape_solves_the_equations():
    system = library.stewart_isolator().linearize()
    amplitudes = {"Fx": 2.0, "Mz": 1j}
    shape = system.deflection_shape(12.0, amplitudes)
    u = np.array([amplitudes.get(name, 0.0) for name in system.inputs])
    q = solved(system, 24 * np.pi, u)
    assert_allclose([*shape.coordinates.values()], q, rtol=1e-9, atol=1e-12 * np.abs(q).max())
    assert list(shape.coordinates) == list(system.coordinates)
    assert_allclose(shape.body_shapes["platform"], system.displacements(q)["platform"], atol=1e-12 * np.abs(q).max())
    assert "12 Hz" in repr(shape)
    assert set(system.deflection_shape(12.0, "F*").inputs) == {"Fx", "Fy", "Fz"}


def test_near_a_resonance_it_is_the_mode_in_quadrature():
    model = mv.Model("mass")
    model.add_body("b", 1.0, (1, 1, 1))
    model.add_joint("rail", "prismatic", "ground", "b", position=(0, 0, 0), axis=(1, 0, 0))
    model.add_spring("k", "ground", "b", (-1, 0, 0), (0, 0, 0), stiffness=100.0, damping=0.4)
    model.add_input("F", "b", "x")
    shape = model.linearize().deflection_shape(10.0 / (2 * np.pi), "F")
    assert_allclose(shape.body_shapes["b"][0], -1j / (10.0 * 0.4), rtol=1e-9)


@pytest.mark.slow
def test_it_moves_as_modes_do(tmp_path):
    system = library.stewart_isolator().linearize()
    motion = system.deflection_shape(9.6, "Fx").animate(tmp_path / "shape.gif", frames=3, amplitude=0.2)
    assert (tmp_path / "shape.gif").stat().st_size > 2000
    assert motion.title == "9.6 Hz, Fx"
    assert np.linalg.norm(motion.shape, axis=1).max() == pytest.approx(0.2 * motion.scene.size)


def outputs_of_all_orders(model):
    for name in ("velocity", "acceleration"):
        model.add_output(name, "body1", "rz", quantity=name)
    return model


@pytest.mark.parametrize("make", [
    library.stewart_isolator, library.quarter_car, library.rotor_stator,
    lambda: outputs_of_all_orders(library.chain(4)),
], ids=["damped", "car", "gyroscopic", "velocities"])  # fmt: skip
def test_contributions_add_up_to_the_response(make):
    system = make().linearize()
    parts = system.mode_contributions(W)
    total = system.frequency_response(W)
    assert parts.shape == (system.dof, *total.shape)
    assert_allclose(parts.sum(axis=0) + system.D[:, :, None], total, rtol=0.0, atol=1e-8 * np.abs(total).max())


def test_a_contribution_is_that_of_one_mode_alone():
    """With classical damping c phi (phi^T b) s^2 / (Omega^2 + 2 zeta Omega s + s^2), phi mass-normalised."""
    system = outputs_of_all_orders(library.chain(4)).linearize()
    modes = system.modes()
    phi = modes.shapes / np.sqrt(np.einsum("ik,ij,jk->k", modes.shapes, system.M, modes.shapes))
    parts = system.mode_contributions(W, "acceleration", system.inputs[0])
    gain = (system.Ca[system.outputs.index("acceleration")] @ phi) * (phi.T @ system.B[:, 0])
    natural, ratio = (2 * np.pi * modes.frequencies)[:, None], modes.damping_ratios[:, None]
    down = natural**2 - W**2 + 2j * ratio * natural * W
    assert_allclose(parts[:, 0, 0], gain[:, None] * -(W**2) / down, rtol=1e-8)


def test_mistakes_are_told():
    system = library.stewart_isolator().linearize()
    with pytest.raises(mv.MbsvibError, match="input 'F'"):
        system.deflection_shape(10.0, {"F": 1.0})
    with pytest.raises(mv.ResponseError):
        system.deflection_shape(np.inf, "Fx")
    matrices = mv.System.from_matrices(np.eye(1), None, np.eye(1))
    with pytest.raises(mv.MbsvibError, match="deflection_shape"):
        matrices.deflection_shape(1.0)


def test_motions_without_mass_contribute_by_their_single_eigenvalue():
    model = mv.Model("relaxing")
    for name, mass, x in (("a", 1.0, 0.0), ("node", 0.0, 1.0)):
        model.add_body(name, mass, (0, 0, 0), (x, 0, 0))
        model.add_joint(f"rail {name}", "prismatic", "ground", name, (x, 0, 0), axis=(1, 0, 0))
    model.add_spring("k", "ground", "a", (-1, 0, 0), (0, 0, 0), 100.0, 1.0)
    model.add_spring("soft", "a", "node", (0, 0, 0), (1, 0, 0), 30.0)
    model.add_spring("damper", "node", "ground", (1, 0, 0), (2, 0, 0), damping=0.5)
    model.add_input("push", "a", "x")
    model.add_output("x", "a", "x")
    system, omega = model.linearize(), np.array([1.0, 9.0, 30.0])
    # x (30 + 0.5 s) = node ... : G = (30 + 0.5 s) / ((s^2 + s + 130)(30 + 0.5 s) - 900)
    above, below = np.poly1d([0.5, 30.0]), np.poly1d([1, 1, 130]) * np.poly1d([0.5, 30.0]) - 900.0
    poles = below.roots
    parts = above(poles) / below.deriv()(poles) / (1j * omega[:, None] - poles)
    single = np.abs(poles.imag) == 0.0
    expected = np.array([parts[:, ~single].sum(axis=1), parts[:, single].sum(axis=1)])
    np.testing.assert_allclose(system.mode_contributions(omega)[:, 0, 0], expected, rtol=1e-12)


def test_names_in_place_of_frequencies_are_told_as_such():
    """What is wrong is the first argument, not the names behind it."""
    system, driven = mv.library.quarter_car().linearize(), mv.library.chain(600).linearize()
    for call in (system.frequency_response, system.mode_contributions, driven.frequency_response):
        with pytest.raises(mv.errors.ResponseError, match=r"omega = 'body\.az'; expected a vector of numbers"):
            call("body.az", "road")
