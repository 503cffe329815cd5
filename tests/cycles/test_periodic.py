"""Linear periodic equations about cycles: closed forms, Mathieu's equation, and the equations of small motion."""

from functools import cache

import mpmath as mp
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp
from scipy.special import mathieu_a, mathieu_b

import mbsvib as mv
from mbsvib import library
from tests.support.sizes import few

TURN = 2 * np.pi


@cache
def driven(n=96, speed=TURN, **words):
    return library.hoeken(**words).cycle("crank.rz", TURN * np.arange(n) / n, speed=speed)


def crank_inertia(q):
    """J(q) of Hoeken's linkage with a = 0.1 m and 2 kg/m, from the closed-form positions of its pins."""
    a = lambda q: (mp.cos(q) / 10, mp.sin(q) / 10)  # noqa: E731

    def b(q):
        x, y = a(q)
        gap = mp.hypot(mp.mpf("0.2") - x, -y)
        across = mp.sqrt(mp.mpf("0.0625") - gap**2 / 4)
        return (mp.mpf("0.2") + x) / 2 + across * y / gap, y / 2 + across * (mp.mpf("0.2") - x) / gap

    rest = lambda q: (mp.mpf(0), mp.mpf(0))  # noqa: E731
    total = mp.mpf(0)
    for start, end, length in ((rest, a, 0.1), (a, b, 0.25), (rest, b, 0.25)):
        (xs, ys), (xe, ye) = ([mp.diff(lambda t, c=c, f=f: f(t)[c], q) for c in (0, 1)] for f in (start, end))
        total += 2 * mp.mpf(str(length)) * (xs**2 + ys**2 + xe**2 + ye**2 + xs * xe + ys * ye) / 3
    return total


@pytest.mark.slow
def test_coefficients_of_a_linkage():
    """tau = J q'' + J' q'^2 / 2, so that M = J, C = J' q', K = J'' q'^2 / 2 at constant speed."""
    found = driven(12).periodic()
    for i in (0, 3, 7):
        with mp.workdps(30):
            j, slope, curve = (mp.diff(crank_inertia, TURN * i / 12, order) for order in range(3))
        assert_allclose(found.M[i], [[float(j)]], rtol=1e-10)
        assert_allclose(found.C[i], [[float(slope) * TURN]], rtol=1e-7, atol=1e-10)
        assert_allclose(found.K[i], [[float(curve) * TURN**2 / 2]], rtol=1e-6, atol=1e-8)


@pytest.mark.slow
def test_at_rest_they_are_those_of_small_motion():
    """Speed zero: the system that linearize makes of every pose, with springs and gravity."""
    model = library.four_bar()
    angles = np.array([0.0, 0.1, -0.2])
    found = model.cycle("A.rz", angles, speed=0.0).periodic({"A.rz": (3.0, 0.2)}, period=1.0)
    system = model.linearize(independent=["A.rz"])
    assert_allclose(found.M[0], system.M, rtol=1e-11)
    assert_allclose(found.C[0] - 0.2, system.C, rtol=1e-11)
    assert_allclose(found.K[0] - 3.0, system.K, rtol=1e-9)
    there = model.moved({"A.rz": angles[1]}).with_parts(springs={}, gravity=None)
    assert_allclose(found.M[1], there.linearize(independent=["A.rz"]).M, rtol=1e-10)
    plain = model.cycle("A.rz", [0.0], speed=0.0).periodic(period=1.0)
    values = system.modes().eigenvalues
    assert_allclose(np.sort_complex(plain.frozen[0]), np.sort_complex(values), rtol=1e-8)
    assert_allclose(plain.averaged, plain.frozen[0], rtol=1e-14)


def geared_pendulums(samples, turns):
    """Two eccentric wheels, of which the second makes half the turns of the first, which is driven."""
    model = mv.Model("geared", gravity=(0, 0, -9.81))
    for i, name in enumerate(("fast", "slow")):
        model.add_body(name, 2.0 + i, (0.1, 0.1, 0.1), (i + 0.1, 0, 0.1 * i))
        model.add_joint(f"{name}.pivot", "revolute", "ground", name, (i, 0, 0), axis=(0, 1, 0))
    model.add_gear("gear", "fast.pivot", "slow.pivot", 0.5)
    angles = turns * TURN * np.arange(samples) / samples
    return model.cycle("fast.pivot.rz", angles, speed=10.0)


@pytest.mark.slow
def test_a_turn_of_a_geared_shaft_is_no_period():
    with pytest.raises(mv.ModelError, match=r"'geared' do not repeat after 0.628319 s; .* over several turns"):
        geared_pendulums(32, 1).periodic()
    with pytest.raises(mv.ModelError, match=r"do not repeat after 1.88496 s"):
        geared_pendulums(32, 3).periodic(period=0.3 * TURN)


