"""Forces in joints and sums of forces as outputs: work on motions in which joints come apart."""

import numpy as np
import pytest
from hypothesis import assume, example, given

import mbsvib as mv
from mbsvib.sensitivities.variants import Variants
from tests.sensitivities.differences import assert_as_variants, of_variants
from tests.support.loaded_models import stiffened
from tests.support.random_models import planar, seeds, spatial
from tests.support.sizes import examples

# redundant constraints are welcome here: what they leave open is compared as well
pytestmark = pytest.mark.filterwarnings("ignore::mbsvib.UndeterminedForceWarning")

@pytest.mark.slow
@examples(2, slow=6)
@pytest.mark.filterwarnings("ignore::mbsvib.errors.NearSingularWarning")
@given(seeds())
def test_forces_of_random_mechanisms(seed):
    """In axes of joints, about their points, beside all other ports; against variants of the whole equations."""
    rng = np.random.default_rng(seed)
    model = planar(seed, 3, 1) if seed % 5 == 0 else spatial(seed, 3, seed % 3, floating=seed % 4 == 3)
    for k in range(2):
        model.add_force_output(f"carried{k}", str(rng.choice(list(model.joints))), rng.normal(size=6) if k else "y")
    if seed % 4 != 3:
        model.add_force_output("shaking", "ground", rng.normal(size=3))
        model.add_force_output("taken", str(rng.choice(list(model.bodies))), rng.normal(size=3))
    try:
        system = model.linearize()
    except mv.SingularPoseError:
        assume(False)
    assume(system.dof > 0)
    for name in map(str, rng.choice(list(system.parameters), 4, replace=False)):
        try:
            expected = of_variants(system, name)
        except mv.ModelError:
            continue
        result = system.matrix_derivatives(name)
        assert_as_variants(result, 0, system, expected, system.parameters[name], 1e-8, 1e-10)


@pytest.mark.slow
@examples(2, slow=5)
@pytest.mark.filterwarnings("ignore::mbsvib.errors.NearSingularWarning")
@given(seeds())
@example(1_185_243_431)  # virtual displacements vary, points do not
def test_forces_in_joints_of_random_loaded_mechanisms(seed):
    """What they carry at rest turns with their first bodies, and gives way with the equilibrium."""
    rng = np.random.default_rng(seed)
    try:
        model = stiffened(seed, 2, seed % 3, torque=seed % 2 == 1)
        for k, name in enumerate(model.joints):
            model.add_force_output(f"carried{k}", name, rng.normal(size=6) if k else "y")
        model.add_force_output("shaking", "ground", rng.normal(size=3))
        model.add_force_output("taken", next(iter(model.bodies)), rng.normal(size=3))
        model.add_input("push", next(iter(model.bodies)), "x", position=rng.normal(size=3))
        model.add_base_motion("floor", rng.normal(size=3))
        system = model.linearize()
    except mv.MbsvibError:
        assume(False)
    assume(system.dof > 0)
    for name in map(str, rng.choice(list(system.parameters), 3, replace=False)):
        try:
            expected, result = of_variants(system, name), system.matrix_derivatives(name)
        except mv.ModelError:
            continue
        assert_as_variants(result, 0, system, expected, system.parameters[name], 1e-8, 1e-10)


def test_bearing_of_a_pendulum_in_closed_form(monkeypatch):
    """A force on the bob meets M q'' + k q = r f; the pin carries m r q'' - f and, as a moment about z, nothing."""
    model = mv.Model("pendulum")
    model.add_body("bob", 3.0, (0.1, 0.1, 0.1), position=(0.5, 0, 0))
    model.add_joint("hinge", "revolute", "ground", "bob", position=(0, 0, 0), axis=(0, 1, 0))
    model.add_bushing("spiral", "ground", "bob", (0, 0, 0), (0, 0, 0, 0, 40.0, 0))
    model.add_input("push", "bob", "z")
    axes = np.array(model.joints["hinge"].axes)
    model.add_force_output("pin", "hinge", axes.T @ (0, 0, 1.0))
    model.add_force_output("shaking", "ground", "z")
    system = model.linearize()
    monkeypatch.setattr(Variants, "slopes", lambda *_: pytest.fail("a variant was asked for"))
    w, m, r, k, inertia = 7.0, 3.0, 0.5, 40.0, 0.1
    result = system.frequency_response_sensitivities([w], ["bob.mass", "spiral.stiffness.ry", "bob.position.x"])[..., 0]

    def pin(m, k, r):
        """Upward force on the bob: m z'' less the push, with z = r^2 f / (k - w^2 (I + m r^2))."""
        return -m * w * w * r * r / (k - w * w * (inertia + m * r * r)) - 1.0

    h = 1e-30j
    expected = np.array([pin(m + h, k, r), pin(m, k + h, r), pin(m, k, r + h)]).imag / h.imag
    sign = system.frequency_response([w])[0, 0, 0].real / pin(m, k, r)
    assert abs(abs(sign) - 1.0) < 1e-13
    assert result[:, 0, 0] == pytest.approx(sign * expected, rel=1e-12)
    total = system.frequency_response([w])[1, 0, 0].real
    assert abs(total) == pytest.approx(abs(pin(m, k, r) + 1.0), rel=1e-12)
    assert np.abs(result[:, 1, 0]) == pytest.approx(np.abs(expected), rel=1e-12)


