"""Modes of sparse equations without symmetry: eigenvalues, shapes and responses of the dense ones."""

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

import mbsvib as mv
from mbsvib.sparse import spectrum
from tests.sparse.scenes import follower_chain, shaft
from tests.support.loaded_models import loaded
from tests.support.random_models import spatial

SHAFTS = [{}, {"damping": 1e-3}, {"damping": 1e-4, "rotating": 1e-6}, {"damping": 1e-2, "rotating": 1e-5},
          {"free": True}, {"free": True, "rotating": 1e-6}]  # fmt: skip
CHAINS = [{"force": 300.0}, {"force": 3e4}, {"force": 300.0, "free": True}, {"force": 3e3, "free": True},
          {"force": 300.0, "free": True, "drag": False}]  # fmt: skip


def same_modes(dense, result, k, near, rtol=1e-12):
    """Eigenvalue by eigenvalue, as far as both say that they can be trusted; how many are rigid; shapes of bodies."""
    expected = dense.nearest(k, near)
    assert (len(result), result.rigid) == (k, expected.rigid)
    apart = np.abs(result.eigenvalues[:, None] - expected.eigenvalues)
    i, j = linear_sum_assignment(apart)
    size = np.abs(expected.eigenvalues[j])
    allowed = np.minimum(rtol, result.errors[i] + expected.errors[j])
    np.testing.assert_array_less(apart[i, j], np.maximum(allowed * size, 1e-300))
    np.testing.assert_allclose(result.frequencies, expected.frequencies, rtol=rtol)
    np.testing.assert_array_equal(result.growing, expected.growing)
    assert result.errors.max() < rtol
    pair = np.flatnonzero(result.eigenvalues.imag > 0.0)
    np.testing.assert_array_equal(result.errors[pair], result.errors[pair + 1])
    np.testing.assert_array_equal(result.eigenvalues[pair], result.eigenvalues[pair + 1].conj())


@pytest.mark.slow
@pytest.mark.parametrize(("words", "near"), [*((words, 0.0) for words in SHAFTS), *((words, 100.0) for words in SHAFTS),
                                             (SHAFTS[0], 1e6), (SHAFTS[1], 1000.0), (SHAFTS[5], 1000.0)])  # fmt: skip
def test_disks_that_spin(words, near):
    model = shaft(12, **words)
    same_modes(model.linearize(method="dense").modes(rtol=1.0), model.linearize(method="sparse").modes(4, near=near),
               4, near)  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("near", [0.0, 10.0, 100.0])
@pytest.mark.parametrize("words", CHAINS, ids=str)
def test_chains_under_follower_loads(words, near):
    """Held and free, before flutter and beyond it; where a load that stays fixed pushes against one that turns."""
    model = follower_chain(20, **words)
    dense = model.linearize(method="dense").modes(rtol=1.0)
    assert (words["force"] > 1e4 or words.get("drag") is False) == (not dense.stable)
    same_modes(dense, model.linearize(method="sparse").modes(5, near=near), 5, near)


