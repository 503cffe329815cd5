"""Loops by the hundred: planar with redundant rows, spatial, rings, grids; ranks by name as in the dense path."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
from tests.sparse import scenes
from tests.support.compare import assert_same_eigenvalues
from tests.support.sizes import few

OMEGA = np.array([1.0, 7.0, 40.0])
SCENES = {
    "ladder": lambda: mv.library.ladder(12),
    "spherical ladder": lambda: mv.library.ladder(4, "spherical"),
    "flat grid": lambda: scenes.grid(4, 3),
    "grid of balls": lambda: scenes.grid(3, 3, "spherical", flat=False),
    "braced": lambda: scenes.braced(17),
    "ring of balls": lambda: scenes.ring(9),
    "ring of sleeves": lambda: scenes.ring(12, "cylindrical"),
}


@pytest.mark.few(2)
@pytest.mark.parametrize("name", SCENES)
def test_as_the_dense_path(name):
    model = SCENES[name]()
    dense, sparse = model.linearize(method="dense"), model.linearize(method="sparse")
    assert sparse.dof == dense.dof
    assert sparse.redundant == dense.redundant
    every, k = dense.modes(), max(1, dense.dof // 2)
    assert_same_eigenvalues(sparse.modes(k).eigenvalues, every.nearest(k).eigenvalues, rtol=1e-11)
    assert_same_eigenvalues(sparse.modes(dense.dof).eigenvalues, every.eigenvalues, rtol=1e-11)
    expected = dense.frequency_response(OMEGA)
    assert_allclose(sparse.frequency_response(OMEGA), expected, rtol=0, atol=1e-11 * np.abs(expected).max())


@pytest.mark.parametrize(("last", "dof"), [(0.6, 1), (0.9, 0)])
def test_rows_that_depend_only_across_the_loops_of_a_large_group(last, dof, monkeypatch):
    """Three parallel cranks under a table move; a third one that is longer holds them. Each loop alone moves."""
    monkeypatch.setattr("mbsvib.sparse.constraints.MOST_DENSE_ENTRIES", 0)
    model = mv.Model("cranks")
    model.add_body("table", 1.0, scenes.INERTIA, (1.0, 1.0, 0.0))
    for k, (x, length) in enumerate(((0.0, 0.6), (1.0, 0.6), (2.0, last))):
        top = (x + 0.8 * length, 0.6, 0.0)
        model.add_body(f"crank{k}", 1.0, scenes.INERTIA, (x, 0.3, 0.0))
        model.add_joint(f"low{k}", "revolute", "ground", f"crank{k}", (x, 0.0, 0.0), axis=(0, 0, 1))
        model.add_joint(f"high{k}", "revolute", f"crank{k}", "table", top, axis=(0, 0, 1))
    dense, sparse = (model.linearize(method=method) for method in ("dense", "sparse"))
    assert sparse.dof == dense.dof == dof
    assert len(sparse.redundant) == len(dense.redundant)


@pytest.mark.slow
def test_two_thousand_bodies_with_five_hundred_loops():
    """Every brace closes a spatial loop of its own; eigenvalues hold for the whole equations."""
    model = scenes.braced(2000)
    system = model.linearize()
    assert len(system.cut_joints) == 500
    assert len(system.bodies) == 2000
    assert system.redundant == ()
    assert system.dof == 3 * 2000 - 3 * 500
    modes = system.modes(10)
    assert modes.missed == 0
    assert modes.errors.max() <= 1e-12
    again = system.modes(4, near=float(modes.frequencies[6]))
    assert_same_eigenvalues(again.eigenvalues, modes.nearest(4, float(modes.frequencies[6])).eigenvalues, rtol=1e-11)


@pytest.mark.slow
def test_modes_of_many_loops_are_peaks_of_the_whole_response():
    """Independent of Lanczos: each damped eigenvalue is a pole of G, found by Newton's method on 1 / G."""
    system = scenes.braced(600).linearize()
    modes = system.modes(3)
    for value in modes.eigenvalues[0::2]:
        w = np.array([1.0, 1 + 1e-9]) * abs(value.imag)
        peak = np.abs(system.frequency_response(w)[0, 0])
        side = np.abs(system.frequency_response(w * (1 + 5 * abs(value.real / value.imag)))[0, 0])
        assert peak[0] > 2 * side[0]


@pytest.mark.slow
@pytest.mark.parametrize("layers", few([300, 1000], 1))
def test_planar_loops_have_three_redundant_rows_each(layers):
    model = mv.library.ladder(layers)
    system = model.linearize(method="sparse")
    assert len(system.cut_joints) == layers
    assert len(system.redundant) == 3 * layers
    assert system.dof == layers
    names = set(system.cut_joints)
    assert {name.rsplit(".", 1)[0] for name in system.redundant} <= names


@pytest.mark.slow
def test_a_large_grid_of_balls_is_decided_as_a_whole():
    """Loops that all share coordinates, with more rows than a dense rank decision takes."""
    model = scenes.grid(14, 14, "spherical", flat=False)
    system, dense = (model.linearize(method=method) for method in ("sparse", "dense"))
    assert system.dof == dense.dof == 3 * 196 - 3 * 169
    assert system.redundant == dense.redundant == ()
    assert_same_eigenvalues(system.modes(6).eigenvalues, dense.modes(6).eigenvalues, rtol=1e-11)


