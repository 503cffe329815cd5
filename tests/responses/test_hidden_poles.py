"""Poles that do not decay: infinite answers are refused, finite ones given, whichever states the equations have."""

from fractions import Fraction

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.responses.norms import pole_words
from tests.support.random_models import rotation


def turned(a, b, c, seed):
    """A state space in other states; seed 0: as it is."""
    n = len(a)
    turn = np.eye(n) if not seed else np.random.default_rng(seed).standard_normal((n, n))
    back = np.linalg.inv(turn)
    return mv.StateSpace.from_arrays(turn @ a @ back, turn @ b, c @ back, 0)


def grounded(kp, ki):
    """2 kg on 800 N/m and 2 N s/m with the force -kp v - ki z, z' = v, from force to displacement."""
    model = mv.Model("grounded")
    model.add_body("mass", 2.0, (1, 1, 1))
    model.add_joint("rail", "prismatic", "ground", "mass", axis=(1, 0, 0))
    model.add_bushing("k", "ground", "mass", (0, 0, 0), (800.0, 0, 0, 0, 0, 0), (2.0, 0, 0, 0, 0, 0))
    model.add_input("F", "mass", "x")
    model.add_output("v", "mass", "x", quantity="velocity")
    model.add_output("x", "mass", "x")
    pi = mv.StateSpace.from_arrays([[0.0]], [[1.0]], [[-ki]], [[-kp]], inputs=["v"], outputs=["F"])
    return model.linearize().feedback(pi)["x", "F"]


@pytest.mark.few(2)
@pytest.mark.parametrize("kp", [1.0, 10.0])
@pytest.mark.parametrize("ki", [1.0, 50.0, 300.0, 2000.0])
def test_integral_feedback_of_a_velocity_is_a_spring(kp, ki):
    """The integral of the velocity is the displacement, up to a constant that nothing drives: a pole at 0."""
    loop, k, c, m = grounded(kp, ki), 800.0 + ki, 2.0 + kp, 2.0
    space = loop.state_space()
    assert space.frequency_response([0.0])[0, 0, 0] == pytest.approx(1.0 / k, rel=1e-12)
    assert loop.step_info().final[0, 0] == pytest.approx(1.0 / k, rel=1e-12)
    assert loop.h2_norm().value == pytest.approx(1.0 / np.sqrt(2.0 * c * k), rel=1e-12)
    zeta = c / (2.0 * np.sqrt(k * m))
    peak = loop.hinf_norm()
    assert peak.value == pytest.approx(1.0 / k / (2.0 * zeta * np.sqrt(1.0 - zeta**2)), rel=1e-9)
    assert peak.omega == pytest.approx(np.sqrt(k / m * (1.0 - 2.0 * zeta**2)), rel=1e-5)


@pytest.mark.parametrize("seed", range(4))
def test_static_response_beside_a_pole_at_zero_that_nothing_drives(seed):
    a = np.array([[0.0, 1.0, 0.0], [-400.0, -3.0, -7.0], [0.0, 1.0, 0.0]])
    space = turned(a, np.array([[0.0], [1.0], [0.0]]), np.array([[1.0, 0.0, 0.0]]), seed)
    value = space.frequency_response([0.0, 1e-9, 5.0])[0, 0]
    s = 1j * np.array([0.0, 1e-9, 5.0])
    assert value == pytest.approx(1.0 / (s**2 + 3.0 * s + 407.0), rel=1e-12)
    assert value[0].imag == 0.0
    assert space.reduced(order=3).states == ("hankel1", "hankel2")