@pytest.mark.slow
@pytest.mark.parametrize("full", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_random_mechanisms(seed, full, monkeypatch):
    """Wheels, follower forces and torques in trees and loops, taken whole and by a search."""
    if not full:
        monkeypatch.setattr(spectrum, "DENSE_DOF", 0)
        monkeypatch.setattr(spectrum, "DENSE_RATIO", 0)
    wheels = spatial(seed, bodies=4, loops=seed % 2, kinds=("spherical", "universal"), ports=False)
    rng = np.random.default_rng(seed)
    for k, body in enumerate(list(wheels.bodies)):
        wheels.add_rotor(f"wheel{k}", body, rng.uniform(50, 300), rng.normal(size=3), inertia=rng.uniform(0.01, 0.1))
    for model in (wheels, loaded(7 + seed, bodies=4, loops=seed % 2, follower=True, torque=True)):
        dense, sparse = (model.linearize(method=method) for method in ("dense", "sparse"))
        every = dense.modes(rtol=1.0)
        for k, near in ((dense.dof, 0.0), (3, 0.0), (2, 1.02 * every.frequencies[2])):
            same_modes(every, sparse.modes(k, near=near), k, near, rtol=1e-11)


@pytest.mark.slow
def test_overdamped_modes_around_a_frequency():
    """Two real eigenvalues far below and far above the frequency of which they are the geometric mean."""
    model = shaft(12, damping=1e-4)
    model.add_body("pan", 2.0, (0.1, 0.1, 0.1), (1, 0, 0))
    model.add_joint("rail", "prismatic", "ground", "pan", (1, 0, 0), axis=(1, 0, 0))
    model.add_bushing("dashpot", "ground", "pan", (1, 0, 0), (2.0 * 600.0**2, 0, 0, 0, 0, 0), (2e4, 0, 0, 0, 0, 0))
    result = model.linearize(method="sparse").modes(3, near=600.0 / (2.0 * np.pi))
    half, root = 5e3, np.sqrt(5e3**2 - 600.0**2)
    expected = np.array([-(600.0**2) / (half + root), -half - root])
    pair = result.pairs[np.abs(result.natural - 600.0).argmin()]
    np.testing.assert_allclose(np.sort(pair.real)[::-1], expected, rtol=1e-12)
    same_modes(model.linearize(method="dense").modes(rtol=1.0), result, 3, 600.0 / (2.0 * np.pi))


def test_equal_parts_have_equal_eigenvalues():
    """Nine wheels on springs of their own: every eigenvalue nine times, and forward and backward precession apart."""
    model, inertia, stiffness, spin = mv.Model("wheels"), 0.02, 50.0, 3.0
    for k in range(9):
        model.add_body(f"w{k}", 1.0, (inertia, inertia, 0.03), (k, 0, 0))
        model.add_joint(f"j{k}", "universal", "ground", f"w{k}", (k, 0, 0), axis=(1, 0, 0),
                        axis2=(0, 1, 0))  # fmt: skip
        model.add_bushing(f"b{k}", "ground", f"w{k}", (k, 0, 0), (0, 0, 0, stiffness, stiffness, 0))
        model.add_rotor(f"r{k}", f"w{k}", spin / 0.03, (0, 0, 1), inertia=0.03)
    system = model.linearize(method="sparse")
    slow, fast = np.sort(np.abs(np.roots([inertia, -spin, -stiffness])))
    for patch in (False, True):
        with pytest.MonkeyPatch.context() as patched:
            if patch:
                patched.setattr(spectrum, "DENSE_DOF", 0)
                patched.setattr(spectrum, "DENSE_RATIO", 0)
            np.testing.assert_allclose(system.modes(9).natural, slow, rtol=1e-12)
            np.testing.assert_allclose(system.modes(9, near=1.1 * fast / (2.0 * np.pi)).natural, fast, rtol=1e-12)


@pytest.mark.slow
def test_a_long_shaft():
    """Forty disks: forward and backward bending of a spinning shaft, by all modes of the dense equations."""
    model = shaft(40)
    same_modes(model.linearize(method="dense").modes(rtol=1.0), model.linearize(method="sparse").modes(8), 8, 0.0)


@pytest.mark.slow
def test_long_chain_of_wheels():
    """Wheels in a row on equal springs between them: eigenvalues by those of the row, in closed form."""
    count, inertia, momentum, stiffness = 500, 0.02, 3.0, 50.0
    model, last = mv.Model("row"), "ground"
    for k in range(count):
        model.add_body(f"w{k}", 1.0, (inertia, inertia, 0.03), (0, 0, k))
        model.add_joint(f"j{k}", "universal", "ground", f"w{k}", (0, 0, k), axis=(1, 0, 0),
                        axis2=(0, 1, 0))  # fmt: skip
        model.add_bushing(f"b{k}", last, f"w{k}", (0, 0, k), (0, 0, 0, stiffness, stiffness, 0))
        model.add_rotor(f"r{k}", f"w{k}", momentum / 0.03, (0, 0, 1), inertia=0.03)
        last = f"w{k}"
    system = model.linearize()
    assert not isinstance(system, mv.System)
    row = 4.0 * np.sin(np.pi * (2 * np.arange(count) + 1) / (4 * count + 2)) ** 2 * stiffness
    root = np.sqrt(momentum**2 + 4.0 * inertia * row)
    every = np.sort(np.concatenate((2.0 * row / (momentum + root), (momentum + root) / (2.0 * inertia))))
    np.testing.assert_allclose(system.modes(6).natural, every[:6], rtol=1e-11)
    near = 1.0001 * every[count // 3]
    expected = np.sort(every[np.argsort(np.abs(every - near))[:4]])
    np.testing.assert_allclose(system.modes(4, near=near / (2.0 * np.pi)).natural, expected, rtol=1e-11)


@pytest.mark.slow
def test_what_modes_give_further():
    """Shapes of bodies, tables, reduced systems with their responses in frequency and time, states."""
    model = shaft(12, damping=1e-3, rotating=1e-6)
    dense, sparse = model.linearize(method="dense"), model.linearize(method="sparse")
    result, expected = sparse.modes(6), dense.modes(rtol=1.0).nearest(6)
    a, b = (np.concatenate([modes.body_shapes[name] for name in sorted(modes.bodies)]) for modes in (result, expected))
    share = np.abs(np.einsum("ij,ij->j", a.conj(), b)) / np.linalg.norm(a, axis=0) / np.linalg.norm(b, axis=0)
    np.testing.assert_allclose(share, 1.0, rtol=0, atol=1e-10)
    assert "6 of 72 DOF" in str(result)
    assert result.missed is None
    omega = np.linspace(0.1, 1.2, 30) * result.natural[2]
    small = sparse.reduced(30)
    assert small.gyroscopic is not None
    assert small.circulatory is not None
    assert sparse.truncation_error(small, omega).max() < 1e-2
    t = np.linspace(0.0, 0.02, 50)
    u = np.sin(3e2 * t)
    every = dense.time_response(t, u)
    assert np.abs(sparse.time_response(t, u, modes=sparse.dof) - every).max() < 1e-9 * np.abs(every).max()
    values = np.linalg.eigvals(sparse.state_space(modes=6).A)
    assert np.abs(values[:, None] - result.eigenvalues).min(axis=0).max() < 1e-8 * np.abs(result.eigenvalues).max()


@pytest.mark.slow
def test_static_correction_beside_follower_loads():
    sparse = follower_chain(20, 300.0).linearize(method="sparse")
    omega = np.linspace(0.0, 0.5, 10) * sparse.modes(1).natural[0]
    plain, corrected = (sparse.truncation_error(sparse.reduced(4, correction=c), omega).max() for c in (False, True))
    assert corrected < 0.1 * plain
    free = follower_chain(20, 300.0, free=True).linearize(method="sparse")
    with pytest.raises(mv.ResponseError, match=r"stiffness of .* is singular"):
        free.reduced(8, correction=True)


@pytest.mark.few(2)
@pytest.mark.parametrize("near", [0.0, 0.5, 2.0, 5.0])
def test_some_dampers_along_a_chain_around_a_frequency(near):
    """Light damping of a few joints, which couples the modes: those nearest to a frequency [Hz]."""
    model = mv.Model("chain")
    for i in range(80):
        below = f"b{i - 1}" if i else "ground"
        model.add_body(f"b{i}", 1.0 + 0.1 * (i % 3), (1, 1, 1), (0, 0, i))
        model.add_joint(f"j{i}", "prismatic", below, f"b{i}", axis=(0, 0, 1))
        model.add_bushing(f"k{i}", below, f"b{i}", (0, 0, i), (0, 0, 1e3 * (1 + i % 2), 0, 0, 0),
                          (0, 0, 0.5 * (i % 7 == 3), 0, 0, 0))  # fmt: skip
    same_modes(model.linearize(method="dense").modes(), model.linearize(method="sparse").modes(3, near=near), 3, near)
