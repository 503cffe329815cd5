"""Reduced models as users ask for them: names kept, errors told, exports as of any system."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
import mbsvib_export as mx
from mbsvib.common.display import upper

OMEGA = np.geomspace(1.0, 1e5, 3000)


def stage():
    return mv.library.wafer_stage().linearize()


def off(system, small):
    difference = system.frequency_response(OMEGA) - small.frequency_response(OMEGA)
    return np.linalg.norm(difference.transpose(2, 0, 1), ord=2, axis=(1, 2)).max()


@pytest.mark.slow
@pytest.mark.parametrize("method", ["balanced", "modal", "static-corrected"])
def test_names_and_bounds(method):
    system = stage()
    small = system.reduced(16, method=method)
    assert len(small.states if method == "balanced" else small.coordinates) == 16
    assert (small.inputs, small.outputs, small.output_units) == (system.inputs, system.outputs, system.output_units)
    assert off(system, small) <= small.error_bound
    assert system.error_bound is None
    assert f"error at most {upper(small.error_bound)})" in repr(small)
    assert f"differs by {upper(small.error_bound)} at most" in small.explain()
    assert "error" not in repr(system) + repr(system.state_space())


@pytest.mark.slow
def test_kept_outputs_decide_the_error():
    system = stage()
    some = system.reduced(error=1e-6, keep=system.outputs[0])
    every = system.reduced(error=1e-6)
    assert some.outputs == (system.outputs[0],)
    assert len(some.states) < len(every.states)
    assert off(system[system.outputs[0], :], some) <= some.error_bound <= 1e-6
    with pytest.raises(mv.ResponseError, match="nothing"):
        system.reduced(4, keep="nothing")


@pytest.mark.slow
def test_state_spaces_and_loops():
    plant = stage()
    loop = plant.feedback([[-2.0]], sensors=[plant.outputs[0]], actuators=["Fx"])
    space = loop.state_space()
    small = space.reduced(20)
    assert len(small.states) == 20
    assert small.error_bound > 0.0
    assert off(space, small) <= small.error_bound
    assert type(small) is type(space)
    assert small.reduced(12).error_bound > small.error_bound


@pytest.mark.slow
def test_explain_tells_the_bound():
    small = stage().reduced(8, method="modal")
    text = small.explain()
    assert "a reduced model of 21 DOF (method 'modal')" in text
    assert f"{upper(small.error_bound)} at most" in text


@pytest.mark.slow
@pytest.mark.parametrize("method", ["balanced", "modal", "craig-bampton"])
def test_exports_take_them(method, tmp_path):
    system = stage()
    small = system.reduced(20, method=method)
    plant = mx.to_control(small, "physical" if method == "balanced" else "modal")
    f = np.array([3.0, 40.0])
    assert_allclose(plant(1j * f), small.frequency_response(f), rtol=1e-7, atol=1e-12)
    assert mx.to_c(small, tmp_path, 1e-5).source.exists()
    assert mx.to_modelica(small, tmp_path / "small.mo").exists()
    assert mx.to_mat(small, tmp_path / "small.mat").exists()


def test_methods_of_a_state_space():
    """It has the same words as a system; methods that need equations of motion are refused as such."""
    space = stage().state_space("modal")
    assert np.array_equal(space.reduced(6, method="balanced").A, space.reduced(6).A)
    with pytest.raises(mv.ResponseError, match=r"method = 'modal' .*projects equations of motion"):
        space.reduced(6, method="modal")
    with pytest.raises(mv.ResponseError, match=r"expected 'balanced'\. Did you mean 'balanced'"):
        space.reduced(6, method="balancd")
