"""Uncertain places and directions as polynomials: closed forms, equations linearized anew, what is refused."""

import numpy as np
import pytest

import mbsvib as mv
from tests.api.test_family import mirror_on_slide


def lever(stiffness=500.0, arm=0.5):
    """A bar on a hinge, held by a spring at a lever arm a: J q'' + c q' + k a^2 q = T."""
    model = mv.Model("lever", gravity=None)
    model.add_body("bar", 2.0, (0.1, 0.2, 0.3), (0, 0, 0))
    model.add_joint("hinge", "revolute", "ground", "bar", (0, 0, 0), axis=(0, 0, 1))
    model.add_spring("s", "ground", "bar", (arm, -1.0, 0), (arm, 0, 0), stiffness)
    model.add_torsion_spring("t", "ground", "bar", axis=(0, 0, 1), stiffness=1.0, damping=0.4)
    model.add_input("T", "bar", "rz")
    model.add_output("q", "bar", "rz")
    return model


def closed(plant, values, omega=3.0):
    """The upper linear fractional map at values of the parameters."""
    r, g = sum(plant.blocks.values()), plant.linear.frequency_response([omega])[:, :, 0]
    delta = np.diag(np.repeat([(values[b.name] - b.nominal) / b.half for b in plant.parameters],
                              list(plant.blocks.values())))  # fmt: skip
    return g[r:, r:] + g[r:, :r] @ delta @ np.linalg.solve(np.eye(r) - g[:r, :r] @ delta, g[:r, r:])


def test_powers_and_products_enter_as_often_as_their_hankel_matrices_have_rank():
    """k (e - s) of a spring along y whose ends move along x together: the lever's K is k times a polynomial."""
    system = lever().linearize()
    plant = system.uncertain({"s.end.x": (0.49, 0.52), "s.stiffness": 0.1}, order=3)
    assert plant.error < 3e-3
    assert plant.blocks == {"s.end.x": 4, "s.stiffness": 2}
    rng = np.random.default_rng(0)
    for _ in range(5):
        values = {name: rng.uniform(*limits) for name, limits in plant.limits.items()}
        there, nominal = (plant.at(at).frequency_response([3.0])[:, :, 0] for at in (values, {}))
        assert np.abs(closed(plant, values) - there).max() < plant.error * np.abs(there - nominal).max() * 10.0


def test_errors_fall_with_the_order_and_are_those_of_taylor():
    system = lever().linearize()
    errors = [system.uncertain({"s.end.x": (0.4, 0.6)}, order=order).error for order in (2, 3, 4)]
    assert errors[0] > 3.0 * errors[1] > 9.0 * errors[2] > 0.0


def test_affine_parameters_are_the_same_by_polynomials():
    system = lever().linearize()
    exact, fitted = (system.uncertain({"s.stiffness": 0.2}, order=order) for order in (1, 3))
    assert exact.blocks == fitted.blocks == {"s.stiffness": 1}
    assert (exact.error, fitted.error < 1e-9) == (0.0, True)
    values = {"s.stiffness": 430.0}
    np.testing.assert_allclose(closed(fitted, values), closed(exact, values), rtol=1e-9)


@pytest.mark.slow
def test_worst_gains_over_a_place_are_near_those_linearized_anew():
    plant = lever().linearize().uncertain({"s.end.x": (0.48, 0.52)}, order=2)
    worst = plant.worst_gain("q", "T")
    grid = [plant.at({"s.end.x": x}).hinf_norm("q", "T").value for x in np.linspace(0.48, 0.52, 21)]
    assert worst.lower == pytest.approx(max(grid), rel=1e-3)
    assert worst.lower <= worst.upper < 1.002 * worst.lower
    stable = plant.robust_stability()
    assert (stable.lower > 1.0, stable.upper) == (True, np.inf)
    assert "Polynomials: at sampled values off by up to" in str(plant)


def test_what_is_refused():
    system = lever().linearize()
    with pytest.raises(mv.ModelError, match="Give order=2 or more"):
        system.uncertain({"s.end.x": (0.48, 0.52)})
    with pytest.raises(mv.ModelError, match=r"order 2 miss the changes of 'lever' by .* a higher order"):
        system.uncertain({"s.end.x": (-0.6, 1.6)}, order=2)
    with pytest.raises(mv.ModelError, match="order = 0"):
        system.uncertain({"s.stiffness": 0.1}, order=0)


@pytest.mark.slow
@pytest.mark.parametrize("metre", [1.0, 1024.0])
def test_stated_errors_are_those_of_light_parts_too(metre):
    """The frequency of a mirror of 1e-6 kg m^2 on a slide of 100 kg that a stiff spring holds."""
    system = mirror_on_slide(metre).linearize()
    limits = {"wire.start.x": (-0.3 * metre, -0.1 * metre), "drive.stiffness": (9e6, 1.2e7)}
    plant = system.uncertain(limits, order=3)
    assert plant.error < 0.05
    rng, off, r = np.random.default_rng(0), 0.0, sum(plant.blocks.values())
    space = plant.linear.state_space()
    for _ in range(10):
        values = {name: rng.uniform(*pair) for name, pair in limits.items()}
        delta = np.diag(np.repeat([(values[b.name] - b.nominal) / b.half for b in plant.parameters],
                                  list(plant.blocks.values())))  # fmt: skip
        closing = np.linalg.solve(np.eye(r) - delta @ space.D[:r, :r], delta @ space.C[:r])
        found = np.sort(np.abs(np.linalg.eigvals(space.A + space.B[:, :r] @ closing)))[::2]
        off = max(off, np.abs(found / (2 * np.pi * plant.at(values).modes().frequencies) - 1.0).max())
    assert 1e-9 < off < 3.0 * plant.error
