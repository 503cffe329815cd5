"""Connected parts of matrices: small ones in plain Python, large ones by scipy."""

import numpy as np
import pytest

from mbsvib.linalg import groups


@pytest.mark.parametrize("seed", range(6))
def test_small_and_large_matrices_have_the_same_parts(seed, monkeypatch):
    rng = np.random.default_rng(seed)
    shape = (int(rng.integers(1, 25)), int(rng.integers(1, 25)))
    row, column = np.nonzero(rng.random(shape) < 0.06)
    few = groups.connected_parts(row, column, shape)
    monkeypatch.setattr(groups, "FEW", 0)
    for ours, theirs in zip(few, groups.connected_parts(row, column, shape), strict=True):
        np.testing.assert_array_equal(ours, theirs)