@pytest.mark.parametrize("seed", range(5))
def test_an_integrator_in_any_states_is_refused(seed):
    """G = 1/s + sum of 1/(s + i): rounding of A leaves 1e-15 1/s of either sign for the pole."""
    n = 9
    space = turned(np.diag(-np.arange(float(n))), np.ones((n, 1)), np.ones((1, n)), seed)
    for question in (space.h2_norm, space.hinf_norm, space.step_info):
        with pytest.raises(mv.ResponseError, match=r"0 1/s does not decay and appears in the response of 'y1' to 'u1'"):
            question()
    with pytest.raises(mv.ResponseError, match=r"omega\[1\] = 0 rad/s is a pole"):
        space.frequency_response([1.0, 0.0])
    exact = (1.0 / (1j + np.arange(n))).sum()
    assert space.frequency_response([1.0])[0, 0, 0] == pytest.approx(exact, rel=1e-9)  # a condition of 8000


def test_poles_that_grow_are_refused_although_nothing_shows_them():
    with pytest.raises(mv.ResponseError, match=r"H2 norm of 'state space': the pole 2 1/s grows, although no output"):
        mv.StateSpace.from_arrays(np.diag([2.0, -1.0]), [[0], [1]], [[1, 1]], 0).h2_norm()


@pytest.mark.parametrize(("k", "fast", "c"), [(1e2, 1e7, 1e-3), (1e2, 1e9, 1e3), (1e4, 1e9, 1e-3), (1e6, 1e9, 1.0)])
def test_the_h2_norm_keeps_its_digits_beside_fast_poles(k, fast, c):
    """A mass on a spring, softened to nothing but for a lag: Routh's formula of third order; errors were 3e-10."""
    model = mv.Model("lag")
    model.add_body("mass", 1.0, (1, 1, 1))
    model.add_joint("rail", "prismatic", "ground", "mass", axis=(1, 0, 0))
    model.add_bushing("k", "ground", "mass", (0, 0, 0), (k, 0, 0, 0, 0, 0), (c, 0, 0, 0, 0, 0))
    model.add_input("F", "mass", "x")
    model.add_output("x", "mass", "x")
    lag = mv.StateSpace.from_arrays([[-fast]], [[fast]], [[-k]], 0, inputs=["x"], outputs=["F"])
    f, c, k = map(Fraction, (fast, c, k))
    m2, m1, m0 = c + f, k + c * f, 2 * k * f
    square = (m0 + f**2 * m2) / (2 * m0 * (m2 * m1 - m0))
    assert model.linearize().feedback(lag).h2_norm().value == pytest.approx(float(square) ** 0.5, rel=3e-15)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_norms_whose_terms_cancel_are_refused(seed):
    """Decays of 1, 2 and 3 1/s in states that are dependent to 1e-7: squares came out negative, as 0, or anything."""
    rng = np.random.default_rng(seed)
    left, right = (np.linalg.qr(rng.normal(size=(3, 3)))[0] for _ in range(2))
    sizes = np.geomspace(1.0, 1e-7, 3)
    turn, back = left @ np.diag(sizes) @ right, right.T @ np.diag(1.0 / sizes) @ left.T
    space = mv.StateSpace.from_arrays(turn @ np.diag([-1.0, -2.0, -3.0]) @ back, turn @ np.ones((3, 1)),
                                      np.ones((1, 3)) @ back, 0)  # fmt: skip
    for ask in (space.h2_norm, lambda: space.rms("y1", {"u1": 2.0})):
        with pytest.raises(mv.ResponseError, match="rounding cannot tell apart"):
            ask()