def test_forces_that_constraints_do_not_tell_stay_beside():
    """A door on two hinges: how these share the load is a choice, which the work on a gap does not make."""
    model = mv.Model("door")
    model.add_body("door", 20.0, (1.0, 2.0, 3.0), position=(0.4, 0, 0))
    for name, height in (("lower", -0.5), ("upper", 0.5)):
        model.add_joint(name, "revolute", "ground", "door", position=(0, 0, height), axis=(0, 0, 1))
    model.add_bushing("spring", "ground", "door", (0, 0, 0), (0, 0, 0, 0, 0, 5.0))
    model.add_input("push", "door", "x", position=(0.4, 0, 0.7))
    model.add_force_output("held", "upper", "x")
    system = model.linearize()
    assert system.sensitivity_basis.ported([0], [0])[2].excluded == (0,)
    result = system.matrix_derivatives("door.mass")
    expected = of_variants(system, "door.mass")
    assert result.Ca[0] == pytest.approx(expected["Ca"], abs=1e-9)
    assert result.D[0] == pytest.approx(expected["D"], abs=1e-9)
    # of least norm: 1/2 + (z - (z1 + z2) / 2) / 2h
    share = system.D[0, 0] / 0.85
    assert abs(share) == pytest.approx(1.0, rel=1e-13)
    for name, slope in (("lower", 0.1), ("upper", -0.6)):
        assert system.matrix_derivatives(f"{name}.position.z").D[0] * share == pytest.approx(slope, rel=1e-9)


@pytest.mark.slow
def test_forces_beside_parameters_that_are_differenced():
    """A rotor on a bracket: spin goes through variants, forces in the bearing of two hinges too, each counted once."""
    model = mv.Model("rotor")
    model.add_body("bracket", 4.0, (0.2, 0.3, 0.25), position=(0.1, 0, 0.2))
    model.add_body("disc", 5.0, (0.2, 0.2, 0.4), position=(0.1, 0, 0.4))
    for name, height in (("lower", 0.0), ("upper", 0.5)):
        model.add_joint(name, "revolute", "ground", "bracket", position=(0, 0, height), axis=(0, 0, 1))
    model.add_bushing("hold", "ground", "bracket", (0.2, 0, 0.1), (4e3, 3e3, 5e3, 20, 30, 10))
    model.add_bushing("mount", "bracket", "disc", (0.1, 0, 0.35), (3e4, 2e4, 4e4, 40, 30, 0),
                      damping=(9, 8, 7, 0, 0, 0))  # fmt: skip
    model.add_rotor("spin", "disc", 50.0, (0, 0, 1))
    model.add_input("push", "disc", "x", position=(0.1, 0, 0.5))
    model.add_force_output("held", "upper", "x")
    model.add_output("seen", "disc", "x")
    system, w = model.linearize(), np.array([5.0, 40.0])
    assert system.sensitivity_basis.ported([0], [0, 1])[2].excluded == (0,)
    names = ["spin.speed", "mount.stiffness.x", "mount.position.z"]
    result = system.frequency_response_sensitivities(w, names)
    for k, name in enumerate(names):
        value, h = model.parameters[name], 1e-4 * max(abs(model.parameters[name]), 1.0)
        above, below = (model.with_values({name: value + change}).linearize(independent=system.coordinates)
                        .frequency_response(w) for change in (h, -h))  # fmt: skip
        assert result[k] == pytest.approx((above - below) / (2 * h), rel=1e-5, abs=1e-9 * np.abs(result[k]).max())
