"""Sensitivities of frequency responses: closed forms, differences of the whole computation, random mechanisms."""

import numpy as np
import pytest
from hypothesis import assume, given, settings

import mbsvib as mv
from tests.sensitivities.differences import difference, step_of
from tests.support.random_models import planar, seeds, spatial
from tests.support.sizes import examples


def isolator():
    model = mv.Model("isolator")
    model.add_body("mass", 2.0, (1.0, 1.0, 1.0))
    model.add_joint("rail", "prismatic", "ground", "mass")
    model.add_spring("spring", "ground", "mass", (0, 0, -1), (0, 0, 0), 800.0, 3.0)
    model.add_input("push", "mass", "z")
    model.add_base_motion("floor", "z")
    model.add_output("way", "mass", "z")
    model.add_output("speed", "mass", "z", quantity="velocity")
    model.add_output("felt", "mass", "z", quantity="acceleration")
    model.add_force_output("force", "spring", "z")
    return model


def test_isolator_in_closed_form():
    system, w = isolator().linearize(), np.array([0.0, 5.0, 20.0, 300.0])
    names = ["mass.mass", "spring.stiffness", "spring.damping"]
    result = system.frequency_response_sensitivities(w, names)
    s, m, k, c = 1j * w, 2.0, 800.0, 3.0
    t = k + s * c + s * s * m
    slopes = np.array([s * s, np.ones(4), s])
    for n, (dt, dh, db) in enumerate(zip(slopes, [0 * s, np.ones(4), s], [-1.0, 0.0, 0.0], strict=True)):
        for o, (h, by) in enumerate(((np.ones(4), 0), (s, 0), (s * s, 0), (k + s * c, dh))):
            pushed = by / t - h * dt / t**2
            carried = -m * by / t + h * db / t + h * m * dt / t**2
            assert np.abs(result[n, o, 0] - pushed).max() <= 1e-13 * np.abs(pushed).max(initial=1e-30) + 1e-18
            assert np.abs(result[n, o, 1] - carried).max() <= 1e-12 * np.abs(carried).max() + 1e-18


def test_lever_whose_port_is_at_its_centre_of_mass():
    """G = r^2 / (kt + s^2 (I + m r^2)): the force and the sensor go along with the centre of mass."""
    model = mv.Model()
    model.add_body("bob", 3.0, (0.1, 0.1, 0.1), position=(0.5, 0, 0))
    model.add_joint("hinge", "revolute", "ground", "bob", position=(0, 0, 0), axis=(0, 1, 0))
    model.add_bushing("spiral", "ground", "bob", (0, 0, 0), (0, 0, 0, 0, 40.0, 0))
    model.add_input("push", "bob", "z")
    model.add_output("way", "bob", "z")
    w = np.array([0.0, 3.0, 30.0])
    result = model.linearize().frequency_response_sensitivities(w, ["bob.position.x", "hinge.position.x"])
    r, t = 0.5, 40.0 - w**2 * (0.1 + 3.0 * 0.25)
    moved = 2 * r / t + r * r * w**2 * 2 * 3.0 * r / t**2
    assert result[0, 0, 0] == pytest.approx(moved, rel=1e-13)
    assert result[1, 0, 0] == pytest.approx(-moved, rel=1e-13)


def check(model, rng, count=4):
    try:
        system = model.linearize()
    except mv.MbsvibError:
        assume(False)
    assume(system.dof > 0)
    retained = [group.retained for group in system.provenance.reduction.groups]
    assume(min(retained, default=1.0) > 0.05)
    values = np.abs(system.modes().eigenvalues)
    assume(values.min() > 1e-2)
    w = np.geomspace(values.min(), values.max(), 5) * 1.1
    assume(np.abs(1j * w[:, None] - system.modes().eigenvalues).min() > 1e-2 * values.min())
    result = system.frequency_response_sensitivities(w)
    # differences are blind to what loops hold still: rounding of the largest response of each port hides it
    value = np.abs(system.frequency_response(w)).max(axis=-1, keepdims=True)
    noise = 1e-10 * np.maximum(value.max(axis=0, keepdims=True), value.max(axis=1, keepdims=True))
    names = list(system.parameters)
    for k in rng.choice(len(names), size=count, replace=False):
        if np.isnan(result[k]).any():
            continue
        expected = difference(model, system, names[k], lambda s: s.frequency_response(w))
        limit = 1e-6 * np.abs(expected).max(axis=-1, keepdims=True) + noise / step_of(system.parameters, names[k])
        assert (np.abs(result[k] - expected) <= limit).all(), names[k]


@pytest.mark.slow
@examples(3, slow=9)
@pytest.mark.filterwarnings("ignore::mbsvib.errors.NearSingularWarning")
@given(seeds())
def test_differences_of_random_mechanisms(seed):
    rng = np.random.default_rng(seed)
    check(spatial(seed, bodies=3, loops=int(rng.integers(3))), rng)


@pytest.mark.slow
@settings(max_examples=5, deadline=None)
@given(seeds())
def test_differences_of_random_planar_loops(seed):
    check(planar(seed, bodies=3, loops=1), np.random.default_rng(seed))
