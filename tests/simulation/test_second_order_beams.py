"""Beams in finite motion whose slopes add to their strain: spinning blades, and beams between clamps."""

import numpy as np
import pytest
from scipy.optimize import curve_fit

import mbsvib as mv
from mbsvib.elements.beam_expansion import elastic_part

ALUMINIUM = {"E": 7e10, "nu": 0.3, "rho": 2700.0}
RADIUS = 5e-3
# rad/s, the unit of frequencies of a blade of 1 m: sqrt(EI / (rho A)) / L^2
UNIT = 0.5 * RADIUS * np.sqrt(ALUMINIUM["E"] / ALUMINIUM["rho"])


def blade(elements, **words):
    model = mv.Model("blade")
    model.add_body("hub", 1e4, (1e4, 1e4, 1e4))
    model.add_joint("shaft", "revolute", "ground", "hub", (0, 0, 0), axis=(0, 0, 1))
    model.add_beam("rod", "hub", None, {"type": "circle", "radius": RADIUS}, ALUMINIUM, start=(0, 0, 0),
                   end=(1, 0, 0), elements=elements, **words)  # fmt: skip
    model.add_input("F", f"rod.{elements}", "z")
    model.add_output("flap", f"rod.{elements}", "z", relative_to="hub")
    return model


def flapping(model, speed, end=0.25):
    """Frequency [1 / UNIT] at which the tip flaps after a small step of force, at a speed of the hub."""
    t = np.linspace(0.0, end, 126)
    flap = model.simulate(t, {"F": 1e-3}, initial={"shaft.rz": (0.0, speed * UNIT)}, tolerance=1e-6)["flap"]
    swing = lambda t, size, omega: size * (1.0 - np.cos(omega * t))  # noqa: E731
    (_, omega), _ = curve_fit(swing, t, flap, (0.5 * flap.max(), np.hypot(3.5, 1.05 * speed) * UNIT))
    return omega / UNIT


@pytest.mark.slow
@pytest.mark.parametrize(("speed", "exact"), [(3.0, 4.7973), pytest.param(6.0, 7.3604, marks=pytest.mark.slow)])
def test_a_spinning_blade_flaps_faster(speed, exact):
    """Source: Wright et al., J. Appl. Mech. 49 (1982), table of rotating uniform beams. The error falls with h^2."""
    errors = [flapping(blade(elements), speed) / exact - 1.0 for elements in (1, 2)]
    assert abs(errors[1]) < 0.02
    assert errors[1] / errors[0] < 0.25


@pytest.mark.slow
def test_spin_does_not_stiffen_a_linear_blade():
    assert flapping(blade(1, second_order=False), 3.0) == pytest.approx(3.53, rel=0.01)


def clamped(**words):
    model = mv.Model("clamped")
    model.add_beam("rod", "ground", "ground", {"type": "rectangle", "width": 0.02, "height": 0.004}, ALUMINIUM,
                   (0, 0, 0), (1, 0, 0), elements=4, **words)  # fmt: skip
    model.add_input("F", "rod.2", "z")
    model.add_output("w", "rod.2", "z")
    model.add_force_output("N", "rod.e1", "x")
    model.add_strain_output("top", "rod.e1")
    return model


@pytest.mark.slow
def test_a_run_settles_in_the_pose_of_equilibrium():
    """A beam between clamps under a sudden force, damped: sag, tension and strain are those of the bent beam."""
    model = clamped(beta=5e-3)
    run = model.simulate(np.linspace(0.0, 1.0, 3), {"F": 20.0}, tolerance=1e-7)
    loaded = model.with_parts(inputs={}, outputs={})
    loaded.add_load("P", "rod.2", (0, 0, 20.0))
    rod = loaded.equilibrium().beams["rod"]
    assert run["w"][-1] == pytest.approx(rod.points[2][2], rel=1e-5)
    part = elastic_part(rod)
    tension = -part.row_forces[0]
    assert run["N"][-1] == pytest.approx(tension, rel=1e-5)
    linear = clamped().linearize().frequency_response([0.0])[:, 0, 0].real * 20.0
    assert rod.points[2][2] < 0.8 * linear[0]
    bending = run["top"][-1] - tension / (rod.material.E * rod.properties.A)
    assert bending == pytest.approx(linear[2] * run["w"][-1] / linear[0], rel=0.2)


@pytest.mark.slow
def test_a_bent_beam_stays_in_balance():
    """Described as bent by a load, a beam has the tension of its slopes."""
    model = clamped()
    model.add_load("P", "rod.2", (0, 0, 20.0))
    run = model.equilibrium().simulate([0.0, 2e-3])
    np.testing.assert_allclose(run["w"], 0.0, atol=1e-14)


def test_energy_stays_in_a_beam_between_clamps():
    run = clamped().simulate(np.linspace(0.0, 0.02, 21), {"F": 20.0}, tolerance=1e-9)
    stored = run.energy.total
    np.testing.assert_allclose(stored - stored[0], 20.0 * run["w"], atol=1e-6 * np.abs(stored).max())


def test_nodes_are_measured_where_they_are():
    """The first node of a beam that nothing holds carries it; it stays on its hinge, the other turns."""
    model, turn = mv.Model("bar"), 0.3
    model.add_beam("bar", None, None, {"type": "rectangle", "width": 0.02, "height": 0.01},
                   {"E": 2.1e11, "nu": 0.3, "rho": 7800.0}, (0.3, 0.1, 0), (0.8, 0.1, 0), elements=1,
                   y_axis=(0, 0, 1))  # fmt: skip
    model.add_joint("hinge", "revolute", "ground", "bar.0", (0.3, 0.1, 0.05), axis=(0, 0, 1))
    for node in ("bar.0", "bar.1"):
        model.add_output(node, node, "y")
    run = model.simulate([0.0, 1e-6], initial={"hinge.rz": turn}, tolerance=1e-3)
    assert run["bar.0"][0] == pytest.approx(0.0, abs=1e-15)
    assert run["bar.1"][0] == pytest.approx(0.5 * np.sin(turn), rel=1e-12)
