"""python-control: matrices bit for bit, names kept, and python-control's own functions run on the result."""

from dataclasses import replace

import control
import numpy as np
import pytest

import mbsvib as mv
import mbsvib_export as mx
from mbsvib import library
from tests.export.plants import same_bits, slider, stewart
from tests.support.exact import Exact

BACK = mx.SignalNames.to_mbsvib


@pytest.mark.parametrize("realization", ["physical", "modal", "balanced"])
def test_matrices_and_names_are_those_of_the_state_space(realization):
    system = stewart()
    space = system.state_space(realization)
    for plant in (mx.to_control(system, realization), mx.to_control(space)):
        assert all(same_bits(getattr(plant, key), getattr(space, key)) for key in "ABCD")
        assert tuple(map(BACK, plant.state_labels)) == space.states
        assert tuple(map(BACK, plant.input_labels)) == system.inputs
        assert tuple(map(BACK, plant.output_labels)) == system.outputs
        assert plant.name == "stewart"
        assert plant.isctime(strict=True)


def test_the_plant_is_a_copy():
    system = slider()
    plant = mx.to_control(system)
    plant.A[1, 0] = 0.0
    assert system.state_space().A[1, 0] == pytest.approx(-1e4 / 2)


def test_states_that_act_on_nothing_stay():
    system = slider(stiffness=0.0)  # A's first column is zero: python-control calls that state useless on request
    control.config.defaults["statesp.remove_useless_states"] = True
    try:
        assert mx.to_control(system).nstates == 2
    finally:
        control.reset_defaults()


@pytest.mark.slow
def test_dc_gain_is_the_static_compliance():
    plant = mx.to_control(stewart())
    gain = plant.dcgain()
    truth = Exact(library.stewart(ports="all")).static()
    for row, output in enumerate(plant.output_labels):
        scale = max(np.abs(truth[row]).max(), np.abs(plant.D[row]).max())  # D cancels in static accelerations
        assert np.abs(gain[row] - truth[row]).max() <= 3e-14 * scale, output
    along = [plant.dcgain()[plant.find_output(d), plant.find_input(f"F{d}")] for d in "xyz"]
    # the published study's, case 3
    assert along == pytest.approx([2.8371955207e-8, 2.8371955207e-8, 2.0990463026e-8], rel=1e-10)


def test_step_response_follows_the_closed_form():
    plant = mx.to_control(slider())
    t = np.linspace(0.0, 1.0, 400)
    decay, omega = 3.0 / 4, np.sqrt(1e4 / 2 - (3.0 / 4) ** 2)
    exact = 1e-4 * (1 - np.exp(-decay * t) * (np.cos(omega * t) + decay / omega * np.sin(omega * t)))
    step = control.step_response(plant, t)
    assert np.abs(step.outputs - exact).max() < 1e-15
    assert np.abs(step.states["guide:z"] - exact).max() < 1e-15


def test_bode_data_by_names():
    system = stewart()
    omega = np.geomspace(1e3, 1e4, 30)
    response = control.frequency_response(mx.to_control(system), omega)
    direct = system.frequency_response(omega)[system.outputs.index("leg3.force"), system.inputs.index("leg1.f")]
    entry = response.complex["leg3:force", "leg1:f"]
    assert np.abs(entry / direct - 1).max() < 1e-10


def test_feedback_adds_damping():
    plant = mx.to_control(slider())
    rate = control.StateSpace([], [], [], [[0.0]])
    assert control.feedback(plant, rate).poles() == pytest.approx(plant.poles())
    loop = control.feedback(plant, control.StateSpace([], [], [], [[2e4]]))
    assert np.abs(loop.poles()) == pytest.approx([np.sqrt(3e4 / 2)] * 2)


