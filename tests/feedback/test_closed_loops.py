"""Closed loops of any system against 40 digits, closed forms and python-control."""

from dataclasses import replace

import control
import numpy as np
import pytest
import scipy.io as scipy_io

import mbsvib as mv
import mbsvib_export as mx
from mbsvib import isolation, library, plots, studies
from tests.isolation.scenes import two_masses
from tests.support import closed_loops as reference


def chain():
    return replace(library.chain(6, line=(0, 1, 0)).linearize(), name="chain")


def slider(stiffness=0.0, damping=0.0):
    model = mv.Model("slider")
    model.add_body("mass", 2.0, (1, 1, 1))
    model.add_joint("rail", "prismatic", "ground", "mass", axis=(1, 0, 0))
    if stiffness or damping:
        model.add_spring("k", "ground", "mass", start=(-1, 0, 0), end=(0, 0, 0), stiffness=stiffness, damping=damping)
    model.add_input("F", "mass", "x")
    model.add_input("disturbance", "mass", "x")
    for name, quantity in (("x", "displacement"), ("v", "velocity"), ("a", "acceleration")):
        model.add_output(name, "mass", "x", quantity=quantity)
    return model.linearize()


def test_modes_that_nothing_damps_have_no_damping_in_tables():
    """Rounding was shown as a damping ratio of -1e-14 %, which reads as unstable."""
    model = mv.Model("stage")
    model.add_body("table", 2.0, (0.004, 0.004, 0.007))
    model.add_bushing("flexures", "ground", "table", position=(0.01, 0, -0.03),
                      stiffness=(800.0, 3e6, 5e6, 3e3, 4e3, 1e4), damping=(1.0, 0, 0, 0, 0, 0))  # fmt: skip
    model.add_input("coil", "table", "x")
    model.add_output("v", "table", "x", quantity="velocity")
    system = model.linearize()
    loop = system.feedback([[-16.0]], "v", "coil")
    assert loop.stable
    for table in (system.modes().table(), loop.table()):
        column = [head for head, _ in table["columns"]].index("damping ratio [%]")
        ratios = np.array([float(row[column]) for row in table["rows"]])
        assert ratios.max() > 0.1
        assert (ratios[ratios < 1e-9] == 0.0).all()
        assert (ratios == 0.0).any()


def test_real_poles_that_grow_are_in_the_table():
    """m s^2 + k - g = 0 with g > k: only the vibrating modes were."""
    table = slider(400.0, 0.0).feedback([[900.0]], "x", "F").table()
    (row,) = table["rows"]
    assert row[2] == "-100"
    assert float(row[1]) == pytest.approx(np.sqrt(500.0 / 2.0) / (2.0 * np.pi), rel=1e-4)
    assert table["notes"][0].startswith("Unstable: mode 1 ")


def test_real_poles_that_decay_are_counted_below_the_table():
    """Overdamped modes were in no row, and nothing told of them: 2 s^2 + 50 s + 200 has the poles -5 and -20."""
    assert slider(200.0, 0.0).feedback([[-50.0]], "v", "F").table()["notes"] == [
        "Not listed: 2 real poles; the slowest is at -5 1/s (mode 1 (1.592 Hz, mass x))."]
    assert not slider(200.0, 0.0).feedback([[-1.0]], "v", "F").table()["notes"]


def test_growth_beyond_all_numbers_is_refused():
    """NaN with warnings of numpy were returned: exp(10 t) after 100 s."""
    loop = slider(0.0, 0.0).feedback([[200.0]], "x", "F")["x", "F"]
    for system in (loop, loop.state_space(), loop.sampled(1000.0)):
        with pytest.raises(mv.ResponseError, match=r"'slider.*' is unstable and grows beyond all numbers before t = "):
            system.time_response(np.linspace(0.0, 100.0, 101), np.ones(101))
    np.testing.assert_allclose(loop.time_response([0.0, 1.0], [1.0, 1.0])[0, 1], (np.cosh(10.0) - 1.0) / 200.0)


