"""Flexures on hubs against beams of their shape, and in all engines."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
from tests.elements.test_flexure import ELLIPTIC, FILLETED, NOTCH, STEEL, extent, extrapolated, stepped

RADIUS, SPEED = 0.03, 400.0
LEAF = {"type": "leaf", "length": 0.05, "width": 0.01, "thickness": 0.001}
# columns: width along y, length along x
OUTWARDS = np.array([[0, 0, 1.0], [0, 1, 0], [-1, 0, 0]])


def blade(shape, speed=SPEED, tip=0.02, axis=(0, 0, 1), steps=None, material=STEEL, **words):
    """A small block on a flexure, or on so many beams of its shape, that stands out from a hub."""
    model, length = mv.Model("blade"), extent(shape)
    model.add_hub("hub", speed, axis)
    model.add_body("tip", tip, (1e-6, 2e-6, 3e-6), (RADIUS + length, 0, 0))
    if steps is None:
        model.add_flexure("f", "hub", "tip", shape, material, position=(RADIUS + 0.5 * length, 0, 0),
                          orientation=OUTWARDS, **words)  # fmt: skip
        return model
    before, middle = "hub", RADIUS + 0.5 * length
    for i, (start, end, section) in enumerate(stepped(shape, steps)):
        after = "tip" if i == steps - 1 else None
        # the width of flexures is along y, as z of beams would be
        swapped = section | {"Iy": section["Iz"], "Iz": section["Iy"]}
        model.add_beam(f"f{i}", before, after, swapped, material, (middle + start, 0, 0), (middle + end, 0, 0),
                       elements=1, shear=True, y_axis=(0, 0, -1))  # fmt: skip
        before = f"f{i}.1"
    return model


def frequencies(model, count=6):
    return model.linearize().modes().frequencies[:count]


@pytest.mark.parametrize("axis", [(0, 0, 1), (1, 2, -0.5)])
@pytest.mark.parametrize("speed", [0.0, SPEED])
def test_a_leaf_is_a_beam_of_one_element(speed, axis):
    """But for its torsion, whose warping is held: with a hinge along it there is none."""
    leaf = blade(LEAF, speed, axis=axis)
    beam = mv.Model("beam")
    beam.add_hub("hub", speed, axis)
    beam.add_body("tip", 0.02, (1e-6, 2e-6, 3e-6), (RADIUS + 0.05, 0, 0))
    properties = {"A": 1e-5, "Iy": 1e-5 * 1e-6 / 12, "Iz": 1e-5 * 1e-4 / 12, "ky": 5 / 6, "kz": 5 / 6,
                  "J": leaf.beams["f"].properties.J}  # fmt: skip
    beam.add_beam("f", "hub", "tip", properties, STEEL, (RADIUS, 0, 0), (RADIUS + 0.05, 0, 0), elements=1,
                  y_axis=(0, 1, 0))  # fmt: skip
    balanced = [held(model) for model in (leaf, beam)]
    assert_allclose(*[np.sort(np.abs(model.linearize().modes().eigenvalues)) for model in balanced], rtol=1e-9)


def held(model):
    """The same with a stiff bushing at the tip, so that what is off the axis does not bend it far."""
    model.add_bushing("hold", "hub", "tip", (RADIUS, 0, 0), (1e3, 2e3, 3e3, 1, 2, 3))
    return model


@pytest.mark.slow
@pytest.mark.parametrize("shape", [NOTCH, ELLIPTIC, FILLETED])
@pytest.mark.parametrize("axis", [(0, 0, 1), (0, 1, 0)])
def test_a_notch_of_some_mass_follows_short_beams(shape, axis):
    """The rise of the squares of the frequencies, over the square of the speed, of a block lighter than the notch."""
    def rise(count):
        fast, slow = (frequencies(blade(shape, speed, 1e-3, axis, count), 3) for speed in (100.0, 0.0))
        return (fast**2 - slow**2) * (2 * np.pi / 100.0) ** 2

    expected = extrapolated(rise)
    assert_allclose(rise(None), expected, rtol=2e-3, atol=2e-3 * np.abs(expected).max())


def test_a_mass_on_a_light_leaf_flaps_in_closed_form():
    """To first order in the tension T = m W^2 (R + L): k = 3 E I / L^3 + 6 T / 5 L, of a point mass."""
    model = blade(LEAF, 20.0, material=STEEL | {"rho": 1e-3})
    model = model.with_values({f"tip.inertia.{ii}": 1e-15 for ii in ("xx", "yy", "zz")})
    soft = STEEL["E"] * 0.01 * 0.001**3 / 12
    tension = 0.02 * 20.0**2 * (RADIUS + 0.05)
    expected = np.sqrt((3 * soft / 0.05**3 + 1.2 * tension / 0.05) / 0.02) / (2 * np.pi)
    assert_allclose(frequencies(model, 1), expected, rtol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("shape", [LEAF, NOTCH])
def test_engines(shape, tmp_path):
    """Sparse equations, variants, compiled plants, derivatives to speed and thickness, files, other poses."""
    model = blade(shape)
    model.add_input("F", "tip", "z")
    model.add_output("z", "tip", "z")
    system, omega = model.linearize(), [0.0, 700.0]
    expected = system.frequency_response(omega)
    assert_allclose(model.linearize(method="sparse").frequency_response(omega), expected, rtol=1e-9)
    speeds = [0.0, 300.0, SPEED]
    batch, plant = model.linearize(values={"hub.speed": speeds}), model.compile(parameters=["hub.speed"])
    for i, speed in enumerate(speeds):
        single = model.with_values({"hub.speed": speed}).linearize().K
        assert_allclose(batch.K[i], single, rtol=1e-11, atol=1e-11 * np.abs(single).max())
        assert_allclose(plant([speed]).K, single, rtol=1e-11, atol=1e-11 * np.abs(single).max())
    mv.save(model, tmp_path / "blade.yaml")
    assert_allclose(mv.load(tmp_path / "blade.yaml").linearize().K, system.K, rtol=1e-12)
    table = system.mode_sensitivities(["hub.speed", "f.thickness"])
    for slopes, (name, value) in zip(table.frequencies, {"hub.speed": SPEED, "f.thickness": shape["thickness"]}.items(),
                                     strict=True):  # fmt: skip
        far, near = ((frequencies(model.with_values({name: value + h})) - frequencies(
            model.with_values({name: value - h}))) / (2 * h) for h in (2e-3 * value, 1e-3 * value))  # fmt: skip
        assert_allclose(slopes[:6], (4 * near - far) / 3, rtol=1e-6, atol=1e-9 * np.abs(slopes).max(), err_msg=name)
