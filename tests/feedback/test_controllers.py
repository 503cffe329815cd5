"""Controllers as systems of their own: responses, norms, selection, units, and matrices of transfer functions."""

import control
import numpy as np
import pytest

import mbsvib as mv
import mbsvib_export as mx
from mbsvib import isolation, library, plots, report

W = np.geomspace(0.1, 1e3, 40)


def rig():
    model = mv.Model("rig")
    model.add_body("arm", 2.0, (0.1, 0.1, 0.1), (0, 0, 0.1))
    model.add_joint("hinge", "revolute", "ground", "arm", (0, 0, 0), axis=(0, 1, 0))
    model.add_torsion_spring("spring", "ground", "arm", (0, 1, 0), 30.0, 0.1)
    model.add_input("motor", "arm", "ry")
    model.add_input("push", "arm", "x")
    model.add_output("angle", "arm", "ry")
    model.add_output("rate", "arm", "ry", quantity="velocity")
    return model.linearize()


def filters():
    lag, double_lag = [0.01, 1.0], [1e-4, 0.02, 1.0]
    return control.tf([[[-2.0, -30.0], [0.0]], [[4.0], [-1.0]]], [[lag, [1.0]], [lag, double_lag]],
                      inputs=["angle", "rate"], outputs=["motor", "push"], name="filters")  # fmt: skip


def test_a_controller_answers_as_a_system_does():
    space = control.ss([[-5.0, 1], [0, -30]], [[0.0], [1.0]], [[-30.0, 2.0]], [[0.0]])
    law = rig().feedback(space, "angle", "motor").law
    theirs = mx.to_control(law)
    np.testing.assert_allclose(law.frequency_response(W)[0, 0], theirs(1j * W), rtol=1e-12)
    np.testing.assert_allclose(np.sort(law.poles().real), [-30.0, -5.0])
    assert law.h2_norm("motor", "angle").value == pytest.approx(control.norm(theirs, 2), rel=1e-10)
    assert law.hinf_norm().value == pytest.approx(np.abs(theirs(0.0)), rel=1e-10)
    t = np.linspace(0.0, 1.0, 50)
    exact = control.step_response(theirs, t).outputs
    np.testing.assert_allclose(law.time_response(t, np.ones(50))[0], exact, atol=1e-12)
    assert law.step_info().final[0, 0] == pytest.approx(theirs(0.0).real)
    assert len(law.modes()) == 2
    assert len(law.frequency_grid()) > 100


def test_a_part_of_a_controller_is_chosen_by_name():
    law = rig().feedback(filters()).law
    part = law["push", "angle"]
    assert (part.outputs, part.inputs, part.units) == (("push",), ("angle",), (("rad",), ("N",)))
    np.testing.assert_allclose(part.frequency_response(W), law.frequency_response(W, "push", "angle"), rtol=1e-14)
    with pytest.raises(mv.ResponseError, match="'push' is an output, and no input"):
        law["push", "push"]


def test_units_are_those_of_the_plant():
    """The actuator of a torque is in N m, not in N."""
    system = rig()
    law = system.feedback([[-3.0]], "rate", "motor").law
    assert law.units == (("rad/s",), ("N m",))
    assert law.state_space().output_units == ("N m",)
    assert isolation.controller([[1.0]], ["a"], ["b"]).state_space().output_units == ("",)
    plant = isolation.actuated(library.stewart_isolator(), "platform")
    assert set(isolation.force_feedback(plant, 1.0).output_units) == {"N"}
    assert isolation.velocity_feedback(plant, 1.0).input_units == ("m/s",) * 6


def test_a_matrix_of_transfer_functions_is_a_controller():
    """Against the formula of the closed loop with python-control's own frequency responses."""
    system, law = rig(), filters()
    loop = system.feedback(law)
    assert loop.stable
    assert len(loop.law.A) == 3  # two entries of the first input share a state
    plant = system.frequency_response(W).transpose(2, 0, 1)
    gains = law(1j * W).transpose(2, 0, 1)
    exact = np.linalg.solve(np.eye(2) - plant @ gains, plant)
    np.testing.assert_allclose(loop.frequency_response(W).transpose(2, 0, 1), exact, rtol=1e-9)
    assert mv.StateSpace.from_control(law).poles() == pytest.approx([-100.0, -100.0, -100.0], rel=1e-6)
    np.testing.assert_allclose(mx.to_control(law)(1j * W), law(1j * W), rtol=1e-9)


def test_leading_zeros_and_static_entries_take_no_states():
    space = mv.StateSpace.from_control(control.tf([[[0, 0, 3.0], [5.0]]], [[[0, 1.0, 2.0], [2.0]]]))
    assert space.A.shape == (1, 1)
    np.testing.assert_allclose(space.D, [[0.0, 2.5]])


def test_active_mechanisms_take_transfer_functions_by_name():
    plant = isolation.actuated(library.stewart_isolator(), "platform")
    law = control.tf([40.0], [1.0, 1.0], inputs=["leg1:k:force"], outputs=["leg1:k:actuator"])
    same = isolation.controller(control.ss(law), ["leg1.k.force"], ["leg1.k.actuator"])
    np.testing.assert_allclose(plant.with_gains(law).poles(), plant.with_gains(same).poles(), rtol=1e-10)


def test_states_of_each_input_stand_where_its_input_acts():
    """Three inputs with two, one and three states: python-control's own responses."""
    law = control.tf([[[1.0], [2.0, 1.0], [5.0]], [[3.0, 1.0], [4.0], [1.0, 0.0]]],
                     [[[1.0, 2.0, 9.0], [1.0, 4.0], [1.0, 3.0, 3.0, 1.0]]] * 2)  # fmt: skip
    space = mv.StateSpace.from_control(law)
    assert space.A.shape == (6, 6)
    np.testing.assert_allclose(space.frequency_response(W), law(1j * W), rtol=1e-12)


@pytest.mark.parametrize("law", [[[np.nan]], control.ss([[np.inf]], [[1.0]], [[1.0]], [[0.0]])])
def test_gains_that_are_not_finite_are_refused(law):
    with pytest.raises(mv.ResponseError, match="entries that are not finite"):
        rig().feedback(law, "angle", "motor")
    with pytest.raises(mv.ResponseError, match="'drift': D has entries that are not finite"):
        isolation.controller([[np.inf]], ["a"], ["b"], "drift")


@pytest.mark.slow
def test_figures_and_reports_of_controllers():
    law = rig().feedback(filters()).law
    for source in (law, mx.to_control(law), filters()):
        assert len(plots.bode(source, frequencies=W).axes) == 8
        page = report.html(source)
        assert "motor" in page
        assert "angle" in page