def test_no_upper_limit_where_the_loop_gain_vanishes():
    """A modulus of 1 but for rounding gave a gain margin of 1e15 in place of infinity."""
    for gain in (-3.0, -0.3, -30.0):
        margins = slider(400.0, 1.0).feedback([[gain]], "v", "F").margins()
        assert margins.modulus == pytest.approx(1.0, abs=1e-9)
        assert margins.all_gains == (pytest.approx(0.5, abs=1e-9), np.inf)


PI = control.ss([[0.0]], [[1.0]], [[-1e2]], [[-1e3]])
LAWS = {
    "static gain": ([[-1e2]], ["x"], ["Fx"]),
    "high gain": ([[-1e9]], ["x"], ["Fx"]),
    "gain from another output": ([[-3.0, 2.0]], ["x", "rz"], ["Fx"]),
    "integrator": (PI, ["x"], ["Fx"]),
    "filter": (control.ss([[-50.0, -900.0], [1.0, 0.0]], [[1.0], [0.0]], [[0.0, -4e5]], [[0.0]]), "x", "Fx"),
}


def matched(values, exact):
    """The largest relative distance of exact values to the nearest of others."""
    return max(np.abs(values - value).min() / abs(value) for value in exact)


@pytest.mark.few(1)
@pytest.mark.parametrize("name", LAWS)
def test_poles_and_responses_in_40_digits(name):
    law, sensors, actuators = LAWS[name]
    system = chain()
    loop = system.feedback(law, sensors, actuators)
    exact = np.array([complex(value) for value in reference.poles(system, loop.law, loop.sensors, loop.actuators)])
    assert len(loop.poles()) == len(exact)
    assert matched(loop.poles(), exact) < (1e-14 if loop.second_order is not None else 2e-10)
    w = np.abs(exact.imag[exact.imag > 0.0])[:4] * [1.0, 1.01, 0.3, 3.0]
    truth = np.array([[[complex(v) for v in row] for row in
                       reference.response(system, loop.law, loop.sensors, loop.actuators, x)] for x in w])  # fmt: skip
    for response in (loop.response(w), loop.state_space().frequency_response(w)):
        error = np.abs(response.transpose(2, 0, 1) - truth).max(axis=(1, 2)) / np.abs(truth).max(axis=(1, 2))
        assert error.max() < 1e-11


def test_static_gains_keep_the_second_order():
    """A spring and a damper by feedback are a spring and a damper."""
    loop = slider(300.0, 3.0).feedback([[-500.0, -4.0]], ["x", "v"], ["F"])
    same = slider(800.0, 7.0)
    second = loop.second_order
    np.testing.assert_allclose(second.K, same.K, rtol=1e-15)
    np.testing.assert_allclose(second.C, same.C, rtol=1e-15)
    assert len(second.row_owner) == len(second.elastic_rows) == len(second.row_stiffness) == len(second.row_damping)
    np.testing.assert_allclose(loop.poles(), same.poles(), rtol=1e-14)
    modes = loop.modes()
    np.testing.assert_allclose(modes.natural, same.modes().natural, rtol=1e-14)
    np.testing.assert_allclose(np.abs(modes.shapes), np.abs(same.modes().shapes), rtol=1e-14)
    w, t = np.array([0.0, 3.0, 20.0]), np.linspace(0.0, 1.0, 21)
    np.testing.assert_allclose(loop.frequency_response(w), same.frequency_response(w), rtol=1e-13)
    u = np.ones((2, 21))
    np.testing.assert_allclose(loop.time_response(t, u), same.time_response(t, u), rtol=1e-12, atol=1e-15)
    assert loop.h2_norm("x", "F").value == pytest.approx(same.h2_norm("x", "F").value, rel=1e-12)
    assert loop.hinf_norm("x", "F").value == pytest.approx(same.hinf_norm("x", "F").value, rel=1e-12)
    assert "a controller acts on it" in second.explain()
    with pytest.raises(mv.ModelError, match=r"a controller acts on .*open_loop"):
        second.eigenvalue_sensitivities()
    assert second.hinf_norm("x", "F").slopes.size == 0


