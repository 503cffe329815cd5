"""Stiffness over 12 and mass over 8 decades, with massless nodes in any place, against 60 digits."""

import mpmath
import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.massless.scenes import along_z

BODIES = 6


def exact(masses, springs):
    """Frequencies of the bodies with mass, from the flexibility that the springs give them."""
    names = ["ground", *masses]
    with mpmath.workdps(60):
        stiffness = mpmath.zeros(len(masses))
        for first, second, value, _ in springs.values():
            i, j, k = names.index(first) - 1, names.index(second) - 1, mpmath.mpf(value)
            stiffness[j, j] += k
            if i >= 0:
                stiffness[i, i] += k
                stiffness[i, j] -= k
                stiffness[j, i] -= k
        flexibility = stiffness**-1
        heavy = [i for i, mass in enumerate(masses.values()) if mass]
        root = [mpmath.sqrt(mpmath.mpf(list(masses.values())[i])) for i in heavy]
        square = mpmath.matrix(len(heavy))
        for a, i in enumerate(heavy):
            for b, j in enumerate(heavy):
                square[a, b] = root[a] * flexibility[i, j] * root[b]
        return np.sort([float(1 / mpmath.sqrt(value)) for value in mpmath.eigsy(square, eigvals_only=True)])


@pytest.mark.parametrize("relative", [False, True])
@pytest.mark.parametrize("seed", range(6))
def test_condensed_chains_keep_their_digits(seed, relative):
    rng = np.random.default_rng(seed)
    light = set(rng.choice(BODIES, 3, replace=False).tolist())
    masses = {f"b{i}": 0.0 if i in light else 10 ** rng.uniform(-4, 4) for i in range(BODIES)}
    names = ["ground", *masses]
    stiffness = 10 ** rng.uniform(-6, 6, size=BODIES + 1)
    springs = {f"k{i}": (names[i], names[i + 1], stiffness[i], 0) for i in range(BODIES)}
    if seed % 2:
        springs["last"] = ("ground", names[-1], stiffness[-1], 0)
    system = along_z(masses, springs, relative).linearize()
    assert len(system.provenance.separation.condensed) == 3
    assert_allclose(np.sort(system.modes(rtol=1e-12).natural), exact(masses, springs), rtol=1e-12)
