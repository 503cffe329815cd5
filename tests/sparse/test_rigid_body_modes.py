"""Motions that no spring resists: exactly zero, counted where springs touch, and named."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
from tests.sparse import scenes
from tests.support.compare import assert_same_eigenvalues
from tests.support.random_models import rotation, spatial

SCENES = {
    "floating": (lambda n: scenes.floating(n), 6),
    # a line spring holds one direction of the free motion, or only what is between the ends
    "tied to ground": (lambda n: scenes.floating(n, "ground"), 5),
    "tied to itself": (lambda n: scenes.floating(n, "self"), 6),
    "leapfrog": (lambda n: scenes.leapfrog(n), 1),
    "shaft without ground": (lambda n: unsprung(n), 1),
}


def unsprung(n):
    """A revolute chain on a bearing: nothing resists the first joint."""
    model = mv.Model(f"unsprung{n}")
    for i in range(n):
        below, name = f"b{i - 1}" if i else "ground", f"b{i}"
        model.add_body(name, 1.0, scenes.INERTIA, (i + 0.5, 0.0, 0.0))
        model.add_joint(f"j{i}", "revolute", below, name, (float(i), 0.0, 0.0))
        if i:
            model.add_bushing(f"s{i}", below, name, (float(i), 0.0, 0.0), (0, 0, 0, 0, 0, 100.0))
    return model


@pytest.mark.few(2)
@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("n", [20, 700])
def test_zero_exactly_and_named(name, n):
    make, rigid = SCENES[name]
    system = make(n).linearize(method="sparse")
    modes = system.modes(rigid + 4)
    assert modes.rigid == rigid
    assert not modes.eigenvalues[: 2 * rigid].any() or not modes.classical
    assert not modes.frequencies[:rigid].any()
    assert (modes.frequencies[rigid:] > 0).all()
    word = "1 rigid-body mode, exactly 0 Hz." if rigid == 1 else f"{rigid} rigid-body modes, exactly 0 Hz."
    assert word in modes.remarks()


@pytest.mark.few(2)
@pytest.mark.parametrize("name", SCENES)
def test_as_the_dense_path_has_them(name):
    make, _ = SCENES[name]
    model = make(24)
    every = model.linearize(method="dense").modes()
    some = model.linearize(method="sparse").modes(12)
    assert_same_eigenvalues(some.eigenvalues, every.nearest(12).eigenvalues, rtol=1e-11)


@pytest.mark.few(1)
@pytest.mark.parametrize("name", SCENES)
def test_around_a_frequency(name):
    """They are exact zeros, too, where they are found because they are the nearest."""
    make, rigid = SCENES[name]
    model = make(24)
    every = model.linearize(method="dense").modes()
    near = 0.45 * every.frequencies[rigid]
    some = model.linearize(method="sparse").modes(rigid + 3, near=near)
    assert some.rigid == rigid
    assert not some.frequencies[:rigid].any()
    assert_allclose(some.frequencies, every.nearest(rigid + 3, near).frequencies, rtol=1e-10)
    high = model.linearize(method="sparse").modes(3, near=every.frequencies[-1])
    assert high.rigid == 0


@pytest.mark.slow
def test_fewer_than_there_are():
    """Two of six: still zeros, and motions that meet no spring."""
    system = scenes.floating(800).linearize()
    modes = system.modes(2)
    assert modes.rigid == 2
    assert not modes.eigenvalues.any()
    assert system.modes(2).remarks()[0].startswith("2 rigid-body modes")


def test_free_motion_is_that_of_a_rigid_body():
    """The six zeros of a floating chain move all bodies as one."""
    model = scenes.floating(300)
    modes = model.linearize(method="sparse").modes(6)
    first = modes.body_shapes["b0"]
    for name in ("b1", "b150", "b299"):
        arm = np.subtract(model.bodies[name].position, model.bodies["b0"].position)
        shape = modes.body_shapes[name]
        assert_allclose(shape[3:], first[3:], atol=1e-11)
        assert_allclose(shape[:3], first[:3] + np.cross(first[3:].T, arm).T, atol=1e-9)


@pytest.mark.slow
def test_equal_frequencies_of_equal_parts():
    """One frequency 2000 times: Lanczos alone sees it once, the count finds the others."""
    modes = scenes.pendulums(2000).linearize().modes(20)
    assert_allclose(modes.natural, np.sqrt(100.0 / (0.15 + 1.0)), rtol=1e-14)
    assert modes.missed == 0
    shapes = np.array([modes.body_shapes[f"b{i}"][5] for i in range(2000)])
    assert np.linalg.matrix_rank(shapes) == 20


@pytest.mark.slow
def test_static_compliance_without_a_hold_is_refused():
    model = scenes.floating(300)
    model.add_input("F", "b10", "x")
    model.add_output("x", "b10", "x")
    system = model.linearize(method="sparse")
    with pytest.raises(mv.ResponseError, match="stiffness of 'floating300' is singular"):
        system.static_compliance()
    with pytest.raises(mv.ResponseError, match="a rigid-body mode"):
        system.frequency_response([0.0])
    assert np.isfinite(system.frequency_response([1e-3])).all()


def test_an_undamped_pole_is_refused():
    model = mv.library.chain(700, damping=(0,) * 6, line=(0, 1, 0))
    system = model.linearize()
    omega = 2 * np.pi * system.modes(3).frequencies
    with pytest.raises(mv.ResponseError, match=r"omega\[1\] = .* \(an undamped mode\)"):
        system.frequency_response([0.5 * omega[0], omega[0]])
    assert np.isfinite(system.frequency_response(omega * (1 + 1e-9))).all()


def test_a_wheel_under_its_weight():
    """Its rows of load cancel, so that no lock was found for its turning: a bare LinAlgError."""
    model = mv.Model("wheel", gravity=(0, 0, -9.81))
    model.add_body("wheel", 2.0, (0.1, 0.1, 0.1), position=(0.3, 0, 0))
    model.add_joint("axle", "revolute", "ground", "wheel", position=(0, 0, 0), axis=(1, 0, 0))
    model.add_body("bob", 2.0, (0.1, 0.1, 0.1), position=(1, 0, -0.3))
    model.add_joint("pin", "revolute", "ground", "bob", position=(1, 0, 0), axis=(0, 1, 0))
    result = model.linearize(method="sparse").modes(2).frequencies
    np.testing.assert_allclose(result, [0, np.sqrt(2 * 9.81 * 0.3 / 0.28) / (2 * np.pi)], rtol=1e-12, atol=1e-6)


def test_dampers_of_motions_that_are_free_but_for_underflow():
    """Coordinates of a rigid-body mode that are 1e-140 in place of 0 are not braked: the mode is exactly 0."""
    model = spatial(4419614, bodies=2, floating=True)
    dense = model.linearize(method="dense").modes()
    result = model.linearize(method="sparse").modes(len(dense.frequencies))
    assert np.count_nonzero(result.eigenvalues == 0) == np.count_nonzero(dense.eigenvalues == 0)
    assert_allclose(result.natural, dense.natural, rtol=1e-9)


@pytest.mark.few(2)
@pytest.mark.parametrize("count", [1, 2, 4, 6, 8])
def test_preloads_that_cancel_hold_nothing(count):
    """Four rigid-body modes of the dense equations are held by rounding of preloads in the sparse ones."""
    model = mv.load(Path(__file__).with_name("hardly_held.yaml"))
    dense, modes = (model.linearize(method=method).modes(count) for method in ("dense", "sparse"))
    assert modes.rigid == min(count, 4)
    assert_same_eigenvalues(modes.eigenvalues, dense.eigenvalues, rtol=1e-9)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_the_slowest_of_braked_modes_are_found_among_all_of_them(count):
    """Carriages that dampers alone hold: their eigenvalues are 0 and those of -M^-1 C, the slowest of these come."""
    masses, brakes = np.array([2.0, 0.5, 3.0, 1.0, 7.0]), np.array([4.0, 30.0, 0.2, 9.0, 1.0])
    model = mv.Model("carriages")
    for i, (mass, brake) in enumerate(zip(masses, brakes, strict=True)):
        at = [0.4 * i, 0.0, 0.0]
        model.add_body(f"c{i}", mass, [0.1, 0.1, 0.1], at)
        model.add_joint(f"rail{i}", "prismatic", "ground", f"c{i}", axis=[1.0, 0.0, 0.0])
        before = "ground" if i == 0 else f"c{i - 1}"
        model.add_spring(f"brake{i}", before, f"c{i}", [0.4 * i - 0.4, 0.0, 0.0], at, damping=brake)
    C = np.diag(brakes + np.append(brakes[1:], 0.0)) - np.diag(brakes[1:], 1) - np.diag(brakes[1:], -1)
    expected = -np.linalg.eigvalsh(C / np.sqrt(np.outer(masses, masses)))[:count]
    result = model.linearize(method="sparse").modes(count)
    np.testing.assert_allclose(np.sort(result.eigenvalues.real)[:count], np.sort(expected), rtol=1e-12)
    assert (np.sort(np.abs(result.eigenvalues))[:count] == 0.0).all()


def cylinders(n, damping=0.0, force=8.0):
    """Bodies that slide freely along an axis, about which a force diverges, each with a sprung part."""
    model, axes = mv.Model(f"cylinders{n}"), rotation(np.random.default_rng(0))
    for i in range(n):
        at, stiffness = axes @ (0.9 * i, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 18.0 + 1.8 * i)
        body, part, joint = f"b{i}", f"p{i}", at + axes @ (0.0, 0.4, 0.3)
        model.add_body(body, 1.0 + i, (0.1, 0.2, 0.3), at + axes @ (0.0, 0.4, 0.1))
        model.add_joint(f"slide{i}", "cylindrical", body, "ground", at, axes)
        model.add_load(f"force{i}", body, axes @ (0.0, -force, 0.0), position=at + axes @ (0.0, 0.4, 0.2))
        model.add_body(part, 1.0, (0.1, 0.1, 0.2), at + axes @ (0.0, 0.5, 0.3))
        model.add_joint(f"hinge{i}", "revolute", body, part, joint, axes)
        model.add_bushing(f"spring{i}", body, part, joint, stiffness, (0, 0, 0, 0, 0, damping), axes)
    return model


@pytest.mark.few(1)
@pytest.mark.parametrize("n", [1, 3, 12])
@pytest.mark.parametrize("damping", [0.0, 0.3])
def test_diverging_motions_are_not_taken_for_free_ones(n, damping):
    model = cylinders(n, damping)
    every, system = model.linearize(method="dense").modes(), model.linearize(method="sparse")
    natural = np.sort(every.natural)
    for count in (1, n, n + 1, 2 * n, 3 * n):
        modes = system.modes(count)
        assert modes.rigid == min(n, count)
        assert modes.missed == 0
        assert_allclose(np.sort(modes.natural), natural[:count], rtol=1e-10, atol=0.0)
        assert np.abs(modes.eigenvalues[:, None] - every.eigenvalues).min(axis=1).max() < 1e-10


def test_diverging_motions_do_not_hide_a_slower_one():
    """Twelve diverging motions are nearer to the shift below zero than one that oscillates more slowly."""
    model = cylinders(12, force=0.05)
    for i in range(120):
        wheel, stiffness = f"wheel{i}", 100.0 + i if i else 0.0034
        model.add_body(wheel, 1.0, (1.0, 1.0, 1.0), (0.0, 0.0, 0.0))
        model.add_joint(f"axle{i}", "revolute", "ground", wheel, (0.0, 0.0, 0.0))
        model.add_bushing(f"tie{i}", "ground", wheel, (0.0, 0.0, 0.0), (0, 0, 0, 0, 0, stiffness))
    modes = model.linearize(method="sparse").modes(13)
    assert modes.rigid == 12
    assert_allclose(modes.natural[-1], np.sqrt(0.0034), rtol=1e-9)


def carriage(n):
    """A free carriage with inverted pendulums, of which the first diverge and the others oscillate."""
    model = mv.Model(f"carriage{n}", gravity=(0.0, 0.0, -9.81))
    model.add_body("carriage", 3.0, scenes.INERTIA, (0.0, 0.0, 0.0))
    model.add_joint("rail", "prismatic", "ground", "carriage", (0.0, 0.0, 0.0), axis=(1.0, 0.0, 0.0))
    for i in range(n):
        model.add_body(f"p{i}", 1.0 + 0.1 * i, (0.1, 0.1, 0.1), (float(i), 0.0, 0.5 - 0.01 * i))
        model.add_joint(f"j{i}", "revolute", "carriage", f"p{i}", (float(i), 0.0, 0.0), axis=(0.0, 1.0, 0.0))
        model.add_torsion_spring(f"s{i}", "carriage", f"p{i}", (0.0, 1.0, 0.0), stiffness=0.5 + 3.0 * i)
    return model


@pytest.mark.parametrize("count", [2, 3, 5])
def test_free_motions_are_no_missed_modes(count):
    modes = carriage(40).linearize(method="sparse").modes(count)
    assert modes.rigid == 1
    assert modes.missed == 0


@pytest.mark.parametrize("damping", [0.0, 2.0])
def test_around_a_frequency_where_all_modes_are_rigid(damping):
    """Nothing but dampers: the nearest modes are the slowest ones, wherever they are asked for."""
    model, below = mv.Model("sliders"), "ground"
    for i in range(30):
        model.add_body(f"b{i}", 1.0, scenes.INERTIA, (float(i), 0.0, 0.0))
        model.add_joint(f"j{i}", "prismatic", below, f"b{i}", axis=(1, 0, 0))
        if damping:
            model.add_bushing(f"d{i}", below, f"b{i}", (float(i), 0.0, 0.0), (0.0,) * 6, (damping, 0, 0, 0, 0, 0))
        below = f"b{i}"
    modes = model.linearize(method="sparse").modes(5, near=3.0)
    assert modes.natural.tolist() == [0.0] * 5
    assert modes.missed == 0
    expected = model.linearize(method="dense").modes().eigenvalues
    slowest = np.sort(np.abs(expected[expected != 0.0]))[:5]
    assert_allclose(np.sort(np.abs(modes.eigenvalues[modes.eigenvalues != 0.0])), slowest, rtol=1e-11)


def carts(brakes, forced, method):
    """Two carts with a spring of 50 N/m between them, braked to the ground."""
    model = mv.Model("carts")
    for name, x, mass, brake in (("a", 0.0, 3.0, brakes[0]), ("b", 1.0, 2.0, brakes[1])):
        model.add_body(name, mass, np.ones(3), (x, 0, 0))
        model.add_joint(f"rail.{name}", "prismatic", "ground", name, (x, 0, 0), axis=(1, 0, 0))
        if brake:
            model.add_spring(f"brake.{name}", "ground", name, (x, 1, 0), (x + 1, 1, 0), stiffness=0.0, damping=brake)
    model.add_spring("spring", "a", "b", (0, 0, 0), (1, 0, 0), stiffness=50.0, damping=0.3)
    model.add_input("F", forced[0], "x", relative_to=forced[-1])
    model.add_output("v", "a", "x", quantity="velocity")
    model.add_output("gap", "b", "x", relative_to="a")
    return model.linearize(method=method)


@pytest.mark.parametrize("method", ["dense", "sparse"])
def test_the_response_at_0_of_braked_motions_is_their_drift(method):
    result = carts((1.5, 0.5), ("a", "ground"), method).frequency_response([0.0, 1e-9])
    # v = F / (c_a + c_b), and the spring pulls the brake of b along
    assert_allclose(result[:, 0, 0].real, (0.5, -0.25 / 50.0), rtol=1e-12)
    assert_allclose(result[:, 0, 0], result[:, 0, 1], rtol=1e-7)
    assert not result[:, 0, 0].imag.any()


@pytest.mark.parametrize("method", ["dense", "sparse"])
@pytest.mark.parametrize("brakes", [(0.0, 0.0), (1.5, 0.5)])
def test_the_response_at_0_to_a_force_within_is_finite(brakes, method):
    result = carts(brakes, ("b", "a"), method).frequency_response([0.0])[:2, 0, 0]
    assert_allclose(result, (0.0, 1 / 50.0), rtol=1e-12, atol=1e-15)


def test_the_response_at_0_is_refused_where_a_motion_is_free():
    with pytest.raises(mv.ResponseError, match="0 rad/s is a pole of the system"):
        carts((0.0, 0.0), ("a", "ground"), "sparse").frequency_response([0.0])