def test_outputs_that_feel_the_actuator_in_both_forms():
    """Tensions of legs hold the forces of the controllers: as rows of positions and velocities, and as states."""
    p = isolation.actuated(two_masses(), "payload", directions="z")
    law = isolation.controller([[-300.0, -4e3], [70.0, -90.0]], ["lower.rate", "upper.stroke"],
                               ["lower.actuator", "upper.actuator"])  # fmt: skip
    loop, w = p.system.feedback(law), np.array([0.5, 30.0, 200.0])
    first, second = loop.state_space().frequency_response(w), loop.second_order.frequency_response(w)
    np.testing.assert_allclose(second, first, rtol=1e-9, atol=1e-12 * np.abs(first).max())
    tension = loop.outputs.index("lower.force"), loop.inputs.index("base.z")
    np.testing.assert_allclose(second[tension], first[tension], rtol=1e-9)


def test_gains_without_symmetry_are_circulatory():
    system = chain()
    second = system.feedback([[-2e3, 0.0], [3e2, -1e3]], ["x", "rz"], ["Fx", "Mz"]).second_order
    assert second.circulatory is not None
    change = system.B @ np.array([[2e3, 0.0], [-3e2, 1e3]]) @ system.Cq
    np.testing.assert_allclose(second.K - system.K, change, rtol=1e-9, atol=1e-9)
    rows = second.elastic_rows
    restored = rows.T @ (second.row_stiffness[:, None] * rows) + second.circulatory
    np.testing.assert_allclose(restored, second.K, rtol=1e-12, atol=1e-9)


def test_a_free_mass_is_held_by_its_servo():
    """At 0 rad/s the open loop has a pole, the closed one the stiffness of its controller."""
    law = control.tf2ss([30.0, 800.0], [1e-3, 1.0]) * -1.0
    loop = slider().feedback(law, "x", "F")
    assert loop.second_order is None
    assert loop.frequency_response([0.0], "x", "disturbance")[0, 0, 0] == pytest.approx(1.0 / 800.0, rel=1e-12)
    t = np.linspace(0.0, 20.0, 4001)
    y = loop.time_response(t, np.ones(len(t)), outputs="x", inputs="disturbance")
    assert y[0, -1] == pytest.approx(1.0 / 800.0, rel=1e-6)


def test_accelerations_change_the_mass():
    """m + g moves, and the gain at infinity is 1 / (m + g)."""
    loop = slider(200.0, 1.0).feedback([[-3.0]], "a", "F")
    assert loop.second_order.M == 5.0
    assert "without effect" not in str(loop.second_order.explain())
    exact = np.roots([5.0, 1.0, 200.0])
    assert matched(loop.poles(), exact) < 1e-15
    assert loop.state_space()["a", "disturbance"].D[0, 0] == pytest.approx(1.0 / 5.0, rel=1e-14)
    with pytest.raises(mv.ResponseError, match="algebraic loop"):
        slider(200.0).feedback([[2.0]], "a", "F").poles()
    # of 2 kg nearly all cancels: what is left, exact in binary, is told from rounding down to 1e-12
    light = slider(200.0).feedback([[2.0 - 2.0**-31]], "a", "F")
    np.testing.assert_allclose(np.abs(light.poles()), np.sqrt(200.0 * 2.0**31), rtol=1e-5)
    with pytest.raises(mv.ResponseError, match="algebraic loop"):
        slider(200.0).feedback([[2.0 - 2.0**-41]], "a", "F").poles()


