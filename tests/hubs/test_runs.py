"""Runs on hubs: against those on a heavy body that a revolute joint lets turn, and against sums of inertia forces."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv

pytest.importorskip("casadi")
SPEED, CENTRE, AXIS = 4.0, (0.1, -0.2, 0.05), np.array((0.2, 0.3, 1.0)) / np.linalg.norm((0.2, 0.3, 1.0))


def on_carrier(hub, axis=AXIS, speed=SPEED):
    """A hub, or a body so heavy that it turns steadily when it is set to."""
    model = mv.Model("carrier")
    if hub:
        model.add_hub("hub", speed, axis, CENTRE)
    else:
        model.add_body("hub", 1e9, (1e9, 1e9, 1e9), CENTRE)
        model.add_joint("spin", "revolute", "ground", "hub", CENTRE, axis=axis)
    return model


def pair(hub, damping=0.5):
    """Two bodies on hinges, with a rotor and a spring back to the hub."""
    model = on_carrier(hub)
    model.add_body("a", 2.0, (0.02, 0.03, 0.04, 0.003, 0.002, 0.001), (0.6, 0.1, 0.0))
    model.add_joint("one", "revolute", "hub", "a", (0.4, 0, 0), axis=(0, 1, 0.3))
    model.add_body("b", 1.0, (0.01, 0.02, 0.03), (0.9, 0.2, 0.1))
    model.add_joint("two", "revolute", "a", "b", (0.7, 0.1, 0), axis=(0.1, 1, 0.2))
    model.add_spring("k", "hub", "b", (0.4, 0.3, 0.2), (0.9, 0.2, 0.1), 200.0, damping)
    model.add_rotor("r", "b", 30.0, (1, 0, 0), 0.01)
    return model


def same_runs(make, t, start=()):
    """Runs on a hub and on the heavy body, of which the joints move alike."""
    run, other = (make(hub).simulate(t, initial=dict(start) | ({} if hub else {"spin.rz": (0.0, SPEED)}),
                                     tolerance=1e-9) for hub in (True, False))  # fmt: skip
    for name, values in run.coordinates.items():
        expected = other.coordinates[name]
        assert_allclose(values, expected, atol=3e-7 * np.abs(expected).max(), err_msg=name)
    return run


@pytest.mark.slow
def test_runs_are_those_on_a_heavy_body():
    run = same_runs(pair, np.linspace(0.0, 0.4, 5), {"one.rz": (0.2, 1.0)})
    assert np.ptp(run.coordinates["two.rz"]) > 0.1


@pytest.mark.slow
def test_beams_bend_as_on_a_heavy_body():
    def blade(hub):
        model = on_carrier(hub, (0, 0, 1))
        model.add_body("root", 0.5, (1e-3, 1e-3, 1e-3), (0.2, 0, 0))
        model.add_joint("flap", "revolute", "hub", "root", (0.1, 0, 0), axis=(0, 1, 0))
        model.add_torsion_spring("k", "hub", "root", axis=(0, 1, 0), stiffness=20.0)
        model.add_beam("blade", "root", None, {"type": "circle", "radius": 0.006}, {"E": 7e9, "nu": 0.3, "rho": 2700},
                       (0.2, 0, 0), (0.6, 0.1, 0.05), elements=2, beta=1e-4)  # fmt: skip
        return model

    same_runs(blade, np.linspace(0.0, 0.02, 5))


@pytest.mark.slow
def test_the_energy_seen_from_the_hub_is_constant():
    """Jacobi's integral T2 + V - T0; -T0 is 0 as described."""
    energy = pair(True, 0.0).simulate(np.linspace(0.0, 0.4, 5), tolerance=1e-10).energy
    assert energy.total[0] == 0.0
    assert_allclose(energy.total, 0.0, atol=1e-8 * energy.kinetic.max())


def test_the_ground_carries_all_inertia_forces():
    """Force on the ground: -m (a + 2 W x v + W x (W x r)); linear equations refuse to tell."""
    model = on_carrier(True, (0, 0, 1))
    model.add_body("a", 2.0, (0.02, 0.03, 0.04), (0.1, -0.2, 0.1))
    model.add_joint("j", "planar", "hub", "a", (0.1, -0.2, 0.1))
    model.add_bushing("k", "hub", "a", (0.1, -0.2, 0.1), (40, 50, 60, 3, 4, 5))
    for name, quantity in (("r", "displacement"), ("v", "velocity"), ("a", "acceleration")):
        for d in "xy":
            model.add_output(name + d, "a", d, quantity=quantity)
    model.add_force_output("ground", "ground", "x")
    run = model.simulate(np.linspace(0.0, 1.0, 5), initial={"j.x": (0.02, 0.1)}, tolerance=1e-9)
    expected = -2.0 * (run["ax"] - 2.0 * SPEED * run["vy"] - SPEED**2 * run["rx"])
    assert_allclose(run["ground"], expected, atol=1e-7 * np.abs(expected).max())
    with pytest.raises(mv.ModelError, match="'ground': the sum of forces on the ground beside hub 'hub'"):
        model.linearize()


def test_superelements_are_refused_by_name():
    """Those that a hub carries; others do not turn."""
    model = on_carrier(True)
    stiffness = np.kron([[1.0, -1.0], [-1.0, 1.0]], np.eye(6))
    model.add_superelement("s", np.eye(12), None, stiffness, {"a": (0, 0, 0), "b": (0, 0, 0)}, {"a": "hub"})
    with pytest.raises(mv.ModelError, match="superelement 's' on hub 'hub'"):
        model.simulate(np.linspace(0.0, 1.0, 3))
    beside = model.replace("s", bodies={"a": "ground"})
    assert {f"s.b.{d}" for d in ("x", "y", "z", "rx", "ry", "rz")} <= set(beside.linearize().coordinates)
