"""What outputs see of inputs at once: D + Ca M^-1 B, exactly 0 between mechanisms that share no inertia."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.responses.feedthrough import direct
from tests.hunt.checks import Subject
from tests.hunt.generate import example
from tests.support.random_models import rotation


def two_mechanisms():
    """Two chains of bodies, each on its own damped bushings, in all directions; nothing ties them to each other."""
    rng = np.random.default_rng(5)
    model = mv.Model()
    below = {"left": "ground", "right": "ground"}
    for i in range(4):
        for side in below:
            body = f"{side}{i}"
            model.add_body(body, 1.0 + rng.random(), 0.1 + rng.random(3) * 0.05, position=rng.normal(size=3),
                           orientation=rotation(rng))  # fmt: skip
            model.add_joint(f"{body}.hinge", "spherical", below[side], body, position=rng.normal(size=3))
            model.add_bushing(f"{body}.mount", "ground", body, position=rng.normal(size=3), orientation=rotation(rng),
                              stiffness=rng.uniform(1e3, 1e4, 6), damping=rng.uniform(1, 10, 6))  # fmt: skip
            below[side] = body
    for side, body in below.items():
        model.add_input(f"{side}.F", body, "x")
        model.add_output(f"{side}.a", body, "y", quantity="acceleration")
    return model


def test_mechanisms_that_share_no_inertia_see_nothing_at_once():
    system = two_mechanisms().linearize()
    inverse = np.linalg.inv(system.M)
    for realization in ("physical", "modal", "balanced"):
        d = system.state_space(realization).D
        assert d[0, 1] == d[1, 0] == 0.0
        assert d == pytest.approx(system.Ca @ inverse @ system.B, rel=1e-12, abs=1e-15)
    physical = system.state_space("physical")
    m = system.dof
    left = np.array([name.startswith("left") for name in system.coordinates])
    assert not physical.A[m:, :m][np.ix_(left, ~left)].any()
    assert not physical.A[m:, m:][np.ix_(~left, left)].any()


def test_what_is_not_seen_at_once_has_an_h2_norm():
    """Nor do its derivatives make it infinite."""
    system = two_mechanisms().linearize()
    norm = system.h2_norm("left.a", "right.F", ["left1.mass", "right2.hinge.position.x"])
    assert norm.value < 1e-9
    assert np.isfinite(norm.slopes).all()
    with pytest.raises(mv.ResponseError, match="infinite"):
        system.h2_norm("left.a", "left.F")


def test_what_is_left_of_terms_that_cancel_is_no_rounding():
    """D + Ca M^-1 B = -0.999 + 1 / (1 - 1e-6) with a mass matrix of condition 1e6; 1.001e-3 was taken for rounding."""
    mass = np.array([[1.0, 1.0 - 2e-6], [1.0 - 2e-6, 1.0]])
    system = mv.System.from_matrices(mass, None, 1e4 * np.eye(2), B=[[1.0], [1.0]], Ca=[[1.0, 1.0]], D=[[-0.999]])
    for realization in ("physical", "modal", "balanced"):
        found = system.state_space(realization).D
        np.testing.assert_allclose(found, 1.0 / (1.0 - 1e-6) - 0.999, rtol=1e-6)
    assert direct(system)[0, 0] == pytest.approx(1.0 / (1.0 - 1e-6) - 0.999, rel=1e-6)


@pytest.mark.parametrize("seed", [1, 2])
def test_bodies_beyond_one_without_mass_are_accelerated_at_once(seed):
    """A massless body between two joints; the feedthrough was taken for rounding, and the rms under white noise 9.2."""
    rng, model = np.random.default_rng(seed), mv.Model()
    for name, mass, below in (("a", 2.0, "ground"), ("n", 0.0, "a"), ("c", 1.0, "n")):
        model.add_body(name, mass, (0.1 * mass, 0.2 * mass, 0.25 * mass), position=rng.normal(size=3))
        model.add_joint(f"{name}.joint", "spherical", below, name, position=rng.normal(size=3))
        model.add_bushing(f"{name}.k", below, name, rng.normal(size=3), (1e3, 1e3, 1e3, 10, 10, 10), (1, 2, 3, 4, 5, 6))
    model.add_input("t", "c", "rz")
    model.add_output("acc", "c", (1, 0.3, -0.4), position=rng.normal(size=3), quantity="acceleration")
    system = model.linearize()
    far = system.frequency_response([1e12])[0, 0, 0].real
    assert abs(far) > 0.1
    assert direct(system)[0, 0] == pytest.approx(far, rel=1e-9)
    assert system.rms("acc", {"t": 1.0}) == {"acc": np.inf}


def test_a_mode_that_no_input_reaches_counts_for_nothing_in_a_reduction():
    """An undamped mode has an infinite peak, times no force at all."""
    model = mv.Model()
    for i in range(3):
        model.add_body(f"b{i}", 1.0, (1, 1, 1), position=(i, 0, 0))
        model.add_joint(f"j{i}", "prismatic", "ground", f"b{i}", position=(i, 0, 0), axis=(0, 0, 1))
        model.add_spring(f"s{i}", "ground", f"b{i}", start=(i, 0, -1), end=(i, 0, 0), stiffness=100.0 * (i + 1))
    model.add_input("F", "b1", "z")
    model.add_output("z", "b1", "z")
    model.add_output("beside", "b2", "z")
    small = model.linearize().reduced(1, method="modal")
    assert small.modes().frequencies == pytest.approx([np.sqrt(200.0) / (2 * np.pi)])


def test_small_accelerations_are_no_rounding():
    """A light body on a heavy one, 1e7 apart: what the heavy one does at once is small, and known to all digits."""
    model = mv.Model()
    for i, (name, mass) in enumerate((("heavy", 1e5), ("light", 1e-2))):
        model.add_body(name, mass, (mass, mass, mass), position=(i, 0, 0))
    model.add_joint("slide", "prismatic", "ground", "heavy", position=(0, 0, 0), axis=(1, 0, 0))
    model.add_joint("tilted", "prismatic", "heavy", "light", position=(1, 0, 0), axis=(1e-3, 1, 0))
    model.add_spring("k", "ground", "heavy", start=(-1, 0, 0), end=(0, 0, 0), stiffness=1e6)
    model.add_spring("l", "heavy", "light", start=(1, -1, 0), end=(1, 0, 0), stiffness=1e2)
    model.add_input("F", "light", "y")
    model.add_output("a", "heavy", "x", quantity="acceleration")
    system = model.linearize()
    tilt = 1e-3
    total = 1e5 + 1e-2 * (1 - tilt**2 / (1 + tilt**2))
    expected = -tilt / (1 + tilt**2) / total
    for realization in ("physical", "modal"):
        assert system.state_space(realization).D[0, 0] == pytest.approx(expected, rel=1e-9)


def test_small_accelerations_along_a_beam_are_no_rounding():
    """A force at the end moves each node before at once 0.3 times as much as the next; 3e-5 of the last was 0."""
    model = mv.Model()
    model.add_body("tip", 0.5, (1e-3, 1e-3, 1e-3), position=(1, 0, 0))
    model.add_beam("beam", "ground", "tip", {"type": "rectangle", "width": 0.06, "height": 0.01},
                   {"E": 7e10, "nu": 0.3, "rho": 2700.0}, (0, 0, 0), (1, 0, 0), elements=10)  # fmt: skip
    for k in range(1, 10):
        model.add_output(f"a{k}", f"beam.{k}", "z", quantity="acceleration")
    model.add_input("wind", "tip", "z")
    system = model.linearize()
    scale = 1.0 / np.sqrt(system.M.diagonal())
    expected = (system.Ca * scale) @ np.linalg.solve(system.M * np.outer(scale, scale), (system.B.T * scale).T)
    assert np.abs(expected).min() < 1e-4 * np.abs(expected).max()
    np.testing.assert_allclose(direct(system), expected, rtol=1e-7)  # M of condition 3e6


@pytest.mark.slow
def test_states_that_move_mass_by_rounding_alone_hide_no_feedthrough():
    """A scene with a massless node between dampers: D was taken for rounding of a state with 1e-20 J, and was 0."""
    system = Subject(example(76005)).system
    w = np.array([0.1])
    for realization in ("physical", "modal", "balanced"):
        space = system.state_space(realization)
        d = space.D[space.outputs.index("out2"), space.inputs.index("in1")]
        assert d == pytest.approx(-0.343123755, rel=1e-8)  # of the scene's own matrices, far above all poles
        response = space.frequency_response(w, "out2", "in1")
        np.testing.assert_allclose(response, system.frequency_response(w, "out2", "in1"), atol=1e-10)
