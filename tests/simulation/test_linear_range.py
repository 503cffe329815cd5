"""How far the linear model holds: closed forms, harmonics of nonlinear runs, and what is refused."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.finite_motion.statement import finite_motion
from mbsvib.library import toggle
from mbsvib.simulation.linear_range import second_order
from mbsvib.simulation.outputs import measured


@pytest.mark.few(2)
@pytest.mark.parametrize("angle", [0.284, 0.1415, 0.05, 0.01, 0.001])
def test_toggle_has_its_closed_form(angle):
    """s = 2 l cos(theta): 1/2 s'' d^2 = 0.1 s' d at d = 0.2 tan(theta), where s' d = 0.4 l sin(theta) tan(theta)."""
    found = toggle(angle=angle).linearize().linear_range()
    expected = 0.4 * 0.1 * np.sin(angle) * np.tan(angle)
    assert found.values[0, found.outputs.index("s")] == pytest.approx(expected, rel=1e-9)


def test_pendulum_on_a_spring_has_the_second_order_part_of_lindstedt():
    """theta'' + w^2 (theta + e theta^2) = 0 has the mean -e a^2 / 2 and the second harmonic e a^2 / 6."""
    length, mass, k, ratio = 0.3, 2.0, 500.0, 0.05
    model = mv.Model("eccentric")
    model.add_body("bar", mass, (1e-3, 1e-3, 1e-3), (length, 0, 0))
    model.add_joint("hinge", "revolute", "ground", "bar", (0, 0, 0), axis=(0, 0, 1))
    # V = k/2 (|r| - L)^2 with r from (length, h) to the bar's end
    h = ratio / 0.05 * 0.2
    model.add_spring("s", "ground", "bar", (0.0, -h, 0), (length, 0, 0), k)
    model.add_output("angle", "bar", "rz")

    def stretch(theta):
        end = length * np.array([np.cos(theta), np.sin(theta)])
        return np.hypot(end[0], end[1] + h)

    # exact derivatives of |r|^2 = l^2 + h^2 + 2 l h sin(theta)
    L, c = stretch(0.0), length * h
    first, second = c / L, -(c**2) / L**3
    e = 1.5 * second / first  # V' = k (D1^2 t + 3/2 D1 D2 t^2)
    found = model.linearize().linear_range(0.1)
    assert found.values[0, 0] == pytest.approx(0.1 / abs(0.5 * e), rel=1e-9)


@pytest.mark.parametrize("size", [1.0, 1e-3, 1e3])
def test_travel_of_a_slide_is_in_sizes_of_the_mechanism(size):
    """x'' + w^2 (x + e x^2) = 0 has the mean -e a^2 / 2: travel in sizes and amplitude in metres follow the scale."""
    h, near = 0.5 * size, 0.003 * size
    model = mv.Model("oblique")
    model.add_body("b", 2.0, (0.1, 0.1, 0.1), (0, 0, 0))
    model.add_joint("rail", "prismatic", "ground", "b", (0, 0, 0), axis=(0, 1, 0))
    model.add_spring("s", "ground", "b", (h, -near, 0), (0, 0, 0), 500.0)
    model.add_output("y", "b", "y")
    length = np.hypot(h, near)
    first, second = near / length, h**2 / length**3  # derivatives of the spring's length
    amplitude = 0.1 / (0.5 * 1.5 * second / first)
    found = model.linearize().linear_range(0.1)
    assert found.values[0, 0] == pytest.approx(amplitude, rel=1e-9)
    points = np.array([(0, 0, 0), (0, 0, 0), (h, -near, 0), (0, 0, 0)])
    rms = np.sqrt(np.mean(np.sum((points - points.mean(axis=0)) ** 2, axis=1)))
    assert found.travel[0, 0] == pytest.approx(amplitude / rms, rel=1e-9)
    assert len(found.sentences()) == 1


@pytest.mark.slow
@pytest.mark.parametrize("angle", [0.284, 0.05])
def test_toggle_in_a_nonlinear_run_has_the_mean_and_harmonic_predicted(angle):
    model = toggle(angle=angle, spring_damping=1e-9)
    system = model.linearize(independent=["base.rz"])
    share = 0.004
    amplitude = system.linear_range(share).values[0, 1]
    w = float(system.modes().natural[0])
    t = np.linspace(0.0, 2.0 * np.pi / w, 65)
    # quadratic terms move the mean; released at +a the run is a mean, a first and a second harmonic
    run = model.simulate(t, initial={"base.rz": amplitude}, tolerance=1e-10)
    angles = run["angle"]
    basis = np.array([np.ones_like(t), np.cos(w * t), np.cos(2.0 * w * t)]).T
    mean, first, second = np.linalg.lstsq(basis, angles, rcond=None)[0]
    assert max(abs(mean), abs(second)) / abs(first) == pytest.approx(share, rel=0.02)


def test_second_order_parts_of_damped_motion():
    """x = l cos(theta), x' = -l sin(theta) theta', m g l cos(theta) at theta = Re(q e^(s t)), q and s complex."""
    mass, length, gravity, q, s = 2.0, 0.3, 9.81, 0.4 + 0.3j, -0.5 + 2.0j
    model = mv.Model("bar", gravity=(0.0, -gravity, 0.0))
    model.add_body("bar", mass, (0.1, 0.1, 0.1), (length, 0, 0))
    model.add_joint("hinge", "revolute", "ground", "bar", (0, 0, 0), axis=(0, 0, 1))
    model.add_output("x", "bar", "x", position=(length, 0, 0))
    model.add_output("v", "bar", "x", position=(length, 0, 0), quantity="velocity")
    statement = finite_motion(model)
    parts = second_order(statement, measured(model, statement), np.array([0]), np.zeros(0))
    twice, steady = parts.along(parts.first(np.array([q]), s))
    np.testing.assert_allclose(twice[2], -0.25 * length * q**2 * np.array([1.0, 2.0 * s]), rtol=1e-12)
    np.testing.assert_allclose(steady[2], -0.25 * length * abs(q) ** 2 * np.array([1.0, 2.0 * s.real]), rtol=1e-12)
    weight = -0.25 * mass * gravity * length
    np.testing.assert_allclose([twice[0][0], steady[0][0]], [weight * q**2, weight * abs(q) ** 2], rtol=1e-12)


@pytest.mark.slow
def test_velocity_outputs_and_the_table():
    model = toggle()
    model.add_output("v", "slider", "x", quantity="velocity")
    system = model.linearize()
    found = system.linear_range(0.1)
    assert found.values.shape == (1, 3)
    assert np.isfinite(found.values).all()
    assert "angle [rad]" in str(found)
    assert "estimated amplitude" in str(found)
    assert "no lower bounds" in str(found)
    assert "conservative amplitude" in str(system.linear_range(0.1, conservative=True))
    twice = system.linear_range(0.2)
    np.testing.assert_allclose(twice.values, 2.0 * found.values)
    assert found.sentences() == ()
    near = toggle(angle=0.01).linearize().linear_range()
    assert "output 's'" in near.sentences()[0]
    assert "mode 1" in near.sentences()[0]


def test_linear_motion_has_no_second_order_part():
    model = mv.Model("slider")
    model.add_body("b", 1.0, (0.1, 0.1, 0.1), (0, 0, 0))
    model.add_joint("rail", "prismatic", "ground", "b", axis=(1, 0, 0))
    model.add_spring("s", "ground", "b", (-1, 0, 0), (0, 0, 0), 100.0)
    model.add_output("x", "b", "x")
    assert np.isinf(model.linearize().linear_range().values).all()


def test_what_has_no_range_is_refused_by_name():
    system = toggle().linearize()
    with pytest.raises(mv.ResponseError, match=r"share = -0\.1"):
        system.linear_range(-0.1)
    with pytest.raises(mv.ModelError, match="'beam' is a beam"):
        mv.library.singular_beam().linearize().linear_range()
    with pytest.raises(mv.ModelError, match="made of matrices"):
        mv.System.from_matrices(np.eye(2), None, np.eye(2)).linear_range()


@pytest.mark.slow
def test_explain_tells_small_ranges_and_computes_no_modes_for_them():
    system = mv.library.toggle(angle=0.01).linearize()
    text = system.explain()
    assert "linear range\n  output 's': the second-order part reaches 10% of the linear one at an estimated" in text
    assert "4e-06 m in mode 1" in text
    assert "no eigenvalue was computed" in system.explain()
    assert "linear range" not in mv.library.toggle(angle=0.284).linearize().explain()
    assert "linear range" not in mv.library.stewart_isolator().linearize().explain()


def test_outputs_without_any_part_are_no_warning():
    """An output that a mode does not move has an infinite range."""
    model = mv.library.toggle(angle=0.284)
    model.add_output("across", "slider", "z")
    found = model.linearize().linear_range()
    assert np.isinf(found.values[:, found.outputs.index("across")]).all()


def test_an_output_that_stands_still_by_symmetry_has_no_linear_part():
    """The tip of an upright arm moves across its axis only, but for the rounding of its pose."""
    model = mv.Model("arm", gravity=(0, 0, -9.81))
    model.add_body("arm", 2.0, (0.03, 0.03, 0.001), position=(0, 0, 0.1))
    model.add_joint("hinge", "revolute", "ground", "arm", position=(0, 0, 0), axis=(0, 1, 0))
    model.add_torsion_spring("k", "ground", "arm", (0, 1, 0), 50.0)
    model.add_output("up", "arm", "z", position=(1e-16, 0, 0.3))
    system = model.linearize()
    assert abs(system.Cq[0, 0]) == pytest.approx(1e-16)
    reach = system.linear_range()
    assert reach.values[0, 0] == 0.0
    assert reach.sentences() == ()