def test_interconnect_by_names():
    plant = mx.to_control(slider(outputs=("mass.z",)))
    error = control.summing_junction(["r", "-mass:z"], "e", name="error")
    gain = control.StateSpace([], [], [], [[2e4]], inputs="e", outputs="F", name="gain")
    implicit = control.interconnect([plant, gain, error], inputs=["r"], outputs=["mass:z"])
    explicit = control.interconnect(
        [plant, gain], connections=[["slider.F", "gain.F"], ["gain.e", "-slider.mass:z"]],
        inplist=["gain.e"], outlist=["slider.mass:z"],
    )  # fmt: skip
    for loop in (implicit, explicit):
        assert loop.dcgain() == pytest.approx(2 / 3)
        assert np.abs(loop.poles()) == pytest.approx([np.sqrt(3e4 / 2)] * 2)
    assert [BACK(name) for name in implicit.state_labels] == ["slider_guide.z", "slider_d(guide.z)/dt"]


def test_one_name_for_an_input_and_an_output_is_warned_of():
    """python-control wires signals of one name, and with them a plant to itself: its stiffness fell by 1 N/m."""
    system = slider(inputs=("z", "F"), outputs=("z",))
    with pytest.warns(UserWarning, match="input and output 'z' of 'slider' have one name, and control.interconnect"):
        plant = mx.to_control(system)
    itself = control.interconnect([plant], inputs=["F"], outputs=["z"])
    assert itself.dcgain() == pytest.approx(1.0 / (1e4 - 1.0))


@pytest.mark.filterwarnings("ignore:.*interconnect:FutureWarning")
def test_connect_by_numbers():
    plants = control.append(mx.to_control(slider()), control.StateSpace([], [], [], [[2e4]]))
    loop = control.connect(plants, [[1, 2], [2, -1]], [2], [1])
    assert loop.dcgain() == pytest.approx(2 / 3)


def test_state_feedback_by_names():
    space = slider(outputs=("mass.z",)).state_space()
    space = replace(space, C=np.eye(2), D=np.zeros((2, 1)), outputs=("mass.z", "mass.vz"), output_units=("m", "m/s"))
    plant = mx.to_control(space)
    gain, _, poles = control.lqr(plant, np.diag([1e8, 1.0]), np.eye(1))
    _, loop = control.create_statefbk_iosystem(plant, gain)
    assert np.sort_complex(loop.poles()) == pytest.approx(np.sort_complex(poles))
    assert loop.output_labels == ["mass:z", "mass:vz", "F"]


@pytest.mark.parametrize("realization", ["physical", "modal", "balanced"])
def test_discretised_exactly_with_its_names(realization):
    system = stewart()
    sampled = mx.to_control(system, realization).sample(1e-4, method="zoh")
    assert tuple(map(BACK, sampled.input_labels)) == system.inputs
    assert tuple(map(BACK, sampled.state_labels)) == system.state_space(realization).states
    t = 1e-4 * np.arange(60)
    u = np.random.default_rng(1).normal(size=(len(system.inputs), len(t)))
    exact = system.time_response(t, u, hold="zero")
    response = control.forced_response(sampled, t, u).outputs
    assert np.all(np.abs(response - exact).max(axis=1) < 1e-11 * np.abs(exact).max(axis=1))


def test_frequency_response_data():
    system = stewart()
    omega = np.geomspace(1e2, 1e5, 20)
    data = mx.to_frd(system, omega)
    assert same_bits(np.asarray(data.frdata), system.frequency_response(omega))
    assert np.array_equal(data.omega, omega)
    assert tuple(map(BACK, data.input_labels)) == system.inputs
    assert tuple(map(BACK, data.output_labels)) == system.outputs
    assert data.name == "stewart"
    assert np.array_equal(data.complex["leg3:force", "leg1:f"], system.frequency_response(omega)[11, 6])
    assert mx.to_frd(system, 1e3).frdata.shape == (len(system.outputs), len(system.inputs), 1)


def test_a_loop_is_closed_on_frequency_response_data():
    omega = np.array([50.0, 70.0, 90.0])
    loop = control.feedback(mx.to_frd(slider(), omega), 2e4)
    assert np.ravel(loop.frdata) == pytest.approx(1 / (3e4 - 2 * omega**2 + 3j * omega), rel=1e-12)


