"""Controllers in discrete time, and sampled loops as discrete systems, against python-control."""

import control
import numpy as np
import pytest

import mbsvib as mv
import mbsvib_export as mx
from mbsvib import isolation
from mbsvib.feedback.sampled import SampledLoop
from mbsvib.linalg.discrete import inverse_tustin, tustin
from tests.feedback.test_closed_loops import slider
from tests.isolation.scenes import active_strut

STEP = 1.0 / 400.0
# a filter, a delay of one sample, and an integrator
LAW = control.ss(np.diag([0.7, 0.0, 1.0]), [[1.0, 0.2], [0.0, 1.0], [0.01, 0.0]], [[-40.0, -6.0, -30.0]],
                 [[-90.0, -20.0]], STEP, inputs=["x", "v"], outputs=["F"], name="digital")  # fmt: skip


def reference(space, law, sensors, actuator):
    """The loop by python-control: the plant discretised by a zero-order hold, and the controller as it is."""
    outputs, inputs = ([name.replace(".", ":") for name in names] for names in (space.outputs, space.inputs))
    plant = control.c2d(control.ss(space.A, space.B, space.C, space.D), law.dt)
    select = np.eye(len(outputs))[[outputs.index(name) for name in sensors]]
    into = np.eye(len(inputs))[:, [inputs.index(actuator)]]
    return control.feedback(plant, control.ss([], [], [], into, law.dt) * law * control.ss([], [], [], select, law.dt),
                            sign=1)  # fmt: skip


def test_loop_with_a_discrete_controller_is_that_of_python_control():
    loop = slider(800.0, 4.0).feedback(LAW)
    assert isinstance(loop, SampledLoop)
    assert loop.rate == pytest.approx(400.0)
    exact = reference(loop.plant.space, LAW, ["x", "v"], "F")
    z = np.exp(STEP * loop.poles())
    expected = exact.poles()[np.abs(exact.poles()) > 1e-7]
    np.testing.assert_allclose(np.sort_complex(z), np.sort_complex(expected), atol=1e-12)
    for given, made in zip((LAW.A, LAW.B, LAW.C, LAW.D), loop.discrete, strict=True):
        np.testing.assert_allclose(made, given, atol=1e-13 * np.abs(given).max())
    assert loop.stable
    assert loop.margins().modulus > 0.1


def test_transfer_function_in_discrete_time_and_a_second_controller():
    law = control.tf([-60.0, 50.0], [1.0, -0.4], STEP)
    loop = slider(800.0, 4.0).feedback(law, "x", "F")
    exact = reference(loop.plant.space, law, ["x"], "F").poles()
    np.testing.assert_allclose(np.sort_complex(np.exp(STEP * loop.poles())),
                               np.sort_complex(exact[np.abs(exact) > 1e-7]), atol=1e-12)  # fmt: skip
    both = loop.feedback(control.tf([-5.0], [1.0], STEP), "v", "F")
    assert both.rate == loop.rate
    assert both.damping_ratios.min() > loop.damping_ratios.min()


def test_discrete_controller_of_a_study():
    plant = isolation.actuated(active_strut(damping=60.0), "payload", "leg", directions="z")
    loop = plant.feedback(control.tf([-700.0], [1.0], 1e-3), "leg.rate", "leg.actuator")
    expected = plant.feedback([[-700.0]], "leg.rate", "leg.actuator").sampled(1e3)
    np.testing.assert_allclose(loop.poles(), expected.poles(), rtol=1e-12)
    assert loop.isolation([10.0]).index.shape == (1,)


@pytest.mark.parametrize("size", [0, 1, 4])
def test_inverse_of_tustins_rule(size):
    rng = np.random.default_rng(size)
    law = rng.normal(size=(size, size)) - 2 * np.eye(size), rng.normal(size=(size, 2)), rng.normal(size=(3, size)), \
        rng.normal(size=(3, 2))  # fmt: skip
    for made, given in zip(inverse_tustin(*tustin(*law, 0.1), 0.1), law, strict=True):
        np.testing.assert_allclose(made, given, atol=1e-12)


@pytest.mark.parametrize("delay", [0.0, 0.4, 2.0])
def test_sampled_loop_as_a_discrete_system(delay):
    loop = slider(800.0, 4.0).feedback(LAW).sampled(400.0, delay * STEP)
    system = mx.to_control(loop, outputs=["x", "v"], inputs="disturbance")
    assert system.dt == loop.period
    assert system.input_labels == ["disturbance"]
    assert system.state_labels[-3:] == ["controller1", "controller2", "controller3"]
    u = np.random.default_rng(1).normal(size=60)
    exact = control.forced_response(system, U=u).outputs
    response = loop.time_response(np.arange(60) * STEP, u, "zero", outputs=["x", "v"], inputs="disturbance")
    np.testing.assert_allclose(response, exact, atol=1e-10 * np.abs(exact).max())


def test_sampled_loop_has_its_own_step():
    with pytest.raises(mv.ExportError, match=r"dt = 0\.1; expected 0\.0025, the sample time"):
        mx.to_control(slider(800.0, 4.0).feedback(LAW), dt=0.1)


def test_rates_and_steps_that_are_exchanged_are_doubted(tmp_path):
    plant = slider(800.0, 4.0)
    loop, words = plant.feedback([[-90.0]], "x", "F"), " periods of the slowest pole of "
    with pytest.warns(mv.AccuracyWarning, match="sampled: rate = 0.0025 Hz: a step of 400 s is .*" + words):
        loop.sampled(STEP)
    for export, name in ((mx.to_c, "step"), (mx.to_control, "dt"), (mx.to_casadi, "step")):
        where = (tmp_path,) if export is mx.to_c else ()
        with pytest.warns(mv.AccuracyWarning, match=f"{export.__name__}: {name} = 400: .*{words}.*not a rate in Hz"):
            export(plant, *where, **{name: 400.0})
        export(plant, *where, **{name: 2.0})  # some periods: a slow loop around a fast plant
    integrator = control.ss([[0.0]], [[1.0]], [[1.0]], [[0.0]])
    assert mx.to_control(mv.StateSpace.from_control(integrator), dt=400.0).dt == 400.0