@pytest.mark.parametrize("gain", [1.0, 1e6, 1e9])
def test_large_gains_from_accelerations_keep_the_digits_of_all_poles(gain):
    """M' = M + g b b^T with b = Q e1, M = Q diag(2, 5) Q^T and K = Q [[3, 1], [1, 4]] Q^T: the eigenvalues of
    [[3, 1], [1, 4]] - w^2 diag(2 + g, 5), of which 6e-8 was lost under a gain of 1e9.
    """
    q = np.array([[0.6, -0.8], [0.8, 0.6]])
    stiffness = q @ [[3.0, 1.0], [1.0, 4.0]] @ q.T
    plant = mv.System.from_matrices(q @ np.diag([2.0, 5.0]) @ q.T, None, stiffness, q[:, :1], Ca=q[:, :1].T)
    loop = plant.feedback([[-gain]], plant.outputs, plant.inputs)
    m, p, r = 2.0 + gain, 15.0 + 4.0 * (2.0 + gain), 11.0  # 5 m s^4 + (3 * 5 + 4 m) s^2 + 3 * 4 - 1
    high = (p + np.sqrt(p * p - 20.0 * m * r)) / (10.0 * m)
    expected = np.sqrt([r / (5.0 * m * high), r / (5.0 * m * high), high, high])
    np.testing.assert_allclose(np.abs(loop.poles()), expected, rtol=1e-14)


def test_accelerations_that_do_more_than_add_mass_keep_the_states():
    """A force on the first of two masses by the acceleration of the other: M' is not symmetric."""
    plant = mv.System.from_matrices(np.diag([2.0, 5.0]), None, [[3.0, -1.0], [-1.0, 4.0]], [[1.0], [0.0]], Ca=[[0, 1]])
    for gain, entry in ((-1.0, 1.0), (1.0, -1.0)):
        loop = plant.feedback([[gain]], plant.outputs, plant.inputs)
        assert loop.second_order is None
        poly = np.roots([10.0, 0.0, 8.0 + 15.0 + entry, 0.0, 11.0])
        assert matched(loop.poles(), poly) < 1e-13


def test_python_control_closes_the_same_loop():
    system = chain()
    loop = system.feedback(PI, "x", "Fx")
    plant = mx.to_control(system, outputs="x", inputs="Fx")
    theirs = control.feedback(plant, PI, sign=1)
    w = np.geomspace(1.0, 1e3, 50)
    np.testing.assert_allclose(loop.frequency_response(w, "x", "Fx")[0, 0], theirs(1j * w), rtol=1e-9)
    np.testing.assert_allclose(mx.to_control(loop)["x", "Fx"](1j * w), theirs(1j * w), rtol=1e-9)


def test_transfer_functions_of_python_control_are_controllers():
    plant = slider(800.0, 4.0)
    law = control.tf([-30.0, -600.0], [1e-3, 1.0])
    loop, same = (plant.feedback(each, "x", "F") for each in (law, control.ss(law)))
    exact = np.roots(np.polysub(np.polymul([2.0, 4.0, 800.0], law.den[0][0]), law.num[0][0]))
    assert matched(loop.poles(), exact) < 1e-12
    assert loop.name == same.name == "slider with controller"
    named = control.tf([-30.0, -600.0], [1e-3, 1.0], inputs=["x"], outputs=["F"], name="lead")
    assert plant.feedback(named).name == "slider with lead"


@pytest.mark.parametrize(("law", "message"), [
    (control.tf([1, 0], [1]), "numerator has degree 1"),
    (control.frd([1, 2], [1, 2]), "it is a FrequencyResponseData"), ("gain", "it is a str"),
])  # fmt: skip
def test_controllers_that_have_no_equations(law, message):
    with pytest.raises(mv.ResponseError, match=message):
        slider(800.0).feedback(law, "x", "F")


