"""Beams that bend on the way to equilibrium: closed forms, rigid limits, and the same part by its matrices."""

import re
import warnings

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.equilibrium.search import at_equilibrium
from tests.beams.reference import assembled, matrices

G = 9.81
WIDTH, THICK, LENGTH = 0.02, 0.004, 1.0
SECTION = {"type": "rectangle", "width": WIDTH, "height": THICK}
STEEL = {"E": 2.1e11, "nu": 0.3, "rho": 7800.0}
EI = STEEL["E"] * WIDTH * THICK**3 / 12
LINE = STEEL["rho"] * WIDTH * THICK


def cantilever(force, elements=5, **words):
    model = mv.Model("cantilever")
    model.add_beam("rod", "ground", None, SECTION, STEEL, start=(0, 0, 0), end=(LENGTH, 0, 0), elements=elements,
                   **words)  # fmt: skip
    model.add_load("P", f"rod.{elements}", force)
    return model


def turn(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def test_a_cantilever_bends_as_the_text_books_say():
    force, side = -0.3, 2.0
    there = cantilever((5.0, side, force), second_order=False).equilibrium(report=True)
    rod = there.model.beams["rod"]
    across = EI * (WIDTH / THICK) ** 2
    tip = np.array([5.0 * LENGTH / (STEEL["E"] * WIDTH * THICK), side * LENGTH**3 / (3 * across),
                    force * LENGTH**3 / (3 * EI)])  # fmt: skip
    np.testing.assert_allclose(np.subtract(rod.points[-1], (LENGTH, 0, 0)), tip, rtol=1e-9)
    slope = (0, -force * LENGTH**2 / (2 * EI), side * LENGTH**2 / (2 * across))
    np.testing.assert_allclose(rod.displacements[-1][3:], slope, rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(there.displacements["rod.5"], rod.displacements[-1], atol=1e-15)
    assert there.stable
    assert there.model.equilibrium(report=True).iterations == 0
    back = there.model.with_parts(loads={}).equilibrium().beams["rod"]
    np.testing.assert_allclose(back.points, cantilever((0, 0, 1.0)).beams["rod"].points, atol=1e-12)
    double = there.model.with_values({"P.force.z": 2 * force}).equilibrium().beams["rod"]
    np.testing.assert_allclose(double.points[-1][2], 2 * tip[2], rtol=1e-9)


@pytest.mark.slow
def test_another_load_needs_another_pose():
    there = cantilever((0, 0, -0.3)).equilibrium()
    with pytest.raises(mv.EquilibriumError, match=r"body 'rod\.5', -0\.03 N missing along z \(.*displacements"):
        there.with_values({"P.force.z": -0.27}).linearize()
    model, system = at_equilibrium(there.with_values({"P.force.z": -0.6}))
    assert model.beams["rod"].points[-1][2] == pytest.approx(-0.6 * LENGTH**3 / (3 * EI), rel=1e-9)
    assert system.dof == there.linearize().dof


def between_walls(force, **words):
    model = mv.Model("walls")
    model.add_beam("rod", "ground", "ground", SECTION, STEEL, start=(0, 0, 0), end=(LENGTH, 0, 0), elements=6, **words)
    model.add_load("P", "rod.3", (0, 0, -force))
    return model.equilibrium()


def test_a_linear_beam_on_both_walls_sags():
    there = between_walls(0.1, second_order=False)
    np.testing.assert_allclose(there.beams["rod"].points[3][2], -0.1 * LENGTH**3 / (192 * EI), rtol=1e-9)


def arms(height=0.192):
    """Two arms of 0.1 m on the middle of a clamped linear beam."""
    model = mv.Model("arms")
    model.add_beam("rod", "ground", "ground", SECTION, STEEL, start=(-0.5, 0, 0), end=(0.5, 0, 0), elements=8,
                   second_order=False)  # fmt: skip
    out = np.sqrt(0.1**2 - (0.5 * height) ** 2)
    for name, z in (("lower", -0.75 * height), ("upper", -0.25 * height)):
        model.add_body(name, 0.05, (1e-9, 5e-4 / 12, 5e-4 / 12), (0.5 * out, 0, z))
    model.add_joint("base", "revolute", "ground", "lower", (0, 0, -height), axis=(0, 1, 0))
    model.add_joint("elbow", "revolute", "lower", "upper", (out, 0, -0.5 * height), axis=(0, 1, 0))
    model.add_joint("pin", "revolute", "upper", "rod.4", (0, 0, 0), axis=(0, 1, 0))
    return model


@pytest.mark.slow
def test_the_statically_loaded_start_of_the_drop_test():
    """30 N on the middle: the published start, sag and energy."""
    model = arms()
    model.add_load("drop", "rod.4", (0, 0, -30.0))
    there = model.equilibrium()
    sag = there.beams["rod"].points[4][2]
    assert sag == pytest.approx(-6.975446428571e-3, rel=1e-10)
    assert -0.5 * 30.0 * sag == pytest.approx(0.10463169642857, rel=1e-10)
    assert there.linearize().dof == model.linearize().dof


@pytest.mark.few(2)
@pytest.mark.parametrize("share", [0.05, 1.0, 1.5, -0.2])
def test_arms_that_move_bend_the_beam_that_they_are_on(share):
    """Up to where they are stretched and beyond: the middle goes as arms of their length say, the rest bends least."""
    height = 0.192
    angle = np.arccos(0.5 * height / 0.1)
    there = arms(height).moved({"elbow.rz": 2.0 * share * angle})
    w = np.array(there.beams["rod"].points)[:, 2]
    assert w[4] == pytest.approx(0.2 * np.cos(angle - share * angle) - height, rel=1e-9)
    x = np.linspace(0, 0.5, 5)
    np.testing.assert_allclose(w[:5], w[4] * x**2 * (12.0 - 16.0 * x), rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(w[::-1], w, rtol=1e-9, atol=1e-15)
    if share == 1.0:  # the stretched arms are a column that the beam's force does not turn
        assert not there.linearize().modes().stable
    else:
        with pytest.raises(mv.EquilibriumError, match=r"unbalanced moment .* by the displacements"):
            there.linearize()


@pytest.mark.few(1)
@pytest.mark.parametrize("unit", [1.0, 1e-3])
def test_a_slider_lifts_a_beam_in_any_unit_of_length(unit):
    """A link of 0.52 comes to stand upright below the middle, which goes up by 0.04; a rigid beam would hold it."""
    model = mv.Model("lift")
    section = {"type": "rectangle", "width": WIDTH * unit, "height": THICK * unit}
    model.add_beam("rod", "ground", "ground", section, STEEL, start=(-0.5 * unit, 0, 0), end=(0.5 * unit, 0, 0),
                   elements=4, second_order=False)  # fmt: skip
    foot = np.multiply(unit, (0.2, 0, -0.48))
    model.add_body("slider", 1.0, (1e-3, 1e-3, 1e-3), foot)
    model.add_body("link", 1.0, (1e-3, 1e-3, 1e-3), 0.5 * foot)
    model.add_joint("rail", "prismatic", "ground", "slider", foot, axis=(1, 0, 0))
    model.add_joint("knee", "revolute", "slider", "link", foot, axis=(0, 1, 0))
    model.add_joint("pin", "revolute", "link", "rod.2", (0, 0, 0), axis=(0, 1, 0))
    w = np.array(model.moved({"rail.z": -0.2 * unit}).beams["rod"].points)[:, 2]
    np.testing.assert_allclose(w / unit, (0, 0.02, 0.04, 0.02, 0), rtol=1e-9, atol=1e-12)


def test_coordinates_that_are_cut_do_not_move_beams():
    with pytest.raises(mv.ModelError, match=r"'base\.rz' is not a joint coordinate"):
        arms().moved({"base.rz": 0.01}, cut=["base"])


def hanging(tilt, elements=4, **material):
    """A pendulum on the tip of a beam, described at an angle."""
    model = mv.Model("hanging", gravity=(0, 0, -G))
    model.add_beam("rod", "ground", None, SECTION, STEEL | material, start=(0, 0, 0), end=(LENGTH, 0, 0),
                   elements=elements)  # fmt: skip
    model.add_body("bob", 0.05, (2e-5, 3e-5, 1e-5), (LENGTH - 0.2 * np.sin(tilt), 0, -0.2 * np.cos(tilt)),
                   orientation=turn(tilt))  # fmt: skip
    model.add_joint("pin", "revolute", f"rod.{elements}", "bob", (LENGTH, 0, 0), axis=(0, 1, 0))
    return model


@pytest.mark.slow
@pytest.mark.parametrize("tilt", [0.0, 0.6, -2.0])
def test_a_pendulum_on_a_beam_hangs_straight_down(tilt):
    there = hanging(tilt).equilibrium()
    down = 0.05 * G * LENGTH**3 / (3 * EI) + LINE * G * LENGTH**4 / (8 * EI)
    x = np.polynomial.Polynomial([0.0, 1.0])
    moment = 0.05 * G * (LENGTH - x) + 0.5 * LINE * G * (LENGTH - x) ** 2
    shorter = 0.5 * ((moment / EI).integ() ** 2).integ()(LENGTH)
    tip = there.beams["rod"].points[-1]
    np.testing.assert_allclose(tip, (LENGTH - shorter, 0, -down), rtol=3e-5, atol=1e-11)  # weights turn with nodes
    np.testing.assert_allclose(there.bodies["bob"].position, np.subtract(tip, (0, 0, 0.2)), atol=1e-9)
    # the same mechanism as one that is built there, its beam through the bent nodes
    system = there.linearize()
    built = mv.Model("built", gravity=(0, 0, -G))
    built.add_beam("rod", "ground", None, SECTION, STEEL, nodes=there.beams["rod"].points, y_axis=(0, 1, 0))
    built.add_body("bob", 0.05, (2e-5, 3e-5, 1e-5), there.bodies["bob"].position)
    built.add_joint("pin", "revolute", "rod.4", "bob", tip, axis=(0, 1, 0))
    np.testing.assert_allclose(system.modes().natural, built.linearize().modes().natural, rtol=1e-3)


@pytest.mark.slow
def test_a_stiff_beam_is_a_rigid_body():
    """A beam on a spring-loaded hub with a load at its tip, beside a mechanism with a rigid rod in its place."""

    def swing(modulus):
        model = mv.Model("swing", gravity=(0, 0, -G))
        model.add_body("hub", 0.5, (1e-3, 1e-3, 1e-3))
        model.add_joint("motor", "revolute", "ground", "hub", (0, 0, 0), axis=(0, 1, 0))
        model.add_bushing("k", "ground", "hub", (0, 0, 0), (0, 0, 0, 0, 5.0, 0))
        if modulus is None:
            for i in range(5):
                share = (0.5 if i in (0, 4) else 1.0) / 4
                model.add_body(f"n{i}", LINE * LENGTH * share, (0, 0, 0), (i / 4, 0, 0))
                model.add_joint(f"f{i}", "fixed", "hub", f"n{i}", (i / 4, 0, 0))
        else:
            model.add_beam("rod", "hub", None, SECTION, STEEL | {"E": modulus}, start=(0, 0, 0), end=(LENGTH, 0, 0),
                           elements=4)  # fmt: skip
        model.add_load("P", "n4" if modulus is None else "rod.4", (0, 0.1, -2.0))
        return model.equilibrium(report=True).displacements["hub"][4]

    rigid = swing(None)
    assert abs(rigid) > 0.5
    errors = [abs(swing(modulus) - rigid) for modulus in (1e15, 1e16)]
    assert errors[1] < 2e-6
    assert errors[1] == pytest.approx(errors[0] / 10, rel=0.05)


@pytest.mark.parametrize("modulus", [1e14, 1e21])
def test_a_beam_beside_a_spring_that_is_softer_by_far_is_a_rigid_body(modulus):
    """k a = P L cos(a) at any modulus: the beam is stiffer than the spring by factors of 1e7 and 1e14."""
    model, k = mv.Model("swing"), 5e-3
    model.add_body("hub", 0.5, (1e-3, 1e-3, 1e-3))
    model.add_joint("motor", "revolute", "ground", "hub", (0, 0, 0), axis=(0, 1, 0))
    model.add_torsion_spring("k", "ground", "hub", (0, 1, 0), k)
    model.add_beam("rod", "hub", None, SECTION, STEEL | {"E": modulus}, start=(0, 0, 0), end=(LENGTH, 0, 0), elements=1)
    model.add_load("P", "rod.1", (0, 0, -0.4 * k / LENGTH))
    angle = model.equilibrium(report=True).displacements["hub"][4]
    assert angle == pytest.approx(0.4 * np.cos(angle), rel=1e-7)


@pytest.mark.slow
def test_a_beam_is_the_superelement_of_its_matrices():
    """A bent line in space between a hub and a body, carried at an angle: the same pose by either description."""
    nodes = np.array([(0, 0, 0), (0.4, 0.1, 0.1), (0.6, -0.1, 0.3), (0.9, 0, 0)])
    section = {"A": 3e-4, "Iy": 2e-8, "Iz": 5e-9, "J": 1e-8}

    def model(reduced):
        model = mv.Model("either")
        model.add_body("hub", 0.5, (1e-3, 1e-3, 1e-3))
        model.add_joint("ball", "spherical", "ground", "hub", (0.1, 0, 0))
        model.add_bushing("k", "ground", "hub", (0.1, 0, 0), (0, 0, 0, 60.0, 50.0, 70.0))
        model.add_body("end", 0.5, (1e-3, 1e-3, 1e-3), (1.0, 0.1, 0))
        if reduced:
            frames = make.beams["rod"].frames()
            k, m = assembled(nodes, [axes for _, axes in frames],
                             lambda i: matrices(frames[i][0], 3e-4, 2e-8, 5e-9, 1e-8, 7e10, 2.6e10, 2700.0))
            names = {f"n{i}": point for i, point in enumerate(nodes)}
            model.add_superelement("rod", m, None, k, names, bodies={"n0": "hub", "n3": "end"})
        else:
            model.add_beam("rod", "hub", "end", section, {"E": 7e10, "G": 2.6e10, "rho": 2700.0}, nodes=nodes,
                           y_axis=(1, 2, 5), second_order=False)  # fmt: skip
        model.add_load("P", "end", (30.0, 40.0, -25.0), torque=(0, 5.0, 0))
        return model

    make = model(False)
    bent, reduced = make.equilibrium(report=True), model(True).equilibrium(report=True)
    for body in ("hub", "end"):
        np.testing.assert_allclose(bent.displacements[body], reduced.displacements[body], atol=1e-9)
    assert np.linalg.norm(bent.displacements["hub"][3:]) > 0.1
    own = np.array(bent.model.beams["rod"].displacements)
    other = _world(reduced.model.superelements["rod"], own.shape)
    np.testing.assert_allclose(own.reshape(-1), other, rtol=1e-6, atol=1e-11)


def _world(part, shape):
    return (np.array(part.displacements).reshape(-1, 3) @ np.array(part.orientation).T).reshape(shape).reshape(-1)


@pytest.mark.slow
def test_files_keep_bent_beams(tmp_path):
    there = hanging(0.3).equilibrium()
    for name in ("there.yaml", "there.json"):
        mv.save(there, tmp_path / name)
        again = mv.load(tmp_path / name)
        assert again.beams == there.beams
        assert again.equilibrium(report=True).iterations == 0


def test_axes_of_twisted_elements_turn():
    """A strip that a torque twists and a force then bends: each element's axes stand at the angle of its middle."""
    model = cantilever((0, 0, 0.01), elements=4)
    model.add_load("T", "rod.4", torque=(2.0, 0, 0))
    rod = model.equilibrium().beams["rod"]
    angles = [np.arctan2(axes[2][1], axes[1][1]) for _, axes in rod.frames()]
    twist = np.array(rod.displacements)[:, 3]
    assert twist[-1] > 0.05
    np.testing.assert_allclose(angles, 0.5 * (twist[1:] + twist[:-1]), rtol=1e-3)


def test_preloads_of_springs_with_a_free_length_beside_a_beam():
    """A spring that was slack holds a hinged beam as it stands: T = m g / 2 at the end of a beam of the weight m g."""
    model = mv.Model("boom", gravity=(0, 0, -9.81))
    model.add_body("hub", 0.5, (1e-3, 1e-3, 1e-3))
    model.add_joint("hinge", "revolute", "ground", "hub", (0, 0, 0), axis=(0, 1, 0))
    model.add_beam("boom", "hub", None, SECTION, STEEL, start=(0, 0, 0), end=(LENGTH, 0, 0), elements=2)
    model.add_spring("stay", "ground", "boom.2", (LENGTH, 0, 1.0), (LENGTH, 0, 0), 1e3, free_length=1.0)
    there = model.equilibrium(preload=True)
    weight = 9.81 * STEEL["rho"] * there.beams["boom"].properties.A * LENGTH
    assert there.springs["stay"].free_length is None
    assert there.springs["stay"].preload == pytest.approx(0.5 * weight, rel=1e-12)
    assert there.linearize().dof == 13


@pytest.mark.parametrize(("slope", "told"), [(0.14, False), (0.16, True), (-0.31, True)])
def test_a_beam_that_bends_far_is_warned_of(slope, told):
    """Beside another one that does not; the slope of the tip is P L^2 / 2EI, and its square over two the error."""
    model = cantilever((0, 0, 2 * EI * slope / LENGTH**2), second_order=False)
    model.add_beam("other", "ground", None, SECTION, STEEL, start=(0, 1, 0), end=(LENGTH, 1, 0), elements=1)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        model.equilibrium()
    words = [str(item.message) for item in caught if item.category is mv.LargeDisplacementWarning]
    assert len(words) == told
    if told:
        assert re.search(rf"beam 'rod' bends by {abs(slope):.2g} rad; .* about {0.5 * slope**2:.0%} there", words[0])
