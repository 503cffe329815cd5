"""Eigenvalues of mechanisms whose stiffness spans 12 and mass 8 decades, against 80 digits."""

import numpy as np
import pytest

from tests.stress.compare import assert_honest, damped_errors, modes_of, undamped_errors
from tests.stress.families import ladder, linkage, wide
from tests.support.sizes import few

UNDAMPED = {
    "chain": lambda seed: wide(seed),
    "tree": lambda seed: wide(seed, branches=True),
    "sliding chain": lambda seed: wide(seed, kinds=("prismatic",), far=4),
    "hinged chain": lambda seed: wide(seed, kinds=("revolute",), far=4),
    "floating chain": lambda seed: wide(seed, bodies=5, floating=True),
    "ladder": lambda seed: ladder(seed, 2),
    "spatial ladder": lambda seed: ladder(seed, 2, spatial=True),
    "four-bars": lambda seed: linkage(seed, 3),
    "spatial four-bars": lambda seed: linkage(seed, 3, spatial=True),
    "floating four-bars": lambda seed: linkage(seed, 2, floating=True),
}


def check_undamped(family, seeds):
    bounds = []
    for seed in seeds:
        model = UNDAMPED[family](seed)
        modes = modes_of(model)
        assert_honest(undamped_errors(model, modes), modes.errors[2 * modes.rigid :: 2])
        bounds.append(modes.errors[2 * modes.rigid :: 2])
    return np.concatenate(bounds)


@pytest.mark.few(1)
@pytest.mark.parametrize("family", UNDAMPED)
def test_undamped(family):
    """Twelve digits of every frequency, exact zeros of rigid-body modes, no false alarm, and no bound thrown away."""
    bounds = check_undamped(family, range(1))
    assert np.median(bounds) <= 1e-13


@pytest.mark.slow
@pytest.mark.parametrize("family", UNDAMPED)
def test_undamped_at_length(family):
    bounds = check_undamped(family, range(1, 30))
    assert np.median(bounds) <= 1e-13


FLOATING = ("revolute", "prismatic", "universal")
DAMPED = {
    "chain": lambda seed, span: wide(seed, 6, damping=span),
    "tree": lambda seed, span: wide(seed, 6, branches=True, damping=span),
    "floating tree": lambda seed, span: wide(seed, 4, FLOATING, True, floating=True, damping=span),
    "four-bars": lambda seed, span: linkage(seed, 3, damping=span),
    "spatial four-bars": lambda seed, span: linkage(seed, 2, spatial=True, damping=span),
}
SHARES = {"light": (0.0, 1e-2), "critical": (0.0, 10.0), "any": (1e-6, 1e6), "strong": (1.0, 1e6)}  # of critical


def check_damped(family, shares, seeds):
    bounds = []
    for seed in seeds:
        model = DAMPED[family](seed, SHARES[shares])
        modes = modes_of(model)
        errors, promised = damped_errors(model, modes)
        assert_honest(errors, promised)
        bounds.append(promised)
    return np.concatenate(bounds)


@pytest.mark.few(1)
@pytest.mark.parametrize("shares", few(["any", "critical"], 1))
@pytest.mark.parametrize("family", DAMPED)
def test_damped(family, shares):
    """Dampers that are anything between nothing and a million times critical, in no proportion to the stiffness."""
    assert np.median(check_damped(family, shares, range(1))) <= 1e-13


@pytest.mark.slow
@pytest.mark.parametrize("shares", SHARES)
@pytest.mark.parametrize("family", DAMPED)
def test_damped_at_length(family, shares):
    assert np.median(check_damped(family, shares, range(14))) <= 1e-13