def test_loops_around_loops_and_state_spaces():
    system = chain()
    inner = system.feedback([[-1e2]], "x", "Fx", name="inner")
    both = inner.feedback(PI, "x", "Fx", name="outer")
    together = system.feedback(control.ss([[0.0]], [[1.0]], [[-1e2]], [[-1.1e3]]), "x", "Fx")
    w = np.geomspace(1.0, 1e3, 20)
    np.testing.assert_allclose(both.frequency_response(w), together.frequency_response(w), rtol=1e-9, atol=1e-20)
    assert both.name == "chain with inner + outer"
    two = slider(800.0, 4.0).feedback([[-3.0]], "v", "F").feedback([[-50.0]], "x", "disturbance")
    assert (two.sensors, two.actuators) == (("v", "x"), ("F", "disturbance"))
    space = system.state_space("modal").feedback(PI, "x", "Fx")
    np.testing.assert_allclose(space.frequency_response(w, "x", "Fx"),
                               system.feedback(PI, "x", "Fx").frequency_response(w, "x", "Fx"), rtol=1e-9)  # fmt: skip
    for gain in ("loop_gain", "sensitivity"):
        np.testing.assert_allclose(getattr(space, gain)(w), getattr(system.feedback(PI, "x", "Fx"), gain)(w), rtol=1e-9)
    assert {*space.sources} == {"plant", "controller"}


def test_selection_keeps_the_loop_closed():
    loop = chain().feedback(PI, "x", "Fx")
    part, w = loop["rz", "Mz"], [3.0, 40.0]
    assert (part.outputs, part.inputs, part.output_units, part.input_units) == (("rz",), ("Mz",), ("rad",), ("N m",))
    np.testing.assert_array_equal(part.poles(), loop.poles())
    np.testing.assert_allclose(part.frequency_response(w), loop.frequency_response(w)[1:, 1:], rtol=1e-12)
    space = part.state_space()
    assert (space.outputs, space.inputs) == (("rz",), ("Mz",))
    np.testing.assert_allclose(part.transmission_zeros(), loop.transmission_zeros("rz", "Mz"))
    assert part.frequency_grid().size < loop.frequency_grid().size


def test_loop_gain_sensitivity_and_margins():
    """An integrator at a mass on a spring: L = g / s / (m s^2 + c s + k)."""
    loop = slider(200.0, 4.0).feedback(control.ss([[0.0]], [[1.0]], [[-100.0]], [[0.0]]), "x", "F")
    w = np.array([0.5, 3.0, 30.0])
    exact = 100.0 / (1j * w * (200.0 - 2.0 * w**2 + 4j * w))
    np.testing.assert_allclose(loop.loop_gain(w)[0, 0], exact, rtol=1e-12)
    np.testing.assert_allclose(loop.sensitivity(w)[0, 0], 1.0 / (1.0 + exact), rtol=1e-12)
    assert loop.margins().gain[0] == pytest.approx(4.0 * 200.0 / (2.0 * 100.0), rel=1e-9)  # c k / (m g)
    assert loop.sampled(1e4).margins().gain[0] == pytest.approx(4.0, rel=1e-2)


@pytest.mark.parametrize("rate", [1e6, 1e9, 1e12])
def test_sampling_that_is_fast_keeps_all_digits(rate):
    """The sampled loop differs from the continuous one by its delay of half a period, not by rounding of 1 + A dt."""
    loop, w = slider(800.0, 4.0).feedback([[-30.0, -2.0]], ["v", "x"], "F"), np.array([0.5, 20.0, 300.0])
    np.testing.assert_allclose(loop.sampled(rate).frequency_response(w), loop.frequency_response(w), rtol=10.0 / rate)


def test_norms_against_lyapunov_of_python_control():
    loop = chain().feedback(PI, "x", "Fx")["x", "Fx"]
    space = mx.to_control(loop)
    assert loop.h2_norm().value == pytest.approx(control.norm(space, 2), rel=1e-8)
    w = loop.frequency_grid()
    peak = loop.hinf_norm()
    assert peak.value >= np.abs(loop.frequency_response(w)).max()
    assert peak.value == pytest.approx(np.abs(loop.frequency_response([peak.omega])).max(), rel=1e-10)
    with pytest.raises(mv.ModelError, match="no parameters"):
        loop.hinf_norm(parameters=["k.stiffness"])


