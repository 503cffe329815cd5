"""Strain outputs against the closed forms of a cantilever, and what is refused."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv

E, LENGTH, ELEMENTS = 7e10, 1.2, 3


def cantilever(section, shear=False, y_axis=(0, 1, 0)):
    model = mv.Model("cantilever")
    model.add_beam("bar", "ground", None, section, {"E": E, "nu": 0.3, "rho": 2700}, start=(0, 0, 0),
                   end=(LENGTH, 0, 0), elements=ELEMENTS, shear=shear, y_axis=y_axis)  # fmt: skip
    for direction in ("x", "y", "z"):
        model.add_input(direction, f"bar.{ELEMENTS}", direction)
    return model


def strain(model, method="dense"):
    return model.linearize(method=method).frequency_response([0.0])[:, :, 0].real


@pytest.mark.parametrize("method", ["dense", "sparse"])
@pytest.mark.parametrize("shear", [False, True])
@pytest.mark.parametrize(("section", "half"), [
    ({"type": "circle", "radius": 0.02}, (0.02, 0.02)), ({"type": "tube", "radius": 0.03, "wall": 0.004}, (0.03, 0.03)),
    ({"type": "rectangle", "width": 0.02, "height": 0.05}, (0.01, 0.025)),
])  # fmt: skip
def test_cantilever_under_forces_at_its_tip(section, half, shear, method):
    """eps = F_x / (E A) - offset F (L - x) / (E I), the same with and without shear."""
    model = cantilever(section, shear)
    properties = model.beams["bar"].properties
    expected = []
    for e in range(1, ELEMENTS + 1):
        for share, at in ((0.0, "start"), (0.5, "middle"), (1.0, "end")):
            x = (e - 1 + share) * LENGTH / ELEMENTS
            for sign in ("", "-"):
                model.add_strain_output(f"y{sign}{e}{at}", f"bar.e{e}", at, f"{sign}y")
                model.add_strain_output(f"z{sign}{e}{at}", f"bar.e{e}", at, f"{sign}z")
                moment = (LENGTH - x) * (-1.0 if sign else 1.0)
                stretch = 1 / (E * properties.A)
                expected += [(stretch, -half[0] * moment / (E * properties.Iz), 0.0),
                             (stretch, 0.0, -half[1] * moment / (E * properties.Iy))]  # fmt: skip
    result = strain(model, method)
    assert_allclose(result, expected, rtol=1e-11, atol=1e-13 * np.abs(expected).max())
    assert set(model.linearize().output_units) == {"m/m"}


def test_axes_of_the_section_turn_with_it():
    section = {"type": "rectangle", "width": 0.02, "height": 0.05}
    model = cantilever(section, y_axis=(0, 0, 1))
    model.add_strain_output("eps", "bar.e1", side="y")
    inertia = model.beams["bar"].properties.Iz
    assert_allclose(strain(model), [[1 / (E * 0.001), 0.0, -0.01 * LENGTH / (E * inertia)]], rtol=1e-12, atol=1e-20)


def test_a_distance_in_place_of_the_surface():
    section = {"A": 1e-3, "Iy": 2e-7, "Iz": 1e-7, "J": 2e-7}
    model = cantilever(section)
    model.add_strain_output("eps", "bar.e1", distance=0.01)
    model.add_strain_output("mean", "bar.e1", distance=0.0)
    assert_allclose(strain(model), [[1 / (E * 1e-3), 0.0, -0.01 * LENGTH / (E * 2e-7)], [1 / (E * 1e-3), 0.0, 0.0]],
                    rtol=1e-12, atol=1e-20)  # fmt: skip
    model.add_strain_output("surface", "bar.e1")
    with pytest.raises(mv.ModelError, match="do not contain its surface"):
        model.linearize()


def test_it_follows_the_parameters_of_the_beam():
    model = cantilever({"type": "circle", "radius": 0.02})
    model.add_strain_output("eps", "bar.e1")
    thick = model.with_values({"bar.radius": 0.04})
    assert_allclose(strain(thick)[0, 2], strain(model)[0, 2] / 8, rtol=1e-12)
    batch = model.linearize(values={"bar.radius": [0.02, 0.04]})
    assert_allclose(batch.frequency_response([0.0])[:, 0, 2, 0], [strain(model)[0, 2], strain(thick)[0, 2]], rtol=1e-12)


@pytest.mark.parametrize(("words", "message"), [
    ({"element": "bar.e9"}, "strain output 'eps': element = 'bar.e9'; expected an element of a beam"),
    ({"at": "tip"}, "expected 'start', 'middle' or 'end'"), ({"side": "x"}, "expected 'y', '-y', 'z' or '-z'"),
    ({"distance": -1.0}, "not negative"), ({"at": ["start"]}, r"at = \['start'\]"),
    ({"side": np.eye(2)}, "expected 'y', '-y', 'z' or '-z'"),
])  # fmt: skip
def test_refusals(words, message):
    model = cantilever({"type": "circle", "radius": 0.02})
    with pytest.raises(mv.ModelError, match=message):
        model.add_strain_output("eps", **({"element": "bar.e1"} | words))