@pytest.mark.slow
def test_coefficients_that_are_rounding_are_resolved():
    """Nothing damps, so that C is rounding; the inertia is constant: x'' + (a cos 2t + b cos t) x = 0."""
    found = geared_pendulums(24, 2).periodic(period=0.2 * TURN)
    assert found.unresolved < 1e-12
    inertia = 0.12 + 0.25 * (0.1 + 3.0 * 0.02)
    assert_allclose(found.M, np.full((24, 1, 1), inertia), rtol=1e-12)
    slope = lambda t: -9.81 * (-0.2 * np.sin(10 * t) + 0.3 * 0.25 * (np.cos(5 * t) - np.sin(5 * t)))  # noqa: E731
    assert_allclose(found.K[:, 0, 0], slope(found.time), rtol=1e-9, atol=1e-9)
    columns = solve_ivp(lambda t, x: (x[1], -slope(t) / inertia * x[0], x[3], -slope(t) / inertia * x[2]),
                        (0.0, 0.2 * TURN), (1, 0, 0, 1), method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]  # fmt: skip
    expected = np.linalg.eigvals(columns.reshape(2, 2))
    assert_allclose(np.sort_complex(found.multipliers()), np.sort_complex(expected), rtol=1e-8)


def shaken_pendulum(a, q, damping=0.0, n=48):
    """x'' + (a - 2 q cos 2t) x = 0 of a pendulum of 1 m on a pivot that goes up and down by z, g + z'' = -(...)."""
    model = mv.Model("shaken", gravity=(0, 0, -9.81))
    model.add_body("pivot", 0.5, (1, 1, 1))
    model.add_body("bob", 1.0, (0, 0, 0), (0, 0, -1.0))
    model.add_joint("slide", "prismatic", "ground", "pivot", axis=(0, 0, 1))
    model.add_joint("pin", "revolute", "pivot", "bob", (0, 0, 0), axis=(0, 1, 0))
    t = np.pi * np.arange(n) / n
    z = (0.5 * q * np.cos(2 * t), -q * np.sin(2 * t), -2 * q * np.cos(2 * t))
    cycle = model.cycle(motion={"slide.z": z, "pin.rz": (0.0, 0.0, 0.0)})
    return cycle.periodic({"pin.rz": (a - 9.81, damping)}, period=np.pi)


@pytest.mark.slow
@pytest.mark.parametrize("q", [0.5, 3.0])
@pytest.mark.parametrize("branch", [(mathieu_a, 0, 1), (mathieu_b, 1, -1), (mathieu_a, 1, -1), (mathieu_b, 2, 1)])
def test_borders_of_mathieus_equation(branch, q):
    """On a characteristic curve both multipliers are 1, or -1; beside it the pair is real, or on the unit circle."""
    curve, order, sign = branch
    a = float(curve(order, q))
    on = shaken_pendulum(a, q)
    assert_allclose(on.M, 1.0, rtol=1e-13)
    assert_allclose(on.multipliers(), [sign, sign], atol=2e-4)  # a double eigenvalue, to the root of rounding
    assert_allclose(on.multipliers().sum(), 2 * sign, atol=1e-8)
    below, above = (shaken_pendulum(a + step, q) for step in (-0.01, 0.01))
    assert below.stable is not above.stable
    assert above.stable is (curve is mathieu_a)


@pytest.mark.slow
def test_damping_shrinks_the_product_of_multipliers():
    """Liouville: the product of all is exp(-integral of trace C / M)."""
    found = shaken_pendulum(1.2, 0.8, damping=0.3)
    assert_allclose(np.prod(found.multipliers()), np.exp(-0.3 * np.pi), rtol=1e-9)
    machine = driven().periodic({"crank.rz": (5.0, 0.02)})
    trace = (machine.C[:, 0, 0] / machine.M[:, 0, 0]).mean()
    assert_allclose(np.prod(machine.multipliers()).real, np.exp(-trace * machine.period), rtol=1e-6)


def inertia(q):
    """J(q) of Hoeken's linkage, analytic in q, for steps along the imaginary axis."""
    step = 1e-30

    def pins(q):
        a = np.array([0.1 * np.cos(q), 0.1 * np.sin(q)])
        gap = np.sqrt((0.2 - a[0]) ** 2 + a[1] ** 2)
        across = np.sqrt(0.0625 - gap**2 / 4) / gap
        return a, np.array([(0.2 + a[0]) / 2 + across * a[1], a[1] / 2 + across * (0.2 - a[0])])

    a, b = (np.array(pin) / step for pin in np.imag(pins(q + 1j * step)))
    rest = np.zeros(2)
    return sum(2 * length * (s @ s + e @ e + s @ e) / 3 for s, e, length in (
        (rest, a, 0.1), (a, b, 0.25), (rest, b, 0.25)))  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("stiffness", few([2.0, 0.0], 1))