@pytest.mark.slow
def test_open_and_closed_loop_in_one_figure():
    system = chain()
    loop = system.feedback(PI, "x", "Fx")
    for draw in (plots.bode, plots.step, plots.nyquist):
        figure = draw([system, loop], "x", "Fx")
        labels = [text.get_text() for legend in figure.legends for text in legend.get_texts()] or [
            text.get_text() for axes in figure.axes if axes.get_legend() for text in axes.get_legend().get_texts()]
        assert labels == ["chain", "chain with controller"], draw
    assert len(plots.singular_values([system, loop, loop.state_space()], "x", "Fx").axes[0].lines) == 3
    for other in (loop.law, PI, system.state_space()):
        assert plots.bode(other).axes


@pytest.mark.slow
@pytest.mark.parametrize("name", ["static gain", "integrator"])
def test_exports(name, tmp_path):
    loop = chain().feedback(*LAWS[name])
    w = np.array([2.0, 30.0])
    truth = loop.frequency_response(w)
    np.testing.assert_allclose(mx.to_frd(loop, w).frdata, truth)
    scipy = mx.to_scipy(loop)
    response = [scipy.C @ np.linalg.solve(1j * x * np.eye(len(scipy.A)) - scipy.A, scipy.B) + scipy.D for x in w]
    np.testing.assert_allclose(np.moveaxis(response, 0, 2), truth, rtol=1e-8, atol=1e-9 * np.abs(truth).max())
    mx.to_fmu(loop, tmp_path / "loop.fmu")
    assert (tmp_path / "loop.fmu").stat().st_size > 1000
    mx.to_mat(loop, tmp_path / "loop.mat")
    stored = scipy_io.loadmat(tmp_path / "loop.mat")
    response = [stored["C"] @ np.linalg.solve(1j * x * np.eye(len(stored["A"])) - stored["A"], stored["B"]) for x in w]
    np.testing.assert_allclose(np.moveaxis(response, 0, 2), truth, rtol=1e-8, atol=1e-9 * np.abs(truth).max())
    mx.to_npz(loop, tmp_path / "loop.npz")
    for back in (mx.from_npz(tmp_path / "loop.npz"), mx.from_mat(tmp_path / "loop.mat")):
        if name == "static gain":
            assert back.M.shape == (6, 6)
        else:
            np.testing.assert_allclose(back.frequency_response(w), truth, rtol=1e-8, atol=1e-9 * np.abs(truth).max())


