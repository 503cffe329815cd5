"""Parts that no asked input reaches or no asked output sees are left out, and nothing else changes."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

import mbsvib as mv
from tests.support.compare import linearized
from tests.support.random_models import open_trees, planar_loops
from tests.support.sizes import examples

OMEGA = np.array([0.3, 17.0, 240.0, 5e3])
INERTIA = (0.1, 0.12, 0.15)


def beside(*lengths, damping=True):
    """Chains of links on ground, side by side, that nothing joins; each has ports of its own."""
    model = mv.Model("side by side")
    for c, n in enumerate(lengths):
        for i in range(n):
            below, name = f"c{c}.{i - 1}" if i else "ground", f"c{c}.{i}"
            model.add_body(name, 1.0 + i, INERTIA, (i + 0.5, 10.0 * c, 0.0))
            model.add_joint(f"j{c}.{i}", "revolute", below, name, (float(i), 10.0 * c, 0.0))
            model.add_bushing(f"s{c}.{i}", below, name, (float(i), 10.0 * c, 0.0), (0, 0, 0, 0, 0, 1e3 * (i + 1)),
                              (0, 0, 0, 0, 0, 0.3 * damping * (i % 2)))  # fmt: skip
        model.add_input(f"F{c}", f"c{c}.{n - 1}", "y")
        for quantity in ("displacement", "velocity", "acceleration"):
            model.add_output(f"{quantity}{c}", f"c{c}.{n - 1}", "y", quantity=quantity)
        model.add_force_output(f"M{c}", f"s{c}.0", "rz")
    return model


def test_one_of_three():
    """The same numbers, bit for bit, and the others by name in explain()."""
    system = beside(3, 2, 4).linearize()
    part = system.reachable(["displacement1", "M1"], "F1")
    at = [3, 4]
    assert part.coordinates == ("j1.0.rz", "j1.1.rz")
    assert part.inputs == ("F1",)
    assert part.outputs == ("displacement1", "M1")
    for key in ("M", "C", "K"):
        assert_array_equal(getattr(part, key), getattr(system, key)[np.ix_(at, at)])
    full = system.frequency_response(OMEGA)[[4, 7], 1:2]
    assert_allclose(part.frequency_response(OMEGA), full, rtol=1e-13)
    text = part.explain()
    assert "not controllable from F1: j0.0.rz, j0.1.rz, j0.2.rz, j2.0.rz" in text
    assert "dependent" not in text


def test_reached_and_not_seen():
    """A force on one chain and a sensor on another: nothing is left but D."""
    part = beside(3, 2).linearize().reachable("acceleration1", "F0")
    assert part.dof == 0
    assert_array_equal(part.frequency_response(OMEGA), np.zeros((1, 1, len(OMEGA))))
    assert part.state_space().A.shape == (0, 0)
    assert "not controllable from F0: j1.0.rz" in part.explain()
    assert "not observable from acceleration1: j0.0.rz" in part.explain()
    assert "y = D u" in part.explain()


def test_base_motion_reaches_everything_that_it_moves():
    model = beside(2, 3)
    model.add_base_motion("floor", "y")
    model.add_output("a", "c1.2", "y", quantity="acceleration")
    system = model.linearize()
    part = system.reachable("a", "floor")
    assert part.dof == 3
    assert_allclose(part.frequency_response(OMEGA)[0, 0], system.frequency_response(OMEGA)[-1, -1], rtol=1e-13)
    assert_array_equal(part.D, [[1.0]])


def test_directions_that_do_not_couple():
    """A block on springs along the axes through its centre: one direction out of six."""
    model = mv.Model("block")
    model.add_body("block", 2.0, INERTIA)
    model.add_bushing("mount", "ground", "block", (0, 0, 0), (1e3, 2e3, 3e3, 10, 20, 30), (1, 2, 3, 0.1, 0.2, 0.3))
    model.add_input("F", "block", "z")
    model.add_output("z", "block", "z")
    system = model.linearize()
    part = system.reachable()
    assert part.coordinates == ("block.z",)
    s = 1j * OMEGA
    assert_allclose(part.frequency_response(OMEGA)[0, 0], 1 / (2 * s**2 + 3 * s + 3e3), rtol=1e-14)
    assert system.state_space(reachable=True).states == ("block.z", "d(block.z)/dt")
    assert len(system.state_space("modal", reachable=True).states) == 2
    assert len(system.state_space().states) == 12


@pytest.mark.parametrize("method", ["dense", "sparse"])
@pytest.mark.parametrize(("k", "c"), [(0.0, 0.7), (50.0, 0.0)])
def test_a_damper_or_a_spring_by_itself_joins_two_parts(k, c, method):
    """Sledges on springs to ground, of which the pushed one moves the other only by a damper, or by a spring."""
    model = mv.Model("sledges")
    for name, mass in (("a", 2.0), ("b", 3.0), ("c", 1.0)):
        model.add_body(name, mass, INERTIA)
        model.add_joint(f"{name}.j", "prismatic", "ground", name)
        model.add_bushing(f"{name}.k", "ground", name, (0, 0, 0), (0, 0, 100.0 * mass, 0, 0, 0))
    model.add_bushing("between", "a", "b", (0, 0, 0), (0, 0, k, 0, 0, 0), (0, 0, c, 0, 0, 0))
    model.add_input("F", "a", "z")
    model.add_output("z", "b", "z")
    part = model.linearize(method=method).reachable("z", "F")
    assert part.dof == 2
    s = 1j * OMEGA
    link, first, second = k + c * s, 200.0 + 2 * s * s, 300.0 + 3 * s * s
    expected = link / ((first + link) * (second + link) - link * link)
    assert_allclose(part.frequency_response(OMEGA)[0, 0], expected, rtol=1e-12)


def test_spin_by_itself_joins_two_parts():
    """A wheel on two hinges: pushed about one it tilts about the other by -[h]x alone."""
    model = mv.Model("wheel")
    model.add_body("wheel", 1.0, INERTIA)
    model.add_joint("tilt", "universal", "ground", "wheel", (0, 0, 0))
    model.add_bushing("k", "ground", "wheel", (0, 0, 0), (0, 0, 0, 20.0, 30.0, 0))
    model.add_rotor("spin", "wheel", 5.0, (0, 0, 1), inertia=0.4)
    model.add_input("M", "wheel", "rx")
    model.add_output("y", "wheel", "ry")
    part = model.linearize().reachable("y", "M")
    assert part.dof == 2
    s = 1j * OMEGA
    expected = 2 * s / ((20 + 0.1 * s * s) * (30 + 0.12 * s * s) + 4 * s * s)  # C = [[0, h], [-h, 0]], h = 2
    assert_allclose(part.frequency_response(OMEGA)[0, 0], expected, rtol=1e-12)


def test_a_load_that_follows_joins_two_parts():
    """K = diag + [[0, t], [-t, 0]] / 2 by a dead torque about the third axis, the only link of both angles."""
    model = mv.Model("torque")
    model.add_body("body", 1.0, INERTIA)
    model.add_joint("tilt", "spherical", "ground", "body", (0, 0, 0))
    model.add_bushing("k", "ground", "body", (0, 0, 0), (0, 0, 0, 20.0, 30.0, 40.0), preload=(0, 0, 0, 0, 0, -3.0))
    model.add_load("t", "body", (0, 0, 0), (0, 0, 3.0))
    model.add_input("M", "body", "rx")
    model.add_output("y", "body", "ry")
    system = model.linearize()
    part = system.reachable("y", "M")
    assert part.dof == 2
    s = 1j * OMEGA[:, None, None]
    exact = np.linalg.inv(system.K + s * s * system.M)[:, 1, 0]
    assert_allclose(part.frequency_response(OMEGA)[0, 0], exact, rtol=1e-10)


def test_nothing_to_drop_says_so():
    system = beside(3).linearize()
    part = system.reachable()
    assert part.coordinates == system.coordinates
    assert "nothing was removed: every part is coupled to an input and to an output" in part.explain()
    assert_array_equal(part.frequency_response(OMEGA), system.frequency_response(OMEGA))


def test_twice_names_what_went_the_first_time_too():
    part = beside(2, 2, 2).linearize().reachable(inputs=["F0", "F1"]).reachable("M0", "F0")
    assert part.dof == 2
    assert "not controllable from F0: j2.0.rz, j2.1.rz, j1.0.rz, j1.1.rz" in part.explain()


@pytest.mark.parametrize(("words", "message"), [
    ({"inputs": "F9"}, "input 'F9': system .* has no such input"),
    ({"outputs": ["M0", "M7"]}, "output 'M7': system .* has no such output"),
    ({"inputs": []}, "no inputs are asked for, which leaves nothing"),
])  # fmt: skip
def test_names_that_are_none(words, message):
    with pytest.raises(mv.ResponseError, match=message):
        beside(2).linearize().reachable(**words)


def test_a_system_without_ports_is_refused():
    model = mv.Model("bare")
    model.add_body("b", 1.0, INERTIA)
    with pytest.raises(mv.ResponseError, match="yet it has none"):
        model.linearize().reachable()


@pytest.mark.parametrize("damping", [False, True])
def test_everything_that_a_system_does_works_on_the_part(damping):
    system = beside(3, 4, damping=damping).linearize()
    part = system.reachable("displacement1", "F1")
    t = np.linspace(0, 2, 300)
    u = np.sin(9 * t)
    full = system.time_response(t, np.stack((0 * u, u)))[system.outputs.index("displacement1")]
    assert_allclose(part.time_response(t, u)[0], full, rtol=0, atol=1e-12 * np.abs(full).max())
    values = system.modes().eigenvalues
    for value in part.modes().eigenvalues:
        assert np.abs(values - value).min() <= 1e-12 * abs(value)
    assert len(part.transmission_zeros()) < len(part.poles())
    assert sum(v.sum() for v in part.modes().kinetic_energy.values()) == pytest.approx(part.dof)
    assert set(part.displacements(np.ones(part.dof))) == set(system.bodies)


def together(first, second):
    """Two mechanisms in one model, that nothing joins."""
    model = mv.Model("together")
    for tag, source in (("a.", first), ("b.", second)):
        for part in (*source.bodies.values(), *source.joints.values(), *source.springs.values(),
                     *source.inputs.values(), *source.outputs.values()):  # fmt: skip
            words = part.constructor_kwargs()
            for key in ("name", "first", "second", "body", "relative_to", "element"):
                if key in words and words[key] != "ground":
                    words[key] = tag + words[key]
            getattr(model, mv.api.model.ADDERS[type(part)])(**words)
    return model


@pytest.mark.slow
@examples(20, slow=40)
@given(open_trees(), st.one_of(open_trees(), planar_loops()))
def test_random_mechanisms_side_by_side(first, second):
    model = together(first, second)
    system = linearized(model)
    separate = linearized(second)
    assume(separate.dof)
    names = [f"b.{name}" for name in second.outputs], [f"b.{name}" for name in second.inputs]
    part = system.reachable(*names)
    assert part.dof <= separate.dof
    assert not any(name.startswith("a.") for name in part.coordinates)
    expected = separate.frequency_response(OMEGA)
    size = np.abs(expected).max(axis=1, keepdims=True)
    noise = 1e-13 * size.max(axis=0, keepdims=True)
    assert (np.abs(part.frequency_response(OMEGA) - expected) <= 1e-9 * size + noise).all()
