"""Quarter car, inclined chain, quadruped, and the list of models."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
from mbsvib.library import build, inclined_chain, models, quadruped, quarter_car
from tests.support.compare import assert_same_matrices
from tests.support.exact import Exact


def test_quarter_car_frequencies():
    omega = 2 * np.pi * quarter_car().linearize().modes().frequencies
    assert_allclose(omega, [7.87863, 68.70862], atol=0.5e-5)
    # roots of m1 m2 s^2 - (m1 (k1 + k2) + m2 k1) s + k1 k2 = 0, s = omega^2
    squares = np.sort(np.roots([317.5 * 45.4, -(317.5 * (22e3 + 192e3) + 45.4 * 22e3), 22e3 * 192e3]))
    assert_allclose(omega, np.sqrt(squares), rtol=1e-13)


def test_quarter_car_on_the_road():
    """Transmissibility of a two-mass isolator, body and wheel, road acceleration to acceleration."""
    m1, m2, k1, c1, k2, c2 = 317.5, 45.4, 22e3, 1500.0, 192e3, 30.0
    system = quarter_car(suspension_damping=c1, tyre_damping=c2).linearize()
    omega = np.geomspace(0.1, 1e3, 60)
    s = 1j * omega
    strut, tyre = k1 + c1 * s, k2 + c2 * s
    both = (m1 * s**2 + strut) * (m2 * s**2 + strut + tyre) - strut**2
    response = dict(zip(system.outputs, system.frequency_response(omega)[:, 0], strict=True))
    # an absolute acceleration is a relative one plus that of the road: the sum has the digits of its terms
    assert_allclose(response["body.az"], strut * tyre / both, rtol=1e-12, atol=1e-14)
    assert_allclose(response["wheel.az"], (m1 * s**2 + strut) * tyre / both, rtol=1e-12, atol=1e-14)
    # travel for a unit acceleration of the road: difference of the two, integrated twice
    assert_allclose(response["travel"], -m1 * tyre / both, rtol=1e-11)


def test_quarter_car_actuator_and_load():
    system = quarter_car().linearize()
    static = system.frequency_response([0.0])[:, :, 0].real
    get = lambda output, source: static[system.outputs.index(output), system.inputs.index(source)]  # noqa: E731
    assert_allclose(get("travel", "actuator"), 1 / 22e3, rtol=1e-13)
    assert_allclose(get("wheel.z", "actuator"), 0, atol=1e-18)
    assert_allclose(get("body.z", "load"), 1 / 22e3 + 1 / 192e3, rtol=1e-13)
    # a force that lifts the body pulls at the tyre
    assert_allclose(get("tyre.force", "load"), 1, rtol=1e-13)


@pytest.mark.parametrize("n", [1, 2, 8])
def test_inclined_chain(n):
    i = np.arange(1, n + 1)
    expected = 1 / np.pi * np.sqrt(1e5 / 10) * np.sin(i * np.pi / (2 * (n + 1)))
    assert_allclose(inclined_chain(n).linearize().modes().frequencies, expected, rtol=1e-13)


def test_inclined_chain_of_the_guide():
    model = inclined_chain()
    assert_allclose(model.linearize().modes().frequencies[[0, -1]], [5.52739317, 31.34740438], rtol=0, atol=0.5e-8)
    assert (len(model.bodies), len(model.springs)) == (8, 9)
    rise = np.subtract(model.bodies["mass8"].position, model.bodies["mass1"].position)
    assert_allclose(rise, 7 * np.array([0.8, 0.6, 0]), rtol=1e-14)
    # force on the first of eight masses between walls: springs 1 and 8 in parallel
    assert_allclose(model.linearize().frequency_response([0.0])[0, 0, 0].real, 8 / 9 / 1e5, rtol=1e-12)


def test_quadruped_counts():
    system = quadruped().linearize()
    assert (system.dof, len(system.bodies), system.cut_joints) == (18, 13, ())
    modes = system.modes()
    assert np.all((modes.damping_ratios > 0) & (modes.damping_ratios < 1))
    # the range of the chapter's figure 10
    assert_allclose(modes.frequencies[[0, -1]], [247, 5452], rtol=0.003)
    assert_allclose(modes.damping_ratios[[0, -1]], [0.023, 0.514], atol=0.001)
    # left and right, front and rear are alike
    static = system.frequency_response([0.0])[:, :, 0].real
    assert_allclose(static[[2, 2, 2, 0, 0, 1, 1], [0, 1, 3, 1, 3, 0, 5]], 0, atol=1e-18)


@pytest.mark.slow
def test_quadruped_against_fifty_digits():
    model = quadruped()
    exact = Exact(model)
    values = model.linearize().modes().eigenvalues
    assert exact.dof == 18
    assert_allclose(np.sort(abs(values)), np.sort(abs(exact.eigenvalues)), rtol=1e-12)
    assert_allclose(np.sort(values.real), np.sort(exact.eigenvalues.real), rtol=1e-12)


DRIVEN = {"hoeken", "carpet_scraper", "two_link", "gripper", "six_link", "puma", "stanford"}


@pytest.mark.slow
def test_every_model_builds_and_vibrates():
    for name, (function, line) in models().items():
        model = build(name)
        assert repr(model) == repr(function())
        assert line
        assert "\n" not in line
        system = model.linearize()
        assert system.inputs
        assert system.outputs
        modes = system.modes()
        if name in DRIVEN:  # nothing holds their drives: they move freely
            assert modes.rigid == system.dof
        else:
            assert modes.frequencies[modes.rigid] > 0


@pytest.mark.few(10)
@pytest.mark.parametrize("name", models())
def test_descriptions_tell_the_truth(name):
    assert models()[name][1].endswith(f", {build(name).linearize().dof} DOF")


def test_unknown_models():
    with pytest.raises(mv.ModelError, match="Did you mean 'stewart'"):
        build("stuart")
    with pytest.raises(mv.ModelError, match="C50RF1"):
        build("C0RF1")
    with pytest.raises(mv.ModelError, match="Known: chain, tree"):
        build("")


@pytest.mark.slow
def test_quadruped_with_worms_of_their_own():
    """The rotors' inertia counts by the square of the reduction, which a motor of 40 turns a turn makes large."""
    plain, driven = quadruped(), quadruped(worm_ratio=1 / 40)
    assert len(driven.bodies) == 21
    system, gears = driven.linearize(), [f"{corner}.gear{i}" for corner in ("fl", "fr", "rl", "rr") for i in (1, 2)]
    assert system.dof == 18
    assert not system.redundant
    assert_same_matrices(system, Exact(driven), 1e-11)
    pinned = driven.linearize(independent=[f"{gear}.rz" for gear in gears])
    before = plain.linearize()
    k = before.coordinates.index("fl.gear1.rz")
    rotor = 0.5 * 0.08 * 0.012**2
    other = 0.08 * (0.12**2 + 0.06**2) + 0.08 * (3 * 0.012**2 + 0.04**2) / 12  # the next worm, carried along
    i = pinned.coordinates.index("fl.gear1.rz")
    assert_allclose(pinned.M[i, i] - before.M[k, k], 1600 * rotor + other, rtol=1e-10)
