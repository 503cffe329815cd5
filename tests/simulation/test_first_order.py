"""Runs of motions without inertia that dampers resist: currents of coils, charges of piezo stacks, massless nodes."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.linalg import expm

import mbsvib as mv

M, K, C, T, R, L = 2.0, 4e3, 6.0, 12.0, 3.5, 0.05
TIME = np.linspace(0.0, 0.3, 16)


def on_a_rail():
    model = mv.Model("rail")
    model.add_body("b", M, (1, 1, 1))
    model.add_joint("j", "prismatic", "ground", "b", axis=(0, 0, 1))
    model.add_spring("k", "ground", "b", (0, 0, -1), (0, 0, 0), K, C)
    return model


def states(matrix, start, constant):
    """x' = A x + b over the times."""
    wide = np.zeros((len(matrix) + 1,) * 2)
    wide[:-1, :-1], wide[:-1, -1] = matrix, constant
    return np.array([(expm(wide * t) @ [*start, 1.0])[:-1] for t in TIME]).T


def test_the_current_of_a_coil_and_the_energy_it_takes():
    """m x'' + c x' + k x = T i, L i' + R i = u - T x', from a step of the voltage, and a free coil that is released."""
    model = on_a_rail()
    model.add_voice_coil("a", "ground", "b", (0, 0, -0.5), (0, 0, 0), T, R, L)
    model.add_output("x", "b", "z")
    model.add_output("v", "b", "z", quantity="velocity")
    model.add_force_output("f", "a.resistance", "z")
    A = np.array([[0, 1, 0], [-K / M, -C / M, T / M], [0, -T / L, -R / L]])
    x, v, i = states(A, np.zeros(3), [0.0, 0.0, 9.0 / L])
    run = model.simulate(TIME, {"a.voltage": 9.0})
    flux = run.coordinates["a.flux.z"]
    np.testing.assert_allclose(run["x"], x, atol=1e-7 * np.abs(x).max())
    np.testing.assert_allclose(run["v"], v, atol=1e-7 * np.abs(v).max())
    np.testing.assert_allclose(-T * flux, L * i + T * x, atol=1e-7 * T * np.abs(flux).max())
    # back-EMF and driving voltage are in parallel: T (u - R i) / R is the force of the damper T^2 / R
    np.testing.assert_allclose(run["f"], T * (9.0 - R * i) / R, atol=1e-6 * T * 9.0 / R)
    stored = 0.5 * M * v**2 + 0.5 * K * x**2 + 0.5 * L * i**2
    np.testing.assert_allclose(run.energy.total, stored, atol=1e-6 * stored.max())
    given, taken = run.energy.supplied, run.energy.dissipated
    np.testing.assert_allclose(run.energy.total + taken, given, atol=1e-6 * given.max())
    x, v, i = states(A, [0.01, 0.0, -T * 0.01 / L], np.zeros(3))
    run = model.simulate(TIME, initial={"j.z": 0.01})
    np.testing.assert_allclose(run["x"], x, atol=1e-9)
    np.testing.assert_allclose(run.energy.total + run.energy.dissipated, run.energy.total[0], rtol=1e-7)
    with pytest.raises(mv.ModelError, match=r"initial\['a.flux.z'\].*displacement alone: without inertia"):
        model.simulate(TIME, initial={"a.flux.z": (0.0, 1.0)})


@pytest.mark.slow
def test_the_charge_of_a_piezo_stack_with_a_resistance():
    """F = T v - k x, Q = T x + C v, v = u - R Q'."""
    k, constant, blocked, ohm = 8e3, 3.0, 4e-3, 2.0
    model = on_a_rail()
    model.add_piezo_stack("a", "ground", "b", (0, 0, -0.1), (0, 0, 0), k, constant, blocked + constant**2 / k, ohm)
    model.add_output("x", "b", "z")
    A = np.array([[0, 1, 0], [-(K + k + constant**2 / blocked) / M, -C / M, constant / blocked / M],
                  [constant / blocked / ohm, 0, -1 / blocked / ohm]])  # fmt: skip
    x, _, charge = states(A, np.zeros(3), [0.0, 0.0, 5.0 / ohm])
    run = model.simulate(TIME, {"a.voltage": 5.0})
    np.testing.assert_allclose(run["x"], x, atol=1e-7 * np.abs(x).max())
    np.testing.assert_allclose(-constant * run.coordinates["a.flow.z"], charge, atol=1e-7 * np.abs(charge).max())