@pytest.mark.parametrize("seed", range(3))
def test_a_mode_beside_a_maxwell_element_that_rounding_alone_reaches_is_hidden(seed):
    """Two slides at right angles along skew axes, one undamped; norms were refused, and the rms was infinite."""
    model, turn = mv.Model("slides"), rotation(np.random.default_rng(seed))
    model.add_body("a", 2.0, (0.1, 0.2, 0.25))
    model.add_body("b", 1.0, (0.1, 0.2, 0.25))
    model.add_joint("ja", "prismatic", "ground", "a", position=(0, 0, 0), axis=turn[:, 0])
    model.add_joint("jb", "prismatic", "a", "b", position=(0, 0, 0), axis=turn[:, 1])
    model.add_spring("s", "a", "b", -turn[:, 1], 0 * turn[:, 1], stiffness=50.0)
    model.add_maxwell("mx", "ground", "a", -turn[:, 0], 0 * turn[:, 0], stiffness=1e3, damping=10.0,
                      static_stiffness=100.0)  # fmt: skip
    model.add_input("F", "a", turn[:, 0])
    model.add_output("x", "a", turn[:, 0])
    system, w = model.linearize(), np.linspace(3.0, 20.0, 200_001)
    peak = np.abs(1.0 / (100.0 - 3.0 * w**2 + 1j * w * 1e4 / (1e3 + 10j * w))).max()
    # m c s^3 + m k s^2 + c (k + k0) s + k k0 under c s + k: Routh's formula of third order, divided by m c
    a2, a1, a0, b1, b0 = 1e2, 1100.0 / 3.0, 1e4 / 3.0, 1.0 / 3.0, 1e2 / 3.0
    square = (b1**2 * a0 + b0**2 * a2) / (2.0 * a0 * (a2 * a1 - a0))
    assert system.hinf_norm().value == pytest.approx(peak, rel=1e-9)
    assert system.h2_norm().value == pytest.approx(np.sqrt(square), rel=1e-12)
    assert system.rms("x", {"F": 2.0})["x"] == pytest.approx(np.sqrt(square), rel=1e-12)
    loop = system.feedback([[-1.0]], sensors="x", actuators="F")
    assert 0.0 < loop.hinf_norm().value < peak


def free_masses(damping=1.0):
    """Two free bodies of 1 and 3 kg along a skew line, joined by 100 N/m, in absolute coordinates of two rails."""
    model = mv.Model("free")
    line = np.array([1.0, 0.3, -0.2]) / np.linalg.norm([1.0, 0.3, -0.2])
    for name, mass, x in (("a", 1.0, 0.0), ("b", 3.0, 1.0)):
        model.add_body(name, mass, (0.1, 0.1, 0.1), position=x * line)
        model.add_joint(f"rail_{name}", "prismatic", "ground", name, axis=line)
    model.add_spring("s", "a", "b", 0.0 * line, line, stiffness=100.0, damping=damping)
    model.add_input("pair", "b", line, relative_to="a")
    model.add_input("push", "a", line)
    model.add_output("gap", "b", line, relative_to="a")
    model.add_output("way", "a", line)
    model.add_output("felt", "a", line, quantity="acceleration")
    return model.linearize()


@pytest.mark.few(2)
@pytest.mark.parametrize("realization", [None, "physical", "modal", "balanced"])
def test_relative_force_and_displacement_of_free_masses(realization):
    """1 / (mu s^2 + c s + k), mu = 3/4 kg: the centre of mass is neither driven nor seen, also where no entry is 0."""
    system = free_masses()["gap", "pair"]
    linear = system if realization is None else system.state_space(realization)
    s = 1j * np.array([0.0, 1e-7, 3.0])
    expected = 1.0 / (0.75 * s**2 + s + 100.0)
    assert linear.frequency_response(s.imag)[0, 0] == pytest.approx(expected, rel=1e-12)
    assert linear.h2_norm().value == pytest.approx(1.0 / np.sqrt(200.0), rel=1e-12)
    assert linear.step_info().final[0, 0] == pytest.approx(0.01, rel=1e-12)
    zeta = 0.5 / np.sqrt(75.0)
    assert linear.hinf_norm().value == pytest.approx(0.005 / (zeta * np.sqrt(1.0 - zeta**2)), rel=1e-9)