@pytest.mark.slow
def test_a_large_grid_of_hinges_has_redundant_rows():
    """Three in every loop, and more where loops share bodies that can no longer move."""
    model = scenes.grid(14, 14)
    system, dense = (model.linearize(method=method) for method in ("sparse", "dense"))
    assert system.dof == dense.dof
    assert len(system.redundant) == len(dense.redundant) > 3 * 169
    assert_same_eigenvalues(system.modes(dense.dof).eigenvalues, dense.modes().eigenvalues, rtol=1e-10)


def test_a_ring_of_universal_joints_is_singular_on_both_paths():
    for method in ("dense", "sparse"):
        with pytest.raises(mv.SingularPoseError, match="singular pose"):
            scenes.ring(12, "universal").linearize(method=method)


def flat_four_bars(n, singular):
    """Many four-bar linkages in a row, one of them stretched out."""
    model = mv.Model("four-bars")
    for k in range(n):
        height = 0.0 if k == singular else 0.5
        points = np.array([(0, 0, k), (1, height, k), (3, height, k), (2, 0, k)], dtype=float)
        names = ("ground", f"crank{k}", f"coupler{k}", f"rocker{k}", "ground")
        for i, name in enumerate(names[1:4]):
            model.add_body(name, 1.0 + i, scenes.INERTIA, (points[i] + points[i + 1]) / 2)
        for i in range(4):
            model.add_joint(f"j{k}.{i}", "revolute", names[i], names[i + 1], points[i])
            model.add_bushing(f"s{k}.{i}", names[i], names[i + 1], points[i], (0, 0, 0, 0, 0, 100.0))
    return model


@pytest.mark.slow
def test_a_singular_pose_among_many_is_refused_by_name():
    assert flat_four_bars(250, None).linearize(method="sparse").dof == 250
    with pytest.raises(mv.SingularPoseError, match=r"j137\.\d: singular pose"):
        flat_four_bars(250, 137).linearize(method="sparse")


def test_a_nearly_singular_pose_is_warned_of_and_its_digits_are_not_promised():
    model = mv.Model("nearly flat")
    points = np.array([(0, 0, 0), (1, 1e-6, 0), (3, 1e-6, 0), (2, 0, 0)])
    names = ("ground", "crank", "coupler", "rocker", "ground")
    for i, name in enumerate(names[1:4]):
        model.add_body(name, 1.0 + i, scenes.INERTIA, (points[i] + points[i + 1]) / 2)
    for i in range(4):
        model.add_joint(f"j{i}", "revolute", names[i], names[i + 1], points[i])
        model.add_bushing(f"s{i}", names[i], names[i + 1], points[i], (0, 0, 0, 0, 0, 100.0 * (i + 1)))
    with pytest.warns(mv.NearSingularWarning, match="loops closed by j"):
        sparse = model.linearize(method="sparse")
    with pytest.warns(mv.NearSingularWarning):
        dense = model.linearize(method="dense")
    first, second = sparse.modes(1), dense.modes()
    assert first.errors[0] > 1e-11
    assert abs(first.frequencies[0] / second.frequencies[0] - 1) <= first.errors[0] + second.errors[0]


def test_many_long_loops_are_cut_elsewhere(monkeypatch):
    """A tree of stars has shorter loops; the answers are those of the first tree, with as many loops."""
    model = scenes.grid(5, 5)
    first = model.linearize(method="sparse")
    monkeypatch.setattr("mbsvib.sparse.tree.LONG", 4)
    monkeypatch.setattr("mbsvib.sparse.tree.FEW", 1)
    system = model.linearize(method="sparse")
    assert set(system.cut_joints) != set(first.cut_joints)
    assert len(system.cut_joints) == len(model.joints) - len(model.bodies) == 16
    expected = first.frequency_response(OMEGA)
    assert_allclose(system.frequency_response(OMEGA), expected, rtol=0, atol=1e-11 * np.abs(expected).max())


@pytest.mark.parametrize("ends", [("ground", "a35"), ("a35", "ground"), ("a35", "b4"), ("b4", "a35")])
def test_a_long_path_on_either_side_of_a_joint(ends):
    """Two arms of hinges, of which a ball closes a loop: the first and the second body may be the far one."""
    model, tip = mv.Model("arms"), {}
    for arm, links, turn in (("a", 36, 0.05), ("b", 5, -0.03)):
        at, below = np.array((0.0, 1.0 if arm == "a" else -1.0, 0.0)), "ground"
        for k in range(links):
            name, step = f"{arm}{k}", 0.1 * np.array((np.cos(k * turn), np.sin(k * turn), 0.0))
            model.add_body(name, 1.0, (0.1, 0.1, 0.01), at + 0.5 * step)
            model.add_joint(f"{name}.j", "revolute", below, name, at)
            model.add_bushing(f"{name}.k", below, name, at, (0, 0, 0, 0, 0, 50.0 + k))
            at, below = at + step, name
        tip[name] = at
    model.add_joint("close", "spherical", *ends, tip["a35"])
    model.add_input("F", "a20", (0, 1, 0))
    model.add_output("y", "b2", (0, 1, 0))
    model.add_output("z", "a30", (1, 0, 0))
    dense, sparse = (model.linearize(method=method, cut=["close"]) for method in ("dense", "sparse"))
    assert sparse.dof == dense.dof == 39
    expected = dense.frequency_response(OMEGA)
    assert_allclose(sparse.frequency_response(OMEGA), expected, rtol=0, atol=1e-11 * np.abs(expected).max())
