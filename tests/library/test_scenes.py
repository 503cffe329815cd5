"""Loaded, spinning and flexible scenes of the library against closed forms."""

import mpmath as mp
import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
from mbsvib.library import (
    cantilever,
    engine_on_mounts,
    four_bar,
    hinged_rod,
    pendulum_chain,
    rotor_stator,
    sleeping_top,
    slider_crank,
    trifilar_pendulum,
    wafer_stage,
)
from tests.spin.test_rotors import whirl_roots
from tests.support.lagrangian import projected

G = 9.81


def squares(model):
    return np.sort(np.square(2 * np.pi * model.linearize().modes().frequencies))


def test_hinged_rod():
    assert squares(hinged_rod()) == pytest.approx([14.678304239401497], rel=1e-13)
    model = hinged_rod(width=0.2, length=2.0, density=500.0, gravity=1.6)
    assert squares(model) == pytest.approx([1.6 / ((4 * 4.0 + 0.04) / 12)], rel=1e-13)
    system = model.linearize()
    # what the hinge carries while the rod swings: m (l/2) omega^2 per unit of angle, less what turns with the rod
    force = system.frequency_response([0.0])[:, 0, 0].real
    assert_allclose(force[1:] * system.K[0, 0], [0.0, 0.0], atol=1e-12)


@pytest.mark.few(1)
@pytest.mark.parametrize("n", [1, 3, 12])
def test_pendulum_chain(n):
    with mp.workdps(40):
        coefficients = [mp.mpf(-1) ** k * mp.binomial(n, k) / mp.factorial(k) for k in range(n + 1)]
        roots = mp.polyroots(coefficients, asc=True, maxsteps=500, extraprec=300)
    expected = G / 0.7 * np.sort([float(root.real) for root in roots])
    assert_allclose(squares(pendulum_chain(n, length=0.7)), expected, rtol=1e-12)
    system = pendulum_chain(n, length=0.7).linearize()
    static = system.frequency_response([0.0])[:, 0, 0].real
    # a force at the lowest mass pulls each string aside by F / (weight below)
    assert_allclose(static[0], sum(0.7 / (k * G) for k in range(1, n + 1)), rtol=1e-12)
    assert abs(static[1]) == pytest.approx(1.0, rel=1e-12)


def test_trifilar_pendulum():
    expected = [G / 1.5, G / 1.5, 6.0 * G * 0.16 / (0.7 * 1.5)]
    assert squares(trifilar_pendulum()) == pytest.approx(expected, rel=1e-12)


def test_slider_crank_has_the_curvature_of_its_potential():
    r, rod, angle, m1, m2, m3, k = 0.1, 0.3, 0.9, 1.0, 1.5, 2.0, 5e3
    system = slider_crank(angle=angle).linearize(independent=["A.rz"])
    with mp.workdps(40):
        slide = lambda q: r * mp.cos(q) + mp.sqrt(mp.mpf(rod) ** 2 - (r * mp.sin(q)) ** 2)  # noqa: E731
        lean = lambda q: mp.asin(r * mp.sin(q) / rod)  # noqa: E731
        height = lambda q: (m1 + m2) * r * mp.sin(q) / 2  # noqa: E731
        push = G * mp.diff(height, angle) / mp.diff(slide, angle)  # what the slider lacks along x
        potential = lambda q: (G * height(q) - push * slide(q)  # noqa: E731
                               + k * (slide(q) - slide(angle)) ** 2 / 2)  # fmt: skip
        stiffness = mp.diff(potential, angle, 2)
        x = lambda q: slide(q) - rod * mp.cos(lean(q)) / 2  # noqa: E731
        inertia = (m1 * mp.mpf(r) ** 2 / 3 + m2 * (mp.diff(x, angle) ** 2 + (r * mp.cos(angle) / 2) ** 2)
                   + m2 * mp.mpf(rod) ** 2 / 12 * mp.diff(lean, angle) ** 2 + m3 * mp.diff(slide, angle) ** 2)
    assert_allclose(system.M, [[float(inertia)]], rtol=1e-12)
    assert_allclose(system.K, [[float(stiffness)]], rtol=1e-10)
    assert len(system.redundant) == 3


def test_four_bar_has_the_curvature_of_its_potential():
    a, b, c, d = (np.array(point) for point in ((0, 0), (0.2, 0.25), (1.05, 0.65), (1.2, 0)))
    with mp.workdps(40):
        first, second, third = (mp.hypot(*map(mp.mpf, v)) for v in (b - a, c - b, d - c))
        start = mp.atan2(*map(mp.mpf, (b - a)[::-1].tolist()))

        def pins(q):
            at = mp.matrix([first * mp.cos(q), first * mp.sin(q)])
            gap = mp.matrix([mp.mpf(d[0]) - at[0], mp.mpf(d[1]) - at[1]])
            size = mp.hypot(*gap)
            along = (second**2 - third**2 + size**2) / (2 * size)
            up = mp.sqrt(second**2 - along**2)
            return at, at + mp.matrix([along * gap[0] - up * gap[1], along * gap[1] + up * gap[0]]) / size

        def height(q):
            at, end = pins(q)
            return 2 * G * (first * at[1] / 2 + second * (at[1] + end[1]) / 2 + third * end[1] / 2)

        def length(q):
            at, end = pins(q)
            return mp.hypot((at[0] + end[0]) / 2 - mp.mpf("0.4"), (at[1] + end[1]) / 2 - mp.mpf("1.1"))

        tension = -mp.diff(height, start) / mp.diff(length, start)
        rest = length(start)
        stiffness = mp.diff(lambda q: height(q) + tension * length(q) + 200 * (length(q) - rest) ** 2, start, 2)
    model = four_bar()
    assert model.springs["spring"].preload == pytest.approx(float(tension), rel=1e-11)
    system = model.linearize(independent=["A.rz"])
    assert_allclose(system.K, [[float(stiffness)]], rtol=1e-9)
    assert system.modes().stable
    assert len(system.redundant) == 3


