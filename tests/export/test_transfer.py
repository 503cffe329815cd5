"""Transfer functions from poles and zeros, refused where polynomials lose too much."""

import control
import numpy as np
import pytest

import mbsvib as mv
import mbsvib_export as mx
from mbsvib import library
from tests.export.plants import slider, stewart, stiff_model


def test_closed_form():
    result, error = mx.to_transfer_function(slider(outputs=("mass.z",)))
    assert result.den[0][0] == pytest.approx([1, 1.5, 5000], rel=1e-13)
    assert result.num[0][0] == pytest.approx([0.5], rel=1e-13)
    assert error < 1e-13
    assert (result.input_labels, result.output_labels, result.name) == (["F"], ["mass:z"], "slider")


@pytest.mark.parametrize("ports", [("leg1.force", "leg1.f"), ("x", "Fx"), ("leg3.force", "leg1.f")])
def test_a_platform(ports):
    system = stewart()
    result, error = mx.to_transfer_function(system, *ports)
    omega = np.geomspace(1e3, 1e5, 200)
    exact = system.frequency_response(omega)[system.outputs.index(ports[0]), system.inputs.index(ports[1])]
    assert np.abs(result(1j * omega) / exact - 1).max() < 1e-9
    assert error < 1e-9
    assert len(result.poles()) <= 12


def test_motions_the_input_does_not_reach_are_no_poles():
    assert len(mx.to_transfer_function(stewart(), "x", "Fx")[0].poles()) == 4


def test_stiffness_of_twelve_decades():
    assert mx.to_transfer_function(stiff_model().linearize(), "z", "F")[1] < 1e-11


def test_polynomials_that_lose_their_digits_are_refused():
    system = library.chain(60, line=(0, 1, 0)).linearize()
    with pytest.raises(mv.ExportError, match=r"120 poles, and as polynomials .* off by .*to_control"):
        mx.to_transfer_function(system, system.outputs[0], system.inputs[0])


def test_one_of_several_must_be_named():
    with pytest.raises(mv.ExportError, match=r"2 inputs.*input=\.\.\. of F, d"):
        mx.to_transfer_function(slider(inputs=("F", "d")))
    with pytest.raises(mv.ExportError, match=r"0 outputs.*add one"):
        mx.to_transfer_function(slider(outputs=()))
    with pytest.raises(mv.ResponseError, match="no input 'G'"):
        mx.to_transfer_function(slider(), input="G")
    with pytest.raises(mv.ExportError, match="Model; expected a System"):
        mx.to_transfer_function(library.stewart())


def test_state_spaces_and_closed_loops():
    system = slider(outputs=("mass.z",))
    result, error = mx.to_transfer_function(system.state_space())
    assert result.den[0][0] == pytest.approx([1, 1.5, 5000], rel=1e-13)
    assert error < 1e-13
    closed, error = mx.to_transfer_function(system.feedback([[-400.0]], "mass.z", "F"))
    assert closed.den[0][0] == pytest.approx([1, 1.5, 5200], rel=1e-13)
    assert error < 1e-13


def test_rigid_and_locked_mechanisms():
    free, error = mx.to_transfer_function(slider(stiffness=0.0))
    assert free.poles() == pytest.approx([-1.5, 0.0])
    assert error < 1e-12
    locked, error = mx.to_transfer_function(slider(locked=True))
    assert locked(1j) == 0.0
    assert error == 0.0


@pytest.mark.parametrize("delay", [0.0, 0.004, 0.02, 0.033])
@pytest.mark.parametrize("output", ["x", "v"])
def test_sampled_loop_between_its_samples_and_held_inputs(delay, output):
    """It was compared with the response to a sine, which is none of z, and refused as off by 100 %."""
    model = mv.Model("axis")
    model.add_body("mass", 2.0, (1, 1, 1))
    model.add_joint("rail", "prismatic", "ground", "mass", axis=(1, 0, 0))
    model.add_spring("k", "ground", "mass", (-1, 0, 0), (0, 0, 0), stiffness=800.0, damping=4.0)
    model.add_input("F", "mass", "x")
    for name, quantity in (("x", "displacement"), ("v", "velocity"), ("a", "acceleration")):
        model.add_output(name, "mass", "x", quantity=quantity)
    loop = model.linearize().feedback([[-20.0]], ["v"], ["F"]).sampled(50.0, delay)
    result, error = mx.to_transfer_function(loop, output, "F")
    assert result.dt == loop.period
    # its impulse response is that of the loop, in which a force is held for one sample
    k = np.arange(40)
    expected = loop.time_response(k * loop.period, (k == 0)[None] * 1.0, "zero")[loop.outputs.index(output)]
    found = control.forced_response(result, k * loop.period, (k == 0) * 1.0).outputs
    np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max())
    assert error < 1e-6
