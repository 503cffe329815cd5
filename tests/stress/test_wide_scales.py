"""Eigenvalues of mechanisms whose stiffness spans 12 and mass 8 decades, against 80 digits."""

import numpy as np
import pytest

from tests.stress.compare import assert_honest, modes_of, undamped_errors
from tests.stress.families import ladder, linkage, wide

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


@pytest.mark.parametrize("family", UNDAMPED)
def test_undamped(family):
    """Twelve digits of every frequency, exact zeros of rigid-body modes, no false alarm, and no bound thrown away."""
    bounds = check_undamped(family, range(3))
    assert np.median(bounds) <= 1e-14


@pytest.mark.slow
@pytest.mark.parametrize("family", UNDAMPED)
def test_undamped_at_length(family):
    bounds = check_undamped(family, range(3, 30))
    assert np.median(bounds) <= 1e-14
