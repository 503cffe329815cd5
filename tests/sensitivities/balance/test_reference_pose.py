"""Derivatives where the equilibrium was found away from where the model is described."""

import numpy as np
import pytest
from hypothesis import assume, given
from scipy.optimize import brentq

import mbsvib as mv
from mbsvib.api.in_equilibrium import in_equilibrium
from mbsvib.sensitivities.variants import Variants
from tests.sensitivities.differences import assert_as_variants, of_variants
from tests.support.loaded_models import loaded
from tests.support.random_models import seeds
from tests.support.sizes import examples

# Every variant finds an equilibrium of its own, to some 1e-12 of the forces; differences make more of it.
RTOL, NOISE = 1e-6, 1e-9


def off_balance(seed, moments=False):
    """A random mechanism that stiff springs hold, away from its equilibrium; its bushings carry forces alone."""
    rng = np.random.default_rng(seed)
    model = loaded(seed, 2, seed % 4, torque=seed % 2 == 1, follower=seed % 4 > 1)
    if not moments:
        fields, ways = (".stiffness.", ".damping.", ".preload."), (".rx", ".ry", ".rz")
        turns = [name for name in model.parameters if any(field in name for field in fields)
                 and any(way in name for way in ways)]  # fmt: skip
        model = model.with_values(dict.fromkeys(turns, 0.0))
    for body in list(model.bodies):
        for i in range(3):
            start, end = np.array(model.bodies[body].position) + rng.normal(size=(2, 3))
            model.add_spring(f"{body}.line{i}", "ground", body, start, end, 2e5, preload=1e2 if i else None)
            held = 1e6 * rng.random(6) * ([1] * 6 if moments else [1, 1, 1, 0, 0, 0])
            model.add_bushing(f"{body}.mount{i}", "ground", body, end, held)
        model.add_input(f"{body}.push", body, rng.normal(size=3), position=start)
        model.add_output(f"{body}.seen", body, rng.normal(size=3), position=end, quantity="acceleration")
    return model


def check(model, system, names):
    result = system.matrix_derivatives(names)
    for k, name in enumerate(names):
        try:
            expected = of_variants(system, name)
        except mv.ModelError:
            assume(False)
        assert_as_variants(result, k, system, expected, model.parameters[name], RTOL, NOISE)


@pytest.mark.slow
@examples(1, slow=8)
@pytest.mark.filterwarnings("ignore::mbsvib.errors.NearSingularWarning")
@given(seeds())
def test_differences_of_equilibria_found_for_every_variant(seed):
    try:
        model = off_balance(seed)
        _, system = in_equilibrium(model)
    except mv.MbsvibError:
        assume(False)
    assume(system.dof > 0 and system.provenance.moved_to_equilibrium)
    assert system.sensitivity_basis.loaded is not None
    rng = np.random.default_rng(seed)
    fields = (".mass", ".position.", ".orientation.", ".start.", ".end.", ".stiffness", ".damping.", ".pitch",
              "gravity.")  # fmt: skip
    names = [[name for name in model.parameters if field in name] for field in fields]
    selected = [str(rng.choice(some)) for some in names if some]
    check(model, system, [str(name) for name in rng.choice(selected, 4, replace=False)])


def hanging(angle, **words):
    """A pendulum with a spring, described at some angle from where it comes to rest."""
    model = mv.Model("hanging", gravity=(0, 0, -9.81))
    location = 0.5 * np.array([np.sin(angle), 0, -np.cos(angle)])
    model.add_body("bob", 3.0, (0.1, 0.1, 0.1), position=location)
    model.add_joint("hinge", "revolute", "ground", "bob", position=(0, 0, 0), axis=(0, 1, 0))
    for name, value in words.items():
        model.add_bushing(name, "ground", "bob", (0, 0, 0), value)
    return model


def test_a_pendulum_described_at_an_angle():
    """omega^2 = m g r / (I + m r^2) wherever it is described; moving its bob across changes r by the sine only."""
    m, r, g, angle = 3.0, 0.5, 9.81, 0.7
    _, system = in_equilibrium(hanging(angle))
    assert system.provenance.moved_to_equilibrium
    full = 0.1 + m * r * r
    square = m * g * r / full
    by_r = m * g / full - square * 2 * m * r / full
    slopes = {"bob.position.x": by_r * np.sin(angle), "bob.position.z": -by_r * np.cos(angle),
              "hinge.position.x": -by_r * np.sin(angle), "hinge.position.z": by_r * np.cos(angle),
              "bob.mass": g * r / full - square * r * r / full, "gravity.z": -square / g,
              "gravity.x": 0.0}  # fmt: skip
    result = 2 * np.sqrt(square) * system.eigenvalue_sensitivities(list(slopes))[:, 0].imag
    assert result == pytest.approx(list(slopes.values()), rel=1e-10, abs=1e-10)


@pytest.mark.slow
def test_what_turned_bushings_do_about_axes_is_differenced(monkeypatch):
    """k about the hinge, slack at an angle a: omega^2 = (m g r cos b + k) / (I + m r^2), k (b - a) = -m g r sin b."""
    k, angle = 20.0, 0.7
    _, system = in_equilibrium(hanging(angle, spiral=(0, 0, 0, 0, k, 0)))
    asked = []
    slopes = Variants.slopes
    monkeypatch.setattr(Variants, "slopes", lambda *words: asked.append(1) or slopes(*words))
    result = system.eigenvalue_sensitivities("spiral.stiffness.ry")[0, 0].imag
    assert asked
    def omega(stiff):
        rest = brentq(lambda b: stiff * (b - angle) + 3 * 9.81 * 0.5 * np.sin(b), 0, angle, xtol=1e-15)
        return np.sqrt((3 * 9.81 * 0.5 * np.cos(rest) + stiff) / 0.85)

    expected = (8 * (omega(k + 0.01) - omega(k - 0.01)) - omega(k + 0.02) + omega(k - 0.02)) / 0.12
    assert result == pytest.approx(expected, rel=1e-8)


@pytest.mark.slow
def test_dampers_of_turned_bushings_act_in_axes_of_both_bodies():
    """A damper about axes across the turn: C goes with the rotation vector, and is no longer its own value."""
    model = mv.Model("ball", gravity=(0, 0, -9.81))
    model.add_body("bob", 3.0, (0.1, 0.2, 0.15), position=(0.3, 0, -0.4))
    model.add_joint("ball", "spherical", "ground", "bob", position=(0, 0, 0))
    model.add_bushing("mount", "ground", "bob", (0.1, 0.2, -0.3), (60.0, 80.0, 50.0, 0, 0, 0),
                      damping=(0, 0, 0, 0.1, 0.2, 0.3))  # fmt: skip
    _, system = in_equilibrium(model)
    assert system.provenance.moved_to_equilibrium
    result, h = system.matrix_derivatives("mount.damping.rx").C[0], 1e-3

    def at(value):
        return in_equilibrium(model.with_values({"mount.damping.rx": value}))[1].C

    assert result == pytest.approx((at(0.1 + h) - at(0.1 - h)) / (2 * h), rel=1e-9, abs=1e-10)
