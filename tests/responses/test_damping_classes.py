"""Each class of damping against first-order equations by hand: poles, responses, moving starts, state space, norms."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import solve_continuous_lyapunov

from tests.support.compare import nearest_pairs
from tests.support.damping_classes import CLASSES, UNDAMPED_OR_FREE, by_hand, frequency_response, model, time_response

OMEGA = np.array([0.4, 5.0, 13.0, 29.0, 37.3, 400.0])
EVEN = 0.2 + np.linspace(0.0, 1.5, 31)
UNEVEN = 0.2 + np.cumsum([0.0, 0.01, 0.2, 0.003, 0.11, 0.11, 0.4, 0.07])


@pytest.fixture(scope="module", params=CLASSES)
def case(request):
    """The parameters of a class and its system."""
    p = CLASSES[request.param]
    return request.param, p, model(p).linearize()


def moving(p, system):
    """q and q' of a system in motion, and the states by hand."""
    rng = np.random.default_rng(3)
    q, rate = 0.1 * rng.normal(size=system.dof), rng.normal(size=system.dof)
    if "mx.stiffness" not in p:
        return (q, rate), (q, rate)
    return (q, rate), (q[:3], rate[:3], [p["mx.stiffness"] * (q[2] - q[0] + q[3])])


def test_poles(case):
    name, p, system = case
    modes = system.modes()
    result, expected = nearest_pairs(modes.eigenvalues, np.linalg.eigvals(by_hand(p)[0]))
    # LAPACK leaves 1e-8 of a double eigenvalue
    zero = np.abs(expected) < 1e-6
    assert not result[zero].any()
    rtol = 1e-6 if name in ("critical", "defective") else 1e-8
    assert_allclose(result[~zero], expected[~zero], rtol=rtol, atol=0)
    if name not in UNDAMPED_OR_FREE:  # omega^2 and 2 zeta omega are product and sum of a pair
        size = np.sqrt(np.abs(modes.pairs).prod(axis=1))
        assert_allclose(modes.frequencies, size / (2 * np.pi), rtol=1e-12)
        assert_allclose(modes.damping_ratios, -modes.pairs.sum(axis=1).real / (2 * size), rtol=1e-9)
        assert_allclose(modes.damped_frequencies, np.abs(modes.pairs[:, 0].imag) / (2 * np.pi), rtol=1e-12)
    assert modes.stable == (name != "unstable")


def test_mode_shapes(case):
    """(l^2 M + l C + K) phi = 0; shapes of bodies are those of the coordinates; rigid ones strain nothing."""
    name, _, system = case
    modes = system.modes()
    values, shapes = np.atleast_2d(modes.pairs), modes.shapes
    m, c, k = system.M, system.C, system.K
    for i, pair in enumerate(values):
        phi = shapes[:, i]
        assert np.abs(phi).max() > 0.0
        if name == "defective" or ((pair.imag == 0).all() and pair[0] != pair[1]):
            continue
        terms = [pair[0] ** 2 * m @ phi, pair[0] * c @ phi, k @ phi]
        assert np.abs(sum(terms)).max() <= 1e-8 * max(np.abs(k).max(), 1.0) * np.abs(phi).max()
    size = [np.abs(system.displacements(shapes[:, 0].real)[body]).max() for body in modes.body_shapes]
    result = [np.abs(shape[:, 0].real).max() for shape in modes.body_shapes.values()]
    assert_allclose(result, size, rtol=1e-12, atol=1e-15)
    left = np.linalg.matrix_rank(shapes[:, : modes.rigid].real, tol=1e-9) if modes.rigid else 0
    assert left == modes.rigid
    assert not np.abs(k @ shapes[:, : modes.rigid]).max(initial=0.0) > 1e-9 * np.abs(k).max()


@pytest.mark.few(2)
def test_zeros(case):
    """With the poles they make each response but for a factor."""
    _, p, system = case
    w = np.array([0.4, 13.0, 37.3])
    expected, poles, s = frequency_response(p, w), np.linalg.eigvals(by_hand(p)[0]), 1j * w[:, None]
    for o, output in enumerate(system.outputs):
        for i, source in enumerate(system.inputs):
            if np.abs(expected[o, i]).min() > 1e-9 * np.abs(expected[:, i]).max():
                zeros = system.transmission_zeros(output, source)
                ratio = np.exp(np.log(s - zeros).sum(axis=1) - np.log(s - poles).sum(axis=1)) / expected[o, i]
                assert_allclose(ratio / ratio[0], 1.0, rtol=1e-7)


def test_frequency_responses(case):
    _, p, system = case
    expected = frequency_response(p, OMEGA)
    assert_allclose(system.frequency_response(OMEGA), expected, rtol=1e-9, atol=1e-14)
    assert_allclose(system.frequency_response(-OMEGA), expected.conj(), rtol=1e-9, atol=1e-14)


@pytest.mark.few(18)
@pytest.mark.parametrize("realization", ["physical", "modal", "balanced"])
def test_state_space(case, realization):
    _, p, system = case
    ss = system.state_space(realization)
    assert len(ss.A) == len(by_hand(p)[0])
    result = [ss.C @ np.linalg.solve(1j * w * np.eye(len(ss.A)) - ss.A, ss.B) + ss.D for w in OMEGA]
    assert_allclose(np.stack(result, axis=-1), frequency_response(p, OMEGA), rtol=1e-8, atol=1e-13)


@pytest.mark.few(18)
@pytest.mark.parametrize("hold", ["first", "zero"])
@pytest.mark.parametrize("t", [EVEN, UNEVEN], ids=["even", "uneven"])
def test_moving_starts(case, hold, t):
    _, p, system = case
    u = np.random.default_rng(1).normal(size=(2, len(t)))
    initial, states = moving(p, system)
    expected = time_response(p, t, u, hold, states)
    result = system.time_response(t, u, hold=hold, initial=initial)
    assert_allclose(result, expected, rtol=0, atol=1e-9 * np.abs(expected).max(axis=1).min())
    for k in range(2):  # positions and velocities count, each by itself
        only = [part * (i == k) for i, part in enumerate(initial)]
        state = [np.array(part) * (i == k) for i, part in enumerate(states[:2])]
        if len(states) > 2:
            state.append(p["mx.stiffness"] * (only[0][2] - only[0][0] + only[0][3:]))
        expected = time_response(p, t, 0 * u, hold, state)
        result = system.time_response(t, 0 * u, hold=hold, initial=only)
        assert_allclose(result, expected, rtol=0, atol=1e-9 * np.abs(expected).max(axis=1).min())


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in CLASSES if name not in UNDAMPED_OR_FREE])
def test_norms(name):
    """H2 by the Lyapunov equation; H-infinity against a fine scan about the peak."""
    p = CLASSES[name]
    system = model(p).linearize()
    a, b, c, _ = by_hand(p)
    gramian = solve_continuous_lyapunov(a, -b @ b.T)
    for k, output in enumerate(("displacement", "velocity")):
        result = system.h2_norm(outputs=output).value
        assert result == pytest.approx(np.sqrt(c[k] @ gramian @ c[k]), rel=1e-8)
        peak = system.hinf_norm(outputs=output)
        scan = np.geomspace(0.01, 1e3, 4001)
        scan = np.concatenate((scan, peak.omega * (1 + 1e-4 * np.arange(-3, 4))))
        size = np.linalg.norm(frequency_response(p, scan)[k], axis=0)
        assert peak.value == pytest.approx(size.max(), rel=1e-6)
        assert peak.value >= size.max() * (1 - 1e-11)  # rounding of the scan, at a Q of 300
