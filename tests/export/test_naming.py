"""Names after python-control's own functions, and exact discretisation."""

import control
import numpy as np
import pytest

import mbsvib as mv
import mbsvib_export as mx
from tests.export.plants import resonances, slider, stewart


def two():
    return mx.to_control(slider(inputs=("F", "d"), outputs=("mass.z", "mass.v")))


def gain(rows, columns, value=0.5):
    return control.StateSpace([], [], [], np.full((rows, columns), value))


def test_results_of_python_control_get_the_plants_names():
    plant = two()
    bare = control.StateSpace(plant.A, plant.B, plant.C, plant.D)
    for result in (-bare, control.feedback(bare, gain(2, 2)), bare + bare):
        assert result.input_labels != plant.input_labels
        again = mx.named(result, plant)
        assert again.input_labels == ["F", "d"]
        assert again.output_labels == ["mass:z", "mass:v"]
        assert again.name == "slider"
        assert np.array_equal(again.A, result.A)
        assert result.input_labels != plant.input_labels  # the result itself is not touched
    again = mx.named(-bare, plant, states=True)
    assert again.state_labels == again["mass:z", :].state_labels == plant.state_labels


def test_series_takes_inputs_of_the_first_and_outputs_of_the_last():
    plant = two()
    filter = control.StateSpace(-np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2)), inputs=["a", "b"],
                                outputs=["F", "d"], name="filter")  # fmt: skip
    both = mx.named(control.series(filter, plant), (filter, plant), states=True)
    assert both.input_labels == ["a", "b"]
    assert both.output_labels == ["mass:z", "mass:v"]
    assert both.name == "filter_slider"
    assert both.nstates == len(set(both.state_labels)) == 4


def test_a_controller_closes_the_loop_by_names():
    """What h2syn and hinfsyn return: inputs are the last outputs of the plant, outputs its last inputs."""
    plant = mx.to_control(slider(inputs=("d", "F"), outputs=("z", "y")))
    result = control.StateSpace([[-50.0]], [[1.0]], [[-2e4]], [[0.0]])
    law = mx.named(result, plant, controller=True, name="law")
    assert (law.input_labels, law.output_labels, law.name) == (["y"], ["F"], "law")
    loop = control.interconnect([plant, law], inputs=["d"], outputs=["z"])
    s = 40j
    g, k = 1 / (2 * s * s + 3 * s + 1e4), -2e4 / (s + 50)
    assert loop(s) == pytest.approx(g / (1 - g * k), rel=1e-12)


def test_reduced_and_transfer_functions_too():
    plant = two()
    reduced = control.StateSpace([[-1.0]], np.ones((1, 2)), np.ones((2, 1)), np.zeros((2, 2)))
    assert mx.named(reduced, plant).input_labels == ["F", "d"]
    data = control.FrequencyResponseData(np.ones((2, 2, 3)), [1.0, 2.0, 3.0])
    assert mx.named(data, plant).output_labels == ["mass:z", "mass:v"]


@pytest.mark.parametrize(
    ("result", "options", "message"),
    [
        (gain(1, 2), {}, "1 outputs, the plant 2"),
        (gain(2, 3), {}, r"3 inputs, the plant 2 \(F, d\)"),
        (gain(3, 2), {"controller": True}, "controller has 3 outputs"),
        (gain(2, 2), {"states": True}, "0 states, the plant 2"),
        (np.eye(2), {}, "ndarray is not a system of python-control"),
    ],
)
def test_what_does_not_fit_is_refused(result, options, message):
    with pytest.raises(mv.ExportError, match=message):
        mx.named(result, two(), **options)


@pytest.mark.parametrize("realization", ["physical", "modal", "balanced"])
@pytest.mark.parametrize("dt", [1e-5, 1e-3, 0.1])
def test_discretised_exactly(realization, dt):
    system = stewart()
    sampled = mx.to_control(system, realization, dt=dt)
    assert sampled.dt == dt
    assert sampled.input_labels == mx.to_control(system).input_labels
    t = dt * np.arange(60)
    u = np.random.default_rng(1).normal(size=(len(system.inputs), len(t)))
    exact = system.time_response(t, u, hold="zero")
    response = control.forced_response(sampled, t, u).outputs
    assert np.all(np.abs(response - exact).max(axis=1) < 5e-12 * np.abs(exact).max(axis=1))


@pytest.mark.parametrize("dt", [0, -1.0, np.inf, np.nan, "1 ms", True])
def test_steps_that_are_none(dt):
    with pytest.raises(mv.ExportError, match=r"to_control: step = .*positive number of seconds"):
        mx.to_control(slider(), dt=dt)


@pytest.mark.parametrize("export", [
    lambda space, folder: mx.to_control(space, dt=1e3),
    lambda space, folder: mx.to_control(space, dt=1e3, method="foh"),
    lambda space, folder: mx.to_casadi(space, 1e3), lambda space, folder: mx.to_c(space, folder, 1e3),
])  # fmt: skip
def test_steps_in_which_states_overflow(export, tmp_path):
    """e^1000 is beyond all numbers."""
    space = mv.StateSpace.from_arrays([[1.0]], [[1.0]], [[1.0]], 0, name="fast")
    with pytest.raises(mv.ExportError, match="'fast' grows beyond all numbers within step = 1000 s; take a shorter"):
        export(space, tmp_path)


def test_batches_are_discretised_one_by_one():
    from tests.export.plants import stiff_model

    batch = stiff_model().linearize(values={"ka.stiffness": [100.0, 200.0]})
    assert [item.dt for item in mx.to_control(batch, dt=1e-3)] == [1e-3, 1e-3]


def test_the_discrete_plant_has_the_poles_of_the_continuous_one():
    system = stewart()
    dt = 1e-5
    result = np.sort_complex(np.linalg.eigvals(mx.to_control(system, "modal", dt=dt).A))
    assert result == pytest.approx(np.sort_complex(np.exp(system.poles() * dt)), rel=1e-12)
    assert resonances(system).max() * dt < np.pi
