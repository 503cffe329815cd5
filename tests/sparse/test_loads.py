"""Loads on many bodies: closed forms of long chains, the dense path's answers, and what is refused."""

import numpy as np
import pytest
from scipy.special import jn_zeros, roots_laguerre

import mbsvib as mv
from mbsvib.library import engine_on_mounts, four_bar, pendulum_chain, stewart, trifilar_pendulum
from tests.hunt.generate import example
from tests.support.loaded_models import loaded
from tests.support.sizes import few

G = 9.81


@pytest.mark.few(1)
@pytest.mark.parametrize("n", [40, 3000])
def test_long_chains_have_the_roots_of_laguerre_polynomials(n):
    """x = j^2 / (4 v) (1 + (j^2 - 2) / (48 v^2)) + ... with v = n + 1/2 and j the zeros of J0: Tricomi's series."""
    system = pendulum_chain(n).linearize(method="sparse")
    modes = system.modes(4)
    nu, j = n + 0.5, jn_zeros(0, 4)
    expected = roots_laguerre(n)[0][:4] if n < 100 else j**2 / (4 * nu) * (1 + (j**2 - 2) / (48 * nu**2))
    np.testing.assert_allclose(modes.natural**2 / G, expected, rtol=1e-12)
    assert modes.errors.max() < 1e-13
    assert "rows of geometric stiffness" in system.explain()
    if n < 100:
        dense = pendulum_chain(n).linearize(method="dense").modes()
        np.testing.assert_allclose(modes.natural, dense.natural[:4], rtol=1e-13)


def test_large_loaded_models_are_held_sparse(monkeypatch):
    monkeypatch.setattr("mbsvib.sparse.choice.MANY", 100)
    assert type(pendulum_chain(150).linearize()).__name__ == "SparseSystem"
    model = pendulum_chain(150)
    model.add_load("wind", "m150", force=(0, 0, -1.0), follower=True)
    assert type(model.linearize()).__name__ == "SparseSystem"


def same(model):
    for k, body in enumerate(model.bodies):
        model.add_input(f"in{k}", body, (1.0, 0.5, 0.3, 0.2, 0.1, 0.7))
        model.add_output(f"out{k}", body, (0.3, 0.5, -1.0, 0.2, 0.7, 0.1))
    dense, sparse = (model.linearize(method=method) for method in ("dense", "sparse"))
    expected, result = (system.frequency_response([0.7, 20.0, 60.0]) for system in (dense, sparse))
    assert np.abs(result - expected).max() < 1e-10 * np.abs(expected).max()
    assert sparse.dof == dense.dof
    return dense, sparse


@pytest.mark.few(1)
@pytest.mark.filterwarnings("ignore::mbsvib.NearSingularWarning")
@pytest.mark.parametrize("seed", few(range(3), 1))
@pytest.mark.parametrize("words", [{"bodies": 4}, {"bodies": 5, "loops": 2}, {"bodies": 3, "floating": True}])
def test_same_answers_for_random_models(seed, words):
    same(loaded(seed, **words))


@pytest.mark.few(2)
@pytest.mark.parametrize("kind", [
    "universal", "homokinetic", "screw", "cylindrical", "planar", "distance", "point_on_line",
])  # fmt: skip
def test_same_answers_for_every_kind_of_joint(kind):
    same(loaded(2, bodies=3, kinds=(kind,)))


def loaded_stewart():
    model = stewart(ports="none")
    model.gravity = (0, 0, -G)
    return model.equilibrium(preload="leg*.k")


@pytest.mark.parametrize("make", [four_bar, trifilar_pendulum, loaded_stewart, lambda: engine_on_mounts(loss=0.0)])
def test_loops_and_redundant_constraints(make):
    model = make().with_parts(inputs={}, outputs={})
    dense, sparse = same(model)
    assert sparse.redundant == dense.redundant
    np.testing.assert_allclose(sparse.modes(sparse.dof).natural, dense.modes().natural, rtol=1e-12)


def test_springs_that_hold_a_chain_upright_or_not():
    """The lowest modes of an inverted chain diverge where its springs are too soft: counted, and not lost."""
    n, stiffness = 30, 4.0
    model = mv.Model("upright", gravity=(0, 0, -G))
    for k in range(n):
        model.add_body(f"m{k}", 0.1, (1e-3, 1e-3, 1e-3), position=(0, 0, 0.1 * (k + 1)))
        first = f"m{k - 1}" if k else "ground"
        model.add_joint(f"pin{k}", "revolute", first, f"m{k}", position=(0, 0, 0.1 * k), axis=(1, 0, 0))
        model.add_bushing(f"k{k}", first, f"m{k}", (0, 0, 0.1 * k), (0, 0, 0, stiffness, 0, 0))
    dense, sparse = (model.linearize(method=method).modes(6) for method in ("dense", "sparse"))
    assert not dense.stable
    np.testing.assert_allclose(sparse.eigenvalues, dense.eigenvalues, rtol=1e-9)


def test_parts_that_nothing_reaches_are_left_out_with_their_loads():
    model = pendulum_chain(4)
    model.add_body("lamp", 2.0, (1, 1, 1), position=(5, 0, -1))
    model.add_joint("hook", "spherical", "ground", "lamp", position=(5, 0, 0))
    model.add_load("shade", "lamp", force=(0, 0, -3.0))
    system = model.linearize(method="sparse").reachable()
    assert system.dof == 4
    expected = pendulum_chain(4).linearize().modes().natural
    np.testing.assert_allclose(system.modes(4).natural, expected, rtol=1e-13)


def test_what_lacks_balance_is_named():
    model = pendulum_chain(12).replace("m7", position=(0, 0.01, -7))
    with pytest.raises(mv.EquilibriumError, match=r"'m7', 0.0981 N m missing about z of joint 'pin7'") as caught:
        model.linearize(method="sparse")
    assert caught.value.missing == pytest.approx(0.0981, rel=1e-12)
    model = four_bar()
    model = model.with_parts(outputs={})
    model.linearize(method="sparse")
    model.add_load("push", "rocker", force=(0, 0, 1e-5))
    with pytest.raises(mv.EquilibriumError, match=r", .* N m missing about z of joint"):
        model.linearize(method="sparse")


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::mbsvib.UndeterminedForceWarning")
def test_two_couplers_on_one_coordinate_of_a_cut_joint():
    """Forces of least norm in the joints do not say how couplers share them: K of this scene was off by 1e-3."""
    model = example(236).scene.model()
    dense, sparse = (model.linearize(method=method) for method in ("dense", "sparse"))
    omega = np.array([1.0, 3.9, 20.0])
    expected, result = (system.frequency_response(omega) for system in (dense, sparse))
    rows = [k for k, name in enumerate(dense.outputs) if not name.startswith("force")]
    assert np.abs(result - expected)[rows].max() < 1e-11 * np.abs(expected[rows]).max()
