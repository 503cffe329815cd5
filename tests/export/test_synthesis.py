"""hinfsyn, h2syn, mixsyn and augw with names, against python-control's augmented plant, closed forms and norms."""

import sys
import warnings

import control
import numpy as np
import pytest

import mbsvib as mv
import mbsvib_export as mx
from mbsvib import library
from mbsvib_export import NamedStateSpace


def car():
    return library.quarter_car(suspension_damping=900.0).linearize()


def one():
    return mx.to_control(car()["travel", "actuator"])


def weights():
    return control.tf([0.5, 30.0], [1.0, 0.3]), 1e-5, control.tf([1.0, 0.0], [0.01, 100.0])


def norm(space):
    return mv.StateSpace.from_control(space).hinf_norm().value


@pytest.mark.parametrize("chosen", [(0, 1, 2), (0,), (0, 2), (1, 2)])
def test_the_augmented_plant_is_python_controls(chosen):
    given = [w if k in chosen else None for k, w in enumerate(weights())]
    g = mx.to_control(car()[["travel", "body.z"], ["actuator", "load"]])
    ours = mx.augw(g, *given)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # python-control's own, about its connect
        # of several signals python-control takes square weights only
        square = [control.ss([], [], [], w * np.eye(2)) if isinstance(w, float) else
                  w and control.append(control.ss(w), control.ss(w)) for w in given]  # fmt: skip
        theirs = control.augw(g, *square)
    s = 1j * np.array([0.1, 3.0, 50.0, 2e3])
    assert np.allclose(ours(s), theirs(s), rtol=1e-9, atol=1e-12)
    assert ours.input_labels == ["r:travel", "r:body:z", "actuator", "load"]
    signals = (("travel", "body:z"), ("actuator", "load"), ("travel", "body:z"))
    names = [f"w{k + 1}:{signal}" for k in chosen for signal in signals[k]]
    assert ours.output_labels == [*names, "e:travel", "e:body:z"]
    assert mx.augw(g, control.ss([], [], [], np.ones((1, 2)))).output_labels == ["w1:1", "e:travel", "e:body:z"]
    assert ours.state_labels[:4] == g.state_labels


def test_what_is_refused(monkeypatch):
    g = one()
    with pytest.raises(mv.ExportError, match="there is no weight"):
        mx.augw(g)
    with pytest.raises(mv.ExportError, match="w1 has 3 inputs; expected 1"):
        mx.augw(g, control.ss([], [], [], np.ones((1, 3))))
    with pytest.raises(mv.ExportError, match="continuous"):
        mx.augw(mx.to_control(car(), dt=1e-3), 1.0)
    with pytest.raises(mv.ExportError, match="nmeas = 2, ncon = 1; the plant has 2 outputs"):
        mx.hinfsyn(mx.augw(g, 1.0), 2, 1)
    monkeypatch.setitem(sys.modules, "ctrlsys", None)
    for design in (lambda: mx.hinfsyn(mx.augw(g, 1.0), 1, 1), lambda: mx.mixsyn(g, 1.0)):
        with pytest.raises(mv.ExportError, match=r'pip install "mbsvib\[ctrlsys\]"'):
            design()


def test_mixed_sensitivity():
    pytest.importorskip("ctrlsys", reason="ctrlsys is not installed: pip install 'mbsvib[ctrlsys]'")
    g, (w1, w2, w3) = one(), weights()
    w3 = control.tf([1.0, 1.0], [0.01, 100.0])
    k, loop, (least, rcond) = mx.mixsyn(g, w1, w2, w3)
    assert (k.input_labels, k.output_labels) == (["travel"], ["actuator"])
    assert loop.output_labels == ["w1:travel", "w2:actuator", "w3:travel"]
    assert loop.input_labels == ["r:travel"]
    assert len(rcond) == 4
    assert loop.poles().real.max() < 0
    assert norm(loop) == pytest.approx(least, rel=1e-6)
    s = 1j * np.geomspace(1e-3, 1e5, 2000)
    sensitivity = 1.0 / (1.0 + g(s) * k(s))
    stacked = np.abs([w1(s) * sensitivity, w2 * k(s) * sensitivity, w3(s) * g(s) * k(s) * sensitivity])
    assert np.linalg.norm(stacked, axis=0).max() == pytest.approx(least, rel=1e-3)
    closed = car().feedback(-k)
    assert closed.stable
    truth = closed.frequency_response(np.abs(s[::100]), "travel", "actuator")[0, 0]
    np.testing.assert_allclose(truth, (g(s) * sensitivity)[::100], rtol=1e-6)


def test_controllers_of_a_generalized_plant():
    """x' = w1 + u, z = (x, u), y = x + w2: least norm sqrt(2); the H2 controller has the pole -2."""
    pytest.importorskip("ctrlsys", reason="ctrlsys is not installed: pip install 'mbsvib[ctrlsys]'")
    plant = control.ss([[0.0]], [[1.0, 0, 1]], [[1.0], [0], [1]], [[0.0, 0, 0], [0, 0, 1], [0, 1, 0]], name="cart",
                       inputs=["d", "n", "u"], outputs=["x", "effort", "y"], states=["position"])  # fmt: skip
    k, loop, least, _ = mx.hinfsyn(plant, 1, 1)
    assert np.sqrt(2) <= least < 1.01 * np.sqrt(2)
    assert norm(loop) == pytest.approx(least, rel=1e-6)
    assert (k.input_labels, k.output_labels, k.name) == (["y"], ["u"], "cart_controller")
    assert (loop.input_labels, loop.output_labels) == (["d", "n"], ["x", "effort"])
    assert loop.state_labels == ["position", "controller1"]
    assert isinstance(loop["x", "d"], NamedStateSpace)
    h2 = mx.h2syn(plant, 1, 1)
    assert h2.poles() == pytest.approx([-2])
    closed = mv.StateSpace.from_control(NamedStateSpace.of(plant).lft(h2))
    # trace of the control and the filter cost, both Riccati solutions are 1
    assert closed.h2_norm().value == pytest.approx(np.sqrt(2), rel=1e-9)
