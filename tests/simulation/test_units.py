"""Runs in other units of length, time and force: the same motion, in the same steps."""

import numpy as np
import pytest

import mbsvib as mv

UNITS = [(1e6, 1e6, 1e9), (1e9, 1e9, 1e12), (1e-6, 1e-6, 1e-9), (1e3, 1.0, 1.0), (1.0, 1e3, 1e-3)]


def arm(length=1.0, time=1.0, force=1.0):
    """Two links with a spring-damper and a Maxwell element; units of which so many make 1 m, 1 s and 1 N."""
    mass = force * time**2 / length
    inertia = np.array((0.01, 0.01, 0.005)) * mass * length**2
    model = mv.Model("arm", gravity=(0, 0, -9.81 * length / time**2))
    model.add_body("a", 0.5 * mass, inertia, (0.25 * length, 0, 0))
    model.add_body("b", 0.3 * mass, 0.6 * inertia, (0.7 * length, 0, 0))
    model.add_joint("p", "revolute", "ground", "a", (0, 0, 0), axis=(0, 1, 0))
    model.add_joint("q", "revolute", "a", "b", (0.5 * length, 0, 0), axis=(0, 1, 0))
    top, end, middle = ((x * length, 0, z * length) for x, z in ((0.7, 0.5), (0.7, 0.0), (0.25, 0.0)))
    model.add_spring("k", "ground", "b", top, end, 50.0 * force / length, 0.2 * force * time / length)
    above = (0.25 * length, 0, 0.4 * length)
    model.add_maxwell("relaxing", "ground", "a", above, middle, 80.0 * force / length, 5.0 * force * time / length)
    model.add_output("z", "b", "z")
    return model


def beam(length=1.0, time=1.0, force=1.0):
    """A cantilever of two elements that a mass at its tip bends."""
    mass = force * time**2 / length
    model = mv.Model("beam")
    model.add_body("tip", 0.2 * mass, (1e-4 * mass * length**2,) * 3, (0.5 * length, 0, 0))
    section = {"type": "rectangle", "width": 0.02 * length, "height": 0.004 * length}
    steel = {"E": 2.1e11 * force / length**2, "nu": 0.3, "rho": 7800 * mass / length**3}
    model.add_beam("beam", "ground", "tip", section, steel, (0, 0, 0), (0.5 * length, 0, 0), elements=2,
                   y_axis=(0, 1, 0))  # fmt: skip
    model.add_input("F", "tip", "z")
    model.add_output("z", "tip", "z")
    return model


@pytest.mark.few(1)
@pytest.mark.parametrize("units", UNITS)
def test_an_arm_that_falls(units):
    t = np.linspace(0.0, 1.0, 9)
    reference, run = arm().simulate(t), arm(*units).simulate(units[1] * t)
    np.testing.assert_allclose(run["z"] / units[0], reference["z"], rtol=0, atol=1e-9)
    np.testing.assert_allclose(run.rates["q.rz"] * units[1], reference.rates["q.rz"], rtol=0, atol=1e-8)
    assert np.abs(run.energy.balance).max() < 1e-8 * run.energy.kinetic.max()
    dissipated = run.energy.dissipated / (units[0] * units[2])
    np.testing.assert_allclose(dissipated, reference.energy.dissipated, rtol=0, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("units", UNITS[:1])
def test_a_beam_that_is_pushed(units):
    t = np.linspace(0.0, 0.02, 3)
    reference = beam().simulate(t, {"F": np.sin(200.0 * t)})
    run = beam(*units).simulate(units[1] * t, {"F": units[2] * np.sin(200.0 * t)})
    np.testing.assert_allclose(run["z"] / units[0], reference["z"], rtol=0, atol=1e-11)
