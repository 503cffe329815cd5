"""Modes where dampers act on motions without mass: Maxwell elements and damped nodes of many bodies."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
from tests.massless.test_maxwell import OMEGA
from tests.massless.test_random_networks import network
from tests.sparse.test_massless import isolated
from tests.support.compare import assert_same_eigenvalues, assert_same_response


def with_static_nodes(n):
    """A chain of isolated bodies, of which every third pulls at a massless body without damper."""
    model = isolated(n)
    for i in range(0, n, 3):
        model.add_body(f"n{i}", 0.0, (0, 0, 0), position=(1, 0, i))
        model.add_joint(f"rail.n{i}", "prismatic", f"b{i}", f"n{i}")
        model.add_spring(f"a{i}", f"b{i}", f"n{i}", (1, 0, i), (1, 0, i + 0.5), 30.0)
        model.add_spring(f"c{i}", "ground", f"n{i}", (1, 0, 0), (1, 0, i + 0.5), 20.0)
    model.add_input("G", "n0", "z")
    model.add_output("y", "n0", "z")
    return model


def floating(n, static=0.0):
    """Bodies on one rail with nothing between them but Maxwell elements."""
    model = mv.Model(f"floating{n}")
    for i in range(n):
        before = f"b{i - 1}" if i else "ground"
        model.add_body(f"b{i}", 1.0 + i % 2, (1, 1, 1), position=(0, 0, i))
        model.add_joint(f"rail{i}", "prismatic", before, f"b{i}")
        if i:
            model.add_maxwell(f"leg{i}", before, f"b{i}", (0, 0, i - 1), (0, 0, i), 100.0 + i, 3.0, static)
    model.add_input("F", "b0", "z")
    model.add_output("x", "b0", "z")
    return model


def cubic(n, damping, count):
    """Roots of s^2 + mu (k + k1 c s / (k1 + c s)) for the lowest mu of a chain that one end holds, by size."""
    mu = 4.0 * np.sin((2 * np.arange(1, count + 1) - 1) * np.pi / (4 * n + 2)) ** 2
    return np.array([np.roots([damping, 300.0, 400.0 * damping * m, 3e4 * m]) for m in mu])


@pytest.mark.parametrize("seed", range(3))
def test_all_modes_of_random_networks(seed):
    model = network(seed)
    dense, sparse = (model.linearize(method=method) for method in ("dense", "sparse"))
    first, second = dense.modes(), sparse.modes(sparse.dof)
    assert (first.rigid, second.rigid, len(second)) == (0, 0, sparse.dof)
    assert_same_eigenvalues(second.eigenvalues, first.eigenvalues, rtol=1e-12)
    assert_allclose(second.first_order.sum(), first.first_order.sum())
    small = sparse.reduced(sparse.dof)
    assert small.massless == dense.massless
    assert_same_response(small.frequency_response(OMEGA), dense.frequency_response(OMEGA), rtol=1e-9)
    t = np.linspace(0, 0.5, 6)
    u = np.array([np.sin(9 * t), np.cos(5 * t)])
    expected = dense.time_response(t, u)
    assert_allclose(sparse.time_response(t, u, modes=sparse.dof), expected, rtol=0, atol=1e-10 * np.abs(expected).max())


@pytest.mark.slow
def test_the_lowest_modes_of_a_long_chain_of_isolators():
    system = isolated(400).linearize(method="sparse")
    modes = system.modes(4)
    expected = cubic(400, 5.0, 4)
    pairs = expected[expected.imag != 0].reshape(-1)
    assert_same_eigenvalues(modes.eigenvalues, pairs, rtol=1e-11)
    assert (modes.errors < 1e-10).all()


@pytest.mark.slow
@pytest.mark.parametrize(("near", "count"), [(0.0, 6), (0.3, 4)])
def test_strong_dampers_that_relax_slowly(near, count):
    """Every element relaxes far below all vibrations: these modes are of first order, and the lowest."""
    model = isolated(60, damping=1e5)
    dense, sparse = (model.linearize(method=method) for method in ("dense", "sparse"))
    modes, expected = sparse.modes(count, near=near), dense.modes().nearest(count, near)
    assert_same_eigenvalues(modes.eigenvalues, expected.eigenvalues, rtol=1e-10)
    assert modes.first_order.tolist() == expected.first_order.tolist()
    if not near:
        assert modes.first_order.all()


@pytest.mark.slow
@pytest.mark.parametrize(("n", "near"), [(9, 0.0), (45, 0.0), (45, 2.0)])
def test_some_nodes_relax_and_others_follow_from_statics(n, near):
    model = with_static_nodes(n)
    dense, sparse = (model.linearize(method=method) for method in ("dense", "sparse"))
    assert (sparse.dof, sparse.massless) == (dense.dof, dense.massless) == (2 * n, n)
    modes = sparse.modes(5, near=near)
    assert_same_eigenvalues(modes.eigenvalues, dense.modes().nearest(5, near).eigenvalues, rtol=1e-10)
    assert_allclose(sparse.reduced(5).D, dense.D, rtol=1e-13)
    if not near:
        small, low = sparse.reduced(5, correction=True), np.array([1e-3])
        result, expected = (system.frequency_response(low)[[0, 2]].real for system in (small, dense))
        assert_allclose(result, expected, rtol=1e-4)


@pytest.mark.few(1)
@pytest.mark.parametrize(("n", "static", "count"), [(5, 0.0, 9), (5, 2.0, 9), (45, 2.0, 4)])
def test_what_floats_on_maxwell_elements(n, static, count):
    """Rigid-body motions stay exactly zero, and those that relax to rest anywhere as well."""
    model = floating(n, static)
    dense, sparse = (model.linearize(method=method) for method in ("dense", "sparse"))
    modes, expected = sparse.modes(count), dense.modes().nearest(count, 0.0)
    assert modes.rigid == expected.rigid
    assert_same_eigenvalues(modes.eigenvalues, expected.eigenvalues, rtol=1e-10)


@pytest.mark.parametrize("count", [4, 8])
def test_massless_motions_that_are_no_coordinates(count):
    """Point masses on oblique ball joints spin about the line to the joint, which dampers resist, and move nothing."""
    rng = np.random.default_rng(5)
    model = mv.Model("bobs")
    for i in range(2):
        model.add_body(f"bob{i}", 1.0 + i, (0, 0, 0), rng.uniform(-1, 1, size=3))
        model.add_joint(f"ball{i}", "spherical", "ground", f"bob{i}", rng.uniform(-1, 1, size=3))
        model.add_bushing(f"k{i}", "ground", f"bob{i}", (0, 0, 0), tuple(rng.uniform(1, 9, 6)), (0.1,) * 6)
    model.add_body("free", 3.0, (0, 0, 0), rng.uniform(-1, 1, size=3))
    model.add_bushing("link", "bob0", "free", (0, 0, 0), tuple(rng.uniform(1, 9, 6)), tuple(rng.uniform(0.1, 0.9, 6)))
    dense, sparse = (model.linearize(method=method) for method in ("dense", "sparse"))
    assert (sparse.dof, sparse.massless) == (dense.dof, dense.massless) == (12, 5)
    result, expected = sparse.modes(12), dense.modes()
    assert_same_eigenvalues(result.eigenvalues, expected.eigenvalues, rtol=1e-11)
    assert np.isin(np.round(sparse.modes(count).eigenvalues, 8), np.round(expected.eigenvalues, 8)).all()


@pytest.mark.parametrize(("links", "light"), [(3, 1), (6, 2)])
def test_massless_links_under_a_load_that_follows_them(links, light):
    """A column of hinges whose last links have no mass; the load on them makes K unsymmetric where it is condensed."""
    model = mv.Model("column")
    for i in range(links):
        below, mass = f"b{i - 1}" if i else "ground", float(i + light < links)
        model.add_body(f"b{i}", mass, (0.1 * mass,) * 3, (i + 0.5, 0, 0))
        model.add_joint(f"j{i}", "revolute", below, f"b{i}", (i, 0, 0))
        model.add_bushing(f"k{i}", below, f"b{i}", (i, 0, 0), (0, 0, 0, 0, 0, 300.0 + i))
    model.add_load("push", f"b{links - 1}", (-20.0, 0, 0), position=(links, 0, 0), follower=True)
    model.add_input("F", "b0", "y")
    model.add_output("y", f"b{links - 1}", "y")
    dense, sparse = (model.linearize(method=method) for method in ("dense", "sparse"))
    assert sparse.dof == dense.dof == links - light
    expected = dense.modes().eigenvalues
    np.testing.assert_allclose(sparse.modes(sparse.dof).eigenvalues, expected, rtol=1e-10, atol=1e-10)
    omega = np.array([1.0, 7.0, 40.0])
    np.testing.assert_allclose(sparse.reduced(sparse.dof).frequency_response(omega), dense.frequency_response(omega),
                               rtol=1e-9)  # fmt: skip


def spinning_flanges(damping):
    """Massless flanges on bushings alone, one on the ground and one on a body, each with a rotor."""
    model = mv.Model("flanges")
    model.add_body("disk", 2.0, (0.03, 0.04, 0.05), (0.01, 0, 0.3))
    model.add_bushing("mount", "ground", "disk", (0.01, 0, 0.3), (3e4, 4e4, 5e4, 300.0, 400.0, 500.0))
    for name, on, rotational, c, axis in (
            ("low", "ground", (30.0, 120.0, 50.0), (0,) * 6, (0, 0, 1)),
            ("high", "disk", (600.0, 700.0, 800.0), damping, (0.3, -0.2, 1))):  # fmt: skip
        model.add_body(name, 0.0, (0, 0, 0), (0, 0, 0.4))
        model.add_bushing(f"{name}.bush", on, name, (0, 0, 0.4), (1e4, 2e4, 3e4, *rotational), c)
        model.add_rotor(f"{name}.rotor", name, 100.0, axis, inertia=0.02)
    model.add_input("T", "high", "rx")
    model.add_output("y", "high", "ry")
    return model


@pytest.mark.parametrize("damping", [
    (0.0,) * 6, pytest.param((0, 0, 0, 0.5, 0, 0), marks=pytest.mark.slow),
    pytest.param((1.0, 1.0, 1.0, 0.5, 0.6, 0.7), marks=pytest.mark.slow)])  # fmt: skip
def test_rotors_on_flanges_that_bushings_alone_hold(damping):
    """A flange turns about its two axes at sqrt(kx ky) / h; the others are those of dense equations."""
    model = spinning_flanges(damping)
    dense, sparse = (model.linearize(method=method) for method in ("dense", "sparse"))
    assert (sparse.dof, sparse.massless) == (dense.dof, dense.massless)
    values = np.asarray(dense.modes().eigenvalues)
    for system in (values, np.asarray(sparse.modes(2, near=30.0 / (2.0 * np.pi)).eigenvalues)):
        assert np.abs(system - 1j * np.sqrt(30.0 * 120.0) / 2.0).min() < 1e-11
    lowest = np.sort(np.abs(sparse.modes(4).eigenvalues))
    np.testing.assert_allclose(lowest, np.sort(np.abs(values))[: len(lowest)], rtol=1e-11)
    w = np.array([5.0, 60.0, 200.0])
    expected = dense.frequency_response(w)
    np.testing.assert_allclose(sparse.frequency_response(w), expected, rtol=0, atol=1e-11 * np.abs(expected).max())
