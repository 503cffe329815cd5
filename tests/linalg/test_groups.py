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


@pytest.mark.parametrize("strong", [False, True])
@pytest.mark.parametrize("share", [0.0, 0.08, 0.3, 1.0])
def test_items_of_one_part_reach_each_other(share, strong, monkeypatch):
    """Against all powers of the matrix at once."""
    monkeypatch.setattr(groups, "FEW", 0)
    links = np.random.default_rng(3).random((14, 14)) < share
    steps = links if strong else links | links.T
    reach = np.linalg.matrix_power((steps | np.eye(14, dtype=bool)).astype(float), 14) > 0.0
    part = groups.part_numbers(links, strong)
    np.testing.assert_array_equal(part[:, None] == part, reach & reach.T)
    assert set(part.tolist()) == set(range(part.max() + 1))
