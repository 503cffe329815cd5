"""Strong dampers make slow real eigenvalues of what is fast without them: none of these modes is missed."""

import numpy as np
import pytest

import mbsvib as mv


def chain(count, dampers, seed):
    """A chain of sliders on springs, some of them with a strong damper to the ground."""
    rng = np.random.default_rng(seed)
    model = mv.Model("chain")
    before = "ground"
    for i in range(count):
        model.add_body(f"b{i}", 1.0, (0.1, 0.1, 0.1), (0, 0, i + 1.0))
        model.add_joint(f"j{i}", "prismatic", before, f"b{i}", axis=(0, 0, 1))
        model.add_spring(f"k{i}", before, f"b{i}", (0, 0, i), (0, 0, i + 1.0), 1e3, 1.0)
        before = f"b{i}"
    for d in range(dampers):
        i = int(rng.integers(count // 2, count))
        model.add_spring(f"d{d}", "ground", f"b{i}", (1, 0, -1), (1, 0, i + 1.0), damping=10 ** rng.uniform(2, 5))
    return model


@pytest.mark.few(1)
@pytest.mark.parametrize(("dampers", "seed"), [(1, 0), (1, 3), (5, 1), (5, 5)])
def test_the_slowest_modes_are_those_of_dense_equations(dampers, seed):
    model = chain(60, dampers, seed)
    modes, dense = model.linearize(method="sparse").modes(4), model.linearize(method="dense").modes()
    np.testing.assert_allclose(modes.natural, dense.natural[:4], rtol=1e-13)
    np.testing.assert_allclose(modes.pairs, dense.pairs[:4], rtol=1e-10)
    assert modes.errors.max() < 1e-11
    assert modes.missed in (0, None)


@pytest.mark.slow
def test_damping_proportional_to_stiffness_needs_no_solves(monkeypatch):
    """Row by row the same multiple of K: the undamped modes are those of the damped chain."""
    def refuse(*_):
        raise AssertionError("solved")

    monkeypatch.setattr("mbsvib.sparse.modes._motion", refuse)
    model = mv.library.chain(400)
    sparse, dense = model.linearize(method="sparse").modes(6), model.linearize(method="dense").modes()
    assert sparse.classical == "damping proportional to stiffness"
    np.testing.assert_allclose(sparse.eigenvalues, dense.eigenvalues[:12], rtol=1e-12)
    uneven = model.with_values({"spring1.damping.*": 0.0})
    with pytest.raises(AssertionError, match="solved"):
        uneven.linearize(method="sparse").modes(6)
