"""Springs and torsion springs whose stiffness depends on frequency, in every engine, against K(w) itself."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.elements.dynamic_bushing import DynamicBushing
from mbsvib.errors import ModelError

OMEGA = 2 * np.pi * np.geomspace(0.1, 300.0, 40)
S = 1j * OMEGA
FACTOR = mv.Dynamic.of_words({"static": 0.9, "viscous": 1e-4, "weights": [0.8, 0.3], "times": [0.02, 1e-3]})
K, C, M = 6e3, 1.0, 2.0
# of the dynamic stiffness z to each parameter
SLOPES = {"k.g1": K * 0.02 * S / (1 + 0.02 * S), "k.tau2": K * 0.3 * S / (1 + 1e-3 * S) ** 2,
          "k.stiffness": FACTOR.factor(OMEGA), "k.damping": S}  # fmt: skip
Z = K * FACTOR.factor(OMEGA) + S * C
X = 1.0 / (Z - M * OMEGA**2)


def one_mass(kind, swap=False, factor=FACTOR):
    """A mass on a rail with a spring along it, or a wheel on a hinge with a torsion spring about it."""
    model = mv.Model("mass")
    model.add_body("b", M, (M, M, M), position=(0, 0, 0.5))
    model.add_joint("j", kind, "ground", "b", position=(0, 0, 0.5), axis=(0, 0, 1))
    ends = ("b", "ground") if swap else ("ground", "b")
    if kind == "prismatic":
        points = ((0, 0, 0.5), (0, 0, 0)) if swap else ((0, 0, 0), (0, 0, 0.5))
        model.add_spring("k", *ends, *points, K, C, dynamic=factor)
    else:
        model.add_torsion_spring("k", *ends, (0, 0, 1), K, C, dynamic=factor)
    direction = "z" if kind == "prismatic" else "rz"
    model.add_input("F", "b", direction)
    model.add_output("x", "b", direction)
    model.add_force_output("f", "k", direction)
    return model


@pytest.mark.parametrize("method", ["dense", "sparse"])
@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("kind", ["prismatic", "revolute"])
def test_the_closed_form(kind, swap, method):
    found = one_mass(kind, swap).linearize(method=method).frequency_response(OMEGA)
    sign = -1.0 if swap and kind == "revolute" else 1.0
    np.testing.assert_allclose(found[:, 0], [X, sign * Z * X], rtol=1e-12)


def test_states_and_names():
    model = one_mass("prismatic")
    system = model.linearize()
    assert system.coordinates == ("j.z", "k.1.z", "k.2.z")
    assert (system.massless, len(system.modes().eigenvalues)) == (2, 4)
    assert {"k.g1", "k.tau1", "k.g2", "k.tau2", "k.stiffness", "k.start.x"} <= set(model.parameters)
    with pytest.raises(ModelError, match=r"'k\.2\.node'"):
        model.add_body("k.2.node", 1.0, (1, 1, 1))


@pytest.mark.parametrize("swap", [False, True])
def test_a_floor_that_moves(swap):
    model = one_mass("prismatic", swap)
    model.add_motion_input("floor", "k")
    x = Z * X
    for method in ("dense", "sparse"):
        found = model.linearize(method=method).frequency_response(OMEGA)
        np.testing.assert_allclose(found[0, 1], x, rtol=1e-11)
        force = M * OMEGA**2 * x
        np.testing.assert_allclose(found[1, 1] / np.abs(force), force / np.abs(force), rtol=0.0, atol=1e-8)


@pytest.mark.parametrize("kind", ["prismatic", "revolute"])
def test_derivatives_are_those_of_the_closed_form(kind):
    found = one_mass(kind).linearize().frequency_response_sensitivities(OMEGA, list(SLOPES))
    for row, slope in zip(found, SLOPES.values(), strict=True):
        for value, expected in zip(row[:, 0], (-(X**2) * slope, X * slope - Z * X**2 * slope), strict=True):
            size = np.abs(expected).max()
            np.testing.assert_allclose(value / size, expected / size, rtol=0.0, atol=1e-11)


@pytest.mark.parametrize("kind", ["prismatic", "revolute"])
def test_files_batches_and_compiled_plants(kind, tmp_path):
    model = one_mass(kind)
    for suffix in ("yaml", "json"):
        assert mv.load(mv.save(model, tmp_path / f"model.{suffix}")).springs == model.springs
    names = list(SLOPES)
    values = {name: [model.parameters[name], 1.01 * model.parameters[name]] for name in names}
    batch, plant = model.linearize(values=values), model.compile(parameters=names)
    for row in (0, 1):
        system = model.with_values({name: pair[row] for name, pair in values.items()}).linearize()
        compiled = plant([values[name][row] for name in plant.names])
        for key in ("M", "C", "K", "B", "Cq", "Cv"):
            np.testing.assert_allclose(getattr(batch[row], key), getattr(system, key), rtol=1e-12, atol=1e-9)
            np.testing.assert_allclose(getattr(compiled, key), getattr(system, key), rtol=1e-12, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["prismatic", "revolute"])
def test_runs_follow_the_linear_model_and_take_the_energy_that_is_given(kind):
    model = one_mass(kind)
    direction = "z" if kind == "prismatic" else "rz"
    model.add_output("v", "b", direction, quantity="velocity")
    t = np.linspace(0.0, 0.3, 2401)
    force = 0.1 * np.sin(50.0 * t) ** 2
    run = model.simulate(t, {"F": force}, tolerance=1e-10)
    linear = model.linearize().time_response(t, force[None], hold="first")
    for name, row in zip(("x", "f"), linear, strict=False):
        np.testing.assert_allclose(run[name], row, rtol=0.0, atol=2e-4 * np.abs(row).max())
    power = force * run["v"]
    given = np.concatenate(([0.0], np.cumsum(0.5 * np.diff(t) * (power[1:] + power[:-1]))))
    np.testing.assert_allclose(run.energy.total + run.energy.dissipated, given, rtol=0.0, atol=1e-4 * given.max())
    assert run.energy.dissipated[-1] > 0.01 * given.max()


def leg(factor, **words):
    """A mass that hangs by two oblique springs in a plane, the left one with a factor."""
    model = mv.Model("leg", gravity=(0, 0, -9.81))
    model.add_body("b", M, (0.02, 0.02, 0.02), position=(0, 0, -1))
    model.add_joint("j", None, "ground", "b", position=(0, 0, -1), free=("x", "z"))
    model.add_spring("left", "ground", "b", (-0.5, 0, 0), (0, 0, -1), dynamic=factor, **words)
    model.add_spring("right", "ground", "b", (0.7, 0, 0), (0, 0, -1), 3e2, 0.5, preload=10.0)
    model.add_input("F", "b", "x")
    model.add_output("x", "b", "x")
    return model


@pytest.mark.parametrize("words", [{"preload": 12.0}, {"free_length": 1.05}])
def test_at_rest_it_is_its_spring(words):
    """Equilibria and static compliance are those of the stiffness at rest; a free length scales with it."""
    factor = mv.Dynamic.of_words({"static": 0.8, "weights": [0.7], "times": [0.02]})
    there = leg(factor, stiffness=4e2, damping=0.3, **words).equilibrium()
    plain = leg(None, stiffness=0.8 * 4e2, damping=0.3, **words).equilibrium()
    np.testing.assert_allclose(there.bodies["b"].position, plain.bodies["b"].position, rtol=1e-10, atol=1e-12)
    one, other = (model.linearize().frequency_response([0.0, 30.0])[0, 0] for model in (there, plain))
    assert one[0] == pytest.approx(other[0], rel=1e-8)
    assert abs(one[1] / other[1] - 1.0) > 0.01


def held(words, stiffness, damping):
    """A body on a ball joint with a torsion spring, turned about and across its axis, with what balances its moment."""
    turn = {"j.rx": 0.3, "j.rz": 0.2}
    model = mv.Model("ball")
    model.add_body("b", M, (0.3, 0.4, 0.5))
    model.add_joint("j", "spherical", "ground", "b", position=(0, 0, 0))
    model.add_torsion_spring("k", "ground", "b", (0, 0, 1), stiffness, damping, **words)
    model.add_bushing("hold", "ground", "b", (0, 0, 0), (0, 0, 0, 10, 20, 30))
    model.add_input("T", "b", "rx")
    model.add_output("x", "b", "rx")
    there = model.moved(turn, relaxed=False)
    there.add_load("balance", "b", torque=-sum(np.array(spring.rest_wrench[3:]) for spring in there.springs.values()))
    return there


def test_turned_about_its_axis_it_stays_and_across_it_becomes_a_bushing():
    """Swing and twist: about the axis only the moment grows by static k phi; across it, it is a bushing."""
    model = one_mass("revolute")
    k = model.moved({"j.rz": 0.2}, relaxed=False).springs["k"]
    assert (k.stiffness, k.damping, k.dynamic) == (K, C, FACTOR)
    assert k.preload == pytest.approx(-0.2 * 0.9 * K, rel=1e-12)
    there = held({"dynamic": FACTOR}, K, C)
    assert isinstance(there.springs["k"], DynamicBushing)
    # what is without relaxations at rest, and the stiffness that relaxes as damping of the same numbers does
    found = there.linearize().frequency_response(OMEGA)[0, 0]
    acting, system = (held({}, 0.9 * K, c).linearize() for c in (K, C + 1e-4 * K))
    for k, s in enumerate(S):
        extra = (0.8 * 0.02 * s / (1 + 0.02 * s) + 0.3 * 1e-3 * s / (1 + 1e-3 * s)) * acting.C
        q = np.linalg.solve(system.M * s**2 + system.C * s + system.K + extra, system.B)
        np.testing.assert_allclose(found[k], (system.Cq @ q)[0, 0], rtol=1e-9)


def test_copies_turn_along():
    whole = mv.Model("whole")
    whole.add_model("left", one_mass("prismatic"), position=(1, 2, 3), orientation=(0.3, -0.2, 0.5))
    whole.add_model("right", one_mass("revolute"), mirror="y")
    found = whole.linearize().frequency_response(OMEGA)
    np.testing.assert_allclose(found[0, 0], X, rtol=1e-10)
    np.testing.assert_allclose(found[2, 1], X, rtol=1e-10)


def test_without_a_part_at_rest_it_is_a_maxwell_element():
    factor = mv.Dynamic.transfer([0.02, 0.0], [0.02, 1.0])
    for kind in ("prismatic", "revolute"):
        model = one_mass(kind, factor=factor)
        found = model.linearize().frequency_response(OMEGA)[0, 0]
        z = K * 0.02 * S / (1 + 0.02 * S) + S * C
        np.testing.assert_allclose(found, 1.0 / (z - M * OMEGA**2), rtol=1e-9)


@pytest.mark.parametrize("kind", ["prismatic", "revolute"])
def test_a_relaxation_of_no_weight_has_no_state(kind):
    model = one_mass(kind, factor=mv.Dynamic.prony([0.8, 0.0], [0.02, 1e-3]))
    found = model.linearize()
    assert found.dof == 2
    z = K * (1 + 0.8 * 0.02 * S / (1 + 0.02 * S)) + C * S
    np.testing.assert_allclose(found.frequency_response(OMEGA)[0, 0], 1.0 / (z - M * OMEGA**2), rtol=1e-11)
    assert model.parameters["k.g2"] == 0.0


@pytest.mark.parametrize(("words", "text"), [
    ({"dynamic": mv.Dynamic.hysteretic(0.1)}, "dynamic = .*loss factor 0.1.*no states.*rational"),
    ({"dynamic": 0.1}, "dynamic = 0.1; expected an mv.Dynamic"),
    ({"dynamic": FACTOR, "stiffness": -K}, "stiffness = -6000 .*above 0"),
    ({"dynamic": FACTOR, "stiffness": 0.0, "damping": 1.0}, "stiffness = 0 .*above 0"),
    ({"dynamic": {"weights": [1.0], "times": [1.0], "statc": 1.0}}, "'statc' is not a word of it.*static"),
])  # fmt: skip
def test_what_no_spring_is_is_refused(words, text):
    model = mv.Model("m")
    model.add_body("b", 1.0, (1, 1, 1))
    words = {"stiffness": K} | words
    with pytest.raises(ModelError, match=f"(?s){text}"):
        model.add_spring("k", "ground", "b", (0, 0, -1), (0, 0, 0), **words)
    with pytest.raises(ModelError, match=f"(?s){text}"):
        model.add_torsion_spring("k", "ground", "b", (0, 0, 1), **words)


@pytest.mark.parametrize("kind", ["prismatic", "revolute"])
def test_a_force_that_is_late_drives_its_mass(kind, tmp_path):
    """Poles of m s^2 + c s + k (1 - s T / 2) / (1 + s T / 2), near those of m s^2 + c s + k e^(-s T)."""
    late = 5e-4
    model = one_mass(kind, factor=mv.Dynamic.delay(late).rational((1.0, 20.0)))
    found = model.linearize().modes().eigenvalues
    expected = np.roots(np.polyadd(np.polymul([M, C, 0.0], [late / 2, 1.0]), K * np.array([-late / 2, 1.0])))
    np.testing.assert_allclose(np.sort_complex(found), np.sort_complex(expected), rtol=1e-10)
    s = found[found.imag > 0.0][0]
    for _ in range(4):
        s -= (M * s**2 + C * s + K * np.exp(-s * late)) / (2 * M * s + C - K * late * np.exp(-s * late))
    assert s.real > 0.0  # k T > c
    np.testing.assert_allclose(found[found.imag > 0.0], s, rtol=1e-5)
    mv.save(model, tmp_path / "late.yaml")
    again = mv.load(tmp_path / "late.yaml")
    np.testing.assert_array_equal(again.linearize().modes().eigenvalues, found)
    longer = again.with_values({"k.tau1": late}).linearize().modes().eigenvalues
    assert longer.real.max() > 1.5 * found.real.max()


@pytest.mark.parametrize("method", ["dense", "sparse"])
@pytest.mark.parametrize("damping", [0.0, 20.0])
def test_a_late_force_may_cancel_a_spring_at_once(method, damping):
    """K (1 - s T / 2) / (1 + s T / 2) is -K at once: beside a spring K the mass has no stiffness by itself alone."""
    late, model = 5e-4, mv.Model("late")
    model.add_body("b", M, (M, M, M))
    model.add_joint("j", "prismatic", "ground", "b", axis=(0, 0, 1))
    ends = "ground", "b", (0, 0, -1), (0, 0, 0), K
    model.add_spring("late", *ends, dynamic=mv.Dynamic.delay(late).rational((1.0, 20.0)))
    model.add_spring("k", *ends, damping)
    model.add_input("F", "b", "z")
    model.add_output("x", "b", "z")
    system = model.linearize(method=method)
    num, den = K * np.array([-late / 2, 1.0]), [late / 2, 1.0]
    expected = np.polyadd(np.polymul([M, damping, K], den), num)
    found = (system.modes() if method == "dense" else system.modes(2)).eigenvalues
    np.testing.assert_allclose(np.sort_complex(found), np.sort_complex(np.roots(expected)), rtol=1e-12)
    np.testing.assert_allclose(system.frequency_response(OMEGA)[0, 0],
                               np.polyval(den, 1j * OMEGA) / np.polyval(expected, 1j * OMEGA), rtol=1e-11)  # fmt: skip
