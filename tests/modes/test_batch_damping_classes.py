"""Batches of each class of damping: every variant against first-order equations written by hand."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.support.compare import nearest_pairs
from tests.support.damping_classes import CLASSES, by_hand, frequency_response, model, time_response

OMEGA = np.array([5.0, 13.0, 61.0])
T = np.array([0.0, 0.03, 0.1, 0.2, 0.25, 0.7])
# four variants of which none is the pose as given; the third one leaves the class where dampers come in
SHARES = np.array([0.9, 1.2, 1.05, 0.7])
NAMES = [name for name in CLASSES if not name.startswith("relaxation")]  # those have other states by hand


def varied(name):
    """The model, all its parameters in each variant, and what varies."""
    p = CLASSES[name]
    known = model(p).linearize().parameters
    values = {key: p[key] * SHARES ** (1 + k % 3) for k, key in enumerate(p)
              if key in known and p[key] and ".inertia." not in key}
    for key in p:
        if key in known and key.endswith((".damping", "damping.rx")) and not p[key]:
            values[key] = np.array([0.0, 0.0, 2.0, 0.0])
    return model(p), [p | {key: float(array[i]) for key, array in values.items()} for i in range(4)], values


@pytest.mark.few(2)
@pytest.mark.parametrize("omega", [OMEGA, np.linspace(1.0, 80.0, 60)], ids=["few", "many"])
@pytest.mark.parametrize("name", NAMES)
def test_every_variant(name, omega):
    built, variants, values = varied(name)
    batch = built.linearize(values=values)
    modes, responses = batch.modes(), batch.frequency_response(omega)
    rng = np.random.default_rng(1)
    u, initial = rng.normal(size=(2, len(T))), rng.normal(size=(2, batch.dof))
    moved = batch.time_response(T, u, "first", initial)
    spaces = batch.state_space("modal")
    for i, p in enumerate(variants):
        result, expected = nearest_pairs(modes.eigenvalues[i], np.linalg.eigvals(by_hand(p)[0]))
        assert_allclose(result, expected, rtol=1e-6, atol=1e-6)
        assert_allclose(modes.frequencies[i], built.with_values(
            {key: array[i] for key, array in values.items()}).linearize().modes().frequencies, rtol=1e-9)  # fmt: skip
        exact = frequency_response(p, omega)
        assert_allclose(responses[i], exact, rtol=1e-8, atol=1e-12)
        expected = time_response(p, T, u, "first", initial)
        assert_allclose(moved[i], expected, rtol=0, atol=1e-9 * np.abs(expected).max(axis=1).min())
        ss = spaces[i]
        result = [ss.C @ np.linalg.solve(1j * w * np.eye(len(ss.A)) - ss.A, ss.B) + ss.D for w in omega]
        assert_allclose(np.stack(result, axis=-1), exact, rtol=1e-7, atol=1e-12)
