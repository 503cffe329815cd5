"""Beams against closed forms: static deflections, frequencies of the continuous beam, the cantilever tube of SDLL15."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.beams import Material, Rectangle, Section, Tube

STEEL = Material(E=2.1e11, nu=0.3, rho=7800.0)
BAR = Rectangle(0.02, 0.05)
LENGTH = 1.7


def beam(a, b, elements, section=BAR, material=STEEL, start=(0.0, 0.0, 0.0), end=(LENGTH, 0.0, 0.0), **words):
    model = mv.Model("beam")
    model.add_beam("rod", a, b, section, material, start=start, end=end, elements=elements, **words)
    return model


def compliance(model, node, wrenches):
    """What unit forces and torques at a node move there, (6, 6)."""
    for name in wrenches:
        model.add_input(name, node, name)
        model.add_output(name, node, name)
    system = model.linearize(method="dense")
    return system.Cq @ np.linalg.solve(system.K, system.B)


@pytest.mark.parametrize("elements", [1, 2, 7, 40])
@pytest.mark.parametrize("shear", [False, True])
def test_tip_of_a_cantilever_moves_as_statics_say(elements, shear):
    model = beam("ground", None, elements, shear=shear)
    result = compliance(model, f"rod.{elements}", ("x", "y", "z", "rx", "ry", "rz"))
    p = BAR.properties(STEEL.poisson)
    e, g, length = STEEL.E, STEEL.shear_modulus, LENGTH
    expected = np.diag([length / (e * p.A), length**3 / (3 * e * p.Iz), length**3 / (3 * e * p.Iy), length / (g * p.J),
                        length / (e * p.Iy), length / (e * p.Iz)])  # fmt: skip
    expected[1, 5] = expected[5, 1] = length**2 / (2 * e * p.Iz)
    expected[2, 4] = expected[4, 2] = -(length**2) / (2 * e * p.Iy)
    if shear:
        expected[1, 1] += length / (p.ky * g * p.A)
        expected[2, 2] += length / (p.kz * g * p.A)
    size = np.sqrt(np.outer(expected.diagonal(), expected.diagonal()))
    assert np.abs((result - expected) / size).max() < 1e-13
    acts = expected != 0.0
    assert np.abs(result[acts] / expected[acts] - 1.0).max() < 1e-13


def test_axes_of_a_beam_turn_with_it():
    straight = compliance(beam("ground", None, 3), "rod.3", ("x", "y", "z", "rx", "ry", "rz"))
    turn = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    model = beam("ground", None, 3, end=LENGTH * turn[:, 0], y_axis=turn[:, 1])
    result = compliance(model, "rod.3", ("x", "y", "z", "rx", "ry", "rz"))
    both = np.kron(np.eye(2), turn)
    size = np.sqrt(np.outer(straight.diagonal(), straight.diagonal()))
    # it bends 3e4 times as easily as it stretches, so that rounding of the axes counts as often
    assert np.abs((both.T @ result @ both - straight) / size).max() < 1e-11


def frequencies(model):
    return model.linearize(method="dense").modes().frequencies


def bending(beta):
    """Angular frequencies of the two planes over 2 pi, for beta L of the continuous beam."""
    p = BAR.properties(STEEL.poisson)
    return [np.square(beta) / LENGTH**2 * np.sqrt(STEEL.E * i / (STEEL.rho * p.A)) / (2 * np.pi) for i in (p.Iz, p.Iy)]


def closest(result, expected):
    return np.abs(result[:, None] / expected - 1.0).min(axis=0)


@pytest.mark.parametrize(
    ("ends", "beta"),
    [(("ground", None), (1.87510407, 4.69409113, 7.85475744)), ((None, None), (4.73004074, 7.85320462)),
     (("ground", "ground"), (4.73004074, 7.85320462))],
)  # fmt: skip
def test_bending_converges_with_the_fourth_power_of_the_length(ends, beta):
    for n in (16, 32):
        result = frequencies(beam(*ends, n))
        for f in bending(beta):
            # consistent mass: the frequency is too high by (beta h)^4 / 1440 to leading order
            assert closest(result, f) == pytest.approx((np.array(beta) / n) ** 4 / 1440, rel=0.05, abs=5e-9)


def test_free_beam_has_six_rigid_modes_that_are_exactly_zero():
    modes = beam(None, None, 10).linearize().modes()
    assert (modes.frequencies[:6] == 0.0).all()
    assert modes.frequencies[6] > 1.0


def test_pinned_beam():
    model = beam(None, None, 24)
    model.add_joint("left", None, "ground", "rod.0", position=(0, 0, 0), free=("rz",))
    model.add_joint("right", None, "ground", "rod.24", position=(LENGTH, 0, 0), free=("x", "rz", "rx"))
    beta = np.pi * np.arange(1, 4)
    assert closest(frequencies(model), bending(beta)[0]) == pytest.approx((beta / 24) ** 4 / 1440, rel=0.02)


def test_rod_and_shaft_with_the_known_error_of_consistent_mass():
    n = 16
    result = frequencies(beam("ground", None, n))
    p = BAR.properties(STEEL.poisson)
    # linear elements: omega h / c = sqrt(6 (1 - cos) / (2 + cos)) of the wave's phase per element, exactly
    phase = (2 * np.arange(1, 5) - 1) * np.pi / (2 * n)
    discrete = np.sqrt(6 * (1 - np.cos(phase)) / (2 + np.cos(phase))) * n / LENGTH / (2 * np.pi)
    rod = np.sqrt(STEEL.E / STEEL.rho)
    shaft = np.sqrt(STEEL.shear_modulus * p.J / (STEEL.rho * (p.Iy + p.Iz)))
    assert closest(result, rod * discrete).max() < 1e-12
    assert closest(result, shaft * discrete).max() < 1e-12


def test_cantilever_tube_with_tip_mass():
    """VPCS SDLL15 without offset, 20 Euler-Bernoulli elements."""
    model = mv.Model("SDLL15")
    model.add_body("tip", 1000.0, (0, 0, 0), position=(10, 0, 0))
    model.add_beam("tube", "ground", "tip", Tube(0.175, 0.015), STEEL, start=(0, 0, 0), end=(10, 0, 0), elements=20)
    result = model.linearize().modes(rtol=1e-11).frequencies[:10]
    expected = [1.655433398] * 2 + [16.071161667] * 2 + [50.023996028] * 2 + [76.472717539, 80.468757907]
    assert result == pytest.approx([*expected, 103.204375129, 103.204375129], rel=1e-9, abs=0)


def test_body_off_the_end_of_a_beam():
    """A heavy body on a light cantilever, its centre of mass ahead of the tip: two modes of a 2 x 2 problem."""
    light = Material(E=2.1e11, nu=0.3, rho=1e-4)
    ahead, mass, moment = 0.3, 40.0, 0.7
    model = mv.Model("flag")
    model.add_body("load", mass, (moment,) * 3, position=(LENGTH + ahead, 0, 0))
    model.add_beam("pole", "ground", "load", BAR, light, start=(0, 0, 0), end=(LENGTH, 0, 0), elements=3)
    ei = light.E * BAR.properties(light.poisson).Iz
    tip = np.array([[LENGTH**3 / 3, LENGTH**2 / 2], [LENGTH**2 / 2, LENGTH]]) / ei
    shift = np.array([[1.0, ahead], [0.0, 1.0]])
    inverse = np.linalg.eigvals(shift @ tip @ shift.T @ np.diag([mass, moment]))
    assert closest(frequencies(model), 1.0 / np.sqrt(inverse) / (2 * np.pi)).max() < 1e-7


def test_both_ends_held_cuts_an_element_and_locks_nothing():
    system = beam("ground", "ground", 6).linearize()
    assert system.dof == 30
    assert system.redundant == ()


def test_polyline_of_nodes_is_the_straight_beam():
    single = frequencies(beam("ground", None, 5))
    model = mv.Model("nodes")
    model.add_beam("rod", "ground", None, BAR, STEEL, nodes=[(LENGTH * i / 5, 0, 0) for i in range(6)])
    assert frequencies(model) == pytest.approx(single, rel=1e-10)


def test_section_by_its_properties():
    p = BAR.properties(STEEL.poisson)
    arguments = {"A": p.A, "Iy": p.Iy, "Iz": p.Iz, "J": p.J}
    words = {"E": STEEL.E, "G": STEEL.shear_modulus, "rho": STEEL.rho}
    other = frequencies(beam("ground", None, 3, section=arguments, material=words))
    assert other == pytest.approx(frequencies(beam("ground", None, 3)), rel=1e-11)
    assert Section(**arguments).ky is None