NAMED = control.ss([], [], [], [[1.0, 2.0]], inputs=["x", "rz"], outputs=["Fx"])
REFUSALS = [
    (lambda: chain().feedback(NAMED, ["rz", "x"], "Fx"), "sensors are rz, x, and the controller has x, rz; expected "
     "the same order"),
    (lambda: chain().feedback(mv.StateSpace.from_control(NAMED), ["rz", "x"], "Fx"), "sensors are rz, x, and"),
    (lambda: chain().feedback(control.ss([], [], [], [[1.0]], inputs=["x"], outputs=["F"])), "StateSpace from x to F, "
     r"whose .*, or inputs among .*x.* and outputs among .*Fx"),
    (lambda: chain().feedback(control.ss([], [], [], [[1.0]], inputs=["Fx"], outputs=["x"])), "Its inputs and outputs "
     "are exchanged"),
    (lambda: isolation.controller(control.ss([[0.5]], [[1]], [[1]], [[0]], 0.1), ["x"], ["Fx"]),
     r"discrete \(dt = 0\.1\)"),
    (lambda: chain().feedback(PI), r"do not have the names of those of 'chain'; expected sensors="),
    (lambda: chain().feedback([[-1.0]], "x", "Fx").rms("x", {"x.noise": 1.0}),
     r"input 'x.noise': .* noise=True\)\. It has"),
    (lambda: chain().feedback(PI, "Fx", "x"), r"'Fx' is an input, and no output"),
    (lambda: chain().feedback(PI, "x", "Fxx"), r"input 'Fxx': .*Did you mean 'Fx'"),
    (lambda: chain().feedback([[1.0, 2.0]], "x", "Fx"), r"shape \(1, 2\); expected \(1, 1\)"),
    (lambda: chain().feedback(control.ss([[0.5]], [[1]], [[1]], [[0]], True), "x", "Fx"), "without a sample time"),
    (lambda: chain().feedback(control.ss([[-1.0]], [[1]], [[1]], [[0]], 0.1), "x", "Fx"), "a pole at z = -1"),
    (lambda: chain().feedback([[-1.0]], "x", "Fx").feedback(control.ss([[0.5]], [[1]], [[1]], [[0]], 0.1), "x", "Fx"),
     r"discrete, dt = 0\.1 s; expected one in continuous time"),
    (lambda: chain().feedback([[-1.0]], "x", "Fx").sampled(20.0).feedback(
        control.ss([[0.5]], [[1]], [[1]], [[0]], 0.1), "x", "Fx"), r"expected 0\.05 s as the loop has"),
    (lambda: chain().feedback(isolation.controller([[1.0]], ["a"], ["b"])), r"output 'a': .*no such output"),
    (lambda: chain().feedback([[1e6]], "x", "Fx").h2_norm(), "does not decay"),
    (lambda: chain().state_space().feedback(PI, "x", "Fx").state_space("balance"), "realization = 'balance'"),
]  # fmt: skip


@pytest.mark.parametrize(("ask", "message"), REFUSALS, ids=[message for _, message in REFUSALS])
def test_refusals(ask, message):
    with pytest.raises(mv.MbsvibError, match=message):
        ask()


def test_responses_of_unstable_loops_are_those_of_the_equations_with_a_warning():
    system = chain()
    loop, w = system.feedback([[1e6]], "x", "Fx"), np.array([0.5, 20.0, 300.0])
    g = system.frequency_response(w, "x", "Fx")[0, 0]
    with pytest.warns(mv.UnstableWarning, match=r"not stable with controller: .*No steady vibration"):
        response = loop.frequency_response(w, "x", "Fx")[0, 0]
    np.testing.assert_allclose(response, g / (1.0 - 1e6 * g), rtol=1e-10)
    with pytest.warns(UserWarning, match="all 1 points failed, the first by ResponseError: closed loop: not stable"):
        mv.sweep(mv.library.quarter_car(), {"gain": [1e6]}, studies.gain("body.z", "actuator", 1.0),
                 plant=lambda system, gain: system.feedback([[gain]], "body.z", "actuator"))  # fmt: skip


def test_a_controller_brings_its_names():
    system = chain()
    law = isolation.controller(PI, ["x"], ["Fx"], name="PI")
    named = mv.StateSpace.from_arrays([[0.0]], [[1.0]], [[-1e2]], [[-1e3]], inputs=["x"], outputs=["Fx"], name="PI")
    w = [1.0, 30.0]
    for given in (law, named):
        loop = system.feedback(given)
        assert loop.name == "chain with PI"
        np.testing.assert_allclose(loop.frequency_response(w), system.feedback(PI, "x", "Fx").frequency_response(w))


@pytest.mark.parametrize("plant", [chain(), chain().state_space()], ids=["system", "state space"])
def test_realizations_respond_alike(plant):
    loop = plant.feedback(PI, "x", "Fx")
    expected = loop.response(np.array([0.3, 4.0, 90.0]))
    kinds = ["modal", "balanced", "physical"] if plant.kind == "system" else ["modal", "balanced"]
    for realization in kinds:
        space = loop.state_space(realization)
        assert len(space.states) == len(plant.poles()) + 1
        np.testing.assert_allclose(space.frequency_response([0.3, 4.0, 90.0]), expected, rtol=1e-11)
    names = loop.state_space("physical" if plant.kind == "system" else "modal").states
    assert loop.state_space("balanced").states == names
    assert names[:-1] == plant.state_space().states
    assert names[-1] == "controller1"


