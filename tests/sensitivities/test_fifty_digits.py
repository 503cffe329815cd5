"""Sensitivities against differences of the independent reference in 50 digits: no rounding, and next to no step."""

import numpy as np
import pytest
from hypothesis import assume, given, settings

import mbsvib as mv
from tests.sensitivities.differences import step_of
from tests.support import fast_digits
from tests.support.digits import mp
from tests.support.exact import Exact
from tests.support.random_models import seeds, spatial

RTOL = 1e-9


def eigenvalues(model):
    """All eigenvalues of (lambda^2 M + lambda C + K), 50 digits."""
    exact = Exact(model)
    m = exact.dof
    mass = mp.matrix(exact.M)
    lower = [-fast_digits.solve(mass, mp.matrix(rows)) for rows in (exact.K, exact.C)]
    a = mp.zeros(2 * m)
    for i in range(m):
        a[i, m + i] = 1
        for j in range(m):
            a[m + i, j], a[m + i, m + j] = lower[0][i, j], lower[1][i, j]
    return fast_digits.eigenvalues(a)


def slopes(model, parameters, name, values):
    """Differences of four points, whose error is of the fourth order of a small step, for each of some eigenvalues."""
    h = 2.0 ** np.round(np.log2(step_of(parameters, name) / 16))
    given_at = [parameters[name] + k * h for k in (1, -1, 2, -2)]
    at = [eigenvalues(model.with_values({name: value})) for value in given_at]
    result = []
    for value in values:
        a, b, c, d = (min(item, key=lambda v: abs(v - mp.mpc(value))) for item in at)
        first, second = ((p - q) / (mp.mpf(x) - mp.mpf(y))
                    for p, q, x, y in ((a, b, *given_at[:2]), (c, d, *given_at[2:])))  # fmt: skip
        result.append(complex((4 * first - second) / 3))
    return np.array(result)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::mbsvib.errors.NearSingularWarning")
@settings(max_examples=5, deadline=None)
@given(seeds())
def test_eigenvalues_of_random_mechanisms(seed):
    model = spatial(seed, bodies=2, loops=seed % 2, ports=False)
    try:
        system = model.linearize()
    except mv.MbsvibError:
        assume(False)
    assume(0 < system.dof <= 4)
    retained = [group.retained for group in system.provenance.reduction.groups]
    assume(min(retained, default=1.0) > 0.05)
    values = system.modes().eigenvalues
    apart = np.abs(values[:, None] - values)[np.triu_indices(len(values), 1)]
    assume(apart.min() > 1e-2 * np.abs(values).max())
    result, names = system.eigenvalue_sensitivities(), list(system.parameters)
    for k in np.random.default_rng(seed).choice(len(names), size=2, replace=False):
        if ".orientation." not in names[k] and np.isfinite(result[k]).all():
            expected = slopes(model, system.parameters, names[k], values)
            noise = 1e-13 * np.abs(values).max() / max(1.0, abs(system.parameters[names[k]]))
            assert np.abs(result[k] - expected).max() <= RTOL * np.abs(expected).max() + noise, names[k]
