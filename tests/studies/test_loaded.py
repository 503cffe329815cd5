"""Studies of loaded scenes: where a value shifts the equilibrium, the pose follows, and gradients with it."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import studies as st
from mbsvib.api.in_equilibrium import in_equilibrium


def crank():
    """An arm under gravity on a cord, at rest."""
    model = mv.Model("crank", gravity=(0, 0, -9.81))
    model.add_body("arm", 2.0, (0.02, 0.02, 0.02), position=(0.3, 0, 0))
    model.add_joint("hinge", "revolute", "ground", "arm", position=(0, 0, 0), axis=(0, 1, 0))
    model.add_spring("cord", "ground", "arm", (0.2, 0, 0.5), (0.4, 0, 0), 800.0, damping=3.0, free_length=0.45)
    return model.equilibrium()


def test_a_sweep_finds_the_pose_of_each_point():
    model, masses = crank(), [1.0, 2.0, 3.0]
    result = mv.sweep(model, {"arm.mass": masses}, of="modes.frequencies")["modes.frequencies"]
    single = [model.with_values({"arm.mass": m}).equilibrium().linearize().modes().frequencies for m in masses]
    assert np.allclose(result, single, rtol=1e-12)
    assert np.ptp(result) > 0.1


@pytest.mark.few(1)
@pytest.mark.parametrize("name", ["arm.mass", "cord.stiffness", "cord.free_length", "hinge.position.x", "cord.start.x",
                                  "arm.position.x", "cord.damping", "arm.inertia.yy", "gravity.z"])  # fmt: skip
def test_gradients_far_from_the_pose_described(name):
    """The arm turns by a third: numbers of the model as described are not those of the model at rest."""
    model = crank().with_values({"arm.mass": 3.0, "cord.free_length": 0.6})
    there, system = in_equilibrium(model)
    turned = np.array(there.bodies["arm"].orientation) @ np.array(model.bodies["arm"].orientation).T
    assert np.arccos((np.trace(turned) - 1) / 2) > 0.2
    value, h = model.parameters[name], 1e-4

    def at(change):
        return in_equilibrium(model.with_values({name: value + change}))[1].modes().eigenvalues

    expected = (8 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12 * h)
    assert np.allclose(system.eigenvalue_sensitivities(name)[0], expected, rtol=1e-7, atol=1e-9)


@pytest.mark.slow
def test_a_search_follows_the_equilibrium():
    """The mass and the cord that give 3.5 Hz with the arm level are found, and the model is handed back at rest."""
    model = crank()
    variables = {"cord.free_length": (0.3, 0.6), "arm.mass": (1.0, 4.0)}
    target = st.placement({1: 3.5})
    result = mv.optimize(model, variables, target)
    assert result.success
    system = result.model.linearize()
    assert system.modes().frequencies[0] == pytest.approx(3.5, rel=1e-6)
    system.reactions  # noqa: B018  # in balance


def test_followed_modes():
    tracks = mv.track(crank(), {"arm.mass": np.linspace(1.0, 3.0, 5)})
    assert len(tracks.modes) == 1
    assert (np.diff(tracks.mode(tracks.modes[0])) < 0).all()
