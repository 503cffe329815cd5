"""Maxwell elements against closed forms: k0 + k1 c s / (k1 + c s) between two points."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv

OMEGA = np.array([0.01, 0.3, 0.6, 1.0, 3.0, 30.0])


def isolator(stiffness=3.0, damping=5.0, static=2.0, mass=7.0):
    """A mass on a relaxation isolator on a moving ground."""
    model = mv.Model("isolator")
    model.add_body("m", mass, (1, 1, 1), position=(0, 0, 1))
    model.add_joint("rail", "prismatic", "ground", "m")
    model.add_maxwell("leg", "ground", "m", start=(0, 0, 0), end=(0, 0, 1), stiffness=stiffness, damping=damping,
                      static_stiffness=static)  # fmt: skip
    model.add_base_motion("base", "z")
    model.add_input("F", "m", "z")
    model.add_output("a", "m", "z", quantity="acceleration")
    model.add_output("x", "m", "z")
    model.add_force_output("f", "leg")
    return model


def stiffness_at(s, k1=3.0, c=5.0, k0=2.0):
    return k0 + k1 * c * s / (k1 + c * s)


def test_the_relaxation_isolator():
    system = isolator().linearize()
    k = stiffness_at(1j * OMEGA)
    result = system.frequency_response(OMEGA)
    t, x = k / (k - 7.0 * OMEGA**2), 1.0 / (k - 7.0 * OMEGA**2)
    relative = -7.0 * x
    assert_allclose(result, [[t, -(OMEGA**2) * x], [relative, x], [relative * k, k * x]], rtol=1e-12)
    expected = np.sort_complex(np.roots([7.0 * 5.0, 7.0 * 3.0, 2.0 * 5.0 + 3.0 * 5.0, 2.0 * 3.0]))
    assert_allclose(np.sort_complex(system.poles()), expected, rtol=1e-12)
    space = system.state_space()
    assert space.states == ("rail.z", "leg.z", "d(rail.z)/dt")


def test_the_response_in_time_is_that_of_the_states():
    system = isolator().linearize()
    t = np.linspace(0.0, 8.0, 41)
    u = np.array([np.sin(t), np.cos(2.0 * t)])
    space = system.state_space()
    n, inputs = space.B.shape
    from scipy.linalg import expm

    full = np.zeros((n + 2 * inputs, n + 2 * inputs))
    full[:n, :n], full[:n, n : n + inputs], full[n : n + inputs, n + inputs :] = space.A, space.B, np.eye(inputs)
    step = expm(full * (t[1] - t[0]))[:n]
    x, expected = np.zeros(n), []
    for i in range(len(t)):
        expected.append(space.C @ x + space.D @ u[:, i])
        if i + 1 < len(t):
            x = step @ np.concatenate((x, u[:, i], (u[:, i + 1] - u[:, i]) / (t[1] - t[0])))
    assert_allclose(system.time_response(t, u), np.transpose(expected), rtol=1e-10, atol=1e-11)


@pytest.mark.parametrize("damping", [1e9, 1e14])
def test_a_damper_that_holds_leaves_two_springs(damping):
    system = isolator(damping=damping).linearize()
    poles = system.poles()
    slow = np.argmin(np.abs(poles))
    assert_allclose(poles[slow], -2.0 * 3.0 / (2.0 + 3.0) / damping, rtol=1e-8)
    assert_allclose(np.abs(np.delete(poles, slow)), np.sqrt(5.0 / 7.0), rtol=1e-8)


@pytest.mark.parametrize("stiffness", [1e6, 1e8])
def test_a_spring_that_holds_leaves_the_damper(stiffness):
    result = isolator(stiffness=stiffness).linearize().frequency_response(OMEGA)[1, 1]
    k = stiffness_at(1j * OMEGA, k1=stiffness)
    assert_allclose(result, 1.0 / (k - 7.0 * OMEGA**2), rtol=1e-7)
    assert_allclose(k, 2.0 + 5j * OMEGA, rtol=2e2 / stiffness)


def test_without_damping_the_series_carries_nothing():
    system = isolator(damping=0.0).linearize()
    assert system.coordinates == ("rail.z",)
    assert_allclose(system.K, [[2.0]], rtol=1e-15)
    k = 2.0
    assert_allclose(system.frequency_response(OMEGA)[2, 1], k / (k - 7.0 * OMEGA**2), rtol=1e-12)


@pytest.mark.parametrize("relative", [False, True])
def test_a_massless_body_between_a_spring_and_an_element(relative):
    """The body follows what the damper yields, and takes the mass behind it along: 1/k + 1/k1 + 1/(c s)."""
    model = mv.Model("series")
    model.add_body("n", 0.0, (0, 0, 0), position=(0, 0, 1))
    model.add_body("m", 7.0, (1, 1, 1), position=(0, 0, 2))
    model.add_joint("n.rail", "prismatic", "ground", "n")
    model.add_joint("m.rail", "prismatic", "n" if relative else "ground", "m")
    model.add_spring("k", "n", "m", start=(0, 0, 1), end=(0, 0, 2), stiffness=2.0)
    model.add_maxwell("leg", "ground", "n", start=(0, 0, 0), end=(0, 0, 1), stiffness=3.0, damping=5.0)
    model.add_input("F", "m", "z")
    model.add_output("x", "m", "z")
    system = model.linearize()
    yields = 1.0 / 2.0 + 1.0 / 3.0 + 1.0 / (5j * OMEGA)
    assert_allclose(system.frequency_response(OMEGA)[0, 0], 1.0 / (1.0 / yields - 7.0 * OMEGA**2), rtol=1e-12)
    moving = np.roots([7.0 * 5.0 * (1.0 / 2.0 + 1.0 / 3.0), 7.0, 5.0])
    assert_allclose(np.sort_complex(system.poles()), np.sort_complex([0.0, *moving]), rtol=1e-12)


def test_between_bodies_along_any_line():
    """A free pair of bodies: the element acts on the change of its length only."""
    start, end = np.array([0.1, -0.2, 0.4]), np.array([0.5, 0.3, 1.4])
    model = mv.Model()
    model.add_body("a", 1.5, (0.3, 0.4, 0.5), position=(0, 0, 0))
    model.add_body("b", 2.5, (0.6, 0.5, 0.7), position=(0.2, 0.1, 2.0))
    model.add_bushing("mount", "ground", "a", position=(0, 0, 0), stiffness=(9, 8, 7, 6, 5, 4))
    model.add_bushing("hold", "ground", "b", position=(0, 0, 1), stiffness=(5, 6, 7, 9, 8, 9))
    model.add_input("F", "b", "x")
    for name in ("a", "b"):
        for i, direction in enumerate(("x", "y", "z", "rx", "ry", "rz")):
            model.add_output(f"{name}{i}", name, direction)
    model.add_maxwell("leg", "a", "b", start=start, end=end, stiffness=3.0, damping=5.0, static_stiffness=2.0)
    result = model.linearize().frequency_response(OMEGA)[:, 0]
    plain = mv.Model()
    for part in ("a", "b"):
        plain.add_body(**model.bodies[part].constructor_kwargs())
    for part in ("mount", "hold"):
        plain.add_bushing(**model.springs[part].constructor_kwargs())
    bare = plain.linearize()
    e = (end - start) / np.linalg.norm(end - start)
    row = np.concatenate((-e, -np.cross(start, e), e, np.cross(end - model.bodies["b"].position, e)))
    for i, w in enumerate(OMEGA):
        z = bare.K - w**2 * bare.M + stiffness_at(1j * w) * np.outer(row, row)
        assert_allclose(result[:, i], np.linalg.solve(z, np.eye(12)[6]), rtol=1e-10, atol=1e-13)


def test_parameters_changes_and_files(tmp_path):
    model = isolator()
    assert model.parameters["leg.static_stiffness"] == 2.0
    assert model.parameters.units["leg.damping"] == "N s/m"
    assert model.parameters.units["leg.static_stiffness"] == "N/m"
    changed = model.with_values({"leg.damping": 11.0, "leg.static_stiffness": 4.0})
    k = stiffness_at(1j * OMEGA, c=11.0, k0=4.0)
    expected = 1.0 / (k - 7.0 * OMEGA**2)
    assert_allclose(changed.linearize().frequency_response(OMEGA)[1, 1], expected, rtol=1e-12)
    again = mv.load(mv.save(changed, tmp_path / "isolator.yaml"))
    assert again.springs == changed.springs
    assert "type: maxwell" in (tmp_path / "isolator.yaml").read_text(encoding="utf-8")
    assert set(model.linearize().parameters) == set(model.parameters)
    assert model.replace("leg", damping=11.0).springs["leg"].damping == 11.0


@pytest.mark.parametrize(("words", "message"), [
    ({"stiffness": 0.0}, "stiffness = 0.*positive"), ({"stiffness": -1.0}, "stiffness"),
    ({"damping": -1.0}, "damping.*not negative"), ({"damping": float("nan")}, "damping"),
    ({"end": (0, 0, 0)}, "no length"), ({"second": "ground"}, "itself"), ({"second": "nobody"}, "nobody"),
    ({"name": "m"}, "taken"),
])  # fmt: skip
def test_bad_elements_are_refused(words, message):
    model = isolator()
    arguments = {"name": "e", "first": "ground", "second": "m", "start": (0, 0, 0), "end": (0, 0, 1), "stiffness": 1.0,
             "damping": 1.0} | words  # fmt: skip
    with pytest.raises(mv.ModelError, match=message):
        model.add_maxwell(**arguments)


def test_names_and_directions():
    model = isolator()
    with pytest.raises(mv.ModelError, match=r"'leg\.node': the name is taken by a Maxwell element"):
        model.add_body("leg.node", 1.0, (1, 1, 1))
    with pytest.raises(mv.ModelError, match="the line of a spring"):
        model.add_force_output("g", "leg", "x")


def test_six_directions_by_a_massless_body_between_two_bushings():
    """What a spring-damper in series in six directions takes: a node that is free, and two bushings."""
    k0, k1, c = np.arange(1.0, 7.0), np.arange(6.0, 0.0, -1.0), np.array([1.0, 2.0, 3.0, 0.5, 0.7, 0.9])
    mass = np.array([2.0, 2.0, 2.0, 0.1, 0.2, 0.25])
    model = mv.Model("mount")
    model.add_body("b", 2.0, mass[3:])
    model.add_body("node", 0.0, (0, 0, 0))
    model.add_joint("yields", "free", "b", "node", position=(0, 0, 0))
    model.add_bushing("static", "ground", "b", (0, 0, 0), stiffness=k0)
    model.add_bushing("series", "ground", "node", (0, 0, 0), stiffness=k1)
    model.add_bushing("damper", "node", "b", (0, 0, 0), damping=c)
    for direction in ("x", "y", "z", "rx", "ry", "rz"):
        model.add_input(f"F{direction}", "b", direction)
        model.add_output(direction, "b", direction)
    system = model.linearize()
    assert (system.dof, system.massless) == (12, 6)
    s = 1j * OMEGA[:, None]
    expected = 1.0 / (mass * s**2 + k0 + k1 * c * s / (k1 + c * s))
    result = system.frequency_response(OMEGA)
    assert_allclose(np.einsum("iiw->wi", result), expected, rtol=1e-11)
    assert np.abs(result - np.einsum("wi,ij->ijw", expected, np.eye(6))).max() < 1e-12


@pytest.mark.parametrize("k1", [1e3, 1e6, 1e9, 1e13])
def test_elements_in_three_directions_and_stiff_ones(k1):
    """x = F / (m s^2 + k0 + k1 c s / (k1 + c s)) along each, however stiff the springs that dampers let give way."""
    model = mv.Model("corner")
    model.add_body("part", 3.0, (0.1, 0.2, 0.3))
    model.add_joint("guide", None, "ground", "part", (0, 0, 0), free=("x", "y", "z"))
    for i, line in enumerate(np.eye(3), start=1):
        name = "xyz"[i - 1]
        model.add_maxwell(f"e{name}", "ground", "part", -line, (0, 0, 0), i * k1, 20.0 * i, static_stiffness=100.0 * i)
        model.add_input(f"F{name}", "part", name)
        model.add_output(name, "part", name)
        model.add_force_output(f"{name}.force", f"e{name}")
    system = model.linearize()
    assert system.massless == 3
    omega = np.array([0.1, 3.0, 5.77, 6.5, 50.0, 1e3])
    result = system.frequency_response(omega)
    for i, name in enumerate("xyz"):
        s = 1j * omega
        holds = (i + 1) * (100.0 + k1 * 20.0 * s / (k1 + 20.0 * s))
        expected = 1.0 / (3.0 * s**2 + holds)
        np.testing.assert_allclose(result[system.outputs.index(name), i], expected, rtol=1e-13)
        np.testing.assert_allclose(result[system.outputs.index(f"{name}.force"), i], holds * expected, rtol=1e-13)
        assert (np.abs(np.delete(result[system.outputs.index(name)], i, axis=0)) <= 1e-13 * np.abs(expected)).all()


def test_a_damper_that_gives_way_holds_nothing_at_rest():
    system = isolator(static=0.0, stiffness=1e9).linearize()
    with pytest.raises(mv.MbsvibError, match=r"0 rad/s is a pole"):
        system.frequency_response([0.0, 1.0])
    s = 0.5j
    result = system.frequency_response([0.5])[system.outputs.index("x"), system.inputs.index("F"), 0]
    assert result == pytest.approx(1.0 / (7.0 * s**2 + 1e9 * 5.0 * s / (1e9 + 5.0 * s)), rel=1e-14)