@pytest.mark.parametrize(("inputs", "outputs"), [((), ("a", "b")), (("F",), ()), ((), ())])
def test_systems_without_inputs_or_outputs(inputs, outputs):
    system = slider(inputs, outputs)
    plant = mx.to_control(system)
    assert (plant.ninputs, plant.noutputs, plant.nstates) == (len(inputs), len(outputs), 2)
    assert np.sort_complex(plant.poles()) == pytest.approx(np.sort_complex(system.modes().eigenvalues))
    released = control.initial_response(plant, np.linspace(0, 1, 5), [1.0, 0.0])
    assert released.states[0][0] == 1.0
    assert mx.to_frd(system, [1.0]).frdata.shape == (len(outputs), len(inputs), 1)


def test_one_output_without_inputs_is_refused_by_name():
    with pytest.raises(mv.ExportError, match=r"'slider' has no inputs.*add_input"):
        mx.to_control(slider(inputs=()))


def test_a_locked_mechanism_is_a_continuous_gain():
    plant = mx.to_control(slider(locked=True))
    assert plant.nstates == 0
    assert plant.dt == 0
    assert plant.dcgain() == 0.0


def test_what_is_no_system_is_refused():
    for wrong in (library.stewart(), None, np.eye(2)):
        with pytest.raises(mv.ExportError, match=rf"to_control: system = {type(wrong).__name__}.*linearize"):
            mx.to_control(wrong)
    with pytest.raises(mv.ExportError, match="to_frd: system = ndarray"):
        mx.to_frd(np.eye(2), [1.0])
    with pytest.raises(mv.ExportError, match=r"realization = 'modal'.*'physical'"):
        mx.to_control(slider().state_space(), "modal")
    with pytest.raises(mv.ResponseError, match="realization"):
        mx.to_control(slider(), "jordan")


@pytest.mark.parametrize("method", ["zoh", "foh", "tustin"])
def test_discrete_systems_by_each_method(method):
    """As scipy discretises the same matrices."""
    from scipy.signal import cont2discrete

    system = mv.library.quarter_car().linearize()
    space, h = system.state_space(), 5e-3
    found = mx.to_control(system, dt=h, method=method)
    a, b, c, d, _ = cont2discrete((space.A, space.B, space.C, space.D), h,
                                  "bilinear" if method == "tustin" else method)  # fmt: skip
    z = np.exp(1j * np.array([0.01, 0.3, 1.0, 2.5]))
    theirs = np.array([c @ np.linalg.solve(x * np.eye(len(a)) - a, b) + d for x in z]).transpose(1, 2, 0)
    assert found.dt == h
    assert np.allclose(found(z), theirs, rtol=1e-9, atol=1e-12 * np.abs(theirs).max())


def test_an_unknown_method_is_refused():
    with pytest.raises(mv.ExportError, match="method = 'euler'; expected 'zoh', 'foh' or 'tustin'"):
        mx.to_control(mv.library.quarter_car().linearize(), dt=1e-3, method="euler")


def test_a_method_without_a_step_is_refused():
    """It was left out in silence: the result was continuous in time."""
    system = mv.library.quarter_car().linearize()
    for method in ("tustin", "zoh"):
        with pytest.raises(mv.ExportError, match=f"method = '{method}' without dt"):
            mx.to_control(system, method=method)
    loop = system.feedback([[0.0]], system.outputs[0], system.inputs[0]).sampled(100.0)
    with pytest.raises(mv.ExportError, match="discrete already"):
        mx.to_control(loop, method="tustin")
    assert mx.to_control(loop, method="zoh").dt == 0.01


def test_ports_of_a_sampled_loop():
    """Some outputs and inputs of a loop are its response from these inputs to these outputs."""
    system = library.quarter_car().linearize()
    output, source = system.outputs[-1], system.inputs[-1]
    loop = system.feedback([[0.0]], system.outputs[0], system.inputs[0]).sampled(100.0)
    whole, part = mx.to_control(loop), mx.to_control(loop, outputs=output, inputs=source)
    assert tuple(map(BACK, part.output_labels)) == (output,)
    assert tuple(map(BACK, part.input_labels)) == (source,)
    assert part(np.exp(0.3j)) == pytest.approx(whole(np.exp(0.3j))[-1, -1], rel=1e-12)
