"""Parallel guide and cross hinge against closed forms, published ones and beams of several elements."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
from mbsvib.library import cross_hinge, parallel_guide

E, RHO = 2.1e11, 7800.0


def static(model):
    system = model.linearize()
    return dict(zip(system.outputs, system.frequency_response([0.0])[:, 0, 0].real, strict=True))


def of_beams(model):
    """The model with beams of 16 elements for its leaves, whose ends hold no warping: other in torsion alone."""
    result = model.with_parts(composed={})
    for name, part in model.beams.items():
        sides = {"type": "rectangle", "width": part.shape.width, "height": part.shape.thickness}
        result.add_beam(name, part.a, part.b, sides, part.material, *part.points, elements=16, y_axis=part.y_axis)
    return result


def test_frequency_and_stiffness_of_the_guide():
    model, length, width, thickness = parallel_guide(), 0.05, 0.02, 5e-4
    leaf = RHO * length * width * thickness
    k = 2 * E * width * thickness**3 / length**3
    assert_allclose(static(model)["x"], 1 / k, rtol=1e-4)       # the leaves give way along z, as well
    expected = np.sqrt(k / (0.5 + 26 / 35 * leaf)) / (2 * np.pi)
    frequencies = model.linearize().modes().frequencies
    assert_allclose(frequencies[0], expected, rtol=1e-3)
    assert frequencies[1] > 10 * frequencies[0]
    assert abs(static(model)["tilt"] * length) < 1e-3 / k       # a force at half their length tilts by their stretch


@pytest.mark.parametrize("lean", [0.3, 0.25 * np.pi, 1.2])
def test_stiffness_of_the_hinge(lean):
    """8 (3 q^2 - 3 q + 1) E I / L at q = 1/2 (Wittrick 1948), whatever the angle."""
    model = cross_hinge(angle=lean)
    result = static(model)
    assert_allclose(result["angle"], 0.04 / (2 * E * 0.01 * 3e-4**3 / 12), rtol=1e-9)
    assert max(abs(result["x"]), abs(result["z"])) < 1e-12 * result["angle"]


@pytest.mark.parametrize("make", [parallel_guide, cross_hinge])
def test_modes_are_those_of_fine_beams(make):
    """The lowest ones, which are soft; the mass of the leaves is small."""
    model = make()
    expected = of_beams(model).linearize().modes().frequencies
    result = model.linearize().modes().frequencies
    assert_allclose(result[0], expected[0], rtol=1e-5)


def test_the_guide_sinks_as_it_moves():
    model = parallel_guide()
    model.add_load("push", "stage", (10.0, 0, 0), (0, 0, 0))
    x, _, z = np.subtract(model.equilibrium().bodies["stage"].position, (0, 0, 0.025))
    assert_allclose(z, -0.6 * x * x / 0.05, rtol=2e-3)


def test_refusals():
    with pytest.raises(mv.ModelError, match="cross_hinge: angle = 2; expected an angle between 0 and pi/2"):
        cross_hinge(angle=2.0)
    with pytest.raises(mv.ModelError, match="parallel_guide: distance = -1"):
        parallel_guide(distance=-1)
