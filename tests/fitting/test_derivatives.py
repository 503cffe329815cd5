"""Derivatives of all residuals against differences: channels, noise that outputs share, modes, geometry, a rotor."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.api.fitting import _problem
from mbsvib.fitting.data import conditioned
from mbsvib.fitting.problem import real_rows
from mbsvib.fitting.variables import variables
from tests.fitting.scenes import chain, measured
from tests.fitting.test_modes import MIXED, modes_of

OMEGA = 2 * np.pi * np.linspace(2.0, 60.0, 17)


def spinning():
    """A rotor on soft bearings: matrices without symmetry, a frame that is free to turn, outputs of acceleration."""
    model = mv.Model("rotor")
    model.add_body("shaft", 3.0, (0.2, 0.25, 0.15), position=(0.1, 0, 0.5))
    model.add_bushing("near", "ground", "shaft", (0, 0, 0.2), (1e5, 2e5, 3e5, 10, 10, 10), (20, 30, 40, 0.1, 0.1, 0.1))
    model.add_bushing("far", "ground", "shaft", (0, 0.1, 0.9), (2e5, 1e5, 2e5, 10, 10, 10), (30, 20, 40, 0.1, 0.1, 0.1))
    model.add_rotor("wheel", "shaft", axis=(0, 0, 1), speed=300.0, inertia=0.08)
    model.add_input("F", "shaft", "x", position=(0.1, 0.1, 0.9))
    model.add_input("G", "shaft", "y", position=(0.1, 0.1, 0.2))
    model.add_output("x", "shaft", "x", position=(0, 0.2, 0.9))
    model.add_output("a", "shaft", "y", position=(0, 0.2, 0.1), quantity="acceleration")
    model.add_force_output("f", "near", "x")
    return model


def springs():
    """A node without mass between two springs, whose displacement is fed through from a force that acts on it."""
    model = mv.Model("springs")
    model.add_body("node", 0.0, (0, 0, 0), position=(0, 0, 1.0))
    model.add_body("top", 2.0, (1, 1, 1), position=(0, 0, 2.0))
    for i, (body, below) in enumerate((("node", "ground"), ("top", "node"))):
        model.add_joint(f"rail_{body}", "prismatic", "ground", body, axis=(0, 0, 1))
        model.add_spring(f"k{i}", below, body, (0, 0, float(i)), (0, 0, i + 1.0), 1e4 * (i + 1.0))
        model.add_input(f"F{i}", body, "z")
        model.add_output(f"z{i}", body, "z")
    model.add_spring("damper", "ground", "top", (0, 1, 0), (0, 1, 2.0), damping=5.0)
    return model


def scene(kind):
    if kind == "rotor":
        model = spinning()
        data = measured(model, OMEGA, 0.02, 1)
        free = ["near.stiffness.*", "far.damping.y", "shaft.mass", "shaft.inertia.xx", "shaft.position.x",
                "near.position.z", "near.orientation.ry", "wheel.inertia"]  # fmt: skip
        return model, data, free, ()
    if kind == "springs":
        return springs(), measured(springs(), OMEGA, 0.02, 1), ["k*.stiffness", "damper.damping"], ()
    model = chain()
    if kind in ("modes", "quantities"):
        data = modes_of(model, (1, 0, 2))
        model = chain(quantities=MIXED) if kind == "quantities" else model
        return model, data, ["k*.stiffness", "k*.damping", "b*.mass"], ()
    data = measured(model, OMEGA, 0.02, 1)
    if kind == "shared":
        power = np.einsum("in,jn,ij->ijn", *[1e-6 * np.ones((3, 17))] * 2, np.eye(3) + 0.5)
        data = mv.Measurement(OMEGA, data.responses, data.outputs, data.inputs, covariance=power)
    return model, data, ["k*.stiffness", "k*.damping", "b*.mass"], ("gain", "delay", "lag")


@pytest.mark.few(3)
@pytest.mark.parametrize("far", [False, True])
@pytest.mark.parametrize("kind", ["chain", "shared", "modes", "quantities", "rotor", "springs"])
def test_derivatives_of_residuals(kind, far):
    model, data, free, channels = scene(kind)
    chosen = variables(model.parameters, free, (), {free[-1]: (1.0, 0.1)} if kind == "rotor" else None, None)
    problem = _problem(model, conditioned(data), chosen, channels)
    rng = np.random.default_rng(0)
    x = problem.variables.unknowns(problem.variables.start) + 0.05 * rng.standard_normal(len(problem.variables.start))
    x[len(chosen.names) :] = np.abs(x[len(chosen.names) :]) + 0.1  # lags are positive
    slopes = np.concatenate([real_rows(block)[0] for _, block in problem.blocks(x, far)], axis=1)
    step = 2e-4  # smaller ones leave 1e-6 of rounding in slopes that are small beside the residuals

    def residuals(at):
        return np.concatenate([np.ascontiguousarray(block.residual).reshape(-1).view(float)
                               for _, block in problem.blocks(at, far, slopes=False)])  # fmt: skip

    for k, row in enumerate(slopes):
        unit = step * np.eye(len(x))[k]
        near, wide = ((residuals(x + s * unit) - residuals(x - s * unit)) / (2.0 * s * step) for s in (1.0, 2.0))
        np.testing.assert_allclose(row, (4.0 * near - wide) / 3.0, atol=3e-7 * np.abs(row).max() + 1e-9,
                                   err_msg=problem.variables.names[k])  # fmt: skip


@pytest.mark.few(2)
@pytest.mark.parametrize("far", [False, True])
@pytest.mark.parametrize("kind", ["chain", "shared", "modes"])
def test_gradient_is_that_of_the_cost(kind, far):
    """Of the robust measure from afar too, with priors and the hold on starts, over lines in blocks."""
    model, data, free, channels = scene(kind)
    chosen = variables(model.parameters, free, (), {free[-1].replace("*", "1"): (1.1, 0.05)}, None)
    problem = _problem(model, conditioned([data, data]), chosen, channels)
    rng = np.random.default_rng(1)
    x = problem.variables.unknowns(problem.variables.start) + 0.2 * rng.standard_normal(len(problem.variables.start))
    x[len(chosen.names) :] = np.abs(x[len(chosen.names) :]) + 0.1
    sums = problem.sums(x, far)
    assert sums.cost == pytest.approx(problem.cost(x, far), rel=1e-12)
    step = 1e-5
    for k, slope in enumerate(sums.gradient):
        unit = step * np.eye(len(x))[k]
        found = (problem.cost(x + unit, far) - problem.cost(x - unit, far)) / (2.0 * step)
        assert found == pytest.approx(slope, rel=1e-4, abs=1e-5 * np.abs(sums.gradient).max()), k
    np.testing.assert_allclose(sums.normal, sums.normal.T, rtol=1e-9)


@pytest.mark.parametrize("quantity", ["displacement", "acceleration"])
def test_starts_of_channels_are_near_their_values(quantity):
    """Gains to 1 %, delays from one period before to five behind to a step, from responses of the model itself."""
    model, w = chain(), OMEGA
    gains, inner = np.array([2.0, -0.5, 3.0]), np.array([1.0, -4.0])
    delays = np.array([1e-3, -0.9, 4.7]) * [1.0, *[2.0 * np.pi / w.max()] * 2]  # of periods of the highest line
    channel = gains[:, None, None] * inner[:, None] * np.exp(-1j * delays[:, None, None] * w)
    data = measured(model, w, 0.0, 1, change=lambda w: channel * (-(w**2) if quantity == "acceleration" else 1.0))
    data = mv.Measurement(w, data.responses, data.outputs, data.inputs, quantity=quantity)
    chosen = variables(model.parameters, ["k0.stiffness"], (), None, None)
    problem = _problem(model, conditioned(data), chosen, ("gain", "delay"))
    (part,) = problem.data
    values = problem.variables.start
    started = part.started(problem.scenes[0](problem.variables.map @ values, None)[0], values)
    found = dict(zip(problem.variables.names, started, strict=True))
    step = 0.05 * 2.0 * np.pi / w.max()
    for name, gain, delay in zip(("z0", "z1", "z2"), gains, delays, strict=True):
        assert found[f"{name}.gain"] == pytest.approx(gain, rel=0.01)
        assert found[f"{name}.delay"] == pytest.approx(delay, abs=0.51 * step)
    assert found["F0.gain"] == pytest.approx(-4.0, rel=0.01)
    assert found["k0.stiffness"] == pytest.approx(1e4, rel=1e-12)


def test_limits_stay_within_physics():
    """A trial that no body can have, such as an inertia beyond the sum of the others, is a step that is not taken."""
    model = spinning()
    data = measured(model, OMEGA, 0.01, 2)
    start = model.with_values({"shaft.inertia.xx": 0.38})
    fit = start.fit(data, ["shaft.inertia.xx", "near.stiffness.x"])
    assert fit.values["shaft.inertia.xx"] == pytest.approx(0.2, rel=0.05)
