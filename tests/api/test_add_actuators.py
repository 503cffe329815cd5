"""Voice coils and piezo stacks: the closed forms of their circuits on a mass, and of the circuits alone."""

import mpmath
import numpy as np
import pytest

import mbsvib as mv
from mbsvib.errors import ModelError

M, K0, C0 = 0.4, 900.0, 0.7
OMEGA = 2 * np.pi * np.geomspace(0.3, 3000.0, 60)
S = 1j * OMEGA
COIL = {"constant": 12.0, "resistance": 3.5, "inductance": 1.2e-3}
STACK = {"stiffness": 2e7, "constant": 4.5, "capacitance": 4.4e-6}
RAIL = M * S**2 + C0 * S + K0


def on_a_rail(call, swap=False, **words):
    """A mass on a spring along z with an actuator beside it, whose elongation is its displacement."""
    model = mv.Model("rail")
    model.add_body("b", M, (1, 1, 1), position=(0, 0, 0.2))
    model.add_joint("j", "prismatic", "ground", "b", axis=(0, 0, 1))
    model.add_spring("k", "ground", "b", (0, 0, 0), (0, 0, 0.2), K0, C0)
    ends = ("b", "ground", (0, 0, 0.2), (0, 0, 0)) if swap else ("ground", "b", (0, 0, 0), (0, 0, 0.2))
    names = getattr(model, f"add_{call}")("a", *ends, **words)
    model.add_input("F", "b", "z")
    model.add_output("x", "b", "z")
    return model, names


def of_coil(T, R, L):
    """Displacement per voltage and per force: the circuit (R + L s) i = u - T s x solved at 40 digits."""
    rows = []
    with mpmath.workdps(40):
        for w in OMEGA:
            s = mpmath.mpc(0, w)
            matrix = mpmath.matrix([[M * s**2 + C0 * s + K0, -T], [T * s, R + L * s]])
            rows.append([complex(mpmath.lu_solve(matrix, mpmath.matrix(right))[0]) for right in ([0, 1], [1, 0])])
    return np.array(rows).T


def of_stack(stiffness, constant, capacitance, resistance=0.0, drive="voltage"):
    """Displacement per input and per force: F = T u - k x, Q = T x + C_b u, and the input u + R Q' or Q."""
    rows, k, T = [], stiffness, constant
    with mpmath.workdps(40):
        blocked = mpmath.mpf(capacitance) - mpmath.mpf(T) ** 2 / k
        for w in OMEGA:
            s = mpmath.mpc(0, w)
            last = [T, blocked] if drive == "charge" else [resistance * s * T, 1 + resistance * s * blocked]
            matrix = mpmath.matrix([[M * s**2 + C0 * s + K0 + k, -T], last])
            rows.append([complex(mpmath.lu_solve(matrix, mpmath.matrix(right))[0]) for right in ([0, 1], [1, 0])])
    return np.array(rows).T


def same(found, expected, rtol=1e-11):
    np.testing.assert_allclose(found / np.abs(expected), expected / np.abs(expected), rtol=0.0, atol=rtol)


@pytest.mark.few(2)
@pytest.mark.parametrize("method", ["dense", "sparse"])
@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("inductance", [0.0, 1.2e-3])
def test_a_voice_coil_on_a_voltage(inductance, swap, method):
    model, names = on_a_rail("voice_coil", swap, **COIL | {"inductance": inductance})
    assert names[0] == "a.voltage"
    system = model.linearize(method=method)
    same(system.frequency_response(OMEGA)[0], of_coil(12.0, 3.5, inductance))
    assert model.inputs["a.voltage"].unit == "V"


def test_the_electric_pole_and_the_current():
    model, _ = on_a_rail("voice_coil", **COIL)
    model.add_force_output("f", "a.inductance")
    system = model.linearize()
    x = of_coil(12.0, 3.5, 1.2e-3)[0]
    current = (1.0 - 12.0 * S * x) / (3.5 + 1.2e-3 * S)
    same(system.frequency_response(OMEGA)[1, 0] / -12.0, current, 1e-9)
    with mpmath.workdps(40):
        cubic = [K0 * 3.5, C0 * 3.5 + K0 * 1.2e-3 + 12.0**2, M * 3.5 + C0 * 1.2e-3, M * 1.2e-3]
        roots = np.array([complex(root) for root in mpmath.polyroots(cubic, maxsteps=200, asc=True)])
    np.testing.assert_allclose(np.sort_complex(system.modes().eigenvalues), np.sort_complex(roots), rtol=1e-12)


def test_a_voice_coil_on_a_current_pushes_apart():
    for swap in (False, True):
        model, names = on_a_rail("voice_coil", swap, constant=12.0)
        assert (names, model.inputs["a.current"].unit) == (("a.current",), "A")
        same(model.linearize().frequency_response(OMEGA)[0, 0], 12.0 / RAIL)


