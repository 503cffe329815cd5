"""Everything moved 1e4 m off the origin: positions then have 12 digits behind the metre, and answers must have 9."""

import numpy as np
import pytest

from tests.stress.compare import modes_of
from tests.stress.families import ladder, linkage, wide
from tests.support.random_models import moved

SHIFT = 1e4 * np.array([0.6, -0.64, 0.48])
FAMILIES = {
    "chain": lambda seed: wide(seed, stiffness_span=4, mass_span=2, damping=(0.0, 1e-1)),
    "tree": lambda seed: wide(seed, branches=True, stiffness_span=4, mass_span=2, damping=(0.0, 1e-1)),
    "floating": lambda seed: wide(seed, 5, floating=True, stiffness_span=4, mass_span=2, damping=(0.0, 1e-1)),
    "ladder": lambda seed: ladder(seed, 2, stiffness_span=4, mass_span=2),
    "spatial ladder": lambda seed: ladder(seed, 2, spatial=True, stiffness_span=4, mass_span=2),
    "four-bars": lambda seed: linkage(seed, 3, stiffness_span=4, mass_span=2, damping=(0.0, 1e-1)),
    "spatial four-bars": lambda seed: linkage(seed, 3, spatial=True, stiffness_span=4, mass_span=2),
    "wide chain": lambda seed: wide(seed),
    "wide four-bars": lambda seed: linkage(seed, 3),
}


@pytest.mark.few(9)
@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("seed", range(4))
def test_eigenvalues_far_from_the_origin(family, seed):
    model = FAMILIES[family](seed)
    near, far = modes_of(model, accurate=False), modes_of(moved(model, SHIFT), accurate=False)
    assert near.rigid == far.rigid
    order = np.lexsort((near.eigenvalues.real, near.eigenvalues.imag))
    other = np.lexsort((far.eigenvalues.real, far.eigenvalues.imag))
    a, b = near.eigenvalues[order], far.eigenvalues[other]
    assert ((a == 0) == (b == 0)).all()
    flexible = a != 0
    assert (np.abs(b - a)[flexible] / np.abs(a)[flexible]).max() <= 1e-9