@pytest.mark.parametrize("speed", [0.0, 10.0, -40.0])
def test_rotor_stator(speed):
    values = rotor_stator(speed).linearize().modes().eigenvalues
    assert values[:2].tolist() == [0.0, 0.0]
    for root in whirl_roots(speed):
        assert np.abs(values - root).min() <= 1e-12 * abs(root)


@pytest.mark.parametrize("speed", [200.0, 30.0, 1.0])
def test_sleeping_top(speed):
    across, moment, weight = 4e-4 + 0.5 * 0.04**2, 5e-4 * speed, 0.5 * G * 0.04
    modes = sleeping_top(speed).linearize().modes()
    assert np.count_nonzero(modes.eigenvalues == 0.0) == 2
    expected = np.roots([across, -1j * moment, -weight])
    for root in [*expected, *expected.conj()]:
        assert np.abs(modes.eigenvalues - root).min() <= 1e-12 * abs(root)
    assert modes.stable == (moment**2 > 4 * across * weight)


def test_cantilever():
    expected = [1.655433398, 1.655433398, 16.071161667, 16.071161667, 50.023996028, 50.023996028, 76.472717539,
                80.468757907, 103.204375129, 103.204375129]  # fmt: skip
    system = cantilever().linearize()
    assert_allclose(system.modes().frequencies[:10], expected, rtol=1e-9)
    static = system.frequency_response([0.0])[:, :, 0].real
    area = np.pi / 4 * (0.175**4 - 0.16**4)
    assert_allclose(static[0, 0], 10.0**3 / (3 * 2.1e11 * area), rtol=1e-9)
    assert_allclose(abs(static[2]), [0.0, 1.0], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("gravity", [None, G])
def test_engine_on_mounts(gravity):
    model = engine_on_mounts(gravity=gravity, loss=0.0)
    system = model.linearize()
    a, b, h, kz, kl, weight = 0.35, 0.25, 0.12, 2.5e5, 1.2e5, 180.0 * (gravity or 0.0)
    result = np.sort(squares(model))
    for expected in (4 * kz / 180.0, 4 * kl * (a * a + b * b) / 12.0):
        assert np.abs(result - expected).min() < 1e-12 * expected
    for arm, side, inertia in ((a, 1.0, 14.0), (b, -1.0, 6.0)):
        # sideways shift and pitch; the weight is carried below the centre of mass, as of an inverted pendulum
        stiffness = np.array([[4 * kl, -side * 4 * kl * h],
                              [-side * 4 * kl * h, 4 * (kl * h * h + kz * arm * arm) - weight * h]])  # fmt: skip
        for expected in np.linalg.eigvals(stiffness / [[180.0], [inertia]]):
            assert np.abs(result - expected).min() < 1e-12 * expected
    tangent, mass, residual = projected(model, system)
    assert_allclose(system.K, tangent, rtol=0, atol=1e-12 * np.abs(tangent).max())
    assert_allclose(system.M, mass, rtol=0, atol=1e-14 * np.abs(mass).max())
    assert np.abs(residual).max() < 1e-11
    forces = system.frequency_response([0.0])[2:, :, 0].real
    assert_allclose(forces[:, 1], 0.25, rtol=1e-12)
    if gravity is None:  # a torque is taken by the mounts' arms, along z
        assert_allclose(abs(forces[:, 0]), 0.25 / b, rtol=1e-12)


def test_wafer_stage_up_and_down():
    """By symmetry motions along z are a chain of three masses; the long stroke goes with the base."""
    system = wafer_stage().linearize()
    feet, soft, light = ((2 * np.pi * f) ** 2 * m for f, m in ((18.0, 3980.0), (1.0, 900.0), (0.5, 20.0)))
    mass = np.diag([3060.0, 900.0, 20.0])
    stiffness = np.array([[feet + soft + light, -soft, -light], [-soft, soft, 0.0], [-light, 0.0, light]])
    expected = np.sort(np.linalg.eigvals(np.linalg.solve(mass, stiffness)).real)
    assert system.dof == 21
    assert system.modes().rigid == 0
    omega = np.sqrt(expected) * 1.003
    table = dict(zip(system.outputs, range(len(system.outputs)), strict=True))
    response = system.frequency_response(omega)[table["z"], system.inputs.index("Fz")]
    c = lambda k, m, ratio: 4 * ratio * np.sqrt(k / 4 * m)  # noqa: E731
    dampers = c(feet, 3000.0, 0.05), c(soft, 900.0, 0.3), 0.02 * light / (2 * np.pi * 0.5)
    damping = np.diag([sum(dampers), *dampers[1:]])
    damping[0, 1:] = damping[1:, 0] = np.negative(dampers[1:])
    for w, value in zip(omega, response, strict=True):
        x = np.linalg.solve(stiffness + 1j * w * damping - w * w * mass, [-1.0, 0.0, 1.0])
        assert abs(value - (x[2] - x[1])) < 1e-10 * abs(value)


def test_refusals():
    with pytest.raises(mv.ModelError, match=r"slider_crank: rod = 0.1; expected more than the crank"):
        slider_crank(rod=0.1)
    with pytest.raises(mv.EquilibriumError):
        slider_crank(angle=0.0)
    with pytest.raises(mv.ModelError, match=r"four_bar: pins"):
        four_bar(pins=((0, 0), (1, 1), (2, 1)))
    with pytest.raises(mv.ModelError, match=r"hinged_rod: length = -1.0; expected a positive number \[m\]"):
        hinged_rod(length=-1.0)