def test_multipliers_against_the_nonlinear_motion(stiffness):
    """J q'' + J' q'^2 / 2 = tau(t) - k (q - W t), integrated over a turn from neighbouring starts."""
    slope = lambda q: (inertia(q + 1e-5) - inertia(q - 1e-5)) / 2e-5  # noqa: E731

    def rate(t, x):
        wanted = 0.5 * slope(TURN * t) * TURN**2 - stiffness * (x[0] - TURN * t)
        return [x[1], (wanted - 0.5 * slope(x[0]) * x[1] ** 2) / inertia(x[0])]

    ends = []
    for start in ((1e-5, 0.0), (-1e-5, 0.0), (0.0, 1e-5), (0.0, -1e-5)):
        end = solve_ivp(rate, (0, 1), np.array([0.0, TURN]) + start, method="DOP853", rtol=1e-12, atol=1e-13)
        ends.append(end.y[:, -1])
    over = np.array([ends[0] - ends[1], ends[2] - ends[3]]).T / 2e-5
    found = driven().periodic({"crank.rz": (stiffness, 0.0)}).multipliers()
    assert_allclose(np.poly(found).real, np.poly(over), rtol=1e-4, atol=1e-4)


@pytest.mark.slow
def test_stiff_drives_are_those_of_frozen_equations():
    """A shaft that is fast against the turn: its multipliers wind as the frozen frequency does on average."""
    found = driven().periodic({"crank.rz": (300.0, 0.0)})
    frozen = np.abs(found.frozen[:, 0])
    turns = np.angle(found.multipliers()[0]) % TURN
    wound = (frozen.mean() * found.period) % TURN
    assert min(abs(turns - wound), abs(TURN - turns - wound)) < 0.02
    assert found.stable


@pytest.mark.slow
def test_two_released_drives_of_an_arm():
    """At rest in one pose: coefficients are those of the arm with the drives' stiffness."""
    arm = library.two_link()
    cycle = arm.cycle(motion={"joint1.rz": ([0.0, 0.0], 0, 0), "joint2.rz": ([0.0, 0.0], 0, 0)})
    found = cycle.periodic({"joint2.rz": (3.0, 0.0), "joint1.rz": (5.0, 0.0)}, period=0.1)
    assert found.coordinates == ("joint2.rz", "joint1.rz")
    mass = arm.linearize().M[::-1, ::-1]
    assert_allclose(found.M[0], mass, rtol=1e-12)
    values = np.linalg.eigvals(np.linalg.solve(mass, np.diag([3.0, 5.0])))
    assert_allclose(np.sort(np.abs(found.averaged))[::2], np.sqrt(np.sort(values)), rtol=1e-10)
    assert_allclose(np.abs(found.multipliers()), 1.0, rtol=1e-9)
    damped = cycle.periodic({"joint2.rz": (3.0, 0.4), "joint1.rz": (5.0, 0.1)}, period=0.1)
    companion = np.block([[np.zeros((2, 2)), np.eye(2)],
                          [-np.linalg.solve(mass, np.diag(part)) for part in ([3.0, 5.0], [0.4, 0.1])]])  # fmt: skip
    values = np.linalg.eigvals(companion)
    for eigenvalues in (damped.frozen[0], damped.frozen[1], damped.averaged):
        assert_allclose(np.sort_complex(eigenvalues), np.sort_complex(values), rtol=1e-9)
        assert_allclose(np.abs(eigenvalues), np.sort(np.abs(values)), rtol=1e-9)
    assert_allclose(np.abs(damped.multipliers()), np.sort(np.exp(0.1 * values.real))[::-1], rtol=1e-9)


def wheel():
    model = mv.Model("wheel", gravity=(0, 0, -9.81))
    model.add_body("wheel", 2.0, (0.1, 0.1, 0.1), (0.1, 0, 0))
    model.add_joint("pivot", "revolute", "ground", "wheel", (0, 0, 0), axis=(0, 1, 0))
    return model


@pytest.mark.parametrize("speed", [5.0, -5.0])
def test_the_period_is_that_of_a_turn(speed):
    angles = 0.3 + np.sign(speed) * TURN * np.arange(8) / 8
    found = wheel().cycle("pivot.rz", angles, speed=speed).periodic()
    assert found.period == pytest.approx(TURN / 5.0, rel=1e-15)
    assert_allclose(found.K[:, 0, 0], 2.0 * 9.81 * 0.1 * np.sin(angles), atol=1e-12)


