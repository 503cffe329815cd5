"""CasADi functions of the pose: those of the systems there, with derivatives."""

import numpy as np
import pytest

import mbsvib as mv
import mbsvib_export as mx
from mbsvib.equations.matrices import MATRICES

casadi = pytest.importorskip("casadi")
BOX = {"leg1.slide.z": [-3e-3, 3e-3], "leg4.slide.z": [-2e-3, 4e-3]}


def lpv_system():
    return mv.library.stewart(ports=["platform", "base"]).family(BOX, grid=True).interpolated(1e-4)


@pytest.mark.slow
def test_functions_of_the_pose_are_those_of_the_system_there():
    lpv, pose = lpv_system(), np.array([1e-3, -1.5e-3])
    outputs, inputs = ["z", "platform.ax", "rx"], ["Fz", "ax"]
    model = mx.to_casadi(lpv, step=1e-5, outputs=outputs, inputs=inputs)
    assert (model.parameters, model.parameter_units, model.inputs) == (lpv.names, ("m", "m"), tuple(inputs))
    np.testing.assert_allclose(model.values, [0.0, 1e-3], atol=1e-18)
    system = lpv.at(dict(zip(lpv.names, pose.tolist(), strict=True))).with_ports(outputs, inputs)
    for key, matrix in zip(MATRICES, model.matrices(pose), strict=True):
        wanted = getattr(system, key)
        np.testing.assert_allclose(np.array(matrix), wanted, rtol=0, atol=1e-12 * abs(wanted).max() + 1e-300)
    space = system.state_space()
    rng = np.random.default_rng(1)
    x, u = rng.normal(size=12), rng.normal(size=2)
    rates, y = (np.array(part).ravel() for part in model.rates(x, u, pose))
    np.testing.assert_allclose(rates, space.A @ x + space.B @ u, rtol=0, atol=1e-10 * abs(rates).max())
    np.testing.assert_allclose(y, space.C @ x + space.D @ u, rtol=0, atol=1e-10 * abs(y).max())
    after = np.array(model.step(x, u, pose)[0]).ravel()
    sampled = mx.to_casadi(system, step=1e-5)
    np.testing.assert_allclose(after, np.array(sampled.step(x, u, [])[0]).ravel(), rtol=0, atol=1e-9 * abs(after).max())


@pytest.mark.slow
def test_casadi_has_the_slopes_of_matrices():
    lpv = lpv_system()
    model, p = mx.to_casadi(lpv), casadi.MX.sym("p", 2)
    slope = casadi.Function("slope", [p], [casadi.jacobian(model.matrices(p)[2][0, 0], p)])
    at, step = np.array([5e-4, 1e-3]), 1e-6
    ends = [lpv.matrices(np.array([at + sign * step * row]))["K"][0, 0, 0] for row in np.eye(2) for sign in (1, -1)]
    wanted = [(ends[0] - ends[1]) / (2 * step), (ends[2] - ends[3]) / (2 * step)]
    np.testing.assert_allclose(np.array(slope(at)).ravel(), wanted, rtol=1e-6)


@pytest.mark.slow
def test_other_options_are_refused():
    for options in ({"parameters": "platform.mass"}, {"realization": "modal"}):
        with pytest.raises(mv.ExportError, match="an LPVSystem has its pose as parameters"):
            mx.to_casadi(lpv_system(), **options)
    with pytest.raises(mv.ResponseError, match="nothing"):
        mx.to_casadi(lpv_system(), outputs="nothing")