def test_norms_name_all_poles_that_do_not_decay():
    model = mv.Model("pair")
    for name, stiffness in (("a", 100.0), ("b", 400.0)):
        model.add_body(name, 1.0, (1, 1, 1))
        model.add_joint(f"{name}.rail", "prismatic", "ground", name, axis=(1, 0, 0))
        model.add_spring(f"{name}.k", "ground", name, (-1, 0, 0), (0, 0, 0), stiffness=stiffness, damping=0.1)
        model.add_input(f"{name}.F", name, "x")
        model.add_output(f"{name}.v", name, "x", quantity="velocity")
    loop = model.linearize().feedback(3.0 * np.eye(2), ["a.v", "b.v"], ["a.F", "b.F"])
    with pytest.raises(mv.ResponseError, match=r"poles 1\.45\+.* of mode 1; 1\.45\+.* of mode 2 do not decay"):
        loop.hinf_norm()


def test_accelerations_that_are_fed_back_keep_their_digits_under_large_gains():
    """(m + g) a = F at high frequencies, by g up to 1e12 times the mass."""
    for gain in (1e6, 1e12):
        model = mv.Model("cart")
        model.add_body("cart", 2.0, (1, 1, 1))
        model.add_joint("rail", "prismatic", "ground", "cart", axis=(1, 0, 0))
        model.add_spring("spring", "ground", "cart", (-1, 0, 0), (0, 0, 0), 800.0, 4.0)
        model.add_input("F", "cart", "x")
        model.add_output("a", "cart", "x", quantity="acceleration")
        space = model.linearize().feedback([[-gain]], "a", "F").state_space()
        np.testing.assert_allclose(space.D, [[1.0 / (2.0 + gain)]], rtol=1e-14)


@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_other_units_of_coordinates_and_ports_change_no_digit(unit):
    """Coordinates in units 12 orders apart lost six digits; sensors in nm/s^2 beside km/s^2 were called algebraic."""
    rng = np.random.default_rng(5)
    m, k, b, c, g = (rng.standard_normal((3, 3)) for _ in range(5))
    m, k = m @ m.T + np.eye(3), 1e4 * (k @ k.T + np.eye(3))

    def response(q, u):
        plant = mv.System.from_matrices(m * np.outer(q, q), None, k * np.outer(q, q), b * np.outer(q, u),
                                        Cq=1e3 * c[:2] * q[None, :], Ca=np.outer([0.0, 0.0], q))  # fmt: skip
        loop = plant.feedback(g[:, :2] / u[:, None], plant.outputs, plant.inputs)
        return loop.frequency_response([3.0, 50.0, 200.0]) / u[None, :, None]

    expected = response(np.ones(3), np.ones(3))
    np.testing.assert_allclose(response(np.array([1.0, unit, 1.0 / unit]), np.array([1.0, unit, 1.0])), expected,
                               rtol=1e-10)  # fmt: skip
    plant = mv.System.from_matrices(m, None, k, b, Ca=c)
    sensors = np.array([1.0, unit**2, 1.0 / unit])
    scaled = mv.System.from_matrices(m, None, k, b, Ca=c * sensors[:, None])
    poles, same = (each.poles() for each in (
        plant.feedback(-0.02 * g, plant.outputs, plant.inputs),
        scaled.feedback(-0.02 * g / sensors, plant.outputs, plant.inputs)))  # fmt: skip
    np.testing.assert_allclose(np.sort(same.imag), np.sort(poles.imag), rtol=1e-9)
