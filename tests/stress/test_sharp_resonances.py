"""Frequency response at resonances with damping ratios down to 1e-8: an error of a frequency counts 1 / ratio there.

A resonance is known no better than eps / ratio however it is computed: that is what rounding the pole once does.
"""

import numpy as np
import pytest

from tests.stress.families import linkage, wide
from tests.support.exact import Exact
from tests.support.random_models import rebuilt
from tests.support.sizes import few
from tests.support.sliding_chain import chain_response, sliding_chain

EPS = np.finfo(float).eps
# Roundings of a pole that are allowed; those of one mode among 200.
POLE = 20.0


def chain(n, ratio, classical, seed):
    """Masses and stiffness over a decade each; the lowest damping ratio is ``ratio``."""
    rng = np.random.default_rng(seed)
    k, m = 10.0 ** (4 + rng.uniform(0, 1, n)), 10.0 ** rng.uniform(0, 1, n)
    c = k if classical else rng.uniform(0, 1, n) * np.sqrt(k * m)
    lowest = sliding_chain(m, k, 1e-6 * c).linearize().modes().damping_ratios.min()
    return m, k, c * 1e-6 * ratio / lowest


@pytest.mark.parametrize("n", few([20, 200], 1))
@pytest.mark.parametrize("classical", [True, False])
@pytest.mark.parametrize("ratio", [5e-5, 1e-6, 1e-8])
def test_at_the_peaks_of_a_chain(n, classical, ratio):
    data = chain(n, ratio, classical, seed=n)
    inputs, outputs = (0, n // 2), [("displacement", n - 1), ("velocity", n // 2), ("acceleration", 0)]
    system = sliding_chain(*data, inputs, outputs).linearize()
    modes = system.modes()
    low = np.argsort(modes.damping_ratios)[:4]
    peak = 2 * np.pi * modes.damped_frequencies[low]
    omega = np.concatenate((peak, peak * (1 + ratio), peak * (1 - 3 * ratio), peak * (1 + 30 * ratio)))
    expected = np.stack([chain_response(*data, 1j * w, inputs, outputs) for w in omega], axis=-1)
    error = np.abs(system.frequency_response(omega) - expected) / np.abs(expected).max(axis=1, keepdims=True)
    limit = 2e-12 + POLE * EPS / ratio
    assert error.max() <= limit
    if ratio == 5e-5:
        assert limit <= 1e-10


@pytest.mark.parametrize("ratio", [5e-5, 1e-8])
@pytest.mark.parametrize("family", ["tree", "four-bars"])
def test_at_the_peaks_of_mechanisms(ratio, family):
    """Stiffness over 12 decades as well, and dampers in no proportion to it."""
    share = (0.3 * ratio, ratio)
    model = wide(3, 5, branches=True, damping=share) if family == "tree" else linkage(3, 2, damping=share)
    model = rebuilt(model)
    last = list(model.bodies)[-1]
    model.add_input("f", last, (0.3, 0.5, 0.8, 0.1, 0.2, 0.3))
    model.add_output("x", last, (0.7, 0.1, -0.4, 0.3, 0.2, 0.9))
    system = model.linearize()
    modes = system.modes()
    omega = 2 * np.pi * modes.damped_frequencies
    lowest = modes.damping_ratios.min()
    assert lowest < 3 * ratio
    result, expected = system.frequency_response(omega), Exact(model).frequency_response(omega)
    assert np.abs(result / expected - 1).max() <= 2e-12 + POLE * EPS / lowest
