"""Massless bodies and Maxwell elements of many bodies, held against the dense engine and closed forms."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import solve_banded

import mbsvib as mv
from tests.massless.scenes import along_z
from tests.massless.test_maxwell import OMEGA, isolator, stiffness_at
from tests.massless.test_random_networks import network
from tests.massless.test_with_others import gimbal
from tests.support.compare import assert_same_response


def isolated(n, static=0.0, damping=5.0, spring=100.0):
    """A chain of n bodies on rails, each on a Maxwell element and a spring beside it."""
    model = mv.Model(f"isolated{n}")
    for i in range(n):
        before, name = f"b{i - 1}" if i else "ground", f"b{i}"
        model.add_body(name, 1.0, (1, 1, 1), position=(0.1 * (i % 2), 0, i + 1))
        model.add_joint(f"rail{i}", "prismatic", before, name)
        model.add_maxwell(f"leg{i}", before, name, start=(0, 0, i), end=(0, 0, i + 1), stiffness=300.0,
                          damping=damping, static_stiffness=static)  # fmt: skip
        if spring:
            model.add_spring(f"k{i}", before, name, start=(0, 0, i), end=(0, 0, i + 1), stiffness=spring)
    model.add_input("F", name, "z")
    model.add_output("x", name, "z")
    model.add_force_output("f", f"leg{n // 2}")
    return model


def both(model):
    """The dense and the sparse system, with the same motions told apart."""
    dense, sparse = (model.linearize(method=method) for method in ("dense", "sparse"))
    assert (sparse.dof, sparse.massless, sparse.bodies) == (dense.dof, dense.massless, dense.bodies)
    return dense, sparse


@pytest.mark.parametrize(("static", "damping"), [(2.0, 5.0), (0.0, 5.0), (2.0, 0.0), (2.0, 1e9)])
def test_the_relaxation_isolator(static, damping):
    system = isolator(damping=damping, static=static).linearize(method="sparse")
    k = stiffness_at(1j * OMEGA, c=damping, k0=static)
    t, x = k / (k - 7.0 * OMEGA**2), 1.0 / (k - 7.0 * OMEGA**2)
    result = system.frequency_response(OMEGA)
    assert_allclose(result, [[t, -(OMEGA**2) * x], [-7.0 * x, x], [-7.0 * x * k, k * x]], rtol=1e-12)
    assert (system.dof, system.massless) == ((2, 1) if damping else (1, 0))


@pytest.mark.parametrize("seed", range(4))
def test_random_networks(seed):
    """Nodes of which dampers touch some and others not, with forces and rates on both."""
    dense, sparse = both(network(seed))
    massless = dense.provenance.separation
    assert len(sparse.separation.condensed) == len(massless.condensed)
    assert len(sparse.separation.first_order) == len(massless.first_order)
    assert_same_response(sparse.frequency_response(OMEGA), dense.frequency_response(OMEGA), rtol=1e-11)
    assert_allclose(sparse.D, dense.D, rtol=1e-12, atol=1e-15)
    assert_allclose(sparse.static_compliance(), dense.Cq @ np.linalg.solve(dense.K, dense.B) + dense.D, atol=1e-12)


@pytest.mark.slow
def test_a_long_chain_of_isolators():
    """Against the tridiagonal equations of the masses, which the elements join by k0 + k1 c s / (k1 + c s)."""
    n, omega = 1500, np.array([0.0, 1e-3, 0.02, 0.3, 4.0, 30.0])
    system = isolated(n).linearize(method="sparse")
    assert (system.dof, system.massless) == (2 * n, n)
    result = system.frequency_response(omega)[:, 0]
    middle = n // 2
    for i, w in enumerate(omega):
        leg = stiffness_at(1j * w, 300.0, 5.0, 0.0)
        k = 100.0 + leg
        bands = np.full((3, n), -k)
        bands[1] = 2.0 * k - w**2
        bands[1, -1] = k - w**2
        x = solve_banded((1, 1), bands, np.eye(n)[-1])
        assert_allclose(result[:, i], [x[-1], leg * (x[middle] - x[middle - 1])], rtol=1e-9)


@pytest.mark.parametrize("static", [0.0, 20.0])
def test_static_compliance_needs_a_spring_beside_the_element(static):
    with_spring = isolated(5, static, spring=0.0 if static else 100.0).linearize(method="sparse")
    k = static or 100.0
    assert_allclose(with_spring.static_compliance()[:, 0], [5.0 / k, static / k], rtol=1e-13)
    single = isolated(5, spring=0.0).linearize(method="sparse")
    with pytest.raises(mv.ResponseError, match="a motion of the mechanism has no stiffness"):
        single.static_compliance()


def loose():
    return along_z({"node": 0.0, "b": 1.0}, {"k": ("ground", "b", 1, 0)})


def cancelling():
    return along_z({"node": 0.0, "b": 1.0}, {"k": ("ground", "node", 1, 0), "minus": ("node", "b", -1, 0)})


def improper(quantity, damping=0.0):
    model = along_z({"node": 0.0, "b": 1.0}, {"k1": ("ground", "node", 1, damping), "k2": ("node", "b", 2, 0)})
    model.add_output("x", "node", "z", quantity=quantity)
    model.add_input("F", "node", "z")
    return model


def turning_point():
    model = mv.Model()
    model.add_body("point", 1.0, (0, 0, 0))
    return model


@pytest.mark.parametrize("model", [
    loose, cancelling, turning_point, lambda: improper("velocity"), lambda: improper("acceleration"),
    lambda: improper("acceleration", 1.0), lambda: gimbal((0.1, 0.0, 0.1)),
])  # fmt: skip
def test_what_dense_equations_refuse_is_refused(model):
    messages = []
    for method in ("dense", "sparse"):
        with pytest.raises(mv.MbsvibError) as caught:
            model().linearize(method=method)
        messages.append((type(caught.value), str(caught.value).partition("(pivots")[0]))
    assert messages[0] == messages[1]


def test_rates_of_damped_nodes():
    dense, sparse = both(improper("velocity", 1.0))
    assert sparse.massless == 1
    assert_allclose(sparse.frequency_response(OMEGA), dense.frequency_response(OMEGA), rtol=1e-12)


@pytest.mark.parametrize("damping", [0.0, 0.4])
def test_a_lattice_of_nodes(damping):
    """Nodes that float, tied by bushings to each other and to a few bodies: one part of many motions."""
    rng = np.random.default_rng(3)
    model, n = mv.Model("lattice"), 4
    for i in range(n):
        for j in range(n):
            heavy = (i, j) in ((0, 0), (3, 2))
            model.add_body(f"n{i}{j}", 2.0 * heavy, (0.3 * heavy,) * 3, (i, j, rng.uniform()))
    for i in range(n):
        for j in range(n):
            for a, b in ((i + 1, j), (i, j + 1)):
                if max(a, b) < n:
                    k = rng.uniform(1, 50, size=6)
                    c = damping * k if (i + j) % 3 == 0 else np.zeros(6)
                    model.add_bushing(f"s{i}{j}{a}{b}", f"n{i}{j}", f"n{a}{b}", (i, j, 0), tuple(k), tuple(c))
    model.add_bushing("foot", "ground", "n00", (0, 0, 0), (100.0,) * 6)
    model.add_input("F", "n33", "x")
    model.add_output("x", "n12", (1, 2, 3))
    model.add_output("y", "n32", "ry", quantity="acceleration")
    dense, sparse = both(model)
    assert_same_response(sparse.frequency_response(OMEGA), dense.frequency_response(OMEGA), rtol=1e-9)
    assert_allclose(sparse.D, dense.D, rtol=1e-9)


def test_under_gravity_and_loads():
    """Inverted pendulums on massless struts, with massless arms, held by elements that relax."""
    model = mv.Model("tower", gravity=(0, 0, -9.81))
    before = "ground"
    for i in range(4):
        for name, mass in ((f"strut{i}", 0.0), (f"b{i}", 2.0)):
            model.add_body(name, mass, (0.1 * mass,) * 3, (0, 0, 2 * i + (1.5 if mass else 0.5)))
            height = 2 * i + (1.0 if mass else 0.0)
            model.add_joint(f"{name}.j", "universal", before, name, (0, 0, height), axis=(1, 0, 0), axis2=(0, 1, 0))
            model.add_bushing(f"{name}.k", before, name, (0, 0, height), (0, 0, 0, 900, 800, 0))
            before = name
        model.add_body(f"arm{i}", 0.0, (0, 0, 0), (0.5, 0, 2 * i + 1.5))
        model.add_joint(f"pin{i}", "revolute", before, f"arm{i}", (0.2, 0, 2 * i + 1.5), axis=(0, 1, 0))
        model.add_spring(f"tip{i}", "ground", f"arm{i}", (1, 0, 2 * i), (0.7, 0, 2 * i + 1.4), 40.0, 0.5 * (i == 1))
        model.add_maxwell(f"leg{i}", "ground", f"b{i}", (1, 1, 2 * i), (0.1, 0, 2 * i + 1.5), 500.0, 20.0)
    model.add_load("push", "b3", (0, 0, -7.0))
    model.add_input("F", "b3", "x")
    model.add_output("x", "b3", "x")
    model.add_output("y", "strut2", "rx")
    model.add_force_output("f", "leg2")
    model.add_force_output("g", "strut1.j", "x")
    dense, sparse = both(model)
    assert sparse.separation.condensed == ("pin0.rz", "pin2.rz", "pin3.rz")
    assert_same_response(sparse.frequency_response(OMEGA), dense.frequency_response(OMEGA), rtol=1e-11)


def test_machines_out_of_reach_take_their_nodes_along():
    model = isolated(6)
    model.add_body("other", 1.0, (1, 1, 1), position=(3, 0, 0))
    model.add_joint("other.rail", "prismatic", "ground", "other")
    model.add_maxwell("other.leg", "ground", "other", (3, 0, -1), (3, 0, 0), 10.0, 1.0)
    model.add_spring("other.k", "ground", "other", (3, 0, -1), (3, 0, 0), 10.0)
    model.add_input("G", "other", "z")
    model.add_output("y", "other", "z")
    full = model.linearize(method="sparse")
    part = full.reachable("y", "G")
    assert (part.dof, part.massless, part.bodies) == (2, 1, ("other", "other.leg.node"))
    assert_allclose(part.frequency_response(OMEGA)[0, 0], full.frequency_response(OMEGA)[2, 1], rtol=1e-13)
    assert full.reachable(["x", "f"], "F").dof == 12


def test_explain_tells_of_motions_without_mass():
    text = isolated(3).linearize(method="sparse").explain()
    assert "one first-order state each: leg0.z, leg1.z, leg2.z; 9 states in all" in text
    text = isolated(3, damping=0.0).linearize(method="sparse").explain()
    assert "condensed statically, as no damper acts on them: leg0.z, leg1.z, leg2.z" in text
    assert "without mass" not in mv.library.chain(3).linearize(method="sparse").explain()


def series(n):
    """A chain of bodies, between each two of them a massless node that pairs of springs hold."""
    masses = {name: mass for i in range(n) for name, mass in ((f"n{i}", 0.0), (f"b{i}", 1.0 + i % 3))}
    springs, before = {}, "ground"
    for i, name in enumerate(masses):
        springs[f"k{i}"] = (before, name, 50.0 + 7.0 * (i % 5), 0.3 if not i else 0.0)
        before = name
    springs["c"] = ("ground", f"b{n - 1}", 0.0, 0.7)
    model = along_z(masses, springs | {"k0": ("ground", "n0", 50.0, 0.0)})
    model.add_input("F", f"n{n - 1}", "z")
    model.add_output("x", f"n{n - 1}", "z")
    model.add_output("y", f"b{n - 1}", "z")
    return model


@pytest.mark.few(1)
@pytest.mark.parametrize("n", [3, 60])
def test_modes_where_all_nodes_follow_from_statics(n):
    dense, sparse = both(series(n))
    count = min(n, 8)
    modes = sparse.modes(count)
    assert_allclose(modes.eigenvalues, dense.modes().eigenvalues[: 2 * count], rtol=1e-9)
    assert modes.missed == 0
    small = sparse.reduced(count, correction=True)
    low = np.array([0.01, 0.1])
    assert_allclose(small.frequency_response(low), dense.frequency_response(low), rtol=1e-3)
    assert_allclose(sparse.reduced(n).frequency_response(OMEGA), dense.frequency_response(OMEGA), rtol=1e-8)
    assert_allclose(sparse.reduced(1).D, dense.D, rtol=1e-13)


def test_point_masses_on_a_long_chain_are_no_search():
    """Each stands still where the one before does: no part of thousands of coordinates is made."""
    system = mv.library.pendulum_chain(800).linearize(method="sparse")
    assert (system.dof, system.separation) == (800, None)
