"""Loaded beams: buckling loads, frequencies under tension, own weight, and what elements carry."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import eigh
from scipy.optimize import brentq
from scipy.special import jn_zeros, jv

import mbsvib as mv
from mbsvib.beams import Material, Rectangle
from mbsvib.equations.beam_prestress import least_energy_forces
from mbsvib.equations.expansion import expanded
from tests.beams.reference import assembled, matrices

ALLOY = Material(E=7e10, nu=0.3, rho=2700.0)
BAR = Rectangle(0.02, 0.03)
P = BAR.properties(ALLOY.poisson)
LENGTH = 1.2


def column(n, load, pinned=False, section=BAR, gravity=None, **words):
    model = mv.Model("column", gravity=gravity)
    foot = None if pinned else "ground"
    model.add_beam("c", foot, None, section, ALLOY, start=(0, 0, 0), end=(0, 0, LENGTH), elements=n, **words)
    if pinned:
        model.add_joint("foot", None, "ground", "c.0", position=(0, 0, 0), free=("rx", "ry"))
        model.add_joint("head", None, "ground", f"c.{n}", position=(0, 0, LENGTH), free=("z", "rx", "ry"))
    if load:
        model.add_load("P", f"c.{n}", (0, 0, load))
    return model.linearize()


def critical(unloaded, loaded):
    """Factors of the load at which K is singular: K is linear in the load."""
    inverse = eigh(loaded.K - unloaded.K, unloaded.K, eigvals_only=True)
    return np.sort(-1.0 / inverse[inverse < 0.0])


@pytest.mark.parametrize(("pinned", "part"), [(False, 0.25), (True, 1.0)])
def test_euler_loads_converge_with_the_fourth_power(pinned, part):
    exact = part * np.pi**2 * ALLOY.E * np.sort([P.Iy, P.Iz]) / LENGTH**2
    error = [critical(column(n, 0, pinned), column(n, -1.0, pinned))[:2] / exact - 1.0 for n in (2, 4, 8)]
    assert np.log2(error[0] / error[1]) == pytest.approx(4.0, abs=0.2)
    assert np.log2(error[1] / error[2]) == pytest.approx(4.0, abs=0.05)
    assert (error[2] > 0.0).all()


def test_shear_lowers_the_buckling_load():
    stout = Rectangle(0.2, 0.3)
    p = stout.properties(ALLOY.poisson)
    result = critical(column(16, 0, section=stout, shear=True), column(16, -1.0, section=stout, shear=True))[0]
    euler = np.pi**2 * ALLOY.E * p.Iz / (4 * LENGTH**2)
    assert result == pytest.approx(euler / (1 + euler / (p.ky * ALLOY.shear_modulus * p.A)), rel=1e-4)


@pytest.mark.parametrize(("inertia", "factor"), [("Iy", "kz"), ("Iz", "ky")])
def test_one_element_with_shear_buckles_as_in_the_book(inertia, factor):
    """K_G = -P / (L (1 + f)^2) [[6/5 + 2 f + f^2, -L/10], [-L/10, L^2 (2/15 + f/6 + f^2/12)]] of deflection and turn.

    Source: Przemieniecki, Theory of Matrix Structural Analysis (1968), for shear; f = 12 E I / (k G A L^2).
    """
    stout = Rectangle(0.2, 0.3)
    p = stout.properties(ALLOY.poisson)
    bend = ALLOY.E * getattr(p, inertia)
    f = 12.0 * bend / (getattr(p, factor) * ALLOY.shear_modulus * p.A * LENGTH**2)
    k = bend / (LENGTH**3 * (1.0 + f)) * np.array([[12.0, -6.0 * LENGTH], [-6.0 * LENGTH, (4.0 + f) * LENGTH**2]])
    geometric = np.array([[1.2 + 2.0 * f + f**2, -0.1 * LENGTH],
                          [-0.1 * LENGTH, LENGTH**2 * (2.0 / 15.0 + f / 6.0 + f**2 / 12.0)]]) / (
        LENGTH * (1.0 + f) ** 2)  # fmt: skip
    exact = eigh(k, geometric, eigvals_only=True)
    result = critical(column(1, 0, section=stout, shear=True), column(1, -1.0, section=stout, shear=True))
    for value in exact:
        assert np.abs(result / value - 1.0).min() < 1e-7  # the load of 1 N is the difference of two stiffnesses


def test_stiffness_under_tension_is_that_of_the_book():
    """K + K_G, K_G = N / (30 L) [[36, 3 L, -36, 3 L], [3 L, 4 L^2, -3 L, -L^2], ...] in both planes."""
    n, force = 5, 3.0e3
    h = LENGTH / n
    system = column(n, force)
    kg = np.zeros((12, 12))
    bend = force / (30 * h) * np.array([[36, 3 * h, -36, 3 * h], [3 * h, 4 * h * h, -3 * h, -h * h],
                                        [-36, -3 * h, 36, -3 * h], [3 * h, -h * h, -3 * h, 4 * h * h]])  # fmt: skip
    for position, sign in (((1, 5, 7, 11), 1), ((2, 4, 8, 10), -1)):
        turn = np.array([1, sign, 1, sign])
        kg[np.ix_(position, position)] += np.outer(turn, turn) * bend
    k, m = matrices(h, P.A, P.Iy, P.Iz, P.J, ALLOY.E, ALLOY.shear_modulus, ALLOY.rho)
    points = [(0, 0, h * i) for i in range(n + 1)]
    axes = [((0, 0, 1), (0, 1, 0), (-1, 0, 0))] * n
    full = assembled(points, [np.array(a) for a in axes], lambda i: (np.array(k) + kg, m))
    square = eigh(full[0][6:, 6:], full[1][6:, 6:], eigvals_only=True)
    # torsion: the rigid halves of a twisted element do not see the tension, and neither does the book
    assert system.modes().frequencies == pytest.approx(np.sqrt(square) / (2 * np.pi), rel=1e-9)


def test_supported_beam_under_tension():
    force, n = 2.0e4, 24
    b = np.arange(1, 4) * np.pi / LENGTH
    result = column(n, force, pinned=True).modes().frequencies
    for second in (P.Iy, P.Iz):
        exact = np.sqrt((ALLOY.E * second * b**4 + force * b**2) / (ALLOY.rho * P.A)) / (2 * np.pi)
        assert (np.abs(result[:, None] / exact - 1.0).min(axis=0) < 2e-5).all()


def test_column_buckles_under_its_own_weight():
    """Greenhill: q L^3 / (E I) = 9/4 times the square of the first zero of J of order -1/3."""
    load = 2.25 * brentq(lambda x: jv(-1 / 3, x), 1.5, 2.2) ** 2
    result = critical(column(16, 0), column(16, 0, gravity=(0, 0, -1.0)))[0]
    assert result * ALLOY.rho * P.A * LENGTH**3 / (ALLOY.E * P.Iz) == pytest.approx(load, rel=2e-3)


def test_strip_tips_over_under_a_load_across():
    """Lateral buckling of a narrow cantilever (Timoshenko & Gere): P = 4.0126 sqrt(E I G J) / L^2."""
    strip = Rectangle(0.002, 0.06)  # z of the section stands upright
    p = strip.properties(ALLOY.poisson)

    def system(load, n=24):
        model = mv.Model("strip")
        model.add_beam("s", "ground", None, strip, ALLOY, start=(0, 0, 0), end=(1, 0, 0), elements=n)
        if load:
            model.add_load("P", f"s.{n}", (0, 0, load))
        return model.linearize()

    exact = 4.0126 * np.sqrt(ALLOY.E * p.Iz * ALLOY.shear_modulus * p.J)
    assert critical(system(0), system(-1.0))[0] == pytest.approx(exact, rel=5e-3)


def test_column_flutters_under_a_load_that_follows_its_tip():
    """Beck: P = 20.0510 E I / L^2; below, a follower load has no critical value at all."""
    bend = ALLOY.E * P.Iz

    def growth(factor):
        model = mv.Model("Beck")
        model.add_beam("c", "ground", None, BAR, ALLOY, start=(0, 0, 0), end=(0, 0, LENGTH), elements=8)
        model.add_load("P", "c.8", (0, 0, -factor * bend / LENGTH**2), follower=True)
        return model.linearize().modes().eigenvalues.real.max()

    assert growth(20.04) < 1e-6
    assert growth(20.07) > 1.0


def test_beam_held_at_both_ends_shares_the_load_by_stiffness():
    model = mv.Model("shared")
    model.add_beam("c", "ground", "ground", BAR, ALLOY, start=(0, 0, 0), end=(0, 0, 1), elements=4)
    model.add_load("P", "c.1", (0, 0, -1000.0))
    springs = expanded(model).springs
    carried = [springs[f"c.e{i}"].preload[0] for i in (1, 2, 3, 4)]
    assert carried == pytest.approx([750.0, -250.0, -250.0, -250.0], rel=1e-12)
    assert (model.linearize().modes().frequencies > 0.0).all()


def test_elements_carry_the_bending_moment_of_their_weight():
    n, g = 10, 9.81
    model = mv.Model("shelf", gravity=(0, 0, -g))
    model.add_beam("c", "ground", None, BAR, ALLOY, start=(0, 0, 0), end=(LENGTH, 0, 0), elements=n)
    springs = expanded(model).springs
    line, h = ALLOY.rho * P.A * g, LENGTH / n
    rest = LENGTH - h * (np.arange(n) + 0.5)
    assert [springs[f"c.e{i + 1}"].preload[2] for i in range(n)] == pytest.approx(line * rest, rel=1e-12)
    # the moment of the cubic deflection, whose mean is that of the parabola: q h^2 / 24 above it at the middle
    moments = line * (rest**2 / 2 + h * h / 24)
    assert [abs(springs[f"c.e{i + 1}"].preload[4]) for i in range(n)] == pytest.approx(moments, rel=1e-11)


@pytest.mark.parametrize("elements", [1, 2, 5])
@pytest.mark.parametrize("shear", [False, True])
def test_nodes_sag_exactly_under_the_weight(elements, shear):
    """Tip of a cantilever: q L^4 / (8 E I) + q L^2 / (2 k G A) and the slope q L^3 / (6 E I), whatever the elements."""
    line = ALLOY.rho * P.A * 1e-3  # hardly any sag, so that nothing turns
    model = mv.Model("shelf", gravity=(0, 0, -1e-3))
    model.add_beam("c", "ground", None, BAR, ALLOY, start=(0, 0, 0), end=(LENGTH, 0, 0), elements=elements, shear=shear)
    six = np.array(model.equilibrium().beams["c"].displacements)[-1]
    shearing = line * LENGTH**2 / (2.0 * P.kz * ALLOY.shear_modulus * P.A) if shear else 0.0
    assert six[2] == pytest.approx(-line * LENGTH**4 / (8.0 * ALLOY.E * P.Iy) - shearing, rel=1e-9)
    assert six[4] == pytest.approx(line * LENGTH**3 / (6.0 * ALLOY.E * P.Iy), rel=1e-9)


@pytest.mark.parametrize("elements", [1, 2, 8])
def test_a_hanging_rope_swings_as_bessel_says(elements):
    """A thin beam that hangs from a hinge: omega = j / 2 sqrt(g / L), j the first zero of J0; bending adds 4e-5."""
    model = mv.Model("rope", gravity=(0, 0, -9.81))
    model.add_beam("c", None, None, Rectangle(2e-5, 2e-5), ALLOY, (0, 0, 0), (0, 0, -LENGTH), elements=elements)
    model.add_joint("hinge", None, "ground", "c.0", position=(0, 0, 0), free=("rx", "ry"))
    modes = model.linearize().modes()
    exact = jn_zeros(0, 1)[0] / 2.0 * np.sqrt(9.81 / LENGTH) / (2.0 * np.pi)
    assert modes.frequencies[0] == pytest.approx(exact, rel=1e-4)
    assert modes.stable


def test_body_on_a_loaded_beam_with_a_stay():
    """Everything in balance by what the beam carries: statics need no preload from the user."""
    model = mv.Model("crane", gravity=(0, 0, -9.81))
    model.add_body("load", 20.0, (0.1, 0.2, 0.1), position=(1.1, 0, -0.1))
    model.add_beam("boom", "ground", "load", BAR, ALLOY, start=(0, 0, 0), end=(1, 0, 0.1), elements=6)
    model.add_spring("stay", "ground", "boom.3", start=(0, 0.1, 1), end=(0.5, 0, 0.05), stiffness=1e4, preload=50.0)
    system = model.linearize()
    assert system.provenance.statics.imbalance < 1e-11
    assert "boom" in system.provenance.springs
    assert system.explain()
    assert (system.modes().frequencies > 0.0).all()


def test_beam_that_nothing_holds_is_off_balance():
    model = mv.Model("falls", gravity=(0, 0, -9.81))
    model.add_beam("c", None, None, BAR, ALLOY, start=(0, 0, 0), end=(1, 0, 0), elements=2)
    model.add_joint("hinge", "revolute", "ground", "c.0", position=(0, 0, 0), axis=(0, 1, 0))
    with pytest.raises(mv.EquilibriumError, match=r"not in balance .* joint 'hinge'"):
        model.linearize()


def test_gears_beside_a_loaded_column():
    """What couplers lock counts as well where the forces in the elements are found."""
    ratio, spring, inertia = -2.5, 40.0, (0.03, 0.02)
    model = mv.Model("column and gears")
    model.add_beam("c", "ground", None, BAR, ALLOY, start=(0, 0, 0), end=(0, 0, LENGTH), elements=3)
    model.add_load("P", "c.3", (0, 0, -500.0))
    for i, moment in enumerate(inertia):
        model.add_body(f"wheel{i}", 1.0, (0.02, 0.02, moment), position=(1.0 + i, 0, 0))
        model.add_joint(f"shaft{i}", "revolute", "ground", f"wheel{i}", position=(1.0 + i, 0, 0))
    model.add_gear("gears", "shaft0", "shaft1", ratio)
    model.add_bushing("spring", "ground", "wheel0", (1, 0, 0), (0, 0, 0, 0, 0, spring))
    wheels = np.sqrt(spring / (inertia[0] + ratio**2 * inertia[1])) / (2 * np.pi)
    expected = np.sort([wheels, *column(3, -500.0).modes().frequencies])
    assert model.linearize().modes().frequencies == pytest.approx(expected, rel=1e-10)


def test_strains_that_are_rounding_of_loops_carry_nothing():
    """Bodies that loops lock to each other strain the beam between them by 1e-16 of what open loops would."""
    rng = np.random.default_rng(0)
    apart, root = rng.uniform(-1, 1, (6, 6)), np.array([500.0, 20.0, 20.0, 4.0, 5.0, 5.0])
    rounding = 1e-16 * rng.uniform(-1, 1, (6, 7))
    assert not least_energy_forces(rounding, apart, root, 1e-13 * rng.uniform(-1, 1, 7)).any()
    strained = np.concatenate((rng.uniform(-1, 1, (6, 1)), rounding[:, 1:]), axis=1)
    forces = least_energy_forces(strained, apart, root, np.full(7, 3.0))
    assert strained[:, 0] @ forces == pytest.approx(3.0)


def test_a_falling_superelement_is_off_balance():
    model = mv.Model("loaded", gravity=(0, 0, -9.81))
    model.add_superelement("lump", np.eye(6), None, np.zeros((6, 6)), {"node": (0, 0, 0)})
    with pytest.raises(mv.EquilibriumError, match=r"unbalanced force on body 'lump\.node', 9\.81 N missing"):
        model.linearize()


def test_a_loaded_beam_on_a_geared_shaft():
    """A gear to a second shaft is as much inertia more about the first one's axis."""

    def shafts(geared):
        model = mv.Model("geared", gravity=(0, 0, -9.81))
        model.add_body("shaft", 1.0, (2.0, 2.0, 1.0 if geared else 1.0 + 2.0**2 * 0.3), (0, 0, 1))
        model.add_joint("bearing", "revolute", "ground", "shaft", (0, 0, 1), axis=(0, 0, 1))
        model.add_bushing("k", "ground", "shaft", (0, 0, 1), (0, 0, 0, 0, 0, 10.0))
        model.add_beam("arm", "shaft", None, BAR, ALLOY, start=(0, 0.2, 1), end=(0, 1, 1), elements=3)
        if geared:
            model.add_body("other", 1.0, (1.0, 1.0, 0.3), (2, 0, 1))
            model.add_joint("other bearing", "revolute", "ground", "other", (2, 0, 1), axis=(0, 0, 1))
            model.add_gear("gear", "bearing", "other bearing", 2.0)
        return model.linearize().modes().frequencies

    assert_allclose(shafts(True), shafts(False), rtol=1e-11)


