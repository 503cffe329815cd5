"""All forces on the ground with beams and reduced models: nodes on the ground have mass as well."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.beams import Material, Rectangle

OMEGA = [0.0, 300.0, 3000.0]


def cantilever(clamp):
    """A beam of two elements that ends on the ground, at once or by a joint."""
    model = mv.Model("cantilever")
    model.add_beam("c", None if clamp else "ground", None, Rectangle(0.02, 0.03), Material(E=7e10, nu=0.3, rho=2700.0),
                   start=(0.2, 0, 0), end=(1, 0, 0), elements=2)  # fmt: skip
    if clamp:
        model.add_joint("clamp", "fixed", "ground", "c.0", position=(0.2, 0, 0))
    model.add_input("F", "c.2", (0.3, 1.0, -2.0, 0.1, 0.2, 0.3))
    model.add_base_motion("a", (1.0, 2.0, 0.5))
    for direction in ("x", "y", "z", "rx", "ry", "rz"):
        model.add_force_output(direction, "ground", direction)
    return model


@pytest.mark.parametrize("method", ["dense", "sparse"])
def test_a_beam_on_the_ground_is_as_heavy_as_a_clamped_one(method):
    result, expected = (cantilever(clamp).linearize(method=method).frequency_response(OMEGA) for clamp in (False, True))
    np.testing.assert_allclose(result, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("method", ["dense", "sparse"])
def test_shaking_a_beam_slowly_takes_its_mass(method):
    mass = 0.02 * 0.03 * 2700.0 * 0.8
    model = cantilever(False)
    result = model.linearize(method=method).frequency_response([0.0])[:3, 1, 0]
    np.testing.assert_allclose(result, -mass * np.array((1.0, 2.0, 0.5)), rtol=1e-9)


def test_a_beam_between_locked_bodies():
    """No degree of freedom, but mass of its own that the ground shakes."""
    model = mv.Model("locked")
    for name, x in (("a", 0.0), ("b", 0.5)):
        model.add_body(name, 1.0, (0.1, 0.1, 0.1), (x, 0, 0))
        model.add_joint(f"{name} fixed", "fixed", "ground", name)
    model.add_beam("c", "a", "b", Rectangle(0.02, 0.03), Material(E=7e10, nu=0.3, rho=2700.0), start=(0, 0, 0),
                   end=(0.5, 0, 0), elements=1)  # fmt: skip
    model.add_base_motion("shake", "z")
    model.add_force_output("sum", "ground", "z")
    system = model.linearize()
    assert system.dof == 0
    mass = 2.0 + 0.02 * 0.03 * 2700.0 * 0.5
    np.testing.assert_allclose(system.frequency_response([3.0]), np.full((1, 1, 1), -mass), rtol=1e-12)