@pytest.mark.few(2)
@pytest.mark.parametrize("method", ["dense", "sparse"])
@pytest.mark.parametrize("words", [{}, {"resistance": 200.0}, {"drive": "charge"}])
def test_a_piezo_stack(words, method):
    model, names = on_a_rail("piezo_stack", **STACK, **words)
    assert (names[0], model.inputs[names[0]].unit) == (("a.charge", "C") if "drive" in words else ("a.voltage", "V"))
    same(model.linearize(method=method).frequency_response(OMEGA)[0], of_stack(**STACK, **words), 1e-9)


def test_open_electrodes_are_stiffer_by_the_coupling():
    share = 4.5**2 / (2e7 * 4.4e-6)
    model, _ = on_a_rail("piezo_stack", **STACK, drive="charge")
    assert model.springs["a.spring"].stiffness == pytest.approx(2e7 / (1.0 - share), rel=1e-14)


@pytest.mark.few(2)
@pytest.mark.parametrize(("call", "words"), [
    ("voice_coil", COIL), ("voice_coil", COIL | {"inductance": 0.0}), ("voice_coil", {"constant": 12.0}),
    ("piezo_stack", STACK | {"resistance": 200.0}), ("piezo_stack", STACK | {"drive": "charge"}),
])  # fmt: skip
def test_every_engine(call, words, tmp_path):
    model, _ = on_a_rail(call, **words)
    system = model.linearize()
    expected = system.frequency_response(OMEGA)
    again = mv.load(mv.save(model, tmp_path / "model.yaml"))
    assert (again.springs, again.inputs) == (model.springs, model.inputs)
    same(again.linearize().frequency_response(OMEGA), expected)
    values = {"b.mass": [M, 1.1 * M]}
    batch = model.linearize(values=values)
    same(batch.frequency_response(OMEGA)[0], expected)
    heavier = model.with_values({"b.mass": 1.1 * M}).linearize()
    same(batch.frequency_response(OMEGA)[1], heavier.frequency_response(OMEGA))
    plant = model.compile(parameters=["b.mass"])
    np.testing.assert_allclose(plant([M]).K, system.K, rtol=1e-12)
    slope = system.frequency_response_sensitivities(OMEGA, ["b.mass"])[0]
    same(slope[0], -(S**2) * expected[0, 1] * expected[0], 1e-8)
    whole = mv.Model("whole")
    whole.add_model("copy", model, position=(1, 2, 3), orientation=(0.3, 0.2, 0.1))
    same(whole.linearize().frequency_response(OMEGA), expected, 1e-9)
    assert whole.linearize().input_units == system.input_units


def test_words_of_files(tmp_path):
    path = tmp_path / "model.yaml"
    path.write_text("""
mbsvib: 1
name: rail
bodies: {b: {mass: 0.4, inertia: [1, 1, 1], position: [0, 0, 0.2]}}
joints: {j: {kind: prismatic, first: ground, second: b, axis: [0, 0, 1]}}
drives:
  a: {type: voice_coil, first: ground, second: b, start: [0, 0, 0], end: [0, 0, 0.2], constant: 12, resistance: 3.5}
  p: {type: piezo_stack, first: ground, second: b, start: [0, 0, 0], end: [0, 0, 0.2], stiffness: 2.0e+7, constant: 4.5}
inputs: {F: {body: b, direction: z, per: kN}}
""")
    model = mv.load(path)
    assert [part.unit for part in model.inputs.values()] == ["V", "V", "kN"]


@pytest.mark.parametrize(("call", "words", "text"), [
    ("voice_coil", {"constant": 0.0, "resistance": 1.0}, "'a': constant = 0.0.*not zero"),
    ("voice_coil", COIL | {"resistance": 0.0}, "'a': resistance = 0.0.*above 0"),
    ("voice_coil", {"constant": 1.0, "inductance": 1e-3}, "'a': inductance = 0.001.*a resistance with it"),
    ("voice_coil", COIL | {"inductance": -1.0}, "'a': inductance = -1.0.*0 or more"),
    ("piezo_stack", STACK | {"capacitance": 1e-6}, "'a': capacitance = 1e-06.*above constant.*1.013e-06"),
    ("piezo_stack", STACK | {"capacitance": None, "drive": "charge"}, "'a': capacitance = None"),
    ("piezo_stack", STACK | {"drive": "current"}, "'a': drive = 'current'.*'voltage' or 'charge'"),
    ("piezo_stack", STACK | {"drive": np.eye(2)}, "'a': drive = .*'voltage' or 'charge'"),
    ("piezo_stack", STACK | {"drive": "charge", "resistance": 1.0}, "'a': resistance = 1.0"),
    ("piezo_stack", STACK | {"stiffness": 0.0}, "'a': stiffness = 0.0"),
])  # fmt: skip
def test_what_is_none_is_refused_before_anything_is_added(call, words, text):
    model, _ = on_a_rail("voice_coil", constant=1.0)
    parts = dict(model.springs), dict(model.inputs), dict(model.bodies)
    with pytest.raises(ModelError, match=f"(?s){text}"):
        getattr(model, f"add_{call}")("a", "ground", "b", (0, 0, 0), (0, 0, 0.2), **words)
    assert parts == (dict(model.springs), dict(model.inputs), dict(model.bodies))
    with pytest.raises(ModelError, match=r"per = ''.*unit"):
        model.add_input("G", "b", "z", per="")
