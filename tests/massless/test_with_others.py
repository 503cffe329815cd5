"""Massless motions beside loads, spin, loops and slender bodies."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
from tests.support.random_models import rotation


@pytest.mark.parametrize("l1", [0.3, 1.0])
def test_a_massless_link_under_tension_follows_its_bob(l1):
    """Two links of which only the end has mass hang as one string: omega^2 = g / (l1 + l2)."""
    g, l2 = 9.81, 0.7
    model = mv.Model("string", gravity=(0, 0, -g))
    model.add_body("link", 0.0, (0, 0, 0), position=(0, 0, -l1 / 2))
    model.add_body("bob", 1.7, (0, 0, 0), position=(0, 0, -l1 - l2))
    model.add_joint("top", "universal", "ground", "link", position=(0, 0, 0), axis=(1, 0, 0), axis2=(0, 1, 0))
    model.add_joint("middle", "universal", "link", "bob", position=(0, 0, -l1), axis=(1, 0, 0), axis2=(0, 1, 0))
    system = model.linearize()
    assert (system.dof, system.massless) == (2, 0)
    assert_allclose(system.modes().natural ** 2, [g / (l1 + l2)] * 2, rtol=1e-13)


def test_standing_massless_links_are_held_by_springs_against_their_load():
    """The same upside down, on torsion springs: two in series less the load."""
    g, mass, length, k = 9.81, 2.0, 0.4, 500.0
    model = mv.Model("mast", gravity=(0, 0, -g))
    model.add_body("low", 0.0, (0, 0, 0), position=(0, 0, length / 2))
    model.add_body("high", mass, (0, 0, 0), position=(0, 0, 2 * length))
    model.add_joint("foot", "revolute", "ground", "low", position=(0, 0, 0), axis=(0, 1, 0))
    model.add_joint("knee", "revolute", "low", "high", position=(0, 0, length), axis=(0, 1, 0))
    model.add_bushing("k1", "ground", "low", position=(0, 0, 0), stiffness=(0, 0, 0, 0, k, 0))
    model.add_bushing("k2", "low", "high", position=(0, 0, length), stiffness=(0, 0, 0, 0, k, 0))
    # in angles from the vertical: elastic k [[2, -1], [-1, 1]], weight -m g l on each; the tip moves by l (a + b)
    full = k * np.array([[2.0, -1.0], [-1.0, 1.0]]) - mass * g * length * np.eye(2)
    flexible = length**2 * np.ones(2) @ np.linalg.solve(full, np.ones(2))
    system = model.linearize()
    assert system.dof == 1
    assert_allclose(system.modes().natural ** 2, [1.0 / (mass * flexible)], rtol=1e-12)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("offset", [0.0, 1e4])
def test_rounding_is_no_mass(seed, offset):
    """A slender rod, oblique and far away, in a spherical joint at its end: its spin moves nothing, and is refused."""
    turn = rotation(np.random.default_rng(seed))
    at = np.array([offset, -offset, 0.3 * offset])
    model = mv.Model("rod")
    model.add_body("rod", 2.0, (0.1, 0.1, 0.0), position=at + 0.35 * turn[:, 2], orientation=turn)
    model.add_joint("ball", "spherical", "ground", "rod", position=at, orientation=turn)
    model.add_bushing("k", "ground", "rod", position=at, orientation=turn, stiffness=(0, 0, 0, 5, 5, 0))
    with pytest.raises(mv.ModelError, match=r"'ball\.rz'.*moves no mass, and no spring or damper holds it"):
        model.linearize()
    held = model.replace("k", stiffness=(0, 0, 0, 5, 5, 1)).linearize()
    assert held.provenance.separation.condensed == ("ball.rz",)
    assert_allclose(held.modes().natural ** 2, [5.0 / (0.1 + 2.0 * 0.35**2)] * 2, rtol=1e-10 if offset else 1e-13)
    braked = model.replace("k", stiffness=(0, 0, 0, 5, 5, 1), damping=(0, 0, 0, 0, 0, 2)).linearize()
    assert (braked.dof, braked.massless) == (3, 1)
    assert_allclose(np.abs(braked.poles() + 0.5).min(), 0.0, atol=1e-12)


def test_tiny_masses_are_masses():
    """A dust grain before a mountain, in a chain of relative coordinates."""
    model = mv.Model("grain")
    model.add_body("grain", 1e-9, (0, 0, 0), position=(0, 0, 1))
    model.add_body("hill", 1e9, (0, 0, 0), position=(0, 0, 2))
    model.add_joint("a", "prismatic", "ground", "hill")
    model.add_joint("b", "prismatic", "hill", "grain")
    model.add_spring("k1", "ground", "hill", (0, 0, 0), (0, 0, 2), stiffness=1e9)
    model.add_spring("k2", "hill", "grain", (0, 0, 2), (0, 0, 1), stiffness=1e-9)
    system = model.linearize()
    assert system.provenance.separation is None
    assert_allclose(system.modes().natural, [1.0, 1.0], rtol=1e-8)


def test_massless_coordinates_of_loops():
    """A massless coupler of a parallel crank mechanism moves with the cranks; its own spring counts."""
    model = mv.Model("parallel")
    for name, x in (("left", 0.0), ("right", 1.0)):
        model.add_body(name, 1.0, (0.1, 0.1, 0.1), position=(x, 0, 0.25))
        model.add_joint(f"{name}.foot", "revolute", "ground", name, position=(x, 0, 0), axis=(0, 1, 0))
    model.add_body("coupler", 0.0, (0, 0, 0), position=(0.5, 0, 0.5))
    model.add_joint("pin1", "revolute", "left", "coupler", position=(0, 0, 0.5), axis=(0, 1, 0))
    model.add_joint("pin2", "revolute", "right", "coupler", position=(1, 0, 0.5), axis=(0, 1, 0))
    model.add_bushing("k", "ground", "coupler", position=(0.5, 0, 0.5), stiffness=(30, 0, 0, 0, 0, 0))
    system = model.linearize()
    assert system.provenance.separation is None
    assert_allclose(system.modes().natural ** 2, [30 * 0.25 / (2 * (0.1 + 0.0625))], rtol=1e-13)


def gimbal(inertia, kx=2.0, ky=3.0, damping=0.0):
    """A wheel of constant momentum h = 3 about z on a frame that turns about x and y."""
    model = mv.Model("gimbal")
    model.add_body("frame", 0.0, inertia)
    model.add_joint("u", "universal", "ground", "frame", position=(0, 0, 0), axis=(1, 0, 0), axis2=(0, 1, 0))
    model.add_rotor("wheel", "frame", speed=3.0, axis=(0, 0, 1), inertia=1.0)
    model.add_bushing("k", "ground", "frame", (0, 0, 0), stiffness=(0, 0, 0, kx, ky, 0),
                      damping=(0, 0, 0, 0, damping, 0))  # fmt: skip
    model.add_input("M", "frame", "rx")
    model.add_output("t", "frame", "rx")
    return model


def test_spin_that_ties_a_massless_motion_to_others_is_refused():
    """About y nothing moves mass, and spin alone holds it against x: neither condensed nor of first order."""
    with pytest.raises(mv.ModelError, match=r"'u\.ry'.*spin or cross-coupling alone ties it to others"):
        gimbal((0.1, 0.0, 0.1)).linearize()


def test_spin_beside_a_damped_massless_motion():
    """(I s^2 + kx)(c s + ky) + h^2 s^2 = 0: three eigenvalues."""
    inertia, kx, ky, c, h = 0.1, 2.0, 3.0, 0.7, 3.0
    system = gimbal((inertia, 0.0, inertia), kx, ky, c).linearize()
    assert (system.dof, system.massless) == (2, 1)
    expected = np.roots([inertia * c, inertia * ky + h * h, kx * c, kx * ky])
    assert_allclose(np.sort_complex(system.poles()), np.sort_complex(expected), rtol=1e-11)
    for s in (0.5j, 4j):
        answer = (c * s + ky) / ((inertia * s**2 + kx) * (c * s + ky) + h * h * s**2)
        assert_allclose(system.frequency_response([s.imag])[0, 0], [answer], rtol=1e-11)
        space = system.state_space()
        result = space.C @ np.linalg.solve(s * np.eye(3) - space.A, space.B) + space.D
        assert_allclose(result, [[answer]], rtol=1e-11)
