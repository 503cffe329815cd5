"""Sensitivities under load, with couplers and spin: what enters by motions has them, the rest is refused by name."""

import numpy as np
import pytest
from hypothesis import assume, given, settings

import mbsvib as mv
from tests.sensitivities.differences import assert_derivative, difference, eigenvalues, step_of
from tests.support.loaded_models import loaded
from tests.support.random_models import seeds

MATRICES = ("M", "C", "K")


def known(system):
    """Names of parameters that enter by motions alone."""
    return [name for name in system.parameters if ".damping" in name or ".inertia" in name
            or (".stiffness" in name and not name.startswith("free"))]  # fmt: skip


@pytest.mark.filterwarnings("ignore::mbsvib.errors.NearSingularWarning")
@settings(max_examples=8, deadline=None)
@given(seeds())
def test_differences_of_random_mechanisms_under_load(seed):
    try:
        model = loaded(seed, 2, seed % 2, follower=seed % 3 == 0, couplers=seed % 4 == 1)
        system = model.linearize()
    except mv.MbsvibError:
        assume(False)
    assume(system.dof > 0)
    names = known(system)
    found, values = system.matrix_derivatives(names), system.eigenvalue_sensitivities(names)
    for k in np.random.default_rng(seed).choice(len(names), size=4, replace=False):
        at = difference(model, system, names[k], lambda s: [getattr(s, key) for key in MATRICES])
        for key, expected in zip(MATRICES, at, strict=True):
            size = np.abs(getattr(system, key)).max() / step_of(system.parameters, names[k])
            assert np.abs(getattr(found, key)[k] - expected).max() <= 1e-8 * np.abs(expected).max() + 1e-12 * size
    assert np.isfinite(values).all()


def pendulum():
    """omega^2 = (k + m g r) / I: a spiral spring and gravity."""
    model = mv.Model("pendulum", gravity=(0, 0, -9.81))
    model.add_body("bob", 3.0, (0.1, 0.1, 0.1), position=(0, 0, -0.5))
    model.add_joint("hinge", "revolute", "ground", "bob", position=(0, 0, 0), axis=(0, 1, 0))
    model.add_bushing("spiral", "ground", "bob", (0, 0, 0), (0, 0, 0, 0, 40.0, 0))
    return model


def test_pendulum_in_closed_form():
    found = pendulum().linearize().eigenvalue_sensitivities(["spiral.stiffness.ry", "bob.inertia.yy"])
    inertia = 0.1 + 3.0 * 0.25
    omega = np.sqrt((40.0 + 3.0 * 9.81 * 0.5) / inertia)
    assert found[:, 0] == pytest.approx([1j / (2 * omega * inertia), -0.5j * omega / inertia], rel=1e-13)


def test_what_moves_the_equilibrium_is_refused_by_name():
    system = pendulum().linearize()
    with pytest.raises(mv.ModelError, match=r"'gravity' loads the mechanism, where 'bob\.mass' has no") as refusal:
        system.eigenvalue_sensitivities("bob.mass")
    assert refusal.value.element == "bob.mass"
    with pytest.raises(mv.ModelError, match=r"'hinge\.position\.x' has no derivative yet; .* stiffness, damping"):
        system.matrix_derivatives(["spiral.stiffness.ry", "hinge.position.x"])


def rotor():
    model = mv.Model("rotor")
    model.add_body("disc", 5.0, (0.2, 0.2, 0.4))
    model.add_bushing("bearing", "ground", "disc", (0, 0, 0.1), (3e4, 2e4, 5e4, 4e3, 3e3, 0.0),
                      damping=(3.0, 2.0, 5.0, 0.4, 0.3, 0.0))  # fmt: skip
    model.add_rotor("spin", "disc", 300.0, axis=(0, 0, 1))
    model.add_input("push", "disc", "x")
    model.add_output("tilt", "disc", "rx")
    return model


def test_rotors_have_those_of_stiffness_and_damping():
    model = rotor()
    system = model.linearize()
    assert system.gyroscopic is not None
    names = ["bearing.stiffness.x", "bearing.stiffness.ry", "bearing.damping.rx"]
    found = system.eigenvalue_sensitivities(names)
    values = system.modes().eigenvalues
    for row, name in zip(found, names, strict=True):
        expected, step = difference(model, system, name, eigenvalues), step_of(system.parameters, name)
        assert_derivative(row, expected, values, step, 1e-7)
    w = np.array([5.0, 40.0, 200.0])
    for row, name in zip(system.frequency_response_sensitivities(w, names), names, strict=True):
        expected = difference(model, system, name, lambda s: s.frequency_response(w))
        assert np.abs(row - expected).max() <= 1e-7 * np.abs(expected).max() + 1e-15
    with pytest.raises(mv.ModelError, match=r"'spin' spins, where 'disc\.mass' has no derivative yet"):
        system.eigenvalue_sensitivities("disc.mass")
    with pytest.raises(mv.ModelError, match=r"'spin' makes motions without mass or matrices without symmetry"):
        system.h2_norm(names)