@pytest.mark.parametrize(("motion", "said"), [
    (([0.0], 0.0, 0.0), "period = None; expected the period"),
    (([0.0, 3.0], [1.0, 2.0], 0.0), "period = None; expected the period"),
    ((TURN * np.arange(8) / 8, -1.0, 0.0), "not evenly spread over one turn"),
    ((TURN * np.arange(8) / 9, 1.0, 0.0), "not evenly spread over one turn"),
])  # fmt: skip
def test_motions_without_a_period_of_their_own(motion, said):
    with pytest.raises(mv.ModelError, match=said):
        wheel().cycle(motion={"pivot.rz": motion}).periodic()
    arm = library.two_link().cycle(motion={"joint1.rz": motion, "joint2.rz": motion})
    with pytest.raises(mv.ModelError, match="period = None; expected the period"):
        arm.periodic()


@pytest.mark.slow
def test_mistakes_are_named():
    cycle = driven(12)
    for released, said in (({"rocker.rz": (0, 0)}, "released 'rocker.rz' is none of its drives"), ({}, "at least one"),
                           ({"crank.rz": 3.0}, "stiffness and damping"), ("crank.rz", "released")):  # fmt: skip
        with pytest.raises(mv.ModelError, match=said):
            cycle.periodic(released)
    with pytest.raises(mv.ModelError, match="period = -1"):
        cycle.periodic(period=-1.0)
    uneven = library.hoeken().cycle("crank.rz", [0.0, 1.0, 2.0], speed=1.0)
    with pytest.raises(mv.ModelError, match="not evenly spread over one turn"):
        uneven.periodic()
    with pytest.raises(mv.ModelError, match="period = None; expected the period"):
        library.hoeken().cycle("crank.rz", [0.0], speed=0.0).periodic()
    with pytest.warns(mv.errors.AccuracyWarning, match="12 samples leave"):
        cycle.periodic({"crank.rz": (5.0, 0.0)}).multipliers()


@pytest.mark.slow
@pytest.mark.parametrize("speed", [150.0, 230.0, 300.0])
def test_an_unsymmetric_shaft_in_unsymmetric_bearings(speed):
    """A disk on a shaft of two stiffnesses that turn with it, in a bearing of two stiffnesses at rest: the multipliers
    of its four equations in the world, integrated by themselves; unstable between its critical speeds.
    """
    m, mb, c, stiff, bearing = 3.0, 1.0, 20.0, np.diag([2e5, 5e5]), np.diag([3e5, 8e5])
    model = mv.Model("rotor")
    for name, mass in (("brg", mb), ("shaft", 0.0), ("disk", m)):
        model.add_body(name, mass, (1e-3 * mass,) * 3)
    model.add_joint("b", None, "ground", "brg", (0, 0, 0), free=("x", "y"))
    model.add_joint("spin", "revolute", "brg", "shaft", (0, 0, 0), axis=(0, 0, 1))
    model.add_joint("d", None, "shaft", "disk", (0, 0, 0), free=("x", "y"))
    model.add_bushing("bearing", "ground", "brg", (0, 0, 0), (3e5, 8e5, 0, 0, 0, 0), (c, c, 0, 0, 0, 0))
    model.add_bushing("bending", "shaft", "disk", (0, 0, 0), (2e5, 5e5, 0, 0, 0, 0))
    released, period = ("b.x", "b.y", "d.x", "d.y"), TURN / speed
    motion = {"spin.rz": (TURN * np.arange(16) / 16, speed, 0.0)} | dict.fromkeys(released, (0, 0, 0))
    cycle = model.cycle(motion=motion)

    def slope(t, x):
        at, rates = np.split(x.reshape(8, 8), 2)
        turned = np.array([[np.cos(speed * t), -np.sin(speed * t)], [np.sin(speed * t), np.cos(speed * t)]])
        force = turned @ stiff @ turned.T @ (at[2:] - at[:2])
        return np.concatenate((rates, (force - bearing @ at[:2] - c * rates[:2]) / mb, -force / m)).ravel()

    end = solve_ivp(slope, (0.0, period), np.eye(8).ravel(), method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    expected = np.linalg.eigvals(end.reshape(8, 8))
    found = cycle.periodic(released, period=period)
    assert_allclose(np.sort_complex(found.multipliers()), np.sort_complex(expected), atol=1e-9)
    assert found.stable == (speed == 150.0)
