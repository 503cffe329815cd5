"""Aligned models elsewhere: equilibria, families of poses and runs of a planar loop whose axes are tilted by little."""

import numpy as np
import pytest

from tests.equations.tilted import four_bar


@pytest.fixture(params=[1e-6, 1e-4])
def pair(request):
    """The loop with tilted axes, aligned, and the one that is meant; both with the size of the tilt."""
    return four_bar(request.param).aligned(1e-3), four_bar(0.0), request.param


def weighed(model):
    return model.with_parts(gravity=(0, -9.81, 0))


def test_equilibria_are_those_of_the_planar_loop(pair):
    tilted, planar = (weighed(model).equilibrium() for model in pair[:2])
    tilt = pair[2]
    for name, body in planar.bodies.items():
        np.testing.assert_allclose(tilted.bodies[name].position, body.position, atol=3.0 * tilt)
    np.testing.assert_allclose(tilted.linearize().modes().frequencies, planar.linearize().modes().frequencies,
                               rtol=3.0 * tilt)


def test_families_of_poses_are_those_of_the_planar_loop(pair):
    tilted, planar, tilt = pair
    name = planar.linearize().coordinates[0]
    values = {name: np.linspace(-0.2, 0.2, 3)}
    ours, expected = (model.family(values, independent=[name]) for model in (tilted, planar))
    np.testing.assert_allclose(ours.frequencies, expected.frequencies, rtol=3.0 * tilt)


@pytest.mark.slow
def test_runs_are_those_of_the_planar_loop(pair):
    tilted, planar, tilt = pair
    t, runs = np.linspace(0.0, 0.3, 7), []
    for model in (tilted, planar):
        falling = weighed(model)
        falling.add_output("turn", "crank", "rz")
        runs.append(falling.simulate(t, tolerance=1e-9)["turn"])
    np.testing.assert_allclose(runs[0], runs[1], atol=10.0 * tilt * np.abs(runs[1]).max())