def test_an_inerter_before_the_beam_changes_nothing():
    """Inerters have no elastic rows, so that those of beams stand elsewhere among the elastic rows than among all."""
    systems = []
    for first in (True, False):
        model = mv.Model("tie", gravity=(0.0, 0.0, -9.81))
        model.add_body("m", 2.0, (0.01, 0.01, 0.01), (1.0, 0.0, 0.0))
        steps = [lambda m: m.add_inerter("b", "ground", "m", start=(1, 0, 1), end=(1, 0, 0), inertance=0.3),
                 lambda m: m.add_beam("tube", "ground", "m", {"type": "circle", "radius": 0.01},
                                      {"E": 7e10, "nu": 0.3, "rho": 2700.0}, start=(0, 0, 0),
                                      end=(1, 0, 0))]  # fmt: skip
        for add in steps if first else steps[::-1]:
            add(model)
        model.add_load("pull", "m", force=(300.0, 0.0, 0.0))
        systems.append(model.linearize())
    one, other = systems
    assert one.coordinates == other.coordinates
    assert_allclose(one.K, other.K, rtol=0, atol=1e-13 * np.abs(other.K).max())
    assert_allclose(one.modes().frequencies, other.modes().frequencies, rtol=1e-11)


def test_a_beam_between_parts_that_cannot_move():
    """The joint holds the body, and takes what acts on it."""
    model = mv.Model("held", gravity=(0.0, 0.0, -9.81))
    model.add_body("plate", 1.0, (1.0, 1.0, 1.0), position=(1.0, 0.0, 0.0))
    model.add_joint("clamp", "fixed", "ground", "plate", position=(1.0, 0.0, 0.0))
    model.add_beam("beam", "ground", "plate", {"type": "circle", "radius": 0.02}, {"E": 2e11, "nu": 0.3, "rho": 7800.0},
                   start=(0.0, 0.0, 0.0), end=(1.0, 0.0, 0.0), elements=1)  # fmt: skip
    model.add_input("push", "plate", "z")
    model.add_force_output("clamp.z", "clamp", "z")
    system = model.linearize()
    assert system.dof == 0
    assert abs(system.D[0, 0]) == 1.0
