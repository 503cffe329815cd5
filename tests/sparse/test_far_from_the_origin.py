"""Loops far from the origin, where positions are rounded more than arms: the same redundant rows, dense and sparse."""

import numpy as np
import pytest

from tests.support.random_models import moved, planar


@pytest.mark.few(2)
@pytest.mark.parametrize("method", ["dense", "sparse"])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_redundant_rows_of_planar_loops(seed, method):
    model = planar(seed, bodies=3, loops=1)
    here = model.linearize(method=method)
    for far in (1e3, 1e6):
        there = moved(model, far * np.array((1.0, -0.7, 0.4))).linearize(method=method, cut=list(here.cut_joints))
        assert there.dof == here.dof
        assert len(there.redundant) == len(here.redundant) == 3
        near, away = (system.modes(here.dof).eigenvalues for system in (here, there))
        np.testing.assert_allclose(away, near, rtol=1e-14 * far + 1e-9, atol=1e-6)