def test_derivatives_of_norms_of_free_masses():
    system = free_masses()
    norm = system.h2_norm("gap", "pair", ["s.stiffness", "s.damping", "a.mass", "b.mass"])
    value = 1.0 / np.sqrt(200.0)
    assert norm.slopes == pytest.approx([-value / 200.0, -value / 2.0, 0.0, 0.0], rel=1e-10, abs=1e-14)
    peak = system.hinf_norm("gap", "pair", ["s.damping"])
    zeta = 0.5 / np.sqrt(75.0)  # the peak over c: 0.01 / (2 zeta sqrt(1 - zeta^2)), zeta in proportion to c
    assert peak.slopes[0] == pytest.approx(-peak.value * (1.0 - 2.0 * zeta**2) / (1.0 - zeta**2), rel=1e-8)


def test_what_depends_on_the_centre_of_mass_is_infinite():
    system = free_masses()
    for ports in (("way", "push"), ("way", "pair")):
        part = system[ports]
        if ports == ("way", "pair"):  # the centre is not driven, so that this one is finite: -(1/m_a) mu / k
            assert part.frequency_response([0.0])[0, 0, 0] == pytest.approx(-0.0075, rel=1e-12)
            continue
        for question in (part.h2_norm, part.hinf_norm, part.step_info, lambda p=part: p.frequency_response([0.0])):
            with pytest.raises(mv.ResponseError, match=r"infinite|no final value"):
                question()


def test_acceleration_of_free_masses_at_rest():
    """A force on free bodies accelerates their centre of mass: F / 4 kg at 0 Hz."""
    assert free_masses()["felt", "push"].frequency_response([0.0])[0, 0, 0] == pytest.approx(0.25, rel=1e-12)


@pytest.mark.parametrize("coupled", [False, True])
def test_velocities_of_free_masses_in_a_viscous_fluid(coupled):
    """Held by dampers alone, they move at the force over the sum of the dampers; the way that they go is infinite."""
    mass, k = np.diag([2.0, 1.0]), 100.0 * np.array([[1.0, -1.0], [-1.0, 1.0]])
    damping = np.diag([1.0, 3.0]) if coupled else 0.5 * mass
    seen, none = np.eye(2), np.zeros((2, 2))
    system = mv.System.from_matrices(
        mass, damping, k, np.eye(2), np.vstack((seen, none, [[1.0, -1.0]])), np.vstack((none, seen, np.zeros((1, 2)))),
        outputs=["x1", "x2", "v1", "v2", "apart"])  # fmt: skip
    speed = 1.0 / damping.sum()
    apart = np.array([1.0 - speed * damping[0, 0], -speed * damping[0, 0]]) / 100.0
    for form in (system, system.state_space("physical"), system.state_space("modal")):
        at_rest = form.frequency_response([0.0], ["v1", "v2", "apart"])[:, :, 0]
        np.testing.assert_allclose(at_rest, [[speed] * 2, [speed] * 2, apart], rtol=1e-12, atol=1e-16)
        near = form.frequency_response([1e-7], ["v1", "v2", "apart"])[:, :, 0]
        np.testing.assert_allclose(near, at_rest, rtol=1e-6)
        with pytest.raises(mv.ResponseError, match="is a pole of"):
            form.frequency_response([0.0], "x1")
    w = 1e3
    z = k + 1j * w * damping - w**2 * mass
    np.testing.assert_allclose(system.frequency_response([w], "x*")[:, :, 0], np.linalg.inv(z), rtol=1e-9)


@pytest.mark.parametrize(("pole", "words"), [
    (complex(9e-16, 68.7), "the pole 0+68.7j 1/s (10.93 Hz)"), (complex(-1e-17, 2.0), "the pole 0+2j 1/s (0.3183 Hz)"),
    (complex(1e-9, 2.0), "the pole 1e-09+2j 1/s (0.3183 Hz)"), (complex(145.0, 0.0), "the pole 145 1/s"),
    (complex(1e-300, 0.0), "the pole 1e-300 1/s"), (0j, "the pole 0 1/s"),
])  # fmt: skip
def test_messages_on_poles_have_no_rounding(pole, words):
    assert pole_words(pole) == words
