"""Slow modes beside stiff and light parts, where stiffness has both signs or is not symmetric: none of them is 0."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv

LENGTH, WIDTH, THICKNESS, E = 0.1, 0.02, 4e-4, 2.1e11
BENDING = E * WIDTH * THICKNESS**3 / 12


def stage(rho, elements, share=0.3, guided=True):
    """A payload on two leaf springs, each under a share of its buckling load, and this load."""
    load = share * np.pi**2 * BENDING / LENGTH**2
    model = mv.Model("stage", gravity=(0, 0, -9.81))
    model.add_body("payload", 2 * load / 9.81, (1e-3, 1e-3, 1e-3), position=(0, 0, LENGTH))
    for name, x in (("left", -0.03), ("right", 0.03)):
        model.add_beam(name, "ground", "payload", {"type": "rectangle", "width": THICKNESS, "height": WIDTH},
                       {"E": E, "nu": 0.3, "rho": rho}, (x, 0, 0), (x, 0, LENGTH), elements=elements,
                       y_axis=(1, 0, 0))  # fmt: skip
    if guided:
        model.add_joint("guide", None, "ground", "payload", (0, 0, LENGTH), free=("x", "z"))
    return model, load


def sway(load, elements):
    """Frequency [rad/s] of the payload on leaves without mass: Hermite elements under compression, condensed."""
    a = LENGTH / elements
    bending = BENDING / a**3 * np.array([[12, 6 * a, -12, 6 * a], [6 * a, 4 * a * a, -6 * a, 2 * a * a],
                                         [-12, -6 * a, 12, -6 * a], [6 * a, 2 * a * a, -6 * a, 4 * a * a]])  # fmt: skip
    pressed = load / (30 * a) * np.array([[36, 3 * a, -36, 3 * a], [3 * a, 4 * a * a, -3 * a, -a * a],
                                          [-36, -3 * a, 36, -3 * a], [3 * a, -a * a, -3 * a, 4 * a * a]])  # fmt: skip
    K = np.zeros((2 * elements + 2, 2 * elements + 2))
    for i in range(elements):
        K[2 * i : 2 * i + 4, 2 * i : 2 * i + 4] += bending - pressed
    K = K[2:-1, 2:-1]  # clamped below, no slope above
    return np.sqrt(9.81 / load / np.linalg.inv(K)[-1, -1])


@pytest.mark.parametrize("rho", [1e-2, 1e-3, 1e-4])
def test_leaves_of_hardly_any_mass_under_a_payload(rho):
    """It was 0 at 1e-3 kg/m^3: other modes in its shape counted as rounding of its own stiffness."""
    model, load = stage(rho, 6)
    modes = model.linearize().modes()
    assert_allclose(modes.eigenvalues[0].imag, sway(load, 6), rtol=1e-8)
    assert modes.errors.max() < 1e-10


@pytest.mark.parametrize("light", [1e-4, 1e-6, 1e-8])
def test_cross_coupled_mounts_under_stiff_and_light_parts(light):
    """A mass on a mount of stiffness k and cross-coupling c has lambda^2 = -(k +- i c) / m; it was 0."""
    k, c = 100.0, 10.0
    model, first = mv.Model("whirl"), "base"
    model.add_body("base", 50.0, (1, 1, 1))
    model.add_joint("plane", "planar", "ground", "base", (0, 0, 0), axis=(0, 0, 1))
    stiffness = np.diag([k, k, 0, 0, 0, 30.0])
    stiffness[0, 1], stiffness[1, 0] = c, -c
    model.add_bushing("oil", "ground", "base", (0, 0, 0), stiffness)
    for i in range(3):
        model.add_body(f"light{i}", light, (0, 0, 0))
        model.add_joint(f"slide{i}", None, first, f"light{i}", (0, 0, 0), free=("x", "y"))
        model.add_bushing(f"spring{i}", first, f"light{i}", (0, 0, 0), (1e10, 1e10, 0, 0, 0, 0))
        first = f"light{i}"
    slow = model.linearize().modes().eigenvalues[:4]
    exact = np.sqrt(np.array([k + 1j * c, k - 1j * c]) / -(50.0 + 3 * light))
    assert np.abs(slow[:, None] - np.append(exact, -exact)).min(axis=1).max() < 1e-12
    assert len({round(value.imag, 6) + 1j * round(value.real, 6) for value in slow}) == 4


def test_mounts_of_a_rotor_in_oil_bearings():
    """A shaft of 10 beam elements in cross-coupled bearings on a base on soft mounts: three translations were 0."""
    soft, model = 200.0, mv.Model("rotor")
    model.add_body("base", 800.0, (60.0, 80.0, 90.0))
    model.add_bushing("mount", "ground", "base", (0, 0, 0), (soft, soft, soft, 2e4, 2e4, 2e4))
    model.add_body("disk", 12.0, (0.1, 0.1, 0.19), (0, 0, 0.25))
    model.add_beam("shaft", None, "disk", {"type": "circle", "radius": 0.01}, {"E": 2.1e11, "nu": 0.3, "rho": 7800},
                   (0, 0, 0), (0, 0, 0.25), elements=10)  # fmt: skip
    bearing = np.diag([2e7, 2e7, 2e7, 0, 0, 1e3])
    bearing[0, 1], bearing[1, 0] = 1e4, -1e4
    for name, node, z in (("first", "shaft.0", 0.0), ("second", "shaft.5", 0.125)):
        model.add_bushing(name, "base", node, (0, 0, z), bearing)
    modes = model.linearize().modes()
    mass = 812.0 + 7800 * np.pi * 0.01**2 * 0.25
    # the mass is off the base's centre by 4 mm, and turns it a little; bearings give way by a millionth
    assert_allclose(np.abs(modes.eigenvalues[:6]), np.sqrt(soft / mass), rtol=1e-3)


@pytest.mark.parametrize("spinning", [True, False])
def test_weak_drag_of_a_slide_that_carries_strong_dampers(spinning):
    """A slide on a rail of drag c decays at c / m beside a rotor on it, or a damper under negative stiffness; it was 0.
    """
    drag, light = 1e-4, 1e-6
    model = mv.Model("slide")
    model.add_body("slide", 50.0, (1, 1, 1))
    model.add_joint("rail", "prismatic", "ground", "slide", axis=(1, 0, 0))
    model.add_spring("drag", "ground", "slide", (-1, 0, 0), (0, 0, 0), damping=drag)
    model.add_body("light", light, (light, light, light))
    model.add_joint("gimbal", None, "slide", "light", (0, 0, 0), free=("x", "rx", "ry"))
    stiffness = (1e3, 0, 0, 2.0, 2.0, 0) if spinning else (1e3, 0, 0, -1.0, 2.0, 0)
    model.add_bushing("strong", "slide", "light", (0, 0, 0), stiffness, (1e4, 0, 0, 1e4, 1e4, 0))
    if spinning:
        model.add_rotor("wheel", "light", 100.0, (0, 0, 1), inertia=light)
    slow = model.linearize().modes().eigenvalues[:2]
    assert slow[0] == 0.0
    assert_allclose(slow[1], -drag / (50.0 + light), rtol=1e-9)


def test_voice_coil_beside_leaves_under_a_payload():
    """m x'' + k x = T i, L i' + R i = -T x': the slow mode beside the coil, a motion without mass, was 0."""
    constant, resistance, inductance, (model, load) = 4.0, 2.0, 0.5, stage(1e-2, 4, guided=False)
    model.add_voice_coil("coil", "ground", "payload", (-0.2, 0, LENGTH), (0, 0, LENGTH), constant, resistance,
                         inductance)  # fmt: skip
    states = [[0, 1, 0], [-(sway(load, 4) ** 2), 0, 9.81 / (2 * load) * constant],
              [0, -constant / inductance, -resistance / inductance]]  # fmt: skip
    exact, slow = np.linalg.eigvals(states), model.linearize().modes().eigenvalues
    assert np.abs(slow[:, None] / exact - 1).min(axis=0).max() < 1e-4  # the payload turns a little
    assert np.count_nonzero(slow) == len(slow)
