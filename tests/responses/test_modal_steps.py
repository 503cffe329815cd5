"""Closed forms of one step of one mode, against mpmath: any step, any damping, rigid, critical and diverging modes."""

import mpmath
import numpy as np
import pytest
from numpy.testing import assert_allclose

from mbsvib.responses.modal_steps import Exponentials, Oscillators, phi

mp = mpmath.MPContext()
mp.dps = 150
STEPS = 10.0 ** np.linspace(-8, 4, 25)


def differences(square, total, h):
    """C, S, I, J and S' in 150 digits; a double root is split far below what a double shows."""
    p, tau, h = mp.mpf(square), mp.mpf(total), mp.mpf(h)
    root = mp.sqrt(tau * tau / 4 - p) or mp.mpf("1e-30")
    a, b = (-tau / 2 + root) * h, (-tau / 2 - root) * h
    first = lambda x: mp.expm1(x) / x if x else mp.mpf(1)  # noqa: E731
    second = lambda x: (mp.expm1(x) - x) / x**2 if x else mp.mpf(1) / 2  # noqa: E731
    s, i, j = (h**n * (f(a) - f(b)) / (a - b) for n, f in ((1, mp.exp), (2, first), (3, second)))
    c = (a * mp.exp(b) - b * mp.exp(a)) / (a - b)
    rate = (a * mp.exp(a) - b * mp.exp(b)) / (a - b)
    return [float(mp.re(v)) for v in (c, s, i, j, rate)], float(mp.exp(max(mp.re(a), mp.re(b))))


@pytest.mark.few(3)
@pytest.mark.parametrize("omega", [1e-3, 1.0, 30.0, 1e4])
@pytest.mark.parametrize("ratio", [0.0, 1e-8, 1e-3, 0.5, 1 - 1e-6, 1 - 1e-12, 1.0, 1 + 1e-12, 1 + 1e-6, 1.02, 4.0, 1e6])
def test_stable_modes(omega, ratio):
    square, total = omega**2, 2 * ratio * omega
    # the phase omega h is rounded, and the exponent of what has all but decayed
    steps = STEPS[omega * STEPS * (1 if ratio < 1e-2 else ratio) < 1e3]
    mode = Oscillators(np.array([square]), np.array([total]))
    carry, held, ramp = (a[..., 0, :] for a in mode.step(steps))
    for k, h in enumerate(steps):
        (c, s, i, j, rate), envelope = differences(square, total, h)
        limit = 4e-15 * max(1.0, omega * h)
        reach = min(h, 1 / omega) * envelope
        assert_allclose(carry[0, 0, k], c, rtol=limit, atol=limit * envelope)
        assert_allclose(carry[1, 1, k], rate, rtol=limit, atol=limit * envelope)
        assert_allclose(carry[0, 1, k], s, rtol=limit, atol=limit * reach)
        assert_allclose(carry[1, 0, k], -square * s, rtol=limit, atol=limit * square * reach)
        assert_allclose(held[0, k], i, rtol=limit, atol=limit * envelope / square * (omega * h > 1))
        assert_allclose(ramp[0, k] * h, j, rtol=limit)
        assert_allclose((held[1, k], ramp[1, k] * h), (s, i), rtol=limit, atol=limit * reach * max(1.0, h))


@pytest.mark.parametrize("total", [0.0, 1e-9, 0.3, 50.0])
def test_rigid_modes_free_and_braked(total):
    mode = Oscillators(np.zeros(1), np.array([total]))
    carry, held, ramp = (a[..., 0, :] for a in mode.step(STEPS))
    for k, h in enumerate(STEPS):
        (c, s, i, j, rate), _ = differences(0.0, total, h)
        assert carry[0, 0, k] == c == 1.0
        assert_allclose((carry[0, 1, k], held[0, k], ramp[0, k] * h), (s, i, j), rtol=4e-15)
        assert_allclose(carry[1, 1, k], rate, rtol=1e-14 * max(1.0, total * h), atol=1e-300)
        assert carry[1, 0, k] == 0.0


@pytest.mark.parametrize("total", [0.0, 0.01, 1.0, 40.0, -1.0])
def test_diverging_modes(total):
    steps = STEPS[STEPS < 10]
    mode = Oscillators(np.array([-4.0]), np.array([total]))
    carry, held, ramp = (a[..., 0, :] for a in mode.step(steps))
    for k, h in enumerate(steps):
        (c, s, i, j, rate), _ = differences(-4.0, total, h)
        result = (carry[0, 0, k], carry[0, 1, k], held[0, k], ramp[0, k] * h)
        assert_allclose(result, (c, s, i, j), rtol=4e-14)
        assert_allclose(carry[1, 1, k], rate, rtol=4e-14, atol=1e-14)


def test_exponentials():
    values = np.array([-1e-3 + 1j, -5.0 + 0.1j, -1e5, 0.0, 0.2 - 3j])
    steps = STEPS[STEPS < 100]
    carry, held, ramp = Exponentials(values).step(steps)
    for i, value in enumerate(values):
        for k, h in enumerate(steps):
            x = mp.mpmathify(complex(value)) * mp.mpf(h)
            first = mp.expm1(x) / x if x else mp.mpf(1)
            second = (first - 1) / x if x else mp.mpf(1) / 2
            expected = mp.exp(x), h * first, h * second
            for result, exact in zip((carry[0, 0, i, k], held[0, i, k], ramp[0, i, k]), expected, strict=True):
                assert abs(result - complex(exact)) <= 4e-15 * max(1.0, abs(x)) * abs(complex(exact)) + 1e-300


def test_phi_is_smooth_where_its_two_forms_meet():
    x = np.array([1 - 1e-9, 1 + 1e-9, -1 + 1e-9, -1 - 1e-9, 1j, 1.0000001j, 0.0])
    first, second = phi(x)
    exact = [(mp.expm1(v) / v, (mp.expm1(v) - v) / v**2) for v in map(mp.mpmathify, x[:-1].tolist())]
    exact.append((mp.mpf(1), mp.mpf(1) / 2))
    assert_allclose(first, [complex(v[0]) for v in exact], rtol=5e-16)
    assert_allclose(second, [complex(v[1]) for v in exact], rtol=2e-15)
