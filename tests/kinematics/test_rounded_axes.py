"""Springs across axes that do not round exactly: what they do there is zero, and no rounding of it."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
from tests.support.exact import Exact
from tests.support.random_models import rotation
from tests.support.redundant import COMMON, Pair

STIFFNESS = np.array([1e4, 2e4, 1e4, 30.0, 40.0, 50.0])
FREE = {"revolute": [5], "cylindrical": [2, 5], "spherical": [3, 4], "planar": [1]}


def chain(rng, kind, bodies=3):
    """Joints about random axes; at the first of them springs hold everything but some of what it leaves free."""
    model, before, at = mv.Model("chain"), "ground", rng.uniform(-1, 1, size=3)
    for k in range(bodies):
        turn = rotation(rng)
        center = at + turn @ (0.4, 0.2, 0.3)
        model.add_body(f"b{k}", 1.0 + k, (0.1, 0.2, 0.25), center, orientation=turn)
        model.add_joint(f"j{k}", kind, before, f"b{k}", at, orientation=turn)
        held = STIFFNESS.copy()
        if k == 0:
            held[FREE[kind]] = 0.0
        model.add_bushing(f"k{k}", before, f"b{k}", at, held, orientation=turn)
        before, at = f"b{k}", center + turn @ (0.5, 0.1, 0.2)
    return model


@pytest.mark.few(2)
@pytest.mark.parametrize("kind", FREE)
def test_what_no_spring_resists_is_exactly_free(kind):
    """As many rigid-body modes as directions without a spring, on both paths, and the others to all digits."""
    for seed in range(2):
        model, free = chain(np.random.default_rng(seed), kind), len(FREE[kind])
        dense = model.linearize(method="dense").modes()
        sparse = model.linearize(method="sparse").modes(len(dense.frequencies))
        expected = np.sqrt(np.sort(Exact(model).squares)[free:]) / (2 * np.pi)
        for modes in (dense, sparse):
            assert modes.rigid == free
            assert not modes.frequencies[:free].any()
            assert_allclose(modes.frequencies[free:], expected, rtol=1e-11)


@pytest.mark.parametrize("kinds", COMMON, ids=" and ".join)
def test_doors_swing_freely(kinds):
    """Springs across what two joints lock hold nothing of what both leave free, however stiff they are."""
    pair = Pair(kinds, np.random.default_rng(7), place=(1.0, 3.0))
    free = ~pair.rows.any(axis=0)
    model = pair.model.replace("k", stiffness=np.where(free, 0.0, 1e9), position=pair.origin)
    for method in ("dense", "sparse"):
        modes = model.linearize(method=method).modes(pair.dof) if pair.dof else None
        assert modes is None or modes.rigid == np.count_nonzero(free)