@pytest.mark.slow
def test_nodes_in_a_row_between_dampers():
    """Two points without mass, three dampers and two springs: D y' = -K y + the motion of the mass at their end."""
    model = on_a_rail()
    for k in (1, 2):
        model.add_body(f"n{k}", 0.0, (0, 0, 0), position=(0, 0, -0.3 * k))
        model.add_joint(f"s{k}", "prismatic", "ground", f"n{k}", position=(0, 0, 0), axis=(0, 0, 1))
    ends = (("b", 0.0), ("n1", -0.3), ("n2", -0.6), ("ground", -1.0))
    d, e = (30.0, 50.0, 20.0), (900.0, 0.0, 500.0)
    for k, ((one, top), (other, low)) in enumerate(pairwise(ends)):
        model.add_spring(f"d{k}", other, one, (0, 0, low), (0, 0, top), e[k], d[k])
    model.add_output("x", "b", "z")

    def chain(c):
        return np.array([[c[0], -c[0], 0], [-c[0], c[0] + c[1], -c[1]], [0, -c[1], c[1] + c[2]]])

    damping, stiffness = chain(d), chain(e)
    damping[0, 0] += C
    stiffness[0, 0] += K
    # M v' = -D_00 v - D_0n y' - K_0 x; D_nn y' = -D_n0 v - K_n x
    inner = np.linalg.inv(damping[1:, 1:])
    y_x, y_v = -inner @ stiffness[1:], -inner @ damping[1:, 0]
    A = np.zeros((4, 4))  # x, y1, y2, v
    A[0, 3], A[1:3, :3], A[1:3, 3] = 1.0, y_x, y_v
    A[3, :3] = (-stiffness[0] - damping[0, 1:] @ y_x) / M
    A[3, 3] = (-damping[0, 0] - damping[0, 1:] @ y_v) / M
    x = states(A, [0.02, 0.01, 0.0, 0.3], np.zeros(4))
    run = model.simulate(TIME, initial={"j.z": (0.02, 0.3), "s1.z": 0.01})
    np.testing.assert_allclose(run["x"], x[0], atol=1e-8)
    np.testing.assert_allclose(run.coordinates["s2.z"], x[2], atol=1e-8)
    np.testing.assert_allclose(run.energy.total + run.energy.dissipated, run.energy.total[0], rtol=1e-7)


@pytest.mark.slow
def test_a_coil_on_a_linkage_follows_the_linear_model():
    """Currents of two coils, of which one is at a body that a closed loop moves, in small motion about equilibrium."""
    model = mv.library.four_bar().equilibrium()
    point = np.array(model.bodies["coupler"].position)
    model.add_voice_coil("a", "ground", "coupler", point - (0, 0, 0.3), point, 40.0, R, L)
    model.add_voice_coil("b", "ground", "rocker", (1.4, 0, 0.3), model.bodies["rocker"].position, -25.0, R, 2.0 * L)
    inputs = {"a.voltage": lambda t: 1e-3 * np.sin(9.0 * t), "b.voltage": lambda t: 1e-3 * np.cos(5.0 * t)}
    run = model.simulate(TIME, inputs)
    system = model.linearize()
    fine = np.linspace(0.0, TIME[-1], 3001)
    expected = system.time_response(fine, [u(fine) for u in inputs.values()], inputs=list(inputs))[:, ::200]
    row = system.outputs.index("crank")
    np.testing.assert_allclose(run["crank"], expected[row], atol=1e-3 * np.abs(expected[row]).max())
