"""Derivatives and uncertain parameters of systems with motions as inputs, against neighbouring models."""

import itertools

import numpy as np
import pytest

from mbsvib.errors import ResponseError
from tests.responses.test_driven import OMEGA, QUANTITIES, quarter


@pytest.mark.slow
@pytest.mark.parametrize("order", range(3))
def test_slopes_of_time_responses_and_norms_are_those_of_neighbours(order):
    model, outputs = quarter(QUANTITIES[order]), ["displacement", "velocity"]
    names = ["tyre.stiffness", "tyre.damping", "wheel.mass"]
    system, h = model.linearize(), 1e-4
    t, u = np.linspace(0.0, 1.0, 11), np.sin(np.arange(11.0))
    slopes = {hold: system[outputs, :].time_response_sensitivities(t, u, names, hold) for hold in ("zero", "first")}
    norms = {"hinf_norm": system.hinf_norm("velocity", "road", names)} if order < 2 else {}
    if order < 2:
        norms["h2_norm"] = system.h2_norm(["displacement", "acceleration"][order], "road", names)
    for k, name in enumerate(names):
        value = model.parameters[name]
        above, below = (model.with_values({name: value * (1.0 + sign * h)}).linearize() for sign in (1.0, -1.0))
        for hold, slope in slopes.items():
            change = np.subtract(*(side.time_response(t, u, hold, outputs=outputs) for side in (above, below)))
            np.testing.assert_allclose(slope[k], change / (2.0 * h * value), atol=1e-6 * np.abs(slope[k]).max())
        for key, norm in norms.items():
            ports = (["displacement", "acceleration"][order] if key == "h2_norm" else "velocity"), "road"
            change = getattr(above, key)(*ports, []).value - getattr(below, key)(*ports, []).value
            assert norm.slopes[k] == pytest.approx(change / (2.0 * h * value), rel=1e-5)
    assert len(system["displacement", :].time_response_sensitivities(t, u)) == len(system.parameters)
    with pytest.raises(ResponseError, match=r"time_response_sensitivities: initial"):
        system.time_response_sensitivities(t, u, names, initial=np.zeros(4))


@pytest.mark.parametrize("outputs", [["velocity", "acceleration"], "velocity"])
def test_slopes_of_peaks_of_several_inputs_and_outputs(outputs):
    """A force of the size at which both inputs matter; the singular vectors there are complex."""
    model = quarter("velocity")
    model.add_input("F", "body", (0, 0, 3e3, 0, 0, 0))
    names, h = ["strut.damping"], 1e-4
    norm = model.linearize().hinf_norm(outputs, None, names)
    assert norm.variables == tuple(names)
    for name, slope in zip(names, norm.slopes, strict=True):
        value = model.parameters[name]
        sides = (model.with_values({name: value * (1.0 + sign * h)}).linearize() for sign in (1.0, -1.0))
        above, below = (side.hinf_norm(outputs, None, []).value for side in sides)
        assert slope == pytest.approx((above - below) / (2.0 * h * value), rel=1e-5)


def test_the_h2_norm_of_what_gets_a_direct_part_grows_without_limit():
    """Without damping of the tyre the road does not act on the acceleration at once; with some it does."""
    norm = quarter(damping=0.0).linearize().h2_norm("acceleration", "road", ["tyre.damping", "tyre.stiffness"])
    assert norm.slopes[0] == np.inf
    assert np.isfinite(norm.slopes[1])


def test_norms_of_sparse_systems_with_motions_refuse_slopes_by_name():
    system = quarter("velocity").linearize(method="sparse")
    with pytest.raises(ResponseError, match=r"'quarter car' has sparse equations"):
        system.time_response_sensitivities([0.0, 1.0], [0.0, 1.0], ["tyre.stiffness"])
    with pytest.raises(ResponseError, match=r"method='dense'"):
        system.h2_norm("acceleration", "road", ["tyre.stiffness"])


@pytest.mark.slow
def test_uncertain_systems_with_motions_reach_the_worst_corner():
    limits = {"tyre.stiffness": 0.1, "tyre.damping": 0.2, "wheel.mass": 0.1}
    model = quarter("velocity")
    plant = model.linearize()["acceleration", :].uncertain(limits)
    assert plant.inputs == ("road",)
    corners = []
    for signs in itertools.product((-1.0, 1.0), repeat=3):
        values = {name: model.parameters[name] * (1.0 + sign * width)
                  for sign, (name, width) in zip(signs, limits.items(), strict=True)}
        corners.append(model.with_values(values).linearize().hinf_norm("acceleration", "road", []).value)
    worst = plant.worst_gain()
    assert worst.lower == pytest.approx(max(corners), rel=1e-6)
    assert worst.lower <= worst.upper <= 1.002 * worst.lower
    values = {"tyre.stiffness": 2.1e5, "wheel.mass": 38.0}
    np.testing.assert_allclose(plant.at(values).frequency_response(OMEGA),
                               model.with_values(values).linearize().frequency_response(OMEGA, "acceleration"),
                               rtol=1e-10)
    with pytest.raises(ResponseError, match=r"'tyre.damping.z' needs the derivative of input 'road'"):
        quarter().linearize()["displacement", :].uncertain({"tyre.damping": 0.1}).worst_gain()
